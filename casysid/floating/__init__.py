"""Robots whose base is free: what their equations tell where contact forces or joint torques are not known."""

from casysid.floating.accumulation import projected_moments
from casysid.floating.forces import Contact, Wrench, check_contacts, generalised_forces
from casysid.floating.projection import free_projector, unknown_directions
from casysid.floating.standing import StandingMotion, standing_forces, standing_motion

__all__ = [
    "Contact",
    "StandingMotion",
    "Wrench",
    "check_contacts",
    "free_projector",
    "generalised_forces",
    "projected_moments",
    "standing_forces",
    "standing_motion",
    "unknown_directions",
]
