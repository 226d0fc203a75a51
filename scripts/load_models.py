"""Load every robot model in folders, and count: loaded, refused with one message, crashed.

    python scripts/load_models.py FOLDER... [--seconds 60] [--json FILE] [--verbose]

Models are files named ``.urdf``, ``.xml``, ``.mjcf`` or ``.xacro`` that hold ``<robot`` or ``<mujoco``. A model is
loaded when ``Robot.from_file`` gives a robot, refused when it raises ``RobotError`` with a message in one line, and
crashed when it does anything else: another exception, the end of the process, more than ``--seconds``. A model that is
refused for joints that mimic others or close loops is loaded once more with ``--lock`` as its message has it. Exit code
1 says that something crashed.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before NumPy is loaded

import argparse
import json
import multiprocessing
import re
import shlex
import sys
import time
import warnings
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

SUFFIXES = (".urdf", ".xml", ".mjcf", ".xacro")
MODEL = re.compile(rb"<\s*(robot|mujoco)[\s>]")
LOCK = re.compile(r"--lock ('[^']+'|\S+=[-+.\deE]+)")


def models_in(folders: list[Path]) -> Iterator[Path]:
    """Files that hold a model, each once."""
    seen = set()
    for folder in folders:
        files = [folder] if folder.is_file() else sorted(folder.rglob("*"))
        for file in files:
            if file.suffix.lower() in SUFFIXES and file.is_file() and file.resolve() not in seen:
                seen.add(file.resolve())
                if MODEL.search(file.read_bytes()):
                    yield file


def load(file: Path) -> tuple[str, str]:
    """What becomes of a model, and in which words."""
    from casysid.errors import RobotError
    from casysid.robot import Robot
    from casysid.robot.likely_bodies import believed

    locked = None
    for attempt in ("loaded", "loaded with locks"):
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                robot = Robot.from_file(file, locked=locked)
                believed(robot)
        except RobotError as error:
            message = str(error)
            locked = {
                name: float(value)
                for name, _, value in (shlex.split(pair)[0].rpartition("=") for pair in LOCK.findall(message))
            }
            if "\n" in message.strip():
                return "crashed", f"message in several lines: {message!r}"
            if attempt != "loaded" or not locked:
                return "refused", message
        except Exception as error:  # whatever it is, it is what is looked for
            return "crashed", f"{type(error).__name__}: {error}"
        else:
            return attempt, f"{robot.nv} degrees of freedom"
    raise AssertionError


def worker(pipe: multiprocessing.connection.Connection) -> None:
    """Loads what is asked for until nothing more is."""
    while (file := pipe.recv()) is not None:
        pipe.send(load(file))


class Loader:
    """A process that loads models, and another one when it dies or hangs."""

    def __init__(self, seconds: float) -> None:
        self._seconds = seconds
        self._start()

    def _start(self) -> None:
        self._pipe, other = multiprocessing.Pipe()
        self._process = multiprocessing.get_context("spawn").Process(target=worker, args=(other,), daemon=True)
        self._process.start()
        other.close()

    def load(self, file: Path) -> tuple[str, str]:
        """What becomes of a model."""
        self._pipe.send(file)
        try:
            if self._pipe.poll(self._seconds):
                return self._pipe.recv()
            found = "crashed", f"no answer within {self._seconds:g} s"
        except EOFError:
            self._process.join()
            found = "crashed", f"the process ended with code {self._process.exitcode}"
        self.close()
        self._start()
        return found

    def close(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.join()


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="+", type=Path, metavar="FOLDER", help="looked through with all below them")
    parser.add_argument("--seconds", type=float, default=60.0, help="for one model")
    parser.add_argument("--json", type=Path, help="write file, outcome and words there")
    parser.add_argument("--verbose", action="store_true", help="one line for every model that is not loaded")
    options = parser.parse_args()
    loader, began, records = Loader(options.seconds), time.perf_counter(), []
    for file in models_in(options.folders):
        outcome, words = loader.load(file)
        records.append({"file": str(file), "outcome": outcome, "words": words})
        if outcome == "crashed" or (options.verbose and not outcome.startswith("loaded")):
            print(f"{outcome}: {file}: {words}", flush=True)
    loader.close()
    if options.json:
        options.json.write_text(json.dumps(records, indent=1) + "\n")
    counts = Counter(record["outcome"] for record in records)
    listing = ", ".join(f"{counts[word]} {word}" for word in ("loaded", "loaded with locks", "refused", "crashed"))
    print(f"{len(records)} models: {listing}; {time.perf_counter() - began:.0f} s")
    return int(counts["crashed"] > 0)


if __name__ == "__main__":
    sys.exit(main())
