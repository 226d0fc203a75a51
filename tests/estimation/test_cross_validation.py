import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from casysid.estimation.cross_validation import contiguous_folds, cross_validate
from casysid.estimation.standardise import standardise
from casysid.moments import Moments


@given(st.integers(2, 50), st.integers(2, 12))
def test_folds_are_contiguous_and_cover_every_block_once(blocks: int, folds: int) -> None:
    parts = contiguous_folds(blocks, folds)
    assert np.concatenate(parts).tolist() == list(range(blocks))
    assert len(parts) == min(blocks, folds)
    assert all(len(part) > 0 for part in parts)


def test_the_error_is_that_of_rows_held_out() -> None:
    rng = np.random.default_rng(0)
    x = rng.standard_normal((60, 3))
    y = x @ np.ones(3) + rng.standard_normal(60)
    problem = standardise(Moments.from_rows(x, y, blocks=6))

    def least_squares_and_nothing(training):
        return np.stack([np.linalg.solve(training.xx, training.xy), np.zeros(3)])

    found = cross_validate(problem, 3, least_squares_and_nothing, choice="test")
    energy = 0.0
    for fold in range(3):
        held_out = np.arange(60) // 20 == fold
        theta = np.linalg.lstsq(x[~held_out], y[~held_out])[0]
        energy += ((y - x @ theta)[held_out] ** 2).sum()
    np.testing.assert_allclose(found, [energy / (y**2).sum(), 1.0])


def test_training_moments_are_means_over_training_rows() -> None:
    rng = np.random.default_rng(1)
    x, y = rng.standard_normal((30, 2)), rng.standard_normal(30)
    problem = standardise(Moments.from_rows(x, y, blocks=3))
    seen = []

    def remember(training):
        seen.append(training)
        return np.zeros((1, 2))

    cross_validate(problem, 3, remember, choice="test")
    z = x / np.sqrt((x**2).mean(axis=0))
    np.testing.assert_allclose(seen[0].xx, z[10:].T @ z[10:] / 20)
    assert [part.count for part in seen] == [pytest.approx(20.0)] * 3
