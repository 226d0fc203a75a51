import mujoco
import numpy as np
import pinocchio as pin
import pytest

from casysid.robot import JointKind, Robot
from tests.robot.mjcf_models import CASES

DISABLED = (
    mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_LIMIT | mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS
)


@pytest.fixture
def read(tmp_path):
    def read_text(text, **options):
        path = tmp_path / "robot.xml"
        path.write_text(text)
        return Robot.from_mjcf(path, **options)

    return read_text


def mujoco_torque(compiled, robot, rng):
    """Random state in Pinocchio's coordinates, and MuJoCo's inverse dynamics at it."""
    data = mujoco.MjData(compiled)
    compiled.opt.disableflags |= DISABLED
    data.qpos[:], data.qvel[:], data.qacc[:] = (rng.normal(size=n) for n in (compiled.nq, compiled.nv, compiled.nv))
    mujoco.mj_normalizeQuat(compiled, data.qpos)
    mujoco.mj_inverse(compiled, data)
    q, v, a, tau = (np.array(x) for x in (data.qpos, data.qvel, data.qacc, data.qfrc_inverse))
    for joint in robot.joints:
        if joint.kind in (JointKind.SPHERICAL, JointKind.FREE_FLYER):
            q[joint.q][-4:] = np.roll(q[joint.q][-4:], -1)
        if joint.kind is JointKind.FREE_FLYER:
            i = joint.v.start
            R = pin.Quaternion(q[joint.q][3:]).toRotationMatrix()
            v[i : i + 3] = R.T @ v[i : i + 3]
            a[i : i + 3] = R.T @ a[i : i + 3] - np.cross(v[i + 3 : i + 6], v[i : i + 3])
            tau[i : i + 3] = R.T @ tau[i : i + 3]
    return q, v, a, tau


@pytest.mark.parametrize("name", CASES)
def test_the_model_has_the_inverse_dynamics_of_mujoco(name, read):
    robot, rng = read(CASES[name]), np.random.default_rng(1)
    compiled = mujoco.MjModel.from_xml_string(CASES[name])
    for _ in range(5):
        q, v, a, tau = mujoco_torque(compiled, robot, rng)
        predicted = pin.rnea(robot.model, robot.model.createData(), q, v, a) + robot.damping * v
        np.testing.assert_allclose(predicted, tau, atol=1e-12 * max(1.0, abs(tau).max()))
