"""When simulation and recordings differ: locate it, say what is missing, model it, show the fit improve."""

from deeptruck_model.mismatch.corrected_truck import CorrectedTruck, load_directory
from deeptruck_model.mismatch.tool import Mismatch, apply, find_mismatch, write

__all__ = ["CorrectedTruck", "Mismatch", "apply", "find_mismatch", "load_directory", "write"]
