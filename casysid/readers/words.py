"""What the name of a column says: of which quantity it is, of which joint, in which unit.

Names are cut into words at every mark, at digits and at capitals within (``jointPos_1``: joint, pos, 1); so one grammar
reads ``q_elbow``, ``elbow/effort``, ``/joint_states/elbow/position``, ``actual_qd_0``, ``effort[3]`` and
``q1 [deg]``.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

from casysid.readers.units_of_columns import canonical, is_unit, is_unit_of

SLOT = "*"
"""Stands for the joint among the words of a name."""
STRONG = {
    "position": "q qs pos poses position positions angle angles ang theta thetas qpos jointpos",
    "velocity": "dq dqs qd qds qdot qdots qp vel vels velocity velocities speed speeds omega dtheta thetadot qvel",
    "acceleration": "ddq ddqs qdd qdds qddot qddots qpp acc accs accel accels acceleration accelerations ddtheta qacc",
    "torque": "tau taus effort efforts torque torques trq tq moment moments force forces drehmoment",
    "current": "current currents curr amp amps ampere amperes iq strom",
}
WEAK = {"velocity": "v", "acceleration": "a", "current": "i", "position": "state"}
TIME = "time times timestamp timestamps stamp stamps t clock elapsed zeit"
COMMANDED = (
    "target targets cmd cmds command commands commanded desired des ref refs reference references setpoint setpoints "
    "sp goal goals d demand demanded planned nominal action set"
)
ALIEN = (
    "error errors err errs std stddev var variance cov covariance limit limits max min temp temperature voltage power "
    "tcp tool flange cart cartesian wrench ext external hat residual offset bias gravity coriolis friction status mode "
    "flag flags diff delta rms mean count counts tick ticks imu odom twist pose linear angular gripperforce"
)
MOTOR = "motor motors mot rotor drive drives"
FILLING = (
    "joint joints j jnt axis ax state states actual act measured meas msr fb feedback present field data msg value "
    "values sensor of the robot arm"
)

_QUANTITY = {word: quantity for quantity, words in STRONG.items() for word in words.split()}
_WEAK = {word: quantity for quantity, words in WEAK.items() for word in words.split()}
_TIME, _COMMANDED, _ALIEN = set(TIME.split()), set(COMMANDED.split()), set(ALIEN.split())
_MOTOR, _FILLING = set(MOTOR.split()), set(FILLING.split())
_DERIVED = {("position", "dot"): "velocity", ("position", "ddot"): "acceleration", ("velocity", "dot"): "acceleration"}
_CUT = re.compile(r"(?:mNm|kNm|Ncm|mA|mN|kN)(?![A-Za-z])|[0-9]+|[A-Z]+(?![a-z])|[A-Z]?[^\W\d_A-Z]+")
_BRACKETS = re.compile(r"\s*[\[({<]\s*([^\[\](){}<>]*[^\[\](){}<>\d\s][^\[\](){}<>]*)\s*[\])}>]\s*$")


@dataclass(frozen=True)
class Meaning:
    """Of the words that are left of a column's name once its joint is taken out.

    Attributes:
        quantity: Position, velocity, acceleration, torque or current.
        commanded: Whether it is what was asked for, not what was measured.
        motor: Whether it names the motor.
        rest: Words that say neither, in their order.
        unknown: How many of these are in no list here.
    """

    quantity: str
    commanded: bool
    motor: bool
    rest: tuple[str, ...]
    unknown: int


@lru_cache(maxsize=1 << 15)
def words_of(name: str) -> tuple[str, ...]:
    """The words of a name in lower case, numbers among them; ``d`` before ``q`` belongs to it."""
    found = [word.lower() for word in _CUT.findall(name)]
    joined: list[str] = []
    for word in found:
        if joined and word == "q" and joined[-1] in ("d", "dd"):
            joined[-1] += word
        else:
            joined.append(word)
    return tuple(joined)


def without_unit(name: str) -> tuple[str, str | None]:
    """A name without the unit in brackets at its end, and that unit; a number in brackets is no unit."""
    found = _BRACKETS.search(name)
    if found is None or not name[: found.start()].strip():
        return name, None
    return name[: found.start()], found[1].strip()


def meaning_of(words: Sequence[str]) -> tuple[Meaning, str | None] | None:
    """What words say, the joint among them replaced by a slot, and the unit if the last of them is one.

    Letters that mean more than a unit (m, s, n) are none here; ``a`` is one at the very end only. None if the words
    name no quantity.
    """
    left, unit = [word for word in words if word != SLOT], None
    last = left[-1] if len(left) > 1 else ""
    if is_unit(last) and (len(last) > 1 or (last == "a" and words[-1] == last)) and last not in _QUANTITY:
        unit = left.pop()
    quantity, used = _quantity_of(left)
    if quantity is None or any(word in _ALIEN for word in left):
        return None
    if unit is not None and not is_unit_of(unit, quantity) and not is_unit_of(unit, "current"):
        left, unit = [word for word in words if word != SLOT], None
    if quantity == "torque" and unit is not None and is_unit_of(unit, "current"):
        quantity = "current"
    rest = tuple(word for word in left if word not in used)
    meaning = Meaning(
        quantity,
        any(word in _COMMANDED for word in rest),
        any(word in _MOTOR for word in rest),
        rest,
        sum(word not in _FILLING | _COMMANDED | _MOTOR and not word.isdigit() for word in rest),
    )
    return meaning, unit


def _is_quantity(word: str) -> bool:
    return word in _QUANTITY or word in _WEAK


def _quantity_of(words: Sequence[str]) -> tuple[str | None, tuple[str, ...]]:
    """The one quantity that the words name, and the words that name it."""
    strong = {word: _QUANTITY[word] for word in words if word in _QUANTITY}
    kinds = set(strong.values())
    if "current" in kinds and kinds & {"position", "velocity", "acceleration"}:  # the present position
        strong = {word: kind for word, kind in strong.items() if kind != "current"}
        kinds.discard("current")
    if kinds == {"current", "torque"}:  # a current that makes torque; it is not taken for one
        return "current", tuple(strong)
    if len(kinds) == 1:
        kind, used = kinds.pop(), tuple(strong)
        for mark in ("dot", "ddot"):
            if mark in words and (kind, mark) in _DERIVED:
                return _DERIVED[kind, mark], (*used, mark)
        return kind, used
    weak = {word: _WEAK[word] for word in words if word in _WEAK}
    if not kinds and len(set(weak.values())) == 1:
        return next(iter(weak.values())), tuple(weak)
    return None, ()


def time_unit_of(name: str) -> tuple[int, str | None] | None:
    """How little a name says beside that it is a time, and its unit if it says one; None if it says no time."""
    bare, unit = without_unit(name)
    words = list(words_of(bare))
    if words and unit is None and len(words) > 1 and is_unit_of(words[-1], "time"):
        unit = words.pop()
    if not any(word in _TIME for word in words) or any(word in _ALIEN | _COMMANDED - {"set"} for word in words):
        return None
    if any(_is_quantity(word) and word != "state" for word in words) or any(word.isdigit() for word in words):
        return None
    if unit is not None and not is_unit_of(unit, "time"):
        return None
    return len([word for word in words if word not in _TIME]), None if unit is None else canonical(unit)


def seconds_part_of(name: str) -> tuple[str, str] | None:
    """What comes before ``sec`` or ``nanosec`` at the end of a name, and the unit; None for other names."""
    words = words_of(without_unit(name)[0])
    if words and is_unit_of(words[-1], "time") and canonical(words[-1]) in ("s", "ns", "us"):
        return " ".join(words[:-1]), canonical(words[-1])
    return None


def curve_times(names: Sequence[str]) -> dict[str, str]:
    """Columns of times by those of values, where a plot's curves were exported each with its own: ``a_x``, ``a_y``."""
    there = set(names)
    found = {name: f"{name[:-1]}x" for name in names if name.endswith(("_y", " y")) and f"{name[:-1]}x" in there}
    return found if 2 * len(found) == len(there) else {}
