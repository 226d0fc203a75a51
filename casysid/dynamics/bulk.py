"""A CasADi function at very many samples: in chunks, on several threads, without a Python call for each sample.

Two routes give the same numbers, bit for bit, in pieces of the same length, so that no result depends on whether a
kernel was at hand. Replaying the function's operations in NumPy works everywhere. C compiled for this machine is
several times faster; it is used when it was compiled before, or when so many samples come that compiling pays.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any, Literal, Protocol, TypeVar

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array
from casysid.dynamics import compiled, replay
from casysid.errors import ParameterError
from casysid.threads import single_threaded

FIND_FROM = 10_000  # samples: evaluating fewer takes no longer than looking for a compiled kernel
COMPILE_FROM = 100_000  # samples: replaying more takes longer than compiling
SAMPLES = 1024  # at once: fewer make calls and sums slow, more leave the processor's cache
MOST_NUMBERS = 2**23  # in the memory of one thread: shorter chunks for very large robots

_COMPARED = 64  # samples that a kernel must give as the replay does

KEPT = 4  # engines of one function that wait for more samples

Result = TypeVar("Result")
Indices = npt.NDArray[np.intp]


class Engine(Protocol):
    """What evaluates a function at as many samples as its memory has columns."""

    inputs: Array  # (scalars, samples)
    outputs: Array  # (nonzeros, samples)
    samples: int  # asked for

    def run(self) -> None:
        """Fill the outputs."""


class Bulk:
    """An SX function with one output, to be evaluated at many samples. Threads may share it.

    Attributes:
        function: The ``casadi.Function``.
        constants: Its last inputs, where they are the same at all samples and settled.
    """

    def __init__(self, function: Any, constants: Sequence[Array] = (), engines: Engines | None = None) -> None:
        """Nothing is compiled yet, unless the engines of the same function with other constants are given."""
        self.function = function
        self.constants = tuple(constants)
        self._engines = engines or Engines(function)

    def __reduce__(self) -> tuple[Any, ...]:
        return Bulk, (self.function, self.constants)

    def given(self, *constants: Array) -> Bulk:
        """The same function with its last inputs settled; its code is shared."""
        return Bulk(self.function, constants, self._engines)

    @property
    def route(self) -> Literal["replay", "compiled"]:
        """How the last samples were evaluated."""
        return "replay" if self._engines.kernel is None else "compiled"

    def evaluate(self, *inputs: npt.ArrayLike, threads: int = 2) -> Array:
        """Structural nonzeros of the output at every sample, shape (N, nonzeros), in CasADi's column-major order.

        Args:
            inputs: One for each input that is not settled: (N, n), or (n,) when it is the same at all samples.
            threads: How many to use.

        Raises:
            ParameterError: When a shape does not fit.
        """
        arrays, samples = self.check(inputs)
        out = np.empty((samples, self.function.nnz_out(0)))

        def keep(values: Array, piece: Indices) -> None:
            out[piece] = values.T

        deque(self.map(keep, arrays, [np.arange(samples)], threads), maxlen=0)
        return out

    def map(
        self,
        consume: Callable[[Array, Indices], Result],
        inputs: Sequence[Array],
        groups: Sequence[Indices],
        threads: int,
    ) -> Iterator[tuple[int, Result]]:
        """Evaluate groups of samples piece by piece, and yield what is made of each piece, in order.

        Args:
            consume: Called on the worker threads with the values of one piece, shape (nonzeros, samples), valid only
                during the call, and the indices of its samples.
            inputs: As :meth:`check` returns them.
            groups: Indices of samples; no piece has samples of two groups.
            threads: How many to use. What is yielded does not depend on it.

        Yields:
            Number of the group, and the result of ``consume``.
        """
        inputs = [*inputs, *self.constants]
        self._engines.choose_route(inputs, sum(len(group) for group in groups))
        pieces = _split(groups, self._engines.longest_piece)
        threads = max(min(threads, len(pieces)), 1)

        @single_threaded()
        def work(piece: Indices) -> Result:
            with self._engines.lent(len(piece)) as engine:
                return consume(_run(engine, inputs, piece), piece)

        if len(pieces) == 1:  # no thread is started for it
            yield pieces[0][0], work(pieces[0][1])
            return
        with ThreadPoolExecutor(threads) as pool:
            pending: deque[tuple[int, Future[Result]]] = deque()
            for number, piece in pieces:
                pending.append((number, pool.submit(work, piece)))
                if len(pending) > 2 * threads:
                    yield pending[0][0], pending.popleft()[1].result()
            while pending:
                yield pending[0][0], pending.popleft()[1].result()

    def check(self, inputs: Sequence[npt.ArrayLike]) -> tuple[list[Array], int]:
        """The inputs as arrays of shape (N, n) or (n,), and N, which is 1 when all are constant.

        Raises:
            ParameterError: When a shape does not fit.
        """
        function = self.function
        arrays = [np.asarray(values, dtype=np.float64) for values in inputs]
        sizes = [function.nnz_in(i) for i in range(function.n_in() - len(self.constants))]
        lengths = {len(array) for array in arrays if array.ndim == 2}
        if (
            len(lengths) > 1
            or len(arrays) != len(sizes)
            or any(x.ndim not in (1, 2) or x.shape[-1] != n for x, n in zip(arrays, sizes, strict=True))
        ):
            wanted = ", ".join(f"{function.name_in(i)} (N, {n})" for i, n in enumerate(sizes))
            raise ParameterError(f"{function.name()}: wants {wanted}; got {', '.join(str(x.shape) for x in arrays)}")
        return arrays, lengths.pop() if lengths else 1


class Engines:
    """The engines of one function, made when they are wanted and kept for the next samples; threads may share them.

    Attributes:
        function: The ``casadi.Function``.
        kernel: What was compiled of it; None when it is replayed.
    """

    def __init__(self, function: Any) -> None:
        """Nothing is compiled yet."""
        self.function = function
        self.kernel: compiled.Kernel | None = None
        self._seen = 0
        self._untried = [(FIND_FROM, compiled.find_kernel), (COMPILE_FROM, compiled.compile_kernel)]
        self._idle: deque[Engine] = deque(maxlen=KEPT)
        self._lock = threading.Lock()

    @property
    def longest_piece(self) -> int:
        """How many samples are evaluated at once."""
        rows = int(self.function.nnz_out(0) + self.function.sz_w())
        return min(SAMPLES, max(MOST_NUMBERS // rows, 64))

    @contextmanager
    def lent(self, samples: int) -> Iterator[Engine]:
        """An engine for so many samples, for this thread alone as long as the context lasts."""
        room, kernel = _rounded(samples), self.kernel
        with self._lock:
            fitting = [engine for engine in self._idle if engine.samples == room]
            if fitting:
                self._idle.remove(fitting[-1])
        engine = fitting[-1] if fitting else self._make(kernel, room)
        yield engine
        with self._lock:
            if kernel is self.kernel:
                self._idle.append(engine)

    def choose_route(self, inputs: Sequence[Array], samples: int) -> None:
        """Look for a kernel, or compile one, once so many samples have come that it pays."""
        with self._lock:
            self._seen += samples
            if self.function.n_instructions() > compiled.LONGEST:
                return
            while self.kernel is None and self._untried and self._seen >= self._untried[0][0]:
                kernel = self._untried.pop(0)[1](self.function)
                if kernel is not None and self._agrees(kernel, inputs):
                    self.kernel = kernel
                    self._idle.clear()

    def _agrees(self, kernel: compiled.Kernel, inputs: Sequence[Array]) -> bool:
        """Whether a kernel gives the replay's bits at the first samples: no compiler's fault may pass for data."""
        first = np.arange(min((len(x) for x in inputs if x.ndim == 2), default=1))[:_COMPARED]
        got, wanted = (_run(self._make(k, len(first)), inputs, first) for k in (kernel, None))
        return np.array_equal(got, wanted, equal_nan=True)

    def _make(self, kernel: compiled.Kernel | None, samples: int) -> Engine:
        if kernel is None:
            return replay.Replay(self.function, samples)
        return compiled.Compiled(self.function, kernel, samples)


def _rounded(samples: int) -> int:
    """The next of few numbers, no more than an eighth above beyond sixty-four, so that engines fit again."""
    step = max(1 << max(samples.bit_length() - 4, 0), 8)
    return -(-samples // step) * step


def _split(groups: Sequence[Indices], longest: int) -> list[tuple[int, Indices]]:
    """Pieces of near-equal length, none longer than ``longest``, with the number of their group."""
    return [
        (number, piece)
        for number, group in enumerate(groups)
        if len(group)
        for piece in np.array_split(group, -(-len(group) // longest))
    ]


def _run(engine: Engine, inputs: Sequence[Array], piece: Indices) -> Array:
    """The values at a piece of the samples, shape (nonzeros, samples of the piece), in the engine's memory."""
    row = 0
    for values in inputs:
        part = values[:, None] if values.ndim == 1 else values[piece].T
        engine.inputs[row : row + len(part), : len(piece)] = part
        row += len(part)
    engine.run()
    return engine.outputs[:, : len(piece)]
