"""How large a model may be, in parts and in numbers, asked before any library is: theirs crash or hang beyond it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import numpy.typing as npt

from casysid.errors import RobotError
from casysid.robot.xmltext import MOST_ELEMENTS, Element, parse_xml, read_bytes

MOST_JOINTS = 1000
"""That move: a humanoid with both hands has a hundred."""
MOST_BODIES = 5000
"""Links of a URDF, bodies of an MJCF as MuJoCo compiles it: 4 s at that number, and four times that at twice (4.0)."""
DEEPEST_CHAIN = 1000
"""Links from the base to the farthest: Pinocchio 4.1 descends by recursion and crashes between 2000 and 5000."""
MOST_COPIES = 5000
"""Elements that replication makes: 4 s for as many geoms, growing with the square (MuJoCo 4.0)."""
LARGEST_SIZE = 1_000_000
"""Of a table that an MJCF asks for (rows, keys, user data): MuJoCo fills it whatever there is to fill it with."""
LARGEST = 1e9
"""Of any mass, length, inertia, friction or gravity, in SI units: a laden supertanker has 6e8 kg. Sums of products of
five such numbers stay far from the largest float."""


def check_parts(joints: int, bodies: int, path: Path) -> None:
    """Nothing, if a mechanism of so many moving joints and bodies is handled.

    Raises:
        RobotError: It is not.
    """
    for count, most, word in ((joints, MOST_JOINTS, "moving joints"), (bodies, MOST_BODIES, "links or bodies")):
        if count > most:
            raise RobotError(f"{path}: {count} {word}; at most {most} are handled. Cut the model, or split it")


def check_chain(depth: int, link: str, path: Path) -> None:
    """Nothing, if a link that many joints from the base is handled.

    Raises:
        RobotError: It is not.
    """
    if depth > DEEPEST_CHAIN:
        raise RobotError(
            f"{path}: link '{link}' is {depth} joints from the base; at most {DEEPEST_CHAIN} are handled. Merge links"
        )


def check_numbers(what: str, values: npt.ArrayLike, path: Path) -> None:
    """Nothing, if all values of a part of the model are finite and below :data:`LARGEST`.

    Raises:
        RobotError: Naming the part.
    """
    numbers = np.abs(np.asarray(values, dtype=np.float64))
    if not (numbers <= LARGEST).all():
        worst = np.nanmax(numbers) if not np.isnan(numbers).all() else np.nan
        raise RobotError(f"{path}: {what} is {worst:.6g}, wanted a number of SI units below {LARGEST:g}")


def check_expansion(root: Element, path: Path) -> None:
    """Nothing, if what an MJCF's replicas, grids, includes and attached models come to is handled.

    Raises:
        RobotError: It is not; nothing was compiled for that.
    """
    seen, made, bodies = 0, 0.0, 0.0
    for element, copies in _expanded(root, path):
        seen += 1
        made += copies - 1.0
        bodies += copies if element.tag == "body" else 0.0
        bodies += copies * _grid(element) if element.tag == "flexcomp" else 0.0
        where = f"{path}: <{element.tag}> (line {element.line} of its file)"
        if seen > MOST_ELEMENTS or made > MOST_COPIES or bodies > MOST_BODIES:
            raise RobotError(
                f"{where}: replicated, included and attached elements are too many; at most {MOST_BODIES} bodies, "
                f"{MOST_COPIES} copies and {MOST_ELEMENTS} elements are handled. Replicate less often"
            )
        _check_sizes(element, where)


def _expanded(root: Element, path: Path) -> Iterator[tuple[Element, float]]:
    """Every element with the number of its copies, included files and attached models followed where they can be."""
    models = {element.name: element.attributes.get("file", "") for element in root.walk() if element.tag == "model"}
    files, waiting = {path.resolve()}, [(root, 1.0)]
    while waiting:
        element, copies = waiting.pop()
        yield element, copies
        inner = copies * _number(element, "count") if element.tag == "replicate" else copies
        waiting += [(child, inner) for child in element.children]
        if (
            element.tag == "include"
            and (file := (path.parent / element.attributes.get("file", "")).resolve()) not in files
        ):
            files.add(file)
            waiting += [(other, inner) for other in _other_root(file)]
        if element.tag == "attach":
            waiting += [
                (other, inner)
                for other in _other_root(path.parent / models.get(element.attributes.get("model", ""), ""))
            ]


def _other_root(file: Path) -> list[Element]:
    """The root of another file; none where MuJoCo has to say what is wrong with it."""
    try:
        return [parse_xml(read_bytes(file), file)]
    except RobotError:
        return []


def _grid(element: Element) -> float:
    counts = [_float(word) for word in element.attributes.get("count", "").split()]
    return math.prod(max(count, 1.0) for count in counts) if counts else 0.0


def _check_sizes(element: Element, where: str) -> None:
    if element.tag == "size":
        asked = {name: _float(text) for name, text in element.attributes.items()}
    elif element.tag == "hfield":
        asked = {"nrow times ncol": _number(element, "nrow") * _number(element, "ncol")}
    else:
        asked = {}
    for name, size in asked.items():
        if size > LARGEST_SIZE:
            raise RobotError(f"{where}: {name} asks for a table of {size:.6g}; at most {LARGEST_SIZE} are made")


def _number(element: Element, name: str) -> float:
    return max(_float(element.attributes.get(name, "1")), 0.0)


def _float(text: str) -> float:
    """A number as written; zero where it is none, which MuJoCo refuses."""
    try:
        number = float(text)
    except ValueError:
        return 0.0
    return 0.0 if math.isnan(number) else number
