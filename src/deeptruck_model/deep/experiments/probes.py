"""Linear probes: what of the truck's hidden state can be read off the LSTM's state by a linear map.

A deep truck runs freely along a drive that it was not trained on. Ridge regression maps its state to signals
that only the physics truck shows: the gear, the brake pressure, the drag. Beside it stand the same regression
from the inputs (commands, grade and the truck's response), and from the state of an untrained network with
the same inputs, whose random features of the past need no learning.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.linear_model import RidgeClassifierCV, RidgeCV
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from deeptruck_model import trucks
from deeptruck_model.deep.data.scales import Scales
from deeptruck_model.deep.experiments.paper_rules import PROBE_AFTER_S, PROBE_PAST_S, PROBE_S
from deeptruck_model.deep.network import TruckNetwork
from deeptruck_model.deep.truck import DeepTruck
from deeptruck_model.recordings import Recording

Array = NDArray[np.float64]
TARGETS = {"gear": "gear", "front_pressure": "brake pressure", "drag_force": "drag"}
SOURCES = {
    "state": "state",
    "untrained": "state of an untrained network",
    "past": "inputs of the last 4 s",
    "now": "inputs",
}
EVERY = 5  # samples from one that is read to the next
PENALTIES = np.logspace(-3, 5, 9)  # of the ridge; chosen by leave-one-out on the drive it is fitted to
DRAWS, TAILS = 500, (5.0, 95.0)  # of the bootstrap over runs; percent


def probe(truck: DeepTruck, fit: Recording, test: Recording, name: str = "trucksim") -> dict[str, Any]:
    """Linear probes: what of the truck's hidden state a linear map reads off the LSTM's state.

    A deep truck runs freely along a drive that it was not trained on. Ridge regression maps its state to the
    gear, brake pressure and drag of the physics truck; the same regression from the inputs, and from the
    state of an untrained network with the same inputs, is what it is compared with.

    Returns scores by target and source, each with its 90 % interval: the share of samples with the right gear,
    of the others R². The drives are of the physics truck `name`, which gives the targets.
    """
    sources, truths = zip(*(_samples(truck, drive, name) for drive in (fit, test)), strict=True)
    return {
        target: {
            source: _score(*(s[source] for s in sources), *(t[target] for t in truths)) for source in SOURCES
        }
        for target in TARGETS
    }


def table(found: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Lines of a table; `found` maps the names of trucks to their scores."""
    lines = [f"| truck | read | {' | '.join(SOURCES.values())} |", "|---" * (len(SOURCES) + 2) + "|"]
    for truck, scores in found.items():
        for target, says in TARGETS.items():
            cells = (_cell(scores[target][source]) for source in SOURCES)
            lines.append(f"| {truck} | {says} | {' | '.join(cells)} |")
    return [*lines, ""]


def learned(found: Mapping[str, Mapping[str, Any]]) -> str:
    """In words, what the trained states hold beyond the untrained one: intervals that do not overlap."""
    more = [
        f"{TARGETS[target]} ({truck})"
        for truck, scores in found.items()
        for target in TARGETS
        if scores[target]["state"][1] > scores[target]["untrained"][2]
    ]
    return f"Above the untrained state, with intervals that do not overlap: {', '.join(more) or 'nothing'}."


def _cell(score: Sequence[float]) -> str:
    middle, low, high = score
    return f"{middle:.3f} ({low:.3f} to {high:.3f})"


def _samples(truck: DeepTruck, drive: Recording, name: str) -> tuple[dict[str, Array], dict[str, Array]]:
    """Features (runs, samples, n) by source and targets (runs, samples) of free runs."""
    steps = round(PROBE_S / truck.dt)
    runs = len(drive) // steps
    inside = trucks.load(name).rollout(drive.u[None], drive.w[None], drive.y[None, 0]).inside
    cut = {target: inside[target][0, : runs * steps].reshape(runs, steps) for target in TARGETS}
    u, w, y = (x[: runs * steps].reshape(runs, steps, -1) for x in (drive.u, drive.w, drive.y))
    state, fed = _run(truck, u, w, y[:, :1])
    read = np.arange(round(PROBE_AFTER_S / truck.dt), steps, EVERY)
    seen = np.concatenate([u, w], axis=-1)
    past = [round(lag / truck.dt) for lag in PROBE_PAST_S]
    lagged = [np.concatenate([seen[:, read - 1 - lag], fed[:, read - lag]], axis=-1) for lag in past]
    features = {
        "state": state[:, read],
        "untrained": _run(_untrained(truck), u, w, fed)[0][:, read],
        "past": np.concatenate(lagged, axis=-1),
        "now": lagged[0],
    }
    return features, {target: values[:, read] for target, values in cut.items()}


def _run(truck: DeepTruck, u: Array, w: Array, fed: Array) -> tuple[Array, Array]:
    """The LSTM's h and c side by side (runs, steps, 2 hidden) and its response (runs, steps, n_y), after each
    step; of an ensemble its first member's. `fed` (runs, n, n_y) takes the place of the first n responses."""
    state = truck.reset(fed[:, 0])
    states, responses = [np.concatenate([state.h[0], state.c[0]], axis=-1)], [fed[:, 0]]
    for k in range(u.shape[1] - 1):
        state, _ = truck.step(state, u[:, k], w[:, k])
        if k + 1 < fed.shape[1]:
            state = truck.force(state, fed[:, k + 1])
        states.append(np.concatenate([state.h[0], state.c[0]], axis=-1))
        responses.append(state.y[0])
    return np.stack(states, axis=1), np.stack(responses, axis=1)


def _untrained(truck: DeepTruck) -> DeepTruck:
    """A truck with the weights that training begins with."""
    network = truck.network
    scales = Scales(network.mean.numpy(), network.scale.numpy(), network.top_speed)
    return DeepTruck(TruckNetwork(network.shape, scales, network.dt), truck.interface)


def _score(fit: Array, test: Array, fit_truth: Array, test_truth: Array) -> list[float]:
    """Score on the runs of `test`, and the ends of its interval."""
    classes = bool((fit_truth == np.round(fit_truth)).all())
    ridge = RidgeClassifierCV(PENALTIES) if classes else RidgeCV(PENALTIES)
    model = make_pipeline(StandardScaler(), ridge)
    model.fit(fit.reshape(-1, fit.shape[-1]), fit_truth.ravel())
    found = model.predict(test.reshape(-1, test.shape[-1])).reshape(test_truth.shape)
    if classes:
        error, spread = (found != test_truth).mean(axis=1), np.ones(len(test_truth))
    else:
        error = ((found - test_truth) ** 2).mean(axis=1)
        spread = ((test_truth - test_truth.mean()) ** 2).mean(axis=1)
    drawn = np.random.default_rng(0).integers(0, len(error), (DRAWS, len(error)))
    scores = 1.0 - error[drawn].mean(axis=1) / spread[drawn].mean(axis=1)
    return [float(1.0 - error.mean() / spread.mean()), *map(float, np.percentile(scores, TAILS))]
