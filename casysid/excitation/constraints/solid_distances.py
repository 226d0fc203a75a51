"""Distances between the shapes of the model file themselves, by coal: for the last check, and to judge capsules by."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from casysid.arrays import Array
from casysid.excitation.constraints.neighbours import FIT_FAULT, are_neighbours
from casysid.excitation.constraints.obstacles import Box, HalfSpace, Obstacle
from casysid.excitation.constraints.solids import Solid
from casysid.kinematics.frames import WORLD
from casysid.robot import Robot
from casysid.robot.coordinates import configuration_from_channels


@dataclass(frozen=True, eq=False)
class SolidDistances:
    """Pairs of shapes, and shapes and obstacles.

    Attributes:
        robot: Whose links they are.
        solids: Its shapes.
        obstacles: Around it.
        pairs: Indices of shapes.
        meetings: Indices of a shape and an obstacle.
    """

    robot: Robot
    solids: tuple[Solid, ...]
    obstacles: tuple[Obstacle, ...]
    pairs: tuple[tuple[int, int], ...]
    meetings: tuple[tuple[int, int], ...] = ()

    @property
    def labels(self) -> tuple[str, ...]:
        """Who with whom, for messages."""
        names = [solid.link for solid in self.solids]
        own = [f"links '{names[i]}' and '{names[k]}'" for i, k in self.pairs]
        return (*own, *(f"link '{names[i]}' and '{self.obstacles[k].name}'" for i, k in self.meetings))

    def distances(self, position: Array) -> Array:
        """At joint positions (N, n), shape (N, pairs and meetings), [m]; negative where shapes overlap."""
        model, data = self._model
        kinematic, found = self.robot.model.createData(), np.empty((len(position), len(model.collisionPairs)))
        for row, q in zip(found, configuration_from_channels(self.robot, position), strict=True):
            pin.computeDistances(self.robot.model, kinematic, model, data, q)
            row[:] = [one.min_distance for one in data.distanceResults]
        return found

    @cached_property
    def _model(self) -> tuple[Any, Any]:
        model = pin.GeometryModel()
        for k, solid in enumerate(self.solids):
            model.addGeometryObject(
                pin.GeometryObject(f"{k}", solid.joint + 1, 0, solid.pose, solid.shape)  # joint 0 is the world
            )
        for k, obstacle in enumerate(self.obstacles):
            model.addGeometryObject(pin.GeometryObject(f"obstacle {k}", 0, 0, *_placed(obstacle)))
        for i, k in self.pairs:
            model.addCollisionPair(pin.CollisionPair(i, k))
        for i, k in self.meetings:
            model.addCollisionPair(pin.CollisionPair(i, len(self.solids) + k))
        return model, model.createData()


def _placed(obstacle: Obstacle) -> tuple[Any, Any]:
    """Pose and shape of what may not be touched."""
    if isinstance(obstacle, HalfSpace):
        return pin.SE3.Identity(), coal.Halfspace(np.array(obstacle.normal), obstacle.offset)
    assert isinstance(obstacle, Box)
    size = obstacle.upper - obstacle.lower
    return pin.SE3(np.eye(3), (obstacle.lower + obstacle.upper) / 2.0), coal.Box(*map(float, size))


def build_solid_distances(
    robot: Robot, solids: tuple[Solid, ...], obstacles: tuple[Obstacle, ...], samples: Array
) -> SolidDistances:
    """All pairs but neighbours in the tree, and but those that overlap in most samples, joint positions (N, n)."""
    pairs = [
        (i, k)
        for (i, one), (k, other) in combinations(enumerate(solids), 2)
        if not are_neighbours(robot, one.joint, other.joint)
    ]
    meetings = [(i, k) for i, one in enumerate(solids) for k in range(len(obstacles)) if one.joint != WORLD]
    everything = SolidDistances(robot, solids, obstacles, tuple(pairs), tuple(meetings))
    kept = (everything.distances(samples) < 0.0).mean(axis=0) <= FIT_FAULT
    return SolidDistances(
        robot,
        solids,
        obstacles,
        tuple(pair for pair, keep in zip(pairs, kept[: len(pairs)], strict=True) if keep),
        tuple(pair for pair, keep in zip(meetings, kept[len(pairs) :], strict=True) if keep),
    )
