"""How well parameters predict torque on a recording, in a band that no choice moves.

Measured and predicted torque are averaged by the same short windows, a low-pass at a cut-off that comes of the motion
alone, away from the ends of stretches of time; and compared once more as they are, without any low-pass.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array, frozen
from casysid.dynamics import Regressor
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
    tables = [_Table() for _ in parameters]
    for motion in motions:
        inner = motion.settled if motion.settled.any() else np.ones(len(motion), dtype=bool)
        weights = averages_of(motion, cutoff)
        for table, theta in zip(tables, parameters, strict=True):
            predicted = regressor.predict(theta, motion.q, motion.v, motion.a, time=motion.time)
            table.add(motion, predicted, inner, weights)
    return tuple(table.error() for table in tables)


class _Table:
    """Sums over all samples, and the averages, of one parameter vector."""

    def __init__(self) -> None:
        self._missed = self._felt = 0.0
        self._samples = 0
        self._times, self._measured, self._predictions = list[Array](), list[Array](), list[Array]()

    def add(self, motion: Motion, predicted: Array, inner: npt.NDArray[np.bool_], weights: Any) -> None:
        """One motion."""
        self._samples += len(motion)
        self._missed += float(np.sum((motion.tau - predicted)[inner] ** 2))
        self._felt += float(np.sum(motion.tau[inner] ** 2))
        for kept, values in (
            (self._times, motion.time),
            (self._measured, motion.tau),
            (self._predictions, predicted),
        ):
            kept.append(frozen(values[inner] if weights is None else weights @ values[inner]))

    def error(self) -> TorqueError:
        """What came together."""
        return _error(self._samples, self._missed, self._felt, self._times, self._measured, self._predictions)


def _error(
    samples: int,
    missed: float,
    felt: float,
    times: Sequence[Array],
    measured: Sequence[Array],
    predictions: Sequence[Array],
) -> TorqueError:
    difference = np.concatenate(measured) - np.concatenate(predictions)
    residual = np.linalg.norm(difference, axis=0)
    size = np.linalg.norm(np.concatenate(measured), axis=0)
    return TorqueError(
        samples=samples,
        relative=_ratio(np.linalg.norm(residual), np.linalg.norm(size)),
        relative_unfiltered=_ratio(np.sqrt(missed), np.sqrt(felt)),
        rmse=frozen(residual / np.sqrt(max(len(difference), 1))),
        relative_by_joint=frozen([_ratio(e, s) for e, s in zip(residual, size, strict=True)]),
        times=tuple(times),
        measured=tuple(measured),
        predictions=tuple(predictions),
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
