"""Moments of several loadings of one robot in common columns: one robot, its friction each time, and what it held."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array
from casysid.inertia import KINDS
from casysid.moments import Moments

Indices = npt.NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Loading:
    """Recordings that were made with one load.

    Attributes:
        payload: Its name; empty without any.
        moments: Of the recordings, in the robot's columns.
    """

    payload: str
    moments: Moments


def joint_moments(
    loadings: Sequence[Loading], link: Indices, motion_free: npt.NDArray[np.bool_], transform: Array
) -> Moments:
    """The moments of all loadings, one after the other, in the robot's columns and those of the payloads.

    The robot's columns come first. Columns of friction, which differs from one day and load to the next, are the first
    loading's; every further loading has its own behind. Ten columns for each payload are the last ones.

    Args:
        loadings: At least one.
        link: The ten columns of the link that holds the payloads.
        motion_free: Which of the robot's columns every loading has for itself, shape (p,).
        transform: Payload's parameters to what they add to the link's, shape (10, 10).
    """
    first, p = loadings[0].moments, len(loadings[0].moments.columns)
    own = np.flatnonzero(motion_free)
    payloads = [one.payload for one in loadings if one.payload]
    names = [*first.columns]
    for k in range(1, len(loadings)):
        names += [f"{first.columns[column]} of loading {k + 1}" for column in own]
    names += [f"{payload}.{kind}" for payload in payloads for kind in KINDS]
    total = len(names)
    joints = tuple(dict.fromkeys(name for one in loadings for name in one.moments.joints))
    grams, counts = [], []
    for k, loading in enumerate(loadings):
        T = np.zeros((p, total))
        T[np.arange(p), np.arange(p)] = 1.0
        if k:
            T[own, own] = 0.0
            T[own, p + (k - 1) * len(own) + np.arange(len(own))] = 1.0
        if loading.payload:
            start = total - 10 * (len(payloads) - payloads.index(loading.payload))
            T[np.ix_(link, np.arange(start, start + 10))] = transform
        gram, count = _in_columns(loading.moments, joints, T)
        grams.append(gram)
        counts.append(count)
    return Moments.from_dense(np.concatenate(grams), np.concatenate(counts), names, joints)


def _in_columns(moments: Moments, joints: Sequence[str], T: Array) -> tuple[Array, Array]:
    """Squares (blocks, joints, total + 1, total + 1) of rows ``[x T, y]``, and counts; zero for missing joints."""
    total = T.shape[1]
    gram = np.zeros((moments.blocks, len(joints), total + 1, total + 1))
    count = np.zeros((moments.blocks, len(joints)))
    for k, name in enumerate(moments.joints):
        columns, squares = moments.of_joint(k)
        wide = np.zeros((len(columns) + 1, total + 1))
        wide[:-1, :-1], wide[-1, -1] = T[columns], 1.0
        place = joints.index(name)
        gram[:, place] = wide.T @ squares @ wide
        count[:, place] = moments.count[:, k]
    return gram, count
