"""Bags and tables in, uniform recordings out."""

from deeptruck_model.recordings.bag_writer import write_bag
from deeptruck_model.recordings.coverage_map import Coverage, coverage
from deeptruck_model.recordings.crash_safe import CrashSafeWriter
from deeptruck_model.recordings.extract import read
from deeptruck_model.recordings.grade import grade_from_elevation
from deeptruck_model.recordings.importing import Imported, import_table
from deeptruck_model.recordings.recording import Recording
from deeptruck_model.recordings.reindex import repair
from deeptruck_model.recordings.resample import Series, uniform
from deeptruck_model.recordings.splits import data_hash, split

__all__ = [
    "Coverage",
    "CrashSafeWriter",
    "Imported",
    "Recording",
    "Series",
    "coverage",
    "data_hash",
    "grade_from_elevation",
    "import_table",
    "read",
    "repair",
    "split",
    "uniform",
    "write_bag",
]
