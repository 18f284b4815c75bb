"""The stage with two beams on which Park, Hong and Danielson, 2009 (paper 002, section 4) test their shapers."""

from __future__ import annotations

import cmath
import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shapegcode._core import Fir, Mode, Shaper
from shapegcode.demos.result import Statement, stated
from shapegcode.shaping.modal_run import ModalRun, respond

__all__ = [
    "MODES",
    "PERIOD_S",
    "StageVibration",
    "phase_jump_degrees",
    "run_stage",
    "statements",
    "vibration",
]

FloatArray = NDArray[np.float64]

MODES = (Mode(1.0, 0.0), Mode(4.0, 0.0))
"""The paper's modes (section 3.2): no damping is stated, and its figures are those without."""
PERIOD_S = 5e-4
"""Of the samples: all taps of the four shapers lie on it."""

# The stage of section 4. The paper states the way and that the stage stops after 3 s.
WAY_MM = 200.0
MOVE_S = 3.0
# Assumed, because not stated: ramps of constant acceleration, damping of the beams, error of the set frequencies.
RAMP_S = 0.1
DAMPING_RATIO = 0.005
FREQUENCY_ERROR = 0.02


@dataclass(frozen=True)
class StageVibration:
    """Vibration of the beams on the stage, mm, one value for each mode.

    Attributes:
        before_stop_mm: before the stage slows down: what the start left.
        after_stop_mm: behind the stop.
    """

    before_stop_mm: tuple[float, ...]
    after_stop_mm: tuple[float, ...]


def _beams() -> list[Mode]:
    return [Mode(mode.frequency_hz * (1.0 + FREQUENCY_ERROR), DAMPING_RATIO) for mode in MODES]


def _command() -> FloatArray:
    """Way of the stage, mm, every `PERIOD_S`: ramps of constant acceleration, and a second of rest behind."""
    t = np.arange(round(MOVE_S / PERIOD_S) + 1) * PERIOD_S
    speed = WAY_MM / (MOVE_S - RAMP_S)
    starting, ending = 0.5 * speed * t**2 / RAMP_S, WAY_MM - 0.5 * speed * (MOVE_S - t) ** 2 / RAMP_S
    way = np.where(t < RAMP_S, starting, np.where(t < MOVE_S - RAMP_S, speed * (t - 0.5 * RAMP_S), ending))
    return np.concatenate([way, np.full(round(2.0 / PERIOD_S), WAY_MM)])


def run_stage(shapers: dict[str, Shaper]) -> dict[str, ModalRun]:
    """The beams on the stage: frequencies a little off what was designed for, a little damping."""
    beams = _beams()
    command = _command()
    runs = {"unshaped": respond(beams, command, PERIOD_S)}
    for name, shaper in shapers.items():
        delays = [round(t / PERIOD_S) for t in shaper.times_s]
        shaped = Fir(delays, list(shaper.amplitudes)).apply(command)
        runs[name] = respond(beams, shaped, PERIOD_S)
    return runs


def vibration(run: ModalRun) -> StageVibration:
    """How the beams vibrate on the way and behind the stop."""
    steady = (run.times_s > MOVE_S - RAMP_S - 1.0) & (run.times_s < MOVE_S - RAMP_S)
    while_moving = np.abs(run.responses[steady] - run.command[steady, None]).max(axis=0)
    return StageVibration(tuple(while_moving.tolist()), tuple(run.residuals.tolist()))


def phase_jump_degrees(run: ModalRun, beam: int) -> float:
    """By how much the phase of a beam's vibration changes between start and stop, 0 to 180 degrees."""
    mode = _beams()[beam]
    waves = np.exp(mode.pole * run.times_s)
    deflection = run.responses[:, beam] - run.command
    phasors = []
    for begin_s, end_s in ((RAMP_S, MOVE_S - RAMP_S), (MOVE_S, run.times_s[-1])):
        part = (run.times_s >= begin_s) & (run.times_s <= end_s)
        columns = np.column_stack([waves[part].real, -waves[part].imag])
        real, imaginary = np.linalg.lstsq(columns, deflection[part], rcond=None)[0]
        phasors.append(complex(real, imaginary))
    return abs(math.degrees(cmath.phase(phasors[1] / phasors[0])))


def statements(shaken: Mapping[str, StageVibration], jump_degrees: float) -> list[Statement]:
    """What the paper says of the stage, beside ours.

    Args:
        shaken: by the shaper's name, "unshaped" among them.
        jump_degrees: of the faster beam, unshaped.

    Returns:
        A row for each.
    """
    slow, fast = shaken["unshaped"].after_stop_mm

    def left(name: str, beam: int) -> float:
        return 100.0 * shaken[name].after_stop_mm[beam] / shaken["unshaped"].after_stop_mm[beam]

    before = shaken["unshaped"].before_stop_mm[1]
    rows = [
        stated(
            "figures 8, 9", "unshaped, 4 Hz beam: start and stop superposed", "reverses after 3 s",
            f"{before:.2f} mm before, {fast:.2f} mm after, phase jumps by {jump_degrees:.0f}°", None,
        ),
        stated(
            "figures 8, 9", "unshaped, behind the stop, 1 Hz / 4 Hz", "(curve)", f"{slow:.2f} / {fast:.2f} mm", None
        ),
    ]  # fmt: skip
    rows += [
        stated(
            figure, f"{name}: left of 1 Hz / 4 Hz", "removed, a little of 4 Hz left",
            f"{left(name, 0):.1f} / {left(name, 1):.1f} %", left(name, 0) < left(name, 1) < 25.0,
        )
        for figure, name in (("figure 8", "short"), ("figure 9", "long"))
    ]  # fmt: skip
    rows.append(
        stated(
            "figures 8, 9", "more of 4 Hz left behind the short than behind the long one", "yes",
            "yes" if left("short", 1) > left("long", 1) else "no", left("short", 1) > left("long", 1),
        )
    )  # fmt: skip
    return rows
