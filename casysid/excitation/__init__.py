"""Excitation: the motion from whose recording the parameters can be known best, within all limits.

Build a problem (:func:`build_excitation`), then design (:func:`design_excitation`). What comes back has been checked on
a grid ten times finer than the one it was optimised on, and can check itself again.
"""

from casysid.excitation.building import build_excitation, choose_series, keep_in
from casysid.excitation.capsules import Capsule, capsules_of
from casysid.excitation.cartesian_blocks import KeepInBlock
from casysid.excitation.clearance import Box, HalfSpace
from casysid.excitation.criteria import AOptimal, Balanced, ConditionNumber, Criterion, DOptimal
from casysid.excitation.design import design_excitation, design_set
from casysid.excitation.earlier import after_recordings, after_result
from casysid.excitation.limits import JointLimits, limits_of
from casysid.excitation.output import write_excitation
from casysid.excitation.problem import ExcitationProblem, parameter_accuracy, torque_accuracy
from casysid.excitation.results import DesignStatus, DesignStep, ExcitationDesign, StartReport
from casysid.excitation.series import ExcitationTrajectory, FourierSeries
from casysid.excitation.verification import Margin, Verification, verify, verify_recorded
from casysid.excitation.words import describe, information_groups

__all__ = [
    "AOptimal",
    "Balanced",
    "Box",
    "Capsule",
    "ConditionNumber",
    "Criterion",
    "DOptimal",
    "DesignStatus",
    "DesignStep",
    "ExcitationDesign",
    "ExcitationProblem",
    "ExcitationTrajectory",
    "FourierSeries",
    "HalfSpace",
    "JointLimits",
    "KeepInBlock",
    "Margin",
    "StartReport",
    "Verification",
    "after_recordings",
    "after_result",
    "build_excitation",
    "capsules_of",
    "choose_series",
    "describe",
    "design_excitation",
    "design_set",
    "information_groups",
    "keep_in",
    "limits_of",
    "parameter_accuracy",
    "torque_accuracy",
    "verify",
    "verify_recorded",
    "write_excitation",
]
