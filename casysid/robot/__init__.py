"""The robot: read from URDF or MJCF, checked, frozen, and written back."""

from casysid.robot.checks import FaultKind, InertiaFault
from casysid.robot.model import Joint, JointKind, Robot

__all__ = ["FaultKind", "InertiaFault", "Joint", "JointKind", "Robot"]
