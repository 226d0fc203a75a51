"""Units that a log may say its columns have, and what one of each is in SI units."""

from __future__ import annotations

import math
import re

TURN, DEGREE = 2.0 * math.pi, math.pi / 180.0

_ANGLES = {"rad": 1.0, "mrad": 1e-3, "deg": DEGREE, "rev": TURN, "turn": TURN}
_LENGTHS = {"m": 1.0, "mm": 1e-3, "cm": 1e-2}
_TIMES = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0}
_PLACES = _ANGLES | _LENGTHS

UNITS: dict[str, dict[str, float]] = {
    "time": _TIMES,
    "position": _PLACES,
    "velocity": {f"{unit}/s": size for unit, size in _PLACES.items()} | {"rpm": TURN / 60.0, "deg/min": DEGREE / 60.0},
    "acceleration": {f"{unit}/s2": size for unit, size in _PLACES.items()} | {"rpm/s": TURN / 60.0},
    "torque": {
        "Nm": 1.0, "mNm": 1e-3, "kNm": 1e3, "Ncm": 1e-2, "N": 1.0, "mN": 1e-3, "kN": 1e3,
        "lbfft": 1.3558179483314004, "lbfin": 0.1129848290276167,
    },
    "current": {"A": 1.0, "mA": 1e-3},
}  # fmt: skip
"""By quantity. Pound-force feet and inches are exact by definition (0.45359237 kg, 9.80665 m/s², 0.3048 m)."""

_OTHER_SPELLINGS = {
    "degree": "deg", "degrees": "deg", "degs": "deg", "°": "deg", "grad": "deg?", "radian": "rad", "radians": "rad",
    "rads": "rad/s", "rad/sec": "rad/s", "radps": "rad/s", "deg/sec": "deg/s", "dps": "deg/s", "degps": "deg/s",
    "1/min": "rpm", "min-1": "rpm", "rev/min": "rpm", "r/min": "rpm", "u/min": "rpm", "rps": "rev/s", "hz": "rev/s",
    "metre": "m", "metres": "m", "meter": "m", "meters": "m", "mps": "m/s", "turns": "turn", "revs": "rev",
    "rotations": "rev", "revolutions": "rev", "rad/s/s": "rad/s2", "m/s/s": "m/s2", "deg/s/s": "deg/s2",
    "sec": "s", "secs": "s", "second": "s", "seconds": "s", "msec": "ms", "msecs": "ms", "millisec": "ms",
    "milliseconds": "ms", "usec": "us", "microseconds": "us", "nsec": "ns", "nsecs": "ns", "nanosec": "ns",
    "nanoseconds": "ns", "nanosecs": "ns", "newton": "N", "newtons": "N", "newtonmeter": "Nm", "newtonmeters": "Nm",
    "newtonmetre": "Nm", "newtonmetres": "Nm", "nm/rad": "?", "amp": "A", "amps": "A", "ampere": "A", "amperes": "A",
    "milliamp": "mA", "milliamps": "mA", "arms": "A", "apk": "A", "ftlb": "lbfft", "ftlbf": "lbfft", "lbft": "lbfft",
    "inlb": "lbfin", "lbin": "lbfin",
}  # fmt: skip


def canonical(unit: str) -> str:
    """The unit in the spelling of :data:`UNITS`, if it is one of them; else as it was written."""
    plain = unit.strip().replace("µ", "u").replace("μ", "u").replace("²", "2").replace("^", "").replace("**", "")
    plain = re.sub(r"[\s·*⋅.]", "", plain)
    known = {name for sizes in UNITS.values() for name in sizes}
    if plain in known:
        return plain
    lower = plain.lower().replace("°", "deg")
    lower = lower.replace("degdeg", "deg")
    lower = re.sub(r"/(sec|second)(?=$|2)", "/s", re.sub("^(degrees?|degs)(?=/|$)", "deg", lower))
    if lower in _OTHER_SPELLINGS:
        return _OTHER_SPELLINGS[lower]
    by_lower = {name.lower(): name for name in known}
    return by_lower.get(lower, plain)


def is_unit(text: str) -> bool:
    """Whether a text is a unit that is known here."""
    return any(canonical(text) in sizes for sizes in UNITS.values())


def is_unit_of(text: str, quantity: str) -> bool:
    """Whether a text is a unit of that quantity; currents stand in for torques."""
    return canonical(text) in UNITS[quantity]
