"""Processes and machines that do one thing to each of many recordings: Dask, measured in bytes.

What the work has to know (robot, regressor, choices) goes to every worker once; what it is done to goes as a path and
some figures, and what comes back is a sum. Everything crosses as compressed bytes, so what is counted is what is moved.

Source: https://distributed.dask.org, ``Client.scatter`` and ``Client.submit``.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import zlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from casysid.errors import CasysidError, MissingExtraError, ParameterError
from casysid.threads import single_threaded

LOCAL, HERE = "local", "synchronous"
"""Words for schedulers that are no address: processes on this machine, and this process."""
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
            ParameterError: The workers do not have the same packages.
        """
        known, parcels = _packed(work), [_packed(item) for item in items]
        results = self._near(known, parcels) if self.client is None else self._far(known, parcels)
        self.traffic.tasks += len(parcels)
        self.traffic.sent += self.count * len(known) + sum(map(len, parcels))
        self.traffic.received += sum(map(len, results))
        return [_value(_unpack(result)) for result in results]

    def _near(self, known: bytes, parcels: list[bytes]) -> list[bytes]:
        import dask

        tasks = [dask.delayed(_done, pure=False)(known, parcel) for parcel in parcels]
        return list(dask.compute(*tasks, scheduler="synchronous"))

    def _far(self, known: bytes, parcels: list[bytes]) -> list[bytes]:
        try:
            spread = self.client.scatter(known, broadcast=True)
            return list(self.client.gather([self.client.submit(_done, spread, one, pure=False) for one in parcels]))
        except ModuleNotFoundError as error:
            raise ParameterError(
                f"the scheduler's workers have no package {error.name}; install the same casysid on every worker"
            ) from error


@contextmanager
def open_workers(scheduler: str | None = None, workers: int | None = None) -> Iterator[Workers]:
    """Workers for as long as the context lasts.

    Args:
        scheduler: Address of a running Dask scheduler, such as ``tcp://10.0.0.1:8786``; ``local`` or None for
            processes on this machine, ``synchronous`` for this process.
        workers: Local processes; None for as many as there are processors for this process. One is this process.

    Raises:
        MissingExtraError: Dask is not installed.
        ParameterError: No scheduler answers.
    """
    try:
        import dask  # noqa: F401
        from distributed import Client, LocalCluster
    except ImportError as error:
        raise MissingExtraError(
            "many recordings at once need Dask, which is not installed; run: pip install 'casysid[cluster]'"
        ) from error
    count = _processors() if workers is None else workers
    if scheduler == HERE or (scheduler in (None, LOCAL) and count == 1):
        yield Workers(None, 1)
    elif scheduler in (None, LOCAL):
        with (
            LocalCluster(n_workers=count, threads_per_worker=1, dashboard_address=":0") as cluster,
            Client(cluster) as client,
        ):
            yield Workers(client, count)
    else:
        try:
            client = Client(scheduler, timeout=PATIENCE)
        except (OSError, ValueError, TypeError) as error:
            raise ParameterError(
                f"--scheduler wants local or the address of a running Dask scheduler, such as tcp://10.0.0.1:8786; "
                f"got {scheduler!r}, where none answers. Start one with: dask scheduler"
            ) from error
        with client:
            there = len(client.scheduler_info(n_workers=-1)["workers"])
            if not there:
                raise ParameterError(
                    f"the scheduler at {scheduler} has no workers; start one on each machine: dask worker {scheduler}"
                )
            yield Workers(client, there)


_unpacked: dict[bytes, Callable[[Any], Any]] = {}


def _done(known: bytes, parcel: bytes) -> bytes:
    """On a worker: unpack what the work has to know once, and do it."""
    key = hashlib.sha256(known).digest()
    if key not in _unpacked:
        _unpacked.clear()
        _unpacked[key] = _unpack(known)
    try:
        with single_threaded():
            return _packed(_unpacked[key](_unpack(parcel)))
    except CasysidError as error:  # as a value: Dask would print a traceback of it
        return _packed(_Refused(error))


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
