"""What LinuxCNC's own planner makes of some programs: python tests/linuxcnc/planner_recordings.py

Writes tests/golden/linuxcnc anew: a program, the set-points of its cut at 1 kHz in mm, and the settings of all.
"""

from __future__ import annotations

import gzip
import io
import json
from pathlib import Path
from tempfile import TemporaryDirectory

import linuxcnc_run
import numpy as np
from numpy.typing import NDArray

import shapegcode as sg
from shapegcode.conversion.translate import translate
from shapegcode.machine.programs import ANY_PRICE

GOLDEN = linuxcnc_run.ROOT / "tests" / "golden" / "linuxcnc"
STOP = "G04P500\n"
# The first move is slow where many short ones follow: the queue is full when they come.
PATHS = {
    "paper": "G01X20.F12000.\nG03X40.Y20.R20.\nG01Y40.\n",
    "corners": "G01X-2.F120.\nG01X10.Y0.F6000.\nX20.Y.5\nX30.Y2.\nX40.Y5.\nX45.Y10.\nX45.Y20.\nX40.Y25.\n"
    "X30.Y20.F4000.\nX20.Y20.F8000.\n",
    "short": "G01X-2.F120.\nX0.F6000.\n"
    + "".join(f"X{0.7 * k:.3f}Y{3 * np.sin(0.07 * k):.3f}Z{0.5 * np.cos(0.05 * k) - 0.5:.3f}\n" for k in range(1, 120)),
    "arcs": "G01X-2.F120.\nG01X10.Y5.F6000.\nG02X14.Y9.R5.\nG01X20.Y10.\nG03X30.Y8.R12.\nG02X40.Y8.R7.\nG01X50.Y30.\n",
}
RUNS = [
    ("paper", False, 5_000, True), ("paper", True, 5_000, False), ("paper", True, 10_000, True),
    ("paper", True, 10_000, False), ("corners", False, 5_000, True), ("corners", False, 10_000, True),
    ("short", False, 5_000, True), ("short", False, 10_000, True), ("short", False, 10_000, False),
    ("short", True, 10_000, False), ("arcs", False, 10_000, True), ("arcs", False, 5_000, False),
]  # fmt: skip
"""Path, shaped or not, mm/s², INI file as it is delivered or with the two lines."""


def program_of(path: str, *, shaped: bool) -> bytes:
    """A path in LinuxCNC's words."""
    machine = sg.Machine.load("vx500").with_values({**ANY_PRICE, "emission.dialect": "linuxcnc"})
    program = sg.Program.from_text(f"G21G90\nG00X0.Y0.Z0.\n{STOP}{path}{STOP}M30\n", machine)
    return sg.convert(program, machine, shape_all=True).text if shaped else translate(program, machine).text


def ini_of(acceleration: float, *, as_delivered: bool, max_feed_override: float = 1.0) -> dict[str, str]:
    """Words of the example's INI file to replace."""
    traj = "[TRAJ]" if as_delivered else "[TRAJ]\nARC_BLEND_RAMP_FREQ = 10000\nARC_BLEND_KINK_RATIO = 0.7"
    return {
        "MAX_VELOCITY = 200": "MAX_VELOCITY = 500", "MAX_LINEAR_VELOCITY = 200": "MAX_LINEAR_VELOCITY = 500",
        "ACCELERATION = 2000": f"ACCELERATION = {acceleration:g}", "FERROR = 0.5": "FERROR = 50",
        "MIN_FERROR = 0.05": "MIN_FERROR = 50", "MAX_FEED_OVERRIDE = 10": f"MAX_FEED_OVERRIDE = {max_feed_override:g}",
        "[TRAJ]": traj,
    }  # fmt: skip


def cut_of(command: NDArray[np.float64]) -> NDArray[np.float64]:
    """From the last pause before the end on: the first position, every set-point, the last position."""
    moved = np.flatnonzero(np.any(np.diff(command, axis=0) != 0.0, axis=1))
    assert len(moved), "LinuxCNC commanded no motion: it may not have kept up on a loaded machine"
    pauses = np.flatnonzero(np.diff(moved) > 300)
    first = moved[pauses[-1] + 1] if len(pauses) else moved[0]
    return command[first : moved[-1] + 2]


def record(user: list[str], program: bytes, ini: dict[str, str], **job: float) -> NDArray[np.float64]:
    """The cut as the joints were commanded, without the component."""
    with TemporaryDirectory(prefix="planner-") as folder:
        file = Path(folder) / "program.ngc"
        file.write_bytes(program)
        return cut_of(linuxcnc_run.run(user, file, ini=ini, set={"enable": 0}, **job).command)


def main() -> None:
    """Record all of them."""
    user = linuxcnc_run.as_user()
    GOLDEN.mkdir(exist_ok=True)
    rows = []
    for path, shaped, acceleration, as_delivered in RUNS:
        program = program_of(PATHS[path], shaped=shaped)
        name = f"{path}-{'shaped' if shaped else 'original'}"
        (GOLDEN / f"{name}.ngc").write_bytes(program)
        cut = record(user, program, ini_of(acceleration, as_delivered=as_delivered))
        run = f"{name}-{acceleration}-{'delivered' if as_delivered else 'two-lines'}"
        text = io.StringIO()
        np.savetxt(text, cut, fmt="%.7f", delimiter=",")
        (GOLDEN / f"{run}.csv.gz").write_bytes(gzip.compress(text.getvalue().encode(), mtime=0))
        rows.append({"run": run, "program": name, "acceleration": acceleration, "as_delivered": as_delivered})
        print(run, len(cut))
    (GOLDEN / "runs.json").write_text(json.dumps(rows, indent=1) + "\n")


if __name__ == "__main__":
    main()
