"""How good parameters are: on recordings, in a controller, and against a hidden truth."""

from casysid.validation.earlier import EarlierResult, read_earlier_result
from casysid.validation.exciting import Excitation
from casysid.validation.output import write_rehearsal
from casysid.validation.perturbation import hidden_truth
from casysid.validation.playback import DesignedMotion, Playback, play
from casysid.validation.prediction import Validation, validate
from casysid.validation.rehearsal import Rehearsal, RehearsalSettings, rehearse
from casysid.validation.tracking import Tracking, measure_tracking, track
from casysid.validation.truth import BaseComparison, compare_base_parameters, true_coefficients, true_torque_error

__all__ = [
    "BaseComparison",
    "DesignedMotion",
    "EarlierResult",
    "Excitation",
    "Playback",
    "Rehearsal",
    "RehearsalSettings",
    "Tracking",
    "Validation",
    "compare_base_parameters",
    "hidden_truth",
    "measure_tracking",
    "play",
    "read_earlier_result",
    "rehearse",
    "track",
    "true_coefficients",
    "true_torque_error",
    "validate",
    "write_rehearsal",
]
