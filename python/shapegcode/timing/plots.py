"""The picture of ``shapegcode time``: where the time goes, by tool and by region."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from shapegcode.results import plot as canvas
from shapegcode.timing.cycle_time import PARTS, CycleTime
from shapegcode.timing.tables import LABELS, slowest_regions, tool_name

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["plot_time", "write_time_pictures"]

_COLOUR = dict(
    zip(
        ("acceleration_s", "cutting_s", "dwell_s", "in_position_s", "rapid_s", "tool_change_s", "function_s"),
        canvas.COLOURS,
        strict=True,
    )
)
_REGIONS = 10
_TOOLS = 16


def write_time_pictures(time: CycleTime, folder: str | Path) -> list[str]:
    """Write ``time.png`` and ``time.svg`` into a folder, which is made where it is missing.

    Returns:
        The files written; none for a program that takes no time.

    Raises:
        OSError: the folder cannot be made or a file not be written.
    """
    if time.total_s <= 0.0:
        return []
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    files = [folder / f"time{suffix}" for suffix in canvas.FORMATS]
    for file in files:
        plot_time(file, time)
    return [str(file) for file in files]


def plot_time(file: str | Path, time: CycleTime) -> None:
    """Where does the time go? One bar per tool, and one for each of the regions that take longest, both by parts.

    Of many tools the ones that take longest are drawn.

    Args:
        file: ``.png`` or ``.svg``.
        time: what was timed.

    Raises:
        ValueError: a wrong ending.
        OSError: the file cannot be written.
    """
    longest = sorted(time.tools, key=lambda tool: -tool.total_s)[:_TOOLS]
    tools = [tool for tool in time.tools if tool in longest]
    regions = slowest_regions(time, _REGIONS)
    heights = [max(len(tools), 1), *([len(regions)] if regions else [])]
    figure = canvas.figure(9.0, 1.8 + 0.32 * sum(heights) + 0.5 * len(heights))
    grid = figure.subplots(len(heights), 1, squeeze=False, height_ratios=heights)[:, 0]
    used = [part for part in PARTS if getattr(time, part) > 0.0]
    _bars(grid[0], [tool_name(tool.tool) for tool in tools], [vars(tool) for tool in tools], used)
    handles, labels = grid[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False, fontsize=9)
    left_out = len(time.tools) - len(tools)
    grid[0].set_title("by tool" + (f", without {left_out} short ones" if left_out else ""), loc="left", fontsize=10)
    if regions:
        names = ["lines {} to {}, {}".format(*region.lines, tool_name(region.tool)) for region in regions]
        _bars(grid[1], names, [vars(region) for region in regions], used)
        grid[1].set_title(f"the {len(regions)} regions that take longest", loc="left", fontsize=10)
    grid[-1].set_xlabel("time in s")
    canvas.heading(figure, f"Where the time goes: {time.total_s:.1f} s on {time.machine}", Path(time.program).name)
    canvas.save(figure, file)


def _bars(panel: Axes, names: Sequence[str], rows: Sequence[Mapping[str, float]], parts: Sequence[str]) -> None:
    """One lying bar per row, longest part first in the order of the parts; its length stands behind it."""
    places = range(len(names))
    ends = [0.0] * len(names)
    for part in parts:
        widths = [float(row.get(part, 0.0)) for row in rows]
        panel.barh(places, widths, left=ends, color=_COLOUR[part], label=LABELS[part], height=0.7)
        ends = [end + width for end, width in zip(ends, widths, strict=True)]
    for place, end in zip(places, ends, strict=True):
        panel.annotate(f"{end:.1f}", (end, place), xytext=(4, 0), textcoords="offset points", va="center", fontsize=8)
    panel.set_yticks(list(places), names, fontsize=8)
    panel.invert_yaxis()
    panel.grid(True, axis="x", color="#e4e4e4", linewidth=0.6)
    panel.set_axisbelow(True)
    panel.margins(x=0.08)
    panel.spines[["top", "right"]].set_visible(False)
