"""The regressor: every torque equation's coefficients of inertial and drive parameters, with what each column means."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
import numpy.typing as npt

from casysid.arrays import Array, frozen
from casysid.dynamics import symbolic
from casysid.dynamics.bulk import Bulk
from casysid.dynamics.drive import FrictionPart, Parameter, PartMaker, continued_positions
from casysid.dynamics.friction import DEFAULT_FRICTION, Coupling, Direction, FrictionKind, Law
from casysid.dynamics.joints import constant
from casysid.dynamics.template import Expressions, Sensing, Template, build_template, finish_template
from casysid.errors import ParameterError
from casysid.robot import Robot


@dataclass(frozen=True, eq=False, kw_only=True)
class Regressor:
    """``tau = Y(q, v, a) θ``, for one robot with its friction.

    Attributes:
        template: What this regressor is with its friction's numbers left open.
        numbers: Those, in the order of ``template.parts``.
        parts: Friction in it, in the order of its columns.
        friction: Kinds of friction that every joint was given.
        couplings: Transmissions in it.
    """

    template: Template
    numbers: Array
    parts: tuple[FrictionPart, ...]
    friction: tuple[FrictionKind, ...] = ()
    couplings: tuple[Coupling, ...] = ()

    @property
    def robot(self) -> Robot:
        """Whose torques these are."""
        return self.template.robot

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """What the p columns multiply: ten for each link, then friction kind by kind, then couplings."""
        return self.template.parameters

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the p columns."""
        return tuple(parameter.name for parameter in self.parameters)

    @cached_property
    def column_kinds(self) -> tuple[str, ...]:
        """Of each of the p columns its kind of friction; empty for a link's."""
        kinds = {column: part.kind.kind for part in self.parts for column in part.columns}
        return tuple(kinds.get(column, "") for column in range(len(self.parameters)))

    @cached_property
    def prior(self) -> Array:
        """The model file's parameters, shape (p,)."""
        return frozen([parameter.prior for parameter in self.parameters])

    @cached_property
    def friction_laws(self) -> tuple[Law, ...]:
        """What friction's parameters obey beside the signs of each."""
        beside: dict[str, dict[str, str]] = {}
        for part in self.parts:
            for column in part.columns:
                beside.setdefault(part.direction.name, {}).setdefault(self.parameters[column].kind, self.names[column])
        return tuple(
            law
            for part in self.parts
            for law in part.kind.laws([self.names[column] for column in part.columns], beside[part.direction.name])
        )

    @property
    def row_columns(self) -> tuple[npt.NDArray[np.intp], ...]:
        """For each degree of freedom, the columns that are structurally nonzero in its row of ``Y``."""
        return self.template.row_columns

    @cached_property
    def history_count(self) -> int:
        """How many signals of the motion before it asks for."""
        return int(self.template.function.nnz_in("histories"))

    @cached_property
    def function(self) -> Any:
        """``casadi.Function`` ``(q, v, a) -> Y``, sparse, shape (nv, p); with histories, if any, as last input."""
        state, histories = symbolic.State.of(self.robot), self._history_symbols
        inputs = [state.q, state.v, state.a, *histories]
        Y = self.template.function(*inputs, *([] if histories else [ca.SX(0, 1)]), constant(self.numbers))
        names = ["q", "v", "a", "histories"][: len(inputs)]
        return ca.Function("regressor", inputs, [Y], names, ["Y"], {"cse": True})

    @cached_property
    def torque(self) -> Any:
        """``casadi.Function`` ``(q, v, a, parameters) -> tau``: ``Y θ`` in fewer operations; histories as there."""
        state, histories = symbolic.State.of(self.robot), self._history_symbols
        inputs = [state.q, state.v, state.a, ca.SX.sym("parameters", len(self.parameters)), *histories]
        tau = self.template.torque(*inputs, *([] if histories else [ca.SX(0, 1)]), constant(self.numbers))
        names = ["q", "v", "a", "parameters", "histories"][: len(inputs)]
        return ca.Function("torque", inputs, [tau], names, ["tau"], {"cse": True})

    @property
    def _history_symbols(self) -> list[Any]:
        return [ca.SX.sym("histories", self.history_count)] if self.history_count else []

    @property
    def equations(self) -> Bulk:
        """Bulk evaluation of ``(q, v, a, tau)``, with :meth:`histories` as a fifth input where there are any.

        Gives for each degree of freedom its row's nonzeros, then its torque; the entries of row ``i`` belong to the
        columns ``row_columns[i]``.
        """
        return self._settled(self.template.equations)

    def _settled(self, bulk: Bulk) -> Bulk:
        return bulk.given(*([] if self.history_count else [np.zeros(0)]), self.numbers)

    def histories(self, q: npt.ArrayLike, time: npt.ArrayLike | None = None) -> tuple[Array, ...]:
        """What friction remembers at every sample, as one input of shape (N, m) more; nothing if it remembers nothing.

        Args:
            q: Configurations in order of time, shape (N, nq).
            time: [s], shape (N,); None numbers the samples.

        Raises:
            ParameterError: A shape does not fit.
        """
        if not self.history_count:
            return ()
        rows = np.asarray(q, dtype=np.float64)
        if rows.ndim != 2 or rows.shape[1] != self.robot.nq:
            raise ParameterError(
                f"friction: what remembers needs q of many samples, (N, {self.robot.nq}); got {rows.shape}"
            )
        at = np.arange(len(rows), dtype=np.float64) if time is None else np.asarray(time, dtype=np.float64)
        positions = continued_positions(self.robot, rows)
        signals = [
            history.values(at, positions @ part.direction.weights)
            for part in self.parts
            for history in part.kind.histories(part.direction)
        ]
        return (np.stack(signals, axis=1),)

    def evaluate(
        self,
        q: npt.ArrayLike,
        v: npt.ArrayLike,
        a: npt.ArrayLike,
        *,
        time: npt.ArrayLike | None = None,
        histories: tuple[Array, ...] | None = None,
    ) -> Array:
        """``Y`` at every sample, dense, shape (N, nv, p): 8 N nv p bytes.

        Args:
            q: Configurations, shape (N, nq).
            v: Velocities, shape (N, nv).
            a: Accelerations, shape (N, nv).
            time: As for :meth:`histories`.
            histories: What these gave for the samples, where they are some of many; None asks.

        Raises:
            ParameterError: When a shape does not fit.
        """
        nv, p = self.robot.nv, len(self.parameters)
        rows = self.equations
        remembered = self.histories(q, time) if histories is None else histories
        inputs, samples = rows.check((q, v, a, np.zeros(nv), *remembered))
        out = np.zeros((samples, nv * p))
        places = np.concatenate([np.append(dof * p + columns, -1) for dof, columns in enumerate(self.row_columns)])
        filled = places >= 0  # without the torques

        def keep(values: Array, piece: npt.NDArray[np.intp]) -> None:
            out[piece[:, None], places[filled]] = values[filled].T

        deque(rows.map(keep, inputs, [np.arange(samples)], threads=2), maxlen=0)
        return out.reshape(samples, nv, p)

    def predict(
        self,
        parameters: npt.ArrayLike,
        q: npt.ArrayLike,
        v: npt.ArrayLike,
        a: npt.ArrayLike,
        *,
        time: npt.ArrayLike | None = None,
        histories: tuple[Array, ...] | None = None,
    ) -> Array:
        """Torques at every sample, shape (N, nv), in memory of that size.

        Args:
            parameters: ``θ``, shape (p,).
            q: Configurations, shape (N, nq).
            v: Velocities, shape (N, nv).
            a: Accelerations, shape (N, nv).
            time: As for :meth:`histories`.
            histories: What these gave, where several vectors of parameters are asked; None asks.

        Raises:
            ParameterError: When a shape does not fit.
        """
        remembered = self.histories(q, time) if histories is None else histories
        return self._settled(self.template.torques).evaluate(q, v, a, parameters, *remembered)


def build_regressor(
    robot: Robot,
    friction: Sequence[FrictionKind] = DEFAULT_FRICTION,
    couplings: Sequence[Coupling] = (),
    *,
    quasi_static: bool = False,
    torque_gains: Sequence[float] | None = None,
) -> Regressor:
    """The regressor of a robot.

    Args:
        robot: Its links give ten columns each.
        friction: Kinds that act on every driven degree of freedom, and on every coupling as far as motion changes them
            (a coupling's constant torque is a sum of its joints' constant torques).
        couplings: Motors that act on several joints.
        quasi_static: Torques hold gravity and friction, but nothing inertial: for links velocity and acceleration, for
            drives acceleration count as zero.
        torque_gains: Measured torque over true torque of every degree of freedom, shape (nv,), negative where it is
            logged with the other sign; None is ones.

    Raises:
        ParameterError: When a kind of friction or a coupling is given twice, a coupling names an unknown joint, or a
            column uses the position of a degree of freedom that has none; or gains are not nv numbers other than zero.
    """
    gains = np.ones(robot.nv) if torque_gains is None else np.asarray(torque_gains, dtype=np.float64)
    if gains.shape != (robot.nv,) or not (np.isfinite(gains).all() and gains.all()):
        raise ParameterError(
            f"torque gains: one number other than zero for each of {', '.join(robot.dofs)}; got {torque_gains}"
        )
    kinds, coupled = [column.kind for column in friction], [coupling.name for coupling in couplings]
    if len(set(kinds)) != len(kinds) or len(set(coupled)) != len(coupled):
        raise ParameterError(f"friction: every kind and every coupling once; got {kinds} and {coupled}")
    template = build_template(robot, friction, couplings, Sensing(tuple(gains.tolist()), quasi_static))
    by_name = {kind.kind: kind for kind in friction}
    parts = tuple(replace(part, kind=by_name[part.kind.kind]) for part in template.parts)
    return Regressor(
        template=template,
        numbers=_numbers(parts),
        parts=parts,
        friction=tuple(friction),
        couplings=tuple(couplings),
    )


def extend_regressor(regressor: Regressor, additions: Sequence[tuple[FrictionKind, Direction]]) -> Regressor:
    """A regressor with further friction, each along one direction, named by its place so that kinds may repeat.

    Raises:
        ParameterError: A kind does not act along its direction, or uses a position that is none.
    """
    robot, state, sensing = regressor.robot, symbolic.State.of(regressor.robot), regressor.template.sensing
    part_along = PartMaker(robot, sensing.state_of_drives(state))
    found = [(kind, direction, next(part_along(kind, direction), None)) for kind, direction in additions]
    missing = [f"{kind.kind} of {direction.name}" for kind, direction, part in found if part is None]
    if missing:
        raise ParameterError(f"friction: no column for {', '.join(missing)}")
    extra = [part for _, _, part in found if part is not None]
    parameters = (
        *regressor.parameters,
        *(
            replace(parameter, name=f"{parameter.name} #{k}")
            for k, part in enumerate(extra)
            for parameter in part.parameters
        ),
    )
    more = sensing.matrix @ ca.horzcat(ca.SX(robot.nv, 0), *(part.torques for part in extra))
    theta, p = ca.SX.sym("parameters", len(parameters)), len(regressor.parameters)
    known = ca.SX.sym("histories", regressor.history_count)
    inputs, earlier = (state.q, state.v, state.a), [known] if regressor.history_count else []
    Y = ca.horzcat(regressor.function(*inputs, *earlier), more)
    tau = regressor.torque(*inputs, theta[:p], *earlier) + more @ theta[p:]
    histories = ca.vertcat(known, *(part.histories for part in extra))
    template = finish_template(robot, state, sensing, Expressions(parameters, Y, theta, tau, histories), extra)
    return Regressor(template=template, numbers=_numbers(template.parts), parts=(*regressor.parts, *template.parts))


def _numbers(parts: Sequence[FrictionPart]) -> Array:
    """What enters nonlinearly, in the order of the parts."""
    return frozen([number for part in parts for number in part.kind.numbers(part.direction)])
