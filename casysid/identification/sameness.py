"""Recordings that hold the same samples: held out they prove nothing, fitted they count twice."""

from __future__ import annotations

import hashlib
import warnings
from collections.abc import Sequence

import numpy as np

from casysid.errors import CasysidWarning, RecordingError
from casysid.recording import Source

PIECES, ROWS = 8, 64
"""Of a recording, from which it is known again."""


def check_sameness(fitted: Sequence[Source], held_out: Sequence[Source]) -> None:
    """Nothing, if no recording that is held out is a fitted one; a warning where one is fitted twice.

    Raises:
        RecordingError: The samples of a held-out recording are those of a fitted one, whatever their files.
    """
    known: dict[bytes, Source] = {}
    for one in fitted:
        if (other := known.setdefault(fingerprint(one), one)) is not one:
            words = f"{one.label}: holds the same samples as {other.label}, which count twice; leave one out"
            warnings.warn(words, CasysidWarning, stacklevel=4)
    for one in held_out:
        if (same := known.get(fingerprint(one))) is not None:
            raise RecordingError(
                f"{one.label}: is held out, but holds the same samples as {same.label}, which is fitted: what was "
                "fitted cannot judge the fit. Hold out a recording of another motion, or split this one by --split 0.6"
            )


def fingerprint(source: Source) -> bytes:
    """Of the number of samples and of positions and torques at places all over them."""
    digest = hashlib.sha256(str(len(source)).encode())
    places = np.unique(np.linspace(0, max(len(source) - ROWS, 0), PIECES).astype(np.intp))
    for first in places.tolist():
        part = source.between(first, min(first + ROWS, len(source))).in_memory()
        for values in (part.position, part.torque):
            digest.update(np.ascontiguousarray(values).tobytes())
    return digest.digest()
