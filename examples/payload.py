"""What an arm holds: recordings without it and with it, of different motions."""

from simulated_arm import ROBOT, record

import casysid
from casysid.inertia import inertial_parameters

TRUE_MASS = 0.8
body = inertial_parameters(TRUE_MASS, [0.05, -0.03, 0.0], [[2e-3, 0, 0], [0, 3e-3, 0], [0, 0, 4e-3]])
theta = ROBOT.inertial_parameters.copy()
theta[-10:] += body  # at the last link
holding = ROBOT.with_parameters(inertial_parameters=theta)

(payload,) = casysid.identify_payload(ROBOT, with_payload=record(1, holding), without=record(0)).payloads
print(payload)
print("centre of mass [mm]:", 1e3 * payload.center_of_mass, "±", 1e3 * payload.center_of_mass_std)
low, high = payload.mass_interval
assert low < TRUE_MASS < high
