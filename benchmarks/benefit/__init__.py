"""Does correcting the simulator pay? Policies from the old and the corrected simulator, on the true truck."""

from typing import TYPE_CHECKING, Any

from benchmarks.benefit.plan import EFFECTS, RECIPES, Effort, Recipe, check

if TYPE_CHECKING:
    from benchmarks.benefit.effects import CASES, Case
    from benchmarks.benefit.experiment import pays

__all__ = ["CASES", "EFFECTS", "RECIPES", "Case", "Effort", "Recipe", "check", "pays"]


def __getattr__(name: str) -> Any:
    """What needs a truck, on its first use."""
    if name not in ("CASES", "Case", "pays"):
        raise AttributeError(name)
    from benchmarks.benefit import experiment

    return getattr(experiment, name)
