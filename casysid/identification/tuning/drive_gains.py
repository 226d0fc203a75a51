"""Torque scales of the joints relative to each other, where no body could have made the torques as they are logged.

Torques computed from motor currents carry the errors of the motors' torque constants. Least squares does not mind: it
scales every joint's parameters as it likes. Bodies that move several joints cannot be scaled joint by joint, so
consistent parameters then miss torques that unconstrained ones explain. Where consistency costs that much, a gain for
every joint, ``tau_j = g_j Y_j θ`` with a geometric mean of one, is fitted together with consistent parameters
(Gauss-Newton on the gains, each step a convex projection with one more column a joint), and kept if it predicts blocks
of time left out better. The common scale cannot be seen without a known mass (Gautier and Briot 2014).
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from casysid.arrays import Array, frozen
from casysid.dynamics import Parameter
from casysid.errors import SolverError
from casysid.estimation import Ridge
from casysid.estimation.cross_validation import contiguous_folds
from casysid.identification.tuning.held_out import FOLDS
from casysid.identification.tuning.log_score import EXPLAINED, PRACTICAL_GAIN, HeldOutScore, simplest_within_one_error
from casysid.inertia import Consistency
from casysid.moments import Indices, Moments, NormalEquations
from casysid.projection import (
    Knowledge,
    LinearKnowledge,
    ProjectionProblem,
    build_projection,
    convex_least_squares,
)

COSTLY = 1.05
"""Gains are looked for when consistency, or gains fixed at one, raise the torque's error by so much."""
SMALLEST = 0.1
"""Gains that are all nearer to one than this are none: torque constants are known no better."""
USUAL, PRICE = 0.3, 0.01
"""A gain that is off by so much (in its logarithm) must lower the residual energy by this share."""
TOLD = 1e-3
"""Share of the torque that gains must explain: a thousandth is below what any sensor of torque or current shows, and in
perfect data what smoothing leaves is explained by anything."""
STEPS, LONGEST_STEP, SETTLED = 8, 0.3, 3e-3
"""Of Gauss-Newton: how many, how far in a logarithm, and the relative fall of the cost that ends it."""


@dataclass(frozen=True, eq=False)
class DriveGains:
    """Measured torque over true torque of every joint, the geometric mean being one.

    Attributes:
        values: Shape (nv,); ones where nothing speaks for others.
        error: Their standard errors from blocks of time, shape (nv,); zeros where none were fitted.
        reason: In words; empty when there is nothing to say.
    """

    values: Array
    error: Array
    reason: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "values", frozen(self.values))
        object.__setattr__(self, "error", frozen(self.error))

    @property
    def found(self) -> bool:
        """Whether gains other than one were fitted."""
        return bool((self.error > 0.0).any())


def no_gains(dofs: int) -> DriveGains:
    """All ones."""
    return DriveGains(np.ones(dofs), np.zeros(dofs))


def choose_drive_gains(
    moments: Moments,
    parameters: Sequence[Parameter],
    consistency: Consistency | None,
    knowledge: Sequence[Knowledge] = (),
    given: Sequence[float] | None = None,
) -> DriveGains:
    """Gains that the data call for; ones where the search for them finds no usable answer.

    Args:
        moments: Of the regressor's columns.
        parameters: The regressor's columns.
        consistency: Laws of bodies; without them no gain can be told from the parameters.
        knowledge: What is known beside.
        given: Taken as they are.
    """
    moving = moments.away_from_rest()
    dofs = len(moving.joints)
    if given is not None:
        return DriveGains(np.array(given), np.zeros(dofs), "given")
    if consistency is None or dofs < 2:
        return no_gains(dofs)
    try:
        return _search(moving, parameters, consistency, knowledge)
    except SolverError:
        return no_gains(dofs)


def _search(
    moments: Moments, parameters: Sequence[Parameter], consistency: Consistency, knowledge: Sequence[Knowledge]
) -> DriveGains:
    """Gains, if they are needed and predict better.

    Raises:
        SolverError: No consistent parameters were found on the way.
    """
    dofs = len(moments.joints)
    weights = _weights(moments, parameters)
    fit = _GainFit(moments.joints, tuple(parameters), consistency, tuple(knowledge), weights)
    if (weights > 0.0).sum() < 2 or not fit.is_suspicious(moments):
        return no_gains(dofs)
    gains, with_them = fit.gains(moments)
    voting = weights > 0.0
    before, after = fit.error(moments, fit.consistent(moments)), fit.error(scaled(moments, gains), with_them)
    torque = math.sqrt(float(weights @ moments.target_energy().sum(axis=0)))
    is_small = np.abs(gains[voting] - 1.0).max() < SMALLEST or math.sqrt(max(before**2 - after**2, 0.0)) < TOLD * torque
    if is_small or after > (1.0 - PRACTICAL_GAIN) * before:
        return no_gains(dofs)
    folds = contiguous_folds(moments.blocks, FOLDS)
    values, without, with_gains = [], [], []
    for fold in folds:
        training = moments.select_blocks(np.setdiff1d(np.arange(moments.blocks), fold))
        test = moments.select_blocks(fold)
        own, parameters_with = fit.gains(training, gains, steps=2)
        without.append(_energies(test, training, fit.consistent(training)))
        with_gains.append(_energies(scaled(test, own), scaled(training, own), parameters_with))
        values.append(own)
    scores = [_held_out_score(moments, folds, energies) for energies in (without, with_gains)]
    if simplest_within_one_error(scores) == 0:
        return no_gains(dofs)
    spread = (len(folds) - 1) / len(folds) * np.sum((np.array(values) - np.mean(values, axis=0)) ** 2, axis=0)
    words = ", ".join(f"{dof} {value:.2f}" for dof, value in zip(moments.joints, gains, strict=True))
    return DriveGains(
        gains,
        np.sqrt(spread),
        f"no bodies make these torques in the proportions logged; with gains of {words} (measured over true torque, "
        f"geometric mean one) they do (held-out error x {scores[1].size(voting) / scores[0].size(voting):.2f}). Check "
        "the motors' torque constants",
    )


def _energies(test: Moments, training: Moments, parameters: Array) -> tuple[Array, Array]:
    """Squared errors on a test and mean squares on what was fitted, by joint."""
    rows = np.maximum(training.count.sum(axis=0), 1.0)
    return test.residual_energy(parameters).sum(axis=0), training.residual_energy(parameters).sum(axis=0) / rows


def _held_out_score(
    moments: Moments, folds: Sequence[Indices], energies: Sequence[tuple[Array, Array]]
) -> HeldOutScore:
    tests = moments.merged_blocks(folds)
    energy, variance = (np.array(one) for one in zip(*energies, strict=True))
    return HeldOutScore(energy, tests.target_energy(), tests.count, variance)


def scaled(moments: Moments, gains: Array) -> Moments:
    """Moments of the regressor whose rows are multiplied by ``gains``, shape (joints,)."""
    factors = [np.append(np.full(len(own), gain), 1.0) for own, gain in zip(moments.row_columns, gains, strict=True)]
    squares, noise = (
        None if sums is None else tuple(own * np.outer(f, f) for own, f in zip(sums, factors, strict=True))
        for sums in (moments.squares, moments.noise)
    )
    return dataclasses.replace(moments, squares=squares or (), noise=noise)


@dataclass(frozen=True, eq=False)
class _GainFit:
    """Consistent least squares with and without gains, joints weighted by the noise of their torque."""

    dofs: tuple[str, ...]
    parameters: tuple[Parameter, ...]
    consistency: Consistency
    knowledge: tuple[Knowledge, ...]
    weights: Array

    @property
    def prior(self) -> Array:
        """The model file's parameters."""
        return np.array([parameter.prior for parameter in self.parameters])

    def error(self, moments: Moments, parameters: Array) -> float:
        """Root of the weighted residual energy."""
        return math.sqrt(float(self.weights @ moments.residual_energy(parameters).sum(axis=0)))

    def is_suspicious(self, moments: Moments) -> bool:
        """Whether consistency, or equal gains without it, leave a good deal of the torque unexplained."""
        free = Ridge(standard_errors=False).estimate(moments, self.prior).parameters
        bent = _with_gain_columns(moments, free)
        prior = np.append(self.prior, np.zeros(len(self.dofs)))
        with_gains = Ridge(standard_errors=False).estimate(bent, prior).parameters
        error = self.error(moments, free)
        return (
            self.error(bent, with_gains) < error / COSTLY
            or self.error(moments, self.consistent(moments)) > COSTLY * error
        )

    def consistent(self, moments: Moments) -> Array:
        """Consistent parameters of least weighted residual energy."""
        return convex_least_squares(self._bodies, moments.pooled(self.weights), self.prior)

    def gains(self, moments: Moments, start: Array | None = None, steps: int = STEPS) -> tuple[Array, Array]:
        """Gains, from a start or ones, and the consistent parameters that go with them."""
        g = np.ones(len(moments.joints)) if start is None else start
        theta = self.consistent(scaled(moments, g))
        cost = self._cost(moments, g, theta)
        for _ in range(steps):
            step = self._gauss_newton(moments, g, theta, cost)
            shorter = g * np.exp(step - step.mean())
            bent = self.consistent(scaled(moments, shorter))
            better = self._cost(moments, shorter, bent)
            if better < cost:
                g, theta = shorter, bent
            if not better < (1.0 - SETTLED) * cost:
                break
            cost = better
        return g, theta

    def _cost(self, moments: Moments, g: Array, theta: Array) -> float:
        """Weighted residual energy, raised by what gains far from one have to pay."""
        energy = self.error(scaled(moments, g), theta) ** 2
        return energy * (1.0 + PRICE * float(np.sum((np.log(g) / USUAL) ** 2)))

    def _gauss_newton(self, moments: Moments, g: Array, theta: Array, cost: float) -> Array:
        """Change of ``log g`` from one convex problem in bodies and gains, clipped."""
        dofs, p = len(g), len(self.parameters)
        normal = _with_gain_columns(scaled(moments, g), theta).pooled(self.weights)
        xx, xy, pull = normal.xx.copy(), normal.xy.copy(), PRICE * cost / USUAL**2
        xx[p:, p:] += pull * np.eye(dofs)
        xy[p:] -= pull * np.log(g)
        found = convex_least_squares(
            self._with_gains, NormalEquations(xx, xy, normal.yy, normal.count), np.append(self.prior, np.zeros(dofs))
        )
        return np.clip(found[p:], -LONGEST_STEP, LONGEST_STEP)

    @cached_property
    def _bodies(self) -> ProjectionProblem:
        return build_projection(self.parameters, consistency=self.consistency, knowledge=self.knowledge)

    @cached_property
    def _with_gains(self) -> ProjectionProblem:
        columns = tuple(Parameter(f"{dof}.gain", dof, "gain", "", False, 0.0) for dof in self.dofs)
        one = LinearKnowledge(coefficients={column.name: 1.0 for column in columns}, lower=0.0, upper=0.0, name="gains")
        return build_projection(
            (*self.parameters, *columns),
            consistency=self.consistency,
            knowledge=(*self.knowledge, one),
        )


def _weights(moments: Moments, parameters: Sequence[Parameter]) -> Array:
    """``1/σ²`` by joint; zero for joints whose torque nothing explains."""
    prior = np.array([parameter.prior for parameter in parameters])
    estimate = Ridge(standard_errors=False).estimate(moments, prior)
    missed, felt = (one.sum(axis=0) for one in (moments.residual_energy(estimate.parameters), moments.target_energy()))
    return np.where(missed < (1.0 - EXPLAINED) * felt, estimate.noise_std**-2.0, 0.0)


def _with_gain_columns(moments: Moments, parameters: Array) -> Moments:
    """Moments with one more column a joint, its torque predicted by ``parameters``, in that joint's rows."""
    dofs, p = len(moments.joints), len(moments.columns)
    squares, rows = [], []
    for joint in range(dofs):
        own, sums = moments.of_joint(joint)
        T = np.zeros((len(own) + 1, len(own) + 2))
        T[:-1, :-2], T[:-1, -2], T[-1, -1] = np.eye(len(own)), parameters[own], 1.0
        squares.append(T.T @ sums @ T)
        rows.append(np.append(own, p + joint))
    names = (*moments.columns, *(f"{dof}.gain" for dof in moments.joints))
    return Moments(tuple(squares), tuple(rows), moments.count, names, moments.joints)
