"""A robot and a recording at a glance, for ``casysid info``."""

from __future__ import annotations

from casysid.dynamics import build_regressor
from casysid.identifiability import structural_base_parameters
from casysid.identification.mistakes import find_mistakes
from casysid.inertia import mass_properties, smallest_eigenvalue
from casysid.recording import Source
from casysid.report.tables import Table, mistake_table, number
from casysid.robot import Robot
from casysid.signals import band_of, noise_of
from casysid.threads import single_threaded


@single_threaded()
def robot_tables(robot: Robot) -> list[tuple[str, Table]]:
    """Joints with their limits, links with their masses, and the base parameters."""
    return [("Joints", _joints(robot)), ("Links", _links(robot)), ("Identifiable combinations", _combinations(robot))]


@single_threaded()
def recording_tables(robot: Robot, recording: Source) -> list[tuple[str, Table]]:
    """What is in a recording, and how each channel moves."""
    summary = recording.summary()
    rows = [
        ("files", ", ".join(summary.sources)),
        ("samples", str(summary.samples)),
        ("logged", ", ".join(summary.logged)),
        ("duration [s]", number(summary.duration)),
        ("rate [Hz]", number(summary.rate)),
        ("stretches between gaps", str(summary.segments)),
        ("columns not used", ", ".join(summary.unused_columns) or "–"),
    ]
    return [
        ("Recording", Table(("", ""), tuple(rows))),
        ("Channels", _channels(recording)),
        ("Signs, units and order of columns against the model file", _against_file(robot, recording)),
    ]


def _against_file(robot: Robot, recording: Source) -> Table:
    mistakes = find_mistakes(robot, recording.excerpts())
    return mistake_table(mistakes) if mistakes else Table(("",), (("nothing looks wrong",),))


def _joints(robot: Robot) -> Table:
    rows = []
    for joint in robot.joints:
        channels = joint.channels
        rows.append(
            (
                joint.name,
                joint.kind.value,
                joint.link or "–",
                " … ".join(number(float(x[channels][0])) for x in (robot.position_lower, robot.position_upper)),
                number(float(robot.velocity_limit[joint.v][0])),
                number(float(robot.effort_limit[joint.v][0])),
                number(float(robot.damping[joint.v][0])),
                number(float(robot.dry_friction[joint.v][0])),
                number(float(robot.armature[joint.v][0])),
            )
        )
    header = ("joint", "kind", "link", "position", "velocity", "effort", "damping", "friction", "armature")
    return Table(header, tuple(rows))


def _links(robot: Robot) -> Table:
    parameters = robot.inertial_parameters.reshape(-1, 10)
    bodies, smallest = mass_properties(parameters), smallest_eigenvalue(parameters)
    rows = tuple(
        (
            link,
            number(float(bodies.mass[k])),
            ", ".join(number(float(value), 3) for value in bodies.center_of_mass[k]),
            "yes" if smallest[k] > 0 else "no",
        )
        for k, link in enumerate(robot.links)
    )
    return Table(("link", "mass [kg]", "centre of mass [m]", "a possible body"), rows)


def _combinations(robot: Robot) -> Table:
    base = structural_base_parameters(build_regressor(robot))
    return Table(("",), tuple((line,) for line in base.words()))


def _channels(recording: Source) -> Table:
    summary = recording.summary()
    header = ["channel", "lowest", "highest"]
    columns = [
        list(summary.position_range),
        [number(low) for low, _ in summary.position_range.values()],
        [number(high) for _, high in summary.position_range.values()],
    ]
    if recording.has_time:
        header += ["motion up to [Hz]", "noise (std)"]
        columns.append([number(float(f), 3) for f in band_of(recording.spectrum)])
        columns.append([number(float(s), 3) for s in noise_of(recording.spectrum)])
    if recording.channels == recording.dofs:
        header += ["torque RMS", "torque peak"]
        columns += [[number(x, 3) for x in values.values()] for values in (summary.torque_rms, summary.torque_peak)]
    return Table(tuple(header), tuple(zip(*columns, strict=True)))
