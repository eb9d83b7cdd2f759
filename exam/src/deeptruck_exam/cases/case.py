"""A case: recordings and a simulator for the tool, and the truth for the scorer alone."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from deeptruck_core.arrays import Array
from deeptruck_core.errors import InputError
from deeptruck_core.signals import TruckInterface
from deeptruck_exam import worlds
from deeptruck_exam.cases.absorption import absorb
from deeptruck_exam.cases.build import DT, Built, build, build_case
from deeptruck_exam.cases.levels import FELT, NOT_RECORDED, SLOPE_OR_WIND
from deeptruck_exam.cases.plan import MINUTES, Plan, draw_plan
from deeptruck_exam.cases.truth import describe
from deeptruck_exam.folder import CASE
from deeptruck_exam.laws.law import GRAVITY
from deeptruck_exam.laws.series import ou_series
from deeptruck_exam.worlds import trucks
from deeptruck_exam.worlds.sensors import Sensors, quantise
from deeptruck_model.recordings import Recording, write_bag
from deeptruck_model.trucks.accelerometer import Accelerometer


@dataclass(frozen=True)
class Case:
    """Folder of a case, and the tool's arguments for it. `environment` is added to the tool's."""

    folder: Path
    simulator: str
    fit: tuple[str, ...]
    held_out: tuple[str, ...]
    environment: dict[str, str]
    sha256: str

    def paths(self, names: tuple[str, ...]) -> list[Path]:
        return [self.folder / "recordings" / name for name in names]

    @staticmethod
    def read(folder: Path) -> Case:
        """The case in a folder. Raises InputError if there is none."""
        try:
            data = json.loads((folder / "case.json").read_text())
        except (OSError, json.JSONDecodeError) as error:
            raise InputError(f"{folder} holds no case ({error}); make one with make_case") from None
        return Case(
            folder,
            data["simulator"],
            tuple(data["fit"]),
            tuple(data["held_out"]),
            data["environment"],
            data["sha256"],
        )


def make_case(
    out: Path,
    level: str,
    seed: int,
    effect: str | None = None,
    simulator: str = "physics",
    minutes: float = MINUTES,
) -> Case:
    """Write one case into the new folder `out`: six recordings to fit and two held out, the simulator, and
    the withheld truth. Equal arguments give the same case. Raises InputError for an unknown level or effect.
    """
    if out.exists():
        raise InputError(f"{out} exists already; choose another folder or remove it")
    built = build_case(level, seed, effect, simulator, minutes)
    plan = built.plan
    interface = interface_of(plan)
    measured = measure(built)
    names = tuple(f"drive_{k}" for k in range(len(measured)))
    recordings = [
        Recording(name, DT, channels, interface) for name, channels in zip(names, measured, strict=True)
    ]
    out.mkdir(parents=True)
    CASE.mark(out, at_work=True)
    for recording in recordings:
        write_bag(out / "recordings" / recording.name, [recording], interface=interface)
    simulator_values = plan.simulator_values
    if level == "absorbed":
        simulator_values = absorb(plan, recordings[: plan.fit])
    spec = _simulator(out, plan, simulator_values)
    truth = describe(built, names, simulator_values)
    (out / "truth").mkdir()
    np.savez_compressed(out / "truth" / "drives.npz", extra=built.extra, grade=built.drives.channels["grade"])
    return _written(out, plan, spec, names, truth)


def further_drives(truth: Mapping[str, Any]) -> list[Recording]:
    """As many further drives of the truck of a case, unseen by the tool: other roads and speeds, the same
    effects, sizes and sensors."""
    keys = [e["key"] for e in truth["effects"]]
    plan = draw_plan(
        truth["level"],
        truth["seed"],
        keys[0] if len(keys) == 1 else None,
        truth["simulator"],
        truth["minutes"],
        truth["attempt"],
    )
    built = build(replace(plan, further=1))
    interface = interface_of(plan)
    return [Recording(f"further_{k}", DT, channels, interface) for k, channels in enumerate(measure(built))]


def measure(built: Built) -> list[dict[str, Array]]:
    """The sensor signals of each drive: channels (n,), with faults and decoys."""
    plan, rng = built.plan, built.plan.rng(5)
    sensors = Sensors.draw(worlds.values()["sensors"], rng)
    out = []
    decoy = draw_decoy(built) if plan.level == "decoy" else {}
    bias = Accelerometer.BIAS * plan.rng(7).standard_normal()
    for k in range(len(plan.drives)):
        true = {name: values[k] for name, values in built.drives.channels.items()}
        true["elevation"] = true["elevation"] + 120.0
        if plan.level == FELT:
            gravity = GRAVITY * np.sin(np.arctan(true["grade"]))
            true["specific_force"] = (1.0 + Accelerometer.PITCH) * true["acceleration"] + gravity + bias
        channels = sensors.record(true, built.truck, DT, rng)
        if plan.level in SLOPE_OR_WIND:  # dv/dt is what a log of speed gives
            rate = np.diff(channels["speed"], prepend=channels["speed"][:1]) / DT
            channels["acceleration"] = rate
        warm = built.truck.ambient_temperature + ou_series(rng, (1, len(true["speed"])), DT, 200.0)[0] * 0.2
        channels["ambient_temperature"] = quantise(warm, 1.0 / 32.0)
        if np.isfinite(built.leader_m[k]).all():
            channels.update(_radar(built, k, rng))
        channels.update({name: values[k] for name, values in decoy.items()})
        for fault in built.faults.faults:
            fault(channels, DT, rng)
        hidden = NOT_RECORDED[plan.hidden_input][0] if plan.hidden_input else ()
        slopeless = () if plan.grade else ("grade", "elevation")
        for name in {*plan.withheld, *built.faults.withheld, *hidden, *slopeless}:
            channels.pop(name, None)
        out.append(channels)
    return out


def _radar(built: Built, k: int, rng: np.random.Generator) -> dict[str, Array]:
    gap = built.leader_m[k] - built.drives.channels["distance"][k]
    speed = np.gradient(built.leader_m[k], DT)
    n = len(gap)
    return {
        "gap": np.clip(gap + 0.25 * rng.standard_normal(n), 0.0, 499.0),
        "leader_speed": np.maximum(speed + 0.08 * rng.standard_normal(n), 0.0),
    }


def draw_decoy(built: Built) -> dict[str, Array]:
    """A channel (batch, n) that has no influence but a trend similar to the effect's, with a correlation of
    about 0.9."""
    rng = built.plan.rng(6)
    width = round(20.0 / DT)
    smooth = np.stack([np.convolve(row, np.ones(width) / width, mode="same") for row in built.extra])
    shape = (smooth - smooth.mean()) / max(float(smooth.std()), 1e-9)
    shape = rng.choice([-1.0, 1.0]) * shape + 0.45 * ou_series(rng, shape.shape, DT, 15.0)
    if rng.random() < 0.5 or np.isfinite(built.leader_m).any():
        return {"ambient_temperature": quantise(built.truck.ambient_temperature + 1.5 * shape, 1.0 / 32.0)}
    gap = 55.0 + 11.0 * shape
    speed = built.drives.channels["speed"] + np.gradient(gap, DT, axis=1)
    return {"gap": np.clip(gap, 5.0, 250.0), "leader_speed": np.clip(speed, 0.0, 40.0)}


def interface_of(plan: Plan) -> TruckInterface:
    interface = trucks.make(plan.truck, plan.values, grade=plan.grade).interface
    return replace(interface, brake_unit=None) if plan.hidden_input == "brake" else interface


def _simulator(out: Path, plan: Plan, simulator_values: dict[str, float]) -> str:
    if plan.simulator == "deep":
        from deeptruck_exam.cases.deep_trucks import trained

        return str(trained(plan))
    path = out / "simulator.yaml"
    path.write_text(yaml.safe_dump(trucks.overrides(simulator_values, plan.grade)))
    return f"truck:{plan.truck}:{path}"


def _written(out: Path, plan: Plan, simulator: str, names: tuple[str, ...], truth: dict[str, Any]) -> Case:
    text = json.dumps(truth, indent=1)
    digest = hashlib.sha256(text.encode()).hexdigest()
    (out / "truth" / "truth.json").write_text(text)
    environment = {"DEEPTRUCK_MISMATCH_EXCLUDE": ",".join(plan.excluded)} if plan.excluded else {}
    case = Case(out, simulator, names[: plan.fit], names[plan.fit :], environment, digest)
    data = {
        "simulator": case.simulator,
        "fit": case.fit,
        "held_out": case.held_out,
        "environment": case.environment,
        "sha256": digest,
    }
    (out / "case.json").write_text(json.dumps(data, indent=1))
    return case


def open_truth(case: Case) -> dict[str, Any]:
    """The truth of a case. Raises InputError if it differs from what was written."""
    text = (case.folder / "truth" / "truth.json").read_text()
    if hashlib.sha256(text.encode()).hexdigest() != case.sha256:
        raise InputError(f"the truth of {case.folder} is not the one that was written")
    truth: dict[str, Any] = json.loads(text)
    return truth
