import warnings

import pytest

from casysid.errors import CasysidWarning
from casysid.robot import Robot
from tests.robot.mjcf_models import INERTIAL, model
from tests.robot.urdf_models import ARM

SPRUNG = model(f'<body name="a"><joint name="j" stiffness="1"/>{INERTIAL}</body>')


@pytest.mark.parametrize(("text", "kind"), [(ARM.replace('value="2.0"', 'value="-2"'), "urdf"), (SPRUNG, "mjcf")])
def test_a_file_is_told_by_its_contents_and_warnings_point_at_the_caller(text, kind, tmp_path):
    path = tmp_path / "robot.txt"
    path.write_text(text)
    for read in (Robot.from_file, getattr(Robot, f"from_{kind}")):
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            robot = read(path)
        assert robot.source_format == kind
        assert [(warning.category, warning.filename) for warning in caught] == [(CasysidWarning, __file__)]
