"""The report that an engineer hands to a colleague: one HTML file that needs nothing else."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

from casysid.identification import IdentificationResult
from casysid.identification.output import identity_of
from casysid.identification.verdict import judge
from casysid.outputs import Stage, add_to_run, write_whole
from casysid.report.pictures import inline_png, torque_figure
from casysid.report.summary import Origin, base_parameter_table, summary_sentences
from casysid.report.tables import (
    Table,
    choice_table,
    drive_table,
    error_table,
    further_drive_table,
    link_table,
    mistake_table,
    source_table,
)
from casysid.threads import single_threaded


@dataclass(frozen=True)
class Section:
    """One heading of the report with what stands under it."""

    title: str
    text: str = ""
    picture: str = ""
    table: Table | None = None
    lines_title: str = ""
    lines: tuple[str, ...] = ()


@single_threaded()
def write_report(result: IdentificationResult, path: str | Path, origin: Origin | None = None) -> None:
    """Write ``report.html``, whole or not at all; in the folder of :func:`~casysid.write_result` it joins its files.

    Raises:
        OutputError: It cannot be written, or the folder has a report of another result, which has replaced this one.
    """
    add_to_run(path, _bytes(result, origin), identity_of(result))


@single_threaded()
def add_report(result: IdentificationResult, stage: Stage, origin: Origin | None = None) -> None:
    """Write ``report.html`` to where a run's files wait."""
    write_whole(stage.folder / "report.html", _bytes(result, origin))


@single_threaded()
def render_report(result: IdentificationResult, origin: Origin | None = None) -> str:
    """The report as HTML text.

    Args:
        result: What it is about.
        origin: Command and inputs, where they are known.
    """
    from jinja2 import Environment

    template = resources.files("casysid.report").joinpath("template.html").read_text(encoding="utf-8")
    return (
        Environment(autoescape=True)
        .from_string(template)
        .render(
            robot=result.robot.name,
            facts=_facts(result),
            verdict=judge(result),
            summary=summary_sentences(result),
            sections=[*_sections(result), *_origin_sections(result, origin or Origin())],
            footer=f"casysid {version()}, {sum(result.seconds.values()):.1f} s",
        )
    )


def version() -> str:
    """Of casysid."""
    from casysid import __version__

    return __version__


def _facts(result: IdentificationResult) -> list[str]:
    held_out = result.held_out.samples if result.held_out else 0
    cutoff = "no low-pass" if result.cutoff.cutoff is None else f"low-pass {result.cutoff.cutoff:.3g} Hz"
    return [
        f"{len(result.robot.dofs)} degrees of freedom",
        f"method {result.estimate.method}",
        f"{result.train.samples} samples fitted, {held_out} held out",
        cutoff,
        f"torque delay {result.delay.reason}",
        f"{result.structural.rank} base parameters, condition number {result.excited.condition_number:.0f}",
    ]


def _sections(result: IdentificationResult) -> list[Section]:
    shown = "held-out" if result.held_out else "fitted"
    sections = [
        Section(
            "Torque error",
            "‖measured − predicted‖ / ‖measured‖, in a band derived from the motion alone; the second "
            "line is against the torque as logged.",
            table=error_table(result),
        ),
        Section(
            f"Torque on {shown} data",
            "The band holds 95 % of what is measured, if the parameters are as sure as they are said to be and "
            "residuals as large as in the fit.",
            picture=inline_png(torque_figure(result)),
        ),
        Section(
            "What the torque depends on",
            "The combinations of parameters that any motion can show, with standard errors; ∞: not recorded.",
            table=base_parameter_table(result),
        ),
        Section("Friction and drive", "At the joint, with standard errors.", table=drive_table(result)),
        Section(
            "Links",
            "In the joint's frame. ∞: the data cannot tell this number by itself, it follows the model file, and is "
            "shown with a ~ and two digits.",
            table=link_table(result),
        ),
        Section(
            "What decided the links' parameters",
            "The mechanism lets a parameter be known by itself, only in combination with others, or not at all; the "
            "recordings excite it when they show most of what the mechanism lets anyone know. The last column is the "
            "share that the data decided: the rest is the model file's. What no torque depends on follows the rest of "
            "its body, as far as bodies like the file's hang together.",
            table=source_table(result),
            lines_title=f"{len(result.sources.of_the_file)} parameters are the model file's rather than the data's",
            lines=(", ".join(result.sources.of_the_file),),
        ),
    ]
    further = further_drive_table(result)
    if further.rows:
        words = "Beside the plain kinds; what is within its standard error of zero is left out."
        sections.append(Section("Further friction and transmission", words, table=further))
    if result.friction.chosen:
        words = f"Of {result.friction.asked} candidates; errors in cross-validation over stretches of time."
        sections.append(Section("Choice of friction", words, table=choice_table(result)))
    if result.mistakes:
        sections.insert(
            0,
            Section(
                "The log against the model file",
                "Signs, units or orders of columns that would explain the log far better. A torque that clearly has "
                "the other sign was taken so; nothing else was changed.",
                table=mistake_table(result.mistakes),
            ),
        )
    return sections


def _origin_sections(result: IdentificationResult, origin: Origin) -> list[Section]:
    """Command, inputs and settings: what it takes to get the same again."""
    inputs = origin.table() if origin.inputs else None
    settings = tuple(
        f"{field.name} = {getattr(result.choices.settings, field.name)!r}"
        for field in dataclasses.fields(result.choices.settings)
    )
    text = f"casysid {version()}." + (f" Command: {origin.command}" if origin.command else "")
    return [
        Section(
            "Where it comes from",
            text,
            table=inputs,
            lines_title="All settings, with what was chosen from the data",
            lines=settings,
        )
    ]


def _bytes(result: IdentificationResult, origin: Origin | None) -> bytes:
    return render_report(result, origin).encode(errors="backslashreplace")
