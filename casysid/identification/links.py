"""Link by link: mass, centre of mass and inertia with their standard errors, and what can be known of each."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from casysid.arrays import Array, frozen
from casysid.identifiability import Identifiability
from casysid.identification.sources import Excitation, Sources
from casysid.uncertainty import PARAMETER_OF_INERTIA, link_quantities


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
        excitation: Of the same: whether these recordings show it.
        by_data: Of the same: the share that the data decided and not the model file, shape (10,).
    """

    name: str
    mass: float
    center_of_mass: Array
    inertia: Array
    mass_std: float
    center_of_mass_std: Array
    inertia_std: Array
    identifiable: tuple[Identifiability, ...]
    excitation: tuple[Excitation, ...]
    by_data: Array

    def to_json(self) -> dict[str, object]:
        """Plain numbers and lists."""
        return {
            "mass": self.mass,
            "center_of_mass": self.center_of_mass.tolist(),
            "inertia": self.inertia.tolist(),
            "std": {
                "mass": self.mass_std,
                "center_of_mass": self.center_of_mass_std.tolist(),
                "inertia": self.inertia_std.tolist(),
            },
            "identifiable": _by_quantity([one.value for one in self.identifiable]),
            "excited": _by_quantity([one.value for one in self.excitation]),
            "decided_by_data": _by_quantity(self.by_data.tolist()),
        }


def _by_quantity(values: list[Any]) -> dict[str, Any]:
    """What is said of the ten parameters under the names of the quantities that they stand for."""
    return {
        "mass": values[0],
        "center_of_mass": values[1:4],
        "inertia": [values[k] for k in PARAMETER_OF_INERTIA],
    }


def link_properties(name: str, parameters: Array, std: Array, sources: Sources) -> LinkProperties:
    """One link from its ten parameters, the standard errors of its quantities, (10,) each, and what decided them."""
    quantities = link_quantities(parameters[None])[0]
    return LinkProperties(
        name=name,
        mass=float(quantities[0]),
        center_of_mass=frozen(quantities[1:4]),
        inertia=frozen(quantities[4:]),
        mass_std=float(std[0]),
        center_of_mass_std=frozen(std[1:4]),
        inertia_std=frozen(std[4:]),
        identifiable=sources.identifiable,
        excitation=sources.excitation,
        by_data=sources.by_data,
    )
