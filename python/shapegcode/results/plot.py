"""The paper of the pictures: figures, panels, titles, files.

Matplotlib is imported when the first figure is made and draws to files only (PNG or SVG, by the file's ending); no
window system and no global state are touched. Colours are those of Okabe and Ito, which colour-blind readers can tell
apart.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["COLOURS", "FORMATS", "GREY", "figure", "heading", "legend_above", "panels", "save", "write_pictures"]

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


def panels(figure: Figure, rows: int, columns: int) -> list[list[Axes]]:
    """Columns of panels that share their time axis."""
    grid: Any = figure.subplots(rows, columns, sharex="col", squeeze=False)
    for panel in grid.flat:
        panel.grid(True, color="#e4e4e4", linewidth=0.6)
        panel.set_axisbelow(True)
        panel.margins(x=0.01)
        panel.spines[["top", "right"]].set_visible(False)
    return [list(grid[:, column]) for column in range(columns)]


def heading(figure: Figure, text: str, part: str) -> None:
    """Title of the whole picture, and which part of the program it shows."""
    figure.suptitle(text + (f"\n{part}" if part else ""), x=0.01, ha="left", fontsize=11)


def legend_above(panel: Axes) -> None:
    """Legend between the panel and what is above it, where it hides no curve."""
    panel.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=4, frameon=False, borderaxespad=0.2, fontsize=9)


def write_pictures(folder: str | Path, prefix: str, pictures: Mapping[str, Callable[[Path], None]]) -> list[str]:
    """Write pictures in every format into a folder, which is made where it is missing.

    Args:
        folder: into which.
        prefix: of the files' names, before a minus.
        pictures: what draws one into a file, by the rest of its name.

    Returns:
        The files written.

    Raises:
        OSError: the folder cannot be made or a file not be written.
    """
    place = Path(folder)
    place.mkdir(parents=True, exist_ok=True)
    files = []
    for name, plot in pictures.items():
        for suffix in FORMATS:
            files.append(place / f"{prefix}-{name}{suffix}")
            plot(files[-1])
    return [str(file) for file in files]


def save(figure: Figure, file: str | Path) -> None:
    """Write the picture as PNG or SVG, by the file's ending; the same data gives the same bytes.

    Raises:
        ValueError: a wrong ending.
        OSError: the file cannot be written.
    """
    import matplotlib

    path = Path(file)
    suffix = path.suffix.lower()
    if suffix not in FORMATS:
        raise ValueError(f"{path}: the ending of a picture must be one of {', '.join(FORMATS)}")
    if suffix == ".svg":
        with matplotlib.rc_context({"svg.hashsalt": "shapegcode", "svg.fonttype": "none"}):
            figure.savefig(path, format="svg", metadata={"Date": None})
    else:
        figure.savefig(path, format="png", dpi=150, metadata={"Software": None})
