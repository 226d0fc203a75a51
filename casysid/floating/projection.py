"""What is left of the equations when forces of unknown size act along known directions.

``Y θ = τ + Uᵀ f`` with unknown ``f``: contact Jacobians are rows of U, and so are unit vectors of joints without a
torque sensor. The equations in the null space of U, ``P Y θ = P τ`` with ``P = 1 - U⁺ U``, hold whatever f is (Mistry,
Schaal, Yamane, "Inertial parameter estimation of floating base humanoid systems using partial force sensing", 2009;
Aghili, "A unified approach for inverse and direct dynamics of constrained multibody systems", 2005).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from casysid.arrays import Array
from casysid.errors import ParameterError
from casysid.floating.forces import Contact, name_of
from casysid.kinematics import Axes, Kinematics

DEPENDENT = 1e-9
"""Directions that add less than this share of the largest to those before are the same: rounding, far above 1e-16."""


def unknown_directions(
    kinematics: Kinematics, q: Array, contacts: Sequence[Contact], unmeasured: Sequence[str] = ()
) -> Array:
    """``U`` at every sample, shape (N, k, nv); rows of frames that do not touch are zero.

    Args:
        kinematics: Of the robot.
        q: Configurations, shape (N, nq).
        contacts: Frames that touch with unknown wrenches.
        unmeasured: Degrees of freedom whose torques are not known.

    Raises:
        ParameterError: A shape does not fit, or there is no such frame or degree of freedom.
    """
    robot, parts = kinematics.robot, [np.zeros((len(q), 0, kinematics.robot.nv))]
    for contact in contacts:
        if len(contact.touching) != len(q):
            raise ParameterError(
                f"contact of {name_of(contact.frame)}: wanted a flag for each of {len(q)} samples; got "
                f"{len(contact.touching)}"
            )
        rows = kinematics.jacobians(contact.frame, q, Axes.FRAME)[:, : contact.rows]
        parts.append(rows * contact.touching[:, None, None])
    for name in unmeasured:
        if name not in robot.dofs:
            raise ParameterError(
                f"unmeasured: robot '{robot.name}' has no degree of freedom '{name}'; it has {robot.dofs}"
            )
        unit = np.eye(robot.nv)[robot.dofs.index(name)]
        parts.append(np.broadcast_to(unit, (len(q), 1, robot.nv)))
    return np.concatenate(parts, axis=1)


def free_projector(directions: Array) -> Array:
    """``P = 1 - U⁺ U`` at every sample, shape (N, nv, nv), symmetric; one where U is zero."""
    nv = directions.shape[2]
    P = np.broadcast_to(np.eye(nv), (len(directions), nv, nv))
    if not directions.shape[1]:
        return P
    _, s, Vt = np.linalg.svd(directions, full_matrices=False)
    taken = Vt * (s > DEPENDENT * s[:, :1])[:, :, None]
    return np.asarray(P - np.swapaxes(taken, 1, 2) @ taken)
