"""Attack the writing of results: kill writers, let two write at once, fill the disk, plant links; count what is broken.

    python scripts/attack_outputs.py [--kills 200] [--calls 60] [--runs 60] [--writers 30] [--disks 20] [--json FILE]

A folder holds a result and a foreign file; another result is written there. Whatever happens, its files have to be
those of one of the two, by their content: anything else is *mixed* (files of both), *torn* (a file that is of neither)
or *unreadable* (a file is missing). The foreign file has to stay, and the next writer has to leave nothing but results
(*litter*). Kills in the write window: half of them anywhere in it, half while names change; the report is drawn
beforehand. ``--calls`` kills a program that calls ``write_result`` and ``write_report``, so the report may be missing;
``--runs`` kills ``casysid identify`` at any time. Full disks need root, for small file systems in memory.
"""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from casysid.bundled import find_model
from casysid.errors import CasysidWarning, OutputError
from casysid.estimation import WeightedLeastSquares
from casysid.identification import IdentificationResult, Settings, identify
from casysid.identification.output import add_result, identity_of, write_result
from casysid.outputs import MANIFEST, check_run_folder, run_folder
from casysid.outputs.files import TEMPORARY
from casysid.recording import Recording
from casysid.report import add_report, html, render_report, write_report
from casysid.robot import Robot
from casysid.simulation import PD, ComputedTorque, ControlModel, Plant, PlantSettings, design_sinusoids, simulate

FILES = ("result.json", "identified.urdf", "drive.yaml", "model.json", "model.npz", "moments.npz", "report.html")
FOREIGN = "notes.txt"
COMMAND = ("--friction", "plain", "--method", "wls", "--cutoff", "12", "--delay", "0")
Write = Callable[[Path], None]


@dataclass(frozen=True)
class Sides:
    """Two results, how each is written, and the digests of the files of each."""

    results: tuple[IdentificationResult, IdentificationResult]
    digests: tuple[dict[str, str], dict[str, str]]

    def judge(self, home: Path, *, report_may_be_missing: bool = False) -> str:
        """``old``, ``new``, or what is broken."""
        found = {name: digest(home / name) for name in FILES if (home / name).exists()}
        sides = {name: [k for k in (0, 1) if self.digests[k][name] == value] for name, value in found.items()}
        missing = set(FILES) - set(found) - ({"report.html"} if report_may_be_missing else set())
        if (home / FOREIGN).read_text() != FOREIGN:
            return "foreign file changed"
        if not all(sides.values()):
            return "torn"
        if len({side[0] for side in sides.values()}) > 1:
            return "mixed"
        return "unreadable" if missing else ("old", "new")[sides["result.json"][0]]


def record(robot: Robot, seed: int) -> Recording:
    plant = Plant(robot, PlantSettings())
    control = ComputedTorque(ControlModel.from_robot(robot, plant.parameters), PD.tuned(robot, plant.parameters))
    motion = design_sinusoids(robot, duration=3.0, seed=seed)
    return simulate(plant, control, motion, rate=400.0, duration=3.0, seed=seed).recording


def make_sides(folder: Path) -> Sides:
    """Two results of one small robot, no file of which is the same."""
    robot = Robot.from_file(find_model("two_link"))
    settings = Settings(method=WeightedLeastSquares(), cutoff=12.0, delay=0.0, choose_friction=False)
    old, new = (identify(robot, record(robot, seed), settings) for seed in (1, 2))
    drawn = {id(result): render_report(result) for result in (old, new)}
    html.render_report = lambda result, origin=None: drawn[id(result)]
    digests = []
    for k, result in enumerate((old, new)):
        write(result, folder / str(k))
        digests.append({name: digest(folder / str(k) / name) for name in FILES})
    assert all(digests[0][name] != digests[1][name] for name in FILES)
    return Sides((old, new), (digests[0], digests[1]))


def write(result: IdentificationResult, home: Path, ready: Callable[[], None] = lambda: None) -> None:
    """As the command line does it; ``ready`` is called when all is there but the names have not changed."""
    with run_folder(home, identity_of(result), waiting=lambda text: None) as stage:
        add_result(result, stage)
        add_report(result, stage)
        ready()


def call_both(result: IdentificationResult, home: Path, ready: Callable[[], None] = lambda: None) -> None:
    """As a program does it, which knows of no other writer."""
    warnings.simplefilter("ignore", CasysidWarning)
    write_result(result, home)
    ready()
    with contextlib.suppress(OutputError):  # another has written its result meanwhile
        write_report(result, home / "report.html")


def kill_writers(sides: Sides, folder: Path, count: int, draw: random.Random, way: Callable[..., None]) -> Counter[str]:
    """States after kills at random instants of a write over the old result."""
    home, states = prepared(sides, folder), Counter[str]()
    instants: list[float] = []
    began = time.monotonic()
    way(sides.results[1], home, lambda: instants.append(time.monotonic()))
    lasts, ends = time.monotonic() - began, time.monotonic() - instants[0]
    for k in range(count):
        reset(sides, home)
        reading, writing = os.pipe()
        child = fork(lambda writing=writing: way(sides.results[1], home, lambda: os.write(writing, b".") and None))
        if k % 2:
            os.read(reading, 1)  # ready
            time.sleep(draw.uniform(0.0, 1.05 * ends))
        else:
            time.sleep(draw.uniform(0.0, 1.05 * lasts))
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        os.close(reading), os.close(writing)
        through = any(path.is_symlink() for path in home.iterdir())
        states[sides.judge(home, report_may_be_missing=way is call_both)] += 1
        states["(while names went through the link)"] += through
        states["litter"] += leaves_litter(home)
    return states


def kill_runs(sides: Sides, folder: Path, count: int, draw: random.Random) -> Counter[str]:
    """States after kills of ``casysid identify`` at random instants over the old result."""
    robot, log = find_model("two_link"), folder / "log.csv"
    record(Robot.from_file(robot), 2).write(log)
    home, states = prepared(sides, folder), Counter[str]()
    command = [sys.executable, "-m", "casysid", "identify", str(robot), str(log), *COMMAND, "--out", str(home)]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    lasts = min(duration_of(lambda: subprocess.run(command, check=True, **quiet)) for _ in range(2))
    for _ in range(count):
        reset(sides, home)
        process = subprocess.Popen(command, **quiet)
        time.sleep(draw.uniform(0.0, 1.1 * lasts))
        process.kill()
        process.wait()
        states[judge_by_list(sides, home)] += 1
        states["litter"] += leaves_litter(home)
    return states


def judge_by_list(sides: Sides, home: Path) -> str:
    """As :meth:`Sides.judge`, where the new files are known by the list that comes with them only."""
    try:
        listed = json.loads((home / MANIFEST).read_text())["files"]
        found = {name: digest(home / name) for name in FILES}
    except (OSError, ValueError):
        return "unreadable"
    old = [found[name] == sides.digests[0][name] for name in FILES]
    if all(old):
        return "old"
    if any(old):
        return "mixed"
    return "new" if found == listed else "torn"


def meet(sides: Sides, folder: Path, count: int, draw: random.Random, way: Callable[..., None]) -> Counter[str]:
    """States after two wrote at once."""
    home, states = prepared(sides, folder), Counter[str]()
    for _ in range(count):
        reset(sides, home)
        begin = time.monotonic() + 0.05
        delays = (0.0, draw.uniform(-0.02, 0.02))
        work = [partial(at, begin + delay, way, sides.results[k], home) for k, delay in enumerate(delays)]
        ended = [os.waitpid(child, 0)[1] for child in [fork(one) for one in work]]
        states["a writer failed"] += any(ended)
        states[sides.judge(home, report_may_be_missing=way is call_both)] += 1
        states["litter"] += leaves_litter(home)
    return states


def at(instant: float, way: Callable[..., None], *arguments: object) -> None:
    time.sleep(max(instant - time.monotonic(), 0.0))
    way(*arguments)


def fill_disks(sides: Sides, folder: Path, count: int) -> Counter[str]:
    """States after a write over the old result on disks of several sizes, from too small to large enough."""
    states = Counter[str]()
    for k in range(count):
        size = 150_000 + k * 200_000 // max(count - 1, 1)
        with small_disk(folder / f"disk{k}", size) as home:
            reset(sides, home)
            try:
                write(sides.results[1], home)
                states["written"] += 1
            except OutputError as error:
                states["refused"] += "No space left" in str(error)
            states["litter"] += any(TEMPORARY.fullmatch(path.name) for path in home.iterdir())
            states[sides.judge(home)] += 1
    return states


@contextlib.contextmanager
def small_disk(home: Path, size: int) -> Iterator[Path]:
    home.mkdir()
    subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(home)], check=True)
    try:
        yield home
    finally:
        subprocess.run(["umount", str(home)], check=True)


def plant_links(sides: Sides, folder: Path) -> Counter[str]:
    """Links to a foreign file under all names that a writer might use; how many writes went through one."""
    home, precious = prepared(sides, folder), folder / "precious"
    precious.write_text("precious")
    forms = ("{}", "{}.part", f".{{}}.{os.getpid()}.part")
    names = [form.format(name) for name in (*FILES, MANIFEST) for form in forms]
    for name in names:
        (home / name).unlink(missing_ok=True)
        (home / name).symlink_to("../precious")
    write(sides.results[1], home)
    states = Counter[str](links=len(names), followed=precious.read_text() != "precious")
    states["results that are links"] = sum((home / name).is_symlink() for name in FILES)
    states[sides.judge(home)] += 1
    return states


def prepared(sides: Sides, folder: Path) -> Path:
    home = Path(tempfile.mkdtemp(dir=folder))
    reset(sides, home)
    return home


def reset(sides: Sides, home: Path) -> None:
    """The old result and the foreign file."""
    (home / FOREIGN).write_text(FOREIGN)
    if not all((home / name).is_file() and digest(home / name) == sides.digests[0][name] for name in FILES):
        write(sides.results[0], home)


def leaves_litter(home: Path) -> bool:
    """Whether anything but results is there after the next has looked at the place; what is there must not change."""
    before = {name: digest(home / name) for name in FILES if (home / name).exists()}
    check_run_folder(home)
    after = {name: digest(home / name) for name in FILES if (home / name).exists()}
    strange = {path.name for path in home.iterdir()} - {*FILES, FOREIGN, MANIFEST}
    return bool(strange) or before != after or any(path.is_symlink() for path in home.iterdir())


def digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def duration_of(work: Callable[[], object]) -> float:
    began = time.monotonic()
    work()
    return time.monotonic() - began


def fork(work: Callable[[], object]) -> int:
    """A child that does the work; its exit status says whether it failed."""
    child = os.fork()
    if child == 0:
        status = 1
        try:
            work()
            status = 0
        finally:
            os._exit(status)
    return child


def attack(options: argparse.Namespace, folder: Path) -> dict[str, Counter[str]]:
    draw, sides = random.Random(options.seed), make_sides(folder)
    states = {
        f"{options.kills} kills in the write window": kill_writers(sides, folder, options.kills, draw, write),
        f"{options.calls} kills of two calls": kill_writers(sides, folder, options.calls, draw, call_both),
        f"{options.runs} kills of whole runs": kill_runs(sides, folder, options.runs, draw),
        f"{options.writers} pairs of writers": meet(sides, folder, options.writers, draw, write),
        f"{options.writers} pairs of two calls": meet(sides, folder, options.writers, draw, call_both),
        "planted links": plant_links(sides, folder),
    }
    if os.geteuid() == 0 and shutil.which("mount"):
        states[f"{options.disks} sizes of disks"] = fill_disks(sides, folder, options.disks)
    else:
        print("full disks: skipped, only root can make small file systems")
    return states


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=200, help="in the write window")
    parser.add_argument("--calls", type=int, default=60, help="kills of write_result and write_report")
    parser.add_argument("--runs", type=int, default=60, help="kills of casysid identify")
    parser.add_argument("--writers", type=int, default=30, help="pairs that write at once")
    parser.add_argument("--disks", type=int, default=20, help="sizes of full disks")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", type=Path, help="write the counts to this file")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="attack-") as folder:
        states = attack(options, Path(folder))
    for name, counts in states.items():
        print(f"{name}: " + ", ".join(f"{state} {count}" for state, count in sorted(counts.items())))
    broken = {state: sum(counts[state] for counts in states.values()) for state in ("mixed", "torn", "unreadable")}
    print("all: " + ", ".join(f"{state} {count}" for state, count in broken.items()))
    if options.json:
        options.json.write_text(json.dumps(states, indent=1) + "\n")
    sys.exit(bool(sum(broken.values())))


if __name__ == "__main__":
    main()
