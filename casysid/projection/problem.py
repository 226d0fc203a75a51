"""A projection, built once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from casysid.errors import ParameterError
from casysid.inertia import Consistency
from casysid.projection.knowledge import Constraints, Knowledge, constraints_of
from casysid.projection.layout import Layout, ParameterLike, layout_of
from casysid.projection.program import ProjectionProgram, build_program
from casysid.threads import single_threaded

FLOOR = 1e-3
"""Default floor: no link keeps less than this fraction of its reference pseudo-inertia in any direction."""
PRIOR_BUDGET = 8e-4
"""Default of what the prior may cost the data, as a fraction of the residual energy."""


@dataclass(frozen=True, eq=False, kw_only=True)
class ProjectionProblem:
    """A projection, built once; estimates, metrics and priors come with each solve.

    Attributes:
        layout: Order of the parameters.
        constraints: What is known beside the data.
        consistency: What is asked of every link.
        floor: No link keeps less than this fraction of its reference (nearly the prior's) pseudo-inertia.
        prior_budget: What staying close to the prior may cost the data, as a fraction of the residual energy.
    """

    layout: Layout
    constraints: Constraints
    consistency: Consistency
    floor: float
    prior_budget: float

    @cached_property
    def program(self) -> ProjectionProgram:
        """What IPOPT solves, built when it is first asked for: searches do without."""
        return build_program(self.layout, self.constraints, self.consistency, self.floor)


@single_threaded()
def build_projection(
    parameters: Sequence[ParameterLike],
    *,
    consistency: Consistency = Consistency.FULL,
    knowledge: Sequence[Knowledge] = (),
    floor: float = FLOOR,
    prior_budget: float = PRIOR_BUDGET,
) -> ProjectionProblem:
    """A projection for a regressor's parameters.

    Args:
        parameters: The regressor's columns: ten for each link, then those of the joints.
        consistency: Full, or only positive mass and inertia as in the paper.
        knowledge: What is known beside the data.
        floor: Fraction of its reference that every link keeps in every direction, so that its inertia can be inverted.
        prior_budget: What staying close to the prior, where the data do not see, may cost the data through the laws
            that bind both, as a fraction of the residual energy.

    Raises:
        ParameterError: The columns are in another order, knowledge is about something else, a number is out of range.
    """
    if not 0.0 <= floor < 0.1:
        raise ParameterError(f"projection: floor must be a small fraction, at least 0 and below 0.1; got {floor}")
    if not prior_budget > 0.0:
        raise ParameterError(f"projection: prior_budget must be positive; got {prior_budget}")
    layout = layout_of(parameters)
    constraints = constraints_of(layout, knowledge)
    return ProjectionProblem(
        layout=layout,
        constraints=constraints,
        consistency=consistency,
        floor=floor,
        prior_budget=prior_budget,
    )
