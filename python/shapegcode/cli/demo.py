"""``shapegcode demo``: repeat a paper's figures."""

from __future__ import annotations

import argparse

from shapegcode.cli.console import add_json_argument

__all__ = ["add_arguments", "run"]

_FOLDER = "demo-output"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.description = "Repeats the figures of a paper with this program's models, and shows both."
    parser.add_argument(
        "name",
        metavar="NAME",
        choices=("path", "cycle-time", "shaper", "metrology", "tap", "corner"),
        help="path: line, arc, line of paper 000 at both feeds and reductions; "
        "cycle-time: a test piece with the features of ISO 10791-7 with both sets of constants of paper 004; "
        "shaper: the two-mode shapers of paper 002, figures 2 to 6, and its test on a stage; "
        "metrology: the specimens of paper 000, measured on the model; "
        "tap: the equivalent systems of paper 003, and what end mill and collet deflect; "
        "corner: the cornering cuts of paper 001, its feeds and the scheduler's",
    )
    parser.add_argument(
        "--plots",
        metavar="DIR",
        default=None,
        help=f"folder for the pictures of `shaper`, `metrology`, `tap` and `corner` (PNG and SVG; default: {_FOLDER})",
    )
    add_json_argument(parser)


def run(args: argparse.Namespace) -> int:
    """Run one demonstration.

    Raises:
        ArgumentError: pictures of a demonstration that has none.
        OSError: the JSON file or a picture cannot be written.
    """
    drawing = {"shaper": _shaper, "metrology": _metrology, "tap": _tap, "corner": _corner}
    if args.name in drawing:
        return drawing[args.name](args.json, args.plots or _FOLDER)
    if args.plots is not None:
        from shapegcode._core import ArgumentError

        raise ArgumentError(f"--plots: demo {args.name} has no pictures")
    return _cycle_time(args.json) if args.name == "cycle-time" else _path(args.json)


def _shaper(json_target: str | None, folder: str) -> int:
    from rich.table import Table

    from shapegcode.cli import ExitCode
    from shapegcode.cli.console import output_console, progress, write_json
    from shapegcode.demos.shaper import shaper_demo
    from shapegcode.demos.shaper_plots import write_demo_pictures

    with progress("paper 002", json_target) as bar:
        bar.wait()
        demo = shaper_demo()
        pictures = write_demo_pictures(demo, folder)
    if json_target is not None:
        write_json({**demo.report, "pictures": pictures}, json_target)
    console = output_console(json_target)
    table = Table(title="Paper 002: two-mode shapers for 1 Hz and 4 Hz")
    table.add_column("figure", no_wrap=True)
    for column in ("what", "paper", "here"):
        table.add_column(column, overflow="fold")
    table.add_column("agrees")
    verdicts = {True: "yes", False: "NO", None: ""}
    for row in demo.report["rows"]:
        table.add_row(row["figure"], row["what"], row["paper"], row["here"], verdicts[row["agrees"]])
    console.print(table)
    console.print(demo.report["remark"], markup=False)
    console.print(f"pictures: {folder}/paper002-*", markup=False)
    console.print("next: shapegcode shaper --mode 1 --mode 4 --period continuous --max-duration 1s", markup=False)
    return ExitCode.OK if demo.report["agrees"] else ExitCode.OUT_OF_TOLERANCE


def _tap(json_target: str | None, folder: str) -> int:
    from rich.table import Table

    from shapegcode.cli import ExitCode
    from shapegcode.cli.console import output_console, progress, write_json
    from shapegcode.demos.tap import tap_demo
    from shapegcode.demos.tap_plots import write_demo_pictures

    with progress("paper 003", json_target) as bar:
        bar.wait()
        demo = tap_demo()
        pictures = write_demo_pictures(demo, folder)
    result = demo.report
    if json_target is not None:
        write_json({**result, "pictures": pictures}, json_target)
    console = output_console(json_target)
    table = Table(title="Paper 003: mass, damping and stiffness from a tap")
    table.add_column("section", no_wrap=True)
    for column in ("what", "paper", "here", "agrees", "note"):
        table.add_column(column, overflow="fold")
    verdicts = {True: "yes", False: "NO", None: ""}
    for row in result["rows"]:
        table.add_row(
            row["section"], row["what"], row["paper"], row["here"], verdicts[row["agrees"]], row["note"]
        )  # fmt: skip
    console.print(table)
    console.print(result["remark"], markup=False)
    console.print(f"pictures: {folder}/paper003-*", markup=False)
    console.print("next: shapegcode identify --tap-plan", markup=False)
    return ExitCode.OK if result["agrees"] else ExitCode.OUT_OF_TOLERANCE


def _corner(json_target: str | None, folder: str) -> int:
    from rich.table import Table

    from shapegcode.cli import ExitCode
    from shapegcode.cli.console import output_console, progress, write_json
    from shapegcode.demos.corner import corner_demo
    from shapegcode.demos.corner_plots import write_corner_pictures

    with progress("paper 001", json_target) as bar:
        demo = corner_demo(bar.update)
        bar.wait()
        pictures = write_corner_pictures(demo, folder)
    result = demo.report
    if json_target is not None:
        write_json({**result, "pictures": pictures}, json_target)
    console = output_console(json_target)
    table = Table(title="Paper 001: cornering cut with an 8 mm end mill, 0.12 mm/rev, 15 mm deep, 0.8 mm wide")
    table.add_column("case", no_wrap=True)
    for column in ("what", "paper", "here", "agrees", "note"):
        table.add_column(column, overflow="fold")
    verdicts = {True: "yes", False: "NO", None: ""}
    for row in result["rows"]:
        said = "differs" if row["note"].startswith("differs") else verdicts[row["agrees"]]
        table.add_row(
            str(row["case"]), row["what"], row["paper"], row["here"], said, row["note"]
        )  # fmt: skip
    console.print(table)
    console.print(result["remark"], markup=False)
    console.print(f"pictures: {folder}/paper001-*", markup=False)
    console.print("next: shapegcode feed YOUR.NC -m vx500 --tool T.toml --stock S.toml -o OUT.NC", markup=False)
    return ExitCode.OK if result["agrees"] else ExitCode.OUT_OF_TOLERANCE


def _path(json_target: str | None) -> int:
    from rich.table import Table

    from shapegcode.cli import ExitCode
    from shapegcode.cli.console import output_console, progress, write_json
    from shapegcode.demos.path import path_demo

    with progress("paper 000", json_target):
        result = path_demo()
    if json_target is not None:
        write_json(result, json_target)
    console = output_console(json_target)
    table = Table(title="Paper 000: line, quarter arc R20, line on a machine with 46 Hz (X) and 131 Hz (Y)")
    table.add_column("feed, arc reduction")
    table.add_column("figure")
    for column in ("unshaped", "ideal command", "emitted 5 ms program", "paper"):
        table.add_column(column, justify="right")
    for row in result["conditions"]:
        unshaped, ideal, emitted, paper = (row[key] for key in ("unshaped", "ideal", "emitted", "paper"))
        name = f"{row['feed_mm_per_s']} mm/s, {row['reduction_percent']} %"
        table.add_row(
            name, "orbit error %", "0", f"{ideal['orbit_error_percent']:.4f}",
            f"{emitted['orbit_error_percent']:.4f}", f"{paper['orbit_error_percent']:.4f}",
        )  # fmt: skip
        for axis in "xy":
            table.add_row(
                "", f"residual {axis.upper()} µm",
                *(f"{each['residual_vibration_um'][axis]:.2f}" for each in (unshaped, ideal, emitted)), "",
            )  # fmt: skip
        table.add_row(
            "", "time s", f"{unshaped['time_s']:.3f}",
            *(f"{each['time_s']:.3f} (+{each['time_increase_percent']:.1f} %)" for each in (ideal, emitted)),
            paper["time"], end_section=True,
        )  # fmt: skip
    console.print(table)
    console.print(result["remark"], markup=False)
    console.print("next: shapegcode convert YOUR.NC -m vx500 -o SHAPED.NC --plots plots", markup=False)
    within = all(row["emitted"]["within_tolerance"] for row in result["conditions"])
    return ExitCode.OK if within else ExitCode.OUT_OF_TOLERANCE


def _cycle_time(json_target: str | None) -> int:
    from rich.table import Table

    from shapegcode.cli import ExitCode
    from shapegcode.cli.console import output_console, progress, write_json
    from shapegcode.demos.path import cycle_time_demo

    with progress("paper 004", json_target) as bar:
        bar.wait()
        result = cycle_time_demo()
    if json_target is not None:
        write_json(result, json_target)
    console = output_console(json_target)
    table = Table(
        title=f"Paper 004: {result['program']} on {result['machine']}; the paper's times are of its own program"
    )
    table.add_column("rapid, bell, cutting ms")
    for column in (
        "closed form s",
        "full interpolation s",
        "difference",
        "computing s",
        "paper predicted / measured s",
    ):
        table.add_column(column, justify="right")
    for row in result["sets"]:
        keys = ("rapid_time_constant_s", "rapid_bell_time_s", "time_constant_s")
        computing, paper = row["computing_s"], row["paper"]
        table.add_row(
            " / ".join(f"{row[key] * 1e3:.0f}" for key in keys),
            f"{row['closed_form_s']:.3f}", f"{row['full_interpolation_s']:.3f}", f"{row['difference_percent']:+.4f} %",
            f"{computing['closed_form']:.3f} + {computing['full_interpolation']:.3f}",
            f"{paper['predicted_s']:.1f} / {paper['measured_s']:.1f}",
        )  # fmt: skip
    console.print(table)
    console.print(result["remark"], markup=False)
    console.print("next: shapegcode time YOUR.NC -m YOUR_MACHINE.toml", markup=False)
    return ExitCode.OK if result["agrees"] else ExitCode.OUT_OF_TOLERANCE


def _metrology(json_target: str | None, folder: str) -> int:
    from shapegcode.cli import ExitCode
    from shapegcode.cli.console import output_console, progress, write_json
    from shapegcode.demos.metrology import metrology_demo
    from shapegcode.metrology.plots import write_measurement_pictures
    from shapegcode.metrology.tables import demo_table

    with progress("paper 000", json_target) as bar:
        bar.wait()
        demo = metrology_demo()
        pictures = write_measurement_pictures(demo.drawn, folder)
    result = demo.report
    if json_target is not None:
        write_json({**result, "pictures": pictures}, json_target)
    console = output_console(json_target)
    for feed in sorted({row["feed_mm_per_s"] for row in result["cases"]}):
        console.print(demo_table(result, feed))
    console.print(result["remark"], markup=False)
    console.print(f"pictures (highest feed): {folder}/measure-*", markup=False)
    console.print("next: shapegcode measure YOUR.NC SHAPED.NC -m YOUR_MACHINE.toml --tool-diameter 3mm", markup=False)
    return ExitCode.OK
