import coal
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from casysid.bundled import find_model
from casysid.excitation import Capsule, HalfSpace, capsules_of
from casysid.excitation.constraints import distance
from casysid.excitation.constraints.clearance import build_clearance
from casysid.excitation.constraints.kinematics import Points
from casysid.excitation.constraints.solid_distances import build_solid_distances
from casysid.excitation.constraints.solids import Solid, bounds, convex_hull, find_mesh, read_geometry
from casysid.robot import Robot

LINK = """<link name="{0}"><inertial><mass value="1"/><origin xyz="0 0 .2"/>
<inertia ixx=".1" ixy="0" ixz="0" iyy=".1" iyz="0" izz=".1"/></inertial>{1}</link>"""
JOINT = """<joint name="j{0}" type="revolute"><parent link="l{0}"/><child link="l{1}"/><origin xyz="0 0 .4"/>
<axis xyz="0 1 0"/><limit lower="-2" upper="2" velocity="2" effort="50"/></joint>"""


def chain(path, shapes):
    """A file of links .4 m long in a row, each with the collision geometry given."""
    links = "".join(LINK.format(f"l{k}", shape) for k, shape in enumerate(shapes))
    joints = "".join(JOINT.format(k, k + 1) for k in range(len(shapes) - 1))
    path.write_text(f'<robot name="chain">{links}{joints}</robot>')
    return Robot.from_file(path)


def collision(shape, xyz="0 0 .2"):
    return f'<collision><origin xyz="{xyz}"/><geometry>{shape}</geometry></collision>'


def write_cube(path, half):
    """An STL file of a cube."""
    corners = np.array(list(np.ndindex(2, 2, 2))) * 2.0 * half - half
    lines = ["solid cube"]
    for triangle in ConvexHull(corners).simplices:
        points = [f"vertex {x} {y} {z}" for x, y, z in corners[triangle]]
        lines += ["facet normal 0 0 0", "outer loop", *points, "endloop", "endfacet"]
    path.write_text("\n".join([*lines, "endsolid cube"]))


def test_a_mesh_is_found_beside_the_file_above_it_and_by_its_package(tmp_path):
    mesh = tmp_path / "pkg" / "meshes" / "a.stl"
    mesh.parent.mkdir(parents=True)
    mesh.touch()
    urdf = tmp_path / "pkg" / "urdf" / "robot.urdf"
    for name in ("package://pkg/meshes/a.stl", "meshes/a.stl", f"file://{mesh}"):
        assert find_mesh(name, urdf) == mesh
    with pytest.raises(FileNotFoundError):
        find_mesh("package://pkg/meshes/b.stl", urdf)


def test_a_mesh_counts_as_the_box_that_it_is(tmp_path):
    write_cube(tmp_path / "cube.stl", 0.1)
    robot = chain(tmp_path / "arm.urdf", ["", collision('<mesh filename="cube.stl" scale="1 1 2"/>'), ""])
    geometry = read_geometry(robot)
    np.testing.assert_allclose(bounds(geometry.solids[0].shape)[1], [0.1, 0.1, 0.2])
    assert not geometry.missing


def test_a_mesh_that_is_not_there_is_named(tmp_path):
    robot = chain(tmp_path / "arm.urdf", ["", collision('<mesh filename="package://x/gone.stl"/>'), ""])
    geometry = read_geometry(robot)
    assert not geometry.solids
    assert "gone.stl" in geometry.missing[0]
    assert "l1" in geometry.missing[0]


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_a_capsule_covers_every_corner_of_its_shape(seed):
    rng = np.random.default_rng(seed)
    corners = rng.normal(size=(12, 3)) * rng.uniform(0.05, 1.0, 3)
    solid = Solid("l", 0, pin.SE3.Random(), convex_hull(corners))
    robot = Robot.from_file(find_model("two_link.urdf"))
    capsule = capsules_of(robot, [solid])[0]
    placed = (solid.pose.rotation @ corners.T) + solid.pose.translation[:, None]
    ends = [np.repeat(end[:, None], 12, axis=1) for end in (capsule.start, capsule.end)]
    assert (distance.between_segments(*ends, placed, placed).distance <= capsule.radius + 1e-9).all()


def test_solids_are_as_far_apart_as_coal_says_of_them_alone(tmp_path):
    box, ball = '<box size=".1 .2 .4"/>', '<sphere radius=".1"/>'
    robot = chain(tmp_path / "arm.urdf", [collision(box), collision(ball), collision(ball), collision(box)])
    solids, floor = read_geometry(robot).solids, HalfSpace("floor", np.array([0.0, 0.0, 1.0]), -0.1)
    position = np.random.default_rng(0).uniform(-1.5, 1.5, (5, 3))
    found = build_solid_distances(robot, solids, (floor,), position * 0.1)
    values, frames = found.distances(position), Points(robot).frames(position)
    for row in range(5):
        placed = [coal.Transform3s(np.eye(3), np.zeros(3))]
        for solid in solids:
            R, p = frames.rotation[:, :, row, solid.joint], frames.origin[:, row, solid.joint]
            pose = pin.SE3(np.array(R), np.array(p)) * solid.pose
            placed.append(coal.Transform3s(pose.rotation, pose.translation))
        for column, (i, k) in enumerate(found.pairs):
            wanted = coal.distance(
                solids[i].shape, placed[i + 1], solids[k].shape, placed[k + 1],
                coal.DistanceRequest(), coal.DistanceResult(),
            )  # fmt: skip
            assert values[row, column] == pytest.approx(wanted, abs=1e-6)
        ball_heights = frames.origin[2, row] + 0.2 * frames.rotation[2, 2, row]
        meeting = [label for label in found.labels if "floor" in label].index("link 'l1' and 'floor'")
        assert values[row, len(found.pairs) + meeting] == pytest.approx(ball_heights[0] - 0.1 + 0.1, abs=1e-6)


def test_links_thinner_than_their_capsules_are_kept_apart_as_far_as_their_shapes_need(tmp_path):
    plate = collision('<box size=".3 .3 .02"/>', "0 0 .39")
    robot = chain(tmp_path / "arm.urdf", [plate, plate, plate, plate])
    samples = np.random.default_rng(0).uniform(-0.3, 0.3, (200, 3))
    solids = read_geometry(robot).solids
    around = [
        Capsule(f"l{k}", solid.joint, np.zeros(3), np.array([0.0, 0.0, 0.4]), 0.5) for k, solid in enumerate(solids)
    ]
    blind = build_clearance(robot, around, (), samples, 0.01)
    seeing = build_clearance(robot, around, (), samples, 0.01, solids)
    assert blind.ignored
    assert not len(blind.pairs)
    apart = build_solid_distances(robot, solids, (), samples).distances(samples).min(axis=1) >= 0.01
    kept = seeing.distances(samples).min(axis=1, initial=np.inf) >= 0.01
    assert not (kept & ~apart).any()
