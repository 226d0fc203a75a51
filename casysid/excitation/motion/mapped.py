"""A CasADi function at a fixed number of samples, again and again, without a copy of its memory in between."""

from __future__ import annotations

from typing import Any

import numpy as np

from casysid.arrays import Array
from casysid.dynamics import compiled
from casysid.errors import SolverError


class Mapped:
    """A function with one output at ``samples`` samples: compiled C if it was compiled before, else CasADi's machine.

    Not to be shared by threads.
    """

    def __init__(self, function: Any, samples: int) -> None:
        """Memory for all samples."""
        self.samples, self.widths = samples, [function.nnz_in(i) for i in range(function.n_in())]
        self._name = function.name()
        kernel = compiled.find_kernel(function) if function.is_a("SXFunction") else None
        self._engine = None if kernel is None else compiled.Compiled(function, kernel, samples)
        if self._engine is not None:
            return
        self._function = function.map(samples)
        self._buffer, self._run = self._function.buffer()
        self._inputs = [np.zeros((samples, width)) for width in self.widths]
        self._output = np.zeros((samples, function.nnz_out(0)))
        for i, values in enumerate(self._inputs):
            self._buffer.set_arg(i, values.reshape(-1).data)
        self._buffer.set_res(0, self._output.reshape(-1).data)

    def __call__(self, *inputs: Array) -> Array:
        """Structural nonzeros at all samples, shape (samples, nonzeros), good until the next call."""
        if self._engine is not None:
            row = 0
            for values, width in zip(inputs, self.widths, strict=True):
                self._engine.inputs[row : row + width, : self.samples] = values.T
                row += width
            self._engine.run()
            return np.asarray(self._engine.outputs[:, : self.samples].T)
        for memory, values in zip(self._inputs, inputs, strict=True):
            memory[...] = values
        self._run()
        if self._buffer.ret():
            raise SolverError(f"{self._name} could not be evaluated")
        return self._output
