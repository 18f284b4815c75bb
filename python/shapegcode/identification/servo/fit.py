"""Fits models of the position loop to one half of a log and validates them on the other."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from shapegcode.errors import ArgumentError
from shapegcode.identification.servo import models
from shapegcode.identification.servo.models import DriveFit, LoopFit, Masks, counted, rms
from shapegcode.identification.servo.record import ServoRecord, ServoTrace, read_servo_record
from shapegcode.identification.servo.result import ServoAxis, ServoCurves, ServoEstimate, ServoFit, ServoModel
from shapegcode.io.units import FloatArray
from shapegcode.machine import Machine

_STILL_TRAVEL = 1e-3  # mm or degrees
_STEADY_CHANGE = 0.02  # least change of speed, relative to the top speed
_LAG_SPREAD = 0.03
_SLOPE = (0.5, 2.0)
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

    Three models are fitted to each half of the changes of speed and validated on the other half: the servo
    lag of the machine file (gain, feed-forward), the same with a dead time, and a drive with friction and a dead
    time. Their input is the command alone, never the actual positions of the validation half.

    Args:
        log: capture of a Sinumerik control, CSV with command and actual columns, or the result of `read_servo_record`.
        machine: machine that gets gain and feed-forward of X, Y and Z; None: none.
        axes: axes of the log that are X, Y, Z of the machine, such as "X=1,Y=6,Z=2"; None: by their names.
        units: of time and length in a CSV, for example "ms,um"; None: from its header.
        drive: fit the drive too (about ten seconds for each axis and half).
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


# --- one axis ---------------------------------------------------------------------------------------------------------


def _axis(trace: ServoTrace, period_s: float, with_drive: bool, tell: Callable[[float], None]) -> ServoAxis:
    lag = np.concatenate(trace.lag)
    travel = max(float(np.ptp(each)) for each in trace.command)
    speeds = tuple(np.gradient(each, period_s) for each in trace.command)
    top = max(float(np.abs(each).max()) for each in speeds)
    own = None if trace.deviation is None else rms(np.concatenate(trace.deviation))
    base = ServoAxis(trace.name, trace.unit, travel, top, rms(lag), own, (), (), "")
    if travel < _STILL_TRAVEL:
        return replace(base, note="did not move")
    if alike := _unlike(trace):
        return replace(base, note=alike)
    change = sum(float(np.abs(np.diff(each)).sum()) for each in speeds)
    if change < _STEADY_CHANGE * top:
        mean = float(np.mean(lag)) / float(np.mean(np.concatenate(speeds)))
        steady = ServoEstimate("lag at constant speed", mean, None, None, "s", "one speed: nothing else can be found")
        return replace(base, parameters=(steady,), note="never changes its speed")
    if two := _two_lags(trace, speeds, top):
        return replace(base, note=two)
    # Samples in the first half of all changes of speed; and used samples.
    changes = [np.abs(np.diff(each, prepend=each[:1])) for each in speeds]
    done = np.cumsum(np.concatenate(changes))
    early = tuple(np.split(done < done[-1] / 2.0, np.cumsum([len(each) for each in speeds])[:-1]))
    settle = round(models.SETTLE_S / period_s)  # the motion before a section is unknown
    use = tuple(np.arange(len(each)) >= settle for each in speeds)
    uses = (use, *(tuple(c & (e == which) for e, c in zip(early, use, strict=True)) for which in (True, False)))
    compared = _compare_models(trace, early, uses, period_s, with_drive, tell)
    own = rms(counted(trace.deviation, use)) if trace.deviation is not None else None
    judged = []
    for each in compared:
        rest, fitted = (rms(counted(left, use)) for left in (each.rest, each.rest_fitted))
        judged.append(ServoModel(each.name, rest, fitted, 100.0 * (1.0 - (rest / own) ** 2) if own else None))
    whole, *halves = compared[1].fits
    parameters = models.lag_estimates(whole, halves, trace, use, period_s)
    parameters += models.torque_friction(trace, whole.lag_s, uses, period_s)
    for each in compared[2:]:
        parameters += _drive_estimates([fit for fit in each.fits if isinstance(fit, DriveFit)], trace.unit)
    best = compared[int(np.argmin([model.rest for model in judged]))]
    curves = ServoCurves(trace.time_s, speeds, trace.lag, trace.deviation, best.rest)
    return replace(base, models=tuple(judged), parameters=parameters, curves=curves)


def _unlike(trace: ServoTrace) -> str:
    """Why the actual position does not follow the command; empty if it does."""
    way = [r - r.mean() for r in trace.command]
    power = sum(float(r @ r) for r in way)
    slope = sum(float(r @ (x - x.mean())) for r, x in zip(way, trace.actual, strict=True)) / power
    if _SLOPE[0] <= slope <= _SLOPE[1]:
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

    found = [judge("servo lag", [models.fit_lag(trace, use, period_s, dead_time=False) for use in uses])]
    tell(0.1)
    lags = [models.fit_lag(trace, use, period_s, dead_time=True) for use in uses]
    found.append(judge("dead time and servo lag", lags))
    tell(0.2)
    if with_drive:
        steps = iter(np.linspace(0.2, 1.0, 7)[1:].tolist())
        pairs = zip(uses, lags, strict=True)
        drives = [models.fit_drive(trace, use, period_s, lag, lambda: tell(next(steps))) for use, lag in pairs]
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
    return tuple(models.range_of_three(f"drive: {name}", values, of) for name, values, of in rows)


# --- the machine file -------------------------------------------------------------------------------------------------


def _machine_axes(record: ServoRecord, axes: str | Mapping[str, str] | None) -> dict[str, int]:
    if axes is None:
        named = {each.name.partition("(")[2].rstrip(")") or each.name: rank for rank, each in enumerate(record.axes)}
        found = {
            letter: named[name] for letter in "xyz" for name in (f"{letter.upper()}1", letter.upper()) if name in named
        }
        turning = [letter for letter, rank in found.items() if record.axes[rank].unit == "deg"]
        return {} if turning else found
    if isinstance(axes, str):
        pairs = [each.partition("=") for each in axes.split(",")]
        axes = {letter.strip().lower(): name.strip() for letter, _, name in pairs}
        if any(not equals for _, equals, _ in pairs):
            raise ArgumentError(f"--axes {','.join(axes)}: must be for example X=1,Y=6,Z=2")
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
