"""Trajectories that keep all limits, to start from: where to stand, and how far to swing about it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from casysid.arrays import Array
from casysid.errors import ParameterError
from casysid.excitation.constraints.constraint import Constraint
from casysid.excitation.design.problem import ExcitationProblem
from casysid.excitation.design.verification import verify
from casysid.excitation.motion.fourier import Motion
from casysid.excitation.search.program import Evaluation

STANDING = 1500
"""Random configurations in which standing is tried."""
SMALL = 0.05
"""Amplitude of the trajectory that is feasible for certain, as a share of half the range."""
_HALVINGS = 7


@dataclass(frozen=True, eq=False)
class Standing:
    """Configurations in which the robot may stand still, best first, shape (m, n)."""

    positions: Array


def find_standing(problem: ExcitationProblem, seed: int) -> Standing:
    """Near the middle of the limits, away from collisions and from torque limits; or where the user wants to start.

    Raises:
        ParameterError: There is none; the message names what is in the way.
    """
    limits, rng = problem.limits, np.random.default_rng(seed)
    if problem.start is not None:
        candidates = problem.start[None]
    else:
        spread = rng.uniform(0.0, 1.0, (STANDING, 1)) * rng.uniform(-1.0, 1.0, (STANDING, len(limits.middle)))
        candidates = np.vstack([limits.middle, limits.middle + 0.9 * spread * limits.half_range])
    still = np.zeros_like(candidates)
    motion = Motion(candidates, still, still, still)
    share = np.min([_room(constraint, motion, problem.tightening) for constraint in problem.constraints], axis=0)
    feasible = share > 0.0
    if not feasible.any():
        raise _refusal(problem, candidates[int(np.argmax(share))])
    away = np.abs((candidates - limits.middle) / limits.half_range).mean(axis=1)
    score = np.minimum(share, 0.1) - 0.1 * away
    order = np.argsort(-np.where(feasible, score, -np.inf))[: int(feasible.sum())]
    return Standing(candidates[order])


def _room(constraint: Constraint, motion: Motion, tightening: float) -> Array:
    """Least slack at each instant as a share of the scale, of the constraint itself and of what the optimiser sees."""
    if not constraint.labels:
        return np.full(len(motion.position), np.inf)
    lower, upper = constraint.bounds
    seen = constraint.constrain(motion)
    smooth = np.minimum(seen - lower, upper - seen).min(axis=1)
    return np.asarray(np.minimum(smooth - tightening, (constraint.slack(motion) / constraint.scale).min(axis=1)))


def _refusal(problem: ExcitationProblem, position: Array) -> ParameterError:
    """What is wrong at the configuration that comes nearest to being allowed."""
    width = problem.series.size
    resting = problem.trajectory(swing(problem, position, np.zeros((len(position), width)), from_there=True))
    worst = verify(problem, resting, 1).violations
    what = str(worst[0]).replace(" at 0 s", "", 1) if worst else "there is no room to move"
    if problem.start is not None:
        return ParameterError(
            f"excitation: the robot cannot stand still at the start given: {what}. Give another start, or correct what "
            "is in the way"
        )
    place = ", ".join(f"{dof} {x:.3g}" for dof, x in zip(problem.robot.dofs, position, strict=True))
    return ParameterError(
        "excitation: found no configuration within the limits in which the robot may stand still; the nearest to one "
        f"({place}) has this wrong: {what}. Correct the limits, obstacles, capsules or the clearance"
    )


def small_motion(problem: ExcitationProblem, standing: Standing, seed: int) -> Array:
    """Variables of a small motion about the best place to stand, verified on the fine grid.

    Raises:
        ParameterError: Even the smallest motion violates something; the message says what.
    """
    rng = np.random.default_rng(seed)
    shape = rng.normal(size=(len(problem.robot.dofs), problem.series.size))
    shape /= np.linalg.norm(shape, axis=1, keepdims=True)
    for place in standing.positions[:20]:
        for amplitude in SMALL * 0.5 ** np.arange(8):
            x = swing(problem, place, amplitude * shape, problem.start is not None)
            if verify(problem, problem.trajectory(x)).passed:
                return x
    worst = verify(problem, problem.trajectory(x)).violations[0]
    raise ParameterError(f"excitation: found no motion at all that keeps the limits: {worst}. Widen the limits")


def swing(problem: ExcitationProblem, place: Array, coordinates: Array, from_there: bool) -> Array:
    """Variables of a motion from a place, or about it; coordinates in units of half ranges."""
    away = problem.series.basis(problem.series.grid(problem.samples)) @ coordinates.T
    shift = np.zeros(len(place)) if from_there else (away.max(axis=0) + away.min(axis=0)) / 2.0
    return np.column_stack([place / problem.limits.half_range - shift, coordinates]).ravel()


def random_start(
    problem: ExcitationProblem, evaluation: Evaluation, standing: Standing, rng: np.random.Generator
) -> Array | None:
    """Variables of a random motion, as large as the limits of the design grid allow; None if there is none there.

    Each joint is first brought to its own limits, then all shrink together until torques and distances allow it.
    """
    n, size = len(problem.robot.dofs), problem.series.size
    fixed = problem.start is not None
    place = standing.positions[0 if fixed else rng.integers(min(len(standing.positions), 30))]
    shape = rng.normal(size=(n, size)) / np.tile(np.arange(1, problem.series.harmonics), 2) ** rng.uniform(0.0, 1.0)
    shape *= _joint_scales(problem, place, shape, fixed)[:, None] * rng.uniform(0.6, 1.0, (n, 1))
    lower, upper = evaluation.bounds(problem.tightening)
    resting = swing(problem, place, 0.0 * shape, fixed)
    whole = swing(problem, place, shape, fixed) - resting
    low, high = 0.0, 1.0
    for k in range(_HALVINGS):
        middle = 1.0 if k == 0 else (low + high) / 2.0
        values = evaluation.constraints(resting + middle * whole)
        if (values >= lower).all() and (values <= upper).all():
            low = middle
            if k == 0:
                break
        else:
            high = middle
    return resting + low * whole if low > 0.0 else None


def _joint_scales(problem: ExcitationProblem, place: Array, shape: Array, fixed: bool) -> Array:
    """How much each joint's shape may grow within its own limits, (n,)."""
    limits, unit = problem.limits, problem.limits.half_range
    time = problem.series.grid(problem.samples)
    moved = problem.trajectory(swing(problem, place, shape, fixed)).motion(time)
    excursion = moved.position - place
    room = [(limits.upper - place) / np.maximum(excursion.max(axis=0), 1e-9 * unit)]
    room.append((place - limits.lower) / np.maximum(-excursion.min(axis=0), 1e-9 * unit))
    for values, bound in zip(moved[1:], (limits.velocity, limits.acceleration, limits.jerk), strict=True):
        room.append(bound / np.maximum(np.abs(values).max(axis=0), 1e-9))
    return np.asarray(0.97 * np.min(room, axis=0))
