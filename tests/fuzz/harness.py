"""Runs mutants in a child process that may hang, crash or run out of memory, and tells what became of each."""

import hashlib
import math
import os
import pickle
import random
import resource
import select
import signal
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from casysid.errors import CasysidError
from tests.fuzz.mutations import Mutation

LONGEST = 5.0
"""Seconds after which an input has hung, on a machine that does nothing else; a busy one is given its load."""
MEMORY = 8 << 30
"""Bytes that a child may ask for."""
PER_CHILD = 500
"""Inputs after which a fresh child starts, so that one's litter does not spoil another's memory."""


@dataclass(frozen=True)
class Target:
    """Something that reads a file.

    Attributes:
        name: Of the folder of its regression seeds.
        suffix: Of the files.
        seeds: Good files.
        mutations: Ways to make them worse.
        run: Reads the file; loads, or raises one of casysid's errors.
    """

    name: str
    suffix: str
    seeds: tuple[bytes, ...]
    mutations: tuple[Mutation, ...]
    run: Callable[[Path], object]


@dataclass
class Tally:
    """What became of the mutants.

    Attributes:
        outcomes: ``loads``, ``refused``, ``uncaught``, ``hang`` and ``crash``.
        failures: Input and reason of every one that neither loaded nor was refused.
        slowest: Seconds of the slowest input.
    """

    outcomes: Counter[str] = field(default_factory=Counter)
    failures: list[tuple[bytes, str]] = field(default_factory=list)
    slowest: float = 0.0


def mutant(target: Target, seed: int, number: int) -> bytes:
    """The ``number``-th mutant of a target, always the same."""
    rng = random.Random(f"{target.name}:{seed}:{number}")
    data, other = rng.choice(target.seeds), rng.choice(target.seeds)
    for _ in range(rng.choice((1, 1, 1, 2))):
        data = rng.choice(target.mutations)(data, other, rng)
    return data


def fuzz(target: Target, *, seed: int = 0, seconds: float | None = None, count: int | None = None) -> Tally:
    """Run mutants until the time is up or there were so many."""
    end = time.monotonic() + seconds if seconds is not None else math.inf
    return _run(target, lambda number: mutant(target, seed, number), math.inf if count is None else count, end)


def run_inputs(target: Target, inputs: Sequence[bytes]) -> Tally:
    """Run given inputs."""
    return _run(target, lambda number: inputs[number], len(inputs), math.inf)


def name_of(content: bytes, target: Target) -> str:
    """The name of a regression seed."""
    return f"{hashlib.sha256(content).hexdigest()[:12]}{target.suffix}"


def _run(target: Target, content: Callable[[int], bytes], count: float, end: float) -> Tally:
    tally, number = Tally(), 0
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"input{target.suffix}"
        while number < count and time.monotonic() < end:
            last = min(number + PER_CHILD, count)
            reading, writing = os.pipe()
            sys.stdout.flush()
            child = os.fork()
            if child == 0:
                os.close(reading)
                _work(target, path, content, number, last, end, writing)
            os.close(writing)
            number = _listen(child, reading, content, number, tally)
    return tally


def _listen(child: int, reading: int, content: Callable[[int], bytes], number: int, tally: Tally) -> int:
    """Notes what a child tells until it ends, dies or hangs; the next number."""
    outcome = ""
    with open(reading, "rb", buffering=0) as stream:
        while not outcome:
            allowed = LONGEST * max(1.0, os.getloadavg()[0])
            if not select.select([reading], [], [], allowed)[0]:
                os.kill(child, signal.SIGKILL)
                outcome = f"hang: no answer in {allowed:.0f} s"
                break
            try:
                kind, reason, took = pickle.load(stream)
            except EOFError:
                break
            tally.outcomes[kind] += 1
            tally.slowest = max(tally.slowest, took)
            if reason:
                tally.failures.append((content(number), reason))
            number += 1
    _, status = os.waitpid(child, 0)
    if not outcome and status != 0:
        outcome = f"crash: wait status {status}"
    if outcome:
        tally.outcomes[outcome.partition(":")[0]] += 1
        tally.failures.append((content(number), outcome))
        number += 1
    return number


def _work(
    target: Target,
    path: Path,
    content: Callable[[int], bytes],
    number: int,
    last: float,
    end: float,
    writing: int,
) -> None:
    """The child: one message an input; never returns."""
    try:
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        os.chdir(path.parent)  # MuJoCo writes a log of its own where it stands
        silence = os.open(os.devnull, os.O_WRONLY)
        os.dup2(silence, 1)
        os.dup2(silence, 2)
        warnings.simplefilter("ignore")
        while number < last and time.monotonic() < end:
            path.write_bytes(content(number))
            os.write(writing, pickle.dumps(_judge(target, path)))
            number += 1
        os._exit(0)
    except BaseException:
        os._exit(70)


def _judge(target: Target, path: Path) -> tuple[str, str, float]:
    start = time.perf_counter()
    kind, reason = "loads", ""
    try:
        target.run(path)
    except CasysidError:
        kind = "refused"
    except BaseException:
        kind, reason = "uncaught", traceback.format_exc(limit=-6)[-2000:]
    return kind, reason, time.perf_counter() - start
