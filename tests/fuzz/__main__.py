"""Fuzz for long: ``python -m tests.fuzz --seconds 3600``; what fails is kept in ``tests/fuzz/seeds``."""

import argparse
import sys
from pathlib import Path

from tests.fuzz.harness import Tally, Target, fuzz, name_of
from tests.fuzz.targets import targets

SEEDS = Path(__file__).parent / "seeds"


def main() -> int:
    """The number of failures, at most 1, as an exit code."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("--seconds", type=float, default=None, help="of all targets together")
    parser.add_argument("--count", type=int, default=None, help="mutants of each target")
    parser.add_argument("--seed", type=int, default=0, help="of the random numbers; another one, other mutants")
    parser.add_argument("targets", nargs="*", metavar="TARGET", help=f"some of {', '.join(targets())}; default: all")
    wanted = parser.parse_args()
    chosen = [targets()[name] for name in wanted.targets or targets()]
    share = None if wanted.seconds is None else wanted.seconds / len(chosen)
    failed = 0
    for target in chosen:
        tally = fuzz(target, seed=wanted.seed, seconds=share, count=wanted.count)
        failed += len(tally.failures)
        _tell(target, tally)
    return min(failed, 1)


def _tell(target: Target, tally: Tally) -> None:
    figures = ", ".join(f"{kind} {count}" for kind, count in sorted(tally.outcomes.items()))
    print(f"{target.name}: {tally.outcomes.total()} mutants, {figures}; slowest {tally.slowest:.2f} s", flush=True)
    last_lines = set()
    for content, reason in tally.failures:
        brief = reason.strip().splitlines()[-1]
        place = next((line for line in reversed(reason.splitlines()) if line.startswith("  File")), "")
        if (brief[:60], place) in last_lines:
            continue
        last_lines.add((brief[:60], place))
        folder = SEEDS / target.name
        folder.mkdir(parents=True, exist_ok=True)
        (folder / name_of(content, target)).write_bytes(content)
        print(f"  {name_of(content, target)}: {reason.strip()}", flush=True)


if __name__ == "__main__":
    sys.exit(main())
