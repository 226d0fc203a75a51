"""A robot and a recording at a glance, for ``casysid info``."""

from __future__ import annotations

from casysid.dynamics import build_regressor
from casysid.identifiability import structural_base_parameters
from casysid.identification import choose_band, find_mistakes
from casysid.identification.passes import Passes
from casysid.inertia import mass_properties, smallest_eigenvalue
from casysid.recording import Source
from casysid.report.tables import Table, mistake_table, number
from casysid.robot import Robot
from casysid.robot.likely_bodies import Witness, believed
from casysid.robot.plausibility import bodies_of
from casysid.signals import band_of, noise_of
from casysid.threads import single_threaded


@single_threaded()
def robot_tables(robot: Robot) -> list[tuple[str, Table]]:
    """Joints with their limits, links with their inertias, which of those are in doubt, and the base parameters."""
    witness = believed(robot)
    doubted = [("Inertial parameters of no body of that size", _doubts(witness))] if witness.replacements else []
    combinations = ("Identifiable combinations", _combinations(robot))
    return [("Joints", _joints(robot)), ("Links", _links(robot)), *doubted, combinations]


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
    excerpts = recording.excerpts()
    passes = Passes(robot, excerpts, choose_band(excerpts))
    mistakes = find_mistakes(robot, passes.sparse_motions, passes.band.cutoff)
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
    inertias, smallest, bodies = mass_properties(parameters), smallest_eigenvalue(parameters), bodies_of(robot)
    rows = tuple(
        (
            link,
            number(float(inertias.mass[k])),
            ", ".join(number(float(value), 3) for value in inertias.center_of_mass[k]),
            ", ".join(number(float(value), 3) for value in bodies.moments[k]),
            number(float(bodies.gyration[k]), 3),
            number(float(bodies.length[k]), 3) if bodies.length[k] > 0.0 else "–",
            "yes" if smallest[k] > 0 else "no",
        )
        for k, link in enumerate(robot.links)
    )
    header = (
        "link",
        "mass [kg]",
        "centre of mass [m]",
        "principal inertia [kg m²]",
        "radius of gyration [m]",
        "length [m]",
        "a possible body",
    )
    return Table(header, rows)


def _doubts(witness: Witness) -> Table:
    rows = tuple((one.doubt.link, one.doubt.message, one.words) for one in witness.replacements)
    return Table(("link", "in the file", "in identification"), rows)


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
