"""MuJoCo's own warnings, which otherwise go to the terminal and into MUJOCO_LOG.TXT in the working folder."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def collected_warnings() -> Iterator[list[str]]:
    """What MuJoCo's library warns of for as long as the context lasts, in a list that grows."""
    import mujoco

    before, found = mujoco.get_mju_user_warning(), list[str]()
    mujoco.set_mju_user_warning(found.append)
    try:
        yield found
    finally:
        mujoco.set_mju_user_warning(before)
