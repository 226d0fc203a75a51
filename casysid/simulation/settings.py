"""What a real robot does beside rigid-body dynamics: every effect a named setting with a default level.

``PlantSettings()`` has them all at plausible levels; :data:`IDEAL` has none. Torques are given as shares of a joint's
torque scale (see :func:`casysid.simulation.truth.torque_scale`), so that one number suits a shoulder and an eye.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields
from typing import Any

from casysid.errors import ParameterError


def _check_not_negative(settings: Any, may_be_infinite: tuple[str, ...] = ()) -> None:
    for item in fields(settings):
        value = getattr(settings, item.name)
        if isinstance(value, bool) or value is None:
            continue
        if not value >= 0.0 or (math.isinf(value) and item.name not in may_be_infinite):
            raise ParameterError(f"{type(settings).__name__}: {item.name} must be a number from 0 up; got {value}")


@dataclass(frozen=True, kw_only=True)
class Mechanics:
    """Forces between the actuator and the rigid bodies.

    The model file's friction and armature are the truth; levels stand in for a kind of which the file has none.

    Attributes:
        viscous_friction: Whether there is viscous friction.
        viscous_level: Viscous torque at full speed (without velocity limit: 1 rad/s or m/s), share of the torque scale.
        coulomb_friction: Whether there is Coulomb friction.
        coulomb_level: Share of the torque scale.
        armature: Whether rotors have inertia.
        rotor_acceleration: How fast the torque scale would accelerate the bare rotor [rad/s², m/s²], for a file without
            armature.
        offset_level: Constant torque besides, of alternating sign from joint to joint, share of the torque scale.
        stiction: Break-away torque over Coulomb friction, at least 1; 1 is none.
        stribeck_velocity: Speed at which 63 % of the excess is gone [rad/s or m/s].
        cable_pull: What the cables pull with at the end of the joint's range, a spring about its middle, share of the
            torque scale.
    """

    viscous_friction: bool = True
    viscous_level: float = 0.03
    coulomb_friction: bool = True
    coulomb_level: float = 0.02
    armature: bool = True
    rotor_acceleration: float = 1000.0
    offset_level: float = 0.002
    stiction: float = 1.3
    stribeck_velocity: float = 0.02
    cable_pull: float = 0.003

    def __post_init__(self) -> None:
        _check_not_negative(self)
        if self.rotor_acceleration == 0.0:
            raise ParameterError("Mechanics: rotor_acceleration must be positive [rad/s², m/s²]; got 0")
        if self.stiction < 1.0:
            raise ParameterError(
                f"Mechanics: stiction is break-away over Coulomb friction, at least 1; got {self.stiction}"
            )
        if self.stiction > 1.0 and self.stribeck_velocity == 0.0:
            raise ParameterError("Mechanics: stribeck_velocity must be positive where stiction is above 1; got 0")


@dataclass(frozen=True, kw_only=True)
class Actuation:
    """From the torque that is asked for to the torque that acts.

    Attributes:
        lag: Time constant of the first-order response [s]; 0 is none: the torque then jumps at each tick.
        saturation: Whether torques stop at the effort limits.
        resolution: Step of the torque asked for, as 16 bits have it, share of the torque scale. It also swallows the
            rounding errors by which one computation of a command differs from another.
    """

    lag: float = 0.002
    saturation: bool = True
    resolution: float = 3e-5

    def __post_init__(self) -> None:
        _check_not_negative(self)


@dataclass(frozen=True, kw_only=True)
class Sensing:
    """From what happens to what is logged, and to what the controller gets.

    Attributes:
        position_noise: Standard deviation [rad, m], white.
        position_resolution: Step of the encoder [rad, m]; quaternions are not quantised.
        position_delay: Age of a position when it is logged [s].
        velocity_cutoff: Velocity is the difference of logged positions behind a first-order low-pass of this frequency
            [Hz]; ``inf`` leaves the bare differences, None gives the true velocity.
        torque_noise: Standard deviation, white, share of the torque scale.
        torque_resolution: Step of the torque sensor, share of the torque scale.
        torque_delay: Age of a torque when it is logged [s].
        torque_is_command: Whether the log has the torque that was asked for, saturated, instead of the one that acts.
        sample_jitter: Standard deviation of the instant at which a sample is taken about the one that is logged [s].
    """

    position_noise: float = 1e-4
    position_resolution: float = 5e-5
    position_delay: float = 0.0
    velocity_cutoff: float | None = 40.0
    torque_noise: float = 0.003
    torque_resolution: float = 0.0005
    torque_delay: float = 5e-4
    torque_is_command: bool = False
    sample_jitter: float = 2e-5

    def __post_init__(self) -> None:
        _check_not_negative(self, may_be_infinite=("velocity_cutoff",))
        if self.velocity_cutoff == 0.0:
            raise ParameterError("Sensing: velocity_cutoff must be positive, or None for the true velocity; got 0")


@dataclass(frozen=True, kw_only=True)
class PlantSettings:
    """Everything that a plant does beside rigid-body dynamics.

    Attributes:
        mechanics: Friction, stiction, cables, rotors.
        actuation: Lag and saturation.
        sensing: Noise, resolution, delay, jitter.
        physics_step: Longest step of the integration [s]; a controller's period is cut into steps at most this long.
    """

    mechanics: Mechanics = field(default_factory=Mechanics)
    actuation: Actuation = field(default_factory=Actuation)
    sensing: Sensing = field(default_factory=Sensing)
    physics_step: float = 0.00125

    def __post_init__(self) -> None:
        if not 0.0 < self.physics_step < math.inf:
            raise ParameterError(f"PlantSettings: physics_step must be positive [s]; got {self.physics_step}")


NO_MECHANICS = Mechanics(
    viscous_friction=False, coulomb_friction=False, armature=False, offset_level=0.0, stiction=1.0, cable_pull=0.0
)
"""Rigid bodies alone."""

PLAIN_MECHANICS = Mechanics(offset_level=0.0, stiction=1.0, cable_pull=0.0)
"""Rigid bodies with viscous and Coulomb friction and armature: nothing that the regressor lacks."""

PERFECT_ACTUATION = Actuation(lag=0.0, saturation=False, resolution=0.0)
"""What is asked for acts."""

PERFECT_SENSING = Sensing(
    position_noise=0.0,
    position_resolution=0.0,
    velocity_cutoff=None,
    torque_noise=0.0,
    torque_resolution=0.0,
    torque_delay=0.0,
    sample_jitter=0.0,
)
"""The log is the truth."""

IDEAL = PlantSettings(mechanics=PLAIN_MECHANICS, actuation=PERFECT_ACTUATION, sensing=PERFECT_SENSING)
"""A machine that does what the model says and logs what it does."""
