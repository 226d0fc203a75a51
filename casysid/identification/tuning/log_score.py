"""The one rule by which the data change how a log is read: the simplest hypothesis within one standard error.

A hypothesis, such as a delay or another clock, is fitted without one stretch of time after the other, and scored by the
logarithm of the likelihood that it gives to the torques left out, every joint with the noise that it had in the fit,
or that it proved to have: a fit to little data is surer of itself than it should be, the better it fits the more.
Of hypotheses in the order of their simplicity, the first is taken that is no worse than the best by more than one
standard error of that difference over the stretches, and no worse than by a gain of practical size. Joints that no
hypothesis explains have no vote.

Source: the one-standard-error rule of Breiman, Friedman, Olshen and Stone 1984, §3.4.3.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array, frozen

Mask = npt.NDArray[np.bool_]

EXPLAINED = 0.5
"""Share of a joint's torque energy that some hypothesis must explain on time left out for the joint to have a vote."""
PRACTICAL_GAIN = 0.05
"""Fall of the torque error (the root of its energy, geometric mean over joints) below which no choice is worth making:
a twentieth of the error is less than the error itself changes from one recording of a robot to the next."""


@dataclass(frozen=True, eq=False)
class HeldOutScore:
    """How a hypothesis predicts what was left out.

    Attributes:
        energy: Squared errors by stretch and joint, shape (k, joints).
        target: Squared torques alike, shape (k, joints).
        count: Equations alike, shape (k, joints).
        variance: Of each joint's residuals in the fit to the others, shape (k, joints).
    """

    energy: Array
    target: Array
    count: Array
    variance: Array

    def __post_init__(self) -> None:
        for name in ("energy", "target", "count", "variance"):
            object.__setattr__(self, name, frozen(getattr(self, name)))

    @property
    def explained(self) -> Array:
        """Share of each joint's torque energy that was predicted, shape (joints,)."""
        target = self.target.sum(axis=0)
        return np.asarray(1.0 - self.energy.sum(axis=0) / np.where(target > 0.0, target, np.inf))

    def by_stretch(self, voting: Mask) -> Array:
        """Mean logarithm of the likelihood of one equation in each stretch, joints weighted alike, shape (k,)."""
        rows, energy = np.maximum(self.count[:, voting], 1.0), self.energy[:, voting]
        proved = np.maximum(energy.sum(axis=0) / rows.sum(axis=0), np.finfo(np.float64).tiny)
        variance = np.maximum(self.variance[:, voting], proved)
        return np.asarray(-0.5 * np.mean(energy / (rows * variance) + np.log(variance), axis=1))

    def size(self, voting: Mask) -> float:
        """Torque error, geometric mean over joints."""
        energy = np.maximum(self.energy[:, voting].sum(axis=0), np.finfo(np.float64).tiny)
        return float(np.exp(0.5 * np.mean(np.log(energy))))


def simplest_within_one_error(scores: Sequence[HeldOutScore], least_gain: float = PRACTICAL_GAIN) -> int:
    """Which hypothesis is taken, by its place in the order of simplicity.

    Args:
        scores: Of the hypotheses, the simplest first.
        least_gain: Fall of the torque error for which a less simple one is taken.
    """
    voting = np.max([score.explained for score in scores], axis=0) > EXPLAINED
    if not voting.any():
        return 0
    tables = [score.by_stretch(voting) for score in scores]
    best = int(np.argmax([table.mean() for table in tables]))
    smallest = scores[best].size(voting)
    for place, (score, table) in enumerate(zip(scores[:best], tables[:best], strict=True)):
        lost = tables[best] - table
        error = float(lost.std(ddof=1)) / np.sqrt(len(lost)) if len(lost) > 1 else np.inf
        if lost.mean() <= error or smallest > (1.0 - least_gain) * score.size(voting):
            return place
    return best
