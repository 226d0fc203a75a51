"""Whether a trajectory keeps every limit, on a grid much finer than the one it was designed on."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array
from casysid.excitation.constraints.constraint import Constraint
from casysid.excitation.constraints.joint import JointConstraint
from casysid.excitation.constraints.torque import TorqueConstraint
from casysid.excitation.design.problem import REFINEMENT, ExcitationProblem
from casysid.excitation.motion.fourier import ExcitationTrajectory, Motion
from casysid.threads import single_threaded

CHUNK = 512
"""Instants looked at together, so that distances of many pairs stay in memory."""


@dataclass(frozen=True, kw_only=True)
class Margin:
    """The instant at which one quantity comes nearest to its bound.

    Attributes:
        kind: Of quantity: position, velocity, acceleration, jerk, torque, distance, keep-in box.
        label: Whose: a joint, two links, a frame.
        unit: Of value, bounds and slack.
        instant: [s].
        value: There.
        lower: Bound, -inf for none.
        upper: Bound, inf for none.
        slack: How far the value is from the bound; negative for a violation.
        share: The same as a share of the quantity's scale.
    """

    kind: str
    label: str
    unit: str
    instant: float
    value: float
    lower: float
    upper: float
    slack: float
    share: float

    def __str__(self) -> str:
        if self.slack < 0.0:
            bounds = f"at least {self.lower:.4g}" if self.upper == np.inf else f"{self.lower:.4g} to {self.upper:.4g}"
            return (
                f"{self.kind} of {self.label} at {self.instant:.4g} s: wanted {bounds} {self.unit}, got "
                f"{self.value:.6g} {self.unit}, {-self.slack:.3g} {self.unit} too far"
            )
        return f"{self.kind} of {self.label}: {self.slack:.3g} {self.unit} left at {self.instant:.4g} s"


@dataclass(frozen=True, kw_only=True)
class Verification:
    """What the check saw.

    Attributes:
        samples: Instants of one period that were looked at.
        margins: The least of each quantity.
    """

    samples: int
    margins: tuple[Margin, ...]

    @property
    def violations(self) -> tuple[Margin, ...]:
        """Worst first."""
        return tuple(sorted((one for one in self.margins if one.slack < 0.0), key=lambda one: one.share))

    @property
    def passed(self) -> bool:
        """Whether nothing is violated."""
        return not self.violations

    @property
    def tightest(self) -> tuple[Margin, ...]:
        """The tightest quantity of each kind."""
        kinds = dict.fromkeys(one.kind for one in self.margins)
        return tuple(
            min((one for one in self.margins if one.kind == kind), key=lambda one: one.share) for kind in kinds
        )


@single_threaded()
def verify(problem: ExcitationProblem, trajectory: ExcitationTrajectory, samples: int | None = None) -> Verification:
    """The least margin of every quantity over one period, from the constraints themselves, not their smooth versions.

    Args:
        problem: Whose limits are to be kept.
        trajectory: Any.
        samples: Instants to look at; None is ten times those of the design grid.
    """
    count = REFINEMENT * problem.samples if samples is None else samples
    pieces = ((t, trajectory.motion(t)) for t in _pieces(problem.series.grid(count)))
    margins = _worst(problem.constraints, ((t, _measuring(motion)) for t, motion in pieces))
    return Verification(samples=count, margins=margins)


@single_threaded()
def verify_recorded(problem: ExcitationProblem, time: Array, motion: Motion, torque: Array) -> Verification:
    """The least margin of every quantity but jerk over a motion that took place, from the torque that acted.

    Args:
        problem: Whose limits are to be kept.
        time: Instants, shape (N,), [s].
        motion: The joints' motion then; its jerk is not looked at.
        torque: Of the joints, shape (N, n), [N m, N].
    """
    constraints = tuple(one for one in problem.constraints if not (isinstance(one, JointConstraint) and one.order > 2))
    rows = _pieces(np.arange(len(time)))
    chosen = ((time[k], Motion(*(values[k] for values in motion)), torque[k]) for k in rows)
    margins = _worst(constraints, ((t, _measuring(piece, acted)) for t, piece, acted in chosen))
    return Verification(samples=len(time), margins=margins)


def verify_motion(constraints: Sequence[Constraint], time: Array, motion: Motion) -> Verification:
    """The least margin of every quantity of some constraints over any motion, at times (N,), [s]."""
    rows = _pieces(np.arange(len(time)))
    pieces = ((time[k], _measuring(Motion(*(values[k] for values in motion)))) for k in rows)
    return Verification(samples=len(time), margins=_worst(constraints, pieces))


Measure = Callable[[Constraint], Array]


def _pieces(values: npt.NDArray[Any]) -> list[npt.NDArray[Any]]:
    return np.array_split(values, -(-len(values) // CHUNK))


def _measuring(motion: Motion, torque: Array | None = None) -> Measure:
    def measure(constraint: Constraint) -> Array:
        if torque is not None and isinstance(constraint, TorqueConstraint):
            return torque[:, constraint.joints]
        return constraint.measure(motion)

    return measure


def _worst(constraints: Sequence[Constraint], pieces: Iterable[tuple[Array, Measure]]) -> tuple[Margin, ...]:
    worst: dict[tuple[int, int], Margin] = {}
    for time, measure in pieces:
        for b, constraint in enumerate(constraints):
            for k, margin in enumerate(_least(constraint, measure(constraint), time)):
                if (b, k) not in worst or margin.slack < worst[b, k].slack:
                    worst[b, k] = margin
    return tuple(worst[key] for key in sorted(worst))


def _least(constraint: Constraint, values: Array, time: Array) -> list[Margin]:
    slack = np.minimum(values - constraint.lower, constraint.upper - values)
    slack = np.where(np.isnan(slack), -np.inf, slack)
    rows = slack.argmin(axis=0)
    lower, upper, scale = constraint.lower, constraint.upper, constraint.scale
    return [
        Margin(
            kind=constraint.kind,
            label=constraint.labels[k],
            unit=constraint.units[k],
            instant=float(time[row]),
            value=float(values[row, k]),
            lower=float(lower[k]),
            upper=float(upper[k]),
            slack=float(slack[row, k]),
            share=float(slack[row, k] / scale[k]),
        )
        for k, row in enumerate(rows)
    ]
