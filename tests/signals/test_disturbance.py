"""Noise added to a recording is the same however the recording is read."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.recording import Recording
from casysid.signals import InputNoise
from casysid.signals.input_noise import Disturbance


def noise(position: float, velocity: float) -> InputNoise:
    return InputNoise(
        position=np.full(2, position),
        velocity=np.array([0.0, velocity]),
        acceleration=np.zeros(2),
        resolution=np.zeros(2),
        relative_error=0.0,
        source="given",
    )


def recording(samples: int) -> Recording:
    wave = np.sin(np.outer(np.arange(samples), [0.1, 0.2]))
    return Recording(
        channels=("a", "b"), dofs=("a", "b"), time=np.arange(samples) * 0.01, position=wave, velocity=wave, torque=wave
    )


@settings(max_examples=20, deadline=None)
@given(st.integers(1, 20_000), st.integers(1, 9000), st.integers(0, 5), st.floats(-2.0, 2.0))
def test_a_row_gets_the_same_noise_in_every_part(samples: int, rows: int, seed: int, scale: float) -> None:
    whole = recording(samples)
    wanted = noise(1e-3, 2.0).disturb(whole, scale, seed)
    change = Disturbance(noise(1e-3, 2.0), scale, seed)
    first = 0
    for batch in whole.batches(rows):
        found = change(batch, first)
        for name in ("position", "velocity", "torque"):
            np.testing.assert_array_equal(getattr(found, name), getattr(wanted, name)[first : first + len(batch)])
        first += len(batch)


def test_the_noise_is_white_of_its_size_and_anew_with_every_seed() -> None:
    whole = recording(50_000)
    draws = [noise(1e-3, 2.0).disturb(whole, 3.0, seed) for seed in (1, 2)]
    added = np.stack([one.position - whole.position for one in draws]).transpose(0, 2, 1).reshape(4, -1)
    np.testing.assert_allclose(np.corrcoef(added), np.eye(4), atol=0.02)
    np.testing.assert_allclose(added.std(axis=1), 3e-3, rtol=0.02)
    assert abs(np.corrcoef(added[0][1:], added[0][:-1])[0, 1]) < 0.02
    assert draws[0].velocity is not None
    np.testing.assert_array_equal(draws[0].velocity[:, 0], whole.position[:, 0])
    opposite = noise(1e-3, 2.0).disturb(whole, -3.0, 1)
    np.testing.assert_allclose(opposite.position + draws[0].position, 2.0 * whole.position, atol=1e-12)
