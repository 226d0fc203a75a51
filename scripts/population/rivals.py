"""Least squares that knows everything, and least squares that knows nothing, with the best cut-off in hindsight.

Both smooth positions (zero-phase Butterworth of order 4), differentiate, smooth torque alike, weight joints by their
residuals, and take the pseudo-inverse. The one that is told has the true friction columns with their true nonlinear
numbers (widths, Stribeck velocities, yield distances, harmonics, loads), the clock, delays, gains and signs. The other
has viscous, ``tanh`` Coulomb, offset and armature on every joint, and takes the log as it is.

A third is told as well and puts the regressor through the same low-pass as the torque, which keeps sharp friction
consistent between the two (Gautier's parallel filter); it is usually the strongest.

None sees the model file. No honest method knows the best cut-off.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import interpolate, signal

from population.drives import regressor
from population.experiments import FRESH_RATE, Experiment
from population.friction import Armature, Coulomb, Offset, Term, Viscous
from population.motions import State
from population.sensors import no_faults

CUTOFFS = 1.5 * 2.0 ** np.arange(6)
"""In the frequencies below which 99 % of the true velocities' energy lies, the joint with the highest counting."""
HIGHEST_SHARE, SMOOTHER = 0.4, 2.0
"""Of the sampling rate; the motion's cut-off over the torque's where the regressor is filtered."""
OVERSAMPLING, LEAST_ROWS, MOST_ROWS = 6.0, 1500, 6000
"""Rows are thinned to so many times the cut-off, and to these numbers."""
WIDTH_SHARE = 0.01
"""Of the rms velocity: where the untold Coulomb friction turns, as in ``judge.py``."""
RCOND = 1e-8
GAP = 5.0
"""Steps of time longer than so many median ones are gaps; samples nearer than a period of the cut-off are left out."""
MOST_TRIMMED = 0.1


@dataclass(frozen=True, eq=False)
class Fit:
    """A torque model by least squares.

    Attributes:
        error: Relative torque error on the fresh motion.
        cutoff: [Hz].
    """

    error: float
    cutoff: float


@dataclass(frozen=True, eq=False)
class Log:
    """A log on an even time base.

    Attributes:
        rate: [Hz].
        position: Shape (N, nv).
        torque: Shape (N, nv).
        distance: To the nearest gap or end [s], shape (N,).
    """

    rate: float
    position: np.ndarray
    torque: np.ndarray
    distance: np.ndarray

    def motion(self, cutoff: float) -> State:
        """Smoothed below a frequency [Hz], and differentiated."""
        q = low_pass(self.position, cutoff, self.rate)
        v = np.gradient(q, 1.0 / self.rate, axis=0)
        return State(q, v, low_pass(np.gradient(v, 1.0 / self.rate, axis=0), cutoff, self.rate))

    def rows(self, cutoff: float) -> np.ndarray:
        """Samples far from gaps and ends, thinned to what a band [Hz] needs."""
        margin = min(1.0 / cutoff, MOST_TRIMMED * len(self.position) / self.rate)
        whole = np.flatnonzero(self.distance >= margin)
        wanted = np.clip(OVERSAMPLING * cutoff * len(whole) / self.rate, LEAST_ROWS, MOST_ROWS)
        return whole[:: max(int(len(whole) / wanted), 1)]


def low_pass(x: np.ndarray, cutoff: float, rate: float) -> np.ndarray:
    """Zero-phase, order 4."""
    return signal.sosfiltfilt(signal.butter(4, cutoff, fs=rate, output="sos"), x, axis=0)


def read_log(experiment: Experiment, told: bool) -> Log:
    """The log as a rival takes it: corrected by what it is told."""
    faults, recording = experiment.faults, experiment.recording
    t = np.array(recording.time) / (faults.clock if told else 1.0)
    step = float(np.median(np.diff(t)))
    u = np.arange(t[0], t[-1], step)
    position = interpolate.make_interp_spline(t, recording.position, 3)(u)
    corrected = faults if told else no_faults(len(faults.delay))
    by_joint = zip(recording.torque.T, corrected.delay, strict=True)
    torque = np.stack([np.interp(u + late, t, tau) for tau, late in by_joint], axis=1) / corrected.scale
    return Log(1.0 / step, position, torque, _distance(t, u, GAP * step))


def _distance(t: np.ndarray, u: np.ndarray, gap: float) -> np.ndarray:
    """Of times u to the nearest end or gap of t; zero within gaps."""
    cuts = np.flatnonzero(np.diff(t) > gap)
    begin, end = np.r_[t[0], t[cuts + 1]], np.r_[t[cuts], t[-1]]
    k = np.maximum(np.searchsorted(begin, u, side="right") - 1, 0)
    return np.maximum(np.minimum(u - begin[k], end[k] - u), 0.0)


def ordinary_terms(state: State) -> tuple[Term, ...]:
    """Columns of one who is told nothing."""
    terms: list[Term] = []
    for j, e in enumerate(np.eye(state.v.shape[1])):
        width = WIDTH_SHARE * float(state.v[:, j].std()) + 1e-9
        terms += [Viscous(direction=e, effect=""), Coulomb(direction=e, effect="", width=width)]
        terms += [Offset(direction=e, effect=""), Armature(direction=e, effect="")]
    return tuple(terms)


def solve(A: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Least squares with joints weighted by their residuals, the shortest of all solutions; columns scaled to one."""
    joints = range(b.shape[1])
    size = np.sqrt(np.mean(A**2, axis=(0, 1)))
    size[size == 0.0] = 1.0
    roots = [np.linalg.qr(np.column_stack([A[:, j] / size, b[:, j]]), mode="r") for j in joints]
    weights = np.ones(len(joints))
    for _ in range(3):
        R = np.concatenate([w * root for w, root in zip(weights, roots, strict=True)])
        x = np.linalg.lstsq(R[:, :-1], R[:, -1], rcond=RCOND)[0]
        residual = [np.linalg.norm(root @ np.append(x, -1.0)) / np.sqrt(len(b)) for root in roots]
        weights = 1.0 / np.maximum(residual, 1e-12)
    return x / size


def best_fit(experiment: Experiment, *, told: bool, filtered: bool = False) -> Fit:
    """The best of six cut-offs, with the result in view.

    Args:
        experiment: Its log is fitted.
        told: Whether the rival knows the truth's columns and the log's faults.
        filtered: Whether the regressor goes through the torque's low-pass, its motion being smoothed at twice that.
    """
    log, bodies = read_log(experiment, told), experiment.truth.bodies
    scale = experiment.faults.scale if told else np.ones(experiment.mechanism.robot.nv)
    highest = HIGHEST_SHARE * log.rate
    found, fresh = [], None
    for cutoff in np.unique(np.minimum(CUTOFFS * velocity_band(experiment), highest)):
        state = log.motion(min(SMOOTHER * cutoff, highest) if filtered else cutoff)
        terms = experiment.truth.terms if told else ordinary_terms(state)
        rows = log.rows(cutoff)
        if filtered:
            A = low_pass(regressor(bodies, terms, state), cutoff, log.rate)[rows]
        else:
            A = regressor(bodies, terms, state, rows)
        x = solve(A, low_pass(log.torque, cutoff, log.rate)[rows])
        if fresh is None or not told:
            fresh = regressor(bodies, terms, experiment.fresh)
        predicted = fresh @ x * scale
        found.append(Fit(relative_error(predicted, experiment.fresh_torque), float(cutoff)))
    return min(found, key=lambda fit: fit.error)


def velocity_band(experiment: Experiment) -> float:
    """Frequency [Hz] below which 99 % of the fresh motion's velocity energy lies, of the joint where it is highest."""
    v = experiment.fresh.v
    frequency, power = signal.periodogram(v, FRESH_RATE, window="hann", axis=0)
    total = np.cumsum(power, axis=0)
    moving = total[-1] > 1e-9 * total[-1].max()
    return float(max(frequency[np.argmax(total >= 0.99 * total[-1], axis=0)][moving].max(), frequency[1]))


def relative_error(predicted: np.ndarray, true: np.ndarray) -> float:
    """``‖τ̂ - τ‖ / ‖τ‖`` over all joints."""
    return float(np.linalg.norm(predicted - true) / np.linalg.norm(true))
