"""The answer of ``shapegcode check`` as a table, a summary and one next step."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from shapegcode.checking.check import Check, Finding

if TYPE_CHECKING:
    from rich.table import Table

__all__ = ["findings_table", "next_step", "summary"]

_SHOWN_ALIKE = 5
_STYLES = {"alarm": "bold red", "warning": "yellow", "note": "dim"}


def findings_table(check: Check) -> Table:
    """One row per finding in the order of places; of many alike the first ones and how many more there are."""
    from rich.table import Table
    from rich.text import Text

    table = Table(title=f"{check.program} on {check.machine}", show_edge=False, pad_edge=False)
    table.add_column("place", overflow="fold")
    table.add_column("", no_wrap=True)
    table.add_column("alarm", justify="right", no_wrap=True)
    table.add_column("what", overflow="fold")
    for finding in _first_of_each(check):
        number = f"{finding.alarm:04d}" if finding.alarm else ""
        severity = Text(finding.severity, style=_STYLES[finding.severity])
        table.add_row(Text(place(finding)), severity, number, Text(finding.message))
    for kind, count in _left_out(check).items():
        table.add_row("", "", "", Text(f"... and {count} more of {kind}: --json lists them"))
    return table


def place(finding: Finding) -> str:
    """``file:line:column`` as far as it is known."""
    parts = [finding.file]
    if finding.line > 0:
        parts.append(str(finding.line))
        if finding.column > 0:
            parts.append(str(finding.column))
    return ":".join(parts)


def summary(check: Check) -> str:
    """What was found, in one line."""
    counted = ", ".join(f"{count} {name}{'' if count == 1 else 's'}" for name, count in check.counts.items())
    return f"{counted}; {check.size_bytes} of {check.memory_bytes} bytes of program memory"


def next_step(check: Check) -> str:
    """The one thing to do next, in one sentence."""
    if check.counts["alarm"] > 0:
        first = next(finding for finding in check.findings if finding.severity == "alarm")
        return f"correct {place(first)} first: alarms behind it may come from it."
    codes = check.counts_by_code
    worst = {finding.code for finding in check.findings if finding.severity == "warning"}
    if "dnc_rate" in worst:
        return "raise the baud rate or lower the feed where the serial line starves (controller.dnc_baud)."
    if "program_memory" in worst:
        return "drip feed the program (controller.dnc_baud), or split it."
    if "short_block" in worst:
        count = codes["short_block"]
        stretches = "the stretch" if count == 1 else f"the {count} stretches"
        return f"post longer blocks, or lower the feed, in {stretches} with short blocks (controller.block_time_s)."
    if "axis_feed" in worst:
        return "lower F to what the axes allow: the control does so anyway."
    if worst:
        return "move what stops the control out of the cut."
    return "shapegcode time tells how long it takes, shapegcode simulate how it vibrates."


def _kind(finding: Finding) -> tuple[str, str]:
    return finding.severity, finding.code


def _first_of_each(check: Check) -> Iterator[Finding]:
    seen: dict[tuple[str, str], int] = {}
    for finding in check.findings:
        seen[_kind(finding)] = seen.get(_kind(finding), 0) + 1
        # What the control refuses is what the user came for.
        if finding.severity == "alarm" or seen[_kind(finding)] <= _SHOWN_ALIKE:
            yield finding


def _left_out(check: Check) -> dict[str, int]:
    shown: dict[str, int] = {}
    for finding in _first_of_each(check):
        shown[finding.code] = shown.get(finding.code, 0) + 1
    return {code: more for code, count in check.counts_by_code.items() if (more := count - shown.get(code, 0)) > 0}
