"""Modes from a control's own capture: commands and actual positions of an axis in production.

The position loop holds the encoder, so the structure vibrates as with that point held: actual over command has a dip
there, command over actual a peak. The drive's own response varies little over the width of a mode.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from shapegcode.errors import RecordError
from shapegcode.identification.frf_fit import find_frf_modes
from shapegcode.identification.model_search import Sought
from shapegcode.identification.result import Identification, as_sweep
from shapegcode.identification.servo.record import ServoTrace, read_servo_record
from shapegcode.identification.spectra import Spectra, moving_parts, transforms
from shapegcode.io.data_file import open_file
from shapegcode.io.edge_json import is_edge_json
from shapegcode.io.frequency_response import FEWEST_LINES, FrequencyResponse
from shapegcode.io.record import ReadOptions
from shapegcode.io.servo_log import is_servo_log
from shapegcode.io.units import FloatArray

_LOWEST_HZ, _OVER_HALF = 4.0, 2.5  # lowest line; samples per cycle of the highest line
_WINDOW_S = 8.0  # of a motion without rests
_AFTER_S = 1.0  # of the decay after the last part
_FEWEST_PARTS = 2


def is_capture(path: Path) -> bool:
    """Whether a file contains commands and actual positions of axes."""
    with open_file(path) as file:
        head = file.read(4096)
    return is_edge_json(head) or is_servo_log(path, head)


def find_modes_of_captures(paths: Sequence[Path], options: ReadOptions, sought: Sought) -> Identification:
    """Find the modes of one axis in captures; see `identify.identify`."""
    traces, notes = [], []
    for path in paths:
        record = read_servo_record(path)
        traces.append((str(path), record.period_s, _axis_of(str(path), record.axes, options.axis)))
        notes += [f"{path}: {note}" for note in record.notes]
    responses = [_response(*each, sought.band_hz, options.axis) for each in traces]
    found = find_frf_modes(responses, tuple(map(str, paths)), replace(sought, phase_known=False))
    source, period_s, trace = traces[0]
    notes.append("modes are those with the encoder held, without masses")
    return as_sweep(found, notes, source, trace.samples, period_s, source, "capture of command and encoder")


def _axis_of(source: str, traces: Sequence[ServoTrace], axis: str | None) -> ServoTrace:
    """The trace of an axis: X, X1, 1 (X1)."""
    linear = [each for each in traces if each.unit == "mm"]
    named = [each for each in linear if axis is not None and axis in each.name.lower()]
    if len(named) == 1 or (axis is not None and len(linear) == 1 and not set("xyz") & set(linear[0].name.lower())):
        return (named or linear)[0]
    names = ", ".join(f"{each.name}{'' if each in linear else ' (turns)'}" for each in traces)
    wanted = "add --axis x, y or z"
    if axis is not None:
        wanted = f"{'several are' if named else 'no linear one is'} called {axis.upper()}"
    raise RecordError(f"{source}: contains command and actual position of {names}: {wanted}")


def _response(
    source: str, period_s: float, trace: ServoTrace, band_hz: tuple[float, float] | None, axis: str | None
) -> FrequencyResponse:
    """Ratio −command/actual at the lines that the command excites and on which the parts agree."""
    windows = _windows(trace, period_s)
    if len(windows) < _FEWEST_PARTS:
        raise RecordError(
            f"{source}: {trace.name} moves in {len(windows)} part{'' if len(windows) == 1 else 's'}; required: two "
            f"between rests of half a second, or {1.5 * _WINDOW_S:g} s of motion"
        )
    low, high = band_hz or (_LOWEST_HZ, np.inf)
    high = min(high, 1.0 / (_OVER_HALF * period_s))
    longest = (max(len(command) for command, _ in windows) + 2) * period_s
    hertz = np.arange(max(low, _LOWEST_HZ), high, 0.5 / longest)
    if len(hertz) < FEWEST_LINES:
        asked = "" if band_hz is None else f", the band asked for is {band_hz[0]:g} to {band_hz[1]:g} Hz"
        raise RecordError(
            f"{source}: a sample every {period_s * 1e3:g} ms resolves {_LOWEST_HZ:g} to "
            f"{1.0 / (_OVER_HALF * period_s):.4g} Hz{asked}"
        )
    none = np.zeros(len(windows))
    command, response = (transforms(list(parts), none, period_s, hertz) for parts in zip(*windows, strict=True))
    spectra = Spectra(hertz, command, response)
    used, coherence = spectra.coherent()
    if np.count_nonzero(used) < FEWEST_LINES:
        raise RecordError(
            f"{source}: the actual position of {trace.name} does not follow its command between {low:g} and "
            f"{high:.0f} Hz: too little motion, or positions too coarse; a sweep moves enough (shapegcode sweep)"
        )
    ratio = -1.0 / spectra.ratio()[used]
    return FrequencyResponse(source, hertz[used], ratio, "acceleration", coherence[used], axis, scaled=False)


def _windows(trace: ServoTrace, period_s: float) -> list[tuple[FloatArray, FloatArray]]:
    """Changes of speed of command and actual position in each part between rests; tapered windows without rests."""
    found: list[tuple[FloatArray, FloatArray]] = []
    after, size = round(_AFTER_S / period_s), round(_WINDOW_S / period_s)
    for command, actual in zip(trace.command, trace.actual, strict=True):
        parts = moving_parts(command, period_s)
        followed = [*(first for first, _ in parts[1:]), len(command)][: len(parts)]
        for (begin, end), following in zip(parts, followed, strict=True):
            stop = min(following, end + after)
            ranges, taper = [slice(begin, stop)], np.ones(1)
            if end - begin > 2 * size:
                starts = range(begin, stop - size + 1, size // 2)
                ranges, taper = [slice(first, first + size) for first in starts], np.hanning(size)[1:-1]
            found += [(np.diff(command[each], 2) * taper, np.diff(actual[each], 2) * taper) for each in ranges]
    return found
