"""Measurements that write docs/results, and the experiments in `paper`."""
