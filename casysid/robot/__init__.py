"""The robot: read from URDF or MJCF, checked, frozen, and written back."""

from casysid.robot.checks import FaultKind, InertiaFault
from casysid.robot.model import Joint, JointKind, Robot
from casysid.robot.writing import WrittenModel, write_robot

__all__ = ["FaultKind", "InertiaFault", "Joint", "JointKind", "Robot", "WrittenModel", "write_robot"]
