"""Fits models of the position loop to one half of a log and judges them on the other."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from shapegcode.characterization.servo.drive import DriveFit, fit_drive
from shapegcode.characterization.servo.intervals import lag_intervals
from shapegcode.characterization.servo.lag import SETTLE_S, LagFit, fit_lag, rms
from shapegcode.characterization.servo.mapping import learned, machine_axes
from shapegcode.characterization.servo.record import ServoRecord, ServoTrace, read_servo_record
from shapegcode.characterization.servo.result import ServoAxis, ServoCurves, ServoEstimate, ServoFit, ServoModel
from shapegcode.characterization.servo.torque import torque_friction
from shapegcode.machine import Machine

__all__ = ["fit_servo"]

FloatArray = npt.NDArray[np.float64]
Masks = tuple[npt.NDArray[np.bool_], ...]
_STILL_TRAVEL = 1e-3  # mm or degrees
_STEADY_CHANGE = 0.02  # of the top speed: less is no change of speed
_LAG_SPREAD = 0.03
_SLOPE = (0.5, 2.0)
_MOST_SAMPLES = 40_000
_LEAST_SPEED = 0.02


def fit_servo(
    log: str | Path | ServoRecord,
    machine: Machine | None = None,
    *,
    axes: str | Mapping[str, str] | None = None,
    units: str | None = None,
    drive: bool = False,
    on_progress: Callable[[float], None] | None = None,
) -> ServoFit:
    """What a log of commands and actual positions says about the position loop of each axis.

    Three models are fitted to one half of the changes of speed and judged on the other half, and the reverse: the servo
    lag of the machine file (gain, feed-forward), the same behind a dead time, and a drive with friction behind a dead
    time. They see the command alone, never the actual positions of the half on which they are judged.

    Args:
        log: capture of a Sinumerik control, CSV with command and actual columns, or what `read_servo_record` gave.
        machine: whose file gets gain and feed-forward of X, Y and Z; None: none.
        axes: which axis of the log is X, Y, Z of the machine, such as "X=1,Y=6,Z=2"; None: by their names.
        units: of time and length in a CSV, for example "ms,um"; None: from its header.
        drive: whether the drive is fitted too, which takes some ten seconds for each axis and half.
        on_progress: told the share of the work done, 0 to 1.

    Returns:
        What each model leaves, and the parameters that follow, with intervals.

    Raises:
        ArgumentError, RecordError: the file cannot be used; an axis that it does not have.
        MachineError: the values do not go with others of the machine file.
        OSError: the file cannot be read.
    """
    record = log if isinstance(log, ServoRecord) else read_servo_record(log, units)
    places = machine_axes(record, axes)
    found: list[ServoAxis] = []
    for rank, trace in enumerate(record.axes):

        def tell(share: float, rank: int = rank) -> None:
            if on_progress is not None:
                on_progress((rank + share) / len(record.axes))

        found.append(_axis(trace.liveliest(_MOST_SAMPLES), record.period_s, drive, tell))
    written: dict[str, float] = {}
    warnings = list(record.notes)
    samples = record.axes[0].samples
    if samples > _MOST_SAMPLES:
        warnings.append(f"of {samples} samples those {_MOST_SAMPLES} were taken where an axis changes its speed most")
    fitted = machine
    if machine is not None:
        fitted, written, unknown = learned(machine, found, places)
        warnings += unknown
    duration = sum(each[-1] - each[0] for each in record.axes[0].time_s)
    return ServoFit(
        source=record.source,
        duration_s=float(duration),
        axes=tuple(found),
        machine="" if machine is None else machine.name,
        written=written,
        warnings=tuple(warnings),
        fitted=fitted,
    )


def _axis(trace: ServoTrace, period_s: float, with_drive: bool, tell: Callable[[float], None]) -> ServoAxis:
    lag = np.concatenate([r - x for r, x in zip(trace.command, trace.actual, strict=True)])
    travel = max(float(np.ptp(each)) for each in trace.command)
    speeds = tuple(np.gradient(each, period_s) for each in trace.command)
    top = max(float(np.abs(each).max()) for each in speeds)
    own = None if trace.deviation is None else np.concatenate(trace.deviation)
    base = ServoAxis(
        trace.name, trace.unit, travel, top, rms(lag), None if own is None else rms(own), (), (), ""
    )  # fmt: skip
    if travel < _STILL_TRAVEL:
        return _with(base, note="did not move")
    alike = _alike(trace)
    if alike:
        return _with(base, note=alike)
    change = sum(float(np.abs(np.diff(each)).sum()) for each in speeds)
    if change < _STEADY_CHANGE * top:
        mean = float(np.mean(lag)) / float(np.mean(np.concatenate(speeds)))
        steady = ServoEstimate("lag at constant speed", mean, None, None, "s", "one speed: nothing else follows")
        return _with(base, parameters=(steady,), note="never changes its speed")
    two = _two_lags(trace, speeds, top)
    if two:
        return _with(base, note=two)
    early, counted = _halves(speeds, period_s)
    halves = tuple(tuple(c & (e == which) for e, c in zip(early, counted, strict=True)) for which in (True, False))
    uses = (*halves, counted)
    judged = _judged(trace, early, uses, period_s, with_drive, tell)
    own_counted = None if trace.deviation is None else rms(_of(trace.deviation, counted))
    models = tuple(
        ServoModel(
            each.name,
            rms(_of(each.rest, counted)),
            rms(_of(each.rest_fitted, counted)),
            100.0 * (1.0 - (rms(_of(each.rest, counted)) / own_counted) ** 2) if own_counted else None,
        )
        for each in judged
    )
    best = min(judged, key=lambda each: rms(_of(each.rest, counted)))
    lagged = next(each for each in judged if each.name == "dead time and servo lag")
    assert isinstance(lagged.whole, LagFit)
    parameters = lag_intervals(
        lagged.whole, [each for each in lagged.halves if isinstance(each, LagFit)], trace, counted, period_s
    )
    parameters += torque_friction(trace, lagged.whole, uses, period_s)
    for each in judged:
        if isinstance(each.whole, DriveFit):
            parameters += _drive_parameters(each.whole, [h for h in each.halves if isinstance(h, DriveFit)], trace.unit)
    curves = ServoCurves(
        trace.time_s,
        speeds,
        tuple(r - x for r, x in zip(trace.command, trace.actual, strict=True)),
        trace.deviation,
        best.rest,
    )
    return _with(base, models=models, parameters=parameters, curves=curves)


def _alike(trace: ServoTrace) -> str:
    """Says where the actual position goes another way than the command: other units, another axis, another sign."""
    way = [r - r.mean() for r in trace.command]
    power = sum(float(r @ r) for r in way)
    slope = sum(float(r @ (x - x.mean())) for r, x in zip(way, trace.actual, strict=True)) / power
    low, high = _SLOPE
    if low <= slope <= high:
        return ""
    return f"the actual position goes {slope:.3g} times the way of the command: not the same unit, sign or axis"


def _with(axis: ServoAxis, **changes: object) -> ServoAxis:
    return replace(axis, **changes)  # type: ignore[arg-type]


def _of(values: Sequence[FloatArray], use: Masks) -> FloatArray:
    return np.concatenate([each[keep] for each, keep in zip(values, use, strict=True)])


def _halves(speeds: Sequence[FloatArray], period_s: float) -> tuple[Masks, Masks]:
    """Which samples lie in the half of all changes of speed that comes first; and which count: not the first of a
    stretch, since what the axis did before it is not known.
    """
    changes = [np.abs(np.diff(each, prepend=each[:1])) for each in speeds]
    done = np.cumsum(np.concatenate(changes))
    early = np.split(done < done[-1] / 2.0, np.cumsum([len(each) for each in speeds])[:-1])
    settle = round(SETTLE_S / period_s)
    return tuple(early), tuple(np.arange(len(each)) >= settle for each in speeds)


@dataclass(frozen=True, eq=False)
class _Judged:
    """A model: fitted to each half and to all, with what it leaves in every sample."""

    name: str
    halves: tuple[LagFit | DriveFit, ...]
    whole: LagFit | DriveFit
    rest: tuple[FloatArray, ...]  # each sample by the fit to the other half
    rest_fitted: tuple[FloatArray, ...]


def _judged(
    trace: ServoTrace,
    early: Masks,
    uses: Sequence[Masks],
    period_s: float,
    with_drive: bool,
    tell: Callable[[float], None],
) -> list[_Judged]:
    """The models, fitted to the first half, the second and all."""
    measured = [r - x for r, x in zip(trace.command, trace.actual, strict=True)]

    def judge(name: str, fit: Callable[[Masks, int], LagFit | DriveFit]) -> _Judged:
        first, second, whole = (fit(use, rank) for rank, use in enumerate(uses))
        rest = tuple(
            e - np.where(in_first, second.error[rank], first.error[rank])
            for rank, (e, in_first) in enumerate(zip(measured, early, strict=True))
        )
        fitted = tuple(e - model for e, model in zip(measured, whole.error, strict=True))
        return _Judged(name, (first, second), whole, rest, fitted)

    def lag(use: Masks, *, dead_time: bool) -> LagFit:
        return fit_lag(trace.command, trace.actual, use, period_s, dead_time=dead_time)

    found = [judge("servo lag", lambda use, _: lag(use, dead_time=False))]
    tell(0.1)
    found.append(judge("dead time and servo lag", lambda use, _: lag(use, dead_time=True)))
    tell(0.2)
    if with_drive:
        starts = (*found[-1].halves, found[-1].whole)
        steps = iter(np.linspace(0.2, 1.0, 7)[1:])

        def drive(use: Masks, rank: int) -> DriveFit:
            start = starts[rank]
            assert isinstance(start, LagFit)
            return fit_drive(trace.command, trace.actual, use, period_s, start, lambda: tell(float(next(steps))))

        found.append(judge("drive", drive))
    return found


def _drive_parameters(whole: DriveFit, halves: Sequence[DriveFit], unit: str) -> tuple[ServoEstimate, ...]:
    """Values of the fit to all, with the range of all three fits; one that the halves do not agree on is not known."""
    rows: tuple[tuple[str, Callable[[DriveFit], float], str], ...] = (
        ("drive: dead time", lambda each: each.dead_s, "s"),
        ("drive: position gain", lambda each: each.gain_per_s, "1/s"),
        ("drive: feed-forward", lambda each: 1.0 - each.rest, "1"),
        ("drive: speed loop", lambda each: each.bandwidth_hz, "Hz"),
        ("drive: integral time", lambda each: each.integral_time_s, "s"),
        ("drive: friction over mass", lambda each: each.coulomb, f"{unit}/s²"),
    )
    out = []
    for name, take, of in rows:
        values = [take(each) for each in (whole, *halves)]
        low, high = min(values), max(values)
        agree = high <= 1.5 * low
        note = "range of three fits" if agree else "the halves do not agree on it"
        out.append(ServoEstimate(name, values[0] if agree else None, low, high, of, note))
    return tuple(out)


def _two_lags(trace: ServoTrace, speeds: Sequence[FloatArray], top: float) -> str:
    """Says where the lag at constant speed is not one number."""
    found: list[tuple[float, float, float]] = []  # lag over speed, speed, time
    for r, x, speed, time in zip(trace.command, trace.actual, speeds, trace.time_s, strict=True):
        count = 25
        for start in range(0, len(r) - 2 * count, count):
            part = slice(start, start + 2 * count)
            mean = float(np.mean(speed[part]))
            if abs(mean) > _LEAST_SPEED * top and float(np.ptp(speed[part])) < 1e-3 * abs(mean):
                late = slice(start + count, start + 2 * count)
                found.append((float(np.mean(r[late] - x[late])) / mean, mean, float(time[start])))
    if not found:
        return ""
    least, most = min(found), max(found)
    if most[0] - least[0] <= _LAG_SPREAD * abs(most[0]):
        return ""
    return (
        f"the lag at constant speed is {1e3 * least[0]:.3f} ms at {least[1]:.5g} {trace.unit}/s ({least[2]:.2f} s) and "
        f"{1e3 * most[0]:.3f} ms at {most[1]:.5g} {trace.unit}/s ({most[2]:.2f} s): the control changed its loop "
        "there, and no one model follows"
    )
