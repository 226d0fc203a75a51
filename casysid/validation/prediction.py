"""How well given parameters predict the torque of recordings: a model file judged, nothing fitted."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from casysid.arrays import Array
from casysid.dynamics import DEFAULT_FRICTION, Coupling, Regressor, build_regressor, with_width
from casysid.errors import ParameterError
from casysid.identification import CutoffChoice, Settings, TorqueError, choose_cutoff, torque_error
from casysid.identification.friction_model import FrictionModel, model_from_json
from casysid.identification.problem import USUAL_WIDTH, coulomb_width, make_motion
from casysid.recording import Recording
from casysid.robot import Robot
from casysid.signals import aligned

Drives = Mapping[str, Mapping[str, float | None]]
"""Friction and armature by joint and kind, as in a ``result.json``."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Validation:
    """Torque error of given parameters.

    Attributes:
        robot: The model.
        cutoff: The low-pass and why.
        parameters: What was judged, shape (p,), in the regressor's order.
        regressor: Of which they are the coefficients.
        total: Over all recordings.
        by_recording: Of each recording, by its name.
    """

    robot: Robot
    cutoff: CutoffChoice
    parameters: Array
    regressor: Regressor
    total: TorqueError
    by_recording: tuple[tuple[str, TorqueError], ...]

    def to_json(self) -> dict[str, object]:
        """Plain numbers, lists and words."""
        return {
            "robot": self.robot.name,
            "model": str(self.robot.source),
            "joints": list(self.robot.dofs),
            "cutoff": {"hz": self.cutoff.cutoff, "reason": self.cutoff.reason},
            **self._figures(self.total),
            "recordings": [{"name": name, **self._figures(error)} for name, error in self.by_recording],
        }

    def _figures(self, error: TorqueError) -> dict[str, object]:
        dofs = self.robot.dofs
        return {
            "samples": error.samples,
            "relative_error": error.relative,
            "relative_error_unfiltered": error.relative_unfiltered,
            "relative_error_by_joint": dict(zip(dofs, error.relative_by_joint.tolist(), strict=True)),
            "torque_rmse": dict(zip(dofs, error.rmse.tolist(), strict=True)),
        }


def validate(
    robot: Robot,
    recordings: Sequence[Recording],
    *,
    drives: Drives | None = None,
    delays: Mapping[str, float] | None = None,
    friction: FrictionModel | None = None,
    cutoff: float | None = None,
    progress: Callable[[str, float], None] = lambda stage, share: None,
) -> Validation:
    """Predict the torque of recordings by a model's own parameters.

    Args:
        robot: Its links' parameters are judged, and its friction unless ``drives`` says otherwise.
        recordings: At least one.
        drives: Friction, offset and armature to take instead of the file's, which has no place for all of them.
        delays: By how much the logged torque is late, by joint [s].
        friction: Columns and couplings that ``drives`` are the parameters of; None takes the default columns, as wide
            as the motions ask, and couplings by their names.
        cutoff: Low-pass [Hz] of motion and torque; None lets the data choose.
        progress: Told the stage and the share done.

    Raises:
        ParameterError: No recording, or a drive that the robot does not have.
    """
    if not recordings:
        raise ParameterError("validate: at least one recording is needed; got none")
    model = friction or FrictionModel(DEFAULT_FRICTION, _couplings(robot, drives or {}))
    settings = Settings(cutoff=cutoff, friction=model.columns, couplings=model.couplings)
    late = np.array([(delays or {}).get(dof, 0.0) for dof in robot.dofs])
    recordings = [aligned(recording, late) for recording in recordings]
    choice = choose_cutoff(robot, recordings, settings, progress=lambda share: progress("cut-off", share))
    progress("predict", 0.0)
    motions = [make_motion(robot, recording, choice.cutoff) for recording in recordings]
    columns = model.columns if friction else with_width(model.columns, coulomb_width(motions, USUAL_WIDTH).tolist())
    regressor = build_regressor(robot, friction=columns, couplings=model.couplings)
    parameters = parameters_with_drives(regressor, drives or {})
    errors = [torque_error(regressor, parameters, [motion], choice.cutoff) for motion in motions]
    progress("predict", 1.0)
    return Validation(
        robot=robot,
        cutoff=choice,
        parameters=parameters,
        regressor=regressor,
        total=torque_error(regressor, parameters, motions, choice.cutoff),
        by_recording=tuple((recording.label, error) for recording, error in zip(recordings, errors, strict=True)),
    )


def parameters_with_drives(regressor: Regressor, drives: Drives) -> Array:
    """The regressor's prior, shape (p,), where ``drives`` does not say otherwise.

    Raises:
        ParameterError: A joint or a kind that the regressor does not have.
    """
    place = {(one.owner, one.kind): k for k, one in enumerate(regressor.parameters)}
    theta = np.array(regressor.prior)
    for owner, kinds in drives.items():
        for kind, value in kinds.items():
            if value is None:
                continue
            if (owner, kind) not in place:
                raise ParameterError(
                    f"validate: robot '{regressor.robot.name}' has no {kind} of '{owner}'; its degrees of freedom are "
                    f"{', '.join(regressor.robot.dofs)}. Is this the result of another robot?"
                )
            theta[place[owner, kind]] = value
    return theta


def read_drives(path: Path) -> tuple[Drives, float | None]:
    """Friction and armature of a ``result.json``, and the cut-off [Hz] that it was identified at.

    Raises:
        ParameterError: The file is not such a result.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        return content["friction"], content["cutoff"]["hz"]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise ParameterError(
            f"{path}: wanted the result.json of an identification, with its 'friction' and 'cutoff'; {error!r}"
        ) from error


def read_delays(path: Path) -> Mapping[str, float]:
    """By how much the torque was late, by joint [s], in a ``result.json``; empty where it says nothing of it.

    Raises:
        ParameterError: The file is not such a result.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        return {str(joint): float(late) for joint, late in content.get("delay", {}).get("seconds", {}).items()}
    except (OSError, ValueError, AttributeError, TypeError) as error:
        raise ParameterError(f"{path}: wanted the result.json of an identification; {error!r}") from error


def read_friction(path: Path) -> FrictionModel | None:
    """The friction columns and couplings of a ``result.json``; None for one that does not hold them.

    Raises:
        ParameterError: The file cannot be read, or its columns are not casysid's own.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        return model_from_json(content["friction_model"]) if "friction_model" in content else None
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise ParameterError(f"{path}: its 'friction_model' is not that of an identification; {error!r}") from error


def _couplings(robot: Robot, drives: Drives) -> tuple[Coupling, ...]:
    """The couplings among the drives' owners, as ``casysid identify --coupling`` makes them: every weight one."""
    names = [owner.split("+") for owner in drives if owner not in robot.dofs and "+" in owner]
    return tuple(Coupling(joints=tuple(joints), weights=(1.0,) * len(joints)) for joints in names)
