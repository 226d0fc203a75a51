"""Straight-line code carried out as NumPy operations on rows of samples: no compiler needed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache, partial
from typing import Any

import casadi as ca
import numpy as np

from casysid.arrays import Array
from casysid.dynamics.instructions import Operation, count_inputs, interpret


class Replay:
    """A function at many samples at once, with a row of scratch memory for each register. Not to be shared by threads.

    Attributes:
        inputs: To be filled, shape (scalars, samples): all inputs one after the other.
        outputs: Filled by :meth:`run`, shape (nonzeros, samples).
        samples: How many it was made for.
    """

    def __init__(self, function: Any, samples: int) -> None:
        """Bind the operations of an SX function with one output to memory for so many samples."""
        self.samples = samples
        self.inputs = np.zeros((count_inputs(function), samples))
        self.outputs = np.zeros((function.nnz_out(0), samples))
        self._scratch = np.zeros((function.sz_w(), samples))
        self._program: list[Callable[[], object]] = []
        interpret(function, self)

    def run(self) -> None:
        """Evaluate the function at all samples."""
        with np.errstate(all="ignore"):
            for call in self._program:
                call()

    def constant(self, number: float) -> Array:
        """The number, without axes."""
        return np.array(number)

    def load(self, row: int) -> Array:
        """A row of the inputs."""
        values: Array = self.inputs[row]
        return values

    def apply(self, operation: Operation, operands: Sequence[Array], register: int) -> Array:
        """Remember the call; its result will be in the register's row."""
        out: Array = self._scratch[register]
        if operation.from_library:
            self._program.append(_Call(operation.array, operands, out))
        else:
            self._program.append(partial(operation.array, *operands, out=out))
        return out

    def store(self, row: int, value: Array) -> None:
        """Remember the copy into a row of the outputs."""
        self._program.append(partial(np.positive, value, out=self.outputs[row]))


class _Call:
    """A function of the C library on rows, through CasADi, which calls it for every sample."""

    def __init__(self, expression: Callable[..., Any], operands: Sequence[Array], out: Array) -> None:
        function = _on_rows(expression, len(operands), out.size)
        self._rows = [np.full(out.size, row) if row.ndim == 0 else row for row in operands]
        self._buffer, self._evaluate = function.buffer()
        for k, row in enumerate(self._rows):
            self._buffer.set_arg(k, row.data)
        self._buffer.set_res(0, out.data)

    def __call__(self) -> None:
        self._evaluate()


@lru_cache(maxsize=64)
def _on_rows(expression: Callable[..., Any], operands: int, samples: int) -> Any:
    """``casadi.Function`` of so many rows of samples, one element after the other."""
    rows = [ca.SX.sym(f"x{k}", samples) for k in range(operands)]
    return ca.Function("rows", rows, [expression(*rows)])
