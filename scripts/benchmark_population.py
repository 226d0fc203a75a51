"""casysid with defaults on random experiments with known truth, against least squares that is told the truth's columns.

    python scripts/benchmark_population.py [--seeds 0-99] [--jobs 2] [--json FILE] [--rivals FILE] [--verbose]
        [--frictionless]
    python scripts/benchmark_population.py --seeds 17-17 --verbose
    python scripts/benchmark_population.py --show FILE

Seeds 0-299 are for development; 1000-1999 are for reporting, and nothing is to be chosen by them. A seed is one
experiment: a random mechanism, its friction, a log and a model file that is wrong. The distributions stand in the texts
of ``scripts/population``: ``mechanisms``, ``motions``, ``drives``, ``sensors``, ``files``; ``rivals`` says what
casysid is compared with.

The error is ``‖τ̂ - τ‖ / ‖τ‖`` over all joints at the noise-free truth of a fresh motion of the same distribution, in
true seconds; a log's wrong gains and signs are part of ``τ``, since predicting the log's torque is what is asked. Below
one, a ratio is a win. A failure counts as a ratio of ten. Coverage looks at logs without faults, at ± 1.96 standard
errors.

``--frictionless`` instead takes robots without friction or rotors, 10 s of Fourier motion at 100 Hz with 1 and 5 %
torque noise; the told rival then has rigid bodies alone. Ctrl-C shows what there is until then.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before NumPy is loaded: processes are the parallelism here

import argparse
import json
import math
import signal
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path

from population.scoring import judge
from population.table import coverage, discoveries, groups, show, show_frictionless, summary, what
from rich.console import Console
from rich.progress import track

NOISES = (0.01, 0.05)
"""Of the frictionless robots' torque, as shares of its rms."""


def seeds_of(text: str) -> range:
    """``A-B``, both included, or one number."""
    first, _, last = text.partition("-")
    try:
        seeds = range(int(first), int(last or first) + 1)
    except ValueError:
        seeds = range(0)
    if not seeds:
        raise argparse.ArgumentTypeError(f"wanted A-B with A at most B, such as 0-99; got {text!r}")
    return seeds


def tell(console: Console, record: dict) -> None:
    """One seed as it comes in."""
    error = record.get("error", float("nan"))
    console.print(
        f"seed {record['seed']}: error {error:.4f}, told {record['told']:.4f} ({error / record['told']:.2f}), untold "
        f"{record['untold']:.4f} ({error / record['untold']:.2f}), {record['seconds']:.1f} s CPU; {what(record)}",
        soft_wrap=True,
        highlight=False,
    )
    console.print(record.get("traceback") or {k: record[k] for k in ("found", "coverage")}, soft_wrap=True)


def write(path: Path, records: list[dict], frictionless: bool) -> None:
    """One record a seed, and the figures of the tables."""
    content = {
        "groups": {title: {word: summary(rows) for word, rows in words if rows} for title, words in groups(records)},
        "discoveries": {} if frictionless else discoveries(records),
        "coverage": coverage(records),
        "records": records,
    }
    part = path.with_name(path.name + ".part")
    part.write_text(json.dumps(without_nan(content), indent=1, allow_nan=False) + "\n")
    os.replace(part, path)


def without_nan(value: object) -> object:
    """Nested content with NaN and infinities as None, which JSON can hold."""
    if isinstance(value, dict):
        return {key: without_nan(item) for key, item in value.items()}
    if isinstance(value, list):
        return [without_nan(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def saved(path: Path | None) -> list[dict]:
    """Records that an earlier run wrote."""
    return json.loads(path.read_text())["records"] if path else []


def run(options: argparse.Namespace) -> list[dict]:
    """Records by noise and seed; those there are until Ctrl-C."""
    progress, records = Console(stderr=True), []
    noises = NOISES if options.frictionless else (None,)
    earlier = {(record["seed"], record.get("noise")): record for record in saved(options.rivals)}
    works = [(seed, noise, earlier.get((seed, noise))) for noise in noises for seed in options.seeds]
    with ProcessPoolExecutor(options.jobs, initializer=signal.signal, initargs=(signal.SIGINT, signal.SIG_IGN)) as pool:
        runs = [pool.submit(judge, *work) for work in works]
        try:
            for one in track(as_completed(runs), "seeds", len(runs), console=progress):
                records.append(one.result())
                records.sort(key=lambda record: (record.get("noise", 0.0), record["seed"]))
                if options.verbose:
                    tell(Console(width=200), one.result())
                if options.json:
                    write(options.json, records, options.frictionless)
        except KeyboardInterrupt:
            pool.shutdown(wait=False, cancel_futures=True)
            progress.print(f"interrupted: {len(records)} of {len(runs)} experiments")
    return records


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=seeds_of, default=seeds_of("0-99"), help="A-B, both included")
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    parser.add_argument(
        "--json", type=Path, help="one record a seed, and the figures of the tables; kept up to date all along"
    )
    parser.add_argument("--rivals", type=Path, help="an earlier JSON: rivals of the same experiments are not run again")
    parser.add_argument("--show", type=Path, help="an earlier JSON: its tables, nothing is run")
    parser.add_argument("--verbose", action="store_true", help="every seed's record as it comes in")
    parser.add_argument("--frictionless", action="store_true", help="robots without friction instead")
    options = parser.parse_args()
    records = saved(options.show) if options.show else run(options)
    if records:
        (show_frictionless if "noise" in records[0] else show)(records, Console(width=200))


if __name__ == "__main__":
    main()
