"""Vehicle files: what they mean, and that a mistake is one clear line."""

from __future__ import annotations

import itertools
import math
from importlib import resources

import numpy as np
import pytest
import yaml

from deeptruck_core.signals import SPEED
from deeptruck_model.simulators import load as load_truck
from truck_bridge import vehicles
from truck_bridge.errors import InputError


@pytest.fixture(params=vehicles.NAMES)
def vehicle(request):
    return vehicles.load(request.param)


@pytest.mark.parametrize("share", [-0.4, 0.0, 0.3, 0.8])
def test_demands_and_commands_are_inverse(vehicle, share):
    engine = share * (1950 if vehicle.interface["engine_unit"] == "N m" else 100)
    brake = 2.0
    assert vehicle.commands(vehicle.demands(engine, brake)) == pytest.approx((engine, brake))


def test_torque_in_percent_of_the_reference():
    demands = vehicles.load("trucksim").demands(975.0, 40.0)
    assert demands == {"engine": 50.0, "retarder": 0.0, "brake": 40.0}
    demands = vehicles.load("trucksim").demands(-525.0, 0.0)
    assert demands == {"engine": 0.0, "retarder": pytest.approx(-50.0), "brake": 0.0}
    assert vehicles.load("volvo").demands(10.0, 2.0)["brake"] == -2.0


def test_inside_the_envelope_demands_saturate_and_outside_they_are_no_number(vehicle):
    low, high = vehicle.envelope["engine"]
    assert vehicle.demands(high, 0.0)["engine"] == 100.0
    assert vehicle.demands(low, 0.0)["retarder"] == -100.0
    for engine, brake in (
        (high + 1, 0.0),
        (low - 1, 0.0),
        (0.0, -0.1),
        (0.0, 1e3),
        (math.nan, 0.0),
        (0.0, math.nan),
    ):
        assert all(map(math.isnan, vehicle.demands(engine, brake).values()))


NAN = math.nan


@pytest.mark.parametrize(
    ("name", "received", "engine", "brake"),
    [
        ("trucksim", {"driver_demand_torque": 40.0, "brake_pedal": 10.0}, 780.0, 10.0),
        ("trucksim", {"driver_demand_torque": NAN, "accelerator_pedal": 40.0}, None, None),
        ("freightliner", {"driver_demand_torque": 40.0, "accelerator_pedal": 55.0}, 40.0, None),
        ("freightliner", {"driver_demand_torque": NAN, "accelerator_pedal": 55.0}, 55.0, None),
        ("freightliner", {"accelerator_pedal": NAN, "brake_pedal": NAN}, NAN, NAN),
        ("volvo", {"driver_demand_torque": 40.0, "brake_pedal": 0.0}, 40.0, 0.0),
        ("volvo", {"driver_demand_torque": -5.0, "brake_pedal": 10.0}, -5.0, NAN),
        ("volvo", {}, None, None),
    ],
)
def test_the_driver_s_demands_are_in_the_units_of_the_commands(name, received, engine, brake):
    expected = {"driver_engine_demand": engine, "driver_brake_demand": brake}
    found = vehicles.load(name).driver_demands(received)
    assert found == pytest.approx({k: v for k, v in expected.items() if v is not None}, nan_ok=True)


def test_frames_on_the_wire():
    engine = vehicles.load("volvo").transmitted["engine"]
    assert engine.frame(30.0, 0) == bytes([0b11100010, 0xFF, 0xFF, 155, 0xFF, 0xFF, 0xFF, 0xFF])
    assert engine.frame(math.nan, 0) == bytes([0b11111100, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF])
    assert engine.axis.can_id == 0x0C00002A
    assert vehicles.load("volvo").transmitted["brake"].axis.can_id == 0x0C040B2A
    assert vehicles.load("trucksim").transmitted["brake"].axis.can_id == 0x0CEF0B2A


def edited(tmp_path, change, base="trucksim"):
    data = yaml.safe_load((resources.files("truck_bridge.vehicles") / f"{base}.yaml").read_text())
    change(data)
    path = tmp_path / "mine.yaml"
    path.write_text(yaml.safe_dump(data))
    return path


def put(*keys):
    *way, last, value = keys

    def change(data):
        for key in way:
            data = data[key]
        data[last] = value

    return change


def twice(key, message, signals, sender="engine"):
    spec = {"message": message, "from": sender, "period": 0.1, "timeout": 0.3, "signals": signals}
    return put("receive", key, spec)


LIMIT = {"modes": [3], "longest": 5, "period": [0.008, 0.05]}


def test_what_others_may_demand_reaches_the_core(vehicle):
    allowed = {demand.name: demand for demand in vehicle.table.allowed}
    brake = allowed["brake to engine"]
    assert (brake.key, brake.modes, brake.longest_s, brake.period_s) == (0x0B, (3,), 5, (0.008, 0.05))
    assert allowed["brake to retarder"].key == 0x0F0B
    assert allowed["transmission to engine"].key == 0x03


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (put("demands", "brake", "brake", LIMIT), "demands.brake.brake: only what TSC1 commands"),
        (put("demands", "brake", "rocket", LIMIT), "can be allowed: engine, retarder"),
        (put("demands", "brake", "engine", "period", [0.05, 0.01]), "demands.brake.engine.period needs two"),
        (put("bridge", "address", 300), "300 is greater than the maximum of 253"),
        (put("transmit", "engine", "message", "TSC9"), "no message 'TSC9'"),
        (
            put("transmit", "engine", "active", "TransmissionRate", -1),
            "transmit.engine: TransmissionRate = -1",
        ),
        (put("transmit", "engine", "demand", "Torque"), "TSC1 has no signal 'Torque'"),
        (put("transmit", "engine", "to", "rocket"), "no address for 'rocket'"),
        (put("transmit", "engine", "limits", "speed", [0, 40]), "the same number of points"),
        (put("transmit", "engine", "limits", "speed", [0, 5, 5]), "must grow"),
        (put("transmit", "brake", "limits", "high", [90, 0]), "make it flatter"),
        (put("transmit", "brake", "limits", "low", [1, 1]), "must hold 0"),
        (put("receive", "EEC1", "signals", "x", "Speed"), "EEC1 has no signal 'Speed'"),
        (put("receive", "EEC1", "check", "xbr"), "byte 8 of EEC1 holds EngineDemandPercentTorque"),
        (twice("speedo", "CCVS1", {"other": "WheelBasedVehicleSpeed"}), "'0xFEF100' is named twice"),
        (put("driver", "horn", 1), "signal 'horn' is not received"),
        (put("command", "engine", [1]), "needs two numbers"),
        (put("receive", "CCVS1", "fastest", {"sped": 12}), "receive.CCVS1.fastest: no signal 'sped'"),
        (put("receive", "EEC1", "still", {"speed": 0.5}), "receive.EEC1.still: no signal 'speed'"),
        (put("follows", "engine", "signal", "torque"), "follows: signal 'torque'"),
        (
            put("follows", "motor", {"signal": "engine_percent", "beyond": 30}),
            "follows: nothing commands 'motor'",
        ),
        (put("timing", {"stall": math.nan}), "nan is not of type 'number'"),
        (put("timing", {"assumed": 31.0}), "31.0 is greater than the maximum of 30"),
        (put("timing", {"fade_longest": 10.5}), "10.5 is greater than the maximum of 10"),
        (put("timing", {"handover_scale": 0.1}), "make it flatter or rate and fade larger"),
        (put("dbc", ["gone.dbc"]), "cannot read"),
    ],
)
def test_a_mistake_is_one_line_that_names_file_and_place(tmp_path, change, says):
    path = edited(tmp_path, change)
    with pytest.raises(InputError) as error:
        vehicles.load(path)
    assert says in str(error.value)
    assert "mine.yaml" in str(error.value)
    assert "\n" not in str(error.value)


def test_a_file_that_says_nothing_of_faults_blocks_the_red_stop_lamp(tmp_path):
    quiet = vehicles.load(edited(tmp_path, lambda d: d.pop("faults"))).blocking
    assert (quiet.lamps, quiet.codes, quiet.listen_s) == ({"red_stop_lamp"}, (), 0.0)
    none = vehicles.load(edited(tmp_path, put("faults", {}))).blocking
    assert (none.lamps, none.codes) == (frozenset(), ())


def test_no_such_vehicle_and_no_yaml(tmp_path):
    with pytest.raises(InputError, match="no vehicle 'unicorn'; known: trucksim"):
        vehicles.load("unicorn")
    path = tmp_path / "broken.yaml"
    path.write_text("a: [1,\nb: }")
    with pytest.raises(InputError, match="line 2"):
        vehicles.load(path)
    path.write_text("just text")
    with pytest.raises(InputError, match="must hold 'key: value' pairs"):
        vehicles.load(path)


@pytest.mark.parametrize(
    ("name", "load_factor", "braking"),
    [("trucksim", 1.0, 5.2), ("volvo", 1.0, 6.0), ("freightliner", 1.0, 7.1), ("freightliner", 2.0, 5.2)],
)
def test_the_full_demand_brakes_as_the_page_says(name, load_factor, braking):
    """docs/safety_core.md; from 20 to 1 m/s on the level, the hardest step."""
    truck, high = load_truck(f"truck:{name}"), vehicles.load(name).brake_limit
    truck = truck.with_parameters({"mass": load_factor * truck.parameters()["mass"]})
    start = np.zeros((1, len(truck.interface.y)))
    start[0, SPEED] = 20.0
    state, speeds = truck.reset(start), [20.0]
    while speeds[-1] > 1.0:
        state, y = truck.step(state, np.array([[0.0, high]]), np.zeros((1, len(truck.interface.w))))
        speeds.append(float(y[0, SPEED]))
    assert -np.diff(speeds).min() / truck.dt == pytest.approx(braking, abs=0.06)


def test_no_two_messages_share_a_turn(vehicle):
    """Sent together, one of them gets lost (PATH): turns differ by 5 ms or more."""
    turns = {
        round(message.phase_s + k * message.axis.period_s, 6): name
        for name, message in vehicle.transmitted.items()
        for k in range(round(0.1 / message.axis.period_s))
    }
    assert len(turns) == 5 + 5 + 2
    times = sorted(turns)
    assert min(b - a for a, b in itertools.pairwise(times)) >= 0.005 - 1e-9
