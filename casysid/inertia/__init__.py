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
from casysid.inertia.reference import (
    ROUNDED,
    ball_factor,
    congruence,
    frobenius_factor,
    nearest_consistent,
    reference_factor,
    reference_sizes,
    relative_covariance,
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
    "ROUNDED",
    "SIGNLESS",
    "Consistency",
    "MassProperties",
    "ball_factor",
    "congruence",
    "consistency_matrix",
    "frobenius_factor",
    "inertial_parameters",
    "is_consistent",
    "mass_properties",
    "nearest_consistent",
    "parameters_from_pseudo_inertia",
    "parameters_from_virtual",
    "pseudo_inertia",
    "reference_factor",
    "reference_sizes",
    "relative_covariance",
    "smallest_eigenvalue",
    "symbolic_parameters_from_virtual",
    "virtual_from_parameters",
]
