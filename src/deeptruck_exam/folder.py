"""What `prove` leaves in its folder, in which it works run after run. Standard library only."""

from __future__ import annotations

from pathlib import Path

from deeptruck_model.errors import InputError
from deeptruck_model.files import ELSEWHERE, LEDGER, Result
from deeptruck_model.results import FOUND, TRUCK_FILES

_BAG = ("metadata.yaml", "*_0.mcap", LEDGER)
_FOUND = tuple(f"found/{name}" for name in (*FOUND.names, LEDGER))
_CASE = (
    "case.json", "score.json", ".score.json", "simulator.yaml", "sealed/truth.json", "sealed/drives.npz",
    *(f"recordings/*/{name}" for name in _BAG),
    *(f"found/simulator/base/{name}" for name in (*TRUCK_FILES, LEDGER)),
    *_FOUND,
)  # fmt: skip
_REAL = (
    *(f"{place}/{name}" for place in ("import", "import_*", "recordings/*") for name in _BAG),
    *(f"simulator/{name}" for name in (*TRUCK_FILES, LEDGER)),
    *(f"found/simulator/base/{name}" for name in (*TRUCK_FILES, LEDGER)),
    *_FOUND,
)
CASE = Result("an examined case", _CASE, "choose another folder")
PROOF = Result(
    "a proof",
    (
        "proof.md", "scoreboard.json", ".proof.md", ".scoreboard.json", "*.png", "concealed/concealed.json",
        *(f"cases/*/{name}" for name in _CASE),
        *(f"concealed/*/{name}" for name in _REAL),
    ),
)  # fmt: skip


def check(out: Path) -> None:
    """Whether a proof can be worked on in `out`: a new folder, or one that has cases.

    Raises InputError as `Result.check`, and for a folder without cases: its proof.md may be anybody's.
    """
    PROOF.check(out, overwrite=True)  # nothing is replaced: what is scored there is kept
    if out.is_dir() and any(out.iterdir()) and not (out / "cases").is_dir():
        inside = min(path.name for path in out.iterdir())
        raise InputError(f"{out} holds {inside} and no cases, so it is no proof; {ELSEWHERE}")
