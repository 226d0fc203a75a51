"""Which logged column belongs to which joint: an assignment of columns to the model's joints, with signs.

Columns of torque are assigned to joints by how much of each torque every joint's equation leaves unexplained (the
Hungarian method). Where positions are exchanged too, each assignment makes another motion and other equations, so
assignments are improved step by step: exchanges of two and three columns and turns of a sign, and what the Hungarian
method proposes, from the order as logged and from random ones.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import combinations, product

import numpy as np
from scipy.optimize import linear_sum_assignment

from casysid.arrays import Array
from casysid.identification.mistakes.bodies import friction_basis
from casysid.identification.mistakes.samples import SHARPNESS, Indices, Samples
from casysid.robot import Joint

ROWS = 100
"""Samples by which assignments are compared."""
RESOLUTION = 1e-3
"""Of a joint's torque energy: smaller residues are alike here."""
STARTS, AGAIN, FEW = 24, 4, 8
"""Random orders that are improved; the search ends once the best was found from so many, or after a few when none is
better than the order as logged."""
ALIKE, MOST_ALIKE = 3.0, 6
"""Orders whose sums of logarithms are so near are told apart by bodies that are fitted to each; so many are."""
INDIFFERENT = 0.1
"""Columns go home and signs go back where that raises the sum of logarithms by no more."""
DESCENTS = 40
"""Steps of one improvement."""
Predict = Callable[[Samples], Array]


@dataclass(frozen=True, eq=False)
class Assignment:
    """Columns of a log for joints.

    Attributes:
        position: Column of each joint's position, shape (m,).
        torque: Column of each joint's torque, shape (m,).
        position_sign: Shape (m,), 1 or -1.
        torque_sign: Likewise.
        cost: Sum of the logarithms of unexplained shares.
    """

    position: Indices
    torque: Indices
    position_sign: Array
    torque_sign: Array
    cost: float

    @property
    def is_as_logged(self) -> bool:
        """Whether no column moves."""
        order = np.arange(len(self.position))
        return bool((self.position == order).all() and (self.torque == order).all())


def reordered(samples: Samples, joints: tuple[Joint, ...], assignment: Assignment) -> Samples:
    """The samples of an assignment."""
    position, v, a, tau = (np.array(x) for x in samples.arrays)
    channels, dofs = places_of(joints)
    sign = assignment.position_sign
    position[:, channels] = samples.position[:, channels[assignment.position]] * sign
    v[:, dofs], a[:, dofs] = (x[:, dofs[assignment.position]] * sign for x in (samples.v, samples.a))
    tau[:, dofs] = samples.tau[:, dofs[assignment.torque]] * assignment.torque_sign
    return dataclasses.replace(samples, position=position, v=v, a=a, tau=tau)


def places_of(joints: tuple[Joint, ...]) -> tuple[Indices, Indices]:
    """First channel and degree of freedom of each."""
    return np.array([one.channels.start for one in joints]), np.array([one.v.start for one in joints])


class OrderSearch:
    """Assignments of a log's columns to joints of one degree of freedom."""

    def __init__(self, joints: tuple[Joint, ...], samples: Samples, predict: Predict) -> None:
        """Prepares what no assignment changes.

        Args:
            joints: That may be exchanged, each with one channel.
            samples: As logged.
            predict: The file's torque for samples, shape (N, nv).
        """
        rows = np.unique(np.linspace(0, len(samples.tau) - 1, ROWS).astype(np.intp))
        self._samples = samples.rows(rows)
        self._joints, self._predict = joints, predict
        self._channels, self._dofs = places_of(joints)
        few = self._samples
        v, a, self._tau = (x[:, self._dofs] for x in (few.v, few.a, few.tau))
        width = SHARPNESS * np.sqrt(np.mean(v**2, axis=0)) + 1e-12
        basis = [friction_basis(*one) for one in zip(v.T, a.T, width, strict=True)]
        self._basis = np.zeros((len(joints), len(rows), 4))
        for k, columns in enumerate(basis):
            self._basis[k, :, : columns.shape[1]] = columns
        along = np.einsum("mnb,nk->mkb", self._basis, self._tau)
        total = np.sum((self._tau - self._tau.mean(axis=0)) ** 2, axis=0)
        self._total = np.maximum(total, 1e-12 * total.max() + 1e-30)
        self._own = np.sum(self._tau**2, axis=0) - np.sum(along**2, axis=2)  # (motion column, torque column)
        self._along = along

    def turned(self) -> Assignment:
        """The order as logged, torques with the signs that the file explains better."""
        order, ones = np.arange(len(self._joints)), np.ones(len(self._joints))
        costs, signs = self._costs(order[None], ones[None])
        return Assignment(order, order, ones, np.diag(signs[0]).copy(), float(np.trace(costs[0])))

    def best(self) -> tuple[list[Assignment], list[Assignment], list[Assignment]]:
        """The best assignments of torques alone, of positions alone, and of both together."""
        m = len(self._joints)
        order, ones = np.arange(m), np.ones(m)
        costs, signs = self._costs(order[None], ones[None])
        own, torque = linear_sum_assignment(costs[0])
        torques = Assignment(order, torque, ones, signs[0, own, torque], float(costs[0, own, torque].sum()))
        return [torques], [self._descended(order, ones, together=False)], self._from_everywhere()

    def _from_everywhere(self) -> list[Assignment]:
        """Columns of both together, from several orders: the best, and others that are as good but for noise."""
        m, rng = len(self._joints), np.random.default_rng(0)
        as_logged = float(np.trace(self._costs(np.arange(m)[None], np.ones((1, m)))[0][0]))
        found = [self._descended(np.arange(m), np.ones(m))]
        for start in range(STARTS):
            costs = np.array([one.cost for one in found])
            again = np.isclose(costs, costs.min(), atol=1e-6).sum()
            hopeless = start >= FEW and costs.min() > as_logged - INDIFFERENT
            if again >= AGAIN or hopeless:
                break
            found.append(self._descended(rng.permutation(m), rng.choice([-1.0, 1.0], m)))
        best = min(one.cost for one in found)
        near = sorted((one for one in found if one.cost < best + ALIKE), key=lambda one: one.cost)
        plain = [self._simplified(one) for one in near]
        return list({(*one.position, *one.position_sign): one for one in plain}.values())[:MOST_ALIKE]

    def _simplified(self, found: Assignment) -> Assignment:
        """Without what moves for nothing, as columns of joints that rest."""
        order, sign, cost = found.position.copy(), found.position_sign.copy(), found.cost
        for k in range(len(order)):
            home, back = order.copy(), sign.copy()
            other = int(np.flatnonzero(order == k)[0])
            home[[k, other]] = k, order[k]
            plain = sign.copy()
            plain[k] = 1.0
            back[[k, other]] = sign[[other, k]]
            for moved, turned in ((home, back), (order, plain)):
                judged, torque_sign = self._judged(moved[None], turned[None], together=True)
                if judged[0] < cost + INDIFFERENT:
                    order, sign, cost = moved, turned, float(judged[0])
                    found = Assignment(order, order, sign, torque_sign[0], cost)
        return found

    def _descended(self, order: Indices, sign: Array, together: bool = True) -> Assignment:
        """Improved until no neighbour is better."""
        cost, torque_sign = (one[0] for one in self._judged(order[None], sign[None], together))
        for _ in range(DESCENTS):
            near = [*self._neighbours(order, sign), *([self._proposed(order, sign)] if together else [])]
            orders, signs = (np.array(one) for one in zip(*near, strict=True))
            costs, turned = self._judged(orders, signs, together)
            k = int(np.argmin(costs))
            if costs[k] > cost - 1e-9:
                break
            order, sign, cost, torque_sign = orders[k], signs[k], costs[k], turned[k]
        return Assignment(order, order if together else np.arange(len(order)), sign, torque_sign, float(cost))

    def _proposed(self, order: Indices, sign: Array) -> tuple[Indices, Array]:
        """Positions in the order in which the torques are explained best by the motion as it is, signs with them."""
        costs, _ = self._costs(order[None], sign[None])
        _, columns = linear_sum_assignment(costs[0])
        return columns, sign[np.argsort(order)][columns]

    def _judged(self, orders: Indices, signs: Array, together: bool) -> tuple[Array, Array]:
        """Cost of orders (K, m), and signs of their torques."""
        costs, turned = self._costs(orders, signs)
        columns = orders if together else np.broadcast_to(np.arange(orders.shape[1]), orders.shape)
        picked, signs = (np.take_along_axis(one, columns[:, :, None], axis=2)[:, :, 0] for one in (costs, turned))
        return picked.sum(axis=1), signs

    def _neighbours(self, order: Indices, sign: Array) -> Iterator[tuple[Indices, Array]]:
        m = len(order)
        for k in range(m):
            turned = sign.copy()
            turned[k] *= -1.0
            yield order, turned
        for pair in combinations(range(m), 2):
            places = list(pair)
            for turns in product((1.0, -1.0), repeat=2):
                moved, signs = order.copy(), sign.copy()
                moved[places], signs[places] = order[places[::-1]], sign[places[::-1]] * turns
                yield moved, signs
        for triple in combinations(range(m), 3):
            for cycle in ([1, 2, 0], [2, 0, 1]):
                places, sources = list(triple), [triple[k] for k in cycle]
                moved, signs = order.copy(), sign.copy()
                moved[places], signs[places] = order[sources], sign[sources]
                yield moved, signs

    def _costs(self, orders: Indices, signs: Array) -> tuple[Array, Array]:
        """Logarithm of what each joint's equation leaves of each torque column, and the torque's sign.

        Args:
            orders: Column of each joint's position, shape (K, m).
            signs: Of these, shape (K, m).

        Returns:
            Both of shape (K, joints m, torque columns m).
        """
        few, count = self._samples, len(orders)
        position, v, a = (np.tile(x, (count, 1)) for x in (few.position, few.v, few.a))
        shape = (count * len(few.v), -1)
        for values, logged, places in (
            (position, few.position, self._channels),
            (v, few.v, self._dofs),
            (a, few.a, self._dofs),
        ):
            turned = logged[:, places][:, orders] * signs
            values[:, places] = turned.transpose(1, 0, 2).reshape(shape)
        stacked = Samples(position, v, a, np.zeros_like(v), few.independent)
        predicted = self._predict(stacked)[:, self._dofs].reshape(count, len(few.v), -1)
        basis = self._basis[orders]  # (K, m, N, 4)
        inside = np.einsum("kmnb,knm->kmb", basis, predicted, optimize=True)
        power = np.sum(predicted**2, axis=1) - np.sum(inside**2, axis=2)
        shared = np.einsum("knm,nc->kmc", predicted, self._tau, optimize=True)
        shared -= np.einsum("kmb,kmcb->kmc", inside, self._along[orders], optimize=True)
        size = np.sum(predicted**2, axis=1)
        told = np.where(power > 1e-9 * size, shared.transpose(2, 0, 1) ** 2 / np.maximum(power, 1e-300), 0.0)
        left = np.maximum(self._own[orders] - told.transpose(1, 2, 0), 0.0) / self._total
        return np.log(left + RESOLUTION), np.where(shared < 0.0, -1.0, 1.0)
