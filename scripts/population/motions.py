"""Random motions, known at every instant with their two derivatives.

Kinds (:data:`KINDS`): Fourier series with a highest frequency log-uniform 0.3-3 Hz; random targets reached by
trapezoids of velocity or by quintics, with dwells of 0-1.5 s (a third without), each joint resting through three of ten
moves; chirps from 0.05-0.2 Hz up to log-uniform 0.5-4 Hz, joints out of step by up to 30 %; series designed by casysid
on the model file as it is (a small budget, at most four joints, otherwise drawn again). In a fifth of all experiments
each joint rests with probability 0.35, half of these all the time, others during two intervals.

A family is drawn once an experiment; motions drawn from it share frequencies, profile and resting joints, and nothing
else: the one that is fitted, and a fresh one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol

import numpy as np

from population.mechanisms import Limits

KINDS = {"fourier": 0.37, "point to point": 0.28, "chirp": 0.15, "designed": 0.20}
RESTS = 0.2
DENSE = 20.0
"""Samples in a period of the highest frequency by which peaks are found."""


class State(NamedTuple):
    """Positions and two derivatives, shape (N, nv) each."""

    q: np.ndarray
    v: np.ndarray
    a: np.ndarray


class Motion(Protocol):
    """Joint motion at any time."""

    def at(self, time: np.ndarray) -> State:
        """At times (N,), [s]."""
        ...


@dataclass(frozen=True, eq=False)
class Series:
    """``Σ s_k sin 2πf_k t + c_k cos 2πf_k t``: frequencies (K,), [Hz], coefficients of shape (K, nv)."""

    frequencies: np.ndarray
    sine: np.ndarray
    cosine: np.ndarray

    def at(self, time: np.ndarray) -> State:
        """At times (N,), [s]."""
        w = 2.0 * np.pi * self.frequencies
        s, c = np.sin(np.outer(time, w)), np.cos(np.outer(time, w))
        first = (c * w) @ self.sine - (s * w) @ self.cosine
        return State(s @ self.sine + c @ self.cosine, first, -(s * w**2) @ self.sine - (c * w**2) @ self.cosine)


@dataclass(frozen=True, eq=False)
class Chirp:
    """``A / (1 + t/T r) sin φ(t)``, ``φ`` of frequencies that rise linearly; shape (nv,) each."""

    amplitude: np.ndarray
    fade: np.ndarray
    low: np.ndarray
    slope: np.ndarray
    phase: np.ndarray

    def at(self, time: np.ndarray) -> State:
        """At times (N,), [s]."""
        t = time[:, None]
        w = 2.0 * np.pi * (self.low + self.slope * t)
        p = self.phase + 2.0 * np.pi * (self.low * t + 0.5 * self.slope * t**2)
        A = self.amplitude / (1.0 + self.fade * t)
        dA, ddA = -self.fade * A / (1.0 + self.fade * t), 2.0 * self.fade**2 * A / (1.0 + self.fade * t) ** 2
        s, c = np.sin(p), np.cos(p)
        bend = 2.0 * np.pi * self.slope * c - w**2 * s
        return State(A * s, dA * s + A * w * c, ddA * s + 2.0 * dA * w * c + A * bend)


@dataclass(frozen=True, eq=False)
class PointToPoint:
    """Moves between targets (K + 1, nv) that begin at times (K,) and last (K,), [s]."""

    targets: np.ndarray
    begin: np.ndarray
    last: np.ndarray
    profile: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray, np.ndarray]]

    def at(self, time: np.ndarray) -> State:
        """At times (N,), [s]."""
        k = np.maximum(np.searchsorted(self.begin, time, side="right") - 1, 0)
        length = self.last[k]
        s, ds, dds = self.profile(np.clip((time - self.begin[k]) / length, 0.0, 1.0))
        step = self.targets[k + 1] - self.targets[k]
        return State(
            self.targets[k] + s[:, None] * step,
            (ds / length)[:, None] * step,
            (dds / length**2)[:, None] * step,
        )


@dataclass(frozen=True, eq=False)
class Resting:
    """Another motion, of which joints rest at zero during intervals, or always.

    Attributes:
        inner: The motion.
        always: Which joints never move, shape (nv,).
        intervals: Begin and end [s] by joint.
        ramp: How long a joint takes to come to rest [s].
    """

    inner: Motion
    always: np.ndarray
    intervals: tuple[tuple[tuple[float, float], ...], ...]
    ramp: float

    def at(self, time: np.ndarray) -> State:
        """At times (N,), [s]."""
        q, v, a = (np.array(part) for part in self.inner.at(time))
        for j, intervals in enumerate(self.intervals):
            for begin, end in intervals:
                down, up = (quintic(np.clip((time - t) / self.ramp, 0.0, 1.0)) for t in (begin - self.ramp, end))
                e, de, dde = (u - d for u, d in zip(up, down, strict=True))
                e, de, dde = 1.0 + e, de / self.ramp, dde / self.ramp**2
                a[:, j] = dde * q[:, j] + 2.0 * de * v[:, j] + e * a[:, j]
                v[:, j] = de * q[:, j] + e * v[:, j]
                q[:, j] *= e
        moving = ~self.always
        return State(q * moving, v * moving, a * moving)


def quintic(u: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """From 0 to 1 at rest, with both derivatives in u."""
    return u**3 * (10.0 - 15.0 * u + 6.0 * u**2), 30.0 * (u * (1.0 - u)) ** 2, 60.0 * u * (1.0 - u) * (1.0 - 2.0 * u)


def trapezoid(share: float) -> Callable[[np.ndarray], tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Constant acceleration for a share of the way, constant speed, constant deceleration."""
    top = 1.0 / (1.0 - share)

    def profile(u: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        early, late = u < share, u > 1.0 - share
        s = np.where(early, 0.5 * top / share * u**2, top * (u - 0.5 * share))
        s = np.where(late, 1.0 - 0.5 * top / share * (1.0 - u) ** 2, s)
        speed = np.where(early, top / share * u, np.where(late, top / share * (1.0 - u), top))
        moves = (u > 0.0) & (u < 1.0)
        return s, speed, np.where(early, top / share, np.where(late, -top / share, 0.0)) * moves

    return profile


@dataclass(frozen=True, eq=False)
class Family:
    """What the motions of one experiment have in common.

    Attributes:
        kind: One of :data:`KINDS`.
        draw: A motion, given generator and duration [s]; the fitted one.
        draw_fresh: The same for the one that is judged; differs where the fitted one is designed.
        top: Highest frequency that matters [Hz], about.
        at_rest: Joints that never move, shape (nv,).
        rests: Whether joints rest, always or in part, beyond what the kind has.
    """

    kind: str
    draw: Callable[[np.random.Generator, float], Motion]
    draw_fresh: Callable[[np.random.Generator, float], Motion]
    top: float
    at_rest: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=bool))
    rests: bool = False


def fitting(unit: Motion, limits: Limits, time: np.ndarray, fill: np.ndarray) -> np.ndarray:
    """Factors (nv,) by which a motion keeps a share ``fill`` of position, velocity and acceleration limits."""
    peaks = [np.maximum(np.abs(part).max(axis=0), 1e-12) for part in unit.at(time)]
    bounds = (limits.half_range, limits.speed, limits.acceleration)
    return fill * np.min([bound / peak for bound, peak in zip(bounds, peaks, strict=True)], axis=0)


def fourier(base: float, count: int, fall: float, limits: Limits) -> Callable[[np.random.Generator, float], Motion]:
    """Series of multiples of a base frequency [Hz] whose coefficients fall with a power of it."""
    frequencies, size = base * np.arange(1, count + 1), len(limits.speed)

    def draw(rng: np.random.Generator, duration: float) -> Motion:
        shrink = np.arange(1, count + 1)[:, None] ** -fall
        sine, cosine = (shrink * rng.standard_normal((count, size)) for _ in range(2))
        time = np.linspace(0.0, 1.0 / base, int(DENSE * count))
        scale = fitting(Series(frequencies, sine, cosine), limits, time, rng.uniform(0.6, 1.0, size))
        return Series(frequencies, sine * scale, cosine * scale)

    return draw


def chirp(low: float, high: float, limits: Limits) -> Callable[[np.random.Generator, float], Motion]:
    """All joints at once, from low to high frequencies [Hz], smaller as they rise."""
    size = len(limits.speed)

    def draw(rng: np.random.Generator, duration: float) -> Motion:
        start, end = low * rng.uniform(0.7, 1.3, size), high * rng.uniform(0.7, 1.3, size)
        slope, fade = (end - start) / duration, (end / start) ** rng.uniform(0.3, 1.0, size) / duration
        one = Chirp(np.ones(size), fade, start, slope, rng.uniform(0.0, 2.0 * np.pi, size))
        time = np.linspace(0.0, duration, int(DENSE * duration * 1.3 * high) + 1)
        scale = fitting(one, limits, time, rng.uniform(0.6, 1.0, size))
        return Chirp(scale, fade, start, slope, one.phase)

    return draw


def point_to_point(
    profile: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray, np.ndarray]], dwell: float, limits: Limits
) -> Callable[[np.random.Generator, float], Motion]:
    """Random targets, all joints in step, as fast as speed and acceleration allow times 1-2."""
    grid = np.linspace(0.0, 1.0, 2001)
    _, speed, bend = (np.abs(part).max() for part in profile(grid))

    def draw(rng: np.random.Generator, duration: float) -> Motion:
        now, targets, begin, last, clock = np.zeros(len(limits.speed)), [np.zeros(len(limits.speed))], [], [], 0.2
        while clock < duration:
            wanted = np.where(rng.random(len(now)) < 0.3, now, limits.half_range * rng.uniform(-1.0, 1.0, len(now)))
            step = np.abs(wanted - now)
            least = max((step * speed / limits.speed).max(), np.sqrt(step * bend / limits.acceleration).max(), 0.05)
            begin.append(clock)
            last.append(least * rng.uniform(1.0, 2.0))
            clock += last[-1] + rng.uniform(0.0, dwell)
            now = wanted
            targets.append(now)
        return PointToPoint(np.array(targets), np.array(begin), np.array(last), profile)

    return draw
