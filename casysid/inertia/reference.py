"""Reference bodies: the change of coordinates in which a link is a body of about unit size.

Links differ by orders of magnitude, and so do a link's mass and inertia. With a reference pseudo-inertia ``A Aᵀ`` near
the model file's, ``P = A P' Aᵀ`` turns a link into one of about unit size, whatever the robot, its frames and units.
There the distance of two bodies is ``‖P' - P'_0‖`` (Frobenius): the constant pull-back of the affine-invariant metric,
which does not depend on the choice of link frames and is the divergences' second order.

Source: Lee and Park (2018), *A Geometric Algorithm for Robust Multibody Inertial Parameter Identification*;
Lee, Wensing and Park (2020), *Geometric Robot Dynamic Identification: A Convex Programming Approach*.
"""

from __future__ import annotations

import numpy as np

from casysid.arrays import Array, frozen
from casysid.inertia.parameters import (
    CONSISTENCY_BASIS,
    Consistency,
    is_consistent,
    mass_properties,
    parameters_from_pseudo_inertia,
    pseudo_inertia,
)
from casysid.inertia.virtual import parameters_from_virtual, virtual_from_parameters

LIGHTEST = 1e-2
"""A link's reference mass is at least this fraction of the robot's mean."""
SMALLEST = 0.1
"""A link's reference radius of gyration is at least this fraction of the robot's median."""
NEGLIGIBLE = 1e-12, 1e-6
"""Masses [kg] and radii of gyration [m] below these are rounding and say nothing."""
NOTHING_KNOWN = (1.0, 0.1)
"""Reference mass [kg] and radius of gyration [m] where nothing is known."""
ROUNDED = 1e-6
"""Relative eigenvalues this far below zero are a model file's decimals."""


def reference_sizes(bodies: Array) -> tuple[Array, Array]:
    """Reference mass and radius of gyration of each body of shape (n, 10): (n,) and (n,), none of them zero."""
    mass = np.where(bodies[:, 0] > NEGLIGIBLE[0], bodies[:, 0], 0.0)
    spread = np.trace(mass_properties(bodies).inertia, axis1=1, axis2=2) / 6.0  # tr Σ / 3 about the centre of mass
    square = np.divide(spread, mass, out=np.zeros_like(mass), where=(mass > 0.0) & (spread > 0.0))
    mean_mass = np.mean(mass) if mass.any() else NOTHING_KNOWN[0]
    radius = np.where(square > NEGLIGIBLE[1] ** 2, np.sqrt(square), 0.0)
    median_radius = np.median(radius[radius > 0.0]) if radius.any() else NOTHING_KNOWN[1]
    return np.maximum(mass, LIGHTEST * mean_mass), np.maximum(radius, SMALLEST * median_radius)


def ball_factor(body: Array, mass: float, radius: float) -> Array:
    """``A`` of a ball of the given mass and radius of gyration at the body's centre of mass, if that means anything."""
    A = np.diag([radius, radius, radius, 1.0])
    if body[0] > LIGHTEST * mass and is_consistent(body, Consistency.INERTIA, tolerance=ROUNDED):
        A[:3, 3] = mass_properties(body).center_of_mass
    return np.asarray(np.sqrt(mass) * A)


def reference_factor(body: Array, mass: float, radius: float, ball: float) -> Array:
    """``A`` of a consistent body's own pseudo-inertia with a share of a ball, upper triangular, shape (4, 4).

    Args:
        body: Shape (10,).
        mass: Of the ball [kg].
        radius: Its radius of gyration [m].
        ball: Its share, so that flat bodies do not divide by zero.
    """
    A = ball_factor(body, mass, radius)
    reference = pseudo_inertia(body) + ball * A @ A.T
    return np.asarray(np.linalg.cholesky(reference[::-1, ::-1])[::-1, ::-1])


def congruence(factor: Array) -> Array:
    """``T`` of ``P = A P' Aᵀ`` on parameters, shape (10, 10)."""
    return parameters_from_pseudo_inertia(factor @ CONSISTENCY_BASIS[Consistency.FULL] @ factor.T).T


def frobenius_factor() -> Array:
    """``F``: ``‖F φ‖`` is the Frobenius norm of the pseudo-inertia of ``φ``, shape (10, 10)."""
    row, column = np.triu_indices(4)
    weight = np.where(row == column, 1.0, np.sqrt(2.0))
    return np.asarray(CONSISTENCY_BASIS[Consistency.FULL][:, row, column] * weight).T


def nearest_consistent(bodies: Array, consistency: Consistency = Consistency.FULL) -> Array:
    """The bodies (n, 10), those that are inconsistent without the negative part of their pseudo-inertia."""
    broken = ~is_consistent(bodies, consistency)
    if not broken.any():
        return bodies
    result = bodies.copy()
    sizes = np.column_stack(reference_sizes(bodies))
    for link in np.flatnonzero(broken):
        scale = congruence(ball_factor(bodies[link], *sizes[link]))
        unit = np.linalg.solve(scale, bodies[link])
        result[link] = scale @ parameters_from_virtual(virtual_from_parameters(unit))
    return result


def relative_covariance(bodies: Array, ball: float = 1.0) -> Array:
    """Covariance of bodies whose pseudo-inertias are off by their own size in all directions alike.

    Bodies of this covariance about the given ones are alike in every frame: mass, centre of mass and inertia are wrong
    together as real bodies are, a heavy long link by more than a light short one.

    Args:
        bodies: The given ones, shape (n, 10); inconsistent ones are mended first.
        ball: Share of a ball of the body's mass and size in what its errors are measured by.

    Returns:
        Shape (n, 10, 10), regular.
    """
    F = np.linalg.inv(frobenius_factor())
    sound = nearest_consistent(bodies)
    sizes = zip(sound, *reference_sizes(sound), strict=True)
    roots = [congruence(reference_factor(*body_and_size, ball)) @ F for body_and_size in sizes]
    return frozen([root @ root.T for root in roots] if roots else np.zeros((0, 10, 10)))
