"""What makes a model file's numbers unfit: inertias that no body has, and settings that mean nothing."""

from __future__ import annotations

import enum
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array, frozen
from casysid.errors import CasysidWarning, RobotError

LARGEST_GRAVITY = 1000.0  # [m/s²]: the sun's surface has 274
_RELATIVE_TOLERANCE = 1e-9  # of the inertia's trace: rounding, not physics


class FaultKind(enum.Enum):
    """What is wrong with a link's inertial parameters in the file."""

    MISSING = "no inertial parameters"
    UNREADABLE = "not a number"
    MASS_NOT_POSITIVE = "mass not positive"
    INERTIA_NOT_POSITIVE = "inertia not positive definite"
    TRIANGLE_INEQUALITY = "triangle inequality violated"


@dataclass(frozen=True)
class InertiaFault:
    """A complaint about one link's inertial parameters in the file: they are a weak prior, or none.

    Attributes:
        link: Name of the link.
        kind: What is wrong.
        message: The same with its numbers, as a sentence part.
    """

    link: str
    kind: FaultKind
    message: str


def check_inertia(link: str, mass: float, inertia: Array, *, strict: bool = True) -> list[InertiaFault]:
    """Complaints about a body's mass and its inertia (3, 3) about the centre of mass.

    Args:
        link: Name for the complaints.
        mass: [kg].
        inertia: [kg m²].
        strict: Whether zero mass and semidefinite inertia are complained of; a part of a body may have them.
    """
    if mass < 0.0 or (strict and mass == 0.0):
        return [InertiaFault(link, FaultKind.MASS_NOT_POSITIVE, f"mass is {mass:.6g} kg, must be positive")]
    moments = np.linalg.eigvalsh(inertia)
    floor = _RELATIVE_TOLERANCE * float(np.abs(moments).sum())
    text = ", ".join(f"{moment:.6g}" for moment in moments)
    if moments[0] < -floor or (strict and moments[0] <= floor):
        message = f"principal moments of inertia {text} kg m², must be positive"
        return [InertiaFault(link, FaultKind.INERTIA_NOT_POSITIVE, message)]
    if moments[2] > moments[0] + moments[1] + floor:
        message = f"principal moments of inertia {text} kg m²: the largest exceeds the sum of the other two"
        return [InertiaFault(link, FaultKind.TRIANGLE_INEQUALITY, message)]
    return []


def warn_of_faults(path: Path, faults: Sequence[InertiaFault], *, stacklevel: int) -> None:
    """One :class:`CasysidWarning` that lists all faults by link; silent when there are none."""
    if faults:
        count = len({fault.link for fault in faults})
        listing = "; ".join(f"link '{fault.link}': {fault.message}" for fault in faults)
        warnings.warn(
            f"{path}: the inertial parameters of {count} link{'s' * (count > 1)} are not those of a body ({listing}). "
            "They serve as prior only: identification goes on, but what the data cannot see falls back to these values",
            CasysidWarning,
            stacklevel=stacklevel + 1,
        )


def check_gravity(gravity: npt.ArrayLike) -> Array:
    """Gravity as three finite numbers [m/s²].

    Raises:
        RobotError: It is anything else.
    """
    try:
        vector = frozen(gravity)
    except (TypeError, ValueError) as error:
        raise RobotError(f"gravity: wanted three numbers [m/s²], such as (0, 0, -9.81); got {gravity!r}") from error
    if vector.shape != (3,) or not (np.abs(vector) <= LARGEST_GRAVITY).all():
        raise RobotError(
            f"gravity: wanted three numbers of at most {LARGEST_GRAVITY:g} m/s², such as (0, 0, -9.81); got {gravity!r}"
        )
    return vector


def negative_friction(damping: float, friction: float, armature: float = 0.0) -> str:
    """A complaint about a joint's friction and armature in the file, empty when none is negative."""
    if min(damping, friction, armature) >= 0.0:
        return ""
    also = f", armature {armature:g}" if armature < 0.0 else ""
    return f"negative friction (damping {damping:g}, friction {friction:g}{also}) is no usable prior"
