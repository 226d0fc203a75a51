"""The one pass over the data: from samples to :class:`~casysid.moments.Moments`, in chunks and in constant memory.

The row of a joint has nonzeros only in the columns of the bodies that it moves and of its own drive. So each joint
keeps the sum of squares of its own short rows ``[x, y]``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import groupby
from operator import itemgetter
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array
from casysid.dynamics.regressor import Regressor
from casysid.errors import ParameterError
from casysid.memory import moments_memory, require_memory
from casysid.moments import NEAR_REST, Moments
from casysid.signals.averaging import BandAverage, WindowSums
from casysid.threads import single_threaded

LARGEST_INVALID_SHARE = 0.01
"""An average counts for a joint if no more than this share of its weight lies on samples that do not."""

Mask = npt.NDArray[np.bool_]
Part = TypeVar("Part")


def accumulate_moments(
    regressor: Regressor,
    q: npt.ArrayLike,
    v: npt.ArrayLike,
    a: npt.ArrayLike,
    tau: npt.ArrayLike,
    *,
    average: BandAverage | None = None,
    valid: npt.ArrayLike | None = None,
    near_rest: npt.ArrayLike | None = None,
    blocks: int = 20,
    threads: int = 2,
    progress: Callable[[int, int], None] | None = None,
) -> Moments:
    """Sums of ``r rᵀ``, ``r = [x, y]``, over contiguous blocks of time, for each joint.

    Args:
        regressor: Gives the row ``x`` of each joint.
        q: Configurations, shape (N, nq).
        v: Velocities, shape (N, nv).
        a: Accelerations, shape (N, nv).
        tau: Torques ``y``, shape (N, nv).
        average: Takes averages of the equations instead of the equations themselves, of ``x`` and ``y`` alike.
        valid: Which samples to use, boolean: shape (N,) for all joints alike, or (N, nv) for each joint's own row; None
            uses all. With ``average`` a joint's windows over samples that are not valid for it are left out.
        near_rest: Which samples find which joint near rest, boolean, shape (N, nv); only with ``average``. Averages
            that touch them are summed apart, as rows of a second set of joints (:data:`~casysid.moments.NEAR_REST`).
        blocks: How many blocks of near-equal length; fewer when there are fewer samples.
        threads: How many threads to use. The sums do not depend on it.
        progress: Called with the number of samples done and of all.

    Raises:
        ParameterError: When a shape does not fit, a sample is not finite, there is no sample, or the moments would not
            fit into memory.
    """
    histories = regressor.histories(q, None if average is None else average.time)
    inputs, samples = regressor.equations.check((q, v, a, tau, *histories))
    if any(array.ndim != 2 for array in inputs):
        raise ParameterError(f"moments: q, v, a, tau must be (N, n); got {', '.join(str(x.shape) for x in inputs)}")
    chosen, own = _chosen(valid, samples, regressor.robot.nv)
    _require_finite(inputs, chosen)
    if blocks < 1:
        raise ParameterError(f"moments: blocks must be at least 1; got {blocks}")
    groups = np.array_split(chosen, min(blocks, len(chosen)))
    widths = [len(columns) + 1 for columns in regressor.row_columns]
    joints, rows_of = regressor.robot.dofs, regressor.row_columns
    apart = None if near_rest is None or average is None else np.asarray(near_rest, dtype=bool)
    if apart is not None:
        joints, rows_of = (*joints, *(f"{joint}{NEAR_REST}" for joint in joints)), (*rows_of, *rows_of)
        widths = [*widths, *widths]
    _require_memory(regressor, len(groups))
    sums, counts = [np.zeros((len(groups), width, width)) for width in widths], np.zeros((len(groups), len(widths)))
    with single_threaded():
        if average is None:

            def square(values: Array, piece: npt.NDArray[np.intp]) -> tuple[int, tuple[Array, list[Array]]]:
                return len(piece), _squares(values, widths, None if own is None else own[piece])

            pieces = regressor.equations.map(square, inputs, groups, threads)
            for block, (equations, squares) in _reported(pieces, len(chosen), progress):
                counts[block] += equations
                for total, own_square in zip(sums, squares, strict=True):
                    total[block] += own_square
        else:
            windows = [average.windows(group) for group in groups]
            starts = np.array([group[0] for group in groups])

            def fill(values: Array, piece: npt.NDArray[np.intp]) -> tuple[int, WindowSums]:
                masks = [mask[piece].T for mask in (None if own is None else ~own, apart) if mask is not None]
                rows = np.vstack([values, *masks]) if masks else values
                block = np.searchsorted(starts, piece[0], side="right") - 1
                return len(piece), windows[block].sums(piece, rows.T)

            filled = regressor.equations.map(fill, inputs, groups, threads)
            for block, parts in groupby(_reported(filled, len(chosen), progress), itemgetter(0)):
                rows = windows[block].averages(part for _, part in parts).T
                counts[block], squares = _squares(*_sorted_rows(rows, widths, own is not None, apart is not None))
                for total, own_square in zip(sums, squares, strict=True):
                    total[block] = own_square
    for total in sums:
        total.setflags(write=False)
    return Moments(tuple(sums), rows_of, counts, regressor.names, joints)


def _sorted_rows(
    rows: Array, widths: Sequence[int], some_invalid: bool, apart: bool
) -> tuple[Array, Sequence[int], Mask | None]:
    """Averaged rows and masks for :func:`_squares`; each joint's rows twice where those near rest are apart."""
    joints = len(widths) // 2 if apart else len(widths)
    values = rows[: sum(widths[:joints])]
    shares = rows[len(values) :]
    kept: Mask | None = shares[:joints].T <= LARGEST_INVALID_SHARE if some_invalid else None
    if not apart:
        return values, widths, kept
    moving = shares[-joints:].T <= LARGEST_INVALID_SHARE
    valid = np.ones_like(moving) if kept is None else kept
    return np.vstack([values, values]), widths, np.hstack([valid & moving, valid & ~moving])


def _require_memory(regressor: Regressor, blocks: int) -> None:
    """Refuse moments that the machine could not hold in a fit."""
    joints, p = regressor.robot.nv, len(regressor.names)
    require_memory(
        moments_memory([len(columns) for columns in regressor.row_columns], blocks, p),
        f"moments: a fit of {joints} joints, {p} columns and {blocks} blocks",
        "Lock joints that do not move, take fewer blocks, or a machine with more memory",
    )


def _reported(
    pieces: Iterable[tuple[int, tuple[int, Part]]], samples: int, progress: Callable[[int, int], None] | None
) -> Iterator[tuple[int, Part]]:
    """Number of the block and what was made of each piece, while progress hears of its samples."""
    done = 0
    for block, (count, part) in pieces:
        done += count
        if progress is not None:
            progress(done, samples)
        yield block, part


def _squares(values: Array, widths: Sequence[int], kept: Mask | None) -> tuple[Array, list[Array]]:
    """Rows counted for each joint, and the sums of its squares.

    Args:
        values: The joints' short rows ``[x, y]``, one joint below the other, shape (sum of widths, samples).
        widths: Of each joint's.
        kept: Which samples count for which joint, shape (samples, joints); None counts all.
    """
    count = np.full(len(widths), float(values.shape[1])) if kept is None else kept.sum(axis=0, dtype=np.float64)
    squares = []
    for joint, x in enumerate(np.split(values, np.cumsum(widths)[:-1])):
        if kept is not None and count[joint] < x.shape[1]:
            x = x[:, kept[:, joint]]
        squares.append(x @ x.T)
    return count, squares


def _chosen(valid: npt.ArrayLike | None, samples: int, joints: int) -> tuple[npt.NDArray[np.intp], Mask | None]:
    """Indices of the samples to use, and the mask by joint if there is one."""
    mask = np.ones(samples, dtype=bool) if valid is None else np.asarray(valid)
    if mask.dtype != np.bool_ or mask.shape not in ((samples,), (samples, joints)):
        raise ParameterError(
            f"moments: valid must be boolean with shape ({samples},) or ({samples}, {joints}); got {mask.dtype} with "
            f"shape {mask.shape}"
        )
    own = mask if mask.ndim == 2 else None
    chosen = np.flatnonzero(mask) if own is None else np.arange(samples if mask.any() else 0)
    if len(chosen) == 0:
        raise ParameterError(f"moments: no sample to sum, {samples} given and {samples} left out")
    return chosen, own


def _require_finite(inputs: list[Array], chosen: npt.NDArray[np.intp]) -> None:
    for name, values in zip(("q", "v", "a", "tau", "histories"), inputs, strict=False):
        finite = np.isfinite(values)
        if finite.all():
            continue
        bad = chosen[np.flatnonzero(~finite[chosen].all(axis=1))]
        if len(bad):
            raise ParameterError(
                f"moments: {name} must be finite; {len(bad)} samples are not, the first is number {bad[0]}; "
                "leave them out with valid"
            )
