"""Programs of a machine whose mode moves: shaped by shapers that follow, judged with the mode where it is."""

import numpy as np
import pytest

import shapegcode as sg
from shapegcode import _core
from shapegcode.conversion.write import RegionWriter
from shapegcode.model.machine_model import MachineModel
from shapegcode.model.modes import Offset, region_offset
from shapegcode.program import Program
from shapegcode.shaping.grid import Grid, choose_grid, make_grid
from shapegcode.verdict.judge import rapid_vibration_um
from test_moving_modes import OVER_MASS, OVER_Z, machine_with

HEAD = "%\nO0001\nG21 G90 G94 G17 G54\n"


def zig_zag(strokes: int, depth_mm: float, head: str = "G00 X0 Y0 Z0") -> str:
    """X to and fro by 30 mm with a stop at every turn, while Z travels `depth_mm`."""
    lines = [f"G01 X{30.0 * (k % 2):.3f} Z{depth_mm * k / strokes:.3f} F6000" for k in range(1, strokes + 1)]
    return HEAD + "\n".join([head, *lines, "M30", "%"]) + "\n"


def fine_machine(contour: str = "off") -> sg.Machine:
    """The machine with words so fine that their rounding leaves nothing, and no forced stops."""
    fine = {"controller.least_increment_mm": 0.00001, "controller.feed_decimals_mm": 4, "shaping.plunge_angle_deg": 0.0}
    return machine_with(OVER_Z).with_values({**fine, "shaping.contour": contour})


def command(path: _core.Path, grid: Grid, machine: sg.Machine, offset: Offset) -> np.ndarray:
    """The shaped command of a region, borders and middles in turn."""
    model = MachineModel(machine)
    writer = RegionWriter(model, grid)
    options = writer.options(model.limits(), writer.tolerance(1e6), offset)
    piece = _core.RegionShaper(path, grid.fir, [], options).next(1 << 30)
    rows = np.empty((len(piece.grid_mm) + len(piece.middle_mm), 3))
    rows[::2], rows[1::2] = piece.grid_mm, piece.middle_mm
    return rows


def test_the_shaped_command_is_the_followed_one() -> None:
    """The command before shaping, shaped by the filter on half the block grid, is what the region's shaper gives."""
    machine = fine_machine()
    region = Program.from_text(zig_zag(4, 400.0), machine).regions[0]
    grid = choose_grid(machine)
    assert grid.track is not None
    alone = make_grid(grid.block_period_s, _core.Shaper([0.0], [1.0]))
    offset = region_offset(region, machine)
    model = MachineModel(machine)
    tolerance = RegionWriter(model, grid).tolerance(1e6)
    options = RegionWriter(model, alone).options(model.limits(), tolerance, offset)
    bare = _core.RegionShaper(region.path, alone.fir, [], options).next(1 << 30)
    before = np.empty((len(bare.grid_mm) + len(bare.middle_mm), 3))
    before[::2], before[1::2] = bare.grid_mm, bare.middle_mm
    expected = grid.track.following().on_finer_grid(2).apply(before)
    shaped = command(region.path, grid, machine, offset)
    assert len(bare.run_ends) == 1
    assert shaped.shape == expected.shape
    assert np.abs(shaped - expected).max() < 1e-11


@pytest.mark.parametrize("contour", ["off", "command", "response"])
def test_following_leaves_a_fraction_of_what_one_shaper_leaves(contour: str) -> None:
    machine = fine_machine(contour)
    program = Program.from_text(zig_zag(21, 40.0), machine)  # all of it near 52 Hz
    followed = sg.convert(program, machine)
    assert followed.to_dict()["shaper"]["following"]["axis"] == "z"
    was = followed.to_dict()["residual_vibration_um"]["original"]["x"]
    left = followed.to_dict()["residual_vibration_um"]["emitted"]["x"]
    # The same program with one shaper for the nominal frequency, simulated by the same plant.
    fixed_machine = machine.with_values("axes.x.modes.1.frequency_over", None)
    fixed = sg.convert(zig_zag(21, 40.0), fixed_machine)
    blocks = fixed.emitted.core.cutting_path(fixed.placed[0].first_line, fixed.placed[0].last_line)
    one_left = MachineModel(machine).simulate_emitted(blocks, program.regions[0].path).residual_mm[0] * 1e3
    assert was > 20.0
    assert left < 0.01 * was
    assert left < 0.2 * one_left
    assert followed.to_dict()["within_tolerance"]


def test_an_unknown_position_is_shaped_for_the_nominal_frequency() -> None:
    machine = fine_machine()
    program = Program.from_text(HEAD + "G00 X0 Y0\nG01 X30. F6000\nX0\nX30.\nM30\n%\n", machine)
    grid = choose_grid(machine)
    offset = region_offset(program.regions[0], machine)
    model = MachineModel(machine)
    options = RegionWriter(model, grid).options(model.limits(), _core.FilterTolerance(), offset)
    assert options.following is None
    report = sg.convert(program, machine).to_dict()
    assert any("position of Z is unknown" in warning for warning in report["warnings"])
    assert report["residual_vibration_um"]["emitted"]["x"] < 0.1


@pytest.mark.parametrize("system", ["G54", "G55"])
def test_a_rapid_vibrates_with_the_modes_at_its_position(system: str) -> None:
    """As on a machine whose mode does not vary and has the frequency at Z 0 (52 Hz) or 400 (41 Hz)."""
    head, offset_mm = HEAD.replace("G54", system), {"G54": 0.0, "G55": 400.0}[system]
    moving = machine_with(OVER_Z).with_values("input.work_offsets", {"G55": [0.0, 0.0, 400.0]})

    def rapids(*heights_mm: float, machine: sg.Machine = moving) -> float:
        lines = [f"G00 X0 Y0 Z{z - offset_mm:g}\nG04 X2.\nG00 X30.\nG01 Y1. F600\nG00 Y0\nG04 X2." for z in heights_mm]
        program = Program.from_text((head + "\n".join([*lines, "M30", "%", ""])), machine)
        return rapid_vibration_um(program, MachineModel(machine)).x

    at_0, at_400 = (sg.Machine.load("vx500").with_values("axes.x.modes.1.frequency_hz", hz) for hz in (52.0, 41.0))
    low, high = rapids(0.0, machine=at_0), rapids(400.0, machine=at_400)
    assert abs(low - high) > 0.1 * high
    assert rapids(0.0) == pytest.approx(low, rel=1e-9)
    assert rapids(400.0) == pytest.approx(high, rel=1e-9)
    assert rapids(0.0, 400.0) == rapids(400.0, 0.0) == pytest.approx(max(low, high), rel=1e-9)


def test_warnings_and_modes_reach_the_report_and_the_header() -> None:
    conversion = sg.convert(zig_zag(4, 4.0), machine_with(OVER_MASS, more="part_mass_kg = 100"))
    assert b"(MODE X 46 HZ 0.03)" in conversion.text
    heavy = machine_with(OVER_MASS, more="part_mass_kg = 400")
    program = Program.from_text(zig_zag(4, 4.0), heavy)
    for warnings in (sg.convert(program, heavy).warnings, sg.simulate(program, heavy).warnings):
        assert any("lies outside the table" in warning for warning in warnings)
    moving = machine_with(OVER_Z)
    assert b"(SHAPER CHANGES WITH Z POSITION)" in sg.convert(zig_zag(4, 4.0), moving).text
