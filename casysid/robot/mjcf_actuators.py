"""What MuJoCo's actuators mean for the joints they turn: reflected inertia and damping, limits of torque."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from casysid.arrays import Array

_JOINT_TRANSMISSIONS = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))
_SCALAR_JOINTS = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))


def scalar_joint_of_actuator(compiled: Any, k: int) -> int | None:
    """The hinge or slide that actuator k turns; None for other transmissions."""
    if int(compiled.actuator_trntype[k]) not in _JOINT_TRANSMISSIONS:
        return None
    j = int(compiled.actuator_trnid[k, 0])
    return j if int(compiled.jnt_type[j]) in _SCALAR_JOINTS else None


def actuator_reflection(compiled: Any) -> tuple[Array, Array]:
    """Armature and damping (nv,) that actuators add to hinges and slides, multiplied by gear²."""
    armature, damping = np.zeros(compiled.nv), np.zeros(compiled.nv)
    for k in range(compiled.nu):
        j = scalar_joint_of_actuator(compiled, k)
        if j is not None:
            square = float(compiled.actuator_gear[k, 0]) ** 2
            armature[compiled.jnt_dofadr[j]] += square * compiled.actuator_armature[k]
            damping[compiled.jnt_dofadr[j]] += square * compiled.actuator_damping[k]
    return armature, damping


def effort_limit(compiled: Any, j: int) -> float:
    """The largest torque or force on a hinge or slide, either way: its own limit, and that of all its actuators."""
    actuators = [k for k in range(compiled.nu) if scalar_joint_of_actuator(compiled, k) == j]
    together = sum(_actuator_limit(compiled, k) for k in actuators) if actuators else np.inf
    own = _both_ways(compiled.jnt_actfrcrange[j]) if compiled.jnt_actfrclimited[j] else np.inf
    return float(min(together, own))


def _both_ways(limits: Array) -> float:
    """The smaller magnitude of a range, or the larger for what pushes one way only."""
    return float(np.abs(limits).min() or np.abs(limits).max())


def _actuator_limit(compiled: Any, k: int) -> float:
    gear = abs(float(compiled.actuator_gear[k, 0]))
    limit = np.inf
    if compiled.actuator_forcelimited[k]:
        limit = gear * _both_ways(compiled.actuator_forcerange[k])
    direct = (
        compiled.actuator_gaintype[k] == mujoco.mjtGain.mjGAIN_FIXED
        and compiled.actuator_biastype[k] == mujoco.mjtBias.mjBIAS_NONE
        and compiled.actuator_dyntype[k] == mujoco.mjtDyn.mjDYN_NONE
    )
    if direct and compiled.actuator_ctrllimited[k]:
        gain = abs(float(compiled.actuator_gainprm[k, 0]))
        limit = min(limit, gear * gain * _both_ways(compiled.actuator_ctrlrange[k]))
    return limit
