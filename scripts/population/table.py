"""Tables of many records, and the same figures as plain numbers."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from population.drives import EFFECTS
from population.scoring import FINDABLE

Record = dict[str, Any]
FAILED = 10.0
"""Ratio that a failure counts for, as in ``judge.py``."""
WORST = 10
FAULTS = ("clock", "delay", "gains", "sign")


def ratios(records: Sequence[Record], rival: str) -> np.ndarray:
    """Errors over the rival's, shape (records,)."""
    return np.array([record["error"] / record[rival] if "error" in record else FAILED for record in records])


def summary(records: Sequence[Record]) -> dict[str, float]:
    """Figures of a group."""
    told, filtered, untold = (ratios(records, rival) for rival in ("told", "told_filtered", "untold"))
    errors = [record["error"] for record in records if "error" in record]
    return {
        "seeds": len(records),
        "error": float(np.median(errors)) if errors else float("nan"),
        "told error": float(np.median([record["told"] for record in records])),
        "untold error": float(np.median([record["untold"] for record in records])),
        "told: median": float(np.median(told)),
        "95 %": float(np.quantile(told, 0.95)),
        "mean": geometric_mean(told),
        "told, filtered: median": float(np.median(filtered)),
        "mean ": geometric_mean(filtered),
        "untold: median": float(np.median(untold)),
        "95 % ": float(np.quantile(untold, 0.95)),
        "mean  ": geometric_mean(untold),
        "CPU s": float(np.mean([record["seconds"] for record in records])),
    }


def geometric_mean(values: np.ndarray) -> float:
    """Of positive numbers."""
    return float(np.exp(np.mean(np.log(np.maximum(values, 1e-12)))))


def groups(records: Sequence[Record]) -> Iterator[tuple[str, list[tuple[str, list[Record]]]]]:
    """Titles, and the records under each word of a title; some stand under several words."""
    right = [record for record in records if not record["faults"]]
    contained = [record for record in records if record["contained"]]
    yield "all", [("all", list(records)), ("log without faults", right), ("truth in the model class", contained)]
    yield "motion", by(records, lambda r: [r["motion"], *(["with rests"] if r["rests"] else [])])
    yield "friction", by(records, lambda r: r["effects"] or [r["friction"]])
    yield "file", by(records, lambda r: [r["file"]])
    yield "faults of the log", by(records, lambda r: r["faults"] or ["none"])
    yield "sampling", by(records, lambda r: r["sampling"] or ["even"])
    yield "joints", by(records, lambda r: [str(r["joints"])])


def by(records: Sequence[Record], words: Callable[[Record], Sequence[str]]) -> list[tuple[str, list[Record]]]:
    """Records under each of their words, words in order."""
    found = sorted({word for record in records for word in words(record)})
    return [(word, [record for record in records if word in words(record)]) for word in found]


def show(records: Sequence[Record], console: Console) -> None:
    """All tables."""
    table = Table("", *summary(records), title="casysid over least squares, told and untold, best cut-off in hindsight")
    for title, rows in groups(records):
        table.add_section()
        for word, members in rows:
            if members:
                table.add_row(f"{title}: {word}" if word != "all" else "all", *map(figure, summary(members).values()))
    console.print(table)
    show_discoveries(records, console)
    show_coverage(records, console)
    show_worst(records, console)


def figure(value: float) -> str:
    """Three digits, whole numbers as they are."""
    return f"{value:d}" if isinstance(value, int) else f"{value:.3g}"


def discoveries(records: Sequence[Record]) -> dict[str, dict[str, float]]:
    """By effect or fault: experiments with a false one; true ones above the threshold, and the share found."""
    answered = [record["found"] for record in records if "found" in record]
    false = Counter(effect for found in answered for effect in set(found["false"]))
    rows = {}
    for effect in (*EFFECTS, *sorted(set(false) - set(EFFECTS))):
        true = [one for found in answered for one in found["true"] if one["effect"] == effect]
        large, hard = ([o["found"] for o in true if o[size] > FINDABLE] for size in ("share", "unexplained"))
        rows[effect] = _row(false[effect], len(answered), large) | {"found, not by ordinary friction": _share(hard)}
    for fault in FAULTS:
        ones = [found["faults"][fault] for found in answered]
        wrong = sum(one["claimed"] and not one["true"] for one in ones)
        rows[fault] = _row(wrong, len(answered), [one["found"] for one in ones if one["true"]])
    rows["quasi-static"] = _row(sum(found["quasi_static"] for found in answered), len(answered), [])
    rows["other complaints"] = _row(sum(bool(found["complaints"]) for found in answered), len(answered), [])
    return rows


def _row(false: int, count: int, found: Sequence[bool]) -> dict[str, float]:
    return {"false": false / max(count, 1), "true": len(found), "found": _share(found)}


def _share(found: Sequence[bool]) -> float:
    return float(np.mean(found)) if found else float("nan")


def show_discoveries(records: Sequence[Record], console: Console) -> None:
    """False ones in experiments; true ones, by joint, that were found."""
    table = Table("kind", "false", "true", "found", "found where ordinary friction leaves it", title="discoveries")
    for kind, row in discoveries(records).items():
        hard = row.get("found, not by ordinary friction", float("nan"))
        table.add_row(kind, f"{row['false']:.1%}", str(row["true"]), f"{row['found']:.0%}", f"{hard:.0%}")
    console.print(table)


def coverage(records: Sequence[Record]) -> dict[str, dict[str, float]]:
    """Share of truths within 95 % intervals by group and kind, and experiments in the group."""
    right = [record for record in records if record.get("coverage")]
    contained = [record for record in right if record["contained"]]
    cells = {}
    for word, members in (("all friction", right), ("truth in the model class", contained)):
        designed = [record["motion"] == "designed" for record in members]
        for name, wanted in (("random", False), ("designed", True)):
            chosen = [record for record, is_so in zip(members, designed, strict=True) if is_so is wanted]
            cells[f"{word}, {name} motion"] = {"experiments": len(chosen)} | {
                kind: _covered([record["coverage"][kind] for record in chosen]) for kind in ("base", "mass", "torque")
            }
    return cells


def _covered(counts: Sequence[Sequence[float]]) -> float:
    inside, total = np.sum(counts, axis=0) if counts else (0.0, 0.0)
    return float(inside / total) if total else float("nan")


def show_coverage(records: Sequence[Record], console: Console) -> None:
    """Logs without faults only."""
    table = Table("", "experiments", "base parameters", "masses", "torques", title="95 % intervals that hold the truth")
    for word, row in coverage(records).items():
        table.add_row(word, str(row["experiments"]), *(f"{row[kind]:.1%}" for kind in ("base", "mass", "torque")))
    console.print(table)


def show_worst(records: Sequence[Record], console: Console) -> None:
    """The seeds that lose most against the told rival, and all failures."""
    table = Table("seed", "told", "untold", "error", "what", title="worst seeds, failures first")
    order = sorted(records, key=lambda r: ("error" in r, -r.get("error", 0.0) / r["told"]))
    failures = sum("failure" in record for record in records)
    for record in order[: max(WORST, failures)]:
        mine = ratios([record], "told")[0], ratios([record], "untold")[0], record.get("error", float("nan"))
        table.add_row(str(record["seed"]), *map(figure, mine), record.get("failure") or what(record))
    console.print(table)
    console.print(f"{failures} failures in {len(records)} experiments")


def what(record: Record) -> str:
    """One experiment in a line."""
    parts = [
        f"{record['joints']} joints",
        record["motion"] + (" with rests" if record["rests"] else ""),
        record["friction"],
        f"file {record['file']}",
        f"{record['duration']:.0f} s at {record['rate']:.0f} Hz",
        *record["sampling"],
        *(f"FAULT {fault}" for fault in record["faults"]),
    ]
    return ", ".join(parts)


def show_frictionless(records: Sequence[Record], console: Console) -> None:
    """By noise and number of joints."""
    table = Table("noise", "joints", *summary(records), title="no friction, 10 s at 100 Hz: over least squares told so")
    for noise in sorted({record["noise"] for record in records}):
        mine = [record for record in records if record["noise"] == noise]
        for word, members in [("all", mine), *by(mine, lambda r: [str(r["joints"])])]:
            table.add_row(f"{noise:.0%}", word, *map(figure, summary(members).values()))
    console.print(table)
    show_worst(records, console)
