"""What a model says of a run that was observed: when each line begins, at its overrides; where it was held."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from shapegcode import _core
from shapegcode.characterization.clock.observed import ObservedRun
from shapegcode.characterization.clock.result import LearnedShare
from shapegcode.characterization.clock.windows import line_starts

__all__ = ["holds_of", "predicted_starts", "shares_of"]

FloatArray = npt.NDArray[np.float64]

_LEAST_HOLD_S = 2.0
_READING_S = 0.35  # what two readings may hide


def predicted_starts(run: ObservedRun, model: _core.ControllerModel) -> FloatArray:
    """(line_count + 2,) When each line begins, s; the last entry is the end."""
    model.rapid_override = run.rapid_override
    model.feed_override = 1.0
    starts = line_starts(run.played, model)
    for override in run.feed_overrides:
        if override == 1.0:
            continue
        model.feed_override = override
        other = line_starts(run.played, model)
        for stretch in run.stretches:
            if stretch.feed_override == override:
                first, last = stretch.lines
                gone = (other[first : last + 2] - other[first]) - (starts[first : last + 2] - starts[first])
                starts[first : last + 2] += gone
                starts[last + 2 :] += gone[-1]
    model.feed_override = 1.0
    return starts


def holds_of(run: ObservedRun, starts: FloatArray) -> list[tuple[float, float, str]]:
    """Where a run stood still though no program asks for it."""
    found = [(begin, length, "hold") for begin, length in run.log.holds]
    found = [_not_covered(run, starts, hold) for hold in (*found, *_held_rapids(run))]
    found = [hold for hold in found if hold[1] > _READING_S]
    line, time_s = run.line, run.time_s
    expected = np.diff(starts[line])
    late = np.diff(time_s) - expected - _READING_S
    for index in np.flatnonzero(late > np.maximum(_LEAST_HOLD_S, 0.5 * expected)):
        if run.played.function[line[index] : line[index + 1]].any():
            continue  # what lies between cuts scatters
        begin, end = float(time_s[index]), float(time_s[index + 1])
        if not any(begin < other + length and other < end for other, length, _ in found):
            found.append((begin, float(late[index]), f"stood at line {line[index]}"))
    return sorted(found)


def _held_rapids(run: ObservedRun) -> list[tuple[float, float, str]]:
    signal = run.log.rapid_override
    if signal is None or run.duration_s is None:
        return []
    ends = np.append(signal.time_s[1:], run.duration_s)
    low = signal.value < 0.1 * max(run.rapid_override, 0.1)
    cutting = np.isfinite(run.played.feed_mm_per_s)
    found: list[tuple[float, float, str]] = []
    for begin, end, is_low in zip(signal.time_s, ends, low, strict=True):
        if not is_low:
            continue
        at = int(np.searchsorted(run.time_s, end, side="right")) - 1
        if (
            at >= 0
            and cutting[run.line[at]]
            and not run.played.rapid[run.line[at] : run.line[min(at + 1, len(run.line) - 1)] + 1].any()
        ):
            continue
        if found and begin - (found[-1][0] + found[-1][1]) < 0.5:
            found[-1] = (found[-1][0], float(end) - found[-1][0], found[-1][2])
        else:
            found.append((float(begin), float(end - begin), "rapids held by their override"))
    return [hold for hold in found if hold[1] > 1.0]


def _not_covered(run: ObservedRun, starts: FloatArray, hold: tuple[float, float, str]) -> tuple[float, float, str]:
    """What a hold added to the run: a spindle that starts, or coolant, may pass within it."""
    begin, length, why = hold
    plain = np.flatnonzero(~run.played.function[run.line] & np.isfinite(run.played.feed_mm_per_s[run.line]))
    before = plain[run.time_s[plain] <= begin]
    behind = plain[run.time_s[plain] >= begin + length]
    since, at = (float(run.time_s[before[-1]]), float(starts[run.line[before[-1]]])) if len(before) else (0.0, 0.0)
    if not len(behind):
        return hold
    late = float(run.time_s[behind[0]]) - since - (float(starts[run.line[behind[0]]]) - at)
    return begin, min(length, max(0.0, late)), why


def shares_of(
    run: ObservedRun, starts: FloatArray, holds: list[tuple[float, float, str]]
) -> tuple[tuple[LearnedShare, ...], tuple[LearnedShare, ...]]:
    """A run by tool, and by kind of motion."""
    end_s = run.duration_s
    if end_s is None:
        return (), ()
    tools = run.played.tools[1:-1]
    changes = [1, *(int(each) + 2 for each in np.flatnonzero(np.diff(tools) != 0) if tools[each] >= 0)]
    edges = [0.0, *(_seen(run, line) for line in changes[1:]), end_s]
    expected = [0.0, *(float(starts[line]) for line in changes[1:]), float(starts[-1])]
    shares: dict[str, tuple[float, float]] = {}
    for index, line in enumerate(changes):
        until = changes[index + 1] - 1 if index + 1 < len(changes) else len(tools)
        tool = int(tools[until - 1])
        name = f"T{tool}" if tool >= 0 else "no tool"
        held = _held(holds, edges[index], edges[index + 1])
        before = shares.get(name, (0.0, 0.0))
        shares[name] = (
            before[0] + edges[index + 1] - edges[index] - held,
            before[1] + expected[index + 1] - expected[index],
        )
        del line
    cut_measured = cut_predicted = 0.0
    for stretch in run.stretches:
        inside = np.flatnonzero((run.line >= stretch.lines[0]) & (run.line <= stretch.lines[1]))
        if len(inside) >= 2:
            begin, end = inside[0], inside[-1]
            cut_measured += float(run.time_s[end] - run.time_s[begin])
            cut_measured -= _held(holds, float(run.time_s[begin]), float(run.time_s[end]))
            cut_predicted += float(starts[run.line[end]] - starts[run.line[begin]])
    whole = end_s - _held(holds, 0.0, end_s), float(starts[-1])
    kinds = (
        LearnedShare("cuts", cut_measured, cut_predicted),
        LearnedShare("between cuts", whole[0] - cut_measured, whole[1] - cut_predicted),
    )
    return tuple(LearnedShare(name, *both) for name, both in shares.items()), kinds


def _seen(run: ObservedRun, line: int) -> float:
    """When a line began, by the readings before and behind it."""
    at = int(np.searchsorted(run.line, line))
    if at >= len(run.line):
        return float(run.time_s[-1])
    return float(run.time_s[at])


def _held(holds: list[tuple[float, float, str]], begin_s: float, end_s: float) -> float:
    return sum(max(0.0, min(begin + length, end_s) - max(begin, begin_s)) for begin, length, _ in holds)
