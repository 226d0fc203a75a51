"""Circumstances that are no data leave every number of an answer as it is, and the script sees one that is not."""

import argparse
import importlib
import sys
from pathlib import Path

import pytest

SCRIPTS = Path(__file__).resolve().parents[2] / "scripts"


@pytest.fixture(scope="module")
def checking():
    """The module of the scripts' folder."""
    sys.path.insert(0, str(SCRIPTS))
    yield importlib.import_module("check_invariance")
    sys.path.remove(str(SCRIPTS))


def test_every_number_and_word_counts_but_seconds(checking):
    one = {"a": [1.0, {"b": 2.0}], "seconds": 3.0, "word": "x"}
    other = {"a": [1.0, {"b": 2.0 + 2**-51}], "seconds": 4.0}
    assert dict(checking.leaves(one)) == {"/a/0": "1.0", "/a/1/b": "2.0", "/word": "'x'"}
    assert checking.differences(dict(checking.leaves(one)), dict(checking.leaves(other))) == ["/a/1/b", "/word"]


@pytest.mark.slow
def test_all_circumstances_at_once_move_nothing(checking, tmp_path):
    options = argparse.Namespace(duration=4.0, rate=500.0, logs=1)
    checking.write_logs(checking.Robot.from_file(checking.find_model("two_link.urdf")), tmp_path, options)
    ways = list(checking.circumstances(tmp_path))
    together = {name: value for way in ways for name, value in way.variables.items()}
    first = checking.run(tmp_path, "two_link.urdf", checking.Circumstance("first"))
    other = checking.Circumstance("all", together, "another folder", "permuted.csv")
    assert len(first) > 100
    assert checking.differences(first, checking.run(tmp_path, "two_link.urdf", other)) == []
