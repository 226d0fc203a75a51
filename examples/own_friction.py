"""A kind of friction of one's own, offered to every joint, in the model, its files and its C code."""

import dataclasses
from dataclasses import dataclass
from typing import ClassVar

import casadi as ca
import numpy as np
from simulated_arm import ROBOT, record

import casysid
from casysid.dynamics import DEFAULT_FRICTION, FRICTION_KINDS, FrictionColumn


@dataclass(frozen=True)
class Drag(FrictionColumn):
    """Torque against motion that grows with the square of speed: a fan, a float, a stirrer."""

    kind: ClassVar[str] = "drag"
    non_negative: ClassVar[bool] = True

    def unit(self, direction):
        """Of the parameter."""
        return "N m s^2"

    def torque(self, direction, state):
        """For a parameter of one, a CasADi expression."""
        return state.velocity * ca.fabs(state.velocity)


recording = record(seed=0)
extra = 0.5 * recording.velocity * np.abs(recording.velocity)  # as if the arm were under water
recording = dataclasses.replace(recording, torque=recording.torque + extra)

settings = casysid.Settings(friction=(*DEFAULT_FRICTION, Drag()), choose_friction=False)
result = casysid.identify(ROBOT, recording, settings)
print("drag:", result.drive_vector("drag"), "N m s²/rad², true 0.5")
assert np.allclose(result.drive_vector("drag"), 0.5, atol=0.1)

casysid.write_result(result, "run")
model = casysid.read_result("run", kinds=(*FRICTION_KINDS, Drag)).model
assert np.array_equal(model.parameters, result.parameters)
