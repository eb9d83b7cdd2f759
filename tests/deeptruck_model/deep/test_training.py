from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch

from deeptruck_core.errors import InputError
from deeptruck_core.signals import TruckInterface
from deeptruck_model import trucks
from deeptruck_model.deep import Arguments, finished, resume, statistics, train, training, trials
from deeptruck_model.deep.network import WEIGHTS
from deeptruck_model.deep.training import DivergedError


def weights(truck):
    return {name: getattr(truck.network, name).detach().clone() for name in WEIGHTS}


def same(a, b):
    return all(torch.equal(a[name], b[name]) for name in WEIGHTS)


def speed_error(truck, recording):
    return statistics(trials(truck, [recording], 30, 20.0))["speed"]["mean_abs"]


def test_learns_a_truck(drive, small, tmp_path):
    """Identity case: predicting the start speed for ever is far worse than a few seconds of training."""
    truck = train([drive(900)], tmp_path / "sim", replace(small, updates=350))
    test = drive(600, seed=9)
    runs = trials(truck, [test], 30, 20.0)
    still = np.nanmean(np.abs(runs.measured[..., 1] - runs.measured[:, :1, 1]))
    assert speed_error(truck, test) < 0.1 * still


@pytest.mark.long
def test_grey_learns_a_truck_too(drive, small, tmp_path):
    truck = train([drive(600)], tmp_path / "sim", replace(small, kind="grey"))
    assert truck.network.shape.gains
    test = drive(300, seed=9)
    runs = trials(truck, [test], 30, 20.0)
    still = np.nanmean(np.abs(runs.measured[..., 1] - runs.measured[:, :1, 1]))
    assert speed_error(truck, test) < 0.2 * still


def test_an_adapted_truck_knows_more_than_its_minute_of_data_tells(truck, drive, small, tmp_path):
    truck.save(tmp_path / "known")
    short, test = [drive(60, seed=5)], drive(600, seed=9)
    alone = train(short, tmp_path / "alone", replace(small, updates=60))
    adapted = train(
        short, tmp_path / "adapted", replace(small, updates=60, start=str(tmp_path / "known"), members=3)
    )
    assert adapted.network.shape.members == 3 and adapted.network.shape.hidden == small.hidden
    assert speed_error(adapted, test) < 0.7 * speed_error(alone, test)


def test_only_a_deep_truck_of_the_same_signals_is_adapted(truck, drive, small, tmp_path):
    truck.save(tmp_path / "known")
    arguments = replace(small, start=str(tmp_path / "known"))
    with pytest.raises(InputError, match=r"other signals.*: brake_command is only in the truck; train"):
        train([drive(60, interface=TruckInterface("x", brake_unit=None))], tmp_path / "sim", arguments)
    trucks.load("volvo").save(tmp_path / "physics")
    with pytest.raises(InputError, match="no deep truck"):
        train([drive(60)], tmp_path / "sim", replace(small, start=str(tmp_path / "physics")))


@pytest.mark.long
def test_paper_mode_learns(drive, small, tmp_path):
    untrained = train([drive(600)], tmp_path / "a", replace(small, mode="paper", updates=1, rounds=1))
    trained = train([drive(600)], tmp_path / "b", replace(small, mode="paper", updates=400))
    test = drive(300, seed=9)
    assert speed_error(trained, test) < 0.5 * speed_error(untrained, test)


def test_resumed_equals_uninterrupted(drive, small, tmp_path, monkeypatch):
    drives, arguments = [drive(300)], replace(small, updates=60, members=2)
    whole = train(drives, tmp_path / "whole", arguments)

    save, saved = resume.save, []

    def killed(*everything):
        save(*everything)
        saved.append(everything[-1])
        if len(saved) == 3:
            raise KeyboardInterrupt

    monkeypatch.setattr(training.resume, "save", killed)
    with pytest.raises(KeyboardInterrupt):
        train(drives, tmp_path / "killed", arguments)
    assert not (tmp_path / "killed").exists()
    monkeypatch.undo()
    resumed = train(drives, tmp_path / "killed", arguments, resumes=True)
    assert same(weights(whole), weights(resumed))
    assert sorted(p.name for p in tmp_path.iterdir()) == ["killed", "whole"]
    written = (tmp_path / "killed" / "simulator.json").stat().st_mtime_ns
    train(drives, tmp_path / "killed", arguments, resumes=True)  # finished: nothing left to do
    assert (tmp_path / "killed" / "simulator.json").stat().st_mtime_ns == written


def test_a_finished_run_is_only_gone_on_with_by_its_own_arguments(drive, small, tmp_path):
    short, out = replace(small, updates=6), tmp_path / "sim"
    assert not finished([drive(60)], out, short)
    train([drive(60)], out, short)
    assert finished([drive(60)], out, short) and not finished([drive(60, seed=1)], out, short)
    with pytest.raises(InputError, match="budget was 6, given 7; the recordings were others"):
        train([drive(60, seed=1)], out, replace(short, updates=7), resumes=True)
    with pytest.raises(InputError, match=r"mode was default, given paper\)"):
        train([drive(60)], out, replace(short, mode="paper"), resumes=True)


def test_directory_is_complete(drive, small, tmp_path):
    train([drive(200)], tmp_path / "sim", replace(small, updates=30))
    names = {p.name for p in (tmp_path / "sim").iterdir()}
    assert names == {
        "simulator.json", "model.safetensors", "coverage.json", "driven.safetensors", "metrics.json",
        "MODEL_CARD.md", "reference.safetensors", "tensorboard", ".deeptruck.json",
    }  # fmt: skip
    assert "| engine_command | N m | input |" in (tmp_path / "sim" / "MODEL_CARD.md").read_text()
    assert json.loads((tmp_path / "sim" / "metrics.json").read_text())["trials"] == 90


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (lambda r: r.channels.pop("engine_command"), "no recording has an engine_command"),
        (
            lambda r: r.channels["engine_command"].__setitem__(slice(None), np.nan),
            "no recording has an engine",
        ),
        (
            lambda r: r.channels["engine_command"].__setitem__(slice(None, None, 20), np.nan),
            "no segment of 3 s",
        ),
    ],
)
def test_unusable_data_is_one_clear_line(drive, small, tmp_path, spoil, says):
    recording = drive(30)
    spoil(recording)
    with pytest.raises(InputError, match=says):
        train([recording], tmp_path / "sim", small)
    assert not list(tmp_path.iterdir())


def test_a_drive_too_short_to_hold_anything_out_is_refused_before_training(drive, small, tmp_path):
    with pytest.raises(InputError, match="given twice"):
        train([drive(60), drive(60)], tmp_path / "sim", small)
    with pytest.raises(InputError, match="21 s or more"):
        train([drive(20)], tmp_path / "sim", small)
    assert not list(tmp_path.iterdir())
    train([drive(21)], tmp_path / "sim", replace(small, updates=6))


def test_weights_that_overflow_are_a_divergence(drive, small, tmp_path):
    """With responses squeezed by tanh the validation loss may be finite all the same."""
    with pytest.raises(DivergedError, match=r"take a lower learning rate than 1e\+20"):
        train([drive(60)], tmp_path / "sim", replace(small, learning_rate=1e20))
    assert not list(tmp_path.iterdir())


# Arguments that no training run can have


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"learning_rate": -1.0}, "learning_rate is -1; it must be at least 0"),
        ({"updates": -5}, r"budget \(updates in Python\) is -5; it must be at least 0"),
        ({"learning_rate": 1e31}, r"learning_rate is 1e\+31; it must be at most 1e\+30"),
        ({"members": 0}, "members is 0; it must be at least 1"),
        ({"clip": float("nan")}, "clip is nan"),
    ],
)
def test_a_value_that_no_run_can_have_is_refused(wrong: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said):
        Arguments(**wrong)


def test_resume_refuses_another_run(drive, small, tmp_path, monkeypatch):
    def killed(*everything):
        original(*everything)
        raise KeyboardInterrupt

    original = resume.save
    monkeypatch.setattr(training.resume, "save", killed)
    with pytest.raises(KeyboardInterrupt):
        train([drive(60)], tmp_path / "sim", small)
    monkeypatch.undo()
    with pytest.raises(InputError, match=r"another run \(seed was 0, given 5\)"):
        train([drive(60)], tmp_path / "sim", replace(small, seed=5), resumes=True)
    with pytest.raises(InputError, match=r"another run \(the recordings were others\)"):
        train([drive(60, seed=1)], tmp_path / "sim", small, resumes=True)
    (tmp_path / ".sim.unfinished" / resume.FILE).write_bytes(b"half")
    with pytest.raises(InputError, match="damaged"):
        train([drive(60)], tmp_path / "sim", small, resumes=True)


def test_a_gradient_that_is_not_finite_is_skipped(drive, small, tmp_path, monkeypatch):
    gradient, calls = training.loss.gradient, []

    def sometimes(network, *rest):
        losses = gradient(network, *rest)
        calls.append(1)
        if len(calls) % 7 == 0:
            network.input.grad[0, 0, 0] = np.nan
            network.bias.grad[1] = np.inf
        return losses

    monkeypatch.setattr(training.loss, "gradient", sometimes)
    truck = train([drive(120)], tmp_path / "sim", replace(small, updates=60, members=2))
    assert len(calls) > 2 * 7  # of them two at least were spoilt
    assert np.isfinite(truck.details["training"]["validation_loss"]).all()
