"""The stabilisation chart: which poles stay where they are while the model grows."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from shapegcode import _core
from shapegcode.identification.result import ChartPole

_SAME_FREQUENCY = 0.01
_SAME_DAMPING = 0.05


def stabilisation_chart(poles: Sequence[npt.NDArray[np.complex128]], period_s: float) -> tuple[ChartPole, ...]:
    """Poles of models with 1, 2, ... modes, each held against the model one order lower."""
    chart: list[ChartPole] = []
    before: list[tuple[float, float]] = []
    for order, of_model in enumerate(poles, start=1):
        omega, zeta = _core.poles_to_modes(list(of_model), period_s)
        now = list(zip(map(float, omega), map(float, zeta), strict=True))
        for w, z in now:
            near = [(wb, zb) for wb, zb in before if abs(w / wb - 1.0) <= _SAME_FREQUENCY]
            damped_alike = any(abs(z - zb) <= _SAME_DAMPING * zb for _, zb in near)
            chart.append(ChartPole(order, w / (2.0 * np.pi), z, bool(near), damped_alike))
        before = now
    return tuple(chart)
