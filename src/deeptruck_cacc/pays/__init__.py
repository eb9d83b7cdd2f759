"""Does correcting the simulator pay? Policies from the old and the corrected simulator, on the true truck."""

from deeptruck_cacc.pays.effects import CASES, Case
from deeptruck_cacc.pays.experiment import RECIPES, Effort, Recipe, pays

__all__ = ["CASES", "RECIPES", "Case", "Effort", "Recipe", "pays"]
