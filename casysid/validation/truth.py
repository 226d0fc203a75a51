"""Identified parameters compared with true ones, in the combinations that the torque depends on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from casysid.arrays import Array, frozen
from casysid.dynamics import Coulomb, Regressor, build_regressor
from casysid.estimation.covariance import block_covariance
from casysid.identification import IdentificationResult
from casysid.identification.result import is_dry
from casysid.simulation import Plant, SimulatedRun
from casysid.threads import single_threaded

TWO_SIDED_95 = 1.96


@dataclass(frozen=True, eq=False, kw_only=True)
class BaseComparison:
    """Base parameters by three sources, shape (r,) each; SI units, combinations as in ``names``.

    Attributes:
        names: Each combination in words.
        true: The machine's.
        file: The model file's.
        identified: The answer's.
        std: Standard errors of weighted least squares on the recordings; infinite for what they do not show.
        torque: Root mean square torque that one unit of each makes on the recordings, over all joints, [N m]: what a
            difference matters.
    """

    names: tuple[str, ...]
    true: Array
    file: Array
    identified: Array
    std: Array
    torque: Array

    def __post_init__(self) -> None:
        for name in ("true", "file", "identified", "std", "torque"):
            object.__setattr__(self, name, frozen(getattr(self, name)))

    @property
    def coverage(self) -> float:
        """Share of the combinations whose 95 % interval contains the truth; those of infinite width do."""
        return float(np.mean(np.abs(self.identified - self.true) <= TWO_SIDED_95 * self.std))

    def improvement(self) -> float:
        """Torque-weighted distance to the truth, the identified over the file's; nan where the file is right."""
        before, after = (np.linalg.norm(self.torque * (x - self.true)) for x in (self.file, self.identified))
        return float(after / before) if before > 0.0 else float("nan")

    def to_json(self) -> dict[str, object]:
        """Plain numbers, combination by combination."""
        columns = zip(self.names, self.true, self.file, self.identified, self.std, strict=True)
        keys = ("true", "file", "identified", "std")
        return {
            "coverage_95": self.coverage,
            "distance_over_files": self.improvement(),
            "combinations": {name: dict(zip(keys, map(float, values), strict=True)) for name, *values in columns},
        }


@single_threaded()
def true_coefficients(plant: Plant, regressor: Regressor) -> Array:
    """The plant's parameters in the order of any regressor of its robot, shape (p,); zero for what it does not have."""
    known = dict(zip(build_regressor(plant.robot).names, plant.parameters, strict=True))
    return np.array([known.get(name, 0.0) for name in regressor.names])


@single_threaded()
def compare_base_parameters(result: IdentificationResult, plant: Plant) -> BaseComparison:
    """An identification's base parameters beside those of the plant it was made on."""
    base, regressor = result.structural, result.regressor
    leading = result.moments.select_columns(base.independent)  # with β = B θ the torque is that of these alone
    weights = result.estimate.noise_std**-2.0
    fitted = base.transform @ result.estimate.parameters
    energy = np.diag(leading.pooled().xx) / max(float(leading.count.sum() / len(plant.robot.dofs)), 1.0)
    return BaseComparison(
        names=base.words(),
        true=base.transform @ true_coefficients(plant, regressor),
        file=base.transform @ regressor.prior,
        identified=base.transform @ _dry_friction_together(regressor, result.parameters),
        std=np.sqrt(np.diag(block_covariance(leading, fitted, weights))),
        torque=np.sqrt(energy),
    )


def _dry_friction_together(regressor: Regressor, parameters: Array) -> Array:
    """Parameters with all dry friction of a joint in Coulomb's, as the plant has it: one once it slides."""
    together = np.array(parameters)
    coulomb = {one.owner: k for k, one in enumerate(regressor.parameters) if one.kind == Coulomb.kind}
    for k, one in enumerate(regressor.parameters):
        if is_dry(one.kind) and k != coulomb.get(one.owner, k):
            together[coulomb[one.owner]] += together[k]
            together[k] = 0.0
    return together


@single_threaded()
def true_torque_error(regressor: Regressor, parameters: Mapping[str, Array], run: SimulatedRun) -> dict[str, Array]:
    """Error of predicted torque against the true one along the true motion, relative by joint, shape (nv,) by name.

    No sensor and no filter comes between: what remains with true parameters is what the regressor has no column for.
    """
    size = np.maximum(np.linalg.norm(run.tau, axis=0), np.finfo(np.float64).tiny)
    return {
        name: np.linalg.norm(regressor.predict(theta, run.q, run.v, run.a) - run.tau, axis=0) / size
        for name, theta in parameters.items()
    }
