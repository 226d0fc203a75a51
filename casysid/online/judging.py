"""The verdict of the running model: how much of the torque it missed of batches it had not seen yet."""

from __future__ import annotations

from collections import deque

import numpy as np

from casysid.arrays import Array
from casysid.identification.verdict.criteria import Criterion, Verdict, Word
from casysid.identification.verdict.explained import FELT, JOINT, WHOLE, WHOLE_AT_ALL
from casysid.moments import Moments


class Judge:
    """Energies of the last batches, each predicted by the model from before it."""

    def __init__(self, dofs: tuple[str, ...], batches: int) -> None:
        """For the joints of a robot, over so many batches."""
        self._dofs = dofs
        self._energies: deque[tuple[Array, Array]] = deque(maxlen=max(batches, 1))

    def add(self, moments: Moments, parameters: Array) -> None:
        """One batch, which the parameters have not seen."""
        missed, felt = moments.residual_energy(parameters).sum(axis=0), moments.target_energy().sum(axis=0)
        n = len(self._dofs)
        self._energies.append((missed[:n] + missed[n:], felt[:n] + felt[n:]))

    def take_back(self, batches: int) -> float:
        """The newest batches were of another robot than the model's; share of all torque that was missed in them."""
        missed = felt = 0.0
        for _ in range(min(batches, len(self._energies))):
            one = self._energies.pop()
            missed, felt = missed + float(one[0].sum()), felt + float(one[1].sum())
        return float(np.sqrt(missed / felt)) if felt > 0.0 else 0.0

    @property
    def missed(self) -> Array:
        """Share of each joint's torque that was missed, shape (nv,); nan without any."""
        if not self._energies:
            return np.full(len(self._dofs), np.nan)
        missed, felt = (np.sum(one, axis=0) for one in zip(*self._energies, strict=True))
        return np.asarray(np.sqrt(np.divide(missed, felt, out=np.full(len(felt), np.nan), where=felt > 0.0)))

    def verdict(self) -> Verdict:
        """By the limits of an identification."""
        if not self._energies:
            return Verdict((), ("No batch has been predicted yet.",))
        missed, felt = (np.sum(one) for one in zip(*self._energies, strict=True))
        whole = float(np.sqrt(missed / felt)) if felt > 0.0 else float("inf")
        at_all = whole > WHOLE_AT_ALL
        criteria = [
            Criterion(
                name="torque missed",
                value=whole,
                limit=WHOLE_AT_ALL if at_all else WHOLE,
                word=Word.REJECTED if at_all else Word.DOUBTFUL,
                reason=f"The model missed {whole:.0%} of the torque of the last batches, which it had not seen.",
                origin=FELT,
            )
        ]
        for dof, share in zip(self._dofs, self.missed, strict=True):
            criteria.append(
                Criterion(
                    name="torque missed",
                    joint=dof,
                    value=float(np.nan_to_num(share)),
                    limit=JOINT,
                    word=Word.DOUBTFUL,
                    reason=f"The model missed {share:.0%} of the torque of {dof}; its controller leans on feedback.",
                    origin=FELT,
                )
            )
        return Verdict(tuple(criteria))
