"""What the torque of a capture says of an axis: its friction over its mass."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from shapegcode.characterization.servo.lag import LagFit, delayed
from shapegcode.characterization.servo.record import ServoTrace
from shapegcode.characterization.servo.result import ServoEstimate

__all__ = ["torque_friction"]

FloatArray = npt.NDArray[np.float64]
Masks = Sequence[npt.NDArray[np.bool_]]
_SIGN_SHARE = 5e-4  # of the top speed, within which friction changes its sign
_LEAST_SHARE = 0.5
_AGREE = 1.5


def torque_friction(
    trace: ServoTrace, lag: LagFit, uses: Sequence[Masks], period_s: float
) -> tuple[ServoEstimate, ...]:
    """Friction over mass from the torque, which the models of the position loop do not see.

    The torque is T_c sign(v) + J a + T_v v + T_0, of the command as late as the axis lags; what is told is T_c/J.
    """
    if trace.torque is None:
        return ()
    torque = trace.torque
    late = [delayed(np.gradient(way, period_s), lag.lag_s / period_s) for way in trace.command]
    sign = _SIGN_SHARE * max(float(np.abs(v).max()) for v in late)
    columns = [np.column_stack([np.tanh(v / sign), np.gradient(v, period_s), v, np.ones_like(v)]) for v in late]

    def fit(use: Masks) -> tuple[float, float]:
        """T_c/J, and the share of the torque that T_c explains beyond the rest."""
        basis = np.concatenate([each[keep] for each, keep in zip(columns, use, strict=True)])
        values = np.concatenate([each[keep] for each, keep in zip(torque, use, strict=True)])
        scale = np.linalg.norm(basis, axis=0)
        scale[scale == 0.0] = 1.0
        basis = basis / scale
        weights = np.linalg.lstsq(basis, values, rcond=None)[0]
        others = values - basis[:, 1:] @ np.linalg.lstsq(basis[:, 1:], values, rcond=None)[0]
        power = float(others @ others)
        share = 1.0 - float(np.sum((values - basis @ weights) ** 2)) / power if power > 0.0 else 0.0
        friction, mass = weights[:2] / scale[:2]
        return float(friction / mass) if mass else 0.0, share

    fits = [fit(use) for use in uses]
    low, high = min(value for value, _ in fits), max(value for value, _ in fits)
    value, share = fits[-1]
    name, unit = "friction over mass by torque", f"{trace.unit}/s²"
    if share < _LEAST_SHARE or low <= 0.0:
        why = f"friction explains {100.0 * max(share, 0.0):.0f} % of the torque that acceleration and speed leave"
        return (ServoEstimate(name, None, None, None, unit, why),)
    if high > _AGREE * low:
        return (ServoEstimate(name, None, low, high, unit, "the halves do not agree on it"),)
    return (ServoEstimate(name, value, low, high, unit, "range of three fits"),)
