import json

import pytest
import typer
from typer.testing import CliRunner

from casysid.bundled import find_model
from casysid.cli.excite import excite

app = typer.Typer()
app.command()(excite)
URDF = str(find_model("two_link.urdf"))
QUICK = ("--period", "5", "--harmonics", "3", "--starts", "1", "--rate", "100")


def run(*arguments):
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def test_excite_writes_motion_words_and_pictures(tmp_path):
    answer = run(URDF, *QUICK, "--floor", "0.1", "--box", "0.8,-1,-1,2,1,0.1", "--out", tmp_path)
    assert answer.exit_code == 0, answer.output
    assert str(tmp_path / "excitation.csv") in answer.output
    names = {path.name for path in tmp_path.iterdir()}
    assert {"excitation.csv", "excitation.json", "excitation.txt", "joint_trajectory.yaml", "joints.png"} <= names
    assert json.loads((tmp_path / "excitation.json").read_text())["checked"]["passed"]
    assert "preview.html" in names


def test_a_second_motion_is_designed_for_what_the_first_does_not_tell(tmp_path):
    assert run(URDF, *QUICK, "--out", tmp_path / "one").exit_code == 0
    log = tmp_path / "one" / "excitation.csv"
    answer = run(URDF, *QUICK, "--log", log, "--criterion", "torque", "--out", tmp_path / "two")
    assert answer.exit_code == 0, answer.output
    first, second = (json.loads((tmp_path / one / "excitation.json").read_text()) for one in ("one", "two"))
    assert second["log_det"] > first["log_det"] + 3.0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--period", "0"), "--period wants 0.1 to 3600 s"),
        (("--harmonics", "1"), "--harmonics wants 2 to 100"),
        (("--box", "1,2"), "--box wants 6 numbers"),
        (("--keep-in", "hand=0,0,0,1,1,1"), "no link is named 'hand'"),
        (("--start", "0,9"), "start of joint 'elbow'"),
        (("--floor", "3"), "distance of link"),
        (("--count", "0"), "--count wants 1 to 100"),
    ],
)
def test_bad_requests_end_with_a_message_and_code_2(tmp_path, arguments, message):
    answer = run(URDF, *arguments, "--out", tmp_path / "none")
    assert answer.exit_code == 2
    assert message in " ".join(answer.output.split())
    assert not (tmp_path / "none").exists()
