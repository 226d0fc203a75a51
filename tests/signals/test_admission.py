import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from casysid.errors import ParameterError, RecordingError
from casysid.recording import Recording
from casysid.signals import NoiseLevels
from casysid.signals.admission import FEWEST, check_noise, check_recordings


def recording(samples: int, rate: float = 100.0, *, gap_at: int | None = None, timed: bool = True) -> Recording:
    time = np.arange(samples) / rate
    if gap_at is not None:
        time[gap_at:] += 1000.0 / rate
    wave = np.sin(time)[:, None]
    return Recording(
        channels=("j",),
        dofs=("j",),
        position=wave,
        torque=wave,
        time=time if timed else None,
        velocity=None if timed else wave,
        acceleration=None if timed else wave,
        sources=("log.csv",),
    )


@given(st.integers(20, 200), st.floats(2.0, 5000.0))
def test_short_recordings_are_refused_whatever_their_rate(samples, rate):
    if samples >= FEWEST:
        check_recordings([recording(samples, rate)])
    else:
        with pytest.raises(RecordingError, match=rf"log\.csv: {samples} samples in time are too few; wanted 100"):
            check_recordings([recording(samples, rate)])


def test_the_longest_stretch_counts_and_unordered_samples_pass():
    check_recordings([recording(20, timed=False)])
    check_recordings([recording(150, gap_at=40)])
    with pytest.raises(RecordingError, match="80 samples in time without a gap"):
        check_recordings([recording(120, gap_at=40)])


def test_what_is_asked_for_must_be_shown():
    ten_seconds = [recording(1000)]
    check_recordings(ten_seconds, cutoff=0.2, delay=0.1, time_scale=1.0)
    for asked, message in (
        ({"cutoff": 1e9}, "cut-off: 1e\\+09 Hz is outside"),
        ({"cutoff": 0.05}, "0.1 to 50 Hz"),
        ({"cutoff": 10.0, "time_scale": 10.0}, "to 5 Hz"),
        ({"delay": -6.0}, "delay: -6 s is more than half"),
        ({"time_scale": 1e9}, "time scale: with 1e\\+09"),
        ({"time_scale": 1e-9}, "time scale: with 1e-09"),
    ):
        with pytest.raises(ParameterError, match=message):
            check_recordings(ten_seconds, **asked)


def test_noise_that_is_not_used_is_not_taken_in_silence():
    noise = NoiseLevels(position=1e-4, velocity=0.1)
    check_noise([recording(20, timed=False)], noise)
    check_noise([recording(200)], NoiseLevels(position=1e-4))
    with pytest.raises(ParameterError, match="noise of velocity: the recordings have time"):
        check_noise([recording(200)], noise)
