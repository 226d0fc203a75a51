"""The pipeline: recordings in, identified parameters with their check out."""

from casysid.identification.bands import torque_band
from casysid.identification.comparison import Comparison, compare
from casysid.identification.cutoff import CutoffChoice, choose_cutoff
from casysid.identification.links import LinkProperties
from casysid.identification.mistakes import Mistake, MistakeKind, find_mistakes
from casysid.identification.pipeline import Preparation, identify, prepare, solve
from casysid.identification.prediction import TorqueError, torque_error
from casysid.identification.result import IdentificationResult
from casysid.identification.settings import Settings
from casysid.identification.sources import Excitation, Sources

__all__ = [
    "Comparison",
    "CutoffChoice",
    "Excitation",
    "IdentificationResult",
    "LinkProperties",
    "Mistake",
    "MistakeKind",
    "Preparation",
    "Settings",
    "Sources",
    "TorqueError",
    "choose_cutoff",
    "compare",
    "find_mistakes",
    "identify",
    "prepare",
    "solve",
    "torque_band",
    "torque_error",
]
