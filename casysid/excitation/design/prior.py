"""What earlier recordings already know, so that the next motion is designed for what they do not."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from casysid.accumulation import accumulate_moments
from casysid.arrays import Array
from casysid.errors import ParameterError
from casysid.excitation.design.problem import ExcitationProblem
from casysid.moments_file import read_moments
from casysid.recording import Recording
from casysid.signals import motion_band, motion_from_recording
from casysid.threads import single_threaded

CUTOFF_OVER_BAND = 3.0
"""Low-pass cut-off over the frequency that holds nearly all of a recording's motion."""
MOST_SAMPLES = 1e12
"""Of one identification: a month of a hundred robots at 1 kHz has 3e11."""
HIGHEST_SHARE_OF_RATE = 0.35
"""Of the rate of samples; no cut-off is higher."""


@single_threaded()
def after_recordings(
    problem: ExcitationProblem, recordings: Sequence[Recording], *, cutoff: float | None = None
) -> ExcitationProblem:
    """The same problem, knowing what recordings tell under its torque noise.

    Args:
        problem: Whose columns and noise are used.
        recordings: Of the same robot.
        cutoff: Of the low-pass [Hz]; None takes three times the motion's band.

    Raises:
        ParameterError: There is no recording.
    """
    if not recordings:
        raise ParameterError("excitation: wanted at least one earlier recording; got none")
    return problem.knowing_gram(sum((_gram(problem, one, cutoff) for one in recordings), 0.0))


@single_threaded()
def after_result(problem: ExcitationProblem, path: str | Path) -> ExcitationProblem:
    """The same problem, knowing what an identification's recordings tell under the problem's torque noise.

    Args:
        problem: Whose noise is used; its columns have to be among those of the identification. Further ones, such as
            friction that the data asked for, count as unknown.
        path: ``result.json`` as ``casysid identify`` writes it, with ``moments.npz`` beside it; or their folder.

    Raises:
        ParameterError: A file is missing or is something else, or lacks columns of the design.
    """
    place = Path(path)
    place = place / "result.json" if place.is_dir() else place
    moments, regressor = read_moments(place.with_name("moments.npz")), problem.information.regressor
    missing = sorted(set(regressor.names) - set(moments.columns))
    if missing or moments.away_from_rest().joints != regressor.robot.dofs:
        raise ParameterError(
            f"excitation: {place.parent} is of other joints or columns than this design; wanted the same, it lacks "
            f"{', '.join(missing[:6]) or 'joints'}. Take the robot and the friction columns that were identified"
        )
    samples = _samples(place)
    rows = np.bincount(moments.moving_rows, moments.count.sum(axis=0))[moments.moving_rows]  # of each joint in all
    averaged = samples / np.maximum(rows, 1.0)  # samples that went into a row
    wanted = np.array([moments.columns.index(name) for name in regressor.names])
    noise = problem.information.noise_std[[regressor.robot.dofs.index(moments.joints[k]) for k in moments.moving_rows]]
    gram = moments.pooled(averaged * noise**-2.0).xx
    return problem.knowing_gram(_marginal(gram, wanted))


def _samples(path: Path) -> float:
    """How many were fitted."""
    try:
        samples = float(json.loads(path.read_bytes().decode("utf-8"))["samples"]["train"])
        if not 0.0 <= samples <= MOST_SAMPLES:
            raise ValueError(f"{samples:g} samples were fitted")
        return samples
    except (OSError, ValueError, KeyError, TypeError, OverflowError, RecursionError) as error:
        raise ParameterError(f"{path}: this is no result.json as casysid identify writes it ({error})") from error


def _marginal(gram: Array, wanted: npt.NDArray[np.intp]) -> Array:
    """Information about some parameters while nothing is known of the others: the Schur complement."""
    others = np.setdiff1d(np.arange(len(gram)), wanted)
    size = np.sqrt(np.diag(gram)[others])
    live = others[size > 0.0]
    across = gram[np.ix_(live, wanted)] / size[size > 0.0, None]
    among = gram[np.ix_(live, live)] / np.outer(size[size > 0.0], size[size > 0.0])
    told = across.T @ np.linalg.lstsq(among, across, rcond=None)[0]
    return np.asarray(gram[np.ix_(wanted, wanted)] - 0.5 * (told + told.T))


def _gram(problem: ExcitationProblem, recording: Recording, cutoff: float | None) -> Array:
    """``Σ σ⁻² x xᵀ`` of all columns, shape (p, p)."""
    if recording.time is not None and cutoff is None:
        band = float(motion_band(recording.time, recording.position).max())
        cutoff = min(CUTOFF_OVER_BAND * max(band, 1.0 / recording.duration), HIGHEST_SHARE_OF_RATE * recording.rate)
    motion = motion_from_recording(problem.robot, recording, None if recording.time is None else cutoff)
    regressor = problem.information.regressor
    moments = accumulate_moments(regressor, motion.q, motion.v, motion.a, motion.tau, blocks=1)
    return np.asarray(moments.pooled(problem.information.noise_std**-2.0).xx)
