"""Structured errors in variables: any estimator, on moments from which the encoders' noise has been taken out.

Noise in the measured motion attenuates least squares, whatever the amount of data. Its share of the moments is known
(:attr:`casysid.moments.Moments.noise`), so it is subtracted. Where noise is so heavy that the rest would not be
positive definite, less is subtracted: Fuller's modification.

Source: Fuller 1987, *Measurement Error Models*, §2.5 (the modification) and §3.1 (noise covariance by observation).
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from casysid.arrays import Array
from casysid.errors import ParameterError
from casysid.estimation.base import Estimate, Estimator
from casysid.estimation.ridge import Ridge
from casysid.estimation.standardise import check_prior, estimate_noise_std, seen_directions
from casysid.moments import Moments


@dataclass(frozen=True)
class ErrorsInVariables:
    """An estimator on denoised moments; without knowledge of the noise, the estimator itself.

    Attributes:
        estimator: Takes the denoised moments.
        margin: Fraction of a direction's energy that noise may explain at most.
    """

    estimator: Estimator = field(default_factory=Ridge)
    margin: float = 0.95
    name: ClassVar[str] = "eiv"

    def __post_init__(self) -> None:
        if not 0.0 < self.margin < 1.0:
            raise ParameterError(f"errors in variables: margin must lie between 0 and 1; got {self.margin}")

    def estimate(self, moments: Moments, prior: Array | None = None) -> Estimate:
        """Parameters without the attenuation by input noise; unseen directions stay at the prior."""
        if moments.noise is None:
            return dataclasses.replace(self.estimator.estimate(moments, prior), method=self.name)
        heaviest = heaviest_noise(moments.shifted(check_prior(moments, prior)))
        share = min(1.0, self.margin / max(heaviest, np.finfo(np.float64).tiny))
        estimate = self.estimator.estimate(moments.denoised(share), prior)
        diagnostics = {**estimate.diagnostics, "noise_share_of_weakest_direction": heaviest, "noise_removed": share}
        return dataclasses.replace(estimate, method=self.name, diagnostics=diagnostics)


def heaviest_noise(moments: Moments) -> float:
    """The largest share of any direction's energy in ``[x, y]`` that is noise: a generalised eigenvalue."""
    assert moments.noise is not None
    weights = estimate_noise_std(moments) ** -2.0
    gram, noise = (np.einsum("j,bjmn->mn", weights, sums) for sums in (moments.gram, moments.noise))
    energy = np.diag(gram)
    scale = np.where(energy > 0.0, 1.0 / np.sqrt(np.where(energy > 0.0, energy, 1.0)), 0.0)
    values, vectors = seen_directions(gram * np.outer(scale, scale))
    whitened = scale[:, None] * vectors / np.sqrt(values)
    return float(np.linalg.eigvalsh(whitened.T @ noise @ whitened).max(initial=0.0))
