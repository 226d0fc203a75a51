"""Friction that goes astray slowly: each joint's friction at its usual speed, against what it was."""

from __future__ import annotations

from collections import deque

import numpy as np

from casysid.arrays import Array
from casysid.dynamics import Regressor
from casysid.model import RobotModel
from casysid.online.events import Event
from casysid.online.renewal import State

SHARE = 0.2
"""Of a joint's friction by which it may change without a word: no controller feels less of it than of its own error."""
CLEAR = 5.0
"""Standard errors that a change has to have, its noise being Gaussian: 6e-7."""
KEPT = 1024
"""Renewals that are remembered, to say since when: a quarter of an hour."""


class FrictionWatch:
    """Compares the friction of every renewal with that of the first, or since the last word on that joint."""

    def __init__(self, regressor: Regressor, speed: Array, anchor: State) -> None:
        """For one robot.

        Args:
            regressor: Whose columns are asked.
            speed: Root mean square velocity of each degree of freedom, shape (nv,).
            anchor: The state that is known.
        """
        names = {name: k for k, name in enumerate(regressor.names)}
        self._dofs = regressor.robot.dofs
        self._rows = np.zeros((len(self._dofs), len(names)))
        for k, dof in enumerate(self._dofs):
            for kind, size in (("viscous", speed[k]), ("coulomb", 1.0)):
                if f"{dof}.{kind}" in names:
                    self._rows[k, names[f"{dof}.{kind}"]] = size
        self._anchor, self._anchor_variance = self._friction(anchor.model), self._variance(anchor)
        self._known: set[int] = set()
        self._past: deque[tuple[float, Array]] = deque(maxlen=KEPT)

    def _friction(self, model: RobotModel) -> Array:
        return np.asarray(self._rows @ model.parameters)

    def _variance(self, state: State) -> Array:
        return np.asarray(
            np.maximum(
                np.einsum("kp,pq,kq->k", self._rows, state.spread.covariance, self._rows),
                np.einsum("kp,pq,kq->k", self._rows, state.posterior, self._rows),
            )
        )

    def know(self, dof: str) -> None:
        """A change was said already; what the next renewal finds is the new measure."""
        self._known.add(self._dofs.index(dof))

    def look(self, state: State, now: float) -> list[Event]:
        """What is to be said of this renewal."""
        friction, variance = self._friction(state.model), self._variance(state)
        self._past.append((state.time, friction))
        for k in self._known:
            self._anchor[k], self._anchor_variance[k] = friction[k], variance[k]
        self._known.clear()
        change = friction - self._anchor
        error = np.sqrt(variance + self._anchor_variance)
        said: list[Event] = []
        for k in map(
            int, np.flatnonzero((np.abs(change) > SHARE * np.abs(self._anchor)) & (np.abs(change) > CLEAR * error))
        ):
            half = [time for time, past in self._past if abs(past[k] - self._anchor[k]) < 0.5 * abs(change[k])]
            since = max(half, default=self._past[0][0])
            said.append(Event("friction", since, now, float(change[k]), float(error[k]), self._dofs[k]))
            self._anchor[k], self._anchor_variance[k] = friction[k], variance[k]
        return said
