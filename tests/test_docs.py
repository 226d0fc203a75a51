"""What the documents name is there."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from casysid.bundled import find_model
from casysid.simulation import PlantSettings
from tests.simulated import simulated_run

ROOT = Path(__file__).parents[1]
PLACES = ROOT, ROOT / "casysid"
DOCS = [*sorted((ROOT / "docs").glob("*.md")), ROOT / "CONTRIBUTING.md", ROOT / "README.md"]
FILE = re.compile(r"`((?:\w[\w.]*/)+(?:\w+\.(?:py|sh|md))?)`")
WRITTEN = "run", "identified", "out", "meta", "answers"
"""Folders of users."""
LINK = re.compile(r"\]\((?!https?:)([^)#]+)")
PYTHON = {
    path.name: re.findall(r"^```python\n(.*?)^```$", path.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    for path in DOCS
    if path.name != "README.md"
}


@pytest.mark.parametrize("document", DOCS, ids=lambda path: path.name)
def test_files_and_folders_that_are_named_exist(document):
    text = document.read_text(encoding="utf-8")
    named = {
        name for name in FILE.findall(text) if name.split("/")[0] not in ("run", "identified", "out", "meta", "answers")
    }
    lacking = [name for name in named if not any((place / name).exists() for place in PLACES)]
    lacking += [link for link in LINK.findall(text) if not (document.parent / link).exists()]
    assert not lacking


def test_every_room_is_in_the_architecture():
    text = (ROOT / "docs/architecture.md").read_text(encoding="utf-8")
    rooms = {path.stem for path in (ROOT / "casysid").iterdir() if not path.name.startswith(("_", "py.typed"))}
    assert not {room for room in rooms if f"`{room}`" not in text}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A robot's file, a log of it, and the result of an identification."""
    place = tmp_path_factory.mktemp("docs")
    (place / "arm.urdf").write_bytes(Path(find_model("two_link.urdf")).read_bytes())
    simulated_run("two_link.urdf", 0, PlantSettings(), 4.0).recording.write(place / "log.csv")
    execute("\n".join(PYTHON["first_ten_minutes.md"]), place)
    return place


def execute(code, folder):
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    answer = subprocess.run([sys.executable, "-c", code], cwd=folder, env=environment, capture_output=True, text=True)
    assert answer.returncode == 0, answer.stdout + answer.stderr


@pytest.mark.slow
@pytest.mark.parametrize("page", ["verdict.md", "online.md", "extending.md"])
def test_python_of_the_documentation_runs(page, folder):
    assert PYTHON[page]
    for code in PYTHON[page]:
        execute(code, folder)


def test_every_page_is_in_the_site():
    told = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    assert [path.name for path in (ROOT / "docs").glob("*.md") if path.name not in told] == []
