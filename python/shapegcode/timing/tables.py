"""The answer of ``shapegcode time`` as tables, as one next step, and as a file of blocks."""

from __future__ import annotations

from dataclasses import astuple, fields
from typing import TYPE_CHECKING

from shapegcode.timing.cycle_time import AGREEMENT_PERCENT, PARTS, BlockTime, CycleTime, RegionTime, slowest_blocks

if TYPE_CHECKING:
    from rich.table import Table

__all__ = ["LABELS", "blocks_csv", "next_step", "parts_table", "slowest_table", "tool_name", "tools_table"]

LABELS = {
    "cutting_s": "cutting",
    "rapid_s": "rapid",
    "in_position_s": "in-position",
    "dwell_s": "dwell",
    "acceleration_s": "lost to acceleration",
    "tool_change_s": "tool change",
    "function_s": "M functions",
}
"""Name of each part in tables and pictures."""

_SLOWEST = 5
# A part of the time that deserves the next look.
_NOTABLE = 0.1


def tool_name(tool: int | None) -> str:
    """A tool in words."""
    return "no tool yet" if tool is None else f"T{tool}"


def parts_table(time: CycleTime) -> Table:
    """The whole time and its parts, and the full interpolation beside it."""
    from rich.table import Table

    table = Table(title=f"{time.program} on {time.machine}", show_edge=False, pad_edge=False)
    table.add_column("time")
    for heading in ("s", "of the whole"):
        table.add_column(heading, justify="right")
    table.add_row("cycle time", f"{time.total_s:.3f}", _clock(time.total_s), end_section=True)
    for part in PARTS:
        seconds = getattr(time, part)
        table.add_row(LABELS[part], f"{seconds:.3f}", _share(seconds, time.total_s), end_section=part == PARTS[-1])
    if time.full_interpolation_s is not None:
        table.add_row("cycle time by full interpolation", f"{time.full_interpolation_s:.3f}", "")
        table.add_row("difference of the closed form", "", f"{time.difference_percent:+.3f} %")
    return table


def tools_table(time: CycleTime) -> Table:
    """One row per tool, one column per part that any tool needs."""
    from rich.table import Table

    parts = [part for part in PARTS if getattr(time, part) > 0.0]
    table = Table(title="by tool, s", show_edge=False, pad_edge=False)
    table.add_column("tool")
    for heading in ("from line", "total", "share", *(LABELS[part] for part in parts)):
        table.add_column(heading, justify="right")
    for tool in time.tools:
        cells = [str(tool.first_line), f"{tool.total_s:.2f}", _share(tool.total_s, time.total_s)]
        table.add_row(tool_name(tool.tool), *cells, *(f"{getattr(tool, part):.2f}" for part in parts))
    return table


def slowest_regions(time: CycleTime, count: int = _SLOWEST) -> list[RegionTime]:
    """The regions that take longest, longest first."""
    return sorted(time.regions, key=lambda region: -region.duration_s)[:count]


def slowest_table(time: CycleTime) -> Table:
    """The regions and, where they were asked for, the blocks that take longest."""
    from rich.table import Table

    table = Table(title="slowest", show_edge=False, pad_edge=False)
    table.add_column("lines")
    table.add_column("what")
    for heading in ("s", "share", "mm", "mean mm/min"):
        table.add_column(heading, justify="right")
    regions, blocks = slowest_regions(time), slowest_blocks(time.blocks, _SLOWEST)
    rows: list[tuple[str, str, float, float]] = [
        ("{} to {}".format(*region.lines), f"region, {tool_name(region.tool)}", region.duration_s, region.length_mm)
        for region in regions
    ]
    rows += [
        (str(block.line), f"block, {block.kind.replace('_', ' ')}", block.duration_s, block.length_mm)
        for block in blocks
    ]
    for number, (lines, what, seconds, length) in enumerate(rows, start=1):
        mean = f"{length / seconds * 60.0:.0f}" if length > 0.0 and seconds > 0.0 else ""
        cells = (f"{seconds:.3f}", _share(seconds, time.total_s), f"{length:.1f}" if length > 0.0 else "", mean)
        table.add_row(lines, what, *cells, end_section=number == len(regions))
    return table


def next_step(time: CycleTime) -> str:
    """The one thing to do next, in one sentence."""
    if not time.agrees:
        return (
            f"trust the full interpolation: the closed form differs by {time.difference_percent:+.2f} % "
            f"(limit {AGREEMENT_PERCENT:g} %)."
        )
    if time.total_s <= 0.0:
        return "nothing in the program takes time: is it the right one?"
    cutting, programmed = sum(r.cutting_s for r in time.regions), sum(r.programmed_s for r in time.regions)
    if cutting - programmed > _NOTABLE * time.total_s:
        return (
            f"cutting takes {cutting / programmed:.2f} times what its feeds say: look for feeds above the limits of "
            "the axes, and for blocks of a few interpolation periods, which are rounded up to whole ones."
        )
    losses = {
        "acceleration_s": "join short blocks, or look at the time constants and corner limits of the machine file",
        "rapid_s": "shorten the rapids, or take tools in an order that needs fewer of them",
        "in_position_s": "spare rapids and exact stops, each of which waits for its axes",
        "dwell_s": "look whether the dwells may be shorter",
        "tool_change_s": "take the tools in an order that needs fewer changes",
        "function_s": "put M codes into blocks that move, where the control allows it",
    }
    worst = max(losses, key=lambda part: float(getattr(time, part)))
    if getattr(time, worst) > _NOTABLE * time.total_s:
        return f"{LABELS[worst]} takes {_share(getattr(time, worst), time.total_s)} of the time: {losses[worst]}."
    if time.regions:
        region = slowest_regions(time, 1)[0]
        first, last = region.lines
        share = _share(region.duration_s, time.total_s)
        return f"most of it is cutting: begin with lines {first} to {last} ({tool_name(region.tool)}, {share})."
    return "look at the blocks: --csv FILE."


def blocks_csv(time: CycleTime) -> str:
    """One line per block with a line of headings: the attributes of `BlockTime`, seconds to a microsecond."""
    lines = [",".join(field.name for field in fields(BlockTime))]
    for block in time.blocks:
        cells = ("" if cell is None else f"{cell:.6f}" if isinstance(cell, float) else cell for cell in astuple(block))
        lines.append(",".join(map(str, cells)))
    return "\n".join(lines) + "\n"


def _share(seconds: float, whole: float) -> str:
    return f"{seconds / whole * 100.0:.1f} %" if whole > 0.0 else ""


def _clock(seconds: float) -> str:
    """Hours, minutes and seconds."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}"
