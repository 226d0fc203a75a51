"""Noise of the measured motion, next to the sensors' resolution."""

from __future__ import annotations

import numpy as np

from casysid.identification import IdentificationResult
from casysid.report.tables import Table, number
from casysid.robot import JointKind


def noise_table(result: IdentificationResult) -> Table | None:
    """Standard deviation of each channel's noise, in degrees too for an angle; None where it is not known."""
    noise = result.input_noise
    if noise is None:
        return None
    rows = []
    for joint in result.robot.joints:
        angle = joint.kind in (JointKind.REVOLUTE, JointKind.CONTINUOUS)
        for channel in range(joint.channels.start, joint.channels.stop):
            std, step = float(noise.position[channel]), float(noise.resolution[channel])
            rows.append(
                (
                    result.robot.channels[channel],
                    number(std),
                    number(float(np.degrees(std))) if angle else "–",
                    number(step) if step else "–",
                    noise.source,
                )
            )
    return Table(("position", "noise [rad, m]", "[°]", "resolution", "from"), tuple(rows))
