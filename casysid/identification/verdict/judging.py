"""The verdict on an identification: what an engineer should read first."""

from __future__ import annotations

import numpy as np

from casysid.estimation import Status
from casysid.identification.result import IdentificationResult
from casysid.identification.verdict.bodies import body_criteria
from casysid.identification.verdict.corrections import correction_criteria
from casysid.identification.verdict.criteria import Verdict, merged, names
from casysid.identification.verdict.evidence import data_criteria
from casysid.identification.verdict.explained import Unexplained, torque_criteria
from casysid.identification.verdict.residuals import residual_criteria

FAR_OFF = 3.0
"""Factor between a mass that the data do not tell and the file's beyond which both are shown."""
WEAK = 1000.0
"""Condition number worth a remark."""


def judge(result: IdentificationResult) -> Verdict:
    """Judge a result by its consistency, its prediction of unseen data, and what had to be done to the log for it."""
    unexplained = Unexplained(result)
    families = (
        body_criteria(result),
        torque_criteria(unexplained),
        residual_criteria(unexplained),
        correction_criteria(result),
        data_criteria(unexplained),
    )
    return Verdict(merged(families), tuple(_remarks(unexplained)), unexplained.set_aside)


def _remarks(unexplained: Unexplained) -> list[str]:
    result = unexplained.result
    found = (result.time_base.reason, result.torque_gains.reason)
    remarks = [f"{reason[:1].upper()}{reason[1:]}." for reason in found if reason]
    if result.status is Status.MAX_ITERATIONS:
        remarks.append(f"The estimator did not finish, but {result.status.value}; what it reached is judged as it is.")
    if result.held_out is None:
        missed = unexplained.by_joint
        most = "none is told" if np.isnan(missed).all() else f"at most {np.nanmax(missed):.1%} of a joint's torque"
        remarks.append(
            "No recording was held out: blocks of time that are predicted from the others stand in, and miss "
            f"{most}. A recording of another motion, held out, tells more."
        )
    missing = result.structural.rank - result.excited.rank
    if missing > 0:
        remarks.append(
            f"The recordings show {result.excited.rank} of the {result.structural.rank} base parameters; the others "
            "stay at the model file's values. Move the joints more, and differently."
        )
    if result.excited.condition_number > WEAK:
        remarks.append(
            f"The recordings excite weakly: condition number {result.excited.condition_number:.0f}, below 100 is good."
        )
    if unseen := _far_off_unseen(result):
        remarks.append(
            f"Mass that the data cannot see and that is far from the file's: {names(unseen)}. Only combinations with "
            "other links are reliable; weigh a link or the robot and give it as knowledge."
        )
    return remarks


def _far_off_unseen(result: IdentificationResult) -> list[str]:
    """Links whose mass no torque tells by itself, and is several times or a fraction of the file's."""
    file = result.regressor.robot.inertial_parameters.reshape(-1, 10)[:, 0]
    return [
        f"{link.name} {link.mass:.3g} kg (file {mass:.3g} kg)"
        for link, mass in zip(result.links(), file, strict=True)
        if np.isinf(link.mass_std) and mass > 0.0 and not 1.0 / FAR_OFF < link.mass / mass < FAR_OFF
    ]
