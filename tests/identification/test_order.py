"""An answer does not depend on the order of its recordings, nor on that of their columns."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from casysid.identification import Settings, identify, passes
from casysid.identification.order import as_given, places_by_content
from casysid.readers.writing import write_columns
from casysid.recording import open_recording, read_recording
from casysid.simulation import PlantSettings
from tests.simulated import bundled_robot, simulated_run

ROBOT = "two_link.urdf"
SETTINGS = Settings(choose_friction=False)


@pytest.fixture(scope="module")
def logs():
    return tuple(simulated_run(ROBOT, seed, PlantSettings(), 3.0).recording for seed in range(3))


@given(order=st.permutations(range(3)))
def test_places_sort_the_same_recordings_whatever_their_order_and_name(logs, order):
    given_logs = [dataclasses.replace(logs[k], sources=(f"{place}.csv",)) for place, k in enumerate(order)]
    places = places_by_content(given_logs)
    assert [order[place] for place in places] == list(places_by_content(logs))
    assert as_given([given_logs[place] for place in places], places) == tuple(given_logs)


def test_what_is_not_one_of_each_stays_as_it_is():
    assert as_given("abc", (1, 0)) == ("a", "b", "c")
    assert as_given("ab", (1, 0)) == ("b", "a")


@pytest.mark.parametrize("excerpt", [None, 300])
def test_recordings_in_another_order_give_the_same_bits(logs, excerpt, monkeypatch):
    if excerpt:
        monkeypatch.setattr(passes, "EXCERPTS", 4)
        monkeypatch.setattr(passes, "EXCERPT_ROWS", excerpt)
    assert passes.is_long(logs) is bool(excerpt)
    robot = bundled_robot(ROBOT)
    first = identify(robot, logs, SETTINGS)
    turned = identify(robot, logs[::-1], SETTINGS)
    np.testing.assert_array_equal(turned.parameters, first.parameters)
    np.testing.assert_array_equal(turned.uncertainty.covariance, first.uncertainty.covariance)
    assert turned.train.relative == first.train.relative
    if not excerpt:
        for one, other in zip(turned.train.measured, first.train.measured[::-1], strict=True):
            np.testing.assert_array_equal(one, other)
        for motion, log in zip(turned.train_motions, logs[::-1], strict=True):
            np.testing.assert_array_equal(motion.time, log.time)


def test_columns_in_another_order_are_the_same_recording(logs, tmp_path):
    columns, robot = logs[0].columns(), bundled_robot(ROBOT)
    for name in ("csv", "npz", "parquet"):
        path = write_columns(tmp_path / f"log.{name}", dict(reversed(columns.items())))
        for read in (read_recording(path, robot), open_recording(path, robot).in_memory()):
            for letter, values in columns.items():
                np.testing.assert_array_equal(read.columns()[letter], values)
