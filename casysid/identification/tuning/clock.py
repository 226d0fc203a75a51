"""Whether a log's inertial torques fit its clock: wrong sampling intervals and torques without inertia, found out.

Gravity does not know of time; inertial and velocity-dependent forces of rigid bodies go with the inverse square of it.
A clock that runs ``s`` times too slow makes them ``s²`` times too small beside gravity's, in every joint alike. The
shape of the model file's bodies is evidence enough for factors far from one: each joint's torque is explained by the
file's gravity torque, its inertial torque, and that joint's own friction and rotor. Where all joints that can tell
agree that inertia is several times too strong or too weak, other clocks, and gravity and friction alone, are tried on
blocks of time left out, every fifth together. Moments of gravity's and of the inertial columns kept apart serve all of
these trials.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from casysid.arrays import Array
from casysid.dynamics import DEFAULT_FRICTION
from casysid.estimation.cross_validation import interleaved_folds
from casysid.identification.passes import Passes
from casysid.identification.tuning.candidates import Candidates
from casysid.identification.tuning.held_out import FOLDS
from casysid.identification.tuning.log_score import HeldOutScore, simplest_within_one_error
from casysid.inertia import mass_properties
from casysid.recording import Source
from casysid.robot import Robot

SUSPICIOUS = 4.0
"""Inertial torque that is so many times larger or smaller than gravity's share promises is looked into: model files
are off by a factor of two, and a wrong clock of less is not to be told from a wrong file."""
SIGNIFICANT = 3.0
"""Standard errors that gravity's factor must have for a joint to be asked; inertia's as well, unless its absence is as
clear."""
MINIMUM_JOINTS = 2
"""So many joints at least must say the same."""
CLOCK_TOLERANCE = 0.2
"""Logged velocities within this of the differentiated positions confirm the clock."""
SCALES = np.geomspace(1e-2, 1e2, 185)
"""Clocks that are tried: steps of 5 %."""
LARGEST_GYRATION = 1.0
"""Radius of gyration over the robot's own size beyond which a file's inertias are placeholders: no body is so wide."""
ARMATURE = 2
"""Place of the rotor's column in a joint's split moments."""


@dataclass(frozen=True)
class TimeBase:
    """What was found of a log's clock.

    Attributes:
        scale: Time stamps times this are seconds.
        quasi_static: The torques hold no inertial part, and are explained by gravity and friction alone.
        inertial_share: Inertial torque over what the file's inertias make of it, gravity's the same way being one;
            the median of the joints that can tell; NaN where none can.
        reason: In words; empty when there is nothing to say.
    """

    scale: float = 1.0
    quasi_static: bool = False
    inertial_share: float = math.nan
    reason: str = ""


@dataclass(frozen=True, eq=False)
class SplitMoments:
    """Each joint's moments of what the model file makes of its torque, in parts.

    Attributes:
        squares: Of ``[gravity torque, inertial torque, armature column, other drive columns ..., tau]``, one array by
            joint, shape (blocks, k, k); joints without gravity or motion are left out.
        count: Rows in them, shape (blocks,) by joint.
    """

    squares: tuple[Array, ...]
    count: tuple[Array, ...]


def choose_clock(
    passes: Passes, candidates: Candidates, time_scale: float | None = None, quasi_static: bool | None = None
) -> TimeBase:
    """Look for a wrong clock, or for torques that hold no inertia.

    Args:
        passes: Over what is fitted.
        candidates: With the columns of the file's gravity.
        time_scale: Given, taken as it is.
        quasi_static: Likewise.
    """
    if time_scale is not None or quasi_static is not None:
        return TimeBase(time_scale or 1.0, bool(quasi_static))
    if passes.band.cutoff is None or has_placeholder_inertias(passes.robot):
        return TimeBase()
    split = split_moments(candidates)
    shares = inertial_shares(split)
    share = float(np.median(shares)) if len(shares) else math.nan
    if len(shares) < MINIMUM_JOINTS or not (shares.min() > SUSPICIOUS or shares.max() < 1.0 / SUSPICIOUS):
        return TimeBase(inertial_share=share)
    confirmed = all(clock_is_confirmed(passes.robot, recording) for recording in passes.recordings)
    return _decide(split, share, confirmed=confirmed)


def has_placeholder_inertias(robot: Robot) -> bool:
    """Whether most of a file's bodies are wider than the robot, or all the same: their inertia is no evidence."""
    bodies = robot.inertial_parameters.reshape(-1, 10)
    heavy = bodies[bodies[:, 0] > 0.0]
    if not len(heavy):
        return True
    properties = mass_properties(heavy)
    gyration = np.sqrt(np.maximum(np.trace(properties.inertia, axis1=1, axis2=2), 0.0) / (2.0 * properties.mass))
    size = _reach(robot) + float(np.linalg.norm(properties.center_of_mass, axis=1).max())
    alike = len(heavy) > 2 and np.allclose(properties.inertia, properties.inertia[0], rtol=1e-6, atol=0.0)
    return bool(np.median(gyration) > LARGEST_GYRATION * size) or bool(alike)


def _reach(robot: Robot) -> float:
    """From the base along the longest chain of joints' places [m]."""
    reach = np.zeros(robot.model.njoints)
    for joint in range(1, robot.model.njoints):
        placed = float(np.linalg.norm(robot.model.jointPlacements[joint].translation))
        reach[joint] = reach[robot.model.parents[joint]] + placed
    return float(reach.max())


def split_moments(candidates: Candidates) -> SplitMoments:
    """Moments of gravity's and of the inertial torque that the file promises, read off those of all columns."""
    regressor, moments = candidates.base, candidates.moments
    n = int(regressor.robot.inertial_parameters.size)
    squares, counts = [], []
    for dof, gravity in candidates.gravity.items():
        own, sums = moments.of_joint(dof)
        places = {int(column): k for k, column in enumerate(own)}
        drives = _drive_columns(candidates, regressor.robot.dofs[dof])
        armature = [column for column in drives if candidates.parameters[column].kind == "armature"]
        others = [column for column in drives if column not in armature and column in places]
        if gravity not in places or len(armature) != 1 or armature[0] not in places:
            continue
        T = np.zeros((len(own) + 1, 4 + len(others)))
        T[places[gravity], 0] = 1.0
        bodies = [k for k, column in enumerate(own.tolist()) if column < n]
        T[bodies, 1] = regressor.prior[own[bodies]]
        T[places[gravity], 1] = -1.0
        T[places[armature[0]], ARMATURE] = 1.0
        T[[places[column] for column in others], 3 + np.arange(len(others))] = 1.0
        T[-1, -1] = 1.0
        own_squares = T.T @ sums @ T
        if (own_squares[:, :2].sum(axis=0)[[0, 1], [0, 1]] > 0.0).all():
            squares.append(own_squares)
            counts.append(moments.count[:, dof])
    return SplitMoments(tuple(squares), tuple(counts))


def _drive_columns(candidates: Candidates, dof: str) -> list[int]:
    """Columns of a joint's ordinary friction and rotor: friction before sliding could stand for what inertia leaves."""
    n = int(candidates.base.robot.inertial_parameters.size)
    ordinary = [kind.kind for kind in DEFAULT_FRICTION]
    return [
        k
        for k, parameter in enumerate(candidates.base.parameters)
        if k >= n and parameter.owner == dof and parameter.kind in ordinary
    ]


def inertial_shares(split: SplitMoments) -> Array:
    """Inertial torque over gravity's, both relative to what the file makes of them, of the joints that can tell, (k,).

    Standard errors are a jackknife over blocks of time.
    """
    shares = []
    for squares in split.squares:
        apart = np.delete(np.delete(squares, ARMATURE, axis=1), ARMATURE, axis=2)
        total = apart.sum(axis=0)
        factors = _solve(total)
        left_out = np.array([_solve(total - block) for block in apart])
        error = np.sqrt((len(apart) - 1) / len(apart) * np.sum((left_out - left_out.mean(axis=0)) ** 2, axis=0))
        told = max(factors[0], factors[1]) > SIGNIFICANT * error[1]
        if told and factors[0] > SIGNIFICANT * error[0]:
            shares.append(factors[1] / factors[0])
    return np.array(shares)


def clock_is_confirmed(robot: Robot, recording: Source) -> bool:
    """Whether logged velocities are the rates of the logged positions; False when no velocities were logged."""
    if not recording.has_velocity or not recording.has_time or robot.nv != len(robot.channels):
        return False
    product = square = 0.0
    for batch in recording.batches():
        assert batch.time is not None
        assert batch.velocity is not None
        if len(batch) > 1:
            rate = np.gradient(batch.position, batch.time, axis=0)
            product, square = product + float(np.sum(rate * batch.velocity)), square + float(np.sum(rate * rate))
    return abs(product / max(square, 1e-300) - 1.0) < CLOCK_TOLERANCE


def _decide(split: SplitMoments, share: float, *, confirmed: bool) -> TimeBase:
    """The simplest reading: the clock as logged, no inertia at all, another clock."""
    words = f"inertial torque is {share:.2g} times what the model file promises beside gravity's with this clock"
    readings = [1.0]
    if share < 1.0:
        readings.append(math.inf)
    if not confirmed and share > 0.0:
        readings.append(_best_scale(split))
    scores = [_score(split, scale) for scale in readings]
    taken = simplest_within_one_error(scores)
    if taken == 0:
        return TimeBase(inertial_share=share)
    everyone = np.ones(len(split.squares), dtype=bool)
    gain = scores[taken].size(everyone) / scores[0].size(everyone)
    if math.isinf(readings[taken]):
        reason = f"{words}; the torques are explained by gravity and friction alone (held-out error x {gain:.2f})"
        return TimeBase(quasi_static=True, inertial_share=share, reason=reason)
    reason = f"{words}; the time stamps were multiplied by {readings[taken]:.3g} (held-out error x {gain:.2f})"
    return TimeBase(readings[taken], inertial_share=share, reason=reason)


def _best_scale(split: SplitMoments) -> float:
    """The clock of greatest likelihood, every joint with a noise level of its own."""
    logarithms = [
        [len(squares) * math.log(_errors(squares.sum(axis=0), squares.sum(axis=0), s)[0]) for s in SCALES]
        for squares in split.squares
    ]
    return float(SCALES[np.argmin(np.sum(logarithms, axis=0))])


def _score(split: SplitMoments, scale: float) -> HeldOutScore:
    """Of gravity and inertia tied together by a clock, one block of time in so many left out.

    Factors of gravity and friction free for every joint extrapolate badly to a part of the motion that none has seen,
    whatever the clock.
    """
    folds = interleaved_folds(len(split.squares[0]), FOLDS)
    shape = len(folds), len(split.squares)
    energy, target, count, variance = (np.zeros(shape) for _ in range(4))
    for j, (squares, rows) in enumerate(zip(split.squares, split.count, strict=True)):
        total = squares.sum(axis=0)
        for k, fold in enumerate(folds):
            test = squares[fold].sum(axis=0)
            energy[k, j], fitted = _errors(total - test, test, scale)
            target[k, j], count[k, j] = test[-1, -1], rows[fold].sum()
            variance[k, j] = fitted / max(rows.sum() - rows[fold].sum(), 1.0)
    return HeldOutScore(energy, target, count, variance)


def _errors(training: Array, test: Array, scale: float) -> tuple[float, float]:
    """Energy of the error of one joint's torque on ``test`` and on ``training``, to which it is fitted."""
    tied = np.zeros((len(training), len(training) - 1))
    tied[0, 0], tied[1, 0] = 1.0, scale**-2.0
    tied[2:, 1:] = np.eye(len(training) - 2)
    train = tied.T @ training @ tied
    factors = _solve(train)
    if factors[ARMATURE - 1] < 0.0:
        without = np.delete(np.arange(len(train)), ARMATURE - 1)
        factors = np.insert(_solve(train[np.ix_(without, without)]), ARMATURE - 1, 0.0)
    residual = tied @ np.append(-factors, 1.0)
    tiny = float(np.finfo(np.float64).tiny)
    return max(float(residual @ test @ residual), tiny), max(float(residual @ training @ residual), tiny)


def _solve(square: Array) -> Array:
    """Least squares from a Gram matrix whose last row is the target's, columns scaled to unit energy."""
    scale = 1.0 / np.sqrt(np.maximum(np.diag(square)[:-1], np.finfo(np.float64).tiny))
    return np.asarray(scale * (np.linalg.pinv(scale[:, None] * square[:-1, :-1] * scale) @ (scale * square[:-1, -1])))
