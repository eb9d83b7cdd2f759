"""Files of a proof folder, in which `prove` continues from run to run. Standard library only."""

from __future__ import annotations

from pathlib import Path

from deeptruck_model._io.results import FOUND, TRUCK_FILES, apart
from deeptruck_model.errors import InputError
from deeptruck_model.files import LEDGER, Result

_BAG = ("metadata.yaml", "*_0.mcap", LEDGER)
_FOUND = tuple(f"found/{name}" for name in (*FOUND.names, LEDGER))
_CASE = (
    LEDGER, "case.json", "score.json", ".score.json", "simulator.yaml", "truth/truth.json",
    "truth/drives.npz",
    *(f"recordings/*/{name}" for name in _BAG),
    *(f"found/{truck}/base/{name}" for truck in ("simulator", "refitted") for name in (*TRUCK_FILES, LEDGER)),
    *_FOUND,
)  # fmt: skip
_REAL = (
    *(f"{place}/{name}" for place in ("import", "import_*", "recordings/*") for name in _BAG),
    *(f"simulator/{name}" for name in (*TRUCK_FILES, LEDGER)),
    *(f"found/{truck}/base/{name}" for truck in ("simulator", "refitted") for name in (*TRUCK_FILES, LEDGER)),
    *_FOUND,
)
_MADE = (
    "line_haul.yaml", "sheet.yaml", "equations.yaml",
    *(f"drives/*/*/{name}" for name in _BAG),
    *(f"{kind}/{name}" for kind in ("learned", "fitted") for name in (*TRUCK_FILES, LEDGER)),
)  # fmt: skip
CASE = Result("an examined case", _CASE, "choose another folder")
PROOF = Result(
    "a proof",
    (
        "proof.md", "scoreboard.json", ".proof.md", ".scoreboard.json", "*.png",
        *(f"cases/*/{name}" for name in _CASE),
    ),
)  # fmt: skip
PLANT = Result(
    "a proof on another's truck",
    (
        "plant.md", "plant.json",
        *(f"{place}/{name}" for place in ("simulators", "blind") for name in _MADE),
        *(f"cases/*/recordings/*/{name}" for name in _BAG),
        *(f"cases/*/{name}.json" for name in ("data_sheet", "learned", "own_equations", "point_mass")),
        *(f"cases/*/found_*/{name}" for name in (*FOUND.names, LEDGER)),
        *(
            f"cases/*/found_*/{truck}/base/{name}"
            for truck in ("simulator", "refitted")
            for name in (*TRUCK_FILES, LEDGER)
        ),
    ),
)  # fmt: skip
REAL = Result(
    "an examination of real logs",
    (
        "real.json", "real.md", "withheld/withheld.json",
        *(f"withheld/*/{name}" for name in _REAL),
        *(f"*/{name}" for name in _REAL),
        "*/drive_*-drive_*.json",
        *(f"*/drive_*-drive_*/{name}" for name in _REAL),
    ),
)  # fmt: skip


def check(out: Path) -> None:
    """Whether a proof can be continued in `out`: a new folder, or one with its ledger.

    Raises InputError as `Result.check` does.
    """
    PROOF.check(out, overwrite=True)  # nothing is replaced: what is scored there is kept


def check_plant(plant: str, out: Path) -> None:
    """Raises InputError for an unknown plant, or if a proof on it cannot be done in `out` (see `check`)."""
    if plant not in ("fastsim", "multi-body"):
        raise InputError(f"--plant: there is no '{plant}'; choose fastsim or multi-body")
    PLANT.check(out, overwrite=True)  # what is scored there is kept


def check_real(data: Path, out: Path) -> None:
    """Raises InputError if there is no folder of real logs, or their examination cannot be done in `out` (see
    `check`)."""
    if not data.is_dir():
        raise InputError(f"--real: there is no folder {data}; docs/recordings.md says where logs are from")
    apart(out, data)
    REAL.check(out, overwrite=True)  # what is judged there is kept
