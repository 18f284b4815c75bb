"""The record of a run as a picture: `python plot_run.py run.csv [run.png]`. Needs NumPy and Matplotlib."""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

AXES = ("x", "y", "z")


def read_run(file: str | Path) -> np.ndarray:
    """Rows of the record by the names of its columns; activity and events are texts."""
    return np.atleast_1d(np.genfromtxt(file, delimiter=",", names=True, dtype=None, encoding="utf-8"))


def columns(run: np.ndarray, pattern: str) -> np.ndarray:
    """One column for each axis: `{}_mm`, `v{}_mm_per_s`, `table_{}_mm`."""
    return np.column_stack([run[pattern.format(axis)] for axis in AXES])


def plot_run(run: np.ndarray) -> Figure:
    """Path with the table's deviation, speed with what the operator and the program did, following error."""
    figure = plt.figure(figsize=(10, 6), layout="constrained")
    (path, speed), (_, error) = figure.subplots(2, 2, width_ratios=(1, 1.3), gridspec_kw={"hspace": 0.1})
    _.remove()
    path.set_subplotspec(figure.axes[0].get_gridspec()[:, 0])
    time, table = run["time_s"], columns(run, "table_{}_mm")
    dots = path.scatter(table[:, 0], table[:, 1], c=np.abs(run["table_off_um"]), s=1, cmap="viridis", rasterized=True)
    path.set(xlabel="X, mm", ylabel="Y, mm", title="table", aspect="equal")
    figure.colorbar(dots, ax=path, location="bottom", label="off the path, µm")

    speed.plot(time, np.linalg.norm(columns(run, "v{}_mm_per_s"), axis=1), lw=0.8)
    held = run["activity"] == "held"
    speed.fill_between(time, 0, 1, where=held, transform=speed.get_xaxis_transform(), color="0.9", label="held")
    for row in run[run["events"] != ""]:
        speed.annotate(
            row["events"], (row["time_s"], 0.98), xycoords=("data", "axes fraction"), rotation=90, fontsize=7, va="top"
        )
    speed.set(ylabel="speed, mm/s")
    speed.legend(loc="upper right")

    lag = 1e3 * (columns(run, "{}_mm") - table)
    for axis, name in enumerate("XYZ"):
        error.plot(time, lag[:, axis], lw=0.8, label=name)
    error.set(xlabel="time, s", ylabel="set-point − table, µm")
    error.legend(loc="upper right")
    return figure


def main() -> int:
    """Exit code 2: no such file, or none that can be read."""
    if len(sys.argv) not in (2, 3):
        print(__doc__, file=sys.stderr)
        return 2
    target = sys.argv[2] if len(sys.argv) == 3 else str(Path(sys.argv[1]).with_suffix(".png"))
    try:
        plot_run(read_run(sys.argv[1])).savefig(target, dpi=120)
    except (OSError, ValueError) as error:
        print(f"{sys.argv[1]}: {error}", file=sys.stderr)
        return 2
    print(target)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
