"""The numeric constants of the chain of decisions, counted in the source and compared with docs/decisions.md.

    python scripts/count_constants.py [--list]

Counted is every name that a module of the chain binds to numbers at its top level: ``A = 1.0``, ``A, B = 2, 3`` (two),
``A = (1e-6, 1e6)``, ``A = np.pi / 180.0`` and ``A = np.geomspace(0.01, 100.0, 185)``. Names that are bound to words,
types or kinds are none. Exit code 1 says that a constant is missing from the table, that the table has one that the
source has not, or that their values differ.
"""

from __future__ import annotations

import argparse
import ast
import re
import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
TABLE = ROOT / "docs" / "decisions.md"
PLACES = ("identification/**/*.py", "estimation/evidence.py", "estimation/empirical_bayes.py")
"""Modules of the chain, beneath ``casysid``."""
ROW = re.compile(
    r"^\| `(?P<name>\w+)` \| `(?P<value>[^`]+)` \| `(?P<file>[^`]+)` \| (?P<role>\w+) \| (?P<origin>.+) \|$"
)


@dataclass(frozen=True, order=True)
class Constant:
    """A module's constant: where it stands, its name, and its value as the source has it."""

    file: str
    name: str
    value: str


@dataclass(frozen=True)
class Row:
    """A row of the table: the constant, what it does (``decides``, ``computes``, ``tells``), where it comes from."""

    constant: Constant
    role: str
    origin: str


def constants_of(source: str, file: str) -> Iterator[Constant]:
    """Numeric constants at the top level of a module."""
    for statement in ast.parse(source).body:
        match statement:
            case ast.Assign(targets=[ast.Tuple(elts=names)], value=ast.Tuple(elts=values)):
                pairs = list(zip(names, values, strict=True))
            case ast.Assign(targets=[target], value=value):
                pairs = [(target, value)]
            case ast.AnnAssign(target=target, value=ast.expr() as value):
                pairs = [(target, value)]
            case _:
                pairs = []
        for name, value in pairs:
            if isinstance(name, ast.Name) and is_numeric(value):
                yield Constant(file, name.id, ast.unparse(value))


def is_numeric(value: ast.expr) -> bool:
    """Whether an expression is made of numbers, at least one: literals, NumPy's constants and functions of numbers."""
    match value:
        case ast.Constant(value=bool()):
            return False
        case ast.Constant(value=int() | float()):
            return True
        case ast.Attribute(value=ast.Name(id="np"), attr="pi" | "inf"):
            return True
        case ast.UnaryOp(operand=operand):
            return is_numeric(operand)
        case ast.BinOp(left=left, right=right):
            return is_numeric(left) and is_numeric(right)
        case (
            ast.Tuple(elts=elements)
            | ast.List(elts=elements)
            | ast.Call(func=ast.Attribute(value=ast.Name(id="np")), args=elements, keywords=[])
        ):
            return bool(elements) and all(map(is_numeric, elements))
    return False


def constants_of_the_chain() -> list[Constant]:
    """Of all modules of the chain, in the order of their files."""
    package = ROOT / "casysid"
    files = sorted({path for place in PLACES for path in package.glob(place)})
    return [
        constant
        for path in files
        for constant in constants_of(path.read_text(encoding="utf-8"), path.relative_to(package).as_posix())
    ]


def rows_of(text: str) -> list[Row]:
    """Rows of the table in a Markdown text."""
    found = [match for line in text.splitlines() if (match := ROW.match(line))]
    return [Row(Constant(one["file"], one["name"], one["value"]), one["role"], one["origin"]) for one in found]


def differences(constants: list[Constant], rows: list[Row]) -> list[str]:
    """What is wrong with the table, a sentence each."""
    there, told = Counter(constants), Counter(row.constant for row in rows)
    missing = [f"not in the table, or with another value: {one}" for one in sorted((there - told).elements())]
    return missing + [f"in the table only: {one}" for one in sorted((told - there).elements())]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--list", action="store_true", help="show every constant")
    options = parser.parse_args()
    constants, rows = constants_of_the_chain(), rows_of(TABLE.read_text(encoding="utf-8"))
    if options.list:
        for constant in constants:
            print(f"{constant.file}: {constant.name} = {constant.value}")
    roles = Counter(row.role for row in rows)
    print(f"{len(constants)} constants: {', '.join(f'{count} {role}' for role, count in sorted(roles.items()))}")
    wrong = differences(constants, rows)
    for sentence in wrong:
        print(sentence, file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
