"""SUMO traffic around the truck: the vehicle ahead in the truck's lane is the leader.

SUMO runs inside the leader's process (libsumo), without a socket or a second clock. The truck is a vehicle of
the scenario whose speed is set at every step; SUMO's checks of its speed and its lane changes are switched
off. SUMO moves it along its route, over lanes and junctions, by the trapezoidal rule that `Gap` uses, and the
traffic reacts to it. Setting its coordinates instead would need the geometry of the lanes.
"""

from __future__ import annotations

import math
import re
import subprocess
import sys
import xml.etree.ElementTree as ET
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any, ClassVar

from deeptruck_core import reading
from deeptruck_core.errors import InputError
from deeptruck_core.terminal import console
from deeptruck_nodes.choice import require

SCENARIOS = Path(__file__).parent / "scenarios"
CURE = "give a .sumocfg, or a scenario that is shipped: {known}"
STEP = 0.1  # s, of SUMO; between its steps the vehicle ahead keeps its speed
SAME_TIME = 1e-6  # s
AHEAD = 500.0  # m; so far a vehicle ahead is looked for, the longest reach of the radar
WARM_UP = 900.0  # s of SUMO's time, within which our truck must have found its place
ALL_CHECKS_OFF, NO_LANE_CHANGES = 32, 0  # SUMO's speed mode and lane-change mode
OPTIONS = (  # what a run needs, whatever the scenario says
    *("--step-length", str(STEP), "--step-method.ballistic", "true", "--random", "false"),
    *("--remote-port", "0", "--xml-validation", "never", "--xml-validation.net", "never"),  # no network
    *("--xml-validation.routes", "never", "--no-step-log", "true", "--duration-log.disable", "true"),
    # a crash is said by us, and SUMO neither removes nor beams a vehicle; all routes are known at the start
    *("--collision.action", "warn", "--collision.mingap-factor", "0", "--time-to-teleport", "-1"),
    *("--route-steps", "0"),
)


class TrafficEnded(Exception):  # noqa: N818 (a run on a finite road ends)
    """The traffic cannot continue around the truck; the message is one line with the reason."""


@dataclass(frozen=True)
class Sumo:
    """A SUMO scenario: the name of a shipped one, or a .sumocfg; its vehicle `truck` is the simulated
    truck."""

    first: ClassVar[str] = "scenario"  # may stand without its name

    scenario: str
    seed: int = 0
    truck: str = "truck"

    def __post_init__(self) -> None:
        require(0 <= self.seed < 2**31, f"leader sumo: seed={self.seed} is outside 0..2147483647")
        cure = CURE.format(known=", ".join(sorted(path.stem for path in SCENARIOS.glob("*.sumocfg"))))
        if self.file.parent == SCENARIOS and not self.file.exists():
            raise InputError(f"leader sumo: there is no scenario '{self.scenario}'; {cure}")
        try:
            root = ET.fromstring(reading.text(self.file, cure)).tag.lower()
        except ET.ParseError as error:
            raise InputError(f"{self.file} is not XML ({error}); {cure}") from None
        if "configuration" not in root:
            raise InputError(f"{self.file} holds <{root}>, not a configuration of SUMO; {cure}")
        if find_spec("libsumo") is None:
            raise InputError(console.MISSING.format(name="libsumo", extra="sumo"))

    @property
    def file(self) -> Path:
        """Path of the configuration; a name without folder or suffix is a shipped scenario."""
        shipped = SCENARIOS / f"{self.scenario}.sumocfg"
        return shipped if re.fullmatch(r"\w+", self.scenario) else Path(self.scenario)

    def try_out(self) -> None:
        """Raises InputError if SUMO refuses the scenario or cannot insert the truck.

        Runs in another process, because a process has only one SUMO, which prints, and some errors end the
        process.
        """
        argv = [sys.executable, "-m", "deeptruck_nodes.traffic", self.scenario, str(self.seed), self.truck]
        done = subprocess.run(argv, capture_output=True, text=True, errors="replace", check=False)
        if done.returncode:
            raise InputError(f"leader sumo:{self.scenario}: {_reason(done.stdout + done.stderr)}")


def _reason(said: str) -> str:
    """SUMO's first error, or its last message if there is none."""
    lines = [" ".join(line.split()) for line in said.splitlines() if line.strip()]
    errors = [line.removeprefix("Error: ") for line in lines if line.startswith("Error: ")]
    return (errors or lines[-1:] or ["SUMO ended without a word"])[0]


class Traffic:
    """Advances SUMO with the truck's samples: `gap` (m) and `leader_speed` (m/s) of the vehicle ahead.

    inf and NaN if there is no vehicle within `AHEAD`. Raises InputError if the scenario has no place for the
    truck, and TrafficEnded from `update`. Equal seeds and samples give equal traffic.
    """

    def __init__(self, scenario: Sumo) -> None:
        import libsumo

        self._sumo: Any = libsumo
        self._failures = (libsumo.TraCIException, libsumo.FatalTraCIError)
        self._truck = scenario.truck
        self.gap, self.leader_speed, self.vehicle = math.inf, math.nan, ""
        try:
            self._sumo.start(["sumo", "-c", str(scenario.file), "--seed", str(scenario.seed), *OPTIONS])
            self._place_truck()
        except self._failures as error:
            raise InputError(" ".join(str(error).split())) from None
        self._steps = 0
        self._time, self._speed = 0.0, float(self._sumo.vehicle.getSpeed(self._truck))  # of the newest sample
        self._stepped_at = self._speed  # the truck's speed at SUMO's last step
        self._see()

    def _place_truck(self) -> None:
        """Simulate the traffic until our truck has departed, and take control of it."""
        self._look_for_truck()
        begin = self._sumo.simulation.getTime()
        while not self._is_on_its_road():
            if self._sumo.simulation.getTime() - begin > WARM_UP:
                raise InputError(
                    f"vehicle '{self._truck}' found no place on its road within {WARM_UP:g} s; "
                    "let it depart earlier, or give it room"
                )
            self._sumo.simulationStep()
        if self._sumo.simulation.getMinExpectedNumber() <= 1:
            raise InputError(
                f"there is no traffic, only '{self._truck}'; add vehicles or flows to its routes"
            )
        self._sumo.vehicle.setSpeedMode(self._truck, ALL_CHECKS_OFF)
        self._sumo.vehicle.setLaneChangeMode(self._truck, NO_LANE_CHANGES)

    def _look_for_truck(self) -> None:
        try:
            self._sumo.vehicle.getTypeID(self._truck)
        except self._sumo.TraCIException:
            raise InputError(
                f"its routes have no vehicle '{self._truck}'; name one so, or say which is ours: truck=ID"
            ) from None

    def _is_on_its_road(self) -> bool:
        return self._truck in self._sumo.vehicle.getIDList()

    def update(self, t: float, speed: float) -> None:
        """Advance to t seconds after the start with the truck's `speed` (m/s); at NaN the last speed
        is kept."""
        speed = max(speed, 0.0) if math.isfinite(speed) else self._speed
        while (due := (self._steps + 1) * STEP) <= t + SAME_TIME:
            share = min((due - self._time) / (t - self._time), 1.0)
            self._step(max(self._speed + share * (speed - self._speed), 0.0))
        self._time, self._speed = t, speed
        self._see()
        since = max(t - self._steps * STEP, 0.0)
        if since > SAME_TIME and self.vehicle:
            self.gap += (self.leader_speed - (self._stepped_at + speed) / 2) * since

    def _step(self, speed: float) -> None:
        self._stepped_at = speed  # never below 0, not even by rounding: SUMO would take the truck back
        self._steps += 1
        try:
            self._sumo.vehicle.setSpeed(self._truck, speed)
            self._sumo.simulationStep()
        except self._failures as error:
            raise self._ended(f"SUMO gave up: {' '.join(str(error).split())}") from None
        self._look_for_an_end(speed)

    def _look_for_an_end(self, speed: float) -> None:
        for crash in self._sumo.simulation.getCollisions():
            if self._truck in (crash.collider, crash.victim):
                raise self._ended(f"{crash.collider} has hit {crash.victim}")
        if not self._is_on_its_road():
            arrived = self._truck in self._sumo.simulation.getArrivedIDList()
            raise self._ended("the truck is at the end of its road" if arrived else "SUMO removed the truck")
        driven = self._sumo.vehicle.getSpeed(self._truck)
        if abs(driven - speed) > SAME_TIME:
            where = self._sumo.vehicle.getLaneID(self._truck)
            raise self._ended(f"the truck cannot go on at {speed:.1f} m/s: lane {where} ends")

    def _ended(self, why: str) -> TrafficEnded:
        return TrafficEnded(f"after {self._steps * STEP:.1f} s {why}; the traffic ends here")

    def _see(self) -> None:
        """The vehicle ahead in our lane, after SUMO's last step. SUMO's gaps exclude our minGap."""
        found = self._sumo.vehicle.getLeader(self._truck, AHEAD)
        self.vehicle = found[0] if found else ""
        if not self.vehicle:
            self.gap, self.leader_speed = math.inf, math.nan
            return
        self.gap = float(found[1]) + float(self._sumo.vehicle.getMinGap(self._truck))
        self.leader_speed = float(self._sumo.vehicle.getSpeed(self.vehicle))

    def close(self) -> None:
        """End SUMO, so that it can be started again in this process."""
        self._sumo.close()


def main() -> None:
    """Try out a scenario, arguments SCENARIO SEED TRUCK; exit code 2 and an explanatory last line if it
    cannot be used."""
    scenario, seed, truck = sys.argv[1:]
    try:
        Traffic(Sumo(scenario, int(seed), truck)).close()
    except InputError as error:
        print(error, file=sys.stderr, flush=True)
        sys.exit(2)


if __name__ == "__main__":
    main()
