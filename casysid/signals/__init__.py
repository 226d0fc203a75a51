"""From logged positions and torques to clean ``q, v, a`` and equations below a cut-off."""

from casysid.signals.alignment import aligned
from casysid.signals.averaging import BandAverage
from casysid.signals.motion import Motion, disturbed, low_passed, motion_from_recording
from casysid.signals.noise import motion_band, position_noise
from casysid.signals.smoothing import Smoother, build_smoother

__all__ = [
    "BandAverage",
    "Motion",
    "Smoother",
    "aligned",
    "build_smoother",
    "disturbed",
    "low_passed",
    "motion_band",
    "motion_from_recording",
    "position_noise",
]
