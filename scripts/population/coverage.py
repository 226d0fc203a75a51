"""How often intervals of ± 1.96 standard errors hold the truth, in one answer."""

from __future__ import annotations

from collections import Counter

import numpy as np

from population.candidate import Answer
from population.experiments import Experiment

HALF_WIDTH = 1.96
SAMPLES = 400
"""Instants of the fresh motion at which torques are looked at."""
ROUNDING = 1e-9
"""Weights below this share of a combination's largest are rounding."""
SEEN = 1e-9
"""Standard errors below this share of the parameters' size are of combinations that the data do not show."""


def intervals(experiment: Experiment, answer: Answer) -> dict[str, list[float]]:
    """Truths within their intervals: counts ``[inside, all]`` by kind, of torques ``[share, 1]``.

    Base parameters that hold a friction parameter without a true value, or are not shown by the data, are left out.
    """
    truth = true_parameters(experiment, answer)
    known = np.isfinite(truth)
    base = answer.base
    told = ~(np.abs(base[:, ~known]) > ROUNDING * np.abs(base).max(axis=1, keepdims=True)).any(axis=1)
    std = np.sqrt(np.maximum(np.einsum("rp,pq,rq->r", base, answer.covariance, base), 0.0))
    told &= std > SEEN * (np.abs(base) @ np.abs(answer.parameters))
    off = np.abs(base @ np.where(known, answer.parameters - truth, 0.0))
    masses = [k for k, (_, kind) in enumerate(answer.names) if kind == "m" and np.isfinite(answer.std[k])]
    inside = np.abs(answer.parameters - truth)[masses] <= HALF_WIDTH * answer.std[masses]
    rows = np.linspace(0, len(experiment.fresh.q) - 1, SAMPLES).astype(int)
    state = [part[rows] for part in experiment.fresh]
    missed = np.abs(answer.torque(*experiment.fresh) - experiment.fresh_torque)[rows]
    moving = ~experiment.family.at_rest
    within = missed[:, moving] <= HALF_WIDTH * answer.torque_std(*state)[:, moving]
    return {
        "base": [float((off <= HALF_WIDTH * std)[told].sum()), float(told.sum())],
        "mass": [float(inside.sum()), float(len(masses))],
        "torque": [float(within.mean()), 1.0],
    }


def true_parameters(experiment: Experiment, answer: Answer) -> np.ndarray:
    """True values of the answer's parameters, shape (p,); NaN where the truth has none of that kind to compare with."""
    dofs = experiment.mechanism.robot.dofs
    links, values = len(experiment.mechanism.robot.links), np.full(len(answer.names), np.nan)
    values[: 10 * links] = experiment.truth.parameters
    simple: Counter[tuple[str, str]] = Counter()
    for term in experiment.truth.terms:
        if len(term.joints) == 1:
            simple[dofs[term.joints[0]], term.kind] += term.coefficient
    for k, (owner, kind) in enumerate(answer.names[10 * links :], start=10 * links):
        slips = simple[owner, "hysteresis"] if kind == "coulomb" else 0.0
        if owner in dofs and kind in ("viscous", "coulomb", "offset", "armature", "viscous_asymmetry"):
            values[k] = simple[owner, kind] + slips
    return values
