"""Three different trucks in a row behind every recorded car, and behind a V2V that loses leader speeds.

DEEPTRUCK_REAL_DATA=DATA python benchmarks/bench_mixed_platoon.py [--work runs/late_commands]

The policies are those of bench_late_commands.py. Without recordings it says so and writes nothing.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np
from bench_gentle_braking import TRUCKS
from bench_late_commands import learn
from numpy.typing import NDArray

from deeptruck_cacc.controllers.loading import load_policy
from deeptruck_cacc.environments.hard_scenes import RECORDED_CARS, recorded, recorded_leaders
from deeptruck_cacc.environments.rollouts import Trace, roll_out
from deeptruck_cacc.environments.scenes import Scene
from deeptruck_cacc.evaluation.platoon import behind
from deeptruck_cacc.safety.guard import guard
from deeptruck_model import trucks
from deeptruck_model.errors import InputError

Array = NDArray[np.float64]

TIME_GAP_S, SETTLED_S = 2.0, 10.0
STILL = 0.2  # m/s: what varies less is not said to be amplified
LOSSES = {  # share of the packets that are lost, and how many in a row
    "none": (0.0, 1),
    "10 %": (0.1, 1),
    "30 %": (0.3, 1),
    "30 %, 1 s in a row": (0.3, 10),
}
COLUMNS = (
    "amplification, median (worst)",
    "time-gap error, 99 % (worst) (s)",
    "smallest gap (m)",
    "mean jerk (m/s³)",
    "fuel (l/100 km)",
    "shield acts (%)",
    "crashes",
)
SAYS = """{names} in this order, at a time gap of 2 s, behind each of {cars} recorded cars in turn. `human`
are the five of FHWA's string, whose first is driven by hand, `acc` the six of OpenACC. Each drive is a piece
of 80 s above 5 m/s on a flat road, {pieces} in all; pieces with a stop are left out. Figures are of all
pieces, after 10 s. Behind guard and shield drives either the first seed of a policy trained on that truck in
scene `late`, or `baseline:cacc`. Time-gap errors of seconds are cars that pull away faster than a truck can.

*Amplification* is the standard deviation of a truck's speed over that of the vehicle before it. Above 1 a
disturbance grows. Pieces in which the vehicle before varies by less than 0.2 m/s do not count for it.

The speed of the vehicle before comes as packets, ten a second. A lost one leaves the last that came."""


def main() -> None:
    """Print the tables and write them to docs/results/mixed_platoon.md."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--work", type=Path, default=Path("runs/late_commands"))
    parser.add_argument("--seed", type=int, default=1000, help="of the losses")
    args = parser.parse_args()
    try:
        leaders = all_leaders()
    except InputError as error:
        print(f"nothing measured: {error}")
        return
    learned = [
        learn(trucks.load(name), name, "late", args.work / name / "late")[0].as_posix() for name in TRUCKS
    ]
    drivers = {"policy": learned, "baseline:cacc": ["baseline:cacc"] * len(TRUCKS)}
    pieces = np.concatenate(list(leaders.values()))
    says = SAYS.format(names=", ".join(TRUCKS), cars=len(leaders), pieces=len(pieces))
    lines = ["# A mixed platoon behind recorded cars", ""]
    lines += ["`python benchmarks/bench_mixed_platoon.py`", "", says]
    for driver, paths in drivers.items():
        for loss in LOSSES:
            string = drive(paths, pieces, LOSSES[loss], args.seed)
            lines += ["", f"## {driver}, packets lost: {loss}", "", *table(string)]
            if loss == "none":
                lines += ["", *by_leader(string, leaders)]
    out = Path(__file__).parents[1] / "docs" / "results" / "mixed_platoon.md"
    out.write_text("\n".join(lines) + "\n")
    print("\n".join(lines))


def all_leaders() -> dict[str, Array]:
    """Speeds (pieces, T + 1) of every recorded car."""
    return {
        f"{name} {car}": recorded_leaders(name, car=car)
        for name, count in RECORDED_CARS.items()
        for car in range(1, count + 1)
    }


def drive(policies: list[str], speeds: Array, loss: tuple[float, int], seed: int) -> list[Trace]:
    """The traces of TRUCKS, one behind the other. Followers do not act on those before them."""
    scene, traces, rng = recorded(speeds, TIME_GAP_S), [], np.random.default_rng(seed)
    for name, policy in zip(TRUCKS, policies, strict=True):
        truck = trucks.load(name)
        driver = guard(load_policy(policy, truck.interface))
        traces.append(roll_out(truck, driver, with_losses(scene, *loss, truck.dt, rng)))
        scene = behind(scene, traces[-1])
    return traces


def with_losses(scene: Scene, share: float, in_a_row: int, dt: float, rng: np.random.Generator) -> Scene:
    """The leader's speed as it arrives where that share of the packets is lost, so many in a row."""
    pieces = -(-scene.steps // in_a_row)
    lost = np.repeat(rng.random((scene.batch, pieces)) < share, in_a_row, axis=1)[:, : scene.steps]
    lost[:, 0] = False
    last = np.maximum.accumulate(np.where(lost, 0, np.arange(scene.steps)), axis=1)
    change = np.cumsum(scene.leader_acceleration * dt, axis=1)
    speed = scene.leader_speed[:, None] + np.hstack([np.zeros((scene.batch, 1)), change[:, :-1]])
    return replace(scene, seen_speed_offset=np.take_along_axis(speed, last, axis=1) - speed)


def table(string: list[Trace]) -> list[str]:
    """As COLUMNS has it, for each truck."""
    lines = [f"| truck | {' | '.join(COLUMNS)} |", "|---" * (len(COLUMNS) + 1) + "|"]
    for name, trace in zip(TRUCKS, string, strict=True):
        late = slice(round(SETTLED_S / trace.dt), None)
        ratio, error = amplification(trace), np.abs(trace["time_gap_error"][late])
        fuel = 1e5 * (trace["fuel"][late] * 1e-3).sum() / trace["speed"][late].sum()
        cells = [
            f"{np.nanmedian(ratio):.3f} ({np.nanmax(ratio):.3f})",
            f"{np.quantile(error, 0.99):.3f} ({error.max():.3f})",
            f"{trace['gap'].min():.1f}",
            f"{np.abs(trace['jerk'][late]).mean():.2f}",
            f"{fuel:.1f}",
            f"{100 * trace['acted'].mean():.1f}",
            f"{int(trace['crash'].any(axis=0).sum())}",
        ]
        lines.append(f"| {name} | {' | '.join(cells)} |")
    return lines


def by_leader(string: list[Trace], leaders: dict[str, Array]) -> list[str]:
    """The whole string behind each car: how much of its disturbance reaches the last truck."""
    ends = np.cumsum([len(pieces) for pieces in leaders.values()])
    head = "leader | pieces | amplification of each truck, worst | last truck over leader | smallest gap (m)"
    lines = [f"| {head} |", "|---|---|---|---|---|"]
    first, last = spread(string[0]["leader_speed"], string[0].dt), spread(string[-1]["speed"], string[0].dt)
    whole = np.where(first > STILL, last / first, np.nan)
    for (name, speeds), end in zip(leaders.items(), ends, strict=True):
        rows = slice(end - len(speeds), end)
        each = ", ".join(f"{np.nanmax(amplification(trace)[rows]):.2f}" for trace in string)
        gap = min(trace["gap"][:, rows].min() for trace in string)
        lines.append(f"| {name} | {len(speeds)} | {each} | {np.nanmax(whole[rows]):.2f} | {gap:.1f} |")
    return lines


def amplification(trace: Trace) -> Array:
    """Of each piece (batch,), NaN where the vehicle before hardly varies."""
    own, before = spread(trace["speed"], trace.dt), spread(trace["leader_speed"], trace.dt)
    return np.where(before > STILL, own / np.maximum(before, STILL), np.nan)


def spread(speed: Array, dt: float) -> Array:
    """Standard deviation of speeds (T, batch) over time, (batch,)."""
    return np.asarray(speed[round(SETTLED_S / dt) :].std(axis=0))


if __name__ == "__main__":
    main()
