"""What a drive adds to the rigid bodies: friction, offset, rotor inertia, springs; each kind in a file of its own."""

from casysid.dynamics.friction.direction import (
    Coupling,
    Direction,
    coupling_direction,
    force_unit,
    joint_directions,
)
from casysid.dynamics.friction.kind import DriveState, FrictionColumn, FrictionKind, JointUse, Law, Term
from casysid.dynamics.friction.kinds import (
    DEFAULT_FRICTION,
    FRICTION_KINDS,
    Armature,
    AsymmetricViscous,
    Coulomb,
    CoulombRipple,
    Counterweight,
    LoadedCoulomb,
    Offset,
    PowerViscous,
    Ripple,
    Spring,
    Stribeck,
    Viscous,
)
from casysid.dynamics.friction.model import FrictionModel
from casysid.dynamics.friction.smooth_sign import SmoothSign, with_width

__all__ = [
    "DEFAULT_FRICTION",
    "FRICTION_KINDS",
    "Armature",
    "AsymmetricViscous",
    "Coulomb",
    "CoulombRipple",
    "Counterweight",
    "Coupling",
    "Direction",
    "DriveState",
    "FrictionColumn",
    "FrictionKind",
    "FrictionModel",
    "JointUse",
    "Law",
    "LoadedCoulomb",
    "Offset",
    "PowerViscous",
    "Ripple",
    "SmoothSign",
    "Spring",
    "Stribeck",
    "Term",
    "Viscous",
    "coupling_direction",
    "force_unit",
    "joint_directions",
    "with_width",
]
