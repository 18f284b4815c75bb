"""Shaped programs in LinuxCNC's words through LinuxCNC's own planner, recorded at 1 kHz, with two modes behind it."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import linuxcnc_run
import numpy as np
import pytest
from numpy.typing import NDArray

import shapegcode as sg
from judge import Mode, residual_um, response
from shapegcode.conversion.translate import translate
from shapegcode.machine.programs import ANY_PRICE

PATHS = {
    # paper 000: line, arc, line at 200 mm/s
    "paper": "G00X0.Y0.Z0.\nG04P500\nG01X20.F12000.\nG03X40.Y20.R20.\nG01Y40.\nG04P500\n",
    # the contour of CONTOUR_R.NC at F6000
    "contour": "G00X0.Y65.123Z0.\nG04P500\nG01Y55.123F6000.\nX-39.556\nG3X-55.123Y39.556R15.567\nG1Y-39.556\n"
    "G3X-39.556Y-55.123R15.567\nG1X39.556\nG3X55.123Y-39.556R15.567\nG1Y39.556\nG3X39.556Y55.123R15.567\nG1X0.\n"
    "Y65.123\nG04P500\n",
}
MODES = [[Mode(46.0, 0.02)], [Mode(131.0, 0.02)], []]
TRAJ = "[TRAJ]\nARC_BLEND_RAMP_FREQ = 10000\nARC_BLEND_KINK_RATIO = 0.7"


user = cache(linuxcnc_run.as_user)


@cache
def figures(
    name: str, acceleration: int, *, shaped: bool, as_delivered: bool, override: float = 1.0, lock: str = "ask"
) -> tuple[NDArray[np.float64], float, float]:
    """Residual vibration in X and Y, µm; time of the cut, s; largest distance of the table from the path, µm."""
    program, conversion = converted(name, lock)
    text = conversion.text if shaped else translate(program, conversion.simulated.machine).text
    ini = {
        "MAX_VELOCITY = 200": "MAX_VELOCITY = 500", "MAX_LINEAR_VELOCITY = 200": "MAX_LINEAR_VELOCITY = 500",
        "ACCELERATION = 2000": f"ACCELERATION = {acceleration}",
        "FERROR = 0.5": "FERROR = 50", "MIN_FERROR = 0.05": "MIN_FERROR = 50",
    }  # fmt: skip
    ini |= {} if as_delivered else {"[TRAJ]": TRAJ}
    with TemporaryDirectory(prefix="dialect-") as folder:
        file = Path(folder) / "program.ngc"
        file.write_bytes(text)
        command = linuxcnc_run.run(user(), file, ini=ini, override=override, set={"enable": 0}).command
    moved = np.flatnonzero(np.any(np.diff(command, axis=0) != 0.0, axis=1))
    pauses = np.flatnonzero(np.diff(moved) > 300)
    first = moved[pauses[-1] + 1] if len(pauses) else moved[0]
    cut = command[first - 2 : moved[-1] + 3]
    table = response(cut, MODES, 0.001, rest_s=0.2)[2][::5, :2]
    path = program.regions[0].path.polyline(0.002)[:, :2]
    step = np.diff(path, axis=0)
    length = (step**2).sum(axis=1)
    farthest = 0.0
    for point in table:
        share = np.clip(((point - path[:-1]) * step).sum(axis=1) / length, 0.0, 1.0)
        nearest = path[:-1] + share[:, None] * step - point
        farthest = max(farthest, float((nearest**2).sum(axis=1).min()))
    residual = residual_um(cut, MODES, 0.001, still_mm=1e-7)[:2]
    return residual, (len(cut) - 4) * 0.001, farthest**0.5 * 1e3


@cache
def converted(name: str, lock: str = "ask") -> tuple[sg.Program, sg.Conversion]:
    keys = {**ANY_PRICE, "emission.dialect": "linuxcnc", "emission.override": lock}
    machine = sg.Machine.load("vx500").with_values(keys)
    program = sg.Program.from_text(f"G21G90\n{PATHS[name]}M30\n", machine)
    return program, sg.convert(program, machine, shape_all=True)


@pytest.mark.parametrize("name", PATHS)
@pytest.mark.parametrize("acceleration", [5_000, 10_000])
@pytest.mark.parametrize("as_delivered", [False, True], ids=["two-lines", "as-delivered"])
def test_the_shaped_program_in_linuxcnc(name: str, acceleration: int, as_delivered: bool) -> None:
    before, _, unshaped_um = figures(name, acceleration, shaped=False, as_delivered=True)
    after, time_s, after_um = figures(name, acceleration, shaped=True, as_delivered=as_delivered)
    conversion = converted(name)[1]
    assert np.all(after < before)
    assert after[0] < 0.5 * before[0]  # the softer mode
    assert after_um < 0.75 * unshaped_um
    assert after_um < 1.1 * conversion.contour_error_um.response.emitted.max + (10.0 if as_delivered else 2.0)
    expected_s = conversion.cutting_time_s.emitted
    assert time_s == pytest.approx(expected_s, rel=0.08 if as_delivered else 0.01, abs=0.015)
    if name == "paper" and acceleration == 10_000 and not as_delivered:
        assert np.all(after < 1.5)


def test_the_feed_override_can_be_locked() -> None:
    at_full, time_s, _ = figures("paper", 10_000, shaped=True, as_delivered=False)
    open_, open_s, _ = figures("paper", 10_000, shaped=True, as_delivered=False, override=0.7)
    locked, locked_s, _ = figures("paper", 10_000, shaped=True, as_delivered=False, override=0.7, lock="lock")
    assert open_[1] > 10.0 and open_s > 1.3 * time_s
    assert np.all(np.abs(locked - at_full) < 0.05) and locked_s == pytest.approx(time_s, abs=0.0015)
