"""COLUMNS.yaml proposed for tables of many kinds, and what `import` makes of it, in SI."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import pytest
import yaml
from pyarrow import parquet

from deeptruck_core.arrays import Array
from deeptruck_model.recordings import TableSuggestion, import_table, suggest_columns
from deeptruck_model.recordings.units import fits
from deeptruck_model.recordings.words import COMMANDED, header, named_channels

DT = 0.1
TIME = DT * np.arange(1200)
SPEED = 12.0 + 11.0 * np.sin(TIME / 12.0 - 1.0)  # m/s, 1 to 23
ACCELERATION = 11.0 / 12.0 * np.cos(TIME / 12.0 - 1.0)
PEDAL = 45.0 + 40.0 * np.cos(TIME / 12.0 - 1.0)  # %
BRAKE = np.fmax(0.0, -40.0 * np.cos(TIME / 12.0 - 1.0))  # %
GEAR = 1.0 + np.floor(SPEED / 3.0)
RPM = 900.0 + 250.0 * (SPEED % 3.0)
FUEL = 2.0 + 0.1 * PEDAL  # cm^3/s
DRIVEN = np.cumsum(SPEED) * DT
HEIGHT = 200.0 + 15.0 * np.sin(DRIVEN / 300.0)
SLOPE = 15.0 / 300.0 * np.cos(DRIVEN / 300.0)
NORTH = 48.0 + DRIVEN / 111_195.0
TORQUE = 20.0 * PEDAL
SI = {
    "speed": SPEED, "acceleration": ACCELERATION, "engine_command": PEDAL, "brake_command": BRAKE,
    "gear": GEAR, "engine_speed": RPM * np.pi / 30, "fuel_rate": FUEL, "elevation": HEIGHT, "grade": SLOPE,
    "latitude": NORTH, "engine_torque": TORQUE,
}  # fmt: skip
START = datetime(2026, 8, 5, 18, 57, 56)


def dates(form: str, digits: int = 3) -> list[str]:
    """The rows' times of day by a format; %f has as many digits."""
    stamps = [START + timedelta(seconds=float(t)) for t in TIME]
    return [
        s.strftime(form.replace("%f", f"{s.microsecond // 10 ** (6 - digits):0{digits}d}")) for s in stamps
    ]


def written(
    path: Path,
    columns: dict[str, Sequence[str] | Array],
    *,
    delimiter: str = ",",
    decimal: str = ".",
    digits: int = 4,
    above: Sequence[str] = (),
    below: Sequence[str] = (),
    encoding: str = "utf-8",
) -> Path:
    """A CSV file: lines before the header, it, lines below it, and the rows."""
    cells = [
        [f"{v:.{digits}f}".replace(".", decimal) for v in column]
        if isinstance(column, np.ndarray)
        else column
        for column in columns.values()
    ]
    rows = [delimiter.join(row) for row in zip(*cells, strict=True)]
    path.write_text("\n".join([*above, delimiter.join(columns), *below, *rows]) + "\n", encoding=encoding)
    return path


class Log(NamedTuple):
    """A table of a logger: its columns, how it is written, and the channels that are proposed with a unit."""

    columns: dict[str, Any]
    form: dict[str, Any]
    channels: set[str]


# fmt: off
LOGS = {
    "torque": Log({
        "GPS Time": dates("%a %b %d %H:%M:%S GMT+02:00 %Y"), " Device Time": dates("%d-%b-%Y %H:%M:%S.%f"),
        " Longitude": 9.0 + 0.0 * TIME, " Latitude": NORTH, "GPS Speed (Meters/second)": SPEED,
        " Horizontal Dilution of Precision": 4.0 + 0.0 * TIME, " Altitude": HEIGHT, " G(x)": 0.01 * PEDAL,
        "Engine RPM(rpm)": RPM, "Accelerator PedalPosition D(%)": PEDAL, "Speed (OBD)(km/h)": 3.6 * SPEED,
        "Throttle Position(Manifold)(%)": 0.8 * PEDAL, "Fuel flow rate/minute(cc/min)": 60.0 * FUEL,
        "Trip average KPL(kpl)": 0.1 * SPEED, "Trip Distance(km)": np.cumsum(SPEED) * 1e-4,
        "Torque(Nm)": TORQUE, "Engine Load(%)": PEDAL,
    }, {"digits": 6},
        {"speed", "engine_command", "engine_speed", "engine_torque", "fuel_rate", "latitude", "longitude"}),
    "obd_fusion": Log({
        "Time (sec)": TIME, " Vehicle speed (MPH)": SPEED / 0.44704, " Engine RPM (RPM)": RPM,
        " Accelerator pedal position D (%)": PEDAL, " Commanded throttle actuator control (%)": PEDAL[::-1],
        " Intake air temperature (°F)": 80.0 + 0.0 * TIME, " Ambient air temperature (°F)": 0.1 * TIME + 50.0,
        " Calculated load value (%)": PEDAL, " Fuel level input (%)": PEDAL,
    }, {"above": ["# StartTime = 08/05/2026 06:57:56.1234 PM"]},
        {"speed", "engine_speed", "engine_command", "ambient_temperature"}),
    "car_scanner": Log({
        "time": dates("%H:%M:%S.%f"), "Geschwindigkeit (km/h)": 3.6 * SPEED, "Motordrehzahl (U/min)": RPM,
        "Gaspedalstellung D (%)": PEDAL, "Kühlmitteltemperatur (°C)": 90.0 + 0.0 * TIME,
        "Kraftstoffverbrauch (L/h)": 3.6 * FUEL, "Durchschnittlicher Kraftstoffverbrauch (L/100km)": FUEL,
    }, {"delimiter": ";"}, {"speed", "engine_speed", "engine_command", "fuel_rate"}),
    "fleetboard": Log({
        "Datum": dates("%d.%m.%Y"), "Uhrzeit": dates("%H:%M:%S,%f"), "Geschwindigkeit [km/h]": 3.6 * SPEED,
        "Tempomat-Sollgeschwindigkeit [km/h]": 80.0 + 0.0 * TIME, "Fahrpedalstellung [%]": PEDAL,
        "Bremspedalstellung [%]": BRAKE, "Motordrehzahl [1/min]": RPM, "Gang": GEAR, "Höhe [m]": HEIGHT,
        "Längsbeschleunigung [m/s²]": ACCELERATION, "Querbeschleunigung [m/s²]": ACCELERATION[::-1],
        "Kilometerstand [km]": 1e5 + np.cumsum(SPEED) * 1e-4, "Retardermoment [%]": BRAKE[::-1],
        "Motormoment Soll [Nm]": TORQUE[::-1], "Motormoment Ist [Nm]": TORQUE,
    }, {"delimiter": ";", "decimal": ",", "encoding": "latin-1"},
        {"speed", "engine_command", "brake_command", "engine_speed", "gear", "elevation",
        "acceleration", "engine_torque"}),
    "samsara": Log({
        "Time": dates("%Y-%m-%dT%H:%M:%S.%fZ"), "Vehicle": ["Truck 17"] * len(TIME),
        "Speed (mph)": SPEED / 0.44704, "Speed Limit (mph)": 55.0 + 0.0 * TIME, "Latitude": NORTH,
        "Longitude": -90.0 + 0.0 * TIME, "Engine RPM": RPM, "Odometer (mi)": 1e5 + 0.01 * TIME,
    }, {"digits": 6}, {"speed", "latitude", "longitude", "engine_speed"}),
    "geotab": Log({
        "DateTime": dates("%m/%d/%Y %I:%M:%S.%f %p"), "Device": ["4711"] * len(TIME), "Latitude": NORTH,
        "Longitude": 9.0 + 0.0 * TIME, "Speed": 3.6 * SPEED, "Engine speed (rpm)": RPM,
    }, {"digits": 7}, {"speed", "latitude", "longitude", "engine_speed"}),
    "canalyzer": Log({
        "Time[s]": TIME, "CCVS1::WheelBasedVehicleSpeed[km/h]": 3.6 * SPEED, "EEC1::EngSpeed[rpm]": RPM,
        "CCVS1::CruiseCtrlSetSpeed[km/h]": 80.0 + 0.0 * TIME, "EEC2::AccelPedalPos1[%]": PEDAL,
        "EBC1::BrakePedalPos[%]": BRAKE, "TSC1::EngRqedSpeed_SpeedLimit[rpm]": 1500.0 + 0.0 * TIME,
        "ETC2::TransCurrentGear[]": GEAR, "ETC2::TransSelectedGear[]": GEAR[::-1],
        "LFE1::EngFuelRate[l/h]": 3.6 * FUEL, "EEC1::NominalFrictionPercentTorque[%]": 5.0 + 0.0 * TIME,
        "EBC1::BrakeSwitch": (BRAKE > 0.0).astype(float),
    }, {"delimiter": ";"},
        {"speed", "engine_speed", "engine_command", "brake_command", "brake_switch", "gear",
        "fuel_rate"}),
    "asammdf": Log({
        "timestamps": TIME, "VehSpd": 3.6 * SPEED, "VehSpd_Cmd": 3.6 * SPEED[::-1], "EngSpd": RPM,
        "AccelPdlPosn": PEDAL, "BrkPrs": 0.1 * BRAKE, "LongAccel": ACCELERATION, "GearAct": GEAR,
    }, {"below": ["s,km/h,km/h,rpm,%,bar,m/s^2,"]},
        {"speed", "engine_speed", "engine_command", "brake_command", "acceleration", "gear"}),
    "canape": Log({
        "time[ms]": 1e3 * TIME, "v_Ist[m/s]": SPEED, "v_Soll[m/s]": SPEED[::-1], "n_mot[1/min]": RPM,
        "a_x[m/s2]": ACCELERATION, "M_Soll[Nm]": TORQUE[::-1], "Fahrpedal[%]": PEDAL,
    }, {"delimiter": "\t", "digits": 3, "encoding": "utf-16"},
        {"speed", "engine_speed", "engine_command", "acceleration"}),
    "dspace": Log({
        "Time": TIME, "Model Root/Vehicle/speed_kmh": 3.6 * SPEED, "Model Root/Setpoint/speed_kmh": SPEED,
        "Model Root/Driver/throttle": 0.01 * PEDAL, "Model Root/Driver/brake": 0.01 * BRAKE,
    }, {"above": ["dSPACE export", "sampling 0.1 s"]}, {"speed", "engine_command", "brake_command"}),
    "matlab": Log({
        "t": 739_000.5 + TIME / 86400.0, "vehSpeed_mps": SPEED, "desiredSpeed_mps": SPEED[::-1],
        "engineSpeed_rpm": RPM, "throttle_pct": PEDAL, "brake_pct": BRAKE,
    }, {"digits": 9}, {"speed", "engine_speed", "engine_command", "brake_command"}),
    "epoch": Log({
        "timestamp_ms": [str(1_785_000_000_000 + round(1e3 * t)) for t in TIME], "velocity": SPEED,
        "accel_x_mps2": ACCELERATION, "cmd.velocity": SPEED[::-1], "gas pedal [%]": PEDAL,
    }, {}, {"speed", "acceleration", "engine_command"}),
    "parquet": Log({
        "stamp": pa.array([round(1e9 * t) for t in TIME]).cast(pa.timestamp("ns")),
        "speed_kmh": 3.6 * SPEED, "target_speed_kmh": SPEED, "accelerator_pct": PEDAL,
    }, {}, {"speed", "engine_command"}),
}
# fmt: on


@pytest.fixture(params=LOGS)
def log(request: pytest.FixtureRequest, tmp_path: Path) -> tuple[Log, Path]:
    """A log, and its file."""
    one = LOGS[request.param]
    if request.param != "parquet":
        return one, written(tmp_path / "drive.csv", one.columns, **one.form)
    parquet.write_table(pa.table(one.columns), tmp_path / "drive.parquet")
    return one, tmp_path / "drive.parquet"


def proposed(found: TableSuggestion) -> dict[str, str]:
    taken = {channel: found.taken(channel) for channel in found.candidates}
    return {channel: one.field.path for channel, one in taken.items() if one}


def test_a_proposal_is_imported_as_it_is(tmp_path: Path, log: tuple[Log, Path]) -> None:
    (columns, _, channels), path = log
    found = suggest_columns(path)
    assert {*proposed(found)} == channels, found.text()
    assert {*yaml.safe_load(found.text())["channels"]} == channels
    (tmp_path / "columns.yaml").write_text(found.text(), encoding="utf-8")
    (recording,) = import_table(path, tmp_path / "columns.yaml", tmp_path / "bag").recordings
    assert recording.dt == pytest.approx(DT, rel=1e-3) and len(recording) >= len(TIME) - 2
    for channel in channels & SI.keys():
        values, wanted = recording.channels[channel][5:-5], np.interp(recording.time, TIME, SI[channel])[5:-5]
        if channel in ("engine_command", "brake_command"):  # held over a step
            wanted = SI[channel][5 : 5 + len(values)]
        if "BrkPrs" in columns and channel == "brake_command":
            wanted = 0.1 * wanted  # bar
        scale = np.abs(wanted).max()
        off = np.abs(values - wanted[: len(values)])
        assert np.quantile(off, 0.9) < 0.02 * scale + 1e-3, (channel, values[:5], wanted[:5])


def test_every_other_column_of_numbers_is_carried_once_its_line_counts(
    tmp_path: Path, log: tuple[Log, Path]
) -> None:
    _, path = log
    found = suggest_columns(path)
    several = (*found.candidates.values(), *found.commanded.values())
    likely = [one.field.path for many in several for one in many]
    assert found.clock
    others = {c.name for c in found.table.numeric} - {*likely, *found.clock.columns}
    before, _, after = found.text().partition("# extra:\n")
    assert bool(after) == bool(others)
    columns = yaml.safe_load(before + "extra:\n" + after.replace("#   ", "  ")) if others else {}
    assert {*columns.get("extra", {}).values()} == others
    if others:
        (recording,) = import_table(path, columns, tmp_path / "bag").recordings
        assert columns["extra"].keys() <= recording.channels.keys()


NOISE = np.random.default_rng(7).normal(0.0, 0.2, len(TIME))
PLACES = {"lat": NORTH, "lon": 9.0 + 0.0 * TIME}


@pytest.mark.parametrize(
    ("columns", "channel", "unit"),
    [
        ({"speed": SPEED}, "speed", ""),
        ({"speed": 3.6 * SPEED, "altitude [ft]": HEIGHT}, "speed", ""),  # no unit is taken from a neighbour
        ({"speed": SPEED, "acc [m/s^2]": ACCELERATION}, "speed", "m/s"),
        ({"speed": SPEED / 0.44704, "acc [m/s^2]": ACCELERATION}, "speed", "mph"),
        *(({"speed": SPEED / factor, **PLACES}, "speed", unit)
          for unit, factor in (("km/h", 1 / 3.6), ("mph", 0.44704), ("ft/s", 0.3048), ("knot", 1852 / 3600))),
        ({"speed": 1.2 * SPEED, **PLACES}, "speed", ""),  # agrees in no unit
        ({"speed": 1.07 * SPEED / 0.3048, **PLACES}, "speed", ""),  # between ft/s and km/h
        ({"speed": np.round(1000.0 * SPEED)}, "speed", ""),  # mm/s and counts of 1/256 km/h are of one size
        ({"speed": np.round(1000.0 * SPEED), **PLACES}, "speed", "mm/s"),
        ({"WheelBasedVehicleSpeed": 3.6 * SPEED}, "speed", "km/h"),
        ({"v [km/h]": 3.6 * SPEED, "acc": ACCELERATION / 9.80665}, "acceleration", "g"),
        ({"v [km/h]": 3.6 * SPEED, "acc": 0.3 * ACCELERATION}, "acceleration", ""),
        ({"v [m/s]": SPEED, "altitude [m]": HEIGHT, "grade": 100.0 * SLOPE}, "grade", "percent"),
        ({"v [m/s]": SPEED, "grade": 100.0 * SLOPE}, "grade", ""),
        ({"v [km/h]": 3.6 * SPEED, "altitude": HEIGHT / 0.3048}, "elevation", ""),
        ({"v [m/s]": SPEED, "altitude": HEIGHT / 0.3048}, "elevation", ""),
        ({"v [m/s]": SPEED, "brake": (BRAKE > 0.0).astype(float)}, "brake_command", ""),  # a switch
        ({"v [m/s]": SPEED, "brake": 0.3 * BRAKE}, "brake_command", ""),  # bar or percent
        ({"v [m/s]": SPEED, "distance": DRIVEN}, "gap", ""),  # an odometer
        ({"v [m/s]": SPEED, "distance [m]": 50.0 + SPEED}, "gap", "m"),
        ({"v [m/s]": SPEED, "pedal": ["-"] * 600 + ["40"] * 600, "throttle": PEDAL}, "engine_command",
         "percent"),
    ],
)  # fmt: skip
def test_a_unit_is_stated_confirmed_or_asked_for(
    tmp_path: Path, columns: dict[str, Array], channel: str, unit: str
) -> None:
    found = suggest_columns(written(tmp_path / "drive.csv", {"time [s]": TIME, **columns}, digits=7))
    taken = found.taken(channel)
    assert (taken.unit if taken else "") == unit, found.text()
    assert channel not in ("speed", "brake_command") or (channel in " ".join(found.lacking)) == (unit == "")


STEPS = range(1200)


@pytest.mark.parametrize(
    ("columns", "line"),
    [
        ({"time": [str(100 * k) for k in STEPS]}, "time: {column: time, unit: ms}"),
        ({"t": TIME, "Engine run time (s)": TIME + 50.0}, "time: {column: t, unit: s}"),
        ({"": dates("%Y-%m-%d %H:%M:%S.%f")}, 'time: {column: "", unit: iso}'),
        ({"Date": dates("%d/%m/%Y %H:%M:%S.%f")}, 'time: {column: Date, format: "%d/%m/%Y %H:%M:%S.%f"}'),
        (
            {"Date": dates("%Y-%m-%d"), "Time": dates("%H:%M:%S.%f")},
            "time: {column: [Date, Time], unit: iso}",
        ),
        (
            {"time_us": [str(1_785_000_000_000_000 + 100_000 * k) for k in STEPS]},
            "time: {column: time_us, unit: us}",
        ),
        ({"epoch": [f"{1_785_000_000 + k / 10:.1f}" for k in STEPS]}, "time: {column: epoch, unit: s}"),
        ({"Zeit": dates("%d.%m.%Y %H:%M:%S")}, ""),  # whole seconds at 10 Hz
        ({"row": [str(k) for k in STEPS]}, ""),
        *(({name: [str(k) for k in STEPS]}, "") for name in ("Time (0.1 sec)", "time [100 ms]", "0.1 sec")),
    ],
)
def test_the_clock(tmp_path: Path, columns: dict[str, Sequence[str] | Array], line: str) -> None:
    found = suggest_columns(written(tmp_path / "drive.csv", {**columns, "speed_kmh": 3.6 * SPEED}))
    assert (found.clock.line if found.clock else "") == line
    if line:
        assert f"\n{line}\n" in found.text()
    else:
        assert found.lacking[0].startswith("time has no line yet: ")
        assert "# time: {column: COLUMN, unit: s}   # or time: {rate_hz: 10}" in found.text()
    if "Zeit" in columns:
        assert "set time: {rate_hz: 10}" in found.lacking[0]


def test_days_are_not_taken_for_months(tmp_path: Path) -> None:
    """Past midnight the other order would jump by a month."""
    stamps = [datetime(2026, 8, 5, 23, 59) + timedelta(seconds=float(t)) for t in TIME]
    cells = [s.strftime("%m/%d/%Y %H:%M:%S.%f") for s in stamps]
    found = suggest_columns(written(tmp_path / "drive.csv", {"Time": cells, "speed_kmh": 3.6 * SPEED}))
    assert found.clock and found.clock.format == "%m/%d/%Y %H:%M:%S.%f"


def meant(name: str) -> str:
    """The channel that a header alone may be, with '!' for a command; '' for none."""
    found = header(name)
    for one in named_channels(found.words, frozenset()):
        if not found.unit or fits(one.channel, found.unit):
            return one.channel + ("!" if found.words & COMMANDED else "")
    return ""


HEADERS = {
    "speed": "Geschwindigkeit in km/h; VehicleSpeed_mps; Ist-Geschwindigkeit [km/h]; v_Ist; Speed (GPS)",
    "speed!": "Sollgeschwindigkeit [km/h]; vSoll; v_ref [m/s]; ACC_SetSpeed; Tempomat-Geschwindigkeit; "
    "speedTgt; Wunschgeschwindigkeit; Zielgeschwindigkeit (km/h); Requested speed; speed_cmd; v_des; "
    "Führungsgröße Speed",
    "engine_speed": "Motordrehzahl [U/min]; Drehzahl (1/min); Engine RPM; EEC1::EngSpeed[rpm]; n_mot [min-1]",
    "engine_speed!": "Solldrehzahl [1/min]; TSC1::EngRqedSpeed[rpm]",
    "engine_command": "Gaspedalstellung; Fahrpedalwert [%]; AccPedPos; Throttle; "
    "Accelerator Pedal Position (F)(%)",
    "engine_command!": "Vorgabe Gaspedal [%]; Drosselklappe Soll [%]; Stellgröße Gaspedal",
    "brake_command": "Bremsdruck [bar]; Brake Pedal Position (%); EBC1::BrakePedalPos[%]; BrkPrs [kPa]",
    "brake_command!": "Bremsanforderung [m/s²]; Bremsdruck Soll [bar]",
    "acceleration": "Längsbeschleunigung [g]; a_x [m/s2]; accel_x",
    "acceleration!": "Sollbeschleunigung [m/s²]; a_soll [m/s2]",
    "gear": "Aktueller Gang; ETC2::TransCurrentGear",
    "gear!": "Sollgang; Selected Gear",
    "grade": "Fahrbahnsteigung [%]; Pitch (deg); Road Grade",
    "fuel_rate": "Kraftstoffverbrauch [l/h]; Fuel Rate (gal/h); Fuel flow rate/minute(cc/min)",
    "engine_torque": "Motormoment [Nm]; Engine Torque (lb-ft)",
    "elevation": "Höhe ü. NN (m); Altitude (ft)",
    "gap": "Abstand zum Vorderfahrzeug [m]; Distance to lead vehicle (m)",
    "leader_speed": "Geschwindigkeit Vorderfahrzeug [km/h]; Lead vehicle speed (m/s)",
    "ambient_temperature": "Außentemperatur [°C]; Ambient air temp(°C)",
    "": "Windgeschwindigkeit [m/s]; Gierwinkelgeschwindigkeit [rad/s]; Speed limit (km/h); "
    "Höchstgeschwindigkeit; Relativgeschwindigkeit [m/s]; Turboladerdrehzahl [1/min]; "
    "Getriebeausgangsdrehzahl [1/min]; Raddrehzahl VL [1/min]; Motorbremse [%]; Retarder torque (%); "
    "Feststellbremse; Querbeschleunigung [m/s²]; accel_y; Tankfüllstand [%]; "
    "Fuel used (l); Kraftstoffverbrauch [l/100km]; Radmoment [Nm]; Reibmoment [Nm]; Zeitlücke [s]; "
    "Ansauglufttemperatur [°C]; Battery V; Motorlast [%]; "
    "Acceleration Sensor(X axis)(g); Acceleration Sensor(Total)(g)",
}


@pytest.mark.parametrize(
    ("channel", "name"), [(channel, name) for channel, names in HEADERS.items() for name in names.split("; ")]
)
def test_words_of_headers(channel: str, name: str) -> None:
    assert meant(name) == channel


def test_a_clock_that_never_goes_back_comes_before_that_of_a_lap(tmp_path: Path) -> None:
    columns = {"Time": TIME % 20.0, "Absolute Time": TIME, "speed_mps": SPEED, "throttle_pct": PEDAL}
    found = suggest_columns(written(tmp_path / "laps.csv", columns))
    assert found.clock and found.clock.columns == ("Absolute Time",)
