"""Processor time of what a conversion spends it on: shaping, text, and the playbacks of the verdict; least of some."""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import workload

import shapegcode as sg
from shapegcode import _core
from shapegcode.conversion.write import RegionWriter
from shapegcode.model.machine_model import MachineModel
from shapegcode.shaping.grid import choose_grid
from shapegcode.verdict.case_player import BLOCK_ENDS

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
            begin = time.thread_time()
            result = action()
            spent.append(time.thread_time() - begin)
        print(f"{what:<42} {min(spent) * 1e3:8.1f} ms", flush=True)
        return result

    least("shaping", shaped)
    text = b"".join(writer.write(program, region, limits, tolerance).text.parts())
    emitted = sg.Program.from_text(_HEAD + text + b"M30\n%\n", machine, source="emitted", emitted=True)
    lines = _HEAD.count(b"\n")
    blocks = emitted.core.cutting_path(lines + 1, lines + text.count(b"\n"))
    tracker = least("tracker of the path", lambda: _core.ContourTracker(path))
    least("original played", lambda: model.play_original(path, offset=offset))
    for rule in BLOCK_ENDS:

        def emitted_played(rule: _core.BlockEnd = rule) -> _core.PlaybackFigures:
            return model.play_emitted(blocks, path, rule, offset=offset, tracker=tracker, increment_mm=1e-3)

        least(f"emitted text played, {rule.name}", emitted_played)
    least("the same, the table alone", lambda: model.play_emitted(
        blocks, path, offset=offset, tracker=tracker, command_contour=False))  # fmt: skip
    least("emitted text, planned anew", lambda: model.play_planned(blocks, path, offset=offset, tracker=tracker))
    least("time of the blocks", lambda: _core.play_duration_s(blocks, model.period_s, model.own_rule, 0.8))
    return 0


if __name__ == "__main__":
    sys.exit(main())
