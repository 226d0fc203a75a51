"""Whether a log's inertial torques fit its clock: wrong sampling intervals and torques without inertia, found out.

Gravity does not know of time; inertial and velocity-dependent forces of rigid bodies go with the inverse square of it.
A clock that runs ``s`` times too slow makes them ``s²`` times too small beside gravity's, in every joint alike. The
shape of the model file's bodies is evidence enough for factors far from one: each joint's torque is explained by the
file's gravity torque, its inertial torque, and that joint's own friction and rotor. Where all joints that can tell
agree that inertia is several times too strong or too weak, other clocks, and gravity and friction alone, are tried on
blocks of time left out. Moments of gravity's and of the inertial columns kept apart serve all of these trials.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array
from casysid.dynamics import Regressor, build_regressor
from casysid.estimation.cross_validation import contiguous_folds
from casysid.identification.cutoff import lowest_cutoff
from casysid.identification.problem import MOTION_TO_TORQUE_BAND, USUAL_WIDTH, make_motion, with_widths
from casysid.identification.settings import Settings
from casysid.recording import Recording
from casysid.robot import Robot
from casysid.signals import BandAverage, Motion, smoothing_cutoff

SUSPICIOUS = 4.0
"""Inertial torque that is so many times larger or smaller than gravity's share promises is looked into."""
SIGNIFICANT = 3.0
"""Standard errors that gravity's factor must have for a joint to be asked."""
WITNESSES = 2
"""So many joints at least must say the same."""
WORTHWHILE = 0.5
"""Another clock must bring the energy of the errors held out below this fraction of the logged clock's."""
SIMPLER = 0.9
"""And below this fraction of gravity's and friction's alone: no inertia is the simpler reading."""
CLOCK_TOLERANCE = 0.2
"""Logged velocities within this of the differentiated positions confirm the clock."""
SCALES = np.geomspace(1e-2, 1e2, 185)
"""Clocks that are tried: steps of 5 %."""
CUTOFF_MARGIN = 2.0
"""Of the cut-off here over the lowest that keeps the motion."""
BLOCKS, FOLDS, LONGEST = 12, 4, 6000
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
        gram: Of ``[gravity torque, inertial torque, armature column, other drive columns ..., tau]``, one array by
            joint, shape (blocks, k, k); joints without gravity or motion are left out.
    """

    gram: tuple[Array, ...]


def settle_time_base(
    robot: Robot,
    recordings: Sequence[Recording],
    settings: Settings,
) -> TimeBase:
    """Look for a wrong clock, or for torques that hold no inertia.

    Args:
        robot: The robot; its inertial parameters are the prior.
        recordings: What is fitted.
        settings: What is given there is taken as it is.
    """
    if settings.time_scale is not None or settings.quasi_static is not None:
        return TimeBase(settings.time_scale or 1.0, bool(settings.quasi_static))
    if any(recording.time is None for recording in recordings):
        return TimeBase()
    split = split_moments(robot, recordings, settings)
    shares = inertial_shares(split)
    share = float(np.median(shares)) if len(shares) else math.nan
    if len(shares) < WITNESSES or not (shares.min() > SUSPICIOUS or shares.max() < 1.0 / SUSPICIOUS):
        return TimeBase(inertial_share=share)
    confirmed = all(clock_is_confirmed(robot, recording) for recording in recordings)
    return _decide(split, share, confirmed=confirmed)


def split_moments(robot: Robot, recordings: Sequence[Recording], settings: Settings) -> SplitMoments:
    """Moments of the start of every recording, a few thousand samples, in the motion's band."""
    cutoff = CUTOFF_MARGIN * lowest_cutoff(recordings)
    motions = [_start(_quiet_motion(robot, recording, cutoff)) for recording in recordings]
    friction = with_widths(settings, motions, USUAL_WIDTH)
    regressor = build_regressor(robot, friction=friction, couplings=settings.couplings)
    pieces = [_rows(regressor, motion, piece, cutoff) for motion in motions for piece in _pieces(motion, len(motions))]
    grams = (np.array([rows[joint].T @ rows[joint] for rows in pieces]) for joint in range(robot.nv))
    return SplitMoments(tuple(gram for gram in grams if (gram[:, :2].sum(axis=0)[[0, 1], [0, 1]] > 0.0).all()))


def _quiet_motion(robot: Robot, recording: Recording, cutoff: float) -> Motion:
    """Smoothed lower where noise is heavy: noise of the accelerations would hide the inertial torques."""
    assert recording.time is not None
    smoothing = smoothing_cutoff(recording.time, recording.position, MOTION_TO_TORQUE_BAND * cutoff)
    return make_motion(robot, recording, cutoff, smoothing=smoothing, quick=True)


def inertial_shares(split: SplitMoments) -> Array:
    """Inertial torque over gravity's, both relative to what the file makes of them, of the joints that can tell, (k,).

    Standard errors are a jackknife over blocks of time.
    """
    shares = []
    for gram in split.gram:
        apart = np.delete(np.delete(gram, ARMATURE, axis=1), ARMATURE, axis=2)
        total = apart.sum(axis=0)
        factors = _solve(total)
        left_out = np.array([_solve(total - block) for block in apart])
        error = np.sqrt((len(gram) - 1) / len(gram) * np.sum((left_out - left_out.mean(axis=0)) ** 2, axis=0))
        if factors[0] > SIGNIFICANT * error[0]:
            shares.append(factors[1] / factors[0])
    return np.array(shares)


def clock_is_confirmed(robot: Robot, recording: Recording) -> bool:
    """Whether logged velocities are the rates of the logged positions; False when no velocities were logged."""
    if recording.velocity is None or recording.time is None or robot.nv != len(robot.channels):
        return False
    rate = np.gradient(recording.position, recording.time, axis=0)
    factor = np.sum(rate * recording.velocity) / max(float(np.sum(rate * rate)), 1e-300)
    return bool(abs(factor - 1.0) < CLOCK_TOLERANCE)


def _decide(split: SplitMoments, share: float, *, confirmed: bool) -> TimeBase:
    """The clock that fits best, if it is far better than the one logged on time left out."""
    gains = {}
    if share < 1.0:
        gains[math.inf] = _held_out_gain(split, math.inf)
    if not confirmed and share > 0.0:
        clock = _best_scale(split)
        gains[clock] = _held_out_gain(split, clock) / SIMPLER
    if not gains or min(gains.values()) > WORTHWHILE:
        return TimeBase(inertial_share=share)
    scale = min(gains, key=gains.__getitem__)
    gain = math.sqrt(_held_out_gain(split, scale))
    words = f"inertial torque is {share:.2g} times what the model file promises beside gravity's with this clock"
    if math.isinf(scale):
        reason = f"{words}; the torques are explained by gravity and friction alone (held-out error x {gain:.2f})"
        return TimeBase(quasi_static=True, inertial_share=share, reason=reason)
    reason = f"{words}; the time stamps were multiplied by {scale:.3g} (held-out error x {gain:.2f})"
    return TimeBase(scale, inertial_share=share, reason=reason)


def _best_scale(split: SplitMoments) -> float:
    """The clock of greatest likelihood, every joint with a noise level of its own."""
    logarithms = [
        [gram.shape[0] * math.log(_error(gram.sum(axis=0), gram.sum(axis=0), scale)) for scale in SCALES]
        for gram in split.gram
    ]
    return float(SCALES[np.argmin(np.sum(logarithms, axis=0))])


def _held_out_gain(split: SplitMoments, scale: float) -> float:
    """Energy of errors on blocks left out over that with the logged clock, joints weighted by their noise."""
    ours, theirs = 0.0, 0.0
    for gram in split.gram:
        folds = [(gram[fold].sum(axis=0), gram.sum(axis=0)) for fold in contiguous_folds(len(gram), FOLDS)]
        other, logged = (sum(_error(total - test, test, s) for test, total in folds) for s in (scale, 1.0))
        noise = min(other, logged)
        ours, theirs = ours + other / noise, theirs + logged / noise
    return ours / theirs


def _error(training: Array, test: Array, scale: float) -> float:
    """Energy of the error on ``test`` of one joint's torque, gravity and inertia tied together by a clock."""
    tied = np.zeros((len(training), len(training) - 1))
    tied[0, 0], tied[1, 0] = 1.0, scale**-2.0
    tied[2:, 1:] = np.eye(len(training) - 2)
    train = tied.T @ training @ tied
    factors = _solve(train)
    if factors[ARMATURE - 1] < 0.0:
        without = np.delete(np.arange(len(train)), ARMATURE - 1)
        factors = np.insert(_solve(train[np.ix_(without, without)]), ARMATURE - 1, 0.0)
    residual = np.append(-factors, 1.0)
    return max(float(residual @ tied.T @ test @ tied @ residual), float(np.finfo(np.float64).tiny))


def _rows(regressor: Regressor, motion: Motion, piece: npt.NDArray[np.intp], cutoff: float) -> list[Array]:
    """Each joint's averaged rows ``[gravity, inertial, armature, other drive columns ..., tau]``, (windows, k)."""
    robot, n = regressor.robot, int(regressor.robot.inertial_parameters.size)
    q, v, a, tau = (values[piece] for values in (motion.q, motion.v, motion.a, motion.tau))
    bodies, still = np.append(regressor.prior[:n], np.zeros(len(regressor.names) - n)), np.zeros_like(v)
    gravity = regressor.predict(bodies, q, still, still)
    inertial = regressor.predict(bodies, q, v, a) - gravity
    drives = regressor.evaluate(q, v, a)[:, :, n:]
    weights = BandAverage(motion.time, cutoff).weights(piece)
    return [
        np.asarray(weights @ np.column_stack([gravity[:, j], inertial[:, j], a[:, j], drives[:, j, own], tau[:, j]]))
        for j, own in enumerate(_drive_columns(regressor, dof) for dof in robot.dofs)
    ]


def _drive_columns(regressor: Regressor, dof: str) -> list[int]:
    """Columns of a joint's friction among all drive columns, its rotor's left out."""
    drives = regressor.parameters[int(regressor.robot.inertial_parameters.size) :]
    return [k for k, parameter in enumerate(drives) if parameter.owner == dof and parameter.kind != "armature"]


def _pieces(motion: Motion, motions: int) -> list[npt.NDArray[np.intp]]:
    return np.array_split(np.arange(len(motion)), max(2, BLOCKS // motions))


def _start(motion: Motion) -> Motion:
    """At most the first few thousand samples."""
    kept = {name: getattr(motion, name)[:LONGEST] for name in ("time", "q", "v", "a", "tau", "standing", "settled")}
    return dataclasses.replace(motion, **kept)


def _solve(gram: Array) -> Array:
    """Least squares from a Gram matrix whose last row is the target's, columns scaled to unit energy."""
    scale = 1.0 / np.sqrt(np.maximum(np.diag(gram)[:-1], np.finfo(np.float64).tiny))
    return np.asarray(scale * (np.linalg.pinv(scale[:, None] * gram[:-1, :-1] * scale) @ (scale * gram[:-1, -1])))
