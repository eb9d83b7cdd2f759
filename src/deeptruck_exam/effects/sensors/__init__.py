"""Faults of the measurement: nothing is missing in the truck."""
