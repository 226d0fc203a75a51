"""Builds a design problem from a robot and what the user wants."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array, frozen
from casysid.dynamics import Armature, Coulomb, FrictionKind, Offset, Regressor, Viscous, build_regressor
from casysid.errors import ParameterError
from casysid.excitation.constraints.capsules import SLENDERNESS, Capsule, capsules_of
from casysid.excitation.constraints.clearance import build_clearance
from casysid.excitation.constraints.constraint import Constraint
from casysid.excitation.constraints.joint import joint_constraint
from casysid.excitation.constraints.keep_clear import ClearanceConstraint
from casysid.excitation.constraints.keep_in import KeepInConstraint
from casysid.excitation.constraints.obstacles import Obstacle
from casysid.excitation.constraints.solid_distances import SolidDistances, build_solid_distances
from casysid.excitation.constraints.solids import FileGeometry, read_geometry
from casysid.excitation.constraints.torque import TorqueConstraint
from casysid.excitation.design.criteria import Balanced, Criterion
from casysid.excitation.design.information import Information, column_scale
from casysid.excitation.design.mount import Floor, find_mount
from casysid.excitation.design.problem import ExcitationProblem, random_states
from casysid.excitation.motion.configuration import check_joints
from casysid.excitation.motion.fourier import FourierSeries, Motion, state_of
from casysid.excitation.motion.limits import JointLimits, limits_of
from casysid.identifiability import structural_base_parameters
from casysid.robot import Robot
from casysid.threads import single_threaded

COULOMB_SHARE = 0.03
"""Width of the smooth sign of Coulomb friction, as a share of the velocity limit."""
NOISE_SHARE = 0.01
"""Torque noise where none is given, as a share of the effort limit, or of the largest torque expected."""
SAMPLES_PER_HARMONIC = 24
"""Instants of the design grid in a period of the highest harmonic."""
LEAST_SWING = 0.05
"""A period in which no joint can swing by more than this share of half its range is too short."""
STATES = 1000
"""Random states that scale the parameters and judge the pairs of links."""
SOLID_STATES = 200
"""So many of them tell which shapes of the file overlap nearly everywhere."""


@single_threaded()
def build_excitation(
    robot: Robot,
    *,
    series: FourierSeries | None = None,
    periods: int = 1,
    rate: float = 500.0,
    limits: JointLimits | None = None,
    criterion: Criterion | None = None,
    friction: Sequence[FrictionKind] | None = None,
    parameters: npt.ArrayLike | None = None,
    torque_noise: npt.ArrayLike | None = None,
    capsules: Sequence[Capsule] | None = None,
    obstacles: Sequence[Obstacle] = (),
    floor: Floor = "mount",
    clearance: float | None = 0.01,
    keep_in: Sequence[KeepInConstraint] = (),
    start: npt.ArrayLike | None = None,
    samples: int | None = None,
) -> ExcitationProblem:
    """A design problem, not yet solved.

    Args:
        robot: Its joints have one degree of freedom each.
        series: Period and harmonics; None chooses them from the limits.
        periods: How often the period is repeated.
        rate: Samples per second of the recording [Hz].
        limits: None takes the model file's, with a margin (:func:`limits_of`).
        criterion: None is D-optimality with an eye to the condition number (:class:`Balanced`).
        friction: Columns to be identified beside the inertial ones; None is viscous, Coulomb (with a smooth width that
            fits the velocity), offset and armature.
        parameters: Of the prior model for the torque, shape (p,); None takes the model file's.
        torque_noise: Standard deviation of the torque, one for all or (n,); None is in proportion to the effort limits.
        capsules: Around the links; None takes the model file's geometry.
        obstacles: Half spaces and boxes around the robot.
        floor: Height of a floor along the base's z axis [m]; ``"mount"`` takes that of the file, or else the plane that
            the base stands on (:func:`~casysid.excitation.design.mount.find_mount`); None for none.
        clearance: Distance to keep between links and to obstacles [m]; None does not look at distances.
        keep_in: Boxes that points of links stay in.
        start: Positions to start from, shape (n,); None leaves them to the design.
        samples: Instants of the design grid in a period.

    Raises:
        ParameterError: Something cannot be; the message says what.
    """
    check_joints(robot)
    limits = limits or limits_of(robot)
    limits.check(robot)
    series = series or choose_series(limits, rate)
    samples = _grid(series, rate, samples)
    _check_period(robot, series, limits, rate, periods)
    regressor = build_regressor(robot, default_friction(limits) if friction is None else friction)
    theta = _parameters(regressor, parameters)
    states = random_states(limits, series, np.random.default_rng(0), STATES)
    information = _information(regressor, theta, states, torque_noise)
    near = _Surroundings(robot, states.position, capsules, obstacles, floor, clearance)
    return ExcitationProblem(
        robot=robot,
        series=series,
        periods=periods,
        rate=rate,
        limits=limits,
        parameters=theta,
        information=information,
        known=frozen(np.zeros((information.size, information.size))),
        criterion=criterion or Balanced(),
        constraints=(*_joint_constraints(regressor, limits, theta), *near.constraints, *keep_in),
        samples=samples,
        start=_start(robot, limits, start),
        notes=(*limits.assumed, *near.notes),
        solids=near.solids,
    )


def _parameters(regressor: Regressor, given: npt.ArrayLike | None) -> Array:
    theta = frozen(regressor.prior if given is None else given)
    if theta.shape != regressor.prior.shape or not np.isfinite(theta).all():
        raise ParameterError(
            f"excitation: parameters must be {len(regressor.names)} finite numbers, {regressor.names[0]} ... "
            f"{regressor.names[-1]}; got shape {theta.shape}"
        )
    return theta


def _information(regressor: Regressor, theta: Array, states: Motion, noise: npt.ArrayLike | None) -> Information:
    noise_std = _noise(regressor.robot, regressor, theta, states, noise)
    base = structural_base_parameters(regressor)
    scale = column_scale(regressor, base, noise_std, states)
    return Information(regressor=regressor, base=base, noise_std=noise_std, scale=scale)


def _joint_constraints(regressor: Regressor, limits: JointLimits, theta: Array) -> list[Constraint]:
    """Position, velocity, and where limited acceleration, jerk and torque."""
    robot, limited = regressor.robot, np.flatnonzero(np.isfinite(limits.torque))
    sides = [(limits.lower, limits.upper)]
    sides += [(-bound, bound) for bound in (limits.velocity, limits.acceleration, limits.jerk)]
    found = [joint_constraint(robot, order, lower, upper) for order, (lower, upper) in enumerate(sides)]
    torque = [TorqueConstraint(regressor, theta, limited, limits.torque[limited])] if len(limited) else []
    return [*(constraint for constraint in found if constraint is not None), *torque]


def default_friction(limits: JointLimits) -> tuple[FrictionKind, ...]:
    """Viscous, Coulomb, offset, armature; the Coulomb column's width in proportion to the velocity limit."""
    return Viscous(), Coulomb(width=COULOMB_SHARE * limits.velocity), Offset(), Armature()


def choose_series(limits: JointLimits, rate: float) -> FourierSeries:
    """Five harmonics, the third at about the frequency where a sinusoid meets position and velocity limits at once."""
    natural = float(np.median(limits.velocity / (2.0 * np.pi * limits.half_range)))
    period = float(np.clip(np.round(3.0 / natural), 4.0, 20.0))
    return FourierSeries(period, 5)


def _grid(series: FourierSeries, rate: float, samples: int | None) -> int:
    if not (np.isfinite(rate) and rate > 0.0):
        raise ParameterError(f"excitation: rate must be a positive number of samples per second; got {rate}")
    recorded = rate * series.period
    if recorded < 4 * series.harmonics:
        raise ParameterError(
            f"excitation: {series.harmonics} harmonics need at least {4 * series.harmonics} samples a period; "
            f"{series.period:.6g} s at {rate:.6g} Hz are {recorded:.6g}. Lengthen the period, raise the rate, or take "
            "fewer harmonics"
        )
    count = SAMPLES_PER_HARMONIC * series.harmonics if samples is None else samples
    if count != int(count) or count < 4 * series.harmonics:
        raise ParameterError(
            f"excitation: the design grid needs at least {4 * series.harmonics} samples for {series.harmonics} "
            f"harmonics; got {count}"
        )
    return int(count)


def _check_period(robot: Robot, series: FourierSeries, limits: JointLimits, rate: float, periods: int) -> None:
    if periods != int(periods) or periods < 1:
        raise ParameterError(f"excitation: periods must be a positive whole number; got {periods}")
    reach = limits.velocity * series.period / (2.0 * np.pi)  # amplitude of the base frequency at full speed
    share = reach / limits.half_range
    k = int(np.argmax(share))
    if share[k] < LEAST_SWING:
        raise ParameterError(
            f"excitation: a period of {series.period:.6g} s is too short: at its velocity limit even joint "
            f"'{robot.dofs[k]}' swings by no more than {share[k]:.2%} of half its range. Take about "
            f"{choose_series(limits, rate).period:.6g} s"
        )


def _start(robot: Robot, limits: JointLimits, start: npt.ArrayLike | None) -> Array | None:
    if start is None:
        return None
    values = np.asarray(start, dtype=np.float64)
    if values.shape != limits.lower.shape or not np.isfinite(values).all():
        raise ParameterError(f"excitation: start must be {len(limits.lower)} finite positions; got {start}")
    for k in np.flatnonzero(~((limits.lower <= values) & (values <= limits.upper))):
        raise ParameterError(
            f"excitation: start of joint '{robot.dofs[k]}' must be within its limits, {limits.lower[k]:.6g} to "
            f"{limits.upper[k]:.6g}; got {values[k]:.6g}"
        )
    return frozen(values)


def _noise(robot: Robot, regressor: Regressor, theta: Array, states: Motion, given: npt.ArrayLike | None) -> Array:
    if given is not None:
        noise = np.broadcast_to(np.asarray(given, dtype=np.float64), (robot.nv,))
        if not (np.isfinite(noise).all() and (noise > 0.0).all()):
            raise ParameterError(f"excitation: torque noise must be positive and finite; got {given}")
        return frozen(noise)
    expected = np.abs(regressor.predict(theta, *state_of(robot, states))).max(axis=0)
    largest = np.where(np.isfinite(robot.effort_limit), robot.effort_limit, expected)
    return frozen(NOISE_SHARE * np.where(largest > 0.0, largest, 1.0))


class _Surroundings:
    """What is kept at a distance from what.

    Attributes:
        constraints: Of distances.
        solids: The shapes of the file, for the last check; None where there are none, or no distances are kept.
        notes: What was assumed or left out, in words.
    """

    def __init__(
        self,
        robot: Robot,
        samples: Array,
        capsules: Sequence[Capsule] | None,
        obstacles: Sequence[Obstacle],
        floor: Floor,
        margin: float | None,
    ) -> None:
        self.constraints: list[Constraint] = []
        self.solids: SolidDistances | None = None
        self.notes: tuple[str, ...] = ("distances between links, and to a floor, are not looked at",)
        if margin is None:
            return
        if not (np.isfinite(margin) and margin >= 0.0):
            raise ParameterError(f"excitation: clearance must be a distance of at least 0 m, or None; got {margin}")
        geometry = read_geometry(robot) if capsules is None else FileGeometry()
        around = capsules_of(robot, geometry.solids) if capsules is None else tuple(capsules)
        mount = find_mount(robot, floor, geometry, around, samples, margin)
        obstacles = (*obstacles, *mount.planes)
        found = build_clearance(robot, around, obstacles, samples, margin, geometry.solids)
        self.notes = (*((mount.said,) if mount.said else ()), *geometry.missing, *found.ignored)
        if capsules is None and not geometry.solids:
            self.notes += (
                "the file has no collision geometry: each link is taken as a capsule between its joints, its radius "
                f"{SLENDERNESS:.0%} of their distance; tools and housings beyond that are not seen",
            )
        if len(found):
            reach = sum(float(np.linalg.norm(joint.placement.translation)) for joint in robot.joints)
            reach = max(reach, max(capsule.radius for capsule in around))
            self.constraints.append(ClearanceConstraint(found, found.near(samples, margin), margin, reach))
        if geometry.solids:
            self.solids = build_solid_distances(robot, geometry.solids, obstacles, samples[:SOLID_STATES])
