"""Moments on disk, written whole, and read with suspicion."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from casysid.archives import array_headers, read_arrays
from casysid.errors import ParameterError
from casysid.moments import Moments
from casysid.outputs import whole_file

ROUNDING = 1e-9
"""By which sums of products may miss their laws, as a share of the largest."""


def write_moments(moments: Moments, path: str | Path) -> None:
    """Write the sums over all blocks as NPZ; noise is left out.

    ``squares`` and ``row_columns`` are those of all joints one after the other, ``widths`` the number of each one's
    columns; ``count``, ``columns`` and ``joints`` are as in :class:`Moments`.

    Raises:
        OutputError: The file cannot be written.
    """
    whole = moments.merged_blocks([np.arange(moments.blocks)])
    with whole_file(path) as stream:
        np.savez_compressed(
            stream,
            squares=np.concatenate([sums.ravel() for sums in whole.squares]),
            row_columns=np.concatenate(whole.row_columns),
            widths=np.array([len(own) for own in whole.row_columns]),
            count=whole.count,
            columns=np.array(moments.columns),
            joints=np.array(moments.joints),
        )


def read_moments(path: str | Path) -> Moments:
    """What :func:`write_moments` wrote, as one block.

    Raises:
        ParameterError: The file is not there, or is something else.
    """
    try:
        path = Path(path)
        if not path.is_file():
            raise ParameterError(f"{path}: there is no such file; casysid identify writes it beside result.json")
        names = tuple(array_headers(path))
        kept = ("gram",) if "gram" in names else ("squares", "row_columns", "widths")
        content = read_arrays(path, (*kept, "count", "columns", "joints"))
        columns, joints = (tuple(str(name) for name in content[key].ravel()) for key in ("columns", "joints"))
        for key in (*kept, "count"):
            if content[key].dtype.kind not in "buif":
                raise ParameterError(f"'{key}' holds {content[key].dtype}, wanted real numbers")
        if "gram" in names:  # version 0.1.0 wrote all columns of every joint
            moments = Moments.from_dense(content["gram"], content["count"], columns, joints)
        else:
            moments = _from_short_sums(content, columns, joints)
        _check_sums(moments)
    except (OSError, ValueError, TypeError, IndexError, OverflowError) as error:
        raise ParameterError(f"{path}: these are no moments as casysid identify writes them ({error})") from error
    return moments


def _from_short_sums(content: Mapping[str, Any], columns: tuple[str, ...], joints: tuple[str, ...]) -> Moments:
    """Of the arrays that :func:`write_moments` writes."""
    widths = np.asarray(content["widths"], dtype=np.intp).ravel()
    if (widths < 0).any() or (widths > len(columns)).any():
        raise ParameterError(f"'widths' holds {widths.tolist()}, wanted 0 to {len(columns)}")
    rows = np.split(content["row_columns"].ravel(), np.cumsum(widths)[:-1])
    squares = np.split(content["squares"].ravel(), np.cumsum((widths + 1) ** 2)[:-1])
    shaped = (own.reshape(1, w + 1, w + 1) for own, w in zip(squares, widths.tolist(), strict=True))
    return Moments(tuple(shaped), tuple(rows), content["count"], columns, joints)


def _check_sums(moments: Moments) -> None:
    """Nothing, if these can be sums of squares and products.

    Raises:
        ParameterError: They cannot.
    """
    if len(set(moments.columns)) < len(moments.columns) or (moments.count < 0.0).any() or not moments.blocks:
        raise ParameterError("moments: a column is there twice, a count is negative, or there is no block")
    for sums in moments.squares:
        diagonal = np.einsum("bmm->bm", sums)
        bound = np.sqrt(np.maximum(diagonal[:, :, None] * diagonal[:, None, :], 0.0))
        slack = ROUNDING * np.abs(diagonal).max(initial=0.0)
        uneven = np.abs(sums - np.swapaxes(sums, 1, 2)).max(initial=0.0)
        if not (diagonal >= 0.0).all() or not (np.abs(sums) <= bound + slack).all() or not uneven <= slack:
            raise ParameterError("moments: these are no sums of squares and products of real numbers")
