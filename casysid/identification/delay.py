"""By how much the logged torque is late against the logged positions, settled by the data.

With the torque late by ``d``, ``tau(t + d) = Y(t) θ``. The delay enters nonlinearly, but moments at many delays come
out of one pass (:mod:`casysid.identification.shifted`), and on them Gauss-Newton is one more column of the regression:
minus the torque's slope, whose coefficient is the step. Its standard error comes from blocks of time like any
parameter's.

Friction, elasticity and filters also look late, so a delay is only taken out where it is significant *and* blocks of
time that were left out are predicted better, by more than that gain varies from block to block. Joints get delays of
their own where that gains as clearly over one delay for all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from casysid.arrays import Array, frozen
from casysid.errors import RecordingError
from casysid.estimation import Ridge, WeightedLeastSquares
from casysid.estimation.cross_validation import contiguous_folds
from casysid.identification.problem import MINIMUM_BLOCKS, build_problem, counted
from casysid.identification.settings import Settings
from casysid.identification.shifted import NODE_SPACING, NODES, ShiftedMoments, node_delays, sum_shifted_moments
from casysid.recording import Recording
from casysid.robot import Robot

SIGNIFICANT = 4.0
"""A delay of fewer standard errors is none."""
CLEAR_GAIN = 2.5
"""The gain on blocks left out must be so many of its standard errors."""
WORTHWHILE_GAIN = 1e-3
"""And this share of the squared error."""
OWN_GAIN = 0.5
"""Joints get their own for no less than this share: their friction and elasticity look like delays, too."""
FOLDS = 5
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


def choose_delay(
    robot: Robot,
    recordings: Sequence[Recording],
    cutoff: float | None,
    settings: Settings,
    relative_width: float | Array,
) -> DelayChoice:
    """The delay to take out of the torque.

    Args:
        robot: The robot.
        recordings: What is fitted.
        cutoff: Of the equations' average [Hz]; None when samples have no time.
        settings: A delay given there is taken as it is.
        relative_width: Of Coulomb's smooth sign, in root mean square velocities.

    Raises:
        RecordingError: A delay is given for samples without time.
    """
    if settings.delay is not None:
        if cutoff is None and settings.delay:
            raise RecordingError("delay: samples without time have none; leave the delay out, or give time stamps")
        return given_delay(robot, settings.delay, f"{1e3 * settings.delay:.3g} ms, given")
    if cutoff is None:
        return given_delay(robot, 0.0, "samples without time have none")
    found = _Search(robot, recordings, cutoff, settings, relative_width).run()
    return found or given_delay(robot, 0.0, "none found: no delay fits better than its neighbours")


@dataclass(frozen=True, eq=False)
class _Fit:
    """Delays, shape (joints,), with their standard errors, and the row weights at them."""

    delays: Array
    std: Array
    weights: Array


class _Search:
    """Moments at many delays, and what is looked up in them."""

    def __init__(
        self,
        robot: Robot,
        recordings: Sequence[Recording],
        cutoff: float,
        settings: Settings,
        relative_width: float | Array,
    ) -> None:
        self._recordings, self._cutoff, self._settings = recordings, cutoff, settings
        self._problem = build_problem(robot, recordings, cutoff, settings, relative_width=relative_width, quick=True)
        self._regressor, self._nv = self._problem.regressor, robot.nv
        self._prior = self._regressor.prior
        usual = Ridge(standard_errors=False).estimate(self._problem.moments, self._prior)
        self._strength = usual.diagnostics.get("strength", 0.0)
        self._sample = 1.0 / max(recording.rate for recording in recordings)

    def run(self) -> DelayChoice | None:
        """The choice; None when Gauss-Newton finds no delay."""
        everyone, centre = np.ones((1, self._nv)), 0.0
        for _ in range(MOVES):
            shifted = self._shifted(centre)
            common = self._fit(shifted, everyone, np.full(self._nv, centre))
            if common is None:
                return None
            centre = float(common.delays[0])
            if abs(centre - shifted.nodes.mean()) <= self._reach / 2.0:
                return self._judge(shifted, common)
        return None

    def _judge(self, shifted: ShiftedMoments, common: _Fit) -> DelayChoice:
        """Whether the common delay is taken out, and whether joints get their own beyond it."""
        none = np.zeros(self._nv)
        zero = shifted if shifted.nodes[0] <= 0.0 <= shifted.nodes[-1] else self._shifted(0.0)
        without = self._left_out(zero, none, common.weights)
        gain = _compare(without, self._left_out(shifted, common.delays, common.weights))
        words = f"{1e3 * common.delays[0]:.3g} ± {1e3 * common.std[0]:.2g} ms, the same for all joints"
        chosen = common if _is_significant(common) and gain.is_clear else None
        own = self._fit(shifted, np.eye(self._nv), common.delays) if chosen and self._nv > 1 else None
        if own is not None and _is_significant(own):
            more = _compare(
                self._left_out(shifted, common.delays, own.weights), self._left_out(shifted, own.delays, own.weights)
            )
            if more.is_clear and more.share > OWN_GAIN:
                gain = _compare(
                    self._left_out(zero, none, own.weights), self._left_out(shifted, own.delays, own.weights)
                )
                chosen, words = own, f"{1e3 * own.delays.min():.3g} to {1e3 * own.delays.max():.3g} ms by joint"
        found = chosen or common
        outcome = "taken out" if chosen else "left as it is"
        return DelayChoice(
            seconds=frozen(found.delays if chosen else none),
            estimate=frozen(found.delays),
            std=frozen(found.std),
            gain=gain.share,
            reason=f"{words}; {outcome}: {gain.share:+.1%} of the squared torque error on blocks left out",
        )

    @property
    def _reach(self) -> float:
        return (NODES - 1) / 2.0 * NODE_SPACING / self._cutoff

    def _shifted(self, centre: float) -> ShiftedMoments:
        blocks = max(MINIMUM_BLOCKS, -(-self._settings.blocks // len(self._recordings)))
        return sum_shifted_moments(
            self._regressor,
            counted(self._problem.motions, self._settings),
            self._recordings,
            node_delays(centre, self._cutoff),
            self._cutoff,
            blocks=blocks,
            threads=self._settings.threads,
        )

    def _fit(self, shifted: ShiftedMoments, groups: Array, start: Array) -> _Fit | None:
        """Gauss-Newton on the delays of groups of joints; None when it does not settle within the nodes."""
        delays, prior = start, np.append(self._prior, np.zeros(len(groups)))
        low, high = shifted.nodes[1], shifted.nodes[-2]
        for _ in range(STEPS):
            estimate = WeightedLeastSquares().estimate(shifted.at(delays, groups), prior)
            step = estimate.parameters[-len(groups) :] @ groups
            moved = np.clip(delays + step, low, high)
            settled = np.abs(moved - delays).max() < CONVERGED * self._sample
            delays = moved
            if settled:
                break
        else:
            return None
        std = np.sqrt(np.diag(estimate.covariance))[-len(groups) :]
        return _Fit(delays, std @ groups, estimate.noise_std**-2.0)

    def _left_out(self, shifted: ShiftedMoments, delays: Array, weights: Array) -> Array:
        """Weighted squared error of each block, predicted without its fold, shape (blocks,)."""
        moments, ridge = shifted.at(delays), Ridge(strength=self._strength, standard_errors=False)
        error = np.zeros(moments.blocks)
        for held_out in contiguous_folds(moments.blocks, FOLDS):
            training = np.setdiff1d(np.arange(moments.blocks), held_out)
            found = ridge.estimate(moments.select_blocks(training), self._prior).parameters
            error[held_out] = moments.select_blocks(held_out).residual_energy(found) @ weights
        return error


@dataclass(frozen=True)
class _Gain:
    """Share of the squared error that is gone, and whether that is clear against its spread over blocks."""

    share: float
    is_clear: bool


def _compare(before: Array, after: Array) -> _Gain:
    difference = before - after
    spread = float(difference.std(ddof=1) * np.sqrt(len(difference)))
    share = float(difference.sum() / before.sum())
    return _Gain(share, bool(difference.sum() > CLEAR_GAIN * spread) and share > WORTHWHILE_GAIN)


def _is_significant(fit: _Fit) -> bool:
    return bool((np.abs(fit.delays) > SIGNIFICANT * fit.std).any())
