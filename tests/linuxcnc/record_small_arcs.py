"""What LinuxCNC's own planner makes of small blended arcs: python tests/linuxcnc/record_small_arcs.py

Writes tests/benchmarks/data/linuxcnc_small_arcs.csv.gz anew; the README there says what it holds.
"""

from __future__ import annotations

import gzip
import io

import analysis
import linuxcnc_run
import numpy as np

DATA = linuxcnc_run.ROOT / "tests" / "benchmarks" / "data"
ACCELERATION = 1750.0
"""mm/s^2, of each joint: the limit of LinuxCNC's issue 3773."""


def main() -> None:
    """Record, write, and print the largest speed and acceleration."""
    recorded = linuxcnc_run.run(
        linuxcnc_run.as_user(),
        DATA / "linuxcnc_small_arcs.ngc",
        ini={"ACCELERATION = 2000": f"ACCELERATION = {ACCELERATION:g}"},
        set={"enable": 0},
    )
    command = recorded.command[:, :2]
    moved = np.flatnonzero(np.any(np.diff(command, axis=0) != 0.0, axis=1))
    command = command[max(moved[0] - 20, 0) : moved[-1] + 22]
    text = io.StringIO()
    text.write("x_mm,y_mm\n")
    np.savetxt(text, command, fmt="%.9f", delimiter=",")
    with (DATA / "linuxcnc_small_arcs.csv.gz").open("wb") as file:
        file.write(gzip.compress(text.getvalue().encode("ascii"), mtime=0))
    speed = np.abs(np.diff(command, axis=0)) / analysis.PERIOD_S
    acceleration = analysis.acceleration(command)
    print(f"{len(command)} set-points; largest speed of a joint {speed.max():.1f} mm/s")
    print(f"largest acceleration of a joint {np.abs(acceleration).max() / ACCELERATION:.4f} of its limit, "
          f"of both together {np.linalg.norm(acceleration, axis=1).max() / ACCELERATION:.3f}")  # fmt: skip
    jerk = np.abs(np.diff(command, 3, axis=0)).max() / analysis.PERIOD_S**3
    print(f"largest jerk of a joint {jerk:.3g} mm/s^3")


if __name__ == "__main__":
    main()
