"""Columns of which all others are exact combinations: where columns depend on each other, who carries the noise?

Noise that is independent from column to column cannot be in columns that depend on each other exactly: that of the
combinations is the combination of their parts' noise. The second moments do not say which columns are the parts. Two
readings, the first where it is possible:

* *mixtures*: the parts are the edges of the cone of all columns, every other column a sum of them with non-negative
  weights. That is one answer at most (separable mixtures: Donoho and Stodden 2003, *NIPS* 16), and no accident where
  columns outnumber directions.
* *best conditioned*: the columns of largest volume, by pivoted Cholesky factorisation and exchanges. Every other
  column then has weights of at most about one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.linalg.lapack import dpstrf

from casysid.arrays import Array, frozen

PIVOT_TOLERANCE = 1e-10
"""A column of which less than this share is left, in mean square, once others are taken out depends on them."""
CONE_TOLERANCE = 1e-4
"""A column whose distance from a cone is less than this fraction of its length lies in it."""
WORTH_AN_EXCHANGE = 1.01
"""Least factor by which the volume must grow."""


@dataclass(frozen=True, eq=False)
class GeneratingColumns:
    """Independent columns, and how the others follow from them.

    Attributes:
        chosen: Indices of the independent columns, ascending, shape (r,).
        weights: ``x = weights @ x[chosen]``, shape (d, r); the unit matrix in the chosen rows.
    """

    chosen: npt.NDArray[np.intp]
    weights: Array


def find_generating_columns(correlation: Array) -> GeneratingColumns:
    """The columns that generate all others, from their second moments, shape (d, d), with a unit diagonal."""
    chosen = _largest_volume(correlation)
    rest = np.setdiff1d(np.arange(len(correlation)), chosen)
    if len(rest):
        parts = chosen[(np.abs(weights_of(correlation, chosen)[rest]) > CONE_TOLERANCE).any(axis=0)]
        group = np.sort(np.append(parts, rest))
        edges = _edges_of_cone(correlation[np.ix_(group, group)], rank=len(parts))
        if edges is not None:
            chosen = np.union1d(np.setdiff1d(chosen, parts), group[edges])
    return GeneratingColumns(chosen, frozen(weights_of(correlation, chosen)))


def weights_of(correlation: Array, chosen: npt.NDArray[np.intp]) -> Array:
    """How all columns follow from the chosen ones, shape (d, r), from the second moments of all, (d, d)."""
    weights = np.asarray(np.linalg.solve(correlation[np.ix_(chosen, chosen)], correlation[chosen]).T, dtype=np.float64)
    weights[chosen] = np.eye(len(chosen))
    return weights


def _largest_volume(correlation: Array) -> npt.NDArray[np.intp]:
    """Independent columns whose Gram determinant no exchange of two columns raises by much, ascending."""
    _, pivots, rank, _ = dpstrf(correlation, tol=PIVOT_TOLERANCE)
    chosen = pivots[:rank].astype(np.intp) - 1
    while True:
        weights = np.abs(weights_of(correlation, chosen))
        incoming, outgoing = np.unravel_index(weights.argmax(), weights.shape)
        if weights[incoming, outgoing] <= WORTH_AN_EXCHANGE:
            return np.sort(chosen)
        chosen[outgoing] = incoming


def _edges_of_cone(correlation: Array, rank: int) -> npt.NDArray[np.intp] | None:
    """The columns of which all others are non-negative combinations; None unless they are ``rank`` independent ones."""
    from scipy.optimize import nnls

    values, vectors = np.linalg.eigh(correlation)
    coordinates = (vectors[:, -rank:] * np.sqrt(np.maximum(values[-rank:], 0.0))).T  # (rank, d)
    rest, edges = list(range(len(correlation))), []
    for column in range(len(correlation)):
        others = [k for k in rest if k != column]
        # SciPy's nnls breaks down on a matrix without columns
        if others and nnls(coordinates[:, others], coordinates[:, column])[1] <= CONE_TOLERANCE:
            rest = others
        else:
            edges.append(column)
        if len(edges) > rank:
            return None
    return np.array(edges, dtype=np.intp) if len(edges) == rank else None
