"""One rigid body, pure mathematics: inertial parameters, consistency, virtual parameters."""

from casysid.inertia.parameters import (
    CONSISTENCY_BASIS,
    KINDS,
    Consistency,
    MassProperties,
    consistency_matrix,
    inertial_parameters,
    is_consistent,
    mass_properties,
    parameters_from_pseudo_inertia,
    pseudo_inertia,
    smallest_eigenvalue,
)
from casysid.inertia.virtual import (
    SIGNLESS,
    parameters_from_virtual,
    symbolic_parameters_from_virtual,
    virtual_from_parameters,
)

__all__ = [
    "CONSISTENCY_BASIS",
    "KINDS",
    "SIGNLESS",
    "Consistency",
    "MassProperties",
    "consistency_matrix",
    "inertial_parameters",
    "is_consistent",
    "mass_properties",
    "parameters_from_pseudo_inertia",
    "parameters_from_virtual",
    "pseudo_inertia",
    "smallest_eigenvalue",
    "symbolic_parameters_from_virtual",
    "virtual_from_parameters",
]
