"""A simulated arm in MuJoCo that picks something up while its model is identified on line."""

from dataclasses import replace

import mujoco
import numpy as np
from simulated_arm import ROBOT, record

import casysid
from casysid.inertia import inertial_parameters

RATE, MASS = 500.0, 0.8  # [Hz], [kg]
body = inertial_parameters(MASS, [0.05, -0.03, 0.0], np.diag([2e-3, 3e-3, 4e-3]))
start = casysid.identify(ROBOT, record(seed=0), casysid.Settings(choose_friction=False))
model = start.model
parameters = model.parameters.copy()
last = ROBOT.inertial_parameters.size
parameters[last - 10 : last] += body
bare, loaded = model.mujoco(), replace(model, parameters=parameters).mujoco()
for machine in (bare, loaded):
    machine.opt.timestep = 1.0 / RATE

online, data = casysid.Online(ROBOT, start), mujoco.MjData(bare)
rng, picked, noticed = np.random.default_rng(0), 16.0, None
for step in range(int(26.0 * RATE)):
    time = step / RATE
    machine = bare if time < picked else loaded
    wanted = np.array(
        [0.8 * np.sin(1.3 * time) + 0.3 * np.sin(4.1 * time), np.sin(1.9 * time) + 0.3 * np.sin(5.3 * time)]
    )
    data.ctrl[:] = model.gravity(data.qpos) + 60.0 * (wanted - data.qpos) - 6.0 * data.qvel
    position = data.qpos + 1e-5 * rng.normal(size=2)
    for event in online.add(time, position, data.ctrl + 0.02 * rng.normal(size=2)):
        print(event)
        noticed = noticed or event.noticed
    mujoco.mj_step(machine, data)
held = online.held
print(f"holds {held.mass:.3f} kg ± {held.mass_std:.3f}, true {MASS}; the model is {online.verdict.headline}")
assert noticed is not None
assert noticed - picked < 2.0
assert abs(held.mass - MASS) < 0.1
