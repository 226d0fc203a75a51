"""Which friction the drives of an experiment have.

One experiment in ten has none. In the others each joint has viscous friction with probability 0.85 (log-uniform 2-40 %
of the rms of the joint's rigid torque), Coulomb friction with 0.85 (3-50 %), a constant torque with 0.4 (1-20 %). Where
Coulomb friction turns is log-uniform 0.002-0.05 of the joint's rms velocity. Beside them 0, 1, 2 or 3 effects of
:data:`EFFECTS` (probabilities 0.35, 0.35, 0.2, 0.1), each on every joint that moves with probability 0.6, at least on
one, log-uniform 2-30 %:

- asymmetry: viscous friction that differs by direction;
- stribeck: more at slow motion, below log-uniform 0.05-0.6 of the rms velocity;
- load: in proportion to the true gravity torque (half of them) or to all of the rigid torque (half);
- ripple: one or two harmonics of the joint's angle, log-uniform 2-60 a radian, or by log-uniform 10-100 mm of travel;
- hysteresis: the joint's Coulomb friction comes back after a reversal over log-uniform 0.1-5 % of its half range, three
  elements with random shares and yield distances in ratio 1:3:10; it takes Coulomb's place and size;
- wrist: two motors drive the sum and the difference of the last two joints, if both turn and one carries the other;
  each has viscous and Coulomb friction.

A joint whose rigid torque is below 2 % of the largest joint's counts with that.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from population.drawing import chance, log_uniform, pick, some
from population.friction import (
    Armature,
    Asymmetric,
    Coulomb,
    Hysteresis,
    Load,
    Offset,
    Ripple,
    Stribeck,
    Term,
    Viscous,
)
from population.mechanisms import Mechanism
from population.motions import State
from population.rigid import RigidBodies

EFFECTS = ("asymmetry", "stribeck", "load", "ripple", "hysteresis", "wrist")
ORDINARY = ("viscous", "coulomb", "offset", "armature")
NO_FRICTION = 0.1
LEAST_TORQUE = 0.02


@dataclass(frozen=True, eq=False)
class Truth:
    """The machine's rigid bodies and drives.

    Attributes:
        bodies: Their kinematics.
        parameters: Inertial, shape (10 nv,).
        terms: Of friction and rotors.
    """

    bodies: RigidBodies
    parameters: np.ndarray
    terms: tuple[Term, ...]

    @property
    def effects(self) -> tuple[str, ...]:
        """Kinds of friction beyond the ordinary ones."""
        return tuple(effect for effect in EFFECTS if any(term.effect == effect for term in self.terms))

    @property
    def without_friction(self) -> bool:
        """Whether there are at most rotors."""
        return all(term.kind == "armature" for term in self.terms)

    def regressor(self, state: State) -> np.ndarray:
        """Of the inertial parameters and the terms' coefficients, shape (N, nv, p)."""
        return regressor(self.bodies, self.terms, state)

    def torque(self, state: State) -> np.ndarray:
        """Torques along a motion in the order of time, shape (N, nv)."""
        rigid = self.bodies.torque(self.parameters, *state)
        return rigid + sum((term.coefficient * term.column(state) for term in self.terms), np.zeros_like(rigid))


def regressor(
    bodies: RigidBodies, terms: Sequence[Term], state: State, keep: np.ndarray | slice = slice(None)
) -> np.ndarray:
    """Columns of bodies and terms at the samples kept of a motion in the order of time, shape (N, nv, p)."""
    rigid = bodies.regressor(*(part[keep] for part in state))
    return np.concatenate([rigid, *(term.column(state)[keep][:, :, None] for term in terms)], axis=2)


def draw_truth(rng: np.random.Generator, mechanism: Mechanism, state: State, *, friction: bool = True) -> Truth:
    """Drives whose friction is in proportion to the rigid torques along a motion."""
    robot = mechanism.robot
    bodies, parameters = RigidBodies(robot), np.array(robot.inertial_parameters)
    rms = np.sqrt(np.mean(bodies.torque(parameters, *state) ** 2, axis=0))
    scale = np.maximum(rms, LEAST_TORQUE * rms.max())
    drawing = _Drawing(rng, mechanism, state, scale, bodies, parameters)
    rotors = zip(np.eye(robot.nv), robot.armature, strict=True)
    terms: list[Term] = [
        Armature(direction=e, effect="armature", coefficient=float(inertia)) for e, inertia in rotors if inertia > 0.0
    ]
    if friction and not chance(rng, NO_FRICTION):
        terms += drawing.ordinary()
        count = pick(rng, {0: 0.35, 1: 0.35, 2: 0.2, 3: 0.1})
        for effect in rng.permutation(EFFECTS)[:count]:
            terms = drawing.with_effect(terms, str(effect))
    return Truth(bodies, parameters, tuple(terms))


@dataclass(frozen=True, eq=False)
class _Drawing:
    rng: np.random.Generator
    mechanism: Mechanism
    state: State
    scale: np.ndarray
    bodies: RigidBodies
    parameters: np.ndarray

    @property
    def moving(self) -> np.ndarray:
        """Joints that move at all."""
        return np.flatnonzero(np.abs(self.state.v).max(axis=0) > 0.0)

    def sized(self, term: Term, low: float, high: float) -> Term:
        """The term with an rms torque of a random share of its joints' scale."""
        size = np.sqrt(np.mean(term.shape(self.state) ** 2))
        share = float(log_uniform(self.rng, low, high)) * self.scale[list(term.joints)].mean()
        return dataclasses.replace(term, coefficient=float(share / size) if size > 0.0 else 0.0)

    def width(self, direction: np.ndarray) -> float:
        """Where Coulomb friction turns along a direction."""
        return float(log_uniform(self.rng, 0.002, 0.05) * np.std(self.state.v @ direction))

    def ordinary(self) -> list[Term]:
        terms: list[Term] = []
        for j, e in enumerate(np.eye(len(self.scale))):
            if chance(self.rng, 0.4):
                offset = self.sized(Offset(direction=e, effect="offset"), 0.01, 0.2)
                terms.append(dataclasses.replace(offset, coefficient=offset.coefficient * self.rng.choice([-1.0, 1.0])))
            if j in self.moving and chance(self.rng, 0.85):
                terms.append(self.sized(Viscous(direction=e, effect="viscous"), 0.02, 0.4))
            if j in self.moving and chance(self.rng, 0.85):
                terms.append(self.sized(Coulomb(direction=e, effect="coulomb", width=self.width(e)), 0.03, 0.5))
        return terms

    def with_effect(self, terms: list[Term], effect: str) -> list[Term]:
        """The terms with one effect more, if the mechanism and the motion allow it."""
        if effect == "wrist":
            return [*terms, *self.wrist()]
        where = [np.eye(len(self.scale))[j] for j in self.moving[some(self.rng, len(self.moving), 0.6)]]
        if effect == "hysteresis":
            return [self.hysteretic(term) if _acts_on(term, where) else term for term in terms]
        return [*terms, *(term for e in where for term in self.along(e, effect))]

    def along(self, e: np.ndarray, effect: str) -> Iterator[Term]:
        """Terms of an effect along one joint."""
        sign = float(self.rng.choice([-1.0, 1.0]))
        match effect:
            case "asymmetry":
                term = self.sized(Asymmetric(direction=e, effect=effect), 0.02, 0.3)
                yield dataclasses.replace(term, coefficient=sign * term.coefficient)
            case "stribeck":
                slow = float(log_uniform(self.rng, 0.05, 0.6) * np.std(self.state.v @ e))
                yield self.sized(Stribeck(direction=e, effect=effect, width=self.width(e), slow=slow), 0.02, 0.3)
            case "load":
                one = Load(
                    direction=e,
                    effect=effect,
                    width=self.width(e),
                    bodies=self.bodies,
                    parameters=self.parameters,
                    gravity_only=chance(self.rng, 0.5),
                )
                yield self.sized(one, 0.02, 0.3)
            case "ripple":
                slides = bool(self.mechanism.sliding @ e)
                for _ in range(self.rng.integers(1, 3)):
                    harmonic = 2.0 * np.pi / log_uniform(self.rng, 0.01, 0.1) if slides else self.rotary_harmonic()
                    for quadrature in (False, True):
                        one = Ripple(direction=e, effect=effect, harmonic=float(harmonic), quadrature=quadrature)
                        yield self.sized(one, 0.01, 0.15)

    def rotary_harmonic(self) -> float:
        """A whole number of ripples a turn of the joint."""
        return float(round(float(log_uniform(self.rng, 2.0, 60.0))))

    def hysteretic(self, term: Term) -> Term:
        """Coulomb friction along a joint made to come back over a distance."""
        reach = self.mechanism.limits.half_range[term.joints[0]] * log_uniform(self.rng, 0.001, 0.05)
        return Hysteresis(
            direction=term.direction,
            effect="hysteresis",
            coefficient=term.coefficient,
            yields=float(reach) * np.array([0.1, 0.3, 1.0]),
            shares=self.rng.dirichlet(np.ones(3)),
        )

    def wrist(self) -> Iterator[Term]:
        """Friction of two motors that drive the sum and the difference of the last two joints."""
        joints, size = self.mechanism.robot.joints, len(self.scale)
        last = size - 1
        fits = size > 1 and joints[last].parent == last - 1 and not self.mechanism.sliding[-2:].any()
        if not fits or not {last - 1, last} <= set(self.moving.tolist()):
            return
        for sign in (1.0, -1.0):
            e = np.zeros(size)
            e[-2:] = 1.0, sign
            yield self.sized(Viscous(direction=e, effect="wrist"), 0.02, 0.2)
            yield self.sized(Coulomb(direction=e, effect="wrist", width=self.width(e)), 0.02, 0.2)


def _acts_on(term: Term, where: list[np.ndarray]) -> bool:
    return type(term) is Coulomb and any((term.direction == e).all() for e in where)
