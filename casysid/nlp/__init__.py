"""The one place that calls IPOPT: build a nonlinear program once, solve it many times.

CasADi's IPOPT is quiet about its failures and swallows Ctrl-C. Here a failure is a :class:`NlpStatus` that does not
look like success, refused options and errors in the caller's progress function are raised, and Ctrl-C stops within one
iteration.
"""

from casysid.nlp.program import NonlinearProgram, build_nlp, solve_nlp
from casysid.nlp.results import HessianKind, NlpSettings, NlpSolution, NlpStatus
from casysid.nlp.watch import NlpIteration, Progress

__all__ = [
    "HessianKind",
    "NlpIteration",
    "NlpSettings",
    "NlpSolution",
    "NlpStatus",
    "NonlinearProgram",
    "Progress",
    "build_nlp",
    "solve_nlp",
]
