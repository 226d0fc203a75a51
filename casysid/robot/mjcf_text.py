"""Finds the bodies and joints of a compiled model in MJCF text.

They are known by their order in the text, which is MuJoCo's. Where the text does not show them all (includes, replicas,
attached models), MuJoCo's own text of the whole is taken, which is exact when saved as authored.
"""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

from casysid.errors import RobotError
from casysid.robot.xmltext import Element, parse_xml, read_bytes


def locate_bodies(source: Path, spec: Any, compiled: Any, *, alone: bool) -> tuple[bytes, Element, list[Element]]:
    """A text of the model, its root, and the element of each body but the world, in MuJoCo's order.

    Args:
        source: The MJCF file.
        spec: Its ``MjSpec``.
        compiled: Its ``MjModel``, static bodies kept apart.
        alone: Whether the text must stand without the files that it includes.

    Raises:
        RobotError: The bodies cannot be told apart.
    """
    text = read_bytes(source)
    root = parse_xml(text, source)
    elements = _match_bodies(root, compiled)
    if elements is None or (alone and any(element.tag == "include" for element in root.walk())):
        text = _flattened(spec, source)
        root = parse_xml(text, source)
        elements = _match_bodies(root, compiled)
    if elements is None:
        raise RobotError(f"{source}: cannot tell which <body> is which; write the bodies out in one file")
    return text, root, elements


def own_elements(body: Element, *tags: str) -> list[Element]:
    """Elements of a body, and of frames in it, but not of bodies in it."""
    found: list[Element] = []
    for child in body.children:
        if child.tag in tags:
            found.append(child)
        elif child.tag == "frame":
            found += own_elements(child, *tags)
    return found


def joint_elements(body: Element) -> list[Element]:
    """The joints of a body, in the order of the text."""
    return own_elements(body, "joint", "freejoint")


def _match_bodies(root: Element, compiled: Any) -> list[Element] | None:
    elements = [e for world in root.find_all("worldbody") for e in world.walk() if e.tag == "body"]
    if len(elements) != compiled.nbody - 1:
        return None
    for b, element in enumerate(elements, 1):
        names = [compiled.joint(j).name for j in range(compiled.njnt) if compiled.jnt_bodyid[j] == b]
        if element.name != compiled.body(b).name or [joint.name for joint in joint_elements(element)] != names:
            return None
    return elements


def _flattened(spec: Any, source: Path) -> bytes:
    """MuJoCo's text of the whole model, as authored.

    Raises:
        RobotError: An asset's file is missing.
    """
    spec.compiler.savecompiled = spec.compiler.savecanonical = False
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # the same as when it was read
            return str(spec.to_xml()).encode()
    except ValueError as error:
        raise RobotError(f"{source}: MuJoCo cannot write the included parts: {' '.join(str(error).split())}") from error
