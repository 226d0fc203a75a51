"""Whether the newest batches are still of the robot that is known: a test of innovations.

What a batch's torque differs from the model's, ``g = Σ w xᵀ(y - xθ)`` in the columns ``x`` of a payload or of a joint's
friction, has the covariance ``c A + N P Nᵀ``: noise, ``A = Σ w x xᵀ``, coloured by ``c``, and what the model itself
does not know, ``P`` its posterior's covariance, ``N`` the sums of ``x`` with all columns. ``c`` is learnt of the
batches before, so ``gᵀ C⁻¹ g / k`` has Fisher's distribution, and a level of significance is a number of false alarms.

Source: generalised likelihood ratio of additive changes (Willsky and Jones 1976).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.special import fdtri

from casysid.arrays import Array
from casysid.estimation.covariance import RANK_TOLERANCE
from casysid.moments import Moments

WINDOWS = 1, 2, 4
"""Batches that are tested together: what is weak shows in several."""
LEVEL = 1e-9
"""Of one test, there being some ten a second: one false alarm in years, were the noise Gaussian. It is not, and the
innovations' own scatter has tails; a kilogram exceeds the limit a hundred times."""
FEWEST = 16
"""Batches before anything is said: the noise's colour is known to a third of itself with four columns each."""
KEPT = max(WINDOWS) + 1
"""Batches that are not yet in the model: a change among them is found before the model has taken it in."""
MEMORY = 256
"""Batches of which the colour is learnt, some minutes."""
HALF = 0.5
"""A change that explains less than this share of the excess is not what has happened."""

Indices = npt.NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Innovation:
    """One batch against the model that was known before it.

    Attributes:
        start: Of the batch [s].
        information: ``N`` over all columns, (p, p).
        score: ``g`` over all columns, (p,).
        energy: ``Σ w r²``.
        rows: Of equations.
    """

    start: float
    information: Array
    score: Array
    energy: float
    rows: float

    def gain(self, columns: Indices, change: Array) -> float:
        """How much of the energy a change of some columns takes."""
        return float(2.0 * self.score[columns] @ change - change @ self.information[np.ix_(columns, columns)] @ change)

    def share(self, columns: Indices, change: Array) -> float:
        """How much of a change is in it, the factor of most gain."""
        size = float(change @ self.information[np.ix_(columns, columns)] @ change)
        return float(self.score[columns] @ change) / size if size > 0.0 else 0.0

    @classmethod
    def of(cls, moments: Moments, parameters: Array, weights: Array, start: float) -> Innovation:
        """Of one block of moments."""
        normal = moments.shifted(parameters).pooled(weights)
        return cls(start, normal.xx, normal.xy, normal.yy, normal.count)


@dataclass(frozen=True, eq=False)
class Change:
    """What the newest batches say has changed.

    Attributes:
        name: Of the hypothesis; empty where none of them explains it.
        batches: How many of the newest have all of it; the one before them has a part.
        since: When it began [s].
        size: Change of the hypothesis' parameters.
        covariance: Of that.
        seen: The newest batches.
    """

    name: str
    batches: int
    since: float
    size: Array
    covariance: Array
    seen: tuple[Innovation, ...]

    def within(self, some: Indices) -> tuple[Array, Array]:
        """The change if it were of these columns only, and its covariance for white noise."""
        newest = self.seen[-self.batches :]
        information = sum((one.information[np.ix_(some, some)] for one in newest), np.zeros((len(some),) * 2))
        inverse: Array = np.asarray(np.linalg.pinv(information, rcond=RANK_TOLERANCE, hermitian=True), dtype=np.float64)
        return inverse @ sum((one.score[some] for one in newest), np.zeros(len(some))), inverse

    def gain(self, columns: Indices, size: Array) -> float:
        """What a change of another size takes of the energy of the batches that have all of it."""
        return sum(one.gain(columns, size) for one in self.seen[-self.batches :])


class Watch:
    """Looks at every batch; a change is told when the batch after it says so too."""

    def __init__(self, hypotheses: Mapping[str, Indices], inflation: float) -> None:
        """For some hypotheses.

        Args:
            hypotheses: Columns that may change together, by name.
            inflation: What is thought of the noise's colour before anything is seen.
        """
        self._hypotheses, self._seen, self._doubts = dict(hypotheses), 0, 0
        self._newest: deque[Innovation] = deque(maxlen=KEPT)
        self._ratios = {
            (name, m): deque([inflation], maxlen=max(MEMORY // m, 1)) for name in hypotheses for m in WINDOWS
        }
        self._usual: deque[float] = deque(maxlen=MEMORY)

    def forget(self) -> None:
        """The newest batches are of another robot."""
        self._newest.clear()
        self._doubts = 0

    @property
    def is_doubting(self) -> bool:
        """Whether the newest batch looked like a change that the next one has to confirm."""
        return self._doubts > 0

    def look(self, innovation: Innovation, posterior: Array, confirmations: int = 1) -> Change | None:
        """What the newest batch adds; a change, if there is one and so many further batches say so too."""
        self._newest.append(innovation)
        self._seen += 1
        tests = [
            (name, m, test)
            for name, columns in self._hypotheses.items()
            for m in WINDOWS
            if len(self._newest) >= m and (test := _Test.of(list(self._newest)[-m:], columns, posterior)) is not None
        ]
        alarms = [name for name, m, test in tests if test.exceeds(self._ratios[name, m])]
        if self._seen <= FEWEST or not alarms:
            self._learn(tests, innovation)
            self._doubts = 0
            return None
        self._doubts += 1
        return self._likeliest(sorted(set(alarms)), posterior) if self._doubts > confirmations else None

    def _learn(self, tests: list[tuple[str, int, _Test]], innovation: Innovation) -> None:
        for name, m, test in tests:
            if self._seen % m == 0:
                ratios = self._ratios[name, m]
                ratios.append(test.noise(_colour(ratios)))
        self._usual.append(innovation.energy / max(innovation.rows, 1.0))

    def _likeliest(self, names: list[str], posterior: Array) -> Change:
        """The hypothesis, and the start, that take most of the energy, if they take enough of the excess."""
        newest = list(self._newest)
        best: tuple[float, Change] | None = None
        for name in names:
            columns = self._hypotheses[name]
            for m in range(2, len(newest) + 1):
                test = _Test.of(newest[-m + 1 :], columns, posterior)
                if test is None:
                    continue
                size, covariance = test.size(_colour(self._ratios[name, 1]))
                part = float(np.clip(newest[-m].share(columns, size), 0.0, 1.0))
                gain = newest[-m].gain(columns, part * size)
                gain += sum(one.gain(columns, size) for one in newest[-m + 1 :])
                since = newest[-m].start + (1.0 - part) * (newest[-m + 1].start - newest[-m].start)
                if best is None or gain > best[0]:
                    best = gain, Change(name, m - 1, since, size, covariance, tuple(newest))
        if best is None:
            return Change("", len(newest) - 1, newest[0].start, np.zeros(0), np.zeros((0, 0)), tuple(newest))
        gained, change = best
        usual = float(np.median(self._usual))
        excess = sum(one.energy - usual * one.rows for one in newest[-change.batches - 1 :])
        explained = gained >= HALF * excess
        return change if explained else replace(change, name="")


def _colour(ratios: deque[float]) -> float:
    return max(float(np.mean(ratios)), 1.0)


@dataclass(frozen=True, eq=False)
class _Test:
    """Score and covariances of some batches in directions that they show, of unit information."""

    score: Array
    model: Array
    directions: Array

    @classmethod
    def of(cls, batches: list[Innovation], columns: Indices, posterior: Array) -> _Test | None:
        information = batches[0].information[columns]
        score = batches[0].score[columns]
        for one in batches[1:]:
            information, score = information + one.information[columns], score + one.score[columns]
        own = information[:, columns]
        size = np.sqrt(np.maximum(np.diag(own), 0.0))
        unit = np.divide(1.0, size, out=np.zeros_like(size), where=size > 0.0)
        values, vectors = np.linalg.eigh(own * np.outer(unit, unit))
        seen = values > max(RANK_TOLERANCE * values.max(initial=0.0), np.finfo(np.float64).tiny)
        if not seen.any():
            return None
        W = unit[:, None] * vectors[:, seen] / np.sqrt(values[seen])
        rows = W.T @ information
        return cls(W.T @ score, rows @ posterior @ rows.T, W)

    @property
    def rank(self) -> int:
        return len(self.score)

    def exceeds(self, ratios: deque[float]) -> bool:
        """Whether noise of the colour seen so far, and the model's own uncertainty, do not explain the score."""
        covariance = _colour(ratios) * np.eye(self.rank) + self.model
        statistic = float(self.score @ np.linalg.solve(covariance, self.score)) / self.rank
        return statistic > float(fdtri(self.rank, max(len(ratios) - 1, 1) * self.rank, 1.0 - LEVEL))

    def noise(self, colour: float) -> float:
        """What the colour would be by this test alone: of the score's energy the noise's share."""
        share = colour / (colour + np.trace(self.model) / self.rank)
        return float(self.score @ self.score) / self.rank * float(share)

    def size(self, colour: float) -> tuple[Array, Array]:
        """Least squares of the change, and its covariance."""
        covariance = self.directions @ (colour * np.eye(self.rank) + self.model) @ self.directions.T
        return self.directions @ self.score, covariance
