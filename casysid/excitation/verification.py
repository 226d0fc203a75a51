"""Whether a trajectory keeps every limit, on a grid much finer than the one it was designed on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from casysid.arrays import Array
from casysid.excitation.blocks import Block
from casysid.excitation.problem import REFINEMENT, ExcitationProblem
from casysid.excitation.series import ExcitationTrajectory, Motion

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


def verify(problem: ExcitationProblem, trajectory: ExcitationTrajectory, samples: int | None = None) -> Verification:
    """The least margin of every quantity over one period, from the constraints themselves, not their smooth versions.

    Args:
        problem: Whose limits are to be kept.
        trajectory: Any.
        samples: Instants to look at; None is ten times those of the design grid.
    """
    count = REFINEMENT * problem.samples if samples is None else samples
    time = problem.series.grid(count)
    worst: dict[tuple[int, int], Margin] = {}
    for piece in np.array_split(time, -(-count // CHUNK)):
        motion = trajectory.motion(piece)
        for b, block in enumerate(problem.blocks):
            for k, margin in enumerate(_least(block, motion, piece)):
                if (b, k) not in worst or margin.slack < worst[b, k].slack:
                    worst[b, k] = margin
    return Verification(samples=count, margins=tuple(worst[key] for key in sorted(worst)))


def _least(block: Block, motion: Motion, time: Array) -> list[Margin]:
    values = block.measure(motion)
    slack = np.minimum(values - block.lower, block.upper - values)
    slack = np.where(np.isnan(slack), -np.inf, slack)
    rows = slack.argmin(axis=0)
    lower, upper, scale = block.lower, block.upper, block.scale
    return [
        Margin(
            kind=block.kind,
            label=block.labels[k],
            unit=block.units[k],
            instant=float(time[row]),
            value=float(values[row, k]),
            lower=float(lower[k]),
            upper=float(upper[k]),
            slack=float(slack[row, k]),
            share=float(slack[row, k] / scale[k]),
        )
        for k, row in enumerate(rows)
    ]
