"""Identification while the robot runs: a model that is renewed every second, and changes that are noticed and said."""

from casysid.online.events import Event
from casysid.online.online import Online
from casysid.online.renewal import Held, State

__all__ = ["Event", "Held", "Online", "State"]
