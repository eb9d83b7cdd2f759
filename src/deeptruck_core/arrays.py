"""Types of arrays, whose shapes docstrings state: numbers, flags of rows, and indices."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Indices = NDArray[np.intp]
