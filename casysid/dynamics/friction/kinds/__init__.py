"""Every kind of friction in a file of its own."""

from casysid.dynamics.friction.kind import FrictionKind
from casysid.dynamics.friction.kinds.armature import Armature
from casysid.dynamics.friction.kinds.asymmetric_viscous import AsymmetricViscous
from casysid.dynamics.friction.kinds.coulomb import Coulomb
from casysid.dynamics.friction.kinds.coulomb_ripple import CoulombRipple
from casysid.dynamics.friction.kinds.counterweight import Counterweight
from casysid.dynamics.friction.kinds.drift import Drift
from casysid.dynamics.friction.kinds.loaded_coulomb import LoadedCoulomb
from casysid.dynamics.friction.kinds.maxwell_slip import MaxwellSlip
from casysid.dynamics.friction.kinds.offset import Offset
from casysid.dynamics.friction.kinds.power_viscous import PowerViscous
from casysid.dynamics.friction.kinds.random_features import RandomFeatures
from casysid.dynamics.friction.kinds.ripple import Ripple
from casysid.dynamics.friction.kinds.sharp_coulomb import SharpCoulomb
from casysid.dynamics.friction.kinds.spring import Spring
from casysid.dynamics.friction.kinds.stribeck import Stribeck
from casysid.dynamics.friction.kinds.viscous import Viscous

DEFAULT_FRICTION: tuple[FrictionKind, ...] = (Viscous(), Coulomb(), Offset(), Armature())
FRICTION_KINDS: tuple[type[FrictionKind], ...] = (
    Viscous, Coulomb, Offset, Armature,
    AsymmetricViscous, Stribeck, PowerViscous, LoadedCoulomb, Spring, Counterweight, Ripple, CoulombRipple,
    MaxwellSlip, SharpCoulomb, Drift, RandomFeatures,
)  # fmt: skip
"""All that files may hold, in the order in which candidates are proposed."""
PHYSICAL_KINDS = tuple(kind for kind in FRICTION_KINDS if kind.is_physical)
"""Those that the data may ask for unless others are named."""

__all__ = [
    "DEFAULT_FRICTION",
    "FRICTION_KINDS",
    "PHYSICAL_KINDS",
    "Armature",
    "AsymmetricViscous",
    "Coulomb",
    "CoulombRipple",
    "Counterweight",
    "Drift",
    "LoadedCoulomb",
    "MaxwellSlip",
    "Offset",
    "PowerViscous",
    "RandomFeatures",
    "Ripple",
    "SharpCoulomb",
    "Spring",
    "Stribeck",
    "Viscous",
]
