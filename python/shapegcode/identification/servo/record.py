"""Commands and actual positions of axes, from captures and logs."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Self

import numpy as np

from shapegcode.errors import ArgumentError, RecordError
from shapegcode.io.data_file import open_file
from shapegcode.io.edge_capture import EdgeCapture
from shapegcode.io.edge_json import is_edge_json, read_edge_json
from shapegcode.io.servo_log import parse_units, read_log
from shapegcode.io.units import FloatArray

_FEWEST, _WINDOW = 100, 2500
_LARGEST_ACCELERATION = 5e5  # mm/s² or degrees/s²; beyond it a command is a step, not motion


@dataclass(frozen=True, eq=False)
class ServoTrace:
    """One axis; a section is a range of samples without a gap.

    Attributes:
        name: of the axis, as in the file.
        unit: "deg" if whole turns were found or the label begins with A, B or C; else "mm".
        time_s: instants of each section, (n,).
        command: of each section, (n,) in mm or degrees.
        actual: encoder position of each section, as `command`.
        deviation: the control's own contour deviation; None where it was not recorded.
        torque: of the motor; None where it was not recorded.
    """

    name: str
    unit: str
    time_s: tuple[FloatArray, ...]
    command: tuple[FloatArray, ...]
    actual: tuple[FloatArray, ...]
    deviation: tuple[FloatArray, ...] | None = None
    torque: tuple[FloatArray, ...] | None = None

    @property
    def samples(self) -> int:
        """Number of samples of all sections."""
        return sum(map(len, self.command))

    @cached_property
    def lag(self) -> tuple[FloatArray, ...]:
        """Command minus actual position."""
        return tuple(r - x for r, x in zip(self.command, self.actual, strict=True))

    def liveliest(self, most: int) -> Self:
        """Select the windows with most changes of speed, to limit the time of a fit.

        Args:
            most: largest number of samples.

        Returns:
            The trace itself if it is short enough; else some of its windows, adjacent ones joined.
        """
        if self.samples <= most:
            return self
        windows: list[tuple[float, int, int]] = []  # change of speed, section, start
        for rank, way in enumerate(self.command):
            changes = np.abs(np.diff(way, 2, prepend=way[:1], append=way[-1:]))
            windows += [(float(changes[at : at + _WINDOW].sum()), rank, at) for at in range(0, len(way), _WINDOW)]
        kept: list[tuple[int, slice]] = []  # section, and its samples
        for _, rank, at in sorted(sorted(windows, reverse=True)[: max(1, most // _WINDOW)], key=lambda each: each[1:]):
            end = min(at + _WINDOW, len(self.command[rank]))
            if kept and kept[-1][0] == rank and kept[-1][1].stop == at:
                kept[-1] = (rank, slice(kept[-1][1].start, end))
            elif end - at >= _FEWEST:
                kept.append((rank, slice(at, end)))
        return self._parts(kept)

    def _parts(self, kept: Sequence[tuple[int, slice]]) -> Self:
        """Parts of sections, as separate sections."""
        names = ("time_s", "command", "actual", "deviation", "torque")
        columns = {name: values for name in names if (values := getattr(self, name)) is not None}
        cut: dict[str, Any] = {n: tuple(values[rank][part] for rank, part in kept) for n, values in columns.items()}
        return replace(self, **cut)


@dataclass(frozen=True, eq=False)
class ServoRecord:
    """Recorded commands and positions.

    Attributes:
        source: file.
        period_s: between samples.
        axes: those with command and actual position.
        notes: parts ignored and assumptions made on reading.
    """

    source: str
    period_s: float
    axes: tuple[ServoTrace, ...]
    notes: tuple[str, ...]


def read_servo_record(path: str | Path, units: str | None = None) -> ServoRecord:
    """Read a capture of a Sinumerik control (JSON, gzip, zip), or a servo log (CSV with command and actual columns).

    Args:
        path: of the file.
        units: of time and length in a CSV, for example "ms,um"; None: from its header.

    Returns:
        The axes with both positions.

    Raises:
        ArgumentError, RecordError: an unusable file, or no axis with both positions.
        OSError: it cannot be read.
    """
    path = Path(path)
    with open_file(path) as file:
        head = file.read(200)
    if is_edge_json(head) or path.suffix.lower() == ".json":
        if units is not None:
            raise ArgumentError(f"--units {units}: is for a CSV; a capture has s and mm or degrees")
        return _of_capture(read_edge_json(path))
    return _of_log(path, parse_units(units) if units is not None else None)


def _of_capture(capture: EdgeCapture) -> ServoRecord:
    notes = list(capture.notes)
    axes = []
    for axis in capture.axes:
        label = f"axis {axis.number} ({axis.name})"
        lacks = [each for each in ("DES_POS", "ENC_POS") if each not in axis.signals]
        if lacks:
            notes.append(f"{label}: no {' and no '.join(lacks)} was recorded")
            continue
        command, actual = capture.position(axis.number), capture.position(axis.number, actual=True)
        bad = np.flatnonzero(~np.isfinite(command + actual))
        if bad.size:
            notes.append(f"{label}: ignored: values are missing, first in sample {bad[0]}")
            continue
        ranges = _ranges(command, capture.stretches, capture.cycle_s)
        if len(ranges) > len(capture.stretches):
            gaps = {each.start for each in capture.stretches}
            first = next(each.start for each in ranges if each.start not in gaps)
            where = f"{capture.time_s[first]:.3f} s"
            notes.append(f"{label}: its command has a step, first at {where}: split there")
        ranges = tuple(each for each in ranges if each.stop - each.start >= _FEWEST)
        if not ranges:
            notes.append(f"{label}: ignored: no {_FEWEST} samples without gap or jump")
            continue

        others = [capture.columns.get(f"{signal}|{axis.number}") for signal in ("CONT_DEV", "TORQUE")]
        measured = [None if each is None or not np.isfinite(each).all() else (each,) for each in others]
        turns = capture.is_rotary(axis.number) or axis.name[:1].upper() in ("A", "B", "C")
        name = f"{axis.number} ({axis.name})" if axis.name != str(axis.number) else axis.name
        whole = ServoTrace(name, "deg" if turns else "mm", (capture.time_s,), (command,), (actual,), *measured)
        axes.append(whole._parts([(0, each) for each in ranges]))
    return _checked(ServoRecord(capture.source, capture.cycle_s, tuple(axes), tuple(notes)))


def _ranges(command: FloatArray, stretches: tuple[slice, ...], period_s: float) -> tuple[slice, ...]:
    """Sections, split where the command jumps in one sample (a coordinate change, not motion)."""
    out = []
    for each in stretches:
        steps = np.diff(command[each])
        kinks = np.abs(np.diff(steps)) > _LARGEST_ACCELERATION * period_s**2
        jumps = np.flatnonzero(kinks[:-1] & kinks[1:]) + 2  # between the sample before and this one
        ends = [each.start, *(each.start + jumps).tolist(), each.stop]
        out += [slice(a, b) for a, b in itertools.pairwise(ends) if b > a]
    return tuple(out)


def _of_log(path: Path, units: tuple[float, float] | None) -> ServoRecord:
    log = read_log(path, units)
    if log.actual_mm is None:
        raise RecordError(f"{path}: no actual positions: columns such as X_act are needed next to the commanded X")
    steps = np.diff(log.times_s)
    ends = [0, *(np.flatnonzero(steps > 1.5 * log.sampling_s) + 1).tolist(), len(log.times_s)]
    ranges = [slice(a, b) for a, b in itertools.pairwise(ends) if b - a >= _FEWEST]
    notes = [f"{len(ends) - 2} gaps between samples"] if len(ends) > 2 else []
    axes = []
    for index, name in enumerate("XYZ"):
        command, actual = log.command_mm[:, index], log.actual_mm[:, index]
        if np.isfinite(command + actual).all():
            whole = ServoTrace(name, "mm", (log.times_s,), (command,), (actual,))
            axes.append(whole._parts([(0, each) for each in ranges]))
    return _checked(ServoRecord(str(path), log.sampling_s, tuple(axes), tuple(notes)))


def _checked(record: ServoRecord) -> ServoRecord:
    if not record.axes or not record.axes[0].command:
        raise RecordError(
            f"{record.source}: no axis with command and actual position over {_FEWEST} samples without a gap"
            + (f" ({'; '.join(record.notes[:3])})" if record.notes else "")
        )
    return record
