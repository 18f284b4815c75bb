"""Types of arrays, by what is in them."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
"""Of doubles, of any shape."""
