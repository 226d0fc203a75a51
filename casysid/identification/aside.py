"""Joints that nothing explains: found by time left out, and kept from steering corrections of the others."""

from __future__ import annotations

import dataclasses

import numpy as np

from casysid.arrays import Array
from casysid.dynamics import Counterweight, LoadedCoulomb, Regressor, Ripple, Spring
from casysid.errors import SolverError
from casysid.estimation import Ridge
from casysid.estimation.cross_validation import contiguous_folds
from casysid.identification.settings import Settings
from casysid.identification.tuning.drive_gains import DriveGains, choose_drive_gains
from casysid.moments import Moments

FOLDS = 5
"""Of cross-validation."""
UNEXPLAINED = 0.75
"""Share of a joint's varying torque (roots of energies) beyond which nothing explains it."""
LIKE_WEIGHT = (LoadedCoulomb, Spring, Counterweight, Ripple)
"""Kinds whose torque goes with the configuration as that of links does."""
SILENT = 1e-6
"""Share of its own size that torque varies by which was not measured."""


def missed_on_blocks(moments: Moments, regressor: Regressor) -> Array:
    """What blocks of time predicted from the others miss of each joint's varying torque, shape (nv,).

    Roots of energies. No law of bodies is asked for. nan where torque does not vary; inf where no fit was found.
    """
    moving = moments.away_from_rest()
    missed = np.zeros(len(moving.joints))
    for fold in contiguous_folds(moving.blocks, FOLDS):
        training = moving.select_blocks(np.setdiff1d(np.arange(moving.blocks), fold))
        try:
            found = Ridge(standard_errors=False).estimate(training, regressor.prior).parameters
        except SolverError:
            return np.full(len(missed), np.inf)
        missed += moving.select_blocks(fold).residual_energy(found).sum(axis=0)
    whole, varying = moving.target_energy().sum(axis=0), _varying_energy(moving, regressor)
    told = varying > SILENT**2 * whole
    return np.where(told, np.sqrt(missed / np.where(told, varying, 1.0)), np.nan)


def unexplained_joints(moments: Moments, regressor: Regressor) -> tuple[str, ...]:
    """Joints whose torque nothing explains, or never changes."""
    missed = missed_on_blocks(moments, regressor)
    return tuple(dof for dof, share in zip(moments.joints, missed, strict=False) if not share <= UNEXPLAINED)


def gains_of_the_rest(moments: Moments, regressor: Regressor, settings: Settings) -> DriveGains:
    """Gains that the joints call for that something explains; one for the others.

    Kinds of friction and transmission whose torque is like the weight of links are left out: scaled torques look like
    them.
    """
    aside = unexplained_joints(moments, regressor) if settings.torque_gains is None else ()
    alike = {c for part in regressor.parts if isinstance(part.kind, LIKE_WEIGHT) for c in part.columns}
    columns = np.array([column for column in range(len(regressor.names)) if column not in alike])
    moments, parameters = moments.select_columns(columns), [regressor.parameters[column] for column in columns]
    asked = (parameters, settings.consistency, settings.knowledge, settings.torque_gains)
    if not aside:
        return choose_drive_gains(moments, *asked)
    moving = moments.away_from_rest()
    kept = [k for k, dof in enumerate(moving.joints) if dof not in aside]
    values, error = np.ones(len(moving.joints)), np.zeros(len(moving.joints))
    if len(kept) < 2:
        return DriveGains(values, error)
    found = choose_drive_gains(moving.of_joints(kept), *asked)
    values[kept], error[kept] = found.values, found.error
    return dataclasses.replace(found, values=values, error=error)


def _varying_energy(moments: Moments, regressor: Regressor) -> Array:
    """Of each joint's torque about its mean, shape (joints,); about zero where the model has no offset."""
    energy = moments.target_energy().sum(axis=0)
    offsets = {one.owner: k for k, one in enumerate(regressor.parameters) if one.kind == "offset"}
    for joint, dof in enumerate(moments.joints):
        own, squares = moments.of_joint(joint)
        for place in np.flatnonzero(own == offsets.get(dof, -1)):
            column = squares.sum(axis=0)[place]
            if column[place] > 0.0:
                energy[joint] -= column[-1] ** 2 / column[place]
    return np.asarray(np.maximum(energy, 0.0))
