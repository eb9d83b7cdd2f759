"""Fuel against comfort and gap: policies and baselines at three follow distances, behind recorded cars.

DEEPTRUCK_REAL_DATA=DATA python benchmarks/bench_energy.py [--work runs/late_commands] [--trucks trucksim]

The policies are those of bench_late_commands.py, one for all follow distances: the time gap that a driver
sets is one of their signals. Without recordings it says so and writes nothing.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from bench_gentle_braking import TRUCKS
from bench_late_commands import TRAINED, learn
from bench_mixed_platoon import all_leaders
from numpy.typing import NDArray

from deeptruck_cacc.controllers.baselines import LAWS, baseline
from deeptruck_cacc.controllers.loading import load_policy
from deeptruck_cacc.controllers.pedals import PedalMap
from deeptruck_cacc.controllers.policy import Policy
from deeptruck_cacc.environments.hard_scenes import recorded
from deeptruck_cacc.environments.rollouts import Trace, roll_out
from deeptruck_cacc.environments.scenes import Scene
from deeptruck_cacc.evaluation import metrics
from deeptruck_cacc.safety.guard import guard
from deeptruck_model import trucks
from deeptruck_model.errors import InputError
from deeptruck_model.simulators import Simulator

TIME_GAPS_S, SETTLED_S = (1.5, 2.0, 3.0), 10.0
TICKS_M = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0)
RESULTS = Path(__file__).parents[1] / "docs" / "results"
COLUMNS = ("fuel (l/100 km)", "rms of the gap error (m)", "99 % (m)", "rms jerk (m/s³)", "crashes")
SAYS = """One truck behind each of {cars} recorded cars, {pieces} pieces of 80 s above 5 m/s on a flat road,
behind guard and shield; figures are after 10 s. Policies were trained on the truck itself, first of three
seeds. Baselines drive over a pedal map measured on the truck. Gap errors are those where the truck
has the power to follow. *Unbeaten* is what no other driver at this distance betters in one of fuel, gap
error and jerk without being worse in another."""


@dataclass(frozen=True)
class Driven:
    """A driver behind all pieces: fuel in l/100 km, gap errors in m, jerk in m/s^3."""

    driver: str
    fuel: float
    gap_rms: float
    gap_p99: float
    jerk_rms: float
    crashes: int

    def beaten_by(self, other: Driven) -> bool:
        """Whether another is better in one of fuel, gap and jerk, and worse in none."""
        own, its = ((d.fuel, d.gap_rms, d.jerk_rms) for d in (self, other))
        return its != own and all(b <= a for a, b in zip(own, its, strict=True))


def main() -> None:
    """Print the tables and write them, with the picture, to docs/results/energy.md."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--work", type=Path, default=Path("runs/late_commands"))
    parser.add_argument("--trucks", nargs="+", default=TRUCKS)
    args = parser.parse_args()
    try:
        leaders = all_leaders()
    except InputError as error:
        print(f"nothing measured: {error}")
        return
    pieces = np.concatenate(list(leaders.values()))
    lines = ["# Fuel against comfort and gap", "", "`python benchmarks/bench_energy.py`", ""]
    lines += [SAYS.format(cars=len(leaders), pieces=len(pieces)), "", "![fuel and gap](energy.png)"]
    found: dict[str, dict[float, list[Driven]]] = {}
    for name in args.trucks:
        truck = trucks.load(name)
        drivers: dict[str, Policy] = {
            f"policy `{s}`": load_policy(learn(truck, name, s, args.work / name / s)[0]) for s in TRAINED
        }
        pedals = PedalMap.calibrate(truck)
        drivers |= {law: baseline(law, truck.interface, pedals, truck.dt) for law in LAWS}
        found[name] = {}
        for gap_s in TIME_GAPS_S:
            scene = recorded(pieces, gap_s)
            reach = metrics.within_reach(scene, pedals, truck.dt)
            found[name][gap_s] = [drive(truck, d, p, scene, reach) for d, p in drivers.items()]
        lines += ["", f"## {name}", *table(found[name])]
    draw(found, RESULTS / "energy.png")
    (RESULTS / "energy.md").write_text("\n".join(lines) + "\n")
    print("\n".join(lines))


def drive(truck: Simulator, driver: str, policy: Policy, scene: Scene, reach: NDArray[np.bool_]) -> Driven:
    """One driver behind all pieces; `reach` (T, batch) is where the truck has the power to follow."""
    trace = roll_out(truck, guard(policy), scene)
    late = slice(round(SETTLED_S / trace.dt), None)
    error = np.abs(trace["time_gap_error"] * np.maximum(trace["speed"], 1.0))[late][reach[late]]
    jerk = trace["jerk"][late]
    return Driven(
        driver,
        litres_per_100_km(trace, late),
        float(np.sqrt(np.mean(error**2))),
        float(np.quantile(error, 0.99)),
        float(np.sqrt(np.mean(jerk**2))),
        int(trace["crash"].any(axis=0).sum()),
    )


def litres_per_100_km(trace: Trace, late: slice) -> float:
    """Fuel over the distance of all pieces together."""
    litres, metres = trace["fuel"][late].sum() * 1e-3, trace["speed"][late].sum()
    return float(1e5 * litres / metres)


def draw(found: dict[str, dict[float, list[Driven]]], path: Path) -> None:
    """Fuel over the gap error, a panel for each truck and a colour for each follow distance."""
    figure, axes = plt.subplots(
        1, len(found), figsize=(4.2 * len(found), 4), layout="constrained", squeeze=False
    )
    for ax, (name, by_gap) in zip(axes[0], found.items(), strict=True):
        for gap_s, colour in zip(TIME_GAPS_S, ("#117733", "#332288", "#aa4499"), strict=True):
            for d in by_gap[gap_s]:
                learned = d.driver.startswith("policy")
                ax.plot(d.gap_rms, d.fuel, "o" if learned else "x", color=colour)
                text = d.driver.removeprefix("policy ").strip("`")
                ax.annotate(text, (d.gap_rms, d.fuel), (4, -2), textcoords="offset points", fontsize=7)
            ax.plot([], [], "o", color=colour, label=f"{gap_s:g} s")
        ax.set(title=name, xscale="log", xlabel="rms of the gap error (m)", ylabel="fuel (l/100 km)")
        ax.minorticks_off()
        ax.set_xticks(TICKS_M, [f"{m:g}" for m in TICKS_M])
        errors = [d.gap_rms for rows in by_gap.values() for d in rows]
        ax.set_xlim(0.8 * min(errors), 1.4 * max(errors))
    axes[0][0].legend(title="follow distance", fontsize=8)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def table(by_gap: dict[float, list[Driven]]) -> list[str]:
    """As COLUMNS has it, for each follow distance."""
    lines = []
    for gap_s, rows in by_gap.items():
        lines += ["", f"At {gap_s:g} s:", "", f"| driver | {' | '.join(COLUMNS)} | unbeaten |"]
        lines += ["|---" * (len(COLUMNS) + 2) + "|"]
        for d in rows:
            best = "" if any(d.beaten_by(other) for other in rows) else "yes"
            lines.append(
                f"| {d.driver} | {d.fuel:.2f} | {d.gap_rms:.2f} | {d.gap_p99:.2f} | {d.jerk_rms:.2f} "
                f"| {d.crashes} | {best} |"
            )
    return lines


if __name__ == "__main__":
    main()
