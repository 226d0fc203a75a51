"""Everything a run of the identification can be told; nothing of it is needed."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from casysid.dynamics import DEFAULT_FRICTION, Coupling, FrictionKind
from casysid.errors import ParameterError
from casysid.estimation import Estimator, Ridge
from casysid.inertia import Consistency
from casysid.projection import Knowledge
from casysid.signals import NoiseLevels


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Hyperparameters of one identification.

    Attributes:
        method: The estimator.
        consistency: Physical laws that the parameters are made to obey; None leaves the estimate as it is.
        knowledge: What is known beside the data, such as a total mass; used together with ``consistency``.
        flip: Columns of the recordings whose signs are turned, as :meth:`casysid.recording.Recording.flipped` has it.
        cutoff: Low-pass cut-off [Hz]; None lets the data choose.
        delay: By how much the torque's time stamps are late against the positions' [s]; None takes it from the data.
        friction: Kinds of friction and drive columns of every joint.
        choose_friction: Whether the data may add kinds of friction, joint by joint, and couplings of neighbours; only
            with time stamps.
        coulomb_width: Velocity within which Coulomb's smooth sign turns [rad/s, m/s]; None takes it from the velocity's
            noise.
        couplings: Transmissions that link joints, such as a wrist driven by two motors.
        time_scale: Time stamps times this are seconds; None looks whether inertial torques contradict the clock.
        quasi_static: Torques hold no inertial part, gravity and friction explain them; None lets the data decide.
        ends: Whether equations at the ends of stretches of time count, where smoothing knows one side only; None lets
            the data decide.
        input_noise: What is known of the noise of the measured motion; by default the positions' is found in the data.
        torque_gains: Measured torque over true torque of every degree of freedom; None fits them if needed.
        blocks: Blocks of time by which moments are kept: the folds of cross-validation and the unit of standard errors.
        threads: Threads of the regressor's evaluation.
    """

    method: Estimator = field(default_factory=Ridge)
    consistency: Consistency | None = Consistency.FULL
    knowledge: tuple[Knowledge, ...] = ()
    flip: tuple[str, ...] = ()
    cutoff: float | None = None
    delay: float | None = None
    friction: tuple[FrictionKind, ...] = DEFAULT_FRICTION
    choose_friction: bool = True
    coulomb_width: float | None = None
    couplings: tuple[Coupling, ...] = ()
    time_scale: float | None = None
    quasi_static: bool | None = None
    ends: bool | None = None
    input_noise: NoiseLevels = field(default_factory=NoiseLevels)
    torque_gains: tuple[float, ...] | None = None
    blocks: int = 20
    threads: int = 2

    def __post_init__(self) -> None:
        if self.cutoff is not None and not (np.isfinite(self.cutoff) and self.cutoff > 0):
            raise ParameterError(f"cut-off must be a positive number of Hz; got {self.cutoff}")
        if self.time_scale is not None and not (np.isfinite(self.time_scale) and self.time_scale > 0):
            raise ParameterError(f"time scale must be a positive number; got {self.time_scale}")
        if self.delay is not None and not np.isfinite(self.delay):
            raise ParameterError(f"delay must be a finite number of seconds; got {self.delay}")
        if self.blocks < 4:
            raise ParameterError(
                f"blocks must be at least 4 for cross-validation and standard errors; got {self.blocks}"
            )
        if self.threads < 1:
            raise ParameterError(f"threads must be at least 1; got {self.threads}")
