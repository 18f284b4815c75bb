"""What `convert` says of a program for LinuxCNC, and what LinuxCNC's planner then commands: recorded at 1 kHz."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import recorded_planners as recordings
from numpy.typing import NDArray
from recorded_planners import PERIOD_S, Setting, Setup

import shapegcode as sg
from planner_references import distance_in_time, smoothed
from shapegcode import _core
from shapegcode.model.machine_model import fanuc_model

EXACT_UM = 5.0  # set-points of the model are those of the recording; else one period apart or some blocks


@cache
def outcome(setup: Setup, *, shaped: bool) -> tuple[recordings.Outcome, float]:
    """What was recorded, and the largest distance of the model's set-points at the same time, µm."""
    cut = recordings.recorded(setup, shaped=shaped)
    program, conversion = recordings.converted(setup)
    blocks = conversion.placed[0].blocks(conversion.emitted) if shaped else program.regions[0].path
    off_um = 1e3 * distance_in_time(cut, modelled(blocks, recordings.machine_of(setup)))
    return recordings.outcome_of(setup, cut, shaped=shaped), off_um


def modelled(path: _core.Path, machine: sg.Machine) -> NDArray[np.float64]:
    model = fanuc_model(machine)
    followed, profile = _core.controlled_motion(path, model.limits, model.planner)
    return smoothed(np.asarray(_core.interpolate(followed, profile, PERIOD_S)))


@pytest.mark.parametrize("name", recordings.PATHS)
@pytest.mark.parametrize("acceleration", [5_000.0, 10_000.0])
@pytest.mark.parametrize("setting", ["two lines", "as delivered"])
def test_what_convert_said(name: str, acceleration: float, setting: Setting) -> None:
    for shaped in (False, True):
        found, off_um = outcome(Setup(name, acceleration, setting), shaped=shaped)
        was, said = found.recorded, found.said
        print(f"\n{recordings.row(found)} model off by {off_um:.1f} um", end="")
        assert was.time_s == pytest.approx(said.time_s, rel=0.005, abs=0.005)
        exact = off_um < EXACT_UM
        # A deviation of the set-points that comes and goes excites up to twice itself.
        least_um = 0.3 + 2.0 * off_um if exact else 3.0
        for recorded_um, said_um in zip(was.residual_um, said.residual_um, strict=True):
            assert recorded_um == pytest.approx(said_um, rel=0.1 if exact else 0.5, abs=least_um)
        assert was.both_ways_um == pytest.approx(said.both_ways_um, rel=0.05 if exact else 0.2, abs=0.5)
