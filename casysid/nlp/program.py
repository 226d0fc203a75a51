"""Building a nonlinear program, and solving it."""

from __future__ import annotations

import math
import threading
import time
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
import numpy.typing as npt

from casysid.arrays import Array
from casysid.errors import ParameterError, SolverError
from casysid.nlp.results import NlpSettings, NlpSolution, NlpStatus
from casysid.nlp.watch import Progress, Watch, interruptible, largest_violation
from casysid.threads import look_again, single_threaded

_STATUS = {
    "Solve_Succeeded": NlpStatus.CONVERGED,
    "Feasible_Point_Found": NlpStatus.CONVERGED,
    "Solved_To_Acceptable_Level": NlpStatus.ACCEPTABLE,
    "User_Requested_Stop": NlpStatus.STOPPED,
    "Maximum_Iterations_Exceeded": NlpStatus.MAX_ITERATIONS,
    "Maximum_CpuTime_Exceeded": NlpStatus.MAX_SECONDS,
    "Maximum_WallTime_Exceeded": NlpStatus.MAX_SECONDS,
    "Infeasible_Problem_Detected": NlpStatus.INFEASIBLE,
}


class NonlinearProgram:
    """``min f(x, p)`` subject to bounds on ``x`` and ``g(x, p)``: solved for any parameters, bounds and start.

    Built by :func:`build_nlp`, never changed. Threads may share it: one solves while the others wait, because a CasADi
    solver that is entered twice at the same time crashes the interpreter.
    """

    def __init__(self, functions: dict[str, Any], settings: NlpSettings, derivatives: dict[str, Any]) -> None:
        self.settings = settings
        self.variables, self.parameters, self.constraints = (int(functions[key].numel()) for key in "xpg")
        self._functions, self._derivatives = functions, derivatives
        self._watch = Watch(self.variables, self.parameters, self.constraints)
        self._lock = threading.Lock()

    @cached_property
    def _cold(self) -> Any:
        return self._solver({})

    @cached_property
    def _warm(self) -> Any:
        names = ("bound_push", "bound_frac", "slack_bound_push", "slack_bound_frac", "mult_bound_push")
        pushes = {f"ipopt.warm_start_{name}": 1e-8 for name in names}
        return self._solver({"ipopt.warm_start_init_point": "yes", "ipopt.mu_init": 1e-6, **pushes})

    def _solver(self, more: dict[str, Any]) -> Any:
        options = {**self.settings.options(), **self._derivatives, **more, "iteration_callback": self._watch}
        try:
            solver = ca.nlpsol("program", "ipopt", self._functions, options)
        except RuntimeError as error:
            raise SolverError(f"IPOPT did not take the program: {error}") from error
        look_again()  # IPOPT brings its own BLAS
        return solver

    def run(
        self, arguments: dict[str, Array], warm: bool, progress: Progress | None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """CasADi's answer and statistics; raises what the progress function raised, and KeyboardInterrupt on Ctrl-C."""
        with self._lock:
            solver = self._warm if warm else self._cold
            self._watch.begin(arguments, progress)
            with single_threaded(), interruptible(self._watch):
                answer = solver(**arguments)
            if self._watch.error is not None:
                raise self._watch.error
            return answer, solver.stats()


def build_nlp(
    variables: Any,
    objective: Any,
    *,
    parameters: Any = None,
    constraints: Any = None,
    settings: NlpSettings | None = None,
    derivatives: dict[str, Any] | None = None,
) -> NonlinearProgram:
    """A program over CasADi symbols, not yet solved.

    Args:
        variables: Column of SX or MX symbols, n of them.
        objective: Scalar expression.
        parameters: Column of symbols whose values come with each solve; None for none.
        constraints: Column of expressions whose bounds come with each solve; None for none.
        settings: How IPOPT is asked to work.
        derivatives: Own derivative functions by CasADi's option name (``grad_f``, ``jac_g``, ``hess_lag``), where
            something better than automatic differentiation is known.
    """
    kind = type(variables)
    functions = {
        "x": variables,
        "f": objective,
        "p": kind(0, 1) if parameters is None else parameters,
        "g": kind(0, 1) if constraints is None else constraints,
    }
    return NonlinearProgram(functions, settings or NlpSettings(), derivatives or {})


def solve_nlp(
    program: NonlinearProgram,
    start: npt.ArrayLike,
    *,
    parameters: npt.ArrayLike = (),
    lower: npt.ArrayLike = -math.inf,
    upper: npt.ArrayLike = math.inf,
    constraint_lower: npt.ArrayLike = -math.inf,
    constraint_upper: npt.ArrayLike = math.inf,
    warm: NlpSolution | None = None,
    progress: Progress | None = None,
) -> NlpSolution:
    """Solves a program from a start. Look at the status before using the variables.

    Args:
        program: From :func:`build_nlp`.
        start: First point, shape (n,).
        parameters: Their values, shape (parameters,).
        lower: Bounds of the variables, shape (n,) or one for all.
        upper: Likewise.
        constraint_lower: Bounds of the constraints, shape (m,) or one for all.
        constraint_upper: Likewise.
        warm: Solution of a similar problem, whose multipliers are taken over; ``start`` should be near its variables.
        progress: Called at every iteration.

    Raises:
        ParameterError: A shape is wrong, a number is not finite, or a lower bound lies above an upper one.
        SolverError: IPOPT refused its options or could not be run.
        KeyboardInterrupt: Ctrl-C, within one iteration, when called from the main thread.
    """
    n, m = program.variables, program.constraints
    arguments = {
        "x0": _vector("start", start, n),
        "p": _vector("parameters", parameters, program.parameters),
        "lbx": _vector("lower", lower, n, bound=True),
        "ubx": _vector("upper", upper, n, bound=True),
        "lbg": _vector("constraint_lower", constraint_lower, m, bound=True),
        "ubg": _vector("constraint_upper", constraint_upper, m, bound=True),
    }
    for low, high in (("lbx", "ubx"), ("lbg", "ubg")):
        if np.any(arguments[low] > arguments[high]):
            raise ParameterError(
                f"NLP: lower bounds must not exceed upper ones; {low} > {high} in places "
                f"{np.flatnonzero(arguments[low] > arguments[high]).tolist()}"
            )
    if warm is not None:
        arguments |= {"lam_x0": warm.bound_multipliers, "lam_g0": warm.constraint_multipliers}
    began = time.perf_counter()
    try:
        answer, stats = program.run(arguments, warm is not None, progress)
    except RuntimeError as error:
        raise SolverError(f"IPOPT could not be run: {error}") from error
    return _solution(answer, stats, arguments, time.perf_counter() - began)


def _solution(
    answer: dict[str, Any], stats: dict[str, Any], arguments: dict[str, Array], seconds: float
) -> NlpSolution:
    reason = str(stats["return_status"])
    if reason == "Invalid_Option":
        raise SolverError(
            "IPOPT refused one of its options, most likely a linear solver that CasADi's wheel does not hold; "
            "use linear_solver 'mumps' or 'spral'"
        )
    x, g = answer["x"].full().ravel(), answer["g"].full().ravel()
    status, objective = _STATUS.get(reason, NlpStatus.FAILED), float(answer["f"])
    if not (math.isfinite(objective) and np.isfinite(x).all()):
        status = NlpStatus.FAILED
    return NlpSolution(
        status=status,
        reason=reason,
        variables=x,
        objective=objective,
        constraints=g,
        infeasibility=largest_violation(x, g, arguments),
        bound_multipliers=answer["lam_x"].full().ravel(),
        constraint_multipliers=answer["lam_g"].full().ravel(),
        iterations=int(stats.get("iter_count", 0)),
        seconds=seconds,
    )


def _vector(name: str, values: npt.ArrayLike, size: int, bound: bool = False) -> Array:
    array = np.asarray(values, dtype=np.float64)
    if bound and array.ndim == 0:
        array = np.full(size, array)
    if array.shape != (size,):
        raise ParameterError(f"NLP: {name} must have shape ({size},); got {array.shape}")
    if np.isnan(array).any() or not (bound or np.isfinite(array).all()):
        raise ParameterError(
            f"NLP: {name} must be finite numbers; look at places {np.flatnonzero(~np.isfinite(array)).tolist()}"
        )
    return array
