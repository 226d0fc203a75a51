"""What had to be changed in the log, and what in it contradicts the file: nothing large, in what is accepted."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from casysid.identification.mistakes import SCALES, Mistake
from casysid.identification.result import IdentificationResult
from casysid.identification.verdict.criteria import Criterion, Word
from casysid.robot import Robot

LARGE = 0.3
"""Share of the torque that a correction may change."""
HEAVIEST_LINK = 100.0
"""Of a robot, in its median link's masses: grams and millimetres make a thousand."""
CHANGES = "a correction of the log that changes more of the torque is a hypothesis, and is to be checked at the robot"


def correction_criteria(result: IdentificationResult) -> Iterator[Criterion]:
    """Gains, clock, delay, missing inertia, and what was named and not corrected."""
    gains = np.abs(np.log(result.torque_gains.values)) if result.torque_gains.found else np.zeros(1)
    yield Criterion(
        name="gains",
        value=float(np.expm1(gains.max())),
        limit=LARGE,
        word=Word.DOUBTFUL,
        reason="Torques had to be scaled joint by joint by up to "
        f"{np.exp(gains.max()):.2f}. Check torque constants, gears and units of the columns.",
        origin=CHANGES,
    )
    yield Criterion(
        name="clock",
        value=float(np.expm1(abs(np.log(result.time_base.scale)))),
        limit=LARGE,
        word=Word.DOUBTFUL,
        reason=f"The time stamps had to be multiplied by {result.time_base.scale:.3g}. Check the log's clock and rate.",
        origin=CHANGES,
    )
    late = float(np.abs(result.torque_delay).max())
    turn = 2.0 * np.sin(min(np.pi * result.cutoff.motion_band * late, np.pi / 2.0))
    yield Criterion(
        name="delay",
        value=float(turn),
        limit=LARGE,
        word=Word.DOUBTFUL,
        reason=f"Torques were {1e3 * late:.0f} ms late, much of the motion's period. Check how they are logged.",
        origin=CHANGES,
    )
    yield Criterion(
        name="inertia in the torque",
        value=float(result.time_base.quasi_static),
        limit=0.0,
        word=Word.DOUBTFUL,
        reason="These torques hold nothing inertial: usable for gravity and friction in slow motion.",
        origin="a computed torque is made of inertia",
    )
    told = [one for one in result.mistakes if one.kind not in SCALES or is_witness(result.robot)]
    for mistake in told:
        yield _named(mistake)
    if not told:
        yield _nothing_named()


def _named(mistake: Mistake) -> Criterion:
    """A mistake of the log or the base that was found: a torque's sign is taken so, all else is still in the log."""
    unit, corrected = mistake.kind in SCALES, bool(mistake.negated_torques)
    words = mistake.words.rstrip("?")
    remedy = f": try {mistake.option}" if mistake.option else ""
    if corrected:
        remedy = f" and was taken so: check it, and say {mistake.option} if it is"
    return Criterion(
        name=mistake.kind.name.lower().replace("_", " "),
        joint=mistake.joints[0] if len(mistake.joints) == 1 else "",
        value=mistake.gain,
        limit=0.0,
        word=Word.DOUBTFUL if unit or corrected else Word.REJECTED,
        reason=f"{words[:1].upper()}{words[1:]}{'?' if unit else ''}{remedy}{'' if unit else '.'}",
        origin="the model file's own prediction, read so, explains the log far better",
    )


def is_witness(robot: Robot) -> bool:
    """Whether a model file's masses may say in what unit torque is: no placeholders, no link in another unit."""
    bodies = robot.inertial_parameters.reshape(-1, 10)
    alike = len(bodies) > 1 and bool(np.allclose(bodies, bodies[0], rtol=1e-6, atol=0.0))
    heavy = float(bodies[:, 0].max()) > HEAVIEST_LINK * max(float(np.median(bodies[:, 0])), 0.0)
    return not alike and not heavy


def _nothing_named() -> Criterion:
    return Criterion(
        name="mistakes",
        value=0.0,
        limit=0.0,
        word=Word.REJECTED,
        reason="",
        origin="the model file's own prediction explains no other reading of the log far better",
    )
