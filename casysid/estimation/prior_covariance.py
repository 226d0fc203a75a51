"""How wrong a prior may be, in which directions: the shape of a ridge's pull.

A model file is wrong as bodies are: mass, centre of mass and inertia of a link together, in the geometry of its
pseudo-inertia, and as likely by a tenth of a heavy link as by a tenth of a light one. Of drives nothing is known
beforehand but the size of their torque. Only the shape is said here; the size is for the data to find.

Source: Lee, Wensing and Park (2020), *Geometric Robot Dynamic Identification: A Convex Programming Approach*.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from casysid.arrays import Array, frozen
from casysid.estimation.standardise import StandardisedProblem
from casysid.inertia import KINDS, relative_covariance


def prior_covariance(problem: StandardisedProblem, columns: Sequence[str]) -> Array:
    """Covariance of the parameters about the prior, up to a factor, regular, shape (p, p).

    Columns of links that the prior knows take the geometry of their pseudo-inertias; all others are scaled to explain
    as much torque each. The columns then have unit energy on average: ``tr(K S_xx / Σ y²)`` is their number.

    Args:
        problem: The standardised problem, whose prior it is.
        columns: Names of all p parameters.
    """
    size = np.zeros(len(columns))
    size[problem.live] = problem.scale
    unseen = np.setdiff1d(np.arange(len(columns)), problem.live)
    size[unseen] = problem.scale.max(initial=0.0) or 1.0
    links = [link for link in links_among(columns) if problem.prior[link.start] > 0.0]
    K = np.diag(size**2)
    bodies = relative_covariance(np.array([problem.prior[link] for link in links]).reshape(-1, 10))
    for link, covariance in zip(links, bodies, strict=True):
        K[link, link] = covariance
    live = problem.live
    standardised = K[np.ix_(live, live)] / np.outer(problem.scale, problem.scale)
    return frozen(K * len(live) / np.sum(standardised * problem.normal.xx))


def links_among(columns: Sequence[str]) -> tuple[slice, ...]:
    """Places of every link's ten parameters: names ``link.m`` to ``link.Izz`` that follow each other."""
    parts = [name.rpartition(".")[::2] for name in columns]
    found = []
    for start in range(len(parts) - len(KINDS) + 1):
        owners, kinds = zip(*parts[start : start + len(KINDS)], strict=True)
        if kinds == KINDS and len(set(owners)) == 1:
            found.append(slice(start, start + len(KINDS)))
    return tuple(found)
