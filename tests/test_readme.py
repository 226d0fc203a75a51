"""Every block of code in the README runs as it stands, one after another, beside a robot's file and two logs."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from casysid.bundled import find_model
from casysid.recording import read_map
from casysid.simulation import PlantSettings
from tests.simulated import simulated_run

ROOT = Path(__file__).parents[1]
BLOCKS = re.findall(
    r"^```(\w*)\n(.*?)^```$", (ROOT / "README.md").read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL
)
NOT_RUN = {
    "make demo": "it would make a virtual environment from the network; casysid rehearse does the rest",
    "make test": "it would run this test",
}


def words(code):
    return [" ".join(line.partition("#")[0].split()) for line in code.splitlines() if line.partition("#")[0].strip()]


SHELL = [line for language, code in BLOCKS if language == "sh" for line in words(code) if line not in NOT_RUN]
TOML = [code for language, code in BLOCKS if language == "toml"]
EXPERIMENTS = [code for code in TOML if "[robot]" in code]
PYTHON = [code for language, code in BLOCKS if language == "python"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A small arm's file, two logs of it, an experiment, and the virtual environment where ``make`` leaves it."""
    place = tmp_path_factory.mktemp("readme")
    shutil.copy(find_model("two_link.urdf"), place / "arm.urdf")
    (place / "logs").mkdir()
    for seed, name in enumerate(("log.csv", "other.csv")):
        log = simulated_run("two_link.urdf", seed, PlantSettings(), 4.0).recording.write(place / name)
        shutil.copy(log, place / "logs")
    (experiment,) = EXPERIMENTS
    (place / "experiment.toml").write_text(experiment, encoding="utf-8")
    if (Path(sys.prefix) / "bin" / "activate").is_file():
        (place / ".venv").symlink_to(sys.prefix)
    return place


def run(command, folder):
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    answer = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)
    assert answer.returncode == 0, answer.stdout + answer.stderr


def test_every_block_says_what_it_is():
    assert {language for language, _ in BLOCKS} == {"sh", "python", "text", "toml"}
    every = [line for language, code in BLOCKS if language == "sh" for line in words(code)]
    assert NOT_RUN.keys() <= set(every)
    assert every[len(NOT_RUN)] == "source .venv/bin/activate"


@pytest.mark.parametrize("code", [code for code in TOML if code not in EXPERIMENTS])
def test_maps_of_columns_are_read(code, tmp_path):
    (tmp_path / "map.toml").write_text(code, encoding="utf-8")
    assert read_map(tmp_path / "map.toml").columns


@pytest.mark.slow
@pytest.mark.parametrize("code", PYTHON)
def test_python_runs(code, folder):
    run([sys.executable, "-c", code], folder)


@pytest.mark.slow
def test_the_shell_finds_and_runs_every_command(folder):
    """In one shell and in this order: later commands take what earlier ones wrote."""
    if not (folder / ".venv").exists():
        pytest.skip("these tests run outside a virtual environment, so there is none to activate")
    run(["bash", "-euc", "\n".join(SHELL)], folder)
    for name in ("rehearsed", "excite", "run", "fleet", "identified", "excitation", "validated", "answers"):
        assert any((folder / name).iterdir())
