"""What an identification is for: the robot's dynamics as one object, as code, and as simulators' models."""

from casysid.model.files import MODEL_FILE, SCATTER_FILE, read_model, write_model
from casysid.model.functions import ModelFunctions
from casysid.model.robot_model import RobotModel
from casysid.model.standard_errors import Scatter

__all__ = ["MODEL_FILE", "SCATTER_FILE", "ModelFunctions", "RobotModel", "Scatter", "read_model", "write_model"]
