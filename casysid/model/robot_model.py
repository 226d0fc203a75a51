"""The identified robot as one object, to be asked for torques, written as code, or handed to a simulator."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Literal, overload

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array, frozen
from casysid.dynamics import Bulk, Regressor
from casysid.errors import ParameterError
from casysid.model.functions import ModelFunctions, build_functions, values
from casysid.model.standard_errors import Scatter, StandardErrors
from casysid.robot import Robot
from casysid.robot.coordinates import configuration_from_channels
from casysid.threads import single_threaded

Answer = Array | tuple[Array, Array]


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class RobotModel:
    """Dynamics with identified numbers: bodies, friction, couplings, springs, and how sure all of it is.

    States are one, ``q`` (nq,) and ``v, a, tau`` (nv,), or many, (N, nq) and (N, nv). ``q`` is in Pinocchio's layout:
    :meth:`configuration` makes it of logged positions. Torques are those of the recordings' scale; a gain that was
    found of a joint's torque is in all of them. Everywhere

        ``torque(q, v, a) = mass_matrix(q) a + bias(q, v) + friction(v, q)``.

    Friction before sliding remembers the way. Without more, each state stands for itself, and friction has slid far in
    the direction of ``v``; with ``time`` the states follow each other, as in a recording; ``memory`` says what is
    remembered, as :meth:`remember` carries it along. With ``std=True`` the answer comes with its standard error,
    infinite for what the recordings do not tell.

    Attributes:
        regressor: Whose columns the parameters multiply.
        parameters: Shape (p,).
        scatter: How far they are known; None where nobody said.
        damping: Viscous friction that, with ``dry_friction``, comes nearest to all friction, (nv,), [N m s/rad].
        dry_friction: Coulomb friction likewise, (nv,), [N m].
    """

    regressor: Regressor
    parameters: Array
    scatter: Scatter | None = None
    damping: Array
    dry_friction: Array

    def __post_init__(self) -> None:
        for name, size in (
            ("parameters", len(self.regressor.parameters)),
            ("damping", self.robot.nv),
            ("dry_friction", self.robot.nv),
        ):
            given = frozen(getattr(self, name))
            if given.shape != (size,) or not np.isfinite(given).all():
                raise ParameterError(f"model: {name} must be {size} finite numbers; got shape {given.shape}")
            object.__setattr__(self, name, given)

    def __repr__(self) -> str:
        sure = "" if self.scatter is None else ", with standard errors"
        return f"<RobotModel of '{self.robot.name}': {self.robot.nv} joints, {len(self.parameters)} parameters{sure}>"

    @property
    def robot(self) -> Robot:
        """The tree, with the parameters of its file."""
        return self.regressor.robot

    @property
    def inertial_parameters(self) -> Array:
        """The links' parameters, shape (10 links,), in the order of ``robot.inertial_parameters``."""
        return self.parameters[: self.robot.inertial_parameters.size]

    @property
    def armature(self) -> Array:
        """Inertia of the rotors and gears of single joints, shape (nv,), [kg m²] or [kg]."""
        return frozen(self.values_of("armature"))

    @property
    def torque_gains(self) -> Array:
        """Torque of the recordings' scale over true torque, shape (nv,)."""
        return np.array(self.regressor.template.sensing.gains)

    @property
    def memory_size(self) -> int:
        """How many numbers friction remembers; 0 if it remembers nothing."""
        return self.regressor.history_count

    @cached_property
    def casadi(self) -> ModelFunctions:
        """The same as CasADi Functions, to differentiate or to put into an optimiser."""
        return build_functions(self.regressor, self.parameters)

    def configuration(self, positions: npt.ArrayLike) -> Array:
        """``q`` of positions as they are logged, (channels,) or (N, channels): unlike only where a joint turns on."""
        rows = np.asarray(positions, dtype=np.float64)
        q = configuration_from_channels(self.robot, np.atleast_2d(rows))
        return q if rows.ndim == 2 else q[0]

    @overload
    def torque(
        self, q: npt.ArrayLike, v: npt.ArrayLike, a: npt.ArrayLike, *,
        time: npt.ArrayLike | None = None, memory: npt.ArrayLike | None = None, std: Literal[False] = False,
    ) -> Array: ...  # fmt: skip
    @overload
    def torque(
        self, q: npt.ArrayLike, v: npt.ArrayLike, a: npt.ArrayLike, *,
        time: npt.ArrayLike | None = None, memory: npt.ArrayLike | None = None, std: Literal[True],
    ) -> tuple[Array, Array]: ...  # fmt: skip
    def torque(
        self,
        q: npt.ArrayLike,
        v: npt.ArrayLike,
        a: npt.ArrayLike,
        *,
        time: npt.ArrayLike | None = None,
        memory: npt.ArrayLike | None = None,
        std: bool = False,
    ) -> Answer:
        """What moves the robot so, friction included, (nv,) or (N, nv), [N m] or [N].

        Args:
            q: Configurations.
            v: Velocities.
            a: Accelerations.
            time: Of states that follow each other [s], (N,).
            memory: What friction remembers, (m,) or (N, m).
            std: Whether the standard error is wanted too.

        Raises:
            ParameterError: A shape does not fit.
        """
        known = self._memory(q, v, time, memory)
        return self._answer("torque", (q, v, a), known, std, lambda e, x: e.torque(x[0], x[1], x[2], known))

    @overload
    def gravity(self, q: npt.ArrayLike, *, std: Literal[False] = False) -> Array: ...
    @overload
    def gravity(self, q: npt.ArrayLike, *, std: Literal[True]) -> tuple[Array, Array]: ...
    def gravity(self, q: npt.ArrayLike, *, std: bool = False) -> Answer:
        """What holds the robot still without friction: weight, springs, counterweights, offsets; (nv,) or (N, nv)."""
        return self._answer("gravity", (q,), None, std, lambda e, x: e.gravity(*x))

    @overload
    def bias(self, q: npt.ArrayLike, v: npt.ArrayLike, *, std: Literal[False] = False) -> Array: ...
    @overload
    def bias(self, q: npt.ArrayLike, v: npt.ArrayLike, *, std: Literal[True]) -> tuple[Array, Array]: ...
    def bias(self, q: npt.ArrayLike, v: npt.ArrayLike, *, std: bool = False) -> Answer:
        """The torque of a steady motion without friction: Coriolis, centrifugal and :meth:`gravity`."""
        return self._answer("bias", (q, v), None, std, lambda e, x: e.bias(*x))

    @overload
    def friction(
        self, v: npt.ArrayLike, q: npt.ArrayLike | None = None, *,
        time: npt.ArrayLike | None = None, memory: npt.ArrayLike | None = None, std: Literal[False] = False,
    ) -> Array: ...  # fmt: skip
    @overload
    def friction(
        self, v: npt.ArrayLike, q: npt.ArrayLike | None = None, *,
        time: npt.ArrayLike | None = None, memory: npt.ArrayLike | None = None, std: Literal[True],
    ) -> tuple[Array, Array]: ...  # fmt: skip
    def friction(
        self,
        v: npt.ArrayLike,
        q: npt.ArrayLike | None = None,
        *,
        time: npt.ArrayLike | None = None,
        memory: npt.ArrayLike | None = None,
        std: bool = False,
    ) -> Answer:
        """What of the torque friction takes, of joints and couplings, (nv,) or (N, nv).

        Args:
            v: Velocities.
            q: Configurations; needed where friction depends on the load or the position, or with ``time``.
            time: As for :meth:`torque`.
            memory: As for :meth:`torque`.
            std: Whether the standard error is wanted too.

        Raises:
            ParameterError: ``q`` is needed and was not given, or a shape does not fit.
        """
        if q is None and (time is not None or bool(self.casadi.friction.which_depends("q", ["tau"], 1)[0])):
            raise ParameterError("friction: it depends on load or position here; give q as well: friction(v, q)")
        where = np.zeros(self.robot.nq) if q is None else q
        known = self._memory(where, v, time, memory)
        return self._answer("friction", (where, v), known, std, lambda e, x: e.friction(x[0], x[1], known))

    @overload
    def mass_matrix(self, q: npt.ArrayLike, *, std: Literal[False] = False) -> Array: ...
    @overload
    def mass_matrix(self, q: npt.ArrayLike, *, std: Literal[True]) -> tuple[Array, Array]: ...
    def mass_matrix(self, q: npt.ArrayLike, *, std: bool = False) -> Answer:
        """``M``, (nv, nv) or (N, nv, nv), rotors included; symmetric unless the torques have gains.

        Raises:
            ParameterError: The torques held nothing inertial, or a shape does not fit.
        """
        self._require("mass_matrix")
        return self._answer("mass_matrix", (q,), None, std, lambda e, x: e.mass_matrix(*x))

    @overload
    def forward_dynamics(
        self, q: npt.ArrayLike, v: npt.ArrayLike, tau: npt.ArrayLike, *,
        time: npt.ArrayLike | None = None, memory: npt.ArrayLike | None = None, std: Literal[False] = False,
    ) -> Array: ...  # fmt: skip
    @overload
    def forward_dynamics(
        self, q: npt.ArrayLike, v: npt.ArrayLike, tau: npt.ArrayLike, *,
        time: npt.ArrayLike | None = None, memory: npt.ArrayLike | None = None, std: Literal[True],
    ) -> tuple[Array, Array]: ...  # fmt: skip
    def forward_dynamics(
        self,
        q: npt.ArrayLike,
        v: npt.ArrayLike,
        tau: npt.ArrayLike,
        *,
        time: npt.ArrayLike | None = None,
        memory: npt.ArrayLike | None = None,
        std: bool = False,
    ) -> Answer:
        """Accelerations under torques, (nv,) or (N, nv), [rad/s²] or [m/s²]; arguments as for :meth:`torque`.

        Raises:
            ParameterError: The torques held nothing inertial, or a shape does not fit.
        """
        self._require("forward_dynamics")
        known = self._memory(q, v, time, memory)
        a = self._values("forward_dynamics", (q, v, tau), known)
        if not std:
            return a
        x = [np.asarray(one, dtype=np.float64) for one in (q, v)]
        return a, self._errors.forward_dynamics(x[0], x[1], a, self.mass_matrix(q), known)

    def remember(self, memory: npt.ArrayLike, q_before: npt.ArrayLike, q: npt.ArrayLike) -> Array:
        """What friction remembers one sample later, (m,): zeros before the first, when everything is slack."""
        function = self.casadi.remember
        return np.zeros(0) if function is None else values(function, None, (memory, q_before, q))

    def write_c(self, folder: str | Path, name: str = "robot_model") -> tuple[Path, ...]:
        """The model as C without dependencies: ``NAME.h``, ``NAME.c``, a test and ``CMakeLists.txt``; their paths.

        Args:
            folder: Made if it is not there.
            name: Of the files, and prefix of the functions; a C identifier.

        Raises:
            ParameterError: The name is no C identifier.
            OutputError: The files cannot be written.
        """
        from casysid.model.c_code import write_c

        return write_c(self, Path(folder), name)

    def pinocchio(self) -> Any:
        """A ``pin.Model`` of its own, with armature, damping and dry friction set; see :meth:`simulator_notes`."""
        from casysid.model.simulators import pinocchio_model

        return pinocchio_model(self)

    def mujoco(self, timestep: float = 0.001) -> Any:
        """A ``mujoco.MjModel`` of the tree, without geometry, its joints, bodies and motors by the robot's names.

        Armature, damping, dry friction and springs are set; see :meth:`simulator_notes`.

        Raises:
            RobotError: A link's parameters are not those of a body that could move.
        """
        from casysid.model.simulators import mujoco_model

        return mujoco_model(self, timestep)

    def simulator_notes(self) -> tuple[str, ...]:
        """What of the model Pinocchio's and MuJoCo's models have no place for, one sentence each."""
        from casysid.model.simulators import notes

        return notes(self)

    def values_of(self, kind: str) -> Array:
        """Parameters of one kind, such as "offset", by degree of freedom, shape (nv,); zero where there is none."""
        found = {one.owner: value for one, value in zip(self.regressor.parameters, self.parameters, strict=True)
                 if one.kind == kind}  # fmt: skip
        return np.array([found.get(dof, 0.0) for dof in self.robot.dofs])

    def _require(self, name: str) -> None:
        if getattr(self.casadi, name) is None:
            raise ParameterError(
                f"{name}: there is none, since the recordings' torques held nothing inertial, or a column of the "
                "model is not linear in the acceleration; torque, gravity and friction are there"
            )

    def _memory(
        self, q: npt.ArrayLike, v: npt.ArrayLike, time: npt.ArrayLike | None, memory: npt.ArrayLike | None
    ) -> Array | None:
        if not self.memory_size:
            return None
        if memory is not None:
            return np.asarray(memory, dtype=np.float64)
        if time is not None:
            return self.regressor.histories(q, time)[0]
        return self._values("slid", (v,), None)

    @single_threaded()
    def _values(self, name: str, inputs: tuple[npt.ArrayLike, ...], memory: Array | None) -> Array:
        every = inputs if memory is None else (*inputs, memory)
        return values(getattr(self.casadi, name), self._bulk[name], every)

    def _answer(
        self,
        name: str,
        inputs: tuple[npt.ArrayLike, ...],
        memory: Array | None,
        std: bool,
        error: Callable[[StandardErrors, list[Array]], Array],
    ) -> Answer:
        found = self._values(name, inputs, memory)
        return (found, error(self._errors, [np.asarray(x, dtype=np.float64) for x in inputs])) if std else found

    @property
    def _errors(self) -> StandardErrors:
        if self.scatter is None:
            raise ParameterError("model: nothing is known of the parameters' errors; std=True is not to be had")
        return StandardErrors(self.regressor, self.scatter)

    @cached_property
    def _bulk(self) -> dict[str, Bulk]:
        return {name: Bulk(one) for name, one in vars(self.casadi).items() if one is not None}
