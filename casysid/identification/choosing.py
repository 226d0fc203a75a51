"""All that the data choose before a method is asked: band, clock, signs, delay, friction and gains, in this order.

Gains are judged without springs, counterweights and friction that grows with the load: these take part of what a wrong
gain leaves.
"""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from casysid.arrays import Array
from casysid.dynamics import JointUse, Regressor
from casysid.errors import CasysidWarning
from casysid.identification.aside import gains_of_the_rest
from casysid.identification.choices import Choices
from casysid.identification.mistakes import MOST_DOFS, find_mistakes, torque_signs
from casysid.identification.passes import Mapped, Passes, excerpts, is_long
from casysid.identification.settings import Settings
from casysid.identification.tuning.band import BandChoice, choose_band
from casysid.identification.tuning.candidates import (
    Candidates,
    final_regressor,
    gather_candidates,
    moments_of,
    with_torque_gains,
)
from casysid.identification.tuning.clock import choose_clock
from casysid.identification.tuning.delay import choose_delay
from casysid.identification.tuning.friction_selection import FrictionChoice, fit_model, select_friction
from casysid.identification.tuning.ripples import ripple_uses
from casysid.identification.unknown_forces import describe_equations, has_unknown_forces
from casysid.moments import Moments
from casysid.recording import Source
from casysid.robot import Robot

Progress = Callable[[str, float], None]
"""Called with the stage and the share of it that is done."""


@dataclass(frozen=True, eq=False)
class Chosen:
    """Choices, the regressor and the moments that they led to, and passes over all and over what was looked at."""

    choices: Choices
    regressor: Regressor
    moments: Moments
    passes: Passes
    looked_at: Passes


def choose(
    robot: Robot, recordings: Sequence[Source], settings: Settings, progress: Progress, mapped: Mapped
) -> Chosen:
    """Band, clock, delay, friction and gains, each given those before; recordings are smoothed anew for a new clock."""
    settings = _within_reach(robot, recordings, settings)
    whole, recordings = recordings, excerpts(recordings, mapped)
    band = choose_band(whole, settings.cutoff)
    passes, candidates = _gather(robot, recordings, band, settings)
    progress("tuning", 0.3)
    clock = choose_clock(passes, candidates, settings.time_scale, settings.quasi_static)
    if clock.reason:
        warnings.warn(clock.reason, CasysidWarning, stacklevel=4)
    settings = dataclasses.replace(settings, quasi_static=clock.quasi_static)
    work = [passes]
    if clock.scale != 1.0 or clock.quasi_static:
        whole, recordings = (tuple(one.with_time_scaled(clock.scale) for one in some) for some in (whole, recordings))
        band = choose_band(whole, settings.cutoff)
        passes, candidates = _gather(robot, recordings, band, settings)
        work.append(passes)
    mistakes = () if has_unknown_forces(recordings) else find_mistakes(robot, passes.sparse_motions, band.cutoff)
    for mistake in mistakes:
        warnings.warn(mistake.sentence, CasysidWarning, stacklevel=4)
    signs = np.ones(robot.nv) if settings.torque_gains is not None else torque_signs(mistakes, robot.dofs)
    measured = _with_gains(settings, signs)
    if (signs < 0.0).any():
        candidates = with_torque_gains(candidates, passes, measured)
    progress("tuning", 0.5)
    delay = choose_delay(passes, candidates.base, settings.delay)
    usual = fit_model(candidates, candidates.model(), measured) if candidates.proposals else None
    uses = None if usual is None else ripple_uses(passes, candidates, usual.estimate)
    if uses or not delay.is_none:
        passes, candidates = _gather(robot, recordings, band, measured, delay.seconds, uses)
        work.append(passes)
    progress("tuning", 0.7)
    friction = select_friction(candidates, measured, usual) if usual else FrictionChoice(measured)
    regressor = final_regressor(candidates, measured, [proposal for proposal, _ in friction.taken])
    gains = gains_of_the_rest(moments_of(regressor, candidates, friction.taken), regressor, settings)
    if gains.found:
        warnings.warn(gains.reason, CasysidWarning, stacklevel=4)
        measured = _with_gains(settings, gains.values * signs)
        candidates = with_torque_gains(candidates, passes, measured, uses)
        regressor = final_regressor(candidates, measured, [proposal for proposal, _ in friction.taken])
    moments = moments_of(regressor, candidates, friction.taken)
    friction = dataclasses.replace(
        friction,
        settings=dataclasses.replace(measured, friction=regressor.friction, couplings=regressor.couplings),
    )
    looked_at = passes
    if is_long(whole):
        passes = Passes(
            robot,
            whole,
            band,
            delays=delay.seconds,
            blocks=settings.blocks,
            threads=settings.threads,
            mapped=mapped,
        ).like(passes)
        moments = passes.moments(regressor)
        work.append(passes)
    choices = Choices(
        band=band,
        width=passes.width if settings.coulomb_width is None else np.full(robot.nv, settings.coulomb_width),
        clock=clock,
        mistakes=mistakes,
        delay=delay,
        friction=friction,
        gains=gains,
        signs=signs,
        smoothings=sum(one.smoothings for one in work),
        passes=sum(one.passes for one in work),
        equations=describe_equations(robot, whole),
    )
    return Chosen(choices, regressor, moments, passes, looked_at)


def _within_reach(robot: Robot, recordings: Sequence[Source], settings: Settings) -> Settings:
    """With nothing left to searches whose memory and time grow with the cube of the joints, and said."""
    if robot.nv <= MOST_DOFS or not (settings.choose_friction or settings.delay is None):
        return settings
    warnings.warn(
        f"{robot.name}: of a robot with {robot.nv} degrees of freedom, more than {MOST_DOFS}, neither mistakes of the "
        "log nor the torque's delay and further kinds of friction are looked for; identify a part of it with the rest "
        "held by --lock to have them",
        CasysidWarning,
        stacklevel=5,
    )
    timed = all(one.has_time for one in recordings)
    delay = 0.0 if settings.delay is None and timed else settings.delay
    return dataclasses.replace(settings, choose_friction=False, delay=delay, torque_gains=(1.0,) * robot.nv)


def _with_gains(settings: Settings, gains: Array) -> Settings:
    """With the gains of the joints' torques, where any is not one."""
    return settings if (gains == 1.0).all() else dataclasses.replace(settings, torque_gains=tuple(gains.tolist()))


def _gather(
    robot: Robot,
    recordings: Sequence[Source],
    band: BandChoice,
    settings: Settings,
    delays: Array | None = None,
    uses: Mapping[int, JointUse] | None = None,
) -> tuple[Passes, Candidates]:
    passes = Passes(robot, recordings, band, delays=delays, blocks=settings.blocks, threads=settings.threads)
    return passes, gather_candidates(passes, settings, uses)
