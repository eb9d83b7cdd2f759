"""What holds for every hidden effect: it has a name, a source and sizes; its force acts in its direction and
size along real drives, leaves a standing truck alone and copies apart; a filter is late and arrives."""

import copy
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from deeptruck_exam import sealed
from deeptruck_exam.effects import EFFECTS, named, of_family, of_kind, unknown
from deeptruck_exam.effects.planting import ALL, FAMILIES, SEALED
from deeptruck_exam.worlds.trucks import TUNABLE

NAMES = {
    "brake_fade", "brake_lag", "dragging_brake", "headwind", "drafting", "drag_area", "road_grade",
    "rolling_resistance_speed", "rolling_resistance_warmup", "road_surface", "payload_change", "turbo_lag",
    "torque_derate", "torque_limit", "engine_brake", "engine_friction", "accessory_load", "driveline_loss",
    "shift_interruption", "torque_converter_slip", "wheel_slip", "rotating_inertia", "load_slosh",
    "command_delay", "command_rate_limit", "driveline_backlash",
}  # fmt: skip
FAULTS = {"clock_offset", "speed_scale", "acceleration_bias", "grade_bias"}
COUNTS = {
    "first": 51,
    "second": 36,
    "third": 40,
    "fourth": 50,
    "fifth": 45,
    "sixth": 40,
    "seventh": 37,
    "eighth": 38,
    "ninth": 38,
    "tenth": 39,
    "eleventh": 38,
    "twelfth": 38,
    "thirteenth": 38,
    "fourteenth": 38,
    "fifteenth": 38,
    "sixteenth": 38,
    "seventeenth": 38,
    "eighteenth": 38,
    "nineteenth": 42,
    "twentieth": 41,
    "twenty-first": 39,
}
MISSING = [e for e in EFFECTS.values() if e.kind == "missing_physics"]
NO_FORCE = {
    "road_grade",
    "torque_converter_slip",
    "stator_freewheels",
}  # a slope unrecorded, other parameters
FILTERS = [e.key for e in MISSING if e.name.startswith("command") or e.key == "worn_linkage"]
FORCES = [e.key for e in MISSING if e.key not in NO_FORCE and e.key not in FILTERS]
# families whose forces act in every test run; those of the others in long ones
QUICK = ("first", "twenty-first", SEALED)
WAITING = (SEALED,) if any(e.family == SEALED for e in EFFECTS.values()) else ()  # none once it is proved
HELPS = {
    "brake_fade", "drafting", "trolley_wire", "steam_from_exhaust", "overboost", "pushed_by_a_second_tractor",
    "hydrostatic_front_axle", "antilock_is_fooled", "hole_in_the_blending", "fast_idle_pushes",
    "pedal_sticks_where_it_rests", "burns_its_own_oil", "remembers_a_speed", "dolly_pushes_uphill",
    "expander_pushes_late", "eco_roll", "wake_bistability", "wet_brakes", "s_winch_assist",
    "s_rail_bleeds", "s_anti_stall", "t_valve_thinks_it_is_empty", "t_softens_the_stop",
    "e_gas_in_the_air", "e_fan_that_is_gone",
    "y_ball_shuts_the_valve", "b_servo_has_no_store",
    "u_somebody_follows_closely", "u_water_goes_in",
    "j_trailers_valve_opens_late", "j_has_to_be_pumped",
}  # fmt: skip
BOTH_WAYS = {  # winds, bodies, slopes, masses and late brakes push and hold; so do governors and mode changes
    "headwind", "exchanged_bodies", "lining_on_the_dynamometer", "brake_lag", "road_grade", "payload_change",
    "rotating_inertia", "load_slosh", "driveline_backlash", "clutch_meters_in", "wheel_slip",
    "torque_converter_slip", "tunnels", "drums_out_of_round", "all_speed_governor", "hydraulic_launch_assist",
    "cylinders_rest", "trucks_that_pass", "drum_on_a_belt", "worn_clutch_damper", "clunk_and_shuffle",
    "filled_gaps_are_paid_back", "hybrid_axle", "hitch_spring", "stepping_suspension_lock",
    "s_pedal_map", "s_surge_damper", "n_load_point_is_shifted", "n_pulse_and_glide", "n_jet_of_the_monitor",
    "n_brush_has_its_own_speed", "t_electronic_drawbar", "t_gear_jumps_out", "t_fuel_changes_over",
    "t_pneumatic_hybrid", "e_brake_closes_the_loop", "e_power_hop",
    "w_hears_the_leader", "w_zone_without_engine", "w_learns_from_slopes", "w_flywheel_pays",
    "w_lifters_pump_up",
    "x_weighs_itself", "x_turbine_on_the_shaft", "x_fuel_wets_the_walls",
    "k_wears_its_axles_by_turns", "k_trailer_carries_itself",
    "q_learns_brake_by_brake", "q_burns_soot_on_the_way",
    "z_valve_reads_the_nod", "z_capacitor_answers_first", "z_pontoons_sink",
    "y_cab_tugs_at_its_cable", "y_mixture_swings", "y_pipes_in_tune", "y_road_up_a_stream",
    "h_pedal_asks_for_a_pull", "h_magnet_over_iron_plates", "h_needle_hangs",
    "b_drum_turns_in_the_side_wind", "b_pedal_asks_for_power", "b_rubber_wound_by_braking",
    "b_two_maps_do_not_meet", "b_fires_whole_cylinders", "b_motor_lies_in_the_road",
    "u_another_foot_valve", "u_motor_for_the_first_metres", "u_two_tanks_of_unlike_fuel",
    "j_sheds_its_servants",
}  # fmt: skip
CHANNEL = {"speed_scale": "speed", "grade_bias": "grade", "commands_from_another_clock": "brake_command"}


def test_no_effect_is_lost_and_each_belongs_to_one_family():
    assert {family: len([e for e in EFFECTS.values() if e.family == family]) for family in FAMILIES} == COUNTS
    assert len(of_family(ALL)) == sum(COUNTS.values()) == 840


def test_the_sealed_family_is_whole_and_alone():
    assert "Contract" in sealed.__doc__
    allowed = ("law", "places", "planting", "series")
    for path in Path(sealed.__file__).parent.glob("*.py"):
        for line in path.read_text().splitlines():
            if line.startswith("from deeptruck_exam."):
                assert line.split()[1] in {f"deeptruck_exam.effects.{name}" for name in allowed}
            assert "mismatch" not in line
    assert all(8 <= len(unknown(family)) <= 10 for family in WAITING)
    assert not any(e.family == SEALED for e in of_family(ALL))


@pytest.mark.parametrize("family", (*FAMILIES, *WAITING))
def test_every_name_has_an_effect_of_the_family(family):
    assert {e.name for e in named(family)} == NAMES
    assert {e.name for e in of_kind("measurement_fault", family)} == FAULTS
    assert {e.name for e in of_kind("parameter_error", family)} == set(TUNABLE)
    assert len(unknown(family)) >= 6 and not any(e.accepts for e in unknown(family))


@pytest.mark.parametrize("key", EFFECTS)
def test_source_and_ranges_are_stated(key):
    effect = EFFECTS[key]
    assert len(effect.source) > 40
    assert all(low < high for low, high in effect.ranges.values())
    drawn = [effect.draw(np.random.default_rng(k)) for k in range(20)]
    for name, (low, high) in effect.ranges.items():
        values = [d[name] for d in drawn]
        assert low <= min(values) < max(values) <= high


@pytest.mark.parametrize(
    "key",
    [key if EFFECTS[key].family in QUICK else pytest.param(key, marks=pytest.mark.long) for key in FORCES],
)
def test_a_force_has_a_plausible_size_and_the_right_sign(key, acted):
    force, _ = acted(key)
    assert np.isfinite(force).all()
    assert 0.02 < np.abs(force).max() < 6.0
    assert 0.002 < np.sqrt(np.mean(force**2)) < 0.6
    names = {EFFECTS[key].name, key}
    if names & BOTH_WAYS:
        assert force.min() < 0.0
    elif names & HELPS:
        assert force.min() > -1e-9
    else:
        assert force.max() < 1e-9


@pytest.mark.parametrize("key", FORCES)
def test_a_force_leaves_a_standing_truck_alone_and_copies_apart(key, alone, scene):
    law = alone(key)
    braked = scene(
        speed=0.0, u0=0.0, u1=20.0, brake_force=0.0, traction_force=0.0, drag_force=0.0, engine_torque=0.0
    )
    for _ in range(20):
        # a mass or a brake that is wrong may pull, but nothing may push a truck that stands on the flat
        assert np.all(np.abs(law.force(braked, 0.01)) < 0.35 * braked.mass)
    rolling = scene(speed=14.0, u0=400.0, acceleration=0.2)
    twin = copy.deepcopy(law)
    first = law.force(rolling, 0.01).copy()
    for k in range(5):
        law.force(scene(speed=14.0, brake_force=2e4 * k), 0.01)
    np.testing.assert_array_equal(twin.force(rolling, 0.01), first)


@pytest.mark.parametrize("key", FILTERS)
def test_a_filter_is_late_and_arrives(key, between):
    one, lost = between(key, 2), 0.4 if key == "worn_linkage" else 1e-6  # what play keeps back
    full = 0.5 * one.full
    before, after = np.tile([0.0, 0.0], (2, 1)), np.tile([full, 5.0], (2, 1))
    for k in range(300):
        np.testing.assert_array_equal(one.filter(before, 0.01 * k, 0.01), before)
    twin = copy.deepcopy(one)
    early = one.filter(after, 3.0, 0.01)[:, 0].copy()
    for k in range(4000):
        late = one.filter(after, 3.0 + 0.01 * k, 0.01)
    np.testing.assert_allclose(late, after, rtol=lost)
    assert np.all(early < (1.0 if key == "worn_linkage" else 0.25) * full)
    np.testing.assert_array_equal(twin.filter(after, 3.0, 0.01)[:, 0], early)


@pytest.mark.parametrize("key", [e.key for e in EFFECTS.values() if e.kind == "measurement_fault"])
def test_a_fault_spoils_its_channel_and_no_other(key, moments):
    effect = EFFECTS[key]
    channel = CHANNEL.get(key, CHANNEL.get(effect.name, "acceleration"))
    setting, seen = moments("volvo")
    names = ("speed", "acceleration", "grade", "engine_speed", "engine_torque", "gear", "elevation")
    rows = {name: np.array([getattr(v, name)[1] for v in seen[::2]]) for name in names}
    rows |= {
        f"{who}_command": np.array([v.u[1, k] for v in seen[::2]])
        for k, who in enumerate(("engine", "brake"))
    }
    planted = effect.build(setting, SimpleNamespace(**effect.draw(np.random.default_rng(3))))
    assert not planted.forces and not planted.filters
    out = {name: values.copy() for name, values in rows.items()}
    planted.faults[0](out, 0.1, np.random.default_rng(1))
    changed = {name for name in rows if np.any(out[name] != rows[name])}
    several = key in ("commands_from_another_clock", "clock_offset_responses")
    assert channel in changed and (several or changed == {channel})
    if channel != "brake_command":
        off = np.sqrt(np.mean((out[channel] - rows[channel]) ** 2))
        assert off > (0.006 if channel == "grade" else 0.02)
