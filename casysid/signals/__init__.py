"""From logged positions and torques to clean ``q, v, a, tau``."""

from casysid.signals.motion import Motion, motion_from_recording
from casysid.signals.noise import motion_band, position_noise
from casysid.signals.smoothing import Smoother, build_smoother

__all__ = ["Motion", "Smoother", "build_smoother", "motion_band", "motion_from_recording", "position_noise"]
