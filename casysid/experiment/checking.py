"""Tables of a TOML file, compared with what they may contain: unknown keys are refused with the nearest known one."""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from casysid.errors import ParameterError

Check = Callable[[Any], Any]


def checked_table(content: object, place: str, known: Mapping[str, tuple[Check, Any]]) -> dict[str, Any]:
    """All values of a table, with the defaults of those that are not in it.

    Args:
        content: As it was read.
        place: What it is called, such as ``[settings]``.
        known: By key, what makes a value of what was read or raises ValueError, and the default; a default that is an
            exception class says that the key is needed.

    Raises:
        ParameterError: A key is unknown, is missing, or has a value that cannot be.
    """
    if not isinstance(content, dict):
        raise ParameterError(f"{place} must be a table of keys and values; got {_short(content)}")
    for key in content:
        if key not in known:
            near = difflib.get_close_matches(key, known, n=1)
            hint = f"did you mean '{near[0]}'?" if near else f"known are {', '.join(known)}"
            raise ParameterError(f"{place} has no key '{key}'; {hint}")
    values = {}
    for key, (check, default) in known.items():
        if key not in content:
            if default is KeyError:
                raise ParameterError(f"{place} needs the key '{key}'")
            values[key] = default
            continue
        try:
            values[key] = check(content[key])
        except ValueError as error:
            raise ParameterError(f"{place} {key} = {_short(content[key])}: wanted {error}") from error
    return values


def anything(value: Any) -> Any:
    """Whatever it is; it is looked at elsewhere."""
    return value


def table(value: Any) -> dict[str, Any]:
    """A table."""
    if not isinstance(value, dict):
        raise ValueError("a table of keys and values")
    return value


def text(value: Any) -> str:
    """A text."""
    if not isinstance(value, str) or not value:
        raise ValueError("a text")
    return value


def texts(value: Any) -> tuple[str, ...]:
    """A list of texts."""
    if not isinstance(value, list):
        raise ValueError("a list of texts")
    return tuple(text(one) for one in value)


def truth(value: Any) -> bool:
    """True or false."""
    if not isinstance(value, bool):
        raise ValueError("true or false")
    return value


def number(low: float, high: float) -> Callable[[Any], float]:
    """A number between two."""

    def check(value: Any) -> float:
        usual = isinstance(value, (int, float)) and not isinstance(value, bool)
        if not usual or not math.isfinite(value) or not low <= value <= high:
            raise ValueError(f"a number from {low:g} to {high:g}")
        return float(value)

    return check


def numbers(count: int | None, low: float, high: float) -> Callable[[Any], tuple[float, ...]]:
    """So many numbers between two, or any number of them."""
    one = number(low, high)

    def check(value: Any) -> tuple[float, ...]:
        if not isinstance(value, list) or (count is not None and len(value) != count):
            raise ValueError(f"a list of {'' if count is None else f'{count} '}numbers from {low:g} to {high:g}")
        return tuple(one(each) for each in value)

    return check


def numbers_by_name(low: float, high: float) -> Callable[[Any], dict[str, float]]:
    """A table of numbers between two."""
    one = number(low, high)

    def check(value: Any) -> dict[str, float]:
        if not isinstance(value, dict):
            raise ValueError(f"a table of numbers from {low:g} to {high:g}")
        return {str(name): one(each) for name, each in value.items()}

    return check


def word(*words: str) -> Callable[[Any], str]:
    """One of some words."""

    def check(value: Any) -> str:
        if value not in words:
            raise ValueError(_choice(words))
        return str(value)

    return check


def _choice(words: Sequence[str]) -> str:
    return f"one of {', '.join(words)}"


def _short(value: object) -> str:
    shown = repr(value)
    return shown if len(shown) <= 60 else f"{shown[:57]}..."
