"""The pipeline: recordings in, identified parameters with their check out."""

from casysid.identification.bands import torque_band
from casysid.identification.choices import Choices
from casysid.identification.comparison import Comparison, compare
from casysid.identification.links import LinkProperties
from casysid.identification.mistakes import Mistake, MistakeKind, find_mistakes
from casysid.identification.pipeline import Preparation, identify, prepare, solve
from casysid.identification.prediction import TorqueError, torque_error
from casysid.identification.result import IdentificationResult
from casysid.identification.settings import Settings
from casysid.identification.sources import Excitation, Sources
from casysid.identification.tuning.band import BandChoice, choose_band

__all__ = [
    "BandChoice",
    "Choices",
    "Comparison",
    "Excitation",
    "IdentificationResult",
    "LinkProperties",
    "Mistake",
    "MistakeKind",
    "Preparation",
    "Settings",
    "Sources",
    "TorqueError",
    "choose_band",
    "compare",
    "find_mistakes",
    "identify",
    "prepare",
    "solve",
    "torque_band",
    "torque_error",
]
