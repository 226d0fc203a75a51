"""From the units in which columns were logged to SI units at the joint."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from casysid.errors import RecordingError
from casysid.readers.candidates import Candidate, Labels
from casysid.readers.refusals import current_not_torque
from casysid.readers.units_of_columns import UNITS, canonical
from casysid.recording.declared import Declared

LINEAR = ("m", "mm", "cm")


def factors_of(
    chosen: Sequence[Candidate],
    channels: Sequence[str],
    dofs: Sequence[str],
    labels: Labels,
    declared: Declared,
    linear: Collection[str],
    source: str,
) -> dict[str, float]:
    """By which columns are multiplied; those of factor one are left out.

    Raises:
        RecordingError: A unit is unknown or of something else, torques are currents whose motor constant is not known,
            or a drive is declared of a joint that is not there.
    """
    strange = [name for name in declared.joints if name not in dofs]
    if strange:
        raise RecordingError(f"{source}: a drive is declared of '{strange[0]}', but the joints are {', '.join(dofs)}")
    factors: dict[str, float] = {}
    for group in chosen:
        quantity = "torque" if group.quantity == "current" else group.quantity
        names = channels if quantity == "position" else dofs
        for column, unit, name in zip(group.columns, group.units, names, strict=True):
            said = declared.units.get(quantity) or tuple(filter(None, [labels.units.get(column) or unit]))
            if quantity == "torque":
                factor = _torque(said, group, declared, source) * declared.drive(name)
            else:
                factor = _motion(said, quantity, column, name in linear, source)
            if factor != 1.0:
                factors[column] = factor
    return factors


def is_length(unit: str) -> bool:
    """Whether a unit is of joints that slide."""
    return unit.split("/")[0] in LINEAR


def _motion(said: Sequence[str], quantity: str, column: str, length: bool, source: str) -> float:
    for unit in said:
        size = UNITS[quantity].get(canonical(unit))
        if size is None:
            raise _unknown(unit, quantity, column, source)
        if is_length(canonical(unit)) == length:
            return size
    if said and not length:
        raise RecordingError(
            f"{source}: '{column}' is of a joint that turns, but its unit is said to be {said[0]}; wanted an angle's"
        )
    return 1.0


def _torque(said: Sequence[str], group: Candidate, declared: Declared, source: str) -> float:
    units = [canonical(unit) for unit in said]
    for unit in units:
        if unit not in UNITS["torque"] and unit not in UNITS["current"]:
            raise _unknown(unit, "torque", group.columns[0], source)
    amperes = [UNITS["current"][unit] for unit in units if unit in UNITS["current"]]
    torques = [UNITS["torque"][unit] for unit in units if unit in UNITS["torque"]]
    if declared.motor_constant is None and (amperes or (group.quantity == "current" and not torques)):
        raise current_not_torque(group, source)
    return (amperes or ([1.0] if declared.motor_constant is not None else torques) or [1.0])[0]


def _unknown(unit: str, quantity: str, column: str, source: str) -> RecordingError:
    return RecordingError(
        f"{source}: '{column}' has the unit '{unit[:40]}', which is none of {quantity}: {', '.join(UNITS[quantity])}; "
        f"say --units {quantity}=UNIT, or convert the column"
    )
