"""States of cores as numbers that add."""

import numpy as np
import pytest

from warpimpact.scene.exit_state import ExitStates, features, flown, states, tilts
from warpimpact.scene.rigid import line_of_flight

LENGTH = 0.028


def some_states(count=200):
    """Cores that fly and point anywhere but backwards through the plate, from several lines of fire."""
    draw = np.random.default_rng(1)
    fire = np.array([line_of_flight(*angles) for angles in draw.uniform(-0.7, 0.7, (count, 2))])
    axis = draw.normal(size=(count, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    velocity = 700.0 * fire + draw.normal(scale=150.0, size=(count, 3))
    turning = np.cross(axis, draw.normal(scale=4e3, size=(count, 3)))
    return ExitStates(velocity, axis, turning), fire, draw.uniform(800.0, 900.0, count)


def test_states_return_from_their_features():
    exits, fire, impact = some_states()
    back = states(features(*exits, fire, impact, LENGTH), fire, impact, LENGTH)
    for one, other in zip(exits, back, strict=True):
        assert other == pytest.approx(one, rel=1e-9, abs=1e-9 * np.abs(one).max())


def test_a_core_as_it_arrived_has_no_angles():
    _, fire, impact = some_states()
    numbers = features(impact[:, None] * fire, fire, np.zeros_like(fire), fire, impact, LENGTH)
    assert numbers == pytest.approx(np.tile([1.0] + [0.0] * 6, (len(fire), 1)), abs=1e-12)


def test_mirrored_states_have_mirrored_features():
    exits, _, impact = some_states()
    fire, mirror = np.tile([1.0, 0.0, 0.0], (len(impact), 1)), np.array([1.0, -1.0, 1.0])
    mirrored = ExitStates(exits.velocity * mirror, exits.axis * mirror, -exits.angular_velocity * mirror)
    numbers, others = (features(*one, fire, impact, LENGTH) for one in (exits, mirrored))
    assert others == pytest.approx(numbers * [1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 1.0], abs=1e-9)


def test_a_core_that_turns_in_a_plane_tilts_at_its_rate():
    turning = ExitStates(np.array([[800.0, 0.0, 0.0]]), np.array([[1.0, 0.0, 0.0]]), np.array([[0.0, 0.0, 5e3]]))
    angles = tilts(turning, np.array([[1.0, 0.0, 0.0]]), np.array([0.04, 0.12]))
    assert angles[0] == pytest.approx([5e3 * 0.04 / 800.0, 5e3 * 0.12 / 800.0])


def test_a_flight_in_two_parts_is_the_whole_flight():
    exits, fire, _ = some_states()
    forward = exits.velocity[:, 0] > 0.0
    exits, fire = ExitStates(*(part[forward] for part in exits)), fire[forward]
    part = flown(exits, np.full(len(fire), 0.05))
    assert tilts(part, fire, np.array([0.08])) == pytest.approx(tilts(exits, fire, np.array([0.13])), abs=1e-9)
