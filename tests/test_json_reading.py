"""A result.json that somebody edited, or that was made to harm."""

import json

import pytest

from casysid.errors import ParameterError
from casysid.validation import read_earlier_result

GOOD = {
    "friction": {"shoulder": {"viscous": 0.1, "coulomb": None}},
    "cutoff": {"hz": 12.0},
    "delay": {"seconds": {"shoulder": 0.002}},
    "time_base": {"scale": 1.0, "quasi_static": False},
    "torque_gains": {"gains": {"shoulder": 1.1}},
    "flip": ["tau_shoulder"],
    "friction_model": {"columns": [{"kind": "viscous"}, {"kind": "coulomb", "width": [0.01]}], "couplings": []},
}


def put(path, value):
    content = json.loads(json.dumps(GOOD))
    place = content
    *keys, last = path.split("/")
    for key in keys:
        place = place[int(key) if isinstance(place, list) else key]
    place[int(last) if isinstance(place, list) else last] = value
    return json.dumps(content).encode()


BROKEN = {
    "friction is a list": (put("friction", []), "'friction' is a list, wanted an object"),
    "a joint's friction is a text": (put("friction/shoulder", "x"), "'friction.shoulder' is a text"),
    "a coefficient is an object": (put("friction/shoulder/viscous", {}), "'friction.shoulder.viscous' is an object"),
    "a coefficient is endless": (put("friction/shoulder/viscous", 1e300), "wanted a number from -1e\\+09"),
    "a coefficient is true": (put("friction/shoulder/viscous", True), "is True, wanted a number"),
    "no cut-off": (put("cutoff", {}), "there is no 'hz'"),
    "a cut-off of nothing": (put("cutoff/hz", 0.0), "'cutoff.hz' is 0.0, wanted a number from 0.01"),
    "a delay that is none": (put("delay/seconds/shoulder", float("nan")), "'delay.seconds.shoulder' is nan"),
    "a gain of zero": (put("torque_gains/gains/shoulder", 0), "'torque_gains.gains.shoulder' is 0"),
    "columns to flip": (put("flip", "tau"), "'flip' is a text, wanted a list of texts"),
    "a width below zero": (put("friction_model/columns/1/width", -1.0), "width must be positive"),
    "a width that is none": (put("friction_model/columns/1/width", float("inf")), "columns.1.width' is inf"),
    "a kind unheard of": (put("friction_model/columns/0", {"kind": "magic"}), "'magic'"),
    "a field unheard of": (put("friction_model/columns/0", {"kind": "viscous", "x": 1}), "unexpected keyword|x"),
    "no kinds": (put("friction_model", {}), "there is no 'couplings'|there is no 'columns'|columns|couplings"),
    "deep": (b"[" * 100_000, "nested too deeply"),
    "a list": (b"[]", "it holds a list, wanted an object"),
    "no text": (b"\xff\xfe\x00", "utf-8"),
    "nothing": (b"", "Expecting value"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_what_is_no_result_is_named(name, tmp_path):
    content, message = BROKEN[name]
    path = tmp_path / "result.json"
    path.write_bytes(content)
    with pytest.raises(ParameterError, match=message) as caught:
        read_earlier_result(path)
    assert str(caught.value).startswith(f"{path}: ")


def test_a_whole_result_is_read(tmp_path):
    path = tmp_path / "result.json"
    path.write_text(json.dumps(GOOD))
    earlier = read_earlier_result(path)
    assert earlier.drives == GOOD["friction"]
    assert earlier.delays == {"shoulder": 0.002}
    assert earlier.torque_gains == {"shoulder": 1.1}
    assert earlier.friction is not None
    assert read_earlier_result(tmp_path).drives == earlier.drives


def test_a_torque_that_was_logged_with_the_other_sign_has_a_negative_gain(tmp_path):
    path = tmp_path / "result.json"
    path.write_text(json.dumps({**GOOD, "torque_gains": {"gains": {"shoulder": -1.1}}}))
    assert read_earlier_result(path).torque_gains == {"shoulder": -1.1}
    path.write_text(json.dumps({**GOOD, "torque_gains": {"gains": {"shoulder": 0.0}}}))
    with pytest.raises(ParameterError, match=r"torque_gains\.gains\.shoulder"):
        read_earlier_result(path)
