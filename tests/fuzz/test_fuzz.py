"""Whatever bytes are given, they load or are refused with one of casysid's errors: no traceback, hang, crash or bomb.

``FUZZ_SECONDS`` is the time for each target here; ``make fuzz`` takes an hour for all.
"""

import faulthandler
import os
import signal
from pathlib import Path

import pytest

from tests.fuzz.harness import Target, fuzz, mutant, run_inputs
from tests.fuzz.targets import targets

SECONDS = float(os.environ.get("FUZZ_SECONDS", "3"))
SEEDS = Path(__file__).parent / "seeds"
NAMES = ("csv", "csv-gz", "parquet", "npz", "urdf", "mjcf", "result", "moments", "command")


@pytest.mark.parametrize("name", NAMES)
def test_good_files_and_those_that_once_failed_load_or_are_refused(name: str) -> None:
    target = targets()[name]
    found = [path.read_bytes() for path in sorted((SEEDS / name).glob("*"))]
    tally = run_inputs(target, [*target.seeds, *found])
    assert not tally.failures, tally.failures[0][1]
    assert tally.outcomes["loads"] >= (1 if name == "command" else len(target.seeds))


@pytest.mark.parametrize("name", NAMES)
def test_mutants_load_or_are_refused(name: str) -> None:
    tally = fuzz(targets()[name], seconds=SECONDS)
    assert not tally.failures, tally.failures[0][1]


def test_mutants_are_the_same_every_time() -> None:
    for target in targets().values():
        assert [mutant(target, 1, k) for k in range(20)] == [mutant(target, 1, k) for k in range(20)]
        assert len({mutant(target, 1, k) for k in range(20)}) > 10


def _misbehave(path: Path) -> None:
    match path.read_bytes():
        case b"hang":
            while True:
                pass
        case b"crash":
            faulthandler.disable()
            os.kill(os.getpid(), signal.SIGSEGV)
        case b"bomb":
            bytearray(1 << 40)
        case b"wrong":
            raise ZeroDivisionError


def test_the_harness_sees_what_it_is_there_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tests.fuzz.harness.LONGEST", 0.2)
    target = Target("x", ".x", (b"",), (), _misbehave)
    tally = run_inputs(target, [b"", b"hang", b"crash", b"bomb", b"wrong", b""])
    assert tally.outcomes == {"loads": 2, "hang": 1, "crash": 1, "uncaught": 2}
    assert [content for content, _ in tally.failures] == [b"hang", b"crash", b"bomb", b"wrong"]
