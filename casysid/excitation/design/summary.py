"""What a designed motion will and will not tell, in words and figures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from casysid.arrays import Array
from casysid.excitation.design.information import FLOOR
from casysid.excitation.design.result import ExcitationDesign
from casysid.identifiability import Identifiability
from casysid.threads import single_threaded

WEAK = 0.5
"""A base parameter whose expected standard deviation is more than this share of its value is known weakly."""
NOTHING = 1e-3
"""Less than this share of its expected standard deviation is no value: the file says nothing of it."""


@dataclass(frozen=True, kw_only=True)
class Group:
    """Base parameters of one kind and owner.

    Attributes:
        owner: A link or a joint.
        kind: first moment, inertia, friction, ...
        before: Expected standard deviation from what was known, in the scaled units, root mean square; inf for unknown.
        after: With the motion.
    """

    owner: str
    kind: str
    before: float
    after: float


def expected_std(design: ExcitationDesign) -> Array:
    """Expected standard deviation of each base parameter in its unit, shape (r,), under the torque noise assumed."""
    problem = design.problem
    return np.asarray(_std(design.information, FLOOR * problem.measured) * problem.information.scale)


@single_threaded()
def information_groups(design: ExcitationDesign) -> tuple[Group, ...]:
    """Expected standard deviations by link and kind of parameter, before and after."""
    problem = design.problem
    parameters = problem.information.regressor.parameters
    floor = FLOOR * problem.measured
    before = _std(problem.known, floor) if problem.known.any() else np.full(len(problem.known), np.inf)
    after = _std(design.information, floor)
    members: dict[tuple[str, str], list[int]] = {}
    for k, column in enumerate(problem.information.base.independent):
        parameter = parameters[int(column)]
        kind = (
            "mass" if parameter.kind == "m" else "first moment" if parameter.kind.startswith("mc") else parameter.kind
        )
        kind = "inertia" if kind.startswith("I") else kind
        members.setdefault((parameter.owner, kind), []).append(k)
    return tuple(
        Group(
            owner=owner,
            kind=kind,
            before=float(np.sqrt(np.mean(before[chosen] ** 2))),
            after=float(np.sqrt(np.mean(after[chosen] ** 2))),
        )
        for (owner, kind), chosen in members.items()
    )


@single_threaded()
def describe(design: ExcitationDesign) -> tuple[str, ...]:
    """Sentences for a reader: the motion, the check, what remains unknown, what was assumed."""
    problem, checked = design.problem, design.check()
    series = problem.series
    lines = [
        f"{series.harmonics} harmonics of {1.0 / series.period:.4g} Hz, {problem.periods} period(s) of "
        f"{series.period:.6g} s, at rest at the start and after every period.",
        f"The design {design.status.value}.",
        f"In scaled units the information has log det {design.log_det:.4g}, condition number "
        f"{design.condition_number:.4g}.",
        f"Checked at {checked.samples} instants of a period: "
        + ("every limit is kept." if checked.passed else f"violated: {checked.violations[0]}."),
        *(f"Nearest: {margin}." for margin in checked.tightest),
        *_unknown(design),
        *(f"Assumed: {note}." for note in problem.notes),
    ]
    return tuple(lines)


def _unknown(design: ExcitationDesign) -> list[str]:
    information = design.problem.information
    base, parameters = information.base, information.regressor.parameters
    kinds = base.identifiability()
    never = [one.name for one, kind in zip(parameters, kinds, strict=True) if kind is Identifiability.NOT_AT_ALL]
    mixed = [one.name for one, kind in zip(parameters, kinds, strict=True) if kind is Identifiability.COMBINED]
    lines = [f"{base.rank} combinations of {len(parameters)} parameters can be known from joint torques."]
    if never:
        lines.append(f"Never, whatever the motion: {', '.join(never)}.")
    if mixed:
        lines.append(f"Only in combination with others: {', '.join(mixed)}.")
    std, value = expected_std(design), np.abs(base.transform @ information.regressor.prior)
    words = base.words()
    weak = [k for k in np.argsort(-std / np.maximum(value, 1e-300)) if NOTHING * std[k] < value[k] < std[k] / WEAK]
    lines += [f"Weakly known after this motion: {words[k]} = {value[k]:.3g} ± {std[k]:.3g}." for k in weak]
    return lines


def _std(information: Array, floor: float) -> Array:
    return np.sqrt(np.diag(np.linalg.inv(information + floor * np.eye(len(information)))))
