"""Link by link: mass, centre of mass and inertia with their standard errors, and what can be known of each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from casysid.arrays import Array, frozen
from casysid.identifiability import Identifiability
from casysid.inertia import mass_properties

INERTIA_ORDER = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
"""xx yy zz xy xz yz, the order in which a link's inertia is reported."""
_PARAMETER_OF_INERTIA = (4, 6, 9, 5, 7, 8)
"""Places of the same entries among Pinocchio's ten parameters."""


@dataclass(frozen=True, eq=False)
class LinkProperties:
    """One link as an engineer knows it.

    Attributes:
        name: Of the link.
        mass: [kg].
        center_of_mass: In the joint's frame, shape (3,), [m].
        inertia: About the centre of mass, xx yy zz xy xz yz, shape (6,), [kg m²].
        mass_std: Standard error; infinite where the data see nothing.
        center_of_mass_std: Shape (3,).
        inertia_std: Shape (6,).
        identifiable: Of the ten parameters m, mcx.. Izz: what the mechanism lets anyone know.
    """

    name: str
    mass: float
    center_of_mass: Array
    inertia: Array
    mass_std: float
    center_of_mass_std: Array
    inertia_std: Array
    identifiable: tuple[Identifiability, ...]

    def to_json(self) -> dict[str, object]:
        """Plain numbers and lists."""
        words = [one.value for one in self.identifiable]
        return {
            "mass": self.mass,
            "center_of_mass": self.center_of_mass.tolist(),
            "inertia": self.inertia.tolist(),
            "std": {
                "mass": self.mass_std,
                "center_of_mass": self.center_of_mass_std.tolist(),
                "inertia": self.inertia_std.tolist(),
            },
            "identifiable": {
                "mass": words[0],
                "center_of_mass": words[1:4],
                "inertia": [words[k] for k in _PARAMETER_OF_INERTIA],
            },
        }


def link_properties(
    name: str, parameters: Array, covariance: Array, identifiable: tuple[Identifiability, ...]
) -> LinkProperties:
    """Physical quantities of one link from its ten parameters, shape (10,), and their covariance, shape (10, 10)."""
    body = mass_properties(parameters)
    std = _delta_method(_jacobian(parameters), covariance)
    return LinkProperties(
        name=name,
        mass=float(body.mass),
        center_of_mass=body.center_of_mass,
        inertia=frozen([body.inertia[entry] for entry in INERTIA_ORDER]),
        mass_std=float(std[0]),
        center_of_mass_std=frozen(std[1:4]),
        inertia_std=frozen(std[4:]),
        identifiable=identifiable,
    )


def _jacobian(parameters: Array) -> Array:
    """Derivative of (mass, centre of mass, inertia about it) by the ten parameters, shape (10, 10)."""
    m, h = float(parameters[0]), parameters[1:4]
    jacobian = np.zeros((10, 10))
    jacobian[0, 0] = 1.0
    if m == 0.0:
        jacobian[1:] = np.inf
        return jacobian
    jacobian[1:4, 0] = -h / m**2
    jacobian[1:4, 1:4] = np.eye(3) / m
    by_mass = (h @ h * np.eye(3) - np.outer(h, h)) / m**2
    for row, (i, k) in enumerate(INERTIA_ORDER):
        jacobian[4 + row, 0] = by_mass[i, k]
        jacobian[4 + row, _PARAMETER_OF_INERTIA[row]] = 1.0
        for axis in range(3):
            e = np.eye(3)[axis]
            jacobian[4 + row, 1 + axis] = -(2.0 * h[axis] * (i == k) - e[i] * h[k] - h[i] * e[k]) / m
    return jacobian


def _delta_method(jacobian: Array, covariance: Array) -> Array:
    """Standard errors ``√diag(J C Jᵀ)``; infinite where anything of infinite variance enters."""
    unknown = np.isinf(np.diag(covariance))
    finite = np.where(unknown[:, None] | unknown[None, :], 0.0, covariance)
    with np.errstate(invalid="ignore"):
        variance = np.einsum("ij,jk,ik->i", jacobian, finite, jacobian)
    touched = (jacobian[:, unknown] != 0.0).any(axis=1) | ~np.isfinite(jacobian).all(axis=1)
    return np.where(touched, np.inf, np.sqrt(np.maximum(variance, 0.0)))
