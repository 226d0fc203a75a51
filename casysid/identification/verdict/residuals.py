"""Whether what the model misses still follows the motion: then something is missing from the model, and not noise."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from casysid.arrays import Array
from casysid.dynamics import continued_positions
from casysid.identification.prediction import TorqueError
from casysid.identification.result import IdentificationResult
from casysid.identification.verdict.criteria import Criterion, Word
from casysid.identification.verdict.explained import Unexplained
from casysid.signals import Motion

STRUCTURED = 0.3
"""Share of a joint's varying torque that is missed and follows position, velocity or acceleration."""
SHARPNESS = 0.02
"""Width of the smooth sign in root mean square velocities."""
ENOUGH = 4
"""Samples for every function of the motion that is tried."""


def residual_criteria(unexplained: Unexplained) -> Iterator[Criterion]:
    """Of every joint that is not set aside."""
    result = unexplained.result
    motions = result.held_out_motions if result.held_out else result.train_motions
    shares = structure(result, unexplained.judge, motions)
    for dof, share, quantity in shares:
        if dof in unexplained.set_aside:
            continue
        yield Criterion(
            name="residual follows the motion",
            joint=dof,
            value=share,
            limit=STRUCTURED,
            word=Word.DOUBTFUL,
            reason=f"What is missed of the torque of {dof} follows its {quantity} ({share:.0%} of the torque): "
            "the model lacks something. Look for friction, springs or couplings that it does not have.",
            origin="as the torque that a joint may miss",
        )


def structure(
    result: IdentificationResult, error: TorqueError, motions: Sequence[Motion]
) -> Iterator[tuple[str, float, str]]:
    """For each joint the share of its varying torque that is missed and follows its own motion, and which quantity."""
    if len(motions) != len(error.times):
        return
    q, v, a = (np.concatenate(x) for x in zip(*map(_at, motions, error.times, [result] * len(motions)), strict=True))
    measured, predicted = np.concatenate(error.measured), np.concatenate(error.predictions)
    for k, dof in enumerate(result.robot.dofs):
        varying = float(np.linalg.norm(measured[:, k] - measured[:, k].mean()))
        missed = measured[:, k] - predicted[:, k]
        width = SHARPNESS * float(np.sqrt(np.mean(v[:, k] ** 2))) + 1e-12
        tries = {
            "position": np.column_stack([f(n * q[:, k]) for n in (1, 2) for f in (np.sin, np.cos)]),
            "velocity": np.column_stack([v[:, k], np.tanh(v[:, k] / width), v[:, k] * np.abs(v[:, k])]),
            "acceleration": np.column_stack([a[:, k], a[:, k] * np.abs(a[:, k])]),
        }
        shares = {name: _followed(columns, missed) for name, columns in tries.items()}
        best = max(shares, key=lambda name: shares[name])
        yield dof, shares[best] / varying if varying > 0.0 else 0.0, best


def _followed(columns: Array, missed: Array) -> float:
    """Root of the energy of the residual that columns explain beyond what chance would, about the mean."""
    columns = columns - columns.mean(axis=0)
    size = np.maximum(np.sqrt(np.mean(columns**2, axis=0)), 1e-300)
    samples, count = columns.shape
    if samples < ENOUGH * count:
        return 0.0
    centred = missed - missed.mean()
    fitted = (columns / size) @ np.linalg.lstsq(columns / size, centred, rcond=1e-8)[0]
    total = float(centred @ centred)
    return float(np.sqrt(max(float(fitted @ fitted) - total * count / samples, 0.0)))


def _at(motion: Motion, time: Array, result: IdentificationResult) -> tuple[Array, Array, Array]:
    """Positions, velocities and accelerations at the times of the averages."""
    q = continued_positions(result.robot, motion.q)
    if len(time) == len(motion):
        return q, motion.v, motion.a
    q, v, a = (
        np.column_stack([np.interp(time, motion.time, column) for column in x.T]) for x in (q, motion.v, motion.a)
    )
    return q, v, a
