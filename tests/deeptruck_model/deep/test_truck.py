import time

import numpy as np
import pytest
import torch

from deeptruck_model import simulators
from deeptruck_model.deep import DeepTruck
from deeptruck_model.errors import InputError
from deeptruck_model.simulators import Simulator, forced_run, free_run


def batch_of(recording, size, steps):
    starts = np.linspace(0, len(recording) - steps, size).astype(int)
    return tuple(
        np.stack([a[s : s + steps] for s in starts]) for a in (recording.u, recording.w, recording.y)
    )


def test_is_a_simulator(truck):
    assert isinstance(truck, Simulator)
    assert truck.inside(truck.reset(np.zeros((1, 3)))) == {}
    assert truck.parameters() == {}
    assert truck.with_parameters({}) is truck
    with pytest.raises(InputError, match="no parameter 'mass'"):
        truck.with_parameters({"mass": 1.0})


@pytest.mark.parametrize("size", [1, 2, 3, 70])
def test_rollout_equals_steps(truck, drive, size):
    u, w, y = batch_of(drive(120, seed=1), size, 40)
    free, forced = free_run(truck, u, w, y[:, 0]).y, forced_run(truck, u, w, y).y
    state = state_forced = truck.reset(y[:, 0])
    for k in range(39):
        state, response = truck.step(state, u[:, k], w[:, k])
        np.testing.assert_allclose(response, free[:, k + 1], atol=2e-5)
        state_forced, response = truck.step(state_forced, u[:, k], w[:, k])
        np.testing.assert_allclose(response, forced[:, k + 1], atol=2e-5)
        state_forced = truck.force(state_forced, y[:, k + 1])


def test_step_leaves_the_old_state_usable(truck, drive):
    u, w, y = batch_of(drive(60, seed=1), 2, 10)
    state = truck.reset(y[:, 0])
    first, again = truck.step(state, u[:, 0], w[:, 0])[1], truck.step(state, u[:, 0], w[:, 0])[1]
    np.testing.assert_array_equal(first, again)


def test_kinematic_constraint_holds_to_rounding(truck, drive):
    recording = drive(900, seed=2)
    y = free_run(truck, recording.u[None], recording.w[None], recording.y[:1]).y[0]
    assert np.abs(np.diff(y[:, 1]) - truck.dt * y[1:, 0]).max() < 1e-12
    assert y[:, 1].min() >= 0 and y[:, 2].min() >= 0


def test_stands_still_without_drift(truck):
    u, w = np.tile([0.0, 30.0], (1, 3000, 1)), np.zeros((1, 3000, 1))
    y = free_run(truck, u, w, np.array([[0.0, 3.0, 0.5]])).y[0]
    assert y[-1, 1] == 0.0
    stopped = np.argmax(y[:, 1] == 0.0)
    assert (y[stopped + 1 :, :2] == 0.0).all()


def test_torch_module_agrees_and_is_differentiable(truck, drive):
    u, w, y = (torch.as_tensor(a, dtype=torch.float32) for a in batch_of(drive(60, seed=3), 5, 30))
    module, u = truck.torch_module(), u.requires_grad_()
    state, responses = module.reset(y[:, 0]), []
    for k in range(29):
        state, response = module(state, u[:, k], w[:, k])
        responses.append(response)
    run = torch.stack(responses, dim=1)
    expected = free_run(truck, u.detach().double().numpy(), w.double().numpy(), y[:, 0].double().numpy()).y
    np.testing.assert_allclose(run.detach().numpy(), expected[:, 1:], atol=1e-4)
    run[..., 1].sum().backward()
    assert torch.isfinite(u.grad).all() and u.grad[:, :28].abs().sum() > 0
    assert all(weight.grad is None for weight in module.parameters())  # the truck itself is not trained


def test_unknown_start_and_unknown_recorded_samples(truck, drive):
    u, w, y = batch_of(drive(60, seed=4), 3, 20)
    start = y[:, 0].copy()
    start[:, [0, 2]] = np.nan
    assert np.isfinite(free_run(truck, u, w, start).y).all()
    holes = y.copy()
    holes[:, 5:, :] = np.nan
    forced, expected = forced_run(truck, u, w, holes).y, forced_run(truck, u[:, :6], w[:, :6], y[:, :6]).y
    np.testing.assert_allclose(forced[:, :6], expected)
    assert np.isfinite(forced).all()


def test_an_invalid_input_is_not_made_a_number(truck, drive):
    u, w, y = batch_of(drive(60, seed=4), 2, 20)
    u[0, 10, 0] = np.nan
    run = free_run(truck, u, w, y[:, 0]).y
    assert np.isnan(run[0, 11:]).all()
    assert np.isfinite(run[0, :11]).all() and np.isfinite(run[1]).all()


def test_save_and_load_are_equal(truck, drive, tmp_path):
    truck.save(tmp_path / "copy")
    again = simulators.load(tmp_path / "copy")
    u, w, y = batch_of(drive(60, seed=5), 3, 50)
    np.testing.assert_array_equal(free_run(truck, u, w, y[:, 0]).y, free_run(again, u, w, y[:, 0]).y)
    assert isinstance(again, DeepTruck)
    assert (again.interface, again.dt, again.details) == (truck.interface, truck.dt, truck.details)
    assert (again.covers(y, w) == truck.covers(y, w)).all()


def test_coverage_flags_what_was_not_driven(truck, drive):
    recording = drive(600)
    inside = truck.covers(recording.y[:5000], recording.w[:5000])
    assert inside.mean() > 0.97
    assert not truck.covers(np.array([[0.0, 55.0, 1.0]]), np.array([[0.0]])).any()
    assert not truck.covers(np.array([[0.0, 15.0, 1.0]]), np.array([[0.2]])).any()
    assert not truck.covers(np.array([[np.nan, 15.0, 1.0]]), np.array([[0.0]])).any()


def test_an_hour_runs_in_about_a_second(truck):
    u, w = np.zeros((1, 36000, 2)), np.zeros((1, 36000, 1))
    y0 = np.array([[0.0, 10.0, 1.0]])
    free_run(truck, u[:, :10], w[:, :10], y0)
    began = time.process_time()
    free_run(truck, u, w, y0)
    assert time.process_time() - began < 2.0
