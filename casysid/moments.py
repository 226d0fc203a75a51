"""Sufficient statistics of a linear regression: all that any estimator sees of the data.

With rows ``r = [x, y]`` (``x`` a joint's row of the regressor, ``y`` its torque at one instant), the sums ``Σ r rᵀ``
per block of time and per joint are enough for least squares, ridge, errors in variables, the Bayesian de-noising EM,
cross-validation over blocks, re-weighting between joints, and standard errors from blocks. They add: over blocks,
recordings, processes, machines.
"""

from __future__ import annotations

import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array, frozen
from casysid.errors import ParameterError
from casysid.outputs import whole_file


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

    def residual_energy(self, parameters: Array) -> float:
        """``Σ w (y - xᵀθ)²``, never negative, for parameters of shape (p,)."""
        return max(float(self.yy - 2.0 * self.xy @ parameters + parameters @ self.xx @ parameters), 0.0)


@dataclass(frozen=True, eq=False)
class Moments:
    """Sums of ``r rᵀ``, ``r = [x, y]``, by block of time and by joint.

    Attributes:
        gram: Shape (blocks, joints, p + 1, p + 1), symmetric in the last two axes; the last row and column belong to
            ``y``.
        count: Rows in each sum, shape (blocks, joints).
        columns: Names of the p regressor columns.
        joints: Names of the degrees of freedom whose torque rows were summed.
        noise: What errors of the measured motion have added to ``gram``, same shape; None when that is not known.
        noise_error: Standard error of ``noise`` as a whole, as a fraction of it: the noise's level is itself estimated.
    """

    gram: Array
    count: Array
    columns: tuple[str, ...]
    joints: tuple[str, ...]
    noise: Array | None = None
    noise_error: float = 0.0

    def __post_init__(self) -> None:
        gram, count = np.asarray(self.gram, dtype=np.float64), np.asarray(self.count, dtype=np.float64)
        width = len(self.columns) + 1
        if gram.ndim != 4 or gram.shape[1:] != (len(self.joints), width, width):
            raise ParameterError(
                f"moments: gram must have shape (blocks, {len(self.joints)}, {width}, {width}) for {len(self.joints)} "
                f"joints and {width - 1} columns; got {gram.shape}"
            )
        if count.shape != gram.shape[:2]:
            raise ParameterError(f"moments: count must have shape {gram.shape[:2]}; got {count.shape}")
        if not (np.isfinite(gram).all() and np.isfinite(count).all()):
            raise ParameterError("moments: sums must be finite; check the samples for NaN, infinities and overflow")
        object.__setattr__(self, "gram", frozen(gram))
        object.__setattr__(self, "count", frozen(count))
        if self.noise is not None:
            if self.noise.shape != gram.shape:
                raise ParameterError(f"moments: noise must have shape {gram.shape}, like gram; got {self.noise.shape}")
            object.__setattr__(self, "noise", frozen(self.noise))

    @classmethod
    def from_rows(
        cls, x: npt.ArrayLike, y: npt.ArrayLike, *, columns: Sequence[str] | None = None, blocks: int = 1
    ) -> Moments:
        """Moments of one regression problem, ``x`` of shape (N, p) and ``y`` of shape (N,), in contiguous blocks."""
        x, y = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
        if x.ndim != 2 or y.shape != x.shape[:1]:
            raise ParameterError(f"moments: x must be (N, p) and y (N,); got {x.shape} and {y.shape}")
        rows = np.column_stack([x, y])
        parts = np.array_split(rows, blocks)
        names = tuple(columns) if columns is not None else tuple(f"x{m + 1}" for m in range(x.shape[1]))
        return cls(
            np.stack([part.T @ part for part in parts])[:, None],
            np.array([[float(len(part))] for part in parts]),
            names,
            ("y",),
        )

    def __add__(self, other: Moments) -> Moments:
        """The blocks of both, one after the other; every pooled sum is the sum of the two."""
        if (self.columns, self.joints) != (other.columns, other.joints):
            raise ParameterError("moments: only moments with the same columns and joints can be added")
        known = self.noise is not None and other.noise is not None
        return Moments(
            np.concatenate([self.gram, other.gram]),
            np.concatenate([self.count, other.count]),
            self.columns,
            self.joints,
            np.concatenate([self.noise, other.noise]) if known else None,
            max(self.noise_error, other.noise_error),
        )

    @property
    def blocks(self) -> int:
        """Number of blocks of time."""
        return int(self.gram.shape[0])

    def select_blocks(self, blocks: npt.ArrayLike) -> Moments:
        """The given blocks only (indices or a boolean mask)."""
        chosen = np.asarray(blocks)
        noise = None if self.noise is None else self.noise[chosen]
        return Moments(self.gram[chosen], self.count[chosen], self.columns, self.joints, noise, self.noise_error)

    def shifted(self, parameters: Array) -> Moments:
        """The moments of ``[x, y - xᵀθ0]``: what is left to explain beside ``parameters`` θ0, shape (p,)."""
        noise = None if self.noise is None else _shift(self.noise, parameters)
        return Moments(_shift(self.gram, parameters), self.count, self.columns, self.joints, noise, self.noise_error)

    def denoised(self, share: float = 1.0) -> Moments:
        """The moments less ``share`` of what noise has added, perhaps indefinite; unchanged when that is not known."""
        if self.noise is None:
            return self
        return Moments(self.gram - share * self.noise, self.count, self.columns, self.joints)

    def pooled(self, weights: npt.ArrayLike | None = None) -> NormalEquations:
        """Sum over blocks and joints, each joint's rows weighted by ``1/σ²`` (shape (joints,), default 1)."""
        w = np.ones(len(self.joints)) if weights is None else np.asarray(weights, dtype=np.float64)
        total = np.einsum("j,jmn->mn", w, self.gram.sum(axis=0))
        return NormalEquations(
            frozen(total[:-1, :-1]), frozen(total[:-1, -1]), float(total[-1, -1]), float(self.count.sum())
        )

    def residual_energy(self, parameters: Array) -> Array:
        """``Σ (y - xᵀθ)²`` by block and joint, shape (blocks, joints), for parameters of shape (p,)."""
        r = np.append(-parameters, 1.0)
        return np.asarray(np.maximum(np.einsum("m,bjmn,n->bj", r, self.gram, r), 0.0))

    def target_energy(self) -> Array:
        """``Σ y²`` by block and joint, shape (blocks, joints)."""
        return np.asarray(self.gram[:, :, -1, -1])


def write_moments(moments: Moments, path: Path) -> None:
    """Write the sums over all blocks as NPZ: ``gram``, ``count``, ``columns``, ``joints``; noise is left out.

    Raises:
        OutputError: The file cannot be written.
    """
    with whole_file(path) as stream:
        np.savez_compressed(
            stream,
            gram=moments.gram.sum(axis=0, keepdims=True),
            count=moments.count.sum(axis=0, keepdims=True),
            columns=np.array(moments.columns),
            joints=np.array(moments.joints),
        )


def read_moments(path: Path) -> Moments:
    """What :func:`write_moments` wrote, as one block.

    Raises:
        ParameterError: The file is not there, or is something else.
    """
    try:
        with path.open("rb") as stream, np.load(stream, allow_pickle=False) as content:
            columns, joints = (tuple(str(name) for name in content[key]) for key in ("columns", "joints"))
            return Moments(content["gram"], content["count"], columns, joints)
    except FileNotFoundError as error:
        raise ParameterError(f"{path}: there is no such file; casysid identify writes it beside result.json") from error
    except (OSError, EOFError, ValueError, KeyError, zipfile.BadZipFile) as error:
        raise ParameterError(f"{path}: these are no moments as casysid identify writes them ({error})") from error


def _shift(gram: Array, parameters: Array) -> Array:
    """``Tᵀ G T`` for the change of variables ``y → y - xᵀθ0``."""
    shifted = gram.copy()
    reduced = gram[..., :-1, -1] - gram[..., :-1, :-1] @ parameters
    shifted[..., -1, -1] = gram[..., -1, -1] - (gram[..., -1, :-1] + reduced) @ parameters
    shifted[..., :-1, -1] = shifted[..., -1, :-1] = reduced
    return shifted
