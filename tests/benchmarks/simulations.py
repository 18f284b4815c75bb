"""Processor time of what a conversion spends it on: shaping, text, the simulations of the verdict; minimum of some."""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from statistics import median
from typing import Any
from unittest import mock

import processes
import workload
from places import GOLDEN
from table import timed

import shapegcode as sg
from shapegcode import _core, cli
from shapegcode.conversion.write import RegionWriter
from shapegcode.model.machine_model import BLOCK_ENDS, MachineModel
from shapegcode.shaping.grid import choose_grid
from shapegcode.verdict.figures import Case, CaseSimulation

_WITH, _WITHOUT = "with-override-contours", "without-override-contours"
_TEN_LINES = b"%\nO1\nG21G17G90G94G40G49G80\nG0X0.Y0.Z0.\nG1X50.F3000\nY50.\nX20.\nY20.\nM30\n%\n"
_PARALLEL = GOLDEN / "PARALLEL.NC"
_HEAD = b"%\nO0001\nG21G17G90G94G40G49G80\nG0X0.Y0.Z0.\n"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--lines", type=int, default=100_000, help="G01 lines of the program (default: %(default)s)")
    parser.add_argument("--repetitions", type=int, default=8, help="of each (default: %(default)s)")
    arguments = parser.parse_args()
    machine = sg.Machine.load("vx500")
    with tempfile.TemporaryDirectory(prefix="shapegcode-bench-") as name:
        file = Path(name) / "program.nc"
        workload.write_program(file, arguments.lines)
        program = sg.Program.read(file, machine)
        _override_rows(Path(name), file, arguments.repetitions)
    (region,) = program.regions
    path, model, grid = region.path, MachineModel(machine), choose_grid(machine)
    writer = RegionWriter(model, grid)
    limits, tolerance, offset = model.limits(), writer.tolerance(machine.tolerance.contour_um), model.offset(region)

    def shaped() -> None:
        shaper = _core.RegionShaper(path, grid.fir, [], writer.options(limits, tolerance, offset))
        while shaper.next(1 << 17) is not None:
            pass

    def least(what: str, action: Callable[[], Any]) -> Any:
        spent = []
        for _ in range(arguments.repetitions):
            seconds, result = timed(action, time.thread_time)
            spent.append(seconds)
        print(f"{what:<42} {min(spent) * 1e3:8.1f} ms", flush=True)
        return result

    least("shaping", shaped)
    text = b"".join(writer.write(program, region, limits, tolerance).text.parts())
    emitted = sg.Program.from_text(_HEAD + text + b"M30\n%\n", machine, source="emitted", emitted=True)
    lines = _HEAD.count(b"\n")
    blocks = emitted.core.cutting_path(lines + 1, lines + text.count(b"\n"))
    tracker = least("tracker of the path", lambda: _core.ContourTracker(path))
    least("original simulated", lambda: model.simulate_original(path, offset=offset))
    for rule in BLOCK_ENDS:

        def emitted_played(rule: _core.BlockEnd = rule) -> _core.SimulationFigures:
            return model.simulate_emitted(blocks, path, rule, offset=offset, tracker=tracker, increment_mm=1e-3)

        least(f"emitted text simulated, {rule.name}", emitted_played)
    least("the same, the table alone", lambda: model.simulate_emitted(
        blocks, path, offset=offset, tracker=tracker, command_contour=False))  # fmt: skip
    least("emitted text, planned again", lambda: model.simulate_planned(blocks, path, offset=offset, tracker=tracker))
    least("time of the blocks", lambda: _core.simulated_duration_s(blocks, model.period_s, model.own_rule, 0.8))
    return 0


def _override_rows(folder: Path, long_file: Path, repetitions: int) -> None:
    """Whole conversions with and without the contour at other feed overrides, in turn."""
    short_file = folder / "ten.nc"
    short_file.write_bytes(_TEN_LINES)
    for what, file, values in (
        ("ten lines", short_file, {}),
        ("PARALLEL.NC, 10 um", _PARALLEL, {"tolerance.contour_um": 10}),
        (long_file.name, long_file, {}),
    ):
        settings = [word for key, value in values.items() for word in ("--set", f"{key}={value}")]
        ratios = []
        for _ in range(repetitions):
            without, now = (
                processes.launched(
                    [sys.executable, __file__, way, "convert", file, "-m", "vx500", "-o", folder / "out.nc", *settings],
                    accepted=(0, 1),
                )
                for way in (_WITHOUT, _WITH)
            )
            ratios.append((now.wall_s / without.wall_s, now.cpu_s / without.cpu_s))
        wall, cpu = (median(column) for column in zip(*ratios, strict=True))
        print(f"override contours, {what:<20} wall x {wall:.2f}, CPU x {cpu:.2f}", flush=True)


def _run_command(way: str, words: Sequence[str]) -> int:
    """A command of shapegcode, with the contour at other overrides or with their residual alone."""
    if way == _WITH:
        return cli.main(words)
    with (
        mock.patch.object(CaseSimulation, "_beside", lambda *_: False),
        mock.patch.object(Case, "needs_contour", lambda case, _target: case.override == 1.0),
    ):
        return cli.main(words)


if __name__ == "__main__":
    sys.exit(_run_command(sys.argv[1], sys.argv[2:]) if sys.argv[1:2] in ([_WITH], [_WITHOUT]) else main())
