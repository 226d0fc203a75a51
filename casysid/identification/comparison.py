"""Every estimator on the same moments: which one to take for this robot."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from casysid.errors import CasysidError
from casysid.estimation import Estimator
from casysid.identification.choosing import Progress
from casysid.identification.pipeline import Preparation, silent, solve
from casysid.identification.result import IdentificationResult
from casysid.identification.settings import Settings
from casysid.threads import single_threaded


@dataclass(frozen=True, eq=False)
class Comparison:
    """Results of several methods on one preparation.

    Attributes:
        results: By method, those that gave an answer.
        failures: By method, why there is none.
    """

    results: Mapping[str, IdentificationResult]
    failures: Mapping[str, str]

    def ranked(self) -> tuple[str, ...]:
        """Methods by their error, the best first: held-out error, or that of the fit where nothing was held out."""
        return tuple(
            sorted(self.results, key=lambda name: (self.results[name].held_out or self.results[name].train).relative)
        )

    def to_json(self) -> dict[str, object]:
        """Error by joint, consistency, rank, seconds, why the estimator stopped, and its diagnostics, by method."""
        content: dict[str, object] = {name: _figures(result) for name, result in self.results.items()}
        content.update({name: {"failed": reason} for name, reason in self.failures.items()})
        return content


@single_threaded()
def compare(
    preparation: Preparation, methods: Sequence[Estimator], settings: Settings, *, progress: Progress = silent
) -> Comparison:
    """Solve with each method in turn; one that fails is noted and does not stop the others."""
    results, failures = {}, {}
    for k, method in enumerate(methods):
        progress("methods", k / len(methods))
        try:
            results[method.name] = solve(preparation, dataclasses.replace(settings, method=method))
        except CasysidError as error:
            failures[method.name] = str(error)
    progress("methods", 1.0)
    return Comparison(MappingProxyType(results), MappingProxyType(failures))


def _figures(result: IdentificationResult) -> dict[str, object]:
    held_out = result.held_out
    by_joint = (held_out or result.train).relative_by_joint.tolist()
    seconds = [result.seconds[stage] for stage in ("estimate", "projection")]
    return {
        "train": result.train.relative,
        "held_out": held_out.relative if held_out else None,
        "held_out_unfiltered": held_out.relative_unfiltered if held_out else None,
        "unconstrained": result.unconstrained.relative,
        "by_joint": dict(zip(result.robot.dofs, by_joint, strict=True)),
        "physically_consistent": result.is_physically_consistent,
        "rank": result.estimate.rank,
        "status": result.status.value,
        "stopped": result.estimate.status.value,
        "seconds": sum(seconds),
        "diagnostics": dict(result.estimate.diagnostics),
    }
