"""XML read with its places in the text, so that a number can be replaced and all else stays as it was written."""

from __future__ import annotations

import codecs
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat

from casysid.errors import RobotError

LARGEST_FILE = 1 << 26
"""Bytes: half a kilobyte for each of as many elements as are read."""
MOST_ELEMENTS = 100_000
"""Of one file: a mobile manipulator's URDF has five hundred (TIAGo)."""
DEEPEST = 500
"""Elements within each other: MuJoCo's own reader (TinyXML-2) allows no more."""
_DECLARATION = re.compile(rb"""\A(?:\xef\xbb\xbf)?<\?xml\s[^>]*?encoding\s*=\s*["']([A-Za-z0-9._-]+)["']""")
_READ_AS_IT_IS = ("utf-8", "ascii", "iso8859-1", "utf-16")
_CODECS = {"ansi": "cp1252", "gb2312": "gb18030", "gbk": "gb18030", "shift_jis": "cp932", "sjis": "cp932"}
"""What vendors' programs write of the names that XML declares: a superset, and the code page of Windows."""
_MARKUP = bytes(range(0x20, 0x5C)) + bytes(range(0x5D, 0x7E)) + b"\t\r\n"
_START_TAG = re.compile(rb"""<[^\s/>]+(?:\s+[^\s=>]+\s*=\s*(?:"[^"]*"|'[^']*'))*\s*/?>""")


@dataclass(eq=False)
class Element:
    """One element of the document and the bytes it occupies.

    Attributes:
        tag: Its name, prefix included.
        attributes: Its attributes, in the order of the text.
        line: Line of the start tag, counted from 1.
        start: Offset of its first byte.
        open_end: Offset behind the start tag.
        end: Offset behind the element.
        parent: The element around it.
        children: The elements in it.
    """

    tag: str
    attributes: dict[str, str]
    line: int
    start: int
    open_end: int
    end: int = -1
    parent: Element | None = None
    children: list[Element] = field(default_factory=list)

    @property
    def name(self) -> str:
        """The ``name`` attribute, empty when there is none."""
        return self.attributes.get("name", "")

    def find(self, tag: str) -> Element | None:
        """The first child with this tag."""
        return next((child for child in self.children if child.tag == tag), None)

    def find_all(self, tag: str) -> list[Element]:
        """All children with this tag."""
        return [child for child in self.children if child.tag == tag]

    def walk(self) -> Iterator[Element]:
        """This element and everything below it, in the order of the text."""
        waiting = [self]
        while waiting:
            element = waiting.pop()
            yield element
            waiting += reversed(element.children)


def read_bytes(path: Path) -> bytes:
    """The file's text in UTF-8, if its XML declares an encoding of one country; else its bytes as they are.

    Raises:
        RobotError: It is not there, is no readable file, or is not in the encoding that it declares.
    """
    return _in_utf8(_read(path), path)


def _in_utf8(text: bytes, path: Path) -> bytes:
    declared = _DECLARATION.match(text)
    if declared is None:
        return text
    word = declared[1].decode("ascii")
    name = _CODECS.get(word.lower().replace("-", "_"), word)
    try:
        codec = codecs.lookup(name)
        kept = codec.name in _READ_AS_IT_IS or _MARKUP.decode(name) != _MARKUP.decode("ascii")
        plain = "" if kept else text.decode(name)
    except UnicodeDecodeError as error:
        raise RobotError(
            f"{path}: is not in the encoding that it declares, {word} (byte {error.start}); save it as UTF-8"
        ) from error
    except (LookupError, ValueError):
        return text  # the parser has to say what it makes of that
    if kept:
        return text
    return (plain[: declared.start(1)] + "UTF-8" + plain[declared.end(1) :]).encode("utf-8")


def _read(path: Path) -> bytes:
    try:
        if not path.exists():
            raise RobotError(f"{path}: no such file (looked in {path.parent.resolve()})")
        if path.is_dir():
            raise RobotError(f"{path}: is a folder; give the URDF or MJCF file in it")
        if not path.is_file():
            raise RobotError(f"{path}: is no regular file; copy what it gives to a file and name that")
        if path.stat().st_size > LARGEST_FILE:
            raise RobotError(f"{path}: {path.stat().st_size} bytes; a model file has at most {LARGEST_FILE}")
        return path.read_bytes()
    except OSError as error:
        raise RobotError(f"{path}: cannot be read: {error.strerror}") from error


def parse_xml(text: bytes, path: Path) -> Element:
    """The root element of an XML text; ``path`` is for messages only.

    Raises:
        RobotError: The text is not well-formed XML, or not in an encoding that keeps ASCII as it is.
    """
    if text[:2] in (b"\xff\xfe", b"\xfe\xff"):
        raise RobotError(f"{path}: is encoded as UTF-16; save it as UTF-8")
    parser = expat.ParserCreate()
    parser.buffer_text = True
    top = Element("", {}, 0, 0, 0)
    stack = [top]

    count = 0

    def begin(tag: str, attributes: dict[str, str]) -> None:
        nonlocal count
        count += 1
        where = f"{path}:{parser.CurrentLineNumber}"
        if count > MOST_ELEMENTS:
            raise RobotError(f"{where}: more than {MOST_ELEMENTS} elements, too many for a model of a robot")
        if len(stack) > DEEPEST:
            raise RobotError(f"{where}: <{tag}> is more than {DEEPEST} elements deep, too deep for a model of a robot")
        start = parser.CurrentByteIndex
        match = _START_TAG.match(text, start)
        if match is None:
            raise RobotError(f"{where}: cannot read the tag <{tag}>")
        element = Element(tag, attributes, parser.CurrentLineNumber, start, match.end(), parent=stack[-1])
        stack[-1].children.append(element)
        stack.append(element)

    def finish(tag: str) -> None:
        element = stack.pop()
        closed_at_once = text[element.open_end - 2 : element.open_end] == b"/>"
        element.end = element.open_end if closed_at_once else text.index(b">", parser.CurrentByteIndex) + 1

    parser.StartElementHandler = begin
    parser.EndElementHandler = finish
    try:
        parser.Parse(text, True)
    except expat.ExpatError as error:
        reason = expat.ErrorString(error.code)
        raise RobotError(f"{path}:{error.lineno}: not well-formed XML ({reason}, column {error.offset + 1})") from error
    except (LookupError, ValueError) as error:
        if isinstance(error, RobotError):
            raise
        raise RobotError(f"{path}: is in an encoding that is not read ({error}); save it as UTF-8") from error
    root = top.children[0]
    root.parent = None
    return root
