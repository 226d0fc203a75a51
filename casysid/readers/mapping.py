"""Maps of columns: what a user says of them to a layout, and a layout as the text of a map."""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping, Sequence

from casysid.errors import RecordingError
from casysid.readers.candidates import Candidate, Labels
from casysid.readers.clock import Clock, find_clock
from casysid.readers.columns import Layout, in_own_order, match_columns, refuse_unusable
from casysid.readers.messages import listing
from casysid.readers.scaling import factors_of, is_length
from casysid.readers.units_of_columns import UNITS, canonical
from casysid.readers.words import SLOT, without_unit
from casysid.recording.declared import Declared


def lay_out(
    found: Sequence[str],
    channels: Sequence[str],
    dofs: Sequence[str],
    source: str,
    labels: Labels,
    declared: Declared,
    linear: Collection[str],
    numbered: tuple[Sequence[str], Sequence[str]] | None = None,
) -> Layout:
    """The layout that a map gives, or else that of the names; see :func:`~casysid.readers.columns.match_columns`.

    Raises:
        RecordingError: The columns of the map are not there, or not one for each joint; or as that function says.
    """
    if not declared.columns.keys() - {"time"}:
        layout = match_columns(found, channels, dofs, source, labels, declared, linear, numbered)
        clock = _clock(declared, found, labels, source, layout.clock)
        return Layout(**(vars(layout) | {"clock": clock}))
    chosen = {}
    for quantity, columns in declared.columns.items():
        if quantity != "time":
            names = channels if quantity == "position" else dofs
            mapped = _mapped(quantity, columns, names, found, source)
            chosen[quantity] = in_own_order(mapped, channels, dofs, numbered)
    for quantity in ("position", "torque"):
        if quantity not in chosen:
            raise RecordingError(
                f"{source}: the map names no columns of {quantity}; wanted one for each of {listing(dofs)}"
            )
    layout = Layout(
        clock=_clock(declared, found, labels, source, find_clock(found, labels.units, chosen["position"].columns[0])),
        factors=factors_of(list(chosen.values()), channels, dofs, labels, declared, set(linear), source),
        **{
            quantity: chosen[quantity].columns if quantity in chosen else None
            for quantity in ("position", "velocity", "acceleration", "torque")
        },  # type: ignore[arg-type]
    )
    refuse_unusable(layout, found, source)
    return layout


def _mapped(quantity: str, said: object, names: Sequence[str], found: Sequence[str], source: str) -> Candidate:
    named = isinstance(said, (str, Mapping))
    if isinstance(said, str):
        columns = [said.replace(SLOT, name) for name in names]
        if SLOT in said and not set(columns) <= set(found):
            named = False
            columns = next(
                (
                    numbered
                    for start in (1, 0)
                    if set(numbered := [said.replace(SLOT, str(k + start)) for k in range(len(names))]) <= set(found)
                ),
                columns,
            )
        elif SLOT not in said:
            columns = [said]
    elif isinstance(said, Mapping):
        strange, absent = [name for name in said if name not in names], [name for name in names if name not in said]
        if strange or absent:
            raise RecordingError(
                f"{source}: the map of {quantity} names {listing([*said])}, but the joints are {listing(names)}"
            )
        columns = [said[name] for name in names]
    else:
        columns = list(said)  # type: ignore[call-overload]
    if len(columns) != len(names):
        raise RecordingError(
            f"{source}: the map has {len(columns)} columns of {quantity} ({listing(columns, 8)}), but the robot has "
            f"{len(names)}: {listing(names)}"
        )
    lacking = [column for column in columns if column not in found]
    if lacking:
        raise RecordingError(
            f"{source}: the map takes {quantity} from {listing(lacking, 8)}, which the log does not have. "
            f"Found: {listing(found)}"
        )
    units = tuple(without_unit(column)[1] for column in columns)
    return Candidate(quantity, tuple(columns), units, named=named)


def _clock(declared: Declared, found: Sequence[str], labels: Labels, source: str, own: Clock | None) -> Clock | None:
    said, units = declared.columns.get("time"), declared.units.get("time")
    if said is not None:
        columns = (said,) if isinstance(said, str) else tuple(said)
        if any(column not in found for column in columns) or len(columns) > 2:
            raise RecordingError(
                f"{source}: the map takes time from {listing(columns, 4)}; wanted one column of the log, or that of "
                f"seconds and that of their fraction. Found: {listing(found)}"
            )
        own = find_clock(columns, labels.units)
        own = (
            Clock(columns, (None,) if len(columns) == 1 else ("s", "ns"))
            if own is None or (own.columns != columns)
            else own
        )
    if own is None or units is None:
        return own
    strange = [unit for unit in units if canonical(unit) not in UNITS["time"]]
    if strange or len(units) != len(own.columns):
        raise RecordingError(
            f"{source}: time has the columns {listing(own.columns)}; wanted a unit for each, of "
            f"{', '.join(UNITS['time'])}; got {listing(units)}"
        )
    return Clock(own.columns, tuple(canonical(unit) for unit in units))


def text_of_map(
    layout: Layout, channels: Sequence[str], dofs: Sequence[str], declared: Declared, linear: Collection[str]
) -> str:
    """The map that a layout follows, as the text of a file that can be edited and given to ``--map``."""
    lines = ["# columns of the log; * stands for the joint, a list is in the order of joints in the model file"]
    units: dict[str, str] = {}
    if layout.clock is not None:
        clock = layout.clock.columns
        lines.append(f"time = {toml(clock[0] if len(clock) == 1 else clock)}")
        said = [unit or "s" for unit in layout.clock.units]
        units["time"] = toml(said[0] if len(said) == 1 else said)
    for quantity, columns in (
        ("position", layout.position),
        ("velocity", layout.velocity),
        ("acceleration", layout.acceleration),
        ("torque", layout.torque),
    ):
        if columns is not None:
            names = channels if quantity == "position" else dofs
            lines.append(f"{quantity} = {toml(_short(columns, names))}")
            units[quantity] = _units(quantity, dict(zip(names, columns, strict=True)), layout, declared, linear)
    lines += ["", "[units]", *(f"{quantity} = {unit}" for quantity, unit in units.items() if unit)]
    drives = {
        "constant": declared.motor_constant, "gear": declared.gear, "efficiency": declared.efficiency
    }  # fmt: skip
    if any(drive is not None for drive in drives.values()):
        lines += ["", "[motor]"]
        lines += [f"{name} = {toml(drive)}" for name, drive in drives.items() if drive is not None]
    return "\n".join(lines) + "\n"


def _short(columns: Sequence[str], names: Sequence[str]) -> str | dict[str, str]:
    if names[0] in columns[0]:
        pattern = SLOT.join(columns[0].rsplit(names[0], 1))
        if [pattern.replace(SLOT, name) for name in names] == list(columns):
            return pattern
    return dict(zip(names, columns, strict=True))


def _units(
    quantity: str, columns: Mapping[str, str], layout: Layout, declared: Declared, linear: Collection[str]
) -> str:
    """The units of columns by joint."""
    if quantity in declared.units:
        return toml(_one_or_all(declared.units[quantity]))
    kind = "current" if quantity == "torque" and declared.motor_constant is not None else quantity
    found: dict[str, None] = {}
    for name, column in columns.items():
        size = layout.factors.get(column, 1.0) / (declared.drive(name) if quantity == "torque" else 1.0)
        fitting = [unit for unit in UNITS[kind] if quantity == "torque" or is_length(unit) == (name in linear)]
        found[min(fitting, key=lambda unit: abs(UNITS[kind][unit] / size - 1.0))] = None
    return toml(_one_or_all(list(found)))


def _one_or_all(words: Sequence[str]) -> str | list[str]:
    return words[0] if len(words) == 1 else list(words)


def toml(value: object) -> str:
    """A value as TOML writes it."""
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{json.dumps(key)} = {toml(one)}" for key, one in value.items()) + " }"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, Sequence):
        return "[" + ", ".join(toml(one) for one in value) + "]"
    return repr(value)
