"""The climb on a bound simple enough to know where it ends."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.estimation.acceleration import Ascent, ascend

CURVATURE = np.array([1.0, 30.0, 1000.0])
FREE = (np.full(3, -np.inf), np.full(3, np.inf))


@dataclass(frozen=True, eq=False)
class Hill:
    """``1000 - ½ Σ c x²``, rounded to multiples of ``grain``; EM's step goes a little of the way."""

    vector: np.ndarray
    grain: float = 0.0
    rounding: float = 1e-12
    gradient_sign: float = 1.0
    em_gain: float = 1e-3

    @property
    def bound(self) -> float:
        exact = 1000.0 - 0.5 * float(CURVATURE @ self.vector**2)
        return exact if self.grain == 0.0 else self.grain * np.floor(exact / self.grain)

    @property
    def gradient(self) -> np.ndarray:
        return -self.gradient_sign * CURVATURE * self.vector

    def metric(self) -> Callable[[np.ndarray], np.ndarray]:
        return lambda gradient: gradient / 30.0

    def em_step(self) -> np.ndarray:
        return self.vector * (1.0 - self.em_gain)


def climb(start: np.ndarray, limits: tuple[np.ndarray, np.ndarray] = FREE, **kind: float) -> Ascent:
    return ascend(lambda vector: Hill(vector, **kind), start, limits, tolerance=1e-12, max_iterations=500, metric_age=3)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_the_top_is_reached_by_steps_that_only_climb(seed: int) -> None:
    ascent = climb(np.random.default_rng(seed).standard_normal(3))
    assert ascent.converged
    assert ascent.bounds[-1] == pytest.approx(1000.0, abs=1e-9)
    assert min(np.diff(ascent.bounds)) >= 0.0


def test_a_limit_is_kept_and_climbed_along() -> None:
    lowest = np.array([0.5, -1.0, -1.0])
    ascent = climb(np.ones(3), (lowest, np.full(3, 2.0)))
    assert ascent.converged
    np.testing.assert_allclose(ascent.vector, [0.5, 0.0, 0.0], atol=1e-6)


def test_where_only_rounding_is_left_to_gain_the_climb_has_converged() -> None:
    ascent = climb(np.array([1e-3, 1e-3, 1e-5]), grain=0.02, rounding=0.04)
    assert ascent.converged
    assert len(ascent.bounds) == 1


def test_a_climb_that_breaks_off_below_what_the_gradient_promises_has_not_converged() -> None:
    assert not climb(np.ones(3), grain=1e6).converged
    assert not climb(np.ones(3), gradient_sign=-1.0, em_gain=-1e-3).converged
    assert not climb(np.ones(3), gradient_sign=np.nan, em_gain=0.0).converged


def test_running_out_of_iterations_is_not_convergence() -> None:
    ascent = ascend(Hill, np.ones(3), FREE, tolerance=1e-12, max_iterations=3, metric_age=3)
    assert not ascent.converged
    assert len(ascent.bounds) == 4
