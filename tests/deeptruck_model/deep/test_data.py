from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from deeptruck_core.errors import InputError
from deeptruck_core.signals import TruckInterface
from deeptruck_model.deep import coverage, data, io
from deeptruck_model.deep.data import unexcited
from deeptruck_model.recordings import Recording


def test_sequences_stay_inside_their_piece(drive):
    pieces = [drive(30, seed=1), drive(12, seed=2)]
    sequences = data.Sequences.of(pieces, data.measure_scales(pieces))
    starts = sequences.draw(200, 100, np.random.default_rng(0))
    x, target = sequences.gather(starts[None], 100)
    assert x.shape == (1, 100, 200, 3) and target.shape == (1, 101, 200, 3)
    ends = np.where(starts < 300, 300, 420)
    for j, (start, end) in enumerate(zip(starts, ends, strict=True)):
        length = min(101, end - start)
        assert length >= 26
        np.testing.assert_array_equal(target[0, :length, j], sequences.y[start : start + length])
        assert np.isnan(target[0, length:, j]).all()


def test_cut_at_invalid_inputs(drive):
    recording = drive(60)
    recording.channels["engine_command"][200:210] = np.nan
    recording.channels["speed"][:3] = np.nan
    recording.channels["speed"][400:405] = np.nan
    pieces = data.cut(recording, recording.interface)
    assert [(p.start_s, len(p)) for p in pieces] == [(pytest.approx(0.3), 197), (21.0, 390)]


def test_consistent_acceleration_loses_bias_and_keeps_the_rest(drive):
    recording = drive(300)
    truth = recording.channels["acceleration"].copy()
    np.testing.assert_allclose(data.consistent(recording).channels["acceleration"][1:], truth[1:], atol=1e-9)
    biased = replace(recording, channels={**recording.channels, "acceleration": truth + 0.3})
    np.testing.assert_allclose(data.consistent(biased).channels["acceleration"][1:], truth[1:], atol=1e-9)
    biased.channels["acceleration"][50:90] = np.nan
    corrected = data.consistent(biased).channels["acceleration"]
    known = np.isfinite(corrected) & (np.arange(len(truth)) > 0)
    np.testing.assert_allclose(corrected[known], truth[known], atol=1e-9)


def test_split_keeps_time_order_and_shares(drive):
    long, short = drive(600), [drive(20, seed=s) for s in range(1, 15)]
    training, validation = data.time_split([long, *short])
    assert len(training[0]) == 5100 and len(validation[0]) == 900
    assert validation[0].start_s == pytest.approx(510.0)
    assert len(training) + len(validation) == 16 and len(validation) == 3
    only, held = data.time_split([drive(20)])
    assert (len(only[0]), len(held[0])) == (170, 30)


def test_common_interface_is_what_all_have(drive):
    full, blind = drive(10), drive(10, seed=1)
    del blind.channels["grade"], blind.channels["fuel_rate"]
    blind.channels["brake_command"][:] = np.nan
    interface = data.common_interface([full, blind])
    assert (interface.grade, interface.brake_unit, interface.fuel) == (False, None, True)
    piece = data.cut(blind, interface)[0]
    assert piece.y.shape == (100, 3) and np.isnan(piece.y[:, 2]).all()


def test_a_short_stretch_without_grade_does_not_cost_the_grade(drive):
    full, standing = drive(100), drive(8, seed=1)
    standing.channels["grade"][:] = np.nan
    interface = data.common_interface([full, standing])
    assert interface.grade
    assert data.cut(standing, interface) == []
    del standing.channels["grade"]
    assert data.cut(standing, interface) == []


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda r: replace(r, dt=1.0), "one rate"),
        (lambda r: replace(r, interface=TruckInterface("x", engine_unit="g/s")), "N m"),
        (lambda r: replace(r, interface=TruckInterface("x", brake_unit="bar")), "bar, percent"),
    ],
)
def test_bags_that_do_not_belong_together(drive, change, says):
    with pytest.raises(InputError, match=says):
        data.common_interface([drive(10), change(drive(10, seed=1))])


def test_unrecorded_braking_is_left_out(drive):
    fuel = TruckInterface("logger", "g/s", None)
    recording = drive(30, interface=fuel)
    recording.channels["grade"][:] = 0.02
    recording.channels["acceleration"][:] = -0.7  # of which the slope takes 0.2
    assert not data.unexplained(recording, fuel).any()
    recording.channels["acceleration"][100:120] = -1.5
    assert [len(p) for p in data.cut(recording, fuel)] == [100, 180]
    assert not data.unexplained(recording, TruckInterface("torque", "N m", None)).any()
    assert not data.unexplained(recording, TruckInterface("braked", "g/s", "percent")).any()


def test_inputs_that_never_vary_are_named(drive):
    still = drive(60)
    assert unexcited([still], still.interface) == ()
    for name, value in (("engine_command", 300.0), ("brake_command", 0.0), ("grade", 0.01)):
        still.channels[name][:] = value
    assert len(unexcited([still], still.interface)) == 3
    other = replace(still, channels={**still.channels, "engine_command": np.full(len(still), 800.0)})
    assert len(unexcited([still, other], still.interface)) == 2


# Which driving a truck has learned from


INTERFACE = TruckInterface("truck", "N m")
N = 300


def cruise(speed: float, engine: float, seconds: float = 30.0) -> Recording:
    n = round(10 * seconds)
    channels = {
        "speed": np.full(n, speed),
        "acceleration": np.zeros(n),
        "fuel_rate": np.ones(n),
        "engine_command": np.full(n, engine),
        "brake_command": np.zeros(n),
        "grade": np.zeros(n),
    }
    return Recording("cruise", 0.1, channels, INTERFACE)


def covered(what: coverage.Driven, speed: float, engine: float, grade: float = 0.0) -> bool:
    return bool(what.covers(np.array([speed]), np.array([[engine, 0.0]]), np.array([[grade]]))[0])


def test_near_what_was_driven_is_known_and_far_is_not() -> None:
    what = coverage.measure_driven([cruise(10.0, 1000.0)])
    assert covered(what, 11.9, 1000.0) and not covered(what, 12.1, 1000.0)
    assert covered(what, 10.0, 1090.0) and not covered(what, 10.0, 1110.0)
    assert covered(what, 10.0, 1000.0, 0.009) and not covered(what, 10.0, 1000.0, 0.011)


def test_a_moment_teaches_nothing() -> None:
    what = coverage.measure_driven([cruise(10.0, 1000.0), cruise(20.0, 1000.0, seconds=1.0)])
    assert covered(what, 10.0, 1000.0) and not covered(what, 20.0, 1000.0)


def test_an_adapted_truck_knows_what_it_drove_before_as_well() -> None:
    before = coverage.measure_driven([cruise(10.0, 1000.0)])
    both = coverage.measure_driven([cruise(20.0, 800.0)], before)
    assert covered(both, 10.0, 1000.0) and covered(both, 20.0, 800.0) and not covered(both, 15.0, 900.0)


def test_damaged_or_of_other_signals_is_said(tmp_path: Path) -> None:
    io.save_driven(coverage.measure_driven([cruise(10.0, 1000.0)]), tmp_path)
    with pytest.raises(InputError, match="of other signals"):
        io.load_driven(tmp_path, 3)
    whole = io.load_driven(tmp_path, 4)
    assert whole is not None
    for name, value in (("samples", np.nan), ("near", np.nan), ("near", 0.0)):
        damaged = getattr(whole, name).copy()
        damaged.flat[-1] = value
        io.save_driven(replace(whole, **{name: damaged}), tmp_path)
        with pytest.raises(InputError, match="values that are not possible"):
            io.load_driven(tmp_path, 4)
    (tmp_path / io.DRIVEN_FILE).write_bytes(b"nothing of the kind")
    with pytest.raises(InputError, match="damaged"):
        io.load_driven(tmp_path, 4)


def test_a_channel_that_stands_still_is_scaled_by_its_floor(drive):
    recording = drive(30)
    for name in ("acceleration", "speed"):
        recording.channels[name][:] = 10.0
    scales, n_y = data.measure_scales([recording]), len(recording.interface.y)
    np.testing.assert_allclose(scales.scale[-n_y:][:2], [0.05, 1.0], rtol=1e-6)  # m/s^2, m/s


def test_samples_without_a_number_teach_nothing() -> None:
    gap = cruise(10.0, 1000.0)
    gap.channels["speed"][:] = np.nan
    what = coverage.measure_driven([gap, cruise(20.0, 1000.0)])
    assert np.isfinite(what.samples).all() and not covered(what, 10.0, 1000.0)
