"""Which further columns of friction the data ask for, decided on moments that hold all of them.

A candidate is a few columns that act on the torque of one joint (a coupling: of two). It is judged by the torque of
its own joints on stretches of time that were left out of the fit: in each stretch the residual energy with it is held
against that without it, and the logarithms of these ratios say how large the gain is and how sure. Ratios, because the
energy of a recording sits in few stretches, and what helps in these alone is chance as often as friction. The best of
those that pass joins the model; then all are asked again, until none passes. Where there are several recordings, it has
to help in each of them that was left out whole: what takes up the habits of one motion does not help in another.

The columns that are in the model anyway are eliminated once for each fold; after that a candidate costs next to
nothing, and all of them together little more than one fit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array
from casysid.estimation import Ridge
from casysid.estimation.cross_validation import contiguous_folds
from casysid.identification.friction_trial import HeldOutErrors
from casysid.moments import Moments

Indices = npt.NDArray[np.intp]

PARTITIONS = (5, 10)
"""Numbers of contiguous stretches; a candidate has to hold in every partition."""
FEWEST_STRETCHES = 4
"""Fewer than these say nothing of how sure a gain is."""
SMALLEST_GAIN = 0.10
"""Share of the joints' residual energy that has to go, for one column and for each further one half as much again."""
STANDARD_ERRORS = 2.5
"""The mean logarithm of the gain exceeds so many of its standard errors."""
FAMILIAR = 2.0
"""So many are enough for a kind of friction that another joint has: the drives of a robot are built alike."""
SURE_ENOUGH = 0.02
"""Standard error of the mean logarithm that is believed at least: a few stretches may agree by chance."""
MOST_ROUNDS = 30


@dataclass(frozen=True, eq=False)
class Candidate:
    """Columns that may join the model together.

    Attributes:
        name: For people; of candidates with the same name at most one joins.
        columns: Where they are in the moments.
        joints: Rows on which they act.
        family: What other joints probably have if one has it; empty for what is each joint's own matter.
    """

    name: str
    columns: tuple[int, ...]
    joints: tuple[int, ...]
    family: str = ""


@dataclass(frozen=True, eq=False)
class Finding:
    """A candidate that joined the model.

    Attributes:
        candidate: Which.
        gain: Share of its joints' held-out residual energy that it took away.
        error_before: Held-out torque error of its joints relative to their torque, without it.
        error_after: And with it.
    """

    candidate: Candidate
    gain: float
    error_before: float
    error_after: float


@dataclass(frozen=True, eq=False)
class Evidence:
    """Moments of all columns, ready to be asked about any of them.

    Attributes:
        moments: Of all columns.
        shifted: The same relative to the prior.
        partitions: Ways to cut the blocks into stretches, each a list of block indices.
        recordings: The blocks of each whole recording, where there are several, but too few to be the stretches.
        physics: Rows ``A`` of ``A θ ≥ 0``: what friction cannot be otherwise, shape (r, p).
        prior: ``θ0``, shape (p,).
    """

    moments: Moments
    shifted: Moments
    partitions: Sequence[Sequence[Indices]]
    recordings: Sequence[Indices]
    physics: Array
    prior: Array


def build_evidence(moments: Moments, prior: Array, physics: Array, recordings: int = 1) -> Evidence:
    """Evidence of moments whose blocks belong to so many recordings of equally many blocks each.

    With enough recordings whole ones are left out, else contiguous stretches of time and then whole recordings.
    """
    units, whole = np.arange(moments.blocks)[:, None], []
    if recordings > 1 and moments.blocks % recordings == 0:
        by_recording = units.reshape(recordings, -1)
        if recordings >= FEWEST_STRETCHES:
            units = by_recording
        else:
            whole = list(by_recording)
    partitions = [[units[fold].ravel() for fold in contiguous_folds(len(units), folds)] for folds in PARTITIONS]
    return Evidence(moments, moments.shifted(prior), partitions, whole, physics, prior)


def choose_candidates(evidence: Evidence, base: Sequence[int], candidates: Sequence[Candidate]) -> tuple[Finding, ...]:
    """The candidates that join the columns ``base``, in the order in which they did.

    Nothing joins where there are too few stretches of time to judge by.
    """
    if min(len(folds) for folds in evidence.partitions) < FEWEST_STRETCHES:
        return ()
    chosen: list[Finding] = []
    for _ in range(MOST_ROUNDS):
        taken = {finding.candidate.name for finding in chosen}
        left = [candidate for candidate in candidates if candidate.name not in taken]
        found = _best(evidence, _with(base, chosen), left, _families(chosen))
        if found is None:
            break
        chosen.append(found)
    return tuple(_confirmed(evidence, base, chosen))


def _confirmed(evidence: Evidence, base: Sequence[int], chosen: list[Finding]) -> list[Finding]:
    """Those that would be chosen last too, beside all others: an early one may have stood for a later one."""
    for finding in list(chosen):
        others = [one for one in chosen if one is not finding]
        if others and _best(evidence, _with(base, others), [finding.candidate], _families(others)) is None:
            chosen = others
    return chosen


def _with(base: Sequence[int], chosen: Sequence[Finding]) -> Indices:
    columns = [column for finding in chosen for column in finding.candidate.columns]
    return np.array([*base, *columns], dtype=np.intp)


def _families(chosen: Sequence[Finding]) -> frozenset[str]:
    return frozenset(finding.candidate.family for finding in chosen) - {""}


def _best(
    evidence: Evidence, base: Indices, candidates: Sequence[Candidate], familiar: frozenset[str]
) -> Finding | None:
    """The candidate of largest gain among those that pass every test; None when none does."""
    model = evidence.moments.select_columns(base)
    fit = Ridge(standard_errors=False).estimate(model, evidence.prior[base])
    weights = fit.noise_std**-2.0
    pull = fit.metric - model.pooled(weights).xx
    strength = fit.diagnostics.get("strength", 0.0)
    errors, by_recording = (
        [HeldOutErrors(evidence.shifted, base, weights, pull, strength, stretches) for stretches in several]
        for several in (evidence.partitions, [evidence.recordings] if evidence.recordings else [])
    )
    gains = [
        min(_sure_gain(one, candidate, FAMILIAR if candidate.family in familiar else STANDARD_ERRORS) for one in errors)
        for candidate in candidates
    ]
    for k in np.argsort(gains)[::-1]:
        if not gains[k] > 0.0:
            break
        candidate = candidates[int(k)]
        if (
            all(_harms_no_other(one, candidate) for one in errors)
            and all(_helps_everywhere(one, candidate) for one in by_recording)
            and _is_physical(errors[0], candidate, evidence)
        ):
            return _finding(errors[0], candidate)
    return None


def _sure_gain(errors: HeldOutErrors, candidate: Candidate, standard_errors: float) -> float:
    """Mean logarithm of the gain over stretches, less what its columns cost; zero where it is too small or unsure."""
    before, after = errors.energies(candidate.columns, candidate.joints)
    felt, more = before > 0.0, len(candidate.columns) - 1
    if felt.sum() < FEWEST_STRETCHES:
        return 0.0
    logarithms = np.log(before[felt] / after[felt])
    mean = float(logarithms.mean())
    error = max(float(logarithms.std(ddof=1)) / np.sqrt(len(logarithms)), SURE_ENOUGH)
    wanted = SMALLEST_GAIN * (1.0 + 0.5 * more)
    if mean < standard_errors * error or after.sum() > (1.0 - wanted) * before.sum():
        return 0.0
    return mean - 0.5 * SMALLEST_GAIN * more


def _helps_everywhere(errors: HeldOutErrors, candidate: Candidate) -> bool:
    """Whether the torque of its own joints is predicted better in every stretch."""
    before, after = errors.energies(candidate.columns, candidate.joints)
    return bool((after <= before).all())


def _harms_no_other(errors: HeldOutErrors, candidate: Candidate) -> bool:
    """Whether the torque of all joints is predicted no worse, joints weighted by their noise and in N m."""
    before, after = errors.all_energies(()), errors.all_energies(candidate.columns)
    return bool((after @ errors.weights).sum() <= (before @ errors.weights).sum() and after.sum() <= before.sum())


def _is_physical(errors: HeldOutErrors, candidate: Candidate, evidence: Evidence) -> bool:
    """Whether the fit to all data keeps the candidate's laws, and any other law that the fit without it keeps."""
    before, after = (evidence.prior + errors.fit(columns) for columns in ((), candidate.columns))
    rows = evidence.physics
    own = (rows[:, list(candidate.columns)] != 0.0).any(axis=1)
    return bool(np.all((rows @ after >= 0.0) | ((rows @ before < 0.0) & ~own)))


def _finding(errors: HeldOutErrors, candidate: Candidate) -> Finding:
    before, after = (energy.sum() for energy in errors.energies(candidate.columns, candidate.joints))
    joints = list(candidate.joints)
    target = float((errors.target[:, joints] @ errors.weights[joints]).sum())
    return Finding(
        candidate, float(1.0 - after / before), float(np.sqrt(before / target)), float(np.sqrt(after / target))
    )
