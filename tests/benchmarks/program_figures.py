"""What `convert` makes of every program of some folders, and of drawn ones, as a table.

    python tests/benchmarks/program_figures.py FOLDER... [--draws N] [-m MACHINE] [--set KEY=VALUE] [--markdown]

Read or refused (and whether a control would refuse it too), cuts shaped of all, vibration and contour of the whole
program before and after, price (of the program, and of the dearest cut), size, recommendation. Drawn programs
(`tests/oracles/judge/draws.py`, each on a machine of its own) are held against the tests' independent interpreter,
player and plant too: shaped cuts, cuts left unchanged, rapids and everything between. Below the table: what would be a
fault of shapegcode, such as a price that is exceeded, a cut left unshaped without a reason, or figures that
`simulate --against` or the independent judge do not confirm. Exit code 1 if there is one.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path

import places  # noqa: F401

import shapegcode as sg
from judge.draws import draw
from random_verdict import complaints, convert

_SUFFIXES = {".nc", ".tap", ".cnc", ".ngc", ".gcode", ".prg", ".min", ".txt", ".eia", ".iso"}
_HEADS = (
    "program", "result", "cutting s", "cuts shaped", "residual µm", "contour µm", "time", "dearest cut", "size",
    "recommendation",
)  # fmt: skip


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


def row(path: Path, machine: sg.Machine) -> Row:
    """One program, converted."""
    try:
        conversion, settings = converted(path, machine)
    except sg.ShapegcodeError as error:
        return refused(path, error)
    if settings:
        machine = machine.with_values({"input.arc_centre": settings.split()[-1]})
    return row_of(path.name, conversion, machine, settings, path)


def row_of(name: str, conversion: sg.Conversion, machine: sg.Machine, settings: str, original: Path | None) -> Row:
    """A conversion as a row."""
    vibration, contour = conversion.residual_vibration_um, conversion.contour_error_um.response
    whole, cuts = conversion.cycle_time_s, conversion.cuts
    increase = (whole.emitted / whole.original - 1.0) * 100.0 if whole.original > 0.0 else 0.0
    dearest = max(((cut.time_s.emitted / cut.time_s.original - 1.0) * 100.0 for cut in cuts), default=0.0)
    faults = [
        f"{name}: lines {cut.lines} unshaped without a reason" for cut in cuts if not cut.is_shaped and not cut.reason
    ]
    if increase > machine.price.program_time_percent + 1e-6 or dearest > machine.price.cut_time_percent + 1e-6:
        faults.append(f"{name}: takes {increase:.2f} % more, one cut {dearest:.2f} %: above the price")
    if original is not None and not settings:
        verdict = sg.simulate(conversion.emitted, machine, record_samples=0, against=original).verdict
        assert verdict is not None
        for figure in ("residual_vibration_um", "contour_error_um", "rapid_vibration_um"):
            if getattr(verdict, figure) != getattr(conversion, figure):
                faults.append(f"{name}: {figure}: simulate --against {getattr(verdict, figure)}")
    shaped = sum(cut.is_shaped for cut in cuts)
    ratio = conversion.bytes_emitted / max(conversion.bytes_read, 1)
    cells = (
        name, f"read{', ' + settings if settings else ''}", f"{conversion.cutting_time_s.original:.0f}",
        f"{shaped} of {len(cuts)}", f"{max(vibration.original):.1f} → {max(vibration.emitted):.1f}",
        f"{contour.original.max:.1f} → {contour.emitted.max:.1f}", f"{increase:+.1f} %", f"{dearest:+.1f} %",
        f"{ratio:.2f}", conversion.recommendation,
    )  # fmt: skip
    return Row(cells, ratio, tuple(faults))


def drawn(seed: int) -> Row:
    """A drawn program on its own machine, with what the independent judge says of it."""
    case = convert(draw(seed), shape_all=False)
    found = row_of(f"draw {seed}", case.conversion, case.machine, "", None)
    return Row(found.cells, found.size_ratio, (*found.faults, *(f"draw {seed}: {what}" for what in complaints(case))))


def shown(rows: list[Row], *, markdown: bool) -> str:
    """The table."""
    table = [_HEADS, *(each.cells for each in rows)]
    if markdown:
        rule = "|" + "|".join(["---", "---", *["--:"] * 7, "---"]) + "|"
        lines = ["| " + " | ".join(cells) + " |" for cells in table]
        return "\n".join([lines[0], rule, *lines[1:]])
    widths = [max(len(cells[k]) for cells in table) for k in range(len(_HEADS))]
    return "\n".join("  ".join(cell.ljust(width) for cell, width in zip(cells, widths, strict=True)) for cells in table)


def main() -> int:
    """Table, median size, faults."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--draws", type=int, default=0, metavar="N", help="drawn programs, held against the judge")
    parser.add_argument("folders", nargs="*", type=Path, metavar="FOLDER", help="folders of programs, or programs")
    parser.add_argument("-m", "--machine", default="vx500", help="machine file or built-in machine")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="another value for a key")
    parser.add_argument("--markdown", action="store_true", help="as a table of a page")
    args = parser.parse_args()
    machine = sg.Machine.load(args.machine)
    if args.set:
        pairs = (assignment.partition("=") for assignment in args.set)
        machine = machine.with_values({key: tomllib.loads(f"v = {value}")["v"] for key, _, value in pairs})
    rows = [row(path, machine) for path in programs_in(args.folders)] + [drawn(seed) for seed in range(args.draws)]
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
