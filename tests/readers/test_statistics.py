"""Figures of a log do not depend on the batches in which it comes."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.readers.statistics import MOST_MARKS, Statistics
from casysid.readers.steps import RandomSample, StepStatistics
from casysid.readers.weaknesses import find_weaknesses
from casysid.recording import Recording
from casysid.robot import Robot


def log(samples: int, seed: int) -> Recording:
    """Of the arm: jitter, a gap, a wheel whose angle wraps, a glitch, a stuck torque, a late velocity."""
    rng = np.random.default_rng(seed)
    steps = 0.01 * rng.uniform(0.7, 1.3, samples)
    steps[samples // 3] = 2.0
    time = np.cumsum(steps)
    omega = np.array([3.0, 2.0, 0.0, 4.0])
    position = np.array([1.0, 1.5, 0.0, 0.3]) * np.sin(omega * time[:, None])
    velocity = omega * np.array([1.0, 1.5, 0.0, 0.3]) * np.cos(omega * time[:, None])
    position[:, 2] = (2.0 * time + np.pi) % (2.0 * np.pi) - np.pi
    velocity[:, 2] = 2.0
    velocity[:, 1] *= -1.0
    position[samples // 2, 0] += 1.0
    torque = rng.normal(size=(samples, 4))
    torque[:, 3] = 1.5
    names = ("shoulder", "elbow", "wheel", "slide")
    return Recording(channels=names, dofs=names, time=time, position=position, velocity=velocity, torque=torque)


def gathered(recording: Recording, robot: Robot, rows: int) -> Statistics:
    statistics = Statistics(robot, "log")
    for batch in recording.batches(rows):
        statistics.add(batch)
    return statistics


@settings(max_examples=15, deadline=None)
@given(st.integers(60, 4000), st.integers(7, 3000), st.integers(0, 2**32 - 1))
def test_warnings_and_figures_are_the_same_in_any_batches(arm: Robot, samples: int, rows: int, seed: int) -> None:
    recording = log(samples, seed)
    one, many = gathered(recording, arm, samples), gathered(recording, arm, rows)
    assert find_weaknesses(one, arm) == find_weaknesses(many, arm)
    assert len(find_weaknesses(one, arm)) >= 4
    np.testing.assert_array_equal(one.unwrapped, many.unwrapped)
    a, b = one.facts(), many.facts()
    for name in ("samples", "start", "stop", "step", "rate"):
        assert getattr(a, name) == getattr(b, name), name
    for name in ("position_range", "torque_peak", "mark_rows", "mark_times"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name), err_msg=name)
    np.testing.assert_allclose(a.torque_rms, np.sqrt(np.mean(recording.torque**2, axis=0)))
    np.testing.assert_allclose(b.torque_rms, a.torque_rms)


def test_marks_are_few_and_evenly_apart_in_a_long_log(arm: Robot) -> None:
    facts = gathered(log(40_000, 1), arm, 5000).facts()
    assert MOST_MARKS <= len(facts.mark_rows) <= 2 * MOST_MARKS
    assert len(set(np.diff(facts.mark_rows))) == 1


@pytest.mark.parametrize("joint", [0, 1, 2, 3])
@pytest.mark.parametrize("samples", [2000, 50_000])
def test_travel_agrees_with_the_integral_of_velocity_at_any_length(arm: Robot, joint: int, samples: int) -> None:
    statistics = gathered(log(samples, 2), arm, 7000)
    ratio, correlation = statistics.travel_over_integral(arm.joints[joint], unwrapped=True)
    assert (ratio, correlation) == pytest.approx((-1.0, -1.0) if joint == 1 else (1.0, 1.0), abs=0.05)


@settings(max_examples=20, deadline=None)
@given(st.integers(1, 5000), st.integers(1, 700), st.integers(10, 400))
def test_a_random_sample_is_the_same_in_any_parts(count: int, rows: int, size: int) -> None:
    values = np.arange(count, dtype=np.float64)
    one, many = RandomSample(size), RandomSample(size)
    one.add(values)
    for first in range(0, count, rows):
        many.add(values[first : first + rows])
    np.testing.assert_array_equal(one.values, many.values)
    assert len(one.values) <= size
    if count <= size:
        np.testing.assert_array_equal(one.values, values)


def test_quantiles_of_a_long_log_are_those_of_all_steps() -> None:
    rng = np.random.default_rng(3)
    steps = 1e-3 * (1.0 + 0.3 * rng.uniform(-1.0, 1.0, 600_000) + 0.4 * (np.arange(600_000) % 2))
    time = np.cumsum(np.append(0.0, steps))
    statistics = StepStatistics()
    for first in range(0, len(time) - 1, 65_536):
        statistics.add(time[first : first + 65_537])
    shares = [0.05, 0.5, 0.95]
    np.testing.assert_allclose(statistics.quantiles(shares), np.quantile(steps, shares), rtol=5e-3)
    assert statistics.rate == pytest.approx(1.0 / steps.mean())
