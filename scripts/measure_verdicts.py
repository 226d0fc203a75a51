"""Words of the verdict on random experiments with known truth, good and spoilt logs alike, against deserved ones.

    python scripts/measure_verdicts.py [--seeds 0-29] [--jobs 2] [--json FILE]

Every seed is identified twice, from 60 % of its log with the rest held out: as it is drawn, and spoilt
(``scripts/population/spoiling.py``, one kind a seed in turn). Seeds 0-299 are for development, 1000-1999 for reporting.

What is deserved follows from computed torque, whose tracking error is the share of the torque that the model misses,
times the error of feedback alone. At the noise-free truth of a fresh motion *useless* is a model that misses three
tenths of all torque, or half of the energy of one moving joint's varying torque; *good* is one that misses at most a
tenth of all and three tenths of every joint's, from a log without wrong clock, gains or signs in which every joint
moves. Between them every word is right.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before NumPy is loaded: processes are the parallelism here

import argparse
import json
import warnings
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from itertools import product
from pathlib import Path

import numpy as np
from benchmark_population import seeds_of
from population.experiments import draw_experiment
from population.spoiling import KINDS, spoilt
from rich.console import Console
from rich.table import Table

from casysid.identification import Settings, identify
from casysid.identification.verdict import judge

USELESS, USELESS_JOINT = 0.3, 0.5**0.5
GOOD, GOOD_JOINT = 0.1, 0.3
SHARE = 0.6
WORDS = ("accepted", "doubtful", "rejected")


def measure(seed: int, is_spoilt: bool) -> dict[str, object]:
    """The words of one experiment, and whether they fit."""
    experiment = draw_experiment(seed)
    kind = KINDS[seed % len(KINDS)] if is_spoilt else ""
    file, log = spoilt(experiment, kind) if kind else (experiment.file, experiment.recording)
    record = {"seed": seed, "kind": kind, "file": experiment.file_error, "faults": list(experiment.faults.names)}
    fitted, held_out = log.split(SHARE)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            result = identify(file, [fitted], Settings(), held_out=[held_out])
            verdict = judge(result)
    except Exception as failure:  # of any kind: a failure is counted, and the others go on
        return record | {"word": f"{type(failure).__name__}", "deserved": "none"}
    missed = result.predict_torque(*experiment.fresh) - experiment.fresh_torque
    whole = float(np.linalg.norm(missed) / np.linalg.norm(experiment.fresh_torque))
    varying = np.maximum(experiment.fresh_torque.std(axis=0), np.finfo(np.float64).tiny)
    moving = (
        ~np.broadcast_to(experiment.family.at_rest, len(varying)) if len(experiment.family.at_rest) else varying > 0
    )
    worst = float((np.sqrt(np.mean(missed**2, axis=0)) / varying)[moving].max(initial=0.0))
    clean = not kind and not {"clock", "gains", "sign"} & set(experiment.faults.names) and bool(moving.all())
    deserved = "between"
    if whole > USELESS or worst > USELESS_JOINT:
        deserved = "useless"
    elif clean and whole <= GOOD and worst <= GOOD_JOINT:
        deserved = "good"
    broken = [f"{one.name} {one.joint}".strip() for one in verdict.criteria if not one.met]
    return record | {"word": verdict.headline, "deserved": deserved, "whole": whole, "joint": worst, "broken": broken}


def show(records: list[dict], console: Console) -> None:
    """Words by what was deserved, and every wrong one."""
    count = Counter((record["deserved"], record["word"]) for record in records)
    table = Table("deserved", *WORDS, title="words of the verdict")
    for deserved in ("good", "between", "useless"):
        table.add_row(deserved, *(str(count[deserved, word]) for word in WORDS))
    console.print(table)
    for record in records:
        pair = record["deserved"], record["word"] == "accepted"
        if pair in (("useless", True), ("good", False)) or record["word"] not in WORDS:
            console.print(record, soft_wrap=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=seeds_of, default=seeds_of("0-29"), help="A-B, both included")
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    parser.add_argument("--json", type=Path, help="one record an experiment")
    options = parser.parse_args()
    works = list(product(options.seeds, (False, True)))
    with ProcessPoolExecutor(options.jobs) as pool:
        records = list(pool.map(measure, *zip(*works, strict=True)))
    if options.json:
        options.json.write_text(json.dumps(records, indent=1) + "\n")
    show(records, Console(width=200))


if __name__ == "__main__":
    main()
