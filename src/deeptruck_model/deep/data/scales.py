"""How the columns of a drive are scaled for the network; numbers alone, without the library that learns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float32]


@dataclass(frozen=True)
class Scales:
    """Normalisation inside the network: (x - mean) / scale for the columns [u, w, y, taught], each
    (columns,).

    `top_speed` m/s is where the speed code ends.
    """

    mean: FloatArray
    scale: FloatArray
    top_speed: float = 30.0
