"""Which columns are mixtures of others."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.estimation.mixtures import find_parts, weights_of

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
    columns = columns * 10.0 ** rng.uniform(-3, 3, 11)
    assert find_parts(correlation_of(columns)).tolist() == parts.tolist()
    weights = weights_of(columns.T @ columns, parts)
    assert weights.min() > -1e-6
    np.testing.assert_allclose(columns[:, parts] @ weights.T, columns, rtol=1e-6, atol=1e-6)


@LAW
@given(seeds)
def test_columns_that_depend_on_each_other_otherwise_are_left_alone(seed: int) -> None:
    columns = np.random.default_rng(seed).standard_normal((50, 5))
    crossed = np.column_stack([columns, columns[:, 0] - columns[:, 1], columns[:, 0] + columns[:, 1], -columns[:, 0]])
    assert find_parts(correlation_of(crossed)).tolist() == list(range(8))


def test_independent_columns_are_all_parts() -> None:
    correlation = correlation_of(np.random.default_rng(0).standard_normal((20, 6)))
    assert find_parts(correlation).tolist() == list(range(6))
    np.testing.assert_array_equal(weights_of(correlation, np.arange(6)), np.eye(6))


def test_of_columns_that_are_multiples_one_is_a_part() -> None:
    columns = np.random.default_rng(0).standard_normal((20, 2))
    parts = find_parts(correlation_of(np.column_stack([columns, 2.0 * columns[:, 0]])))
    assert len(parts) == 2
    assert 1 in parts


def test_the_weights_on_other_columns_are_theirs() -> None:
    columns = np.random.default_rng(0).standard_normal((20, 2))
    columns = np.column_stack([columns, columns.sum(axis=1)])
    gram = columns.T @ columns
    np.testing.assert_allclose(weights_of(gram, np.array([1, 2])), [[-1.0, 1.0], [1.0, 0.0], [0.0, 1.0]], atol=1e-9)
