"""Inertial parameters of bodies that could exist, as a Hypothesis strategy."""

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from casysid.inertia import parameters_from_pseudo_inertia


@st.composite
def consistent_parameters(draw, bodies: int) -> np.ndarray:
    """Shape (10 bodies,), from pseudo-inertias ``U Uᵀ`` with a positive diagonal."""
    numbers = draw(hnp.arrays(np.float64, (bodies, 10), elements=st.floats(-1.0, 1.0, width=32)))
    return np.concatenate([_parameters(row) for row in numbers])


def _parameters(numbers: np.ndarray) -> np.ndarray:
    U = np.diag(np.exp([0.5, 0.5, 0.5, 2.0] * numbers[:4] - [1.5, 1.5, 1.5, 0.0]))
    U[np.triu_indices(4, 1)] = 0.2 * numbers[4:]
    return parameters_from_pseudo_inertia(U @ U.T)
