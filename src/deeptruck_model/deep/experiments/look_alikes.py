"""What a start can tell: the reference truck itself, its hidden state guessed from moments that looked alike.

A run starts from one sample of u, w and y. Gear, boost and brake temperature are hidden in it, and a model
that has learned everything can do no better than weigh all states that have looked like this. On a reference
truck they can be counted: `LookAlikes` keeps the states of a long drive, and starts the exact physics from
each of the nearest.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from deeptruck_model.recordings import Recording
from deeptruck_model.signals import SPEED
from deeptruck_model.simulators import Array, Run
from deeptruck_model.trucks import PhysicsTruck, TruckState

NEAREST = 50
FINENESS = 0.1  # of each signal's standard deviation: what counts as the same


class LookAlikes(PhysicsTruck):
    """The mean of the truck's runs from every state in `drive` that looked like the start.

    Gear, boost and brake temperature are hidden in the sample of u, w and y from which a run starts: no model
    can do better than weigh all states that look like it.
    """

    def __init__(self, truck: PhysicsTruck, drive: Recording) -> None:
        super().__init__(truck.specification, dt=truck.dt)
        self._states = states(truck, drive)
        seen = np.concatenate([drive.u, drive.w, drive.y], axis=1)
        self._unit = np.maximum(FINENESS * seen.std(axis=0), 1e-9)
        self._tree = KDTree(seen / self._unit)

    def rollout(
        self, u: Array, w: Array, y0: Array, recorded: Array | None = None, *, inside: bool = False
    ) -> Run:
        """Free run from y0 (batch, n_y); u (batch, T, n_u), w likewise."""
        start = np.concatenate([u[:, 0], w[:, 0], y0], axis=1) / self._unit
        distance, index = self._tree.query(start, range(1, NEAREST + 1))
        weight = np.exp(-0.5 * (distance**2 - distance[:, :1] ** 2))
        records = self._states[index.ravel()].copy()
        records["speed"] = np.repeat(y0[:, SPEED], NEAREST)
        state, y = TruckState(records), [y0]
        share = (weight / weight.sum(axis=1, keepdims=True))[..., None]
        for k in range(u.shape[1] - 1):
            u_k, w_k = (np.repeat(x[:, k], NEAREST, axis=0) for x in (u, w))
            response = self._respond(state, u_k, w_k)
            y.append((response.reshape(len(y0), NEAREST, -1) * share).sum(axis=1))
        return Run(np.stack(y, axis=1), {})

    def _respond(self, state: TruckState, u: Array, w: Array) -> Array:
        y = np.empty((len(u), len(self.interface.y)))
        self.advance(state, u, np.ascontiguousarray(w[:, 0]), y)
        return y


def states(truck: PhysicsTruck, drive: Recording) -> NDArray[np.void]:
    """The truck's whole state at every sample of a drive from its reset, (n,) of trucks.state.STATE."""
    state = truck.reset(np.array([[0.0, drive.channels["speed"][0]]]))
    kept = np.empty(len(drive), state.records.dtype)
    u, grade = drive.u, np.ascontiguousarray(drive.w[:, 0])
    y = np.empty((1, len(truck.interface.y)))
    for k in range(len(drive)):
        kept[k] = state.records[0]
        truck.advance(state, u[k : k + 1], grade[k : k + 1], y)
    return kept
