"""Intervals of the fitted servo lag: curvature of the sum of squares, for errors that hang together over time."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from shapegcode.characterization.servo.lag import LagFit, delayed, lag_way
from shapegcode.characterization.servo.record import ServoTrace
from shapegcode.characterization.servo.result import ServoEstimate

__all__ = ["lag_intervals"]

FloatArray = npt.NDArray[np.float64]
_SIGMAS = 1.96
_WIDEST = 0.5
_EFFECTIVE = "of a first-order loop that lags alike; the control's setting may be another"


def lag_intervals(
    fit: LagFit, halves: Sequence[LagFit], trace: ServoTrace, use: Sequence[npt.NDArray[np.bool_]], period_s: float
) -> tuple[ServoEstimate, ...]:
    """Parameters of a servo lag behind a dead time, with 95 % intervals.

    The interval is that of least squares with as many independent samples as the autocorrelation of what is left
    allows, and never narrower than what the fits to the halves differ by.
    """

    def model(values: FloatArray) -> FloatArray:
        out = []
        for way, keep in zip(trace.command, use, strict=True):
            late = delayed(way, values[0] / period_s)
            out.append(
                (way - late + values[2] * lag_way(way, values[1], period_s, values[0] / period_s) + values[3])[keep]
            )
        return np.concatenate(out)

    values = np.array([fit.dead_s, fit.gain_per_s, fit.rest, fit.offset])
    steps = np.array([1e-6, 1e-3 * fit.gain_per_s, 1e-4, 1e-6])
    jacobian = np.column_stack([
        (model(values + step * unit) - model(values - step * unit)) / (2.0 * step)
        for step, unit in zip(steps, np.eye(4), strict=True)
    ])  # fmt: skip
    left = [
        (r - x - e)[keep] for r, x, e, keep in zip(trace.command, trace.actual, fit.error, use, strict=True)
    ]  # fmt: skip
    scale = np.linalg.norm(jacobian, axis=0)
    scale[scale == 0.0] = 1.0  # of a gain that nothing depends on
    inverse = np.linalg.pinv((jacobian / scale).T @ (jacobian / scale), rcond=1e-12) / np.outer(scale, scale)
    covariance = inverse * _variance(left) * _together(left)

    def half(gradient: Sequence[float], take: Sequence[float]) -> float:
        slope = np.asarray(gradient)
        formal = _SIGMAS * math.sqrt(max(float(slope @ covariance @ slope), 0.0))
        return max(formal, (max(take) - min(take)) / 2.0)

    gain, rest = fit.gain_per_s, fit.rest
    lag = half([1.0, -rest / gain**2, 1.0 / gain, 0.0], [each.lag_s for each in halves])
    dead = half([1.0, 0.0, 0.0, 0.0], [each.dead_s for each in halves])
    gains = half([0.0, 1.0, 0.0, 0.0], [each.gain_per_s for each in halves])
    forward = half([0.0, 0.0, 1.0, 0.0], [each.rest for each in halves])
    known = gains < _WIDEST * gain and forward < rest
    why = "" if known else "the feed-forward leaves no lag that tells it"
    return (
        ServoEstimate("lag at constant speed", fit.lag_s, fit.lag_s - lag, fit.lag_s + lag, "s"),
        ServoEstimate("dead time", fit.dead_s, max(0.0, fit.dead_s - dead), fit.dead_s + dead, "s"),
        ServoEstimate(
            "position gain",
            gain if known else None,
            gain - gains if known else None,
            gain + gains if known else None,
            "1/s",
            why or _EFFECTIVE,
        ),
        ServoEstimate(
            "feed-forward",
            1.0 - rest if known else None,
            max(0.0, 1.0 - rest - forward),
            min(1.0, 1.0 - rest + forward),
            "1",
            why,
        ),
    )


def _variance(left: Sequence[FloatArray]) -> float:
    return float(np.mean(np.concatenate(left) ** 2))


def _together(left: Sequence[FloatArray]) -> float:
    """Over how many samples what is left hangs together: 1 + 2 Σ ρ, up to where ρ first falls below zero."""
    whole = np.concatenate(left)
    whole = whole - whole.mean()
    size = 1 << (2 * len(whole) - 1).bit_length()
    power = np.abs(np.fft.rfft(whole, size)) ** 2
    correlation = np.fft.irfft(power, size)[: len(whole) // 2]
    if correlation[0] <= 0.0:
        return 1.0
    correlation = correlation / correlation[0]
    end = int(np.argmax(correlation < 0.0)) or len(correlation)
    return float(1.0 + 2.0 * correlation[1:end].sum())
