"""By how much the logged torque is late against the logged positions, settled by the data.

With the torque late by ``d``, ``tau(t + d) = Y(t) θ``. The delay enters nonlinearly, but moments at many delays come
out of one pass (:mod:`casysid.identification.tuning.delayed_moments`), and on them Gauss-Newton is one more column of
the regression: minus the torque's slope, whose coefficient is the step.

Friction, elasticity and filters also look late. So no delay, one for all joints, and one for each are hypotheses in
the order of their simplicity (:mod:`casysid.identification.tuning.log_score`); a delay that shifts the motion's
quickest part by less than a thousandth of a period is none.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from casysid.arrays import Array, frozen
from casysid.dynamics import Regressor
from casysid.errors import RecordingError
from casysid.estimation import Ridge, WeightedLeastSquares
from casysid.estimation.cross_validation import contiguous_folds
from casysid.identification.passes import Passes
from casysid.identification.tuning.delayed_moments import (
    NODE_SPACING,
    NODES,
    DelayedMoments,
    node_delays,
    sum_delayed_moments,
)
from casysid.identification.tuning.held_out import FOLDS
from casysid.identification.tuning.log_score import HeldOutScore, simplest_within_one_error
from casysid.robot import Robot

SMALLEST_IN_BAND = 0.001
"""Periods of the motion's band: a shorter delay moves no part of the torque by more than 0.6 % of its amplitude."""
OWN_GAIN = 0.3
"""Fall of the torque error for which joints get delays of their own: then half of its energy goes. Their friction and
elasticity look like delays, too, and one sampling card serves them all."""
STEPS, CONVERGED = 20, 1e-3
"""Of Gauss-Newton; converged when a step is less than this many samples."""
MOVES = 5
"""So often the nodes may follow a delay that runs away from them."""


@dataclass(frozen=True, eq=False, kw_only=True)
class DelayChoice:
    """How late the torque is, by joint, and what was done about it.

    Attributes:
        seconds: Taken out: by so much the torque's time stamps are late against the positions', shape (nv,), [s].
        estimate: What the data say, whether taken out or not, shape (nv,), [s].
        std: Its standard error, shape (nv,), [s]; inf where not known.
        gain: Share of the squared torque error on blocks left out that it takes away.
        reason: In words.
    """

    seconds: Array
    estimate: Array
    std: Array
    gain: float
    reason: str

    @property
    def is_none(self) -> bool:
        """Nothing is taken out."""
        return not self.seconds.any()

    @property
    def is_common(self) -> bool:
        """All joints are late alike."""
        return bool(np.ptp(self.estimate) == 0.0)

    def to_json(self, joints: Sequence[str]) -> dict[str, object]:
        """Seconds by joint, the estimate with its standard error, and the reason."""
        return {
            "seconds": dict(zip(joints, self.seconds.tolist(), strict=True)),
            "estimate": dict(zip(joints, self.estimate.tolist(), strict=True)),
            "std": dict(zip(joints, self.std.tolist(), strict=True)),
            "gain": self.gain,
            "reason": self.reason,
        }


def given_delay(robot: Robot, seconds: float, reason: str = "none") -> DelayChoice:
    """One delay for all joints that nobody estimated."""
    all_joints = frozen(np.full(robot.nv, seconds))
    return DelayChoice(
        seconds=all_joints, estimate=all_joints, std=frozen(np.full(robot.nv, np.inf)), gain=0.0, reason=reason
    )


def choose_delay(passes: Passes, regressor: Regressor, given: float | None = None) -> DelayChoice:
    """The delay to take out of the torque.

    Args:
        passes: Over what is fitted.
        regressor: Of the usual model.
        given: Taken as it is [s]; None lets the data decide.

    Raises:
        RecordingError: A delay is given for samples without time.
    """
    robot, cutoff = passes.robot, passes.band.cutoff
    if given is not None:
        if cutoff is None and given:
            raise RecordingError("delay: samples without time have none; leave the delay out, or give time stamps")
        return given_delay(robot, given, f"{1e3 * given:.3g} ms, given")
    if cutoff is None:
        return given_delay(robot, 0.0, "samples without time have none")
    found = _Search(passes, regressor, cutoff).run()
    return found or given_delay(robot, 0.0, "none found: no delay fits better than its neighbours")


@dataclass(frozen=True, eq=False)
class _Fit:
    """Delays, shape (joints,), with their standard errors."""

    delays: Array
    std: Array


class _Search:
    """Moments at many delays, and what is looked up in them."""

    def __init__(self, passes: Passes, regressor: Regressor, cutoff: float) -> None:
        self._passes, self._regressor, self._cutoff = passes, regressor, cutoff
        self._nv, self._prior = passes.robot.nv, regressor.prior
        self._sample = 1.0 / max(recording.rate for recording in passes.recordings)
        self._strength: float | None = None

    def run(self) -> DelayChoice | None:
        """The choice; None when Gauss-Newton finds no delay."""
        everyone, centre = np.ones((1, self._nv)), 0.0
        first = None
        for _ in range(MOVES):
            delayed = self._delayed(centre)
            first = first or delayed
            common = self._fit(delayed, everyone, np.full(self._nv, centre))
            if common is None:
                return None
            centre = float(common.delays[0])
            if abs(centre - delayed.nodes.mean()) <= self._reach / 2.0:
                return self._judge(first, delayed, common)
        return None

    def _judge(self, undelayed: DelayedMoments, delayed: DelayedMoments, common: _Fit) -> DelayChoice:
        """Which of no delay, the common one, and joints' own is taken."""
        none = np.zeros(self._nv)
        smallest = SMALLEST_IN_BAND / max(self._passes.band.motion_band, 1e-12)
        without, with_common = self._score(undelayed, none), self._score(delayed, common.delays)
        words = f"{1e3 * common.delays[0]:.3g} ± {1e3 * common.std[0]:.2g} ms, the same for all joints"
        found, gained = common, _energy_gain(without, with_common)
        taken = abs(common.delays[0]) > smallest and simplest_within_one_error([without, with_common]) == 1
        own = self._fit(delayed, np.eye(self._nv), common.delays) if taken and self._nv > 1 else None
        if own is not None and np.ptp(own.delays) > smallest:
            with_own = self._score(delayed, own.delays)
            if simplest_within_one_error([with_common, with_own], OWN_GAIN) == 1:
                found, gained = own, _energy_gain(without, with_own)
                words = f"{1e3 * own.delays.min():.3g} to {1e3 * own.delays.max():.3g} ms by joint"
        outcome = "taken out" if taken else "left as it is"
        return DelayChoice(
            seconds=frozen(found.delays if taken else none),
            estimate=frozen(found.delays),
            std=frozen(found.std),
            gain=gained,
            reason=f"{words}; {outcome}: {gained:+.1%} of the squared torque error on time left out",
        )

    @property
    def _reach(self) -> float:
        return (NODES - 1) / 2.0 * NODE_SPACING / self._cutoff

    def _delayed(self, centre: float) -> DelayedMoments:
        passes = self._passes
        passes.passes += 1
        return sum_delayed_moments(
            self._regressor,
            passes.sparse_motions,
            passes.motions,
            node_delays(centre, self._cutoff),
            self._cutoff,
            blocks=passes.blocks_of_each(),
        )

    def _fit(self, delayed: DelayedMoments, groups: Array, start: Array) -> _Fit | None:
        """Gauss-Newton on the delays of groups of joints; None when it does not settle within the nodes."""
        delays, prior = start, np.append(self._prior, np.zeros(len(groups)))
        low, high = delayed.nodes[1], delayed.nodes[-2]
        for _ in range(STEPS):
            estimate = WeightedLeastSquares().estimate(delayed.at(delays, groups), prior)
            step = estimate.parameters[-len(groups) :] @ groups
            moved = np.clip(delays + step, low, high)
            settled = np.abs(moved - delays).max() < CONVERGED * self._sample
            delays = moved
            if settled:
                break
        else:
            return None
        std = np.sqrt(np.diag(estimate.covariance))[-len(groups) :]
        return _Fit(delays, std @ groups)

    def _score(self, delayed: DelayedMoments, delays: Array) -> HeldOutScore:
        """Of the usual model at some delays, stretches of time left out."""
        moments = delayed.at(delays)
        if self._strength is None:
            usual = Ridge(standard_errors=False).estimate(moments, self._prior)
            self._strength = usual.diagnostics.get("strength", 0.0)
        ridge = Ridge(strength=self._strength, standard_errors=False)
        folds = contiguous_folds(moments.blocks, FOLDS)
        tests = moments.merged_blocks(folds)
        energy, variance = np.zeros((len(folds), self._nv)), np.zeros((len(folds), self._nv))
        for k, fold in enumerate(folds):
            training = moments.select_blocks(np.setdiff1d(np.arange(moments.blocks), fold))
            found = ridge.estimate(training, self._prior)
            energy[k], variance[k] = tests.residual_energy(found.parameters)[k], found.noise_std**2
        return HeldOutScore(energy, tests.target_energy(), tests.count, variance)


def _energy_gain(before: HeldOutScore, after: HeldOutScore) -> float:
    """Share of the squared error that is gone, joints weighted by their noise."""
    weights = 1.0 / np.maximum(before.variance.mean(axis=0), np.finfo(np.float64).tiny)
    return float(1.0 - (after.energy @ weights).sum() / max((before.energy @ weights).sum(), 1e-300))
