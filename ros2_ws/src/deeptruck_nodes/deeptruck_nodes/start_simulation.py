"""Start command: drives a simulated truck behind a leader, with one process each for truck, leader,
controller and recorder.
"""

from __future__ import annotations

import deeptruck_core.terminal.script_start  # noqa: F401 - Ctrl-C during the imports that follow

# isort: split
from typing import Annotated

import typer

from deeptruck_nodes import options, runs
from deeptruck_nodes.parameters import Sections

EXAMPLES = """
Examples:\n
  deeptruck-simulation --simulator truck:trucksim --policy baseline:acc --record drive\n
  deeptruck-simulation --simulator SIM --policy POLICY --record drive --lockstep --duration 600
  --leader sine:speed=18,amplitude=2,period=20 --road sine:grade=0.03,length=2000 --radar field\n
Leaders: constant:speed=V, sine:speed=V,amplitude=A,period=T, steps:speeds=A/B/C,every=T,acceleration=A,
stop:speed=V,at=T,deceleration=A,wait=T, random:low=V,high=V,acceleration=A,seed=N, recorded:path=CSV_OR_BAG\n
Roads: flat, constant:grade=G, sine:grade=G,length=L, random:grade=G,length=L,seed=N, table:path=CSV\n
Every parameter of every node: docs/parameters.md.
"""


def main(
    simulator: Annotated[
        str,
        typer.Option(
            help="Simulator directory, truck:NAME[:overrides.yaml], truck:FILE.yaml, "
            "python:MODULE:FACTORY or fmu:MODEL.fmu."
        ),
    ],
    policy: options.Policy,
    record: options.Record = None,
    overwrite: options.Overwrite = False,
    leader: Annotated[
        str, typer.Option(help="What the vehicle ahead does, see below.")
    ] = "constant:speed=20",
    radar: Annotated[
        options.Errors,
        typer.Option(
            help="clean: no errors; noisy: noise of 0.1 m and 0.05 m/s (1 sd), 0.05 dropouts a second; "
            "field: these, and the lane-change jump of the paper's field run at 63 s."
        ),
    ] = "noisy",
    radar_lost_at: options.RadarLostAt = 0.0,
    radar_lost_for: options.RadarLostFor = 2.0,
    road: Annotated[str, typer.Option(help="The grade ahead, see below.")] = "flat",
    initial_speed: Annotated[float, typer.Option(help="Of the truck, m/s.")] = 20.0,
    initial_gap: options.InitialGap = 0.0,
    time_gap: options.TimeGap = 2.0,
    duration: Annotated[float, typer.Option(help="Simulated time, s; 0: until Ctrl-C.")] = 0.0,
    lockstep: Annotated[bool, typer.Option("--lockstep", help="As fast as it goes, repeatable.")] = False,
    rate: Annotated[float, typer.Option(help="Publishing rate in real time, Hz.")] = 10.0,
    seed: Annotated[int, typer.Option(help="Seed of the radar's noise.")] = 0,
    page: options.Page = False,
    parameters: options.Parameters = None,
    run_folders: options.RunFolders = options.RUNS,
) -> None:
    """Drive a simulated truck behind a leader, in real time or lock-step. Ctrl-C ends everything in order."""
    given: Sections = {
        "leader": {
            "profile": leader,
            "initial_gap": initial_gap,
            "seed": seed,
            **runs.RADARS[radar],
            "lost_at_s": radar_lost_at,
            "lost_for_s": radar_lost_for,
        },
        "controller": {"target_time_gap": time_gap},
        "truck_sim": {"rate_hz": rate, "initial_speed": initial_speed, "road": road, "duration_s": duration},
    }
    common = runs.Common(record, overwrite, parameters, run_folders, page)
    raise typer.Exit(runs.simulate(common, given, policy=policy, simulator=simulator, lockstep=lockstep))


def start(program: str = "deeptruck-simulation") -> None:
    """The console script; that of the ROS 2 workspace gives its own name as `program`."""
    options.start(main, EXAMPLES, program)
