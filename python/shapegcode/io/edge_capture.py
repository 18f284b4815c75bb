"""Capture of a Sinumerik control: axis signals in every position control cycle, and executed blocks."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shapegcode.errors import RecordError
from shapegcode.io.units import FloatArray

IntArray = npt.NDArray[np.int64]

TURN_DEG = 360.0
_EVEN_DEG = 10.0


@dataclass(frozen=True)
class EdgeAxis:
    """An axis or spindle of the capture.

    Attributes:
        number: axis number, after the bar of its signals: 3 in "DES_POS|3".
        name: label in the header, such as "X1"; the number if it has no label. A label is set in the
            recorder and may differ from the control's name of the axis.
        signals: recorded signals, such as "DES_POS".
    """

    number: int
    name: str
    signals: tuple[str, ...]


@dataclass(frozen=True)
class EdgeBlock:
    """A block that the control began to execute.

    Attributes:
        counter: position control cycle.
        time_s: its time since the first sample; may be before it, after the last sample, or in a gap.
        text: text of the block after the control's preprocessing.
        line: line number in its program ("SeekOffset").
        path: path of its program, from the last call event; empty before the first one.
        selected_tool: number of the programmed tool.
        active_tool: number of the tool in the spindle.
        motion: G code of the first group, such as "G1".
        buffered: blocks in the look-ahead buffer.
        channel: channel of the control.
    """

    counter: int
    time_s: float
    text: str
    line: int | None
    path: str
    selected_tool: int | None
    active_tool: int | None
    motion: str
    buffered: int | None
    channel: int | None


@dataclass(frozen=True)
class EdgeCall:
    """A program that was called or returned to.

    Attributes:
        counter: position control cycle.
        time_s: its time since the first sample.
        path: path of the program.
        line: line number in it.
        level: depth of the call.
        channel: channel of the control.
    """

    counter: int
    time_s: float
    path: str
    line: int | None
    level: int | None
    channel: int | None


@dataclass(frozen=True)
class EdgeValue:
    """A slow value ("LFData").

    Attributes:
        counter: position control cycle.
        time_s: its time since the first sample.
        address: such as "/Channel/State/actTNumber".
        value: text in the file.
    """

    counter: int
    time_s: float
    address: str
    value: str


@dataclass(frozen=True)
class EdgeGap:
    """Cycles without a sample.

    Attributes:
        index: index of the first sample after the gap.
        counter: counter of the last sample before it.
        missing: number of missing cycles.
        start_s: time of the last sample before it.
        duration_s: from there to the first sample after it.
    """

    index: int
    counter: int
    missing: int
    start_s: float
    duration_s: float


@dataclass(frozen=True, eq=False)
class EdgeCapture:
    """A capture of a Sinumerik control, from `read_edge_json`.

    Units are those of the control: positions in mm (rotary axes in degrees), speeds per second, torques in Nm (N for a
    linear motor). DES_POS is the command after the fine interpolator, ENC_POS the active encoder, CONT_DEV the lag
    minus that of the control's axis model, VEL_FFW the velocity feed-forward.

    Attributes:
        source: file.
        version: version of the format, such as "1.0".
        cycle_s: position control cycle.
        counter: (n,) cycle of each sample, ascending.
        time_s: (n,) time of each sample since the first: counter times cycle, including gaps.
        columns: (n,) values by address, such as "DES_POS|1"; NaN if the file has no value.
        axes: in the order of their numbers.
        blocks: in the order of their counters.
        calls: in the order of their counters.
        values: slow values in the order of their counters.
        gaps: where samples are missing.
        notes: parts ignored and assumptions made on reading.
    """

    source: str
    version: str
    cycle_s: float
    counter: IntArray
    time_s: FloatArray
    columns: Mapping[str, FloatArray]
    axes: tuple[EdgeAxis, ...]
    blocks: tuple[EdgeBlock, ...] = ()
    calls: tuple[EdgeCall, ...] = ()
    values: tuple[EdgeValue, ...] = ()
    gaps: tuple[EdgeGap, ...] = ()
    notes: tuple[str, ...] = ()

    @functools.cached_property
    def stretches(self) -> tuple[slice, ...]:
        """Ranges of samples without a gap, in order."""
        ends = [0, *(gap.index for gap in self.gaps), len(self.counter)]
        return tuple(slice(start, stop) for start, stop in itertools.pairwise(ends) if stop > start)

    def axis(self, axis: int | str) -> EdgeAxis:
        """Find an axis.

        Args:
            axis: its number, or its label ("X1").

        Returns:
            The axis.

        Raises:
            RecordError: no such axis, or a label of several.
        """
        wanted = str(axis).strip().lower()
        found = [each for each in self.axes if wanted == str(each.number)]
        found = found or [each for each in self.axes if wanted == each.name.lower()]
        if len(found) != 1:
            known = ", ".join(f"{each.number} ({each.name})" for each in self.axes)
            what = "no axis" if not found else f"{len(found)} axes"
            raise RecordError(f"{self.source}: {what} {axis!r}; the file has {known or 'no axis'}")
        return found[0]

    def column(self, signal: str, axis: int | str) -> FloatArray:
        """Values of one signal of one axis, as in the file.

        Args:
            signal: such as "DES_POS".
            axis: number or label.

        Returns:
            (n,) values.

        Raises:
            RecordError: no such axis, or the signal is not recorded for it; the message lists those that are.
        """
        found = self.axis(axis)
        if signal not in found.signals:
            raise RecordError(
                f"{self.source}: SignalListHFData has no {signal}|{found.number}; recorded of axis {found.number} "
                f"({found.name}) are {', '.join(found.signals)}"
            )
        return self.columns[f"{signal}|{found.number}"]

    def position(self, axis: int | str, *, actual: bool = False) -> FloatArray:
        """Position of an axis, with a rotary axis' wraps by whole turns removed.

        No axis moves 180 degrees or mm in a cycle (15000 rpm, 90 m/s at 2 ms). A larger step is a wrap if, with whole
        turns subtracted, it nearly equals the step before. The number of turns in a gap is unknown: after a gap the
        file's value is used unchanged. Command and actual position are unwrapped by the same turns, so that their
        difference is unchanged.

        Args:
            axis: number or label.
            actual: the encoder's (ENC_POS), else the command (DES_POS).

        Returns:
            (n,) in mm or degrees.

        Raises:
            RecordError: no such axis, or the signal is not in the file.
        """
        number = self.axis(axis).number
        values = self.column("ENC_POS" if actual else "DES_POS", number)
        reference = values if actual and f"DES_POS|{number}" not in self.columns else self.column("DES_POS", number)
        out = np.array(values)
        for stretch in self.stretches:
            steps = np.diff(reference[stretch], prepend=reference[stretch][:1])
            turns = np.where(np.abs(steps) > TURN_DEG / 2.0, np.round(steps / TURN_DEG), 0.0)
            # A wrap continues the motion before; otherwise the coordinates changed.
            beyond = steps - TURN_DEG * turns
            before = np.concatenate([beyond[:1], beyond[:-1]])
            turns[~(np.abs(beyond - before) < _EVEN_DEG)] = 0.0
            out[stretch] -= TURN_DEG * np.cumsum(np.nan_to_num(turns))
        return out

    def is_rotary(self, axis: int | str) -> bool:
        """Whether the command of an axis wraps by whole turns, which proves a rotary axis.

        False proves nothing: a rotary axis may have stayed within one turn.

        Args:
            axis: number or label.

        Returns:
            True if a wrap was found.

        Raises:
            RecordError: its command is not in the file.
        """
        return bool(np.any(np.abs(self.position(axis) - self.column("DES_POS", axis)) > TURN_DEG / 2.0))

    def speed(self, axis: int | str, *, actual: bool = False) -> FloatArray:
        """Speed of an axis: differences of its position over two cycles, over one cycle at the ends and next to gaps.

        Args:
            axis: number or label.
            actual: True: speed measured by the encoder; False: commanded speed.

        Returns:
            (n,) in mm/s or degrees/s; NaN for a single sample between gaps.

        Raises:
            RecordError: no such axis, or its position is not in the file.
        """
        position_of = self.position(axis, actual=actual)
        out = np.full(len(position_of), np.nan)
        for stretch in self.stretches:
            if stretch.stop - stretch.start > 1:
                out[stretch] = np.gradient(position_of[stretch], self.cycle_s)
        return out
