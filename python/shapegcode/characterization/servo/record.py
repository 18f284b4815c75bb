"""Commands and actual positions of axes, whatever file they are in."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from shapegcode.characterization.log import parse_units, read_log
from shapegcode.errors import ArgumentError, RecordError
from shapegcode.io.edge_capture import EdgeCapture
from shapegcode.io.edge_json import is_edge_json, read_edge_json

__all__ = ["ServoRecord", "ServoTrace", "read_servo_record"]

FloatArray = npt.NDArray[np.float64]
_GAP = 1.5  # of the usual step
_FEWEST = 100


@dataclass(frozen=True, eq=False)
class ServoTrace:
    """One axis; a stretch is a range of samples without a gap.

    Attributes:
        name: of the axis, as the file has it.
        unit: "deg" where whole turns were seen or the label begins with A, B or C; else "mm".
        time_s: of each stretch, (n,).
        command: of each stretch, (n,) in mm or degrees.
        actual: the same of the encoder.
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


@dataclass(frozen=True, eq=False)
class ServoRecord:
    """What was recorded.

    Attributes:
        source: file.
        period_s: between samples.
        axes: those with command and actual position.
        notes: what reading had to leave out or to assume.
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
        The axes of which both positions were recorded.

    Raises:
        ArgumentError, RecordError: the file cannot be used, or has no axis with both positions.
        OSError: it cannot be read.
    """
    path = Path(path)
    if path.exists() and not path.is_file():
        raise RecordError(f"{path}: not a regular file")
    with path.open("rb") as file:
        head = file.read(200)
    if is_edge_json(head) or path.suffix.lower() == ".json":
        if units is not None:
            raise ArgumentError(f"--units {units}: goes with a CSV; a capture has s and mm or degrees")
        return _of_capture(read_edge_json(path))
    return _of_log(path, parse_units(units) if units is not None else None)


def _of_capture(capture: EdgeCapture) -> ServoRecord:
    notes = list(capture.notes)
    axes = []
    for axis in capture.axes:
        lacks = [each for each in ("DES_POS", "ENC_POS") if each not in axis.signals]
        if lacks:
            notes.append(f"axis {axis.number} ({axis.name}): no {' and no '.join(lacks)} was recorded")
            continue
        command, actual = capture.position(axis.number), capture.position(axis.number, actual=True)
        bad = np.flatnonzero(~np.isfinite(command + actual))
        if bad.size:
            notes.append(f"axis {axis.number} ({axis.name}): left out: values are missing from {bad[0]} on")
            continue

        def cut(values: FloatArray) -> tuple[FloatArray, ...]:
            return tuple(values[each] for each in capture.stretches if each.stop - each.start >= _FEWEST)

        def other(signal: str, number: int = axis.number) -> tuple[FloatArray, ...] | None:
            found = capture.columns.get(f"{signal}|{number}")
            return None if found is None or not np.isfinite(found).all() else cut(found)

        turns = capture.is_rotary(axis.number) or axis.name[:1].upper() in ("A", "B", "C")
        unit = "deg" if turns else "mm"
        name = f"{axis.number} ({axis.name})" if axis.name != str(axis.number) else axis.name
        axes.append(
            ServoTrace(
                name,
                unit,
                cut(capture.time_s),
                cut(command),
                cut(actual),
                other("CONT_DEV"),
                other("TORQUE"),
            )
        )
    return _checked(ServoRecord(capture.source, capture.cycle_s, tuple(axes), tuple(notes)))


def _of_log(path: Path, units: tuple[float, float] | None) -> ServoRecord:
    log = read_log(path, units)
    if log.actual_mm is None:
        raise RecordError(f"{path}: no actual positions: columns such as X_act are needed beside the commanded X")
    steps = np.diff(log.times_s)
    ends = [0, *(np.flatnonzero(steps > _GAP * log.sampling_s) + 1).tolist(), len(log.times_s)]
    ranges = [slice(a, b) for a, b in itertools.pairwise(ends) if b - a >= _FEWEST]
    notes = [f"{len(ends) - 2} gaps between samples"] if len(ends) > 2 else []
    axes = []
    for index, name in enumerate("XYZ"):
        command, actual = log.command_mm[:, index], log.actual_mm[:, index]
        if np.isfinite(command + actual).all():
            axes.append(
                ServoTrace(
                    name,
                    "mm",
                    tuple(log.times_s[each] for each in ranges),
                    tuple(command[each] for each in ranges),
                    tuple(actual[each] for each in ranges),
                )
            )
    return _checked(ServoRecord(str(path), log.sampling_s, tuple(axes), tuple(notes)))


def _checked(record: ServoRecord) -> ServoRecord:
    if not record.axes or not record.axes[0].command:
        raise RecordError(
            f"{record.source}: no axis with command and actual position over {_FEWEST} samples without a gap"
            + (f" ({'; '.join(record.notes[:3])})" if record.notes else "")
        )
    return record
