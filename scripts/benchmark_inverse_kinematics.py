"""How often inverse kinematics succeeds, how long it takes, and how near it comes to what is out of reach.

    python scripts/benchmark_inverse_kinematics.py [ROBOT[:FRAME]...] [--poses 1000] [--unreachable 200] [--seed 0]

Reachable poses are those of random configurations within the joints' limits. Beside casysid stands the closed loop of
Pinocchio's documentation (step 0.1, damping 1e-12, 1000 iterations, no limits) as printed there, from the neutral
configuration: its answers count as found whether or not they keep the limits; and the same with casysid's number of
random restarts. Poses out of reach are positions at 1 to 2 times the farthest reach; the nearest posture is compared
with a dense search, the best of 100 000 random configurations polished by SciPy's bounded minimiser from the ten best.
"""

from __future__ import annotations

import argparse
import time
import warnings

import numpy as np
import pinocchio as pin
from scipy.optimize import minimize

from casysid import InverseKinematics, Kinematics, PoseTarget, Robot, find_model
from casysid.errors import CasysidWarning
from casysid.kinematics import FrameKind, random_configurations

DEFAULT = ("two_link", "scara:tool", "arm:palm", "head:left_eye", "head:right_eye")
DENSE, POLISHED = 100_000, 10


def closed_loop(model, data, joint, wanted, q, iterations=1000, step=0.1, damping=1e-12, tolerance=1e-6):
    """Pinocchio's documented example, "Inverse kinematics (clik)"; whether it converged, and where."""
    for _ in range(iterations):
        pin.forwardKinematics(model, data, q)
        left = data.oMi[joint].actInv(wanted)
        error = pin.log(left).vector
        if np.linalg.norm(error) < tolerance:
            return True, q
        J = -pin.Jlog6(left.inverse()) @ pin.computeJointJacobian(model, data, q, joint)
        v = -J.T @ np.linalg.solve(J @ J.T + damping * np.eye(6), error)
        q = pin.integrate(model, q, v * step)
    return False, q


def measure_reachable(kinematics, frame, count, seed, restarts):
    """Successes and milliseconds of casysid, of the closed loop, and of the closed loop with restarts."""
    robot, rng = kinematics.robot, np.random.default_rng(seed)
    frame = kinematics.frame(frame)
    q = random_configurations(robot, rng, count)
    poses, solver = kinematics.poses(frame, q), InverseKinematics(kinematics)
    targets = [
        PoseTarget(frame=frame, position=p, rotation=R) for p, R in zip(poses.translation, poses.rotation, strict=True)
    ]
    solver.reach(targets[0])  # builds the expressions
    model, data = robot.model, robot.model.createData()
    inner = pin.SE3(np.array(frame.rotation), np.array(frame.translation)).inverse()
    found = {"casysid": [], "closed loop": [], "closed loop, restarts": []}
    for target in targets:
        began = time.perf_counter()
        answer = solver.reach(target)
        found["casysid"].append((answer.success, time.perf_counter() - began))
        wanted = pin.SE3(np.array(target.rotation), np.array(target.position)) * inner
        began = time.perf_counter()
        there, _ = closed_loop(model, data, frame.joint + 1, wanted, np.array(pin.neutral(model)))
        found["closed loop"].append((there, time.perf_counter() - began))
        for _ in range(restarts if not there else 0):
            start = random_configurations(robot, rng, 1)[0]
            there, _ = closed_loop(model, data, frame.joint + 1, wanted, start)
            if there:
                break
        found["closed loop, restarts"].append((there, time.perf_counter() - began))
    for name, answers in found.items():
        success, seconds = np.array(answers).T
        print(
            f"  {name:<24}{100 * success.mean():7.1f} %   median {1e3 * np.median(seconds):8.3f} ms   "
            f"95 % below {1e3 * np.quantile(seconds, 0.95):9.3f} ms",
            flush=True,
        )


def measure_unreachable(kinematics, frame, count, seed):
    """By how much the nearest posture is farther away than that of a dense search."""
    robot, rng = kinematics.robot, np.random.default_rng(seed + 1)
    cloud = random_configurations(robot, rng, DENSE)
    points, solver = kinematics.poses(frame, cloud).translation, InverseKinematics(kinematics)
    center = points.mean(axis=0)
    reach = np.linalg.norm(points - center, axis=1).max()
    pose, jacobian = kinematics.pose_function(frame), kinematics.jacobian_function(frame)
    excess, seconds, called = [], [], 0
    for _ in range(count):
        direction = rng.normal(size=3)
        goal = center + direction / np.linalg.norm(direction) * reach * rng.uniform(1.0, 2.0)

        def square(q, goal=goal):
            gap = pose(q)[1].full().ravel() - goal
            return gap @ gap, 2.0 * jacobian(q).full()[:3].T @ gap

        distances = np.linalg.norm(points - goal, axis=1)
        bounds = list(zip(robot.position_lower, robot.position_upper, strict=True))
        dense = min(
            np.sqrt(minimize(square, cloud[k], jac=True, bounds=bounds, method="L-BFGS-B").fun)
            for k in np.argsort(distances)[:POLISHED]
        )
        answer = solver.reach(PoseTarget(frame=frame, position=goal))
        excess.append(answer.distance[0] - min(dense, distances.min()))
        seconds.append(answer.seconds)
        called += answer.success
    excess = np.array(excess)
    print(
        f"  out of reach             {100 * np.mean(excess <= 1e-3):7.1f} % within 1 mm of the dense search (worst "
        f"{1e3 * excess.max():.4f} mm), {called} called reached, median {1e3 * np.median(seconds):.1f} ms",
        flush=True,
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("robots", nargs="*", default=DEFAULT, metavar="ROBOT[:FRAME]")
    parser.add_argument("--poses", type=int, default=1000)
    parser.add_argument("--unreachable", type=int, default=200)
    parser.add_argument("--restarts", type=int, default=10, help="of the closed loop")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    warnings.simplefilter("ignore", CasysidWarning)
    for word in options.robots:
        name, _, frame = word.partition(":")
        kinematics = Kinematics(Robot.from_file(find_model(name)))
        links = [one.name for one in kinematics.frames.values() if one.kind is FrameKind.LINK]
        print(f"{kinematics.robot.name}, frame {frame or links[-1]}")
        measure_reachable(kinematics, frame or links[-1], options.poses, options.seed, options.restarts)
        if options.unreachable:
            measure_unreachable(kinematics, frame or links[-1], options.unreachable, options.seed)


if __name__ == "__main__":
    main()
