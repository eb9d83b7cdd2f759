"""Records the inputs of a truck's forces along a simulated drive, so that many laws can be evaluated
at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from deeptruck_exam.cases.build import Built
from deeptruck_exam.cases.gates import Open
from deeptruck_exam.laws.law import STEP_S, Array, Setting
from deeptruck_exam.worlds.drive import Drives
from deeptruck_model.trucks import Force, PhysicsTruck, View

SUBSTEPS = 10  # of the truck between two views; a law is asked in each, as at 0.1 s fast parts would swing up


class _Recorder:
    """A zero force that records the state at which forces are evaluated."""

    def __init__(self) -> None:
        self.seen: list[dict[str, Any]] = []
        self.calls = 0

    def reset(self, batch: int) -> None:
        self.seen, self.calls = [], 0

    def __deepcopy__(self, memo: object) -> _Recorder:
        return self

    def force(self, view: View, dt: float) -> Array:
        if self.calls % SUBSTEPS == 0:
            self.seen.append({name: copy(getattr(view, name)) for name in View.__annotations__})
        self.calls += 1
        return np.zeros_like(view.speed)


@dataclass(frozen=True)
class Trace:
    """Views of a batch of drives, one every 0.1 s; `setting` is that of the batch."""

    views: tuple[Any, ...]  # as View has them
    setting: Setting

    @staticmethod
    def of(truck: PhysicsTruck, drives: Drives, setting: Setting) -> Trace:
        """The views of the forces of `truck` along the drives."""
        recorder = _Recorder()
        truck.with_forces([recorder]).rollout(drives.u, drives.w, drives.y[:, 0], drives.y, inside=False)
        return Trace(tuple(SimpleNamespace(**seen) for seen in recorder.seen), setting)

    def repeated(self, times: int) -> Trace:
        """The same drives repeated, one set after the other."""

        def tiled(x: Any) -> Any:
            return np.concatenate([x] * times) if isinstance(x, np.ndarray) else x

        views = tuple(SimpleNamespace(**{n: tiled(x) for n, x in vars(v).items()}) for v in self.views)
        places = ("start_m", "direction", "route", "leader_m")
        more = {name: tiled(getattr(self.setting, name)) for name in places}
        return Trace(views, replace(self.setting, batch=self.setting.batch * times, **more))

    def acceleration(self, forces: Sequence[Force], openings: Sequence[Open] = ()) -> Array:
        """Acceleration by the forces, (1 + openings, batch, n) m/s^2: unweighted, then weighted by each
        opening."""
        for force in forces:
            force.reset(self.setting.batch)
        out = np.zeros((1 + len(openings), len(self.views), self.setting.batch))
        for k, view in enumerate(self.views):
            asked = [force.force(view, STEP_S) for _ in range(SUBSTEPS) for force in forces]
            out[0, k] = sum(asked, start=np.zeros(())) / SUBSTEPS / view.effective_mass
            for row, opening in enumerate(openings, 1):
                out[row, k] = out[0, k] * opening(view)
        return np.moveaxis(out, 1, 2)


def setting_of(built: Built) -> Setting:
    """The setting of a driven world, with what laws may know of it."""
    drives = built.drives
    return Setting(
        built.truck,
        len(drives.u),
        drives.u.shape[1] * drives.dt,
        drives.dt,
        built.plan.effect_seed,
        built.roads.start_m,
        built.roads.direction,
        built.roads.route,
        built.leader_m,
    )
