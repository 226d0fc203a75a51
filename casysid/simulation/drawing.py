"""Pictures of moving capsules, drawn by MuJoCo without a display, where the machine can do that.

MuJoCo chooses its OpenGL when it is first imported; here the choice is made when a picture is wanted.
"""

from __future__ import annotations

import importlib
import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import numpy.typing as npt

from casysid.arrays import Array
from casysid.errors import MissingExtraError

FIELD_OF_VIEW = 40.0
"""Of the camera, vertical [deg]."""
_MARGIN = 0.9
"""Distance of the camera over that at which a sphere around everything fills the picture."""
_THINNEST = 0.004
"""A capsule is drawn no thinner than this share of the scene."""
_PALETTE = np.array(
    [(0.12, 0.43, 0.92), (0.82, 0.29, 0.36), (0.95, 0.66, 0.2), (0.25, 0.62, 0.5), (0.5, 0.4, 0.75), (0.6, 0.65, 0.7)]
)
_WORLD = """<mujoco><visual><global offwidth="{width}" offheight="{height}" fovy="{fovy}"/>
<headlight ambient=".45 .45 .45" diffuse=".5 .5 .5" specular="0 0 0"/><map znear="0.01" zfar="100"/></visual>
<statistic center="{center}" extent="{extent}"/>
<asset><texture type="skybox" builtin="gradient" rgb1="1 1 1" rgb2="1 1 1" width="16" height="16"/></asset>
<worldbody><light directional="true" dir="-0.4 0.5 -1" diffuse=".4 .4 .4"/></worldbody></mujoco>"""


def draw_capsules(
    start: Array,
    end: Array,
    radius: Array,
    group: npt.ArrayLike,
    *,
    boxes: tuple[tuple[Array, Array], ...] = (),
    size: tuple[int, int] = (280, 280),
) -> npt.NDArray[np.uint8]:
    """One picture per instant, all seen from the same place.

    Args:
        start: Ends of the capsules' axes in the world, shape (instants, capsules, 3), [m].
        end: The other ends, likewise.
        radius: Shape (capsules,), [m].
        group: Whole numbers; capsules of one group have one colour, shape (capsules,).
        boxes: Lower and upper corners of boxes to be drawn too.
        size: Width and height [pixels].

    Returns:
        Shape (instants, height, width, 3).

    Raises:
        MissingExtraError: This machine cannot draw; the message says what it lacks.
    """
    import mujoco

    corners = np.concatenate([start.reshape(-1, 3), end.reshape(-1, 3)])
    low, high = corners.min(axis=0), corners.max(axis=0)
    center, extent = (low + high) / 2.0, float(np.linalg.norm(high - low) / 2.0 + radius.max())
    width, height = size
    world = _WORLD.format(
        width=width, height=height, fovy=FIELD_OF_VIEW, center=" ".join(map(str, center)), extent=extent
    )
    model = mujoco.MjModel.from_xml_string(world)
    with _context(*size):
        scene, context = mujoco.MjvScene(model, 1000), mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, context)
        state = model, mujoco.MjData(model), _camera(center, extent)
        thick = np.maximum(radius, _THINNEST * extent)
        pictures = np.empty((len(start), height, width, 3), np.uint8)
        for picture, first, second in zip(pictures, start, end, strict=True):
            _fill(scene, state, (first, second, thick), np.asarray(group), boxes)
            view = mujoco.MjrRect(0, 0, width, height)
            mujoco.mjr_render(view, scene, context)
            mujoco.mjr_readPixels(picture, None, view, context)
        context.free()
    return pictures[:, ::-1]


@contextmanager
def _context(width: int, height: int) -> Iterator[None]:
    """OpenGL without a window: EGL, or what the environment variable MUJOCO_GL says."""
    name = os.environ.get("MUJOCO_GL", "egl").lower()
    try:
        context = importlib.import_module(f"mujoco.{name}").GLContext(width, height)
        context.make_current()
    except Exception as error:  # whatever the driver, its binding or the loader of either may raise
        raise MissingExtraError(
            f"no pictures of the robot can be drawn here: {name} is not available ({error}). Install PyOpenGL (pip "
            "install pyopengl) and libegl1, or libosmesa6 with MUJOCO_GL=osmesa"
        ) from error
    try:
        yield
    finally:
        context.free()


def _camera(center: Array, extent: float) -> Any:
    import mujoco

    camera = mujoco.MjvCamera()
    camera.lookat[:] = center
    camera.distance = _MARGIN * extent / np.sin(np.deg2rad(FIELD_OF_VIEW / 2.0))
    camera.azimuth, camera.elevation = 130.0, -20.0
    return camera


def _fill(
    scene: Any,
    state: tuple[Any, Any, Any],
    capsules: tuple[Array, Array, Array],
    group: npt.NDArray[Any],
    boxes: tuple[tuple[Array, Array], ...],
) -> None:
    """Put everything into the scene."""
    import mujoco

    model, data, camera = state
    everything = mujoco.mjtCatBit.mjCAT_ALL.value
    mujoco.mjv_updateScene(model, data, mujoco.MjvOption(), None, camera, everything, scene)
    for lower, upper in boxes:
        geom = _add(scene, mujoco.mjtGeom.mjGEOM_BOX, np.array([0.8, 0.8, 0.8]))
        geom.size[:], geom.pos[:] = (upper - lower) / 2.0, (upper + lower) / 2.0
    for first, second, radius, color in zip(*capsules, _PALETTE[group % len(_PALETTE)], strict=True):
        geom = _add(scene, mujoco.mjtGeom.mjGEOM_SPHERE, color)
        if np.linalg.norm(second - first) > 1e-9:
            mujoco.mjv_connector(geom, mujoco.mjtGeom.mjGEOM_CAPSULE, radius, first, second)
        else:
            geom.size[:], geom.pos[:] = radius, first


def _add(scene: Any, kind: Any, color: Array) -> Any:
    import mujoco

    geom = scene.geoms[scene.ngeom]
    rgba = np.append(color, 1.0).astype(np.float32)
    mujoco.mjv_initGeom(geom, kind, np.ones(3), np.zeros(3), np.eye(3).ravel(), rgba)
    scene.ngeom += 1
    return geom
