"""How well parameters predict torque on a recording, in a band that no choice moves.

Measured and predicted torque are averaged by the same short windows, a low-pass at a cut-off that comes of the motion
alone, away from the ends of stretches of time; and compared once more as they are, without any low-pass.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array, frozen
from casysid.dynamics import Regressor
from casysid.identification.order import as_given
from casysid.identification.unknown_forces import known_part
from casysid.signals import BandAverage, Motion
from casysid.threads import single_threaded


@dataclass(frozen=True, eq=False)
class TorqueError:
    """Torque error of one parameter vector over some motions.

    Attributes:
        samples: Number of instants.
        relative: ``‖F(τ - τ̂)‖ / ‖F τ‖`` over all joints, ``F`` the average: measured and predicted torque in one band.
        relative_unfiltered: ``‖τ - τ̂‖ / ‖τ‖``, the torque as logged.
        rmse: Root mean square of ``F(τ - τ̂)`` by joint, shape (nv,), [N m].
        relative_by_joint: ``‖F(τ_j - τ̂_j)‖ / ‖F τ_j‖``, shape (nv,).
        times: Middles of each motion's windows, shape (N,) each, [s].
        measured: ``F τ`` of each motion, shape (N, nv) each.
        predictions: ``F τ̂`` of each motion, shape (N, nv) each.
    """

    samples: int
    relative: float
    relative_unfiltered: float
    rmse: Array
    relative_by_joint: Array
    times: tuple[Array, ...]
    measured: tuple[Array, ...]
    predictions: tuple[Array, ...]

    def as_given(self, places: Sequence[int]) -> TorqueError:
        """With the curves of sorted recordings, one of each, in the order in which the recordings were given."""
        times, measured, predictions = (
            as_given(curves, places) for curves in (self.times, self.measured, self.predictions)
        )
        return replace(self, times=times, measured=measured, predictions=predictions)


@single_threaded()
def torque_error(
    regressor: Regressor, parameters: Array, motions: Iterable[Motion], cutoff: float | None
) -> TorqueError:
    """Predict each motion's torque and compare, below ``cutoff`` [Hz] and as logged."""
    return torque_errors(regressor, [parameters], motions, cutoff)[0]


@single_threaded()
def torque_errors(
    regressor: Regressor, parameters: Sequence[Array], motions: Iterable[Motion], cutoff: float | None
) -> tuple[TorqueError, ...]:
    """The same of several parameter vectors, in one pass over the motions."""
    return tuple(sums.error() for sums in error_sums(regressor, parameters, motions, cutoff))


def error_sums(
    regressor: Regressor,
    parameters: Sequence[Array],
    motions: Iterable[Motion],
    cutoff: float | None,
    *,
    curves: int | None = None,
) -> list[ErrorSums]:
    """What :func:`torque_errors` are made of.

    Args:
        regressor: Predicts.
        parameters: Several vectors, shape (p,) each.
        motions: What is predicted.
        cutoff: Of the averages [Hz].
        curves: Of so many motions the times, the measured and the predicted torque are kept; None for all.
    """
    tables = [ErrorSums() for _ in parameters]
    for place, motion in enumerate(motions):
        inner = motion.settled if motion.settled.any() else np.ones(len(motion), dtype=bool)
        weights, remembered = averages_of(motion, cutoff), regressor.histories(motion.q, motion.time)
        known = replace(motion, tau=known_part(regressor.robot, motion, motion.tau))
        for table, theta in zip(tables, parameters, strict=True):
            predicted = regressor.predict(theta, motion.q, motion.v, motion.a, histories=remembered)
            predicted = known_part(regressor.robot, motion, predicted)
            table.add(known, predicted, inner, weights, curves=curves is None or place < curves)
    return tables


class ErrorSums:
    """Sums over all samples, and the averages, of one parameter vector; those of several recordings add."""

    def __init__(self) -> None:
        self._missed = self._felt = 0.0
        self._samples = self._averages = 0
        self._residual: Array | float = 0.0
        self._size: Array | float = 0.0
        self._times, self._measured, self._predictions = list[Array](), list[Array](), list[Array]()

    def add(
        self, motion: Motion, predicted: Array, inner: npt.NDArray[np.bool_], weights: Any, *, curves: bool = True
    ) -> None:
        """One motion, its curves kept or not."""
        self._samples += len(motion)
        self._missed += float(np.sum((motion.tau - predicted)[inner] ** 2))
        self._felt += float(np.sum(motion.tau[inner] ** 2))
        time, measured, guess = (
            frozen(values[inner] if weights is None else weights @ values[inner])
            for values in (motion.time, motion.tau, predicted)
        )
        self._averages += len(time)
        self._residual = self._residual + np.sum((measured - guess) ** 2, axis=0)
        self._size = self._size + np.sum(measured**2, axis=0)
        if curves:
            self._times.append(time)
            self._measured.append(measured)
            self._predictions.append(guess)

    def join(self, other: ErrorSums) -> None:
        """Those of further recordings."""
        self._missed += other._missed
        self._felt += other._felt
        self._samples += other._samples
        self._averages += other._averages
        self._residual = self._residual + other._residual
        self._size = self._size + other._size
        self._times += other._times
        self._measured += other._measured
        self._predictions += other._predictions

    def error(self) -> TorqueError:
        """What came together."""
        residual, size = np.sqrt(np.atleast_1d(self._residual)), np.sqrt(np.atleast_1d(self._size))
        return TorqueError(
            samples=self._samples,
            relative=_ratio(np.linalg.norm(residual), np.linalg.norm(size)),
            relative_unfiltered=_ratio(np.sqrt(self._missed), np.sqrt(self._felt)),
            rmse=frozen(residual / np.sqrt(max(self._averages, 1))),
            relative_by_joint=frozen([_ratio(e, s) for e, s in zip(residual, size, strict=True)]),
            times=tuple(self._times),
            measured=tuple(self._measured),
            predictions=tuple(self._predictions),
        )


def averages_of(motion: Motion, cutoff: float | None) -> Any:
    """Sparse weights of the averages over a motion's settled samples; None without a cut-off."""
    if cutoff is None:
        return None
    inner = np.flatnonzero(motion.settled) if motion.settled.any() else np.arange(len(motion))
    return BandAverage(motion.time, cutoff).weights(inner)


def _ratio(error: float | np.floating, size: float | np.floating) -> float:
    """Error over size; infinite when there is an error and nothing to compare it with."""
    if size > 0:
        return float(error / size)
    return 0.0 if error == 0 else float("inf")
