"""Estimators: moments in, parameters with their uncertainty out; one method a file."""

from casysid.estimation.base import Estimate, Estimator, Status
from casysid.estimation.cross_validation import cross_validated_energy
from casysid.estimation.least_squares import OrdinaryLeastSquares, WeightedLeastSquares
from casysid.estimation.ridge import Ridge

__all__ = [
    "Estimate",
    "Estimator",
    "OrdinaryLeastSquares",
    "Ridge",
    "Status",
    "WeightedLeastSquares",
    "cross_validated_energy",
]
