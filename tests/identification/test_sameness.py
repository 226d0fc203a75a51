"""A recording that judges the fit is not the one that was fitted."""

import dataclasses

import pytest

from casysid.errors import CasysidWarning, RecordingError
from casysid.identification.sameness import check_sameness, fingerprint
from tests.simulated import simulated_run


@pytest.fixture(scope="module")
def recording():
    return simulated_run("two_link.urdf", 0).recording


def copy_of(recording):
    return dataclasses.replace(recording, time=recording.time + 5.0, sources=("copy.csv",))


def test_a_copy_is_refused_as_held_out_whatever_its_name_and_clock(recording):
    with pytest.raises(RecordingError, match=r"copy.csv: is held out, but holds the same samples"):
        check_sameness([recording], [copy_of(recording)])


def test_a_recording_that_is_fitted_twice_is_named(recording):
    with pytest.warns(CasysidWarning, match="count twice"):
        check_sameness([recording, copy_of(recording)], [])


def test_parts_of_one_recording_are_not_alike(recording):
    first, second = recording.split(0.5)
    check_sameness([first], [second])
    assert fingerprint(first) != fingerprint(second)
