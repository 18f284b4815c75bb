"""The machine and the program of the recordings."""

from __future__ import annotations

from pathlib import Path

import analysis
import numpy as np
from linuxcnc_run import ROOT

MODES = ((46.0, 0.02), (80.0, 0.02))
"""Frequency in Hz and damping ratio of X and Y, as in the example's INI file."""
DEPTH_MM = -5.123
"""Where the contour is cut."""
FEED_OVERRIDE = 6.0
"""The program has F500: at 3000 mm/min it shakes a machine."""


def contour_program(place: Path) -> Path:
    """tests/golden/programs/CONTOUR_R.NC; of its line `G0 G91 G28 Z0` LinuxCNC takes only one code with axis words."""
    text = (ROOT / "tests/golden/programs/CONTOUR_R.NC").read_text()
    file = place / "contour.ngc"
    file.write_text(text.replace("G0 G91 G28 Z0", "G91 G28 Z0"))
    return file


def both_modes() -> analysis.Array:
    """Taps of ZV for both modes in series."""
    return np.convolve(*(analysis.zv_taps(*mode) for mode in MODES))


def table(command: analysis.Array) -> analysis.Array:
    """Where the table is: X and Y swing in their mode, Z does not."""
    moved = command.copy()
    for axis, mode in enumerate(MODES):
        moved[:, axis] += analysis.vibration(command[:, axis], *mode)
    return moved
