"""Meshes, textures and height fields of an MJCF that moves to another folder, or absorbs other models."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from casysid.robot.xmlpatch import XmlPatch, element_text, path_from
from casysid.robot.xmltext import Element

_FOLDER_OF = {"mesh": "meshdir", "hfield": "meshdir", "skin": "meshdir", "texture": "texturedir"}


def redirect_files(patch: XmlPatch, root: Element, origin: Path, folder: Path) -> None:
    """Lets relative paths of assets point from ``folder`` to where they pointed from ``origin``."""
    if not any("file" in name for element in root.walk() if element.tag != "include" for name in element.attributes):
        return
    folders = _asset_folders(root)
    redirected = {
        name: path_from(folder, value, origin) for name, value in folders.items() if not Path(value).is_absolute()
    }
    compilers = root.find_all("compiler")
    if compilers:
        patch.set(compilers[-1], **redirected)
    else:
        patch.prepend(root, element_text("compiler", redirected))
    for element in root.walk():
        file = element.attributes.get("file", "")
        if element.tag == "model" and not Path(file).is_absolute():
            patch.set(element, file=path_from(folder, file, origin))


def name_attached_files(patch: XmlPatch, root: Element, compiled: Any, origin: Path) -> None:
    """Names the files of attached models, whose own asset folders MuJoCo's text of the whole leaves out."""
    folders, paths = _asset_folders(root), _compiled_paths(compiled)
    for element in root.walk():
        if element.tag not in _FOLDER_OF or "file" not in element.attributes:
            continue
        home = origin / folders[_FOLDER_OF[element.tag]]
        file = element.attributes["file"]
        path = paths.get((element.tag, element.name or Path(file).stem))
        if path is not None and path.resolve() != (home / file).resolve():
            patch.set(element, file=path_from(home, os.fspath(path.resolve()), home))


def _asset_folders(root: Element) -> dict[str, str]:
    """What ``meshdir`` and ``texturedir`` come to."""
    folders = dict.fromkeys(_FOLDER_OF.values(), "")
    for compiler in root.find_all("compiler"):
        shared = compiler.attributes.get("assetdir")
        for name, value in folders.items():
            folders[name] = compiler.attributes.get(name, value if shared is None else shared)
    return folders


def _compiled_paths(compiled: Any) -> dict[tuple[str, str], Path]:
    """Where MuJoCo found the file of each asset, by kind and name."""
    found: dict[tuple[str, str], Path] = {}
    for kind, prefix in (("mesh", "mesh"), ("hfield", "hfield"), ("skin", "skin"), ("texture", "tex")):
        for k, start in enumerate(getattr(compiled, f"{prefix}_pathadr")):
            if start >= 0:
                name = getattr(compiled, prefix)(k).name
                found[kind, name] = Path(compiled.paths[start : compiled.paths.index(b"\0", start)].decode())
    return found
