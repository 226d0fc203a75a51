"""A simulated experiment: a controller drives a plant along a trajectory."""

from __future__ import annotations

import math
import time as clock
import warnings
from collections.abc import Callable

import numpy as np

from casysid.arrays import Array
from casysid.errors import CasysidWarning, ParameterError, SolverError
from casysid.recording import Recording
from casysid.robot.coordinates import configuration_from_channels
from casysid.robot.mujoco_warnings import collected_warnings
from casysid.simulation.controllers import Controller
from casysid.simulation.plant import Plant
from casysid.simulation.reference import Reference, Trajectory
from casysid.simulation.result import RunStatus, SimulatedRun
from casysid.simulation.sensors import History, StateSensors, read_torques
from casysid.simulation.watchdog import Watchdog
from casysid.threads import single_threaded

_TELL_EVERY = 1000  # ticks
_STABLE = 1.5  # steps times decay rate that the integrator bears with room to spare
_OFTEN = 0.01  # share of saturated samples that is worth a warning


@single_threaded()
def simulate(
    plant: Plant,
    controller: Controller,
    trajectory: Trajectory,
    *,
    rate: float,
    duration: float,
    seed: int = 0,
    progress: Callable[[float], object] | None = None,
) -> SimulatedRun:
    """Let the controller drive the plant along the trajectory and log what happens.

    Half a million samples of seven joints take about a minute. Runs share nothing, so threads may do several at once.

    Args:
        plant: The robot; it starts on the trajectory.
        controller: Gets the readings of the sensors at every tick.
        trajectory: What it follows.
        rate: Of controller and log [Hz].
        duration: [s].
        seed: Of all sensor noise; the same seed gives the same run.
        progress: Called now and then with the share that is done.

    Returns:
        The run. When the robot runs away it ends there, with status DIVERGED and a :class:`CasysidWarning`.

    Raises:
        ParameterError: Rate or duration make no sense, or the trajectory is another robot's.
        RobotError: The plant cannot be simulated.
        SolverError: The controller's first command is not finite.
    """
    samples = _count_samples(rate, duration)
    reference = trajectory.sample(np.arange(samples) / rate)
    if reference.channels.shape[1:] != (len(plant.robot.channels),):
        raise ParameterError(
            f"simulate: the trajectory has {reference.channels.shape[1]} channels, robot '{plant.robot.name}' "
            f"{len(plant.robot.channels)}"
        )
    loop = _Loop(plant, controller, reference, rate, seed)
    start = clock.perf_counter()
    with collected_warnings():  # the watchdog tells what they are about
        done = loop.run(progress)
    return loop.result(done, clock.perf_counter() - start)


def _count_samples(rate: float, duration: float) -> int:
    if not (0.0 < rate < math.inf and 0.0 < duration < math.inf and round(rate * duration) >= 2):
        raise ParameterError(
            f"simulate: rate and duration must be positive and give two samples or more; got {rate} Hz and {duration} s"
        )
    return round(rate * duration)


class _Loop:
    """The state of a run while it runs."""

    def __init__(self, plant: Plant, controller: Controller, reference: Reference, rate: float, seed: int) -> None:
        import mujoco

        samples, nv = reference.v.shape
        self.plant, self.controller, self.reference, self.rate = plant, controller, reference, rate
        settings = plant.settings
        longest = min(
            settings.physics_step, settings.actuation.lag or math.inf, _STABLE / max(plant.fastest_decay, 1e-9)
        )
        self.steps = max(math.ceil(1.0 / (rate * longest) - 1e-9), 1)
        self.machine = plant.build(1.0 / (rate * self.steps))
        self.data = mujoco.MjData(self.machine.model)
        state_seed, self.torque_seed = np.random.SeedSequence(seed).spawn(2)
        self.history = History.empty(samples, plant.coordinates)
        self.planned = controller.plan(reference)
        self._start()
        self.sensors = StateSensors(plant.coordinates, settings.sensing, self.history, 1.0 / rate, state_seed)
        resolution = settings.actuation.resolution
        self.step = resolution * plant.torque_scale if resolution else None
        self.watchdog = Watchdog(plant.robot)
        self.asked, self.feedback, self.acting, self.dry = np.empty((4, samples, nv))

    def _start(self) -> None:
        """On the trajectory, with the motors already holding what the controller plans."""
        data, machine, plant, reference = self.data, self.machine, self.plant, self.reference
        data.qpos[machine.positions] = reference.channels[0]
        data.qvel[machine.rates] = plant.coordinates.rates(reference.channels[0], reference.v[0])
        data.qfrc_applied[machine.rates] = -plant.offset
        self.history.channels[0], self.history.rates[0] = reference.channels[0], data.qvel[machine.rates]
        if machine.model.na:
            command = self.controller.react(reference.q[0], reference.v[0], reference, 0)
            data.act[:] = plant.coordinates.force_along_rates(reference.channels[0], self.planned[0] + command.model)

    def run(self, progress: Callable[[float], object] | None) -> int:
        """Simulate; return how many ticks there are results of."""
        import mujoco

        machine, data, plant = self.machine, self.data, self.plant
        model, positions, rates, history = machine.model, machine.positions, machine.rates, self.history
        mechanics, samples = plant.settings.mechanics, len(self.reference)
        sticking = mechanics.stiction > 1.0 and bool(plant.coulomb_friction.any())
        for k in range(samples):
            channels, speed = history.channels[k], history.rates[k]
            channels[:], speed[:] = data.qpos[positions], data.qvel[rates]
            if self.watchdog.barks(channels, speed):
                return k
            if sticking:
                excess = (mechanics.stiction - 1.0) * np.exp(-np.square(speed / mechanics.stribeck_velocity))
                model.dof_frictionloss[rates] = plant.coulomb_friction * (1.0 + excess)
            if not self._command(k):
                return k
            mujoco.mj_forward(model, data)
            history.change[k] = data.qacc[rates]
            self.acting[k], self.dry[k] = data.qfrc_actuator[rates], data.qfrc_constraint[rates]
            mujoco.mj_step(model, data, self.steps)
            if progress is not None and k % _TELL_EVERY == 0:
                progress(k / samples)
        if progress is not None:
            progress(1.0)
        return samples

    def _command(self, k: int) -> bool:
        """Read the sensors, ask the controller, set the motors; False when there is no finite answer."""
        coordinates, history = self.plant.coordinates, self.history
        channels, speed = self.sensors.read(k)
        q, v = coordinates.configuration(channels), coordinates.velocity(channels, speed)
        command = self.controller.react(q, v, self.reference, k)
        torque = self.planned[k] + command.model + command.feedback
        if not math.isfinite(float(torque @ torque)):
            return False
        if self.step is not None:
            torque = np.round(torque / self.step) * self.step
        self.asked[k], self.feedback[k] = torque, command.feedback
        self.data.ctrl[:] = coordinates.force_along_rates(history.channels[k], torque)
        return True

    def result(self, done: int, seconds: float) -> SimulatedRun:
        """The run of the first ``done`` ticks."""
        if done == 0:
            raise SolverError(
                f"simulate: robot '{self.plant.robot.name}' could not start: the controller's first command "
                "is not finite"
            )
        saturated = (np.abs(self.asked[:done]) > self.plant.effort_limit).mean(axis=0)
        status = RunStatus.COMPLETED if done == len(self.reference) else RunStatus.DIVERGED
        self._warn(done, saturated)
        plant, coordinates, rows = self.plant, self.plant.coordinates, slice(done)
        channels, rates, change = self.history.channels[rows], self.history.rates[rows], self.history.change[rows]
        tau, dry = (coordinates.force(channels, x[rows]) for x in (self.acting, -self.dry))
        return SimulatedRun(
            recording=self._record(channels, tau, rows),
            reference=self.reference.first(done),
            channels=channels,
            q=configuration_from_channels(plant.robot, channels),
            v=coordinates.velocity(channels, rates),
            a=coordinates.acceleration(channels, rates, change),
            tau=tau,
            dry_friction=dry,
            cable=plant.cable_torque(channels),
            feedback=self.feedback[rows],
            saturated=saturated,
            status=status,
            seconds=seconds,
        )

    def _warn(self, done: int, saturated: Array) -> None:
        """Of a run that ended early, and of motors that could not do what was asked."""
        robot, complaint = self.plant.robot, ""
        if done < len(self.reference):
            reason = self.watchdog.reason or "the controller's command is not finite"
            complaint = (
                f"was stopped after {done / self.rate:.3f} s of {len(self.reference) / self.rate:.3f} s: {reason}. "
                "Check the controller's parameters and gains"
            )
        elif saturated.max() > _OFTEN:
            worst = int(np.argmax(saturated))
            complaint = (
                f"could not give '{robot.dofs[worst]}' the torque it was asked for in {saturated[worst]:.0%} of the "
                f"samples (limit {robot.effort_limit[worst]:.6g}). Choose a gentler motion, check the file's limits, "
                "or switch saturation off"
            )
        if complaint:
            warnings.warn(f"simulate: robot '{robot.name}' {complaint}", CasysidWarning, stacklevel=5)

    def _record(self, channels: Array, tau: Array, rows: slice) -> Recording:
        plant, sensing = self.plant, self.plant.settings.sensing
        limit = plant.effort_limit
        torque = np.clip(self.asked[rows], -limit, limit) if sensing.torque_is_command else tau
        measured, instants = self.sensors.channels[rows], self.sensors.instants[rows] + sensing.position_delay
        return Recording(
            channels=plant.robot.channels,
            dofs=plant.robot.dofs,
            time=self.reference.time[rows],
            position=measured,
            velocity=plant.coordinates.velocity(measured, self.sensors.rates[rows]),
            torque=read_torques(torque, instants, plant.torque_scale, sensing, 1.0 / self.rate, self.torque_seed),
            sources=(f"simulation of {plant.robot.name}",),
        )
