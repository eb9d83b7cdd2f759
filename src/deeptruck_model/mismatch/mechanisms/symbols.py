"""The signals that formulas are made of, by short names."""

from deeptruck_model.mismatch.expression import Signal, maximum

SPEED, ENGINE, BRAKE = Signal("speed"), Signal("engine"), Signal("brake")
DRAG, ROLLING = Signal("drag"), Signal("rolling")
ELAPSED, DISTANCE, SIMULATED = Signal("elapsed"), Signal("distance"), Signal("simulated")
ENGINE_COMMAND = Signal("engine_command")
ENGINE_SPEED, RATIO, GEAR = Signal("engine_speed"), Signal("ratio"), Signal("gear")
# Turns per metre, but no more than the lowest gear gives: a clutch may slip. Saved borders name it "lever".
OVERALL_RATIO = Signal("lever")
PLACE = Signal("place", missing=-1.0)  # below zero where nobody knows it
PULL = maximum(ENGINE, 0.0)
OMEGA = 150.0  # rad/s, a diesel's working speed
