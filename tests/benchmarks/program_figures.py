"""What `convert` makes of every program of some folders, as a table.

    python tests/benchmarks/program_figures.py FOLDER... [-m MACHINE] [--set KEY=VALUE] [--markdown]

Read or refused (and whether a control would refuse it too), share of the cutting time that is shaped, vibration and
contour before and after, size, recommendation. Below the table: what would be a fault of shapegcode, such as a program
that was left unshaped without a word, or rewritten for nothing. Exit code 1 if there is one.
"""

from __future__ import annotations

import argparse
import math
import statistics
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path

import shapegcode as sg

_SUFFIXES = {".nc", ".tap", ".cnc", ".ngc", ".gcode", ".prg", ".min", ".txt", ".eia", ".iso"}
_HEADS = ("program", "result", "cutting s", "shaped", "residual µm", "contour µm", "time", "size", "recommendation")


@dataclass(frozen=True)
class Row:
    """One program; `faults`: what shapegcode should have done better."""

    cells: tuple[str, ...]
    size_ratio: float | None
    faults: tuple[str, ...]


def programs_in(folders: list[Path]) -> list[Path]:
    """Files of the folders that look like programs, by name."""
    found = [path for folder in folders for path in ([folder] if folder.is_file() else sorted(folder.iterdir()))]
    return [path for path in found if path.is_file() and path.suffix.lower() in _SUFFIXES]


def converted(path: Path, machine: sg.Machine) -> tuple[sg.Conversion, str]:
    """The conversion, and the settings that it took: the one that an error message names is tried."""
    try:
        return sg.convert(path, machine), ""
    except sg.ProgramError as error:
        for value in ("absolute", "incremental"):
            if f'set input.arc_centre = "{value}"' in str(error):
                return sg.convert(path, machine.with_values({"input.arc_centre": value})), f"arc centres {value}"
        raise


def refused(path: Path, error: sg.ShapegcodeError) -> Row:
    """A program that was not read: a number of the control's own alarms says that it would refuse it too."""
    alarm = getattr(error, "alarm", 0)
    said = f"refused: alarm {alarm:04d}, as a control would" if alarm else "refused; a control might not"
    faults = () if alarm else (f"{path.name}: {str(error)[:200]}",)
    return Row((path.name, said, *("",) * (len(_HEADS) - 2)), None, faults)


def cutting_s(conversion: sg.Conversion, path: Path, machine: sg.Machine) -> tuple[float, float, float]:
    """Cutting time of the original: shaped, kept by choice, and outside of what can be shaped; s."""
    program = sg.Program.read(path, machine)
    shaped = conversion.cutting_time_s.original
    regions = sg.cycle_time(program, machine, full=False).regions
    outside = math.fsum(
        segment.length_mm / segment.feed_mm_per_s
        for segment, dwell_s in program.core.other_moves
        if dwell_s <= 0.0 and segment.feed_mm_per_s > 0.0
    )
    return shaped, max(0.0, math.fsum(region.duration_s for region in regions) - shaped), outside


def least_gain_um(conversion: sg.Conversion, path: Path, machine: sg.Machine) -> float:
    """What the shaped region that gains least gains, of residual vibration or contour, µm: both texts played anew."""
    before = {run.lines: run for run in sg.simulate(path, machine, record_samples=0).regions}
    after = sg.simulate(conversion.emitted, machine, record_samples=0, against=path).regions
    gains = []
    for region, run in zip(conversion.regions, (run for run in after if run.shaped and not run.was_rapid), strict=True):
        was = before[region.lines]
        contour_mm = was.figures.response.max_abs_mm - run.figures.response.max_abs_mm
        gains.append(max(max(was.residual_vibration_um) - max(run.residual_vibration_um), 1e3 * contour_mm))
    return min(gains)


def row(path: Path, machine: sg.Machine) -> Row:
    """One program, converted."""
    try:
        conversion, settings = converted(path, machine)
    except sg.ShapegcodeError as error:
        return refused(path, error)
    if settings:
        machine = machine.with_values({"input.arc_centre": settings.split()[-1]})
    shaped, kept, outside = cutting_s(conversion, path, machine)
    whole = shaped + kept + outside
    vibration, contour = conversion.residual_vibration_um, conversion.contour_error_um.response
    before, after = max(vibration.original), max(vibration.emitted)
    ratio = len(conversion.text) / path.stat().st_size
    faults = []
    told = len(conversion.kept) + sum("kept untouched" in warning for warning in conversion.warnings)
    if kept + outside > 0.0 and not told and conversion.placed:
        faults.append(f"{path.name}: {kept + outside:.1f} s are unshaped without a word")
    # Regions with absolute arc centres are no FANUC text: they cannot be kept as they are.
    if conversion.placed and not settings:
        gain = least_gain_um(conversion, path, machine)
        if gain < machine.shaping.least_gain_um - 0.05:
            faults.append(f"{path.name}: a region is rewritten for {gain:.1f} µm")
    if not conversion.ok:
        faults.append(f"{path.name}: {next(conversion.misses())}")
    figures = ("", "", "")
    if conversion.placed:
        times = conversion.cycle_time_s
        figures = (
            f"{before:.1f} → {after:.1f}",
            f"{contour.original.max:.1f} → {contour.emitted.max:.1f}",
            f"{(times.emitted / times.original - 1.0) * 100:+.1f} %",
        )
    share = f"{100 * shaped / whole:.0f} %" if whole > 0.0 else "no cut"
    cells = (path.name, f"read{', ' + settings if settings else ''}", f"{whole:.0f}", share, *figures, f"{ratio:.2f}")
    return Row((*cells, conversion.recommendation), ratio, tuple(faults))


def shown(rows: list[Row], *, markdown: bool) -> str:
    """The table."""
    table = [_HEADS, *(each.cells for each in rows)]
    if markdown:
        rule = "|" + "|".join(["---", "---", *["--:"] * 6, "---"]) + "|"
        lines = ["| " + " | ".join(cells) + " |" for cells in table]
        return "\n".join([lines[0], rule, *lines[1:]])
    widths = [max(len(cells[k]) for cells in table) for k in range(len(_HEADS))]
    return "\n".join("  ".join(cell.ljust(width) for cell, width in zip(cells, widths, strict=True)) for cells in table)


def main() -> int:
    """Table, median size, faults."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("folders", nargs="+", type=Path, metavar="FOLDER", help="folders of programs, or programs")
    parser.add_argument("-m", "--machine", default="vx500", help="machine file or built-in machine")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="another value for a key")
    parser.add_argument("--markdown", action="store_true", help="as a table of a page")
    args = parser.parse_args()
    machine = sg.Machine.load(args.machine)
    if args.set:
        pairs = (assignment.partition("=") for assignment in args.set)
        machine = machine.with_values({key: tomllib.loads(f"v = {value}")["v"] for key, _, value in pairs})
    rows = [row(path, machine) for path in programs_in(args.folders)]
    print(shown(rows, markdown=args.markdown))
    ratios = [each.size_ratio for each in rows if each.size_ratio is not None]
    rewritten = [ratio for ratio in ratios if ratio != 1.0]
    if ratios:
        print(f"\nsize: median {statistics.median(ratios):.2f} of {len(ratios)} programs", end="")
        print(f", {statistics.median(rewritten):.2f} of the {len(rewritten)} that were rewritten" if rewritten else "")
    faults = [fault for each in rows for fault in each.faults]
    print("\n".join(["", *faults]) if faults else "no fault found")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
