"""Which family of motions an experiment has; see :mod:`population.motions` for the distributions."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from casysid.excitation import FourierSeries, JointLimits, build_excitation, design_excitation
from casysid.excitation.motion.fourier import ExcitationTrajectory
from casysid.robot import Robot
from population.drawing import chance, log_uniform, pick
from population.mechanisms import Mechanism
from population.motions import (
    KINDS,
    RESTS,
    Family,
    Motion,
    Resting,
    State,
    chirp,
    fourier,
    point_to_point,
    quintic,
    trapezoid,
)

MOST_DESIGNED, ITERATIONS = 4, 12
"""Joints and iterations of a design, so that it takes a second or two."""
HARMONICS = 5


@dataclass(frozen=True, eq=False)
class Designed:
    """A designed series, repeated; it starts at rest."""

    trajectory: ExcitationTrajectory

    def at(self, time: np.ndarray) -> State:
        """At times (N,), [s]."""
        motion = self.trajectory.motion(time)
        return State(motion.position, motion.velocity, motion.acceleration)


def draw_family(rng: np.random.Generator, mechanism: Mechanism, file: Robot, kind: str | None = None) -> Family:
    """The family of an experiment; ``file`` is what a motion is designed for."""
    joints = mechanism.robot.nv
    kind = kind or pick(rng, KINDS if joints <= MOST_DESIGNED else {k: w for k, w in KINDS.items() if k != "designed"})
    family = _plain(rng, mechanism, file, kind)
    if not chance(rng, RESTS):
        return family
    resting = rng.random(joints) < 0.35
    always = resting & (rng.random(joints) < 0.5)
    if always.all() or not resting.any():
        return family
    return _with_rests(family, resting & ~always, always, rng.uniform(0.5, 1.5))


def _plain(rng: np.random.Generator, mechanism: Mechanism, file: Robot, kind: str) -> Family:
    limits = mechanism.limits
    moving = np.zeros(len(limits.speed), dtype=bool)
    match kind:
        case "fourier":
            top, base = float(log_uniform(rng, 0.3, 3.0)), float(log_uniform(rng, 0.05, 0.2))
            count = int(np.clip(round(top / base), 2, 30))
            draw = fourier(base, count, rng.uniform(0.0, 1.5), limits)
            return Family(kind, draw, draw, base * count, moving)
        case "chirp":
            high = float(log_uniform(rng, 0.5, 4.0))
            draw = chirp(rng.uniform(0.05, 0.2), high, limits)
            return Family(kind, draw, draw, high, moving)
        case "point to point":
            profile = quintic if chance(rng, 0.5) else trapezoid(rng.uniform(0.15, 0.5))
            draw = point_to_point(profile, 0.0 if chance(rng, 1 / 3) else 1.5, limits)
            return Family(kind, draw, draw, float(np.median(limits.speed / limits.half_range)), moving)
        case _:
            return _designed(rng, mechanism, file)


def _designed(rng: np.random.Generator, mechanism: Mechanism, file: Robot) -> Family:
    """Designed once; what is judged moves along random series of the same frequencies."""
    limits = mechanism.limits
    natural = float(np.median(limits.speed / (2.0 * np.pi * limits.half_range)))
    series = FourierSeries(float(np.clip(3.0 / natural, 4.0, 20.0)), HARMONICS)

    def draw(rng: np.random.Generator, duration: float) -> Motion:
        free = np.full(len(limits.speed), np.inf)
        bounds = JointLimits(
            lower=-limits.half_range,
            upper=limits.half_range,
            velocity=limits.speed,
            acceleration=limits.acceleration,
            jerk=free,
            torque=free,
        )
        problem = build_excitation(file, series=series, limits=bounds, rate=100.0, clearance=None)
        seed = int(rng.integers(2**31))
        return Designed(design_excitation(problem, starts=1, seed=seed, max_iterations=ITERATIONS).trajectory)

    fresh = fourier(1.0 / series.period, HARMONICS, 0.5, limits)
    return Family("designed", draw, fresh, HARMONICS / series.period, np.zeros(len(limits.speed), dtype=bool))


def _with_rests(family: Family, partly: np.ndarray, always: np.ndarray, ramp: float) -> Family:
    def resting(inner: Motion, rng: np.random.Generator, duration: float) -> Motion:
        half = duration / 2.0
        intervals = tuple(
            tuple(sorted_pair(rng, begin, begin + half - 2.0 * ramp) for begin in (ramp, half + ramp)) if rests else ()
            for rests in partly
        )
        return Resting(inner, always, intervals, ramp)

    return dataclasses.replace(
        family,
        draw=lambda rng, duration: resting(family.draw(rng, duration), rng, duration),
        draw_fresh=lambda rng, duration: resting(family.draw_fresh(rng, duration), rng, duration),
        at_rest=always,
        rests=True,
    )


def sorted_pair(rng: np.random.Generator, low: float, high: float) -> tuple[float, float]:
    """Begin and end of an interval between two times."""
    begin, end = np.sort(rng.uniform(low, max(high, low + 0.1), 2))
    return float(begin), float(end)
