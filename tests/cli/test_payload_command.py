"""``casysid payload`` as a person meets it."""

import json

import pytest
from typer.testing import CliRunner

from casysid.bundled import find_model
from casysid.cli.app import app
from casysid.simulation import PlantSettings
from tests.simulated import simulated_run

URDF = str(find_model("two_link.urdf"))


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("logs")
    for seed, name in enumerate(("empty.csv", "held.csv")):
        simulated_run("two_link.urdf", seed, PlantSettings()).recording.write(folder / name)
    return folder


def run(*arguments):
    return CliRunner().invoke(app, ["payload", *(str(argument) for argument in arguments)])


def test_it_tells_and_writes_every_payload(logs, tmp_path):
    held = logs / "held.csv"
    answer = run(
        URDF, "--without", logs / "empty.csv", "--with", held, "--with", f"tool={held}", "--friction", "plain",
        "--out", tmp_path,
    )  # fmt: skip
    assert answer.exit_code == 0, answer.output
    content = json.loads((tmp_path / "payload.json").read_text())
    assert [one["name"] for one in content["payloads"]] == ["payload", "tool"]
    for one in content["payloads"]:
        low, high = one["interval_95"]["mass"]
        assert low <= one["mass"] <= high
        assert low == 0.0
        assert one["std"]["center_of_mass"][2] is None
    for word in ("payload, held by fore_link", "tool, held by fore_link", "centre of mass x [mm]", "kg cm²", "∞"):
        assert word in answer.stderr
    assert answer.stdout.strip().endswith("payload.json")


def test_a_known_mass_is_told_as_a_scale(logs, tmp_path):
    answer = run(
        URDF, "--with", f"arm={logs / 'held.csv'}", "--mass", "arm=1e6", "--friction", "plain", "--out", tmp_path
    )
    told = "motor constants times" in answer.stderr or "no scale of the torques" in answer.stderr
    assert told, answer.output


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--mass", "heavy"), "--mass wants a number of kg"),
        (("--mass", "-1"), "--mass wants"),
        (("--mass", "x=1"), "there are only payload"),
        (("--link", "nose"), "no moving link or frame called 'nose'"),
        (("--with", "b=nowhere.csv"), "nowhere.csv"),
    ],
)
def test_what_cannot_be_is_said_in_one_message(options, message, logs, tmp_path):
    answer = run(URDF, "--with", logs / "held.csv", *options, "--out", tmp_path / "out")
    assert answer.exit_code == 2, answer.output
    assert message in " ".join(answer.stderr.split())
    assert not (tmp_path / "out").exists()
