"""True friction: terms that are linear in one coefficient each, and what it takes to know them.

A term acts along a direction of the joints: along one joint, or for the motors of a coupled wrist along the sum or the
difference of two. Its shape may depend on numbers that an oracle is told, and on the history of the motion.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from population.motions import State
from population.rigid import RigidBodies


@dataclass(frozen=True, eq=False, kw_only=True)
class Term:
    """Torque ``c w f(s, ṡ, s̈)`` along ``s = wᵀ q``.

    Attributes:
        direction: ``w``, shape (nv,).
        coefficient: ``c``.
        effect: For what kind of friction the term stands, one of :data:`population.drives.EFFECTS`, or an ordinary one.
    """

    direction: np.ndarray
    effect: str
    coefficient: float = 1.0

    kind: ClassVar[str]

    @property
    def joints(self) -> tuple[int, ...]:
        """On which it acts."""
        return tuple(np.flatnonzero(self.direction).tolist())

    def column(self, state: State) -> np.ndarray:
        """Torque for a coefficient of one, shape (N, nv)."""
        return np.outer(self.shape(state), self.direction)

    def shape(self, state: State) -> np.ndarray:
        """``f`` over a motion in the order of time, shape (N,)."""
        raise NotImplementedError


@dataclass(frozen=True, eq=False, kw_only=True)
class Viscous(Term):
    """``ṡ``."""

    kind: ClassVar[str] = "viscous"

    def shape(self, state: State) -> np.ndarray:
        """See the class."""
        return state.v @ self.direction


@dataclass(frozen=True, eq=False, kw_only=True)
class Offset(Term):
    """One."""

    kind: ClassVar[str] = "offset"

    def shape(self, state: State) -> np.ndarray:
        """See the class."""
        return np.ones(len(state.v))


@dataclass(frozen=True, eq=False, kw_only=True)
class Armature(Term):
    """``s̈``."""

    kind: ClassVar[str] = "armature"

    def shape(self, state: State) -> np.ndarray:
        """See the class."""
        return state.a @ self.direction


@dataclass(frozen=True, eq=False, kw_only=True)
class Asymmetric(Term):
    """``|ṡ|``."""

    kind: ClassVar[str] = "viscous_asymmetry"

    def shape(self, state: State) -> np.ndarray:
        """See the class."""
        return np.abs(state.v @ self.direction)


@dataclass(frozen=True, eq=False, kw_only=True)
class Coulomb(Term):
    """``tanh(ṡ / width)``."""

    width: float

    kind: ClassVar[str] = "coulomb"

    def shape(self, state: State) -> np.ndarray:
        """See the class."""
        return np.tanh(state.v @ self.direction / self.width)


@dataclass(frozen=True, eq=False, kw_only=True)
class Stribeck(Coulomb):
    """``tanh(ṡ / width) exp(-(ṡ / slow)²)``."""

    slow: float

    kind: ClassVar[str] = "stribeck"

    def shape(self, state: State) -> np.ndarray:
        """See the class."""
        return super().shape(state) * np.exp(-((state.v @ self.direction / self.slow) ** 2))


@dataclass(frozen=True, eq=False, kw_only=True)
class Load(Coulomb):
    """``|load| tanh(ṡ / width)``, the load being the true gravity torque, or all of the rigid bodies' torque."""

    bodies: RigidBodies = field(repr=False)
    parameters: np.ndarray = field(repr=False)
    gravity_only: bool

    kind: ClassVar[str] = "loaded_coulomb"

    def shape(self, state: State) -> np.ndarray:
        """See the class."""
        (j,) = self.joints
        if self.gravity_only:
            load = self.bodies.gravity(self.parameters, state.q)
        else:
            load = self.bodies.torque(self.parameters, *state)
        return super().shape(state) * np.abs(load[:, j])


@dataclass(frozen=True, eq=False, kw_only=True)
class Ripple(Term):
    """``sin(k s)`` or ``cos(k s)``."""

    harmonic: float
    quadrature: bool

    kind: ClassVar[str] = "ripple"

    def shape(self, state: State) -> np.ndarray:
        """See the class."""
        angle = self.harmonic * (state.q @ self.direction)
        return np.cos(angle) if self.quadrature else np.sin(angle)


@dataclass(frozen=True, eq=False, kw_only=True)
class Hysteresis(Term):
    """Dry friction with pre-sliding: springs that slip at their yield distances (generalised Maxwell slip).

    Sliding for long, it is Coulomb's sign; after each reversal it comes back over the yield distances. Source:
    Al-Bender, Lampaert and Swevers (2005), without their slip dynamics.

    Attributes:
        yields: Distances at which the elements slip [rad, m].
        shares: Of the elements in the whole, summing to one.
    """

    yields: np.ndarray
    shares: np.ndarray

    kind: ClassVar[str] = "hysteresis"

    def shape(self, state: State) -> np.ndarray:
        """See the class."""
        s = state.q @ self.direction
        steps = np.diff(s, prepend=s[:1])[:, None] / self.yields
        z, found = np.zeros(len(self.yields)), np.empty(len(s))
        for k, step in enumerate(steps):
            z = np.minimum(np.maximum(z + step, -1.0), 1.0)
            found[k] = z @ self.shares
        return found
