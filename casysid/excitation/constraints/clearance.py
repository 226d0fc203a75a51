"""Distances that must be kept: between links that are not neighbours, to the floor, to walls, to boxes."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import combinations
from typing import NamedTuple

import numpy as np

from casysid.arrays import Array
from casysid.excitation.constraints import distance
from casysid.excitation.constraints.capsules import Capsule
from casysid.excitation.constraints.kinematics import Frames, Indices, Points
from casysid.excitation.constraints.neighbours import FIT_FAULT, are_neighbours
from casysid.excitation.constraints.obstacles import Box, HalfSpace, Obstacle
from casysid.excitation.constraints.solid_distances import SolidDistances
from casysid.excitation.constraints.solids import Solid
from casysid.kinematics.frames import WORLD
from casysid.robot import Robot

_STILL = 1e-6  # [m] a distance that varies less does not vary


_ENDS = ("start", "end")


class Found(NamedTuple):
    """Distances, points and directions at N configurations, and the joints (len,) that the two points are fixed to."""

    near: distance.Closest
    first: Indices
    second: Indices


@dataclass(frozen=True, eq=False, kw_only=True)
class Clearance:
    """Pairs whose distance is looked at.

    Attributes:
        points: Of the robot.
        capsules: Around the links.
        obstacles: Around the robot.
        pairs: Of capsules, shape (m, 2).
        meetings: Of capsules with obstacles, shape (k, 2).
        allowance: How far each pair of capsules may overlap, as the links inside them are thinner, shape (m,), [m].
        ignored: What is not looked at, and why, in words.
    """

    points: Points
    capsules: tuple[Capsule, ...]
    obstacles: tuple[Obstacle, ...]
    pairs: Indices
    meetings: Indices
    allowance: Array
    ignored: tuple[str, ...] = ()
    labels: tuple[str, ...] = field(init=False)

    def __post_init__(self) -> None:
        names = [capsule.link for capsule in self.capsules]
        self_labels = [f"links '{names[i]}' and '{names[k]}'" for i, k in self.pairs]
        world = [f"link '{names[i]}' and '{self.obstacles[k].name}'" for i, k in self.ordered_meetings]
        object.__setattr__(self, "labels", (*self_labels, *world))

    @property
    def ordered_meetings(self) -> list[tuple[int, int]]:
        """The meeting of each distance: half spaces first, once for each end of the capsule, then boxes."""
        flat = [(int(i), int(k)) for i, k in self.meetings if isinstance(self.obstacles[k], HalfSpace)]
        boxes = [(int(i), int(k)) for i, k in self.meetings if isinstance(self.obstacles[k], Box)]
        return [*flat, *flat, *boxes]

    def __len__(self) -> int:
        return len(self.labels)

    def closest(self, frames: Frames) -> Found:
        """Distances at N configurations, less what capsules are thick, and where they are reached."""
        joint, radius, *ends = self._shapes
        start, end = (self.points.places(frames, joint, local) for local in ends)
        i, k = self.pairs.T
        found = [distance.between_segments(start[..., i], end[..., i], start[..., k], end[..., k])]
        sizes, firsts, seconds = [radius[i] + radius[k] - self.allowance], [joint[i]], [joint[k]]
        for near, capsule in self._to_obstacles(start, end):
            found.append(near)
            sizes.append(radius[capsule])
            firsts.append(joint[capsule])
            seconds.append(np.full(len(capsule), WORLD, dtype=np.intp))
        merged = distance.Closest(*(np.concatenate(parts, axis=-1) for parts in zip(*found, strict=True)))
        merged = merged._replace(distance=merged.distance - np.concatenate(sizes))
        return Found(merged, np.concatenate(firsts), np.concatenate(seconds))

    @cached_property
    def _shapes(self) -> tuple[Indices, Array, Array, Array]:
        """Of the capsules: joint, radius, both ends."""
        starts, ends = (np.array([getattr(one, name) for one in self.capsules]).reshape(-1, 3) for name in _ENDS)
        joint = np.array([one.joint for one in self.capsules], dtype=np.intp)
        return joint, np.array([one.radius for one in self.capsules]), starts, ends

    def _to_obstacles(self, start: Array, end: Array) -> list[tuple[distance.Closest, Indices]]:
        flat = [(i, self.obstacles[k]) for i, k in self.meetings if isinstance(self.obstacles[k], HalfSpace)]
        boxes = [(i, self.obstacles[k]) for i, k in self.meetings if isinstance(self.obstacles[k], Box)]
        found: list[tuple[distance.Closest, Indices]] = []
        if flat:
            chosen = np.array([i for i, _ in flat], dtype=np.intp)
            normal = np.array([one.normal for _, one in flat if isinstance(one, HalfSpace)]).T
            offset = np.array([one.offset for _, one in flat if isinstance(one, HalfSpace)])
            found += [(distance.to_planes(side[..., chosen], normal, offset), chosen) for side in (start, end)]
        if boxes:
            chosen = np.array([i for i, _ in boxes], dtype=np.intp)
            lower, upper = (np.array([getattr(one, side) for _, one in boxes]).T for side in ("lower", "upper"))
            found.append((distance.to_boxes(start[..., chosen], end[..., chosen], lower, upper), chosen))
        return found

    def distances(self, position: Array) -> Array:
        """At joint positions (N, n), shape (N, len), [m]; negative where capsules overlap."""
        if not len(self):
            return np.empty((len(position), 0))
        return self.closest(self.points.frames(position)).near.distance

    def near(self, samples: Array, margin: float) -> Clearance:
        """The same without the pairs of links that stay far apart in all of some configurations (N, n).

        Far is a quarter of their mean distance beyond the margin.
        """
        between = self.distances(samples)[:, : len(self.pairs)]
        kept = between.min(axis=0, initial=np.inf) < margin + 0.25 * between.mean(axis=0)
        return dataclasses.replace(self, pairs=self.pairs[kept], allowance=self.allowance[kept])

    def pull_back(self, frames: Frames, found: Found, weights: Array) -> Array:
        """Derivative of the distances' sum with weights (N, len) along the joints, shape (N, n)."""
        near, force = found.near, weights * found.near.direction
        pulled = self.points.pull_back
        return pulled(frames, found.first, near.first, force) - pulled(frames, found.second, near.second, force)


def build_clearance(
    robot: Robot,
    capsules: Sequence[Capsule],
    obstacles: Sequence[Obstacle],
    samples: Array,
    margin: float,
    solids: Sequence[Solid] = (),
) -> Clearance:
    """All distances that can be kept.

    Left out are neighbours in the tree, links that overlap as capsules nearly everywhere, and links whose distance to
    an obstacle never changes, such as a base to the floor it stands on. Capsules of links with known shapes may overlap
    as far as they do where none of the samples has the shapes themselves nearer than the margin.

    Args:
        robot: Its joints have one degree of freedom each.
        capsules: Around its links.
        obstacles: Around it.
        samples: Configurations to judge by, joint positions (N, n).
        margin: Distance to keep [m].
        solids: Shapes inside the first capsules, one each.
    """
    pairs = [
        (i, k)
        for (i, one), (k, other) in combinations(enumerate(capsules), 2)
        if not are_neighbours(robot, one.joint, other.joint)
    ]
    everything = Clearance(
        points=Points(robot),
        capsules=tuple(capsules),
        obstacles=tuple(obstacles),
        pairs=np.array(pairs, dtype=np.intp).reshape(-1, 2),
        meetings=np.array(list(np.ndindex(len(capsules), len(obstacles))), dtype=np.intp).reshape(-1, 2),
        allowance=np.zeros(len(pairs)),
    )
    distances = everything.distances(samples)
    between = distances[:, : len(pairs)]
    allowance = _allowances(everything, between, samples, margin, solids)
    share = (between + allowance < margin).mean(axis=0)
    still = _spread_by_meeting(everything, np.ptp(distances, axis=0)) < _STILL
    ignored = [
        f"{everything.labels[k]} overlap as capsules in {share[k]:.0%} of all configurations, so this is not looked at"
        for k in np.flatnonzero(share > FIT_FAULT)
    ]
    ignored += [
        f"a part of link '{capsules[i].link}' stays where it is to '{obstacles[k].name}', which is not looked at"
        for i, k in everything.meetings[still]
    ]
    kept = (share <= FIT_FAULT) & np.isfinite(allowance)
    return dataclasses.replace(
        everything,
        pairs=everything.pairs[kept],
        allowance=allowance[kept],
        meetings=everything.meetings[~still],
        ignored=tuple(dict.fromkeys(ignored)),
    )


def _allowances(clearance: Clearance, between: Array, samples: Array, margin: float, solids: Sequence[Solid]) -> Array:
    """How far capsules that overlap nearly everywhere may do so, shape (pairs,); inf where the shapes never meet."""
    allowance = np.zeros(len(clearance.pairs))
    fat = ((between < margin).mean(axis=0) > FIT_FAULT) & (clearance.pairs < len(solids)).all(axis=1)
    if fat.any():
        chosen = tuple((int(i), int(k)) for i, k in clearance.pairs[fat])
        robot = clearance.points.robot
        near = SolidDistances(robot, tuple(solids), (), chosen).distances(samples) < margin
        allowance[fat] = margin - np.where(near, between[:, fat], -np.inf).max(axis=0, initial=-np.inf)
    return allowance


def _spread_by_meeting(clearance: Clearance, spread: Array) -> Array:
    """How much each meeting's distance varies, shape (meetings,), from that of all distances."""
    of_meeting: dict[tuple[int, int], float] = {}
    for key, value in zip(clearance.ordered_meetings, spread[len(clearance.pairs) :], strict=True):
        of_meeting[key] = max(of_meeting.get(key, 0.0), float(value))
    return np.array([of_meeting[int(i), int(k)] for i, k in clearance.meetings])
