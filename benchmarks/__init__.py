"""Measurements that write docs/results."""
