"""Torque brought to the time of its motion."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.recording import Recording
from casysid.signals import aligned, motion_from_recording
from tests.simulated import bundled_robot

RATE, CUTOFF = 200.0, 25.0


def recording_with_torque(delays, gap=0.0):
    """Smooth positions, and torques that are the positions of ``delays`` ago, in two stretches ``gap`` apart."""
    robot = bundled_robot("two_link.urdf")
    time = np.arange(0, 3, 1 / RATE)
    time = np.where(time > 1.5, time + gap, time)

    def position(t):
        return np.stack([np.sin(3 * t), np.cos(2 * t)], axis=1)

    torque = np.stack([position(time - late)[:, k] for k, late in enumerate(delays)], axis=1)
    return robot, Recording(channels=robot.channels, dofs=robot.dofs, time=time, position=position(time), torque=torque)


delay = st.floats(-0.03, 0.03)


@settings(max_examples=20, deadline=None)
@given(delay, delay, st.sampled_from([0.0, 1.0]))
def test_motion_and_torque_of_an_aligned_recording_belong_together(first, second, gap):
    robot, recording = recording_with_torque((first, second), gap)
    motion = motion_from_recording(robot, aligned(recording, np.array([first, second])), CUTOFF)
    assert np.abs(motion.q - motion.tau).max() < 1e-4
    assert len(motion) > 0.9 * len(recording)


@settings(max_examples=20, deadline=None)
@given(delay, delay)
def test_delays_add(first, second):
    _, recording = recording_with_torque((0.0, 0.0))
    twice = aligned(aligned(recording, np.full(2, first)), np.full(2, second))
    assert twice.torque_delay == pytest.approx(first + second, abs=1e-15)


def test_a_common_delay_leaves_every_torque_as_logged():
    _, recording = recording_with_torque((0.0, 0.0))
    moved = aligned(recording, np.full(2, 0.0123))
    np.testing.assert_array_equal(moved.torque, recording.torque)
    np.testing.assert_array_equal(moved.position, recording.position)


def test_no_delay_changes_nothing():
    _, recording = recording_with_torque((0.0, 0.0))
    assert aligned(recording, np.zeros(2)) is recording


def test_samples_without_time_are_taken_as_they_are():
    _, recording = recording_with_torque((0.0, 0.0))
    zeros = np.zeros_like(recording.torque)
    unordered = dataclasses.replace(recording, time=None, velocity=zeros, acceleration=zeros)
    assert aligned(unordered, np.full(2, 0.01)) is unordered
