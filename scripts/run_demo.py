"""Rehearse the identification of a bundled robot: a machine that differs from its file, known only to the simulator.

    python scripts/run_demo.py --out out/demo [--robot head] [--duration 15] [--seed 0]

Writes what ``casysid rehearse`` writes: rehearsal.json, result.json, the identified model, report.html and pictures.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from casysid.bundled import find_model
from casysid.cli.console import progress_bar, rich_table, speaking
from casysid.report import write_report
from casysid.report.rehearsal_pictures import write_rehearsal_pictures
from casysid.report.validation_tables import rehearsal_tables
from casysid.robot import Robot
from casysid.validation import RehearsalSettings, rehearse, write_rehearsal


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True, help="folder to write to")
    parser.add_argument("--robot", default="head", help="a bundled model or a file")
    parser.add_argument("--duration", type=float, default=15.0, help="of each recording [s]")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    settings = RehearsalSettings(duration=options.duration, seed=options.seed, rate=420.0)
    with speaking() as console:
        robot = Robot.from_file(find_model(options.robot))
        with progress_bar(console) as progress:
            rehearsal = rehearse(robot, settings, progress)
            progress("write", 0.0)
            write_rehearsal(rehearsal, options.out)
            write_report(rehearsal.result, options.out / "report.html")
            pictures = write_rehearsal_pictures(rehearsal, options.out)
        for title, table in rehearsal_tables(rehearsal):
            console.print(rich_table(title, table.header, table.rows))
            console.print()
        for path in (options.out / "rehearsal.json", options.out / "report.html", *pictures):
            print(path)


if __name__ == "__main__":
    main()
