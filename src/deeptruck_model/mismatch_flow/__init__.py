"""Find what a simulator leaves out: what was not recorded, a budget, names as deep as the data carry."""

from deeptruck_model.mismatch_flow.find import find_mismatch
from deeptruck_model.mismatch_flow.output import fill, write, write_profiles
from deeptruck_model.mismatch_flow.report.lines import lines
from deeptruck_model.mismatch_flow.result import Result

__all__ = ["Result", "fill", "find_mismatch", "lines", "write", "write_profiles"]
