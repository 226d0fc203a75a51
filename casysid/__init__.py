"""Robot dynamics identification: errors in variables, physically consistent, with honest uncertainty.

Names are imported on first use, so that ``import casysid`` and the command line's help stay light.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from casysid.dynamics import Coupling as Coupling
    from casysid.dynamics import build_dynamics as build_dynamics
    from casysid.dynamics import build_regressor as build_regressor
    from casysid.estimation import OrdinaryLeastSquares as OrdinaryLeastSquares
    from casysid.estimation import Ridge as Ridge
    from casysid.estimation import WeightedLeastSquares as WeightedLeastSquares
    from casysid.identification import IdentificationResult as IdentificationResult
    from casysid.identification import Settings as Settings
    from casysid.identification import identify as identify
    from casysid.moments import Moments as Moments
    from casysid.recording import Recording as Recording
    from casysid.recording import read_recording as read_recording
    from casysid.recording import read_recordings as read_recordings
    from casysid.robot import Robot as Robot

__version__ = "0.1.0"

_HOMES = {
    "Coupling": "casysid.dynamics",
    "IdentificationResult": "casysid.identification",
    "Moments": "casysid.moments",
    "OrdinaryLeastSquares": "casysid.estimation",
    "Recording": "casysid.recording",
    "Ridge": "casysid.estimation",
    "Robot": "casysid.robot",
    "Settings": "casysid.identification",
    "WeightedLeastSquares": "casysid.estimation",
    "build_dynamics": "casysid.dynamics",
    "build_regressor": "casysid.dynamics",
    "identify": "casysid.identification",
    "read_recording": "casysid.recording",
    "read_recordings": "casysid.recording",
}

__all__ = sorted(_HOMES)


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'casysid' has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
