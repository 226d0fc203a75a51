"""Equations of robots with a free base of which some forces are not known, and what can be chosen from them."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from casysid.accumulation import Mask, accumulate_moments
from casysid.arrays import Array
from casysid.dynamics import Regressor
from casysid.errors import RecordingError
from casysid.estimation import Estimate
from casysid.floating import (
    Contact,
    check_contacts,
    free_projector,
    projected_moments,
    unknown_directions,
)
from casysid.floating.accumulation import PIECE
from casysid.identification.settings import Settings
from casysid.kinematics import Kinematics
from casysid.moments import Moments
from casysid.recording import Source
from casysid.robot import JointKind, Robot
from casysid.signals import BandAverage, Motion


def has_unknown_forces(recordings: Sequence[Source | Motion]) -> bool:
    """Whether some torques or contact forces were not measured."""
    return any(one.unmeasured or one.contacts for one in recordings)


def is_free(robot: Robot) -> bool:
    """Whether the robot's base is free, so that its rows hold without any torque."""
    return robot.joints[0].kind is JointKind.FREE_FLYER


def settings_for(robot: Robot, recordings: Sequence[Source], settings: Settings) -> Settings:
    """The settings, and where forces are not known, no choice of what only a joint's own equation shows.

    Friction is the plain one, torques come on time and in one scale, unless the settings say otherwise.

    Raises:
        RecordingError: Some recordings lack forces that others have: their equations are different ones.
    """
    if not has_unknown_forces(recordings):
        return settings
    first = recordings[0]
    for other in recordings[1:]:
        if (set(other.unmeasured), set(other.contacts)) != (set(first.unmeasured), set(first.contacts)):
            raise RecordingError(
                f"{other.label}: other forces are unknown than in {first.label}; identify them one after the other"
            )
    return dataclasses.replace(
        settings,
        choose_friction=False,
        time_scale=1.0 if settings.time_scale is None else settings.time_scale,
        delay=0.0 if settings.delay is None else settings.delay,
        torque_gains=(1.0,) * robot.nv if settings.torque_gains is None else settings.torque_gains,
    )


def describe_equations(robot: Robot, recordings: Sequence[Source]) -> str:
    """Which equations are fitted, in words; empty for a robot whose base is fixed."""
    if not is_free(robot):
        return ""
    first = recordings[0]
    measured = f", with measured wrenches at {', '.join(first.wrenches)}" if first.wrenches else ""
    if first.unmeasured and len(first.unmeasured) == robot.nv - 6:
        return f"equations: the six of the base alone, as no joint has a torque{measured}"
    missing = f" but those of {', '.join(first.unmeasured)}" if first.unmeasured else ""
    if first.contacts:
        return (
            f"equations: what contact forces at {', '.join(first.contacts)} do not enter while they touch "
            f"(null space of the contact Jacobians){missing}{measured}"
        )
    return f"equations: all of base and joints{missing}{measured}"


def moments_of_known(
    regressor: Regressor,
    motion: Motion,
    average: BandAverage | None,
    *,
    near_rest: Mask | None,
    blocks: int,
    threads: int,
) -> Moments:
    """Moments of the equations in which all forces are known.

    Raises:
        RecordingError: A frame moves while it is said to touch.
    """
    inputs = (regressor, motion.q, motion.v, motion.a, motion.tau)
    if motion.contacts:
        contacts = _contacts(motion)
        check_contacts(Kinematics(regressor.robot), motion.q, motion.v, contacts)
        return projected_moments(
            *inputs, contacts=contacts, unmeasured=motion.unmeasured, average=average, blocks=blocks
        )
    valid = None
    if motion.unmeasured:
        known = np.array([dof not in motion.unmeasured for dof in regressor.robot.dofs])
        valid = np.broadcast_to(known, motion.tau.shape)
    return accumulate_moments(
        *inputs, average=average, valid=valid, near_rest=near_rest, blocks=blocks, threads=threads
    )


def with_noise_of_known(estimate: Estimate, moments: Moments) -> Estimate:
    """The estimate, with noise of one where no equation tells it: whatever weighs such rows weighs zeros."""
    known = np.asarray(moments.count.any(axis=0))
    if known.all() or len(known) != len(estimate.noise_std):
        return estimate
    return dataclasses.replace(estimate, noise_std=np.where(known, estimate.noise_std, 1.0))


def known_part(robot: Robot, motion: Motion, torque: Array) -> Array:
    """What of torques, shape (N, nv), the equations show in which all forces are known; the torques if all are."""
    if not (motion.contacts or motion.unmeasured):
        return torque
    if not motion.contacts:
        return np.where([dof in motion.unmeasured for dof in robot.dofs], 0.0, torque)
    kinematics, known = Kinematics(robot), np.empty_like(torque)
    for first in range(0, len(motion), PIECE):
        rows = slice(first, first + PIECE)
        part = motion.rows(rows)
        P = free_projector(unknown_directions(kinematics, part.q, _contacts(part), motion.unmeasured))
        known[rows] = np.einsum("nij,nj->ni", P, torque[rows])
    return known


def _contacts(motion: Motion) -> list[Contact]:
    assert motion.touching is not None
    return [
        Contact(frame=frame, touching=flags) for frame, flags in zip(motion.contacts, motion.touching.T, strict=True)
    ]
