"""Random moments, and what changes of columns make of them."""

import numpy as np

from casysid.moments import Moments


def draw_moments(rng: np.random.Generator, joints: int = 2, blocks: int = 4, n: int = 60, p: int = 6) -> Moments:
    """Half the columns relevant, some noise in all of them, joints of unlike size and noise."""
    truth = np.where(np.arange(p) % 2 == 0, rng.uniform(0.5, 2.0, p) * rng.choice([-1.0, 1.0], p), 0.0)
    gram = np.empty((blocks, joints, p + 1, p + 1))
    for b, j in np.ndindex(blocks, joints):
        t = (j + 1.0) * rng.standard_normal((n, p))
        x = t + 0.1 * rng.standard_normal((n, p))
        rows = np.column_stack([x, t @ truth + 0.3 * (3.0 * j + 1.0) * rng.standard_normal(n)])
        gram[b, j] = rows.T @ rows
    columns, names = (tuple(f"{letter}{k}" for k in range(m)) for letter, m in (("x", p), ("joint_", joints)))
    return Moments.from_dense(gram, np.full((blocks, joints), float(n)), columns, names)


def transformed(moments: Moments, transform: np.ndarray, columns: tuple[str, ...]) -> Moments:
    """Moments of the rows ``r`` multiplied by ``transform``."""
    return Moments.from_dense(transform.T @ moments.gram @ transform, moments.count, columns, moments.joints)


def with_columns(moments: Moments, mixing: np.ndarray) -> Moments:
    """Moments of the columns multiplied by ``mixing``, the output as it is."""
    transform = np.zeros((mixing.shape[0] + 1, mixing.shape[1] + 1))
    transform[:-1, :-1], transform[-1, -1] = mixing, 1.0
    return transformed(moments, transform, tuple(f"x{k}" for k in range(mixing.shape[1])))
