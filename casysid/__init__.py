"""Robot dynamics identification: errors in variables, physically consistent, with honest uncertainty.

Names are imported on first use, so that ``import casysid`` and the command line's help stay light.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from casysid.bundled import find_model as find_model
    from casysid.dynamics import Coupling as Coupling
    from casysid.dynamics import build_dynamics as build_dynamics
    from casysid.dynamics import build_regressor as build_regressor
    from casysid.dynamics import generate_c as generate_c
    from casysid.estimation import ErrorsInVariables as ErrorsInVariables
    from casysid.estimation import OrdinaryLeastSquares as OrdinaryLeastSquares
    from casysid.estimation import Ridge as Ridge
    from casysid.estimation import WeightedLeastSquares as WeightedLeastSquares
    from casysid.excitation import build_excitation as build_excitation
    from casysid.excitation import design_excitation as design_excitation
    from casysid.excitation import write_excitation as write_excitation
    from casysid.experiment import read_experiment as read_experiment
    from casysid.experiment import run_experiment as run_experiment
    from casysid.identification import IdentificationResult as IdentificationResult
    from casysid.identification import Settings as Settings
    from casysid.identification import compare as compare
    from casysid.identification import identify as identify
    from casysid.identification import prepare as prepare
    from casysid.identification.many import identify_fleet as identify_fleet
    from casysid.identification.many import identify_many as identify_many
    from casysid.identification.output import write_result as write_result
    from casysid.identification.saved import SavedResult as SavedResult
    from casysid.identification.saved import read_result as read_result
    from casysid.inertia import Consistency as Consistency
    from casysid.kinematics import Kinematics as Kinematics
    from casysid.model import RobotModel as RobotModel
    from casysid.moments import Moments as Moments
    from casysid.online import Online as Online
    from casysid.payload import identify_payload as identify_payload
    from casysid.reaching import InverseKinematics as InverseKinematics
    from casysid.reaching import LookAt as LookAt
    from casysid.reaching import PoseTarget as PoseTarget
    from casysid.recording import Recording as Recording
    from casysid.recording import open_recording as open_recording
    from casysid.recording import open_recordings as open_recordings
    from casysid.recording import read_recording as read_recording
    from casysid.recording import read_recordings as read_recordings
    from casysid.report import write_report as write_report
    from casysid.robot import Robot as Robot
    from casysid.robot import write_robot as write_robot
    from casysid.simulation import ComputedTorque as ComputedTorque
    from casysid.simulation import Plant as Plant
    from casysid.simulation import simulate as simulate
    from casysid.validation import rehearse as rehearse

__version__ = "0.1.0"

_HOMES = {
    "ComputedTorque": "casysid.simulation",
    "Consistency": "casysid.inertia",
    "Coupling": "casysid.dynamics",
    "ErrorsInVariables": "casysid.estimation",
    "IdentificationResult": "casysid.identification",
    "InverseKinematics": "casysid.reaching",
    "Kinematics": "casysid.kinematics",
    "LookAt": "casysid.reaching",
    "Moments": "casysid.moments",
    "Online": "casysid.online",
    "OrdinaryLeastSquares": "casysid.estimation",
    "Plant": "casysid.simulation",
    "PoseTarget": "casysid.reaching",
    "Recording": "casysid.recording",
    "Ridge": "casysid.estimation",
    "Robot": "casysid.robot",
    "RobotModel": "casysid.model",
    "SavedResult": "casysid.identification.saved",
    "Settings": "casysid.identification",
    "WeightedLeastSquares": "casysid.estimation",
    "build_dynamics": "casysid.dynamics",
    "build_excitation": "casysid.excitation",
    "build_regressor": "casysid.dynamics",
    "compare": "casysid.identification",
    "design_excitation": "casysid.excitation",
    "find_model": "casysid.bundled",
    "generate_c": "casysid.dynamics",
    "identify": "casysid.identification",
    "identify_payload": "casysid.payload",
    "identify_fleet": "casysid.identification.many",
    "identify_many": "casysid.identification.many",
    "open_recording": "casysid.recording",
    "open_recordings": "casysid.recording",
    "prepare": "casysid.identification",
    "read_experiment": "casysid.experiment",
    "read_recording": "casysid.recording",
    "read_recordings": "casysid.recording",
    "read_result": "casysid.identification.saved",
    "rehearse": "casysid.validation",
    "run_experiment": "casysid.experiment",
    "simulate": "casysid.simulation",
    "write_excitation": "casysid.excitation",
    "write_report": "casysid.report",
    "write_result": "casysid.identification.output",
    "write_robot": "casysid.robot",
}

__all__ = sorted(_HOMES)


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'casysid' has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
