"""The answer: what was held, and how sure that is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from casysid.arrays import Array
from casysid.uncertainty import ParameterUncertainty


@dataclass(frozen=True)
class TorqueScale:
    """Logged torque over true torque, as a known mass tells it.

    Attributes:
        value: Divide logged torques by it, or multiply the motor constants that made them of currents by ``1 / value``.
        std: Standard error.
    """

    value: float
    std: float


@dataclass(frozen=True, eq=False)
class Payload:
    """What was held, as a body of its own in the frame of its link.

    Attributes:
        name: Of the payload.
        link: That holds it, in whose frame all of it is.
        uncertainty: Parameters, physical quantities and their errors.
        torque_scale: What the known mass says of the torques; None without one.
        torque_error: Relative torque error on its recordings without it, and with it.
    """

    name: str
    link: str
    uncertainty: ParameterUncertainty
    torque_scale: TorqueScale | None
    torque_error: tuple[float, float]

    def __repr__(self) -> str:
        low, high = self.mass_interval
        return f"<Payload '{self.name}' at '{self.link}': {self.mass:.4g} kg, 95 % within {low:.4g} to {high:.4g}>"

    @property
    def parameters(self) -> Array:
        """m, mcx, mcy, mcz, Ixx, Ixy, Iyy, Ixz, Iyz, Izz at the link's frame, shape (10,): of a body that can be."""
        return self.uncertainty.parameters

    @property
    def mass(self) -> float:
        """[kg]."""
        return float(self.uncertainty.links[0, 0])

    @property
    def mass_std(self) -> float:
        """Standard error [kg]."""
        return float(self.uncertainty.link_std[0, 0])

    @property
    def mass_interval(self) -> tuple[float, float]:
        """Ends of the 95 % interval [kg]."""
        low, high = self.uncertainty.link_interval()
        return float(low[0, 0]), float(high[0, 0])

    @property
    def center_of_mass(self) -> Array:
        """In the link's frame, shape (3,), [m]."""
        return self.uncertainty.links[0, 1:4]

    @property
    def center_of_mass_std(self) -> Array:
        """Standard errors, shape (3,), [m]."""
        return self.uncertainty.link_std[0, 1:4]

    @property
    def inertia(self) -> Array:
        """About the centre of mass, xx yy zz xy xz yz, shape (6,), [kg m²]."""
        return self.uncertainty.links[0, 4:]

    @property
    def inertia_std(self) -> Array:
        """Standard errors, shape (6,), [kg m²]; infinite where the recordings say nothing."""
        return self.uncertainty.link_std[0, 4:]

    def to_json(self) -> dict[str, Any]:
        """Plain numbers, lists and words."""
        low, high = self.uncertainty.link_interval()
        scale = self.torque_scale
        return {
            "name": self.name,
            "link": self.link,
            "mass": self.mass,
            "center_of_mass": self.center_of_mass.tolist(),
            "inertia": self.inertia.tolist(),
            "std": {
                "mass": self.mass_std,
                "center_of_mass": self.center_of_mass_std.tolist(),
                "inertia": self.inertia_std.tolist(),
            },
            "interval_95": {
                "mass": [low[0, 0], high[0, 0]],
                "center_of_mass": [low[0, 1:4].tolist(), high[0, 1:4].tolist()],
                "inertia": [low[0, 4:].tolist(), high[0, 4:].tolist()],
            },
            "parameters": self.parameters.tolist(),
            "torque_scale": None if scale is None else {"value": scale.value, "std": scale.std},
            "relative_torque_error": {"without_it": self.torque_error[0], "with_it": self.torque_error[1]},
        }


@dataclass(frozen=True, eq=False, repr=False)
class PayloadResult:
    """All payloads of one robot.

    Attributes:
        robot: Name of the robot.
        link: That held them.
        payloads: In the order in which they were given.
        reference: What the robot without them was taken from.
    """

    robot: str
    link: str
    payloads: tuple[Payload, ...]
    reference: str

    def __repr__(self) -> str:
        return f"<PayloadResult of '{self.robot}': {', '.join(map(repr, self.payloads))}>"

    def __getitem__(self, name: str) -> Payload:
        """The payload of a name."""
        return {one.name: one for one in self.payloads}[name]

    def to_json(self) -> dict[str, Any]:
        """Plain numbers, lists and words."""
        return {
            "robot": self.robot,
            "link": self.link,
            "reference": self.reference,
            "payloads": [one.to_json() for one in self.payloads],
        }
