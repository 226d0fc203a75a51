"""What is to be designed, for which robot, within which limits."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array, frozen
from casysid.errors import ParameterError
from casysid.excitation.constraints.constraint import Constraint
from casysid.excitation.constraints.solid_distances import SolidDistances
from casysid.excitation.design.criteria import AOptimal, Criterion
from casysid.excitation.design.information import Information
from casysid.excitation.motion.fourier import ExcitationTrajectory, FourierSeries, Motion
from casysid.excitation.motion.limits import JointLimits
from casysid.robot import Robot
from casysid.threads import single_threaded

REFINEMENT = 10
"""The check looks at so many times as many instants as the design."""
BETWEEN = 2e-4
"""Share of its scale that every quantity keeps to its bound at the instants of the check, for what happens between."""
TIGHTENING = {False: 0.006, True: 0.003}
"""How far, as a share of each limit, the optimiser stays within it, for what happens between instants of its grid
and for the errors of a good controller; less from a start that is given, which may be where another design started."""


@dataclass(frozen=True, eq=False, kw_only=True)
class ExcitationProblem:
    """What :func:`~casysid.excitation.design.design_excitation` solves.

    Attributes:
        robot: Whose joints are moved.
        series: The basis of the motion.
        periods: How often it is repeated.
        rate: Samples of the recording per second [Hz].
        limits: Of the joints.
        parameters: Of the prior model, shape (p,).
        information: How to see what a motion tells.
        known: Information from earlier recordings, shape (r, r), scaled.
        criterion: To be minimised.
        constraints: To be kept.
        samples: Instants of the design grid.
        start: Positions to start from, shape (n,); None leaves them to the design.
        notes: What was assumed or left out, in words.
        solids: The file's own shapes, which a motion to be played is checked against; None where there are none.
    """

    robot: Robot
    series: FourierSeries
    periods: int
    rate: float
    limits: JointLimits
    parameters: Array
    information: Information
    known: Array
    criterion: Criterion
    constraints: tuple[Constraint, ...]
    samples: int
    start: Array | None
    notes: tuple[str, ...] = ()
    solids: SolidDistances | None = None

    @property
    def measured(self) -> float:
        """Samples in the whole recording."""
        return self.rate * self.series.period * self.periods

    @property
    def tightening(self) -> float:
        """See :data:`TIGHTENING`."""
        return TIGHTENING[self.start is not None]

    def variables(self, trajectory: ExcitationTrajectory) -> Array:
        """The design's variables of a trajectory, shape (n (1 + series.size),)."""
        values = np.column_stack([trajectory.start, trajectory.coordinates])
        return np.asarray(values / self.limits.half_range[:, None]).ravel()

    def trajectory(self, x: Array) -> ExcitationTrajectory:
        """Of the design's variables."""
        values = np.asarray(x).reshape(len(self.robot.dofs), -1) * self.limits.half_range[:, None]
        return ExcitationTrajectory(
            robot=self.robot, series=self.series, start=values[:, 0], coordinates=values[:, 1:], periods=self.periods
        )

    def gained(self, trajectory: ExcitationTrajectory, refinement: int = 1) -> Array:
        """Information of a trajectory alone, all periods, shape (r, r), scaled."""
        grid = self.samples * refinement
        total = self.information.of_motion(trajectory.motion(self.series.grid(grid)))
        return np.asarray(total * (self.measured / grid))

    def judged_by(self, criterion: Criterion) -> ExcitationProblem:
        """The same with another criterion."""
        return dataclasses.replace(self, criterion=criterion)

    def starting_at(self, position: Array) -> ExcitationProblem:
        """The same from given positions, shape (n,)."""
        return dataclasses.replace(self, start=frozen(position))

    def knowing(self, information: Array) -> ExcitationProblem:
        """The same with more information beforehand, shape (r, r), scaled, as :meth:`gained` returns it."""
        return dataclasses.replace(self, known=frozen(self.known + information))

    def knowing_gram(self, gram: npt.ArrayLike) -> ExcitationProblem:
        """The same, after recordings with ``Σ σ⁻² x xᵀ`` of all p columns, shape (p, p).

        That is ``moments.pooled(noise_std**-2).xx`` for a regressor with the same columns.

        Raises:
            ParameterError: The shape does not fit.
        """
        values, p = np.asarray(gram, dtype=np.float64), len(self.information.regressor.names)
        if values.shape != (p, p) or not np.isfinite(values).all():
            raise ParameterError(
                f"excitation: known information must be finite and of shape ({p}, {p}), for the columns "
                f"{self.information.regressor.names[0]} ... {self.information.regressor.names[-1]}; got {values.shape}"
            )
        return self.knowing(self.information.of_parameters(values))


@single_threaded()
def parameter_accuracy(problem: ExcitationProblem, names: Sequence[str]) -> AOptimal:
    """The criterion: mean variance of the base parameters that the named parameters are part of, in the scaled units.

    Raises:
        ParameterError: A name is unknown, or no motion can tell anything of it.
    """
    base = problem.information.base
    chosen = np.zeros(base.rank)
    for name in names:
        if name not in base.names:
            raise ParameterError(f"excitation: no parameter is named '{name}'; names are like '{base.names[0]}'")
        weights = np.abs(base.transform[:, base.names.index(name)])
        if not weights.any():
            raise ParameterError(f"excitation: parameter '{name}' acts on no joint torque, so no motion shows it")
        chosen[weights > 1e-3 * weights.max()] = 1.0
    if not chosen.any():
        raise ParameterError("excitation: parameter_accuracy wants at least one parameter's name")
    return AOptimal(np.diag(chosen))


@single_threaded()
def torque_accuracy(problem: ExcitationProblem, *, samples: int = 500, seed: int = 0) -> AOptimal:
    """The criterion: mean variance of torques predicted at random states within the limits, relative to the noise."""
    states = random_states(problem.limits, problem.series, np.random.default_rng(seed), samples)
    return AOptimal(problem.information.of_motion(states) / samples)


def random_states(limits: JointLimits, series: FourierSeries, rng: np.random.Generator, count: int) -> Motion:
    """Unordered states within the limits, accelerations as the third harmonic has them at full speed."""
    shape = (count, len(limits.lower))
    fast = np.minimum(limits.velocity * 2.0 * np.pi * 3.0 / series.period, limits.acceleration)
    return Motion(
        rng.uniform(limits.lower, limits.upper, shape),
        rng.uniform(-1.0, 1.0, shape) * limits.velocity,
        rng.uniform(-1.0, 1.0, shape) * fast,
        np.zeros(shape),
    )
