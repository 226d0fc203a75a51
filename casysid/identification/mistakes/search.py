"""Signs, units and orders of a log's columns, and gravity, that contradict the model file: found, named, never changed.

The log is read as if one mistake had been made: a torque or a position negated, columns permuted, a zero elsewhere,
degrees, the base turned or gravity taken out. A mistake is named when the log so read is explained far better, in all
joints together and steadily over time; a file that explains nothing either way accuses nobody. Once found, a mistake is
corrected in memory, and the search goes on for a second one.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence

import numpy as np

from casysid.arrays import Array
from casysid.identification.mistakes.explanation import RESOLUTION, Explanation, Witness, gain_of, share_explained
from casysid.identification.mistakes.gravity import CLEAR_ABSENCE, GravityChoice, GravityFit, angle_between
from casysid.identification.mistakes.kinds import Column, Mistake, MistakeKind
from casysid.identification.mistakes.order import Assignment, OrderSearch, reordered
from casysid.identification.mistakes.samples import Samples, pick_samples
from casysid.robot import Joint, JointKind, Robot
from casysid.signals import Motion
from casysid.threads import single_threaded

CLEAR = 1.2
"""A mistake lowers the sum over joints of the logarithms of the residual energies by at least this: in one joint to
three tenths. The eight real robots' logs, read otherwise, reach 0.7."""
STEADY = 4.0
"""And in the mean over blocks of time by so many standard errors."""
NEARLY = 0.9
"""Readings that reach this share of the best one's gain are named beside it."""
USUAL_SCALE = 8.0
"""Between a file's masses and the truth lies no larger factor; beyond it the unit of torque is doubted."""
MOST = 4
"""Mistakes that are told of one log: who has made more reads the log anew after mending these."""
MOVED_COLUMNS = 0.5
"""What every column that moves beyond two must lower the logarithms by, so that none moves for nothing."""
EXPLAINED, PLAUSIBLE = 0.1, 0.5
"""Share of the torque's energy that no joint leaves more of, and mean square deviation of bodies from the file's in
its usual errors, where no order of columns is doubted."""
MOST_ORDERED = 12
"""Joints whose orders are searched: the neighbours of an order, each a prediction, grow with the square and more."""
CONVINCING = 0.7
"""Share of the variance of the torques concerned that another order or gravity must explain."""
DEGREE = np.pi / 180.0
"""[rad]."""
MOVING = (JointKind.REVOLUTE, JointKind.CONTINUOUS, JointKind.PRISMATIC)


@single_threaded()
def find_mistakes(robot: Robot, motions: Sequence[Motion], cutoff: float | None) -> tuple[Mistake, ...]:
    """Mistakes that the model file's own prediction shows in motions; none when nothing is clear.

    Joints of several degrees of freedom are taken as logged. A change that no torque tells, as another zero of a joint
    with a vertical axis at the base, cannot be found.
    """
    search = _Search(robot, motions, cutoff)
    found: list[Mistake] = []
    while len(found) < MOST and (mistake := search.next_mistake()) is not None:
        found.append(mistake)
    return (*found, *search.wrong_scales())


@single_threaded()
def find_gravity(robot: Robot, motions: Sequence[Motion], cutoff: float | None) -> Mistake | None:
    """The gravity that motions and their torques ask for, if it clearly is not the file's."""
    return next((mistake for mistake in find_mistakes(robot, motions, cutoff) if mistake.gravity), None)


@dataclasses.dataclass(frozen=True, eq=False)
class _Reading:
    """The log read as if a mistake had been made; ``gravity`` None is the file's."""

    mistake: Mistake
    samples: Samples
    gravity: Array | None
    explanation: Explanation
    gain: float


class _Search:
    """Samples as read so far, and how well the file explains them."""

    def __init__(self, robot: Robot, motions: Sequence[Motion], cutoff: float | None) -> None:
        self._robot = robot
        self._joints = tuple(joint for joint in robot.joints if joint.kind in MOVING)
        self._places = {joint.name: (joint.channels.start, joint.v.start) for joint in self._joints}
        self._angles = [joint.name for joint in self._joints if joint.kind is not JointKind.PRISMATIC]
        self._samples = pick_samples(robot, motions, cutoff)
        self._gravity: Array | None = None
        self._witness = Witness(robot, self._samples)
        self._now = self._witness.explain(self._samples)

    def next_mistake(self) -> Mistake | None:
        """The clearest mistake, corrected in the samples from now on; None when there is no clear one."""
        judged = [reading for one in self._promising() if (reading := self._read_so(*one)) is not None]
        fit = GravityFit(self._robot, self._samples) if self._gravity is None else None
        if fit is not None and self._may_be_permuted(fit.file):
            judged += self._permuted()
        judged.sort(key=lambda one: -one.gain)
        turned = None if fit is None else self._turned(fit)
        if turned is not None and not (judged and self._is_better(judged[0], turned[1])):
            judged.insert(0, turned[0])
        if not judged:
            return None
        best, *others = judged
        alternatives = tuple(other.mistake.words for other in others[:3] if other.gain > NEARLY * best.gain)
        dofs = [self._places[name][1] for name in best.mistake.joints]
        explained = (
            share_explained(self._now, self._samples, dofs),
            share_explained(best.explanation, best.samples, dofs),
        )
        self._samples, self._now, self._gravity = best.samples, best.explanation, best.gravity
        return dataclasses.replace(best.mistake, gain=best.gain, explained=explained, alternatives=alternatives)

    def wrong_scales(self) -> Iterator[Mistake]:
        """Joints whose torque is far from the file's in size, though alike in shape."""
        ordinary = self._explain(self._samples, most=USUAL_SCALE)
        for name, (_, dof) in self._places.items():
            factor = float(self._now.factor[dof])
            only = np.arange(self._robot.nv) == dof
            known = self._now.factor[dof] > 0.0
            if known and factor > USUAL_SCALE:
                gain, steadiness = gain_of(ordinary, self._now, only)
            elif known and factor < 1.0 / USUAL_SCALE:
                gain, steadiness = gain_of(self._without(dof), self._now, only)
            else:
                continue
            if gain > CLEAR and steadiness > STEADY:
                mistake = Mistake(kind=MistakeKind.SCALE, joints=(name,), amount=factor, gain=gain)
                explained = share_explained(self._now, self._samples, [dof])
                yield dataclasses.replace(mistake, explained=(explained, explained))

    def _explain(self, samples: Samples, most: float | Array = np.inf) -> Explanation:
        return self._witness.explain(samples, self._gravity, most)

    def _without(self, dof: int) -> Explanation:
        """The explanation without the file's prediction of a joint."""
        return self._explain(self._samples, most=np.where(np.arange(self._robot.nv) == dof, 0.0, np.inf))

    def _promising(self) -> Iterator[tuple[Mistake, Samples]]:
        """Single mistakes that may be clear, with the samples read so."""
        mistakes = tuple(self._conceivable())
        readings = [self._corrected(mistake) for mistake in mistakes]
        tau = self._samples.tau
        size = np.maximum(np.sum((tau - tau.mean(axis=0)) ** 2, axis=0), 1e-300)
        left = self._witness.most_explained(readings, self._gravity)
        most = np.sum(np.log(self._now.energy / size + RESOLUTION) - np.log(left + RESOLUTION), axis=1)
        return (one for one, gain in zip(zip(mistakes, readings, strict=True), most, strict=True) if gain > CLEAR / 2.0)

    def _read_so(self, mistake: Mistake, read: Samples, price: float = 0.0) -> _Reading | None:
        """The samples without the mistake, if they are explained clearly better."""
        explanation = self._explain(read)
        gain, steadiness = gain_of(self._now, explanation)
        if gain - price <= CLEAR or steadiness <= STEADY:
            return None
        return _Reading(mistake, read, self._gravity, explanation, gain - price)

    def _turned(self, fit: GravityFit) -> tuple[_Reading, GravityChoice] | None:
        """The samples in another gravity, if bodies near the file's and the file's own are clearly better there."""
        choice = fit.found()
        if choice is None:
            return None
        explanation = self._witness.explain(self._samples, choice.gravity)
        file, gravity = self._robot.gravity, choice.gravity
        mistake = Mistake(
            kind=MistakeKind.GRAVITY_TURNED if gravity.any() else MistakeKind.GRAVITY_ABSENT,
            joints=tuple(self._places),
            amount=angle_between(gravity, file) if gravity.any() and file.any() else 0.0,
            gravity=tuple(gravity.tolist()),
        )
        gain, _ = gain_of(self._now, explanation)
        convincing = share_explained(explanation, self._samples, list(range(self._robot.nv))) > CONVINCING
        reading = _Reading(mistake, self._samples, gravity, explanation, gain)
        clear = gain > (CLEAR if gravity.any() else 0.0)
        return (reading, choice) if clear and convincing else None

    def _is_better(self, reading: _Reading, turned: GravityChoice) -> bool:
        """Whether columns read otherwise leave bodies that clearly explain more than another gravity does."""
        return GravityFit(self._robot, reading.samples).file.cost < turned.cost - CLEAR_ABSENCE

    def _may_be_permuted(self, fit: GravityChoice) -> bool:
        """Whether some joint is not explained by bodies that are anywhere near the file's."""
        near = fit.strain <= PLAUSIBLE and bool((fit.unexplained <= EXPLAINED).all())
        return 1 < len(self._joints) <= MOST_ORDERED and not near

    def _permuted(self) -> Iterator[_Reading]:
        """Readings of other orders of the columns that are clearly better; of alike ones the bodies' choice first."""
        search = OrderSearch(self._joints, self._samples, lambda few: self._witness.predict(few, self._gravity))
        signs, _ = gain_of(self._now, self._explain(reordered(self._samples, self._joints, search.turned())))
        kinds = (MistakeKind.TORQUES_PERMUTED, MistakeKind.POSITIONS_PERMUTED, MistakeKind.JOINTS_PERMUTED)
        for kind, assignments in zip(kinds, search.best(), strict=True):
            readings = [one for assignment in assignments if (one := self._ordered(kind, assignment, max(signs, 0.0)))]
            if len(readings) > 1:
                readings.sort(key=lambda one: GravityFit(self._robot, one.samples).file.cost)
            for reading in readings:
                yield dataclasses.replace(reading, gain=min(reading.gain, readings[0].gain))

    def _ordered(self, kind: MistakeKind, assignment: Assignment, signs: float) -> _Reading | None:
        """The samples in another order, if that is clearly better and explains the joints concerned.

        ``signs`` is what torques of other signs gain in the order as logged: no order has to be changed for that.
        """
        names, order = _changes(self._joints, assignment)
        if assignment.is_as_logged:
            return None
        samples = reordered(self._samples, self._joints, assignment)
        mistake = Mistake(kind=kind, joints=names, order=order)
        reading = self._read_so(mistake, samples, signs + MOVED_COLUMNS * (len(names) - 2))
        dofs = [self._places[name][1] for name in names]
        convincing = reading is not None and share_explained(reading.explanation, samples, dofs) > CONVINCING
        return reading if convincing else None

    def _conceivable(self) -> Iterator[Mistake]:
        for name in self._places:
            for kind in (MistakeKind.TORQUE_NEGATED, MistakeKind.AXIS_NEGATED, MistakeKind.POSITION_NEGATED):
                yield Mistake(kind=kind, joints=(name,))
        if len(self._places) > 1:
            yield Mistake(kind=MistakeKind.ALL_TORQUES_NEGATED, joints=tuple(self._places))
        for name in self._angles:
            for amount in (90.0, -90.0, 180.0):
                yield Mistake(kind=MistakeKind.ZERO_SHIFTED, joints=(name,), amount=amount)
        if self._angles:
            yield Mistake(kind=MistakeKind.DEGREES, joints=tuple(self._angles))

    def _corrected(self, mistake: Mistake) -> Samples:
        """The samples as they would be without the mistake."""
        now = self._samples
        position, v, a, tau = (np.array(x) for x in now.arrays)
        places = [self._places[name] for name in mistake.joints]
        channels, dofs = [channel for channel, _ in places], [dof for _, dof in places]
        kind = mistake.kind
        if kind in (MistakeKind.TORQUE_NEGATED, MistakeKind.AXIS_NEGATED, MistakeKind.ALL_TORQUES_NEGATED):
            tau[:, dofs] *= -1.0
        if kind in (MistakeKind.POSITION_NEGATED, MistakeKind.AXIS_NEGATED):
            position[:, channels] *= -1.0
            v[:, dofs] *= -1.0
            a[:, dofs] *= -1.0
        if kind is MistakeKind.ZERO_SHIFTED:
            position[:, channels] -= mistake.amount * DEGREE
        if kind is MistakeKind.DEGREES:
            for values, columns in ((position, channels), (v, dofs), (a, dofs)):
                values[:, columns] *= DEGREE
        return dataclasses.replace(now, position=position, v=v, a=a, tau=tau)


def _changes(joints: tuple[Joint, ...], assignment: Assignment) -> tuple[tuple[str, ...], tuple[Column, ...]]:
    """Joints whose values are elsewhere or of another sign, and where."""
    names, order = [], []
    for k, joint in enumerate(joints):
        turned = assignment.position_sign[k] < 0.0, assignment.torque_sign[k] < 0.0
        sources = {int(one[k]) for one in (assignment.position, assignment.torque)} - {k}
        if sources or any(turned):
            names.append(joint.name)
            order.append(Column(joints[sources.pop() if sources else k].name, *map(bool, turned)))
    return tuple(names), tuple(order)
