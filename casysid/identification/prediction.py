"""How well parameters predict torque on a recording."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from casysid.arrays import Array, frozen
from casysid.dynamics import Regressor
from casysid.signals import Motion


@dataclass(frozen=True, eq=False)
class TorqueError:
    """Torque error of one parameter vector over some motions.

    Attributes:
        samples: Number of instants.
        relative: ``‖τ - τ̂‖ / ‖τ‖`` over all joints, torque seen through the low-pass of the motion.
        relative_unfiltered: The same against the torque as logged: what no low-pass has flattered.
        rmse: Root mean square of ``τ - τ̂`` by joint, low-passed, shape (nv,), [N m].
        relative_by_joint: ``‖τ_j - τ̂_j‖ / ‖τ_j‖``, low-passed, shape (nv,).
        predictions: ``τ̂`` of each motion, shape (N, nv) each.
    """

    samples: int
    relative: float
    relative_unfiltered: float
    rmse: Array
    relative_by_joint: Array
    predictions: tuple[Array, ...]


def torque_error(regressor: Regressor, parameters: Array, motions: Sequence[Motion]) -> TorqueError:
    """Predict each motion's torque and compare."""
    predictions = tuple(frozen(regressor.predict(parameters, motion.q, motion.v, motion.a)) for motion in motions)
    predicted = np.concatenate(predictions)
    tau = np.concatenate([motion.tau for motion in motions])
    measured = np.concatenate([motion.tau_measured for motion in motions])
    residual = np.linalg.norm(tau - predicted, axis=0)
    size = np.linalg.norm(tau, axis=0)
    return TorqueError(
        samples=len(tau),
        relative=_ratio(np.linalg.norm(residual), np.linalg.norm(size)),
        relative_unfiltered=_ratio(np.linalg.norm(measured - predicted), np.linalg.norm(measured)),
        rmse=frozen(residual / np.sqrt(len(tau))),
        relative_by_joint=frozen([_ratio(e, s) for e, s in zip(residual, size, strict=True)]),
        predictions=predictions,
    )


def _ratio(error: float | np.floating, size: float | np.floating) -> float:
    """Error over size; infinite when there is an error and nothing to compare it with."""
    if size > 0:
        return float(error / size)
    return 0.0 if error == 0 else float("inf")
