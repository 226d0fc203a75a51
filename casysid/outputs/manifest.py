"""What a run wrote into a folder, so that the next one can tell its files from those of others."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath

from casysid.errors import OutputError
from casysid.outputs.files import write_whole

MANIFEST = ".casysid.json"
"""Where it is written down, in the same folder."""


@dataclass(frozen=True)
class Manifest:
    """The files of a run.

    Attributes:
        identity: What tells the run from others; empty if nothing does.
        files: SHA-256 by name relative to the folder.
    """

    identity: str = ""
    files: Mapping[str, str] = field(default_factory=dict)

    @classmethod
    def of(cls, home: Path) -> Manifest:
        """What is written down in a folder; an empty one if that is nothing, or nonsense."""
        try:
            content = json.loads((home / MANIFEST).read_bytes())
            files = {str(name): str(digest) for name, digest in content["files"].items() if _is_inside(str(name))}
            return cls(str(content["run"]), files)
        except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
            return cls()

    @classmethod
    def describe(cls, folder: Path, identity: str) -> Manifest:
        """The files that are in a folder, those in its folders too."""
        return cls(identity, {name: _digest(folder / name) for name in files_in(folder)})

    def unchanged_in(self, home: Path) -> set[str]:
        """Names of those files that are still as they were written."""
        return {
            name
            for name, digest in self.files.items()
            if (home / name).is_file() and not (home / name).is_symlink() and _digest(home / name) == digest
        }

    def joining(self, earlier: Manifest, home: Path) -> Manifest:
        """These files with those of the same run that are there already; an empty one if no run is written down.

        Raises:
            OutputError: A file would take the place of another run's.
        """
        if self.identity and self.identity == earlier.identity:
            return Manifest(self.identity, {**earlier.files, **self.files})
        strange = sorted(set(self.files) & set(earlier.files))
        if strange:
            raise OutputError(
                f"{home / strange[0]}: not written: the folder holds another run's files by now. Write the result "
                "there again, or name another place"
            )
        return Manifest()

    def write(self, folder: Path) -> None:
        """Write it down in a folder."""
        content = {"run": self.identity, "files": dict(sorted(self.files.items()))}
        write_whole(folder / MANIFEST, (json.dumps(content, indent=1) + "\n").encode())


def files_in(folder: Path) -> list[str]:
    """Names of all files in a folder and its folders, relative to it, sorted; links are not followed."""
    found = (path for path in folder.rglob("*") if path.is_symlink() or path.is_file())
    return sorted(path.relative_to(folder).as_posix() for path in found)


def _digest(path: Path) -> str:
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def _is_inside(name: str) -> bool:
    path = PurePosixPath(name)
    return bool(path.parts) and not path.is_absolute() and ".." not in path.parts
