"""The pipeline: recordings in, identified parameters with their check out."""

from casysid.identification.cutoff import CutoffChoice, choose_cutoff
from casysid.identification.links import LinkProperties
from casysid.identification.pipeline import identify
from casysid.identification.prediction import TorqueError, torque_error
from casysid.identification.result import IdentificationResult
from casysid.identification.settings import Settings

__all__ = [
    "CutoffChoice",
    "IdentificationResult",
    "LinkProperties",
    "Settings",
    "TorqueError",
    "choose_cutoff",
    "identify",
    "torque_error",
]
