"""From a solution of all loadings to one payload: its scatter, the nearest body that can be, and what a scale says."""

from __future__ import annotations

import dataclasses

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array
from casysid.dynamics import Parameter
from casysid.errors import SolverError
from casysid.estimation import Estimate, Status
from casysid.estimation.base import Spread
from casysid.estimation.covariance import RANK_TOLERANCE, covariance_from_blocks
from casysid.inertia import KINDS
from casysid.inertia import inertial_parameters as parameters_of
from casysid.moments import Moments
from casysid.payload.results import Payload, TorqueScale
from casysid.projection import build_projection, project
from casysid.projection.knowledge import link_mass
from casysid.uncertainty import propagate

Indices = npt.NDArray[np.intp]
DENSITY = 2700.0
"""Of aluminium [kg/m³]: held things lie between plastic and steel. It makes the size of the ball that stands for a
payload's own inertia where the recordings do not show it; a density three times as large makes it a radius of .7."""
UNITS = ("kg", *("kg m",) * 3, *("kg m^2",) * 6)


def payload_of(
    moments: Moments,
    weights: Array,
    solution: Array,
    places: Indices,
    *,
    blocks: slice,
    name: str,
    link: str,
    known_mass: float | None,
) -> Payload:
    """One payload of a solution.

    Args:
        moments: Of all loadings, in common columns.
        weights: Of the rows by joint.
        solution: Least squares, shape (p,).
        places: The payload's ten columns.
        blocks: Of its own recordings.
        name: Of the payload.
        link: In whose frame it is.
        known_mass: If it was weighed [kg].

    Raises:
        SolverError: The recordings do not show its mass, or no body is near.
    """
    spread = covariance_from_blocks(moments, solution, weights)
    own = Spread.without_prior(
        spread.covariance[np.ix_(places, places)], spread.hidden[places], spread.scale[places], spread.freedom
    )
    if not own.sees(np.eye(10)[:1])[0]:
        raise SolverError(
            f"payload '{name}': its recordings do not show its mass; move joints whose torque depends on it"
        )
    found, metric, scale = solution[places], _metric(moments.pooled(weights).xx, places), None
    if known_mass is not None:
        scale = TorqueScale(float(found[0]) / known_mass, float(np.sqrt(own.covariance[0, 0])) / known_mass)
        if not scale.value > 0.0:
            raise SolverError(
                f"payload '{name}': its recordings show {found[0]:.3g} kg, so no scale of the torques makes it "
                f"{known_mass:g} kg; look at which recordings are with it and which without"
            )
        change = known_mass * (np.eye(10) / found[0] - np.outer(found, np.eye(10)[0]) / found[0] ** 2)
        own = dataclasses.replace(own, covariance=change @ own.covariance @ change.T)
        found, metric = found / scale.value, metric * scale.value**2
    parameters = [
        Parameter(f"{name}.{kind}", name, kind, unit, False, 0.0) for kind, unit in zip(KINDS, UNITS, strict=True)
    ]
    knowledge = [] if known_mass is None else [link_mass(name, known_mass)]
    problem = build_projection(parameters, knowledge=knowledge)
    energy = float(weights @ moments.residual_energy(solution).sum(axis=0))
    prior = _ball(found, float(np.sqrt(own.covariance[0, 0])))
    projected = project(problem, found, metric, prior, residual_energy=energy)
    estimate = Estimate(
        method="payload",
        parameters=found,
        covariance=own.covariance,
        metric=metric,
        noise_std=weights**-0.5,
        rank=int(own.sees(np.eye(10)).sum()),
        status=Status.CONVERGED,
        spread=own,
    )
    uncertainty = propagate(estimate, moments, parameters, problem, projected, prior, residual_energy=energy)
    return Payload(
        name,
        link,
        uncertainty,
        scale,
        _errors(moments.select_blocks(np.arange(blocks.start, blocks.stop)), weights, solution, places),
    )


def _metric(information: Array, places: Indices) -> Array:
    """Information on the payload alone, (10, 10): what is left once all other columns may follow."""
    others = np.setdiff1d(np.arange(len(information)), places)
    size = np.sqrt(np.maximum(np.diag(information), 0.0))
    unit = np.divide(1.0, size, out=np.zeros_like(size), where=size > 0.0)
    scaled = information * np.outer(unit, unit)
    across = scaled[np.ix_(places, others)]
    left = (
        scaled[np.ix_(places, places)]
        - across @ np.linalg.pinv(scaled[np.ix_(others, others)], rcond=RANK_TOLERANCE, hermitian=True) @ across.T
    )
    values, vectors = np.linalg.eigh(0.5 * (left + left.T))
    positive = (vectors * np.maximum(values, 0.0)) @ vectors.T
    return np.asarray(positive * np.outer(size[places], size[places]))


def _ball(found: Array, error: float) -> Array:
    """A ball of the payload's mass at its centre of mass: what stands for its inertia where nothing shows it."""
    mass = max(float(found[0]), error)
    centre = found[1:4] / mass
    radius = (3.0 * mass / (4.0 * np.pi * DENSITY)) ** (1.0 / 3.0)
    return np.asarray(parameters_of(mass, centre, 0.4 * mass * radius**2 * np.eye(3)))


def _errors(moments: Moments, weights: Array, solution: Array, places: Indices) -> tuple[float, float]:
    """Relative torque error on some recordings without the payload and with it, all joints weighted alike."""
    without = solution.copy()
    without[places] = 0.0
    felt = float(np.sum(moments.target_energy()))
    errors = [float(np.sqrt(np.sum(moments.residual_energy(theta)) / felt)) for theta in (without, solution)]
    return errors[0], errors[1]
