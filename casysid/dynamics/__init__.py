"""Symbolic kinematics and dynamics, the regressor with friction, and their evaluation in bulk."""

from casysid.dynamics.bulk import Bulk
from casysid.dynamics.drive import Parameter
from casysid.dynamics.friction import (
    DEFAULT_FRICTION,
    Armature,
    Coulomb,
    Coupling,
    Direction,
    FrictionColumn,
    Offset,
    SmoothSign,
    Viscous,
    with_width,
)
from casysid.dynamics.friction_kinds import AsymmetricViscous, LoadedCoulomb, PowerViscous, Spring, Stribeck
from casysid.dynamics.functions import Dynamics, build_dynamics, generate_c
from casysid.dynamics.regressor import Regressor, build_regressor, extend_regressor

__all__ = [
    "DEFAULT_FRICTION",
    "Armature",
    "AsymmetricViscous",
    "Bulk",
    "Coulomb",
    "Coupling",
    "Direction",
    "Dynamics",
    "FrictionColumn",
    "LoadedCoulomb",
    "Offset",
    "Parameter",
    "PowerViscous",
    "Regressor",
    "SmoothSign",
    "Spring",
    "Stribeck",
    "Viscous",
    "build_dynamics",
    "build_regressor",
    "extend_regressor",
    "generate_c",
    "with_width",
]
