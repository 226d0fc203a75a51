"""The robot while it runs: samples in, a model, its verdict and what has changed out."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from casysid.errors import ParameterError
from casysid.identification import IdentificationResult, Settings, identify
from casysid.identification.verdict.criteria import Verdict
from casysid.model import RobotModel
from casysid.online.events import Event
from casysid.online.renewal import Held, State
from casysid.online.run import Run
from casysid.online.stream import Samples
from casysid.payload.frames import holding_frame
from casysid.robot import Robot


class Online:
    """Identification while the robot runs.

    Samples are added one by one or in batches. They are smoothed with the lag that :attr:`lag` states, summed, and
    forgotten with a time constant. Every second of samples the model is renewed, its parameters those of bodies that
    can be; a payload that is picked up, changed or put down, and friction that has changed, are said as
    :class:`Event`. Nothing is done between calls, and no thread is started.

    Without an identification to start from, the first ``learn`` seconds are identified as :func:`casysid.identify`
    does, which takes some seconds once. Friction before sliding is left out on line: it remembers more than a batch.
    """

    def __init__(
        self,
        robot: Robot,
        start: IdentificationResult | None = None,
        *,
        learn: float = 20.0,
        forget: float = 60.0,
        renew: float = 1.0,
        link: str | None = None,
        settings: Settings | None = None,
    ) -> None:
        """Nothing is known yet but the start.

        Args:
            robot: The robot without payload.
            start: An identification of it; None learns first.
            learn: So many seconds of samples, in which the robot holds nothing [s].
            forget: Time constant of forgetting [s].
            renew: The model is renewed so often [s].
            link: That may hold a payload, or a frame fixed to it; None for the last one.
            settings: Of the identification that is learnt; by default viscous and Coulomb friction, offset, armature.

        Raises:
            ParameterError: A time is not positive, or it is not clear which link holds.
        """
        for name, value in (("learn", learn), ("forget", forget), ("renew", renew)):
            if not (np.isfinite(value) and value > 0.0):
                raise ParameterError(f"online: {name} must be a positive number of seconds; got {value}")
        self.robot = robot
        self._learn, self._forget, self._renew = learn, forget, renew
        self._frame = holding_frame(robot, link)
        self._settings = settings or Settings(choose_friction=False)
        self._samples = Samples(robot)
        self._result, self._run = start, None if start is None else self._begin(start)

    def add(self, time: npt.ArrayLike, position: npt.ArrayLike, torque: npt.ArrayLike) -> tuple[Event, ...]:
        """One sample or several in the order of time, and what is to be said.

        Args:
            time: [s], a number or (N,).
            position: By channel, (channels,) or (N, channels).
            torque: By degree of freedom, (nv,) or (N, nv).

        Raises:
            RecordingError: A shape does not fit, or nothing can be learnt of the first samples.
            SolverError: No consistent parameters could be found in them.
        """
        self._samples.add(time, position, torque)
        if self._run is None:
            if self._samples.newest - self._samples.oldest < self._learn:
                return ()
            self._result = identify(self.robot, self._samples.recording(), self._settings)
            self._run = self._begin(self._result)
            self._run.replay(self._samples)
        return self._run.go_on(self._samples)

    def _begin(self, result: IdentificationResult) -> Run:
        if result.robot.dofs != self.robot.dofs:
            raise ParameterError(
                f"online: the result to start from is of joints {', '.join(result.robot.dofs)}; the robot has "
                f"{', '.join(self.robot.dofs)}"
            )
        return Run(self.robot, result, self._frame.columns, self._forget, self._renew)

    @property
    def ready(self) -> bool:
        """Whether there is a model."""
        return self._run is not None

    @property
    def result(self) -> IdentificationResult | None:
        """The identification that it started from; None while it learns."""
        return self._result

    @property
    def lag(self) -> float:
        """From a sample to its use at most, beside the renewal's own second [s]; nan while it learns."""
        return np.nan if self._run is None else self._run.lag

    @property
    def dropped(self) -> int:
        """Samples left out: time that did not go on, or numbers that are not finite."""
        return self._samples.dropped

    @property
    def state(self) -> State:
        """The newest model, with what is held and how sure all is.

        Raises:
            ParameterError: It still learns.
        """
        if self._run is None:
            raise ParameterError(f"online: there is no model yet; it learns of the first {self._learn:g} s")
        return self._run.state

    @property
    def model(self) -> RobotModel:
        """The newest model, with what is held in its link."""
        return self.state.model

    @property
    def held(self) -> Held | None:
        """What is held, in the frame of its link; None if nothing."""
        return self.state.held

    @property
    def verdict(self) -> Verdict:
        """On the last batches, each predicted by the model from before it."""
        if self._run is None:
            raise ParameterError(f"online: there is no verdict yet; it learns of the first {self._learn:g} s")
        return self._run.judge.verdict()
