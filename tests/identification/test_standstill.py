"""Stands of a joint are left out where friction holds it, and stay where the model explains them."""

import dataclasses

import numpy as np
import pytest

from casysid.dynamics import Viscous
from casysid.estimation import WeightedLeastSquares
from casysid.identification import Settings
from casysid.identification.problem import build_problem
from casysid.identification.standstill import choose_moving_only
from casysid.simulation import IDEAL, PD, ControlModel, Mechanics, Plant, Sensing, design_sinusoids
from casysid.validation import track, true_coefficients
from tests.simulated import bundled_robot

CUTOFF = 10.0
SENSING = Sensing(position_noise=1e-5, position_resolution=0.0, torque_noise=1e-3, torque_delay=0.0, sample_jitter=0.0)
STICKING = Mechanics(coulomb_level=0.1, stiction=1.5, offset_level=0.0, cable_pull=0.0)


def recorded(mechanics, bandwidth=3.0):
    """A two-link arm under soft feedback: with much friction it sticks whenever it turns round."""
    plant = Plant(bundled_robot("two_link.urdf"), dataclasses.replace(IDEAL, mechanics=mechanics, sensing=SENSING))
    gains = PD.tuned(plant.robot, plant.parameters, bandwidth=bandwidth)
    motion = design_sinusoids(plant.robot, duration=12.0, seed=1, torque_share=0.4)
    return plant, track(plant, ControlModel.from_robot(plant.robot), gains, motion, rate=250.0, duration=12.0, seed=1)


@pytest.fixture(scope="module")
def sticking():
    return recorded(STICKING)


def error(plant, run, problem):
    """Of the torque while the joints move, relative, by joint."""
    found = WeightedLeastSquares().estimate(problem.moments, problem.regressor.prior).parameters
    miss = problem.regressor.predict(found, run.q, run.v, run.a) - problem.regressor.predict(
        true_coefficients(plant, problem.regressor), run.q, run.v, run.a
    )
    return np.sqrt((miss**2).mean(axis=0) / (run.tau**2).mean(axis=0))


def test_stands_that_friction_holds_are_left_out(sticking):
    plant, run = sticking
    assert choose_moving_only(plant.robot, [run.recording], CUTOFF, Settings(threads=1)).any()


def test_without_stands_friction_is_found_far_better(sticking):
    plant, run = sticking
    whole, moving = (
        build_problem(plant.robot, [run.recording], CUTOFF, Settings(threads=1), moving_only=left_out, quick=True)
        for left_out in (False, True)
    )
    assert (moving.moments.count < whole.moments.count).any()
    assert error(plant, run, moving).max() < 0.5 * error(plant, run, whole).max()


def test_joints_without_dry_friction_keep_all_their_equations():
    plant, run = recorded(dataclasses.replace(STICKING, coulomb_friction=False, stiction=1.0))
    assert not choose_moving_only(plant.robot, [run.recording], CUTOFF, Settings(threads=1)).any()


def test_a_model_without_coulomb_friction_keeps_all_equations(sticking):
    plant, run = sticking
    settings = Settings(friction=(Viscous(),), threads=1)
    assert not choose_moving_only(plant.robot, [run.recording], CUTOFF, settings).any()


def test_noise_is_told_from_the_same_equations(sticking):
    plant, run = sticking
    moments = build_problem(plant.robot, [run.recording], CUTOFF, Settings(threads=1), moving_only=True).moments
    torque = moments.gram[..., -1, -1].sum(axis=0)
    assert (np.abs(moments.dense_noise[..., -1, -1]).sum(axis=0) < 1e-9 * torque).all()  # none came or went
