"""Coordinates in which the prior's links are bodies of about unit size.

With the prior's links as references (:mod:`casysid.inertia.reference`) a link is one of about unit size. Distance to
the prior is measured there, ``‖P' - P'_prior‖`` (Frobenius), the constant pull-back of the affine-invariant metric.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from casysid.arrays import Array, frozen
from casysid.errors import CasysidWarning
from casysid.inertia import (
    ROUNDED,
    Consistency,
    ball_factor,
    congruence,
    frobenius_factor,
    is_consistent,
    nearest_consistent,
    parameters_from_pseudo_inertia,
    parameters_from_virtual,
    reference_factor,
    reference_sizes,
    smallest_eigenvalue,
    virtual_from_parameters,
)
from casysid.projection.knowledge import Constraints
from casysid.projection.layout import Layout
from casysid.projection.misfit import DataMisfit

BALL = 0.1
"""Share of a ball of the link's mass and size in its reference, so that flat links do not divide by zero."""
LOUDEST = 100.0
"""Effects of a single parameter are not believed to exceed the residuals by more than this factor."""
UNIT_BODY = frozen(parameters_from_pseudo_inertia(np.eye(4)))
"""Parameters of the body whose pseudo-inertia is the unit matrix."""


@dataclass(frozen=True, eq=False)
class Frame:
    """The change of coordinates ``θ = T φ``, and the prior in both.

    Attributes:
        transform: ``T``, shape (p, p), ten by ten blocks and a diagonal.
        prior: ``θ_0``, consistent, at or above the floor, shape (p,).
        scaled_prior: ``φ_0``, shape (p,).
        strain: ``F``: ``‖F (φ - φ_0)‖`` is the distance to the prior, shape (p, p).
    """

    transform: Array
    prior: Array
    scaled_prior: Array
    strain: Array

    def __post_init__(self) -> None:
        for name in ("transform", "prior", "scaled_prior", "strain"):
            object.__setattr__(self, name, frozen(getattr(self, name)))


def frame_of(
    layout: Layout, constraints: Constraints, misfit: DataMisfit, prior: Array, consistency: Consistency, floor: float
) -> Frame:
    """Coordinates and a consistent prior; warns when the prior had to be changed for that."""
    bodies = _nearest_consistent(layout, constraints, prior, consistency)
    factors = [_reference(*row, consistency) for row in zip(bodies, *reference_sizes(bodies), strict=True)]
    blocks = [congruence(factor) for factor in factors]
    scalars = _scales(misfit, prior)[layout.inertial :]
    transform = block_diag(*blocks, np.diag(scalars))
    scaled = np.linalg.solve(transform, np.concatenate([bodies.ravel(), prior[layout.inertial :]]))
    scaled = np.where(constraints.kept, scaled, feasible(layout, scaled, consistency, floor))
    strain = block_diag(*[frobenius_factor()] * len(blocks), np.eye(len(scalars)))
    return Frame(transform, np.where(constraints.kept, prior, transform @ scaled), scaled, strain)


def feasible(layout: Layout, scaled: Array, consistency: Consistency, floor: float) -> Array:
    """Scaled parameters (p,) that are nearly consistent made so, by adding the least share of a unit body."""
    result = scaled.copy()
    bodies = result[: layout.inertial].reshape(-1, 10)
    lacking = np.maximum(-smallest_eigenvalue(bodies - floor * UNIT_BODY, consistency), 0.0)
    bodies += lacking[:, None] * UNIT_BODY
    single = list(layout.non_negative)
    result[single] = np.maximum(result[single], 0.0)
    return result


def clipped(layout: Layout, scaled: Array, floor: float) -> Array:
    """The nearest scaled parameters (p,) whose pseudo-inertias and single numbers are at or above the floor."""
    result = scaled.copy()
    bodies = result[: layout.inertial].reshape(-1, 10)
    bodies[:] = _without_negatives(bodies - floor * UNIT_BODY) + floor * UNIT_BODY
    single = list(layout.non_negative)
    result[single] = np.maximum(result[single], floor)
    return result


def _without_negatives(bodies: Array) -> Array:
    """The nearest bodies whose pseudo-inertia has no negative eigenvalue."""
    return parameters_from_virtual(virtual_from_parameters(bodies))


def _nearest_consistent(layout: Layout, constraints: Constraints, prior: Array, consistency: Consistency) -> Array:
    """The prior's links (n, 10), those that are inconsistent replaced by the nearest that are."""
    bodies = prior[: layout.inertial].reshape(-1, 10)
    broken = ~is_consistent(bodies, consistency, tolerance=ROUNDED)
    negative = [place for place in layout.non_negative if prior[place] < 0.0]
    if broken.any() or negative:
        names = [layout.links[link] for link in np.flatnonzero(broken)] + [layout.names[place] for place in negative]
        kept = constraints.kept[: layout.inertial : 10] & broken
        warnings.warn(
            f"projection: the prior is not physically consistent at {', '.join(names)}; the nearest consistent values "
            f"take its place{', but links to be kept stay as they are' if kept.any() else ''}",
            CasysidWarning,
            stacklevel=6,
        )
    return nearest_consistent(bodies, consistency)


def _reference(body: Array, mass: float, radius: float, consistency: Consistency) -> Array:
    """``A`` of the link's reference: the prior's and some of a ball, or a ball alone where shears are not allowed."""
    if consistency is not Consistency.FULL:
        return ball_factor(body, mass, radius)
    return reference_factor(body, mass, radius, BALL)


def _scales(misfit: DataMisfit, prior: Array) -> Array:
    """A size for every single parameter: of the prior, the estimate, and what would double the residual energy."""
    strength = np.linalg.norm(misfit.seen, axis=0)
    doubling = np.divide(1.0, strength, out=np.zeros_like(strength), where=strength > 0.0)
    estimate = np.clip(np.abs(misfit.minimum), doubling, LOUDEST * doubling)
    size = np.maximum(np.abs(prior), estimate)
    return np.where(size > 0.0, size, 1.0)
