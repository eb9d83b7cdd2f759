"""Three simulators of a plant, as its user would have them: from its data sheet, learned, and its own
equations. Each is made by the commands of the tool, once for all cases.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import yaml

from deeptruck_core.errors import InputError
from deeptruck_exam.plants import fastsim_truck as plant
from deeptruck_exam.plants.cases import CONCEALED, drives, written
from deeptruck_exam.tool import CONSOLE_SCRIPT
from deeptruck_model.simulators import MANIFEST

OWN, LEARNED, DATA_SHEET = SIMULATORS = ("own equations", "learned", "data sheet")
EQUATIONS = "python:deeptruck_exam.plants.fastsim_equations:make"
SEEDS = (900_000, 900_001, 900_002)  # of the drives that simulators are made of
TORQUE = 2300.0  # N m: its power over the engine speed at which the reference truck's torque is largest
FULL_BRAKING = 6.0  # m/s^2; UN Regulation 13 asks for 5.0 of a heavy truck
UPDATES = 0  # as many as training chooses


def make(folder: Path, *, grade: bool = True, updates: int = UPDATES) -> dict[str, str]:
    """The `--simulator` argument of each of SIMULATORS, made in `folder` if missing; all from drives with or
    without `grade`. Raises InputError if a command fails."""
    folder.mkdir(parents=True, exist_ok=True)
    shown = CONCEALED["nothing" if grade else "slope"]
    bags, geared = (
        [p for s in SEEDS for p in written(drives(shown, s, geared=name == "geared"), folder / name / str(s))]
        for name in ("drives", "geared")
    )
    each = [part for path in geared for part in ("--recordings", str(path))]
    learned, fitted, truck, equations = (
        folder / name for name in ("learned", "fitted", "line_haul.yaml", "equations.yaml")
    )
    if not (learned / MANIFEST).exists():
        command("train", *map(str, bags), "--out", str(learned), "--resume", "--budget", str(updates))
    if not truck.exists():
        _data_sheet(folder / "sheet.yaml")
        command("new", str(truck), "--from", str(folder / "sheet.yaml"), *each)
    equations.write_text(yaml.safe_dump({"grade": grade}))
    follows = f"truck:{truck}?gear=recorded"
    sheet = str(fitted) if grade else follows  # a fit without slopes is worse, and writes nothing
    if grade and not (fitted / MANIFEST).exists():
        command("calibrate-truck", follows, *each, "--out", str(fitted))
    return {DATA_SHEET: sheet, LEARNED: str(learned), OWN: f"{EQUATIONS}:{equations}"}


def _data_sheet(path: Path) -> None:
    s = plant.sheet()
    data = {
        "mass_kg": s["mass"],
        "gear_ratios": list(plant.GEARS),
        "axle_ratio": plant.AXLE,
        "tyres": s["wheel_radius"],
        "rated_torque_nm": TORQUE,
        "frontal_area_m2": s["frontal_area"],
        "full_braking_m_s2": FULL_BRAKING,
    }
    path.write_text(yaml.safe_dump(data))


def command(*arguments: str) -> None:
    """Run a command of the tool, with one thread. Raises InputError with its last line if it fails."""
    print(f"deeptruck-model {arguments[0]}", flush=True)
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    line: Sequence[str] = (sys.executable, "-c", CONSOLE_SCRIPT, *arguments)
    done = subprocess.run(line, check=False, env=environment, capture_output=True, text=True)
    if done.returncode:
        raise InputError(f"deeptruck-model {arguments[0]}: {(done.stdout + done.stderr).strip()[-300:]}")
