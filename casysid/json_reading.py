"""JSON of an identification, read with suspicion: what is not as it should be is named by its path."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

LARGEST_FILE = 1 << 26
"""Bytes of a ``result.json``: 1000 joints with ten kinds of friction each are 4 MB."""
LARGEST = 1e9
"""Of any number in SI units, as of a model file's."""
DEEPEST = 20
"""Objects and lists within each other; a result has six."""


def read_json(path: str | Path) -> Mapping[str, Any]:
    """The object in a JSON file.

    Raises:
        ValueError: It is too large, too deep, no JSON, or no object.
        OSError: It cannot be read.
    """
    path = Path(path)
    if not path.is_file():
        raise ValueError("there is no such file")
    if path.stat().st_size > LARGEST_FILE:
        raise ValueError(f"{path.stat().st_size} bytes are too many for a result")
    try:
        content = json.loads(path.read_bytes().decode("utf-8"))
    except RecursionError:
        raise ValueError("the JSON is nested too deeply") from None
    if not isinstance(content, dict):
        raise ValueError(f"it holds {_word(content)}, wanted an object")
    return content


def object_at(content: Mapping[str, Any], *keys: str) -> Mapping[str, Any]:
    """The object at a path of keys; empty where the path is not there.

    Raises:
        ValueError: Something else is there.
    """
    found: Any = content
    for k, key in enumerate(keys):
        found = found.get(key, {})
        if not isinstance(found, dict):
            raise ValueError(f"'{'.'.join(keys[: k + 1])}' is {_word(found)}, wanted an object")
    return found  # type: ignore[no-any-return]


def number(value: object, name: str, low: float = -LARGEST, high: float = LARGEST) -> float:
    """A number within a range.

    Raises:
        ValueError: It is something else.
    """
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not low <= value <= high:
        raise ValueError(f"'{name}' is {_word(value)}, wanted a number from {low:g} to {high:g}")
    return float(value)


def numbers_by_name(
    values: Mapping[str, Any], name: str, low: float = -LARGEST, high: float = LARGEST
) -> dict[str, float]:
    """Numbers within a range, by name.

    Raises:
        ValueError: One is something else.
    """
    return {key: number(value, f"{name}.{key}", low, high) for key, value in values.items()}


def check_numbers(content: object, name: str, depth: int = 0) -> None:
    """Nothing, if all numbers anywhere in the content are finite and below :data:`LARGEST`.

    Raises:
        ValueError: One is not, or it is nested too deeply.
    """
    if depth > DEEPEST:
        raise ValueError(f"'{name}' is nested too deeply")
    parts = content.items() if isinstance(content, dict) else enumerate(content) if isinstance(content, list) else ()
    for key, value in parts:
        check_numbers(value, f"{name}.{key}", depth + 1)
    if isinstance(content, (int, float)) and not isinstance(content, bool):
        number(content, name)


def texts(values: object, name: str) -> tuple[str, ...]:
    """A list of texts.

    Raises:
        ValueError: It is something else.
    """
    if not isinstance(values, list) or not all(isinstance(value, str) for value in values):
        raise ValueError(f"'{name}' is {_word(values)}, wanted a list of texts")
    return tuple(values)


def _word(value: object) -> str:
    kinds: dict[type, str] = {dict: "an object", list: "a list", str: "a text"}
    return kinds.get(type(value)) or str(value)[:40]
