"""From a model file and two recordings to a model with error bars, and back from its folder."""

import numpy as np
from simulated_arm import ROBOT, record

import casysid

train, test = record(seed=0), record(seed=1)  # yours: casysid.read_recording("log.csv", robot)
result = casysid.identify(ROBOT, train, held_out=[test])
print(result)
casysid.write_result(result, "run")

model = casysid.read_result("run").model
torque, error = model.torque(q=[0.3, -0.5], v=[0.2, 0.1], a=[1.0, 0.0], std=True)
for name, value, std in zip(ROBOT.dofs, torque, error, strict=True):
    print(f"{name}: {value:.3f} ± {std:.3f} N m")
assert np.isfinite(error).all()
assert result.held_out.relative < result.file.relative
