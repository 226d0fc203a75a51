"""Torque brought to the time of the motion that it belongs to."""

from __future__ import annotations

import dataclasses

import numpy as np
import numpy.typing as npt
from scipy.interpolate import make_interp_spline

from casysid.arrays import Array
from casysid.errors import RecordingError
from casysid.recording import Recording

DEGREE = 3
ROUNDING = 1e-12
"""Delays nearer to each other than this [s] are the same."""


def aligned(recording: Recording, delays: Array) -> Recording:
    """The recording, told that its torques are ``delays`` late, shape (dofs,), [s].

    What all joints have in common is left to the spline of the positions, so the torques stay as logged; only by what
    they differ are they interpolated. Samples that this takes beyond the ends of a stretch are dropped. Samples without
    time are taken as they are.

    Raises:
        RecordingError: The recording is shorter than the delays differ.
    """
    if recording.time is None or not delays.any():
        return recording
    common = float(np.median(delays))
    own = np.where(np.abs(delays - common) > ROUNDING, delays - common, 0.0)
    total = recording.torque_delay + common
    if not own.any():
        return dataclasses.replace(recording, torque_delay=total)
    kept, torque = [], recording.torque.copy()
    for piece in recording.segments:
        time = recording.time[piece]
        inside = (time + own.min() >= time[0]) & (time + own.max() <= time[-1])
        if len(time) > DEGREE:
            kept.append(np.arange(piece.start, piece.stop)[inside])
        for joint in np.flatnonzero(own) if len(time) > DEGREE else ():
            spline = make_interp_spline(time, recording.torque[piece, joint], k=DEGREE)
            torque[kept[-1], joint] = spline(time[inside] + own[joint])
    rows = np.concatenate(kept) if kept else np.empty(0, dtype=np.intp)
    if not len(rows):
        raise RecordingError(
            f"{recording.label}: its {recording.duration:.3g} s are shorter than the torques' delays differ, "
            f"{1e3 * np.ptp(delays):.3g} ms"
        )
    return dataclasses.replace(recording, torque=torque, torque_delay=total).selected(rows)


def moved_torque(time: Array, torque: Array, delays: Array, rows: npt.NDArray[np.intp]) -> Array:
    """Torques at some rows, each joint's looked up ``delays`` later [s], shape (rows, dofs).

    Args:
        time: [s], shape (N,).
        torque: At these times, shape (N, dofs).
        delays: By degree of freedom [s], shape (dofs,).
        rows: Which; moved by any of the delays, they lie within ``time``.
    """
    if not delays.any():
        return np.asarray(torque[rows])
    moved = np.array(torque[rows])
    for joint in np.flatnonzero(np.abs(delays) > ROUNDING):
        moved[:, joint] = make_interp_spline(time, torque[:, joint], k=DEGREE)(time[rows] + delays[joint])
    return moved
