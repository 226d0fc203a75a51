"""What is held is found: with recordings of the empty robot, by the file alone, several at once, and weighed."""

import dataclasses

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings

from casysid.errors import ParameterError, RecordingError
from casysid.identification import Settings
from casysid.inertia import inertial_parameters, is_consistent
from casysid.moments import Moments
from casysid.payload import identify_payload
from casysid.payload.columns import Loading, joint_moments
from casysid.payload.frames import holding_frame
from casysid.simulation import PD, ComputedTorque, ControlModel, Plant, PlantSettings, design_sinusoids, simulate
from tests.simulated import bundled_robot
from tests.strategies import generators, random_inertia, random_placement

ARM = bundled_robot("two_link.urdf")
PLAIN = Settings(choose_friction=False)
MASS, CENTRE = 0.8, np.array([0.05, -0.03, 0.0])
BODY = inertial_parameters(MASS, CENTRE, np.diag([2e-3, 3e-3, 4e-3]))
OTHER = inertial_parameters(0.4, [-0.04, 0.06, 0.0], np.diag([1e-3, 1e-3, 1e-3]))


def recorded(body, seed, duration=12.0):
    theta = ARM.inertial_parameters.copy()
    theta[-10:] += body
    robot = ARM.with_parameters(inertial_parameters=theta)
    plant = Plant(robot, PlantSettings())
    control = ComputedTorque(ControlModel.from_robot(robot, plant.parameters), PD.tuned(robot, plant.parameters))
    motion = design_sinusoids(robot, duration=duration, seed=seed)
    return simulate(plant, control, motion, rate=500.0, duration=duration, seed=seed).recording


@pytest.fixture(scope="module")
def empty():
    return recorded(np.zeros(10), 1)


@pytest.fixture(scope="module")
def held():
    return recorded(BODY, 2)


def assert_found(payload, mass, centre):
    """Mass and the two coordinates that a planar arm shows, within their intervals and near."""
    low, high = payload.uncertainty.link_interval()
    wanted = np.array([mass, *centre[:2]])
    assert (low[0, :3] <= wanted).all()
    assert (wanted <= high[0, :3]).all()
    assert abs(payload.mass / mass - 1.0) < 0.03
    assert np.abs(payload.center_of_mass[:2] - centre[:2]).max() < 0.006
    assert is_consistent(payload.parameters)


def test_the_file_need_not_be_true_where_the_empty_robot_was_recorded(empty, held):
    wrong = ARM.with_parameters(inertial_parameters=1.4 * ARM.inertial_parameters)
    result = identify_payload(wrong, held, empty, settings=PLAIN)
    (payload,) = result.payloads
    assert_found(payload, MASS, CENTRE)
    assert payload.torque_error[1] < 0.3 * payload.torque_error[0]
    assert not np.isfinite(payload.center_of_mass_std[2])  # no torque of a planar arm depends on it
    assert result.reference == "1 recordings without payload"


def test_a_true_file_needs_no_empty_robot(held):
    assert_found(identify_payload(ARM, held, settings=PLAIN)["payload"], MASS, CENTRE)


def test_several_payloads_at_once_and_each_its_own(empty, held):
    both = identify_payload(ARM, {"box": held, "tool": [recorded(OTHER, 3)]}, [empty], settings=PLAIN)
    assert [one.name for one in both.payloads] == ["box", "tool"]
    assert_found(both["box"], MASS, CENTRE)
    assert_found(both["tool"], 0.4, np.array([-0.04, 0.06, 0.0]))


def test_a_weighed_payload_tells_the_scale_of_torques(empty, held):
    doubled = [dataclasses.replace(one, torque=1.3 * one.torque) for one in (held, empty)]
    (payload,) = identify_payload(ARM, doubled[0], doubled[1], known_mass=MASS, settings=PLAIN).payloads
    assert payload.mass == pytest.approx(MASS, rel=1e-6)
    assert payload.mass_std == pytest.approx(0.0, abs=1e-6)
    scale = payload.torque_scale
    assert abs(scale.value - 1.3) < min(3.0 * scale.std, 0.04)
    assert np.abs(payload.center_of_mass[:2] - CENTRE[:2]).max() < 0.006
    assert is_consistent(payload.parameters)


def test_nothing_held_is_found_to_be_nothing(empty):
    (payload,) = identify_payload(ARM, recorded(np.zeros(10), 5), empty, settings=PLAIN).payloads
    low, high = payload.mass_interval
    assert low <= 0.0 <= high
    assert high < 0.2


@settings(max_examples=10)
@given(generators())
def test_common_columns_are_those_of_the_rows_written_out(rng):
    """Beside the moments: rows of both loadings stacked with their columns in place."""
    p, link, own = 14, np.arange(10), np.arange(14) >= 11
    transform = rng.normal(size=(10, 10))
    x = [rng.normal(size=(30, p)) for _ in range(3)]
    y = [rng.normal(size=30) for _ in range(3)]
    names = [f"x{k}" for k in range(p)]
    made = [Moments.from_rows(a, b, columns=names, blocks=2) for a, b in zip(x, y, strict=True)]
    loadings = [Loading("", made[0]), Loading("a", made[1]), Loading("b", made[2])]
    got = joint_moments(loadings, link, own, transform)
    zero3, zero10 = np.zeros((30, 3)), np.zeros((30, 10))
    shared = [one * ~own for one in x]
    rows = [
        np.hstack([x[0], zero3, zero3, zero10, zero10]),
        np.hstack([shared[1], x[1][:, own], zero3, x[1][:, :10] @ transform, zero10]),
        np.hstack([shared[2], zero3, x[2][:, own], zero10, x[2][:, :10] @ transform]),
    ]
    wanted = Moments.from_rows(np.vstack(rows), np.concatenate(y), blocks=6)
    np.testing.assert_allclose(got.gram, wanted.gram, atol=1e-10)
    assert got.columns[-20:-18] == ("a.m", "a.mcx")


@settings(max_examples=10)
@given(generators())
def test_a_frame_moves_a_body_as_pinocchio_does(rng):
    model, place, body = ARM.model.copy(), random_placement(rng), random_inertia(rng)
    model.addFrame(pin.Frame("flange", 2, 0, place, pin.FrameType.OP_FRAME))
    frame = holding_frame(dataclasses.replace(ARM, model=model), "flange")
    np.testing.assert_array_equal(frame.columns, np.arange(10, 20))
    np.testing.assert_allclose(
        frame.to_link @ body.toDynamicParameters(), place.act(body).toDynamicParameters(), atol=1e-12
    )


def test_what_makes_no_sense_is_refused(held):
    with pytest.raises(ParameterError, match="ends in left_eye, right_eye"):
        holding_frame(bundled_robot("head.urdf"), None)
    with pytest.raises(ParameterError, match=r"no moving link or frame called 'x'.*upper_link"):
        holding_frame(ARM, "x")
    with pytest.raises(RecordingError, match="at least one recording"):
        identify_payload(ARM, [])
    with pytest.raises(RecordingError, match="'tool' is needed"):
        identify_payload(ARM, {"box": held, "tool": []})
    for mass in (0.0, -1.0, float("nan")):
        with pytest.raises(ParameterError, match="positive number of kg"):
            identify_payload(ARM, held, known_mass=mass)
    with pytest.raises(ParameterError, match="only payload"):
        identify_payload(ARM, held, known_mass={"box": 1.0})
