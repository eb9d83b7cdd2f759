"""Bags and tables in, uniform recordings out."""

from deeptruck_model.recordings.bag_writer import write_bag
from deeptruck_model.recordings.crash_safe import CrashSafeWriter
from deeptruck_model.recordings.extract import read
from deeptruck_model.recordings.recording import Recording
from deeptruck_model.recordings.repair import repair
from deeptruck_model.recordings.splits import data_hash, split

__all__ = ["CrashSafeWriter", "Recording", "data_hash", "read", "repair", "split", "write_bag"]
