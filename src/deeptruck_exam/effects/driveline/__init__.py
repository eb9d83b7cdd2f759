"""Clutch, gears, shafts, axles; second drives."""
