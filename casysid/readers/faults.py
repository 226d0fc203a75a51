"""Faults of whole columns, and of the clock, that are mended once a scan has shown them."""

from __future__ import annotations

import dataclasses

import numpy as np

from casysid.errors import RecordingError
from casysid.readers.angles import angle_joints
from casysid.readers.columns import Layout
from casysid.readers.messages import listing
from casysid.readers.repairs import Glitches
from casysid.readers.samples import Samples
from casysid.readers.statistics import FASTEST, JUMP, SINGLE, Statistics
from casysid.readers.survey import Survey
from casysid.readers.units import SLOWEST
from casysid.robot import Robot

COARSEST = 0.025
"""Smallest leap of a glitch [rad, m]: encoders of eight bits have steps of 2π / 256."""
TORQUES = 10.0
"""A torque beyond so many effort limits is a glitch if its neighbours are within one."""
FAST = 0.01
"""Of the steps may be faster than the joint's limit when the unit of time was guessed."""


def glitches_of(robot: Robot, layout: Layout) -> Glitches:
    """What no motion of the robot is."""
    speed, turns = {}, []
    for joint in robot.joints:
        if joint.kind in SINGLE:
            limit, column = float(robot.velocity_limit[joint.v.start]), layout.position[joint.channels.start]
            speed[column] = JUMP * limit if np.isfinite(limit) and limit > 0.0 else FASTEST
    for joint in angle_joints(robot):
        turns.append(layout.position[joint.channels.start])
    torque = {
        column: TORQUES * float(limit)
        for column, limit in zip(layout.torque, robot.effort_limit, strict=True)
        if np.isfinite(limit) and limit > 0.0
    }
    return Glitches(speed=speed, step=COARSEST, turns=tuple(turns), torque=torque)


def emptied(samples: Samples, survey: Survey, robot: Robot) -> tuple[Samples, str] | None:
    """Without columns that hold nothing throughout, and without velocities that have holes where there is time."""
    layout, empty = samples.layout, survey.emptied()
    for word in ("velocity", "acceleration"):
        columns = getattr(layout, word)
        if columns and layout.clock is not None and any(survey.empty[name] > survey.nothing for name in columns):
            said = f"{word} has empty cells and is left aside; positions tell it"
            return samples.laid_out(**{word: None}), said
    silent = [name for name in empty if name in layout.torque and name not in layout.position]
    if not silent or len(silent) == len(layout.torque):
        return None
    joints = [dof for dof, column in zip(robot.dofs, layout.torque, strict=True) if column in silent]
    locks = " ".join(f"--lock {joint}=VALUE" for joint in joints)
    return samples.laid_out(unmeasured=(*layout.unmeasured, *silent)), (
        f"{listing(silent)} is empty throughout: no torque is measured at {listing(joints)}, of which nothing can be "
        f"identified then; hold it: {locks}"
    )


def decided_unit(samples: Samples, survey: Survey, statistics: Statistics) -> tuple[Samples, str] | None:
    """With the clock's unit, where nothing says it and the steps do.

    Raises:
        RecordingError: Two units are as likely.
    """
    clock = samples.layout.clock
    if clock is None or clock.units != (None,) or not survey.step >= SLOWEST:
        return None
    step = survey.step
    unit, size = next((one for one in (("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9)) if step * one[1] < 0.5), ("ns", 1e-9))
    decided = samples.laid_out(clock=dataclasses.replace(clock, units=(unit,))).with_clock_started()
    return decided, (
        f"time is taken as {unit}: its steps are {step:.6g}, which makes {1.0 / (step * size):.6g} samples a second; "
        "--units time=UNIT says otherwise"
    )


def too_fast(statistics: Statistics, robot: Robot, unit: str | None) -> None:
    """Nothing, if joints keep to their speeds in a unit of time that was guessed.

    Raises:
        RecordingError: They do not.
    """
    if not statistics.steps.count:
        return
    positions = statistics.positions(unwrapped=True)
    for joint in angle_joints(robot):
        fast = positions.fast[joint.channels.start] / statistics.steps.count
        if fast > FAST:
            raise RecordingError(
                f"{statistics.label}: time looks like {unit}, but then {joint.name} is faster than its limit in "
                f"{fast:.0%} of the steps; say --units time=UNIT (s, ms, us or ns). Poses held at rest, truly seconds "
                "apart, go in without time and with v = a = 0"
            )
