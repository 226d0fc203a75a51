import importlib
import random
import sys
from pathlib import Path

import pytest

SCRIPTS = Path(__file__).resolve().parents[2] / "scripts"


@pytest.fixture(scope="module")
def attack():
    sys.path.insert(0, str(SCRIPTS))
    yield importlib.import_module("attack_outputs")
    sys.path.remove(str(SCRIPTS))


@pytest.fixture(scope="module")
def sides(attack, tmp_path_factory):
    drawn = attack.html.render_report
    yield attack.make_sides(tmp_path_factory.mktemp("sides"))
    attack.html.render_report = drawn


def test_kills_and_meetings_leave_files_of_one_run(attack, sides, tmp_path):
    for states, count in (
        (attack.kill_writers(sides, tmp_path, 8, random.Random(0), attack.write), 8),
        (attack.meet(sides, tmp_path, 3, random.Random(0), attack.write), 3),
    ):
        assert states["old"] + states["new"] == count, states
        assert states["litter"] == states["a writer failed"] == 0, states


def test_planted_links_are_not_followed(attack, sides, tmp_path):
    states = attack.plant_links(sides, tmp_path)
    assert states["followed"] == states["results that are links"] == 0
    assert states["new"] == 1


@pytest.mark.parametrize("fault", ["mixed", "torn", "unreadable", "foreign file changed"])
def test_what_is_broken_is_seen(attack, sides, fault, tmp_path):
    home = attack.prepared(sides, tmp_path)
    report = home / "report.html"
    match fault:
        case "mixed":
            attack.write(sides.results[1], tmp_path / "new")
            report.write_bytes((tmp_path / "new" / report.name).read_bytes())
        case "torn":
            report.write_bytes(report.read_bytes()[:-1])
        case "unreadable":
            report.unlink()
        case _:
            (home / attack.FOREIGN).write_text("other")
    assert sides.judge(home) == fault
