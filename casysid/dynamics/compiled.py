"""Straight-line code as C on vectors of samples, compiled once for this machine and kept in the user's cache directory.

Products and sums are not contracted, so that a kernel gives the bits that the replay gives. Any failure (no compiler,
no place to write, an unknown flag) yields no kernel, never an error: the caller has another way.
"""

from __future__ import annotations

import ctypes
import hashlib
import os
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from typing import Any, cast

import numpy as np

from casysid.dynamics.instructions import OPERATIONS, Operation, count_inputs, interpret
from casysid.dynamics.kernel_cache import find_library, keep_library, load_library

LONGEST = 60_000  # operations; more would keep a compiler busy for minutes
Kernel = Callable[[int, int, int], None]
_MOST_LANES = 8
_FLAGS = (
    *("-O1", "-march=native", "-fPIC", "-shared", "-w"),
    "-ffp-contract=off",  # no sum of a product is rounded once where NumPy rounds twice
    *sorted({f"-fno-builtin-{one.c.partition('(')[0]}" for one in OPERATIONS.values() if one.from_library}),
)
_SECONDS = 120.0
_FAILURES = (OSError, RuntimeError, AttributeError, subprocess.SubprocessError)

HELPERS = """\
static inline double sign(double x) { return (x > 0) - (x < 0); }
static inline double less(double x, double y) { return x < y; }
static inline double less_equal(double x, double y) { return x <= y; }
static inline double equal(double x, double y) { return x == y; }
static inline double not_equal(double x, double y) { return x != y; }
static inline double logical_and(double x, double y) { return x && y; }
static inline double logical_or(double x, double y) { return x || y; }
static inline double logical_not(double x) { return !x; }
static inline double if_else_zero(double x, double y) { return x ? y : 0; }
"""
"""What operations need beside C's own and ``math.h``."""

_PROLOGUE = f"""\
#include <math.h>
#include <stddef.h>
#if defined(__AVX512F__)
#define LANES 8
#elif defined(__AVX__)
#define LANES 4
#else
#define LANES 2
#endif
typedef double vec __attribute__((vector_size(8 * LANES)));
typedef double row __attribute__((vector_size(8 * LANES), aligned(8), may_alias));
{HELPERS}#define EACH(call) ({{ vec r; for (int l = 0; l < LANES; ++l) r[l] = call; r; }})
#define BROADCAST(x) ((vec){{0}} + (x))
void kernel(const double *x, double *y, ptrdiff_t n) {{
for (ptrdiff_t k = 0; k < n; k += LANES) {{
"""


class Compiled:
    """A compiled function at many samples at once. Not to be shared by threads.

    Attributes:
        inputs: To be filled, shape (scalars, samples): all inputs one after the other.
        outputs: Filled by :meth:`run`, shape (nonzeros, samples).
        samples: How many it was made for.
    """

    def __init__(self, function: Any, kernel: Kernel, samples: int) -> None:
        """Memory for so many samples (rounded up to whole vectors) of a function and its kernel."""
        self.samples = samples
        whole = -(-samples // _MOST_LANES) * _MOST_LANES
        self.inputs = np.zeros((count_inputs(function), whole))
        self.outputs = np.zeros((function.nnz_out(0), whole))
        self._kernel = kernel

    def run(self) -> None:
        """Evaluate the function at all samples."""
        self._kernel(self.inputs.ctypes.data, self.outputs.ctypes.data, self.inputs.shape[1])


def find_kernel(function: Any) -> Kernel | None:
    """The kernel of an SX function with one output if it was compiled before, by this compiler for this machine."""
    try:
        library = find_library(_key(write_source(function)))
        return None if library is None else _kernel(library)
    except _FAILURES:
        return None


def compile_kernel(function: Any) -> Kernel | None:
    """The kernel of an SX function with one output; None when it cannot be compiled here."""
    try:
        source = write_source(function)
        library = _build(source)
        kernel = _kernel(library)
    except _FAILURES:
        return None
    with suppress(*_FAILURES):  # a place to keep it is not needed
        keep_library(_key(source), library)
    return kernel


def write_source(function: Any) -> str:
    """C source of ``void kernel(const double *x, double *y, ptrdiff_t n)``.

    Rows of ``n`` samples, a multiple of eight: one for each input scalar in ``x``, one for each structural nonzero in
    ``y``.
    """
    writer = _Writer()
    interpret(function, writer)
    return "\n".join([_PROLOGUE, *writer.lines, "}}\n"])


class _Writer:
    """Writes one C statement for each operation; a value is the name of a vector, or a number in C."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def constant(self, number: float) -> str:
        if not np.isfinite(number):
            return "NAN" if np.isnan(number) else f"({'-' if number < 0 else ''}INFINITY)"
        return f"({number!r})"

    def load(self, row: int) -> str:
        return self._name(f"*(const row *)(x + {row} * n + k)")

    def apply(self, operation: Operation, operands: Sequence[str], register: int) -> str:
        if operation.c[0].isalpha():
            lanes = [f"{operand}[l]" if operand.startswith("t") else operand for operand in operands]
            return self._name(f"EACH({operation.c.format(*lanes)})")
        expression = operation.c.format(*operands)
        is_vector = any(operand.startswith("t") for operand in operands)
        return self._name(expression if is_vector else f"BROADCAST({expression})")

    def store(self, row: int, value: str) -> None:
        self.lines.append(f"*(row *)(y + {row} * n + k) = {value if value.startswith('t') else f'BROADCAST({value})'};")

    def _name(self, expression: str) -> str:
        name = f"t{len(self.lines)}"
        self.lines.append(f"vec {name} = {expression};")
        return name


def _build(source: str) -> bytes:
    """The shared library of a source."""
    with tempfile.TemporaryDirectory(prefix="casysid-") as directory:
        text, built = Path(directory) / "kernel.c", Path(directory) / "kernel.so"
        text.write_text(source)
        _run(_compiler(), *_FLAGS, str(text), "-o", str(built), "-lm")
        return built.read_bytes()


def _key(source: str) -> str:
    """What the library of a source is known by: the source, the compiler and the processor."""
    return hashlib.sha256("\0".join([source, *_FLAGS, _target(_compiler())]).encode()).hexdigest()


def _kernel(library: bytes) -> Kernel:
    kernel = load_library(library).kernel
    kernel.argtypes, kernel.restype = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_ssize_t], None
    return cast("Kernel", kernel)


def _compiler() -> str:
    found = shutil.which("gcc") or shutil.which("cc")
    if found is None:
        raise RuntimeError("no C compiler")
    return found


@lru_cache(maxsize=4)
def _target(compiler: str) -> str:
    """What the compiler predefines for this machine: its version, and which instructions the processor has."""
    return _run(compiler, "-march=native", "-dM", "-E", "-x", "c", os.devnull)


def _run(*command: str) -> str:
    done = subprocess.run(
        command, capture_output=True, text=True, timeout=_SECONDS, check=True, stdin=subprocess.DEVNULL
    )
    return done.stdout
