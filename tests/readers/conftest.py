"""A small arm, and a clean log of it for every test to spoil."""

import numpy as np
import pytest

from casysid.robot import Robot

LINK = (
    '<link name="{0}"><inertial><origin xyz="0 0 .1"/><mass value="2"/>'
    '<inertia ixx=".02" iyy=".02" izz=".01" ixy="0" ixz="0" iyz="0"/></inertial></link>'
)
JOINT = (
    '<joint name="{0}" type="{1}"><parent link="{2}"/><child link="{3}"/><axis xyz="0 1 0"/>'
    '<limit lower="{4}" upper="{4}" velocity="4" effort="50"/></joint>'
)


@pytest.fixture(scope="session")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    """Shoulder and elbow (revolute, 2.5 rad), a wheel (continuous) and a slide (prismatic, 0.5 m)."""
    links = "".join(LINK.format(name) for name in ("upper", "lower", "rim", "carriage"))
    kinds = [
        ("shoulder", "revolute", 2.5),
        ("elbow", "revolute", 2.5),
        ("wheel", "continuous", 0),
        ("slide", "prismatic", 0.5),
    ]
    chain = ["base", "upper", "lower", "rim", "carriage"]
    joints = "".join(
        JOINT.format(name, kind, chain[k], chain[k + 1], reach).replace('lower="', 'lower="-')
        for k, (name, kind, reach) in enumerate(kinds)
    )
    path = tmp_path_factory.mktemp("arm") / "arm.urdf"
    path.write_text(f'<robot name="arm"><link name="base"/>{links}{joints}</robot>')
    return Robot.from_urdf(path)


@pytest.fixture
def columns() -> dict[str, np.ndarray]:
    """Four joints moving for 4 s at 100 Hz, by name, with velocity and acceleration as its exact derivatives."""
    time = np.arange(400) / 100.0
    names = {"shoulder": (1.0, 3.0), "elbow": (1.5, 2.0), "wheel": (2.0, 1.0), "slide": (0.3, 4.0)}
    noise = np.random.default_rng(1)
    log = {"time": time}
    log |= {f"q_{name}": size * np.sin(speed * time) for name, (size, speed) in names.items()}
    log |= {f"v_{name}": size * speed * np.cos(speed * time) for name, (size, speed) in names.items()}
    log |= {f"a_{name}": -size * speed**2 * np.sin(speed * time) for name, (size, speed) in names.items()}
    return log | {f"tau_{name}": noise.normal(size=len(time)) for name in names}
