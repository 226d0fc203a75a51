"""Models that were made to harm, or look like it: one message each, before a library crashes or hangs."""

import os
import re
import warnings

import pytest
from hypothesis import given
from hypothesis import strategies as st

from casysid.errors import CasysidWarning, RobotError
from casysid.robot import Robot
from casysid.robot.limits import DEEPEST_CHAIN, LARGEST, MOST_BODIES, MOST_JOINTS, check_expansion, check_numbers
from casysid.robot.xmltext import DEEPEST, MOST_ELEMENTS, parse_xml
from tests.robot.mjcf_models import INERTIAL, model
from tests.robot.urdf_models import ARM

JOINTED = f'<body name="a"><joint name="j"/>{INERTIAL}</body>'
REPLICA = '<replicate count="{}" offset="1 0 0">{}</replicate>'


def tree(count: int, kind: str, *, chain: bool) -> str:
    """A URDF of ``count`` joints, one behind the other or all on the base."""
    parts = ['<robot name="r"><link name="l0"/>']
    for k in range(count):
        parts.append(
            f'<link name="l{k + 1}"/><joint name="j{k}" type="{kind}"><parent link="l{k if chain else 0}"/>'
            f'<child link="l{k + 1}"/></joint>'
        )
    return "".join([*parts, "</robot>"])


BROKEN = {
    "deep": ("<robot>" + "<a>" * DEEPEST + "</a>" * DEEPEST + "</robot>", "more than 500 elements deep"),
    "many": ("<robot>" + "<a/>" * MOST_ELEMENTS + "</robot>", "more than 100000 elements"),
    "no encoding": ('<?xml version="1.0" encoding="klingon"?><robot/>', "encoding that is not read"),
    "many bytes to a letter": ('<?xml version="1.0" encoding="utf-7"?><robot/>', "encoding|not well-formed"),
    "laughs": (
        '<!DOCTYPE r [<!ENTITY a "ha"><!ENTITY b "'
        + "&a;" * 9999
        + '"><!ENTITY c "'
        + "&b;" * 9999
        + '">]><robot name="&c;"/>',
        "not well-formed XML",
    ),
    "moving joints": (tree(MOST_JOINTS + 1, "continuous", chain=False), "1001 moving joints; at most 1000"),
    "links": (tree(MOST_BODIES, "fixed", chain=False), "5001 links or bodies; at most 5000"),
    "a chain on which Pinocchio crashes": (
        tree(DEEPEST_CHAIN + 1, "fixed", chain=True),
        "'l1001' is 1001 joints from the base; at most 1000",
    ),
    "origin": (ARM.replace('xyz="0 0 0.3"', 'xyz="0 0 1e300"'), r"below 1e\+09"),
    "replicas": (model(REPLICA.format(1_000_000, JOINTED)), "at most 5000 bodies"),
    "replicas of replicas": (model(REPLICA.format(100, REPLICA.format(100, JOINTED))), "at most 5000 bodies"),
    "replicated geoms": (model(JOINTED + REPLICA.format("1e5", '<geom size="1"/>')), "5000 copies"),
    "a grid": (
        model('<flexcomp name="f" type="grid" count="30 30 30" spacing=".1 .1 .1"/>' + JOINTED),
        "at most 5000 bodies",
    ),
    "a field": (
        model(JOINTED, '<asset><hfield name="h" nrow="100000" ncol="100000" size="1 1 1 1"/></asset>'),
        "a table of 1e\\+10",
    ),
    "keys": (model(JOINTED, '<size nkey="1000000000"/>'), "nkey asks for a table"),
    "user data": (model(JOINTED, '<size nuser_body="900000000"/>'), "nuser_body asks for a table"),
    "mass": (model('<body name="a"><joint/><geom mass="1e300" size="1"/></body>'), "body 'a': mass is 1e\\+300"),
    "Latin-1": (
        '<?xml version="1.0" encoding="ISO-8859-1"?><mujoco model="\xe9"><worldbody/></mujoco>'.encode("latin-1"),
        "is not UTF-8",
    ),
}


@pytest.mark.parametrize("name", BROKEN)
def test_hostile_models_are_refused_with_a_reason(name, tmp_path):
    text, message = BROKEN[name]
    path = tmp_path / "robot.xml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(RobotError, match=message) as caught:
        Robot.from_file(path)
    assert str(caught.value).startswith(str(path))
    assert len(str(caught.value)) < 1000


def test_what_mujoco_warns_of_is_in_the_message_and_nowhere_else(tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "robot.xml"
    path.write_text(model(JOINTED.replace('diaginertia=".1', 'diaginertia="nan')))
    with pytest.raises(RobotError, match="MuJoCo does not accept"):
        Robot.from_file(path)
    path.write_text(model(JOINTED + '<site name="s" pos="nan 0 0"/>'))
    with pytest.warns(CasysidWarning, match="MuJoCo: XML contains a 'NaN'"):
        Robot.from_file(path)
    assert list(tmp_path.iterdir()) == [path]
    assert capfd.readouterr() == ("", "")


def test_what_includes_and_attached_models_bring_is_counted(tmp_path):
    (tmp_path / "many.xml").write_text(model(REPLICA.format(3000, JOINTED)))
    (tmp_path / "inner.xml").write_text(f"<mujoco>{REPLICA.format(6000, JOINTED)}</mujoco>")
    include = '<mujoco><worldbody><include file="inner.xml"/></worldbody></mujoco>'
    attach = '<attach model="m" prefix="{}"/>'
    twice = (
        '<mujoco><asset><model name="m" file="many.xml"/></asset><worldbody>'
        f"{attach.format('a')}{attach.format('b')}</worldbody></mujoco>"
    )
    for text in (include, twice):
        path = tmp_path / "robot.xml"
        path.write_text(text)
        with pytest.raises(RobotError, match="at most 5000 bodies"):
            check_expansion(parse_xml(text.encode(), path), path)
    itself = '<mujoco><include file="robot.xml"/></mujoco>'
    check_expansion(parse_xml(itself.encode(), path), path)


@given(st.integers(1, 40), st.integers(1, 40), st.integers(1, 40))
def test_nested_replicas_are_counted_as_their_product(outer, middle, inner):
    from pathlib import Path

    text = model(REPLICA.format(outer, REPLICA.format(middle, REPLICA.format(inner, '<body name="b"/>'))))
    refused = False
    try:
        check_expansion(parse_xml(text.encode(), Path("robot.xml")), Path("robot.xml"))
    except RobotError:
        refused = True
    made = outer - 1 + outer * middle - 1 + outer * middle * inner - 1
    assert refused == (outer * middle * inner > MOST_BODIES or made > 5000)


@given(st.floats())
def test_numbers_pass_up_to_the_largest(value):
    from pathlib import Path

    if abs(value) <= LARGEST:
        check_numbers("mass", [0.0, value], Path("r.xml"))
    else:
        with pytest.raises(RobotError, match=re.escape("r.xml: mass is")):
            check_numbers("mass", [0.0, value], Path("r.xml"))


def test_the_longest_chain_that_is_allowed_is_read(tmp_path):
    path = tmp_path / "chain.urdf"
    path.write_text(tree(DEEPEST_CHAIN, "fixed", chain=True).replace('type="fixed"', 'type="continuous"', 1))
    with pytest.warns(CasysidWarning):
        assert len(Robot.from_file(path).joints) == 1


def test_negative_friction_is_said_of_an_mjcf_as_of_a_urdf(tmp_path):
    path = tmp_path / "robot.xml"
    path.write_text(model(f'<body name="a"><joint name="j" armature="-0.1" frictionloss="-2"/>{INERTIAL}</body>'))
    with pytest.warns(CasysidWarning, match=r"joint 'j': negative friction \(damping 0, friction -2, armature -0.1\)"):
        Robot.from_file(path)


def test_no_advice_destroys_a_file(tmp_path):
    """The shell empties what stands behind > before xacro reads."""
    for name, taken in (("arm.urdf", ()), ("arm.xacro", ("arm.urdf",)), ("a b.urdf.xacro", ("a b_expanded.urdf",))):
        for other in taken:
            (tmp_path / other).write_text("precious")
        (tmp_path / name).write_text('<robot xmlns:xacro="x"><xacro:arm/></robot>')
        with pytest.raises(RobotError, match="run `xacro ") as caught:
            Robot.from_file(tmp_path / name)
        target = re.search("> '?([^`']*)'?`", str(caught.value))[1]
        assert not (tmp_path / target).exists()


def test_what_is_no_regular_file_is_not_read(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for path, message in (
        ("/dev/zero", "no regular file"),
        (tmp_path / "pipe", "no regular file"),
        ("a" * 300, "File name too long"),
    ):
        with pytest.raises(RobotError, match=message):
            Robot.from_file(path)


def test_a_huge_mass_is_no_prior(tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text(ARM.replace('<mass value="2.0" />', '<mass value="1e300"/>'))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        Robot.from_file(path)
    assert 'mass value="1e300" is not a finite number below 1e+09' in str(caught[0].message)
