"""What random experiments are drawn with."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeVar

import numpy as np

Choice = TypeVar("Choice")


def log_uniform(rng: np.random.Generator, low: float, high: float, size: int | None = None) -> np.ndarray | float:
    """Between two positive numbers, every factor alike."""
    drawn = np.exp(rng.uniform(np.log(low), np.log(high), size))
    return float(drawn) if size is None else drawn


def pick(rng: np.random.Generator, weights: Mapping[Choice, float]) -> Choice:
    """One of the keys, with probabilities in proportion to the weights."""
    share = np.array(list(weights.values()), dtype=np.float64)
    return list(weights)[int(rng.choice(len(share), p=share / share.sum()))]


def chance(rng: np.random.Generator, probability: float) -> bool:
    """True with this probability."""
    return bool(rng.random() < probability)


def some(rng: np.random.Generator, count: int, probability: float) -> np.ndarray:
    """Which of ``count``, each with this probability, at least one, shape (count,)."""
    chosen = rng.random(count) < probability
    chosen[rng.integers(count)] |= not chosen.any()
    return chosen
