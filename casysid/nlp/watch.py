"""What happens between two iterations of IPOPT: the report to the caller, a stop on request, Ctrl-C."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import FrameType
from typing import Any

import casadi as ca
import numpy as np

from casysid.arrays import Array, frozen


@dataclass(frozen=True, eq=False, kw_only=True)
class NlpIteration:
    """One step of IPOPT, as a progress function sees it.

    Attributes:
        step: Its number, from 0.
        objective: There.
        infeasibility: Largest violation of a bound or constraint.
        seconds: Since the solve began.
        variables: The point, shape (n,).
    """

    step: int
    objective: float
    infeasibility: float
    seconds: float
    variables: Array


Progress = Callable[[NlpIteration], bool | None]
"""Called at every iteration; an answer that is true stops the solver."""


class Watch(ca.Callback):
    """IPOPT's iteration callback: reports, and stops on request, on Ctrl-C and on an error in the report."""

    def __init__(self, variables: int, parameters: int, constraints: int) -> None:
        ca.Callback.__init__(self)
        sizes = {
            "x": variables,
            "lam_x": variables,
            "g": constraints,
            "lam_g": constraints,
            "lam_p": parameters,
            "f": 1,
        }
        self.names = [ca.nlpsol_out(i) for i in range(ca.nlpsol_n_out())]
        self.sizes = [sizes[name] for name in self.names]
        self.construct("watch", {})

    def begin(self, arguments: dict[str, Array], progress: Progress | None) -> None:
        """Forgets the last solve."""
        self.arguments, self.progress = arguments, progress
        self.interrupted = False
        self.error: BaseException | None = None
        self.step, self.start = 0, time.perf_counter()

    def get_n_in(self) -> int:
        """All outputs of a solver."""
        return len(self.names)

    def get_n_out(self) -> int:
        """One: whether to stop."""
        return 1

    def get_name_in(self, i: int) -> str:
        """CasADi's names of the outputs."""
        return str(self.names[i])

    def get_name_out(self, i: int) -> str:
        """CasADi's name for it."""
        return "ret"

    def get_sparsity_in(self, i: int) -> Any:
        """All dense."""
        return ca.Sparsity.dense(self.sizes[i])

    def eval(self, arguments: Any) -> list[int]:
        """1 to stop, 0 to go on."""
        if self.interrupted or self.progress is None:
            return [int(self.interrupted)]
        try:
            return [int(bool(self.progress(self._iteration(dict(zip(self.names, arguments, strict=True))))))]
        except BaseException as error:  # CasADi would print it and go on; run() raises it
            self.error = error
            return [1]

    def _iteration(self, values: dict[str, Any]) -> NlpIteration:
        x, g = values["x"].full().ravel(), values["g"].full().ravel()
        step, self.step = self.step, self.step + 1
        return NlpIteration(
            step=step,
            objective=float(values["f"]),
            infeasibility=largest_violation(x, g, self.arguments),
            seconds=time.perf_counter() - self.start,
            variables=frozen(x),
        )


@contextmanager
def interruptible(watch: Watch) -> Iterator[None]:
    """Ctrl-C stops the solver at its next iteration and is then handed to whoever handled it before."""
    previous = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(previous):
        yield
        return
    caught: list[tuple[int, FrameType | None]] = []

    def note(number: int, frame: FrameType | None) -> None:
        watch.interrupted = True
        caught.append((number, frame))

    signal.signal(signal.SIGINT, note)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, previous)
        if caught:
            previous(*caught[0])


def largest_violation(x: Array, g: Array, arguments: dict[str, Array]) -> float:
    """By how much ``x`` and ``g`` leave their bounds at most, 0 if nowhere."""
    excess = [arguments["lbx"] - x, x - arguments["ubx"], arguments["lbg"] - g, g - arguments["ubg"]]
    return float(max(np.max(part, initial=0.0) for part in excess))
