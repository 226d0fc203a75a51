"""Kinds of friction and transmission chosen by the data: the evidence nominates, stretches of time left out confirm.

All candidates stand side by side in one set of moments. Given the fit of the usual model, the evidence for each is a
small quadratic form. The candidate of most evidence is tried: it stays if it makes the error of its joints clearly
smaller, in every one of five contiguous stretches of time, if the weighted error of all joints falls, and if its
coefficients obey the laws of friction. Otherwise it is out until another one has come in.
"""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from casysid.arrays import Array
from casysid.dynamics import Parameter, Regressor
from casysid.errors import CasysidWarning
from casysid.estimation import EmpiricalBayes, Estimate
from casysid.estimation.cross_validation import contiguous_folds
from casysid.estimation.empirical_bayes import INFLATION
from casysid.estimation.evidence import centre_of
from casysid.identification.friction_candidates import Proposal, joined
from casysid.identification.friction_laws import physics_rows
from casysid.identification.settings import Settings
from casysid.identification.tuning.candidates import Candidates
from casysid.identification.tuning.held_out import FOLDS, HeldOut
from casysid.identification.tuning.log_score import HeldOutScore
from casysid.inertia import Consistency
from casysid.moments import Indices
from casysid.projection import LinearKnowledge, PossibleParameters, build_projection

MOST = 30
"""Kinds that may join: more than any robot's drives have."""
CLEARLY_BETTER = 1.0 / 3.0
"""Fall of the energy of its joints' errors on time left out for which a kind joins: of a hundred candidates one gains
something on any motion, and a spring or a ripple that is not there costs the next motion more than it gained here."""
CLEARLY_BROKEN = 2.0
"""Standard errors by which a law of other columns must be missed to keep a candidate out: the fit to come holds it."""
ROUNDS, MORE_ROUNDS = 12, 4
"""Of the first fit on the way, past the cautious ones and two inflations of the scores, and of those that go on from
the one before; the last fit takes what it needs."""
AT_ZERO = 1e-7
"""A coefficient below this share of the largest is zero to the convex solver."""

Columns = tuple[int, ...]


@dataclass(frozen=True)
class ChosenFriction:
    """One kind of friction that joined, or one coupling.

    Attributes:
        joints: On which it acts.
        kind: Of friction; ``coupling`` for a transmission.
        words: What a person calls it, with its numbers.
        error_before: Error of its joints on time left out, relative to their torque, without it.
        error_after: And with it.
        evidence: Gain of the logarithm of the evidence when it joined.
    """

    joints: tuple[str, ...]
    kind: str
    words: str
    error_before: float
    error_after: float
    evidence: float = 0.0

    @property
    def sentence(self) -> str:
        """Such as ``joint_2: Stribeck (v_s = 0.1 rad/s): held-out error 12.0 % → 9.0 %``."""
        change = f"{100.0 * self.error_before:.3g} % → {100.0 * self.error_after:.3g} %"
        return f"{' and '.join(self.joints)}: {self.words}: held-out error {change}"

    def to_json(self) -> dict[str, object]:
        """Plain numbers, lists and words."""
        return {**dataclasses.asdict(self), "joints": list(self.joints)}


@dataclass(frozen=True)
class FrictionChoice:
    """What the data added to the friction that was given.

    Attributes:
        settings: Those given, with the kinds and couplings that were chosen.
        chosen: What joined, in the order in which it did.
        asked: How many candidates there were.
        taken: The same as proposals, with their columns among all candidates'.
    """

    settings: Settings
    chosen: tuple[ChosenFriction, ...] = ()
    asked: int = field(default=0)
    taken: tuple[tuple[Proposal, Columns], ...] = field(default=(), repr=False)


def select_friction(candidates: Candidates, settings: Settings, usual: Estimate | None = None) -> FrictionChoice:
    """The candidates that join the usual model.

    Args:
        candidates: From one pass over the data.
        settings: Whose friction they join.
        usual: The fit of the usual model, if there is one already.
    """
    search = _Search(candidates, settings, usual)
    while len(search.taken) < MOST and search.add_some():
        pass
    model = joined(candidates.base.friction, settings.couplings, [proposal for proposal, _ in search.taken])
    return FrictionChoice(
        dataclasses.replace(settings, friction=model.columns, couplings=model.couplings, choose_friction=False),
        tuple(search.chosen),
        len(candidates.proposals),
        tuple(search.taken),
    )


class _Search:
    """The model so far, and what is asked of it."""

    def __init__(self, candidates: Candidates, settings: Settings, usual: Estimate | None) -> None:
        self._candidates, self._settings = candidates, settings
        self.taken: list[tuple[Proposal, Columns]] = []
        self.chosen: list[ChosenFriction] = []
        self._laws = physics_rows(candidates.regressor)
        moments = candidates.moments
        self._centre = centre_of(moments, candidates.regressor.prior)
        self._shifted = moments.shifted(self._centre)
        self._folds = contiguous_folds(moments.blocks, FOLDS)
        self._fit = usual

    def add_some(self) -> bool:
        """Let the best candidates that pass join, at most one a joint before the next fit; False when none does."""
        names = {proposal.name for proposal, _ in self.taken}
        left = [one for one in self._candidates.proposals if one[0].name not in names]
        if not left or len(self._folds) < 2:
            return False
        held_out = self._held_out()
        gains = np.array([held_out.gain(columns, self._noise) for _, columns in left])
        new, joints = Columns(), set[int]()
        without = held_out.score()
        for place in np.argsort(-gains, kind="stable").tolist():
            if gains[place] <= np.log(len(self._candidates.proposals)):
                break
            proposal, columns = left[place]
            if joints & set(proposal.joints):
                continue
            score = held_out.score((*new, *columns))
            if self._is_better(proposal, without, score) and self._is_lawful(held_out, new, columns):
                self.taken.append((proposal, columns))
                self.chosen.append(self._described(proposal, without, score, float(gains[place])))
                new, without = (*new, *columns), score
                joints |= set(proposal.joints)
        return bool(new)

    def _held_out(self) -> HeldOut:
        """Errors beside the fit of the model so far, coefficients that a law holds at zero left out."""
        model = self._candidates.model([columns for _, columns in self.taken])
        parameters = [self._candidates.parameters[column] for column in model]
        estimate = self._fit = fit_model(self._candidates, model, self._settings, self._fit)
        free = model[~at_zero(parameters, estimate.parameters)]
        kept = np.isin(model, free)
        weights = estimate.noise_std**-2.0
        pull = estimate.metric - self._candidates.moments.select_columns(model).pooled(weights).xx
        self._weights, self._noise = weights, estimate.diagnostics[INFLATION]
        return HeldOut(self._shifted, free, weights, pull[np.ix_(kept, kept)], self._folds)

    def _rows(self, proposal: Proposal) -> list[int]:
        """Rows on which a proposal acts."""
        own = {self._candidates.base.robot.dofs[joint] for joint in proposal.joints}
        moments = self._candidates.moments
        return [k for k, place in enumerate(moments.moving_rows.tolist()) if moments.joints[place] in own]

    def _is_better(self, proposal: Proposal, without: HeldOutScore, score: HeldOutScore) -> bool:
        rows = self._rows(proposal)
        before, after = (one.energy[:, rows] @ self._weights[rows] for one in (without, score))
        clear = after.sum() <= (1.0 - CLEARLY_BETTER) * before.sum()
        no_worse = (score.energy @ self._weights).sum() < (without.energy @ self._weights).sum()
        return bool((after < before).all() and clear and no_worse)

    def _is_lawful(self, held_out: HeldOut, joined: Columns, columns: Columns) -> bool:
        """Whether the fit to all data keeps the candidate's laws, and hardly breaks any that the fit without it keeps.

        Coefficients of friction that is not there are zero but for their noise, and change sign with any candidate.
        """
        both = (*joined, *columns)
        before, after = (self._laws @ (self._centre + held_out.fit(own)) for own in (joined, both))
        C = held_out.covariance(both, self._noise)
        error = np.sqrt(np.maximum(np.einsum("rm,mn,rn->r", self._laws, C, self._laws, optimize=True), 0.0))
        own = (self._laws[:, list(columns)] != 0.0).any(axis=1)
        kept = (after >= 0.0) | (~own & ((before < 0.0) | (after >= -CLEARLY_BROKEN * error)))
        return bool(kept.all())

    def _described(
        self, proposal: Proposal, without: HeldOutScore, score: HeldOutScore, evidence: float
    ) -> ChosenFriction:
        rows = self._rows(proposal)
        logged = self._candidates.moments.target_energy().sum(axis=0)[rows]
        target = max(float(logged @ self._weights[rows]), np.finfo(np.float64).tiny)
        before, after = (
            float(np.sqrt((one.energy[:, rows] @ self._weights[rows]).sum() / target)) for one in (without, score)
        )
        joints = tuple(self._candidates.base.robot.dofs[joint] for joint in proposal.joints)
        return ChosenFriction(joints, proposal.kind, proposal.description, before, after, evidence)


def fit_model(candidates: Candidates, model: Indices, settings: Settings, like: Estimate | None = None) -> Estimate:
    """The fit of some of the candidates' columns, possible parameters only, going on from that of fewer."""
    parameters = [candidates.parameters[column] for column in model]
    prior = np.array([parameter.prior for parameter in parameters])
    problem = build_projection(
        parameters,
        consistency=settings.consistency or Consistency.FULL,
        knowledge=(*settings.knowledge, *_laws_of(candidates.regressor, parameters)),
    )
    moments = candidates.moments.select_columns(model)
    method = EmpiricalBayes(standard_errors=False, iterations=MORE_ROUNDS if like else ROUNDS, like=like)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", CasysidWarning)  # of an inconsistent model file: the answer's projection warns
        return method.estimate_among(moments, prior, PossibleParameters(problem, prior))


def at_zero(parameters: Sequence[Parameter], values: Array) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Which drive parameters a law would hold at zero, because the unconstrained fit has them there or below."""
    largest = max((abs(v) for p, v in zip(parameters, values, strict=True) if p.non_negative), default=0.0)
    return np.array(
        [p.non_negative and p.kind != "m" and v <= AT_ZERO * largest for p, v in zip(parameters, values, strict=True)]
    )


def _laws_of(regressor: Regressor, parameters: Sequence[Parameter]) -> tuple[LinearKnowledge, ...]:
    """Laws of friction about some of the parameters only."""
    names = {parameter.name for parameter in parameters}
    return tuple(
        LinearKnowledge(coefficients=dict(law.coefficients), lower=0.0, name=law.name)
        for law in regressor.friction_laws
        if set(law.coefficients) <= names
    )
