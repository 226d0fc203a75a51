"""The split of second moments into signal and independent noise."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.errors import SolverError
from casysid.estimation.noise_split import split_noise

LAW = settings(max_examples=20, deadline=None)
seeds = st.integers(0, 2**32 - 1)


def draw_moments(rng: np.random.Generator, d: int = 6) -> np.ndarray:
    rows = rng.standard_normal((2 * d, d)) * 10.0 ** rng.uniform(-2, 2, d)
    return rows.T @ rows


def entropy(moments: np.ndarray, noise: np.ndarray) -> float:
    return float(np.log(noise).sum() + np.linalg.slogdet(moments - np.diag(noise))[1])


@LAW
@given(seeds)
def test_both_parts_are_positive_and_no_other_split_has_more_entropy(seed: int) -> None:
    rng = np.random.default_rng(seed)
    moments = draw_moments(rng)
    noise = split_noise(moments)
    assert (noise > 0.0).all()
    assert (noise < 1.0 / np.diag(np.linalg.inv(moments))).all()
    size = np.sqrt(np.diag(moments))
    assert np.linalg.eigvalsh((moments - np.diag(noise)) / np.outer(size, size)).min() > 0.0
    best = entropy(moments, noise)
    for _ in range(5):
        assert entropy(moments, noise * np.exp(0.01 * rng.standard_normal(len(noise)))) < best


@LAW
@given(seeds)
def test_the_split_follows_order_and_units(seed: int) -> None:
    rng = np.random.default_rng(seed)
    moments, order, units = draw_moments(rng), rng.permutation(6), 10.0 ** rng.uniform(-3, 3, 6)
    expected = split_noise(moments)
    np.testing.assert_allclose(split_noise(moments[np.ix_(order, order)]), expected[order], rtol=1e-4)
    np.testing.assert_allclose(split_noise(moments * np.outer(units, units)), expected * units**2, rtol=1e-4)


def test_a_lone_column_is_split_in_halves_and_pairs_as_their_correlation_allows() -> None:
    assert split_noise(np.array([[4.0]])) == pytest.approx([2.0])
    # log f² + log((1 - f)² - c²) is largest where 2 f² - 3 f + 1 - c² = 0
    share = (3.0 - np.sqrt(1.0 + 8.0 * 0.36)) / 4.0
    np.testing.assert_allclose(split_noise(np.array([[1.0, 0.6], [0.6, 1.0]])), share, rtol=1e-5)


def test_where_the_signals_are_dependent_the_noise_is_found() -> None:
    mixing = 100.0 * np.random.default_rng(0).standard_normal((19, 20))
    absent = np.linalg.svd(mixing)[2][-1]  # direction without signal
    noise = split_noise(mixing.T @ mixing + 0.3 * np.eye(20))
    assert absent**2 @ noise == pytest.approx(0.3 * 20 / 21, rel=0.01)  # f²⁰ (0.3 - f) is largest


def test_nearly_dependent_columns_are_split_and_dependent_ones_refused() -> None:
    rng = np.random.default_rng(0)
    mixing = rng.standard_normal((10, 10)) * np.logspace(0, -4, 10)[:, None]
    moments = mixing.T @ mixing
    noise = split_noise(moments)
    assert np.linalg.eigvalsh(moments - np.diag(noise)).min() > 0.0
    with pytest.raises(SolverError, match="leave dependent columns out"):
        split_noise(np.ones((2, 2)))
