"""Programs and results as values: one program belongs to one machine; copies, equality, arrays in place of lists."""

import dataclasses
import json
import pickle
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import shapegcode as sg
from command import run
from shapegcode.results.outcome import NotKeptError, Outcome
from test_feed_schedule import ALLOWANCE, CORNER, tool

NO_UNIT = "%\nO1\nG17G90G94\nG0X0Y0Z0\nG1X2.F600\nG3X4.Y2.R2.\nG1Y4.\nG0Z5.\nM30\n%\n"
UNITS = "power_on.units"
METRIC = sg.Machine.load("vx500")
INCH = METRIC.with_values({UNITS: "G20", "name": "inch"})


ENTRIES: dict[str, Callable[[sg.Program, sg.Machine], object]] = {
    "simulate": lambda program, machine: sg.simulate(program, machine, record_samples=0),
    "against": lambda program, machine: sg.simulate(NO_UNIT, machine, against=program, record_samples=0),
    "convert": lambda program, machine: sg.convert(program, machine, tolerance_curve=False),
    "check": sg.check,
    "cycle_time": sg.cycle_time,
    "expand": sg.expand,
    "measure": lambda program, machine: sg.measure(program, machine, tool_diameter_mm=2.0),
    "compare": lambda program, machine: sg.compare(program, program, machine),
    "simulate_motion": sg.simulate_motion,
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
    assert sg.cycle_time(program, stiffer) == sg.cycle_time(NO_UNIT, stiffer)
    # What shapegcode wrote has FANUC's arcs, whatever those of the original were.
    absolute = METRIC.with_values("input.arc_centre", "absolute")
    emitted = sg.convert(NO_UNIT, absolute, tolerance_curve=False).emitted
    assert sg.cycle_time(emitted, METRIC).blocks == sg.cycle_time(emitted, absolute).blocks


def test_a_comparison_without_a_machine_takes_the_programs_own() -> None:
    program = sg.Program.from_text(NO_UNIT, INCH)
    assert sg.compare(program, program).machine == "inch"


SHAPED = "%\nO1\nG21G17G90G94\nG0X0Y0Z0\nG1X20.F12000\nY20.\nX0.\nG0Z50.\nM30\n%\n"
MODES = ["46:0.02", "131:0.02"]
RESULTS: dict[str, Callable[[], sg.Result]] = {
    "convert": lambda: sg.convert(sg.Program.from_text(SHAPED), METRIC),
    "simulate": lambda: sg.simulate(sg.Program.from_text(SHAPED), METRIC),
    "check": lambda: sg.check(sg.Program.from_text(SHAPED), METRIC),
    "cycle_time": lambda: sg.cycle_time(sg.Program.from_text(SHAPED), METRIC),
    "expand": lambda: sg.expand(sg.Program.from_text(SHAPED), METRIC),
    "measure": lambda: sg.measure(sg.Program.from_text(SHAPED), METRIC, tool_diameter_mm=2.0),
    "compare": lambda: sg.compare(sg.Program.from_text(SHAPED), sg.Program.from_text(SHAPED)),
    "choose_shaper": lambda: sg.choose_shaper(MODES, periods_s=[0.005]),
    "describe_machine": lambda: sg.describe_machine(METRIC),
    "study": lambda: sg.study(
        sg.Program.from_text(SHAPED), METRIC, {"axes.x.modes.1.frequency_hz": sg.uniform(45, 47)}, n=2
    ),
    "schedule_feed": lambda: sg.schedule_feed(
        sg.Program.from_text(CORNER), METRIC, tool(), sg.Stock.from_toml(ALLOWANCE)
    ),
}


@pytest.mark.parametrize("name", RESULTS)
def test_a_result_travels_and_equals_its_copy(name: str) -> None:
    result, other = RESULTS[name](), RESULTS[name]()
    copy = pickle.loads(pickle.dumps(result))
    assert copy.to_dict() == result.to_dict()
    assert (copy == result, result == other) == (True, True)
    assert len({copy, result, other}) == 1
    assert result != object()
    field = next(each.name for each in dataclasses.fields(result) if isinstance(getattr(result, each.name), str))  # type: ignore[arg-type]
    assert dataclasses.replace(result, **{field: "another"}) != result  # type: ignore[type-var]


def test_every_result_is_compared_in_the_same_way() -> None:
    public = {name: getattr(sg, name) for name in sg.__all__}
    results = {name: cls for name, cls in public.items() if isinstance(cls, type) and issubclass(cls, sg.Result)}
    assert len(results) > 20
    for name, cls in results.items():
        assert (cls.__eq__, cls.__hash__) == (Outcome.__eq__, Outcome.__hash__), name


def test_a_copy_holds_samples_and_program_and_simulates_again() -> None:
    conversion = RESULTS["convert"]()
    simulation = RESULTS["simulate"]()
    assert isinstance(conversion, sg.Conversion) and isinstance(simulation, sg.Simulation)
    copy = pickle.loads(pickle.dumps(simulation))
    np.testing.assert_array_equal(copy.regions[0].response_mm, simulation.regions[0].response_mm)
    again = copy.regions[0].replay(100_000)
    np.testing.assert_array_equal(again.residual_mm, simulation.regions[0].figures.residual_mm)
    other = pickle.loads(pickle.dumps(conversion))
    assert other.text == conversion.text
    assert list(other.plots()) == list(conversion.plots())
    region = other.placed[0].region
    with pytest.raises(NotKeptError, match="nothing: a pickled result does not contain it"):
        region.nothing  # noqa: B018
    # What differs in an array differs.
    study = sg.study(sg.Program.from_text(SHAPED), METRIC, {"axes.x.modes.1.frequency_hz": [45, 47]}, n=2)
    draws = {key: values + 1 for key, values in study.draws.items()}
    assert study.draws and dataclasses.replace(study, draws=draws) != study


def test_a_program_travels_with_those_that_it_calls(tmp_path: Path) -> None:
    (tmp_path / "O0005.nc").write_text("%\nO5\nG1X2.F600\nM99\n%\n")
    (tmp_path / "part.nc").write_text("%\nO1\nG21G17G90G94\nG0X0Y0Z0\nM98P5\nM30\n%\n")
    program = sg.Program.read(tmp_path / "part.nc", METRIC)
    packed = pickle.dumps(program)
    (tmp_path / "O0005.nc").unlink()
    copy = pickle.loads(packed)
    assert copy == program and hash(copy) == hash(program)
    assert copy.expanded_text == program.expanded_text
    assert b"X2." in copy.expanded_text
    assert copy != sg.Program.from_text(SHAPED, METRIC, source=program.source)
    # In another process, too.
    (tmp_path / "packed").write_bytes(packed)
    code = f"import pickle; print(len(pickle.load(open({str(tmp_path / 'packed')!r}, 'rb')).regions))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == f"{len(program.regions)}\n"


def test_a_result_read_back_leaves_out_what_it_cannot_draw(tmp_path: Path) -> None:
    (tmp_path / "part.nc").write_text(SHAPED)
    part, out = tmp_path / "part.nc", tmp_path / "out.json"
    drawn = {}
    for name, options in {"convert": ["-o", tmp_path / "out.nc"], "simulate": [], "time": []}.items():
        done = run(tmp_path, name, part, "-m", "vx500", *options, "--json", out)
        assert done.returncode in (0, 1), done.stderr
        drawn[name] = list(sg.load_result(out).plots())
        json.loads(out.read_text())
    assert drawn == {"convert": ["tolerance"], "simulate": [], "time": ["time"]}


def test_arrays_are_taken_where_lists_are() -> None:
    program, key = sg.Program.from_text(SHAPED), "axes.x.modes.1.frequency_hz"
    listed = sg.study(program, METRIC, {key: [45.0, 46.0]}, n=2)
    assert sg.study(program, METRIC, {key: np.array([45.0, 46.0])}, n=2) == listed
    assert sg.listed(np.arange(1, 4)).values == (1, 2, 3)
    assert all(type(each) is int for each in sg.listed(np.arange(1, 4)).values)
    with pytest.raises(sg.ArgumentError, match="empty"):
        sg.listed(np.array([]))
    chosen = sg.optimize(
        program, METRIC, {key: np.array([45.0, 46.0])}, choose={"shaping.family": np.array(["zv"])}, n=2
    )
    assert chosen == sg.optimize(program, METRIC, {key: [45.0, 46.0]}, choose={"shaping.family": ["zv"]}, n=2)
    shaper = sg.choose_shaper(np.array(MODES), periods_s=np.array([0.005]))  # type: ignore[arg-type]
    assert shaper == sg.choose_shaper(MODES, periods_s=[0.005])
