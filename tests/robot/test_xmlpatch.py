from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.errors import RobotError
from casysid.robot.xmlpatch import XmlPatch, comment, number_text, path_from
from casysid.robot.xmltext import parse_xml

TEXT = b"""<?xml version="1.0"?>
<!-- before -->
<root  a = "1"
   b='x > y'>
  <empty/>
  text <full c="2" >inner</full><!-- after -->
</root>
"""
HERE = Path("model.xml")


def parsed(text=TEXT):
    return parse_xml(text, HERE)


def test_elements_know_their_places():
    root = parsed()
    empty, full = root.children
    assert TEXT[empty.start : empty.end] == b"<empty/>"
    assert TEXT[full.start : full.end] == b'<full c="2" >inner</full>'
    assert TEXT[root.start : root.open_end].endswith(b"b='x > y'>")
    assert (root.line, empty.line, full.line) == (3, 5, 6)
    assert root.attributes == {"a": "1", "b": "x > y"}
    assert root.find("full") is full
    assert root.find("none") is None
    assert [element.tag for element in root.walk()] == ["root", "empty", "full"]


def test_without_changes_every_byte_stays():
    assert XmlPatch(TEXT).result() == TEXT


def test_attributes_are_set_added_and_taken_away():
    root, patch = parsed(), XmlPatch(TEXT)
    patch.set(root, a="7")
    patch.set(root.children[0], new='"&<')
    patch.set(root.children[1], c=None, d="3")
    changed = patch.result()
    assert b"<root  a = \"7\"\n   b='x > y'>" in changed
    assert b"<empty new='\"&amp;&lt;'/>" in changed
    assert b'<full d="3" >inner</full>' in changed
    assert parsed(changed).children[0].attributes == {"new": '"&<'}


def test_elements_are_put_in_and_replaced():
    root, patch = parsed(), XmlPatch(TEXT)
    patch.append(root.children[0], "<child/>")
    patch.replace(root.children[1], comment("gone -- away"))
    patch.set(root.children[1], c="lost")
    patch.prepend(root, "<first/>")
    patch.append(root, "<last/>")
    changed = patch.result()
    assert (
        b"\n  <first/>\n  <empty>\n    <child/>\n  </empty>\n  text <!-- gone - - away --><last/><!-- after -->"
        in changed
    )
    assert [child.tag for child in parsed(changed).children] == ["first", "empty", "last"]


def test_changes_within_a_replaced_element_are_lost():
    text = b"<a><b><c/></b></a>"
    root, patch = parsed(text), XmlPatch(text)
    patch.set(root.children[0].children[0], x="1")
    patch.replace(root.children[0], "<d/>")
    assert patch.result() == b"<a><d/></a>"


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "latin-1"])
def test_other_letters_stay_as_they_are(encoding):
    declared = "utf-8" if encoding == "utf-8-sig" else encoding
    text = f'<?xml version="1.0" encoding="{declared}"?><größe name="Übung" m="1"><b/></größe>'.encode(encoding)
    root, patch = parsed(text), XmlPatch(text)
    assert root.name == "Übung"
    patch.set(root.children[0], name="Ö")
    patch.append(root, comment("Ä"))
    changed = patch.result()
    assert parsed(changed).children[0].name == "Ö"
    assert changed.startswith(text[:40])


def test_what_is_no_xml_is_refused_with_its_line():
    with pytest.raises(RobotError, match=r"model\.xml:2: not well-formed XML \(mismatched tag, column 3\)"):
        parsed(b"<a>\n</b>")
    with pytest.raises(RobotError, match="UTF-16"):
        parsed("<a/>".encode("utf-16"))
    with pytest.raises(RobotError, match="not well-formed XML"):
        parsed(b"")


@settings(max_examples=40, deadline=None)
@given(values=st.lists(st.floats(allow_nan=False, allow_infinity=False), max_size=5))
def test_numbers_read_back_exactly(values):
    assert [float(part) for part in number_text(values).split()] == values


def test_paths_are_named_from_the_new_folder(tmp_path):
    assert path_from(tmp_path / "out", "meshes/a.stl", tmp_path / "in") == "../in/meshes/a.stl"
