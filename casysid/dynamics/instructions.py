"""A CasADi function as the list of scalar operations that it is, read out once for whatever carries them out.

An SX function is straight-line code. :func:`interpret` walks it and hands every operation to an :class:`Interpreter`:
one turns it into NumPy calls on rows of samples (:mod:`~casysid.dynamics.replay`), the other into C on vectors of
samples (:mod:`~casysid.dynamics.compiled`).

Both give the same bits. What IEEE 754 rounds in one way only (sums, products, quotients, roots, comparisons) NumPy may
do. Sines, powers and the like are the C library's in both: NumPy has its own, which differ from it in the last bits.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, Protocol, TypeVar

import casadi as ca
import numpy as np

from casysid.errors import ParameterError

Value = TypeVar("Value")


class Operation(NamedTuple):
    """One scalar operation: on rows of samples, and as a C expression of ``{0}`` and ``{1}``.

    ``name(...)`` in C is a function of ``double`` for each sample of a vector; the rest is arithmetic on vectors.

    Attributes:
        array: NumPy's ``array(*operands, out=...)``, or CasADi's function of expressions when ``from_library``.
        c: The C expression.
        from_library: Whether the C library computes it.
    """

    array: Callable[..., Any]
    c: str
    from_library: bool = False


def _if_else_zero(condition: Any, value: Any, out: Any) -> None:
    out[...] = np.where(condition, value, 0.0)


def _library(expression: Callable[..., Any], name: str, operands: str = "{0}") -> Operation:
    return Operation(expression, f"{name}({operands})", from_library=True)


OPERATIONS: dict[int, Operation] = {
    ca.OP_ASSIGN: Operation(np.positive, "{0}"),
    ca.OP_ADD: Operation(np.add, "{0} + {1}"),
    ca.OP_SUB: Operation(np.subtract, "{0} - {1}"),
    ca.OP_MUL: Operation(np.multiply, "{0} * {1}"),
    ca.OP_DIV: Operation(np.divide, "{0} / {1}"),
    ca.OP_NEG: Operation(np.negative, "-{0}"),
    ca.OP_INV: Operation(np.reciprocal, "1.0 / {0}"),
    ca.OP_SQ: Operation(np.square, "{0} * {0}"),
    ca.OP_TWICE: Operation(lambda x, out: np.add(x, x, out=out), "{0} + {0}"),
    ca.OP_POW: _library(ca.power, "pow", "{0}, {1}"),
    ca.OP_CONSTPOW: _library(ca.constpow, "pow", "{0}, {1}"),
    ca.OP_SQRT: Operation(np.sqrt, "sqrt({0})"),
    ca.OP_EXP: _library(ca.exp, "exp"),
    ca.OP_EXPM1: _library(ca.expm1, "expm1"),
    ca.OP_LOG: _library(ca.log, "log"),
    ca.OP_LOG1P: _library(ca.log1p, "log1p"),
    ca.OP_SIN: _library(ca.sin, "sin"),
    ca.OP_COS: _library(ca.cos, "cos"),
    ca.OP_TAN: _library(ca.tan, "tan"),
    ca.OP_ASIN: _library(ca.asin, "asin"),
    ca.OP_ACOS: _library(ca.acos, "acos"),
    ca.OP_ATAN: _library(ca.atan, "atan"),
    ca.OP_ATAN2: _library(ca.atan2, "atan2", "{0}, {1}"),
    ca.OP_SINH: _library(ca.sinh, "sinh"),
    ca.OP_COSH: _library(ca.cosh, "cosh"),
    ca.OP_TANH: _library(ca.tanh, "tanh"),
    ca.OP_ASINH: _library(ca.asinh, "asinh"),
    ca.OP_ACOSH: _library(ca.acosh, "acosh"),
    ca.OP_ATANH: _library(ca.atanh, "atanh"),
    ca.OP_ERF: _library(ca.erf, "erf"),
    ca.OP_HYPOT: _library(ca.hypot, "hypot", "{0}, {1}"),
    ca.OP_FABS: Operation(np.fabs, "fabs({0})"),
    ca.OP_SIGN: Operation(np.sign, "sign({0})"),
    ca.OP_COPYSIGN: Operation(np.copysign, "copysign({0}, {1})"),
    ca.OP_FMIN: Operation(np.fmin, "fmin({0}, {1})"),
    ca.OP_FMAX: Operation(np.fmax, "fmax({0}, {1})"),
    ca.OP_FMOD: Operation(np.fmod, "fmod({0}, {1})"),
    ca.OP_FLOOR: Operation(np.floor, "floor({0})"),
    ca.OP_CEIL: Operation(np.ceil, "ceil({0})"),
    ca.OP_LT: Operation(np.less, "less({0}, {1})"),
    ca.OP_LE: Operation(np.less_equal, "less_equal({0}, {1})"),
    ca.OP_EQ: Operation(np.equal, "equal({0}, {1})"),
    ca.OP_NE: Operation(np.not_equal, "not_equal({0}, {1})"),
    ca.OP_AND: Operation(np.logical_and, "logical_and({0}, {1})"),
    ca.OP_OR: Operation(np.logical_or, "logical_or({0}, {1})"),
    ca.OP_NOT: Operation(np.logical_not, "logical_not({0})"),
    ca.OP_IF_ELSE_ZERO: Operation(_if_else_zero, "if_else_zero({0}, {1})"),
}


class Interpreter(Protocol[Value]):
    """What carries out the operations; a value is whatever stands for a number there."""

    def constant(self, number: float) -> Value:
        """A number."""

    def load(self, row: int) -> Value:
        """The row-th input scalar, all inputs one after the other."""

    def apply(self, operation: Operation, operands: Sequence[Value], register: int) -> Value:
        """The result of an operation, which may overwrite what the register held before."""

    def store(self, row: int, value: Value) -> None:
        """The row-th structural nonzero of the output."""


def count_inputs(function: Any) -> int:
    """Number of input scalars of a ``casadi.Function``, all inputs together."""
    return int(sum(function.nnz_in(i) for i in range(function.n_in())))


def interpret(function: Any, interpreter: Interpreter[Value]) -> None:
    """Hand the operations of an SX ``casadi.Function`` with one output to an interpreter, in order.

    Raises:
        ParameterError: When the function has several outputs, or an operation that has no counterpart.
    """
    if function.n_out() != 1 or not function.is_a("SXFunction"):
        raise ParameterError(f"bulk evaluation: needs an SX function with one output; got {function}")
    first = np.cumsum([0] + [function.nnz_in(i) for i in range(function.n_in())]).tolist()
    registers: dict[int, Value] = {}
    for k in range(function.n_instructions()):
        code, operands, results = (
            function.instruction_id(k),
            function.instruction_input(k),
            function.instruction_output(k),
        )
        if code == ca.OP_CONST:
            registers[results[0]] = interpreter.constant(float(function.instruction_constant(k)))
        elif code == ca.OP_INPUT:
            registers[results[0]] = interpreter.load(first[operands[0]] + operands[1])
        elif code == ca.OP_OUTPUT:
            interpreter.store(results[1], registers[operands[0]])
        elif code in OPERATIONS:
            values = [registers[i] for i in operands]
            registers[results[0]] = interpreter.apply(OPERATIONS[code], values, results[0])
        else:
            raise ParameterError(f"bulk evaluation: {function.name()} uses operation {code}, which is not supported")
