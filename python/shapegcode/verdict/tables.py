"""The operating conditions of a verdict as a table."""

from __future__ import annotations

import re
from collections.abc import Sequence

from shapegcode.results.table import NO_BREAK, Column, Table
from shapegcode.verdict.figures import CaseVerdict

__all__ = ["case_table", "unbroken"]

_NUMBER = re.compile(r"(\d) (%|ms\b|s\b|mm\b|Hz\b|µm\b)")
_SWINGS_UM = 0.005  # an axis that nowhere reaches this has no column


def case_table(cases: Sequence[CaseVerdict], worst: CaseVerdict | None) -> Table:
    """What every case leaves, whether it counts, and which one decides."""
    columns = (
        Column("condition", value=lambda case: unbroken(case.name), text=True),
        *(
            Column(axis.upper(), value=f"residual_um.{axis}", digits=2)
            for axis in "xyz"
            if any(case.residual_um[axis] >= _SWINGS_UM for case in cases)
        ),
        Column("command", value=lambda case: _micrometres(case.contour_error_um.command)),
        Column("resp.", value=lambda case: _micrometres(case.contour_error_um.response)),
        Column("s", value=lambda case: "-" if case.time_s is None else f"{case.time_s:.2f}"),
        Column("of limit", value=lambda case: _share(case.share_of_limit)),
        Column("verdict", value=lambda case: _verdict(case) + (" <- worst" if case is worst else ""), left=True),
    )
    shown = sum(not case.counts for case in cases)
    brackets = "; those in brackets are only shown" if shown else ""
    return Table(
        "operating conditions: residual X Y Z, contour error of command and response, µm",
        columns,
        cases,
        caption=f"{len(cases) - shown} of {len(cases)} operating conditions count{brackets} ([verdict])",
        row_style=lambda case: _style(case, case is worst),
    )


def unbroken(text: str) -> str:
    """Keep a number on the line of its unit."""
    return _NUMBER.sub(rf"\1{NO_BREAK}\2", text)


def _micrometres(value: float | None) -> str:
    return "-" if value is None else f"{value:.1f}"


def _share(share: float | None) -> str:
    """Of the limit in percent; a limit of zero leaves no share."""
    return "no limit but 0" if share is None else f"{share * 100:.0f} %"


def _verdict(case: CaseVerdict) -> str:
    word = "within" if case.within else "OUT"
    return word if case.counts else f"({word.lower()})"


def _style(case: CaseVerdict, worst: bool) -> str:
    if not case.counts:
        return "dim"
    colour = "" if case.within else "red"
    return f"bold {colour}".strip() if worst else colour
