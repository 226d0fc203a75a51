"""The command line as a person meets it."""

import dataclasses
import hashlib
import json
import re
import subprocess
import sys

import numpy as np
import pytest
from typer.testing import CliRunner

from casysid.bundled import find_model
from casysid.cli.app import app
from casysid.cli.bug_report import describe_fault
from casysid.excitation import DesignStatus, design_set
from casysid.simulation import PlantSettings
from tests.simulated import simulated_run

URDF = str(find_model("two_link.urdf"))


def run(*arguments):
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    path = tmp_path_factory.mktemp("logs") / "run.csv"
    simulated_run("two_link.urdf", 0, PlantSettings()).recording.write(path)
    return path


def test_identify_writes_result_model_and_report(log, tmp_path):
    out = tmp_path / "out"
    answer = run("identify", URDF, log, "--split", "0.6", "--cutoff", "12", "--out", out)
    assert answer.exit_code == 0, answer.output
    assert answer.stdout.strip().endswith("result.json")
    content = json.loads((out / "result.json").read_text())
    assert content["relative_error"]["held_out"] < 0.15
    assert "accepted" in answer.stderr
    assert "<h1>" in (out / "report.html").read_text()
    assert (out / "identified.urdf").exists()


def test_the_noise_of_unordered_samples_can_be_given(tmp_path):
    run_of = simulated_run("two_link.urdf", 0, PlantSettings())
    path, out = tmp_path / "samples.csv", tmp_path / "out"
    samples = dataclasses.replace(run_of.recording, time=None, velocity=run_of.v, acceleration=run_of.a)
    samples.write(path)
    noise = ("--noise-position", "1e-3", "--noise-velocity", "0.1,0.2", "--noise-acceleration", "1")
    answer = run("identify", URDF, path, "--method", "eiv", *noise, "--out", out)
    assert "Noise of the measured motion" in answer.stderr
    content = json.loads((out / "result.json").read_text())["input_noise"]
    assert content["source"] == "given"
    assert list(content["velocity"].values()) == [0.1, 0.2]
    wrong = run("identify", URDF, path, "--noise-velocity", "fast")
    assert wrong.exit_code == 2
    assert "--noise-velocity wants a number" in wrong.stderr


@pytest.mark.parametrize("method", ["ols", "wls", "stepwise", "tls"])
def test_every_method_has_a_name(log, tmp_path, method):
    answer = run("identify", URDF, log, "--split", "0.6", "--cutoff", "12", "--method", method, "--out", tmp_path)
    assert answer.exit_code == 0, answer.output
    assert json.loads((tmp_path / "result.json").read_text())["method"] == method


def test_info_shows_robot_and_recording(log):
    answer = run("info", URDF, log)
    assert answer.exit_code == 0, answer.output
    for word in ("Joints", "Links", "Identifiable combinations", "rate [Hz]", "noise (std)", "nothing looks wrong"):
        assert word in answer.stdout


def test_info_names_an_inertia_in_other_units(tmp_path):
    text = find_model("two_link.urdf").read_text(encoding="utf-8")
    first = re.search(r'<inertia ixx="([^"]+)"[^>]*iyy="([^"]+)"[^>]*izz="([^"]+)"', text)
    wrong = first[0]
    for number in first.groups():
        wrong = wrong.replace(f'"{number}"', f'"{1e6 * float(number)!r}"')
    file = tmp_path / "wrong.urdf"
    file.write_text(text.replace(first[0], wrong, 1), encoding="utf-8")
    answer = CliRunner().invoke(app, ["info", str(file)], env={"COLUMNS": "200"})
    assert answer.exit_code == 0, answer.output
    assert "principal inertia [kg m²]" in answer.stdout
    assert "Inertial parameters of no body of that size" in answer.stdout
    assert "Inertial parameters of no body of that size" not in run("info", URDF).stdout


def test_help_has_examples():
    for verb in ("identify", "info"):
        answer = run(verb, "--help")
        assert answer.exit_code == 0
        assert f"casysid {verb} arm" in " ".join(answer.stdout.split())


def make_log(path, change):
    rows = 200
    time = np.arange(rows) * 0.01
    columns = {"time": time, "q1": np.sin(time), "q2": np.cos(time), "tau1": np.sin(3 * time), "tau2": np.cos(2 * time)}
    change(columns)
    names = list(columns)
    lines = [",".join(names)] + [",".join(f"{columns[name][k]}" for name in names) for k in range(rows)]
    path.write_text("\n".join(lines) + "\n")
    return path


def put(name, row, value):
    def change(columns):
        columns[name][row] = value

    return change


BAD_INPUT = {
    "a robot that is not there": (["nowhere.urdf", "LOG"], "nowhere.urdf"),
    "a log that is not there": ([URDF, "nowhere.csv"], "nowhere.csv"),
    "an unknown method": ([URDF, "LOG", "--method", "magic"], "method must be one of"),
    "a split above one": ([URDF, "LOG", "--split", "1.5"], "--split wants 0.01 to 0.99 of the time"),
    "a negative cut-off": ([URDF, "LOG", "--cutoff", "-3"], "--cutoff wants 0.01 to 10000 Hz"),
    "a delay that is not a number": ([URDF, "LOG", "--delay", "soon"], "--delay wants auto or a number of seconds"),
    "gravity that is not a number": ([URDF, "LOG", "--gravity", "0", "0", "nan"], "gravity"),
    "an unknown joint to lock": ([URDF, "LOG", "--lock", "elbowww=0"], "elbowww"),
    "a lock without a number": ([URDF, "LOG", "--lock", "joint_2"], "JOINT=VALUE"),
    "a coupling of unknown joints": ([URDF, "LOG", "--coupling", "a+b"], "coupling"),
    "a coupling of one joint": ([URDF, "LOG", "--coupling", "a"], "coupling"),
}


@pytest.mark.parametrize("case", BAD_INPUT)
def test_bad_input_gets_one_message_and_exit_code_2(case, tmp_path):
    arguments, message = BAD_INPUT[case]
    log = make_log(tmp_path / "log.csv", lambda columns: None)
    out = tmp_path / "out"
    answer = run("identify", *(log if word == "LOG" else word for word in arguments), "--out", out)
    assert answer.exit_code == 2, answer.output
    assert message in " ".join(answer.stderr.split())
    assert "Traceback" not in answer.output
    assert not out.exists()


BAD_LOG = {
    "not a number": (put("q1", slice(17, None), np.nan), "q1"),
    "time running backwards": (lambda columns: columns.update(time=columns["time"][::-1]), "time"),
    "a missing column": (lambda columns: columns.pop("tau2"), "tau"),
}


@pytest.mark.parametrize("case", BAD_LOG)
def test_bad_logs_are_refused_at_the_door(case, tmp_path):
    change, message = BAD_LOG[case]
    answer = run("identify", URDF, make_log(tmp_path / "log.csv", change), "--out", tmp_path / "out")
    assert answer.exit_code == 2
    assert message in answer.stderr
    assert "log.csv" in " ".join(answer.stderr.split()).replace(" ", "")
    assert not (tmp_path / "out").exists()


def unusable(tmp_path, case):
    match case:
        case "a file":
            (tmp_path / "f").write_text("")
            return tmp_path / "f"
        case "below a file":
            (tmp_path / "f").write_text("")
            return tmp_path / "f" / "x"
        case "a link to nowhere":
            (tmp_path / "l").symlink_to("none")
            return tmp_path / "l"
    raise ValueError(case)


VERBS = {
    "identify": ["identify", URDF, "absent.csv"],
    "compare": ["compare", URDF, "absent.csv"],
    "validate": ["validate", URDF, "absent.csv"],
    "excite": ["excite", "absent.urdf"],
    "rehearse": ["rehearse", "absent.urdf"],
}


@pytest.mark.parametrize("verb", VERBS)
@pytest.mark.parametrize("case", ["a file", "below a file", "a link to nowhere"])
def test_a_place_that_cannot_be_written_to_is_found_before_anything_is_read(verb, case, tmp_path):
    place = unusable(tmp_path, case)
    if (verb, case) == ("compare", "a file"):
        place = tmp_path / "none" / "x.json"
    answer = run(*VERBS[verb], "--out", place)
    assert answer.exit_code == 2, answer.output
    message = " ".join(answer.stderr.split())
    assert message.startswith(f"error: {place}: cannot be written: ")
    assert "absent." not in message


def test_another_run_replaces_the_files_of_the_one_before(log, tmp_path):
    out = tmp_path / "out"
    out.mkdir()
    (out / "notes.txt").write_text("mine")
    (out / "identified.xml").write_text("of an earlier run")
    for split in ("0.5", "0.6"):
        answer = run("identify", URDF, log, "--split", split, "--cutoff", "12", "--method", "wls", "--out", out)
        assert answer.exit_code == 0, answer.output
    model = {"model.json", "model.npz", "drive.yaml"}
    written = {"result.json", "identified.urdf", *model, "moments.npz", "report.html", ".casysid.json"}
    assert {path.name for path in out.iterdir()} == {*written, "notes.txt"}
    listed = json.loads((out / ".casysid.json").read_text())["files"]
    for name in written - {".casysid.json"}:
        assert hashlib.sha256((out / name).read_bytes()).hexdigest() == listed[name]


def test_a_fault_of_casysid_is_saved_for_whoever_can_mend_it(monkeypatch, tmp_path):
    def fail(*arguments, **options):
        raise ZeroDivisionError("a [bold]fault[/]")

    monkeypatch.setattr("casysid.cli.info.load_robot", fail)
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    answer = run("info", URDF)
    assert answer.exit_code == 70
    (saved,) = (tmp_path / "state" / "casysid").iterdir()
    message = " ".join(answer.stderr.split())
    assert message.startswith("internal error: ZeroDivisionError: a [bold]fault[/]. This is a fault of casysid")
    assert str(saved) in message
    assert "Traceback" not in answer.output
    assert saved.stat().st_mode & 0o777 == 0o600
    assert "raise ZeroDivisionError" in saved.read_text()


def test_a_fault_is_saved_somewhere_even_without_a_home(monkeypatch, tmp_path):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "file" / "state"))
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    assert str(tmp_path / "casysid-fault-") in describe_fault(ValueError("x"))
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "none"))
    assert "could not be saved (No such file or directory)" in describe_fault(ValueError("x"))


def test_ctrl_c_says_what_was_written(log, monkeypatch, tmp_path):
    def interrupt(*arguments, **options):
        raise KeyboardInterrupt

    command = ["identify", URDF, log, "--cutoff", "12", "--method", "wls", "--out", tmp_path / "out"]
    monkeypatch.setattr("casysid.cli.identify.tell_result", interrupt)
    after = run(*command)
    assert (after.exit_code, after.stderr.split("\n")[-2]) == (
        130,
        f"interrupted; the files in {tmp_path / 'out'} are complete",
    )
    before = {path: path.read_bytes() for path in (tmp_path / "out").iterdir()}
    monkeypatch.setattr("casysid.report.html.render_report", interrupt)
    during = run(*command)
    assert (during.exit_code, during.stderr.strip()) == (130, "interrupted; nothing was written")
    assert {path: path.read_bytes() for path in (tmp_path / "out").iterdir()} == before


def test_an_interrupted_design_is_not_written(monkeypatch, tmp_path):
    real = design_set

    def interrupted(problem, count, **options):
        design = real(problem, count, **{**options, "starts": 1})[0]
        return (dataclasses.replace(design, status=DesignStatus.INTERRUPTED),)

    monkeypatch.setattr("casysid.excitation.design_set", interrupted)
    answer = run("excite", URDF, "--harmonics", "2", "--out", tmp_path / "out")
    assert answer.exit_code == 130, answer.output
    assert "interrupted; nothing was written" in answer.stderr
    assert not (tmp_path / "out").exists()


def test_the_module_runs_as_a_command():
    answer = subprocess.run([sys.executable, "-m", "casysid", "--version"], capture_output=True, text=True, check=True)
    assert answer.stdout.startswith("casysid 0.")
