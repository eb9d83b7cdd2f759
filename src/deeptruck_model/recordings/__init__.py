"""Readers and writers of recordings: bags, tables and CAN logs become channels on one uniform clock."""

from typing import TYPE_CHECKING

from deeptruck_core.imports import lazy

if TYPE_CHECKING:
    from deeptruck_model.recordings.bag_writer import write_bag
    from deeptruck_model.recordings.coverage_map import Coverage, coverage
    from deeptruck_model.recordings.crash_safe import CrashSafeWriter
    from deeptruck_model.recordings.extract import read
    from deeptruck_model.recordings.grade import grade_from_elevation
    from deeptruck_model.recordings.importing import Imported, import_table
    from deeptruck_model.recordings.interpolate import Series
    from deeptruck_model.recordings.mcap_repair import repair
    from deeptruck_model.recordings.recording import Recording
    from deeptruck_model.recordings.resample import uniform
    from deeptruck_model.recordings.several import read_all
    from deeptruck_model.recordings.splits import data_hash, split
    from deeptruck_model.recordings.suggestion import Suggestion, suggest
    from deeptruck_model.recordings.tables.suggestion import TableSuggestion, suggest_columns
    from deeptruck_model.recordings.tables.table_writer import check_table, write_table

__all__ = [
    "Coverage",
    "CrashSafeWriter",
    "Imported",
    "Recording",
    "Series",
    "Suggestion",
    "TableSuggestion",
    "check_table",
    "coverage",
    "data_hash",
    "grade_from_elevation",
    "import_table",
    "read",
    "read_all",
    "repair",
    "split",
    "suggest",
    "suggest_columns",
    "uniform",
    "write_bag",
    "write_table",
]

__getattr__ = lazy.names(
    __name__,
    {
        "bag_writer": ("write_bag",),
        "coverage_map": ("Coverage", "coverage"),
        "crash_safe": ("CrashSafeWriter",),
        "extract": ("read",),
        "grade": ("grade_from_elevation",),
        "importing": ("Imported", "import_table"),
        "recording": ("Recording",),
        "mcap_repair": ("repair",),
        "interpolate": ("Series",),
        "resample": ("uniform",),
        "several": ("read_all",),
        "splits": ("data_hash", "split"),
        "suggestion": ("Suggestion", "suggest"),
        "tables.suggestion": ("TableSuggestion", "suggest_columns"),
        "tables.table_writer": ("check_table", "write_table"),
    },
)
