from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from deeptruck_cacc import CaccEnv
from deeptruck_cacc.controllers.road_ahead import AHEAD, AHEAD_M, Road
from deeptruck_cacc.environments import scenes
from deeptruck_core.errors import InputError


def test_a_grade_is_straight_between_its_points_and_goes_on_at_the_ends():
    road = Road(np.array([[0.0, 0.02, -0.01], [0.01, 0.01, 0.01]]), spacing_m=100.0)
    positions = np.array([[-5.0, 50.0, 150.0, 900.0]] * 2)
    np.testing.assert_allclose(road.at(positions), [[0.0, 0.01, 0.005, -0.01], [0.01] * 4])


def test_what_lies_ahead_begins_where_the_truck_is():
    road = Road(np.linspace(0.0, 0.04, 201)[None])
    ahead = road.ahead(np.array([500.0]))
    assert ahead.shape == (1, AHEAD)
    np.testing.assert_allclose(ahead[0], np.minimum((500.0 + AHEAD_M * np.arange(AHEAD)) * 8e-6, 0.04))


@pytest.mark.parametrize("grade", [np.zeros(5), np.zeros((2, 1)), np.array([[0.0, np.nan]])])
def test_what_is_no_road_is_refused(grade):
    with pytest.raises(InputError, match="finite numbers"):
        Road(grade)
    with pytest.raises(InputError, match="above 0"):
        Road(np.zeros((1, 2)), spacing_m=0.0)


def test_in_the_environment_trucks_feel_the_grade_where_they_are(toy):
    """Two trucks of one scene, of which the second is pushed and soon stands elsewhere on the same hill."""
    hill = Road(np.tile(0.03 * np.sin(np.arange(100) / 5.0), (2, 1)))
    scene = scenes.paper(np.random.default_rng(0), 2, 100, toy.dt)
    env = CaccEnv(toy, 2, 100)
    seen = env.reset(replace(scene, road=hill, known_road=hill))
    position = np.zeros(2)
    state = toy.reset(np.column_stack([np.zeros(2), scene.speed]))
    commands = np.array([[300.0, 0.0], [2000.0, 0.0]])
    speed = scene.speed
    for _ in range(100):
        grade = hill.at(position[:, None])
        np.testing.assert_allclose(seen["grade"], grade[:, 0])
        np.testing.assert_allclose(seen["grade_ahead"][:, 0], grade[:, 0])
        np.testing.assert_allclose(seen["grade_ahead"][:, 4], hill.at(position[:, None] + 100.0)[:, 0])
        state, y = toy.step(state, commands, grade)
        position = position + speed * toy.dt
        speed = y[:, 1]
        seen, _, _ = env.step(commands)
        np.testing.assert_allclose(env.speed, speed)
    assert position[1] > position[0] + 25.0


def test_a_map_may_differ_from_the_road_or_be_missing(toy):
    hill, flat = Road(np.full((1, 50), 0.02)), Road(np.zeros((1, 50)))
    scene = scenes.paper(np.random.default_rng(0), 1, 10, toy.dt)
    seen = CaccEnv(toy).reset(replace(scene, road=hill, known_road=flat))
    assert seen["grade"] == 0.02 and not seen["grade_ahead"].any()
    assert "grade_ahead" not in CaccEnv(toy).reset(replace(scene, road=hill))
