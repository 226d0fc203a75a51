"""Distances that must be kept: between links that are not neighbours, to the floor, to walls, to boxes."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import combinations

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array, frozen
from casysid.errors import ParameterError
from casysid.excitation import distance
from casysid.excitation.capsules import Capsule
from casysid.excitation.kinematics import WORLD, Frames, Kinematics
from casysid.robot import Robot

FIT_FAULT = 0.5
"""Capsules that overlap in more than this share of all configurations do so because they are thicker than the links."""
_STILL = 1e-6  # [m] a distance that varies less does not vary
_NEAR = 1e-4  # [m] below this, two joint frames count as one place


@dataclass(frozen=True, eq=False)
class HalfSpace:
    """Where the robot may be: ``normal · x >= offset``; a floor has the normal (0, 0, 1).

    Attributes:
        name: For messages.
        normal: Points to where the robot may be, shape (3,).
        offset: [m].
    """

    name: str
    normal: Array
    offset: float

    def __post_init__(self) -> None:
        normal = np.asarray(self.normal, dtype=np.float64)
        length = float(np.linalg.norm(normal)) if normal.shape == (3,) else 0.0
        if not (0.0 < length < np.inf and np.isfinite(self.offset)):
            raise ParameterError(f"half space '{self.name}': wanted a normal of three numbers and a finite offset")
        object.__setattr__(self, "normal", frozen(normal / length))
        object.__setattr__(self, "offset", float(self.offset) / length)


@dataclass(frozen=True, eq=False)
class Box:
    """An obstacle along the world's axes.

    Attributes:
        name: For messages.
        lower: Its least corner, shape (3,), [m].
        upper: Its greatest corner.
    """

    name: str
    lower: Array
    upper: Array

    def __post_init__(self) -> None:
        for name in ("lower", "upper"):
            object.__setattr__(self, name, frozen(getattr(self, name)))
        if self.lower.shape != (3,) or self.upper.shape != (3,) or not (self.lower < self.upper).all():
            raise ParameterError(
                f"box '{self.name}': wanted two corners of three numbers, lower before upper; "
                f"got {self.lower} and {self.upper}"
            )


Obstacle = HalfSpace | Box
Indices = npt.NDArray[np.intp]


@dataclass(frozen=True, eq=False, kw_only=True)
class Clearance:
    """Pairs whose distance is looked at.

    Attributes:
        kinematics: Of the robot.
        capsules: Around the links.
        obstacles: Around the robot.
        pairs: Of capsules, shape (m, 2).
        meetings: Of capsules with obstacles, shape (k, 2).
        ignored: What is not looked at, and why, in words.
    """

    kinematics: Kinematics
    capsules: tuple[Capsule, ...]
    obstacles: tuple[Obstacle, ...]
    pairs: Indices
    meetings: Indices
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

    def closest(self, frames: Frames) -> tuple[distance.Closest, Indices, Indices]:
        """Distances (N, len), with points and directions, and the joints (len,) that the two points are fixed to."""
        joint = np.array([capsule.joint for capsule in self.capsules], dtype=np.intp)
        ends = [
            self.kinematics.points(frames, joint, np.array([getattr(c, end) for c in self.capsules]))
            for end in ("start", "end")
        ]
        radius = np.array([capsule.radius for capsule in self.capsules])
        i, k = self.pairs.reshape(-1, 2).T
        found = [distance.between_segments(ends[0][:, i], ends[1][:, i], ends[0][:, k], ends[1][:, k])]
        sizes, firsts, seconds = [radius[i] + radius[k]], [joint[i]], [joint[k]]
        for near, capsule in self._to_obstacles(ends):
            found.append(near)
            sizes.append(radius[capsule])
            firsts.append(joint[capsule])
            seconds.append(np.full(len(capsule), WORLD, dtype=np.intp))
        merged = distance.Closest(*(np.concatenate(parts, axis=1) for parts in zip(*found, strict=True)))
        merged = merged._replace(distance=merged.distance - np.concatenate(sizes))
        return merged, np.concatenate(firsts), np.concatenate(seconds)

    def _to_obstacles(self, ends: list[Array]) -> list[tuple[distance.Closest, Indices]]:
        flat = [(i, self.obstacles[k]) for i, k in self.meetings if isinstance(self.obstacles[k], HalfSpace)]
        boxes = [(i, self.obstacles[k]) for i, k in self.meetings if isinstance(self.obstacles[k], Box)]
        found: list[tuple[distance.Closest, Indices]] = []
        if flat:
            chosen = np.array([i for i, _ in flat], dtype=np.intp)
            normal = np.array([one.normal for _, one in flat if isinstance(one, HalfSpace)])
            offset = np.array([one.offset for _, one in flat if isinstance(one, HalfSpace)])
            found += [(distance.to_planes(end[:, chosen], normal, offset), chosen) for end in ends]
        if boxes:
            chosen = np.array([i for i, _ in boxes], dtype=np.intp)
            lower, upper = (np.array([getattr(one, side) for _, one in boxes]) for side in ("lower", "upper"))
            found.append((distance.to_boxes(ends[0][:, chosen], ends[1][:, chosen], lower, upper), chosen))
        return found

    def distances(self, position: Array) -> Array:
        """At joint positions (N, n), shape (N, len), [m]; negative where capsules overlap."""
        if not len(self):
            return np.empty((len(position), 0))
        return self.closest(self.kinematics.frames(position))[0].distance

    def near(self, samples: Array, margin: float) -> Clearance:
        """The same without the pairs of links that stay far apart in all of some configurations (N, n).

        Far is a quarter of their mean distance beyond the margin.
        """
        between = self.distances(samples)[:, : len(self.pairs)]
        kept = between.min(axis=0, initial=np.inf) < margin + 0.25 * between.mean(axis=0)
        return dataclasses.replace(self, pairs=self.pairs[kept])

    def slopes(self, position: Array) -> tuple[Array, Array]:
        """Distances (N, len) and their derivatives along the joints (N, len, n)."""
        frames = self.kinematics.frames(position)
        near, first, second = self.closest(frames)
        towards = self.kinematics.slopes
        return near.distance, towards(frames, first, near.first, near.direction) - towards(
            frames, second, near.second, near.direction
        )


def build_clearance(
    robot: Robot, capsules: Sequence[Capsule], obstacles: Sequence[Obstacle], samples: Array, margin: float
) -> Clearance:
    """All distances that can be kept.

    Left out are neighbours in the tree, links that overlap as capsules nearly everywhere, and links whose distance to
    an obstacle never changes, such as a base to the floor it stands on.

    Args:
        robot: Its joints have one degree of freedom each.
        capsules: Around its links.
        obstacles: Around it.
        samples: Configurations to judge by, joint positions (N, n).
        margin: Distance to keep [m].
    """
    pairs = [
        (i, k)
        for (i, one), (k, other) in combinations(enumerate(capsules), 2)
        if not _are_neighbours(robot, one.joint, other.joint)
    ]
    everything = Clearance(
        kinematics=Kinematics(robot),
        capsules=tuple(capsules),
        obstacles=tuple(obstacles),
        pairs=np.array(pairs, dtype=np.intp).reshape(-1, 2),
        meetings=np.array(list(np.ndindex(len(capsules), len(obstacles))), dtype=np.intp).reshape(-1, 2),
    )
    distances = everything.distances(samples)
    share = (distances[:, : len(pairs)] < margin).mean(axis=0)
    still = _spread_by_meeting(everything, np.ptp(distances, axis=0)) < _STILL
    ignored = [
        f"{everything.labels[k]} overlap as capsules in {share[k]:.0%} of all configurations, so this is not looked at"
        for k in np.flatnonzero(share > FIT_FAULT)
    ]
    ignored += [
        f"a part of link '{capsules[i].link}' stays where it is to '{obstacles[k].name}', which is not looked at"
        for i, k in everything.meetings[still]
    ]
    return dataclasses.replace(
        everything,
        pairs=everything.pairs[share <= FIT_FAULT],
        meetings=everything.meetings[~still],
        ignored=tuple(dict.fromkeys(ignored)),
    )


def _spread_by_meeting(clearance: Clearance, spread: Array) -> Array:
    """How much each meeting's distance varies, shape (meetings,), from that of all distances."""
    of_meeting: dict[tuple[int, int], float] = {}
    for key, value in zip(clearance.ordered_meetings, spread[len(clearance.pairs) :], strict=True):
        of_meeting[key] = max(of_meeting.get(key, 0.0), float(value))
    return np.array([of_meeting[int(i), int(k)] for i, k in clearance.meetings])


def _are_neighbours(robot: Robot, one: int, other: int) -> bool:
    """Whether two links are the same, or joined by a joint, or by several joints in one place."""
    if one == other:
        return True
    return (
        _attached_to(robot, one) == other
        or _attached_to(robot, other) == one
        or (one != WORLD and other != WORLD and _touch(robot, one, other))
    )


def _touch(robot: Robot, one: int, other: int) -> bool:
    """Whether the later link hangs at the earlier one by joints whose frames coincide."""
    low, high = sorted((one, other))
    at = high
    while at != WORLD and at > low:
        joint = robot.joints[at]
        if joint.parent == low:
            return True
        if float(np.linalg.norm(joint.placement.translation)) > _NEAR:
            return False
        at = joint.parent
    return False


def _attached_to(robot: Robot, joint: int) -> int | None:
    return None if joint == WORLD else robot.joints[joint].parent
