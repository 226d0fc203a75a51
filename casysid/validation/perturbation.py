"""A machine that is not quite what its file says: the hidden truth of a rehearsal.

Every link's pseudo-inertia ``P = U Uᵀ`` becomes ``U (1 + E) (1 + E)ᵀ Uᵀ`` with a random ``E``: consistent whatever
``E`` is, and of the same relative size for a shoulder and an eye, whatever the frames. Friction and rotors, which
cannot be negative, are multiplied by log-normal factors.
"""

from __future__ import annotations

import numpy as np

from casysid.arrays import Array, frozen
from casysid.errors import ParameterError
from casysid.inertia import (
    parameters_from_pseudo_inertia,
    parameters_from_virtual,
    pseudo_inertia,
    virtual_from_parameters,
)
from casysid.robot import Robot
from casysid.simulation import Mechanics
from casysid.simulation.truth import true_parameters
from casysid.threads import single_threaded

FLATTEST = 1e-3
"""Share of its mean square radius that a link has at least in every direction: a flat or point-like link is no body."""


@single_threaded()
def hidden_truth(
    robot: Robot, mechanics: Mechanics, seed: int, *, inertia_spread: float = 0.1, friction_spread: float = 0.3
) -> Array:
    """Parameters of a machine that differs from its file, in the order of the default regressor, shape (p,).

    Args:
        robot: Links that no body can have are first replaced by the nearest that some can; massless ones stay so.
        mechanics: Friction and armature where the file has none.
        seed: Of the draw.
        inertia_spread: Standard deviation of ``E``; masses then differ by about twice as much.
        friction_spread: Standard deviation of the logarithm of friction and armature factors.

    Raises:
        ParameterError: A spread is negative.
    """
    if not (inertia_spread >= 0.0 and friction_spread >= 0.0):
        raise ParameterError(
            f"hidden truth: spreads must be numbers from 0 up; got {inertia_spread} and {friction_spread}"
        )
    rng = np.random.default_rng([seed, 0x7275])
    theta = np.array(true_parameters(robot, mechanics))
    width = robot.inertial_parameters.size
    theta[:width] = _perturbed_links(theta[:width].reshape(-1, 10), rng, inertia_spread).ravel()
    viscous, coulomb, _, armature = theta[width:].reshape(4, -1)
    for values in (viscous, coulomb, armature):
        values *= np.exp(friction_spread * rng.normal(size=values.shape))
    return frozen(theta)


def _perturbed_links(links: Array, rng: np.random.Generator, spread: float) -> Array:
    consistent = pseudo_inertia(parameters_from_virtual(virtual_from_parameters(links)))
    consistent[:, :3, :3] += FLATTEST * np.trace(consistent[:, :3, :3], axis1=1, axis2=2)[:, None, None] * np.eye(3)
    values, vectors = np.linalg.eigh(consistent)
    factor = vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :]
    factor = factor @ (np.eye(4) + spread * rng.normal(size=(len(links), 4, 4)))
    return parameters_from_pseudo_inertia(factor @ np.swapaxes(factor, 1, 2))
