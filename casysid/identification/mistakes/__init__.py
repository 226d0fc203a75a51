"""What in a log contradicts the model file: signs, units and orders of columns, and gravity."""

from casysid.identification.mistakes.kinds import SCALES, Column, Mistake, MistakeKind, torque_signs
from casysid.identification.mistakes.search import MOST_DOFS, find_gravity, find_mistakes

__all__ = ["MOST_DOFS", "SCALES", "Column", "Mistake", "MistakeKind", "find_gravity", "find_mistakes", "torque_signs"]
