"""Excitation: the motion from whose recording the parameters can be known best, within all limits.

Build a problem (:func:`build_excitation`), then design (:func:`design_excitation`). What comes back has been checked on
a grid ten times finer than the one it was optimised on, and can check itself again.
"""

from casysid.excitation.constraints.capsules import Capsule, capsules_of
from casysid.excitation.constraints.keep_in import KeepInConstraint, keep_in
from casysid.excitation.constraints.obstacles import Box, HalfSpace
from casysid.excitation.design.building import build_excitation, choose_series
from casysid.excitation.design.criteria import AOptimal, Balanced, ConditionNumber, Criterion, DOptimal
from casysid.excitation.design.prior import after_recordings, after_result
from casysid.excitation.design.problem import ExcitationProblem, parameter_accuracy, torque_accuracy
from casysid.excitation.design.result import DesignStatus, DesignStep, ExcitationDesign, StartReport
from casysid.excitation.design.summary import describe, information_groups
from casysid.excitation.design.verification import Margin, Verification, verify, verify_recorded
from casysid.excitation.motion.fourier import ExcitationTrajectory, FourierSeries
from casysid.excitation.motion.limits import JointLimits, limits_of
from casysid.excitation.playing.collisions import CollisionCheck, check_collisions
from casysid.excitation.playing.files import write_excitation
from casysid.excitation.playing.played import PlayedMotion
from casysid.excitation.playing.way import Way, find_way
from casysid.excitation.search.design import design_excitation, design_set

__all__ = [
    "AOptimal",
    "Balanced",
    "Box",
    "Capsule",
    "CollisionCheck",
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
    "KeepInConstraint",
    "Margin",
    "PlayedMotion",
    "StartReport",
    "Verification",
    "Way",
    "after_recordings",
    "after_result",
    "build_excitation",
    "capsules_of",
    "check_collisions",
    "choose_series",
    "describe",
    "design_excitation",
    "design_set",
    "find_way",
    "information_groups",
    "keep_in",
    "limits_of",
    "parameter_accuracy",
    "torque_accuracy",
    "verify",
    "verify_recorded",
    "write_excitation",
]
