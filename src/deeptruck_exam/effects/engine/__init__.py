"""Torque of the engine, what takes it and what it drives beside the truck."""
