"""A result goes to another process and comes back."""

import json
import pickle

import numpy as np
import pytest

from casysid.estimation import WeightedLeastSquares
from casysid.identification import Settings, identify
from casysid.identification.output import write_result
from casysid.simulation import PlantSettings
from tests.simulated import bundled_robot, simulated_run


def flat(value, place=()):
    """Nested content by place."""
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else None
    if items is None:
        return {place: value}
    return {key: leaf for name, one in items for key, leaf in flat(one, (*place, name)).items()}


def test_a_result_is_the_same_after_a_journey(tmp_path):
    recording = simulated_run("two_link.urdf", 0, PlantSettings()).recording
    settings = Settings(method=WeightedLeastSquares(), cutoff=12.0, choose_friction=False)
    result = identify(bundled_robot("two_link.urdf"), recording, settings)
    back = pickle.loads(pickle.dumps(result))
    np.testing.assert_array_equal(back.parameters, result.parameters)
    motion = result.train_motions[0]
    torques = (one.regressor.predict(one.parameters, motion.q, motion.v, motion.a) for one in (result, back))
    np.testing.assert_allclose(*torques, rtol=1e-12)
    with pytest.raises(TypeError):
        back.estimate.diagnostics["x"] = 1.0
    for name, one in (("there", result), ("back", back)):
        (tmp_path / name).mkdir()
        write_result(one, tmp_path / name)
    there, back = (flat(json.loads((tmp_path / name / "result.json").read_text())) for name in ("there", "back"))
    assert there.keys() == back.keys()
    for place, value in there.items():
        wanted = pytest.approx(value, rel=1e-8, nan_ok=True) if isinstance(value, float) else value
        assert back[place] == wanted, place  # sums of matrices laid out otherwise
