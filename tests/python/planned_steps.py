"""Steps of a control beside a thread that plans, in one."""

import numpy as np
import numpy.typing as npt

import shapegcode as sg


def planned_steps(made: sg.MotionController, periods: int, *, plans: bool) -> npt.NDArray[np.float64]:
    """So many set-points, (periods, n_axes); `plans`: it does not plan for itself."""
    rows = []
    for _ in range(periods):
        if plans:
            made.plan()
        rows.append(made.step())
    return np.concatenate(rows)
