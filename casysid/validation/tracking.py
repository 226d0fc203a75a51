"""How well a robot tracks under the parameters that its controller believes in (Ting et al. 2006, §IV-B, Table I)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from casysid.arrays import Array, frozen
from casysid.simulation import ControlModel, RunStatus, SimulatedRun
from casysid.simulation.controllers import PD, ComputedTorque
from casysid.simulation.plant import Plant
from casysid.simulation.reference import Trajectory
from casysid.simulation.run import simulate
from casysid.threads import single_threaded

MEASURES = ("position", "velocity", "feedback")


@dataclass(frozen=True, eq=False, kw_only=True)
class Tracking:
    """Root mean squares over a run, by degree of freedom.

    Attributes:
        position: Of ``q_ref - q``, the true one, shape (nv,), [rad, m].
        velocity: Of ``v_ref - v``, the true one, shape (nv,), [rad/s, m/s].
        feedback: Of what the tracking error asked for, shape (nv,), [N m, N].
        completed: Whether the robot got to the end; otherwise the figures are of the part before.
    """

    position: Array
    velocity: Array
    feedback: Array
    completed: bool

    def __post_init__(self) -> None:
        for name in MEASURES:
            object.__setattr__(self, name, frozen(getattr(self, name)))

    def means(self) -> dict[str, float]:
        """Averages over the degrees of freedom, as in the paper's tables; infinite when the robot ran away."""
        return {name: float(np.mean(getattr(self, name))) if self.completed else np.inf for name in MEASURES}

    def to_json(self, dofs: tuple[str, ...]) -> dict[str, object]:
        """On average and by degree of freedom."""
        content: dict[str, object] = {"completed": self.completed, "mean": self.means()}
        return content | {name: dict(zip(dofs, getattr(self, name).tolist(), strict=True)) for name in MEASURES}


@single_threaded()
def track(
    plant: Plant, model: ControlModel, gains: PD, trajectory: Trajectory, *, rate: float, duration: float, seed: int = 0
) -> SimulatedRun:
    """The plant under computed torque by a model; arguments as for :func:`~casysid.simulation.simulate`."""
    return simulate(plant, ComputedTorque(model, gains), trajectory, rate=rate, duration=duration, seed=seed)


@single_threaded()
def measure_tracking(plant: Plant, run: SimulatedRun) -> Tracking:
    """Tracking errors of a plant's run, against the truth."""
    return Tracking(
        position=_rms(position_error(plant, run)),
        velocity=_rms(run.reference.v - run.v),
        feedback=_rms(run.feedback),
        completed=run.status is RunStatus.COMPLETED,
    )


def position_error(plant: Plant, run: SimulatedRun) -> Array:
    """``q_ref - q`` along the degrees of freedom, shape (N, nv), [rad, m]."""
    if plant.coordinates.plain:
        return np.asarray(run.reference.q - run.q)
    error = plant.coordinates.error
    return np.array([error(q, target) for q, target in zip(run.q, run.reference.q, strict=True)])


def _rms(values: Array) -> Array:
    return np.asarray(np.sqrt(np.mean(values**2, axis=0)))
