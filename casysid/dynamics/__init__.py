"""Symbolic kinematics and dynamics, the regressor with friction, and their evaluation in bulk."""

from casysid.dynamics.bulk import Bulk
from casysid.dynamics.friction import (
    DEFAULT_FRICTION,
    Armature,
    Coulomb,
    Coupling,
    Direction,
    FrictionColumn,
    Offset,
    Viscous,
)
from casysid.dynamics.functions import Dynamics, build_dynamics, generate_c
from casysid.dynamics.regressor import Parameter, Regressor, build_regressor

__all__ = [
    "DEFAULT_FRICTION",
    "Armature",
    "Bulk",
    "Coulomb",
    "Coupling",
    "Direction",
    "Dynamics",
    "FrictionColumn",
    "Offset",
    "Parameter",
    "Regressor",
    "Viscous",
    "build_dynamics",
    "build_regressor",
    "generate_c",
]
