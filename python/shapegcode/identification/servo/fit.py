"""Models of a position loop, fitted to commands and actual positions of one half of a log and validated on the other.

Servo lag: the command r is delayed by τ; the loop is the core's `ServoLag`, x' = K (r − x) + f r'. So the lag
at constant speed is τ + (1 − f)/K. A Sinumerik balances its feed-forward by a dead time if MD32620 = 3 (speed) or 4
(torque).
Feed drive: a rigid axis of 1 kg, since positions determine only force/mass.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy.optimize import least_squares, minimize, minimize_scalar
from scipy.signal import lfilter

from shapegcode import _core
from shapegcode.errors import ArgumentError
from shapegcode.identification.servo.record import ServoRecord, ServoTrace, read_servo_record
from shapegcode.identification.servo.result import ServoAxis, ServoCurves, ServoEstimate, ServoFit, ServoModel
from shapegcode.io.units import FloatArray
from shapegcode.machine import Machine

Masks = Sequence[npt.NDArray[np.bool_]]  # of each section: used samples
GAINS = (2.0, 1000.0)  # 1/s
_LONGEST_DEAD_S = 0.05
_SIGN_RATIO = 5e-4  # of the top speed: width of the sign change of friction


@dataclass(frozen=True, eq=False)
class LoopFit:
    """A fitted model."""

    dead_s: float
    gain_per_s: float
    rest: float  # remaining lag ratio 1 − f with feed-forward, 0 to 1
    offset: float  # command minus actual position at rest
    error: tuple[FloatArray, ...]  # of each section: command minus actual position, as modelled

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


def delayed(motion: FloatArray, samples: float) -> FloatArray:
    """A command delayed by a number of samples: interpolated linearly, at constant speed before its first sample."""
    at = np.arange(len(motion)) - samples
    found: FloatArray = np.interp(at, np.arange(len(motion)), motion)
    return np.where(at < 0.0, motion[0] + at * (motion[1] - motion[0]), found)


def lagged_motion(motion: FloatArray, gain_per_s: float, period_s: float, late: float = 0.0) -> FloatArray:
    """Error of a first-order lag (f = 0), exact for set-points joined by straight lines; `late`: delay in samples."""
    kept = math.exp(-gain_per_s * period_s)
    share = (1.0 - kept) / (gain_per_s * period_s)  # for a ramp over one period
    first = motion[1] - motion[0]
    steady = share * first / (1.0 - kept)
    steps = np.diff(motion, prepend=motion[0] - first)
    error = np.asarray(lfilter([share], [1.0, -kept], steps, zi=[kept * steady])[0], dtype=np.float64)
    whole = math.ceil(late)
    part = whole - late
    if whole == 0:
        return error
    # Between samples the previous error decays and that of the line segment is added.
    inside = math.exp(-gain_per_s * period_s * part)
    before = np.concatenate([np.full(whole, steady), error[: max(len(motion) - whole, 0)]])[: len(motion)]
    step = np.concatenate([np.full(whole, first), np.diff(motion)])[: len(motion)]
    return inside * before + step * (1.0 - inside) / (gain_per_s * period_s)


def fit_lag(trace: ServoTrace, use: Masks, period_s: float, *, dead_time: bool) -> LoopFit:
    """Fit dead time, gain, feed-forward and offset; the last two by inner linear least squares."""
    low, high = (math.log(each) for each in GAINS)
    scale = max(rms(counted(trace.lag, use)) ** 2, 1e-18)

    def solve(dead_s: float, gain: float) -> tuple[float, LoopFit]:
        late = [motion - delayed(motion, dead_s / period_s) for motion in trace.command]
        lags = [lagged_motion(motion, gain, period_s, dead_s / period_s) for motion in trace.command]
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
    speed = counted([np.gradient(motion, period_s) for motion in trace.command], use)
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
    """Parameters of servo lag with dead time; 95 % intervals, at least as wide as the fits to both halves are apart."""

    def model(values: FloatArray) -> FloatArray:
        late = values[0] / period_s
        motions = [
            motion - delayed(motion, late) + values[2] * lagged_motion(motion, values[1], period_s, late) + values[3]
            for motion in trace.command
        ]
        return counted(motions, use)

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


_RUN_UP_S, _MM = 0.4, 1e-3
_STIFFNESS_N_PER_M, _DAMPING_N_S_PER_M = 4e6, 400.0  # for 1 kg: 640 Hz, far above the speed loop
# Dead time in ms, ln of position gain, lag ratio 1 − f, ln of bandwidth in Hz, of integral time, of friction.
_LOW = (0.0, math.log(2.0), 0.0, math.log(5.0), math.log(1e-3), math.log(1e-7))
_HIGH = (30.0, math.log(500.0), 1.0, math.log(400.0), math.log(1.0), math.log(1e3))
_SCALE = (1.0, 0.3, 0.02, 0.5, 0.5, 1.0)


def fit_drive(trace: ServoTrace, use: Masks, period_s: float, start: LoopFit, tell: Callable[[], None]) -> DriveFit:
    """Fit the drive model; *start*: fit of the model "servo lag with dead time", whose parameters it starts from."""
    top_speed = max(float(np.abs(np.diff(motion)).max()) for motion in trace.command) / period_s
    acceleration = max(float(np.quantile(np.abs(np.diff(motion, 2)), 0.99)) for motion in trace.command) / period_s**2

    def simulated(values: FloatArray) -> tuple[list[FloatArray], FloatArray]:
        motions = _drive_motions(trace, values, period_s, top_speed)
        return motions, counted([y - x for y, x in zip(motions, trace.actual, strict=True)], use)

    def residual(values: FloatArray) -> FloatArray:
        left = simulated(values)[1]
        return np.asarray((left - left.mean()) * 1e3, dtype=np.float64)

    gain, rest = min(max(start.gain_per_s, 15.0), 80.0), min(max(start.rest, 0.005), 0.5)
    tried = []
    for bandwidth, integral in ((150.0, 0.02), (40.0, 0.005)):
        friction = max(0.02 * acceleration * _MM, 1e-6)
        logarithms = [math.log(each) for each in (bandwidth, integral, friction)]
        begin = (max(1e3 * start.lag_s - 1.0, 0.1), math.log(gain), rest, *logarithms)
        steps, ends = [1e-3] * 6, (_LOW, _HIGH)
        tried.append(least_squares(residual, begin, bounds=ends, x_scale=_SCALE, diff_step=steps, max_nfev=20))
        tell()
    best = np.asarray(min(tried, key=lambda each: float(each.cost)).x)
    motions, left = simulated(best)
    offset = float(left.mean())
    error = tuple(motion - y + offset for motion, y in zip(trace.command, motions, strict=True))
    dead_ms, gain, rest, bandwidth, integral, coulomb = best.tolist()
    return DriveFit(
        dead_ms * 1e-3, math.exp(gain), rest, offset, error,
        math.exp(bandwidth), math.exp(integral), math.exp(coulomb) / _MM,
    )  # fmt: skip


def _drive_motions(trace: ServoTrace, values: FloatArray, period_s: float, top_speed: float) -> list[FloatArray]:
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
    for motion in trace.command:
        late = delayed(motion, dead_ms * 1e-3 / period_s)
        run_up = late[0] + np.arange(-count, 0) * (late[1] - late[0])
        drive = _core.FeedDrive(parameters, period_s)
        drive.reset(run_up[0])
        found.append(np.asarray(drive.respond(np.concatenate([run_up, late]))[count:, 0], dtype=np.float64))
    return found


def range_of_three(name: str, values: Sequence[float], unit: str) -> ServoEstimate:
    """Estimate of a parameter from fits to all samples and to each half; unknown if one is over 1.5 times another."""
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
    late = [delayed(np.gradient(motion, period_s), lag_s / period_s) for motion in trace.command]
    sign = _SIGN_RATIO * max(float(np.abs(v).max()) for v in late)
    columns = [np.column_stack([np.tanh(v / sign), np.gradient(v, period_s), v, np.ones_like(v)]) for v in late]

    def fit(use: Masks) -> tuple[float, float]:
        """T_c/J, and the fraction by which T_c reduces the residual power of a torque fit without it."""
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


_LAG_SPREAD = 0.03
_MAX_SAMPLES = 40_000
_MIN_SPEED = 0.02  # least speed, relative to the top speed, to find a lag at constant speed
_KEYS = {"controller.position_gain_per_s": "position gain", "controller.feed_forward_ratio": "feed-forward"}


def fit_servo(
    log: str | Path | ServoRecord,
    machine: Machine | None = None,
    *,
    axes: str | Mapping[str, str] | None = None,
    units: str | None = None,
    drive: bool = False,
    on_progress: Callable[[float], None] | None = None,
) -> ServoFit:
    """Identify the position loop of each axis from a log of commands and actual positions.

    Up to three models are fitted to each half of the changes of speed and validated on the other half: the servo
    lag of the machine file (gain, feed-forward), the same with a dead time, and a drive with friction and a dead
    time. Their input is the command alone, never the actual positions of the validation half.

    Args:
        log: capture of a Sinumerik control, CSV with command and actual columns, or the result of `read_servo_record`.
        machine: machine that gets gain and feed-forward of X, Y and Z; None: none.
        axes: axes of the log that are X, Y, Z of the machine, such as "X=1,Y=6,Z=2"; None: by their names.
        units: of time and length in a CSV, for example "ms,um"; None: from its header.
        drive: fit the drive too (takes about ten seconds for each axis and each half of the log).
        on_progress: called with the completed fraction, 0 to 1.

    Returns:
        Residual of each model, and the parameters with intervals.

    Raises:
        ArgumentError, RecordError: an unusable file; an axis that is not in it.
        MachineError: the values contradict others of the machine file.
        OSError: the file cannot be read.
    """
    record = log if isinstance(log, ServoRecord) else read_servo_record(log, units)
    places = _machine_axes(record, axes)
    found: list[ServoAxis] = []
    for rank, trace in enumerate(record.axes):

        def tell(share: float, rank: int = rank) -> None:
            if on_progress is not None:
                on_progress((rank + share) / len(record.axes))

        found.append(_axis(trace.liveliest(_MAX_SAMPLES), record.period_s, drive, tell))
    warnings = list(record.notes)
    samples = record.axes[0].samples
    if samples > _MAX_SAMPLES:
        warnings.append(f"of {samples} samples the {_MAX_SAMPLES} with most changes of an axis' speed were used")
    fitted, written, unknown = (None, {}, []) if machine is None else _machine_with(machine, found, places)
    warnings += unknown
    duration = float(sum(each[-1] - each[0] for each in record.axes[0].time_s))
    name = "" if machine is None else machine.name
    return ServoFit(record.source, duration, tuple(found), name, written, tuple(warnings), fitted)


def _axis(trace: ServoTrace, period_s: float, with_drive: bool, tell: Callable[[float], None]) -> ServoAxis:
    lag = np.concatenate(trace.lag)
    travel = max(float(np.ptp(each)) for each in trace.command)
    speeds = tuple(np.gradient(each, period_s) for each in trace.command)
    top = max(float(np.abs(each).max()) for each in speeds)
    own = None if trace.deviation is None else rms(np.concatenate(trace.deviation))
    base = ServoAxis(trace.name, trace.unit, travel, top, rms(lag), own, (), (), "")
    if travel < 1e-3:  # mm or degrees
        return replace(base, note="did not move")
    if alike := _unlike(trace):
        return replace(base, note=alike)
    change = sum(float(np.abs(np.diff(each)).sum()) for each in speeds)
    if change < 0.02 * top:
        mean = float(np.mean(lag)) / float(np.mean(np.concatenate(speeds)))
        steady = ServoEstimate("lag at constant speed", mean, None, None, "s", "one speed: nothing else can be found")
        return replace(base, parameters=(steady,), note="never changes its speed")
    if two := _two_lags(trace, speeds, top):
        return replace(base, note=two)
    # Samples in the first half of all changes of speed; and used samples.
    changes = [np.abs(np.diff(each, prepend=each[:1])) for each in speeds]
    done = np.cumsum(np.concatenate(changes))
    early = tuple(np.split(done < done[-1] / 2.0, np.cumsum([len(each) for each in speeds])[:-1]))
    settle = round(0.1 / period_s)  # the motion before a section is unknown
    use = tuple(np.arange(len(each)) >= settle for each in speeds)
    uses = (use, *(tuple(c & (e == which) for e, c in zip(early, use, strict=True)) for which in (True, False)))
    compared = _compare_models(trace, early, uses, period_s, with_drive, tell)
    own = rms(counted(trace.deviation, use)) if trace.deviation is not None else None
    judged = []
    for each in compared:
        rest, fitted = (rms(counted(left, use)) for left in (each.rest, each.rest_fitted))
        judged.append(ServoModel(each.name, rest, fitted, 100.0 * (1.0 - (rest / own) ** 2) if own else None))
    whole, *halves = compared[1].fits
    parameters = lag_estimates(whole, halves, trace, use, period_s)
    parameters += torque_friction(trace, whole.lag_s, uses, period_s)
    for each in compared[2:]:
        parameters += _drive_estimates([fit for fit in each.fits if isinstance(fit, DriveFit)], trace.unit)
    best = compared[int(np.argmin([model.rest for model in judged]))]
    curves = ServoCurves(trace.time_s, speeds, trace.lag, trace.deviation, best.rest)
    return replace(base, models=tuple(judged), parameters=parameters, curves=curves)


def _unlike(trace: ServoTrace) -> str:
    """Why the actual position does not follow the command; empty if it does."""
    motion = [r - r.mean() for r in trace.command]
    power = sum(float(r @ r) for r in motion)
    slope = sum(float(r @ (x - x.mean())) for r, x in zip(motion, trace.actual, strict=True)) / power
    if 0.5 <= slope <= 2.0:
        return ""
    return f"the actual position moves {slope:.3g} times as far as the command: not the same unit, sign or axis"


def _two_lags(trace: ServoTrace, speeds: Sequence[FloatArray], top: float) -> str:
    """Report a lag at constant speed that changes; empty if it does not."""
    found: list[tuple[float, float, float]] = []  # lag over speed, speed, time
    count = 25
    for lag, speed, time in zip(trace.lag, speeds, trace.time_s, strict=True):
        for start in range(0, len(lag) - 2 * count, count):
            part = speed[start : start + 2 * count]
            mean = float(np.mean(part))
            if abs(mean) > _MIN_SPEED * top and float(np.ptp(part)) < 1e-3 * abs(mean):
                late = lag[start + count : start + 2 * count]
                found.append((float(np.mean(late)) / mean, mean, float(time[start])))
    if not found or max(found)[0] - min(found)[0] <= _LAG_SPREAD * abs(max(found)[0]):
        return ""
    least, most = (
        f"{1e3 * lag:.3f} ms at {speed:.5g} {trace.unit}/s ({time_s:.2f} s)"
        for lag, speed, time_s in (min(found), max(found))
    )
    changed = "the control changed its loop there, and no single model fits"
    return f"the lag at constant speed is {least} and {most}: {changed}"


@dataclass(frozen=True, eq=False)
class _ComparedModel:
    name: str
    fits: tuple[LoopFit, ...]  # fits to all samples, to the first half, to the second
    rest: tuple[FloatArray, ...]  # residual of each sample after the fit to the other half
    rest_fitted: tuple[FloatArray, ...]


def _compare_models(
    trace: ServoTrace, early: Masks, uses: Sequence[Masks], period_s: float, with_drive: bool,
    tell: Callable[[float], None],
) -> list[_ComparedModel]:  # fmt: skip
    """Fit the models to all samples and to each half."""

    def judge(name: str, fits: Sequence[LoopFit]) -> _ComparedModel:
        whole, first, second = fits
        rest = tuple(
            lag - np.where(in_first, second.error[rank], first.error[rank])
            for rank, (lag, in_first) in enumerate(zip(trace.lag, early, strict=True))
        )
        fitted = tuple(lag - model for lag, model in zip(trace.lag, whole.error, strict=True))
        return _ComparedModel(name, tuple(fits), rest, fitted)

    found = [judge("servo lag", [fit_lag(trace, use, period_s, dead_time=False) for use in uses])]
    tell(0.1)
    lags = [fit_lag(trace, use, period_s, dead_time=True) for use in uses]
    found.append(judge("dead time and servo lag", lags))
    tell(0.2)
    if with_drive:
        steps = iter(np.linspace(0.2, 1.0, 7)[1:].tolist())
        pairs = zip(uses, lags, strict=True)
        drives = [fit_drive(trace, use, period_s, lag, lambda: tell(next(steps))) for use, lag in pairs]
        found.append(judge("drive", drives))
    return found


def _drive_estimates(fits: Sequence[DriveFit], unit: str) -> tuple[ServoEstimate, ...]:
    rows = (
        ("dead time", [fit.dead_s for fit in fits], "s"),
        ("position gain", [fit.gain_per_s for fit in fits], "1/s"),
        ("feed-forward", [1.0 - fit.rest for fit in fits], "1"),
        ("speed loop", [fit.bandwidth_hz for fit in fits], "Hz"),
        ("integral time", [fit.integral_time_s for fit in fits], "s"),
        ("friction over mass", [fit.coulomb for fit in fits], f"{unit}/s²"),
    )
    return tuple(range_of_three(f"drive: {name}", values, of) for name, values, of in rows)


def _machine_axes(record: ServoRecord, axes: str | Mapping[str, str] | None) -> dict[str, int]:
    if axes is None:
        named = {each.name.partition("(")[2].rstrip(")") or each.name: rank for rank, each in enumerate(record.axes)}
        found = {
            letter: named[name] for letter in "xyz" for name in (f"{letter.upper()}1", letter.upper()) if name in named
        }
        return {} if any(record.axes[rank].unit == "deg" for rank in found.values()) else found
    if isinstance(axes, str):
        pairs = [each.partition("=") for each in axes.split(",")]
        if any(not equals for _, equals, _ in pairs):
            raise ArgumentError(f"--axes {axes}: must be for example X=1,Y=6,Z=2")
        axes = {letter.strip().lower(): name.strip() for letter, _, name in pairs}
    found = {}
    labels = [each.name.lower() for each in record.axes]
    words = [(label, *label.replace("(", "").replace(")", "").split()) for label in labels]
    for letter, name in axes.items():
        ranks = [rank for rank, known in enumerate(words) if str(name).lower() in known]
        if letter.lower() not in ("x", "y", "z") or len(ranks) != 1:
            held = ", ".join(each.name for each in record.axes)
            raise ArgumentError(f"--axes {letter}={name}: must be X, Y or Z and an axis of the log, which has {held}")
        found[letter.lower()] = ranks[0]
    return found


def _machine_with(
    machine: Machine, axes: Sequence[ServoAxis], places: Mapping[str, int]
) -> tuple[Machine, dict[str, float], list[str]]:
    """The machine with the gain and feed-forward that the log determines."""
    written: dict[str, float] = {}
    remarks: dict[str, list[str]] = {}
    warnings: list[str] = []
    for letter, place in places.items():
        axis = axes[place]
        if axis.unit != "mm":
            warnings.append(f"axis {axis.name} is rotary: it cannot be {letter.upper()} of a machine file")
            continue
        estimates = {key: each for key, name in _KEYS.items() if (each := axis.parameter(name)) is not None}
        known = {key: each.value for key, each in estimates.items() if each.value is not None}
        if len(known) < len(_KEYS):
            warnings.append(f"axis {axis.name}: gain and feed-forward not found: {letter.upper()} keeps its values")
            continue
        for key, value in known.items():
            written[f"{key}.{letter}"] = round(float(value), 6)
            interval = f"{letter} {estimates[key].low:.6g} ... {estimates[key].high:.6g}"
            remarks.setdefault(key, []).append(interval)
    if not written:
        return machine, written, warnings
    said = {key: f"measured (log, with a dead time): {', '.join(each)}" for key, each in remarks.items()}
    return machine.with_values(written).with_remarks(said), written, warnings
