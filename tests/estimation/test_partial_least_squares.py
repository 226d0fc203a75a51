import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.cross_decomposition import PLSRegression

from casysid.estimation.cross_validation import contiguous_folds
from casysid.estimation.partial_least_squares import PartialLeastSquares, extract_components
from casysid.estimation.standardise import standardise
from casysid.moments import Moments

LAW = settings(max_examples=25, deadline=None)
seeds = st.integers(0, 2**32 - 1)


def draw_rows(seed: int, n: int = 60, p: int = 6) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    x = rng.standard_normal((n, p)) @ rng.standard_normal((p, p))
    return x, x @ rng.standard_normal(p) + 2.0 * rng.standard_normal(n)


def mirrored(x: np.ndarray) -> np.ndarray:
    """Rows and their negatives, which a library that centres leaves as they are, in columns of unit energy."""
    return np.concatenate([x, -x]) / np.sqrt((x**2).mean(axis=0))


@LAW
@given(seeds, st.integers(1, 6))
def test_components_agree_with_the_library_on_rows(seed: int, components: int) -> None:
    x, y = draw_rows(seed)
    library = PLSRegression(n_components=components, scale=False).fit(mirrored(x), mirrored(y[:, None]))
    expected = library.coef_[0] * np.sqrt((y**2).mean()) / np.sqrt((x**2).mean(axis=0))
    estimate = PartialLeastSquares(components=components).estimate(Moments.from_rows(x, y))
    np.testing.assert_allclose(estimate.parameters, expected, atol=1e-6 * np.abs(expected).max())
    assert estimate.diagnostics["components"] == components


@LAW
@given(seeds)
def test_all_components_are_least_squares(seed: int) -> None:
    x, y = draw_rows(seed)
    estimate = PartialLeastSquares(components=99).estimate(Moments.from_rows(x, y))
    expected = np.linalg.lstsq(x, y)[0]
    np.testing.assert_allclose(estimate.parameters, expected, atol=1e-5 * np.abs(expected).max())


@LAW
@given(seeds)
def test_scores_are_uncorrelated(seed: int) -> None:
    x, y = draw_rows(seed)
    normal = standardise(Moments.from_rows(x, y)).normal
    rotations, energies = extract_components(normal, 4)
    np.testing.assert_allclose(rotations.T @ normal.xx @ rotations, np.diag(energies), atol=1e-8)


@LAW
@given(seeds)
def test_the_chosen_number_is_the_best_of_rows_held_out(seed: int) -> None:
    x, y = draw_rows(seed)
    z, target = x / np.sqrt((x**2).mean(axis=0)), y / np.sqrt((y**2).mean())
    errors = np.zeros(7)
    for fold in contiguous_folds(10, 5):
        held_out = np.isin(np.repeat(np.arange(10), 6), fold)
        errors[0] += (target[held_out] ** 2).sum()
        for k in range(1, 7):
            both = (
                np.concatenate([z[~held_out], -z[~held_out]]),
                np.concatenate([target[~held_out], -target[~held_out]]),
            )
            library = PLSRegression(n_components=k, scale=False).fit(*both)
            errors[k] += ((target[held_out] - z[held_out] @ library.coef_[0]) ** 2).sum()
    estimate = PartialLeastSquares().estimate(Moments.from_rows(x, y, blocks=10))
    assert errors[int(estimate.diagnostics["components"])] <= errors.min() * (1.0 + 1e-9)


def test_a_target_in_one_direction_needs_one_component() -> None:
    x = np.random.default_rng(0).standard_normal((200, 4))
    x = np.linalg.qr(x)[0]
    estimate = PartialLeastSquares(components=4).estimate(Moments.from_rows(x, x @ np.ones(4)))
    assert estimate.diagnostics["components"] == 1.0
    np.testing.assert_allclose(estimate.parameters, 1.0)
