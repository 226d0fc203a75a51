"""The robot models that come with the package, found by name."""

from __future__ import annotations

import glob
from pathlib import Path

from casysid.errors import RobotError

_PACKAGE = Path(__file__).resolve().parent
_PLACES = (_PACKAGE / "models", _PACKAGE.parent / "models")  # installed from the wheel, source checkout
_SUFFIXES = (".urdf", ".xml")  # which file a bare name means, best first


def bundled_models() -> tuple[str, ...]:
    """Names of the models that come with the package, sorted."""
    directory = _directory()
    if directory is None:
        return ()
    return tuple(sorted(path.name for path in directory.iterdir() if (path / f"{path.name}.urdf").is_file()))


def find_model(name: str | Path) -> Path:
    """The model file that a user means: a path that exists, or a bundled model's name.

    Args:
        name: A file's path, which wins; or ``"head"`` (its URDF), ``"head.urdf"``, ``"head.xml"``; or the name of a
            variant in a model's folder, ``"quadrotor_loaded"``.

    Raises:
        RobotError: There is no such file and no such model; the message lists the models.
    """
    path, directory = Path(name), _directory()
    try:
        if path.is_file():
            return path
    except OSError as error:  # such as a name longer than the file system's
        raise RobotError(f"robot '{name}': cannot be opened: {error.strerror}") from error
    if directory is not None and path.name == str(name):
        for suffix in (path.suffix,) if path.suffix in _SUFFIXES else _SUFFIXES:
            stem = path.name.removesuffix(suffix)
            bundled = directory / stem / f"{stem}{suffix}"
            if bundled.is_file():
                return bundled
            if variant := next(directory.glob(f"*/{glob.escape(stem)}{suffix}"), None):
                return variant
    known = ", ".join(bundled_models()) or "none installed"
    raise RobotError(
        f"robot '{name}': wanted a URDF or MJCF file, or a bundled model ({known}); there is no such file "
        f"from {Path.cwd()}. Check the path"
    )


def _directory() -> Path | None:
    return next((place for place in _PLACES if place.is_dir()), None)
