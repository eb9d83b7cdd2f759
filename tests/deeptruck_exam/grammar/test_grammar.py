"""Laws as data: every name can be drawn, is the same by the same seed, and does what its form says."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from deeptruck_exam.cases.build import MOTION_SD, Built, information
from deeptruck_exam.cases.plan import FIT
from deeptruck_exam.cases.trace import Trace, setting_of
from deeptruck_exam.grammar import grammar
from deeptruck_exam.grammar.shapes import CURVES, GATES, MEMORIES
from deeptruck_exam.grammar.signals import CARRIERS, DRIVERS, Signals
from deeptruck_exam.grammar.special import SPECIAL
from deeptruck_exam.laws import named
from deeptruck_exam.teach.injected import INACTIVE
from deeptruck_exam.worlds import trucks

DT = 0.1


@pytest.fixture(scope="module")
def signals(built: Callable[..., Built]) -> Signals:
    world = built("volvo", True)
    trace = Trace.of(trucks.make("volvo", {}), world.drives, setting_of(world))
    return Signals.of_trace(trace, world.drives.u.shape[1])


def test_the_grammar_has_the_names_of_the_laws() -> None:
    assert set(grammar.names()) == {e.name for e in named()} | {"unknown"}
    assert "drafting" not in grammar.names(leader=False)


def test_every_word_of_the_yaml_is_known() -> None:
    known = {
        "carrier": {*CARRIERS, *SPECIAL},
        "by": {*DRIVERS},
        "loses": {*MEMORIES},
        "memory": {*MEMORIES, "none"},
        "curve": {*CURVES},
        "gate": {*GATES},
    }
    other = {"sign", "size", "loses_s", "memory_s", "negate", "leader", "change"}
    for some in grammar.forms().values():
        for form in some:
            assert set(form) <= {*known, *other}
            assert all(set(form[key]) <= words for key, words in known.items() if key in form)


@pytest.mark.parametrize("name", grammar.names())
def test_laws_of_a_name_act_and_are_the_same_again(name: str, signals: Signals) -> None:
    laws = [grammar.draw(name, np.random.default_rng(k)) for k in range(8)]
    forces = [law.acceleration(signals) for law in laws]
    assert all(np.isfinite(f).all() and f.shape == signals.speed.shape for f in forces)
    # a gate may stay shut here, and a threshold be too high: training leaves such draws as they are
    acting = [information(f[:FIT], MOTION_SD) > INACTIVE for f in forces]
    assert sum(acting) > len(forces) / 2
    again = grammar.draw(name, np.random.default_rng(3)).acceleration(signals)
    assert np.array_equal(again, forces[3]) and not np.array_equal(forces[3], forces[4])


def test_none_to_three_laws_of_different_names() -> None:
    for count in range(4):
        laws = grammar.several(count, np.random.default_rng(count))
        assert len({law.name for law in laws}) == count


def test_a_law_is_size_times_carrier_times_curve(signals: Signals) -> None:
    law = grammar.draw("rolling_resistance_speed", np.random.default_rng(0))
    law = replace(law, size=0.01, driver="", gate="always", change="fixed")
    assert np.allclose(law.newtons(signals), -0.01 * signals.mass * 9.81 * signals.moving)


@pytest.mark.parametrize("name", sorted(CURVES))
def test_curves_go_from_nothing_to_one(name: str) -> None:
    x = np.linspace(0.0, 1.0, 101)
    for seed in range(20):
        y = CURVES[name](x, np.random.default_rng(seed))
        assert y.min() >= -1e-9 and y.max() <= 1.0 + 1e-9
        if name not in ("bell", "falling"):
            assert np.all(np.diff(y) >= -1e-12)


@pytest.mark.parametrize("name", sorted(MEMORIES))
def test_memories_keep_what_is_constant(name: str) -> None:
    x = np.full((2, 3000), 2.0)
    y = MEMORIES[name](x, 1.0, DT, np.random.default_rng(1))
    assert y.shape == x.shape and np.isfinite(y).all()
    if name in ("lag", "delay", "hold", "rate", "swings", "play", "heat"):
        assert y[:, -1] == pytest.approx(2.0, rel=0.02)


def test_a_delay_is_late_and_a_rate_is_limited() -> None:
    step = np.repeat(np.array([[0.0, 10.0]]), 500, axis=1)
    rng = np.random.default_rng(0)
    assert MEMORIES["lag"](step, 1.0, DT, rng)[0, 510] == pytest.approx(10.0 * (1.0 - np.exp(-1.1)), rel=1e-6)
    limited = MEMORIES["rate"](step, 5.0, DT, rng)[0]
    assert np.diff(limited).max() == pytest.approx(10.0 / 5.0 * DT, rel=1e-3)


@pytest.mark.parametrize("name", sorted(GATES))
def test_gates_open_and_close(name: str, signals: Signals) -> None:
    opened = [GATES[name](signals, np.random.default_rng(k)) for k in range(10)]
    assert all(g.shape == signals.speed.shape and g.min() >= 0.0 and g.max() <= 1.0 + 1e-9 for g in opened)
    share = np.mean([g.mean() for g in opened])
    assert share == 1.0 if name == "always" else 0.02 < share < 0.9
