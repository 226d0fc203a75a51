"""Which columns generate the others."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.estimation.generating_columns import find_generating_columns, weights_of

LAW = settings(max_examples=20, deadline=None)
seeds = st.integers(0, 2**32 - 1)


def correlation_of(columns: np.ndarray) -> np.ndarray:
    size = np.linalg.norm(columns, axis=0)
    return (columns / size).T @ (columns / size)


def draw_mixtures(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Columns of which five are mixtures of the first four and two stand alone, in random order, and their places."""
    parts = rng.standard_normal((50, 4)) * 10.0 ** rng.uniform(-1, 1, 4)
    columns = np.column_stack([parts, rng.standard_normal((50, 2)), parts @ rng.dirichlet(np.ones(4), 5).T])
    order = rng.permutation(11)
    return columns[:, order], np.flatnonzero(order < 6)


@LAW
@given(seeds)
def test_the_parts_of_mixtures_are_found_whatever_the_units(seed: int) -> None:
    rng = np.random.default_rng(seed)
    columns, parts = draw_mixtures(rng)
    found = find_generating_columns(correlation_of(columns * 10.0 ** rng.uniform(-3, 3, 11)))
    assert found.chosen.tolist() == parts.tolist()
    assert found.weights.min() > -1e-6


@LAW
@given(seeds)
def test_the_chosen_columns_are_independent_and_give_all_others(seed: int) -> None:
    rng = np.random.default_rng(seed)
    columns = rng.standard_normal((50, 5)) @ rng.standard_normal((5, 12))
    columns /= np.linalg.norm(columns, axis=0)
    found = find_generating_columns(columns.T @ columns)
    assert len(found.chosen) == 5
    np.testing.assert_allclose(columns[:, found.chosen] @ found.weights.T, columns, atol=1e-6)
    assert np.abs(found.weights).max() <= 1.01 or found.weights.min() > -1e-6  # of largest volume, or the edges


def test_independent_columns_are_all_chosen() -> None:
    found = find_generating_columns(correlation_of(np.random.default_rng(0).standard_normal((20, 6))))
    assert found.chosen.tolist() == list(range(6))
    np.testing.assert_array_equal(found.weights, np.eye(6))


@pytest.mark.parametrize("factor", [2.0, -2.0])
def test_of_columns_that_are_multiples_one_is_chosen(factor: float) -> None:
    columns = np.random.default_rng(0).standard_normal((20, 2))
    found = find_generating_columns(correlation_of(np.column_stack([columns, factor * columns[:, 0]])))
    assert len(found.chosen) == 2
    assert 1 in found.chosen
    np.testing.assert_allclose(np.abs(found.weights[[0, 2]]).sum(axis=1), 1.0)


def test_the_weights_on_other_columns_are_theirs() -> None:
    columns = np.random.default_rng(0).standard_normal((20, 2))
    columns = np.column_stack([columns, columns.sum(axis=1)])
    gram = columns.T @ columns
    np.testing.assert_allclose(weights_of(gram, np.array([1, 2])), [[-1.0, 1.0], [1.0, 0.0], [0.0, 1.0]], atol=1e-9)
