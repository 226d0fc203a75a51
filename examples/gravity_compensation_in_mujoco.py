"""Hold an arm against gravity with the identified model, in MuJoCo, where the true arm is simulated."""

import mujoco
import numpy as np
from simulated_arm import ROBOT, record

import casysid

model = casysid.identify(ROBOT, record(seed=0)).model
machine = model.mujoco()  # a simulator of one's own: the identified arm, armature and friction set
print(*model.simulator_notes(), sep="\n")

data = mujoco.MjData(machine)
data.qpos[:] = start = np.array([0.7, -0.4])
for _ in range(2000):
    data.ctrl[:] = model.gravity(data.qpos)
    mujoco.mj_step(machine, data)
held = np.abs(data.qpos - start).max()

data.qpos[:], data.qvel[:], data.ctrl[:] = start, 0.0, 0.0
for _ in range(2000):
    mujoco.mj_step(machine, data)
fallen = np.abs(data.qpos - start).max()
print(f"after 2 s: held within {held:.4f} rad; without compensation it fell by {fallen:.2f} rad")
assert held < 0.01 < 0.3 < fallen
