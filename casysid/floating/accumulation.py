"""Moments of the equations that unknown forces leave: for every estimator, as those of any other robot."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array
from casysid.dynamics import Regressor
from casysid.errors import ParameterError
from casysid.floating.forces import Contact
from casysid.floating.projection import free_projector, unknown_directions
from casysid.kinematics import Kinematics
from casysid.memory import moments_memory, require_memory
from casysid.moments import Moments
from casysid.signals.averaging import BandAverage
from casysid.threads import single_threaded

PIECE = 512
"""Samples at once: effort."""


@single_threaded()
def projected_moments(
    regressor: Regressor,
    q: npt.ArrayLike,
    v: npt.ArrayLike,
    a: npt.ArrayLike,
    forces: npt.ArrayLike,
    *,
    contacts: Sequence[Contact] = (),
    unmeasured: Sequence[str] = (),
    noise: npt.ArrayLike | None = None,
    average: BandAverage | None = None,
    blocks: int = 20,
) -> Moments:
    """Sums of ``r rᵀ`` of the rows ``P [Y, τ]``, by block of time and degree of freedom.

    All wrenches measured and no torque missing, ``P`` is one, and these are the moments of
    :func:`~casysid.accumulation.accumulate_moments`. With all joints' torques unmeasured the rows of the base are left.
    As rows of a projection depend on each other, each counts as its share ``P_ii``, so that the counts sum to the
    number of equations that are left.

    Args:
        regressor: Gives ``Y``.
        q: Configurations, shape (N, nq).
        v: Velocities, shape (N, nv).
        a: Accelerations, shape (N, nv).
        forces: Torques and measured wrenches, shape (N, nv); see :func:`~casysid.floating.generalised_forces`.
        contacts: Frames that touch with unknown wrenches.
        unmeasured: Degrees of freedom whose torques are not known; what ``forces`` has there does not matter.
        noise: Standard deviations of the forces' noise, shape (nv,): equations are divided by it before they are
            projected, so that the least squares of what is left are those of the noise. None is ones.
        average: Takes averages of the projected equations instead of themselves.
        blocks: How many blocks of near-equal length.

    Raises:
        ParameterError: A shape does not fit, a number is not finite, or unknown forces leave no equation.
    """
    robot, p = regressor.robot, len(regressor.names)
    if regressor.history_count:
        raise ParameterError("moments: friction that remembers the way is not projected; give a regressor without it")
    states = [np.asarray(values, dtype=np.float64) for values in (q, v, a, forces)]
    for name, values, width in zip(("q", "v", "a", "forces"), states, (robot.nq, *[robot.nv] * 3), strict=True):
        if values.shape != (len(states[0]), width) or not np.isfinite(values).all():
            raise ParameterError(
                f"moments: {name} must be finite, shape ({len(states[0])}, {width}); got {values.shape}"
            )
    sigma = np.ones(robot.nv) if noise is None else np.asarray(noise, dtype=np.float64)
    if sigma.shape != (robot.nv,) or not (np.isfinite(sigma).all() and (sigma > 0.0).all()):
        raise ParameterError(f"moments: noise must be {robot.nv} positive numbers; got {noise!r}")
    groups = np.array_split(np.arange(len(states[0])), min(blocks, max(len(states[0]), 1)))
    require_memory(
        moments_memory([p] * robot.nv, len(groups), p),
        f"moments of {robot.nv} rows and {p} columns",
        "Take fewer blocks",
    )
    rows = _Rows(regressor, states, tuple(contacts), tuple(unmeasured), 1.0 / sigma)
    gram, count = np.zeros((len(groups), robot.nv, p + 1, p + 1)), np.zeros((len(groups), robot.nv))
    for block, group in enumerate(groups):
        for values in rows.of(group) if average is None else [_averaged(rows, group, average)]:
            shares, equations = values[:, : robot.nv], values[:, robot.nv :].reshape(len(values), robot.nv, p + 1)
            count[block] += shares.sum(axis=0)
            gram[block] += np.einsum("nij,nik->ijk", equations, equations, optimize=True)
    left = count.sum(axis=0) > _LEAST_SHARE * len(states[0])
    if not left.any():
        raise ParameterError("moments: contacts and unmeasured torques leave no equation at all")
    names = [dof for dof, kept in zip(robot.dofs, left, strict=True) if kept]
    return Moments.from_dense(gram[:, left], count[:, left], regressor.names, names)


_LEAST_SHARE = 1e-9  # of the samples: below, a row is rounding


class _Rows:
    """Rows ``[diagonal of P, P [Y, τ]]`` of samples, piece by piece."""

    def __init__(
        self,
        regressor: Regressor,
        states: Sequence[Array],
        contacts: tuple[Contact, ...],
        unmeasured: tuple[str, ...],
        weight: Array,
    ) -> None:
        self._regressor, self._states, self._weight = regressor, states, weight
        self._kinematics = Kinematics(regressor.robot)
        self._contacts, self._unmeasured = contacts, unmeasured
        self._directions = unknown_directions(self._kinematics, states[0], contacts, unmeasured)

    def of(self, group: npt.NDArray[np.intp]) -> list[Array]:
        """Of consecutive samples."""
        return [self._piece(piece) for piece in np.array_split(group, max(-(-len(group) // PIECE), 1))]

    def _piece(self, piece: npt.NDArray[np.intp]) -> Array:
        q, v, a, forces = (values[piece] for values in self._states)
        Y = self._regressor.evaluate(q, v, a, histories=())
        equations = self._weight[:, None] * np.concatenate([Y, forces[:, :, None]], axis=2)
        P = free_projector(self._directions[piece] * self._weight)
        return np.hstack([np.einsum("nii->ni", P), (P @ equations).reshape(len(piece), -1)])


def _averaged(rows: _Rows, group: npt.NDArray[np.intp], average: BandAverage) -> Array:
    windows, first = average.windows(group), 0
    parts = []
    for values in rows.of(group):
        parts.append(windows.sums(group[first : first + len(values)], values))
        first += len(values)
    return windows.averages(parts)
