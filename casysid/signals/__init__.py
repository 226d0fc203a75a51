"""From logged positions and torques to clean ``q, v, a`` and equations below a cut-off."""

from casysid.signals.alignment import aligned
from casysid.signals.averaging import BandAverage, PieceWindows, piece_windows, window_reach
from casysid.signals.input_noise import InputNoise, NoiseLevels, find_input_noise, mean_input_noise
from casysid.signals.motion import (
    Motion,
    MotionPiece,
    MotionScales,
    joined_motions,
    longest_bridge,
    low_passed,
    motion_from_recording,
    motion_pieces,
)
from casysid.signals.noise import (
    band_of,
    cutoff_of,
    motion_band,
    noise_of,
    position_noise,
    smoothing_cutoff,
    spectrum_of,
    speed_of,
)
from casysid.signals.smoothing import Smoother, build_smoother

__all__ = [
    "BandAverage",
    "InputNoise",
    "Motion",
    "MotionPiece",
    "MotionScales",
    "NoiseLevels",
    "PieceWindows",
    "Smoother",
    "aligned",
    "band_of",
    "build_smoother",
    "cutoff_of",
    "find_input_noise",
    "joined_motions",
    "longest_bridge",
    "low_passed",
    "mean_input_noise",
    "motion_band",
    "motion_from_recording",
    "motion_pieces",
    "noise_of",
    "piece_windows",
    "position_noise",
    "smoothing_cutoff",
    "spectrum_of",
    "speed_of",
    "window_reach",
]
