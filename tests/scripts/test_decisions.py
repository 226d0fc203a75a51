"""The table of decisions has every numeric constant of the chain, with its value and its origin, and no other."""

import dataclasses
import importlib
import re
import sys
from pathlib import Path

import pytest

SCRIPTS = Path(__file__).resolve().parents[2] / "scripts"
MOST_THAT_DECIDE = 40


@pytest.fixture(scope="module")
def counting():
    """The module of the scripts' folder."""
    sys.path.insert(0, str(SCRIPTS))
    yield importlib.import_module("count_constants")
    sys.path.remove(str(SCRIPTS))


@pytest.fixture(scope="module")
def rows(counting):
    """Of the table."""
    return counting.rows_of(counting.TABLE.read_text(encoding="utf-8"))


def test_every_constant_is_in_the_table_with_its_value_and_no_other(counting, rows):
    assert counting.differences(counting.constants_of_the_chain(), rows) == []


def test_every_row_says_what_it_does_and_where_it_comes_from(rows):
    origins = ("formula", "standard", "measured", "judgement", "rounding", "tolerance", "effort")
    for row in rows:
        assert row.role in ("decides", "computes", "tells")
        assert row.origin.startswith(tuple(f"{origin}: " for origin in origins)), row


def test_few_constants_decide_and_none_of_them_is_a_matter_of_computation(rows):
    deciding = [row for row in rows if row.role == "decides"]
    assert 0 < len(deciding) <= MOST_THAT_DECIDE
    assert not [row for row in deciding if row.origin.startswith(("rounding", "tolerance", "effort"))]


def test_scripts_that_are_named_as_origins_exist(rows):
    named = {name for row in rows for name in re.findall(r"scripts/(\w+\.py)", row.origin)}
    assert named
    assert [name for name in named if not (SCRIPTS / name).exists()] == []


def test_what_is_counted(counting):
    source = """
A = 1.0
B, C = 2, -3
D = (1e-6, 1e6)
E = np.pi / 180.0
F = np.geomspace(0.01, 100.0, 185)
G: float = 0.5
WORD, FLAG, KINDS, TYPE = "word", True, ("a", "b"), npt.NDArray[np.bool_]
def f():
    H = 1.0
"""
    assert [one.name for one in counting.constants_of(source, "m.py")] == list("ABCDEFG")


def test_missing_changed_and_invented_constants_are_told(counting, rows):
    constants = [row.constant for row in rows]
    changed = dataclasses.replace(constants[0], value="17")
    assert len(counting.differences(constants[1:], rows)) == 1
    assert len(counting.differences(constants, rows[1:])) == 1
    assert len(counting.differences([changed, *constants[1:]], rows)) == 2
