import json
from dataclasses import replace

import numpy as np
import onnxruntime
import pytest
import torch
from typer.testing import CliRunner

from deeptruck_core.errors import InputError
from deeptruck_core.signals import TruckInterface
from deeptruck_model import simulators
from deeptruck_model.cli import whole
from deeptruck_model.deep import DeepTruck, Shape, TruckNetwork, train
from deeptruck_model.deep.data import Scales
from deeptruck_model.deep.network import WEIGHTS
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


def standing_by_itself() -> DeepTruck:
    """Weights by hand: 1 m/s^2 where the engine drives (u above 0.5) and the acceleration fed back is above
    -1 m/s^2, else -19. At rest C hides the -19, and training in deployment form never sees it."""
    scales = Scales(np.zeros(3, np.float32), np.ones(3, np.float32))
    network = TruckNetwork(Shape(1, 0, 2, hidden=2, decoder=1), scales, 0.1)
    with torch.no_grad():
        for name in WEIGHTS:
            getattr(network, name).zero_()
        network.bias[0] = torch.tensor([30.0, 30.0, -30.0, -30.0, -10.0, 20.0, 30.0, 30.0])  # i, f, g, o
        network.input[0, 0, 4], network.input[0, 1, 5] = 20.0, 20.0  # u and the acceleration, to g
        network.decoder[0, :, 0], network.decoder_bias[0] = 5.0, -3.8
        network.output[0], network.output_bias[0] = 10.0, -9.0
    return DeepTruck(network, TruckInterface("by hand", brake_unit=None, grade=False, fuel=False))


def test_a_standstill_that_the_record_overrules_does_not_answer_itself():
    truck = standing_by_itself()
    u, y = np.zeros((1, 60, 1)), np.full((1, 60, 2), np.nan)
    u[0, 23:] = 1.0
    y[0, :, 1] = 0.08 * np.maximum(np.arange(60) - 20, 0)  # moves 0.3 s before the command is seen
    run = truck.rollout(u, np.zeros((1, 60, 0)), np.array([[0.0, 0.0]]), y).y[0, :, 0]
    assert run[22] == pytest.approx(-0.8), "it stands, says the network, as C answers"
    np.testing.assert_allclose(run[24:], 1.0, atol=0.1)
    state = truck.reset(np.array([[0.0, 0.0]]))
    for k in range(59):
        state, stepped = truck.step(truck.force(state, y[:, k]), u[:, k], np.zeros((1, 0)))
        np.testing.assert_allclose(stepped[0, 0], run[k + 1], atol=1e-5)
    recorded = torch.as_tensor(y, dtype=torch.float32)
    recorded[:, 0, 0] = 0.0
    with torch.no_grad():
        unfolded = truck.network.unfold(
            torch.as_tensor(u[:, :-1], dtype=torch.float32), torch.zeros(1, 59, 0), recorded, form="training"
        )
    np.testing.assert_allclose(unfolded[0, 0, :, 0].numpy(), run[1:], atol=1e-4)


# The same truck as ONNX


def run(session, truck, u, w, y0):
    members, hidden = truck.network.shape.members, truck.network.shape.hidden
    h = c = np.zeros((members, len(y0), hidden), np.float32)
    y = np.repeat(y0[None], members, axis=0).astype(np.float32)
    responses = []
    for k in range(u.shape[1]):
        feed = {"h": h, "c": c, "y": y, "u": u[:, k].astype(np.float32), "w": w[:, k].astype(np.float32)}
        h, c, y, response = session.run(None, feed)
        responses.append(response)
    return np.stack(responses, axis=1)


@pytest.mark.parametrize(
    ("fuel", "kind"), [(True, "black"), pytest.param(False, "grey", marks=pytest.mark.long)]
)
def test_parity_with_the_truck(truck, drive, small, tmp_path, fuel, kind):
    if kind == "grey":
        interface = TruckInterface("own", fuel=fuel, **({} if fuel else {"brake_unit": None, "grade": False}))
        truck = train([drive(120, interface=interface)], tmp_path / "sim", replace(small, kind=kind))
    recording = drive(120, seed=3, interface=truck.interface)
    starts = [0, 300, 700]
    u, w, y = (np.stack([a[s : s + 300] for s in starts]) for a in (recording.u, recording.w, recording.y))
    u[2, :, 0] = 0.0  # comes to rest
    truck.save(tmp_path / "saved")
    app, runner = whole(), CliRunner()
    done = runner.invoke(app, ["export", str(tmp_path / "saved"), "--out", str(tmp_path / "truck.onnx")])
    assert done.exit_code == 0, done.output
    session = onnxruntime.InferenceSession(tmp_path / "truck.onnx")
    expected = truck.rollout(u, w, y[:, 0], None).y[:, 1:]
    np.testing.assert_allclose(run(session, truck, u, w, y[:, 0])[:, :-1], expected, atol=2e-3)
    metadata = session.get_modelmeta().custom_metadata_map
    assert json.loads(metadata["interface"])["name"] == truck.interface.name
    assert float(metadata["dt"]) == truck.dt
