"""A fleet: one model for each machine out of one pass, with choices that all share, so that models can be compared."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from functools import partial

import numpy as np

from casysid.arrays import Array, frozen
from casysid.dynamics import Regressor
from casysid.errors import SolverError
from casysid.identification.choosing import Progress
from casysid.identification.many.differences import Difference, Drift, difference, drift
from casysid.identification.many.logs import BY_RECORDING, Logs
from casysid.identification.many.pipeline import prepare_many
from casysid.identification.many.quantities import Quantities, quantities_of
from casysid.identification.many.workers import Workers, open_workers
from casysid.identification.order import as_given
from casysid.identification.passes import added
from casysid.identification.pipeline import fit, silent, solve
from casysid.identification.result import IdentificationResult
from casysid.identification.settings import Settings
from casysid.moments import Moments
from casysid.recording import Declared
from casysid.recording.declared import NOTHING
from casysid.robot import Robot
from casysid.threads import single_threaded

FEWEST_IN_TIME = 3
"""Recordings of a machine, of which a slope has a standard error."""


@dataclass(frozen=True, eq=False)
class Answer:
    """What a group of recordings says.

    Attributes:
        status: Why the estimator stopped, or what it failed of.
        relative_error: Torque error of the fit over the torque, as the equations are summed.
        values: Of the fleet's quantities, shape (k,); nan where there is no answer.
        std: Standard errors, infinite where the data do not tell a quantity by itself, shape (k,).
        low: Lower ends of 95 % intervals, shape (k,).
        high: Upper ends, shape (k,).
        parameters: Of the regressor, shape (p,).
    """

    status: str
    relative_error: float
    values: Array
    std: Array
    low: Array
    high: Array
    parameters: Array


@dataclass(frozen=True, eq=False)
class Machine:
    """One machine of a fleet.

    Attributes:
        name: Value of the column, or name of the recording.
        recordings: Places of its recordings among all.
        answer: Its model.
        drifts: Of every quantity with the order of its recordings; None where nothing can be said.
    """

    name: str
    recordings: tuple[int, ...]
    answer: Answer
    drifts: tuple[Drift | None, ...]


@dataclass(frozen=True, eq=False)
class Fleet:
    """Machines, and how they differ.

    Attributes:
        by: What told them apart.
        quantities: Names of what is compared.
        units: Of each.
        pooled: All recordings as if of one machine.
        machines: In the order of their first recordings.
        differences: Of every quantity; None where fewer than two machines tell it.
        drifts: Of every quantity over the machines in their order, where each is one recording; None otherwise.
        files: The recordings in their order.
    """

    by: str
    quantities: tuple[str, ...]
    units: tuple[str, ...]
    pooled: IdentificationResult
    machines: tuple[Machine, ...]
    differences: tuple[Difference | None, ...]
    drifts: tuple[Drift | None, ...]
    files: tuple[str, ...]


@single_threaded()
def identify_fleet(
    robot: Robot,
    logs: Logs,
    by: str,
    settings: Settings | None = None,
    *,
    held_out: Logs = (),
    split: float | None = None,
    declared: Declared = NOTHING,
    scheduler: str | Workers | None = None,
    progress: Progress = silent,
) -> Fleet:
    """One model for each machine, in one pass over the recordings, with the model file as the prior of each.

    Args:
        robot: As all machines are described.
        logs: Files, folders and patterns; their order is taken for that of time.
        by: Column whose constant value names the machine of a log, or ``recording`` for one model each.
        settings: As for :func:`~casysid.identification.many.identify_many`; what the data decide is decided by all.
        held_out: Predicted by the model of all together.
        split: Likewise.
        declared: Likewise.
        scheduler: Likewise.
        progress: Likewise.

    Raises:
        MissingExtraError: A scheduler is given and Dask is not installed.
        RecordingError: There is no log, or one cannot be used, or does not tell its machine.
        SolverError: No consistent parameters of all together could be found.
    """
    settings = settings or Settings()
    with nullcontext(scheduler) if isinstance(scheduler, Workers) else open_workers(scheduler) as workers:
        many = prepare_many(
            robot, logs, settings, workers, held_out=held_out, split=split, declared=declared, by=by, progress=progress
        )
        preparation = many.preparation
        regressor, parts = (
            preparation.regressor,
            as_given(_parts(preparation.moments, preparation.passes.blocks), preparation.places),
        )
        compared = quantities_of(regressor, preparation.structural)
        pooled = solve(preparation, settings, progress=progress)
        progress("machines", 0.0)
        names = [one.machine for one in many.opened]
        if by == BY_RECORDING:
            names = [str(one.fitted.sources[0]) for one in many.opened]
        groups = {name: tuple(k for k, other in enumerate(names) if other == name) for name in dict.fromkeys(names)}
        ask = partial(_answer, regressor, settings, compared)
        answers = list(workers(ask, [added([parts[k] for k in group]).with_rows_only() for group in groups.values()]))
        progress("machines", 0.5)
        in_time = [k for group in groups.values() if len(group) >= FEWEST_IN_TIME for k in group]
        plain = partial(_answer, regressor, dataclasses.replace(settings, consistency=None), compared)
        single = dict(zip(in_time, workers(plain, [parts[k].with_rows_only() for k in in_time]), strict=True))
        progress("machines", 1.0)
    machines = tuple(
        Machine(name, group, answer, _drifts([single[k] for k in group if k in single], len(compared.names)))
        for (name, group), answer in zip(groups.items(), answers, strict=True)
    )
    values, std = np.array([one.values for one in answers]), np.array([one.std for one in answers])
    return Fleet(
        by=by,
        quantities=compared.names,
        units=compared.units,
        pooled=pooled,
        machines=machines,
        differences=tuple(difference(values[:, k], std[:, k]) for k in range(len(compared.names))),
        drifts=_drifts(answers if by == BY_RECORDING else [], len(compared.names)),
        files=tuple(one.fitted.label for one in many.opened),
    )


def _parts(moments: Moments, blocks: Sequence[int]) -> list[Moments]:
    """Of each recording."""
    ends = np.cumsum(blocks)
    return [moments.select_blocks(np.arange(end - count, end)) for count, end in zip(blocks, ends, strict=True)]


def _answer(regressor: Regressor, settings: Settings, compared: Quantities, moments: Moments) -> Answer:
    """The model of some recordings, from their moments alone."""
    weights = compared.weights
    try:
        estimate, projection, sure = fit(regressor, moments, settings)
    except SolverError as error:
        nothing = frozen(np.full(len(weights), np.nan))
        return Answer(str(error), np.nan, nothing, nothing, nothing, nothing, frozen(regressor.prior))
    parameters = estimate.parameters if projection is None else projection.parameters
    missed = np.sqrt(moments.residual_energy(parameters).sum() / moments.target_energy().sum())
    values, variance = weights @ parameters, np.einsum("km,mn,kn->k", weights, sure.covariance, weights)
    std = np.where(sure.spread.sees(weights), np.sqrt(np.maximum(variance, 0.0)), np.inf)
    half = sure.quantile() * std
    low = values - half
    if settings.consistency is not None:
        low = np.where(compared.non_negative, np.maximum(low, 0.0), low)
    return Answer(
        estimate.status.value,
        float(missed),
        frozen(values),
        frozen(std),
        frozen(low),
        frozen(values + half),
        frozen(parameters),
    )


def _drifts(answers: Sequence[Answer], count: int) -> tuple[Drift | None, ...]:
    if len(answers) < FEWEST_IN_TIME:
        return (None,) * count
    return tuple(
        drift(np.array([one.values[k] for one in answers]), np.array([one.std[k] for one in answers]))
        for k in range(count)
    )
