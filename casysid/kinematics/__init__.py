"""Where links, named frames and the centre of mass are, how fast they move, and how the joints move them."""

from casysid.kinematics.dexterity import Dexterity, dexterity_at, usual_ranks
from casysid.kinematics.frames import Frame, FrameKind, find_frame, frames_of
from casysid.kinematics.kinematics import Kinematics, Pose
from casysid.kinematics.rotations import (
    quaternion_from_rotation,
    rotation_from_quaternion,
    rotation_from_rpy,
    rotation_from_vector,
    rpy_from_rotation,
    vector_from_rotation,
)
from casysid.kinematics.sampling import random_configurations
from casysid.kinematics.symbolic import Axes

__all__ = [
    "Axes",
    "Dexterity",
    "Frame",
    "FrameKind",
    "Kinematics",
    "Pose",
    "dexterity_at",
    "find_frame",
    "frames_of",
    "quaternion_from_rotation",
    "random_configurations",
    "rotation_from_quaternion",
    "rotation_from_rpy",
    "rotation_from_vector",
    "rpy_from_rotation",
    "usual_ranks",
    "vector_from_rotation",
]
