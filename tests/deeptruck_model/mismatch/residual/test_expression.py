"""One formula computed twice: stacked rows and step by step must be the same numbers."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from deeptruck_model.mismatch import expression as ex
from deeptruck_model.mismatch.mechanisms import LIBRARY, build
from deeptruck_model.mismatch.mechanisms.terms import every_variant
from deeptruck_model.mismatch.residual.evidence import DriveRows, Evidence

DT, SIZES = 0.19, (300, 200)  # no time constant is a whole number of steps, where rounding would decide


def synthetic() -> Evidence:
    """Two drives with every signal a mechanism may ask for; rich enough that no column is zero throughout."""
    rng = np.random.default_rng(0)
    n = sum(SIZES)
    t = np.concatenate([np.arange(size) * DT for size in SIZES])
    wave = np.sin(t / 7.0) + 0.5 * np.sin(t / 2.3 + 1.0)
    speed = np.maximum(13.0 + 9.0 * wave, 0.0)
    engine = np.maximum(0.6 * wave, -0.2)
    brake = np.maximum(-1.5 * wave - 0.4, 0.0)
    signals = {
        "speed": speed,
        "acceleration": engine - brake,
        "simulated": engine - brake + rng.normal(0.0, 0.01, n),
        "time": t, "elapsed": t,
        "distance": np.concatenate([np.cumsum(part) * DT for part in np.split(speed, [SIZES[0]])]),
        "place": np.concatenate([np.cumsum(part) * DT for part in np.split(speed, [SIZES[0]])]),
        "engine": engine, "brake": brake, "drag": 2e-4 * speed**2, "rolling": np.full(n, 0.06),
        "engine_command": 1500.0 * engine, "brake_command": 40.0 * brake,
        "grade": 0.02 * np.sin(t / 11.0), "elevation": 300.0 + 10.0 * np.sin(t / 11.0),
        "gear": np.clip(np.round(speed / 2.0), 1, 12),
        "engine_speed": 130.0 + 40.0 * np.sin(t / 3.0),
        "engine_torque": 1500.0 * engine, "modelled_torque": 1500.0 * engine,
        "gap": 30.0 + 25.0 * np.sin(t / 5.0), "leader_speed": speed, "ambient_temperature": 10.0 + 0.05 * t,
        "fuel_rate": np.maximum(8.0 * engine, 0.5), "latitude": 50.0 + 1e-4 * t, "longitude": 8.0 + 1e-4 * t,
        "sensitivity:mass": brake + 2e-4 * speed**2 - engine,
    }  # fmt: skip
    signals["ratio"] = np.clip(signals["engine_speed"] / np.maximum(speed, 0.5), 0.0, 150.0)
    signals["overall_ratio"] = np.minimum(signals["ratio"], 30.0)
    signals["effective_mass_gain"] = 1.0 / (1.05 + 4e-4 * signals["overall_ratio"] ** 2)

    drives = (
        DriveRows("a", 0, SIZES[0], 0.0, False),
        DriveRows("b", SIZES[0], n, 0.0, True),
    )
    return Evidence(
        DT, drives, rng.normal(0.0, 0.05, n), signals["simulated"], np.zeros(n), np.ones(n, dtype=bool),
        signals, {}, 2e4, lambda name, amount: np.full(n, 0.01),
    )  # fmt: skip


EVIDENCE = synthetic()


def streamed(expressions: list[ex.Expression], e: Evidence = EVIDENCE) -> np.ndarray:
    """Values (len(expressions), n) as a running simulation computes them, one drive after the other."""
    out = np.zeros((len(expressions), len(e)))
    for s in e.drives:
        stream = ex.Stream(expressions)
        memory = stream.begin(2)
        for k in range(s.start, s.stop):
            now = {name: np.full(2, x[k]) for name, x in e.signals.items()}
            values, memory = stream.step(memory, now, e.dt)
            for i, value in enumerate(values):
                pair = np.broadcast_to(value, 2)
                assert pair[0] == pair[1]
                out[i, k] = pair[0]
    return out


SPEED, BRAKE = ex.Signal("speed"), ex.Signal("brake")
NODES = {
    "constant": ex.lift(3.0),
    "signal": SPEED,
    "missing signal": ex.Signal("nothing", missing=7.0),
    "arithmetic": (2.0 + SPEED * 3.0 - 1.0) / (1.0 + BRAKE) ** 2 - (1.0 - BRAKE) + 4.0 / (SPEED + 1.0),
    "comparison": (SPEED < 12.0) + (BRAKE > 0.2) * 2.0,
    "functions": ex.maximum(SPEED, 10.0) + ex.minimum(BRAKE, 0.3) + ex.exp(-BRAKE) + ex.absolute(BRAKE - 1.0),
    "tanh": ex.Apply("tanh", (BRAKE,)),
    "lag": ex.Lag((SPEED,), 3.0),
    "cold lag": ex.Lag((SPEED,), 3.0, cold=True),
    "rising lag": ex.RisingLag((SPEED,), 2.0),
    "since": ex.Since((BRAKE > 0.5,)),
    "change": ex.Change((SPEED,)),
    "integral": ex.Integral((SPEED,)),
    "slosh": ex.Slosh((ex.Signal("simulated"),), 0.4, 0.1),
    "play": ex.Play((ex.Signal("simulated"),), 0.7),
    "soft play": ex.Play((BRAKE - 0.4,), 0.5, 0.3),
    "tent": ex.Tent((SPEED,), 12.0, 4.0),
    "interpolated": ex.Interpolated((SPEED,), (5.0, 12.0, 30.0), (0.0, 1.0, -2.0)),
    "memories of memories": ex.Lag((ex.Lag((SPEED * BRAKE,), 5.0, cold=True) - SPEED,), 1.0) * BRAKE,
}


@pytest.mark.parametrize("name", NODES)
def test_every_node_is_the_same_both_ways(name: str) -> None:
    rows = NODES[name].rows(EVIDENCE)
    assert rows.shape == (len(EVIDENCE),)
    assert streamed([NODES[name]])[0] == pytest.approx(rows, rel=1e-9, abs=1e-9)


def test_unknown_samples_count_as_missing_both_ways() -> None:
    x = ex.Signal("gap", missing=500.0)
    holes = EVIDENCE.signals["gap"].copy()
    holes[100:200] = np.nan
    e = Evidence(**{**EVIDENCE.__dict__, "signals": EVIDENCE.signals | {"gap": holes}})
    assert x.rows(e)[150] == 500.0
    assert streamed([x], e)[0] == pytest.approx(x.rows(e))


def test_since_counts_from_never() -> None:
    event = ex.Since((SPEED > 1e3,), never=42.0)
    assert (event.rows(EVIDENCE) == 42.0).all() and (streamed([event]) == 42.0).all()


def test_slosh_is_a_damped_oscillator_that_takes_no_momentum() -> None:
    n = 6000
    kick = np.zeros(n)
    kick[10:15] = 1.0
    whole = (DriveRows("a", 0, n, 0.0, False),)
    e = Evidence(0.02, whole, kick, kick, kick, kick == 0, {"simulated": kick}, {}, 1.0, lambda a, b: kick)
    force = ex.Slosh((ex.Signal("simulated"),), 0.5, 0.1).rows(e)
    after = force[200:]
    crossings = np.flatnonzero(np.diff(np.sign(after)) > 0)
    assert np.diff(crossings[:4]).mean() * e.dt == pytest.approx(1 / (0.5 * np.sqrt(1 - 0.1**2)), rel=0.02)
    assert abs(after[-500:]).max() < 0.01 * abs(after).max()
    assert force.sum() * e.dt == pytest.approx(0.0, abs=0.05 * kick.sum() * e.dt)


@pytest.mark.parametrize("holds", [0.0, 0.1])
def test_a_play_takes_the_same_impulse_each_time_it_is_crossed(holds: float) -> None:
    n = 300
    pull = np.where(np.arange(n) < 150, 0.4, -0.4)
    rows = (DriveRows("a", 0, n, 0.0, False),)
    e = Evidence(0.1, rows, pull, pull, pull, pull > 9, {"simulated": pull}, {}, 1.0, lambda a, b: pull)
    lost = ex.Play((ex.Signal("simulated"),), 0.8, holds).rows(e)
    assert lost[:150].sum() * 0.1 == pytest.approx(0.4) and lost[150:].sum() * 0.1 == pytest.approx(-0.8)
    taken = np.flatnonzero(lost[150:] < 0)
    assert lost[0] == pytest.approx(0.4, rel=0.2) and taken[-1] < (21 if holds == 0.0 else 40)
    assert (lost[150 + taken[-1] + 1 :] == 0.0).all()


def test_in_recording_marks_its_rows_and_says_elsewhere_in_a_simulation() -> None:
    x = ex.InRecording(1, from_s=19.0, elsewhere=0.25)
    rows = x.rows(EVIDENCE)
    assert np.flatnonzero(rows).tolist() == list(range(SIZES[0] + 100, sum(SIZES)))
    assert (streamed([x]) == 0.25).all()


def test_a_knot_is_a_tent_in_its_recording_and_its_mean_in_a_simulation() -> None:
    here = ex.Knot((ex.Signal("elapsed"),), 1, 20.0, 5.0, 0.125)
    elapsed = EVIDENCE["elapsed"]
    tent = np.maximum(1.0 - np.abs(elapsed - 20.0) / 5.0, 0.0)
    assert np.array_equal(here.rows(EVIDENCE), np.where(EVIDENCE.record == 1, tent, 0.0))
    assert (streamed([here]) == 0.125).all()


def test_a_place_is_a_tent_in_every_recording_and_its_mean_where_nobody_knows_the_place() -> None:
    here = ex.AtPlace((ex.Signal("place", missing=-1.0),), 300.0, 50.0, 0.125)
    tent = np.maximum(1.0 - np.abs(EVIDENCE["place"] - 300.0) / 50.0, 0.0)
    assert np.array_equal(here.rows(EVIDENCE), tent) and tent.max() > 0.5
    assert np.allclose(streamed([here]), tent)
    lost = ex.AtPlace((ex.Signal("unheard", missing=-1.0),), 300.0, 50.0, 0.125)
    assert (lost.rows(EVIDENCE) == 0.125).all() and (streamed([lost]) == 0.125).all()


def parts(x: ex.Expression) -> Iterator[ex.Expression]:
    yield x
    for inner in x.inputs:
        yield from parts(inner)


@pytest.mark.parametrize("effect", LIBRARY)
def test_every_mechanism_is_the_same_both_ways(effect: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """As fitted and as simulated; where a column belongs to one recording, as if this were elsewhere."""
    for part in (ex.InRecording, ex.Knot):
        monkeypatch.setattr(part, "over", lambda self, values, e: np.full(len(e), float(self.elsewhere)))
    variants = list(every_variant(LIBRARY[effect], EVIDENCE))
    assert variants, "a mechanism without a shape on rich data can never be named"
    columns = [c.expression for v in variants for c in build(LIBRARY[effect], (v,))[:5]]
    apart = [x for x in columns if not isinstance(x, ex.Rerun)]
    assert not any(isinstance(p, ex.Rerun) for x in apart for p in parts(x)), "a command path is no force"
    if apart:
        rows = np.stack([x.rows(EVIDENCE) for x in apart])
        scale = np.maximum(np.abs(rows).max(axis=1, keepdims=True), 1.0)
        assert (np.abs(streamed(apart) - rows) <= 1e-7 * scale).all()


def test_a_formula_knows_its_signals() -> None:
    force = ex.Lag((ex.Signal("brake") * ex.maximum(SPEED, 1.0),), 3.0) * ex.Signal("gap")
    assert force.signals() == {"brake", "speed", "gap"}
    assert ex.lift(1.0).signals() == frozenset()
    assert ex.Rerun("delay_all", 0.3).signals() == {"engine", "brake"}
    assert ex.Rerun("lag_brake", 0.3).signals() == {"brake"}
