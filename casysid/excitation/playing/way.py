"""From where the robot is to where its motion starts, and back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array, frozen
from casysid.errors import ParameterError
from casysid.excitation.constraints.constraint import Constraint
from casysid.excitation.constraints.joint import JointConstraint
from casysid.excitation.design.problem import ExcitationProblem
from casysid.excitation.design.verification import Margin, verify_motion
from casysid.excitation.motion.fourier import Motion
from casysid.excitation.playing.planner import STEP, Planner, resting

_PEAKS = (15.0 / 8.0, 10.0 / np.sqrt(3.0), 60.0)  # of s' s'' s''' for s = 10 x³ - 15 x⁴ + 6 x⁵ on [0, 1]
SPEED = 0.5
"""Share of the limits on velocity, acceleration and jerk that a way uses: nobody measures anything on it."""
LEAST = 1.0
"""Seconds that a piece of a way takes at least, as acceleration has a limit in few model files."""
SLOWER = (1.0, 0.5, 0.25)
"""Factors on the speed that are tried in turn where a way takes too much torque."""


@dataclass(frozen=True, eq=False)
class Way:
    """From place to place along straight lines of joint positions, at rest at each.

    Each piece is the motion of least jerk (Flash and Hogan, "The coordination of arm movements", 1985).

    Attributes:
        places: Joint positions (m, n), [rad, m].
        durations: Of the pieces between them, shape (m - 1,), [s].
    """

    places: Array
    durations: Array

    def __post_init__(self) -> None:
        for name in ("places", "durations"):
            object.__setattr__(self, name, frozen(getattr(self, name)))

    @property
    def duration(self) -> float:
        """Of all pieces [s]."""
        return float(self.durations.sum())

    def motion(self, time: npt.ArrayLike) -> Motion:
        """Positions and derivatives at times (N,), [s]; at rest before and after."""
        since = np.concatenate([[0.0], np.cumsum(self.durations)])
        t = np.clip(np.asarray(time, dtype=np.float64), 0.0, since[-1])
        piece = np.clip(np.searchsorted(since, t, side="right") - 1, 0, len(self.durations) - 1)
        T = self.durations[piece]
        x = (t - since[piece]) / T
        step = np.diff(self.places, axis=0)[piece]
        shares = (
            x**3 * (10.0 - 15.0 * x + 6.0 * x**2),
            30.0 * (x * (1.0 - x)) ** 2 / T,
            60.0 * x * (1.0 - x) * (1.0 - 2.0 * x) / T**2,
            60.0 * (1.0 - 6.0 * x + 6.0 * x**2) / T**3,
        )
        moved = [share[:, None] * step for share in shares]
        return Motion(self.places[piece] + moved[0], *moved[1:])

    def back(self) -> Way:
        """The same way in the other direction."""
        return Way(self.places[::-1], self.durations[::-1])


def find_way(problem: ExcitationProblem, present: npt.ArrayLike, start: Array, *, speed: float = 1.0) -> Way:
    """A way from where the robot is that keeps torque limits, distances and boxes as the problem has them.

    Straight, or from place to place. It may leave the margin to the position limits of the file.

    Args:
        problem: Whose limits are kept.
        present: Where the robot is, shape (n,), [rad, m].
        start: Where to go, shape (n,).
        speed: Factor on the speed, above 0 and at most 1.

    Raises:
        ParameterError: The robot cannot stand where it is said to be, or no way was found; the message says why.
    """
    here = _checked(problem, present)
    stays = verify_motion(_kept(problem), np.zeros(1), resting(here[None]))
    if stays.violations:
        what = str(stays.violations[0]).replace(" at 0 s", "", 1)
        raise ParameterError(
            f"excitation: the robot cannot be where it is said to be: {what}. "
            "Correct the present position, or move the robot to where it has room"
        )
    planner = Planner(_kept(problem), problem.limits, here, start)
    places = planner.plan()
    if places is None:
        raise ParameterError(
            "excitation: found no way from the present position to the start of the motion; straight ahead is in the "
            f"way: {planner.obstacle()}. Move the robot elsewhere first, or give the motion's start"
        )
    for slower in SLOWER:
        way = Way(places, _durations(problem, places, speed * slower))
        worst = _worst(problem, way)
        if worst is None:
            return way
    raise ParameterError(f"excitation: the way from the present position takes too much: {worst}. Move the robot there")


def _checked(problem: ExcitationProblem, present: npt.ArrayLike) -> Array:
    here, robot = np.asarray(present, dtype=np.float64), problem.robot
    if here.shape != problem.limits.lower.shape or not np.isfinite(here).all():
        raise ParameterError(
            f"excitation: the present position must be {len(problem.limits.lower)} finite numbers; got {present!r}"
        )
    for joint in robot.joints:
        k, channel = joint.v.start, joint.channels.start
        low, high = robot.position_lower[channel], robot.position_upper[channel]
        if not low <= here[k] <= high:
            raise ParameterError(
                f"excitation: present position of joint '{joint.name}' must be within its limits, {low:.6g} to "
                f"{high:.6g}; got {here[k]:.6g}"
            )
    return here


def _kept(problem: ExcitationProblem) -> list[Constraint]:
    """All but the limits of joints, which a way keeps by its making."""
    return [one for one in problem.constraints if not isinstance(one, JointConstraint)]


def _durations(problem: ExcitationProblem, places: Array, speed: float) -> Array:
    """So long that velocity, acceleration and jerk stay within their share of the limits, shape (m - 1,)."""
    steps, limits = np.abs(np.diff(places, axis=0)), problem.limits
    bounds = (limits.velocity, limits.acceleration, limits.jerk)
    needed = [
        (peak * steps / (SPEED * bound)).max(axis=1) ** (1.0 / order)
        for order, (peak, bound) in enumerate(zip(_PEAKS, bounds, strict=True), 1)
    ]
    return np.asarray(np.maximum(np.max(needed, axis=0), LEAST) / speed)


def _worst(problem: ExcitationProblem, way: Way) -> Margin | None:
    """The worst violation, if there is any."""
    steps = np.abs(np.diff(way.places, axis=0) / problem.limits.half_range).max(axis=1).sum()
    time = np.linspace(0.0, way.duration, 2 + int(np.ceil(steps / (STEP / 2.0))))
    violations = verify_motion(_kept(problem), time, way.motion(time)).violations
    return violations[0] if violations else None
