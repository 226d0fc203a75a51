"""One identified body, several parts in the file: which part is given which inertial parameters."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from casysid.arrays import Array
from casysid.inertia import MassProperties, mass_properties, parameters_from_pseudo_inertia, pseudo_inertia

_HELD_SHARE = 1e-3


@dataclass(frozen=True, eq=False)
class Part:
    """A link or body of the file that moves with one joint.

    Attributes:
        name: Its name.
        placement: Its frame in the joint frame, a ``pin.SE3``.
        parameters: The file's ten inertial parameters at its own frame; None where it gives none that can be trusted.
        massive: Whether the file gives it any inertia, trusted or not.
    """

    name: str
    placement: Any
    parameters: Array | None
    massive: bool


def joint_parts(model: Any, known: Mapping[str, tuple[Array | None, bool]]) -> list[list[Part]]:
    """By joint of a ``pin.Model``, universe left out: the parts that move with it, the one it carries first.

    Args:
        model: Its BODY frames are the parts.
        known: By name, the file's parameters at the part's frame (or None), and whether it gives any.
    """
    parts: list[list[Part]] = [[] for _ in range(model.njoints)]
    for frame in model.frames:
        if frame.type == pin.FrameType.BODY and frame.name in known:
            parts[frame.parentJoint].append(Part(frame.name, frame.placement.copy(), *known[frame.name]))
    return parts[1:]


def sum_of(parts: Sequence[Part]) -> Array:
    """Parameters of the whole body at the joint frame, shape (10,), from those parts that have any."""
    return sum((_moved(part.parameters, part.placement) for part in parts if part.parameters is not None), np.zeros(10))


def share_out(theta: Array, parts: Sequence[Part], jointed: Collection[str]) -> dict[str, MassProperties | None]:
    """New properties of parts, by name, so that together they have ``theta`` at the joint frame; absent parts stay.

    The main part (the first that has an inertia) takes what the others leave, if that is a body. Otherwise it takes
    everything, and the others become massless (None), except those with a joint of their own, which is locked:
    simulators want them to have mass, so they get a thousandth of everything, as consistent as the whole.
    """
    main = next((part for part in parts if part.massive), parts[0])
    others = [part for part in parts if part is not main and part.massive]
    if all(part.parameters is not None for part in others):
        share = _seen_from(main, theta - sum_of(others))
        if not others or is_body(share):
            return {main.name: share}
    held = [part for part in others if part.name in jointed]
    fixed = dict.fromkeys(part.name for part in others if part.name not in jointed)
    small = {part.name: _seen_from(part, _HELD_SHARE * theta) for part in held}
    return {main.name: _seen_from(main, (1.0 - _HELD_SHARE * len(held)) * theta), **small, **fixed}


def is_body(share: MassProperties) -> bool:
    """Whether mass and principal moments are positive and no moment exceeds the sum of the other two."""
    moments = np.linalg.eigvalsh(share.inertia)
    return bool(share.mass > 0.0 and moments[0] > 0.0 and moments[2] <= moments[0] + moments[1])


def _seen_from(part: Part, theta: Array) -> MassProperties:
    return mass_properties(_moved(theta, part.placement.inverse()))


def _moved(theta: Array, placement: Any) -> Array:
    """Parameters at one frame, in the frame where ``placement`` puts that one; linear in them."""
    transform = placement.homogeneous
    return parameters_from_pseudo_inertia(transform @ pseudo_inertia(theta) @ transform.T)
