"""What a robot file can hold of a richer friction: viscous and Coulomb coefficients that come nearest to its torque."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.optimize import lsq_linear

from casysid.arrays import Array
from casysid.dynamics import Coulomb, Offset, Regressor, Viscous
from casysid.moments import Moments

JOINT_KINDS = ("viscous", "coulomb", "offset", "armature")
"""Parameters of a drive that every joint may have, and a robot file or a report has a place for."""
PLAIN = (Viscous.kind, Coulomb.kind)


def homeless_columns(regressor: Regressor) -> list[str]:
    """Names of the drive columns that a robot file has no place for."""
    return [
        parameter.name
        for parameter in regressor.parameters[10 * len(regressor.robot.links) :]
        if parameter.kind not in JOINT_KINDS or parameter.owner not in regressor.robot.dofs
    ]


def nearest_plain_friction(
    regressor: Regressor, theta: Array, moments: Moments, homeless: Sequence[str]
) -> dict[str, Array]:
    """Viscous and Coulomb coefficients by degree of freedom, shape (nv,) each, that stand for other friction too.

    On the fitted motions, the torque of each joint's friction with its other columns is nearest to that of these
    coefficients and an offset. Joints without other columns keep theirs; armature, springs and other kinds that take
    no energy out of the motion are no friction.

    Args:
        regressor: Whose columns these are.
        theta: Their values, shape (p,).
        moments: Of the fitted motions.
        homeless: Names of the columns that a robot file has no place for.
    """
    places = {name: k for k, name in enumerate(regressor.names)}
    friction = {column for part in regressor.parts if part.kind.is_friction for column in part.columns}
    moments = moments.away_from_rest()
    found = {kind: np.zeros(len(moments.joints)) for kind in PLAIN}
    for joint, dof in enumerate(moments.joints):
        row, squares = moments.of_joint(joint)
        gram = np.zeros((len(places), len(places)))
        gram[row[:, None], row] = squares[:, :-1, :-1].sum(axis=0)
        own = {kind: places[name] for kind in PLAIN if (name := f"{dof}.{kind}") in places}
        other = [places[name] for name in homeless if places[name] in friction]
        other = [column for column in other if gram[column, column] > 0.0]
        values = {kind: float(theta[column]) for kind, column in own.items()}
        if own and other:
            offset = [places[name] for name in (f"{dof}.{Offset.kind}",) if name in places]
            values = dict(zip(own, _nearest(gram, [*own.values()], offset, other, theta), strict=True))
        for kind, value in values.items():
            found[kind][joint] = value
    return found


def _nearest(gram: Array, own: list[int], offset: list[int], other: list[int], theta: Array) -> Array:
    """Non-negative coefficients of ``own`` whose torque with an offset is nearest to that of ``own`` and ``other``."""
    kept = [*own, *offset, *other]
    values, vectors = np.linalg.eigh(gram[np.ix_(kept, kept)])
    root = np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T
    target = theta[kept].copy()
    target[len(own) : len(own) + len(offset)] = 0.0
    free = len(own) + len(offset)
    lower = np.append(np.zeros(len(own)), np.full(len(offset), -np.inf))
    return np.asarray(lsq_linear(root[:, :free], root @ target, bounds=(lower, np.inf)).x[: len(own)])
