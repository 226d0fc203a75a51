"""What a recording must have before anything is computed from it: samples, and a band that they can show."""

from __future__ import annotations

from collections.abc import Sequence

from casysid.errors import ParameterError, RecordingError
from casysid.recording import Source
from casysid.signals.input_noise import NoiseLevels

FEWEST = 100
"""Samples in time: five stretches are left out one after the other, and twenty samples are the least that a
spline and its derivatives are fitted to."""
FEWEST_TO_PREDICT = 20
"""Samples in time of a recording that is only predicted."""
SLOWEST, FASTEST = 1.0, 1e6
"""Rates of logs [Hz], as the readers take them."""


def check_recordings(
    recordings: Sequence[Source],
    *,
    cutoff: float | None = None,
    time_scale: float | None = None,
    delay: float | None = None,
    fewest: int = FEWEST,
    base_is_free: bool = False,
) -> None:
    """Nothing, if recordings are long enough to smooth, and what is asked for lies within what they show.

    Args:
        recordings: To be fitted or predicted; unordered samples pass.
        cutoff: Of the low-pass [Hz]; None where it is chosen.
        time_scale: Time stamps times this are seconds; None for 1.
        delay: Of the torque [s]; None where it is chosen.
        fewest: Samples in time that each must have.
        base_is_free: Whether the rows of a free base hold where no torque was measured.

    Raises:
        RecordingError: A recording is too short, or lacks the torque of a joint.
        ParameterError: Cut-off, time scale or delay are outside what one can show.
    """
    for recording in recordings:
        if recording.unmeasured and not base_is_free:
            locks = " ".join(f"--lock {joint}=VALUE" for joint in recording.unmeasured)
            raise RecordingError(
                f"{recording.label}: no torque was measured at {', '.join(recording.unmeasured)}, so nothing is known "
                f"of it; hold it: {locks}"
            )
    for recording in (one for one in recordings if one.has_time):
        _check_length(recording, fewest)
        scale = 1.0 if time_scale is None else time_scale
        duration, rate = recording.duration * scale, recording.rate / scale
        if not SLOWEST < rate <= FASTEST and time_scale is not None:
            raise ParameterError(
                f"time scale: with {scale:g}, {recording.label} has {rate:.4g} samples a second; wanted {SLOWEST:g} to "
                f"{FASTEST:g}. Time stamps times the scale are seconds"
            )
        if cutoff is not None and not 1.0 / duration <= cutoff <= 0.5 * rate:
            raise ParameterError(
                f"cut-off: {cutoff:g} Hz is outside what {recording.label} can show, {1.0 / duration:.3g} to "
                f"{0.5 * rate:.4g} Hz (one over its duration, half its rate)"
            )
        if delay is not None and abs(delay) > 0.5 * duration:
            raise ParameterError(
                f"delay: {delay:g} s is more than half of {recording.label}, which lasts {duration:.4g} s"
            )


def check_noise(recordings: Sequence[Source], noise: NoiseLevels) -> None:
    """Nothing, if what is said of the noise is of something that is used.

    Raises:
        ParameterError: Noise of velocities or accelerations is given, but all recordings have time.
    """
    if recordings and all(recording.has_time for recording in recordings):
        for name in ("velocity", "acceleration"):
            if getattr(noise, name) is not None:
                raise ParameterError(
                    f"noise of {name}: the recordings have time, so {name} is taken from the positions and its noise "
                    "from theirs; give that of the positions, or leave time out of the recordings"
                )


def _check_length(recording: Source, fewest: int) -> None:
    stretches = recording.stretches()
    longest = max(one.rows.stop - one.rows.start for one in stretches)
    if longest < fewest:
        gaps = " without a gap" if len(stretches) > 1 else ""
        raise RecordingError(
            f"{recording.label}: {longest} samples in time{gaps} are too few; wanted {fewest} or more. Record longer, "
            "or at a higher rate"
        )
