"""Which values options may have: one table, and one form of the message about those that have another."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from casysid.errors import ParameterError


@dataclass(frozen=True)
class Range:
    """Numbers that an option may be given.

    Attributes:
        low: The smallest.
        high: The largest.
        unit: With blanks before it, empty for none.
        why: Where the ends come from.
    """

    low: float
    high: float
    unit: str
    why: str


RANGES: Mapping[str, Range] = {
    "--split": Range(0.01, 0.99, " of the time", "a hundredth of a recording fits and judges nothing"),
    "--cutoff": Range(0.01, 1e4, " Hz", "a motion of 100 s, and half the fastest rate of logs in use, 20 kHz"),
    "--time-scale": Range(1e-9, 3600.0, "", "stamps in nanoseconds to hours"),
    "--mass-total": Range(1e-6, 1e6, " kg", "a milligram, and a thousand tonnes"),
    "--mass": Range(1e-6, 1e6, " kg", "a milligram, and a thousand tonnes"),
    "--delay": Range(-1.0, 1.0, " s", "a controller a second behind holds no robot"),
    "--noise-position": Range(0.0, 0.1, " rad or m", "a sensor that is wrong by six degrees measures no motion"),
    "--noise-velocity": Range(0.0, 10.0, " rad/s or m/s", "the speed of fast robots itself"),
    "--noise-acceleration": Range(0.0, 1000.0, " rad/s² or m/s²", "beyond the acceleration of the fastest robots"),
    "--gravity": Range(-1000.0, 1000.0, " m/s²", "the sun's surface has 274"),
    "--lock": Range(-1e4, 1e4, " rad or m", "a thousand turns, ten kilometres"),
    "--period": Range(0.1, 3600.0, " s", "faster than robots turn about, an hour"),
    "--harmonics": Range(2, 100, "", "one alone cannot start at rest; published designs have 5 to 20"),
    "--periods": Range(1, 1000, "", "noise falls by 30 by then"),
    "--count": Range(1, 100, "", "each is a design of its own"),
    "--starts": Range(1, 1000, "", "each is a search of its own"),
    "--seed": Range(0, 2**63 - 1, "", "what generators of random numbers take"),
    "--acceleration": Range(1e-3, 1e6, " rad/s² or m/s²", "from creeping to beyond any drive"),
    "--jerk": Range(1e-3, 1e9, " rad/s³ or m/s³", "from creeping to beyond any drive"),
    "--velocity-share": Range(0.01, 1.0, " of the limits", "above 1 is beyond the limits"),
    "--torque-share": Range(0.01, 1.0, " of the limits", "above 1 is beyond the limits"),
    "--clearance": Range(0.0, 10.0, " m", "the size of robots"),
    "--floor": Range(-1e4, 1e4, " m", "ten kilometres"),
    "--box": Range(-1e4, 1e4, " m", "ten kilometres"),
    "--wall": Range(-1e4, 1e4, " m", "ten kilometres"),
    "--keep-in": Range(-1e4, 1e4, " m", "ten kilometres"),
    "--from": Range(-1e4, 1e4, " rad or m", "a thousand turns, ten kilometres"),
    "--speed": Range(0.01, 1.0, "", "a hundredth takes minutes; above 1 is beyond the limits"),
    "--start": Range(-1e4, 1e4, " rad or m", "a thousand turns, ten kilometres"),
    "--at": Range(-1e4, 1e4, " m", "ten kilometres"),
    "--look-at": Range(-1e4, 1e4, " m", "ten kilometres"),
    "--rpy": Range(-1e4, 1e4, " rad or degrees", "a thousand turns"),
    "--axis": Range(-1e4, 1e4, "", "only its direction counts"),
    "POSITION": Range(-1e4, 1e4, " rad or m", "a thousand turns, ten kilometres"),
    "--rate": Range(1.0, 1e5, " Hz", "a hundred times what robots' controllers usually do"),
    "--rate of rehearse": Range(50.0, 1e4, " Hz", "feedback of 6 Hz needs eight samples a cycle; MuJoCo's steps"),
    "--duration": Range(4.0, 3600.0, " s", "a period of usual motion, an hour"),
}
MOST_SAMPLES = 10_000_000
"""Of a motion that is made: a hundred joints of them are 8 GB."""


def checked(option: str, value: float, *, of: str = "") -> float:
    """The value, if it is in the option's range.

    Args:
        option: As it is written on the command line.
        value: What was given.
        of: The verb, where it has a range of its own.

    Raises:
        ParameterError: It is not.
    """
    range_ = RANGES[f"{option} of {of}" if of else option]
    if not range_.low <= value <= range_.high:
        raise ParameterError(
            f"{option} wants {range_.low:g} to {range_.high:g}{range_.unit} ({range_.why}); got {value:g}"
        )
    return value


def check_options(*, of: str = "", **given: float | None) -> None:
    """Nothing, if all values that were given are in the ranges of the options of these names.

    Raises:
        ParameterError: The first is not.
    """
    for name, value in given.items():
        if value is not None:
            option = "--" + name.replace("_", "-")
            checked(option, value, of=of if f"{option} of {of}" in RANGES else "")


def numbers(option: str, text: str, count: int | None = None) -> tuple[float, ...]:
    """Numbers with commas between them, each in the option's range.

    Args:
        option: As it is written on the command line.
        text: What was given.
        count: How many are wanted; None for any number.

    Raises:
        ParameterError: They are too many or too few, no numbers, or out of range.
    """
    try:
        values = tuple(float(word) for word in text.split(","))
    except ValueError:
        values = ()
    if not values or (count is not None and len(values) != count):
        wanted = "a number, or one for each" if count is None else f"{count} numbers with commas between them"
        form = " separated by commas, such as 1e-4,2e-4" if count is None else ""
        raise ParameterError(f"{option} wants {wanted}{form}; got {text[:80]!r}")
    return tuple(checked(option, value) for value in values)


def check_samples(duration: float, rate: float) -> None:
    """Nothing, if so long a motion at such a rate can be made.

    Raises:
        ParameterError: It cannot.
    """
    samples = duration * rate
    if not samples <= MOST_SAMPLES or math.isnan(samples):
        raise ParameterError(
            f"{duration:g} s at {rate:g} Hz are {samples:.3g} samples; at most {MOST_SAMPLES} are made. Shorten the "
            "motion or lower --rate"
        )
