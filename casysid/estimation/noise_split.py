"""How much of every column is independent noise, as far as second moments tell.

``S = C + F`` with the noiseless columns' ``C`` positive semidefinite and the noise's ``F`` diagonal has many solutions
(Frisch 1934): the data only say that no column m has more noise than ``1/(S⁻¹)_mm``, and that all of them together
leave ``S - F`` positive semidefinite. Where columns are correlated that is a narrow room, and it is narrow at the top
where the noiseless columns are nearly dependent: the smallest eigenvalue of S is then noise.

Among the solutions this takes the one of largest entropy, both parts being normal:

    maximise   log det F + log det (S - F)    over positive diagonal F.

It is concave, so the answer is one; it scales and permutes with the columns; a lone column is split in halves.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from casysid.arrays import Array
from casysid.errors import SolverError

TOLERANCE = 1e-3
"""Newton decrement at which the maximum is reached; the error left is of its square."""
DAMPED = 0.25
"""Newton decrement above which steps are shortened."""
MAX_STEPS = 200


def split_noise(second_moments: Array) -> Array:
    """Noise variance of every column, shape (d,), from positive definite second moments, shape (d, d).

    Newton's method with the damped steps ``1/(1 + λ)`` of self-concordant functions (Nesterov 1994), none of which
    leaves the admissible set.

    Raises:
        SolverError: The second moments are not positive definite.
    """
    largest = 1.0 / np.diag(_inverse(second_moments))  # (d,)
    S = second_moments / np.sqrt(np.outer(largest, largest))
    share = np.full(len(S), 0.5 / len(S))  # of the largest; admissible: tr(F S⁻¹) = 1/2
    for _ in range(MAX_STEPS):
        P = _inverse(S - np.diag(share))
        gradient = 1.0 / share - np.diag(P)
        step = np.linalg.solve(np.diag(share**-2.0) + P * P, gradient)
        decrement = np.sqrt(max(float(gradient @ step), 0.0))
        share = share + step / (1.0 + decrement if decrement > DAMPED else 1.0)
        if decrement <= TOLERANCE:
            return np.asarray(share * largest)
    raise SolverError(
        f"noise split: no maximum of the entropy in {MAX_STEPS} Newton steps; wanted a decrement of {TOLERANCE}, got "
        f"{decrement:.3g}: the columns' second moments are too close to singular"
    )


def _inverse(matrix: Array) -> Array:
    try:
        return np.asarray(cho_solve(cho_factor(matrix, check_finite=False), np.eye(len(matrix)), check_finite=False))
    except np.linalg.LinAlgError as error:
        raise SolverError(
            "noise split: the columns' second moments are not positive definite; leave dependent columns out"
        ) from error
