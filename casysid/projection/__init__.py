"""The physically consistent parameters nearest to an estimate, as the data measure distance (paper, §III-B).

IPOPT minimises over virtual parameters, in which every real vector is consistent. The same problem over the cone of
consistent parameters is convex: Clarabel finds its global optimum, which certifies IPOPT's answer or takes its place.
"""

from casysid.projection.api import constrained_least_squares, convex_least_squares, project
from casysid.projection.cuts import HalfSpaces, nearest_in_half_spaces
from casysid.projection.knowledge import (
    KeptLink,
    Knowledge,
    LinearKnowledge,
    center_of_mass_within,
    link_mass,
    parameter_within,
    total_mass,
)
from casysid.projection.layout import ParameterLike
from casysid.projection.possible import PossibleParameters
from casysid.projection.problem import FLOOR, PRIOR_BUDGET, ProjectionProblem, build_projection
from casysid.projection.results import ProjectionResult, ProjectionStatus, Solver
from casysid.projection.sampling import project_samples

__all__ = [
    "FLOOR",
    "PRIOR_BUDGET",
    "HalfSpaces",
    "KeptLink",
    "Knowledge",
    "LinearKnowledge",
    "ParameterLike",
    "PossibleParameters",
    "ProjectionProblem",
    "ProjectionResult",
    "ProjectionStatus",
    "Solver",
    "build_projection",
    "center_of_mass_within",
    "constrained_least_squares",
    "convex_least_squares",
    "link_mass",
    "nearest_in_half_spaces",
    "parameter_within",
    "project",
    "project_samples",
    "total_mass",
]
