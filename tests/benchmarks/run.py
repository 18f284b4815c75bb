"""Measures shapegcode against named peers in the same run: `make bench`. The rows: docs/evidence/benchmarks.md."""

from __future__ import annotations

import argparse
import json
import os
import platform
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import date
from pathlib import Path
from typing import Any
from unittest import mock

import native
import numpy as np
import numpy.typing as npt
import processes
import workload
from places import ROOT
from table import Row, Sample, comparison_table, markdown, timed

import shapegcode as sg
from rs274_tool import rs274_command, run_rs274
from shapegcode import _core
from shapegcode.conversion.write import RegionWriter
from shapegcode.model.machine_model import MachineModel, fanuc_model
from shapegcode.shaping.grid import choose_grid

_MEGA = 1e6
_FIR_SAMPLES = 1_000_000
_FIR_DELAYS, _FIR_TAPS = (0, 7, 11), (0.4, 0.3, 0.3)  # as long as the minimal shaper of 46 and 131 Hz, on 1 ms
_FIR_REPETITIONS = 21
_BUSY_CORES = 0.2  # used by others: above it the run says little
_PAPER_PATH = ROOT / "python" / "shapegcode" / "data" / "paper_path.nc"
_STEP_NAMES = {
    "clock": "nothing (the clock read twice)",
    "interpolator_paper": "Interpolator, paper path",
    "interpolator_long": "Interpolator, G01 program",
    "block_player_paper": "BlockInterpolator, paper path",
    "block_player_long": "BlockInterpolator, G01 program",
    "fir_stream": "FirStream, 3 taps, 3 axes",
    "modal_plant": "ModalPlant, modes on X and Y",
}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--lines", type=int, default=1_000_000, help="G01 lines of the program (default: %(default)s)")
    parser.add_argument("--repetitions", type=int, default=5, help="of the long measurements (default: %(default)s)")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write every single value to FILE")
    arguments = parser.parse_args()

    machine = {"date": date.today().isoformat(), **_machine()}
    others = _OtherProcesses()
    with tempfile.TemporaryDirectory(prefix="shapegcode-bench-") as name:
        folder = Path(name)
        program = folder / "program.nc"
        workload.write_program(program, arguments.lines)
        size = program.stat().st_size
        print(f"program: {arguments.lines} G01 lines, {size / arguments.lines:.1f} bytes each", end="\n\n")
        rows = _program_rows(folder, program, arguments.lines, arguments.repetitions)
        rows += _timing_rows(program, arguments.repetitions)
        rows += _filter_rows()
        print(comparison_table(rows), end="\n\n", flush=True)
        steps = _step_times(program)
    cores_taken = others.cores_taken()

    print(_step_table(steps), end="\n\n")
    print("{date}, {cpu}, {cores} cores, {memory_gb:.0f} GB, Python {python}, NumPy {numpy}".format(**machine))
    print(f"other processes took {cores_taken:.2f} cores during the run", end="")
    print(": too busy, the conversion, which uses all cores, loses most" if cores_taken > _BUSY_CORES else "")
    if arguments.json:
        figures = {"machine": machine, "cores_taken_by_others": cores_taken, "lines": arguments.lines, "bytes": size}
        figures["rows"] = {row.key: row.as_json() for row in rows}
        figures["step_time_ns"] = steps
        arguments.json.write_text(json.dumps(figures, indent=2) + "\n", encoding="utf-8")
    return 0


def _program_rows(folder: Path, program: Path, lines: int, repetitions: int) -> list[Row]:
    """Reading, conversion and its parts, each repetition beside one run of rs274."""
    short = folder / "short.nc"
    workload.write_program(short, 1000)
    if (found := sum("STRAIGHT_FEED(" in line for line in run_rs274(short.read_text(), folder))) != 1000:
        raise RuntimeError(f"rs274 reads {found} moves of 1000: the comparison would be void")

    machine = sg.Machine.load("vx500")
    grid = choose_grid(machine)
    model = MachineModel(machine)
    limits, writer = model.limits(), RegionWriter(model, grid)
    tolerance = writer.tolerance(machine.tolerance.contour_um)
    reading, look_ahead, shaping, emission = [], [], [], []
    peers, conversions = [], []
    for repetition in range(repetitions):
        print(f"repetition {repetition + 1} of {repetitions}", file=sys.stderr)
        peers.append(processes.launched(*rs274_command(program, folder)))
        conversions.append(processes.convert(program, folder / "shaped.nc"))
        read_s, read = timed(lambda: sg.Program.read(program, machine))
        reading.append(read_s)
        (region,) = read.regions
        path = region.path
        look_ahead.append(timed(lambda path=path: _core.plan_speed(path, limits, tolerance))[0])
        with _time_inside(_core, "fit_blocks", "write_blocks") as inside:
            shaping.append(timed(lambda read=read, region=region: writer.write(read, region, limits, tolerance))[0])
        emission.append(sum(inside))
        del read, region, path

    def rate(seconds: list[float]) -> Sample:
        return Sample.of([lines / s / _MEGA for s in seconds])

    peer = "rs274 reading it, whole process"
    peer_rate = rate([run.wall_s for run in peers])
    unit = "M lines/s"
    return [
        Row("read", "reading a program", unit, rate(reading), peer, peer_rate, at_least=10),
        Row("convert", "conversion, whole process, wall", "s", Sample.of([run.wall_s for run in conversions]), peer,
            Sample.of([run.wall_s for run in peers]), at_most=1),
        Row("convert_cpu", "conversion, whole process, CPU", "s", Sample.of([run.cpu_s for run in conversions]), peer,
            Sample.of([run.cpu_s for run in peers])),
        Row("convert_memory", "conversion, peak memory", "MB", Sample.of([run.peak_mb for run in conversions]),
            at_most=300),
        Row("look_ahead", "look-ahead alone", unit, rate(look_ahead), peer, peer_rate),
        Row("emission", "emission alone: fit of blocks and text", unit, rate(emission), peer, peer_rate),
        Row("shape_region", "look-ahead, sampling, filter, emission", unit, rate(shaping), peer, peer_rate),
    ]  # fmt: skip


def _timing_rows(program: Path, repetitions: int) -> list[Row]:
    """Cycle time in closed form beside the same question answered by giving every set-point."""
    machine = sg.Machine.load("vx500")
    read = sg.Program.read(program, machine).core
    rows = []
    for motion in (_core.MotionKind.after_interpolation, _core.MotionKind.look_ahead):
        model = fanuc_model(machine)
        model.motion = motion
        closed, full = [], []
        for _ in range(repetitions):
            closed_s, cycle = timed(lambda model=model: _core.time_program(read, model))
            full_s, interpolated = timed(lambda model=model: _core.interpolate_program(read, model))
            np.testing.assert_allclose(cycle.total_s, interpolated.total_s, rtol=0.005)
            closed.append(closed_s)
            full.append(full_s)
        # In look-ahead both sides plan the speed, and most of the time is the plan.
        target = 0.2 if motion == _core.MotionKind.after_interpolation else None
        what = f"cycle time, {motion.name.replace('_', ' ')}"
        key = f"cycle_time_{motion.name}"
        rows += [
            Row(key, what, "s", Sample.of(closed), at_most=0.2),
            Row(f"{key}_full", what, "s", Sample.of(closed), "full interpolation", Sample.of(full), at_most=target),
        ]
    return rows


def _filter_rows() -> list[Row]:
    """A 3-tap shaper on 3 axes beside numpy.convolve and a plain copy; every one allocates its result."""
    fir = sg.Fir(list(_FIR_DELAYS), list(_FIR_TAPS))
    kernel = np.zeros(_FIR_DELAYS[-1] + 1)
    kernel[list(_FIR_DELAYS)] = _FIR_TAPS
    walk = np.cumsum(np.random.default_rng(1).normal(size=(_FIR_SAMPLES, 3)), axis=0)
    rows = []
    for order, layout in (("F", "axis by axis"), ("C", "sample by sample")):
        samples: npt.NDArray[np.float64] = np.array(walk, order=order)

        def convolve(samples: npt.NDArray[np.float64] = samples) -> Any:
            return [np.convolve(samples[:, axis], kernel) for axis in range(3)]

        def copy(samples: npt.NDArray[np.float64] = samples) -> Any:
            result = np.empty_like(samples)  # keeps the layout, as ndarray.copy() does not
            np.copyto(result, samples)
            return result

        expected = np.stack(convolve(), axis=1)[:_FIR_SAMPLES][_FIR_DELAYS[-1] :]
        np.testing.assert_allclose(fir.apply(samples)[_FIR_DELAYS[-1] : _FIR_SAMPLES], expected, atol=1e-9)

        seconds: dict[str, list[float]] = {"fir": [], "convolve": [], "copy": []}
        for _ in range(_FIR_REPETITIONS):
            seconds["fir"].append(timed(lambda samples=samples: fir.apply(samples))[0])
            seconds["convolve"].append(timed(convolve)[0])
            seconds["copy"].append(timed(copy)[0])
        rates = {
            name: Sample.of([_FIR_SAMPLES / s / _MEGA for s in values[1:]]) for name, values in seconds.items()
        }  # the first call pays for fresh memory
        what, unit = f"Fir.apply, 3 taps, (1e6, 3) {layout}", "M samples/s"
        key = f"fir_{order.lower()}"
        rows += [
            Row(f"{key}_convolve", what, unit, rates["fir"], "numpy.convolve per axis", rates["convolve"], at_least=6),
            Row(f"{key}_copy", what, unit, rates["fir"], "NumPy copy", rates["copy"], at_least=0.6),
        ]
    return rows


def _step_times(program: Path) -> dict[str, dict[str, int]]:
    """One step() of each real-time form, from the C++ program that is built here."""
    run = subprocess.run(
        [native.built("step_time"), _PAPER_PATH, program], stdout=subprocess.PIPE, text=True, check=True
    )
    figures: dict[str, dict[str, int]] = json.loads(run.stdout)
    return figures


def _step_table(steps: dict[str, dict[str, int]]) -> str:
    columns = {
        "median": "median_ns", "99.99 %": "p9999_ns", "longest": "longest_ns",
        "longest, best of passes": "longest_repeatable_ns",
    }  # fmt: skip
    rows = [
        [_STEP_NAMES[name], "{steps} × {passes}".format(**figures), *(str(figures[key]) for key in columns.values())]
        for name, figures in steps.items()
    ]
    return markdown(["one step(), ns", "steps × passes", *columns], rows)


@contextmanager
def _time_inside(module: Any, *names: str) -> Iterator[list[float]]:
    """Collect the seconds spent in functions of a module while something else calls them."""
    spent: list[float] = []

    def watched(function: Callable[..., Any]) -> Callable[..., Any]:
        def call(*args: Any, **kwargs: Any) -> Any:
            seconds, result = timed(lambda: function(*args, **kwargs))
            spent.append(seconds)
            return result

        return call

    with mock.patch.multiple(module, **{name: watched(getattr(module, name)) for name in names}):
        yield spent


class _OtherProcesses:
    """How much of the machine everything but this run uses, from the kernel's own counts."""

    def __init__(self) -> None:
        self._start = self._counts()

    def cores_taken(self) -> float:
        """Cores that others kept busy on average since the start."""
        wall, busy, own = (now - then for now, then in zip(self._counts(), self._start, strict=True))
        return max(0.0, busy - own) / wall

    @staticmethod
    def _counts() -> tuple[float, float, float]:
        """Seconds: wall, all cores busy, this process and its finished children."""
        first = Path("/proc/stat").read_text(encoding="ascii").splitlines()[0]
        user, nice, system, _idle, _io_wait, interrupt, soft_interrupt, stolen = map(int, first.split()[1:9])
        busy = (user + nice + system + interrupt + soft_interrupt + stolen) / os.sysconf("SC_CLK_TCK")
        return time.monotonic(), busy, sum(os.times()[:4])


def _machine() -> dict[str, Any]:
    models = [
        line.partition(":")[2].strip()
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        if line.startswith("model name")
    ]
    return {
        "cpu": models[0] if models else platform.machine(),
        "cores": os.cpu_count(),
        "memory_gb": os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e9,
        "python": platform.python_version(),
        "numpy": np.__version__,
    }


if __name__ == "__main__":
    sys.exit(main())
