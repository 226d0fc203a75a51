"""One recording in the dress of many tools is read to the same samples, and only what must be is declared."""

import warnings
from pathlib import Path

import numpy as np
import pytest

from casysid.recording import Declared, open_recording, read_map, read_recording
from casysid.robot import Robot
from tests.recording.dialects import DIALECTS, JOINTS, Log

LINK = (
    '<link name="{0}"><inertial><origin xyz="0 0 .1"/><mass value="2"/>'
    '<inertia ixx=".02" iyy=".02" izz=".01" ixy="0" ixz="0" iyz="0"/></inertial></link>'
)
JOINT = (
    '<joint name="{0}" type="{1}"><parent link="{2}"/><child link="{3}"/><axis xyz="0 1 0"/>'
    '<limit lower="-2.5" upper="2.5" velocity="8" effort="50"/></joint>'
)


@pytest.fixture(scope="session")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    """Three joints that turn and one that slides."""
    path = tmp_path_factory.mktemp("robot") / "arm.urdf"
    links = "".join(LINK.format(f"link{k}") for k in range(1, 5))
    kinds = ("revolute", "revolute", "revolute", "prismatic")
    joints = "".join(
        JOINT.format(name, kind, f"link{k}" if k else "base", f"link{k + 1}")
        for k, (name, kind) in enumerate(zip(JOINTS, kinds, strict=True))
    )
    path.write_text(f'<robot name="arm"><link name="base"/>{links}{joints}</robot>')
    return Robot.from_urdf(path)


@pytest.fixture(scope="session")
def log() -> Log:
    """Three seconds at 100 Hz; velocities are the positions' derivatives."""
    nanoseconds = np.arange(300, dtype=np.int64) * 10_000_000
    phase = np.array([3.0, 2.0, 4.0, 5.0]) * (nanoseconds[:, None] * 1e-9) + np.array([0.3, 1.0, 2.0, 0.5])
    size = np.array([1.0, 1.2, 0.8, 0.3])
    torque = np.random.default_rng(3).normal(size=(300, 4))
    return Log(nanoseconds, size * np.sin(phase), size * np.array([3.0, 2.0, 4.0, 5.0]) * np.cos(phase), torque)


def test_there_are_many_dialects() -> None:
    assert len(DIALECTS) >= 40
    assert len({dialect.suffix for dialect in DIALECTS.values()}) >= 12


@pytest.mark.parametrize("name", DIALECTS)
def test_a_log_is_read_in_every_dress(name: str, robot: Robot, log: Log, tmp_path: Path) -> None:
    dialect = DIALECTS[name]
    path = tmp_path / f"log{dialect.suffix}"
    dialect.write(path, log)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        recording = read_recording(path, robot, dialect.declared)
    said = [str(one.message) for one in caught]
    assert all(dialect.warns and dialect.warns in sentence for sentence in said), said
    assert bool(dialect.warns) == bool(said)
    assert recording.time is not None
    assert recording.velocity is not None
    np.testing.assert_allclose(
        recording.time - recording.time[0], log.time[: len(log.time) - dialect.lost], rtol=0, atol=1e-12
    )
    for found, wanted in ((recording.position, log.q), (recording.velocity, log.v), (recording.torque, log.tau)):
        np.testing.assert_allclose(found, wanted[dialect.lost :], rtol=dialect.digits, atol=dialect.digits)


@pytest.mark.parametrize("name", DIALECTS)
@pytest.mark.filterwarnings("ignore::casysid.errors.CasysidWarning")
def test_the_map_that_was_used_reads_the_log_again(name: str, robot: Robot, log: Log, tmp_path: Path) -> None:
    dialect = DIALECTS[name]
    path = tmp_path / f"log{dialect.suffix}"
    dialect.write(path, log)
    opened = open_recording(path, robot, dialect.declared)
    (tmp_path / "map.toml").write_text(opened.column_map)
    again = open_recording(path, robot, read_map(tmp_path / "map.toml"))
    assert again.column_map == opened.column_map
    for first, second in zip(opened.batches(50), again.batches(50), strict=True):
        np.testing.assert_array_equal(first.time, second.time)
        np.testing.assert_allclose(first.position, second.position, rtol=1e-15)
        np.testing.assert_allclose(first.torque, second.torque, rtol=1e-15)
    assert Declared() == Declared()
