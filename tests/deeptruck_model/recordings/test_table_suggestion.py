"""COLUMNS.yaml proposed for tables of many kinds, and what `import` makes of it, in SI."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
import yaml
from numpy.typing import NDArray
from pyarrow import parquet

from deeptruck_model.recordings import TableSuggestion, import_table, suggest_columns

Array = NDArray[np.float64]

DT = 0.1
TIME = DT * np.arange(1200)
SPEED = 12.0 + 11.0 * np.sin(TIME / 12.0 - 1.0)  # m/s, 1 to 23
ACCELERATION = 11.0 / 12.0 * np.cos(TIME / 12.0 - 1.0)
PEDAL = 45.0 + 40.0 * np.cos(TIME / 12.0 - 1.0)  # %
BRAKE = np.fmax(0.0, -40.0 * np.cos(TIME / 12.0 - 1.0))  # %
GEAR = 1.0 + np.floor(SPEED / 3.0)
RPM = 900.0 + 250.0 * (SPEED % 3.0)
FUEL = 2.0 + 0.1 * PEDAL  # cm^3/s
HEIGHT = 200.0 + 5.0 * np.sin(TIME / 20.0)
SLOPE = 0.25 * np.cos(TIME / 20.0) / SPEED
NORTH = 48.0 + np.cumsum(SPEED) * DT / 111_195.0
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


def torque(path: Path) -> Path:
    return written(path, {
        "GPS Time": dates("%a %b %d %H:%M:%S GMT+02:00 %Y"), " Device Time": dates("%d-%b-%Y %H:%M:%S.%f"),
        " Longitude": 9.0 + 0.0 * TIME, " Latitude": NORTH, "GPS Speed (Meters/second)": SPEED,
        " Horizontal Dilution of Precision": 4.0 + 0.0 * TIME, " Altitude": HEIGHT, " G(x)": 0.01 * PEDAL,
        "Engine RPM(rpm)": RPM, "Accelerator PedalPosition D(%)": PEDAL, "Speed (OBD)(km/h)": 3.6 * SPEED,
        "Throttle Position(Manifold)(%)": 0.8 * PEDAL, "Fuel flow rate/minute(cc/min)": 60.0 * FUEL,
        "Trip average KPL(kpl)": 0.1 * SPEED, "Trip Distance(km)": np.cumsum(SPEED) * 1e-4,
        "Torque(Nm)": TORQUE, "Engine Load(%)": PEDAL,
    }, digits=6)  # fmt: skip


def obd_fusion(path: Path) -> Path:
    return written(path, {
        "Time (sec)": TIME, " Vehicle speed (MPH)": SPEED / 0.44704, " Engine RPM (RPM)": RPM,
        " Accelerator pedal position D (%)": PEDAL, " Commanded throttle actuator control (%)": PEDAL[::-1],
        " Intake air temperature (°F)": 80.0 + 0.0 * TIME, " Ambient air temperature (°F)": 0.1 * TIME + 50.0,
        " Calculated load value (%)": PEDAL, " Fuel level input (%)": PEDAL,
    }, above=["# StartTime = 08/05/2026 06:57:56.1234 PM"])  # fmt: skip


def car_scanner(path: Path) -> Path:
    return written(path, {
        "time": dates("%H:%M:%S.%f"), "Geschwindigkeit (km/h)": 3.6 * SPEED, "Motordrehzahl (U/min)": RPM,
        "Gaspedalstellung D (%)": PEDAL, "Kühlmitteltemperatur (°C)": 90.0 + 0.0 * TIME,
        "Kraftstoffverbrauch (L/h)": 3.6 * FUEL, "Durchschnittlicher Kraftstoffverbrauch (L/100km)": FUEL,
    }, delimiter=";")  # fmt: skip


def fleetboard(path: Path) -> Path:
    return written(path, {
        "Datum": dates("%d.%m.%Y"), "Uhrzeit": dates("%H:%M:%S,%f"), "Geschwindigkeit [km/h]": 3.6 * SPEED,
        "Tempomat-Sollgeschwindigkeit [km/h]": 80.0 + 0.0 * TIME, "Fahrpedalstellung [%]": PEDAL,
        "Bremspedalstellung [%]": BRAKE, "Motordrehzahl [1/min]": RPM, "Gang": GEAR, "Höhe [m]": HEIGHT,
        "Längsbeschleunigung [m/s²]": ACCELERATION, "Querbeschleunigung [m/s²]": ACCELERATION[::-1],
        "Kilometerstand [km]": 1e5 + np.cumsum(SPEED) * 1e-4, "Retardermoment [%]": BRAKE[::-1],
        "Motormoment Soll [Nm]": TORQUE[::-1], "Motormoment Ist [Nm]": TORQUE,
    }, delimiter=";", decimal=",", encoding="latin-1")  # fmt: skip


def samsara(path: Path) -> Path:
    return written(path, {
        "Time": dates("%Y-%m-%dT%H:%M:%S.%fZ"), "Vehicle": ["Truck 17"] * len(TIME),
        "Speed (mph)": SPEED / 0.44704, "Speed Limit (mph)": 55.0 + 0.0 * TIME, "Latitude": NORTH,
        "Longitude": -90.0 + 0.0 * TIME, "Engine RPM": RPM, "Odometer (mi)": 1e5 + 0.01 * TIME,
    }, digits=6)  # fmt: skip


def geotab(path: Path) -> Path:
    return written(path, {
        "DateTime": dates("%m/%d/%Y %I:%M:%S.%f %p"), "Device": ["4711"] * len(TIME), "Latitude": NORTH,
        "Longitude": 9.0 + 0.0 * TIME, "Speed": 3.6 * SPEED, "Engine speed (rpm)": RPM,
    }, digits=7)  # fmt: skip


def canalyzer(path: Path) -> Path:
    return written(path, {
        "Time[s]": TIME, "CCVS1::WheelBasedVehicleSpeed[km/h]": 3.6 * SPEED, "EEC1::EngSpeed[rpm]": RPM,
        "CCVS1::CruiseCtrlSetSpeed[km/h]": 80.0 + 0.0 * TIME, "EEC2::AccelPedalPos1[%]": PEDAL,
        "EBC1::BrakePedalPos[%]": BRAKE, "TSC1::EngRqedSpeed_SpeedLimit[rpm]": 1500.0 + 0.0 * TIME,
        "ETC2::TransCurrentGear[]": GEAR, "ETC2::TransSelectedGear[]": GEAR[::-1],
        "LFE1::EngFuelRate[l/h]": 3.6 * FUEL, "EEC1::NominalFrictionPercentTorque[%]": 5.0 + 0.0 * TIME,
        "EBC1::BrakeSwitch": (BRAKE > 0.0).astype(float),
    }, delimiter=";")  # fmt: skip


def asammdf(path: Path) -> Path:
    return written(path, {
        "timestamps": TIME, "VehSpd": 3.6 * SPEED, "VehSpd_Cmd": 3.6 * SPEED[::-1], "EngSpd": RPM,
        "AccelPdlPosn": PEDAL, "BrkPrs": 0.1 * BRAKE, "LongAccel": ACCELERATION, "GearAct": GEAR,
    }, below=["s,km/h,km/h,rpm,%,bar,m/s^2,"])  # fmt: skip


def canape(path: Path) -> Path:
    return written(path, {
        "time[ms]": 1e3 * TIME, "v_Ist[m/s]": SPEED, "v_Soll[m/s]": SPEED[::-1], "n_mot[1/min]": RPM,
        "a_x[m/s2]": ACCELERATION, "M_Soll[Nm]": TORQUE[::-1], "Fahrpedal[%]": PEDAL,
    }, delimiter="\t", digits=3, encoding="utf-16")  # fmt: skip


def dspace(path: Path) -> Path:
    return written(path, {
        "Time": TIME, "Model Root/Vehicle/speed_kmh": 3.6 * SPEED, "Model Root/Setpoint/speed_kmh": SPEED,
        "Model Root/Driver/throttle": 0.01 * PEDAL, "Model Root/Driver/brake": 0.01 * BRAKE,
    }, above=["dSPACE export", "sampling 0.1 s"])  # fmt: skip


def matlab(path: Path) -> Path:
    return written(path, {
        "t": 739_000.5 + TIME / 86400.0, "vehSpeed_mps": SPEED, "desiredSpeed_mps": SPEED[::-1],
        "engineSpeed_rpm": RPM, "throttle_pct": PEDAL, "brake_pct": BRAKE,
    }, digits=9)  # fmt: skip


def epoch(path: Path) -> Path:
    return written(path, {
        "timestamp_ms": [str(1_785_000_000_000 + round(1e3 * t)) for t in TIME], "velocity": SPEED,
        "accel_x_mps2": ACCELERATION, "cmd.velocity": SPEED[::-1], "gas pedal [%]": PEDAL,
    })  # fmt: skip


def of_parquet(path: Path) -> Path:
    path = path.with_suffix(".parquet")
    stamps = pa.array([round(1e9 * t) for t in TIME]).cast(pa.timestamp("ns"))
    table = {"stamp": stamps, "speed_kmh": 3.6 * SPEED, "target_speed_kmh": SPEED, "accelerator_pct": PEDAL}
    parquet.write_table(pa.table(table), path)
    return path


TABLES: dict[Callable[[Path], Path], set[str]] = {  # and the channels that are proposed with a unit
    torque: {
        "speed", "engine_command", "engine_speed", "engine_torque", "fuel_rate", "elevation", "latitude",
        "longitude",
    },
    obd_fusion: {"speed", "engine_speed", "engine_command", "ambient_temperature"},
    car_scanner: {"speed", "engine_speed", "engine_command", "fuel_rate"},
    fleetboard: {
        "speed", "engine_command", "brake_command", "engine_speed", "gear", "elevation", "acceleration",
        "engine_torque",
    },
    samsara: {"speed", "latitude", "longitude", "engine_speed"},
    geotab: {"speed", "latitude", "longitude", "engine_speed"},
    canalyzer: {"speed", "engine_speed", "engine_command", "brake_command", "gear", "fuel_rate"},
    asammdf: {"speed", "engine_speed", "engine_command", "brake_command", "acceleration", "gear"},
    canape: {"speed", "engine_speed", "engine_command", "acceleration"},
    dspace: {"speed", "engine_command", "brake_command"},
    matlab: {"speed", "engine_speed", "engine_command", "brake_command"},
    epoch: {"speed", "acceleration", "engine_command"},
    of_parquet: {"speed", "engine_command"},
}  # fmt: skip


def proposed(found: TableSuggestion) -> dict[str, str]:
    taken = {channel: found.taken(channel) for channel in found.candidates}
    return {channel: one.field.path for channel, one in taken.items() if one}


@pytest.mark.parametrize("table", TABLES, ids=lambda table: table.__name__)
def test_a_proposal_is_imported_as_it_is(tmp_path: Path, table: Callable[[Path], Path]) -> None:
    path = table(tmp_path / "drive.csv")
    found = suggest_columns(path)
    assert {*proposed(found)} == TABLES[table], found.text()
    assert {*yaml.safe_load(found.text())["channels"]} == TABLES[table]
    (tmp_path / "columns.yaml").write_text(found.text(), encoding="utf-8")
    (recording,) = import_table(path, tmp_path / "columns.yaml", tmp_path / "bag").recordings
    assert recording.dt == pytest.approx(DT, rel=1e-3) and len(recording) >= len(TIME) - 2
    for channel in TABLES[table] & SI.keys():
        values, wanted = recording.channels[channel][5:-5], np.interp(recording.time, TIME, SI[channel])[5:-5]
        if channel in ("engine_command", "brake_command"):  # held over a step
            wanted = SI[channel][5 : 5 + len(values)]
        if table is asammdf and channel == "brake_command":
            wanted = 0.1 * wanted  # bar
        scale = np.abs(wanted).max()
        off = np.abs(values - wanted[: len(values)])
        assert np.quantile(off, 0.9) < 0.02 * scale + 1e-3, (channel, values[:5], wanted[:5])
