"""How far off a predicted torque may be: what is not known of the parameters, and what no parameter explains."""

from __future__ import annotations

import numpy as np

from casysid.arrays import Array
from casysid.identification.result import IdentificationResult
from casysid.signals import Motion
from casysid.threads import single_threaded
from casysid.uncertainty import torque_std


@single_threaded()
def torque_band(result: IdentificationResult, motion: Motion, level: float = 0.95) -> Array:
    """Half the width of the band about the predicted torque that holds the measured one, shape (N, nv), [N m].

    Measured torque as the fit saw it, below the low-pass; its residuals are taken to be as large as in the fit.

    Args:
        result: The identification.
        motion: Fitted or not.
        level: Share of the measured torque within the band.
    """
    sure = result.uncertainty
    std = torque_std(result.regressor, sure.covariance, motion.q, motion.v, motion.a, time=motion.time)
    return np.asarray(sure.quantile(level) * np.sqrt(std**2 + result.train.rmse**2))
