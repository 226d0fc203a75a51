"""A result in plain words, and where it comes from: for whoever is handed the report."""

from __future__ import annotations

import hashlib
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from casysid.identifiability import Identifiability
from casysid.identification import IdentificationResult
from casysid.report.tables import Table, number, percent

WELL_KNOWN = 0.1
"""Standard error over value at most, of a base parameter that is called well known: one digit that can be trusted."""
SHOWN = 6
"""Names in one sentence; of more, the number is told."""


@dataclass(frozen=True)
class Origin:
    """Where a result comes from.

    Attributes:
        command: As it was typed; empty where nobody typed one.
        inputs: SHA-256 by file.
    """

    command: str = ""
    inputs: Mapping[str, str] = field(default_factory=dict)

    @classmethod
    def of(cls, files: Sequence[str | Path], command: Sequence[str] = ()) -> Origin:
        """Of files that are there, in this order; folders and files that went are named without a digest."""
        return cls(shlex.join(command), {str(path): _digest(Path(path)) for path in files})

    def table(self) -> Table:
        """The inputs."""
        return Table(("input", "SHA-256"), tuple((name, digest or "–") for name, digest in self.inputs.items()))


def summary_sentences(result: IdentificationResult) -> tuple[str, ...]:
    """What was identified from what, how well, what to trust, and what to do next."""
    return (_what(result), _how_well(result), _what_to_trust(result), _what_next(result))


def base_parameter_table(result: IdentificationResult) -> Table:
    """The combinations that the torque depends on, with standard errors: what the data decide and nothing else."""
    value, std = base_parameters(result)
    words, units = result.structural.words(), [one.unit for one in result.regressor.parameters]
    rows = tuple(
        (text, number(float(x), 4 if s < WELL_KNOWN * abs(x) else 2), number(float(s), 2), units[leading])
        for text, x, s, leading in zip(words, value, std, result.structural.independent, strict=True)
    )
    return Table(("combination", "value", "± std", "unit"), rows)


def base_parameters(result: IdentificationResult) -> tuple[np.ndarray, np.ndarray]:
    """Base parameters and their standard errors, shape (r,) each; infinite where the recordings show nothing."""
    B = result.structural.transform
    scatter = result.model.scatter
    std = np.full(len(B), np.inf) if scatter is None else scatter.std(np.asarray(B))
    return B @ result.parameters, std


def _what(result: IdentificationResult) -> str:
    robot, held_out = result.robot, result.held_out
    unseen = f" and tried on {held_out.samples} that were held out" if held_out else ", with none held out"
    return (
        f"The dynamics of '{robot.name}', {len(robot.links)} links and {robot.nv} degrees of freedom with their "
        f"friction, were identified from {result.train.samples} samples{unseen}."
    )


def _how_well(result: IdentificationResult) -> str:
    error = result.held_out or result.train
    kind = "held-out" if result.held_out else "fitted"
    worst = int(np.argmax(error.relative_by_joint))
    return (
        f"The model misses {percent(error.relative)} of the {kind} torque, the robot's file misses "
        f"{percent(result.file.relative)}; the worst joint is {result.robot.dofs[worst]} with "
        f"{percent(float(error.relative_by_joint[worst]))}."
    )


def _what_to_trust(result: IdentificationResult) -> str:
    value, std = base_parameters(result)
    well = int(np.sum(std < WELL_KNOWN * np.abs(value)))
    told = [link.name for link in result.links() if np.isfinite(link.mass_std)]
    masses = f"the masses of {_names(told)} are the data's" if told else "no single mass is the data's"
    return (
        f"Trust torques of motions like the recorded ones: {well} of the {len(value)} combinations that torques depend "
        f"on are known to {WELL_KNOWN:.0%} or better. Of single links, {masses}; the others' numbers follow the file."
    )


def _what_next(result: IdentificationResult) -> str:
    if result.held_out is None:
        return "Next: hold a recording out (--held-out, --split) to learn what the model is worth on another motion."
    _, std = base_parameters(result)
    unseen = int(np.sum(~np.isfinite(std)))
    if unseen:
        return (
            f"Next: {unseen} combinations do not show in these recordings; casysid excite --log RUN/result.json "
            "designs a motion that shows them."
        )
    hidden = result.structural.identifiability()[: 10 * len(result.robot.links)]
    if all(one is Identifiability.ALONE for one in hidden):
        return "Next: hand the model over; nothing is left to be learnt from torques."
    return (
        "Next: hand the model over (casysid.read_result(RUN).model); casysid validate judges it on a recording of the "
        "work that it is meant for."
    )


def _names(names: Sequence[str]) -> str:
    return ", ".join(names) if len(names) <= SHOWN else f"{len(names)} links"


def _digest(path: Path) -> str:
    if not path.is_file():
        return ""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
