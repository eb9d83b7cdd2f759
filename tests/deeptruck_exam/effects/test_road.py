"""Roads and tyres, where each law has a way of its own. What holds for all is in test_laws.py."""

from itertools import pairwise

import numpy as np
import pytest

from deeptruck_exam.effects.places import CELL_M, CELLS, stretches, windows
from deeptruck_exam.effects.series import SAMPLE_S, arrivals


def test_liquid_lies_or_coats_by_what_was_before(alone, held):
    law = alone("liquid_in_the_tyres")
    between = 0.5 * (1.0 + law.p.falls) * law.p.coats_mps
    slow = held(law, 20.0, speed=between)
    held(law, 20.0, speed=20.0)
    assert np.all(slow < -1000.0) and np.all(held(law, 20.0, speed=between) > 0.01 * slow)


def test_slopes_come_from_where_the_truck_was(alone, scene):
    law = alone("chainage_runs_away")
    law.late_m[:], law.p.runs = 100.0, 0.0
    for metres in range(400):
        out = law.force(scene(distance=metres, grade=0.05 * (metres >= 200)), 0.01)
        wanted = 0.05 * 2e4 * 9.81 * (202 <= metres < 297)
        if not (197 <= metres < 206 or 290 <= metres < 306):
            np.testing.assert_allclose(out, wanted, atol=1e-6)


def test_slopes_of_an_outage_begin_at_nothing_from_either_side(alone, scene):
    law = alone("grade_held_in_outages")
    there, back = law.road[:, 0]
    inside = there != 0.0
    assert 0.2 < inside.mean() < 0.95 and np.abs(law.road).max() < 0.06
    assert not np.array_equal(there, back)
    law.setting.start_m[:] = [9000.0, 9400.0]
    assert law.force(scene(distance=200.0), 0.01).shape == (2,)


def test_stretches_cover_their_share_of_the_road():
    road = windows(np.random.default_rng(3), 40, 160.0, 0.3)
    assert abs(road.mean() - 0.3) < 0.03 and set(np.unique(road)) == {0.0, 1.0}


def test_stretches_do_not_overlap_and_gusts_have_unit_mean():
    rng = np.random.default_rng(3)
    lie = stretches(rng, (50.0, 200.0), (100.0, 400.0))
    assert all(a[1] <= b[0] + 1 for a, b in pairwise(lie))
    assert max(last for _, last in lie) <= CELLS and 0.4 < CELL_M * sum(b - a for a, b in lie) / 62000.0 < 0.9
    gusts = arrivals(rng, (4, round(2000.0 / SAMPLE_S)), 6.0, 8.0)
    assert gusts.min() >= 0.0 and abs(gusts.mean() - 1.0) < 0.15


@pytest.mark.parametrize(
    ("key", "sign"),
    [
        ("road_surface", 1.0),
        ("soft_ground", 1.0),
        ("sections_by_roughness", 1.0),
        ("snow_drifts", 1.0),
        ("washboard", 1.0),
        ("chippings", 1.0),
        ("tangents_not_in_the_map", -1.0),
        ("lost_between_map_points", -1.0),
        ("grade_from_a_coarse_map", -1.0),
    ],
)
def test_what_lies_on_the_road_lies_there_for_both_directions(key, sign, alone, scene):
    there = []
    for first in (9000.0, 9400.0, 11000.0, 13000.0):
        law = alone(key)
        law.setting.start_m[:] = [first, first + 400.0]
        if key in ("snow_drifts", "chippings"):
            law.left[:] = 1.0
        there.append(law.force(scene(distance=200.0), 0.01))
    there = np.array(there)
    np.testing.assert_allclose(there[:, 0], sign * there[:, 1])
    assert np.any(there != 0.0)


def test_slopes_that_are_not_in_the_map_keep_the_height(alone):
    law = alone("grade_from_a_coarse_map")
    road = law.road[0]
    assert (road != 0.0).mean() > 0.1 and abs(road.sum() * CELL_M) < 1.0 and law.conceal == ("elevation",)


def test_ice_that_floats_resists_most_at_one_speed(alone, held):
    law = alone("floating_ice")
    slow, resonant, fast = (held(law, 60.0, speed=v) for v in (2.0, 9.5, 22.0))
    assert np.all(resonant < 5.0 * slow) and np.all(resonant < 5.0 * fast)


@pytest.mark.parametrize(
    ("key", "given"),
    [("one_wheel_on_ice", {"traction_force": 300.0}), ("chainage_runs_away", {}), ("grounds_on_crests", {})],
)
def test_without_its_cause_there_is_no_force(key, given, alone, held):
    np.testing.assert_allclose(held(alone(key), 2.0, **given), 0.0, atol=1e-6)
