"""Options out of range and names that a terminal would obey."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from casysid.bundled import find_model
from casysid.cli.app import app
from casysid.cli.console import printable
from casysid.cli.ranges import RANGES, check_samples, checked, numbers
from casysid.errors import ParameterError

URDF = str(find_model("two_link.urdf"))


def run(*arguments):
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


@given(st.sampled_from(sorted(RANGES)), st.floats())
def test_every_range_takes_its_ends_and_refuses_what_is_beyond_in_one_form(name, value):
    option, _, verb = name.partition(" of ")
    wanted = RANGES[name]
    assert checked(option, wanted.low, of=verb) == wanted.low
    assert checked(option, wanted.high, of=verb) == wanted.high
    if wanted.low <= value <= wanted.high:
        assert checked(option, value, of=verb) == value
    else:
        with pytest.raises(ParameterError, match=rf"^{option} wants .* to .* \(.+\); got "):
            checked(option, value, of=verb)


@given(st.lists(st.floats(-1e4, 1e4), min_size=1, max_size=8))
def test_numbers_are_read_as_written(values):
    assert numbers("--box", ",".join(map(repr, values)), len(values)) == tuple(values)
    with pytest.raises(ParameterError, match="--box wants"):
        numbers("--box", ",".join(map(repr, values)), len(values) + 1)


def test_a_motion_of_more_samples_than_fit_is_not_made():
    check_samples(3600.0, 1000.0)
    for duration, rate in ((3600.0, 1e5), (math.nan, 1.0), (math.inf, 1.0)):
        with pytest.raises(ParameterError, match="at most 10000000 are made"):
            check_samples(duration, rate)


@pytest.mark.parametrize(
    "arguments",
    [
        ("identify", URDF, "log.csv", "--cutoff", "1e9"),
        ("identify", URDF, "log.csv", "--cutoff", "nan"),
        ("identify", URDF, "log.csv", "--delay", "1e9"),
        ("identify", URDF, "log.csv", "--time-scale", "1e9"),
        ("identify", URDF, "log.csv", "--noise-position", "1e300"),
        ("identify", URDF, "log.csv", "--lock", "elbow=1e300"),
        ("identify", URDF, "log.csv", "--gravity", "0", "0", "1e300"),
        ("compare", URDF, "log.csv", "--split", "1e-9"),
        ("validate", URDF, "log.csv", "--cutoff", "-1"),
        ("excite", URDF, "--seed", "-1"),
        ("excite", URDF, "--rate", "1e12"),
        ("excite", URDF, "--harmonics", "1000000"),
        ("excite", URDF, "--box", "0,0,0,1,1,1e300"),
        ("rehearse", URDF, "--rate", "1"),
        ("rehearse", URDF, "--duration", "inf"),
    ],
    ids=lambda arguments: " ".join((arguments[0], *arguments[2:])),
)
def test_absurd_values_are_bad_input(arguments):
    option = next(word for word in arguments if word.startswith("--"))
    answer = run(*arguments)
    assert answer.exit_code == 2, answer.output
    assert answer.stderr.startswith(f"error: {option} wants ")


def test_names_are_printed_and_not_obeyed(tmp_path):
    text = find_model("two_link.urdf").read_text().replace('<robot name="two_link"', '<robot name="x[/]y [red]"')
    (tmp_path / "[bold].urdf").write_text(text)
    answer = run("info", tmp_path / "[bold].urdf")
    assert answer.exit_code == 0, answer.output
    assert "x[/]y [red]" in answer.stdout
    assert "[bold].urdf" in answer.stdout.replace("\n", "")
    missing = run("info", tmp_path / "[bold].urdf", r"b\[/x].csv")
    assert missing.exit_code == 2
    assert r"b\[/x].csv: no such file" in missing.stderr


@given(st.text())
def test_what_is_printed_controls_no_terminal(text):
    shown = printable(text)
    assert all(letter.isprintable() or letter == "\n" for letter in shown)
    assert printable(shown) == shown
    shown.encode("utf-8")
