"""The answer of an identification, with everything that is needed to check it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array
from casysid.dynamics import Coulomb, MaxwellSlip, Regressor, SharpCoulomb
from casysid.estimation import Estimate, Status
from casysid.identifiability import BaseParameters
from casysid.identification.choices import Choices
from casysid.identification.friction_laws import broken_laws
from casysid.identification.friction_model import model_to_json
from casysid.identification.links import LinkProperties, link_properties
from casysid.identification.mistakes import Mistake
from casysid.identification.plain_friction import JOINT_KINDS as JOINT_KINDS
from casysid.identification.plain_friction import homeless_columns, nearest_plain_friction
from casysid.identification.prediction import TorqueError
from casysid.identification.settings import Settings
from casysid.identification.sources import Sources, sources_of
from casysid.identification.tuning.band import BandChoice
from casysid.identification.tuning.clock import TimeBase
from casysid.identification.tuning.delay import DelayChoice
from casysid.identification.tuning.drive_gains import DriveGains
from casysid.identification.tuning.friction_selection import FrictionChoice
from casysid.inertia import smallest_eigenvalue
from casysid.model import RobotModel, Scatter
from casysid.moments import Moments
from casysid.projection import ProjectionResult
from casysid.robot import Robot
from casysid.signals import InputNoise, Motion
from casysid.uncertainty import ParameterUncertainty


def is_dry(kind: str) -> bool:
    """Whether a parameter's kind is dry friction that does not depend on load or position."""
    return kind in (Coulomb.kind, SharpCoulomb.kind) or kind.startswith(MaxwellSlip.kind)


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class IdentificationResult:
    """Identified parameters of a robot and how far they can be trusted.

    Attributes:
        robot: The robot as its file describes it.
        settings: What was asked for.
        choices: What was chosen from the data, each with its evidence.
        regressor: Of which ``parameters`` are the coefficients.
        moments: Of the fitted recordings.
        estimate: The unconstrained estimate.
        projection: How the estimate was made consistent; None when that was not asked for.
        uncertainty: Standard errors of the answer.
        structural: Base parameters of the mechanism.
        excited: Base parameters that the recordings show.
        unconstrained: Torque error of the estimate before the projection, on the held-out recordings if there are any.
        train: Torque error on the fitted recordings.
        held_out: Torque error on recordings never fitted; None without any.
        file: Torque error of the file's own parameters, on the held-out recordings if there are any, else on the fitted
            ones.
        train_motions: The fitted motions.
        held_out_motions: The motions never fitted.
        input_noise: Of the measured motion; None where it is not known.
        seconds: Wall time of the stages by name.
    """

    robot: Robot
    settings: Settings
    choices: Choices
    regressor: Regressor
    moments: Moments
    estimate: Estimate
    projection: ProjectionResult | None
    uncertainty: ParameterUncertainty
    structural: BaseParameters
    excited: BaseParameters
    unconstrained: TorqueError
    train: TorqueError
    held_out: TorqueError | None
    file: TorqueError
    train_motions: tuple[Motion, ...]
    held_out_motions: tuple[Motion, ...]
    input_noise: InputNoise | None = None
    seconds: Mapping[str, float] = field(default_factory=dict)

    def __repr__(self) -> str:
        kind, told = ("held-out", self.held_out) if self.held_out else ("fitted", self.train)
        return (
            f"<IdentificationResult of '{self.robot.name}': {len(self.parameters)} parameters by "
            f"{self.estimate.method}, torque error {100.0 * told.relative:.3g} % on {kind} recordings>"
        )

    @cached_property
    def model(self) -> RobotModel:
        """The identified dynamics: torques with standard errors, CasADi, C, Pinocchio, MuJoCo."""
        plain = nearest_plain_friction(self.regressor, self.parameters, self.moments, homeless_columns(self.regressor))
        return RobotModel(
            regressor=self.regressor,
            parameters=self.parameters,
            scatter=Scatter(self.uncertainty.covariance, self.uncertainty.hidden, self.uncertainty.spread.scale),
            damping=plain["viscous"],
            dry_friction=plain["coulomb"],
        )

    @property
    def parameters(self) -> Array:
        """The answer, shape (p,): the projection's if there was one, else the estimate's."""
        return self.estimate.parameters if self.projection is None else self.projection.parameters

    @property
    def time_base(self) -> TimeBase:
        """What was found of the recordings' clock."""
        return self.choices.clock

    @property
    def mistakes(self) -> tuple[Mistake, ...]:
        """What in the recordings contradicts the model file, if anything; nothing was changed for it."""
        return self.choices.mistakes

    @property
    def cutoff(self) -> BandChoice:
        """The low-pass and why."""
        return self.choices.band

    @property
    def delay(self) -> DelayChoice:
        """How late the torque was; taken out of all motions here, fitted and held out alike."""
        return self.choices.delay

    @property
    def torque_delay(self) -> Array:
        """By how much the torque was logged later than the motion, shape (nv,), [s]."""
        return self.choices.delay.seconds

    @property
    def friction(self) -> FrictionChoice:
        """What the data added to the friction that was asked for."""
        return self.choices.friction

    @property
    def torque_gains(self) -> DriveGains:
        """Of the joints relative to each other, and why."""
        return self.choices.gains

    def predict_torque(self, q: npt.ArrayLike, v: npt.ArrayLike, a: npt.ArrayLike) -> Array:
        """Torque along a motion, shape (N, nv), as it would be logged but for the delay.

        Friction before sliding remembers the way that the joints have gone, so the samples must follow each other in
        time; before the first one everything is slack.

        Args:
            q: Configurations, shape (N, nq).
            v: Velocities, shape (N, nv).
            a: Accelerations, shape (N, nv).

        Raises:
            ParameterError: A shape does not fit.
        """
        return self.regressor.predict(self.parameters, q, v, a)

    @property
    def status(self) -> Status:
        """Why the estimator stopped."""
        return self.estimate.status

    @property
    def inertial_parameters(self) -> Array:
        """The links' parameters, shape (10 links,), as all functions take them; ``reshape(-1, 10)`` is link by link."""
        return self.parameters[: 10 * len(self.robot.links)]

    @property
    def smallest_pseudo_inertia_eigenvalue(self) -> float:
        """Over all links; not negative exactly when some distribution of mass has these parameters."""
        return float(smallest_eigenvalue(self.inertial_parameters.reshape(-1, 10)).min())

    @property
    def negative_drive_parameters(self) -> tuple[str, ...]:
        """Names of friction and armature parameters that ought not to be negative, and are."""
        inertial = 10 * len(self.robot.links)
        negative = [
            parameter.name
            for parameter, value in zip(self.regressor.parameters[inertial:], self.parameters[inertial:], strict=True)
            if parameter.non_negative and value < 0.0
        ]
        return (*negative, *broken_laws(self.regressor, self.parameters))

    @property
    def is_physically_consistent(self) -> bool:
        """Positive definite pseudo-inertia of every link, and no negative friction or armature."""
        return self.smallest_pseudo_inertia_eigenvalue > 0.0 and not self.negative_drive_parameters

    @property
    def inconsistent_links(self) -> tuple[str, ...]:
        """Links whose pseudo-inertia is not positive definite."""
        smallest = smallest_eigenvalue(self.inertial_parameters.reshape(-1, 10))
        return tuple(link for link, value in zip(self.robot.links, smallest, strict=True) if not value > 0.0)

    def links(self) -> tuple[LinkProperties, ...]:
        """Mass, centre of mass and inertia of every link with their standard errors."""
        places = [slice(10 * k, 10 * k + 10) for k in range(len(self.robot.links))]
        return tuple(
            link_properties(link, self.parameters[ten], std, self.sources.within(ten))
            for link, ten, std in zip(self.robot.links, places, self.uncertainty.link_std, strict=True)
        )

    @cached_property
    def sources(self) -> Sources:
        """How far the data decided each parameter, and how far the model file."""
        return sources_of(self.uncertainty.spread, self.structural)

    def drive_parameters(self) -> dict[str, dict[str, float | None]]:
        """Friction and armature by degree of freedom, couplings by name; None for a kind that is not in the model."""
        return self._by_drive(self.parameters)

    def drive_std(self) -> dict[str, dict[str, float | None]]:
        """Standard errors of the same; infinite where the data do not tell a parameter by itself."""
        return self._by_drive(self.uncertainty.std)

    def _by_drive(self, values: Array) -> dict[str, dict[str, float | None]]:
        table: dict[str, dict[str, float | None]] = {dof: dict.fromkeys(JOINT_KINDS) for dof in self.robot.dofs}
        inertial = 10 * len(self.robot.links)
        for parameter, value in zip(self.regressor.parameters[inertial:], values[inertial:], strict=True):
            table.setdefault(parameter.owner, {})[parameter.kind] = float(value)
        return table

    def dry_friction(self) -> dict[str, float | None]:
        """All dry friction of each degree of freedom and coupling once it slides, but for that of the load [N m, N].

        The sum of blunt and sharp Coulomb friction and of what every element of friction before sliding slides at.
        """
        table = self.drive_parameters()
        dry = {owner: [row[kind] for kind in row if is_dry(kind)] for owner, row in table.items()}
        return {
            owner: sum(value for value in several if value is not None) if any(v is not None for v in several) else None
            for owner, several in dry.items()
        }

    def drive_vector(self, kind: str) -> Array:
        """One kind of drive parameter by degree of freedom, shape (nv,); zero where the model has none."""
        table = self.drive_parameters()
        return np.array([table[dof][kind] or 0.0 for dof in self.robot.dofs])

    def to_json(self) -> dict[str, object]:
        """The result as plain numbers, lists and words; infinities and NaN as null."""
        by_joint = self.robot.dofs
        held_out = self.held_out
        content: dict[str, object] = {
            "status": self.status.value,
            "method": self.estimate.method,
            "robot": self.robot.name,
            "joints": list(by_joint),
            "samples": {"train": self.train.samples, "held_out": held_out.samples if held_out else 0},
            "seconds": round(sum(self.seconds.values()), 3),
            "flip": list(self.settings.flip),
            **self.choices.to_json(by_joint),
            "relative_error": {
                "train": self.train.relative,
                "held_out": held_out.relative if held_out else None,
                "unconstrained": self.unconstrained.relative,
                "file": self.file.relative,
            },
            "relative_error_unfiltered": {
                "train": self.train.relative_unfiltered,
                "held_out": held_out.relative_unfiltered if held_out else None,
                "file": self.file.relative_unfiltered,
            },
            "torque_rmse": {
                "train": dict(zip(by_joint, self.train.rmse.tolist(), strict=True)),
                "held_out": dict(zip(by_joint, held_out.rmse.tolist(), strict=True)) if held_out else None,
            },
            "physically_consistent": self.is_physically_consistent,
            "smallest_pseudo_inertia_eigenvalue": self.smallest_pseudo_inertia_eigenvalue,
            "projection": _projection_to_json(self.projection),
            "base_parameters": {
                "rank": self.structural.rank,
                "condition_number": self.excited.condition_number,
                "excited_rank": self.excited.rank,
                "combinations": list(self.structural.words()),
            },
            "links": {link.name: link.to_json() for link in self.links()},
            "friction": self.drive_parameters(),
            "dry_friction": self.dry_friction(),
            "friction_std": self.drive_std(),
            "friction_decided_by_data": self._by_drive(self.sources.by_data),
            "decided_by_the_file": list(self.sources.of_the_file),
            "friction_model": {
                **model_to_json(self.regressor),
                "chosen": [one.to_json() for one in self.friction.chosen],
            },
            "degrees_of_freedom": self.uncertainty.freedom,
            "input_noise": _noise_to_json(self.robot, self.input_noise),
            "diagnostics": dict(self.estimate.diagnostics),
        }
        return content


def _noise_to_json(robot: Robot, noise: InputNoise | None) -> dict[str, object] | None:
    if noise is None:
        return None
    by_channel, by_dof = robot.channels, robot.dofs
    return {
        "source": noise.source,
        "position": dict(zip(by_channel, noise.position.tolist(), strict=True)),
        "resolution": dict(zip(by_channel, noise.resolution.tolist(), strict=True)),
        "velocity": dict(zip(by_dof, noise.velocity.tolist(), strict=True)),
        "acceleration": dict(zip(by_dof, noise.acceleration.tolist(), strict=True)),
        "relative_error": noise.relative_error,
    }


def _projection_to_json(projection: ProjectionResult | None) -> dict[str, object] | None:
    if projection is None:
        return None
    return {
        "status": projection.status.value,
        "solver": projection.solver.value,
        "misfit": projection.misfit,
        "gap": projection.gap,
        "active": list(projection.active),
        "iterations": projection.iterations,
    }


def without_infinities(value: object) -> object:
    """The same nested content with infinities and NaN as None, which JSON can hold."""
    if isinstance(value, dict):
        return {key: without_infinities(item) for key, item in value.items()}
    if isinstance(value, list):
        return [without_infinities(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
