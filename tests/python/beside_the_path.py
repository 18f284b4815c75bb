"""A control with limits that its tests hold by differences."""

from typing import Any

import numpy as np

import shapegcode as sg
from shapegcode.io.units import FloatArray

PERIOD_S = 0.001
SPEED, ACCELERATION, JERK = 150.0, 1500.0, 60_000.0
FILTERS: tuple[dict[str, Any], ...] = (
    {},
    {"shaper": sg.Fir([0, 9], [0.55, 0.45])},
    {"smoothing_time_s": 0.008, "shaper": sg.Fir([0, 7, 15], [0.3, 0.4, 0.3])},
)


def control(**changes: Any) -> sg.MotionController:
    limits = {
        "max_feed_mm_per_s": SPEED,
        "max_acceleration_mm_per_s2": ACCELERATION,
        "max_jerk_mm_per_s3": JERK,
        "contour_tolerance_mm": 0.05,
        "window": 32,
        "queue": 64,
    }
    return sg.MotionController(**(limits | changes))


def largest_share(rows: FloatArray) -> float:
    """Of the limits of speed, acceleration and jerk, by differences; at rest at zero before."""
    whole = np.vstack([np.zeros((4, rows.shape[1])), rows])
    limits = (SPEED, ACCELERATION, JERK)
    return max(
        float(np.abs(np.diff(whole, n=order, axis=0)).max()) / PERIOD_S**order / limit
        for order, limit in enumerate(limits, 1)
    )
