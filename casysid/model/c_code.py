"""The model as C99 without dependencies but the C library: header, source, a test, and what CMake needs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from casysid.arrays import Array
from casysid.dynamics.compiled import HELPERS
from casysid.dynamics.instructions import Operation, interpret
from casysid.errors import ParameterError
from casysid.outputs import run_folder

if TYPE_CHECKING:
    from casysid.model.robot_model import RobotModel

STATES = 5
"""Random states that the test asks every function at."""
TOLERANCE = 1e-12
"""By which the C may differ, relative to the largest number of an answer: rounding of some thousand operations."""
SPEED = 2.0
"""Standard deviation of the test's velocities [rad/s, m/s], such as arms move with; accelerations are twice that."""
_DOCS = {
    "torque": "What moves the robot so, friction included.",
    "gravity": "What holds the robot still without friction.",
    "mass_matrix": "The mass matrix, column by column (it is symmetric unless the torques have gains).",
    "bias": "Torque of a steady motion without friction: Coriolis, centrifugal and gravity.",
    "friction": "What of the torque friction takes.",
    "forward_dynamics": "Accelerations under torques.",
    "slid": "What friction remembers after a long way in the direction of v.",
    "remember": "What friction remembers one sample later; start with zeros.",
}


def write_c(model: RobotModel, folder: Path, name: str) -> tuple[Path, ...]:
    """See :meth:`RobotModel.write_c`."""
    texts = c_files(model, name)
    with run_folder(folder) as stage:
        for file, text in texts.items():
            (stage.folder / file).write_text(text, encoding="utf-8")
    return tuple(folder / file for file in texts)


def c_files(model: RobotModel, name: str = "robot_model") -> dict[str, str]:
    """What these files hold, by name.

    Raises:
        ParameterError: The name is no C identifier.
    """
    if not (name.isidentifier() and name.isascii()):
        raise ParameterError(f"C source: the name must be a C identifier such as robot_model; got {name!r}")
    return {
        f"{name}.h": _header(model, name),
        f"{name}.c": _source(model, name),
        f"test_{name}.c": _test(model, name),
        "CMakeLists.txt": _cmake(name),
    }


def _header(model: RobotModel, name: str) -> str:
    robot, guard = model.robot, f"{name.upper()}_H"
    lines = [
        f"/* Dynamics of the robot '{_plain(robot.name)}', identified by casysid. SI units.",
        " *",
        " * v, a, tau: by degree of freedom, in this order:",
        *(f" *   [{k}] {_plain(dof)}" for k, dof in enumerate(robot.dofs)),
        " * q: the same, but two numbers (cosine, sine) for a joint that turns without end, a quaternion x y z w for a",
        " *   ball joint (Pinocchio's layout).",
        *([" * memory: what friction before sliding remembers of the way."] if model.memory_size else []),
        " * No function keeps a state or allocates memory; every one may be called by several threads. */",
        f"#ifndef {guard}",
        f"#define {guard}",
        "",
        f"#define {name.upper()}_NQ {robot.nq}",
        f"#define {name.upper()}_NV {robot.nv}",
        f"#define {name.upper()}_MEMORY {model.memory_size}",
        "",
        "#ifdef __cplusplus",
        'extern "C" {',
        "#endif",
        "",
    ]
    for function in model.casadi.all:
        lines += [f"/* {_DOCS[function.name()]} */", f"{_signature(name, function)};", ""]
    return "\n".join([*lines, "#ifdef __cplusplus", "}", "#endif", "#endif", ""])


def _source(model: RobotModel, name: str) -> str:
    lines = [f'#include "{name}.h"', "", "#include <math.h>", "", HELPERS]
    for function in model.casadi.all:
        writer = _Writer(function)
        interpret(function, writer)
        unused = [f"  (void){one};" for one in writer.unused]
        lines += [f"{_signature(name, function)} {{", *unused, *writer.lines, *writer.stores, "}", ""]
    return "\n".join(lines)


class _Writer:
    """Writes one C statement for each operation of a function; a value is the name of a variable, or a number.

    Attributes:
        lines: The operations.
        stores: Of the results, after all operations, so that an output may take an input's place.
        unused: Inputs that no operation has asked for.
    """

    def __init__(self, function: Any) -> None:
        self.lines: list[str] = []
        self.stores: list[str] = []
        self._inputs = [
            f"{function.name_in(k)}[{i}]" for k in range(function.n_in()) for i in range(function.nnz_in(k))
        ]
        self._output = function.name_out(0)
        self.unused = [function.name_in(k) for k in range(function.n_in())]

    def constant(self, number: float) -> str:
        if not np.isfinite(number):
            return "NAN" if np.isnan(number) else f"({'-' if number < 0 else ''}INFINITY)"
        return f"({number!r})"

    def load(self, row: int) -> str:
        name, place = f"t{len(self.lines)}", self._inputs[row]
        self.unused = [one for one in self.unused if not place.startswith(f"{one}[")]
        self.lines.append(f"  const double {name} = {place};")
        return name

    def apply(self, operation: Operation, operands: Sequence[str], register: int) -> str:
        name = f"t{len(self.lines)}"
        self.lines.append(f"  const double {name} = {operation.c.format(*operands)};")
        return name

    def store(self, row: int, value: str) -> None:
        self.stores.append(f"  {self._output}[{row}] = {value};")


def _signature(name: str, function: Any) -> str:
    inputs = [f"const double {function.name_in(k)}[{function.numel_in(k)}]" for k in range(function.n_in())]
    return f"void {name}_{function.name()}({', '.join(inputs)}, double {function.name_out(0)}[{function.numel_out(0)}])"


def _test(model: RobotModel, name: str) -> str:
    """A program that asks every function at some states and compares with what Python said."""
    lines = ["#include <math.h>", "#include <stdio.h>", f'#include "{name}.h"', "", _COMPARE, "int main(void) {"]
    lines += ["  int wrong = 0;"]
    for inputs in _states(model):
        for function in model.casadi.all:
            given = [inputs[function.name_in(k)] for k in range(function.n_in())]
            wanted = np.asarray(function(*given), dtype=np.float64).ravel(order="F")
            arrays = [
                f"    const double {function.name_in(k)}[] = {_braces(values)};" for k, values in enumerate(given)
            ]
            call = ", ".join(function.name_in(k) for k in range(function.n_in()))
            lines += [
                "  {",
                *arrays,
                f"    const double wanted[] = {_braces(wanted)};",
                f"    double got[{wanted.size}];",
                f"    {name}_{function.name()}({call}, got);",
                f'    wrong += differs("{function.name()}", got, wanted, {wanted.size});',
                "  }",
            ]
    return "\n".join([*lines, "  return wrong != 0;", "}", ""])


def _states(model: RobotModel) -> list[dict[str, Array]]:
    robot, rng = model.robot, np.random.default_rng(0)
    low, high = np.full(robot.nq, -1.0), np.ones(robot.nq)
    pin.seed(0)
    return [
        {
            "q": pin.randomConfiguration(robot.model, low, high),
            "q_before": pin.randomConfiguration(robot.model, low, high),
            "v": SPEED * rng.normal(size=robot.nv),
            "a": 2.0 * SPEED * rng.normal(size=robot.nv),
            "tau": rng.normal(size=robot.nv),
            "memory": rng.uniform(-1.0, 1.0, model.memory_size),
        }
        for _ in range(STATES)
    ]


def _braces(values: Array) -> str:
    return "{" + ", ".join(repr(float(value)) for value in values) + "}"


def _plain(text: str) -> str:
    """A stranger's name that may stand in a comment."""
    return "".join(letter if letter.isprintable() else " " for letter in text).replace("*/", "* /").replace("/*", "/ *")


def _cmake(name: str) -> str:
    return f"""\
cmake_minimum_required(VERSION 3.10)
project({name} C)
set(CMAKE_C_STANDARD 99)
if(NOT CMAKE_BUILD_TYPE)
  set(CMAKE_BUILD_TYPE Release)
endif()

add_library({name} {name}.c)
target_include_directories({name} PUBLIC ${{CMAKE_CURRENT_SOURCE_DIR}})
target_link_libraries({name} PUBLIC m)

enable_testing()
add_executable(test_{name} test_{name}.c)
target_link_libraries(test_{name} {name})
add_test(NAME {name} COMMAND test_{name})
"""


_COMPARE = f"""\
static int differs(const char *name, const double *got, const double *wanted, int n) {{
  double size = 1e-300, error = 0.0;
  for (int k = 0; k < n; ++k) {{
    size = fmax(size, fabs(wanted[k]));
    error = fmax(error, fabs(got[k] - wanted[k]));
  }}
  const int wrong = !(error <= {TOLERANCE!r} * size);
  if (wrong) printf("%s: off by %g of %g\\n", name, error, size);
  return wrong;
}}
"""
