"""The simulator's own parameters are off, and no physics is missing."""

from __future__ import annotations

from functools import partial

import numpy as np

from deeptruck_exam.effects.law import Setting, Sizes
from deeptruck_exam.effects.planting import SIGN, Effect, Planted, register

WRONG = {  # (least, most) change over the true value; drives in which it shows; names that say the same
    "mass": ((0.15, 0.40), "suburban hills", "payload_change"),
    "drag_area": ((0.25, 0.60), "highway hills", "rolling_resistance_speed headwind"),
    "rolling_resistance": ((0.35, 0.80), "highway suburban", "grade_bias"),
    "torque_gain": ((0.10, 0.22), "hills highway", "driveline_loss"),
    "brake_gain": ((0.20, 0.45), "suburban descent", ""),
}
SOURCE = "The simulator's own parameter is off; no physics is missing"


def _wrong(name: str, setting: Setting, p: Sizes) -> Planted:
    factor = 1.0 + np.sign(p.sign) * p.share
    return Planted(parameters={name: getattr(setting.truck, name) * factor})


for _name, (_share, _needs, _accepts) in WRONG.items():
    register(
        Effect(
            f"wrong_{_name}",
            _name,
            "parameter_error",
            "first",
            SOURCE,
            {"share": _share, "sign": SIGN},
            partial(_wrong, _name),
            tuple(_needs.split()),
            accepts=tuple(_accepts.split()),
        )
    )
