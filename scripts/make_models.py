"""Write the bundled robot models: URDF, MJCF and README, all from one table per robot in ``model_tables/``.

A link's inertia is that of the solids it is drawn with, each of uniform density: what the picture shows is what the
joints feel. One table writes both formats, so they cannot disagree. Run ``python scripts/make_models.py`` after editing
a table, then ``python scripts/render_models.py`` for the pictures.
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

TABLES = Path(__file__).parent / "model_tables"
MODELS = Path(__file__).parent.parent / "models"
AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
TURNS = {
    "x": (0.0, np.pi / 2, 0.0),
    "y": (-np.pi / 2, 0.0, 0.0),
    "z": (0.0, 0.0, 0.0),
}  # roll, pitch, yaw that take z there
COLORS = {
    "grey": (0.66, 0.68, 0.70, 1.0),
    "dark": (0.20, 0.22, 0.25, 1.0),
    "orange": (0.91, 0.49, 0.16, 1.0),
    "blue": (0.20, 0.45, 0.70, 1.0),
}


def numbers(values: Any) -> str:
    """Numbers as both formats read them, in full."""
    return " ".join(repr(float(value)) for value in np.ravel(values))


@dataclass(frozen=True)
class Solid:
    """One body of uniform density: its shape, place and mass, and the reason for them."""

    part: str
    shape: str
    at: tuple[float, float, float]
    color: str
    mass: float = 0.0
    size: tuple[float, float, float] = (0.0, 0.0, 0.0)
    radius: float = 0.0
    length: float = 0.0
    axis: str = "z"
    collision: bool = True
    why: str = ""
    optional: bool = False

    def central_inertia(self) -> np.ndarray:
        """Inertia about its own centre in the link's axes, shape (3, 3), [kg m²]."""
        if self.shape == "box":
            squares = np.square(self.size) / 12
            return self.mass * np.diag(squares.sum() - squares)
        r, h = self.radius, self.length
        if self.shape == "cylinder":
            along, across = r**2 / 2, r**2 / 4 + h**2 / 12
        else:  # a capsule: a cylinder with two half balls
            ball = 4 * r / (4 * r + 3 * h)
            along = (1 - ball) * r**2 / 2 + ball * 2 * r**2 / 5
            across = (1 - ball) * (r**2 / 4 + h**2 / 12) + ball * (2 * r**2 / 5 + h**2 / 4 + 3 * h * r / 8)
        turn = Rotation.from_euler("xyz", TURNS[self.axis]).as_matrix()
        return self.mass * turn @ np.diag([across, across, along]) @ turn.T


@dataclass(frozen=True)
class Link:
    """A link with the joint that carries it."""

    name: str
    parent: str
    joint: dict[str, Any]
    solids: tuple[Solid, ...]
    frames: tuple[dict[str, Any], ...] = ()

    @property
    def floats(self) -> bool:
        """Whether nothing holds it."""
        return bool(self.joint["kind"] == "floating")

    def inertial(self) -> tuple[float, np.ndarray, np.ndarray]:
        """Mass, centre of mass, and inertia about it in the link's axes, to six digits as the files have them."""
        mass = sum(solid.mass for solid in self.solids)
        center = sum(solid.mass * np.array(solid.at) for solid in self.solids) / mass
        inertia = np.zeros((3, 3))
        for solid in self.solids:
            arm = np.array(solid.at) - center
            inertia += solid.central_inertia() + solid.mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
        six = np.vectorize(lambda value: float(f"{value:.5e}"), otypes=[float])
        return float(f"{mass:.5e}"), six(center), six(inertia)


@dataclass(frozen=True)
class Machine:
    """A whole robot as its table has it."""

    name: str
    title: str
    rate: float
    text: str
    choice: str
    view: dict[str, list[float]]
    base: tuple[Solid, ...]
    links: tuple[Link, ...]
    loaded: str = ""

    @property
    def moved(self) -> tuple[Link, ...]:
        """Links with a motor."""
        return tuple(link for link in self.links if not link.floats)

    @classmethod
    def read(cls, path: Path, *, loaded: bool = False) -> Machine:
        """The machine of a table, named as the table's file; or with its optional solids, under the name for that."""
        table = tomllib.loads(path.read_text(encoding="utf-8"))
        links = tuple(
            Link(
                row["name"],
                row["parent"],
                row["joint"],
                tuple(one for one in (Solid(**s) for s in row["solids"]) if loaded or not one.optional),
                tuple(row.get("frames", ())),
            )
            for row in table.pop("link")
        )
        base = tuple(Solid(**s) for s in table.pop("base", ()))
        return cls(table["loaded"] if loaded else path.stem, base=base, links=links, **table)


def urdf_shapes(solid: Solid) -> list[tuple[str, np.ndarray]]:
    """The solid as URDF shapes with their places: URDF has no capsule, but a cylinder with two balls is one."""
    place = np.array(solid.at)
    if solid.shape == "box":
        return [(f'<box size="{numbers(solid.size)}"/>', place)]
    shapes = [(f'<cylinder radius="{solid.radius}" length="{solid.length}"/>', place)]
    if solid.shape == "capsule":
        end = np.array(AXES[solid.axis]) * solid.length / 2
        shapes += [(f'<sphere radius="{solid.radius}"/>', place + sign * end) for sign in (-1, 1)]
    return shapes


def urdf_geometry(solids: tuple[Solid, ...]) -> list[str]:
    lines = []
    for solid in solids:
        for shape, place in urdf_shapes(solid):
            turn = (0.0, 0.0, 0.0) if "cylinder" not in shape else TURNS[solid.axis]
            body = f'<origin xyz="{numbers(place)}" rpy="{numbers(turn)}"/><geometry>{shape}</geometry>'
            lines.append(f'    <visual>{body}<material name="{solid.color}"/></visual>')
            if solid.collision:
                lines.append(f"    <collision>{body}</collision>")
    return lines


def urdf(machine: Machine) -> str:
    lines = ['<?xml version="1.0"?>', f"<!-- {machine.title}. Written by scripts/make_models.py. -->"]
    lines += [f'<robot name="{machine.name}">']
    lines += [f'  <material name="{k}"><color rgba="{numbers(v)}"/></material>' for k, v in COLORS.items()]
    lines += ['  <link name="base">', *urdf_geometry(machine.base), "  </link>"]
    for link in machine.links:
        mass, center, inertia = link.inertial()
        names = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
        tensor = " ".join(f'{n}="{numbers(x)}"' for n, x in zip(names, inertia[np.triu_indices(3)], strict=True))
        lines += [
            f'  <link name="{link.name}">',
            f'    <inertial><origin xyz="{numbers(center)}"/><mass value="{mass}"/><inertia {tensor}/></inertial>',
            *urdf_geometry(link.solids),
            "  </link>",
            *urdf_joint(link),
            *(line for frame in link.frames for line in urdf_frame(link, frame)),
        ]
    return "\n".join([*lines, "</robot>", ""])


def urdf_joint(link: Link) -> list[str]:
    joint = link.joint
    lines = [
        f'  <joint name="{joint["name"]}" type="{joint["kind"]}">',
        f'    <parent link="{link.parent}"/><child link="{link.name}"/>',
        f'    <origin xyz="{numbers(joint["at"])}" rpy="{numbers(joint.get("rpy", (0, 0, 0)))}"/>',
    ]
    if not link.floats:
        low, high = joint["range"]
        lines += [
            f'    <axis xyz="{numbers(AXES[joint["axis"]])}"/>',
            f'    <limit lower="{low}" upper="{high}" velocity="{joint["velocity"]}" effort="{joint["effort"]}"/>',
            f'    <dynamics damping="{joint["damping"]}" friction="{joint["friction"]}"/>',
        ]
    return [*lines, "  </joint>"]


def urdf_frame(link: Link, frame: dict[str, Any]) -> list[str]:
    return [
        f'  <link name="{frame["name"]}"/>',
        f'  <joint name="{frame["name"]}_fixed" type="fixed">',
        f'    <parent link="{link.name}"/><child link="{frame["name"]}"/>',
        f'    <origin xyz="{numbers(frame["at"])}" rpy="0.0 0.0 0.0"/>',
        "  </joint>",
    ]


def quaternion(roll_pitch_yaw: Any) -> str:
    x, y, z, w = Rotation.from_euler("xyz", roll_pitch_yaw).as_quat()
    return numbers((w, x, y, z))


def mjcf_geometry(solids: tuple[Solid, ...], indent: str) -> list[str]:
    lines = []
    for solid in solids:
        size = np.array(solid.size) / 2 if solid.shape == "box" else (solid.radius, solid.length / 2)
        turn = "" if solid.shape == "box" or solid.axis == "z" else f' quat="{quaternion(TURNS[solid.axis])}"'
        touch = "" if solid.collision else ' contype="0" conaffinity="0"'
        lines.append(
            f'{indent}<geom type="{solid.shape}" size="{numbers(size)}" pos="{numbers(solid.at)}"{turn} '
            f'material="{solid.color}"{touch}/>'
        )
    return lines


def mjcf_body(machine: Machine, link: Link, depth: int) -> list[str]:
    indent, joint = "  " * depth, link.joint
    mass, center, inertia = link.inertial()
    tensor = inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    turn = f' quat="{quaternion(joint["rpy"])}"' if "rpy" in joint else ""
    return [
        f'{indent}<body name="{link.name}" pos="{numbers(joint["at"])}"{turn}>',
        f'{indent}  <inertial pos="{numbers(center)}" mass="{mass}" fullinertia="{numbers(tensor)}"/>',
        f"{indent}  {mjcf_joint(link)}",
        *mjcf_geometry(link.solids, indent + "  "),
        *(f'{indent}  <site name="{one["name"]}" pos="{numbers(one["at"])}" size="0.01"/>' for one in link.frames),
        *(
            line
            for child in machine.links
            if child.parent == link.name
            for line in mjcf_body(machine, child, depth + 1)
        ),
        f"{indent}</body>",
    ]


def mjcf_joint(link: Link) -> str:
    joint = link.joint
    if link.floats:
        return f'<freejoint name="{joint["name"]}"/>'
    kind = {"revolute": "hinge", "prismatic": "slide"}[joint["kind"]]
    return (
        f'<joint name="{joint["name"]}" type="{kind}" axis="{numbers(AXES[joint["axis"]])}" '
        f'range="{numbers(joint["range"])}" damping="{joint["damping"]}" frictionloss="{joint["friction"]}" '
        f'armature="{joint["armature"]}" actuatorfrcrange="{-joint["effort"]} {joint["effort"]}"/>'
    )


def mjcf_world(machine: Machine, roots: list[Link]) -> list[str]:
    """All bodies; those that nothing holds have no base."""
    if roots[0].floats:
        return [*(line for link in roots for line in mjcf_body(machine, link, 2)), "  </worldbody>"]
    return [
        '    <body name="base">',
        *mjcf_geometry(machine.base, "      "),
        *(line for link in roots for line in mjcf_body(machine, link, 3)),
        "    </body>",
        "  </worldbody>",
        "  <contact>",
        *(f'    <exclude body1="base" body2="{link.name}"/>' for link in roots),
        "  </contact>",
    ]


def mjcf(machine: Machine) -> str:
    """The machine as MJCF; the first link is kept from touching the base, as MuJoCo does for all later neighbours."""
    roots = [link for link in machine.links if link.parent == "base"]
    eye, target = np.array(machine.view["position"]), np.array(machine.view["target"])
    lines = [f"<!-- {machine.title}. Written by scripts/make_models.py. -->", f'<mujoco model="{machine.name}">']
    lines += [
        '  <compiler angle="radian" autolimits="true"/>',
        '  <option timestep="0.001" integrator="implicitfast"/>',
    ]
    lines += ['  <visual><headlight ambient="0.4 0.4 0.4" diffuse="0.3 0.3 0.3"/></visual>', "  <asset>"]
    lines += [f'    <material name="{k}" rgba="{numbers(v)}" specular="0.3"/>' for k, v in COLORS.items()]
    lines += [
        "  </asset>",
        "  <worldbody>",
        f'    <light type="directional" pos="0.0 0.0 4.0" dir="{numbers(target - eye - (0, 0, 1.5))}"/>',
    ]
    lines += mjcf_world(machine, roots)
    if machine.moved:
        lines += ["  <actuator>", *(mjcf_motor(link.joint) for link in machine.moved), "  </actuator>"]
    return "\n".join([*lines, "</mujoco>", ""])


def mjcf_motor(joint: dict[str, Any]) -> str:
    limits = f"{-joint['effort']} {joint['effort']}"
    return f'    <motor name="{joint["name"]}_motor" joint="{joint["name"]}" ctrlrange="{limits}"/>'


def readme(machine: Machine) -> str:
    names = [machine.name, *([machine.loaded] if machine.loaded else [])]
    files = ", ".join(f"`{name}.urdf`, `{name}.xml`" for name in names)
    lines = [f"# {machine.title}", "", f"![{machine.title}]({machine.name}.png)", "", machine.text.strip(), ""]
    lines += [
        f"Files: {files} (the same machine; URDF has no word for armature). Control rate: {machine.rate:g} Hz.",
        "",
    ]
    lines += ["## Joints", "", machine.choice.strip(), ""]
    lines += readme_joints(machine) if machine.moved else []
    lines += readme_frames(machine)
    return "\n".join([*lines, *readme_links(machine), ""])


def readme_joints(machine: Machine) -> list[str]:
    lines = ["| joint | axis | at [m] in parent | range | velocity | effort | viscous | Coulomb | armature | why |"]
    lines += ["|---|---|---|---|---|---|---|---|---|---|"]
    for link in machine.moved:
        j = link.joint
        low, high = j["range"]
        lines.append(
            f"| `{j['name']}` | {j['axis']} | {', '.join(f'{x:g}' for x in j['at'])} | {low:g} to {high:g} | "
            f"{j['velocity']:g} | {j['effort']:g} | {j['damping']:g} | {j['friction']:g} | {j['armature']:g} | "
            f"{j['why']} |"
        )
    return [
        *lines,
        "",
        "Units: rad, rad/s, N m, N m s/rad, N m, kg m²; for a prismatic joint m, m/s, N, N s/m, N, kg.",
        "",
    ]


def readme_frames(machine: Machine) -> list[str]:
    frames = [(link, frame) for link in machine.links for frame in link.frames]
    if not frames:
        return []
    lines = ["## Frames", "", "| frame | on | at [m] | what |", "|---|---|---|---|"]
    for link, frame in frames:
        place = ", ".join(f"{x:g}" for x in frame["at"])
        lines.append(f"| `{frame['name']}` | `{link.name}` | {place} | {frame['why']} |")
    return [*lines, ""]


def readme_links(machine: Machine) -> list[str]:
    lines = [
        "## Links",
        "",
        "Each link is the sum of the solids it is drawn with, of uniform density, none of them centred.",
        "",
    ]
    lines += ["| link | solid | shape [m] | at [m] | mass [kg] | why |", "|---|---|---|---|---|---|"]
    for link in machine.links:
        for s in link.solids:
            shape = (
                " × ".join(f"{x:g}" for x in s.size)
                if s.shape == "box"
                else f"r {s.radius:g}, length {s.length:g}, along {s.axis}"
            )
            place = ", ".join(f"{x:g}" for x in s.at)
            lines.append(f"| `{link.name}` | {s.part} | {s.shape} {shape} | {place} | {s.mass:g} | {s.why} |")
    lines += ["", "which makes, about the centre of mass and in the axes of the joint frame:", ""]
    lines += [
        "| link | mass [kg] | centre of mass [mm] | Ixx, Iyy, Izz [g m²] | Ixy, Ixz, Iyz [g m²] |",
        "|---|---|---|---|---|",
    ]
    for link in machine.links:
        mass, center, inertia = link.inertial()
        row = lambda values: ", ".join(f"{1e3 * x:.4g}" for x in values)  # noqa: E731
        off = (inertia[0, 1], inertia[0, 2], inertia[1, 2])
        lines.append(f"| `{link.name}` | {mass:g} | {row(center)} | {row(np.diag(inertia))} | {row(off)} |")
    return lines


def write_model(machine: Machine, directory: Path) -> None:
    directory.mkdir(parents=True, exist_ok=True)
    machines = [machine]
    if machine.loaded:
        machines.append(Machine.read(TABLES / f"{machine.name}.toml", loaded=True))
    files = {"README.md": readme(machine)}
    for one in machines:
        files |= {f"{one.name}.urdf": urdf(one), f"{one.name}.xml": mjcf(one)}
    for name, text in files.items():
        (directory / name).write_text(text, encoding="utf-8")


if __name__ == "__main__":
    for table in sorted(TABLES.glob("*.toml")):
        write_model(Machine.read(table), MODELS / table.stem)
