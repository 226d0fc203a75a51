"""Joint Factor Analysis (Ting et al. 2006, §II and Fig. 1(b)) on moments: de-noising without the Bayesian layer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

from casysid.estimation.denoising import Start
from casysid.estimation.denoising_estimate import DenoisingEstimator
from casysid.estimation.denoising_fit import Scale
from casysid.estimation.standardise import StandardisedProblem


@dataclass(frozen=True, kw_only=True)
class JointFactorAnalysis(DenoisingEstimator):
    """Maximum likelihood of the noisy regression model by the same EM.

    At the maximum the noisy vector, the paper's ``b_JFA`` (Eq. 9), is that of least squares; how much of a column is
    noise stays where the start has it, as far as the output's residual allows. So the noisy vector is the default here.
    """

    name: ClassVar[str] = "jfa"

    vector: Literal["noiseless", "noisy"] = "noisy"
    starts: tuple[Start, ...] = (Start(0.2, 1e-8),)

    @property
    def precision_prior(self) -> None:
        """None: weights are point estimates."""
        return None

    def scale(self, problem: StandardisedProblem) -> Scale:
        """All rows, the output as it is: maximum likelihood does not depend on either."""
        return Scale(problem.normal.count, 1.0)
