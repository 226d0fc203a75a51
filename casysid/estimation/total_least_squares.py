"""Total least squares: the smallest change of columns *and* target that makes them agree.

Van Huffel and Vandewalle (1991), *The Total Least Squares Problem*; with a given noise covariance it is the maximum
likelihood fit of Fuller (1987), *Measurement Error Models*, §2.3. Ting et al. (2006), §I, on its weakness: without that
covariance it takes the noise of all standardised columns and of the target to be the same.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from casysid.arrays import Array, frozen
from casysid.errors import CasysidWarning, ParameterError
from casysid.estimation.base import Estimate
from casysid.estimation.selection import mean_variance
from casysid.estimation.standardise import StandardisedProblem, seen_directions, standardise
from casysid.moments import Moments, NormalEquations
from casysid.threads import single_threaded


@dataclass(frozen=True, eq=False, kw_only=True)
class TotalLeastSquares:
    r"""Minimises :math:`v^T S v / v^T D v` over ``v = [-θ, 1]``, with the noise covariance ``D`` of a row ``[x, y]``.

    Attributes:
        noise_covariance: ``D``, known up to a factor, in the regressor's units: shape (p + 1, p + 1), or (joints, p +
            1, p + 1) where the joints' rows differ. None: the same fraction of every column's and the target's energy.
    """

    name: ClassVar[str] = "tls"

    noise_covariance: Array | None = None

    def __post_init__(self) -> None:
        if self.noise_covariance is None:
            return
        noise = np.asarray(self.noise_covariance, dtype=np.float64)
        if noise.ndim not in (2, 3) or noise.shape[-1] != noise.shape[-2]:
            raise ParameterError(
                f"tls: noise_covariance must be (p + 1, p + 1) or (joints, p + 1, p + 1); got shape {noise.shape}"
            )
        values = np.linalg.eigvalsh(noise + np.swapaxes(noise, -1, -2)) / 2.0
        if not values.max() > 0.0 or values.min() < -1e-9 * values.max():
            raise ParameterError("tls: noise_covariance must be positive semidefinite and not zero")
        object.__setattr__(self, "noise_covariance", frozen(noise))

    @single_threaded()
    def estimate(self, moments: Moments, prior: Array | None = None) -> Estimate:
        """The maximum likelihood fit in the directions that the data see, and Fuller's asymptotic covariance.

        Without a noise covariance it warns (:class:`CasysidWarning`) when the fit leaves more than the whole target
        unexplained: directions that the data hardly see then passed for noise that all columns share.

        Raises:
            ParameterError: The noise covariance does not fit the moments' columns and joints.
        """
        problem = standardise(moments, prior)
        if problem.is_degenerate:
            return problem.degenerate_estimate(self.name)
        noise = self._standardised_noise(moments, problem)
        fit = solve_total_least_squares(problem.normal, noise)
        if self.noise_covariance is None:
            _warn_if_useless(moments, problem, fit)
        variance = mean_variance(problem, fit.coefficients, fit.rank)
        return problem.to_estimate(
            self.name, fit.coefficients, fit.covariance(variance), diagnostics={"noise_factor": fit.factor}
        )

    def _standardised_noise(self, moments: Moments, problem: StandardisedProblem) -> Array:
        """``D`` of the weighted rows in the problem's coordinates, mean over rows, shape (d + 1, d + 1)."""
        p, joints = len(moments.columns), len(moments.joints)
        weights, count = problem.noise_std**-2.0, moments.count.sum(axis=0)
        if self.noise_covariance is None:
            normal = moments.pooled(weights)
            pooled = np.diag(np.append(np.diag(normal.xx), normal.yy)) / count.sum()
        else:
            try:
                each = np.broadcast_to(self.noise_covariance, (joints, p + 1, p + 1))
            except ValueError:
                raise ParameterError(
                    f"tls: noise_covariance must be ({p + 1}, {p + 1}) or ({joints}, {p + 1}, {p + 1}) "
                    f"for these moments; got {self.noise_covariance.shape}"
                ) from None
            pooled = np.einsum("j,jmn->mn", weights * count, each) / count.sum()
        to_problem = np.zeros((p + 1, len(problem.live) + 1))  # [x, y] to standardised [x, y - xᵀθ0]
        to_problem[problem.live, np.arange(len(problem.live))] = problem.scale / problem.target_rms
        to_problem[:, -1] = np.append(-problem.prior, 1.0) / problem.target_rms
        return np.asarray(to_problem.T @ pooled @ to_problem)


def _warn_if_useless(moments: Moments, problem: StandardisedProblem, fit: TotalFit) -> None:
    target = moments.pooled(problem.noise_std**-2.0)
    energy = problem.normal.residual_energy(fit.coefficients) * problem.target_rms**2 * target.count
    if energy > target.yy:
        warnings.warn(
            f"tls: residuals are {np.sqrt(energy / target.yy):.3g} times the target itself: noise of the same fraction "
            "in every column does not fit these data. Do not use these parameters; give noise_covariance",
            CasysidWarning,
            stacklevel=4,
        )


@dataclass(frozen=True, eq=False)
class TotalFit:
    """Solution of a total least squares problem in the r directions that the data see.

    Attributes:
        whitening: Seen directions, scaled so that ``z = whiteningᵀ x`` has unit second moments, shape (d, r).
        noise: Noise covariance of ``[z, y]``, shape (r + 1, r + 1).
        factor: ``μ``, by which the given noise covariance had to be multiplied.
        direction: Coefficients of ``z``, shape (r,).
    """

    whitening: Array
    noise: Array
    factor: float
    direction: Array

    @property
    def coefficients(self) -> Array:
        """``β``, shape (d,)."""
        return np.asarray(self.whitening @ self.direction)

    @property
    def rank(self) -> int:
        """Number of seen directions."""
        return len(self.direction)

    def covariance(self, mean_variance: float) -> Array:
        """Asymptotic covariance of ``β``, (d, d), from the residuals' variance over the rows; Fuller (1987), §2.3."""
        uu = self.noise[:-1, :-1]
        uv = self.noise[:-1, -1] - uu @ self.direction
        vv = float(np.append(-self.direction, 1.0) @ self.noise @ np.append(-self.direction, 1.0))
        values, vectors = np.linalg.eigh(np.eye(self.rank) - uu)  # second moments of the noiseless columns
        inverse = (vectors / np.maximum(values, _TINY)) @ vectors.T
        spread = inverse + inverse @ (uu - np.outer(uv, uv) / max(vv, _TINY)) @ inverse
        return np.asarray(mean_variance * self.whitening @ spread @ self.whitening.T)


def solve_total_least_squares(normal: NormalEquations, noise: Array) -> TotalFit:
    """The fit for a noise covariance ``D`` of standardised ``[x, y]``, shape (d + 1, d + 1).

    In whitened columns of the seen directions the largest root of ``D v = ν S v`` is ``1/μ``. Should the target take
    no part in its vector (the problem is then called nongeneric), the next vector in which it does is taken.
    """
    from scipy.linalg import eigh

    values, vectors = seen_directions(normal.xx)
    whitening = vectors / np.sqrt(values)  # (d, r)
    sz = whitening.T @ normal.xy
    unexplained = max(float(normal.yy - sz @ sz), _TINY * normal.yy)
    r = len(sz)
    widened = np.zeros((len(whitening) + 1, r + 1))
    widened[:-1, :-1], widened[-1, -1] = whitening, 1.0
    dz = widened.T @ noise @ widened
    moments = np.block([[np.eye(r), sz[:, None]], [sz, np.atleast_2d(sz @ sz + unexplained)]])
    roots, directions = eigh((dz + dz.T) / 2.0, moments)
    generic = np.flatnonzero((directions[-1] ** 2 * unexplained > _GENERIC) & (roots > 0.0))
    root, v = roots[generic[-1]], directions[:, generic[-1]]
    return TotalFit(whitening, dz / root, float(1.0 / root), -v[:-1] / v[-1])


_TINY = 1e-14  # energy below this fraction of the target's is rounding
_GENERIC = 1e-12  # share of the target in a vector below which it takes no part
