"""How the core reads a program of a machine: its options, and the files of programs that another one calls."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from shapegcode import _core

if TYPE_CHECKING:
    from shapegcode.machine import Machine

__all__ = ["program_loader", "reader_options"]


def reader_options(
    machine: Machine,
    *,
    emitted: bool = False,
    probe_lines: Sequence[int] = (),
    program_number: int | None = None,
    expand_compensation: bool = True,
    collect_alarms: bool = False,
) -> _core.ReaderOptions:
    """Settings with which the core reads a program of this machine.

    Args:
        machine: whose controller reads the text.
        emitted: the text was written by shapegcode: its arcs are FANUC's, whatever the original's were.
        probe_lines: ascending line numbers behind which the modal state is kept.
        program_number: O number to play of a file that holds several; None: the first.
        expand_compensation: G41/G42 become plain moves; False: they are kept as they stand.
        collect_alarms: go on behind an alarm.

    Returns:
        The options of the core.
    """
    options = _core.ReaderOptions()
    options.calculator_decimal_point = machine.controller.calculator_decimal_point
    options.absolute_arc_centres = machine.input.arc_centre == "absolute" and not emitted
    options.least_increment_mm = machine.controller.least_increment_mm
    options.least_increment_inch = machine.controller.least_increment_inch
    options.arc_without_centre_is_line = machine.input.arc_without_centre == "line"
    options.arc_tolerance_mm = machine.controller.arc_radius_tolerance_mm
    options.max_line_length = machine.input.max_line_length
    options.unknown_after_tool_change = [axis in machine.input.tool_change_unknown_axes for axis in "XYZ"]
    offsets = machine.input.work_offsets
    if offsets:
        options.work_offsets_mm = [offsets.get(f"G{code}", (0.0, 0.0, 0.0)) for code in range(54, 60)]
        options.extra_work_offsets_mm = {
            int(name[6:]): offset for name, offset in offsets.items() if name.startswith("G54.1P")
        }
    options.tool_offsets = _tool_offsets(machine)  # type: ignore[assignment]
    options.offset_memory = machine.controller.offset_memory
    options.retained_variables = {int(name): value for name, value in machine.input.variables.items()}
    options.bindings = _bindings(machine)
    options.program = -1 if program_number is None else program_number
    options.opaque_programs = list(machine.input.opaque_programs)
    options.subprogram_nesting = machine.controller.nesting_limit_subprogram
    options.max_steps = machine.controller.max_program_steps
    options.block_skip = [{"unknown": None, "on": True, "off": False}[machine.input.block_skip]] * 9
    options.expand_compensation = expand_compensation
    options.compensation_start_up = machine.input.compensation_start_up
    options.peck_clearance_mm = machine.input.peck_clearance_mm
    options.scale_unit = machine.input.scale_unit
    options.collect_alarms = collect_alarms
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


def _tool_offsets(machine: Machine) -> dict[int, _core.ToolOffset]:
    offsets: dict[int, _core.ToolOffset] = {}
    tables = machine.input
    for table, field in (
        (tables.tool_length_mm, "length_mm"),
        (tables.tool_length_wear_mm, "length_wear_mm"),
        (tables.tool_radius_mm, "radius_mm"),
        (tables.tool_radius_wear_mm, "radius_wear_mm"),
    ):
        for name, value in table.items():
            setattr(offsets.setdefault(int(name), _core.ToolOffset()), field, value)
    return offsets


def _bindings(machine: Machine) -> _core.CodeBindings:
    bindings = _core.CodeBindings()
    bindings.g_macros = {round(float(name) * 10): program for name, program in machine.input.g_macros.items()}
    bindings.m_macros = {int(name): program for name, program in machine.input.m_macros.items()}
    bindings.m_subprograms = {int(name): program for name, program in machine.input.m_subprograms.items()}
    bindings.tool_program = machine.input.tool_program or -1
    return bindings


_SUFFIXES = ("", ".nc", ".NC", ".cnc", ".CNC", ".txt", ".TXT", ".tap", ".TAP", ".prg", ".PRG", ".ngc")


def program_loader(folders: Sequence[Path]) -> Callable[[int], tuple[str, bytes] | None]:
    """Finds the file of a program that another one calls: O0123, O123, 0123 with a usual suffix.

    Args:
        folders: where to look, in this order.

    Returns:
        A function of the O number: name and content of the file, None where there is none.
    """

    def load(number: int) -> tuple[str, bytes] | None:
        for folder in folders:
            for stem in (f"O{number:04d}", f"O{number}", f"o{number:04d}", f"{number:04d}", f"O{number:08d}"):
                for suffix in _SUFFIXES:
                    path = folder / (stem + suffix)
                    if path.is_file():
                        return str(path), path.read_bytes()
        return None

    return load
