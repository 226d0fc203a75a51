import numpy as np
import pytest

from casysid.estimation.selection import conditional_covariance, mean_variance
from casysid.estimation.standardise import standardise
from casysid.moments import Moments


def draw_coloured(rng: np.random.Generator, n: int, memory: float) -> np.ndarray:
    values = rng.standard_normal((n, 4))
    for k in range(1, n):
        values[k] = memory * values[k - 1] + np.sqrt(1.0 - memory**2) * values[k]
    return values


@pytest.mark.parametrize("memory", [0.0, 0.95])
def test_standard_errors_hold_for_white_and_for_coloured_residuals(memory: float) -> None:
    rng = np.random.default_rng(0)
    errors = []
    for _ in range(40):
        values = draw_coloured(rng, 2000, memory)
        x, y = values[:, :3], values[:, :3] @ np.ones(3) + values[:, 3]
        problem = standardise(Moments.from_rows(x, y, blocks=20))
        beta = np.linalg.solve(problem.normal.xx, problem.normal.xy)
        covariance = conditional_covariance(problem, beta, np.ones(3, dtype=bool))
        errors.append((problem.restore(beta) - 1.0) / np.sqrt(np.diag(problem.restore_covariance(covariance))))
    assert np.std(errors) == pytest.approx(1.0, abs=0.25)


def test_a_single_block_takes_the_residuals_as_white() -> None:
    rng = np.random.default_rng(1)
    x, y = rng.standard_normal((50, 3)), rng.standard_normal(50)
    problem = standardise(Moments.from_rows(x, y))
    beta = np.linalg.solve(problem.normal.xx, problem.normal.xy)
    assert mean_variance(problem, beta, 3) == pytest.approx(problem.normal.residual_energy(beta) / 47)


def test_choosing_no_column_leaves_every_column_its_own_doubt() -> None:
    rng = np.random.default_rng(2)
    x, y = rng.standard_normal((50, 3)), rng.standard_normal(50)
    problem = standardise(Moments.from_rows(x, y))
    covariance = conditional_covariance(problem, np.zeros(3), np.zeros(3, dtype=bool))
    np.testing.assert_allclose(covariance, np.eye(3) / 50)
