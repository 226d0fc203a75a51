"""URDF texts: one arm to break in many ways, and random trees."""

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

ARM = """<?xml version="1.0"?>
<!-- a comment before the robot -->
<robot name="arm">
  <link name="base">
    <inertial><mass value="-7"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
  </link>
  <link name="upper">
    <inertial>
      <!-- from CAD -->
      <origin xyz="0.1 0 0.02" rpy="0.3 -0.2 0.5"/>
      <mass value="2.0" />
      <inertia ixx="0.02" ixy="0.001" ixz="0.002" iyy="0.03" iyz="-0.001" izz="0.025"/>
    </inertial>
    <visual><geometry><mesh filename="meshes/upper.stl" scale="1 1 1"/></geometry></visual>
  </link>
  <link name="lower">
    <inertial>
      <mass value="1.0"/>
      <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.012" iyz="0" izz="0.008"/>
    </inertial>
  </link>
  <link name="tool">
    <inertial>
      <origin xyz="0 0 0.05"/>
      <mass value="0.5"/>
      <inertia ixx="0.001" ixy="0" ixz="0" iyy="0.001" iyz="0" izz="0.0005"/>
    </inertial>
  </link>
  <joint name="shoulder" type="revolute">
    <parent link="base"/><child link="upper"/>
    <origin xyz="0 0 0.3" rpy="0.1 0.2 0.3"/>
    <axis xyz="0 1 0"/>
    <limit lower="-2.5" upper="1.5" velocity="3" effort="80"/>
    <dynamics damping="0.3" friction="0.2"/>
  </joint>
  <joint name="elbow" type="continuous">
    <parent link="upper"/><child link="lower"/>
    <origin xyz="0.4 0 0"/>
    <axis xyz="0 3 4"/>
    <limit velocity="2" effort="30"/>
  </joint>
  <joint name="flange" type="fixed">
    <parent link="lower"/><child link="tool"/>
    <origin xyz="0 0 0.1" rpy="0 1.5707963267948966 0"/>
  </joint>
</robot>
"""


def numbers(values) -> str:
    return " ".join(repr(float(x)) for x in np.ravel(values))


@st.composite
def trees(draw, largest: int = 5) -> str:
    """Random trees with rotated inertials, any axis, and links that are fixed to others."""
    links, joints = ['<link name="l0"/>'], []
    for i in range(1, draw(st.integers(1, largest)) + 1):
        x = draw(hnp.arrays(np.float64, 22, elements=st.floats(-1.0, 1.0, width=32)))
        kind = "revolute" if i == 1 else draw(st.sampled_from(["revolute", "continuous", "prismatic", "fixed"]))
        parent = draw(st.integers(0, i - 1))
        axis = [*x[6:8], x[8] + 1.5]
        joints.append(
            f'<joint name="j{i}" type="{kind}"><parent link="l{parent}"/><child link="l{i}"/>'
            f'<origin xyz="{numbers(x[:3])}" rpy="{numbers(3 * x[3:6])}"/><axis xyz="{numbers(axis)}"/>'
            '<limit lower="-2" upper="2" velocity="3" effort="4"/></joint>'
        )
        links.append(f'<link name="l{i}">{_inertial(x[9:])}</link>')
    return f'<robot name="tree">{"".join(links + joints)}</robot>'


def _inertial(x) -> str:
    A = np.diag(np.exp(x[:3])) * 0.1
    A[np.triu_indices(3, 1)] = 0.05 * x[3:6]
    second, mass = A @ A.T, float(np.exp(x[6]))
    xx, xy, xz, _, yy, yz, _, _, zz = np.ravel(mass * (np.trace(second) * np.eye(3) - second))
    entries = {"ixx": xx, "ixy": xy, "ixz": xz, "iyy": yy, "iyz": yz, "izz": zz}
    text = " ".join(f'{key}="{numbers(value)}"' for key, value in entries.items())
    return (
        f'<inertial><origin xyz="{numbers(0.2 * x[7:10])}" rpy="{numbers(3 * x[10:13])}"/>'
        f'<mass value="{numbers(mass)}"/><inertia {text}/></inertial>'
    )
