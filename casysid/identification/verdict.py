"""Accepted or rejected, and why: what an engineer should read first."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from casysid.estimation import Status
from casysid.identification.result import IdentificationResult

WORTH_NAMING = 6
"""Names in one sentence; of more, the number is told."""
FAR_OFF = 3.0
"""Factor between a mass that the data do not tell and the file's beyond which both are shown."""
MUCH_WORSE, WORTH_A_REMARK = 1.5, 0.1
"""Held-out error over the fitted one, and held-out error at least, for a remark; a judgement, nothing was measured."""


@dataclass(frozen=True)
class Verdict:
    """The judgement on an identification.

    Attributes:
        accepted: Whether a controller may use the parameters.
        reasons: Why not, one sentence each; empty when accepted.
        remarks: What is weak although the answer stands.
    """

    accepted: bool
    reasons: tuple[str, ...]
    remarks: tuple[str, ...]

    @property
    def headline(self) -> str:
        """One word."""
        return "accepted" if self.accepted else "rejected"


def judge(result: IdentificationResult) -> Verdict:
    """Judge a result by its consistency, its prediction of unseen data, and its solver's word."""
    reasons = tuple(_reasons(result))
    return Verdict(not reasons, reasons, tuple(_remarks(result)))


def _reasons(result: IdentificationResult) -> list[str]:
    reasons = []
    if result.status is not Status.CONVERGED:
        reasons.append(f"The estimator did not finish: {result.status.value}.")
    if links := result.inconsistent_links:
        reasons.append(f"No body can have the inertia of {_names(links)}: the pseudo-inertia is not positive definite.")
    if negative := result.negative_drive_parameters:
        reasons.append(f"Negative where physics allows none: {_names(negative)}.")
    error = (result.held_out or result.train).relative
    if not error < 1.0:
        reasons.append(f"The model explains nothing: its torque error is {error:.0%} of the torque.")
    if not error < result.file.relative:
        reasons.append(
            f"The model file's own parameters predict better: {result.file.relative:.1%} torque error, not {error:.1%}."
        )
    return reasons


def _remarks(result: IdentificationResult) -> list[str]:
    found = (result.time_base.reason, result.torque_gains.reason)
    remarks = [f"{reason[:1].upper()}{reason[1:]}." for reason in found if reason]
    if result.held_out is None:
        remarks.append("No recording was held out: the error is that of the fit, and flatters.")
    missing = result.structural.rank - result.excited.rank
    if missing > 0:
        remarks.append(
            f"The recordings show {result.excited.rank} of the {result.structural.rank} base parameters; the others "
            "stay at the model file's values. Move the joints more, and differently."
        )
    if result.excited.condition_number > 1000.0:
        remarks.append(
            f"The recordings excite weakly: condition number {result.excited.condition_number:.0f}, below 100 is good."
        )
    still = [
        dof
        for k, dof in enumerate(result.robot.dofs)
        if np.all(np.concatenate([motion.v[:, k] for motion in result.train_motions]) ** 2 < 1e-12)
    ]
    if still:
        remarks.append(f"Never moved: {_names(still)}. Its friction and much of its inertia cannot be identified.")
    if unseen := _far_off_unseen(result):
        remarks.append(
            f"Mass that the data cannot see and that is far from the file's: {_names(unseen)}. Only combinations with "
            "other links are reliable; weigh a link or the robot and give it as knowledge."
        )
    if result.held_out is not None:
        missed, fitted = result.held_out.relative, result.train.relative
        if missed > max(MUCH_WORSE * fitted, WORTH_A_REMARK):
            remarks.append(
                f"Held-out recordings are missed by {missed:.1%}, the fitted ones by {fitted:.1%}: they hold motion or "
                "friction that was not fitted. Fit more recordings, of other motions."
            )
        poor = [
            dof for dof, error in zip(result.robot.dofs, result.held_out.relative_by_joint, strict=True) if error > 1.0
        ]
        if poor:
            remarks.append(f"Torque not explained at all on held-out data: {_names(poor)}.")
    return remarks


def _far_off_unseen(result: IdentificationResult) -> list[str]:
    """Links whose mass no torque tells by itself, and is several times or a fraction of the file's."""
    file = result.regressor.robot.inertial_parameters.reshape(-1, 10)[:, 0]
    return [
        f"{link.name} {link.mass:.3g} kg (file {mass:.3g} kg)"
        for link, mass in zip(result.links(), file, strict=True)
        if np.isinf(link.mass_std) and mass > 0.0 and not 1.0 / FAR_OFF < link.mass / mass < FAR_OFF
    ]


def _names(names: tuple[str, ...] | list[str]) -> str:
    shown = ", ".join(names[:WORTH_NAMING])
    return shown if len(names) <= WORTH_NAMING else f"{shown} and {len(names) - WORTH_NAMING} more"
