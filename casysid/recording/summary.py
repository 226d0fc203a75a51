"""A recording in figures."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class RecordingSummary:
    """A recording in figures; ``str()`` gives them as lines of text.

    Attributes:
        sources: Files.
        samples: Number of rows.
        duration: [s], nan without time.
        rate: [Hz], nan without time.
        segments: Runs between gaps in time, 0 without time.
        logged: Which of q, v, a, tau are there.
        position_range: Smallest and largest position by channel [rad, m].
        torque_rms: Root mean square torque by degree of freedom [N m, N].
        torque_peak: Largest absolute torque by degree of freedom [N m, N].
        unused_columns: Columns left aside.
    """

    sources: tuple[str, ...]
    samples: int
    duration: float
    rate: float
    segments: int
    logged: tuple[str, ...]
    position_range: dict[str, tuple[float, float]]
    torque_rms: dict[str, float]
    torque_peak: dict[str, float]
    unused_columns: tuple[str, ...]

    def __str__(self) -> str:
        timing = (
            f"{self.duration:.6g} s at {self.rate:.6g} Hz, {self.segments} segment(s)" if self.segments else "unordered"
        )
        lines = [
            ", ".join(self.sources) or "recording",
            f"{self.samples} samples, {timing}; logged: {', '.join(self.logged)}",
        ]
        lines += [f"q   {name}: {low:.6g} to {high:.6g}" for name, (low, high) in self.position_range.items()]
        lines += [
            f"tau {name}: rms {rms:.6g}, peak {self.torque_peak[name]:.6g}" for name, rms in self.torque_rms.items()
        ]
        if self.unused_columns:
            lines.append(f"not used: {', '.join(self.unused_columns)}")
        return "\n".join(lines)
