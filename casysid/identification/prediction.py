"""How well parameters predict torque on a recording."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from casysid.arrays import Array, frozen
from casysid.dynamics import Regressor
from casysid.signals import Motion, low_passed
from casysid.threads import single_threaded


@dataclass(frozen=True, eq=False)
class TorqueError:
    """Torque error of one parameter vector over some motions.

    Attributes:
        samples: Number of instants.
        relative: ``‖F(τ - τ̂)‖ / ‖F τ‖`` over all joints, ``F`` the zero-phase low-pass: measured and predicted torque
            seen in the same band.
        relative_unfiltered: ``‖τ - τ̂‖ / ‖τ‖``, the torque as logged: what no low-pass has flattered.
        rmse: Root mean square of ``F(τ - τ̂)`` by joint, shape (nv,), [N m].
        relative_by_joint: ``‖F(τ_j - τ̂_j)‖ / ‖F τ_j‖``, shape (nv,).
        measured: ``F τ`` of each motion, shape (N, nv) each.
        predictions: ``F τ̂`` of each motion, shape (N, nv) each.
    """

    samples: int
    relative: float
    relative_unfiltered: float
    rmse: Array
    relative_by_joint: Array
    measured: tuple[Array, ...]
    predictions: tuple[Array, ...]


@single_threaded()
def torque_error(
    regressor: Regressor, parameters: Array, motions: Sequence[Motion], cutoff: float | None
) -> TorqueError:
    """Predict each motion's torque and compare, below ``cutoff`` [Hz] and as logged."""
    raw = [regressor.predict(parameters, motion.q, motion.v, motion.a) for motion in motions]
    measured = tuple(frozen(_seen(motion, motion.tau, cutoff)) for motion in motions)
    predicted = tuple(frozen(_seen(motion, tau, cutoff)) for motion, tau in zip(motions, raw, strict=True))
    residual = np.linalg.norm(np.concatenate(measured) - np.concatenate(predicted), axis=0)
    size = np.linalg.norm(np.concatenate(measured), axis=0)
    logged = np.concatenate([motion.tau for motion in motions])
    return TorqueError(
        samples=len(logged),
        relative=_ratio(np.linalg.norm(residual), np.linalg.norm(size)),
        relative_unfiltered=_ratio(np.linalg.norm(logged - np.concatenate(raw)), np.linalg.norm(logged)),
        rmse=frozen(residual / np.sqrt(len(logged))),
        relative_by_joint=frozen([_ratio(e, s) for e, s in zip(residual, size, strict=True)]),
        measured=measured,
        predictions=predicted,
    )


def _seen(motion: Motion, tau: Array, cutoff: float | None) -> Array:
    return tau if cutoff is None else low_passed(motion.time, tau, cutoff)


def _ratio(error: float | np.floating, size: float | np.floating) -> float:
    """Error over size; infinite when there is an error and nothing to compare it with."""
    if size > 0:
        return float(error / size)
    return 0.0 if error == 0 else float("inf")
