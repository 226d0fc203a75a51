"""Variants of robot models as vendors, editors and converters leave them, for ``load_models.py``.

    python scripts/vary_models.py FOLDER... --out EMPTY_FOLDER

Every URDF in the folders is written once for each of :data:`WAYS`; those that MuJoCo takes without their geometry also
become MJCF, once for each of :data:`MJCF_WAYS`.
"""

from __future__ import annotations

import argparse
import re
import warnings
from collections.abc import Callable
from pathlib import Path

LETTERS = {"gb2312": "机器人", "gbk": "機器人", "shift_jis": "ロボット", "big5": "機器人", "euc-kr": "로봇"}
CUBE = '<body name="cube" pos="3 0 1"><freejoint/><geom type="box" size=".1 .1 .1" mass="1"/></body>'
MESH = (
    '<asset><texture name="t" type="2d" file="no.png"/><material name="grey" texture="t"/>'
    '<mesh name="shell" file="no/shell.stl"/></asset>'
)
MESH_GEOM = '<geom type="mesh" mesh="shell" material="grey" contype="0" conaffinity="0" mass="0"/>'


def declared(encoding: str, codec: str | None = None, letters: str = "é") -> Callable[[str], bytes]:
    """In another encoding, with letters of it in a comment."""

    def encode(text: str) -> bytes:
        body = re.sub(r"^\s*<\?xml.*?\?>", "", text, flags=re.DOTALL)
        whole = f'<?xml version="1.0" encoding="{encoding}"?>\n<!-- {letters} -->\n{body}'
        return whole.encode(codec or encoding, errors="replace")

    return encode


def replaced(pattern: str, by: str, count: int = 0) -> Callable[[str], bytes]:
    """With a pattern replaced, ``count`` times or everywhere."""
    return lambda text: re.sub(pattern, by, text, count=count, flags=re.DOTALL).encode()


WAYS: dict[str, Callable[[str], bytes]] = {
    "as_it_is": str.encode,
    **{f"in_{name}": declared(name, letters=letters) for name, letters in LETTERS.items()},
    "in_ansi": declared("ANSI", "cp1252"),
    **{f"in_windows_{page}": declared(f"windows-{page}", letters="") for page in (1250, 1251, 1252, 1254)},
    "in_utf_16": declared("utf-16"),
    "not_what_it_declares": declared("shift_jis", "utf-8", "größer \x81 ロ"),
    "with_mark": lambda text: b"\xef\xbb\xbf" + text.lstrip().encode(),
    "with_crlf": lambda text: text.replace("\n", "\r\n").encode(),
    "cut_off": lambda text: text[: 6 * len(text) // 10].encode(),
    "without_inertias": replaced(r"<inertial>.*?</inertial>", ""),
    "without_limits": replaced(r"<limit\s[^>]*/>", ""),
    "massless": replaced(r"<mass\s+value\s*=\s*\"[^\"]*\"", '<mass value="0"'),
    "nan_mass": replaced(r"<mass\s+value\s*=\s*\"[^\"]*\"", '<mass value="nan"', 1),
    "decimal_comma": replaced(r"<mass\s+value\s*=\s*\"(\d+)\.(\d+)\"", r'<mass value="\1,\2"'),
    "identity_inertias": replaced(r"<inertia\s[^>]*/>", '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>'),
    "in_grams": replaced(r"(<mass\s+value\s*=\s*\")([^\"]*)\"", r'\g<1>\g<2>e3"'),
    "negative_friction": replaced(r"(<axis\s[^>]*/>)", r'\1<dynamics damping="-1" friction="-0.2"/>'),
    "all_fixed": replaced(r'type\s*=\s*"(revolute|continuous|prismatic)"', 'type="fixed"'),
    "all_mimic": replaced(r"(<axis\s[^>]*/>)", r'\1<mimic joint="nobody"/>'),
    "one_name": replaced(r'<joint\s+name="[^"]*"', '<joint name="joint"'),
    "with_xacro": replaced(r"(<robot[^>]*>)", r'\1<xacro:include filename="x.xacro"/>', 1),
    "with_extras": replaced(r"</robot>", "<gazebo><plugin/></gazebo><transmission name='t'/></robot>"),
    "floating": replaced(r'type\s*=\s*"(revolute|continuous|prismatic)"', 'type="floating"', 1),
}
MJCF_WAYS: dict[str, Callable[[str], bytes]] = {
    "mjcf": str.encode,
    "mjcf_gb2312": declared("gb2312", letters="机器人"),
    "mjcf_ansi": declared("ANSI", "cp1252"),
    "mjcf_scene": replaced(r"</worldbody>", f"{CUBE}</worldbody>", 1),
    "mjcf_meshes": lambda text: replaced(r"(<inertial\s[^>]*/>)", rf"\1{MESH_GEOM}")(
        text.replace("<worldbody>", f"{MESH}<worldbody>", 1)
    ),
    "mjcf_include": replaced(r"<worldbody>", '<include file="../elsewhere.xml"/><worldbody>', 1),
    "mjcf_cut": lambda text: text[: len(text) // 2].encode(),
    "mjcf_static": replaced(r"<(joint|freejoint)\s[^>]*/>", ""),
}


def as_mjcf(text: str) -> str | None:
    """The model as MuJoCo writes it, without its geometry; None where MuJoCo does not take it."""
    import mujoco

    bare = re.sub(r"<(visual|collision|material)\b[^>]*/>", "", text)
    bare = re.sub(r"<(visual|collision|material)\b.*?</\1>", "", bare, flags=re.DOTALL)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            spec = mujoco.MjSpec.from_string(bare)
            spec.compile()
            return str(spec.to_xml())
        except (ValueError, RuntimeError, MemoryError):
            return None


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="+", type=Path, metavar="FOLDER", help="looked through with all below them")
    parser.add_argument("--out", type=Path, required=True, help="folder for the variants")
    options = parser.parse_args()
    count = 0
    for k, file in enumerate(sorted(path for folder in options.folders for path in folder.rglob("*.urdf"))):
        text = file.read_bytes().decode("utf-8", errors="replace")
        home = options.out / f"{k:03d}_{file.stem}"
        home.mkdir(parents=True)
        variants = {f"{name}.urdf": way(text) for name, way in WAYS.items()}
        mjcf = as_mjcf(text)
        if mjcf is not None:
            variants |= {f"{name}.xml": way(mjcf) for name, way in MJCF_WAYS.items()}
        for name, content in variants.items():
            (home / name).write_bytes(content)
        count += len(variants)
    print(f"{count} variants in {options.out}")


if __name__ == "__main__":
    main()
