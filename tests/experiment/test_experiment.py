"""An experiment's file says everything: it is checked, carried out, written back, and gives the same numbers again."""

import json
import shutil
import tomllib

import pytest
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from casysid.bundled import find_model
from casysid.cli.app import app
from casysid.errors import CasysidWarning, ParameterError
from casysid.experiment import read_experiment, run_experiment
from casysid.experiment.description import _value
from casysid.simulation import PlantSettings
from tests.simulated import simulated_run

SMALL = """
[robot]
file = "arm.urdf"

[[recordings]]
file = "log.csv"
"""
WHOLE = """
[robot]
file = "arm.urdf"
gravity = [0.0, 0.0, -9.81]

[[recordings]]
file = "log.csv"
role = "fit"

[[recordings]]
file = "other.csv"
role = "payload"
payload = "box"

[settings]
method = "wls"
friction = "plain"
cutoff = 12
split = 0.7

[log]
gear = ["shoulder=1", "elbow=1"]

[payload]
link = "fore_link"

[outputs]
folder = "answers"
c_code = true
"""


@pytest.fixture(scope="module")
def home(tmp_path_factory):
    folder = tmp_path_factory.mktemp("experiment")
    shutil.copy(find_model("two_link.urdf"), folder / "arm.urdf")
    for seed, name in enumerate(("log.csv", "other.csv")):
        simulated_run("two_link.urdf", seed, PlantSettings(), 6.0).recording.write(folder / name)
    return folder


def experiment(home, text, name="experiment.toml"):
    path = home / name
    path.write_text(text, encoding="utf-8")
    return path


def numbers_of(folder):
    content = json.loads((folder / "result.json").read_text())
    del content["seconds"]
    return content, (folder / "payload.json").read_text()


def test_it_runs_from_its_file_and_again_from_the_file_that_it_left(home, tmp_path):
    path = experiment(home, WHOLE)
    answer = CliRunner().invoke(app, ["run", str(path)])
    assert answer.exit_code == 0, answer.output
    first = home / "answers"
    for name in ("result.json", "report.html", "payload.json", "experiment.toml", "model.json", "c/robot_model.c"):
        assert (first / name).is_file(), name
    left = tomllib.loads((first / "experiment.toml").read_text())
    assert left["settings"] == {
        "method": "wls", "consistency": "full", "friction": "plain", "split": 0.7, "cutoff": 12.0, "flip": [],
        "coupling": [],
    }  # fmt: skip
    assert set(left["provenance"]["sha256"]) == {str(home / name) for name in ("arm.urdf", "log.csv", "other.csv")}
    assert {"casysid", "python", "casadi"} <= set(left["provenance"]["versions"])
    again = CliRunner().invoke(app, ["run", str(first / "experiment.toml"), "--out", str(tmp_path / "again")])
    assert again.exit_code == 0, again.output
    assert numbers_of(tmp_path / "again") == numbers_of(first)
    assert read_experiment(first / "experiment.toml").recordings == read_experiment(path).recordings
    assert "box, held by fore_link" in again.stderr


def test_inputs_that_changed_are_told(home, tmp_path):
    path = experiment(home, SMALL.replace("log.csv", str(home / "log.csv")), "small.toml")
    asked = read_experiment(path)
    text = asked.to_toml({"casysid": "0"}, {str(home / "log.csv"): "0" * 64})
    left = read_experiment(experiment(tmp_path, text))
    changed = dict(left.settings, method="wls", friction="plain", cutoff=12.0)
    left = type(left)(**{**vars(left), "settings": changed, "outputs": dict(left.outputs, folder=str(tmp_path / "x"))})
    with pytest.warns(CasysidWarning, match=r"log\.csv is not the file"):
        run_experiment(left)


WRONG = {
    SMALL + "[settings]\ncutof = 3\n": r"\[settings\] has no key 'cutof'; did you mean 'cutoff'\?",
    SMALL + "[setings]\n": r"the file has no key 'setings'; did you mean 'settings'\?",
    SMALL + "zzz = 1\n": r"\[\[recordings\]\] 1 has no key 'zzz'; known are file, role, payload",
    SMALL + "[settings]\ncutoff = 'high'\n": r"\[settings\] cutoff = 'high': wanted a number from 0\.01 to 10000",
    SMALL + "[settings]\ncutoff = nan\n": r"wanted a number",
    SMALL + "[settings]\ncutoff = true\n": r"wanted a number",
    SMALL + "[settings]\nfriction = 'rich'\n": r"wanted one of auto, plain",
    SMALL + "[settings]\nflip = 'tau'\n": r"wanted a list of texts",
    SMALL + "[settings]\nnoise_position = [-1]\n": r"wanted a number from 0 to 0\.1",
    SMALL + "role = 'train'\n": r"wanted one of fit, held-out, payload",
    SMALL + "payload = 'box'\n": r"its role must be 'payload'",
    SMALL + "role = 'payload'\n": r"at least one must have the role 'fit'",
    SMALL + "[outputs]\nreport = 1\n": r"wanted true or false",
    SMALL + "[payload]\nmass = 3\n": r"wanted a table of numbers",
    SMALL + "[payload.mass]\nbox = -3\n": r"wanted a number from 1e-06",
    SMALL.replace('file = "arm.urdf"', ""): r"\[robot\] needs the key 'file'",
    SMALL.replace('file = "arm.urdf"', 'file = "arm.urdf"\ngravity = [1, 2]'): r"wanted a list of 3 numbers",
    SMALL.replace("[robot]", "[robot]\nlock = 3"): r"wanted a table of numbers",
    '[robot]\nfile = "arm.urdf"\n': r"the file needs the key 'recordings'",
    'recordings = []\n[robot]\nfile = "arm.urdf"\n': r"must be there at least once",
    'recordings = [3]\n[robot]\nfile = "arm.urdf"\n': r"\[\[recordings\]\] 1 must be a table",
    "robot = 3\nrecordings = 4\n": r"robot = 3: wanted a table",
    "[robot": r"this is no TOML",
    "\x00": r"this is no TOML",
}


@pytest.mark.parametrize(("text", "message"), WRONG.items())
def test_what_it_may_not_hold_is_refused_with_the_place(text, message, home):
    with pytest.raises(ParameterError, match=r"wrong\.toml: .*" + message):
        read_experiment(experiment(home, text, "wrong.toml"))


def test_a_file_that_is_not_there_is_one_message(tmp_path):
    answer = CliRunner().invoke(app, ["run", str(tmp_path / "none.toml")])
    assert answer.exit_code == 2
    assert "cannot be read" in answer.stderr
    missing = experiment(tmp_path, SMALL.replace("arm.urdf", str(find_model("two_link.urdf"))))
    answer = CliRunner().invoke(app, ["run", str(missing)])
    assert answer.exit_code == 2
    assert "log.csv: cannot be read" in " ".join(answer.stderr.split())
    assert not (tmp_path / "run").exists()


plain = st.one_of(
    st.booleans(),
    st.integers(-(2**53), 2**53),
    st.floats(allow_nan=False, allow_infinity=False),
    st.text(st.characters(exclude_categories=["Cs"])),
)


@given(st.one_of(plain, st.lists(st.floats(allow_nan=False, allow_infinity=False))))
def test_values_that_are_written_are_read_as_they_were(value):
    assert tomllib.loads(f"x = {_value(value)}")["x"] == value
