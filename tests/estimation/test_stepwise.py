import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.estimation.base import Status
from casysid.estimation.stepwise import StepwiseRegression, _sweep
from casysid.moments import Moments

LAW = settings(max_examples=25, deadline=None)
seeds = st.integers(0, 2**32 - 1)


def draw_rows(seed: int, n: int = 60, p: int = 8) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    x = rng.standard_normal((n, p)) @ rng.standard_normal((p, p))
    return x, x @ np.where(rng.random(p) < 0.5, rng.standard_normal(p), 0.0) + 2.0 * rng.standard_normal(n)


def residual_energy(x: np.ndarray, y: np.ndarray, chosen: set[int]) -> float:
    columns = x[:, sorted(chosen)]
    return float(((y - columns @ np.linalg.lstsq(columns, y)[0]) ** 2).sum()) if chosen else float((y**2).sum())


def stepwise_by_refitting(x: np.ndarray, y: np.ndarray, to_enter: float, to_remove: float) -> set[int]:
    """Draper and Smith's procedure, every candidate model fitted anew to the rows."""
    chosen: set[int] = set()
    while True:
        rest, freedom = residual_energy(x, y, chosen), len(y) - len(chosen)
        removal = {k: (residual_energy(x, y, chosen - {k}) - rest) / (rest / freedom) for k in chosen}
        weakest = min(removal, key=removal.get, default=None)
        if weakest is not None and removal[weakest] < to_remove:
            chosen = chosen - {weakest}
            continue
        without = {k: residual_energy(x, y, chosen | {k}) for k in set(range(x.shape[1])) - chosen}
        entry = {k: (rest - energy) / (energy / (freedom - 1)) for k, energy in without.items()}
        strongest = max(entry, key=entry.get, default=None)
        if strongest is None or entry[strongest] <= to_enter:
            return chosen
        chosen = chosen | {strongest}


@LAW
@given(seeds, st.sampled_from([(4.0, 3.9), (8.0, 2.0), (1.0, 1.0)]))
def test_sweeping_chooses_what_refitting_every_model_chooses(seed: int, thresholds: tuple[float, float]) -> None:
    x, y = draw_rows(seed)
    to_enter, to_remove = thresholds
    estimate = StepwiseRegression(f_to_enter=to_enter, f_to_remove=to_remove).estimate(Moments.from_rows(x, y))
    chosen = stepwise_by_refitting(x, y, to_enter, to_remove)
    assert set(np.flatnonzero(estimate.parameters).tolist()) == chosen
    columns = sorted(chosen)
    np.testing.assert_allclose(estimate.parameters[columns], np.linalg.lstsq(x[:, columns], y)[0], atol=1e-8)
    assert estimate.status is Status.CONVERGED


@LAW
@given(seeds)
def test_standard_errors_of_chosen_columns_are_those_of_the_small_regression(seed: int) -> None:
    x, y = draw_rows(seed)
    estimate = StepwiseRegression().estimate(Moments.from_rows(x, y))
    chosen = np.flatnonzero(estimate.parameters)
    variance = residual_energy(x, y, set(chosen.tolist())) / (len(y) - len(chosen))
    expected = variance * np.linalg.inv(x[:, chosen].T @ x[:, chosen])
    found = estimate.covariance[np.ix_(chosen, chosen)]
    np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-9 * np.abs(expected).max(initial=0.0))


@LAW
@given(seeds)
def test_a_column_that_was_left_out_keeps_the_doubt_it_would_have_inside(seed: int) -> None:
    x, y = draw_rows(seed)
    estimate = StepwiseRegression().estimate(Moments.from_rows(x, y))
    chosen = np.flatnonzero(estimate.parameters)
    variance = residual_energy(x, y, set(chosen.tolist())) / (len(y) - len(chosen))
    for k in np.flatnonzero(estimate.parameters == 0.0):
        wider = x[:, [*chosen, k]]
        expected = np.sqrt(variance * np.linalg.inv(wider.T @ wider)[-1, -1])
        np.testing.assert_allclose(estimate.std[k], expected, rtol=1e-6)


@LAW
@given(seeds)
def test_sweeping_in_and_out_restores_the_tableau(seed: int) -> None:
    x, y = draw_rows(seed)
    rows = np.column_stack([x, y])
    tableau = rows.T @ rows
    swept = tableau.copy()
    for k, sign in ((0, 1.0), (3, 1.0), (0, -1.0), (3, -1.0)):
        _sweep(swept, k, sign)
    np.testing.assert_allclose(swept, tableau, rtol=1e-8, atol=1e-8 * np.abs(tableau).max())


def test_running_out_of_steps_is_said_so() -> None:
    x, y = draw_rows(3)
    estimate = StepwiseRegression(f_to_enter=1e-9, f_to_remove=1e-9, max_steps=2).estimate(Moments.from_rows(x, y))
    assert estimate.status is Status.MAX_ITERATIONS
    assert estimate.diagnostics["selected"] == 2.0


def test_more_columns_than_rows_still_gives_a_finite_answer() -> None:
    x, y = draw_rows(0, n=5, p=8)
    estimate = StepwiseRegression(f_to_enter=1e-3, f_to_remove=1e-3).estimate(Moments.from_rows(x, y))
    assert np.isfinite(estimate.parameters).all()
    assert estimate.rank == 5
