"""Worlds: trucks, roads, speeds, drivers and loggers within reason, each world in its own way."""

import numpy as np
import pytest

from deeptruck_exam import worlds
from deeptruck_exam.cases import measure
from deeptruck_exam.construction import build
from deeptruck_exam.effects.planting import FAMILIES, SEALED
from deeptruck_exam.plans import draw_plan
from deeptruck_exam.worlds import OF_FAMILY, WORLDS, roads
from deeptruck_exam.worlds.badlands import badlands, fog, knicks_down
from deeptruck_exam.worlds.bends import bendy
from deeptruck_exam.worlds.by_trade import BALLAST
from deeptruck_exam.worlds.cones import cones, flanks_down, lights
from deeptruck_exam.worlds.courses import errands, karst, lava_down
from deeptruck_exam.worlds.ferries import fjords, narrow, troughs_down
from deeptruck_exam.worlds.folds import folds, timetable, waves_down
from deeptruck_exam.worlds.loess import convoys, gullies_down, round_hills
from deeptruck_exam.worlds.loggers import Logger, quantise
from deeptruck_exam.worlds.playas import basins, held_up, washes_down
from deeptruck_exam.worlds.polders import hairpins_down, lapses, polders
from deeptruck_exam.worlds.roundabouts import roundabouts
from deeptruck_exam.worlds.sand_ridges import cameras, dammed_down, sand_ridges
from deeptruck_exam.worlds.terraces import stair_down, terraces, works
from deeptruck_exam.worlds.traffic import zones

# a sealed family brings a world, which is one of WORLDS once the family is proved
WAITING = {SEALED: worlds.SEALED_WORLD} if hasattr(worlds, "SEALED_WORLD") else {}
ALL_WORLDS = {**WORLDS, **WAITING}


@pytest.fixture(scope="module", params=(*FAMILIES[1:], *WAITING))
def drives(request):
    """Half a minute of eight drives with nothing missing, in the world of each family."""
    return build(draw_plan("nothing_missing", 8, None, "physics", 0.7, forms=request.param))


def test_each_family_has_its_world_and_deep_simulators_the_plain_one():
    assert [OF_FAMILY[f] for f in FAMILIES] == ["plain", *WORLDS]
    assert all(worlds.of(f, "physics") is WORLDS[OF_FAMILY[f]] for f in FAMILIES)
    assert all(worlds.of(f, "physics") is w and w not in WORLDS.values() for f, w in WAITING.items())
    assert all(worlds.of(f, "deep") is WORLDS["plain"] for f in FAMILIES)
    assert {id(worlds.of("all", "physics", seed)) for seed in range(200)} == {id(w) for w in WORLDS.values()}


@pytest.mark.parametrize("name", ALL_WORLDS)
@pytest.mark.parametrize(
    ("kind", "low", "high"), [("highway", 14.0, 28.0), ("suburban", 0.0, 18.0), ("descent", 0.0, 20.0)]
)
def test_speeds_are_those_of_the_kind_of_drive(name, kind, low, high):
    speed = ALL_WORLDS[name].speed_profile(np.random.default_rng(4), kind, 3000, 0.1)
    assert speed.shape == (3000,) and low <= speed.min() and speed.max() <= high
    assert np.abs(np.diff(speed)).max() < 0.3
    assert (speed.min() < 0.5) == (kind == "suburban")


@pytest.mark.parametrize("name", ALL_WORLDS)
def test_roads_climb_and_fall_and_a_way_down_goes_down(name):
    world, rng = ALL_WORLDS[name], np.random.default_rng(4)
    drawn = world.draw_roads(rng, ["hills"] * 4 + ["descent"] * 4, False)
    grade = np.array([drawn.grade_at(np.full(8, m)) for m in np.arange(0.0, 40000.0, 50.0)])
    assert np.abs(grade).max() < 0.09
    assert 0.015 < grade[:, :4].std() < 0.045 and np.all(grade[:, 4:].mean(axis=0) < -0.03)
    assert not world.draw_roads(rng, ["hills", "descent"], True).grade.any()


@pytest.mark.parametrize("name", ALL_WORLDS)
def test_trucks_are_drawn_between_empty_and_full(name):
    masses = [ALL_WORLDS[name].fleet.draw("volvo", np.random.default_rng(k))["mass"] for k in range(30)]
    assert 13000.0 < min(masses) < 20000.0 and 36000.0 < max(masses) < 47000.0


def test_trucks_of_a_proving_ground_carry_ballast():
    fleet = WORLDS["proving ground"].fleet
    masses = [fleet.draw("volvo", np.random.default_rng(k))["mass"] for k in range(9)]
    assert max(min(abs(m / 30000.0 - f) for f in BALLAST["volvo"]) for m in masses) < 0.04


def test_laps_come_again():
    grade = roads.laps(np.random.default_rng(5), 0.03)
    again = [np.max(np.abs(grade[lap:] - grade[:-lap])) for lap in range(320, 641)]
    assert min(again) < 1e-9 and 0.025 < grade.std() < 0.031


def test_the_land_is_flat_between_climbs():
    grade = roads.climbs(np.random.default_rng(5), 0.03)
    assert 0.3 < np.mean(np.abs(grade) < 0.003) < 0.7 and 0.025 < grade.std() < 0.032


def test_the_land_swells():
    land = roads.swell(np.random.default_rng(5), 2000.0, 0.3)
    assert np.isclose(land.std(), 1.0) and np.abs(np.diff(land)).max() < 0.3


def test_drumlins_are_steeper_on_one_side():
    for seed in range(4):
        grade = roads.drumlins(np.random.default_rng(seed), 0.03)
        up, down = grade[grade > 0.002].mean(), -grade[grade < -0.002].mean()
        assert max(up, down) > 1.1 * min(up, down) and 0.02 < grade.std() < 0.031


def test_fans_end_flatter_than_they_begin():
    grade = roads.fans_down(np.random.default_rng(5))
    assert np.quantile(grade, 0.02) < -0.06 and np.quantile(grade, 0.98) > -0.04
    assert np.mean(np.diff(grade) > 0.0) > 0.75  # ever flatter, but at the heads


def test_hummocks_lie_in_belts():
    for seed in range(4):
        grade = roads.hummocks(np.random.default_rng(seed), 0.03)
        belts = np.abs(grade)[:5900].reshape(-1, 100).mean(axis=1)
        assert 0.02 < grade.std() < 0.031 and np.quantile(belts, 0.9) > 1.5 * np.quantile(belts, 0.1)


def test_slumps_are_steep_or_gentle_and_little_between():
    grade = roads.slumps_down(np.random.default_rng(5))
    between = np.mean((grade > -0.055) & (grade < -0.042))
    assert np.quantile(grade, 0.1) < -0.058 and np.quantile(grade, 0.9) > -0.042 and between < 0.25


def test_speeds_follow_the_bends_and_stop_at_junctions_alone():
    rng = np.random.default_rng(7)
    town, highway, down = (bendy(rng, kind, 6000, 0.1) for kind in ("suburban", "highway", "descent"))
    assert np.mean(town < 0.05) > 0.03 and highway.min() > 14.0 and down.min() > 3.0
    assert highway.std() > 0.8 and down.std() > 0.8


def test_plateaus_are_level_between_gorges():
    for seed in range(4):
        grade = roads.gorges(np.random.default_rng(seed), 0.03)
        assert 0.02 < grade.std() < 0.032 and 0.15 < np.mean(np.abs(grade) < 0.003) < 0.65


def test_noses_are_ever_steeper():
    grade = roads.noses_down(np.random.default_rng(5))
    assert np.quantile(grade, 0.05) < -0.055 and np.quantile(grade, 0.95) > -0.035
    assert np.mean(np.diff(grade) < 0.0) > 0.7


def test_roundabouts_are_slow_and_some_are_stops_in_town():
    rng = np.random.default_rng(7)
    town, highway, down = (roundabouts(rng, kind, 6000, 0.1) for kind in ("suburban", "highway", "descent"))
    assert 0.02 < np.mean(town < 0.05) < 0.4 and highway.min() > 14.0 and down.min() > 3.0
    assert highway.std() > 0.8 and down.std() > 0.8


def test_zones_have_stops_in_town_alone():
    rng = np.random.default_rng(7)
    town, highway = (np.mean(zones(rng, kind, 6000, 0.1) < 0.05) for kind in ("suburban", "highway"))
    assert town > 0.05 and highway == 0.0


def test_people_and_machines_follow_the_speed_within_reason(drives):
    seen = drives.drives.channels
    assert np.abs(seen["acceleration"]).max() < 4.0 and seen["speed"].max() < 30.0
    acts = np.ptp(seen["engine_command"], axis=1) + np.ptp(seen["brake_command"], axis=1)
    assert acts.min() > 0.0


def test_sensors_are_near_the_truth(drives):
    measured, true = measure(drives), drives.drives.channels
    for row, channels in enumerate(measured):
        counts = channels["speed"] * 3.6 * 256.0
        np.testing.assert_allclose(counts, np.rint(counts), atol=1e-6)
        assert np.std(channels["speed"] - true["speed"][row]) < 0.15
        assert abs(np.mean(channels["acceleration"] - true["acceleration"][row])) < 0.04
        assert "grade" not in channels or np.std(channels["grade"] - true["grade"][row]) < 0.006


def test_messages_that_are_missing_are_held_or_joined():
    values, missing = np.arange(8.0), np.array([0, 0, 1, 1, 0, 0, 1, 0], bool)
    held, joined = (Logger(joined=j)._filled(values**2, missing) for j in (False, True))
    np.testing.assert_array_equal(held, [0, 1, 1, 1, 16, 25, 25, 49])
    np.testing.assert_array_equal(joined, [0, 1, 6, 11, 16, 25, 37, 49])


def test_a_step_of_nothing_leaves_values_alone():
    np.testing.assert_array_equal(quantise(np.array([0.1, 0.26]), 0.25), [0.0, 0.25])
    np.testing.assert_array_equal(quantise(np.array([0.1]), 0.0), [0.1])


def test_karst_and_lava_are_steep_in_their_own_ways():
    for seed in range(4):
        assert 0.02 < karst(np.random.default_rng(seed), 0.03).std() < 0.032
    steps = lava_down(np.random.default_rng(5))
    assert np.quantile(steps, 0.1) < -0.05 and np.quantile(steps, 0.9) > -0.042


def test_errands_meet_obstacles_that_are_stops_in_town():
    rng = np.random.default_rng(7)
    town, highway, down = (errands(rng, kind, 6000, 0.1) for kind in ("suburban", "highway", "descent"))
    assert 0.02 < np.mean(town < 0.05) < 0.5 and highway.min() > 14.0
    assert highway.std() > 0.8 and down.std() > 0.8


def test_fjords_are_level_between_and_troughs_go_down_in_steps():
    for seed in range(4):
        grade = fjords(np.random.default_rng(seed), 0.03)
        assert 0.02 < grade.std() < 0.032 and 0.15 < np.mean(np.abs(grade) < 0.003) < 0.65
    steps = troughs_down(np.random.default_rng(5))
    assert np.quantile(steps, 0.1) < -0.055 and np.quantile(steps, 0.9) > -0.04


def test_narrow_roads_have_stops_in_town_alone():
    rng = np.random.default_rng(7)
    town, highway, down = (narrow(rng, kind, 6000, 0.1) for kind in ("suburban", "highway", "descent"))
    assert 0.02 < np.mean(town < 0.05) < 0.5 and highway.min() > 14.0
    assert highway.std() > 0.8 and down.std() > 0.8


def test_basins_are_level_and_their_ranges_steepest_at_the_pass():
    for seed in range(4):
        grade = basins(np.random.default_rng(seed), 0.03)
        assert 0.02 < grade.std() < 0.032 and 0.15 < np.mean(np.abs(grade) < 0.003) < 0.65
        passes = np.flatnonzero((grade[:-1] > 0.0) & (grade[1:] <= 0.0))[1:-1]
        assert np.median(grade[passes - 8]) > 1.3 * np.median(grade[passes - 40])
    steps = washes_down(np.random.default_rng(5))
    assert np.quantile(steps, 0.05) < -0.06 and np.quantile(steps, 0.95) > -0.03


def test_one_is_held_up_by_the_slow_and_stops_at_crossings_in_town_alone():
    rng = np.random.default_rng(7)
    town, highway, down = (held_up(rng, kind, 6000, 0.1) for kind in ("suburban", "highway", "descent"))
    assert 0.05 < np.mean(town < 0.05) < 0.5 and highway.min() > 14.0 and down.min() > 2.0
    assert highway.std() > 0.8 and down.std() > 0.8


def test_round_hills_are_steepest_at_their_feet_and_gullies_flatten():
    for seed in range(4):
        grade = round_hills(np.random.default_rng(seed), 0.03)
        assert 0.02 < grade.std() < 0.032 and 0.1 < np.mean(np.abs(grade) < 0.003) < 0.5
        feet = np.flatnonzero((grade[:-1] < 0.0) & (grade[1:] >= 0.0))[1:-1]
        tops = np.flatnonzero((grade[:-1] > 0.0) & (grade[1:] <= 0.0))[1:-1]
        assert np.median(np.abs(grade[feet - 5])) > 1.5 * np.median(np.abs(grade[tops - 5]))
    steps = gullies_down(np.random.default_rng(5))
    assert np.quantile(steps, 0.1) < -0.055 and np.quantile(steps, 0.97) > -0.03


def test_convoys_swing_and_stop_in_town_alone():
    rng = np.random.default_rng(7)
    town, highway, down = (convoys(rng, kind, 6000, 0.1) for kind in ("suburban", "highway", "descent"))
    assert 0.005 < np.mean(town < 0.05) < 0.5 and highway.min() > 14.0 and down.min() > 2.0
    assert highway.std() > 0.8 and down.std() > 0.8


def test_folds_have_straight_limbs_and_slopes_swell_like_waves():
    for seed in range(4):
        grade = folds(np.random.default_rng(seed), 0.03)
        assert 0.025 < grade.std() < 0.032 and np.mean(np.abs(grade) > 0.02) > 0.75
        limbs = np.diff(np.flatnonzero(np.diff(np.sign(grade)) != 0.0))
        assert 15 < np.median(limbs) < 75
    steps = waves_down(np.random.default_rng(5))
    assert np.quantile(steps, 0.1) < -0.06 and np.quantile(steps, 0.9) > -0.032


def test_a_timetable_has_stops_in_town_alone():
    rng = np.random.default_rng(7)
    town, highway, down = (timetable(rng, kind, 6000, 0.1) for kind in ("suburban", "highway", "descent"))
    assert 0.05 < np.mean(town < 0.05) < 0.5 and highway.min() > 14.0 and down.min() > 2.0
    assert highway.std() > 0.8 and down.std() > 0.8


def test_cones_have_craters_at_their_tops_and_flanks_flatten():
    for seed in range(4):
        grade = cones(np.random.default_rng(seed), 0.03)
        assert 0.025 < grade.std() < 0.032
        signs = np.sign(grade[np.abs(grade) > 0.008])
        runs = np.diff(np.flatnonzero(np.diff(signs) != 0.0))  # flank, crater, crater, flank
        assert np.quantile(runs, 0.75) > 2.0 * np.quantile(runs, 0.25)
    steps = flanks_down(np.random.default_rng(5))
    assert np.quantile(steps, 0.05) < -0.055 and np.quantile(steps, 0.95) > -0.034


def test_lights_are_stopped_at_in_town_alone():
    rng = np.random.default_rng(7)
    town, highway, down = (lights(rng, kind, 6000, 0.1) for kind in ("suburban", "highway", "descent"))
    assert 0.05 < np.mean(town < 0.05) < 0.5 and highway.min() > 14.0 and down.min() > 2.0
    assert highway.std() > 0.8 and down.std() > 0.8


def test_slopes_of_badlands_are_even_between_their_creases_and_knicks_flatten():
    for seed in range(4):
        grade = badlands(np.random.default_rng(seed), 0.03)
        assert 0.025 < grade.std() < 0.032
        assert np.mean(np.abs(np.diff(grade)) < 1e-6) > 0.55  # neither bends nor waves
    steps = knicks_down(np.random.default_rng(5))
    assert np.quantile(steps, 0.05) < -0.055 and np.quantile(steps, 0.95) > -0.034
    assert np.mean(np.diff(steps) > 0.0) > 0.75  # steep at once, flatter by and by


def test_fog_slows_everywhere_and_stops_in_town_alone():
    rng = np.random.default_rng(7)
    town, highway, down = (fog(rng, kind, 6000, 0.1) for kind in ("suburban", "highway", "descent"))
    assert 0.05 < np.mean(town < 0.05) < 0.5 and highway.min() > 14.0 and down.min() > 2.0
    assert highway.std() > 0.8 and down.std() > 0.8


def test_polders_are_level_between_straight_ramps_and_hairpins_are_eased():
    for seed in range(4):
        grade = polders(np.random.default_rng(seed), 0.03)
        assert 0.022 < grade.std() < 0.032 and 0.3 < np.mean(np.abs(grade) < 1e-6) < 0.75
        assert np.mean(np.abs(grade) > 0.5 * np.abs(grade).max()) > 0.2
    steps = hairpins_down(np.random.default_rng(5))
    assert np.quantile(steps, 0.1) < -0.058 and np.quantile(steps, 0.96) > -0.028
    assert np.mean(np.abs(np.diff(steps)) < 1e-6) > 0.6  # even legs


def test_speeds_lapse_and_bridges_are_waited_at_in_town_alone():
    rng = np.random.default_rng(7)
    town, highway, down = (lapses(rng, kind, 6000, 0.1) for kind in ("suburban", "highway", "descent"))
    assert 0.05 < np.mean(town < 0.05) < 0.5 and highway.min() > 14.0 and down.min() > 2.0
    assert highway.std() > 0.8 and down.std() > 0.8


def test_treads_of_terraces_are_nearly_level_and_a_stair_has_steps_of_one_height():
    for seed in range(4):
        grade = terraces(np.random.default_rng(seed), 0.03)
        assert 0.022 < grade.std() < 0.032 and 0.4 < np.mean(np.abs(grade) < 0.008) < 0.85
        assert np.abs(grade).max() > 0.045
    steps = stair_down(np.random.default_rng(5))
    assert np.quantile(steps, 0.1) < -0.055 and np.quantile(steps, 0.98) > -0.03
    assert np.mean(np.abs(np.diff(steps)) < 1e-6) > 0.4  # even beds


def test_roadworks_slow_everywhere_and_hold_in_town_alone():
    rng = np.random.default_rng(7)
    town, highway, down = (works(rng, kind, 6000, 0.1) for kind in ("suburban", "highway", "descent"))
    assert 0.05 < np.mean(town < 0.05) < 0.5 and highway.min() > 14.0 and down.min() > 2.0
    assert highway.std() > 0.8 and down.std() > 0.8


def test_ridges_of_sand_are_steepest_at_their_crests_and_dams_at_their_ends():
    for seed in range(4):
        grade = sand_ridges(np.random.default_rng(seed), 0.03)
        assert 0.022 < grade.std() < 0.032 and 0.3 < np.mean(np.abs(grade) < 0.01) < 0.7
        crests = (grade[:-10] > 0.03) & (grade[10:] < -0.03)  # from steeply up to steeply down in 100 m
        assert crests.sum() > 50
    steps = np.diff(dammed_down(np.random.default_rng(5)))
    assert np.mean(steps < -1e-6) > 0.6 and steps.max() > 3.0 * -steps.min()  # ever steeper, and then level


def test_cameras_make_speeds_swing_and_gates_hold_in_town_alone():
    rng = np.random.default_rng(7)
    town, highway, down = (cameras(rng, kind, 6000, 0.1) for kind in ("suburban", "highway", "descent"))
    assert 0.05 < np.mean(town < 0.05) < 0.5 and highway.min() > 14.0 and down.min() > 2.0
    assert highway.std() > 0.8 and down.std() > 0.8
