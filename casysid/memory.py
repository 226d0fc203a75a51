"""Refuses a computation whose memory would not be there, before it is asked for.

Estimates count the arrays of known shape that live at the same time; what a machine cannot hold would otherwise end in
the middle of the work, or take the machine down with it.
"""

from __future__ import annotations

import os
from collections.abc import Sequence

from casysid.errors import ParameterError

USABLE = 0.8
"""Share of the memory that one computation may plan with: the rest is the operating system's and the interpreter's."""
NUMBER = 8
"""Bytes of a double."""
COPIES = 9
"""Of a recording's moments at once while noise is taken out and a fit is made (measured at 60 joints, 6000 rows)."""
SQUARES = 40
"""Matrices of all columns by all columns at once in a fit, its covariance, and its projection (measured likewise)."""


def memory_limit() -> float:
    """Bytes that one computation may plan with: a share of the machine's memory, or of the process's own limit."""
    amounts = [float("inf")]
    if hasattr(os, "sysconf") and "SC_PHYS_PAGES" in os.sysconf_names:
        amounts.append(float(os.sysconf("SC_PHYS_PAGES")) * os.sysconf("SC_PAGE_SIZE"))
    try:
        import resource
    except ImportError:  # no such limits on this system
        return USABLE * min(amounts)
    soft = resource.getrlimit(resource.RLIMIT_AS)[0]
    if soft != resource.RLIM_INFINITY:
        amounts.append(float(soft))
    return USABLE * min(amounts)


def moments_memory(widths: Sequence[int], blocks: int, columns: int) -> float:
    """Bytes that it takes to sum up a recording and to fit its moments.

    Args:
        widths: Columns of each joint's row.
        blocks: Blocks of time.
        columns: Of all rows together.
    """
    squares = sum((width + 1.0) ** 2 for width in widths)
    return NUMBER * (COPIES * blocks * squares + SQUARES * float(columns) ** 2)


def require_memory(wanted: float, what: str, advice: str) -> None:
    """Refuse what needs more than :func:`memory_limit`.

    Args:
        wanted: Bytes.
        what: Begins the message, with what is wanted and for how large a robot.
        advice: What to do about it, an imperative.

    Raises:
        ParameterError: It does not fit.
    """
    limit = memory_limit()
    if wanted > limit:
        raise ParameterError(
            f"{what} takes about {wanted / 1e9:.3g} GB of memory; wanted at most {limit / 1e9:.3g} GB, {USABLE:.0%} of "
            f"what this machine or its limit for a process has. {advice}"
        )
