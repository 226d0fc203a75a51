"""Which of the two jitters, the samples or their stamps, is told from the positions; the wrong stamps are mended."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.errors import CasysidWarning
from casysid.recording import Recording
from casysid.recording.even_stamps import evened, with_even_stamps

RATE = 100.0


def log(seed, *, stamps_jitter, share=0.1, samples=2000, noise=1e-6, gap=0):
    """Smooth positions measured at jittered times that the stamps tell, or evenly with stamps that jitter."""
    rng = np.random.default_rng(seed)
    even = np.arange(samples) / RATE
    even[samples // 2 :] += gap / RATE
    jittered = even + share / RATE * np.clip(rng.normal(size=samples), -3.0, 3.0)
    measured, stamps = (even, jittered) if stamps_jitter else (jittered, jittered)
    phase = rng.uniform(0.0, 2.0 * np.pi, (2, 3))
    waves = 2.0 * np.pi * rng.uniform(0.2, 2.0, (2, 3)) * measured[:, None, None] + phase
    position = np.sin(waves).sum(axis=2) + noise * rng.normal(size=(samples, 2))
    dofs = ("shoulder", "elbow")
    return Recording(channels=dofs, dofs=dofs, time=stamps, position=position, torque=position), even


@given(st.integers(0, 10_000), st.floats(0.02, 0.2), st.sampled_from([0, 7, 300]))
@settings(max_examples=20)
def test_stamps_that_jitter_are_mended(seed, share, gap):
    recording, truth = log(seed, stamps_jitter=True, share=share, gap=gap)
    even = with_even_stamps(recording)
    assert even is not None
    assert np.std(even.time - truth) < 0.3 * np.std(recording.time - truth)
    np.testing.assert_array_equal(even.position, recording.position)


@given(st.integers(0, 10_000), st.floats(0.02, 0.2), st.sampled_from([0, 7]))
@settings(max_examples=20)
def test_samples_that_jitter_keep_their_stamps(seed, share, gap):
    recording, _ = log(seed, stamps_jitter=False, share=share, gap=gap)
    assert with_even_stamps(recording) is None
    assert evened([recording]) == (recording,)


@pytest.mark.parametrize("noise", [0.1, 1.0])
def test_jitter_below_the_noise_changes_nothing(noise):
    recording, _ = log(3, stamps_jitter=True, share=1e-3, noise=noise)
    assert with_even_stamps(recording) is None


def test_even_stamps_and_few_samples_are_left_alone():
    assert with_even_stamps(log(0, stamps_jitter=True, share=0.0)[0]) is None
    assert with_even_stamps(log(0, stamps_jitter=True, samples=150)[0]) is None


def test_what_was_done_is_said():
    recording, _ = log(0, stamps_jitter=True)
    with pytest.warns(CasysidWarning, match="stamps jitter by 0.9.*taken evenly"):
        (even,) = evened([recording])
    assert even is not recording
