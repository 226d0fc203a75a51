"""Processes and machines that do one thing to each of many recordings: Dask, measured in bytes.

What the work has to know (robot, regressor, choices) goes to every worker once; what it is done to goes as a path and
some figures, and what comes back is a sum. Everything crosses as compressed bytes, so what is counted is what is moved.

Source: https://distributed.dask.org, ``Client.scatter`` and ``Client.submit``.
"""

from __future__ import annotations

import logging
import os
import pickle
import warnings
import zlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

from casysid.errors import CasysidError, CasysidWarning, MissingExtraError, ParameterError
from casysid.threads import single_threaded

LOCAL, HERE = "local", "synchronous"
"""Words for schedulers that are no address: processes on this machine, and this process."""
INSTALL = "pip install 'casysid[cluster]'"
PATIENCE = 10.0
"""For a scheduler's answer [s]: it takes milliseconds on a network that works."""


@dataclass
class Traffic:
    """What has crossed between this process and the workers.

    Attributes:
        tasks: Pieces of work.
        sent: Bytes of what the work was done to, and of what it had to know, once for every worker.
        received: Bytes of results.
    """

    tasks: int = 0
    sent: int = 0
    received: int = 0


@dataclass
class Workers:
    """Does one thing to each of several, in their order: to be called as ``map`` is.

    Attributes:
        client: Of a running scheduler; None works in this process.
        count: Workers.
        traffic: So far.
    """

    client: Any
    count: int
    traffic: Traffic = field(default_factory=Traffic)

    def __call__(self, work: Callable[[Any], Any], items: Sequence[Any]) -> list[Any]:
        """What comes of ``work`` for each item.

        Raises:
            CasysidError: As the work raises it.
            ParameterError: Workers were lost.
        """
        known, parcels = _packed(work), [_packed(item) for item in items]
        if self.client is None:
            results = [_done(known, parcel) for parcel in parcels]
        else:
            results = self._far(known, parcels)
        self.traffic.tasks += len(parcels)
        self.traffic.sent += self.count * len(known) + sum(map(len, parcels))
        self.traffic.received += sum(map(len, results))
        return [_value(_unpack(result)) for result in results]

    def _far(self, known: bytes, parcels: list[bytes]) -> list[bytes]:
        from concurrent.futures import CancelledError

        from distributed import KilledWorker
        from distributed.comm import CommClosedError

        try:
            spread = self.client.scatter(known, broadcast=True)
            return list(self.client.gather([self.client.submit(_done, spread, one, pure=False) for one in parcels]))
        except (KilledWorker, CancelledError, CommClosedError, TimeoutError) as error:
            raise ParameterError(
                f"workers were lost ({type(error).__name__}): killed, most often for want of memory, or no longer "
                "reached. A cluster's own logs say why; take fewer workers on a machine, or give each more memory"
            ) from error


@contextmanager
def _environment_kept() -> Iterator[None]:
    """What Dask sets in this process's environment for its workers, such as their number of threads, is taken back."""
    before = dict(os.environ)
    try:
        yield
    finally:
        os.environ.clear()
        os.environ.update(before)


@contextmanager
def open_workers(scheduler: str | None = None, workers: int | None = None) -> Iterator[Workers]:
    """Workers for as long as the context lasts.

    Args:
        scheduler: Address of a running Dask scheduler, such as ``tcp://10.0.0.1:8786``; ``local`` or None for
            processes on this machine, ``synchronous`` for this process.
        workers: Local processes; None for as many as there are processors for this process. One is this process.

    Warns:
        CasysidWarning: Dask is not installed, and nothing was asked for: this process does the work.

    Raises:
        MissingExtraError: Dask is not installed.
        ParameterError: No scheduler answers, it has no workers, or they do not have this casysid.
    """
    count = _processors() if workers is None else workers
    if scheduler == HERE or (scheduler in (None, LOCAL) and count == 1):
        yield Workers(None, 1)
        return
    try:
        from distributed import Client, LocalCluster
    except ImportError as error:
        if scheduler is not None:
            raise MissingExtraError(f"--scheduler needs Dask, which is not installed; run: {INSTALL}") from error
        said = f"Dask is not installed: one process works through the recordings. For all processors: {INSTALL}"
        warnings.warn(said, CasysidWarning, stacklevel=3)
        yield Workers(None, 1)
        return
    if scheduler in (None, LOCAL):
        with (
            _environment_kept(),
            LocalCluster(
                n_workers=count, threads_per_worker=1, dashboard_address=":0", silence_logs=logging.CRITICAL
            ) as cluster,
            Client(cluster) as client,
        ):
            yield Workers(client, count)
        return
    try:
        client = Client(scheduler, timeout=PATIENCE)
    except (OSError, ValueError, TypeError) as error:
        raise ParameterError(
            f"--scheduler wants local or the address of a running Dask scheduler, such as tcp://10.0.0.1:8786; "
            f"got {scheduler!r}, where none answers. Start one with: dask scheduler"
        ) from error
    with client:
        yield Workers(client, _alike(client, scheduler))


def _alike(client: Any, scheduler: str | None) -> int:
    """How many workers there are, all with this casysid."""
    try:
        versions = client.run(_version)
    except (ImportError, AttributeError) as error:
        raise ParameterError(
            f"the workers of {scheduler} have no casysid ({error}); install casysid {_version()} on every worker"
        ) from error
    if not versions:
        raise ParameterError(
            f"the scheduler at {scheduler} has no workers; start one on each machine: dask worker {scheduler}"
        )
    others = sorted({f"{version} at {worker}" for worker, version in versions.items() if version != _version()})
    if others:
        raise ParameterError(f"wanted casysid {_version()} on every worker; got {', '.join(others)[:300]}")
    return len(versions)


def _version() -> str:
    from casysid import __version__

    return __version__


def _done(known: bytes, parcel: bytes) -> bytes:
    """On a worker: do what is known to what is in the parcel."""
    try:
        with single_threaded():
            return _packed(_work(known)(_unpack(parcel)))
    except CasysidError as error:  # as a value: Dask would print a traceback of it
        return _packed(_Refused(error))


@lru_cache(maxsize=1)
def _work(known: bytes) -> Callable[[Any], Any]:
    """What the work has to know, unpacked once for all its parcels."""
    return _unpack(known)  # type: ignore[no-any-return]


@dataclass(frozen=True)
class _Refused:
    """Bad input, found by a worker."""

    error: CasysidError


def _value(result: Any) -> Any:
    if isinstance(result, _Refused):
        raise result.error
    return result


def _packed(value: Any) -> bytes:
    return zlib.compress(pickle.dumps(value), level=1)


def _unpack(parcel: bytes) -> Any:
    return pickle.loads(zlib.decompress(parcel))


def _processors() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
