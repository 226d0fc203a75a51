"""Trials of errors in variables cover their grid, and tables put together what differs by seeds alone."""

import importlib
import sys
from pathlib import Path

import pytest

SCRIPTS = Path(__file__).resolve().parents[2] / "scripts"


@pytest.fixture(scope="module")
def measures():
    """The module of the scripts' folder."""
    sys.path.insert(0, str(SCRIPTS))
    yield importlib.import_module("noisy_measures")
    sys.path.remove(str(SCRIPTS))


def test_every_place_on_the_grid_is_run_with_every_seed_and_the_first_seed_first(measures):
    places = measures.MEASURES["unordered"].places(["head", "arm"], 3)
    assert len(places) == 2 * len(measures.SHARES) * 3
    assert len({tuple(place.values()) for place in places}) == len(places)
    assert [place["seed"] for place in places] == sorted(place["seed"] for place in places)


def test_a_table_has_one_row_for_all_seeds_with_the_ratio_of_root_mean_squares(measures):
    found = [(0, 3.0, 4.0), (1, 4.0, 3.0), (2, 1.0, 2.0)]
    trials = [
        {"seed": seed, "robot": "a/b.urdf", "noise": 1e-3, "highest": highest}
        | {"ours": ours, "rival": rival, "true motion": 1.0}
        for highest, chosen in ((2.0, found[:2]), (6.0, found[2:]))
        for seed, ours, rival in chosen
    ]
    slow, fast = measures.MEASURES["accuracy"].table(trials)
    assert (slow["robot"], slow["highest"], slow["seeds"], fast["seeds"]) == ("b", 2.0, 2, 1)
    assert slow["ours / rival"] == pytest.approx(1.0)
    assert fast["ours / rival"] == pytest.approx(0.5)


def test_flatness_is_the_spread_over_cut_offs_of_what_the_seeds_give_together(measures):
    place = {"robot": "head", "noise": 1e-3, "highest": 2.0}
    trials = [place | {"seed": seed, "eiv": [1.0, 2.0], "wls": [3.0, 30.0]} for seed in range(2)]
    (row,) = measures.MEASURES["flatness"].table(trials)
    assert row["spread of eiv"] == pytest.approx(2.0)
    assert row["spread of wls"] == pytest.approx(10.0)


def test_a_trial_keeps_its_place_beside_its_figures(measures):
    place = {"seed": 0, "robot": "two_link", "noise": 1e-3, "highest": 2.0, "step": 0.0}
    found = measures.run("noise", place, 10.0)
    assert place.items() <= found.items()
    assert 0.8 < found["lowest"] <= found["largest"] < 1.2
