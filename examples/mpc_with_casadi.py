"""The identified model in an optimiser: a motion of least torque between two poses, friction included."""

import casadi as ca
import numpy as np
from simulated_arm import ROBOT, record

import casysid

result = casysid.identify(ROBOT, record(seed=0), casysid.Settings(choose_friction=False))
dynamics = result.model.casadi.forward_dynamics  # (q, v, tau) -> a, to be differentiated as often as wanted

N, T, limit = 30, 1.0, 40.0
h = T / N
problem = ca.Opti()
q, v, tau = problem.variable(2, N + 1), problem.variable(2, N + 1), problem.variable(2, N)
for k in range(N):
    a = dynamics(q[:, k], v[:, k], tau[:, k])
    problem.subject_to(v[:, k + 1] == v[:, k] + h * a)
    problem.subject_to(q[:, k + 1] == q[:, k] + h * v[:, k + 1])
problem.subject_to(problem.bounded(-limit, ca.vec(tau), limit))
start, goal = np.array([0.0, 0.0]), np.array([0.8, -0.6])
for value, at in ((q[:, 0], start), (q[:, N], goal), (v[:, 0], 0), (v[:, N], 0)):
    problem.subject_to(value == at)
problem.minimize(ca.sumsqr(tau))
problem.set_initial(q, start[:, None] + (goal - start)[:, None] * np.linspace(0, 1, N + 1))
problem.set_initial(v, np.tile(((goal - start) / T)[:, None], N + 1))
problem.set_initial(tau, np.tile(result.model.gravity(start)[:, None], N))
problem.solver("ipopt", {"print_time": False}, {"print_level": 0, "sb": "yes"})
solution = problem.solve()
print("largest torque:", np.abs(solution.value(tau)).max(), "N m")
assert np.allclose(solution.value(q)[:, -1], goal, atol=1e-6)
