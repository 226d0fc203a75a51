"""Columns that are exact mixtures of others have their parts' noise and none of their own.

Noise that is independent from column to column cannot be in columns that depend on each other exactly. Which of them
carry it, second moments do not say, except in one case: the parts of mixtures are the edges of the cone that all
columns span, every other column being a sum of parts with non-negative weights. Columns that outnumber their
directions have that many edges only if they are such mixtures (separability: Donoho and Stodden 2003, *NIPS* 16).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array
from casysid.estimation.standardise import seen_directions, unseen_coordinates

CONE_TOLERANCE = 1e-4
"""A column whose distance from a cone is less than this fraction of its length lies in it."""


def find_parts(correlation: Array) -> npt.NDArray[np.intp]:
    """The columns of which all others are mixtures, ascending; all columns where there are no such.

    Args:
        correlation: Second moments, shape (d, d), with a unit diagonal.
    """
    dependent = unseen_coordinates(correlation)
    group = np.flatnonzero(dependent)
    rank = len(seen_directions(correlation)[0]) - int((~dependent).sum())
    edges = _edges_of_cone(correlation[np.ix_(group, group)], rank) if len(group) else []
    if len(edges) != rank:
        return np.arange(len(correlation))
    return np.union1d(np.flatnonzero(~dependent), group[edges])


def weights_of(correlation: Array, parts: npt.NDArray[np.intp]) -> Array:
    """How all columns follow from independent parts, shape (d, r), from the second moments of all, (d, d)."""
    if len(parts) == len(correlation):
        return np.eye(len(parts))
    weights = np.asarray(np.linalg.solve(correlation[np.ix_(parts, parts)], correlation[parts]).T, dtype=np.float64)
    weights[parts] = np.eye(len(parts))
    return weights


def _edges_of_cone(correlation: Array, rank: int) -> list[int]:
    """The columns of which all others are non-negative combinations; no more than ``rank + 1`` of them."""
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
            break
    return edges
