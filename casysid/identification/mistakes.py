"""Signs, units and orders of a log's columns that contradict the model file: found, named, never changed.

Every joint's torque is explained by what the file predicts for it, times a factor that is not negative, with friction,
armature and an offset beside it. That asks little of the file's masses. Then the log is read as if one mistake had been
made: a torque or a position negated, joints exchanged, a zero elsewhere, degrees. A mistake is named when the log so
read is explained far better, in all joints together and steadily over time; a file that explains nothing either way
accuses nobody. Once found, a mistake is corrected in memory, and the search goes on for a second one.
"""

from __future__ import annotations

import dataclasses
import enum
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.optimize import nnls

from casysid.arrays import Array
from casysid.dynamics import Armature, Regressor, build_regressor
from casysid.robot import JointKind, Robot
from casysid.robot.coordinates import channels_from_configuration, configuration_from_channels
from casysid.signals import Motion, low_passed
from casysid.threads import single_threaded

SAMPLES, BLOCKS = 800, 12
"""Samples of all recordings that are read anew for every reading, and contiguous blocks of them: a standard error of a
mean over twelve is itself known to a fifth."""
SHARPNESS = 0.01
"""Width of Coulomb friction's smooth sign in root mean square velocities."""
RESOLUTION = 1e-4
"""Of a joint's torque energy: smaller residues are alike."""
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
DEGREE = np.pi / 180.0
"""[rad]."""


class MistakeKind(enum.Enum):
    """What may be wrong with a log; the value is how it is told."""

    TORQUE_NEGATED = "tau of {0} looks negated"
    POSITION_NEGATED = "q of {0} looks negated"
    AXIS_NEGATED = "{0} looks mirrored, q and tau alike: its axis points the other way"
    ALL_TORQUES_NEGATED = "the torques of all joints look negated"
    TORQUES_SWAPPED = "the torques of {0} and {1} look exchanged"
    POSITIONS_SWAPPED = "the positions of {0} and {1} look exchanged"
    JOINTS_SWAPPED = "{0} and {1} look exchanged, q and tau alike"
    ZERO_SHIFTED = "the zero of {0} looks {amount:+.0f} degrees away from the file's"
    DEGREES = "q looks like degrees"
    SCALE = "tau of {0} is {amount:.3g} times what the file's masses can mean: in other units, or at the motor's side?"


@dataclass(frozen=True, kw_only=True)
class Mistake:
    """One reading of the log under which the model file explains it far better.

    Attributes:
        kind: What was mistaken.
        joints: Whose columns.
        amount: Degrees of a shifted zero, factor of a scale; 0 for the others.
        gain: By how much the logarithms of the joints' residual energies sink, summed.
        explained: Share of the torque's variance that the file explains of these joints, mean: as logged, corrected.
        alternatives: Other readings that do nearly as well, in words.
    """

    kind: MistakeKind
    joints: tuple[str, ...]
    amount: float = 0.0
    gain: float = 0.0
    explained: tuple[float, float] = (0.0, 0.0)
    alternatives: tuple[str, ...] = ()

    @property
    def words(self) -> str:
        """What looks wrong."""
        return self.kind.value.format(*self.joints, amount=self.amount)

    @property
    def sentence(self) -> str:
        """What looks wrong, why, and that nothing was done about it."""
        others = f" (or else: {'; '.join(self.alternatives)})" if self.alternatives else ""
        before, after = self.explained
        remedy = f", or read it so by --flip {column}" if (column := self.flip) else ""
        return (
            f"{self.words}{others}. The model file explains {before:.1%} of that torque's variance as logged, "
            f"{after:.1%} so corrected. Nothing was changed; check the log's columns and the file's axes{remedy}"
        )

    @property
    def flip(self) -> str | None:
        """What :meth:`casysid.recording.Recording.flipped` is to be told; None where a sign is not the mistake."""
        match self.kind:
            case MistakeKind.TORQUE_NEGATED:
                return f"tau_{self.joints[0]}"
            case MistakeKind.POSITION_NEGATED:
                return f"q_{self.joints[0]}"
            case MistakeKind.AXIS_NEGATED:
                return self.joints[0]
            case MistakeKind.ALL_TORQUES_NEGATED:
                return "tau"
            case _:
                return None

    def to_json(self) -> dict[str, object]:
        """Plain words and numbers."""
        return {
            "kind": self.kind.name.lower(),
            "joints": list(self.joints),
            "amount": self.amount,
            "gain": self.gain,
            "explained": list(self.explained),
            "words": self.words,
            "alternatives": list(self.alternatives),
        }


@dataclass(frozen=True, eq=False)
class _Samples:
    """A log's samples, one row an instant: positions by channel, the rest by degree of freedom."""

    position: Array
    v: Array
    a: Array
    tau: Array


@dataclass(frozen=True, eq=False)
class _Explanation:
    """How well the file explains samples.

    Attributes:
        residue: Squared residuals by block and joint, shape (blocks, nv).
        factor: Of the file's prediction by joint, not negative, shape (nv,).
        floor: Below which squared residuals are alike, shape (nv,).
    """

    residue: Array
    factor: Array
    floor: Array

    @property
    def energy(self) -> Array:
        return np.asarray(self.residue.sum(axis=0))


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


class _Search:
    """Samples as read so far, and how well the file explains them."""

    def __init__(self, robot: Robot, motions: Sequence[Motion], cutoff: float | None) -> None:
        self._robot = robot
        self._regressor: Regressor = build_regressor(robot, friction=(Armature(),))
        self._places = {
            joint.name: (joint.channels.start, joint.v.start)
            for joint in robot.joints
            if joint.kind in (JointKind.REVOLUTE, JointKind.CONTINUOUS, JointKind.PRISMATIC)
        }
        self._angles = [j.name for j in robot.joints if j.kind in (JointKind.REVOLUTE, JointKind.CONTINUOUS)]
        self._samples = _pick(robot, motions, cutoff)
        self._blocks = np.array_split(np.arange(len(self._samples.tau)), BLOCKS)
        self._width = SHARPNESS * np.sqrt(np.mean(self._samples.v**2, axis=0)) + 1e-12
        self._now = self._explain(self._samples)

    def next_mistake(self) -> Mistake | None:
        """The clearest mistake, corrected in the samples from now on; None when there is no clear one."""
        judged = []
        for mistake in self._conceivable():
            read = self._corrected(mistake)
            explanation = self._explain(read)
            gain, steadiness = self._gain(self._now, explanation)
            if gain > CLEAR and steadiness > STEADY:
                judged.append((gain, mistake, read, explanation))
        if not judged:
            return None
        judged.sort(key=lambda one: -one[0])
        gain, mistake, read, explanation = judged[0]
        others = tuple(other.words for near, other, *_ in judged[1:4] if near > NEARLY * gain)
        explained = (self._explained(mistake, self._now, self._samples), self._explained(mistake, explanation, read))
        self._samples, self._now = read, explanation
        return dataclasses.replace(mistake, gain=gain, explained=explained, alternatives=others)

    def wrong_scales(self) -> Iterator[Mistake]:
        """Joints whose torque is far from the file's in size, though alike in shape."""
        ordinary = self._explain(self._samples, most=USUAL_SCALE)
        for name, (_, dof) in self._places.items():
            factor = float(self._now.factor[dof])
            only = np.arange(self._robot.nv) == dof
            known = self._now.factor[dof] > 0.0
            if known and factor > USUAL_SCALE:
                gain, steadiness = self._gain(ordinary, self._now, only)
            elif known and factor < 1.0 / USUAL_SCALE:
                gain, steadiness = self._gain(self._without(dof), self._now, only)
            else:
                continue
            if gain > CLEAR and steadiness > STEADY:
                mistake = Mistake(kind=MistakeKind.SCALE, joints=(name,), amount=factor, gain=gain)
                explained = self._explained(mistake, self._now, self._samples)
                yield dataclasses.replace(mistake, explained=(explained, explained))

    def _without(self, dof: int) -> _Explanation:
        """The explanation without the file's prediction of a joint."""
        most = np.where(np.arange(self._robot.nv) == dof, 0.0, np.inf)
        return self._explain(self._samples, most=most)

    def _conceivable(self) -> Iterator[Mistake]:
        for name in self._places:
            for kind in (MistakeKind.TORQUE_NEGATED, MistakeKind.AXIS_NEGATED, MistakeKind.POSITION_NEGATED):
                yield Mistake(kind=kind, joints=(name,))
        if len(self._places) > 1:
            yield Mistake(kind=MistakeKind.ALL_TORQUES_NEGATED, joints=tuple(self._places))
        for pair in combinations(self._places, 2):
            for kind in (MistakeKind.TORQUES_SWAPPED, MistakeKind.JOINTS_SWAPPED, MistakeKind.POSITIONS_SWAPPED):
                yield Mistake(kind=kind, joints=pair)
        for name in self._angles:
            for amount in (90.0, -90.0, 180.0):
                yield Mistake(kind=MistakeKind.ZERO_SHIFTED, joints=(name,), amount=amount)
        if self._angles:
            yield Mistake(kind=MistakeKind.DEGREES, joints=tuple(self._angles))

    def _corrected(self, mistake: Mistake) -> _Samples:
        """The samples as they would be without the mistake."""
        position, v, a, tau = (np.array(x) for x in dataclasses.astuple(self._samples))
        places = [self._places[name] for name in mistake.joints]
        channels, dofs = [channel for channel, _ in places], [dof for _, dof in places]
        kind = mistake.kind
        if kind in (MistakeKind.TORQUE_NEGATED, MistakeKind.AXIS_NEGATED, MistakeKind.ALL_TORQUES_NEGATED):
            tau[:, dofs] *= -1.0
        if kind in (MistakeKind.POSITION_NEGATED, MistakeKind.AXIS_NEGATED):
            position[:, channels] *= -1.0
            v[:, dofs] *= -1.0
            a[:, dofs] *= -1.0
        if kind in (MistakeKind.TORQUES_SWAPPED, MistakeKind.JOINTS_SWAPPED):
            tau[:, dofs] = tau[:, dofs[::-1]]
        if kind in (MistakeKind.POSITIONS_SWAPPED, MistakeKind.JOINTS_SWAPPED):
            position[:, channels] = position[:, channels[::-1]]
            v[:, dofs], a[:, dofs] = v[:, dofs[::-1]], a[:, dofs[::-1]]
        if kind is MistakeKind.ZERO_SHIFTED:
            position[:, channels] -= mistake.amount * DEGREE
        if kind is MistakeKind.DEGREES:
            for values, columns in ((position, channels), (v, dofs), (a, dofs)):
                values[:, columns] *= DEGREE
        return _Samples(position, v, a, tau)

    def _explain(self, samples: _Samples, most: float | Array = np.inf) -> _Explanation:
        """Every joint's torque by the file's prediction times a factor from 0 to ``most``, friction and an offset."""
        q = configuration_from_channels(self._robot, samples.position)
        predicted = self._regressor.predict(self._regressor.prior, q, samples.v, samples.a)
        nv = self._robot.nv
        limit = np.broadcast_to(most, nv)
        residue, factor = np.empty((BLOCKS, nv)), np.empty(nv)
        for dof in range(nv):
            v = samples.v[:, dof]
            one = np.ones(len(v))
            x = np.column_stack([predicted[:, dof], v, np.tanh(v / self._width[dof]), samples.a[:, dof], one, -one])
            y = samples.tau[:, dof]
            coefficients = _not_negative(x, y)
            if coefficients[0] > limit[dof]:
                coefficients[0] = limit[dof]
                coefficients[1:] = _not_negative(x[:, 1:], y - limit[dof] * x[:, 0])
            factor[dof] = coefficients[0]
            squares = (y - x @ coefficients) ** 2
            residue[:, dof] = [squares[block].sum() for block in self._blocks]
        floor = RESOLUTION * np.sum((samples.tau - samples.tau.mean(axis=0)) ** 2, axis=0) + 1e-30
        return _Explanation(residue, factor, floor)

    def _gain(self, before: _Explanation, after: _Explanation, joints: Array | None = None) -> tuple[float, float]:
        """Fall of the logarithms of residual energies, and the mean of that in blocks in standard errors."""
        chosen = np.ones(self._robot.nv, dtype=bool) if joints is None else joints
        gain = np.log(before.energy + before.floor) - np.log(after.energy + after.floor)
        each = np.log(before.residue + before.floor / BLOCKS) - np.log(after.residue + after.floor / BLOCKS)
        fall = each[:, chosen].sum(axis=1)
        spread = float(fall.std(ddof=1)) / np.sqrt(len(fall))
        return float(gain[chosen].sum()), float(fall.mean()) / max(spread, 1e-12)

    def _explained(self, mistake: Mistake, explanation: _Explanation, samples: _Samples) -> float:
        dofs = [self._places[name][1] for name in mistake.joints]
        tau = samples.tau[:, dofs]
        size = np.sum((tau - tau.mean(axis=0)) ** 2, axis=0)
        return float(np.mean(1.0 - explanation.energy[dofs] / np.maximum(size, 1e-30)))


def _pick(robot: Robot, motions: Sequence[Motion], cutoff: float | None) -> _Samples:
    """Some samples, evenly over the motions, their torque behind a low-pass."""
    each = max(SAMPLES // len(motions), BLOCKS)
    parts = []
    for motion in motions:
        tau = motion.tau if cutoff is None else low_passed(motion.time, motion.tau, cutoff)
        rows = np.unique(np.linspace(0, len(motion) - 1, each).astype(np.intp))
        position = channels_from_configuration(robot, motion.q[rows])
        parts.append((position, motion.v[rows], motion.a[rows], tau[rows]))
    return _Samples(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))


def _not_negative(x: Array, y: Array) -> Array:
    """Least squares with coefficients that are not negative, shape (n,)."""
    scale = np.maximum(np.sqrt(np.mean(x**2, axis=0)), 1e-300)
    triangle: Array = np.asarray(np.linalg.qr(np.column_stack([x / scale, y]), mode="r"))
    coefficients, _ = nnls(triangle[:, :-1], triangle[:, -1])
    return np.asarray(coefficients / scale)
