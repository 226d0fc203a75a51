"""Many recordings on many processes or machines: one answer of all, or a fleet's, one for each machine."""

from casysid.identification.many.fleet import Answer, Fleet, Machine, identify_fleet
from casysid.identification.many.pipeline import identify_many
from casysid.identification.many.workers import Traffic, Workers, open_workers

__all__ = ["Answer", "Fleet", "Machine", "Traffic", "Workers", "identify_fleet", "identify_many", "open_workers"]
