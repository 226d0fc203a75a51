"""Sufficient statistics of a linear regression: all that any estimator sees of the data.

With rows ``r = [x, y]`` (``x`` a joint's row of the regressor, ``y`` its torque at one instant), the sums ``Σ r rᵀ``
per block of time and per joint are enough for least squares, ridge, errors in variables, the Bayesian de-noising EM,
cross-validation over blocks, re-weighting between joints, and standard errors from blocks. They add: over blocks,
recordings, processes, machines.

A joint's row has nonzeros only in the columns of the bodies that it moves and of its own drive, so every joint keeps
the squares of its own columns and no others.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array, frozen
from casysid.errors import ParameterError

Indices = npt.NDArray[np.intp]
NEAR_REST = " near rest"
"""Ends the name of a joint's equations at times when it stands or turns round, where they are kept apart."""


@dataclass(frozen=True, eq=False)
class NormalEquations:
    """Second moments of rows pooled over blocks and joints: ``xx θ = xy``.

    Attributes:
        xx: ``Σ w x xᵀ``, shape (p, p).
        xy: ``Σ w x y``, shape (p,).
        yy: ``Σ w y²``.
        count: Number of rows (not weighted).
    """

    xx: Array
    xy: Array
    yy: float
    count: float

    @classmethod
    def of_square(cls, square: Array, count: float) -> NormalEquations:
        """From ``Σ w r rᵀ`` with the target last, shape (p + 1, p + 1)."""
        return cls(frozen(square[:-1, :-1]), frozen(square[:-1, -1]), float(square[-1, -1]), count)

    def residual_energy(self, parameters: Array) -> float:
        """``Σ w (y - xᵀθ)²``, never negative, for parameters of shape (p,)."""
        return max(float(self.yy - 2.0 * self.xy @ parameters + parameters @ self.xx @ parameters), 0.0)


@dataclass(frozen=True, eq=False)
class Moments:
    """Sums of ``r rᵀ``, ``r = [x, y]``, by block of time and by joint.

    Attributes:
        squares: Of each joint in its own w columns, shape (blocks, w + 1, w + 1), symmetric in the last two axes; the
            last row and column belong to ``y``.
        row_columns: Of each joint the columns that its row may have, ascending, shape (w,).
        count: Rows in each sum, shape (blocks, joints).
        columns: Names of the p regressor columns.
        joints: Names of the degrees of freedom whose torque rows were summed.
        noise: What errors of the measured motion have added to ``squares``, like them; None when that is not known.
        noise_error: Standard error of ``noise`` as a whole, as a fraction of it: the noise's level is itself estimated.

    Raises:
        ParameterError: Shapes do not fit each other, columns are out of order, or a sum is not finite.
    """

    squares: tuple[Array, ...]
    row_columns: tuple[Indices, ...]
    count: Array
    columns: tuple[str, ...]
    joints: tuple[str, ...]
    noise: tuple[Array, ...] | None = None
    noise_error: float = 0.0

    def __post_init__(self) -> None:
        count = frozen(self.count)
        if count.ndim != 2 or count.shape[1] != len(self.joints):
            raise ParameterError(f"moments: count must have shape (blocks, {len(self.joints)}); got {count.shape}")
        if not np.isfinite(count).all():
            raise ParameterError("moments: counts must be finite")
        object.__setattr__(self, "row_columns", tuple(_checked_columns(own, self.columns) for own in self.row_columns))
        object.__setattr__(self, "count", count)
        object.__setattr__(self, "squares", self._checked("squares", self.squares))
        if self.noise is not None:
            object.__setattr__(self, "noise", self._checked("noise", self.noise))

    def _checked(self, name: str, sums: Sequence[Array]) -> tuple[Array, ...]:
        """Read-only sums, one for each joint."""
        if not len(sums) == len(self.row_columns) == len(self.joints):
            raise ParameterError(
                f"moments: {name} and row_columns must be given for each of {len(self.joints)} joints; got {len(sums)} "
                f"and {len(self.row_columns)}"
            )
        arrays = tuple(frozen(one) for one in sums)
        for joint, columns, array in zip(self.joints, self.row_columns, arrays, strict=True):
            wanted = (len(self.count), len(columns) + 1, len(columns) + 1)
            if array.shape != wanted:
                raise ParameterError(f"moments: {name} of {joint} must have shape {wanted}; got {array.shape}")
            if not np.isfinite(array).all():
                raise ParameterError("moments: sums must be finite; check the samples for NaN, infinities and overflow")
        return arrays

    @classmethod
    def from_dense(
        cls,
        gram: npt.ArrayLike,
        count: npt.ArrayLike,
        columns: Sequence[str],
        joints: Sequence[str],
        *,
        noise: npt.ArrayLike | None = None,
        noise_error: float = 0.0,
    ) -> Moments:
        """Moments of sums over all columns, ``gram`` and ``noise`` of shape (blocks, joints, p + 1, p + 1).

        The columns of a joint's row are those in which some sum of it is not zero.
        """
        grams = [np.asarray(sums, dtype=np.float64) for sums in (gram, noise) if sums is not None]
        counts, width = np.asarray(count, dtype=np.float64), len(columns) + 1
        for name, sums in zip(("gram", "noise"), grams, strict=False):
            if sums.ndim != 4 or sums.shape[1:] != (len(joints), width, width):
                raise ParameterError(
                    f"moments: {name} must have shape (blocks, {len(joints)}, {width}, {width}) for {len(joints)} "
                    f"joints and {width - 1} columns; got {sums.shape}"
                )
        if counts.shape != grams[0].shape[:2]:
            raise ParameterError(f"moments: count must have shape {grams[0].shape[:2]}; got {counts.shape}")
        filled = sum((np.any(sums != 0.0, axis=(0, 2)) for sums in grams), np.zeros((len(joints), width), dtype=bool))
        own = [np.flatnonzero(row[:-1]) for row in filled]
        places = [np.append(kept, width - 1) for kept in own]
        packed = [tuple(sums[:, j, kept[:, None], kept] for j, kept in enumerate(places)) for sums in grams]
        known = None if noise is None else packed[1]
        return cls(packed[0], tuple(own), counts, tuple(columns), tuple(joints), known, noise_error)

    @classmethod
    def from_rows(
        cls, x: npt.ArrayLike, y: npt.ArrayLike, *, columns: Sequence[str] | None = None, blocks: int = 1
    ) -> Moments:
        """Moments of one regression problem, ``x`` of shape (N, p) and ``y`` of shape (N,), in contiguous blocks."""
        x, y = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
        if x.ndim != 2 or y.shape != x.shape[:1]:
            raise ParameterError(f"moments: x must be (N, p) and y (N,); got {x.shape} and {y.shape}")
        parts = np.array_split(np.column_stack([x, y]), blocks)
        names = tuple(columns) if columns is not None else tuple(f"x{m + 1}" for m in range(x.shape[1]))
        return cls(
            (np.stack([part.T @ part for part in parts]),),
            (np.arange(x.shape[1]),),
            np.array([[float(len(part))] for part in parts]),
            names,
            ("y",),
        )

    def __add__(self, other: Moments) -> Moments:
        """The blocks of both, one after the other; every pooled sum is the sum of the two."""
        if (self.columns, self.joints) != (other.columns, other.joints):
            raise ParameterError("moments: only moments with the same columns and joints can be added")
        rows = tuple(np.union1d(one, two) for one, two in zip(self.row_columns, other.row_columns, strict=True))
        one, two = self._with_rows(rows), other._with_rows(rows)
        known = one.noise is not None and two.noise is not None
        return dataclasses.replace(
            one,
            squares=tuple(map(_stacked, one.squares, two.squares)),
            count=np.concatenate([one.count, two.count]),
            noise=tuple(map(_stacked, one.noise or (), two.noise or ())) if known else None,
            noise_error=max(one.noise_error, two.noise_error),
        )

    @property
    def blocks(self) -> int:
        """Number of blocks of time."""
        return len(self.count)

    @cached_property
    def moving_rows(self) -> Indices:
        """Of each joint's rows, the place of that joint's rows away from rest, shape (joints,)."""
        places = {name: k for k, name in enumerate(self.joints)}
        return np.array([places[name.removesuffix(NEAR_REST)] for name in self.joints], dtype=np.intp)

    @property
    def gram(self) -> Array:
        """The squares among all columns, shape (blocks, joints, p + 1, p + 1): for small problems only."""
        return self._dense(self.squares)

    @property
    def dense_noise(self) -> Array | None:
        """The noise in the shape of :attr:`gram`; None when it is not known."""
        return None if self.noise is None else self._dense(self.noise)

    def of_joint(self, joint: int) -> tuple[Indices, Array]:
        """The w columns of a joint's row, and its squares, shape (blocks, w + 1, w + 1)."""
        return self.row_columns[joint], self.squares[joint]

    def with_rows_only(self) -> Moments:
        """Without the joints near rest of which there is no row."""
        return self.of_joints(
            [k for k, name in enumerate(self.joints) if self.count[:, k].any() or not name.endswith(NEAR_REST)]
        )

    def away_from_rest(self) -> Moments:
        """Without the rows near rest that are kept apart."""
        return self.of_joints([k for k, name in enumerate(self.joints) if not name.endswith(NEAR_REST)])

    def of_joints(self, kept: list[int]) -> Moments:
        """The rows of some joints only, by their places."""
        return dataclasses.replace(
            self,
            squares=tuple(self.squares[k] for k in kept),
            row_columns=tuple(self.row_columns[k] for k in kept),
            count=self.count[:, kept],
            joints=tuple(self.joints[k] for k in kept),
            noise=None if self.noise is None else tuple(self.noise[k] for k in kept),
        )

    def select_blocks(self, blocks: npt.ArrayLike) -> Moments:
        """The given blocks only (indices or a boolean mask)."""
        chosen = np.asarray(blocks)
        return self._mapped(lambda _, sums: sums[chosen], self.count[chosen])

    def merged_blocks(self, groups: Sequence[npt.ArrayLike]) -> Moments:
        """One block for each group of blocks (indices or a boolean mask), their sum."""
        chosen = [np.asarray(group) for group in groups]
        count = np.array([self.count[group].sum(axis=0) for group in chosen]).reshape(len(chosen), len(self.joints))
        return self._mapped(lambda _, sums: np.stack([sums[group].sum(axis=0) for group in chosen]), count)

    def select_columns(self, columns: npt.ArrayLike) -> Moments:
        """The moments of rows that have the given columns only, in the given order.

        Raises:
            ParameterError: A column is not there, or is given twice.
        """
        chosen, p = np.asarray(columns, dtype=np.intp), len(self.columns)
        if chosen.ndim != 1 or len(np.unique(chosen)) != len(chosen) or ((chosen < 0) | (chosen >= p)).any():
            raise ParameterError(
                f"moments: wanted distinct columns among 0 .. {p - 1}; got {np.asarray(columns).tolist()}"
            )
        place = np.full(p, -1)
        place[chosen] = np.arange(len(chosen))
        rows, kept = [], []
        for own in self.row_columns:
            order = np.argsort(place[own], kind="stable")
            order = order[place[own][order] >= 0]
            rows.append(place[own][order])
            kept.append(np.append(order, len(own)))
        names = tuple(self.columns[column] for column in chosen)
        return self._mapped(
            lambda joint, sums: sums[:, kept[joint][:, None], kept[joint]], row_columns=tuple(rows), columns=names
        )

    def shifted(self, parameters: Array) -> Moments:
        """The moments of ``[x, y - xᵀθ0]``: what is left to explain beside ``parameters`` θ0, shape (p,)."""
        return self._mapped(lambda joint, sums: _shift(sums, parameters[self.row_columns[joint]]))

    def denoised(self, share: float = 1.0) -> Moments:
        """The moments less ``share`` of what noise has added, perhaps indefinite; unchanged when that is not known."""
        if self.noise is None:
            return self
        squares = tuple(sums - share * noise for sums, noise in zip(self.squares, self.noise, strict=True))
        return dataclasses.replace(self, squares=squares, noise=None, noise_error=0.0)

    def pooled(self, weights: npt.ArrayLike | None = None) -> NormalEquations:
        """Sum over blocks and joints, each joint's rows weighted by ``1/σ²`` (shape (joints,), default 1)."""
        total = self._spread([sums.sum(axis=0) for sums in self.squares], weights)
        return NormalEquations.of_square(total, float(self.count.sum()))

    def by_block(self, weights: npt.ArrayLike | None = None) -> Iterator[Array]:
        """``Σ w r rᵀ`` over the joints of one block after the other, shape (p + 1, p + 1) each."""
        for block in range(self.blocks):
            yield self._spread([sums[block] for sums in self.squares], weights)

    def pooled_noise(self, weights: npt.ArrayLike | None = None) -> Array:
        """What noise has added to the weighted sum over blocks and joints, shape (p + 1, p + 1); zero if not known."""
        return self._spread([sums.sum(axis=0) for sums in self.noise or ()], weights)

    def residual_energy(self, parameters: Array) -> Array:
        """``Σ (y - xᵀθ)²`` by block and joint, shape (blocks, joints), for parameters of shape (p,)."""
        rows = [np.append(-parameters[own], 1.0) for own in self.row_columns]
        energy = [(sums @ row) @ row for sums, row in zip(self.squares, rows, strict=True)]
        return np.asarray(np.maximum(np.column_stack(energy), 0.0))

    def scores(self, parameters: Array, weights: npt.ArrayLike | None = None) -> Array:
        """``Σ w x (y - xᵀθ)`` of every block, shape (blocks, p), for parameters of shape (p,)."""
        w = np.ones(len(self.joints)) if weights is None else np.asarray(weights, dtype=np.float64)
        total = np.zeros((self.blocks, len(self.columns)))
        for weight, own, sums in zip(w, self.row_columns, self.squares, strict=True):
            total[:, own] += weight * (sums[:, :-1] @ np.append(-parameters[own], 1.0))
        return total

    def target_energy(self) -> Array:
        """``Σ y²`` by block and joint, shape (blocks, joints)."""
        return np.column_stack([sums[:, -1, -1] for sums in self.squares])

    @cached_property
    def _places(self) -> tuple[Indices, ...]:
        """Of each joint's columns and target among all columns and the target."""
        return tuple(np.append(own, len(self.columns)) for own in self.row_columns)

    def _spread(self, sums: Sequence[Array], weights: npt.ArrayLike | None) -> Array:
        """Sums of each joint, (w + 1, w + 1), weighted and added in their places, shape (p + 1, p + 1)."""
        w = np.ones(len(self.joints)) if weights is None else np.asarray(weights, dtype=np.float64)
        total = np.zeros((len(self.columns) + 1, len(self.columns) + 1))
        for weight, places, own in zip(w, self._places, sums, strict=False):
            total[places[:, None], places] += weight * own
        return total

    def _dense(self, sums: Sequence[Array]) -> Array:
        width = len(self.columns) + 1
        dense = np.zeros((self.blocks, len(self.joints), width, width))
        for joint, (places, own) in enumerate(zip(self._places, sums, strict=True)):
            dense[:, joint, places[:, None], places] = own
        return frozen(dense)

    def _mapped(self, change: Callable[[int, Array], Array], count: Array | None = None, **fields: Any) -> Moments:
        """With ``change`` made to the squares and the noise of every joint, given its number."""
        squares, noise = (
            None if sums is None else tuple(change(joint, own) for joint, own in enumerate(sums))
            for sums in (self.squares, self.noise)
        )
        count = self.count if count is None else count
        return dataclasses.replace(self, squares=squares or (), noise=noise, count=count, **fields)

    def _with_rows(self, rows: tuple[Indices, ...]) -> Moments:
        """The same sums with room for further columns in the joints' rows."""
        if all(map(np.array_equal, rows, self.row_columns)):
            return self
        places = [np.append(np.searchsorted(r, own), len(r)) for r, own in zip(rows, self.row_columns, strict=True)]

        def widened(joint: int, sums: Array) -> Array:
            wide = np.zeros((len(sums), len(rows[joint]) + 1, len(rows[joint]) + 1))
            wide[:, places[joint][:, None], places[joint]] = sums
            return wide

        return self._mapped(widened, row_columns=rows)


def _checked_columns(own: npt.ArrayLike, columns: Sequence[str]) -> Indices:
    """Read-only places of a row's columns."""
    places = np.array(own, dtype=np.intp)
    if places.ndim != 1 or (np.diff(places, prepend=-1) <= 0).any() or (places >= len(columns)).any():
        raise ParameterError(
            f"moments: a row's columns must ascend within 0 .. {len(columns) - 1}; got {places.tolist()}"
        )
    places.setflags(write=False)
    return places


def _stacked(one: Array, two: Array) -> Array:
    return np.concatenate([one, two])


def _shift(sums: Array, parameters: Array) -> Array:
    """``Tᵀ G T`` for the change of variables ``y → y - xᵀθ0``."""
    shifted = sums.copy()
    reduced = sums[..., :-1, -1] - sums[..., :-1, :-1] @ parameters
    shifted[..., -1, -1] = sums[..., -1, -1] - (sums[..., -1, :-1] + reduced) @ parameters
    shifted[..., :-1, -1] = shifted[..., -1, :-1] = reduced
    return shifted
