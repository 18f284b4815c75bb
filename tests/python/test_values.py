"""Programs and results as values: one program belongs to one machine."""

from __future__ import annotations

from collections.abc import Callable

import pytest

import shapegcode as sg

NO_UNIT = "%\nO1\nG17G90G94\nG0X0Y0Z0\nG1X2.F600\nG3X4.Y2.R2.\nG1Y4.\nG0Z5.\nM30\n%\n"
UNITS = "power_on.units"
METRIC = sg.Machine.load("vx500")
INCH = METRIC.with_values({UNITS: "G20", "name": "inch"})


ENTRIES: dict[str, Callable[[sg.Program, sg.Machine], object]] = {
    "simulate": lambda program, machine: sg.simulate(program, machine, record_samples=0),
    "against": lambda program, machine: sg.simulate(
        sg.Program.from_text(NO_UNIT, machine), machine, against=program, record_samples=0
    ),
    "convert": lambda program, machine: sg.convert(program, machine, tolerance_curve=False),
    "check": sg.check,
    "cycle_time": sg.cycle_time,
    "expand": sg.expand,
    "measure": lambda program, machine: sg.measure(program, machine, tool_diameter_mm=2.0),
    "compare": lambda program, machine: sg.compare(program, program, machine),
    "play_motion": sg.play_motion,
    "stream": lambda program, machine: next(iter(sg.stream(program, machine))),
    "study": lambda program, machine: sg.study(
        program, machine, {"axes.x.modes.1.frequency_hz": sg.uniform(40, 50)}, n=2
    ),
    "optimize": lambda program, machine: sg.optimize(
        program, machine, {"axes.x.modes.1.frequency_hz": sg.uniform(40, 50)}, n=2
    ),
}


@pytest.mark.parametrize("entry", ENTRIES)
def test_a_program_of_another_machine_is_refused(entry: str) -> None:
    program = sg.Program.from_text(NO_UNIT, source="part.nc")  # as vx500 reads it: in mm
    with pytest.raises(sg.ArgumentError) as refused:
        ENTRIES[entry](program, INCH)
    message = str(refused.value)
    for said in ("part.nc", f'{UNITS} = "G21" as read, "G20" there', "machine inch", "machine="):
        assert said in message


@pytest.mark.parametrize("key, value, shown", [
    ("controller.calculator_decimal_point", False, "controller.calculator_decimal_point = true as read, false there"),
    ("controller.least_increment_mm", 0.0001, "controller.least_increment_mm = 0.001 as read, 0.0001 there"),
    ("input.arc_centre", "absolute", 'input.arc_centre = "incremental" as read, "absolute" there'),
    ("input.tool_change_unknown_axes", "Z", 'input.tool_change_unknown_axes = "XYZ" as read, "Z" there'),
    ("input.m_subprograms", {"6": 9001}, "input.m_subprograms = {} as read,"),
])  # fmt: skip
def test_every_setting_of_the_reader_counts(key: str, value: object, shown: str) -> None:
    calculator = METRIC.with_values("controller.calculator_decimal_point", True)
    program = sg.Program.from_text(NO_UNIT, calculator)
    with pytest.raises(sg.ArgumentError, match="read with other settings") as refused:
        sg.cycle_time(program, calculator.with_values(key, value))
    assert shown in str(refused.value)


def test_settings_that_read_alike_change_nothing() -> None:
    program = sg.Program.from_text(NO_UNIT)
    stiffer = METRIC.with_values({"axes.x.modes.1.frequency_hz": 60.0, "tolerance.contour_um": 50.0, "name": "other"})
    assert sg.cycle_time(program, stiffer) == sg.cycle_time(sg.Program.from_text(NO_UNIT, stiffer), stiffer)
    # What shapegcode wrote has FANUC's arcs, whatever those of the original were.
    absolute = METRIC.with_values("input.arc_centre", "absolute")
    emitted = sg.convert(sg.Program.from_text(NO_UNIT, absolute), absolute, tolerance_curve=False).emitted
    assert sg.cycle_time(emitted, METRIC).blocks == sg.cycle_time(emitted, absolute).blocks


def test_a_comparison_without_a_machine_takes_the_programs_own() -> None:
    program = sg.Program.from_text(NO_UNIT, INCH)
    assert sg.compare(program, program).machine == "inch"
