"""What stops a robot that runs away, as the safety circuit of a real one does."""

from __future__ import annotations

import numpy as np

from casysid.arrays import Array
from casysid.robot import Robot
from casysid.simulation.truth import finite_limit

_OVERSPEED = 10.0  # times the velocity limit
_FASTEST = 1e3  # [rad/s, m/s] where there is no limit
_OVERTRAVEL = 0.25  # of the range, beyond its ends


class Watchdog:
    """Watches positions and speeds; keeps the reason of its alarm."""

    def __init__(self, robot: Robot) -> None:
        """Take the limits from the robot: ten times the velocity limit, a quarter of the range beyond its ends."""
        self._robot, self.reason = robot, ""
        self._fastest = np.minimum(_OVERSPEED * finite_limit(robot.velocity_limit, np.inf), _FASTEST)
        low, high = robot.position_lower, robot.position_upper
        bounded = np.isfinite(low) & np.isfinite(high)
        slack = _OVERTRAVEL * np.subtract(high, low, out=np.zeros_like(low), where=bounded)
        self._low = np.where(bounded, low - slack, -np.inf)
        self._high = np.where(bounded, high + slack, np.inf)

    def barks(self, channels: Array, rates: Array) -> bool:
        """Whether the robot must be stopped at positions (channels,) and rates (nv,)."""
        if (np.abs(rates) <= self._fastest).all() and ((channels >= self._low) & (channels <= self._high)).all():
            return False
        fast = ~(np.abs(rates) <= self._fastest)
        if fast.any():
            worst = int(np.argmax(fast))
            self.reason = f"'{self._robot.dofs[worst]}' moved at {rates[worst]:.3g} rad/s or m/s"
        else:
            worst = int(np.argmax((channels < self._low) | (channels > self._high)))
            self.reason = (
                f"'{self._robot.channels[worst]}' came to {channels[worst]:.3g} rad or m, far beyond its range"
            )
        return True
