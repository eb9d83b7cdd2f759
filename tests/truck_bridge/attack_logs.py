"""Public recordings of attacks on a research truck's bus, through the checks of the safety core.

`python tests/truck_bridge/attack_logs.py FOLDER`: the logs of github.com/SystemsCyber/J1939_Attack_Datasets
(Chatterjee et al., NDSS 2023), which have no licence and are not part of this project.
"""

from __future__ import annotations

import sys
from pathlib import Path

from truck_bridge import vehicles
from truck_bridge.can_logs.checking import check

TRUCK = Path(__file__).with_name("research_truck.yaml")


def main() -> int:
    """A table: how long control could have been held, and why it would have been lost."""
    vehicle = vehicles.load(TRUCK)
    print(f"{'log':<30}{'frames':>8}{'log':>8}{'engaged':>9}  lost, or never given because")
    logs = (path for path in Path(sys.argv[1]).rglob("*") if path.suffix in (".log", ".txt"))
    for path in sorted(logs):
        found = check(path, vehicle)
        why = ", ".join(f"{name} at {found.lost_s[name][0]:.1f} s" for name in found.losses)
        if not found.engaged_s:
            why = f"never: {', '.join(name for name, _ in found.obstacles.most_common(3))}"
        print(
            f"{path.stem:<30}{found.frames:>8}{found.seconds:>6.0f} s{found.engaged_s:>7.1f} s  {why or '-'}"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
