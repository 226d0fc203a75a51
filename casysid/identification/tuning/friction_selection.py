"""Kinds of friction and transmission chosen by the data: the evidence nominates, stretches of time left out confirm.

All candidates stand side by side in one set of moments. Given the fit of the usual model, the evidence for each is a
small quadratic form. The candidate of most evidence is tried: it stays if it makes the error of its joints clearly
and steadily smaller in five contiguous stretches of time, and if the weighted error of all joints falls, its
coefficients obeying the laws of friction. Otherwise it is out until another one has come in.
"""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array
from casysid.dynamics import Parameter, Regressor, SharpCoulomb
from casysid.dynamics.friction import joint_directions
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
from casysid.identification.tuning.log_score import PRACTICAL_GAIN, HeldOutScore
from casysid.inertia import Consistency
from casysid.moments import Indices
from casysid.projection import HalfSpaces, LinearKnowledge, PossibleParameters, build_projection

MOST = 30
"""Kinds that may join: more than any robot's drives have."""
STEADY = 2.0
"""Standard errors over the stretches by which the error must fall: of a hundred candidates one gains a little on any
motion. One instead finds as much, and twice as many springs and counterweights that are not there."""
ROUNDS, MORE_ROUNDS = 12, 4
"""Of the first fit on the way, past the cautious ones and two inflations of the scores, and of those that go on from
the one before; the last fit takes what it needs."""
AT_ZERO = 1e-7
"""A coefficient whose torque is below this share of the largest's is zero to the convex solver."""

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


class ModelFit(NamedTuple):
    """The fit of some columns, and half-spaces that bound what is possible near it."""

    estimate: Estimate
    possible: HalfSpaces


def select_friction(candidates: Candidates, settings: Settings, usual: ModelFit | None = None) -> FrictionChoice:
    """The candidates that join the usual model.

    Args:
        candidates: From one pass over the data.
        settings: Whose friction they join.
        usual: The fit of the usual model, if there is one already.
    """
    search = _Search(candidates, settings, usual)
    while len(search.taken) < MOST and search.add_some():
        pass
    search.confirm_usual()
    model = joined(candidates.base.friction, settings.couplings, [proposal for proposal, _ in search.taken])
    return FrictionChoice(
        dataclasses.replace(settings, friction=model.columns, couplings=model.couplings, choose_friction=False),
        tuple(search.chosen),
        len(candidates.proposals),
        tuple(search.taken),
    )


class _Search:
    """The model so far, and what is asked of it."""

    def __init__(self, candidates: Candidates, settings: Settings, usual: ModelFit | None) -> None:
        self._candidates, self._settings = candidates, settings
        self.taken: list[tuple[Proposal, Columns]] = []
        self.chosen: list[ChosenFriction] = []
        self._laws = physics_rows(candidates.regressor)
        moments = candidates.moments
        self._centre = centre_of(moments, candidates.regressor.prior)
        self._shifted = moments.shifted(self._centre)
        logged = np.maximum(moments.target_energy().sum(axis=0), np.finfo(np.float64).tiny)
        self._energy = np.diag(moments.pooled(1.0 / logged).xx)
        self._folds = contiguous_folds(moments.blocks, FOLDS)
        self._fit = usual
        self._beside: HeldOut | None = None

    def add_some(self) -> bool:
        """Let the best candidates that pass join, at most one a joint before the next fit; False when none does."""
        names = {proposal.name for proposal, _ in self.taken}
        left = [one for one in self._candidates.proposals if one[0].name not in names]
        if not left or len(self._folds) < 2:
            return False
        held_out = self._beside = self._held_out()
        gains = np.array([held_out.gain(columns, self._noise) for _, columns in left])
        new, joints = (), set[int]()
        without = held_out.score()
        for place in np.argsort(-gains, kind="stable").tolist():
            if gains[place] <= np.log(len(self._candidates.proposals)):
                break
            proposal, columns = left[place]
            if joints & set(proposal.joints):
                continue
            rows = self._rows(proposal.joints)
            if not self._is_better(rows, without, held_out.score((*new, *columns))):
                continue
            score = held_out.lawful_score((*new, *columns))
            if self._is_better(rows, without, score):
                self.taken.append((proposal, columns))
                words = proposal.kind, proposal.description
                self.chosen.append(self._described(proposal.joints, words, without, score, float(gains[place])))
                new, without = (*new, *columns), score
                joints |= set(proposal.joints)
        return bool(new)

    def _held_out(self) -> HeldOut:
        """Errors beside the fit of the model so far, coefficients that a law holds at zero left out."""
        model = self._candidates.model([columns for _, columns in self.taken])
        parameters = [self._candidates.parameters[column] for column in model]
        fit = self._fit = fit_model(self._candidates, model, self._settings, self._fit and self._fit.estimate)
        estimate = fit.estimate
        free = model[~at_zero(parameters, estimate.parameters, self._energy[model]) & (self._energy[model] > 0.0)]
        kept = np.isin(model, free)
        weights = estimate.noise_std**-2.0
        pull = estimate.metric - self._candidates.moments.select_columns(model).pooled(weights).xx
        self._weights, self._noise = weights, estimate.diagnostics[INFLATION]
        laws = self._laws_beside(model, fit.possible)
        return HeldOut(self._shifted, free, weights, pull[np.ix_(kept, kept)], self._folds, laws)

    def _laws_beside(self, model: Indices, possible: HalfSpaces) -> HalfSpaces:
        """What bounds the model's columns, with the laws that candidates' columns enter, relative to the centre."""
        rows = np.zeros((len(possible.rows), len(self._centre)))
        rows[:, model] = possible.rows
        others = np.delete(self._laws, model, axis=1).any(axis=1)
        rows = np.vstack([rows, self._laws[others]])
        lower = np.append(possible.lower, np.zeros(int(others.sum())))
        return HalfSpaces(rows, lower - rows @ self._centre)

    def confirm_usual(self) -> None:
        """Name the usual kinds beside those asked for without which a joint's time left out is clearly worse told."""
        if self._beside is None:
            return
        asked, base = {one.kind for one in self._settings.friction}, self._candidates.base
        directions = {direction.name: dof for dof, direction in joint_directions(base.robot).items()}
        whole = self._beside.score()
        for part in base.parts:
            if part.kind.kind in asked or isinstance(part.kind, SharpCoulomb):
                continue
            joints, without = (directions[part.direction.name],), self._beside.lawful_score(without=part.columns)
            if self._is_better(self._rows(joints), without, whole):
                words = part.kind.kind, part.kind.describe(part.direction)
                self.chosen.append(self._described(joints, words, without, whole))

    def _rows(self, joints: Sequence[int]) -> list[int]:
        """Rows of some degrees of freedom."""
        own = {self._candidates.base.robot.dofs[joint] for joint in joints}
        moments = self._candidates.moments
        return [k for k, place in enumerate(moments.moving_rows.tolist()) if moments.joints[place] in own]

    def _is_better(self, rows: list[int], without: HeldOutScore, score: HeldOutScore) -> bool:
        before, after = (one.energy[:, rows] @ self._weights[rows] for one in (without, score))
        clear = after.sum() <= (1.0 - PRACTICAL_GAIN) ** 2 * before.sum()
        no_worse = (score.energy @ self._weights).sum() < (without.energy @ self._weights).sum()
        tiny = np.finfo(np.float64).tiny
        won = np.log(np.maximum(before, tiny) / np.maximum(after, tiny))
        steady = won.mean() > STEADY * won.std(ddof=1) / np.sqrt(len(won))
        return bool(steady and clear and no_worse)

    def _described(
        self,
        joints: Sequence[int],
        words: tuple[str, str],
        without: HeldOutScore,
        score: HeldOutScore,
        evidence: float = 0.0,
    ) -> ChosenFriction:
        rows = self._rows(joints)
        logged = self._candidates.moments.target_energy().sum(axis=0)[rows]
        target = max(float(logged @ self._weights[rows]), np.finfo(np.float64).tiny)
        before, after = (
            float(np.sqrt((one.energy[:, rows] @ self._weights[rows]).sum() / target)) for one in (without, score)
        )
        names = tuple(self._candidates.base.robot.dofs[joint] for joint in joints)
        return ChosenFriction(names, *words, before, after, evidence)


def fit_model(candidates: Candidates, model: Indices, settings: Settings, like: Estimate | None = None) -> ModelFit:
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
        possible = PossibleParameters(problem, prior)
        return ModelFit(method.estimate_among(moments, prior, possible), possible.half_spaces())


def at_zero(parameters: Sequence[Parameter], values: Array, energy: Array) -> npt.NDArray[np.bool_]:
    """Which drive parameters a law holds at zero: what their columns, of some energy, make of torque is rounding."""
    bound = np.array([parameter.non_negative and parameter.kind != "m" for parameter in parameters])
    effect = np.abs(values) * np.sqrt(energy)
    return np.asarray(bound & (effect <= AT_ZERO * effect.max(where=bound, initial=0.0)))


def _laws_of(regressor: Regressor, parameters: Sequence[Parameter]) -> tuple[LinearKnowledge, ...]:
    """Laws of friction about some of the parameters only."""
    names = {parameter.name for parameter in parameters}
    return tuple(
        LinearKnowledge(coefficients=dict(law.coefficients), lower=0.0, name=law.name)
        for law in regressor.friction_laws
        if set(law.coefficients) <= names
    )
