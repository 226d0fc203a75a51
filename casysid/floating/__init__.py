"""Robots whose base is free: what their equations tell where contact forces or joint torques are not known."""

from casysid.floating.accumulation import projected_moments
from casysid.floating.forces import Contact, Wrench, check_contacts, generalised_forces
from casysid.floating.projection import free_projector, unknown_directions

__all__ = [
    "Contact",
    "Wrench",
    "check_contacts",
    "free_projector",
    "generalised_forces",
    "projected_moments",
    "unknown_directions",
]
