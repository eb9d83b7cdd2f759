"""The numbers that decide the figures of the page beside the paper: unit, meaning, source.

A source in quotation marks is a section of the paper; 'chosen' is ours where the paper says nothing.
"""

from __future__ import annotations

# Training
LOOKS = 60
"""Validations of a training by the paper's recipe; chosen."""
SHORT_UPDATES = 4560
"""Gradient steps of the recipe's variants: 60 passes over 3.4 h; chosen."""
SEEDS = {"paper": 30, "default": 10, "unaided": 10}
"""Deep trucks of `trucksim` by recipe; "Model learning curves" has 30 of its own, the others are chosen."""
FIELD_SEEDS = 10
"""Deep trucks of each field truck by recipe; chosen."""
LOOKS_AT_FEEDBACK = 6
"""Validations from one look at what feedback costs to the next; chosen."""

# Runs of a deep truck
TRANSIENT_S = 2.0
"""s until the initial transient of a field run has decayed; "Results and model validation" gives no time."""
TRANSIENT_OF_SAMPLE_S = 10.0
"""s of the initial transient in the run of 200 s, of which the paper gives no length; chosen."""
SHARE_WITHIN = 0.95
"""Least share of runs that 'is expected to remain within 1.5 m/s' is taken to mean; chosen."""
FIELD_RUNS, FIELD_S = 10, 15.0
"""Simulations of a field truck, and their length in s; "Results and model validation" of the field."""

# Probes
PROBE_FIT_MIN = 120.0
"""Minutes of driving to which a probe is fitted; chosen."""
PROBE_S = 40.0
"""s of a free run of the probes, as long as those of the error statistics; chosen."""
PROBE_AFTER_S = 5.0
"""s of it before the state is read, so that it depends on what was driven and not on its start; chosen."""
PROBE_PAST_S = (0.0, 0.5, 1.0, 2.0, 4.0)
"""s by which the inputs of the probe from past inputs lie back; chosen."""

# Control
DEEP_RUNS, TRUCK_RUNS = 100, 10
"""Runs of DeepEnv-set and TruckSIM-set; "Control validation results"."""
SET_S = 80.0
"""s of such a run: 800 steps of 0.1 s; "Training setup and learning curves"."""
SETTLED_S, STEADY_S = 10.0, 25.0
"""s after which the time gap and the speed are judged; "Control validation results"."""
OVERSHOOT_S = 20.0
"""s in which a speed error may change its side; by then those of the paper's figure are over."""
CLOSING_S, FOLLOWING_S = 40.0, 120.0
"""s of a run of gap closing and of long following; chosen."""
FIELD_SCENES = 10
"""Runs of each; chosen."""
CLOSED_TIME_GAP_S, CLOSED_SPEED = 0.35, 0.2
"""s and m/s within which the gap is closed; "Deep-RL control of full-size trucks"."""
RIPPLE_S = 17.0
"""s at which the leader begins to change its speed; "Deep-RL control of full-size trucks"."""
RIPPLE_PERIOD_S, RIPPLE = 4.0, 0.5
"""s and m/s^2 of its quick changes up and down, of which the paper gives no size; chosen."""
LANE_CHANGE_S = 10.0
"""s from the lane change on that count as its consequence; chosen."""
SCENES_SEED = 1000
"""Seed of the scenes, which no training draws; chosen."""
