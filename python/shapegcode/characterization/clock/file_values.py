"""What was learned as numbers of the machine file, with their intervals and where they come from."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Sequence

from shapegcode.characterization.clock.families import machine_values
from shapegcode.characterization.clock.function_fit import FunctionFit, spindle_rows
from shapegcode.characterization.clock.motion_fit import MotionFit, parameter_intervals
from shapegcode.characterization.clock.observed import ObservedRun
from shapegcode.characterization.clock.result import LearnedNumber
from shapegcode.characterization.clock.windows import clocks_of
from shapegcode.machine import Machine

__all__ = ["feeds_of", "learned_machine", "usual_value"]

_USUAL = 0.75  # of the time
_KNOWN = 4.0  # an interval that reaches so far from its value to both sides tells nothing


def feeds_of(run: ObservedRun) -> list[tuple[float, float]]:
    """Feed overrides of a run."""
    return [(each.feed_override, each.lines[1] - each.lines[0]) for each in run.stretches]


def usual_value(runs: Sequence[ObservedRun], values: Callable[[ObservedRun], Sequence[tuple[float, float]]]) -> float:
    """The value that held for the longest part."""
    held: dict[float, float] = defaultdict(float)
    for run in runs:
        for value, weight in values(run):
            held[value] += weight
    return max(held, key=lambda value: held[value]) if held else 1.0


def learned_machine(
    machine: Machine, motion: MotionFit, functions: FunctionFit, runs: Sequence[ObservedRun]
) -> tuple[Machine, dict[str, str], list[LearnedNumber], list[str]]:
    """The machine with what was learned."""
    source = f"logs of {len(runs)} runs"
    values = machine_values(motion.family, motion.values, motion.rapid_mm_per_s)
    values.update(_function_values(functions, runs))
    numbers, remarks = _motion_numbers(machine, motion, runs, source)
    if math.isfinite(motion.rapid_mm_per_s):
        rate = motion.rapid_mm_per_s * 60.0
        bounds = _digits(rate), _digits(0.99 * rate), _digits(1.01 * rate)
        had = machine.axes.x.rapid_mm_per_min
        numbers.append(
            LearnedNumber(
                "axes.x|y|z.rapid_mm_per_min", "rate of rapids, of the fastest axis", *bounds, "mm/min", True, had
            )
        )
    numbers += _function_numbers(functions)
    not_told = [
        f"{number.meaning} ({number.key}): the runs bear {number.low:.3g} to {number.high:.3g} {number.unit}"
        for number in numbers
        if not number.told
    ]
    if not math.isfinite(motion.rapid_mm_per_s):
        not_told.append("rapid rate: no log shows a rapid that runs steadily; the file keeps what it had")
    for key in values:
        remarks.setdefault(key, f"measured ({source})")
    fitted = machine.with_values(values, source=f"{machine.name} with what was learned")
    return fitted.with_remarks(machine.all_remarks() | remarks), remarks, numbers, not_told


def _motion_numbers(
    machine: Machine, motion: MotionFit, runs: Sequence[ObservedRun], source: str
) -> tuple[list[LearnedNumber], dict[str, str]]:
    intervals = parameter_intervals(motion, clocks_of(runs), machine)
    numbers, remarks = [], {}
    for parameter in motion.family.parameters:
        value = motion.values[parameter.name] * parameter.scale
        low, high = (bound * parameter.scale for bound in intervals[parameter.name])
        told = low > value / _KNOWN and high < value * _KNOWN
        key = parameter.key.format(axis="|".join(parameter.axes))
        had = _had(machine, parameter.key.format(axis=parameter.axes[:1]))
        numbers.append(
            LearnedNumber(
                key, parameter.meaning, _digits(value), _digits(low), _digits(high), parameter.unit, told, had
            )
        )
        for axis in parameter.axes or " ":
            place = parameter.key.format(axis=axis)
            place = place.rpartition(".")[0] if place.startswith("controller.corner_speed") else place
            remarks[place] = f"measured ({source}): {low:.4g} ... {high:.4g} {parameter.unit}"
    return numbers, remarks


def _function_numbers(functions: FunctionFit) -> list[LearnedNumber]:
    numbers = []
    for name, key, meaning, unit in _function_rows(functions):
        value, low, high = functions.values[name], functions.low[name], functions.high[name]
        told = high - low < max(2.0, 2.0 * value)
        numbers.append(LearnedNumber(key, meaning, _digits(value), _digits(low), _digits(high), unit, told))
    return numbers


def _shops_usual(dialled: Sequence[tuple[float, float]]) -> float:
    """The override at which most of the time was run; 1 where the operator had it now so, now otherwise."""
    held: dict[float, float] = defaultdict(float)
    for value, seconds in dialled:
        held[value] += seconds
    most = max(held, key=lambda value: held[value])
    return most if held[most] >= _USUAL * sum(held.values()) else 1.0


def _digits(value: float) -> float:
    """A number to what a person reads."""
    return float(f"{value:.4g}")


def _had(machine: Machine, key: str) -> float | None:
    place: object = machine
    for name in key.split("."):
        place = getattr(place, name, None)
    if isinstance(place, int | float):
        return float(place)
    return float(place.x) if place is not None and hasattr(place, "x") else None


def _function_rows(functions: FunctionFit) -> list[tuple[str, str, str, str]]:
    """Name in the fit, key, meaning and unit of what takes time beside the motion."""
    known = {
        "start": ("times.program_start_s", "from the start key to the first block", "s"),
        "tool change": ("times.tool_change_s", "tool change", "s"),
        "way xy": ("times.unknown_move_s.x|y", "rapid of X and Y on a way that is not known", "s"),
        "way z": ("times.unknown_move_s.z", "rapid of Z on a way that is not known", "s"),
        "spindle start": ("times.spindle_start", "start of the spindle, per 1000/min", "s"),
        "spindle start from": ("times.spindle_start", "start of the spindle takes time from", "1000/min"),
        "spindle stop": ("times.spindle_stop", "stop of the spindle, per 1000/min", "s"),
        "spindle stop from": ("times.spindle_stop", "stop of the spindle takes time from", "1000/min"),
    }
    return [
        (name, *known[name]) if name in known else (name, "times.m_codes", f"M{int(name[1:]):02d}", "s")
        for name in functions.values
    ]


def _function_values(functions: FunctionFit, runs: Sequence[ObservedRun]) -> dict[str, object]:
    values = functions.values
    codes = {int(name[1:]): round(value, 3) for name, value in values.items() if name[0] == "M" and name[1:].isdigit()}
    codes = {code: value for code, value in codes.items() if value >= 0.005}
    way_xy, way_z = (round(values.get(name, 0.0), 3) for name in ("way xy", "way z"))
    feed = _shops_usual([(usual_value([run], feeds_of), run.duration_s or 0.0) for run in runs])
    rapid = _shops_usual([(run.rapid_override, run.duration_s or 0.0) for run in runs])
    found: dict[str, object] = {
        "times.program_start_s": round(values.get("start", 0.0), 3),
        "times.tool_change_s": round(values.get("tool change", 0.0), 3),
        "times.last_tool_in_spindle": functions.last_tool_in_spindle,
        "times.m_function_s": 0.0,
        "times.unknown_move_s": {"x": way_xy, "y": way_xy, "z": way_z},
        "times.feed_override_percent": round(100.0 * feed, 2),
        "times.rapid_override_percent": round(100.0 * rapid, 2),
        "times.m_codes": {"code": list(codes), "s": list(codes.values())} if codes else None,
    }
    for name in ("spindle start", "spindle stop"):
        rows = spindle_rows(values, name)
        table = {"rpm": [round(row[0], 1) for row in rows], "s": [round(row[1], 3) for row in rows]} if rows else None
        found[f"times.{name.replace(' ', '_')}"] = table
    return found
