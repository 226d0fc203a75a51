"""All that goes on once there is a model: batches summed, watched, forgotten, and the model renewed."""

from __future__ import annotations

from collections import deque
from dataclasses import replace
from typing import Literal

import numpy as np
import numpy.typing as npt

from casysid.dynamics import Coulomb, Regressor, Viscous, build_regressor
from casysid.errors import ParameterError
from casysid.identification import IdentificationResult
from casysid.identification.passes import NEAR_REST, SAMPLES_PER_PERIOD, sum_moments
from casysid.identification.verdict.explained import WHOLE
from casysid.moments import Moments
from casysid.online.drift import SHARE, FrictionWatch
from casysid.online.events import Event
from casysid.online.forgetting import Block, FadingMoments
from casysid.online.judging import Judge
from casysid.online.noticing import KEPT, Change, Innovation, Watch
from casysid.online.renewal import Renewal, guessed_body
from casysid.online.stream import MotionStream, Samples
from casysid.robot import Robot
from casysid.signals import Motion, noise_of
from casysid.signals.motion import MotionScales
from casysid.signals.noise import spectrum_of
from casysid.threads import single_threaded

PAYLOAD: Literal["payload"] = "payload"
PLAIN = Viscous.kind, Coulomb.kind
NOTHING = 2.0
"""A mass of fewer standard errors than this is none: its 95 % interval holds zero."""
MOST = 0.5
"""Of the energy that another load explains: if the end of the old one explains so much, it was put down. Ends explain
.7 to 1 of it, changes and better estimates of a load less than .3, on simulated arms."""


class Run:
    """What :class:`~casysid.online.Online` does with samples from its start on."""

    def __init__(
        self, robot: Robot, result: IdentificationResult, link: npt.NDArray[np.intp], forget: float, renew: float
    ) -> None:
        self._robot, self._result, self._link = robot, result, link
        self._forget, self._every = forget, renew
        self._regressor = without_memory(result.regressor)
        self._renewal = Renewal(result, self._regressor, link)
        self._speed = np.sqrt(np.mean(np.concatenate([one.v**2 for one in result.train_motions]), axis=0))
        self._stream: MotionStream | None = None
        self._fading: FadingMoments | None = None
        self._waiting: deque[Block] = deque()
        self._since, self._quiet_until, self._renewed, self._said_until = np.nan, -np.inf, -np.inf, -np.inf
        self._unsaid: Event | None = None
        self._said = 0.0, 0.0
        self.state = self._renewal.renew(
            self._renewal.start, np.zeros(self._renewal.start.blocks, dtype=bool), np.nan, np.nan
        )
        self._friction = FrictionWatch(self._regressor, self._speed, self.state)
        self._watch = Watch(_hypotheses(self._regressor, link), self._renewal.inflation)
        self.judge = Judge(robot.dofs, int(np.ceil(forget)))

    @property
    def lag(self) -> float:
        """From a sample to its use at most [s]; nan before there are samples."""
        return np.nan if self._stream is None else self._stream.lag

    @single_threaded()
    def replay(self, samples: Samples) -> None:
        """What was learnt is not summed again, but tells how the model's errors scatter."""
        self._open(samples)
        assert self._stream is not None
        for motion in self._stream.batches(samples):
            moments = self._moments(motion)
            if moments is not None:
                theta, weights = self.state.model.parameters, self._renewal.weights
                innovation = Innovation.of(moments, theta, weights, float(motion.time[0]))
                self._watch.look(innovation, self.state.posterior)
        self._watch.forget()

    def _open(self, samples: Samples) -> None:
        """The stream, once there are samples that tell rate and noise."""
        seen = samples.recording(samples.oldest + self._every)
        choices, band = self._result.choices, self._result.choices.band
        if band.cutoff is None or band.smoothing is None:
            raise ParameterError("online: the result to start from is of samples without time; its band is not known")
        assert seen.time is not None
        speed = np.zeros(len(self._robot.channels))
        for joint in self._robot.joints:
            if joint.v.stop - joint.v.start == joint.channels.stop - joint.channels.start == 1:
                speed[joint.channels] = self._speed[joint.v]
        scales = MotionScales(noise_of(spectrum_of(seen.time, seen.position)), speed)
        stride = max(int(seen.rate / (SAMPLES_PER_PERIOD * band.cutoff)), 1)
        self._stream = MotionStream(
            self._robot,
            smoothing=band.smoothing,
            cutoff=band.cutoff,
            delays=np.asarray(choices.delay.seconds, dtype=np.float64),
            scales=scales,
            stride=stride - 1 + stride % 2,
        )

    @single_threaded()
    def go_on(self, samples: Samples) -> tuple[Event, ...]:
        """All batches that are complete."""
        if self._stream is None:
            if samples.newest - samples.oldest < self._every:
                return ()
            self._open(samples)
        assert self._stream is not None
        said: list[Event] = []
        for motion in self._stream.batches(samples):
            said += self._take(motion, samples.newest)
        return tuple(said)

    def _take(self, motion: Motion, now: float) -> list[Event]:
        start, stop = float(motion.time[0]), float(motion.time[-1])
        if self._fading is None:
            self._fading = FadingMoments(self._renewal.start, start, self._forget)
        moments = self._moments(motion)
        if moments is None:
            return []
        theta = self.state.model.parameters
        innovation = Innovation.of(moments, theta, self._renewal.weights, start)
        doubts = 1 if self.state.held is None else 2  # which of two loads it is, one batch tells badly
        change = self._watch.look(innovation, self.state.posterior, doubts)
        self.judge.add(moments, theta)
        self._waiting.append(Block(moments, 0.5 * (start + stop), stop - start, self.state.held is not None))
        said = [] if change is None else self._changed(change, now)
        while len(self._waiting) > KEPT:
            self._fading.add(self._waiting.popleft())
        if stop >= self._renewed + self._every and not self._watch.is_doubting:
            self._renewed = stop
            self._renew(stop)
            said += self._friction.look(self.state, now) + self._said_of_load(now)
        return said

    def _moments(self, motion: Motion) -> Moments | None:
        near_rest = motion.standing | (np.abs(motion.v) < NEAR_REST * self._result.choices.width)
        cutoff = self._result.choices.band.cutoff
        found = sum_moments(
            self._regressor, [motion], cutoff, near_rest=[near_rest], blocks=1, threads=1, only_rows=False
        )
        return found if found.count.any() else None

    def _changed(self, change: Change, now: float) -> list[Event]:
        """What follows from a change, and what is said of it."""
        self._watch.forget()
        missed = self.judge.take_back(change.batches + 1)
        count = min(change.batches + 1, len(self._waiting))
        newest = [self._waiting.pop() for _ in range(count)][::-1][-change.batches :]
        if change.name == PAYLOAD and (event := self._payload_changed(change, now)) is not None:
            holds = event.kind == PAYLOAD
            self._waiting.extend(replace(one, held=holds) for one in newest)
            self._renew(now)
            refined = holds and event.since < self._said_until
            self._said_until = change.since + (KEPT * self.lag if holds else 0.0)
            self._quiet_until = max(self._quiet_until, now + KEPT * self.lag)
            if not holds:
                was_said, self._unsaid = self._unsaid is None, None
                return [event] if was_said else []
            self._unsaid = self._unsaid if refined else event
            return self._said_of_load(now)
        if change.name and change.name != PAYLOAD:
            said = self._friction_changed(change, now)
            self._waiting.extend(newest)
            self._renew(now)
            return said
        if now < self._quiet_until or missed < WHOLE:  # what lasts is no contact; what is small matters to nobody
            self._waiting.extend(newest)
            return []
        self._quiet_until = now + self._forget
        return [Event("unexplained", change.since, now, 0.0, np.inf)]

    def _payload_changed(self, change: Change, now: float) -> Event | None:
        """Another payload than before; None if its mass would not be positive."""
        assert self._fading is not None
        held = self.state.held
        before = np.zeros(10) if held is None else held.parameters
        point, covariance = change.within(self._link[:4])
        mass, error = float(before[0] + point[0]), float(np.sqrt(covariance[0, 0]))
        if held is None and mass < NOTHING * error:
            return None
        while self._waiting:
            self._fading.add(self._waiting.popleft())
        if held is not None:
            self._fading.put_down(self._link, held.parameters)
        settling = change.since < self._said_until
        if mass < NOTHING * error or (
            held is not None
            and not settling
            and change.gain(self._link, -held.parameters) >= MOST * change.gain(self._link, change.size)
        ):
            self._renewal.begin(None)
            self._since, self._said = np.nan, (0.0, 0.0)
            return Event("put down", change.since, now, 0.0, error)
        self._renewal.begin(guessed_body(mass, before[1:4] + point[1:4]))
        self._since = change.since
        return Event(PAYLOAD, change.since, now, mass, error)

    def _said_of_load(self, now: float) -> list[Event]:
        """A load is said once its mass is clear; one that more and more samples say is none was put down."""
        held = self.state.held
        if held is None:
            return []
        if held.mass > NOTHING * held.mass_std:
            event, self._unsaid = self._unsaid, None
            mass, error = self._said
            self._said = held.mass, held.mass_std
            if event is None or abs(held.mass - mass) < NOTHING * np.hypot(error, held.mass_std):
                return []  # the same load, known better
            return [replace(event, noticed=now, size=held.mass, std=held.mass_std)]
        if now < self._said_until:
            return []
        assert self._fading is not None
        self._fading.put_down(self._link, held.parameters)
        self._renewal.begin(None)
        self._since, was_said, self._unsaid, self._said = np.nan, self._unsaid is None, None, (0.0, 0.0)
        self._renew(now)
        return [Event("put down", now, now, 0.0, held.mass_std)] if was_said else []

    def _friction_changed(self, change: Change, now: float) -> list[Event]:
        """Worth a word if the joint's friction is another by a share that is felt."""
        joint, columns = self._robot.dofs.index(change.name), _friction_of(self._regressor, change.name)
        row = np.array([self._speed[joint], 1.0])
        size, error = float(row @ change.size), float(np.sqrt(row @ change.covariance @ row))
        before = abs(float(row @ self.state.model.parameters[columns]))
        if abs(size) < NOTHING * error:
            return []
        assert self._fading is not None
        while self._waiting:
            self._fading.add(self._waiting.popleft())
        self._fading.changed(columns, change.size)
        self._friction.know(change.name)
        return [Event("friction", change.since, now, size, error, change.name)] if abs(size) > SHARE * before else []

    def _renew(self, now: float) -> None:
        assert self._fading is not None
        waiting = self._waiting if self._since == self._since else ()
        moments, held = self._fading.weighted(now)
        for block in waiting:  # what was picked up just now is in none of the older blocks
            moments, held = moments + block.moments, np.append(held, block.held)
        self.state = self._renewal.renew(moments, held, now, self._since)


def without_memory(regressor: Regressor) -> Regressor:
    """The regressor without friction that remembers the way."""
    if not regressor.history_count:
        return regressor
    remembering = {part.kind.kind for part in regressor.parts if part.kind.histories(part.direction)}
    kinds = [kind for kind in regressor.friction if kind.kind not in remembering]
    sensing = regressor.template.sensing
    return build_regressor(
        regressor.robot,
        kinds,
        regressor.couplings,
        quasi_static=sensing.quasi_static,
        torque_gains=sensing.gains,
    )


def _hypotheses(regressor: Regressor, link: npt.NDArray[np.intp]) -> dict[str, npt.NDArray[np.intp]]:
    """A payload; each joint's viscous and Coulomb friction."""
    found: dict[str, npt.NDArray[np.intp]] = {PAYLOAD: np.asarray(link, dtype=np.intp)}
    for dof in regressor.robot.dofs:
        own = _friction_of(regressor, dof)
        if len(own) == len(PLAIN):
            found[dof] = own
    return found


def _friction_of(regressor: Regressor, dof: str) -> npt.NDArray[np.intp]:
    wanted = [f"{dof}.{kind}" for kind in PLAIN]
    return np.array([k for name in wanted for k, known in enumerate(regressor.names) if known == name], dtype=np.intp)
