"""Originals and shaped programs through the planners of open controls.

    PYTHONPATH=tests/oracles python tests/linuxcnc/recorded_planners.py [FOLDER]

Three programs, 5 000 and 10 000 mm/s²: LinuxCNC is recorded in its own simulation, Klipper's host plans in its own
Python. Prints the rows of docs/evidence/recorded_planners.md: residual, table and time, in brackets what `convert` said
with that planner, and what misses its target. Writes the paper's path of all of them into
tests/benchmarks/data/recorded_planners.npz; the README there says what it holds. With FOLDER all recordings are kept
there, those that it has already are not made again, and every figure goes there as JSON.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import cache
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Literal

import linuxcnc_run
import numpy as np
import planner_recordings as recordings
from numpy.typing import NDArray

import shapegcode as sg
from dialect_readers import ReadMove, plan_klipper, read_klipper
from judge import Mode, residual_um
from planner_references import ARC_MM, klipper_text, table_off_path_um
from shapegcode.conversion.translate import translate
from shapegcode.machine.programs import ANY_PRICE

Array = NDArray[np.float64]
Setting = Literal["two lines", "as delivered", "host"]
DATA = linuxcnc_run.ROOT / "tests" / "benchmarks" / "data" / "recorded_planners.npz"
UNIT_MM = 1e-7
"""Of the integers in the file."""
PATHS = {
    "paper": recordings.PATHS["paper"],
    # the contour of CONTOUR_R.NC at F6000: lines and arcs
    "contour": "G01Y55.123F6000.\nX-39.556\nG3X-55.123Y39.556R15.567\nG1Y-39.556\nG3X-39.556Y-55.123R15.567\n"
    "G1X39.556\nG3X55.123Y-39.556R15.567\nG1Y39.556\nG3X39.556Y55.123R15.567\nG1X0.\nY65.123\n",
    "short": recordings.PATHS["short"],  # 119 lines of 0.7 mm
}
STARTS = {"contour": "G00X0.Y65.123Z0.\n"}
MODES = [[Mode(46.0, 0.02)], [Mode(131.0, 0.02)], []]
PERIOD_S = 1e-3
REFUSED = ("no benefit: run the original", "do not run")
user = cache(linuxcnc_run.as_user)


@dataclass(frozen=True)
class Figures:
    """Of a cut: residual vibration of X and Y, µm; its time, s; distances of the table and the path, µm."""

    residual_um: tuple[float, float]
    time_s: float
    contour_um: float
    """Largest distance of the table from the path."""
    both_ways_um: float
    """The same, and of the path from where the table was: what is missed of a corner counts, as in `convert`."""


@dataclass(frozen=True)
class Setup:
    """A program, a control and its settings."""

    path: str
    acceleration: float
    setting: Setting
    more: tuple[tuple[str, Any], ...] = ()
    """Further keys of the machine file."""

    @property
    def control(self) -> str:
        return "klipper" if self.setting == "host" else "linuxcnc"

    def key(self, *, shaped: bool) -> str:
        """Its name in the file."""
        program = "shaped" if shaped else "original"
        return f"{self.control}-{self.path}-{program}-{self.acceleration:.0f}-{self.setting.replace(' ', '-')}"


@dataclass(frozen=True)
class Outcome:
    """What was recorded, beside what `convert` said."""

    setup: Setup
    shaped: bool
    recorded: Figures
    said: Figures
    recommendation: str


def machine_of(setup: Setup) -> sg.Machine:
    """The recorded one."""
    axes = {f"axes.{axis}.max_acceleration_mm_s2": setup.acceleration for axis in "xyz"}
    rates = {f"axes.{axis}.max_feed_mm_per_min": 30_000.0 for axis in "xyz"}
    keys = {**ANY_PRICE, **axes, **rates, "emission.dialect": setup.control, "controller.kind": setup.control}
    keys["controller.dialect"] = "fanuc"  # of PATHS; without it a machine of LinuxCNC's kind reads G04P500 as 500 s
    if setup.control == "linuxcnc":
        lines = {"ramp_frequency_hz": 10_000.0, "kink_ratio": 0.7} if setup.setting == "two lines" else {}
        keys["controller.linuxcnc"] = {"rapid_follows": False, **lines}
    return sg.Machine.load("vx500").with_values({**keys, **dict(setup.more)})


@cache
def converted(setup: Setup) -> tuple[sg.Program, sg.Conversion]:
    """The original as FANUC's program, and its conversion."""
    return shaped_on(setup.path, machine_of(setup))


def shaped_on(path: str, machine: sg.Machine) -> tuple[sg.Program, sg.Conversion]:
    """One of the paths, and its conversion on a machine."""
    start, stop = STARTS.get(path, "G00X0.Y0.Z0.\n"), recordings.STOP
    program = sg.Program.from_text(f"G21G90\n{start}{stop}{PATHS[path]}{stop}M30\n", machine)
    return program, sg.convert(program, machine, shape_all=True)


def text_of(setup: Setup, *, shaped: bool) -> bytes:
    """The program in the words of its control."""
    program, conversion = converted(setup)
    if shaped:
        return conversion.text
    if setup.control == "klipper":
        return klipper_text(program.regions[0].path).encode()
    return translate(program, conversion.simulated.machine).text


def recorded(setup: Setup, *, shaped: bool, override: float = 1.0) -> Array:
    """Set-points of the cut at 1 kHz, mm, as the control's own planner gave them."""
    text = text_of(setup, shaped=shaped)
    if setup.control == "klipper":
        with TemporaryDirectory(prefix="klipper-") as folder:
            cut = last_cut(read_klipper(text.decode(), Path(folder), arc_mm=None if shaped else ARC_MM))
            return plan_klipper(cut, setup.acceleration, Path(folder))[0]
    ini = recordings.ini_of(setup.acceleration, as_delivered=setup.setting == "as delivered")
    return recordings.record(user(), text, ini, override=override)


def last_cut(moves: Sequence[ReadMove]) -> list[ReadMove]:
    """The moves between the last two dwells."""
    dwells = [k for k, move in enumerate(moves) if move.dwell_s]
    return list(moves[dwells[-2] + 1 : dwells[-1]])


def figures(cut: Array, program: sg.Program) -> Figures:
    """By the tests' own plant."""
    path = np.asarray(program.regions[0].path.polyline(0.002))
    contour_um, both_ways_um = table_off_path_um(cut, path, MODES)
    x, y, _ = residual_um(cut, MODES, PERIOD_S, still_mm=1e-7)
    moved = np.flatnonzero(np.any(np.diff(cut, axis=0) != 0.0, axis=1))
    time_s = (moved[-1] - moved[0]) * PERIOD_S
    return Figures((float(x), float(y)), float(time_s), contour_um, both_ways_um)


def said_of(conversion: sg.Conversion, *, shaped: bool) -> Figures:
    """What the conversion says of one of its programs."""
    side = "emitted" if shaped else "original"
    residual = getattr(conversion.residual_vibration_um, side)
    contour_um = getattr(conversion.contour_error_um.response, side).max
    return Figures((residual.x, residual.y), getattr(conversion.cutting_time_s, side), contour_um, contour_um)


def outcome_of(setup: Setup, cut: Array, *, shaped: bool) -> Outcome:
    """A recording beside what was said."""
    program, conversion = converted(setup)
    said = said_of(conversion, shaped=shaped)
    return Outcome(setup, shaped, figures(cut, program), said, conversion.recommendation)


def missed(original: Outcome, shaped: Outcome) -> list[str]:
    """Targets that the shaped program misses, and by how much."""
    found = []
    for axis, before, after in zip("XY", original.recorded.residual_um, shaped.recorded.residual_um, strict=True):
        limit = max(1.5, 0.05 * before)
        if after > limit:
            found.append(f"residual {axis} {after:.1f}, target {limit:.1f} µm")
        if after > before and shaped.recommendation not in REFUSED:
            found.append(f"{axis} worse than the original by {after - before:.1f} µm")
    for outcome in (original, shaped):
        which = "shaped" if outcome.shaped else "original"
        was, said = outcome.recorded, outcome.said
        if abs(was.both_ways_um - said.both_ways_um) > 0.1 * said.both_ways_um + 0.5:
            found.append(f"table of the {which} {100.0 * (was.both_ways_um / said.both_ways_um - 1.0):+.0f} %")
        if abs(was.time_s - said.time_s) > 0.01 * said.time_s + 0.01:
            found.append(f"time of the {which} {1e3 * (was.time_s - said.time_s):+.0f} ms")
    return found


def row(outcome: Outcome, misses: Sequence[str] | None = None) -> str:
    """Of the page; misses: of targets, None: not asked."""
    was, said = outcome.recorded, outcome.said
    residual = "/".join(f"{value:.1f}" for value in was.residual_um)
    told = "/".join(f"{value:.1f}" for value in said.residual_um)
    what = "|" if misses is None else f"{outcome.recommendation} | {'; '.join(misses) or 'met'}"
    return (
        f"| {outcome.setup.path} | {outcome.setup.acceleration:.0f} | {outcome.setup.setting} | "
        f"{'shaped' if outcome.shaped else 'original'} | {residual} ({told}) | {was.both_ways_um:.1f} "
        f"({said.both_ways_um:.1f}) | {was.time_s:.3f} ({said.time_s:.3f}) | {what} |"
    )


def packed(cut: Array) -> NDArray[np.int32]:
    """Set-points as integers of UNIT_MM: the first row, then differences, which are small."""
    return np.diff(np.rint(cut / UNIT_MM).astype(np.int32), axis=0, prepend=np.zeros((1, cut.shape[1]), np.int32))


def unpacked(differences: NDArray[np.int32]) -> Array:
    """Set-points in mm."""
    return np.cumsum(differences, axis=0, dtype=np.int64) * UNIT_MM


def override_and_decimals() -> None:
    """Feed override of 70 %, locked or not, and three decimals: the paper's path at 10 000 mm/s²."""
    for name, setup, override in (
        ("override 70 %", Setup("paper", 10_000.0, "two lines"), 0.7),
        ("override 70 %, locked", Setup("paper", 10_000.0, "two lines", (("emission.override", "lock"),)), 0.7),
        ("three decimals", Setup("paper", 10_000.0, "two lines", (("emission.decimals", 3),)), 1.0),
        ("three decimals", Setup("paper", 10_000.0, "as delivered", (("emission.decimals", 3),)), 1.0),
    ):
        outcome = outcome_of(setup, recorded(setup, shaped=True, override=override), shaped=True)
        print(f"{name}: {row(outcome)}", flush=True)
        for case in converted(setup)[1].cases:
            if case.name.startswith("override 70"):
                print(f"    {case.name}: {case.residual_um.x:.2f}/{case.residual_um.y:.2f}", flush=True)


def main() -> None:
    """Record all of them."""
    kept: dict[str, NDArray[Any]] = {}
    all_of_them = []
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else None
    if folder:
        folder.mkdir(parents=True, exist_ok=True)
    settings: tuple[Setting, ...] = ("host", "two lines", "as delivered")
    for setting, path, acceleration in product(settings, PATHS, (5_000.0, 10_000.0)):
        setup = Setup(path, acceleration, setting)
        pair = []
        for shaped in (False, True):
            file = folder / f"{setup.key(shaped=shaped)}.npy" if folder else None
            cut = np.load(file) if file and file.is_file() else recorded(setup, shaped=shaped)
            if file:
                np.save(file, cut)
            pair.append(outcome_of(setup, cut, shaped=shaped))
            if path == "paper":
                kept[setup.key(shaped=shaped)] = packed(cut)
                text = text_of(setup, shaped=shaped)
                kept[f"{setup.key(shaped=shaped)}-program"] = np.frombuffer(text, np.uint8)
        print(row(pair[0]), row(pair[1], missed(*pair)), sep="\n", flush=True)
        all_of_them += pair
    np.savez_compressed(DATA, **kept)
    if folder:
        (folder / "figures.json").write_text(json.dumps([asdict(each) for each in all_of_them], indent=1) + "\n")
    override_and_decimals()


if __name__ == "__main__":
    main()
