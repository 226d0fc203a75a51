"""Excerpts are stretches of the recordings, few enough, and nothing is cut from what is short."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.identification.excerpts import PIECES, excerpts
from casysid.recording import Recording


def recording(samples, *, timed=True):
    column = np.arange(float(samples))[:, None]
    return Recording(
        channels=("a",),
        dofs=("a",),
        time=column[:, 0] if timed else None,
        position=column,
        torque=column,
        velocity=column,
        acceleration=column,
    )


@settings(deadline=None)
@given(st.lists(st.integers(40, 4000), min_size=1, max_size=4), st.integers(400, 4000), st.booleans())
def test_they_are_no_more_than_enough_and_in_order(lengths, enough, timed):
    recordings = [recording(samples, timed=timed) for samples in lengths]
    parts = excerpts(recordings, enough)
    assert sum(map(len, parts)) <= max(enough, 0) or sum(lengths) <= enough
    for part in parts:
        steps = np.diff(part.position[:, 0])
        assert (steps == 1.0).all() if timed else (steps > 0.0).all()


def test_short_recordings_are_taken_whole():
    recordings = [recording(100), recording(50)]
    assert excerpts(recordings, 150) == tuple(recordings)
    assert excerpts([recordings[1], recording(5000)], 200)[0] is recordings[1]


def test_stretches_reach_from_the_first_sample_to_the_last():
    parts = excerpts([recording(10_000)], 1000)
    assert len(parts) == PIECES
    assert parts[0].position[0, 0] == 0.0
    assert parts[-1].position[-1, 0] == 9999.0
