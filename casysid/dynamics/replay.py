"""Straight-line code carried out as NumPy operations on rows of samples: no compiler needed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from casysid.arrays import Array
from casysid.dynamics.instructions import Operation, count_inputs, interpret

SAMPLES = 4096  # rows so long that the calls cost little, and so short that they stay near the processor


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
        self._program: list[tuple[Any, tuple[Array, ...], Array]] = []
        interpret(function, self)

    def run(self) -> None:
        """Evaluate the function at all samples."""
        with np.errstate(all="ignore"):
            for operation, operands, out in self._program:
                operation(*operands, out=out)

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
        self._program.append((operation.array, tuple(operands), out))
        return out

    def store(self, row: int, value: Array) -> None:
        """Remember the copy into a row of the outputs."""
        self._program.append((np.positive, (value,), self.outputs[row]))
