"""What a user says of a log: units, maps, drives; and what is refused rather than guessed."""

import re
import warnings
from pathlib import Path

import numpy as np
import pytest

from casysid.errors import ParameterError, RecordingError
from casysid.readers.candidates import Labels
from casysid.readers.columns import match_columns
from casysid.readers.mapping import lay_out
from casysid.readers.units_of_columns import UNITS, canonical, is_unit
from casysid.readers.words import meaning_of, without_unit, words_of
from casysid.recording import Declared, draft_map, parse_drive, parse_units, read_map, read_recording
from tests.recording.test_repairs import clean, make_robot

README = Path(__file__).parents[2] / "README.md"
JOINTS = ("turn", "lift")


def layout(names: str, declared: Declared | None = None, joints: tuple[str, ...] = JOINTS, **options: object):
    return lay_out(names.split(), joints, joints, "log.csv", Labels(), declared or Declared(), (), **options)


def test_the_map_of_the_readme_is_one(tmp_path: Path) -> None:
    text = re.search(r"^```toml\n(time.*?)^```$", README.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    assert text is not None
    (tmp_path / "map.toml").write_text(text[1], encoding="utf-8")
    declared = read_map(tmp_path / "map.toml")
    found = "sec nanosec /joint_states/elbow/position /joint_states/wrist/position i_2 i_3"
    made = layout(found, declared, ("elbow", "wrist"))
    assert made.clock.units == ("s", "ns")
    assert made.factors == pytest.approx({"i_2": 0.021, "i_3": -0.0105})


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("position = 3", "position wants text"),
        ("positions = 'q*'", "does not know 'positions'"),
        ("[units]\nspeed = 'rpm'", r"\[units\] wants a table of time"),
        ("[motor]\ngear = 0", "motor.gear wants a ratio"),
        ("[motor]\nefficiency = 1.5", "motor.efficiency wants a number above 0"),
        ("position = ", "no map of columns"),
    ],
)
def test_a_map_says_what_it_cannot_take(text: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "map.toml").write_text(text)
    with pytest.raises(ParameterError, match=message):
        read_map(tmp_path / "map.toml")


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ({"position": "c*", "torque": "b*"}, "takes position from cturn, clift, which the log does not have"),
        ({"position": ["a1"], "torque": "b*"}, r"1 columns of position \(a1\), but the robot has 2"),
        ({"position": {"turn": "a1"}, "torque": "b*"}, "names turn, but the joints are turn, lift"),
        ({"position": ["a1", "a2"]}, "names no columns of torque"),
        ({"position": ["a1", "a2"], "torque": ["b1", "b2"], "time": "when"}, "takes time from when"),
    ],
)
def test_a_map_must_fit_the_log(columns: dict, message: str) -> None:
    with pytest.raises(RecordingError, match=message):
        layout("t a1 a2 b1 b2", Declared(columns=columns))


def test_a_star_may_stand_for_numbers() -> None:
    made = layout("t a_0 a_1 b_0 b_1", Declared(columns={"position": "a_*", "torque": "b_*"}))
    assert (made.position, made.torque) == (("a_0", "a_1"), ("b_0", "b_1"))


@pytest.mark.parametrize(
    "names",
    [
        "t q1 q2 current1 current2",
        "t q1 q2 motor_current_1 motor_current_2",
        "t q1 q2 tau1[A] tau2[A]",
        "t q1 q2 tau_1_mA tau_2_mA",
        "t actual_q_0 actual_q_1 actual_current_0 actual_current_1",
        "t q_turn q_lift i_turn i_lift",
    ],
)
def test_currents_are_no_torques_unless_their_constant_is_known(names: str) -> None:
    with pytest.raises(RecordingError, match=r"looks like motor currents.*--motor-constant.*--units torque=Nm"):
        layout(names)
    made = layout(names, Declared(motor_constant=0.1, gear={"turn": 50.0, "lift": -100.0}, efficiency=0.8))
    assert made.torque == tuple(names.split()[-2:])
    unit = 1e-3 if "mA" in names else 1.0
    assert [made.factors[name] / unit for name in made.torque] == pytest.approx([4.0, -8.0])
    declared = layout(names, Declared(units={"torque": ("Nm",)}))
    assert not declared.factors


def test_torques_of_motors_are_brought_to_the_joints() -> None:
    made = layout("t q1 q2 tau1 tau2", Declared(gear=100.0, efficiency={"lift": 0.5}))
    assert made.factors == {"tau1": 100.0, "tau2": 50.0}
    with pytest.raises(RecordingError, match="declared of 'elbow', but the joints are turn, lift"):
        layout("t q1 q2 tau1 tau2", Declared(gear={"elbow": 3.0}))


@pytest.mark.parametrize(
    ("names", "position", "torque"),
    [
        ("t target_q_0 target_q_1 actual_q_0 actual_q_1 cmd_tau_0 cmd_tau_1 tau_0 tau_1", "actual_q_0", "tau_0"),
        ("t q1 q2 q_d1 q_d2 tau1 tau2 tau_ext_1 tau_ext_2", "q1", "tau1"),
        ("t turn/position lift/position turn/effort lift/effort gripper/effort", "turn/position", "turn/effort"),
        ("t a/turn/position a/lift/position a/turn/effort a/lift/effort b/turn/position b/lift/position",
         "a/turn/position", "a/turn/effort"),
        ("t left_turn_pos left_lift_pos left_turn_tau left_lift_tau", "left_turn_pos", "left_turn_tau"),
        ("t q1 q2 position1 position2 tau1 tau2", "q1", "tau1"),
    ],
)  # fmt: skip
def test_what_was_measured_is_taken(names: str, position: str, torque: str) -> None:
    made = layout(names)
    assert (made.position[0], made.torque[0]) == (position, torque)


def test_two_readings_that_are_alike_are_both_named() -> None:
    both = "t " + " ".join(
        f"{arm}/{j}/{w}" for arm in ("left", "right") for j in JOINTS for w in ("position", "effort")
    )
    with pytest.raises(RecordingError, match=r"in two ways: .*left/turn/position .*right/turn/position.*--map FILE"):
        layout(both)


def test_one_number_twice_is_refused() -> None:
    for names in ("t q1 q01 q2 tau1 tau2", "t actual_q1 actual_q01 actual_q2 tau1 tau2"):
        with pytest.raises(RecordingError, match=r"q01.* number"):
            layout(names)


def test_a_joint_that_was_not_logged_is_locked_word_by_word() -> None:
    with pytest.raises(RecordingError, match=r"no column q_lift.*Nearest is q_turn \(1 of 2\).*--lock lift=VALUE"):
        layout("t q_turn tau_turn")
    with pytest.raises(RecordingError, match="--lock lift=VALUE"):
        layout("t turn/position turn/effort")


@pytest.mark.parametrize(
    ("texts", "message"),
    [(["deg"], "units want QUANTITY=UNIT"), (["speed=rpm"], "units want"), (["q="], "units want")],
)
def test_units_have_a_form(texts: list[str], message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        parse_units(texts)


def test_units_of_a_column_must_be_of_its_quantity() -> None:
    assert parse_units(["q=deg,tau=mNm", "q=mm"]) == {"position": ("deg", "mm"), "torque": ("mNm",)}
    with pytest.raises(RecordingError, match="has the unit 'parsec', which is none of position: rad"):
        layout("t q1[parsec] q2[parsec] tau1 tau2")
    with pytest.raises(RecordingError, match="of a joint that turns, but its unit is said to be mm"):
        layout("t q1[mm] q2[mm] tau1 tau2")


@pytest.mark.parametrize("text", ["x", "a=", "0", "a=0", "nan"])
def test_drives_have_a_form(text: str) -> None:
    with pytest.raises(ParameterError, match="--gear wants a ratio between"):
        parse_drive("--gear", "gear", [text])


def test_drives_are_of_all_joints_or_of_each() -> None:
    assert parse_drive("--gear", "gear", ["100"]) == 100.0
    assert parse_drive("--gear", "gear", ["a=1,b=2", "c=-3"]) == {"a": 1.0, "b": 2.0, "c": -3.0}
    with pytest.raises(ParameterError, match="got both"):
        parse_drive("--gear", "gear", ["1", "a=2"])


@pytest.mark.parametrize("quantity", UNITS)
def test_units_are_known_however_they_are_spelled(quantity: str) -> None:
    for unit in UNITS[quantity]:
        assert canonical(unit) == unit
        assert canonical(f" {unit} ") == unit
        assert is_unit(unit)
    for spelling, unit in (("°/s", "deg/s"), ("N·m", "Nm"), ("N*m", "Nm"), ("rad/s^2", "rad/s2"), ("µs", "us"),
                           ("Degrees", "deg"), ("m/s²", "m/s2"), ("[", "[")):  # fmt: skip
        assert canonical(spelling) == unit


@pytest.mark.parametrize(
    ("name", "quantity"),
    [
        ("actual_qd_0", "velocity"),
        ("qDot1", "velocity"),
        ("joint_torque_current_1", "current"),
        ("current_position_1", "position"),
        ("tau_ext_1", None),
        ("temperature_1", None),
        ("tau_J_d", "torque"),
    ],
)
def test_words_name_quantities(name: str, quantity: str | None) -> None:
    found = meaning_of(words_of(without_unit(name)[0]))
    assert (found[0].quantity if found else None) == quantity


def test_a_text_without_names_shows_what_they_would_be_and_is_read_by_a_map(tmp_path: Path) -> None:
    path, log = tmp_path / "log.csv", clean()
    path.write_text("\n".join(",".join(repr(float(x)) for x in row) for row in zip(*log.values(), strict=True)))
    with pytest.raises(RecordingError, match=r"5 columns would be \(time,q1..q2,tau1..tau2\)"):
        read_recording(path, make_robot())
    declared = Declared(
        columns={"time": "column1", "position": ["column2", "column3"], "torque": ["column4", "column5"]}
    )
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        np.testing.assert_array_equal(read_recording(path, make_robot(), declared).position[:, 0], log["q_turn"])


def test_a_draft_needs_no_robot(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("timestamp,actual_q_0,target_q_0,actual_current_0,mode\n0,1,1,1,1\n")
    assert draft_map(path).splitlines() == [
        'time = "timestamp"',
        'position = ["actual_q_0"]',
        '# commanded position = ["target_q_0"]',
        '# current = ["actual_current_0"]',
        '# others: ["mode"]',
    ]


def test_a_time_of_seconds_and_nanoseconds_is_found_beside_others() -> None:
    made = match_columns(("header.stamp.sec", "header.stamp.nanosec", "q1", "tau1"), ("a",), ("a",), "log")
    assert made.clock is not None
    assert made.clock.columns == ("header.stamp.sec", "header.stamp.nanosec")
