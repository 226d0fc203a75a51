"""A CasADi function as the list of scalar operations that it is, read out once for whatever carries them out.

An SX function is straight-line code. :func:`interpret` walks it and hands every operation to an :class:`Interpreter`:
one turns it into NumPy calls on rows of samples (:mod:`~casysid.dynamics.replay`), the other into C on vectors of
samples (:mod:`~casysid.dynamics.compiled`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, Protocol, TypeVar

import casadi as ca
import numpy as np
from scipy.special import erf

from casysid.errors import ParameterError

Value = TypeVar("Value")


class Operation(NamedTuple):
    """One scalar operation: for NumPy as ``array(*operands, out=...)``, and as a C expression of ``{0}`` and ``{1}``.

    ``name(...)`` in C is a function of ``double`` for each sample of a vector; the rest is arithmetic on vectors.
    """

    array: Callable[..., Any]
    c: str


def _if_else_zero(condition: Any, value: Any, out: Any) -> None:
    out[...] = np.where(condition, value, 0.0)


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
    ca.OP_POW: Operation(np.power, "pow({0}, {1})"),
    ca.OP_CONSTPOW: Operation(np.power, "pow({0}, {1})"),
    ca.OP_SQRT: Operation(np.sqrt, "sqrt({0})"),
    ca.OP_EXP: Operation(np.exp, "exp({0})"),
    ca.OP_EXPM1: Operation(np.expm1, "expm1({0})"),
    ca.OP_LOG: Operation(np.log, "log({0})"),
    ca.OP_LOG1P: Operation(np.log1p, "log1p({0})"),
    ca.OP_SIN: Operation(np.sin, "sin({0})"),
    ca.OP_COS: Operation(np.cos, "cos({0})"),
    ca.OP_TAN: Operation(np.tan, "tan({0})"),
    ca.OP_ASIN: Operation(np.arcsin, "asin({0})"),
    ca.OP_ACOS: Operation(np.arccos, "acos({0})"),
    ca.OP_ATAN: Operation(np.arctan, "atan({0})"),
    ca.OP_ATAN2: Operation(np.arctan2, "atan2({0}, {1})"),
    ca.OP_SINH: Operation(np.sinh, "sinh({0})"),
    ca.OP_COSH: Operation(np.cosh, "cosh({0})"),
    ca.OP_TANH: Operation(np.tanh, "tanh({0})"),
    ca.OP_ASINH: Operation(np.arcsinh, "asinh({0})"),
    ca.OP_ACOSH: Operation(np.arccosh, "acosh({0})"),
    ca.OP_ATANH: Operation(np.arctanh, "atanh({0})"),
    ca.OP_ERF: Operation(erf, "erf({0})"),
    ca.OP_HYPOT: Operation(np.hypot, "hypot({0}, {1})"),
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
