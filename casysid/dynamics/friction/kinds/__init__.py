"""Every kind of friction in a file of its own."""

from casysid.dynamics.friction.kind import FrictionKind
from casysid.dynamics.friction.kinds.armature import Armature
from casysid.dynamics.friction.kinds.asymmetric_viscous import AsymmetricViscous
from casysid.dynamics.friction.kinds.coulomb import Coulomb
from casysid.dynamics.friction.kinds.coulomb_ripple import CoulombRipple
from casysid.dynamics.friction.kinds.counterweight import Counterweight
from casysid.dynamics.friction.kinds.loaded_coulomb import LoadedCoulomb
from casysid.dynamics.friction.kinds.offset import Offset
from casysid.dynamics.friction.kinds.power_viscous import PowerViscous
from casysid.dynamics.friction.kinds.ripple import Ripple
from casysid.dynamics.friction.kinds.spring import Spring
from casysid.dynamics.friction.kinds.stribeck import Stribeck
from casysid.dynamics.friction.kinds.viscous import Viscous

DEFAULT_FRICTION: tuple[FrictionKind, ...] = (Viscous(), Coulomb(), Offset(), Armature())
FRICTION_KINDS: tuple[type[FrictionKind], ...] = (
    Viscous, Coulomb, Offset, Armature,
    AsymmetricViscous, Stribeck, PowerViscous, LoadedCoulomb, Spring, Counterweight, Ripple, CoulombRipple,
)  # fmt: skip
"""All that the data may ask for and files may hold, in the order in which candidates are proposed."""

__all__ = [
    "DEFAULT_FRICTION",
    "FRICTION_KINDS",
    "Armature",
    "AsymmetricViscous",
    "Coulomb",
    "CoulombRipple",
    "Counterweight",
    "LoadedCoulomb",
    "Offset",
    "PowerViscous",
    "Ripple",
    "Spring",
    "Stribeck",
    "Viscous",
]
