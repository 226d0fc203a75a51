"""The model anew from fading moments: the posterior's mean with the sizes of an identification, made consistent.

What an identification found of the joints' noise and of how far parameters may be from the model file stays; so a
renewal is one linear system, one nearest point and the sums of the scores, whose time does not grow.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array
from casysid.dynamics import Coulomb, Parameter, Regressor
from casysid.errors import ParameterError
from casysid.estimation.base import Spread
from casysid.estimation.covariance import RANK_TOLERANCE, covariance_from_blocks
from casysid.estimation.empirical_bayes import INFLATION
from casysid.estimation.evidence import centre_of, seen_columns
from casysid.identification import IdentificationResult
from casysid.identification.friction_laws import friction_laws
from casysid.identification.pipeline import PRIOR_BUDGET, fit
from casysid.identification.plain_friction import homeless_columns, nearest_plain_friction
from casysid.inertia import KINDS
from casysid.inertia import inertial_parameters as parameters_of
from casysid.model import RobotModel, Scatter
from casysid.moments import NEAR_REST, Moments
from casysid.online.forgetting import with_payload
from casysid.payload.body import DENSITY, UNITS
from casysid.projection import PossibleParameters, build_projection

Indices = npt.NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Held:
    """What the robot holds.

    Attributes:
        since: From when on [s].
        parameters: Ten at the link's frame, of a body that can be.
        covariance: Of them, (10, 10).
    """

    since: float
    parameters: Array
    covariance: Array

    @property
    def mass(self) -> float:
        """[kg]."""
        return float(self.parameters[0])

    @property
    def mass_std(self) -> float:
        """Standard error [kg]."""
        return float(np.sqrt(self.covariance[0, 0]))

    @property
    def center_of_mass(self) -> Array:
        """In the link's frame, shape (3,), [m]."""
        return np.asarray(self.parameters[1:4] / self.parameters[0])

    @property
    def center_of_mass_std(self) -> Array:
        """Standard errors, shape (3,), [m]."""
        jacobian = np.column_stack([-self.center_of_mass, np.eye(3)]) / self.mass
        return np.asarray(np.sqrt(np.diag(jacobian @ self.covariance[:4, :4] @ jacobian.T)))


@dataclass(frozen=True, eq=False)
class State:
    """What is known of the robot at one time.

    Attributes:
        time: Of the newest sample in it [s].
        model: With what is held in its link; intervals with ``std=True``.
        held: What it holds; None if nothing.
        posterior: Covariance of the model's parameters with the prior's part, (p, p), finite.
        spread: Covariance from blocks of time, of the same.
    """

    time: float
    model: RobotModel
    held: Held | None
    posterior: Array
    spread: Spread


class Renewal:
    """Fixed for a robot: columns, noise, prior, and the laws that parameters obey."""

    def __init__(self, result: IdentificationResult, regressor: Regressor, link: Indices) -> None:
        """From an identification.

        Args:
            result: Its result, whose moments are in the regressor's columns or have more.
            regressor: Of the samples to come.
            link: Columns of the link that may hold something, shape (10,).
        """
        self.regressor, self.link = regressor, link
        self._settings = dataclasses.replace(result.settings, choose_friction=False)
        moments = result.moments.select_columns([result.moments.columns.index(name) for name in regressor.names])
        estimate, _, _ = fit(regressor, moments, self._settings)
        spread = estimate.spread
        if spread is None:
            raise ParameterError(
                f"online: wanted a result of method empirical-bayes or eiv, whose prior goes on; got {estimate.method}"
            )
        self.inflation = float(estimate.diagnostics.get(INFLATION, 1.0))
        self._open = spread.open
        self._prior = estimate.metric - moments.pooled(estimate.noise_std**-2.0).xx
        self._centre = centre_of(moments, regressor.prior)
        self._live = seen_columns(moments)
        self.start = _with_all_joints(moments, regressor)
        self.weights = self._weights(moments.joints, estimate.noise_std, estimate.parameters)
        self._possible: PossibleParameters | None = None
        self._body: Array | None = None

    def _weights(self, joints: tuple[str, ...], noise: Array, theta: Array) -> Array:
        """Of every joint's rows; of those near rest that were not seen, friction may be anything up to Coulomb's."""
        known, values = dict(zip(joints, noise, strict=True)), dict(zip(self.regressor.names, theta, strict=True))
        variance = []
        for name in self.start.joints:
            dof = name.removesuffix(NEAR_REST)
            dry = values.get(f"{dof}.{Coulomb.kind}", 0.0)
            variance.append(known[name] ** 2 if name in known else known[dof] ** 2 + dry**2)
        return 1.0 / np.array(variance)

    def begin(self, body: Array | None) -> None:
        """From now on something is held, of which ten parameters are guessed; or nothing, None."""
        self._possible, self._body = None, body

    @property
    def _first(self) -> int:
        """Place of the payload's columns."""
        return self.regressor.robot.inertial_parameters.size

    def renew(self, moments: Moments, held: npt.NDArray[np.bool_], now: float, since: float) -> State:
        """The state of now, from the weighted moments and which blocks hold something."""
        prior, centre, opened, live = self._prior, self._centre, self._open, self._live
        body, first = self._body, self._first
        if body is not None:
            moments = with_payload(moments, held, self.link, first)
            size = _size(body)
            prior, opened = _wider(prior, size**-2.0, first), _wider(opened, size**2.0, first)
            centre, live = np.insert(centre, [first] * 10, body), np.insert(live, [first] * 10, True)
        normal = moments.pooled(self.weights)
        metric = normal.xx + prior
        places = np.flatnonzero(live)
        scale = 1.0 / np.sqrt(np.maximum(np.diag(metric)[places], np.finfo(np.float64).tiny))
        inverse = _inverse(metric[np.ix_(places, places)] * np.outer(scale, scale)) * np.outer(scale, scale)
        theta, posterior = centre.copy(), np.zeros_like(metric)
        right = normal.xy - normal.xx @ centre
        theta[places] += inverse @ right[places]
        posterior[np.ix_(places, places)] = self.inflation * inverse
        theta = self._nearest_possible(theta, metric, normal.residual_energy(theta))
        spread = covariance_from_blocks(moments.shifted(centre), theta - centre, self.weights, opened)
        return self._state(theta, posterior, spread, now, since)

    def _nearest_possible(self, theta: Array, metric: Array, energy: float) -> Array:
        if self._settings.consistency is None:
            return theta
        if self._possible is None:
            parameters, prior = list(self.regressor.parameters), self.regressor.prior
            if self._body is not None:
                parameters[self._first : self._first] = [
                    Parameter(f"payload.{kind}", "payload", kind, unit, False, 0.0)
                    for kind, unit in zip(KINDS, UNITS, strict=True)
                ]
                prior = np.insert(prior, [self._first] * 10, self._body)
            problem = build_projection(
                parameters,
                consistency=self._settings.consistency,
                knowledge=(*self._settings.knowledge, *friction_laws(self.regressor)),
                prior_budget=PRIOR_BUDGET,
            )
            self._possible = PossibleParameters(problem, prior)
        return self._possible(theta, metric, energy)

    def _state(self, theta: Array, posterior: Array, spread: Spread, now: float, since: float) -> State:
        held = None
        if self._body is not None:
            ten, kept = np.arange(self._first, self._first + 10), np.ones(len(theta), dtype=bool)
            kept[ten] = False
            seen, whole = spread.covariance[np.ix_(ten, ten)], posterior[np.ix_(ten, ten)]
            covariance = seen + np.diag(np.maximum(np.diag(whole) - np.diag(seen), 0.0))  # never less than the prior's
            held = Held(since, theta[ten], covariance)
            together = np.zeros((kept.sum(), len(theta)))
            together[np.arange(kept.sum()), np.flatnonzero(kept)] = 1.0
            together[self.link, ten] = 1.0
            theta, posterior = together @ theta, together @ posterior @ together.T
            spread = _mapped(spread, together)
        plain = nearest_plain_friction(self.regressor, theta, self.start, homeless_columns(self.regressor))
        model = RobotModel(
            regressor=self.regressor,
            parameters=theta,
            scatter=Scatter(spread.covariance, spread.hidden, spread.scale),
            damping=plain["viscous"],
            dry_friction=plain["coulomb"],
        )
        return State(now, model, held, posterior, spread)


def guessed_body(mass: float, first_moment: Array) -> Array:
    """A ball of aluminium with this mass and first moment: what a payload is until more is seen of it, (10,)."""
    radius = (3.0 * mass / (4.0 * np.pi * DENSITY)) ** (1.0 / 3.0)
    return np.asarray(parameters_of(mass, first_moment / mass, 0.4 * mass * radius**2 * np.eye(3)))


def _size(body: Array) -> Array:
    """How far a guess may be off: by all of its mass, at twice its distance and radius, shape (10,)."""
    mass = float(body[0])
    reach = float(np.linalg.norm(body[1:4])) / mass + (3.0 * mass / (4.0 * np.pi * DENSITY)) ** (1.0 / 3.0)
    return mass * np.array([1.0, *(2.0 * reach,) * 3, *(4.0 * reach**2,) * 6])


def _wider(square: Array, diagonal: Array, first: int) -> Array:
    """A square matrix with a diagonal block put in at a place."""
    p = len(square)
    others = np.concatenate([np.arange(first), np.arange(first + 10, p + 10)])
    wide = np.zeros((p + 10, p + 10))
    wide[np.ix_(others, others)] = square
    wide[np.arange(first, first + 10), np.arange(first, first + 10)] = diagonal
    return wide


def _inverse(matrix: Array) -> Array:
    values, vectors = np.linalg.eigh(matrix)
    return np.asarray((vectors / np.maximum(values, RANK_TOLERANCE * values.max(initial=0.0))) @ vectors.T)


def _mapped(spread: Spread, together: Array) -> Spread:
    """The spread of sums of parameters."""
    scale = np.sqrt((together**2) @ spread.scale**2)
    hidden, sizes, _ = np.linalg.svd((together * spread.scale) @ spread.hidden / scale[:, None], full_matrices=False)
    return Spread(
        together @ spread.covariance @ together.T,
        hidden[:, sizes > RANK_TOLERANCE],
        scale,
        spread.freedom,
        together @ spread.open @ together.T,
        together @ spread.settled @ together.T,
    )


def _with_all_joints(moments: Moments, regressor: Regressor) -> Moments:
    """The moments with rows near rest of every joint, zero where there were none."""
    rows = (*regressor.row_columns, *regressor.row_columns)
    joints = (*regressor.robot.dofs, *(f"{dof}{NEAR_REST}" for dof in regressor.robot.dofs))
    squares, count = [], np.zeros((moments.blocks, len(joints)))
    for k, (joint, own) in enumerate(zip(joints, rows, strict=True)):
        wide = np.zeros((moments.blocks, len(own) + 1, len(own) + 1))
        if joint in moments.joints:
            place = moments.joints.index(joint)
            columns, sums = moments.of_joint(place)
            at = np.append(np.searchsorted(own, columns), len(own))
            wide[:, at[:, None], at] = sums
            count[:, k] = moments.count[:, place]
        squares.append(wide)
    return Moments(tuple(squares), rows, count, moments.columns, joints)
