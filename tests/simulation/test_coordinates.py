"""The plant's coordinates against Pinocchio's Lie groups."""

import numpy as np
import pinocchio as pin
from hypothesis import given, settings
from hypothesis import strategies as st

from casysid.robot.coordinates import channels_from_configuration
from casysid.simulation.coordinates import Coordinates
from tests.strategies import random_motion, robots

seeds = st.integers(0, 2**32 - 1).map(np.random.default_rng)


@settings(max_examples=25, deadline=None)
@given(robots(), seeds)
def test_a_displacement_leads_back_to_itself(robot, rng):
    coordinates, q = Coordinates(robot), random_motion(robot, rng, 1).q
    start, step = channels_from_configuration(robot, q)[0], rng.uniform(-1, 1, robot.nv)
    np.testing.assert_allclose(coordinates.displacement(start, coordinates.moved(start, step)), step, atol=1e-12)


@settings(max_examples=25, deadline=None)
@given(robots(), seeds)
def test_moving_at_some_rates_is_moving_at_pinocchios_velocity(robot, rng):
    coordinates, q = Coordinates(robot), random_motion(robot, rng, 1).q[0]
    channels, rates, h = channels_from_configuration(robot, q[None])[0], rng.normal(size=robot.nv), 1e-6
    v = pin.difference(robot.model, q, coordinates.configuration(coordinates.moved(channels, h * rates))) / h
    np.testing.assert_allclose(coordinates.velocity(channels, rates), v, atol=1e-4)


@settings(max_examples=25, deadline=None)
@given(robots(), seeds)
def test_velocities_and_forces_come_back_and_power_is_the_same(robot, rng):
    coordinates, q = Coordinates(robot), random_motion(robot, rng, 1).q
    channels = channels_from_configuration(robot, q)[0]
    rates, torque = rng.normal(size=(2, robot.nv))
    v, tau = coordinates.velocity(channels, rates), coordinates.force(channels, torque)
    np.testing.assert_allclose(coordinates.rates(channels, v), rates, atol=1e-12)
    np.testing.assert_allclose(coordinates.force_along_rates(channels, tau), torque, atol=1e-12)
    np.testing.assert_allclose(tau @ v, torque @ rates, atol=1e-10)


@settings(max_examples=25, deadline=None)
@given(robots(), seeds)
def test_acceleration_is_the_velocitys_derivative(robot, rng):
    coordinates, q = Coordinates(robot), random_motion(robot, rng, 1).q
    channels = channels_from_configuration(robot, q)[0]
    rates, change = rng.normal(size=(2, robot.nv))
    h = 1e-6
    later = coordinates.velocity(coordinates.moved(channels, h * rates), rates + h * change)
    slope = (later - coordinates.velocity(channels, rates)) / h
    np.testing.assert_allclose(coordinates.acceleration(channels, rates, change), slope, atol=1e-4)
