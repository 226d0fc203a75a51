"""Payloads from recordings: least squares over all loadings at once, then the nearest body that can be.

A robot that holds something has the same links, but for the one that holds it, whose parameters are the sum of its own
and the payload's (both at the link's frame, where they add). Recordings without the payload and with it are therefore
rows of one linear problem (:mod:`casysid.payload.columns`), whose covariance from blocks of time says how sure the
payload is, the robot's own uncertainty included.

Source: Atkeson, An, Hollerbach (1986), load identification by differences; here in one step with the robot's own
parameters, without the need to repeat the same motion.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array
from casysid.dynamics import Offset, Regressor, Spring
from casysid.errors import ParameterError, RecordingError
from casysid.estimation.covariance import RANK_TOLERANCE
from casysid.estimation.evidence import VARIANCE_FLOOR
from casysid.identification import Settings, prepare
from casysid.identification.passes import Passes
from casysid.identification.pipeline import Preparation
from casysid.inertia import KINDS
from casysid.moments import Moments
from casysid.payload.body import payload_of
from casysid.payload.columns import Loading, joint_moments
from casysid.payload.frames import holding_frame
from casysid.payload.results import PayloadResult
from casysid.recording import Source
from casysid.robot import JointKind, Robot
from casysid.signals.admission import check_recordings
from casysid.threads import single_threaded

Progress = Callable[[str, float], None]
Recordings = Source | Sequence[Source]
ROUNDS = 3
"""Of least squares with the joints' noise of the round before: weights change by less than a hundredth then."""


def silent(stage: str, share: float) -> None:
    """No progress."""


@single_threaded()
def identify_payload(
    robot: Robot,
    with_payload: Recordings | Mapping[str, Recordings],
    without: Recordings = (),
    *,
    link: str | None = None,
    known_mass: float | Mapping[str, float] | None = None,
    settings: Settings | None = None,
    progress: Progress = silent,
) -> PayloadResult:
    """Mass, centre of mass and inertia of what a robot holds.

    Args:
        robot: The robot without it.
        with_payload: Recordings with it; of several payloads by name.
        without: Recordings of the robot without any. Without these, all links are taken from the robot's file, and
            the payload is whatever its recordings show beyond that.
        link: That holds it, or a frame fixed to it, such as a flange; None for the last link.
        known_mass: If it was weighed [kg], by name for several: the torques' scale follows, and centre of mass and
            inertia are free of it.
        settings: As for :func:`casysid.identify`.
        progress: Called with the stage and the share done.

    Raises:
        RecordingError: There are no recordings with a payload, or one cannot be used.
        ParameterError: The link is not there, or it is not clear which one is the last; a mass is not positive.
        SolverError: No body could be found.
    """
    frame = holding_frame(robot, link)
    groups = _by_name(with_payload)
    masses = _masses(known_mass, groups)
    settings = _with_springs(robot, settings or Settings())
    empty = (without,) if isinstance(without, Source) else tuple(without)
    every = [one for group in groups.values() for one in group]
    prepared = prepare(robot, empty or every, settings, progress=progress)
    progress("payload", 0.0)
    loadings = [Loading("", prepared.moments)] if empty else []
    loadings += [Loading(name, _moments(prepared, group, settings)) for name, group in groups.items()]
    regressor = prepared.regressor
    links = robot.inertial_parameters.size
    moments = joint_moments(loadings, frame.columns, _own_columns(regressor), frame.to_link)
    theta = np.zeros(len(moments.columns))
    if not empty:
        theta[:links] = robot.inertial_parameters
        kept = np.arange(links, len(moments.columns))
        moments = moments.shifted(theta).select_columns(kept)
    weights, solution = _weighted_least_squares(moments)
    payloads = []
    for name in groups:
        places = np.array([moments.columns.index(f"{name}.{kind}") for kind in KINDS])
        counts = np.cumsum([0, *(loading.moments.blocks for loading in loadings)])
        own = next(k for k, loading in enumerate(loadings) if loading.payload == name)
        payloads.append(
            payload_of(
                moments,
                weights,
                solution,
                places,
                blocks=slice(int(counts[own]), int(counts[own + 1])),
                name=name,
                link=frame.name,
                known_mass=masses.get(name),
            )
        )
    progress("payload", 1.0)
    reference = f"{len(empty)} recordings without payload" if empty else f"the file {robot.source.name}"
    return PayloadResult(robot.name, frame.name, tuple(payloads), reference)


def _with_springs(robot: Robot, settings: Settings) -> Settings:
    """Springs at every joint that has a position: hoses and cables pull with and without a payload alike.

    Without a column for them their pull would be taken for a change of weight wherever two motions dwell elsewhere.
    """
    if any(kind.kind == Spring.kind for kind in settings.friction):
        return settings
    joints = tuple(joint.name for joint in robot.joints if joint.kind in (JointKind.REVOLUTE, JointKind.PRISMATIC))
    return dataclasses.replace(settings, friction=(*settings.friction, Spring(joints)))


def _by_name(given: Recordings | Mapping[str, Recordings]) -> dict[str, tuple[Source, ...]]:
    named = dict(given) if isinstance(given, Mapping) else {"payload": given}
    groups = {name: (one,) if isinstance(one, Source) else tuple(one) for name, one in named.items()}
    empty = [name for name, group in groups.items() if not group] or ([""] if not groups else [])
    if empty:
        raise RecordingError(f"payload: at least one recording with the payload {empty[0]!r} is needed; got none")
    return groups


def _masses(known: float | Mapping[str, float] | None, groups: Mapping[str, object]) -> dict[str, float]:
    masses = dict(known) if isinstance(known, Mapping) else {} if known is None else dict.fromkeys(groups, known)
    for name, mass in masses.items():
        if name not in groups:
            raise ParameterError(f"payload: a mass was given of {name!r}, but there are only {', '.join(groups)}")
        if not (np.isfinite(mass) and mass > 0.0):
            raise ParameterError(f"payload: the known mass of {name!r} must be a positive number of kg; got {mass}")
    return {name: float(mass) for name, mass in masses.items()}


def _moments(prepared: Preparation, recordings: Sequence[Source], settings: Settings) -> Moments:
    """Of recordings with a payload, in the columns, band, clock and delay of the robot without."""
    check_recordings(recordings, cutoff=settings.cutoff, time_scale=settings.time_scale, delay=settings.delay)
    choices = prepared.choices
    read = [one.flipped(settings.flip).with_time_scaled(choices.clock.scale) for one in recordings]
    passes = Passes(
        prepared.robot,
        read,
        choices.band,
        delays=choices.delay.seconds,
        blocks=settings.blocks,
        threads=settings.threads,
    ).like(prepared.passes)
    return passes.moments(prepared.regressor)


def _own_columns(regressor: Regressor) -> npt.NDArray[np.bool_]:
    """Columns that every loading has for itself: friction, which changes with load and temperature, and offsets."""
    found = np.zeros(len(regressor.parameters), dtype=bool)
    for part in regressor.parts:
        if part.kind.is_friction or isinstance(part.kind, Offset):
            found[list(part.columns)] = True
    return found


def _weighted_least_squares(moments: Moments) -> tuple[Array, Array]:
    """Row weights by joint and the parameters, which see each other's; what the data do not see stays at zero."""
    weights = np.ones(len(moments.joints))
    rows = np.maximum(moments.count.sum(axis=0), 1.0)
    solution = np.zeros(len(moments.columns))
    for _ in range(ROUNDS):
        normal = moments.pooled(weights)
        size = np.sqrt(np.maximum(np.diag(normal.xx), 0.0))
        unit = np.divide(1.0, size, out=np.zeros_like(size), where=size > 0.0)
        values, vectors = np.linalg.eigh(normal.xx * np.outer(unit, unit))
        seen = values > RANK_TOLERANCE * values.max(initial=0.0)
        W = unit[:, None] * vectors[:, seen]
        solution = W @ ((W.T @ normal.xy) / values[seen])
        variance = moments.residual_energy(solution).sum(axis=0) / rows
        floor = VARIANCE_FLOOR * moments.target_energy().sum(axis=0) / rows
        weights = 1.0 / np.maximum(np.maximum(variance, floor), np.finfo(np.float64).tiny)
        weights[moments.count.sum(axis=0) == 0.0] = 0.0
    return weights, solution
