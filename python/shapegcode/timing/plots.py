"""The picture of ``shapegcode time``: time by tool and by cut."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from shapegcode.results import plot
from shapegcode.results.outcome import Plot
from shapegcode.timing.result import LABELS, PARTS, CycleTime, tool_name

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_COLOURED = ("acceleration_s", "cutting_s", "dwell_s", "in_position_s", "rapid_s", "tool_change_s", "function_s")
_COLOUR = dict(zip(_COLOURED, plot.COLOURS, strict=True))


def plots_of(time: CycleTime) -> dict[str, Plot]:
    """Pictures of a cycle time, by name."""
    return {"time": partial(plot_time, time)}


def plot_time(time: CycleTime, ax: Axes | None = None) -> Axes:
    """Plot the time by parts: one bar per tool, and one for each of the longest cuts.

    Of many tools, only those with the longest times are drawn.

    Args:
        time: the cycle time.
        ax: where to draw; None: a new figure.

    Returns:
        The upper panel.
    """
    longest = sorted(time.tools, key=lambda tool: -tool.duration_s)[:16]
    tools = [tool for tool in time.tools if tool in longest]
    regions = time.slowest_regions(10)
    heights = [max(len(tools), 1), *([len(regions)] if regions else [])]
    panels = plot.column(
        ax, len(heights), sharex=False, height_ratios=heights,
        size_inch=(9.0, 1.8 + 0.32 * sum(heights) + 0.5 * len(heights)),
        title=f"Parts of the time: {time.cycle_time_s:.1f} s on {time.machine}", part=Path(time.program).name,
        xlabel="time in s",
    )  # fmt: skip
    used = [part for part in PARTS if getattr(time, part) > 0.0]
    _bars(panels[0], [tool_name(tool.tool) for tool in tools], [vars(tool) for tool in tools], used)
    plot.legend_below(panels[-1], of=panels[0])
    left_out = len(time.tools) - len(tools)
    panels[0].set_title("by tool" + (f", without {left_out} short ones" if left_out else ""), loc="left", fontsize=10)
    if regions:
        names = ["lines {} to {}, {}".format(*region.lines, tool_name(region.tool)) for region in regions]
        _bars(panels[1], names, [vars(region) for region in regions], used)
        panels[1].set_title(f"the {len(regions)} longest cuts", loc="left", fontsize=10)
    return panels[0]


def _bars(panel: Axes, names: Sequence[str], rows: Sequence[Mapping[str, float]], parts: Sequence[str]) -> None:
    """Draw one horizontal bar per row, the first at the top, divided into parts and labelled with its duration."""
    positions = range(len(names))
    ends = [0.0] * len(names)
    for part in parts:
        widths = [float(row.get(part, 0.0)) for row in rows]
        panel.barh(positions, widths, left=ends, color=_COLOUR[part], label=LABELS[part], height=0.7)
        ends = [end + width for end, width in zip(ends, widths, strict=True)]
    for position, end in zip(positions, ends, strict=True):
        plot.note(panel, f"{end:.1f}", end, position)
    panel.set_yticks(list(positions), names, fontsize=8)
    panel.invert_yaxis()
    panel.grid(False, axis="y")
    panel.margins(x=0.08)
