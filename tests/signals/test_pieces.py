"""A recording smoothed piece by piece is the recording smoothed as a whole, and its averages are counted once."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.recording import Recording
from casysid.robot import Robot
from casysid.signals import (
    build_smoother,
    joined_motions,
    longest_bridge,
    motion_from_recording,
    motion_pieces,
    piece_windows,
    window_reach,
)
from casysid.signals.averaging import SPACING
from casysid.signals.motion import LONGEST_BRIDGE
from casysid.signals.smoothing import Grid, memory

LAWS = settings(max_examples=25, deadline=None)
WHOLE = 1 << 40


def make_robot() -> Robot:
    """Two revolute joints without limits."""
    import pinocchio as pin

    model = pin.Model()
    for k in range(2):
        joint = model.addJoint(k, pin.JointModelRX(), pin.SE3.Identity(), f"joint{k}")
        model.appendBodyToJoint(joint, pin.Inertia(1.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    return Robot.from_pin(model)


ROBOT = make_robot()


@st.composite
def cases(draw: st.DrawFn) -> tuple[Recording, float]:
    """A recording with noise, jitter, holes and gaps, whose torque is late; and a cut-off."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    samples, rate = draw(st.integers(60, 3000)), draw(st.sampled_from([20.0, 1000.0]))
    cutoff = rate * draw(st.floats(0.01, 0.3))
    steps = (1.0 + draw(st.sampled_from([0.0, 0.3])) * rng.uniform(-1.0, 1.0, samples)) / rate
    for _ in range(draw(st.integers(0, 5))):
        steps[draw(st.integers(1, samples - 1))] = draw(st.floats(0.1, 2.0)) / cutoff
    time = draw(st.sampled_from([0.0, 1e5])) + np.cumsum(steps)
    phase = 2.0 * np.pi * cutoff * (time - time[0])[:, None] * rng.uniform(0.05, 0.6, 2)
    noise = draw(st.sampled_from([0.0, 1e-3])) * rng.normal(size=(samples, 2))
    recording = Recording(
        channels=ROBOT.channels,
        dofs=ROBOT.dofs,
        time=time,
        position=np.sin(phase + rng.uniform(0.0, 6.0, 2)) + noise,
        torque=rng.normal(size=(samples, 2)),
        torque_delay=draw(st.floats(-5.0, 5.0)) / rate,
    )
    return recording, cutoff


@LAWS
@given(cases(), st.integers(10, 900), st.floats(0.0, 3.0), st.booleans())
def test_motion_piece_by_piece_is_the_motion_of_the_whole(
    case: tuple[Recording, float], rows: int, window: float, late: bool
) -> None:
    recording, cutoff = case
    delays = np.array([0.0, 1.5 / recording.rate]) if late else None
    whole = list(motion_pieces(ROBOT, recording, cutoff, rows=WHOLE, delays=delays))
    parts = list(motion_pieces(ROBOT, recording, cutoff, rows=rows, window=window / cutoff, delays=delays))
    if not whole:
        assert not parts
        return
    wanted = joined_motions([piece.motion for piece in whole])
    for name in ("time", "q", "v", "a", "tau", "settled"):
        found = np.concatenate([getattr(piece.motion, name)[piece.core] for piece in parts])
        size = np.sqrt(np.mean(np.square(getattr(wanted, name)))) + 1e-300
        np.testing.assert_allclose(found, getattr(wanted, name), rtol=0.0, atol=1e-8 * size, err_msg=name)
    for piece in parts:
        assert (np.diff(piece.motion.time) <= longest_bridge(cutoff, recording.step)).all()
    if not late:
        np.testing.assert_array_equal(motion_from_recording(ROBOT, recording, cutoff).q, wanted.q)


@LAWS
@given(cases(), st.integers(10, 900), st.floats(0.2, 1.0))
def test_every_average_is_counted_once_and_with_all_its_samples(
    case: tuple[Recording, float], rows: int, lower: float
) -> None:
    recording, cutoff = case
    band = lower * cutoff / 2.0
    found, wanted = (
        [
            piece_windows(piece.motion.time, piece.own, piece.stretch, band, recording.rate)
            for piece in motion_pieces(ROBOT, recording, cutoff, rows=size, window=window_reach(band))
        ]
        for size in (rows, WHOLE)
    )
    middles = [np.concatenate([windows.middle for windows in parts] or [np.empty(0)]) for parts in (found, wanted)]
    np.testing.assert_array_equal(*middles)
    assert (np.diff(middles[0]) > 0.0).all()
    averages = []
    for size, parts in ((rows, found), (WHOLE, wanted)):
        motions = motion_pieces(ROBOT, recording, cutoff, rows=size, window=window_reach(band))
        averages.append([w.weights @ p.motion.tau for w, p in zip(parts, motions, strict=True)])
    if averages[1]:
        np.testing.assert_allclose(np.concatenate(averages[0]), np.concatenate(averages[1]), atol=1e-9)


def test_windows_are_cubic_splines_of_the_spacing_over_the_whole_stretch() -> None:
    time, band = np.arange(4000) / 1000.0, 5.0
    recording = Recording(
        channels=ROBOT.channels, dofs=ROBOT.dofs, time=time, position=np.zeros((4000, 2)), torque=np.zeros((4000, 2))
    )
    windows = piece_windows(time, (-np.inf, np.inf), recording.stretches()[0], band, 1000.0)
    weights = windows.weights.toarray()
    np.testing.assert_allclose(weights.sum(axis=1), 1.0)
    inner = slice(2, -2)
    np.testing.assert_allclose((weights @ time)[inner], windows.middle[inner], atol=1e-6)
    spacing = np.diff(windows.middle)
    np.testing.assert_allclose(spacing, spacing[0])
    assert spacing[0] <= SPACING / band
    gain = abs(weights[20] @ np.exp(2j * np.pi * band * time))
    assert gain == pytest.approx(np.sinc(band * spacing[0]) ** 4, rel=1e-3)


@pytest.mark.parametrize("derivative", [0, 1, 2])
def test_what_an_end_does_to_the_spline_falls_as_its_memory_says(derivative: int) -> None:
    rate, cutoff = 500.0, 5.0
    time = np.arange(4000) / rate
    values = np.random.default_rng(0).normal(size=len(time))
    grid = Grid(float(time[0]), float(time[-1]), 1.0 / rate)
    whole = build_smoother(time, cutoff, grid=grid).smooth(values, derivative)
    part = build_smoother(time[1000:], cutoff, grid=grid).smooth(values[1000:], derivative)
    error = np.abs(part - whole[1000:]) / np.sqrt(np.mean(whole**2))
    for tolerance in (1e-3, 1e-6, 1e-9):
        from_here = int(memory(cutoff, tolerance) * rate)
        assert error[:from_here].max() > tolerance / 10.0
        assert error[from_here:].max() < 10.0 * tolerance


def test_a_hole_that_is_bridged_costs_no_accuracy() -> None:
    rate, cutoff = 1000.0, 4.0
    time = np.arange(5000) / rate
    middle = 2.5
    kept = np.abs(time - middle) > 0.49 * LONGEST_BRIDGE / cutoff
    omega = 2.0 * np.pi * cutoff / 4.0
    position = np.stack([np.sin(omega * time), np.cos(omega * time)], axis=1)
    recording, whole = (
        Recording(
            channels=ROBOT.channels, dofs=ROBOT.dofs, time=time[rows], position=position[rows], torque=position[rows]
        )
        for rows in (kept, slice(None))
    )
    assert len(recording.stretches()) == 2
    assert len(recording.stretches(longest_bridge(cutoff, recording.step))) == 1
    found, wanted = (motion_from_recording(ROBOT, one, cutoff) for one in (recording, whole))
    for name in ("q", "v", "a"):
        wave = getattr(wanted, name)[kept]
        assert np.abs(getattr(found, name) - wave).max() < 2e-2 * np.abs(wave).max(), name
