"""Fuel on known roads: planner:SIM?economy compared with other controllers, on the truck itself.

python benchmarks/bench_economy.py [--truck trucksim ...] [--work runs/following] [--seeds 10] [--seed 1000]

The simulator in --work/TRUCK is the deep truck of bench_following.py, the policy one seed trained on it.
Behind a leader of constant speed all drive for the same time; differences in the final position and speed are
charged at the price of a second and of a m/s, at which the leader's speed is optimal on the flat. Recorded
roads are those of two heavy trucks (docs/recordings.md), which are no part of this project: put them under
../shared/data or the folder in DEEPTRUCK_REAL_DATA; without them they are left out. Results are kept in
--work/TRUCK/economy; with --stored the page is made of those alone, and states what was not run.
"""

from __future__ import annotations

import json
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import bench_following
import harness
import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray

from deeptruck_cacc.controllers import policy as policies
from deeptruck_cacc.controllers.baselines import LAWS, Baseline
from deeptruck_cacc.controllers.economy import CRUISE, Economy
from deeptruck_cacc.controllers.loading import load_policy
from deeptruck_cacc.controllers.pedals import PedalMap
from deeptruck_cacc.controllers.planner import Planner
from deeptruck_cacc.controllers.policy import Policy
from deeptruck_cacc.controllers.road_ahead import AHEAD_M, Road
from deeptruck_cacc.environments.rollouts import roll_out
from deeptruck_cacc.environments.scenes import Scene
from deeptruck_cacc.safety import truck_limits
from deeptruck_cacc.safety.guard import guard
from deeptruck_model import simulators, trucks
from deeptruck_model.recordings import import_table
from deeptruck_model.simulators import Simulator

Array = NDArray[np.float64]

LENGTH_M, LEVEL_M, RAMP_M = 10e3, 600.0, 200.0  # level at either end, so that all end alike
SPEED, TIME_GAP = 22.0, 2.0  # m/s (79 km/h), s
FRONTIER = (20.0, 22.0, 24.0)  # m/s, of the leader
STEEP = "steep hills"
ROADS = {  # largest grade; shortest and longest wavelength of both hills, m
    "steep hills": (0.03, 500.0, 2000.0),
    "long hills": (0.02, 1500.0, 4000.0),
    "gentle hills": (0.01, 500.0, 2000.0),
    "flat": (0.0, 500.0, 2000.0),
    "long descent": (-0.03, 0.0, 0.0),
}
MAPS: dict[str, Callable[[Array], Array | None]] = {
    "as it is": lambda grade: grade,
    "slopes 20 % too small": lambda grade: 0.8 * grade,
    "slopes 20 % too large": lambda grade: 1.2 * grade,
    "100 m late": lambda grade: np.roll(grade, round(100.0 / AHEAD_M), axis=1),
    "none": lambda grade: None,
}
LOADED_KG = 36e3
KNOWN = "as it is"
RECORDED = {"roads of veh002": "veh002_all.csv", "roads of veh003": "veh003_all.csv"}
LOGS = harness.DATA / "vt_heavy_truck"
MOTORWAY, STEEPEST = (
    20.0,
    0.04,
)  # m/s, mean of a drive whose road is taken; above it the truck loses the leader
SMOOTH_M = 200.0  # of the recorded heights


def roads(kind: str, seeds: int, seed: int) -> Road:
    """One road for each seed: two sine hills of random wavelength and phase, or a descent of random length,
    with level ends. Of RECORDED the first sections of the log."""
    if kind in RECORDED:
        return recorded(LOGS / RECORDED[kind], seeds)
    limit, short, long = ROADS[kind]
    x = np.arange(0.0, LENGTH_M + 3000.0, AHEAD_M)
    grades = []
    for k in range(seeds):
        rng = np.random.default_rng([seed + k, list(ROADS).index(kind)])
        if kind == "long descent":
            begin, length = rng.uniform(1000.0, 3000.0), rng.uniform(3000.0, 5000.0)
            grade = np.clip(np.minimum(x - begin, begin + length - x) / RAMP_M, 0.0, 1.0)
        else:
            hills = [(share, rng.uniform(short, long), rng.uniform(0.0, 1.0)) for share in (0.65, 0.35)]
            grade = sum(share * np.sin(2 * np.pi * (x / wave + phase)) for share, wave, phase in hills)
        ends = np.clip(np.minimum(x - LEVEL_M, LENGTH_M - 2 * LEVEL_M - x) / RAMP_M, 0.0, 1.0)
        grades.append(limit * grade * ends)
    return Road(np.array(grades))


def recorded(log: Path, most: int) -> Road:
    """The first motorway sections of a log with their recorded heights: as many as fit into LENGTH_M between
    level ends."""
    with tempfile.TemporaryDirectory() as folder:
        columns = harness.ROOT / "layouts" / "columns" / "veh002.yaml"
        drives = import_table(log, columns, Path(folder) / "bag").recordings
    x = np.arange(0.0, LENGTH_M + 3000.0, AHEAD_M)
    inside = (x >= LEVEL_M) & (x < LENGTH_M - 2 * LEVEL_M)
    ends = np.clip(np.minimum(x - LEVEL_M, LENGTH_M - 2 * LEVEL_M - x) / RAMP_M, 0.0, 1.0)
    width, grades = round(SMOOTH_M / AHEAD_M), list[Array]()
    for drive in (d for d in drives if d.channels["speed"].mean() > MOTORWAY):
        way = np.concatenate(([0.0], np.cumsum(drive.channels["speed"][1:]) * drive.dt))
        every = np.interp(np.arange(0.0, way[-1], AHEAD_M), way, np.nan_to_num(drive.channels["grade"]))
        smooth = np.convolve(every, np.full(width, 1.0 / width), mode="same")
        for k in range(0, len(smooth) - inside.sum() + 1, inside.sum()):
            grade = np.zeros(len(x))
            grade[inside] = smooth[k : k + inside.sum()]
            if np.abs(grade).max() <= STEEPEST:
                grades.append(grade * ends)
    return Road(np.array(grades[:most]))


def scene(road: Road, speed: float, known: str, dt: float) -> Scene:
    """A leader of constant speed, and the road as the controller knows it."""
    batch, steps = len(road.grade), round(LENGTH_M / speed / dt)
    ones, still = np.ones(batch), np.zeros((batch, steps))
    given = MAPS[known](road.grade)
    return Scene(
        speed * ones, speed * ones, TIME_GAP * speed * ones, TIME_GAP * ones, still, still,
        road=road, known_road=None if given is None else Road(given),
    )  # fmt: skip


class WholeRoad:
    """A policy that knows the road to its end, for the upper bound of the saving."""

    def __init__(self, policy: Policy, road: Road) -> None:
        self.policy, self.road = policy, road
        self.interface, self.dt = policy.interface, policy.dt

    def reset(self) -> None:
        """Start at the beginning of the road."""
        self.position = np.zeros(len(self.road.grade))
        self.policy.reset()

    def act(self, seen: Any) -> tuple[Array, Array]:
        """The policy's commands."""
        ahead = self.road.ahead(self.position, round(LENGTH_M / AHEAD_M))
        self.position = self.position + seen["speed"] * self.dt
        return self.policy.act({**seen, "grade_ahead": ahead})


class Alone:
    """A policy without a leader, at set speeds (batch,)."""

    def __init__(self, policy: Policy, set_speed: Array) -> None:
        self.policy, self.set_speed, self.reset = policy, set_speed, policy.reset
        self.interface, self.dt = policy.interface, policy.dt

    def act(self, seen: Any) -> tuple[Array, Array]:
        """The policy's commands."""
        nothing = np.full(len(self.set_speed), np.nan)
        return self.policy.act({**seen, "gap": nothing, "leader_speed": nothing, "set_speed": self.set_speed})


class Drivers:
    """The controllers of one truck by name, each made when it is first used."""

    def __init__(self, truck: Simulator, simulator: Simulator, work: Path) -> None:
        self.truck, self.simulator, self._made = truck, simulator, dict[str, Policy]()
        self.work = work

    def __call__(self, name: str, road: Road) -> Policy:
        """The named controller for a road."""
        if name not in self._made:
            self._made[name] = self._make(name)
        made = self._made[name]
        return WholeRoad(made, road) if name == "bound" else made

    def _make(self, name: str) -> Policy:
        if name == "economy":
            return Economy(self.simulator)
        if name == "bound":
            return Economy(self.truck)
        if name == "planner":
            return Planner(self.simulator)
        if name == "policy":
            bench_following.learn(self.work.name, 1, self.work)
            return load_policy(self.work / "policy")
        law = LAWS.get(name, lambda seen: 0.5 * (seen.leader_speed - seen.speed))
        driver: Policy = Baseline(law, PedalMap.calibrate(self.truck), self.truck.interface)
        return driver if self.simulator.interface.grade else Blind(driver)


class Blind(bench_following.Blind):
    """A policy without the grade, behind a guard."""

    def __init__(self, policy: Policy) -> None:
        super().__init__(policy)
        self.interface = policy.interface


EVERYWHERE = ("constant speed", "cacc", "economy")
ON_HILLS = ("acc", "constant speed", "cacc", "mpc", "policy", "planner", "economy", "bound")
OF_TRUCKS = ("steep hills", "long hills")


MEASURED = (  # litres at equal time, share of the way, s, s, m/s^3, share of the time, share
    "litres", "pace", "closest_s", "farthest_s", "jerk", "braking", "shield",
)  # fmt: skip


class Bench:
    """One truck with its controllers, and the figures of each on each road, kept in a folder."""

    def __init__(
        self, name: str, work: Path, seeds: int, seed: int, stored: bool, mass_kg: float | None = None
    ) -> None:
        truck = trucks.load(name)
        truck = truck if mass_kg is None else truck.with_parameters({"mass": mass_kg})
        self.truck = truck if truck.interface.grade else truck.with_grade_input()
        self.label = name if mass_kg is None else f"{name} {mass_kg / 1000:.0f} t"
        self.promise = truck_limits.known(truck.interface)
        self.folder = work / name / "economy"
        self.folder.mkdir(parents=True, exist_ok=True)
        self.simulator = simulators.load(str(work / name / "simulator"))
        self.drive_with = Drivers(self.truck, self.simulator, work / name)
        self.seeds, self.seed, self.stored = seeds, seed, stored
        self.prices = Economy(self.truck).map.prices

    def drive(self, driver: str, road: str, *, known: str = KNOWN, speed: float = SPEED) -> dict[str, Array]:
        """The quantities MEASURED of the drives of all seeds, each (seeds,); NaN if they were not run."""
        key = f"{self.label}_{driver}_{road}_{known}_{speed:g}_{self.seed}_{self.seeds}".replace(" ", "-")
        path = self.folder / f"{key.replace('%', 'percent')}.json"
        if path.exists():
            return {name: np.array(x) for name, x in json.loads(path.read_text()).items()}
        if self.stored:
            return dict.fromkeys(MEASURED, np.full(self.seeds, np.nan))
        made = roads(road, self.seeds, self.seed)
        driven = scene(made, speed, known, self.truck.dt)
        if driver == "cruise":
            trace = roll_out(self.truck, Alone(self.drive_with("economy", made), driven.speed), driven)
        else:
            trace = roll_out(self.truck, guard(self.drive_with(driver, made), self.promise), driven)
        found = self._measured(trace, speed)
        path.write_text(json.dumps({name: x.tolist() for name, x in found.items()}))
        if driver in ("acc", "economy") and road == STEEP and known == KNOWN and speed == SPEED:
            np.savez(self.folder / f"{key}.npz", speed=trace["speed"][:, 0], fuel=trace["fuel"][:, 0])
        return found

    def _measured(self, trace: Any, speed: float) -> dict[str, Array]:
        dt = trace.dt
        late = (speed * len(trace["speed"]) * dt - dt * trace["speed"].sum(axis=0)) / speed  # s
        second, momentum = self.prices(np.array([speed]))
        charged = second * late + momentum * (speed - trace["speed"][-1])
        time_gap = trace["gap"] / trace["speed"]
        braking = trace["brake_command"] > 1e-3
        found = (
            (dt * trace["fuel"].sum(axis=0) + charged) / 1000.0,
            dt * trace["speed"].sum(axis=0) / (speed * len(trace["speed"]) * dt) - 1.0,
            time_gap.min(axis=0),
            time_gap.max(axis=0),
            np.sqrt(np.square(trace["jerk"]).mean(axis=0)),
            braking.mean(axis=0),
            trace["acted"].mean(axis=0),
        )
        return dict(zip(MEASURED, found, strict=True))

    def saved(self, driver: str, road: str, against: str = "acc", **how: Any) -> Array:
        """Fuel saved compared with ACC or another controller at equal time, percent, (seeds,)."""
        speed = {name: x for name, x in how.items() if name == "speed"}
        acc = self.drive(against, road, **speed)["litres"]
        return 100.0 * (1.0 - self.drive(driver, road, **how)["litres"] / acc)


def interval(values: Array) -> str:
    """Mean and its 95 % bootstrap interval over the seeds."""
    if np.isnan(values).any():
        return "not run"
    draws = np.random.default_rng(0).choice(values, (4000, len(values))).mean(axis=1)
    low, high = np.quantile(draws, (0.025, 0.975))
    return f"{values.mean():.1f} ({low:.1f} to {high:.1f})"


def on_every_road(bench: Bench) -> list[str]:
    """Table of the controllers on every road."""
    rows = []
    for road in (*ROADS, *(name for name, log in RECORDED.items() if (LOGS / log).exists())):
        litres = f"{1e5 / LENGTH_M * bench.drive('acc', road)['litres'].mean():.1f}"
        rows.append(" | ".join([road, litres, *(interval(bench.saved(n, road)) for n in EVERYWHERE)]))
    return [*harness.table(f"road | ACC, litres per 100 km | {' | '.join(EVERYWHERE)}", rows), ""]


def on_hills(bench: Bench) -> list[str]:
    """Table of every controller on steep hills: fuel saved, and figures of its driving, the worst or the mean
    over the seeds."""
    rows = []
    for name in ON_HILLS:
        found = bench.drive(name, STEEP)
        if np.isnan(found["litres"]).any():
            continue
        rows.append(
            f"{name} | {interval(bench.saved(name, STEEP))} | {100 * np.abs(found['pace']).max():.2f} | "
            f"{found['closest_s'].min():.2f} | {found['farthest_s'].max():.2f} | "
            f"{found['jerk'].mean():.2f} | {100 * found['braking'].mean():.1f} | "
            f"{100 * found['shield'].mean():.2f}"
        )
    heads = (
        "steep hills | saved (%) | mean speed off the leader's, most (%) | closest (s) | farthest (s) | "
        "jerk, rms (m/s³) | on the brake (%) | shield acts (%)"
    )
    return [*harness.table(heads, rows), ""]


def wrong_maps(bench: Bench) -> list[str]:
    """Table of the economy planner with wrong maps."""
    rows = (f"{known} | {interval(bench.saved('economy', STEEP, known=known))}" for known in MAPS)
    return [*harness.table("map of the road | steep hills, economy (%)", rows), ""]


def trucks_and_loads(benches: list[Bench]) -> list[str]:
    """Table of other trucks, and of a load that the simulator does not know."""
    rows = (
        " | ".join([bench.label, *(interval(bench.saved("economy", road)) for road in OF_TRUCKS)])
        for bench in benches
    )
    return [*harness.table(f"truck, economy (%) | {' | '.join(OF_TRUCKS)}", rows), ""]


def without_a_leader(bench: Bench) -> list[str]:
    """Table of the economy planner at a set speed, compared with constant speed."""
    rows = []
    for road in OF_TRUCKS:
        found = bench.drive("cruise", road)
        saved = interval(bench.saved("cruise", road, "constant speed"))
        rows.append(
            f"{road} | {saved} | {100 * np.abs(found['pace']).max():.2f} | {found['jerk'].mean():.2f}"
        )
    says = (
        f"Without a leader and a shield, at most {CRUISE:g} m/s to either side of a set speed of {SPEED:g} "
        "m/s, and 3 s early or late."
    )
    heads = "road | saved against a constant speed (%) | mean speed off, most (%) | jerk, rms (m/s³)"
    return [says, "", *harness.table(heads, rows), ""]


def frontier(bench: Bench, out: Path) -> list[str]:
    """Fuel against time on steep hills for several speeds of the leader, as a table and a picture."""
    figure, axes = plt.subplots(figsize=(7, 4.2), constrained_layout=True)
    rows = []
    for name in ("acc", "economy"):
        litres = [1e5 / LENGTH_M * bench.drive(name, STEEP, speed=v)["litres"].mean() for v in FRONTIER]
        minutes = [LENGTH_M / v / 60.0 for v in FRONTIER]
        if np.isnan(litres).any():
            continue
        axes.plot(minutes, litres, "o-", label=name)
        rows.append(f"{name} | {' | '.join(f'{x:.1f}' for x in litres)}")
    axes.set(xlabel="minutes for 10 km", ylabel="litres per 100 km", title=f"steep hills, {bench.label}")
    axes.legend()
    axes.grid(alpha=0.3)
    figure.savefig(out / f"{bench.truck.interface.name}_frontier.png", dpi=110)
    plt.close(figure)
    return [
        *harness.table(f"litres per 100 km behind | {' | '.join(f'{v:g} m/s' for v in FRONTIER)}", rows),
        "",
    ]


def over_the_road(bench: Bench, out: Path) -> None:
    """Height, speed and fuel over the first seed's road, as a picture."""
    road = roads(STEEP, bench.seeds, bench.seed)
    figure, axes = plt.subplots(3, sharex=True, figsize=(9, 6.5), constrained_layout=True)
    x = np.arange(0.0, LENGTH_M, AHEAD_M)
    height = AHEAD_M * np.cumsum(road.grade[0, : len(x)])
    axes[0].fill_between(x / 1000, height, height.min() - 2, color="0.8")
    for name in ("acc", "economy"):
        bench.drive(name, STEEP)
        stored = np.load(next(bench.folder.glob(f"{bench.label.replace(' ', '-')}_{name}_steep-hills*.npz")))
        way = np.cumsum(stored["speed"]) * bench.truck.dt
        axes[1].plot(way / 1000, stored["speed"], label=name)
        axes[2].plot(way / 1000, np.cumsum(stored["fuel"]) * bench.truck.dt / 1000, label=name)
    for axis, says in zip(axes, ("height (m)", "speed (m/s)", "fuel used (l)"), strict=True):
        axis.set_ylabel(says)
        axis.grid(alpha=0.3)
    axes[1].legend()
    axes[2].set_xlabel("position (km)")
    figure.savefig(out / f"{bench.truck.interface.name}_hills.png", dpi=110)
    plt.close(figure)


def step_ms(bench: Bench) -> str:
    """CPU time of a step for one truck, ms."""
    driver, seconds = Economy(bench.simulator), []
    road = roads(STEEP, 1, bench.seed)
    seen = {name: np.array([x]) for name, x in policies.TYPICAL.items()}
    for k in range(600):
        seen["grade_ahead"] = road.ahead(np.array([2.2 * k]))
        began = time.process_time()
        driver.act(seen)
        seconds.append(time.process_time() - began)
    p50, p99, most = 1000 * np.quantile(seconds[20:], (0.5, 0.99, 1.0))
    says = f"A step takes {p50:.1f} ms of one core (p50), with a new plan {p99:.1f} ms (p99)"
    return f"{says}, {most:.1f} ms at most."


def main() -> None:
    """Print the tables and write them and the pictures to docs/results/economy.md."""
    args = harness.options(
        __doc__,
        {
            "--truck": ["trucksim", "volvo", "freightliner"],
            "--work": bench_following.WORK,
            "--seeds": 10,
            "--seed": (1000, "of the roads"),
            "--stored": (False, "the page of what was driven alone"),
        },
    )
    for name in args.truck:
        bench_following.learn_simulator(name, args.work / name)
    how = args.work, args.seeds, args.seed, args.stored
    benches = [Bench(name, *how) for name in args.truck]
    first = benches[0]
    loaded = Bench(args.truck[0], *how, LOADED_KG)
    out = harness.RESULTS / "economy"
    out.mkdir(exist_ok=True)
    lines = harness.heading(f"Economy with {first.label}")
    lines += [
        f"Fuel saved against `baseline:acc` in percent at equal time, {args.seeds} roads of 10 km each, "
        f"behind a leader at {SPEED:g} m/s; mean and its 95 % interval (bootstrap).",
        "",
        *on_every_road(first),
        *on_hills(first),
        *wrong_maps(first),
        *trucks_and_loads([*benches, loaded]),
        *without_a_leader(first),
        *frontier(first, out),
        step_ms(first),
    ]
    over_the_road(first, out)
    harness.store("economy", lines)


if __name__ == "__main__":
    main()
