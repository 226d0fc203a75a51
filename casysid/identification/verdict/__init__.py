"""Whether a controller may use what was identified: accepted, doubtful or rejected, by named criteria."""

from casysid.identification.verdict.criteria import Criterion, Verdict, Word
from casysid.identification.verdict.judging import judge

__all__ = ["Criterion", "Verdict", "Word", "judge"]
