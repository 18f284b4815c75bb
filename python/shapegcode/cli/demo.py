"""``shapegcode demo``: repeat a paper's figures."""

from __future__ import annotations

import argparse

from shapegcode.cli.console import add_json_argument

__all__ = ["add_arguments", "run"]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.description = "Repeats the figures of a paper with this program's models, and shows both."
    parser.add_argument(
        "name",
        metavar="NAME",
        choices=("path",),
        help="path: line, arc, line of paper 000 at both feeds and reductions",
    )
    add_json_argument(parser)


def run(args: argparse.Namespace) -> int:
    """Run one demonstration.

    Raises:
        OSError: the JSON file cannot be written.
    """
    from rich.table import Table

    from shapegcode.cli import ExitCode
    from shapegcode.cli.console import output_console, progress, write_json
    from shapegcode.demos import path_demo

    with progress("paper 000", args.json):
        result = path_demo()
    if args.json is not None:
        write_json(result, args.json)
    console = output_console(args.json)
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
