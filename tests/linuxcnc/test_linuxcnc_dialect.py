"""Shaped programs in LinuxCNC's words through LinuxCNC's own planner, recorded at 1 kHz, with two modes behind it.

Unlike those of test_linuxcnc_verdict.py they are made for a machine that is not said to have LinuxCNC's planner.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import planner_recordings
import pytest
import recorded_planners
from recorded_planners import Figures

import shapegcode as sg
from shapegcode.conversion.translate import translate
from shapegcode.machine.programs import ANY_PRICE


@cache
def figures(
    name: str, acceleration: int, *, shaped: bool, as_delivered: bool, override: float = 1.0, lock: str = "ask"
) -> Figures:
    program, conversion = converted(name, lock)
    text = conversion.text if shaped else translate(program, conversion.simulated.machine).text
    ini = planner_recordings.ini_of(acceleration, as_delivered=as_delivered, max_feed_override=10.0)
    cut = planner_recordings.record(recorded_planners.user(), text, ini, override=override)
    return recorded_planners.figures(cut, program)


@cache
def converted(name: str, lock: str = "ask") -> tuple[sg.Program, sg.Conversion]:
    keys = {**ANY_PRICE, "emission.dialect": "linuxcnc", "emission.override": lock}
    return recorded_planners.shaped_on(name, sg.Machine.load("vx500").with_values(keys))


@pytest.mark.parametrize("name", ["paper", "contour"])
@pytest.mark.parametrize("acceleration", [5_000, 10_000])
@pytest.mark.parametrize("as_delivered", [False, True], ids=["two-lines", "as-delivered"])
def test_the_shaped_program_in_linuxcnc(name: str, acceleration: int, as_delivered: bool) -> None:
    before = figures(name, acceleration, shaped=False, as_delivered=True)
    after = figures(name, acceleration, shaped=True, as_delivered=as_delivered)
    conversion = converted(name)[1]
    assert np.all(np.less(after.residual_um, before.residual_um))
    assert after.residual_um[0] < 0.5 * before.residual_um[0]  # the softer mode
    assert after.contour_um < 0.75 * before.contour_um
    assert after.contour_um < 1.1 * conversion.contour_error_um.response.emitted.max + (10.0 if as_delivered else 2.0)
    expected_s = conversion.cutting_time_s.emitted
    assert after.time_s == pytest.approx(expected_s, rel=0.08 if as_delivered else 0.01, abs=0.015)
    if name == "paper" and acceleration == 10_000 and not as_delivered:
        assert max(after.residual_um) < 1.5


def test_the_feed_override_can_be_locked() -> None:
    full = figures("paper", 10_000, shaped=True, as_delivered=False)
    turned = figures("paper", 10_000, shaped=True, as_delivered=False, override=0.7)
    locked = figures("paper", 10_000, shaped=True, as_delivered=False, override=0.7, lock="lock")
    assert turned.residual_um[1] > 10.0 and turned.time_s > 1.3 * full.time_s
    assert np.abs(np.subtract(locked.residual_um, full.residual_um)).max() < 0.05
    assert locked.time_s == pytest.approx(full.time_s, abs=0.0015)
