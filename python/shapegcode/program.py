"""A CNC program as the controller reads it: text to the letter, cutting regions, findings."""

from __future__ import annotations

import errno
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from shapegcode import _core
from shapegcode._core import ProgramError

if TYPE_CHECKING:
    from shapegcode.machine import Machine

MM_PER_INCH = 25.4
_ARC_OFF_RADIUS = "off its radius"


def reader_options(machine: Machine, *, emitted: bool = False, probe_lines: Sequence[int] = ()) -> _core.ReaderOptions:
    """Settings with which the core reads a program of this machine.

    Args:
        machine: whose controller reads the text.
        emitted: the text was written by shapegcode: its arcs are FANUC's, whatever the original's were.
        probe_lines: ascending line numbers behind which the modal state is kept.
    """
    options = _core.ReaderOptions()
    options.calculator_decimal_point = machine.controller.calculator_decimal_point
    options.absolute_arc_centres = machine.input.arc_centre == "absolute" and not emitted
    options.least_increment_mm = machine.controller.least_increment_mm
    options.least_increment_inch = machine.controller.least_increment_inch
    options.arc_tolerance_mm = machine.controller.arc_radius_tolerance_mm
    options.max_line_length = machine.input.max_line_length
    options.unknown_after_tool_change = [axis in machine.input.tool_change_unknown_axes for axis in "XYZ"]
    offsets = machine.input.work_offsets
    if offsets:
        options.work_offsets_mm = [offsets.get(f"G{code}", (0.0, 0.0, 0.0)) for code in range(54, 60)]
    state = _core.ModalState()
    state.motion = int(machine.power_on.motion[1:])
    state.plane = int(machine.power_on.plane[1:])
    state.distance = int(machine.power_on.distance[1:])
    state.units = int(machine.power_on.units[1:])
    state.feed_mode = int(machine.power_on.feed_mode[1:])
    state.exact_stop = int(machine.power_on.path_mode[1:])
    state.coordinate_system = int(machine.power_on.work_offset[1:])
    state.cycle_return = int(machine.power_on.cycle_return[1:])
    options.power_on = state
    options.probe_lines = list(probe_lines)
    return options


@dataclass(frozen=True)
class Program:
    """A program that was read.

    Attributes:
        core: what the core made of it: text, regions (runs of cutting moves between stops), other moves.
        source: name for messages.
    """

    core: _core.ProgramText
    source: str

    @classmethod
    def read(cls, path: str | Path, machine: Machine | None = None) -> Program:
        """Read a program file as the controller of `machine` would (None: as that of the built-in ``vx500``).

        Raises:
            ProgramError: the text is no program that can be read; the message starts with ``file:line:column``.
            OSError: the file cannot be read.
        """
        try:
            text = Path(path).read_bytes()
        except OSError as error:
            # A failed read() does not name the file.
            raise OSError(error.errno or errno.EIO, error.strerror or str(error), str(path)) from error
        return cls.from_text(text, machine, source=str(path))

    @classmethod
    def from_text(
        cls,
        text: bytes | str,
        machine: Machine | None = None,
        *,
        source: str = "<text>",
        emitted: bool = False,
        probe_lines: Sequence[int] = (),
    ) -> Program:
        """Read a program text; `source` names it in messages.

        Raises:
            ProgramError: the text is no program that can be read; the message starts with ``source:line:column``.
        """
        from shapegcode.machine import Machine

        machine = machine or Machine.load("vx500")
        data = text.encode() if isinstance(text, str) else text
        options = reader_options(machine, emitted=emitted, probe_lines=probe_lines)
        try:
            return cls(_core.read_program(data, options), source)
        except ProgramError as error:
            hint = _absolute_centre_hint(data, options) if _ARC_OFF_RADIUS in str(error) else ""
            raise _located(source, error.line, error.column, f"{error}{hint}") from None

    @property
    def regions(self) -> list[_core.Region]:
        """Runs of cutting moves between two stops, in order."""
        return self.core.regions

    @property
    def warnings(self) -> list[str]:
        """What the reader noticed, each ``source:line: text``."""
        return [f"{self.source}:{line}: {message}" for line, message in self.core.warnings]

    def region_error(self, region: _core.Region, message: str) -> ProgramError:
        """An error that names the file and the lines of a region."""
        first, last = region.first_line, region.last_line
        return _located(self.source, first, 1, f"lines {first} to {last}: {message}")

    def refuse_endless(self, limit_s: float) -> None:
        """Refuse a region that cuts for longer than can be computed.

        Raises:
            ProgramError: a region takes more than `limit_s` at its programmed feeds.
        """
        for region in self.regions:
            time_s = region.path.programmed_time_s
            if time_s > limit_s:
                raise self.region_error(region, f"{time_s:.0f} s of cutting without a stop (limit {limit_s:.0f} s)")


def least_increment_mm(machine: Machine, units: int) -> float:
    """Least increment of the words of a program in G20 or G21, mm."""
    controller = machine.controller
    return controller.least_increment_inch * MM_PER_INCH if units == 20 else controller.least_increment_mm


def _located(source: str, line: int, column: int, message: str) -> ProgramError:
    error = ProgramError(f"{source}:{line}:{column}: {message}")
    error.__dict__.update(line=line, column=column)
    return error


def _absolute_centre_hint(text: bytes, options: _core.ReaderOptions) -> str:
    # A post for another kind of control: say so where it explains every arc, but never guess.
    options.absolute_arc_centres = not options.absolute_arc_centres
    try:
        _core.read_program(text, options)
    except ProgramError:
        return ""
    kind = "absolute" if options.absolute_arc_centres else "incremental"
    return f'; with {kind} I J K the whole program reads: set input.arc_centre = "{kind}"'
