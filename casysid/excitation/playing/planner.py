"""A path of joint positions between two places, clear of everything.

Source: Kuffner, LaValle, "RRT-Connect: an efficient approach to single-query path planning" (2000).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array
from casysid.excitation.constraints.constraint import Constraint
from casysid.excitation.design.verification import Margin, verify_motion
from casysid.excitation.motion.fourier import Motion
from casysid.excitation.motion.limits import JointLimits

STEP = 0.02
"""Constraints are looked at this often along a path, as a share of half the joints' ranges."""
TRIES = 500
"""Random places towards which a path is looked for before it is given up."""


def resting(positions: Array) -> Motion:
    """Standing still at joint positions (N, n)."""
    still = np.zeros_like(positions)
    return Motion(positions, still, still, still)


class _Tree:
    """Places that are reached from a root, shape (m, n) in units of half ranges."""

    def __init__(self, root: Array) -> None:
        self.places, self.parents = [root], [-1]

    def nearest(self, place: Array) -> int:
        return int(np.argmin(np.linalg.norm(np.array(self.places) - place, axis=1)))

    def branch(self, k: int) -> list[Array]:
        """From the root to the k-th place."""
        found: list[Array] = []
        while k >= 0:
            found.append(self.places[k])
            k = self.parents[k]
        return found[::-1]


class Planner:
    """Looks for a path; the same one every time."""

    def __init__(self, constraints: Sequence[Constraint], limits: JointLimits, here: Array, there: Array) -> None:
        """Between two joint positions, each (n,), within the limits or at most as far out as the ends are."""
        self._constraints, self._unit = constraints, limits.half_range
        self._ends = here / self._unit, there / self._unit
        self._lower = np.minimum(limits.lower, np.minimum(here, there)) / self._unit
        self._upper = np.maximum(limits.upper, np.maximum(here, there)) / self._unit

    def obstacle(self) -> Margin | None:
        """What is most in the way straight ahead."""
        line = self._line(*self._ends)
        found = verify_motion(
            self._constraints, np.linspace(0.0, 1.0, len(line)), resting(line * self._unit)
        ).violations
        return found[0] if found else None

    def plan(self) -> Array | None:
        """Places (m, n), [rad, m], to go by in straight lines; None if none are found."""
        if self._is_clear(*self._ends):
            return np.array(self._ends) * self._unit
        rng, trees = np.random.default_rng(0), (_Tree(self._ends[0]), _Tree(self._ends[1]))
        for turn in range(TRIES):
            one, other = trees if turn % 2 == 0 else trees[::-1]
            new, _ = self._grow(one, rng.uniform(self._lower, self._upper))
            met, arrived = self._grow(other, one.places[new])
            if arrived:
                there, back = (
                    (one.branch(new), other.branch(met)) if turn % 2 == 0 else (other.branch(met), one.branch(new))
                )
                return np.array(self._shortened([*there, *back[::-1][1:]])) * self._unit
        return None

    def _grow(self, tree: _Tree, place: Array) -> tuple[int, bool]:
        """From the nearest place towards another as far as is clear; where it ends, and whether it arrives."""
        k = tree.nearest(place)
        line = self._line(tree.places[k], place)
        clear = self._clear(line)
        steps = len(line) if clear.all() else int(np.argmin(clear))
        if steps > 1:
            tree.places.append(line[steps - 1])
            tree.parents.append(k)
            k = len(tree.places) - 1
        return k, steps == len(line)

    def _shortened(self, path: list[Array]) -> list[Array]:
        """Without places that can be left out."""
        kept, k = [path[0]], 0
        while k < len(path) - 1:
            k = next(j for j in range(len(path) - 1, k, -1) if j == k + 1 or self._is_clear(path[k], path[j]))
            kept.append(path[k])
        return kept

    def _line(self, a: Array, b: Array) -> Array:
        count = 2 + int(np.ceil(np.abs(b - a).max() / STEP))
        return a + np.linspace(0.0, 1.0, count)[:, None] * (b - a)

    def _is_clear(self, a: Array, b: Array) -> bool:
        return bool(self._clear(self._line(a, b)).all())

    def _clear(self, places: Array) -> npt.NDArray[np.bool_]:
        motion = resting(places * self._unit)
        slack = [one.slack(motion).min(axis=1, initial=np.inf) for one in self._constraints]
        return np.asarray(np.min([np.zeros(len(places)), *slack], axis=0) >= 0.0)
