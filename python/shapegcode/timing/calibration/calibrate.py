"""Calibrates the cycle-time model of a machine from programs and their run logs."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from shapegcode import _core
from shapegcode.errors import ArgumentError
from shapegcode.io.units import FloatArray
from shapegcode.machine import Machine
from shapegcode.program import Program
from shapegcode.timing.calibration import motion as fitting, observed as logs, open_times, result
from shapegcode.timing.calibration.runs_file import RunsFile, load_runs
from shapegcode.timing.cycle_time import time_interval

_Hold = tuple[float, float, str]  # begin and length in s, and reason
_Runs = Sequence[logs.ObservedRun]

_MAX_FOLDS = 4
_BETTER = 0.97  # a later family must have at most this ratio of the error to be chosen
_MAX_HOLDS = 6  # plausible number of holds in one run
_CALLS = 2500  # approximate misfit evaluations per fit, for the progress bar


@dataclass(frozen=True, eq=False)
class _Calibration:
    """Motion and function times calibrated from a subset of the runs."""

    motion: fitting.MotionFit
    functions: fitting.FunctionFit
    machine: Machine

    @classmethod
    def of(cls, runs: _Runs, motion: fitting.MotionFit, machine: Machine) -> _Calibration:
        return cls(motion, fitting.fit_functions(runs, motion, machine), machine)

    def starts(self, run: logs.ObservedRun) -> FloatArray:
        functions = self.functions
        model = fitting.whole_model(self.machine, self.motion, functions.values, functions.last_tool_in_spindle)
        return _predicted_starts(run, model)


def calibrate_cycle_time(
    runs: RunsFile | str | Path,
    machine: Machine,
    *,
    families: Sequence[str] | None = None,
    on_progress: Callable[[float], None] = lambda _done: None,
) -> result.CycleTimeCalibration:
    """Calibrate the cycle-time model of a machine from run logs.

    Logs are aligned with their programs by line; overrides and holds are found. Several kinds of look-ahead are fitted
    to the times of motion between M, S and T words; the one that best predicts programs (or runs, if there is only one
    program) to which it was not fitted is chosen. Times of tool changes, M codes, spindle and unknown travels follow by
    least squares.

    Args:
        runs: pairs of program and log, or the file that lists them (RUNS.toml).
        machine: machine that gets the parameters and determines how programs are read.
        families: names of the kinds of look-ahead to try; None: all.
        on_progress: called with the completed fraction, 0 to 1.

    Returns:
        Parameters with 95 % intervals, the calibrated machine, and each run with its prediction.

    Raises:
        ArgumentError: no run to fit, too few readings of lines in cuts, or an unknown family.
        RecordError: a log does not match its program, or cannot be used; with the line.
        ProgramError, RunsFileError: bad input.
        OSError: a file cannot be read.
    """
    file = runs if isinstance(runs, RunsFile) else load_runs(runs)
    tried = _families(families)
    observed = _observed(file, machine)
    # The rapid rate is from the fitted runs; for the others it gives the override.
    fitted, others_seen = ([run for run in observed if run.entry.use == use] for use in ("fit", "test"))
    rate, fitted = logs.rapid_rate(fitted)
    observed = [*fitted, *(logs.with_override(run, rate) for run in others_seen)]
    if not fitted:
        raise ArgumentError(f'{file.path}: no run has use = "fit": there is nothing to calibrate with')
    folds = _folds(fitted)
    fits, scores = _tried(tried, fitted, folds, machine, rate, on_progress)
    order = [score.cross_validated_s if score.cross_validated_s is not None else score.fitted_s for score in scores]
    best = 0
    for index, error in enumerate(order):
        best = index if error < _BETTER * order[best] else best
    motion = fits[best]
    learned = _Calibration.of(fitted, motion, machine)
    rivals = []
    for fit, weight in zip(fits, open_times.kind_weights(order, best), strict=True):
        if fit is not motion and weight >= open_times.MIN_WEIGHT:
            rivals.append((_Calibration.of(fitted, fit, machine), weight))
    others = _left_out(fitted, folds, motion, machine, rate)
    rows = [_row(run, learned, others.get(id(run))) for run in observed]
    scatters = _scatters(rows, observed, learned)
    with_it, remarks, numbers, undetermined = learned_machine(learned, fitted, rivals, scatters)
    rows = [_with_interval(row, run, with_it) for row, run in zip(rows, observed, strict=True)]
    return result.CycleTimeCalibration(
        machine=machine.name,
        family=motion.family.name,
        families=tuple(scores),
        numbers=tuple(numbers),
        runs=tuple(rows),
        fitted=with_it,
        remarks=remarks,
        undetermined=tuple(undetermined),
        warnings=tuple(dict.fromkeys(warning for row in rows for warning in _warnings(row))),
    )


def _families(names: Sequence[str] | None) -> list[fitting.LookAhead]:
    if names is None:
        return list(fitting.FAMILIES)
    known = {family.name: family for family in fitting.FAMILIES}
    for name in names or [""]:
        if name not in known:
            raise ArgumentError(f"kind of look-ahead {name!r}: must be one of {', '.join(known)}")
    return [known[name] for name in names]


def _observed(file: RunsFile, machine: Machine) -> list[logs.ObservedRun]:
    timed: dict[Path, logs.TimedProgram] = {}
    found = []
    for entry in file.used:
        path = entry.program.resolve()
        if path not in timed:
            timed[path] = logs.timed_program(Program.read(entry.program, machine))
        found += [logs.observe(entry, log, timed[path], machine) for log in entry.read()]
    return found


def _folds(runs: _Runs) -> list[list[logs.ObservedRun]]:
    """Cross-validation groups: runs of one or more programs, or two groups of one program (weaker); empty: one."""
    by_program: dict[int, list[logs.ObservedRun]] = defaultdict(list)
    for run in runs:
        by_program[id(run.timed)].append(run)
    groups = list(by_program.values()) if len(by_program) > 1 else [[run] for run in runs]
    count = min(_MAX_FOLDS if len(by_program) > 1 else 2, len(groups))
    folds = [[run for group in groups[rank::count] for run in group] for rank in range(count)]
    return folds if count > 1 else []


def _tried(
    tried: Sequence[fitting.LookAhead],
    runs: _Runs,
    folds: Sequence[_Runs],
    machine: Machine,
    rate: float,
    on_progress: Callable[[float], None],
) -> tuple[list[fitting.MotionFit], list[result.FamilyScore]]:
    sections = fitting.sections_of(runs)
    if not sections:
        raise ArgumentError(
            "no log reports lines of a section of cuts often enough (10 readings): there is nothing to calibrate with"
        )
    count = len(tried) * (1 + len(folds))
    done = steps = 0

    def on_step() -> None:
        nonlocal steps
        steps += 20
        on_progress(0.97 * (done + min(0.99, steps / _CALLS)) / count)

    fits, scores = [], []
    for family in tried:
        fit = fitting.fit_motion(runs, family, machine, rate, on_step=on_step)
        done, steps = done + 1, 0
        left_out = []
        for fold in folds:
            rest = [run for run in runs if run not in fold]
            part = fitting.fit_motion(rest, family, machine, rate, on_step=on_step, thorough=False)
            left_out.append(fitting.misfit(fitting.sections_of(fold), part.model(machine)))
            done, steps = done + 1, 0
        fits.append(fit)
        score = fitting.misfit(sections, fit.model(machine))
        scores.append(
            result.FamilyScore(family.name, family.meaning, score, float(np.mean(left_out)) if left_out else None)
        )
    return fits, scores


def _left_out(
    runs: _Runs, folds: Sequence[_Runs], motion: fitting.MotionFit, machine: Machine, rate: float
) -> dict[int, _Calibration]:
    """Calibration for each run, from the runs outside its fold (cross-validation)."""
    found: dict[int, _Calibration] = {}
    for fold in folds:
        rest = [run for run in runs if run not in fold]
        other = _Calibration.of(rest, fitting.fit_motion(rest, motion.family, machine, rate), machine)
        found |= {id(run): other for run in fold}
    return found


def _warnings(row: result.CalibrationRun) -> Iterator[str]:
    judged = row.judged_percent
    if judged is not None and abs(judged) > result.TOLERANCE_PERCENT:
        yield f"{row.name}: {judged:+.1f} % from the measured time, more than {result.TOLERANCE_PERCENT:g} %"
    if len(row.holds) > _MAX_HOLDS:
        yield (
            f"{row.name}: stopped {len(row.holds)} times without a programmed stop, first at "
            f"{row.holds[0]}: the program may have been changed after the run"
        )
    else:
        yield from (f"{row.name}: hold at {hold}" for hold in row.holds)


def _row(run: logs.ObservedRun, learned: _Calibration, other: _Calibration | None) -> result.CalibrationRun:
    starts = learned.starts(run)
    holds = _holds_of(run, starts)
    tools, kinds = _shares(run, starts, holds)
    return result.CalibrationRun(
        program=str(run.entry.program),
        log=run.log.source,
        use=run.entry.use,
        measured_s=run.duration_s,
        held_s=sum(length for _, length, _ in holds),
        predicted_s=float(starts[-1]),
        low_s=math.nan,
        high_s=math.nan,
        cross_validated_s=float(other.starts(run)[-1]) if other is not None else None,
        feed_override=_feed_override(run),
        rapid_override=run.rapid_override,
        tools=tools,
        kinds=kinds,
        holds=tuple(f"{begin:.1f} s: {length:.1f} s, {why}" for begin, length, why in holds),
        notes=run.notes,
    )


def _scatters(rows: Sequence[result.CalibrationRun], observed: _Runs, learned: _Calibration) -> tuple[float, float]:
    """Scatter of the time between two cuts, s, and relative scatter of repeated runs of a program."""
    ratios: dict[str, list[float]] = defaultdict(list)
    late: dict[str, list[float]] = defaultdict(list)
    for row, run in zip(rows, observed, strict=True):
        if row.use == "fit" and row.error_percent is not None:
            ratios[row.program].append(1.0 / (1.0 + row.error_percent / 100.0))
            share = next(each for each in row.kinds if each.name == "between cuts")
            late[row.program].append((share.measured_s - share.predicted_s) / math.sqrt(max(1, len(run.cut_sections))))
    # Errors of repeated codes are correlated and show in whole programs.
    together = float(np.sqrt(np.mean([np.mean(each) ** 2 for each in late.values()]))) if late else 0.0
    return max(learned.functions.scatter_s, together), open_times.run_scatter(ratios)


def _with_interval(row: result.CalibrationRun, run: logs.ObservedRun, machine: Machine) -> result.CalibrationRun:
    """Add the interval of the predicted time, as wide in percent as `time` gives it at the run's overrides."""
    interval = time_interval(run.timed.program, machine, row.feed_override, row.rapid_override)
    half = interval.half_width_s * row.predicted_s / interval.total_s if interval and interval.total_s > 0.0 else 0.0
    return replace(row, low_s=row.predicted_s - half, high_s=row.predicted_s + half)


_MIN_HOLD_S = 2.0
_READING_S = 0.35  # a time between two readings may be longer by this, as each may be late


def _predicted_starts(run: logs.ObservedRun, model: _core.FanucModel) -> FloatArray:
    """(line_count + 2,) Start time of each line at the overrides of the run, s; the last entry is the end."""
    starts_at = fitting.starts_of(model)
    starts = starts_at(run, 1.0).copy()
    for cut_section in sorted(run.cut_sections, key=lambda each: each.feed_override):
        if cut_section.feed_override != 1.0:
            other = starts_at(run, cut_section.feed_override)
            first, last = cut_section.lines
            gone = (other[first : last + 2] - other[first]) - (starts[first : last + 2] - starts[first])
            starts[first : last + 2] += gone
            starts[last + 2 :] += gone[-1]
    return starts


def _holds_of(run: logs.ObservedRun, starts: FloatArray) -> list[_Hold]:
    """Find stops in a run that are not programmed."""
    found = [(begin, length, "hold") for begin, length in run.log.holds]
    found = [_not_covered(run, starts, hold) for hold in (*found, *_held_rapids(run))]
    found = [hold for hold in found if hold[1] > _READING_S]
    line, time_s = run.line, run.time_s
    expected = np.diff(starts[line])
    late = np.diff(time_s) - expected - _READING_S
    for index in np.flatnonzero(late > np.maximum(_MIN_HOLD_S, 0.5 * expected)):
        if run.timed.function[line[index] : line[index + 1]].any():
            continue  # times between cuts scatter
        begin, end = float(time_s[index]), float(time_s[index + 1])
        if not any(begin < other + length and other < end for other, length, _ in found):
            found.append((begin, float(late[index]), f"stopped at line {line[index]}"))
    return sorted(found)


def _held_rapids(run: logs.ObservedRun) -> list[_Hold]:
    signal = run.log.rapid_override
    if signal is None or run.duration_s is None:
        return []
    ends = np.append(signal.time_s[1:], run.duration_s)
    low = signal.value < 0.1 * max(run.rapid_override, 0.1)
    cutting = np.isfinite(run.timed.feed_mm_per_s)
    found: list[_Hold] = []
    for begin, end, is_low in zip(signal.time_s, ends, low, strict=True):
        if not is_low:
            continue
        at = int(np.searchsorted(run.time_s, end, side="right")) - 1
        following = run.line[min(at + 1, len(run.line) - 1)]
        if at >= 0 and cutting[run.line[at]] and not run.timed.rapid[run.line[at] : following + 1].any():
            continue
        if found and begin - (found[-1][0] + found[-1][1]) < 0.5:
            found[-1] = (found[-1][0], float(end) - found[-1][0], found[-1][2])
        else:
            found.append((float(begin), float(end - begin), "rapids stopped by their override"))
    return [hold for hold in found if hold[1] > 1.0]


def _not_covered(run: logs.ObservedRun, starts: FloatArray, hold: _Hold) -> _Hold:
    """Part of a hold that lengthened the run; during the rest a spindle start or an M code may have been executed."""
    begin, length, why = hold
    plain = np.flatnonzero(~run.timed.function[run.line] & np.isfinite(run.timed.feed_mm_per_s[run.line]))
    before = plain[run.time_s[plain] <= begin]
    behind = plain[run.time_s[plain] >= begin + length]
    since, at = (float(run.time_s[before[-1]]), float(starts[run.line[before[-1]]])) if len(before) else (0.0, 0.0)
    if not len(behind):
        return hold
    late = float(run.time_s[behind[0]]) - since - (float(starts[run.line[behind[0]]]) - at)
    return begin, min(length, max(0.0, late)), why


def _shares(
    run: logs.ObservedRun, starts: FloatArray, holds: list[_Hold]
) -> tuple[tuple[result.CycleTimePart, ...], tuple[result.CycleTimePart, ...]]:
    """Split a run by tool, and by kind of motion."""
    end_s = run.duration_s
    if end_s is None:
        return (), ()
    tools = run.timed.tools[1:-1]
    changes = [int(each) + 2 for each in np.flatnonzero(np.diff(tools) != 0) if tools[each] >= 0]
    began = np.minimum(np.searchsorted(run.line, changes), len(run.line) - 1)
    seen = [0.0, *run.time_s[began].tolist(), end_s]
    expected = [0.0, *(float(starts[line]) for line in changes), float(starts[-1])]
    shares: dict[str, tuple[float, float]] = {}
    for index, until in enumerate([*(line - 1 for line in changes), len(tools)]):
        tool = int(tools[until - 1])
        name = f"T{tool}" if tool >= 0 else "no tool"
        measured, predicted = shares.get(name, (0.0, 0.0))
        measured += seen[index + 1] - seen[index] - _held(holds, seen[index], seen[index + 1])
        shares[name] = measured, predicted + expected[index + 1] - expected[index]
    cut_measured = cut_predicted = 0.0
    for cut_section in run.cut_sections:
        inside = np.flatnonzero((run.line >= cut_section.lines[0]) & (run.line <= cut_section.lines[1]))
        if len(inside) >= 2:
            ends = inside[[0, -1]]
            begin_s, until_s = run.time_s[ends].tolist()
            cut_measured += until_s - begin_s - _held(holds, begin_s, until_s)
            cut_predicted += float(np.diff(starts[run.line[ends]])[0])
    between = end_s - _held(holds, 0.0, end_s) - cut_measured, float(starts[-1]) - cut_predicted
    kinds = result.CycleTimePart("cuts", cut_measured, cut_predicted), result.CycleTimePart("between cuts", *between)
    return tuple(result.CycleTimePart(name, *both) for name, both in shares.items()), kinds


def _held(holds: list[_Hold], begin_s: float, end_s: float) -> float:
    return sum(max(0.0, min(begin + length, end_s) - max(begin, begin_s)) for begin, length, _ in holds)


_USUAL = 0.75  # fraction of the time
_MAX_MOVE_S = 10.0  # limit of times.unknown_move_s
_KNOWN = 4.0  # ratio to the value: an interval that reaches it on either side determines nothing


def _feed_override(run: logs.ObservedRun) -> float:
    """Feed override at which a run cut most of its lines."""
    return logs.longest((each.feed_override, each.lines[1] - each.lines[0]) for each in run.cut_sections)[0]


def learned_machine(
    learned: _Calibration, runs: _Runs, rivals: Sequence[tuple[_Calibration, float]], scatters: tuple[float, float]
) -> tuple[Machine, dict[str, str], list[result.CalibratedParameter], list[str]]:
    """The calibrated machine, its remarks, the parameters, and descriptions of those that the logs do not determine."""
    motion, functions, machine = learned.motion, learned.functions, learned.machine
    source = f"logs of {len(runs)} runs"
    values = motion.file_values() | _function_values(functions, runs)
    covariance, variances = fitting.parameter_covariance(motion, runs, machine)
    numbers, remarks = _motion_numbers(machine, motion, variances, source)
    rate = motion.rapid_mm_per_s * 60.0
    if math.isfinite(rate):
        key, meaning = "axes.x|y|z.rapid_mm_per_min", "rate of rapids, of the fastest axis"
        limits = rate, 0.99 * rate, 1.01 * rate
        numbers.append(_number(key, meaning, limits, "mm/min", True, machine.axes.x.rapid_mm_per_min))
    for name, value in functions.values.items():
        key, meaning, unit = _meaning(name)
        low, high = functions.low[name], functions.high[name]
        numbers.append(_number(key, meaning, (value, low, high), unit, high - low < max(2.0, 2.0 * value)))
    undetermined = [
        f"{number.meaning} ({number.key}): the runs allow {number.low:.3g} to {number.high:.3g} {number.unit}"
        for number in numbers
        if not number.is_determined
    ]
    if not math.isfinite(rate):
        undetermined.append("rapid rate: no log shows a rapid at constant speed; the value of the file is kept")
    values["times.scatter"] = {
        "cuts_percent": round(100.0 * open_times.cut_scatter(runs, motion, machine), 3),
        "between_cuts_s": round(scatters[0], 3),
        "runs_percent": round(100.0 * scatters[1], 3),
    }
    rows = open_times.motion_rows(motion, covariance, runs, machine)
    rows += open_times.function_rows(functions, partial(_function_values, runs=runs), lambda name: _meaning(name)[1])
    for other, weight in rivals:
        its_values = other.motion.file_values() | _function_values(other.functions, runs)
        rows += open_times.open_row(f"kind of look-ahead ({other.motion.family.name})", values, its_values, weight)
    values["times.open"] = rows
    for key in values:
        if key != "times.open":  # times.scatter already states the origin of its rows
            remarks.setdefault(key, f"measured ({source})")
    fitted = machine.with_values(values, source=f"{machine.name} with calibrated parameters")
    return fitted.with_remarks(machine.all_remarks() | remarks), remarks, numbers, undetermined


def _motion_numbers(
    machine: Machine, motion: fitting.MotionFit, variances: FloatArray, source: str
) -> tuple[list[result.CalibratedParameter], dict[str, str]]:
    numbers, remarks = [], {}
    for parameter, variance in zip(motion.family.parameters, variances, strict=True):
        fitted, ratio = motion.values[parameter.name], math.exp(min(1.96 * math.sqrt(variance), 5.0))
        value = fitted * parameter.scale
        low = max(parameter.low, fitted / ratio) * parameter.scale
        high = min(parameter.high, fitted * ratio) * parameter.scale
        told = low > value / _KNOWN and high < value * _KNOWN
        key = parameter.key.format(axis="|".join(parameter.axes))
        had = _had(machine, parameter.key.format(axis=parameter.axes[:1]))
        numbers.append(_number(key, parameter.meaning, (value, low, high), parameter.unit, told, had))
        for axis in parameter.axes or " ":
            target = parameter.key.format(axis=axis)
            target = target.rpartition(".")[0] if target.startswith("controller.corner_speed") else target
            remarks[target] = f"measured ({source}): {low:.4g} ... {high:.4g} {parameter.unit}"
    return numbers, remarks


def _number(
    key: str, meaning: str, values: tuple[float, float, float], unit: str, told: bool, had: float | None = None
) -> result.CalibratedParameter:
    """A parameter and its interval, rounded for display."""
    value, low, high = (float(f"{each:.4g}") for each in values)
    return result.CalibratedParameter(key, meaning, value, low, high, unit, told, had)


# Key, meaning and unit of times in addition to motion, by name in the fit; other names are M codes.
_FUNCTIONS = {
    "start": ("times.program_start_s", "from the start key to the first block", "s"),
    "tool change": ("times.tool_change_s", "tool change", "s"),
    "move xy": ("times.unknown_move_s.x|y", "rapid of X and Y over an unknown travel", "s"),
    "move z": ("times.unknown_move_s.z", "rapid of Z over an unknown travel", "s"),
    "spindle start": ("times.spindle_start", "start of the spindle, per 1000/min", "s"),
    "spindle start from": ("times.spindle_start", "start of the spindle takes time from", "1000/min"),
    "spindle stop": ("times.spindle_stop", "stop of the spindle, per 1000/min", "s"),
    "spindle stop from": ("times.spindle_stop", "stop of the spindle takes time from", "1000/min"),
}


def _meaning(name: str) -> tuple[str, str, str]:
    """Key, meaning and unit of a time that is added to that of the motion."""
    return _FUNCTIONS.get(name) or ("times.m_codes", f"M{int(name[1:]):02d}", "s")


def _usual(overrides: Iterable[float], runs: _Runs) -> float:
    """Override of most of the run time; 1 if the operator changed it often."""
    value, ratio = logs.longest(zip(overrides, (run.duration_s or 0.0 for run in runs), strict=True))
    return value if ratio >= _USUAL else 1.0


def _had(machine: Machine, key: str) -> float | None:
    target: object = machine
    for name in key.split("."):
        target = getattr(target, name, None)
    target = getattr(target, "x", target)
    return float(target) if isinstance(target, int | float) else None


def _function_values(functions: fitting.FunctionFit, runs: _Runs) -> dict[str, object]:
    values = functions.values
    codes = {code: round(value, 3) for code, value in fitting.m_codes(values).items() if round(value, 3) >= 0.005}
    move_xy, move_z = (min(round(values.get(name, 0.0), 3), _MAX_MOVE_S) for name in ("move xy", "move z"))
    feed = _usual(map(_feed_override, runs), runs)
    rapid = _usual((run.rapid_override for run in runs), runs)
    found: dict[str, object] = {
        "times.program_start_s": round(values.get("start", 0.0), 3),
        "times.tool_change_s": round(values.get("tool change", 0.0), 3),
        "times.last_tool_in_spindle": functions.last_tool_in_spindle,
        "times.m_function_s": 0.0,
        "times.unknown_move_s": {"x": move_xy, "y": move_xy, "z": move_z},
        "times.feed_override_percent": round(100.0 * feed, 2),
        "times.rapid_override_percent": round(100.0 * rapid, 2),
        "times.m_codes": {"code": list(codes), "s": list(codes.values())} if codes else None,
    }
    for name in ("spindle start", "spindle stop"):
        rows = fitting.spindle_rows(values, name)
        table = {"rpm": [round(row[0], 1) for row in rows], "s": [round(row[1], 3) for row in rows]} if rows else None
        found[f"times.{name.replace(' ', '_')}"] = table
    return found
