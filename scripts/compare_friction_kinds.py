"""Which kinds of friction robots have: each kind at all joints beside the ordinary ones, on recordings left out.

usage: python scripts/compare_friction_kinds.py ROLES DATA [--sets A,B]

ROLES has a row a set, ``name | urdf | train logs | test logs or share of time fitted | band Hz | ...``, files in the
folder of that name in DATA. Motion and equations are cut at the band for every model alike; Coulomb friction turns
within 0.02 of the root mean square velocity. Shown is the held-out torque error with a kind over that without it, its
geometric mean over the sets, and the worst.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from casysid import Robot, read_recording
from casysid.accumulation import accumulate_moments
from casysid.dynamics import (
    DEFAULT_FRICTION,
    AsymmetricViscous,
    Counterweight,
    FrictionKind,
    LoadedCoulomb,
    MaxwellSlip,
    PowerViscous,
    Regressor,
    Spring,
    Stribeck,
    build_regressor,
    with_width,
)
from casysid.dynamics.drive import continued_positions
from casysid.estimation import Ridge
from casysid.moments import Moments
from casysid.recording import Recording
from casysid.signals import BandAverage, Motion
from casysid.signals.motion import motion_from_recording

WIDTH = 0.02
SAMPLES_PER_PERIOD = 20


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("roles", type=Path)
    parser.add_argument("data", type=Path)
    parser.add_argument("--sets", default="", help="names with commas between them; all by default")
    arguments = parser.parse_args()
    table: dict[str, list[float]] = {}
    for name, robot, fitted, unseen, band in read_sets(arguments.roles, arguments.data, arguments.sets.split(",")):
        errors = compare(robot, fitted, unseen, band)
        ratios = {kind: error / errors["ordinary"] for kind, error in errors.items() if kind != "ordinary"}
        print(f"{name}: ordinary {errors['ordinary']:.4f}", *(f"{k} {r:.3f}" for k, r in ratios.items()), flush=True)
        for kind, ratio in ratios.items():
            table.setdefault(kind, []).append(ratio)
    for kind, several in table.items():
        print(f"{kind:28s} mean {np.exp(np.log(several).mean()):.3f}  worst {max(several):.3f}")


def read_sets(
    roles: Path, data: Path, wanted: Sequence[str]
) -> Iterator[tuple[str, Robot, list[Recording], list[Recording], float]]:
    """Name, robot, recordings to fit and to be judged by, and band [Hz] of every set."""
    for row in roles.read_text().splitlines():
        if not row.strip() or row.startswith("#"):
            continue
        name, urdf, train, test, band = (cell.strip() for cell in row.split("|")[:5])
        folder = data / name.split(":")[0]
        if (any(wanted) and name not in wanted) or not folder.is_dir():
            continue
        robot = Robot.from_file(folder / urdf)
        fitted = [read_recording(folder / f"{one}.csv.gz", robot) for one in train.split()]
        if test.startswith("0."):
            halves = [one.split(float(test)) for one in fitted]
            yield name, robot, [first for first, _ in halves], [second for _, second in halves], float(band)
        else:
            unseen = [read_recording(folder / f"{one}.csv.gz", robot) for one in test.split()]
            yield name, robot, fitted, unseen, float(band)


def compare(robot: Robot, fitted: Sequence[Recording], unseen: Sequence[Recording], band: float) -> dict[str, float]:
    """Relative held-out error of every model."""
    train, test = ([smooth(robot, one, band) for one in several] for several in (fitted, unseen))
    speed = np.sqrt(np.mean([np.mean(motion.v**2, axis=0) for motion in train], axis=0))
    travel = np.concatenate([continued_positions(robot, motion.q) for motion in train]).std(axis=0)
    by_name = dict(zip(robot.dofs, zip(speed.tolist(), travel.tolist(), strict=True), strict=True))
    width = tuple((WIDTH * speed + 1e-9).tolist())
    errors = {}
    for name, kinds in models(by_name).items():
        regressor = build_regressor(robot, with_width((*DEFAULT_FRICTION, *kinds), width))
        estimate = Ridge(standard_errors=False).estimate(sums(regressor, train, band), regressor.prior)
        held_out = sums(regressor, test, band)
        missed = held_out.residual_energy(estimate.parameters).sum()
        errors[name] = float(np.sqrt(missed / held_out.residual_energy(0.0 * estimate.parameters).sum()))
    return errors


def models(by_name: Mapping[str, tuple[float, float]]) -> dict[str, tuple[FrictionKind, ...]]:
    """What joins ordinary friction, from speed and travel of each joint by its name."""

    def slip(*shares: float) -> MaxwellSlip:
        return MaxwellSlip({name: tuple(s * far for s in shares) for name, (_, far) in by_name.items() if far > 0.0})

    def stribeck(share: float) -> Stribeck:
        return Stribeck(velocity={name: share * fast for name, (fast, _) in by_name.items() if fast > 0.0})

    return {
        "ordinary": (),
        "asymmetric": (AsymmetricViscous(),),
        "power 0.5": (PowerViscous(exponent=0.5),),
        "power 2": (PowerViscous(exponent=2.0),),
        "spring": (Spring(),),
        "counterweight": (Counterweight(),),
        "load": (LoadedCoulomb(),),
        **{f"Stribeck {share}": (stribeck(share),) for share in (0.1, 0.4)},
        **{f"slip {share}": (slip(share),) for share in (0.0003, 0.001, 0.003, 0.01, 0.03, 0.1)},
        "slip 0.01 and 0.003": (slip(0.01, 0.003),),
        "slip 0.01 to 0.3": (slip(0.01, 0.03, 0.1, 0.3),),
        **{f"load, slip {share}": (LoadedCoulomb(), slip(share)) for share in (0.001, 0.003, 0.01)},
        "load, slip 0.001, Stribeck 0.4": (LoadedCoulomb(), slip(0.001), stribeck(0.4)),
    }


def smooth(robot: Robot, recording: Recording, band: float) -> Motion:
    """The recording's motion up to twice the band, without ends, at no more samples than that needs."""
    motion = motion_from_recording(robot, recording, 2.0 * band).without_ends()
    return motion.decimated(int(recording.rate / (SAMPLES_PER_PERIOD * band)))


def sums(regressor: Regressor, motions: Sequence[Motion], band: float) -> Moments:
    """Moments of all motions up to the band."""
    parts = [
        accumulate_moments(regressor, one.q, one.v, one.a, one.tau, average=BandAverage(one.time, band))
        for one in motions
    ]
    total = parts[0]
    for part in parts[1:]:
        total = total + part
    return total


if __name__ == "__main__":
    main()
