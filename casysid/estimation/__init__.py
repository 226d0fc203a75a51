"""Estimators: moments in, parameters with their uncertainty out; one method a file."""

from casysid.errors import ParameterError
from casysid.estimation.base import Estimate, Estimator, Status
from casysid.estimation.bayesian import BayesianDenoising
from casysid.estimation.cross_validation import cross_validated_energy
from casysid.estimation.empirical_bayes import EmpiricalBayes
from casysid.estimation.errors_in_variables import ErrorsInVariables
from casysid.estimation.joint_factor_analysis import JointFactorAnalysis
from casysid.estimation.lasso import LassoRegression
from casysid.estimation.least_squares import OrdinaryLeastSquares, WeightedLeastSquares
from casysid.estimation.partial_least_squares import PartialLeastSquares
from casysid.estimation.relevance import RelevanceRegression
from casysid.estimation.ridge import Ridge
from casysid.estimation.stepwise import StepwiseRegression
from casysid.estimation.total_least_squares import TotalLeastSquares

ESTIMATORS: tuple[type[Estimator], ...] = (
    OrdinaryLeastSquares,
    WeightedLeastSquares,
    EmpiricalBayes,
    Ridge,
    ErrorsInVariables,
    BayesianDenoising,
    JointFactorAnalysis,
    LassoRegression,
    StepwiseRegression,
    PartialLeastSquares,
    RelevanceRegression,
    TotalLeastSquares,
)
"""Every estimator with its defaults, by the names of the command line."""


def estimator_by_name(name: str) -> Estimator:
    """The estimator of that name with its defaults; :class:`ParameterError` when there is none."""
    for kind in ESTIMATORS:
        if kind.name == name:
            return kind()
    raise ParameterError(f"method must be one of {', '.join(kind.name for kind in ESTIMATORS)}; got {name!r}")


__all__ = [
    "ESTIMATORS",
    "BayesianDenoising",
    "EmpiricalBayes",
    "ErrorsInVariables",
    "Estimate",
    "Estimator",
    "JointFactorAnalysis",
    "LassoRegression",
    "OrdinaryLeastSquares",
    "PartialLeastSquares",
    "RelevanceRegression",
    "Ridge",
    "Status",
    "StepwiseRegression",
    "TotalLeastSquares",
    "WeightedLeastSquares",
    "cross_validated_energy",
    "estimator_by_name",
]
