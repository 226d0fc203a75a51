"""What a user says of a log that the log does not say itself."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from casysid.errors import ParameterError

Columns = str | Sequence[str] | Mapping[str, str]
Drive = float | Mapping[str, float] | None

QUANTITIES = ("time", "position", "velocity", "acceleration", "torque")
SHORT = {"t": "time", "q": "position", "v": "velocity", "a": "acceleration", "tau": "torque"}
MOTOR = {"constant": "motor_constant", "gear": "gear", "efficiency": "efficiency"}


@dataclass(frozen=True, kw_only=True)
class Declared:
    """Units, columns and drives of a log, as its user knows them; nothing needs to be said of a log in SI units.

    Attributes:
        units: By quantity (time, position, velocity, acceleration, torque), such as ``("deg",)``; one for angles and
            one for lengths may stand side by side.
        columns: By quantity: names with ``*`` for the joint, a list in the model file's order, or a table by joint; of
            time one name, or those of seconds and their fraction.
        motor_constant: The torque columns hold motor currents [A]; torque is current times this [N m/A], one for all
            joints or by joint.
        gear: The torque columns hold torques, or currents, of motors; joints have so many times the torque.
        efficiency: Of the gears, 0 to 1; 1 if None.
    """

    units: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    columns: Mapping[str, Columns] = field(default_factory=dict)
    motor_constant: Drive = None
    gear: Drive = None
    efficiency: Drive = None

    def __post_init__(self) -> None:
        for name in (*self.units, *self.columns):
            if name not in QUANTITIES:
                raise ParameterError(f"of a log one may declare {', '.join(QUANTITIES)}; got {name!r}")

    def drive(self, joint: str) -> float:
        """Torque of the joint over what its column holds in A or N m."""
        parts = (self.motor_constant, self.gear, self.efficiency)
        product = 1.0
        for part in parts:
            product *= part.get(joint, 1.0) if isinstance(part, Mapping) else 1.0 if part is None else part
        return product

    @property
    def joints(self) -> tuple[str, ...]:
        """All that are named."""
        parts = [part for part in (self.motor_constant, self.gear, self.efficiency) if isinstance(part, Mapping)]
        return tuple(dict.fromkeys(name for part in parts for name in part))

    def over(self, other: Declared) -> Declared:
        """This where it says something, the other elsewhere."""
        return Declared(
            units={**other.units, **self.units},
            columns={**other.columns, **self.columns},
            **{
                name: getattr(self, name) if getattr(self, name) is not None else getattr(other, name)
                for name in MOTOR.values()
            },
        )


def read_map(path: str | Path) -> Declared:
    """What a map file says: TOML with the keys time, position, velocity, acceleration, torque, and [units], [motor].

    Raises:
        ParameterError: It cannot be read, or says something else.
    """
    try:
        said: dict[str, Any] = tomllib.loads(Path(path).read_text(encoding="utf-8-sig"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise ParameterError(f"{path}: is no map of columns that can be read ({error}); wanted TOML") from error
    strange = sorted(said.keys() - {*QUANTITIES, "units", "motor"})
    if strange:
        raise ParameterError(
            f"{path}: does not know '{strange[0][:80]}'; wanted {', '.join(QUANTITIES)}, [units] and [motor]"
        )
    units, motor = said.pop("units", {}), said.pop("motor", {})
    for name, table, known in (("units", units, QUANTITIES), ("motor", motor, tuple(MOTOR))):
        if not isinstance(table, dict) or table.keys() - set(known):
            raise ParameterError(f"{path}: [{name}] wants a table of {', '.join(known)}; got {str(table)[:80]}")
    return Declared(
        units={name: _words(path, f"units.{name}", unit) for name, unit in units.items()},
        columns={name: _columns(path, name, value) for name, value in said.items()},
        **{MOTOR[name]: _drive(path, name, value) for name, value in motor.items()},
    )


def _words(path: str | Path, name: str, value: object) -> tuple[str, ...]:
    words = [value] if isinstance(value, str) else value
    if not isinstance(words, list) or not words or not all(isinstance(word, str) for word in words):
        raise ParameterError(f"{path}: {name} wants text, or a list of texts; got {str(value)[:80]}")
    return tuple(words)


def _columns(path: str | Path, name: str, value: object) -> Columns:
    if isinstance(value, dict) and value and all(isinstance(column, str) for column in value.values()):
        return dict(value)
    if isinstance(value, str):
        return value
    return _words(path, name, value)


def _drive(path: str | Path, name: str, value: object) -> Drive:
    table: dict[str, Any] = value if isinstance(value, dict) else {"": value}
    for one in table.values():
        if isinstance(one, bool) or not isinstance(one, int | float) or not is_drive(name, float(one)):
            raise ParameterError(f"{path}: motor.{name} wants {RANGES[name]}; got {str(one)[:80]}")
    return {joint: float(one) for joint, one in value.items()} if isinstance(value, dict) else float(table[""])


RANGES = {
    "constant": "a number of N m/A between 1e-5 and 1000",
    "gear": "a ratio between 1e-4 and 1e5, negative where it turns the other way",
    "efficiency": "a number above 0 and at most 1",
}
"""The smallest motors of watches and the largest torque motors; harmonic drives reach 320, chains of gears 1000."""


def is_drive(name: str, value: float) -> bool:
    """Whether a number may be a motor constant, a gear or an efficiency."""
    if name == "constant":
        return 1e-5 <= abs(value) <= 1e3
    return 1e-4 <= abs(value) <= 1e5 if name == "gear" else 0.0 < value <= 1.0


def parse_units(texts: Sequence[str]) -> dict[str, tuple[str, ...]]:
    """Units from texts such as ``position=deg`` or ``q=deg,tau=mNm``.

    Raises:
        ParameterError: One is not of this form.
    """
    units: dict[str, tuple[str, ...]] = {}
    for pair in ",".join(texts).split(",") if texts else ():
        name, equals, unit = (part.strip() for part in pair.partition("="))
        name = SHORT.get(name, name)
        if not equals or not unit or name not in QUANTITIES:
            raise ParameterError(
                f"units want QUANTITY=UNIT, such as position=deg or torque=mNm, QUANTITY one of "
                f"{', '.join(QUANTITIES)}; got {pair[:80]!r}"
            )
        units[name] = (*units.get(name, ()), unit)
    return units


def parse_drive(option: str, name: str, texts: Sequence[str] | None) -> Drive:
    """A number for all joints, or ``JOINT=NUMBER`` for each.

    Raises:
        ParameterError: It is neither, or out of range.
    """
    if not texts:
        return None
    found: dict[str, float] = {}
    for text in ",".join(texts).split(","):
        joint, _, number = text.rpartition("=")
        try:
            value = float(number)
        except ValueError:
            value = float("nan")
        if not is_drive(name, value):
            raise ParameterError(f"{option} wants {RANGES[name]}, for all joints or as JOINT=NUMBER; got {text[:80]!r}")
        found[joint] = value
    if "" in found and len(found) > 1:
        raise ParameterError(f"{option} wants one number for all joints, or JOINT=NUMBER for each; got both")
    return found[""] if "" in found else found


NOTHING = Declared()
