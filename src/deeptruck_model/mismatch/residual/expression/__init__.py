"""Formulas that can be evaluated over stacked recordings, and step by step inside a simulator.

An Expression is a small tree over named signals. `rows(e)` evaluates it over an Evidence, (n,). `Stream`
evaluates several in batches along a simulation; nodes with memory store their state there.
"""

from deeptruck_model.mismatch.residual.expression.memory import (
    Change,
    Integral,
    Lag,
    Play,
    RisingLag,
    Since,
    Slosh,
    Stream,
)
from deeptruck_model.mismatch.residual.expression.nodes import (
    Apply,
    AtPlace,
    Constant,
    Expression,
    InRecording,
    Interpolated,
    Knot,
    Leaf,
    Rerun,
    Signal,
    Tent,
    absolute,
    exp,
    lift,
    maximum,
    minimum,
    rows_of,
    tanh,
)

__all__ = [
    "Apply", "AtPlace", "Change", "Constant", "Expression", "InRecording", "Integral", "Interpolated",
    "Knot", "Lag", "Leaf", "Play", "Rerun", "RisingLag", "Signal", "Since", "Slosh", "Stream", "Tent",
    "absolute", "exp", "lift", "maximum", "minimum", "rows_of", "tanh",
]  # fmt: skip
