"""Small identification problems whose truth is known: a chain of three joints, moved and measured with noise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
import pytest

from casysid.inertia import KINDS, parameters_from_pseudo_inertia, pseudo_inertia
from casysid.moments import Moments, NormalEquations

JOINTS = 3


@dataclass(frozen=True)
class Column:
    """A regressor column, as the projection wants to see it."""

    name: str
    owner: str
    kind: str
    non_negative: bool


@dataclass(frozen=True, eq=False)
class Experiment:
    """A regression problem, its least-squares estimate and everything about it."""

    columns: tuple[Column, ...]
    truth: np.ndarray
    prior: np.ndarray
    estimate: np.ndarray
    equations: NormalEquations
    residual_energy: float
    unseen: np.ndarray  # basis of the null space of the metric, (p, k)


def columns(links: int) -> tuple[Column, ...]:
    """Links, then viscous friction (not negative) and an offset (free) for each joint."""
    bodies = [Column(f"link_{i}.{kind}", f"link_{i}", kind, False) for i in range(links) for kind in KINDS]
    viscous = [Column(f"joint_{i}.viscous", f"joint_{i}", "viscous", True) for i in range(links)]
    offset = [Column(f"joint_{i}.offset", f"joint_{i}", "offset", False) for i in range(links)]
    return (*bodies, *viscous, *offset)


def chain(rng: np.random.Generator) -> pin.Model:
    model = pin.Model()
    for index, joint in enumerate((pin.JointModelRZ(), pin.JointModelRY(), pin.JointModelRX())):
        place = pin.SE3(pin.exp3(0.3 * rng.normal(size=3)), rng.normal(size=3) * 0.2)
        body = model.addJoint(index, joint, place, f"joint_{index}")
        root = 0.05 * rng.normal(size=(3, 3))
        second = root @ root.T + 1e-4 * np.eye(3)
        mass = 3.0 * 0.5**index
        inertia = mass * (np.trace(second) * np.eye(3) - second)
        model.appendBodyToJoint(body, pin.Inertia(mass, 0.1 * rng.normal(size=3), inertia), pin.SE3.Identity())
    return model


def make_experiment(seed: int = 0, noise: float = 0.1, samples: int = 300) -> Experiment:
    """Random motion of a random chain, torque noise as a fraction of each joint's torque, a prior some 25 % off."""
    rng = np.random.default_rng(seed)
    model = chain(rng)
    data = model.createData()
    links = [model.inertias[i].toDynamicParameters() for i in range(1, JOINTS + 1)]
    truth = np.concatenate([*links, rng.uniform(0.0, 0.3, JOINTS), 0.2 * rng.normal(size=JOINTS)])
    rows = np.zeros((samples, JOINTS, len(truth)))
    for k in range(samples):
        q, v, a = rng.uniform(-2, 2, JOINTS), rng.normal(size=JOINTS), 3.0 * rng.normal(size=JOINTS)
        regressor = pin.computeJointTorqueRegressor(model, data, q, v, a)
        rows[k] = np.hstack([regressor, np.diag(v), np.eye(JOINTS)])
    tau = rows @ truth
    std = noise * tau.std(axis=0)
    tau = tau + std * rng.normal(size=tau.shape)
    x, y = (rows / std[:, None]).reshape(-1, len(truth)), (tau / std).ravel()
    shear = np.linalg.cholesky(pseudo_inertia(links)) @ (np.eye(4) + 0.25 * rng.normal(size=(JOINTS, 4, 4)))
    bodies = parameters_from_pseudo_inertia(shear @ shear.transpose(0, 2, 1))
    prior = np.concatenate([bodies.ravel(), rng.uniform(0.1, 0.3, JOINTS), np.zeros(JOINTS)])
    scale = 1.0 / np.linalg.norm(x, axis=0).clip(1e-9)
    estimate = prior + scale * np.linalg.lstsq(x * scale, y - x @ prior, rcond=1e-6)[0]
    _, size, basis = np.linalg.svd(x * scale)
    unseen = scale[:, None] * basis[np.append(size, np.zeros(len(truth) - len(size)))[: len(truth)] < 1e-6 * size[0]].T
    moments = Moments.from_rows(x, y)
    return Experiment(
        columns(JOINTS), truth, prior, estimate, moments.pooled(), float(np.sum((y - x @ estimate) ** 2)), unseen
    )


@pytest.fixture(scope="session")
def experiment() -> Callable[..., Experiment]:
    """Makes experiments, each only once."""
    made: dict[tuple[tuple[str, float], ...], Experiment] = {}

    def make(**settings: float) -> Experiment:
        key = tuple(sorted(settings.items()))
        if key not in made:
            made[key] = make_experiment(**settings)  # type: ignore[arg-type]
        return made[key]

    return make
