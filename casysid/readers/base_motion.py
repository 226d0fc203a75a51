"""What the motion of a free base says of its own columns: order of the quaternion, axes of the logged twist."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from casysid.arrays import Array
from casysid.errors import RecordingError
from casysid.readers.messages import listing
from casysid.recording.recording import Recording
from casysid.robot import JointKind, Robot

CLEARLY = 0.25
"""One reading of the columns is believed against another if it leaves less than this share of the other's squared
error: with axes or order mixed up the error is as large as the motion, and noise, which both readings leave, only
brings the shares nearer to one."""
UPRIGHT = 0.5
"""Height of the body's z axis above which a base is upright, and below minus which it is upside down."""


@dataclass
class BaseMotion:
    """Sums over the samples of a log.

    Attributes:
        robot: Whose base is free.
        label: What to call the log in a message.
        flips: Samples whose quaternion has another sign than the one before.
    """

    robot: Robot
    label: str
    flips: int = 0
    _errors: dict[str, float] = field(default_factory=dict)
    _height: dict[str, float] = field(default_factory=lambda: {"last": 0.0, "first": 0.0})
    _samples: int = 0

    def add(self, rows: Recording) -> None:
        """Samples that follow those added before; steps from one batch to the next are left out."""
        joint = self.robot.joints[0]
        position = rows.position[:, joint.channels]
        if joint.kind is not JointKind.FREE_FLYER or len(rows) < 2 or not np.isfinite(position).all():
            return
        place, quaternion = position[:, :3], position[:, 3:]
        self._samples += len(rows)
        for word, q in (("last", quaternion), ("first", quaternion[:, [1, 2, 3, 0]])):
            self._height[word] += float(np.sum(q[:, 3] ** 2 + q[:, 2] ** 2 - q[:, 0] ** 2 - q[:, 1] ** 2))
        if rows.time is None or rows.velocity is None or not np.isfinite(rows.velocity).all():
            return
        step = np.diff(rows.time)[:, None]
        if (step <= 0.0).any():
            return
        twist = 0.5 * (rows.velocity[1:, joint.v] + rows.velocity[:-1, joint.v])
        middle = quaternion[1:] + quaternion[:-1]
        speed, turning = np.diff(place, axis=0) / step, np.diff(quaternion, axis=0) / step
        self._compare("linear", twist[:, :3], {"body": _turned(middle, speed, inverse=True), "world": speed})
        body = _rate(middle, turning)
        self._compare("angular", twist[:, 3:], {"body": body, "world": _turned(middle, body)})
        other = [1, 2, 3, 0]
        body = _rate(middle[:, other], turning[:, other])
        self._compare("w first", twist[:, 3:], {"body": body, "world": _turned(middle[:, other], body)})

    def _compare(self, part: str, logged: Array, readings: dict[str, Array]) -> None:
        for axes, values in readings.items():
            name = f"{part} {axes}"
            self._errors[name] = self._errors.get(name, 0.0) + float(np.sum((logged - values) ** 2))

    def check_order(self) -> str:
        """What to say of the quaternion's order; empty if nothing.

        Raises:
            RecordingError: The logged angular velocity is that of the quaternion read with w first.
        """
        columns = listing(self.robot.channels[self.robot.joints[0].channels][-4:])
        if self._errors:
            own, other = (min(self._errors[f"{part} {axes}"] for axes in ("body", "world")) for part in _ORDERS)
            if other < CLEARLY * own:
                raise RecordingError(
                    f"{self.label}: the base's angular velocity is that of its quaternion read with w first; wanted "
                    f"{columns}, w last. Name the columns so, or put w behind x, y, z"
                )
            return ""
        last, first = (self._height[word] / max(self._samples, 1) for word in ("last", "first"))
        if last < -UPRIGHT and first > UPRIGHT:
            return (
                f"the base is upside down all the time, and would be upright if its quaternion ({columns}) were w, x, "
                "y, z; w comes last"
            )
        return ""

    def twist_in_world(self) -> tuple[str, ...]:
        """Parts of the logged twist that are along the world's axes, not the body's."""
        return tuple(
            part
            for part in ("linear", "angular")
            if self._errors and self._errors[f"{part} world"] < CLEARLY * self._errors[f"{part} body"]
        )


_ORDERS = ("angular", "w first")


def _rate(p: Array, p1: Array) -> Array:
    """Body angular velocity ``2 vec(p* ṗ) / |p|²`` of quaternions (x, y, z, w) twice a unit long, shape (N, 3)."""
    u, n = p[:, :3], p1[:, :3]
    vector = p[:, 3:] * n - p1[:, 3:] * u - np.cross(u, n)
    return np.asarray(4.0 * vector / np.sum(p * p, axis=1, keepdims=True))


def _turned(p: Array, x: Array, *, inverse: bool = False) -> Array:
    """``R x``, or ``Rᵀ x``, for quaternions of any length, shape (N, 3)."""
    unit = p / np.linalg.norm(p, axis=1, keepdims=True)
    u = -unit[:, :3] if inverse else unit[:, :3]
    t = 2.0 * np.cross(u, x)
    return np.asarray(x + unit[:, 3:] * t + np.cross(u, t))
