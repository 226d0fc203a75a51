"""Draw each bundled model's picture with MuJoCo, without a display.

Needs PyOpenGL, Pillow and EGL (or OSMesa: set ``MUJOCO_GL=osmesa``). Run ``python scripts/render_models.py [NAME...]``.
"""

from __future__ import annotations

import argparse
import os

os.environ.setdefault("MUJOCO_GL", "egl")

import mujoco
import numpy as np
from make_models import MODELS, TABLES, Machine
from PIL import Image

WIDTH, HEIGHT = 560, 420
OVERSAMPLING = 3  # each pixel is the mean of 3 x 3, which smooths the edges
FIELD_OF_VIEW = 32.0  # [deg]


def scene(machine: Machine) -> mujoco.MjModel:
    """The model on a light floor, with a camera where the table wants it."""
    spec = mujoco.MjSpec.from_file(str(MODELS / machine.name / f"{machine.name}.xml"))
    spec.visual.global_.offwidth, spec.visual.global_.offheight = WIDTH * OVERSAMPLING, HEIGHT * OVERSAMPLING
    spec.visual.quality.shadowsize, spec.visual.quality.numslices = 8192, 64
    spec.add_texture(
        name="sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=(1, 1, 1),
        rgb2=(1, 1, 1),
        width=256,
        height=1536,
    )
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=(20, 20, 0.1), rgba=(1, 1, 1, 1))
    eye, target = np.array(machine.view["position"]), np.array(machine.view["target"])
    back = (eye - target) / np.linalg.norm(eye - target)
    right = np.cross((0, 0, 1), back)
    frame = np.column_stack([right / np.linalg.norm(right), np.cross(back, right / np.linalg.norm(right)), back])
    quat = np.empty(4)
    mujoco.mju_mat2Quat(quat, frame.ravel())
    spec.worldbody.add_camera(name="view", pos=eye, quat=quat, fovy=FIELD_OF_VIEW)
    return spec.compile()


def render(machine: Machine) -> None:
    model = scene(machine)
    data = mujoco.MjData(model)
    data.qpos[:] = machine.view["pose"]
    mujoco.mj_forward(model, data)
    with mujoco.Renderer(model, HEIGHT * OVERSAMPLING, WIDTH * OVERSAMPLING) as renderer:
        renderer.update_scene(data, camera="view")
        pixels = renderer.render()
    picture = Image.fromarray(pixels).resize((WIDTH, HEIGHT), Image.Resampling.BOX)
    picture.quantize(128, dither=Image.Dither.NONE).save(MODELS / machine.name / f"{machine.name}.png", optimize=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", help="bundled models; default: all")
    for name in parser.parse_args().names or sorted(path.stem for path in TABLES.glob("*.toml")):
        render(Machine.read(TABLES / f"{name}.toml"))
