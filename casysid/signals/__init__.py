"""From logged positions and torques to clean ``q, v, a`` and equations below a cut-off."""

from casysid.signals.alignment import aligned
from casysid.signals.averaging import BandAverage
from casysid.signals.input_noise import InputNoise, NoiseLevels, find_input_noise, mean_input_noise
from casysid.signals.motion import Motion, low_passed, motion_from_recording
from casysid.signals.noise import motion_band, position_noise, smoothing_cutoff
from casysid.signals.smoothing import Smoother, build_smoother

__all__ = [
    "BandAverage",
    "InputNoise",
    "Motion",
    "NoiseLevels",
    "Smoother",
    "aligned",
    "build_smoother",
    "find_input_noise",
    "low_passed",
    "mean_input_noise",
    "motion_band",
    "motion_from_recording",
    "position_noise",
    "smoothing_cutoff",
]
