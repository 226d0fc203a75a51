"""From many logs, wherever they can be read, to one answer: one map over recordings and one reduction.

What has to be chosen (band, clock, delay, friction, gains) is chosen here from excerpts, as for any long recording.
Then each worker opens a recording itself, smooths it and sums its equations; only the sums come back. Errors are summed
likewise. Blocks follow each other in the order of the recordings, so the answer is that of one machine.
"""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import dataclass

from casysid.identification.choosing import Progress
from casysid.identification.many.logs import Logs, Opened, find_logs, open_logs
from casysid.identification.many.workers import Workers, open_workers
from casysid.identification.pipeline import Preparation, prepare, silent, solve
from casysid.identification.result import IdentificationResult
from casysid.identification.settings import Settings
from casysid.recording import Declared
from casysid.recording.declared import NOTHING
from casysid.robot import Robot
from casysid.threads import single_threaded


@dataclass(frozen=True, eq=False)
class ManyPrepared:
    """Many logs, read.

    Attributes:
        opened: What is known of each, in their order.
        preparation: What came of all of them together.
    """

    opened: tuple[Opened, ...]
    preparation: Preparation


@single_threaded()
def identify_many(
    robot: Robot,
    logs: Logs,
    settings: Settings | None = None,
    *,
    held_out: Logs = (),
    split: float | None = None,
    declared: Declared = NOTHING,
    scheduler: str | Workers | None = None,
    progress: Progress = silent,
) -> IdentificationResult:
    """Identify a robot's parameters from many recordings on many processes or machines.

    Logs are opened by the workers: their paths must lead to the same files there. Together no longer than what is kept
    in memory anyway (131 072 samples), they are brought here and fitted here.

    Args:
        robot: The robot; its own parameters are the prior.
        logs: Files, folders and patterns.
        settings: Hyperparameters; the defaults let the data decide.
        held_out: Logs that are only predicted.
        split: Share of each recording's time that is fitted, the rest only predicted; None fits all.
        declared: What is known of the logs: units, columns, drives.
        scheduler: Address of a Dask scheduler; None for processes on this machine; or workers that are open already.
        progress: Called with the stage and the share done.

    Raises:
        MissingExtraError: A scheduler is given and Dask is not installed.
        RecordingError: There is no log, or one cannot be used.
        SolverError: No consistent parameters could be found.
    """
    settings = settings or Settings()
    with nullcontext(scheduler) if isinstance(scheduler, Workers) else open_workers(scheduler) as workers:
        many = prepare_many(
            robot, logs, settings, workers, held_out=held_out, split=split, declared=declared, progress=progress
        )
        return solve(many.preparation, settings, progress=progress)


@single_threaded()
def prepare_many(
    robot: Robot,
    logs: Logs,
    settings: Settings,
    workers: Workers,
    *,
    held_out: Logs = (),
    split: float | None = None,
    declared: Declared = NOTHING,
    by: str | None = None,
    progress: Progress = silent,
) -> ManyPrepared:
    """Open the logs, choose what the data decide, and take the moments.

    Args:
        robot: As for :func:`identify_many`.
        logs: Likewise.
        settings: Likewise.
        workers: Do the work.
        held_out: Likewise.
        split: Likewise.
        declared: Likewise.
        by: What names the machine of a log, as for :func:`~casysid.identification.many.logs.open_logs`.
        progress: Likewise.
    """
    progress("open", 0.0)
    files = find_logs(logs)
    opened = open_logs(robot, files, workers, by=by, split=split, declared=declared)
    rest = [one.held_out for one in opened if one.held_out is not None]
    unseen = (
        [one.fitted for one in open_logs(robot, find_logs(held_out), workers, declared=declared)] if held_out else []
    )
    progress("open", 1.0)
    preparation = prepare(
        robot, [one.fitted for one in opened], settings, held_out=[*rest, *unseen], progress=progress, mapped=workers
    )
    return ManyPrepared(opened, preparation)
