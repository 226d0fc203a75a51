"""What noise of the measured motion has added to the moments: simulation-extrapolation with antithetic noise.

As much noise as there is, is added once more, with both signs, and the moments are taken the same way again: what they
grow by is what the noise that was there has added. It holds for every joint type and regressor, and the noise has the
colour that smoothing gives it; for small noise it is ``Σ J P Jᵀ`` and the bias of the mean. Noise that no low-pass has
made small is added twice over as well, and a parabola in its variance is carried back to zero.

Where positions are smoothed, dry friction's smooth sign is no sharper than the noise of its velocity: about the
expected sign, given what was measured. Its error is then uncorrelated with everything measured and attenuates nothing
(Berkson), so columns with such a sign are left out.

Source: Cook and Stefanski 1994 (simulation-extrapolation); Berkson 1950.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np

from casysid.arrays import Array
from casysid.dynamics import Coulomb, LoadedCoulomb, MaxwellSlip, PowerViscous, Regressor, SharpCoulomb, Stribeck
from casysid.errors import ParameterError
from casysid.identification.passes import Passes
from casysid.moments import Moments
from casysid.recording import Source
from casysid.signals import InputNoise, NoiseLevels, find_input_noise, mean_input_noise

DRAWS = 2
"""Pairs of opposite noise whose growth is averaged, where the positions are smoothed."""
LONG = 50_000
"""So many samples average well enough by themselves: one pair will do."""
DRAWS_AS_LOGGED = 4
"""And where they are not: the parabola adds nine times the variance of one growth to that of the other."""
EXPECTED_KINDS = (
    Coulomb.kind,
    LoadedCoulomb.kind,
    MaxwellSlip.kind,
    PowerViscous.kind,
    SharpCoulomb.kind,
    Stribeck.kind,
)
"""Columns that are an expectation, given the noisy motion, and not a noisy value."""


def with_noise(
    moments: Moments, regressor: Regressor, passes: Passes, levels: NoiseLevels
) -> tuple[Moments, InputNoise | None]:
    """Moments that know what noise of the measured motion has added to them, and that noise; as they are if unknown.

    Args:
        moments: Of the passes' recordings.
        regressor: Whose columns were summed.
        passes: Over what is fitted.
        levels: What is known of the sensors.
    """
    as_logged = passes.band.cutoff is None
    recordings = passes.recordings
    noise = tuple(find_input_noise(one, levels, as_logged=as_logged) for one in recordings)
    together = mean_input_noise(noise)
    if together is None:
        return moments, None

    def sums_of(disturbed: Sequence[Source]) -> Moments:
        return passes.disturbed(disturbed).moments(regressor)

    added = noise_moments(regressor, recordings, noise, moments, sums_of, as_logged=as_logged)
    return dataclasses.replace(moments, noise=added, noise_error=together.relative_error), together


def noise_moments(
    regressor: Regressor,
    recordings: Sequence[Source],
    noise: Sequence[InputNoise | None],
    moments: Moments,
    sums_of: Callable[[Sequence[Source]], Moments],
    *,
    as_logged: bool,
) -> tuple[Array, ...]:
    """What ``noise`` has added to the squares of ``moments``, shaped like them.

    Args:
        regressor: Whose columns were summed.
        recordings: As measured.
        noise: Of each recording.
        moments: Of the recordings.
        sums_of: Moments of disturbed recordings, taken in the same way.
        as_logged: Whether no low-pass has made the noise small.

    Raises:
        ParameterError: The noise of a recording is not known.
    """
    known = [one for one in noise if one is not None]
    if len(known) < len(recordings):
        raise ParameterError("noise moments: the noise of every recording must be known")

    def growth(scale: float) -> list[Array]:
        total = [np.zeros_like(squares) for squares in moments.squares]
        for draw in range(draws):
            for sign in (scale, -scale):
                disturbed = [
                    one.disturb(recording, sign, seed=draw * len(recordings) + k)
                    for k, (one, recording) in enumerate(zip(known, recordings, strict=True))
                ]
                for own, squares in zip(total, sums_of(disturbed).squares, strict=True):
                    own += squares
        return [own / (2 * draws) - squares for own, squares in zip(total, moments.squares, strict=True)]

    draws = DRAWS_AS_LOGGED if as_logged else DRAWS if sum(map(len, recordings)) < LONG else 1
    added = growth(1.0)
    if as_logged:
        return tuple(3.0 * once - twice for once, twice in zip(added, growth(np.sqrt(2.0)), strict=True))
    expected = [m for m, parameter in enumerate(regressor.parameters) if parameter.kind.startswith(EXPECTED_KINDS)]
    for columns, own in zip(moments.row_columns, added, strict=True):
        places = np.flatnonzero(np.isin(columns, expected))
        own[:, places, :] = own[:, :, places] = 0.0
    return tuple(added)
