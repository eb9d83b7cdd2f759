from __future__ import annotations

import numpy as np
import pytest

from deeptruck_core.account import Account
from deeptruck_core.arrays import Array
from deeptruck_core.errors import InputError
from deeptruck_core.signals import TruckInterface
from deeptruck_model.recordings import Recording, Series, uniform

TRUCK = TruckInterface("t", brake_unit=None, grade=False, fuel=False)


def resampled(
    series: dict[str, Series], rate_hz: float = 10.0, cuts: tuple[float, ...] = ()
) -> list[Recording]:
    return uniform(series, name="t", interface=TRUCK, rate_hz=rate_hz, cuts=cuts)


def balanced(recordings: list[Recording]) -> Account:
    """The account of all pieces, of which each sample went somewhere."""
    account = recordings[0].account
    assert account is not None and account.balanced
    assert all(r.account is account for r in recordings)
    assert account.spans == [pytest.approx((r.time[0], r.time[-1]), abs=r.dt) for r in recordings]
    return account


def clock(rate: float, seconds: float, start: float = 0.0) -> Array:
    return start + np.arange(round(seconds * rate) + 1) / rate


def test_samples_on_the_clock_are_kept_exactly() -> None:
    time = clock(10, 60)
    values = np.random.default_rng(0).uniform(0, 30, len(time))
    (recording,) = resampled({"speed": Series(time, values), "gap": Series(time, values)})
    np.testing.assert_array_equal(recording.channels["speed"], values)
    np.testing.assert_array_equal(recording.channels["gap"], values)
    assert recording.dt == 0.1


def test_kinematics_survive_the_change_from_100_to_10_hz() -> None:
    """v(k+1) = v(k) + a(k+1) dt holds at 100 Hz in the source, and at 10 Hz in the recording."""
    time = clock(100, 30)
    acceleration = np.random.default_rng(0).normal(size=len(time))
    speed = 20 + np.concatenate([[0.0], np.cumsum(acceleration[1:]) * 0.01])
    (recording,) = resampled({"speed": Series(time, speed), "acceleration": Series(time, acceleration)})
    v, a = recording.channels["speed"], recording.channels["acceleration"]
    assert len(recording) == 301
    np.testing.assert_allclose(v[1:], v[:-1] + a[1:] * 0.1, atol=1e-12)


def test_a_command_counts_from_when_it_came() -> None:
    """10 Hz commands that come 20 ms after each tick: the step holds a fifth of the old one."""
    ticks = clock(10, 5)
    commands = np.arange(len(ticks), dtype=float)
    late = Series(ticks + 0.02, commands)
    (recording,) = resampled({"speed": Series(ticks, ticks), "engine_command": late})
    expected = 0.2 * commands[:-2] + 0.8 * commands[1:-1]
    np.testing.assert_allclose(recording.channels["engine_command"][1:-1], expected, rtol=1e-9)


def test_a_command_is_held_between_its_samples_and_not_for_ever() -> None:
    ticks = clock(10, 10)
    command = Series(np.array([0.0, 0.5, 1.0, 6.0]), np.array([1.0, 2.0, 3.0, 4.0]))
    (recording,) = resampled({"speed": Series(ticks, ticks), "engine_command": command})
    u = recording.channels["engine_command"]
    np.testing.assert_array_equal(u[[0, 4, 5, 9, 10, 20]], [1, 1, 2, 2, 3, 3])
    assert np.isnan(u[30:60]).all()
    assert u[60] == 4.0


def test_gear_is_never_between_two_gears() -> None:
    ticks = clock(10, 10)
    gear = Series(clock(7, 10), np.repeat([3.0, 4.0], 36)[:71])
    (recording,) = resampled({"speed": Series(ticks, ticks), "gear": gear})
    assert set(recording.channels["gear"]) == {3.0, 4.0}


def test_nan_is_not_bridged() -> None:
    time = clock(100, 10) + 0.0037  # between the ticks of the speed, so that all must be interpolated
    values = np.linspace(0, 10, len(time))
    values[500] = np.nan
    ticks = clock(10, 10)
    (recording,) = resampled({"speed": Series(ticks, ticks), "gap": Series(time, values)})
    gap = recording.channels["gap"]
    assert np.isnan(gap[50]) and np.isnan(gap[[0]])
    assert not np.isnan(gap[[49, 51, 100]]).any()
    np.testing.assert_allclose(gap[60], np.interp(6.0, time, np.linspace(0, 10, len(time))))


def test_holes_are_not_bridged_but_slow_channels_are() -> None:
    ticks = clock(10, 20)
    slow, holed = clock(1, 20), np.concatenate([clock(10, 8), clock(10, 8, start=12)])
    series = {"speed": Series(ticks, ticks), "grade": Series(slow, 0.001 * slow), "gap": Series(holed, holed)}
    (recording,) = resampled(series)
    np.testing.assert_allclose(recording.channels["grade"], 0.001 * ticks, atol=1e-12)
    assert np.isnan(recording.channels["gap"][81:120]).all()
    assert not np.isnan(recording.channels["gap"][[80, 120]]).any()


@pytest.mark.parametrize(("hole", "pieces"), [(1.4, 1), (1.6, 2)])
def test_a_gap_in_the_speed_cuts(hole: float, pieces: int) -> None:
    time = np.concatenate([clock(10, 10), clock(10, 10, start=10 + hole)])
    recordings = resampled({"speed": Series(time, time)})
    assert len(recordings) == pieces
    assert [r.name for r in recordings] == (["t"] if pieces == 1 else ["t#0", "t#1"])
    assert recordings[-1].start_s == pytest.approx(0.0 if pieces == 1 else 10 + hole)


@pytest.mark.parametrize("apart_s", [[0.0], [0.02], [0.04, 0.01], [0.098]])
@pytest.mark.parametrize("place", ["first", "between", "last", "all three"])
def test_samples_nearer_than_a_step_between_gaps_are_left_out_and_counted(
    apart_s: list[float], place: str
) -> None:
    alone = np.concatenate([[0.0], np.cumsum(apart_s)]) if apart_s != [0.0] else np.zeros(1)
    drives = [clock(10, 10, start=10.0), clock(10, 10, start=30.0)]
    short = [alone + {"first": 0.0, "between": 25.0, "last": 45.0}[p] for p in ("first", "between", "last")]
    chosen = short if place == "all three" else [short[("first", "between", "last").index(place)]]
    time = np.sort(np.concatenate([*drives, *chosen]))
    recordings = resampled({"speed": Series(time, 10 + 0.1 * time)})
    assert [len(r) for r in recordings] == [101, 101]
    np.testing.assert_allclose(recordings[1].channels["acceleration"], 0.1, atol=1e-9)
    count = len(alone) * len(chosen)
    note = f"speed: {count} of {len(time)} samples between gaps, in pieces shorter than a step of 0.1 s"
    assert f"{note}, first at {chosen[0][0]:g} s" in recordings[0].notes
    assert balanced(recordings).channels["speed"].left_out == count


def test_telematics_that_report_when_something_changes() -> None:
    """Rows 1 to 15 s apart: gaps go by the median, and short pieces do not stop the rest."""
    rng = np.random.default_rng(4)
    time = np.cumsum(rng.choice([1.0, 2.0, 3.0, 5.0, 15.0], 2000, p=[0.3, 0.3, 0.2, 0.1, 0.1]))
    recordings = resampled({"speed": Series(time, 20 + 5 * np.sin(time / 60))}, rate_hz=np.inf)
    assert min(map(len, recordings)) >= 2
    assert sum(len(r) * r.dt for r in recordings) > 2000
    for r in recordings:
        np.testing.assert_allclose(r.channels["speed"], 20 + 5 * np.sin(r.time / 60), atol=0.2)


def test_a_source_slower_than_asked_keeps_its_rate_and_its_idea_of_a_gap() -> None:
    time = np.concatenate([np.arange(0, 60.0), np.arange(62, 120.0), np.arange(124, 180.0)])
    first, second = resampled({"speed": Series(time, time / 10)})
    assert first.dt == second.dt == 1.0
    assert len(first) == 120  # 2 s without a sample are within three periods
    assert second.start_s == 124.0


def test_an_odd_rate_is_found_exactly() -> None:
    time = np.arange(600) / 3.0
    (recording,) = resampled({"speed": Series(time, time / 10)})
    np.testing.assert_array_equal(recording.channels["speed"], time / 10)


def test_cuts_separate_neighbouring_samples() -> None:
    time = clock(1, 9)
    values = np.array([0, 1, 2, 3, 4, 20, 21, 22, 23, 24.0])
    first, second = resampled({"speed": Series(time, values), "gap": Series(time, values)}, cuts=(5.0,))
    np.testing.assert_array_equal(first.channels["gap"], values[:5])
    np.testing.assert_array_equal(second.channels["speed"], values[5:])
    np.testing.assert_array_equal(second.channels["acceleration"], 1.0)


def test_not_measuring_for_long_is_a_gap() -> None:
    time = clock(10, 30)
    values = time.copy()
    values[100:105] = np.nan  # half a second stays in the recording
    values[200:250] = np.nan
    first, second = resampled({"speed": Series(time, values)})
    assert np.isnan(first.channels["speed"]).sum() == 5
    assert len(first) == 200 and second.start_s == pytest.approx(25.0)
    assert not np.isnan(second.channels["speed"]).any()


def test_jitter_changes_little() -> None:
    rng = np.random.default_rng(3)
    time = clock(10, 60) + rng.uniform(0, 0.01, 601)
    (recording,) = resampled(
        {"speed": Series(time, 10 + np.sin(time)), "acceleration": Series(time, np.cos(time))}
    )
    np.testing.assert_allclose(
        recording.channels["speed"], 10 + np.sin(time[0] + recording.time - recording.start_s), atol=2e-3
    )
    assert not np.isnan(recording.channels["acceleration"]).any()


def test_values_no_truck_produces_become_invalid_and_are_noted() -> None:
    time = clock(10, 60)
    gap = np.full(len(time), 30.0)
    gap[:50] = 655.35  # a radar's 'no target'
    (recording,) = resampled({"speed": Series(time, time / 10), "gap": Series(time, gap)})
    assert np.isnan(recording.channels["gap"][:50]).all()
    assert "gap: 50 of 601 samples outside 0..500 m, first at 0 s (655.35)" in recording.notes


def drive(seconds: float = 60.0) -> dict[str, Series]:
    """10 Hz: from standstill to 25 m/s, on with a ripple, and to a stop with the brake."""
    time = clock(10, seconds)
    speed = np.clip(np.minimum(time, 0.9 * (seconds - time)), 0.0, 25.0) * (1 + 0.01 * np.sin(time))
    braking = np.where(time > seconds - 20, np.clip(time - seconds + 20, 0, 8), 0.0)
    return {
        "speed": Series(time, speed),
        "engine_command": Series(time, 800 + 400 * np.sin(time / 3)),
        "brake_command": Series(time, braking),
    }


def truck(engine_unit: str, brake_unit: str) -> TruckInterface:
    return TruckInterface("t", engine_unit=engine_unit, brake_unit=brake_unit, grade=False, fuel=False)


@pytest.mark.parametrize(
    ("channel", "factor", "units", "says"),
    [
        ("speed", 3.6, ("N m", "bar"), r"speed is 3\.6 times too large: km/h\? .*'scale: 0\.277778'"),
        ("speed", 100.0, ("N m", "bar"), "Give it 'unit: cm/s' or 'unit: mm/s' or 'scale: 0.001"),
        (
            "speed",
            1000.0,
            ("N m", "bar"),
            r"Give it 'unit: mm/s' or 'scale: 0.0010\d+' \(counts of 1/256 km/h\)",
        ),
        ("speed", -1.0, ("N m", "bar"), "speed has the wrong sign .*scale: -1"),
        ("engine_command", 1000.0, ("N m", "bar"), "engine_command is 1e.03 times too large: N mm"),
        (
            "engine_command",
            10.0,
            ("percent", "bar"),
            r"Give it 'scale: 0.01' \(0.01 percent\) or 'scale: 0.001'",
        ),
        ("brake_command", 100.0, ("N m", "bar"), "Give it 'unit: kPa' or 'scale: 0.001' .mbar"),
        ("brake_command", 1e5, ("N m", "bar"), r"brake_command is 1e\+05 times too large: Pa\?"),
        ("brake_command", 100.0, ("N m", "percent"), "Give it 'scale: 0.1' .per mille. or 'scale: 0.01'"),
        ("brake_command", -1.0, ("N m", "bar"), "brake_command has the wrong sign .*scale: -1"),
        ("brake_command", -0.1, ("N m", "m/s^2"), "brake_command has the wrong sign .*scale: -1"),
        ("grade", 100.0, ("N m", "bar"), r"grade is 100 times too large: percent\? .* 'scale: 0\.01'"),
    ],
)
def test_a_needed_channel_off_by_one_factor_is_refused_and_the_factor_said(
    channel: str, factor: float, units: tuple[str, str], says: str
) -> None:
    series = drive()
    series["grade"] = Series(series["speed"].time, 0.03 * np.sin(series["speed"].time / 20.0))
    series[channel] = Series(series[channel].time, factor * series[channel].values)
    with pytest.raises(InputError, match=says):
        uniform(series, name="t", interface=truck(*units))


def test_a_drive_mostly_below_the_limit_is_still_seen_to_be_in_another_unit() -> None:
    """In town by km/h: a tenth of the samples is above 60, reached as gradually as all others."""
    time = clock(10, 600)
    speed = 40 + 22 * np.sin(time / 40)
    assert 0.05 < (speed > 60).mean() < 0.2
    with pytest.raises(InputError, match="km/h"):
        resampled({"speed": Series(time, speed)})


@pytest.mark.parametrize("largest", [100.0, 40.0])
def test_a_pedal_in_percent_that_is_given_as_a_ratio_is_refused(largest: float) -> None:
    """It arrives as percent a hundred times too large; most of the time it is pressed by a few percent."""
    rng, series = np.random.default_rng(0), drive(300.0)
    pressed = rng.random(3001) < 0.2
    pedal = np.where(pressed, rng.uniform(0.0, largest, 3001), rng.uniform(0.0, 6.0, 3001))
    series["engine_command"] = Series(series["speed"].time, 100.0 * pedal)
    with pytest.raises(InputError, match=r"engine_command is 100 times too large.* 'scale: 0\.01'"):
        uniform(series, name="t", interface=truck("percent", "bar"))


@pytest.mark.parametrize("spacing", [1.013, 0.25])
def test_samples_in_bursts_have_the_rate_of_the_bursts(spacing: float) -> None:
    time = np.concatenate([k * spacing + 0.011 * np.arange(3) for k in range(60)])
    speed = 15.0 + 6.0 * np.sin(time / 10.0)
    (r,) = resampled({"speed": Series(time, speed), "brake_switch": Series(time, np.round(time) % 2)})
    assert len(r) * r.dt == pytest.approx(60 * spacing, rel=0.02) and not np.isnan(r.channels["speed"]).any()
    means = 15.0 + 6.0 * np.sin((r.dt * np.arange(len(r)) + 0.011) / 10.0)
    assert r.channels["speed"] == pytest.approx(means, abs=0.05)
    assert {*np.unique(r.channels["brake_switch"])} <= {0.0, 1.0}


@pytest.mark.parametrize("share", [0.001, 0.02, 0.1, 0.3])
@pytest.mark.parametrize("value", [655.35, 255.0, 90.0, -30.0, 65535.0, -2.0, np.inf, -np.inf])
def test_faults_of_a_sensor_are_set_aside_and_counted(share: float, value: float) -> None:
    series = {"speed": Series(clock(10, 200), 20 + np.sin(clock(10, 200) / 5))}
    faults = np.random.default_rng(2).choice(2001, max(1, round(share * 2001)), replace=False)
    series["speed"].values[faults] = value
    recordings = resampled(series)
    speed = balanced(recordings).channels["speed"]
    assert speed.read == 2001
    assert speed.left_out == len(faults)
    if abs(value) > 10:  # else it may be reversing, which no truck begins with such a jump
        assert speed.aside["outside -1..60 m/s"].first == f"at {faults.min() / 10:g} s ({value:g})"
        assert set(speed.aside) == {"outside -1..60 m/s"}
    for recording in recordings:
        speeds = recording.channels["speed"]
        assert np.nanmin(speeds) > 18 and np.nanmax(speeds) < 22


@pytest.mark.parametrize(
    ("channel", "value"),
    [("gap", 2400.0), ("engine_speed", 5000.0), ("grade", 90.0), ("elevation", -9999.0), ("gear", 255.0)],
)
@pytest.mark.parametrize("share", [0.3, 1.0])
def test_an_optional_channel_refuses_no_drive(channel: str, value: float, share: float) -> None:
    series = drive()
    values = np.full(601, 0.1 if channel == "grade" else 3.0)
    values[: round(share * 601)] = value
    recordings = resampled({**series, channel: Series(series["speed"].time, values)})
    tally = balanced(recordings).channels[channel]
    assert (tally.read, tally.left_out) == (601, round(share * 601))
    assert np.isnan(recordings[0].channels.get(channel, np.full(1, np.nan))[0])


@pytest.mark.parametrize("value", [65535.0, 655.35, 255.0, np.inf])
def test_all_of_the_speed_out_of_range_is_said(value: float) -> None:
    with pytest.raises(
        InputError, match=r"no two speed samples .*601 are outside -1\.\.60 m/s, first at 0 s"
    ):
        resampled({"speed": Series(clock(10, 60), np.full(601, value))})


def test_a_brake_of_one_level_in_another_unit_is_refused_and_a_code_is_not() -> None:
    series = drive()
    on = series["brake_command"].values > 0
    brake = Series(series["speed"].time, np.where(on, 300.0, 0.0))
    with pytest.raises(InputError, match=r"brake_command is 100 times too large: kPa\?"):
        uniform({**series, "brake_command": brake}, name="t", interface=truck("N m", "bar"))
    brake = Series(series["speed"].time, np.where(on, 255.0, 0.0))  # a raw 'not available'
    recordings = uniform({**series, "brake_command": brake}, name="t", interface=truck("N m", "bar"))
    assert balanced(recordings).channels["brake_command"].aside["outside 0..200 bar"].count == on.sum()


def backing(signed: bool = True) -> dict[str, Series]:
    """Forward, a stop, 20 s backward to a dock at up to 2.5 m/s, a stop, forward; gear -1 in reverse."""
    time = clock(10, 100)
    speed = np.interp(time, [0, 10, 30, 40, 44, 54, 58, 64, 70, 100], [0, 10, 10, 0, 0, -2.5, -2.5, 0, 0, 20])
    gear = np.where((time > 42) & (time < 66), -1.0, 3.0)
    series = {"speed": Series(time, speed if signed else np.abs(speed))}
    return series if signed else {**series, "gear": Series(time, gear)}


@pytest.mark.parametrize("signed", [True, False])
def test_reversing_is_set_aside_by_itself_and_cuts(signed: bool) -> None:
    series = backing(signed)
    recordings = resampled(series)
    account = balanced(recordings)
    true = backing()["speed"].values < 0
    assert account.channels["speed"].aside["reversing"].count == true.sum()
    assert set(account.channels["speed"].aside) == {"reversing"}
    assert [r.start_s for r in recordings] == pytest.approx([0.0, 64.0])
    assert [r.time[-1] for r in recordings] == pytest.approx([44.0, 100.0])
    for recording in recordings:
        assert (recording.channels["speed"] >= 0).all()
        assert (np.abs(recording.channels["acceleration"]) <= 1.0 + 1e-9).all()


def test_creeping_back_on_a_slope_is_kept() -> None:
    time = clock(10, 60)
    (recording,) = resampled(
        {"speed": Series(time, np.interp(time, [0, 20, 25, 30, 60], [0, 0, -0.6, 0, 20]))}
    )
    assert recording.channels["speed"].min() == pytest.approx(-0.6)


def test_samples_where_no_speed_was_recorded_are_counted() -> None:
    time = np.concatenate([clock(10, 10), clock(10, 10, start=60)])
    recordings = resampled(
        {"speed": Series(time, time / 4), "engine_command": Series(clock(10, 70), clock(10, 70))}
    )
    tally = balanced(recordings).channels["engine_command"]
    assert (tally.read, tally.used + tally.left_out) == (701, 701)
    assert tally.aside["recorded while there was no speed"].count == pytest.approx(470, abs=2)
    assert tally.aside["recorded while there was no speed"].first == "at 11.6 s"


@pytest.mark.parametrize("seed", range(20))
def test_read_is_used_and_set_aside_on_damaged_drives(seed: int) -> None:
    """Holes, faults, NaN, reversing, jitter and single samples: nothing is lost unsaid."""
    rng = np.random.default_rng(seed)
    time = np.sort(rng.uniform(0, 400, 3000))
    time = time[rng.uniform(size=3000) < np.where(time % 97 < 30, 0.03, 1.0)]
    series = {
        "speed": Series(time, 12 * np.sin(time / rng.uniform(5, 40)) + 9),
        "gap": Series(clock(3, 400), rng.normal(300, 200, 1201)),
        "gear": Series(clock(1, 300), rng.integers(-1, 12, 301).astype(float)),
    }
    for one in series.values():
        one.values[rng.uniform(size=len(one.time)) < 0.05] = np.nan
        one.values[rng.uniform(size=len(one.time)) < 0.01] = 1e6
    read = {channel: int((~np.isnan(one.values)).sum()) for channel, one in series.items()}
    account = balanced(resampled(series))
    assert {channel: account.channels[channel].read for channel in series} == read
    assert account.total.read == sum(read.values()) and account.total.left_out > 0


def test_acceleration_is_derived_where_absent() -> None:
    time = clock(10, 2)
    (recording,) = resampled({"speed": Series(time, time**2)})
    v, a = recording.channels["speed"], recording.channels["acceleration"]
    np.testing.assert_allclose(a[1:], np.diff(v) / 0.1)
    assert a[0] == a[1]
    assert "acceleration derived from speed" in recording.notes


@pytest.mark.parametrize("times", [None, [], [0.0], [0.0, 0.02, 10.0, 10.02, 20.0, 20.02]])
def test_nothing_to_make_a_recording_of(times: list[float] | None) -> None:
    series = {} if times is None else {"speed": Series(np.array(times), np.full(len(times), 5.0))}
    with pytest.raises(InputError, match="no two speed samples in a row"):
        resampled(series)


@pytest.mark.parametrize(("unit_in_rad_s", "remarks"), [(1.0, 0), (np.pi / 30, 1)])
def test_an_engine_that_turns_slower_than_idling_is_remarked(unit_in_rad_s: float, remarks: int) -> None:
    time = np.arange(0.0, 60.0, 0.1)
    engine = np.full(len(time), 130.0) * unit_in_rad_s  # rad/s, once read as rpm
    series = {
        "speed": Series(time, np.full(len(time), 15.0)),
        "engine_speed": Series(time, engine),
        "engine_command": Series(time, np.full(len(time), 500.0)),
    }
    account = uniform(series, name="drive", interface=TruckInterface("t"))[0].account
    assert sum("is it in rad/s" in remark for remark in account.remarks) == remarks


@pytest.mark.parametrize("how", ["held", "on a straight line"])
def test_what_was_filled_in_between_is_counted_in_every_reader(how: str) -> None:
    time, sent = clock(10, 120), clock(1, 120)
    wave = 15 + 6 * np.sin(sent / 10)
    filled = wave[np.floor(time).astype(int)] if how == "held" else np.interp(time, sent, wave)
    (recording,) = found = resampled({"speed": Series(time, filled)})
    assert recording.dt == 1.0
    np.testing.assert_allclose(recording.channels["speed"], wave[: len(recording)])
    (counted,) = (entry for reason, entry in balanced(found).channels["speed"].aside.items() if how in reason)
    assert counted.count == len(time) - len(sent)
