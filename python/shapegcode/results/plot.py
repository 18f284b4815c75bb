"""Common plotting: style, figures and panels, titles, files (PNG or SVG); no window, no global state.

A plot is a function ``plot_x(result, ax=None) -> Axes`` that writes nothing. Colours are those of Okabe and Ito.
"""

from __future__ import annotations

import io
import math
import re
from collections.abc import Callable, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shapegcode.io.data_file import write_bytes

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS = ("#D55E00", "#0072B2", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#F0E442")
GREY = "#8a8a8a"
FORMATS = (".png", ".svg")


def figure(width_inch: float, height_inch: float) -> Figure:
    """An empty white picture of a size in inches."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    new = Figure(figsize=(width_inch, height_inch), layout="constrained", facecolor="white")
    FigureCanvasAgg(new)
    return new


def axes(ax: Axes | None = None, *, size_inch: tuple[float, float] = (8.0, 4.5), title: str = "") -> Axes:
    """One panel in the common style."""
    panel: Axes = figure(*size_inch).subplots() if ax is None else ax
    _style(panel)
    if title:
        panel.set_title(title, loc="left", fontsize=11)
    return panel


def grid(
    ax: Axes | None,
    rows: int,
    columns: int,
    *,
    size_inch: tuple[float, float] = (9.0, 6.0),
    title: str = "",
    part: str = "",
    **subplots: Any,
) -> list[list[Axes]]:
    """Panels of one picture, row by row: in a new figure, or replacing the caller's axes."""
    whole: Any
    if ax is None:
        whole = figure(*size_inch)
    else:
        place = ax.get_subplotspec()
        if place is None:
            raise ValueError("ax is not in a grid of panels: make it with figure.subplots() or plt.subplots()")
        parent: Any = ax.get_figure()
        whole = parent.add_subfigure(place)
        ax.set_axis_off()
        parent.sca(ax)
    whole.suptitle(title + (f"\n{part}" if part else ""), x=0.01, ha="left", fontsize=11)
    found = whole.subplots(rows, columns, squeeze=False, **subplots)
    for panel in found.flat:
        _style(panel)
    return [list(row) for row in found]


def column(ax: Axes | None, rows: int, *, sharex: bool = True, xlabel: str = "", **options: Any) -> list[Axes]:
    """Stacked panels with *xlabel* below the last one; options as in `grid`."""
    panels = [row[0] for row in grid(ax, rows, 1, sharex=sharex, **options)]
    panels[-1].set_xlabel(xlabel)
    return panels


def _style(panel: Axes) -> None:
    panel.grid(True, color="#e4e4e4", linewidth=0.6)
    panel.set_axisbelow(True)
    panel.spines[["top", "right"]].set_visible(False)


def aligned(panels: Sequence[Axes]) -> Axes:
    """Align the y-labels of stacked panels; returns the first panel."""
    whole: Any = panels[0].figure
    whole.align_ylabels(panels)
    return panels[0]


def number(value: float, digits: int = 3) -> str:
    """Format a number for a title: *digits* significant digits, or an integer if that has more; no power of ten."""
    if value == 0 or not math.isfinite(value):
        return f"{value:g}"
    places = max(0, digits - 1 - math.floor(math.log10(abs(value))))
    text = f"{value:.{places}f}"
    return text.rstrip("0").rstrip(".") if places else text


def round_below(value: float) -> float:
    """Round a value down to 1, 2 or 5 times a power of ten."""
    decade = 10.0 ** math.floor(math.log10(value))
    return float(max(step * decade for step in (1, 2, 5) if step * decade <= value * (1 + 1e-9)))


def note(panel: Axes, text: str, x: float, y: float, *, shift: int = 4, **options: Any) -> None:
    """Text next to a point: to its right, or with a negative shift (in points) to its left."""
    side = "left" if shift > 0 else "right"
    panel.annotate(
        text, (x, y), xytext=(shift, 0), textcoords="offset points", ha=side, va="center", fontsize=8, **options
    )


def legend_above(panel: Axes, *, columns: int = 4, **options: Any) -> None:
    """Legend above the panel, where it hides no curve."""
    panel.legend(
        loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=columns, frameon=False, borderaxespad=0.2, fontsize=9,
        **options,
    )  # fmt: skip


def legend_below(panel: Axes, *, of: Axes | None = None, columns: int = 4) -> None:
    """Legend below the panel and its axis label."""
    handles, labels = (of or panel).get_legend_handles_labels()
    panel.legend(
        handles, labels, loc="upper center", bbox_to_anchor=(0.5, 0.0), ncols=columns, frameon=False, fontsize=9,
        borderaxespad=4.5,
    )  # fmt: skip


def save_all(plots: Mapping[str, Callable[..., Axes]], folder: str | Path) -> list[str]:
    """Draw pictures and write each in every format into a folder, which is created if missing."""
    if not plots:
        return []
    place = Path(folder)
    place.mkdir(parents=True, exist_ok=True)
    files = []
    for name, plot in plots.items():
        drawn = plot()
        figure: Any = drawn.figure.figure
        # The layout is computed once for all formats: it takes as long as drawing.
        if (engine := figure.get_layout_engine()) is not None:
            engine.execute(figure)
            figure.set_layout_engine("none")
        for suffix in FORMATS:
            files.append(place / f"{name}{suffix}")
            save(drawn, files[-1])
    return [str(file) for file in files]


def save(drawn: Axes | Figure, file: str | Path) -> None:
    """Write the picture to which the axes belong as PNG or SVG, by the file's ending; same data, same bytes."""
    figure: Any = drawn.figure.figure  # for axes in a subfigure: the whole figure
    path = Path(file)
    suffix = path.suffix.lower()
    if suffix not in FORMATS:
        raise ValueError(f"{path}: the ending of a picture must be one of {', '.join(FORMATS)}")
    stream = io.BytesIO()
    if suffix == ".svg":
        _save_svg(figure, stream)
    else:
        figure.savefig(stream, format="png", dpi=150, metadata={"Software": None})
    write_bytes(path, stream.getvalue())


def _save_svg(figure: Figure, stream: Any, **options: Any) -> None:
    import matplotlib

    with matplotlib.rc_context({"svg.hashsalt": "shapegcode", "svg.fonttype": "none"}):
        figure.savefig(stream, format="svg", metadata={"Date": None}, **options)


_MANY_POINTS = 6000
_ID = re.compile(r'(\bid="|xlink:href="#|\bhref="#|url\(#)')


def svg_text(drawn: Axes | Figure, key: str, *, label: str) -> str:
    """The picture of the axes as an `svg` element of a page, curves of many points as pixels; same data, same text."""
    figure: Any = drawn.figure.figure
    for artist in figure.findobj(_is_heavy):
        artist.set_rasterized(True)
    stream = io.StringIO()
    _save_svg(figure, stream, dpi=150)
    text = stream.getvalue()
    head, _, body = text[text.index("<svg") :].partition(">")
    box = re.search(r'viewBox="[^"]*"', head)
    assert box is not None
    body = re.sub(r"<metadata>.*?</metadata>", "", body, flags=re.DOTALL)
    body = _ID.sub(rf"\g<1>{key}-", body)
    # matplotlib's style applies to every element of a page: restrict it to this one.
    body = body.replace('<style type="text/css">*{', f'<style type="text/css">#{key}-svg *{{')
    width = float(box[0].split()[2])
    return (
        f'<svg id="{key}-svg" {box[0]} role="img" aria-label="{escape(label)}" style="max-width:{width * 1.5:.0f}px"'
        f' xmlns:xlink="http://www.w3.org/1999/xlink">{body.strip()}'
    )


def _is_heavy(artist: Any) -> bool:
    from matplotlib.collections import Collection
    from matplotlib.lines import Line2D

    if isinstance(artist, Line2D):
        return len(artist.get_path()) > _MANY_POINTS
    if isinstance(artist, Collection):
        offsets: Any = artist.get_offsets()
        return sum(map(len, artist.get_paths())) * max(len(offsets), 1) > _MANY_POINTS
    return False
