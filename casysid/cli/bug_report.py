"""What is nobody's bad input is a fault of casysid: one short message, and all that is needed to find it in a file."""

from __future__ import annotations

import os
import platform
import shlex
import sys
import tempfile
import traceback
from pathlib import Path

INTERNAL_FAULT = 70
"""As EX_SOFTWARE of BSD's sysexits.h."""


def describe_fault(error: BaseException) -> str:
    """One message for a person, who finds there where the traceback was saved."""
    summary = traceback.format_exception_only(error)[-1].strip().splitlines()[0]
    try:
        saved = f"The traceback was saved in {_save(error)}; please report it to the authors of casysid with that file"
    except OSError as failure:
        saved = f"The traceback could not be saved ({failure.strerror}); please report it to the authors of casysid"
    return (
        f"{summary}. This is a fault of casysid, not of your input. {saved}, the command line, and the input if you "
        "may share it"
    )


def _save(error: BaseException) -> Path:
    """A new file that only this user can read, in the user's state directory, else where temporary files go."""
    from casysid import __version__

    text = "\n".join(
        [
            f"casysid {__version__}, Python {platform.python_version()}, {platform.platform()}",
            shlex.join(sys.argv),
            "".join(traceback.format_exception(error)),
        ]
    )
    try:
        folder = _state_folder()
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        descriptor, name = tempfile.mkstemp(prefix="fault-", suffix=".txt", dir=folder)
    except (OSError, RuntimeError):  # no such place, or no home
        descriptor, name = tempfile.mkstemp(prefix="casysid-fault-", suffix=".txt")
    with os.fdopen(descriptor, "w", encoding="utf-8", errors="backslashreplace") as stream:
        stream.write(text)
    return Path(name)


def _state_folder() -> Path:
    named = os.environ.get("XDG_STATE_HOME", "")
    return (Path(named) if os.path.isabs(named) else Path.home() / ".local" / "state") / "casysid"
