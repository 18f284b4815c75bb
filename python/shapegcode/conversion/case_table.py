"""The cases of a verdict as a table: what each leaves, whether it counts, and which one decides."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.table import Table

__all__ = ["case_table"]

_SWINGS_UM = 0.005  # an axis that nowhere reaches this has no column


def case_table(report: Mapping[str, Any]) -> Table | None:
    """Every case of a report, the one that decides in bold; None without cases."""
    from rich import box
    from rich.table import Table
    from rich.text import Text

    cases = report.get("cases") or []
    if not cases:
        return None
    worst = (report.get("worst_case") or {}).get("name")
    axes = [axis for axis in "xyz" if any(case["residual_um"][axis] >= _SWINGS_UM for case in cases)]
    title = "cases of the verdict: residual X Y Z, contour error of command and table, µm"
    # Narrow enough for a terminal of 80 columns: a cut figure says nothing.
    table = Table(
        title=title, title_justify="left", show_edge=False, pad_edge=False, box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0)
    )
    table.add_column("case", no_wrap=True)
    headings = [axis.upper() for axis in axes]
    for heading in (*headings, "command", "table", "s", "limit"):
        table.add_column(heading, justify="right", no_wrap=True)
    table.add_column("verdict", no_wrap=True)
    for case in cases:
        contour = case["contour_error_um"]
        cells = [
            case["name"],
            *(f"{case['residual_um'][axis]:.2f}" for axis in axes),
            _micrometres(contour["command"]),
            _micrometres(contour["response"]),
            f"{case['time_s']:.2f}",
            _share(case["share_of_limit"]),
            _verdict(case) + (" <- worst" if case["name"] == worst else ""),
        ]
        table.add_row(*(Text(cell) for cell in cells), style=_style(case, case["name"] == worst))
    shown = sum(not case["counts"] for case in cases)
    brackets = "; those in brackets are only shown" if shown else ""
    table.caption = Text(f"{len(cases) - shown} of {len(cases)} cases count{brackets} ([verdict])")
    table.caption_justify = "left"
    return table


def _micrometres(value: float | None) -> str:
    return "-" if value is None else f"{value:.1f}"


def _share(share: float | None) -> str:
    """Of the limit in percent; a limit of zero leaves no share."""
    return "no limit but 0" if share is None else f"{share * 100:.0f} %"


def _verdict(case: Mapping[str, Any]) -> str:
    word = "within" if case["within"] else "OUT"
    return word if case["counts"] else f"({word.lower()})"


def _style(case: Mapping[str, Any], worst: bool) -> str:
    if not case["counts"]:
        return "dim"
    colour = "" if case["within"] else "red"
    return f"bold {colour}".strip() if worst else colour
