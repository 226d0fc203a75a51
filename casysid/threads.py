"""One thread for each linear algebra library while casysid computes.

The matrices are small: threads of BLAS would only spin and wait for each other, several times the processor's time for
nothing. Numbers would depend on how many there are, too. Every public function that computes is a door: decorated with
:func:`single_threaded`. Threads of casysid's own share the work over many samples.
"""

from __future__ import annotations

import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any

import threadpoolctl  # type: ignore[import-untyped]


class _Limit:
    """Libraries held to one thread for as long as anybody is inside, and how many each had before."""

    def __init__(self) -> None:
        self._inside = 0
        self._before: dict[str, tuple[Any, int]] = {}

    def enter(self, libraries: Iterable[Any]) -> None:
        """Hold them, and go on holding those held already."""
        self._inside += 1
        for library in libraries:
            if library.filepath not in self._before:
                self._before[library.filepath] = library, library.num_threads
                _set_threads(library, 1)

    def leave(self) -> None:
        """Give back what there was, if this was the last one inside."""
        self._inside -= 1
        while not self._inside and self._before:
            _set_threads(*self._before.popitem()[1])


class _OwnLimit(threading.local):
    """Of libraries that count threads by calling thread."""

    def __init__(self) -> None:
        self.limit = _Limit()


_lock = threading.Lock()
_shared = _Limit()  # of libraries whose threads serve the whole process
_own = _OwnLimit()


@contextmanager
def single_threaded() -> Iterator[None]:
    """Context, or with parentheses decorator, inside which BLAS and OpenMP have one thread.

    What they had before comes back when the last thread of the process has left, also after an exception. Contexts may
    lie inside each other, which costs microseconds. Libraries that a module brings along while the context lasts are
    held from the next context on that begins.
    """
    libraries = _libraries()
    own = _own.limit
    with _lock:
        _shared.enter(library for library in libraries if not _is_counted_by_thread(library))
    try:
        own.enter(library for library in libraries if _is_counted_by_thread(library))
        try:
            yield
        finally:
            own.leave()
    finally:
        with _lock:
            _shared.leave()


def look_again() -> None:
    """Say that libraries may have been loaded without importing a module: the next context finds them."""
    threadpoolctl.reset_cached_controller()


def _libraries() -> list[Any]:
    """The BLAS and OpenMP libraries of this process; looked for again when modules were imported."""
    _make_known()
    return list(threadpoolctl.get_cached_controller().lib_controllers)


@cache
def _make_known() -> None:
    """Tell threadpoolctl of the OpenBLAS in CasADi's wheel, which IPOPT uses and whose name it does not know."""

    class CasadiOpenBlas(threadpoolctl.OpenBLASController):  # type: ignore[misc]
        internal_api = "openblas_casadi"
        filename_prefixes = ("libcasadi-tp-openblas",)

    threadpoolctl.register(CasadiOpenBlas)
    look_again()


def _is_counted_by_thread(library: Any) -> bool:
    return "openmp" in (library.user_api, getattr(library, "threading_layer", None))


def _set_threads(library: Any, threads: int) -> None:
    """Set the number, whichever Python thread set it before.

    threadpoolctl lets one Python thread at a time set OpenBLAS's number, silently, and no other until it is told that
    this one is done.
    """
    done = getattr(library, "clear_controlling_thread", None)
    if done is None:
        library.set_num_threads(threads)
        return
    done(force=True)
    library.set_num_threads(threads)
    done(force=True)
