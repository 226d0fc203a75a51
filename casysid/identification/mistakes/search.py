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
from casysid.identification.mistakes.gravity import (
    CLEAR_ABSENCE,
    CLEAR_TURN,
    GravityChoice,
    GravityFit,
    angle_between,
)
from casysid.identification.mistakes.kinds import Column, Mistake, MistakeKind
from casysid.identification.mistakes.order import Assignment, reordered
from casysid.identification.mistakes.orders import OrderJudge
from casysid.identification.mistakes.samples import Samples, pick_samples
from casysid.robot import Joint, JointKind, Robot
from casysid.signals import Motion
from casysid.threads import single_threaded

CLEAR = 1.2
"""A mistake lowers the sum over joints of the logarithms of the residual energies by at least this: in one joint to
three tenths. The eight real robots' logs, read otherwise, reach 0.7."""
STEADY = 4.0
"""And in the mean over blocks of time by so many standard errors."""
USUAL_STRAIN = 1.0
"""Mean square deviation of bodies from the file's, in standard deviations of files: more speaks for a reading with
less, as of a zero elsewhere, which no torque tells from a centre of mass elsewhere."""
DIGITS = 3
"""Of evidence [nats]: a zero of the first joint elsewhere and a base turned about it are the same."""
MOST_JUDGED = 6
"""Readings with one mistake that bodies are fitted to."""
USUAL_SCALE = 8.0
"""Between a file's masses and the truth lies no larger factor; beyond it the unit of torque is doubted."""
USUAL_TOTAL, ALIKE = 4.0, 0.9
"""Factor between all torques and the file's likewise, which masses that are off one by one do not make together; and
the cosine between them where they are alike."""
MOST = 4
"""Mistakes that are told of one log: who has made more reads the log anew after mending these."""
MOVED_COLUMNS = 0.5
"""What every column that moves beyond two must lower the logarithms by, so that none moves for nothing."""
EXPLAINED, EXPLAINED_SO, PLAUSIBLE = 0.01, 0.1, 0.5
"""Share of the torque's energy that no joint leaves more of, as logged or in another reading, and mean square deviation
of bodies from the file's in its usual errors, where no order of columns is doubted."""
MOST_DOFS = 30
"""Of a robot whose log is judged: bodies are fitted to each reading, whose cost grows with the cube of their number."""
MOST_ORDERED = 12
"""Joints whose orders are searched: the neighbours of an order, each a prediction, grow with the square and more."""
CONVINCING = 0.7
"""Share of the variance of the torques concerned that bodies must explain in another reading."""
DEGREE = np.pi / 180.0
"""[rad]."""
MOVING = (JointKind.REVOLUTE, JointKind.CONTINUOUS, JointKind.PRISMATIC)


@single_threaded()
def find_mistakes(robot: Robot, motions: Sequence[Motion], cutoff: float | None) -> tuple[Mistake, ...]:
    """Mistakes that the model file's own prediction shows in motions; none when nothing is clear.

    Joints of several degrees of freedom, and robots of very many, are taken as logged. A change that no torque tells,
    as another zero of a joint with a vertical axis at the base, cannot be found.
    """
    if robot.nv > MOST_DOFS or not any(joint.kind in MOVING for joint in robot.joints):
        return ()
    search = _Search(robot, motions, cutoff)
    found: list[Mistake] = []
    while len(found) < MOST and (mistake := search.next_mistake()) is not None:
        found.append(mistake)
    whole = search.wrong_scale_of_all()
    return (*found, *(search.wrong_scales() if whole is None else (whole,)))


@single_threaded()
def find_gravity(robot: Robot, motions: Sequence[Motion], cutoff: float | None) -> Mistake | None:
    """The gravity that motions and their torques ask for, if it clearly is not the file's."""
    return next((mistake for mistake in find_mistakes(robot, motions, cutoff) if mistake.gravity), None)


@dataclasses.dataclass(frozen=True, eq=False)
class _Reading:
    """The log read as if a mistake had been made.

    Attributes:
        mistake: What was mistaken.
        samples: So read.
        gravity: So read; None is the file's.
        bodies: That explain the samples in this gravity.
        cost: By which readings are compared: the bodies', and a price.
    """

    mistake: Mistake
    samples: Samples
    gravity: Array | None
    bodies: GravityChoice
    cost: float


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
        fit = GravityFit(self._robot, self._samples, self._gravity)
        turned = fit.found() if self._gravity is None else None
        readings = [*self._turned(fit.file, turned), *self._single(fit.file)]
        explained = _is_near(fit.file, EXPLAINED) or any(_is_near(one.bodies, EXPLAINED_SO) for one in readings)
        if not explained and 1 < len(self._joints) <= MOST_ORDERED:
            readings += self._permuted(fit.file)
        readings = [one for one in readings if self._is_convincing(one)]
        if not readings:
            return None
        best, *others = sorted(readings, key=lambda one: round(one.cost, DIGITS))
        alternatives = tuple(one.mistake.words for one in others[:3] if one.cost < best.cost + CLEAR_ABSENCE)
        joints = [self._places[name][1] for name in best.mistake.joints]
        before, after = (1.0 - float(np.mean(one.unexplained[joints])) for one in (fit.file, best.bodies))
        gain = fit.file.cost - best.bodies.cost
        self._samples, self._gravity = best.samples, best.gravity
        self._now = self._witness.explain(self._samples, self._gravity)
        return dataclasses.replace(best.mistake, gain=gain, explained=(before, after), alternatives=alternatives)

    def wrong_scale_of_all(self) -> Mistake | None:
        """All torques many times larger or smaller than the file's, though alike: by what they hold at rest as well."""
        predicted, tau = self._witness.predict(self._samples, self._gravity), self._samples.tau
        largest = int(np.argmax(np.sum(tau * predicted, axis=0)))
        several = [np.arange(self._robot.nv) != largest, np.ones(self._robot.nv, dtype=bool)]
        for kept in several:  # one joint alone may be in other units
            shared, size, own = (
                float(np.sum(x[:, kept] * y[:, kept]))
                for x, y in ((tau, predicted), (predicted, predicted), (tau, tau))
            )
            factor = shared / max(size, 1e-300)
            if shared <= ALIKE * np.sqrt(size * own) or 1.0 / USUAL_TOTAL <= factor <= USUAL_TOTAL:
                return None
        explained = shared**2 / (size * own)
        gain = 0.5 * self._samples.independent * abs(float(np.log(factor)))
        kind, joints = MistakeKind.ALL_SCALED, tuple(self._places)
        return Mistake(kind=kind, joints=joints, amount=factor, gain=gain, explained=(explained, explained))

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

    def _single(self, now: GravityChoice) -> Iterator[_Reading]:
        """The samples without one mistake, where both the file's own prediction and bodies clearly want it."""
        clear = []
        for mistake, read in self._promising():
            gain, steadiness = gain_of(self._now, self._explain(read))
            if gain > CLEAR and steadiness > STEADY:
                clear.append((gain, mistake, read))
        for _, mistake, read in sorted(clear, key=lambda one: -one[0])[:MOST_JUDGED]:
            bodies = GravityFit(self._robot, read, self._gravity).file
            likelier = bodies.cost < now.cost and bodies.strain <= USUAL_STRAIN < now.strain
            if likelier or bodies.cost < now.cost - CLEAR_ABSENCE:
                yield _Reading(mistake, read, self._gravity, bodies, bodies.cost)

    def _turned(self, now: GravityChoice, choice: GravityChoice | None) -> Iterator[_Reading]:
        """The samples in another gravity, where it brings bodies nearer to the file's, and its prediction to the log.

        Of one along no axis more is asked than of other readings.
        """
        if choice is None or choice.strain > now.strain or float(np.mean(choice.unexplained)) > EXPLAINED_SO:
            return
        gain, steadiness = gain_of(self._now, self._witness.explain(self._samples, choice.gravity))
        if gain <= 0.0 or steadiness <= STEADY:
            return
        file, gravity = self._robot.gravity, choice.gravity
        mistake = Mistake(
            kind=MistakeKind.GRAVITY_TURNED if gravity.any() else MistakeKind.GRAVITY_ABSENT,
            joints=tuple(self._places),
            amount=angle_between(gravity, file) if gravity.any() and file.any() else 0.0,
            gravity=tuple(gravity.tolist()),
        )
        price = CLEAR_ABSENCE if np.count_nonzero(gravity) > 1 else 0.0
        yield _Reading(mistake, self._samples, gravity, choice, choice.cost + price)

    def _is_convincing(self, reading: _Reading) -> bool:
        """Whether bodies explain the joints concerned, so read."""
        joints = [self._places[name][1] for name in reading.mistake.joints]
        return 1.0 - float(np.mean(reading.bodies.unexplained[joints])) > CONVINCING

    def _permuted(self, now: GravityChoice) -> Iterator[_Reading]:
        """Readings of other orders that bodies and the file's own prediction clearly prefer to signs in this one."""
        judge = OrderJudge(
            self._robot,
            self._joints,
            self._samples,
            self._gravity,
            lambda few: self._witness.predict(few, self._gravity),
        )
        as_logged = judge.as_logged()
        limit = min(now.cost, judge.fit(as_logged).cost) - CLEAR_TURN
        signs, _ = gain_of(self._now, self._explain(reordered(self._samples, self._joints, as_logged)))
        kinds = (MistakeKind.TORQUES_PERMUTED, MistakeKind.POSITIONS_PERMUTED, MistakeKind.JOINTS_PERMUTED)
        for kind, assignments in zip(kinds, judge.best(), strict=True):
            for assignment in assignments:
                names, order = _changes(self._joints, assignment)
                samples, bodies = reordered(self._samples, self._joints, assignment), judge.fit(assignment)
                gain, steadiness = gain_of(self._now, self._explain(samples))
                price = max(signs, 0.0) + MOVED_COLUMNS * (len(names) - 2)
                if bodies.cost < limit and gain > CLEAR + price and steadiness > STEADY:
                    mistake = Mistake(kind=kind, joints=names, order=order)
                    yield _Reading(mistake, samples, self._gravity, bodies, bodies.cost)

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


def _is_near(bodies: GravityChoice, unexplained: float) -> bool:
    """Whether bodies near the file's leave so little of every joint's torque that no order is doubted."""
    return bodies.strain <= PLAUSIBLE and bool((bodies.unexplained <= unexplained).all())


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
