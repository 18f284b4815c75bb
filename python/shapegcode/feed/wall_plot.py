"""Maps of the wall's form error, below each other in one scale."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from shapegcode.results import plot

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.colors import Colormap

__all__ = ["draw_walls"]

_NO_WALL = "#c9c9c9"

Vector = npt.NDArray[np.float64]


def draw_walls(
    ax: Axes | None, edges_mm: Vector, height_mm: Vector, maps: Mapping[str, Vector], colours: Sequence[str], *,
    along: str, title: str, part: str,
) -> Axes:  # fmt: skip
    """Maps of the wall's error below each other in one scale, and in the last panel the largest of each column."""
    everything = np.concatenate([each[np.isfinite(each)] for each in maps.values()])
    low, high = min(float(everything.min()), 0.0), max(float(everything.max()), 0.0)
    high = high if high > low else low + 1e-3
    both = _both_sides(low, high)
    rows = plot.grid(
        ax, len(maps) + 1, 1, size_inch=(11.0, 1.3 + 1.9 * (len(maps) + 1)), sharex=True, title=title, part=part,
    )  # fmt: skip
    panels = [row[0] for row in rows]
    step = height_mm[1] - height_mm[0]
    levels = np.concatenate([height_mm - 0.5 * step, height_mm[-1:] + 0.5 * step])
    for panel, (name, values) in zip(panels, maps.items(), strict=False):
        panel.grid(False)
        panel.spines[["top", "right"]].set_visible(True)
        panel.set_facecolor(_NO_WALL)
        mesh = panel.pcolormesh(
            edges_mm, levels, np.ma.masked_invalid(values.T), cmap=both, vmin=low, vmax=high, rasterized=True,
        )  # fmt: skip
        panel.set_ylim(levels[0], levels[-1])
        panel.set_ylabel("height above\nthe tip in mm")
        worst = float(np.nanmax(np.abs(values))) if np.isfinite(values).any() else 0.0
        panel.set_title(f"{name}: up to {plot.number(worst)} µm", loc="left", fontsize=10)
    whole: Any = panels[0].figure
    whole.colorbar(
        mesh, ax=panels[:-1], pad=0.01, label="error of the wall in µm\nred: left standing, blue: cut too far"
    )
    last = panels[-1]
    for (name, values), colour in zip(maps.items(), colours, strict=True):
        made = np.isfinite(values).any(axis=1)
        largest = np.full(len(values), np.nan)
        largest[made] = np.nanmax(np.abs(values[made]), axis=1)
        last.stairs(largest, edges_mm, baseline=None, color=colour, linewidth=1.1, label=name)
    last.set_ylim(bottom=0.0)
    last.margins(x=0.0)
    last.set_ylabel("largest over\nthe height in µm")
    last.set_xlabel(along)
    plot.legend_above(last)
    return plot.aligned(panels)


def _both_sides(low: float, high: float) -> Colormap:
    """Colours from `low` to `high`, white at 0 and as strong on one side as on the other; `low` <= 0 <= `high`."""
    from matplotlib import colormaps
    from matplotlib.colors import LinearSegmentedColormap

    reach = 2.0 * max(-low, high)
    places = np.linspace(0.5 + low / reach, 0.5 + high / reach, 257)
    return LinearSegmentedColormap.from_list("both sides", colormaps["RdBu_r"](places))
