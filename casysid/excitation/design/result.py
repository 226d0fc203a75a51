"""What a design is while it grows, and what it is in the end."""

from __future__ import annotations

import dataclasses
import enum
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from casysid.arrays import Array, frozen
from casysid.errors import ParameterError
from casysid.excitation.design.problem import REFINEMENT, ExcitationProblem
from casysid.excitation.design.verification import Verification, verify
from casysid.excitation.motion.fourier import ExcitationTrajectory, FourierSeries
from casysid.nlp import NlpStatus


class DesignStatus(enum.Enum):
    """How the design ended; the value is the sentence the user reads."""

    CONVERGED = "converged to the requested tolerance"
    UNFINISHED = "stopped before the tolerance was reached; the best motion found that keeps all limits is returned"
    INTERRUPTED = "interrupted; the best motion found until then that keeps all limits is returned"


@dataclass(frozen=True, kw_only=True)
class DesignStep:
    """One iteration, as a progress function sees it.

    Attributes:
        start: Number of the start, from 1; 0 while motions to start from are looked for, one more than ``starts`` while
            the best are polished.
        starts: How many.
        step: Iteration from this start.
        objective: The criterion there.
        infeasibility: Largest violation, as a share of the limits.
        best: Least criterion of all motions so far that keep the limits of the design grid.
        seconds: Since the design began.
    """

    start: int
    starts: int
    step: int
    objective: float
    infeasibility: float
    best: float
    seconds: float


Progress = Callable[[DesignStep], bool | None]
"""Called at every iteration; an answer that is true stops the design, which then returns the best so far."""


@dataclass(frozen=True, kw_only=True)
class StartReport:
    """What came of one start.

    Attributes:
        status: Why IPOPT stopped.
        first: Criterion at the start.
        objective: At the end; inf if no motion that keeps the limits came of it.
        iterations: How many.
        seconds: Wall time.
    """

    status: NlpStatus
    first: float
    objective: float
    iterations: int
    seconds: float


@dataclass(frozen=True, eq=False, kw_only=True)
class ExcitationDesign:
    """A motion that keeps all limits, and what it tells. Checks itself.

    Attributes:
        problem: What was asked.
        trajectory: The answer.
        status: How the design ended.
        starts: What came of each start, and then of polishing the best.
        evaluations: How often objective, gradient, constraints and Jacobian were evaluated.
        seconds: Wall time.
        shrink: Factor by which the optimiser's motion was made smaller so that it passes the check; 1 for none.
    """

    problem: ExcitationProblem
    trajectory: ExcitationTrajectory
    status: DesignStatus
    starts: tuple[StartReport, ...]
    evaluations: dict[str, int]
    seconds: float
    shrink: float

    @cached_property
    def gained(self) -> Array:
        """Information of all periods, without what was known, shape (r, r), scaled; by quadrature on the fine grid."""
        return frozen(self.problem.gained(self.trajectory, REFINEMENT))

    @cached_property
    def information(self) -> Array:
        """With what was known, shape (r, r), scaled."""
        return frozen(self.problem.known + self.gained)

    @property
    def log_det(self) -> float:
        """Of the information; -inf if it is singular."""
        sign, value = np.linalg.slogdet(self.information)
        return float(value) if sign > 0.0 else -np.inf

    @property
    def condition_number(self) -> float:
        """Of the information in its scaled units: the square of the regressor's."""
        values = np.linalg.eigvalsh(self.information)
        return float(values[-1] / values[0]) if values[0] > 0.0 else np.inf

    def at_speed(self, factor: float) -> ExcitationDesign:
        """The same path more slowly: velocity times the factor, acceleration times its square.

        Raises:
            ParameterError: The factor is not above 0 and at most 1.
        """
        if not 0.0 < factor <= 1.0:
            raise ParameterError(f"excitation: speed must be above 0 and at most 1; got {factor}")
        if factor == 1.0:
            return self
        series = FourierSeries(self.problem.series.period / factor, self.problem.series.harmonics)
        note = f"played at {factor:.4g} times the speed that it was designed for"
        return dataclasses.replace(
            self,
            problem=dataclasses.replace(self.problem, series=series, notes=(note, *self.problem.notes)),
            trajectory=dataclasses.replace(self.trajectory, series=series),
        )

    def check(self, samples: int | None = None) -> Verification:
        """All limits at so many instants of a period; None is ten times those of the design grid."""
        return verify(self.problem, self.trajectory, samples)
