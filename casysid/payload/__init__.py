"""What a robot holds: mass, centre of mass and inertia, from motions with it and without."""

from casysid.payload.identification import identify_payload
from casysid.payload.results import Payload, PayloadResult, TorqueScale

__all__ = ["Payload", "PayloadResult", "TorqueScale", "identify_payload"]
