"""Models of a position loop, fitted to commands and actual positions: servo lag with dead time, feed drive, torque.

Servo lag: the command r is delayed by τ; the loop is the core's `ServoLag`, x' = K (r − x) + f r'. So the lag
at constant speed is τ + (1 − f)/K. A Sinumerik with speed feed-forward compensates it by a dead time (MD32620 = 3, 4).
Feed drive: a rigid axis of 1 kg, since positions determine only force/mass.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shapegcode import _core
from shapegcode.identification.servo.record import ServoTrace
from shapegcode.identification.servo.result import ServoEstimate
from shapegcode.io.units import FloatArray

Masks = Sequence[npt.NDArray[np.bool_]]  # of each section: used samples
SETTLE_S = 0.1
GAINS = (2.0, 1000.0)  # 1/s
_LONGEST_DEAD_S = 0.05
_SIGN_RATIO = 5e-4  # of the top speed: width of the sign change of friction


@dataclass(frozen=True, eq=False)
class LoopFit:
    """A fitted model."""

    dead_s: float
    gain_per_s: float
    rest: float  # remaining lag ratio 1 − f with feed-forward, 0 to 1
    offset: float  # encoder offset from the command at rest
    error: tuple[FloatArray, ...]  # of each section: modelled command minus actual position

    @property
    def lag_s(self) -> float:
        """Lag at constant speed divided by the speed, s."""
        return self.dead_s + self.rest / self.gain_per_s


@dataclass(frozen=True, eq=False)
class DriveFit(LoopFit):
    """A rigid feed drive with Coulomb friction and a dead time."""

    bandwidth_hz: float  # of the speed loop
    integral_time_s: float  # of the speed loop
    coulomb: float  # friction over mass, in mm/s² or degrees/s²


def rms(values: FloatArray) -> float:
    """Root of the mean square; NaN if empty."""
    return float(np.sqrt(np.mean(values**2))) if values.size else math.nan


def counted(values: Sequence[FloatArray], use: Masks) -> FloatArray:
    """The used samples of all sections."""
    return np.concatenate([each[keep] for each, keep in zip(values, use, strict=True)])


def delayed(way: FloatArray, samples: float) -> FloatArray:
    """A command delayed by a number of samples: interpolated linearly, at constant speed before its first sample."""
    at = np.arange(len(way)) - samples
    found: FloatArray = np.interp(at, np.arange(len(way)), way)
    return np.where(at < 0.0, way[0] + at * (way[1] - way[0]), found)


# --- servo lag --------------------------------------------------------------------------------------------------------


def lag_way(way: FloatArray, gain_per_s: float, period_s: float, late: float = 0.0) -> FloatArray:
    """Error of a first-order lag without feed-forward (f = 0), exact for set-points joined by straight lines."""
    from scipy.signal import lfilter

    kept = math.exp(-gain_per_s * period_s)
    share = (1.0 - kept) / (gain_per_s * period_s)  # for a ramp over one period
    first = way[1] - way[0]
    steady = share * first / (1.0 - kept)
    steps = np.diff(way, prepend=way[0] - first)
    error = np.asarray(lfilter([share], [1.0, -kept], steps, zi=[kept * steady])[0], dtype=np.float64)
    whole = math.ceil(late)
    part = whole - late
    if whole == 0:
        return error
    # Between samples the previous error decays and that of the line segment is added.
    inside = math.exp(-gain_per_s * period_s * part)
    before = np.concatenate([np.full(whole, steady), error[: max(len(way) - whole, 0)]])[: len(way)]
    step = np.concatenate([np.full(whole, first), np.diff(way)])[: len(way)]
    return inside * before + step * (1.0 - inside) / (gain_per_s * period_s)


def fit_lag(trace: ServoTrace, use: Masks, period_s: float, *, dead_time: bool) -> LoopFit:
    """Fit dead time, gain, feed-forward and offset; the last two by inner linear least squares."""
    from scipy.optimize import minimize, minimize_scalar

    low, high = (math.log(each) for each in GAINS)
    scale = max(rms(counted(trace.lag, use)) ** 2, 1e-18)

    def solve(dead_s: float, gain: float) -> tuple[float, LoopFit]:
        late = [way - delayed(way, dead_s / period_s) for way in trace.command]
        lags = [lag_way(way, gain, period_s, dead_s / period_s) for way in trace.command]
        left = counted([e - gone for e, gone in zip(trace.lag, late, strict=True)], use)
        basis = counted(lags, use)
        mean_left, mean_basis = left.mean(), basis.mean()
        power = float(np.sum((basis - mean_basis) ** 2))
        rest = float((basis - mean_basis) @ (left - mean_left)) / power if power > 0.0 else 0.0
        rest = min(max(rest, 0.0), 1.0)
        offset = float(mean_left - rest * mean_basis)
        error = tuple(gone + rest * lag + offset for gone, lag in zip(late, lags, strict=True))
        return float(np.mean((left - rest * basis - offset) ** 2)), LoopFit(dead_s, gain, rest, offset, error)

    def square(values: FloatArray) -> float:
        dead, gain = (values[0] * 1e-3, values[1]) if dead_time else (0.0, values[-1])
        inside = min(max(dead, 0.0), _LONGEST_DEAD_S), min(max(gain, low), high)
        out = abs(dead - inside[0]) + abs(gain - inside[1])
        return math.log(solve(inside[0], math.exp(inside[1]))[0] / scale + 1e-18) + 1e3 * float(out)

    if not dead_time:
        gains = np.linspace(low, high, 13)
        rank = int(np.argmin([square(gains[at : at + 1]) for at in range(len(gains))]))
        around = gains[max(rank - 1, 0)], gains[min(rank + 1, len(gains) - 1)]
        found = minimize_scalar(lambda gain: square(np.array([gain])), bounds=around, method="bounded")
        return solve(0.0, math.exp(min(max(float(found.x), low), high)))[1]
    speed = counted([np.gradient(way, period_s) for way in trace.command], use)
    power = float(speed @ speed)
    lag = min(max(float(speed @ counted(trace.lag, use)) / power, 0.0), _LONGEST_DEAD_S) if power > 0.0 else 0.0
    starts = [(1e3 * share * lag, math.log(gain)) for share in (0.6, 0.9, 0.99) for gain in (20.0, 60.0)]
    # Refine the two best starts to their minima; the other starts would only reach the same minima later.
    tried = [
        minimize(square, start, method="Nelder-Mead", options={"xatol": 1e-5, "fatol": 1e-9, "maxiter": 300})
        for start in sorted(starts, key=lambda each: square(np.array(each)))[:2]
    ]
    best = min(tried, key=lambda each: float(each.fun)).x
    dead = min(max(float(best[0]) * 1e-3, 0.0), _LONGEST_DEAD_S)
    return solve(dead, math.exp(min(max(float(best[1]), low), high)))[1]


def lag_estimates(
    fit: LoopFit, halves: Sequence[LoopFit], trace: ServoTrace, use: Masks, period_s: float
) -> tuple[ServoEstimate, ...]:
    """Servo lag with dead time; 95 % intervals at least as wide as the halves of the record differ."""

    def model(values: FloatArray) -> FloatArray:
        late = values[0] / period_s
        ways = [
            way - delayed(way, late) + values[2] * lag_way(way, values[1], period_s, late) + values[3]
            for way in trace.command
        ]
        return counted(ways, use)

    values = np.array([fit.dead_s, fit.gain_per_s, fit.rest, fit.offset])
    steps = np.array([1e-6, 1e-3 * fit.gain_per_s, 1e-4, 1e-6])
    moved = zip(steps, np.eye(4), strict=True)
    slopes = [(model(values + step * unit) - model(values - step * unit)) / (2.0 * step) for step, unit in moved]
    jacobian = np.column_stack(slopes)
    left = counted([lag - e for lag, e in zip(trace.lag, fit.error, strict=True)], use)
    scale = np.linalg.norm(jacobian, axis=0)
    scale[scale == 0.0] = 1.0  # for a gain without effect
    inverse = np.linalg.pinv((jacobian / scale).T @ (jacobian / scale), rcond=1e-12) / np.outer(scale, scale)
    covariance = inverse * float(np.mean(left**2)) * _correlated_samples(left)

    def half(name: str, *gradient: float) -> float:
        slope, take = np.array(gradient), [float(getattr(each, name)) for each in halves]
        formal = 1.96 * math.sqrt(max(float(slope @ covariance @ slope), 0.0))
        return max(formal, (max(take) - min(take)) / 2.0)

    gain, rest = fit.gain_per_s, fit.rest
    lag = half("lag_s", 1.0, -rest / gain**2, 1.0 / gain, 0.0)
    names = "dead_s", "gain_per_s", "rest"
    dead, gains, forward = (half(name, *row) for name, row in zip(names, np.eye(4), strict=False))
    ends = max(0.0, 1.0 - rest - forward), min(1.0, 1.0 - rest + forward)
    why = "with this feed-forward no lag remains to determine it"
    loop = (
        ServoEstimate("position gain", None, None, None, "1/s", why),
        ServoEstimate("feed-forward", None, *ends, "1", why),
    )
    if gains < 0.5 * gain and forward < rest:
        why = "of an equivalent first-order loop; the control's setting may differ"
        gain_estimate = ServoEstimate("position gain", gain, gain - gains, gain + gains, "1/s", why)
        loop = gain_estimate, ServoEstimate("feed-forward", 1.0 - rest, *ends, "1")
    return (
        ServoEstimate("lag at constant speed", fit.lag_s, fit.lag_s - lag, fit.lag_s + lag, "s"),
        ServoEstimate("dead time", fit.dead_s, max(0.0, fit.dead_s - dead), fit.dead_s + dead, "s"),
        *loop,
    )


def _correlated_samples(left: FloatArray) -> float:
    """Correlation length of the residual, samples: 1 + 2 Σ ρ up to the first negative ρ."""
    left = left - left.mean()
    size = 1 << (2 * len(left) - 1).bit_length()
    correlation = np.fft.irfft(np.abs(np.fft.rfft(left, size)) ** 2, size)[: len(left) // 2]
    if correlation[0] <= 0.0:
        return 1.0
    correlation = correlation / correlation[0]
    end = int(np.argmax(correlation < 0.0)) or len(correlation)
    return float(1.0 + 2.0 * correlation[1:end].sum())


# --- feed drive -------------------------------------------------------------------------------------------------------

_RUN_UP_S, _MM = 0.4, 1e-3
_STIFFNESS_N_PER_M, _DAMPING_N_S_PER_M = 4e6, 400.0  # for 1 kg: 640 Hz, far above the speed loop
# Dead time in ms; position gain, bandwidth in Hz, integral time, Coulomb friction as logarithms.
_LOW = (0.0, math.log(2.0), 0.0, math.log(5.0), math.log(1e-3), math.log(1e-7))
_HIGH = (30.0, math.log(500.0), 1.0, math.log(400.0), math.log(1.0), math.log(1e3))
_SCALE = (1.0, 0.3, 0.02, 0.5, 0.5, 1.0)
_STARTS = ((150.0, 0.02), (40.0, 0.005))  # bandwidth, integral time


def fit_drive(trace: ServoTrace, use: Masks, period_s: float, start: LoopFit, tell: Callable[[], None]) -> DriveFit:
    """Fit the drive, started at the best servo lag."""
    from scipy.optimize import least_squares

    top_speed = max(float(np.abs(np.diff(way)).max()) for way in trace.command) / period_s
    acceleration = max(float(np.quantile(np.abs(np.diff(way, 2)), 0.99)) for way in trace.command) / period_s**2

    def simulated(values: FloatArray) -> tuple[list[FloatArray], FloatArray]:
        ways = _drive_ways(trace, values, period_s, top_speed)
        return ways, counted([y - x for y, x in zip(ways, trace.actual, strict=True)], use)

    def residual(values: FloatArray) -> FloatArray:
        left = simulated(values)[1]
        return np.asarray((left - left.mean()) * 1e3, dtype=np.float64)

    gain, rest = min(max(start.gain_per_s, 15.0), 80.0), min(max(start.rest, 0.005), 0.5)
    tried = []
    for bandwidth, integral in _STARTS:
        friction = max(0.02 * acceleration * _MM, 1e-6)
        logarithms = [math.log(each) for each in (bandwidth, integral, friction)]
        begin = (max(1e3 * start.lag_s - 1.0, 0.1), math.log(gain), rest, *logarithms)
        steps, ends = [1e-3] * 6, (_LOW, _HIGH)
        tried.append(least_squares(residual, begin, bounds=ends, x_scale=_SCALE, diff_step=steps, max_nfev=20))
        tell()
    best = np.asarray(min(tried, key=lambda each: float(each.cost)).x)
    ways, left = simulated(best)
    offset = float(left.mean())
    error = tuple(way - y + offset for way, y in zip(trace.command, ways, strict=True))
    dead_ms, gain, rest, bandwidth, integral, coulomb = best.tolist()
    return DriveFit(
        dead_ms * 1e-3, math.exp(gain), rest, offset, error,
        math.exp(bandwidth), math.exp(integral), math.exp(coulomb) / _MM,
    )  # fmt: skip


def _drive_ways(trace: ServoTrace, values: FloatArray, period_s: float, top_speed: float) -> list[FloatArray]:
    """Position of the drive in each section; before the section its first speed is assumed."""
    dead_ms, gain, rest, bandwidth, integral, coulomb = values
    friction, smoothing = math.exp(coulomb), _SIGN_RATIO * top_speed * _MM
    parameters = _core.FeedDriveParameters(
        motor_mass_kg=0.5, table_mass_kg=0.5, stiffness_n_per_m=_STIFFNESS_N_PER_M,
        damping_n_s_per_m=_DAMPING_N_S_PER_M, position_gain_per_s=math.exp(gain),
        velocity_gain_n_s_per_m=2.0 * math.pi * math.exp(bandwidth), velocity_integral_time_s=math.exp(integral),
        velocity_feed_forward_ratio=1.0 - rest,
        table_friction=_core.FrictionParameters(
            _core.FrictionModel.stribeck, coulomb_n=friction, static_n=friction,
            stribeck_velocity_m_per_s=smoothing, smoothing_velocity_m_per_s=smoothing,
        ),
    )  # fmt: skip
    found, count = [], round(_RUN_UP_S / period_s)
    for way in trace.command:
        late = delayed(way, dead_ms * 1e-3 / period_s)
        run_up = late[0] + np.arange(-count, 0) * (late[1] - late[0])
        drive = _core.FeedDrive(parameters, period_s)
        drive.reset(run_up[0])
        found.append(np.asarray(drive.respond(np.concatenate([run_up, late]))[count:, 0], dtype=np.float64))
    return found


# --- torque -----------------------------------------------------------------------------------------------------------


def range_of_three(name: str, values: Sequence[float], unit: str) -> ServoEstimate:
    """A parameter of the fits to all samples and to the halves: unknown if the halves disagree."""
    low, high = min(values), max(values)
    if high > 1.5 * low:
        return ServoEstimate(name, None, low, high, unit, "the halves disagree")
    return ServoEstimate(name, values[0], low, high, unit, "range of three fits")


def torque_friction(
    trace: ServoTrace, lag_s: float, uses: Sequence[Masks], period_s: float
) -> tuple[ServoEstimate, ...]:
    """Friction over mass, T_c/J, from the torque T_c sign(v) + J a + T_v v + T_0 at the command delayed by the lag."""
    if trace.torque is None:
        return ()
    torque = trace.torque
    late = [delayed(np.gradient(way, period_s), lag_s / period_s) for way in trace.command]
    sign = _SIGN_RATIO * max(float(np.abs(v).max()) for v in late)
    columns = [np.column_stack([np.tanh(v / sign), np.gradient(v, period_s), v, np.ones_like(v)]) for v in late]

    def fit(use: Masks) -> tuple[float, float]:
        """T_c/J, and the torque ratio that T_c explains in addition to the other terms."""
        basis, values = counted(columns, use), counted(torque, use)
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
    share = fits[0][1]
    name, unit = "friction over mass by torque", f"{trace.unit}/s²"
    if share < 0.5 or min(value for value, _ in fits) <= 0.0:
        why = f"friction explains {100.0 * max(share, 0.0):.0f} % of the torque not due to acceleration and speed"
        return (ServoEstimate(name, None, None, None, unit, why),)
    return (range_of_three(name, [value for value, _ in fits], unit),)
