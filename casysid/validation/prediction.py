"""How well given parameters predict the torque of recordings: a model file judged, nothing fitted."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from casysid.arrays import Array
from casysid.dynamics import DEFAULT_FRICTION, Coupling, FrictionModel, Regressor, build_regressor, with_width
from casysid.errors import ParameterError
from casysid.identification import BandChoice, TorqueError, choose_band, torque_error
from casysid.identification.passes import Passes
from casysid.recording import Source
from casysid.recording.even_stamps import evened
from casysid.robot import Robot
from casysid.signals.admission import check_recordings
from casysid.threads import single_threaded
from casysid.validation.earlier import Drives, EarlierResult


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
    cutoff: BandChoice
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


@single_threaded()
def validate(
    robot: Robot,
    recordings: Sequence[Source],
    *,
    earlier: EarlierResult | None = None,
    cutoff: float | None = None,
    progress: Callable[[str, float], None] = lambda stage, share: None,
) -> Validation:
    """Predict the torque of recordings by a model's own parameters.

    Args:
        robot: Its links' parameters are judged, and its friction unless ``earlier`` says otherwise.
        recordings: At least one.
        earlier: Friction, offset, armature and how recordings are read, for which the file has no place.
        cutoff: Low-pass [Hz] of motion and torque; None takes the earlier result's, else derives it from the motion.
        progress: Told the stage and the share done.

    Raises:
        ParameterError: No recording, or a drive that the robot does not have.
    """
    if not recordings:
        raise ParameterError("validate: at least one recording is needed; got none")
    earlier = earlier or EarlierResult()
    model = earlier.friction or FrictionModel(DEFAULT_FRICTION, _couplings(robot, earlier.drives))
    check_recordings(recordings, cutoff=cutoff or earlier.cutoff, time_scale=earlier.time_scale)
    recordings = evened(recordings)
    late = np.array([earlier.delays.get(dof, 0.0) for dof in robot.dofs])
    recordings = [recording.flipped(earlier.flip).with_time_scaled(earlier.time_scale) for recording in recordings]
    choice = choose_band(recordings, cutoff or earlier.cutoff)
    progress("predict", 0.0)
    passes = Passes(robot, recordings, choice, delays=late)
    motions, friction = passes.motions, model.columns
    if earlier.friction is None:
        friction = with_width(friction, tuple(passes.width.tolist()))
    regressor = build_regressor(
        robot,
        friction=friction,
        couplings=model.couplings,
        quasi_static=earlier.quasi_static,
        torque_gains=tuple(earlier.torque_gains.get(dof, 1.0) for dof in robot.dofs),
    )
    parameters = parameters_with_drives(regressor, earlier.drives)
    errors = [torque_error(regressor, parameters, [motion], choice.errors) for motion in motions]
    progress("predict", 1.0)
    return Validation(
        robot=robot,
        cutoff=choice,
        parameters=parameters,
        regressor=regressor,
        total=torque_error(regressor, parameters, motions, choice.errors),
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


def _couplings(robot: Robot, drives: Drives) -> tuple[Coupling, ...]:
    """The couplings among the drives' owners, as ``casysid identify --coupling`` makes them: every weight one."""
    names = [owner.split("+") for owner in drives if owner not in robot.dofs and "+" in owner]
    return tuple(Coupling(joints=tuple(joints), weights=(1.0,) * len(joints)) for joints in names)
