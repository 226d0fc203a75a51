"""Changes to an XML text that leave every other byte as it was."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from xml.sax.saxutils import quoteattr

from casysid.robot.xmltext import Element

_ATTRIBUTE = re.compile(rb"""\s+([^\s=>]+)\s*=\s*("[^"]*"|'[^']*')""")


@dataclass
class _Change:
    """What becomes of one element."""

    attributes: dict[str, str | None] = field(default_factory=dict)
    prepended: list[str] = field(default_factory=list)
    appended: list[str] = field(default_factory=list)
    replacement: str | None = None


class XmlPatch:
    """Collects changes to the elements of a text, then applies them all.

    Args:
        text: The text that the elements were read from.
    """

    def __init__(self, text: bytes) -> None:
        self._text = text
        self._changes: dict[Element, _Change] = {}

    def set(self, element: Element, **attributes: str | None) -> None:
        """Sets attributes of an element; None takes one away."""
        self._change(element).attributes.update(attributes)

    def prepend(self, element: Element, text: str) -> None:
        """Puts a text before the first child of an element."""
        self._change(element).prepended.append(text)

    def append(self, element: Element, text: str) -> None:
        """Puts a text behind the last child of an element."""
        self._change(element).appended.append(text)

    def replace(self, element: Element, text: str) -> None:
        """Puts a text in the place of an element; changes within it are lost."""
        self._change(element).replacement = text

    def result(self) -> bytes:
        """The changed text."""
        edits: list[tuple[int, int, bytes]] = []
        for element, change in self._changes.items():
            if change.replacement is not None:
                edits.append((element.start, element.end, _encoded(change.replacement)))
            elif not any(e in self._changes and self._changes[e].replacement is not None for e in _around(element)):
                edits += self._edits(element, change)
        pieces, done = [], 0
        for start, end, text in sorted(edits, key=lambda edit: edit[:2]):
            pieces += [self._text[done:start], text]
            done = end
        return b"".join([*pieces, self._text[done:]])

    def _change(self, element: Element) -> _Change:
        return self._changes.setdefault(element, _Change())

    def _edits(self, element: Element, change: _Change) -> list[tuple[int, int, bytes]]:
        tag = _with_attributes(self._text[element.start : element.open_end], change.attributes)
        inner = [*change.prepended, *change.appended]
        if tag.endswith(b"/>"):
            if inner:
                line = self._line_of(element)
                body = "".join(f"{line}  {text}" for text in inner) + line
                tag = tag[:-2].rstrip() + b">" + _encoded(body) + b"</" + element.tag.encode() + b">"
            return [(element.start, element.open_end, tag)]
        if not element.children:
            appended, change_at = inner, element.open_end
        else:
            appended, change_at = change.appended, element.children[-1].end
            first = self._line_of(element.children[0])
            tag += _encoded("".join(f"{first}{text}" for text in change.prepended))
        edits = [(element.start, element.open_end, tag)]
        if appended:
            line = self._line_of(element.children[-1] if element.children else element)
            edits.append((change_at, change_at, _encoded("".join(f"{line}{text}" for text in appended))))
        return edits

    def _line_of(self, element: Element) -> str:
        """The line break and the indentation before an element, empty when it does not begin its line."""
        before = self._text[: element.start]
        start = before.rfind(b"\n")
        indent = before[start + 1 :]
        return "\n" + indent.decode() if start >= 0 and not indent.strip() else ""


def comment(text: str) -> str:
    """An XML comment, in ASCII as far as its words are ours."""
    return f"<!-- {text.replace('--', '- -').replace('²', '^2')} -->"


def element_text(tag: str, attributes: Mapping[str, str]) -> str:
    """An element without content."""
    return f"<{tag} " + " ".join(f"{name}={quoteattr(value)}" for name, value in attributes.items()) + "/>"


def number_text(values: Iterable[float]) -> str:
    """Numbers that read back exactly, parted by blanks."""
    return " ".join(repr(float(value)) for value in values)


def path_from(folder: Path, file: str, origin: Path) -> str:
    """The path from ``folder`` to a file that is named relative to ``origin``, with forward slashes."""
    return Path(os.path.relpath(origin.resolve() / file, folder.resolve())).as_posix()


def _around(element: Element) -> list[Element]:
    around, outer = [], element.parent
    while outer is not None:
        around.append(outer)
        outer = outer.parent
    return around


def _encoded(text: str) -> bytes:
    return text.encode("ascii", "xmlcharrefreplace")


def _with_attributes(tag: bytes, attributes: dict[str, str | None]) -> bytes:
    """A start tag with attributes set, added or taken away."""
    left = dict(attributes)

    def changed(match: re.Match[bytes]) -> bytes:
        name = match[1].decode()
        if name not in left:
            return match[0]
        value = left.pop(name)
        if value is None:
            return b""
        return match[0][: match.start(2) - match.start()] + _encoded(quoteattr(value))

    tag = _ATTRIBUTE.sub(changed, tag)
    added = "".join(f" {name}={quoteattr(value)}" for name, value in left.items() if value is not None)
    end = len(tag.removesuffix(b">").removesuffix(b"/").rstrip())
    return tag[:end] + _encoded(added) + tag[end:]
