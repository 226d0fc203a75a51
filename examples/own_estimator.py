"""An estimator of one's own: it sees moments, and gives parameters with their covariance."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from simulated_arm import ROBOT, record

import casysid
from casysid.estimation import Estimate, Estimator, Status


@dataclass(frozen=True)
class Shrinkage(Estimator):
    """Least squares pulled towards the model file by the same relative strength in every column."""

    strength: float = 1e-4
    name: ClassVar[str] = "shrinkage"

    def estimate(self, moments, prior=None):
        """Parameters of the moments, near the prior."""
        start = np.zeros(len(moments.columns)) if prior is None else prior
        normal = moments.pooled()
        pull = np.diag(self.strength * (np.diag(normal.xx) + 1e-9 * np.trace(normal.xx)))
        metric = normal.xx + pull
        theta = np.linalg.solve(metric, normal.xy + pull @ start)
        variance = normal.residual_energy(theta) / normal.count
        return Estimate(
            method=self.name,
            parameters=theta,
            covariance=variance * np.linalg.inv(metric),
            metric=metric,
            noise_std=np.full(len(moments.joints), np.sqrt(variance)),
            rank=len(theta),
            status=Status.CONVERGED,
        )


settings = casysid.Settings(method=Shrinkage(), choose_friction=False)
result = casysid.identify(ROBOT, record(seed=0), settings, held_out=[record(seed=1)])
print(result)
assert result.is_physically_consistent  # whatever the estimator says, bodies are made of it
assert result.held_out.relative < 0.05
