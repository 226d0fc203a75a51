"""Logs of real robots, where they are at hand: all are read, and only what deserves a warning gets one."""

import warnings
from pathlib import Path

import numpy as np
import pytest

from casysid.errors import RecordingError
from casysid.recording import read_recording
from casysid.robot import Robot

DATA = Path(__file__).parents[3] / "shared" / "data"
LOGS = sorted(DATA.glob("*/*.csv.gz"))
MOTOR_SIDE = "excitation_9s_motor_raw"
UNEVEN, STILL, REPEATED, JUMPS, STRONG = (
    "sampling is uneven",
    "never moving (less than 0.005 rad or m)",
    "% of the rows repeat the one before",
    "positions jump, faster than ten times the velocity limit",
    "torque at or beyond the model's effort limit",
)
DESERVED = {
    "airbot_play/chirp_loaded": (f"{STRONG}: joint5 in 28 rows",),
    "dfki_double_pendulum/design_A0_11": (UNEVEN,),
    "dfki_double_pendulum/design_C0_12": (UNEVEN,),
    "dfki_double_pendulum/design_C0_13": (UNEVEN,),
    "dfki_double_pendulum/design_C1_143906": (f"{STILL}: elbow",),
    "dvrk_psm/psm1_traj5": (f"12{REPEATED}",),
    "dvrk_psm/psm1_traj6": (f"12{REPEATED}",),
    "franka_panda/exciting_traj_1": ("4 gaps in time, the largest 0.00881 s", UNEVEN, f"6{REPEATED}"),
    "schunk_lwa_krang": (JUMPS, f"23{REPEATED}"),
    "tiago/dynamic": (f"{STRONG}: arm_2_joint in 13 rows",),
    "youbot": (f"{STILL}: arm_joint_5",),
    "youbot/traj5": (),
    "youbot/traj6": (),
}
"""By folder, or by folder and log where those of a folder differ."""

pytestmark = pytest.mark.skipif(not LOGS, reason=f"no logs of real robots in {DATA}")


def robot_of(log: Path) -> Robot:
    urdfs = list(log.parent.glob("*.urdf"))
    urdf = urdfs[0] if len(urdfs) == 1 else next(u for u in urdfs if log.name.startswith(u.stem))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return Robot.from_urdf(urdf)


@pytest.mark.parametrize("log", [log for log in LOGS if MOTOR_SIDE not in log.name], ids=lambda log: log.name)
def test_real_logs_are_read_with_deserved_warnings_only(log: Path) -> None:
    robot = robot_of(log)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        recording = read_recording(log, robot)
    said = [str(w.message).removeprefix(f"{log}: ") for w in caught]
    name = f"{log.parent.name}/{log.name.removesuffix('.csv.gz')}"
    deserved = DESERVED.get(name, DESERVED.get(log.parent.name, ()))
    assert len(said) == len(deserved)
    assert all(sentence.startswith(begin) for sentence, begin in zip(said, deserved, strict=True))
    assert len(recording) >= 500
    assert len(recording.segments) == (5 if "4 gaps in time, the largest 0.00881 s" in deserved else 1)


@pytest.mark.parametrize("log", [log for log in LOGS if MOTOR_SIDE in log.name], ids=lambda log: log.name)
def test_motor_side_columns_are_no_joint_positions(log: Path) -> None:
    with pytest.raises(RecordingError, match=r"no column q_joint_1, .*Found: time, qm1"):
        read_recording(log, robot_of(log))


@pytest.mark.parametrize("log", LOGS[:1] + LOGS[-2:-1], ids=lambda log: log.name)
def test_a_real_log_in_degrees_is_recognised(log: Path, tmp_path: Path) -> None:
    robot = robot_of(log)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        recording = read_recording(log, robot)
    columns = {f"q{k + 1}": np.rad2deg(x) for k, x in enumerate(recording.position.T)}
    columns |= {f"tau{k + 1}": x for k, x in enumerate(recording.torque.T)}
    np.savez(tmp_path / "log.npz", time=recording.time, **columns)
    with pytest.raises(RecordingError, match="q looks like degrees"):
        read_recording(tmp_path / "log.npz", robot)
