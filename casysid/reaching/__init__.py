"""Inverse kinematics: postures in which frames reach what they are to reach."""

from casysid.reaching.results import Reach, ReachSettings, ReachStatus
from casysid.reaching.solver import InverseKinematics
from casysid.reaching.targets import LookAt, PoseTarget, Target

__all__ = ["InverseKinematics", "LookAt", "PoseTarget", "Reach", "ReachSettings", "ReachStatus", "Target"]
