"""What the documents name is there."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PLACES = ROOT, ROOT / "casysid"
DOCS = [*sorted((ROOT / "docs").glob("*.md")), ROOT / "CONTRIBUTING.md", ROOT / "README.md"]
FILE = re.compile(r"`((?:\w[\w.]*/)+(?:\w+\.(?:py|sh|md))?)`")
WRITTEN = "run", "identified", "out", "meta", "answers"
"""Folders of users."""
LINK = re.compile(r"\]\(x\)")


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
