"""A model on disk: ``model.json``, with every number as it is, and ``model.npz``, how sure they are."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from casysid.archives import read_arrays
from casysid.dynamics import FRICTION_KINDS, FrictionKind, FrictionModel, build_regressor
from casysid.errors import ParameterError
from casysid.json_reading import check_numbers, read_json, texts
from casysid.model.robot_model import RobotModel
from casysid.model.standard_errors import Scatter
from casysid.model.tree import numbers, robot_from_json, robot_to_json
from casysid.outputs import whole_file, write_whole

MODEL_FILE, SCATTER_FILE = "model.json", "model.npz"
_SCATTER = ("covariance", "hidden", "scale")


def write_model(model: RobotModel, folder: str | Path) -> None:
    """Write a model's two files into a folder that is there.

    Raises:
        OutputError: They cannot be written.
    """
    regressor, home = model.regressor, Path(folder)
    content = {
        "robot": robot_to_json(model.robot),
        "friction_model": FrictionModel(regressor.friction, regressor.couplings).to_json(model.robot),
        "quasi_static": regressor.template.sensing.quasi_static,
        "torque_gains": model.torque_gains.tolist(),
        "parameters": {
            "names": list(regressor.names),
            "units": [parameter.unit for parameter in regressor.parameters],
            "values": model.parameters.tolist(),
        },
        "damping": model.damping.tolist(),
        "dry_friction": model.dry_friction.tolist(),
    }
    write_whole(home / MODEL_FILE, (json.dumps(content, indent=1, allow_nan=False) + "\n").encode())
    if model.scatter is not None:
        with whole_file(home / SCATTER_FILE) as stream:
            np.savez_compressed(stream, **{name: getattr(model.scatter, name) for name in _SCATTER})


def read_model(folder: str | Path, kinds: Sequence[type[FrictionKind]] = FRICTION_KINDS) -> RobotModel:
    """The model of a run's folder: the same numbers as in the process that wrote it.

    Args:
        folder: With ``model.json``, and ``model.npz`` if its errors are known.
        kinds: Of friction that may be in it; kinds of one's own are to be named here beside ``FRICTION_KINDS``.

    Raises:
        ParameterError: A file is missing or is something else.
    """
    home = Path(folder)
    path = home / MODEL_FILE
    try:
        content = read_json(path)
        model = _model(content, kinds)
        path = home / SCATTER_FILE
        scatter = _scatter(path, len(model.parameters)) if path.exists() else None
    except ParameterError as error:
        raise ParameterError(f"{path}: {error}") from error
    except (OSError, ValueError, KeyError, TypeError, AttributeError, IndexError, OverflowError) as error:
        reason = f"there is no {error.args[0]!r}" if isinstance(error, KeyError) and error.args else str(error)
        raise ParameterError(f"{path}: wanted a model as casysid identify writes it; {reason}") from error
    return RobotModel(
        regressor=model.regressor,
        parameters=model.parameters,
        scatter=scatter,
        damping=model.damping,
        dry_friction=model.dry_friction,
    )


def _model(content: Mapping[str, Any], kinds: Sequence[type[FrictionKind]]) -> RobotModel:
    robot = robot_from_json(content["robot"])
    check_numbers(content["friction_model"], "friction_model")
    friction = FrictionModel.from_json(content["friction_model"], kinds)
    regressor = build_regressor(
        robot,
        friction.columns,
        friction.couplings,
        quasi_static=content["quasi_static"] is True,
        torque_gains=numbers(content["torque_gains"], "torque_gains", robot.nv),
    )
    given = content["parameters"]
    if texts(given["names"], "parameters.names") != regressor.names:
        raise ValueError("the parameters' names are not those of the robot with this friction")
    return RobotModel(
        regressor=regressor,
        parameters=np.array(numbers(given["values"], "parameters.values", len(regressor.names))),
        damping=np.array(numbers(content["damping"], "damping", robot.nv)),
        dry_friction=np.array(numbers(content["dry_friction"], "dry_friction", robot.nv)),
    )


def _scatter(path: Path, p: int) -> Scatter:
    arrays = read_arrays(path, _SCATTER)
    covariance, hidden, scale = (np.asarray(arrays[name], dtype=np.float64) for name in _SCATTER)
    if covariance.shape != (p, p) or hidden.ndim != 2 or len(hidden) != p or scale.shape != (p,):
        raise ValueError(f"its arrays have shapes {covariance.shape}, {hidden.shape}, {scale.shape} for {p} parameters")
    if not all(np.isfinite(one).all() for one in (covariance, hidden, scale)):
        raise ValueError("it holds numbers that are not finite")
    return Scatter(covariance, hidden, scale)
