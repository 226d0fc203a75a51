"""Standing joints are told from joints that turn round."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.signals.standstill import standing

RATE = 500.0
TIME = np.arange(0, 20, 1 / RATE)


def find(position, noise, speed):
    return standing(position[:, None], RATE, np.array([noise]), np.array([speed]), 0.2)[:, 0]


def motion_with_stands(moves, holds):
    """Half waves from -1 to 1 and back, at rest between them; and where it rests."""
    pieces, rests, sign = [], [], -1.0
    for move, hold in zip(moves, holds, strict=True):
        swing, rest = int(move * RATE), int(hold * RATE)
        pieces += [sign * np.cos(np.pi * (np.arange(swing) + 0.5) / swing), np.full(rest, -sign)]
        rests += [np.zeros(swing, dtype=bool), np.ones(rest, dtype=bool)]
        sign = -sign
    return np.concatenate(pieces), np.concatenate(rests)


@settings(max_examples=20, deadline=None)
@given(
    st.lists(st.floats(0.3, 2.0), min_size=4, max_size=8),
    st.floats(0.3, 2.0),
    st.floats(1e-5, 1e-3),
    st.integers(0, 2**32 - 1),
)
def test_stands_are_found_and_hardly_anything_else(moves, hold, noise, seed):
    position, rests = motion_with_stands(moves, [hold] * len(moves))
    noisy = position + noise * np.random.default_rng(seed).normal(size=len(position))
    speed = np.sqrt(np.mean((np.diff(position) * RATE) ** 2))
    found = find(noisy, noise, speed)
    assert found[rests].mean() > 0.8
    assert np.abs(np.gradient(position) * RATE)[found & ~rests].max(initial=0.0) < 0.5 * speed


@settings(max_examples=20, deadline=None)
@given(st.floats(0.05, 2.0), st.floats(0.1, 6.0), st.floats(1e-6, 1e-3), st.integers(0, 2**32 - 1))
def test_a_joint_that_turns_round_does_not_stand(frequency, phase, noise, seed):
    wave = np.sin(2 * np.pi * frequency * TIME + phase)
    noisy = wave + noise * np.random.default_rng(seed).normal(size=len(TIME))
    found = find(noisy, noise, 2 * np.pi * frequency / np.sqrt(2.0))
    assert found.mean() < 0.01


@pytest.mark.parametrize("noise", [0.0, 1e-4])
def test_a_joint_at_rest_stands_all_the_time(noise):
    position = 0.3 + noise * np.random.default_rng(0).normal(size=len(TIME))
    assert find(position, noise, 0.0).mean() > 0.95


def test_steps_of_an_encoder_do_not_hide_a_stand():
    position, rests = motion_with_stands([1.0] * 6, [0.5] * 6)
    step = 1e-3
    found = find(np.round(position / step) * step, step / np.sqrt(12.0), 1.0)
    assert found[rests].mean() > 0.8
    assert found[~rests].mean() < 0.1
