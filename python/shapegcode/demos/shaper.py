"""Paper 002 repeated: minimal two-mode shapers for 1 Hz and 4 Hz, their sensitivity, and its test on a stage.

The paper prints durations and signs in its text; its curves are pictures without numbers. So what can be compared is
what the text states, beside what the models here give; nothing is tuned.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shapegcode._core import Fir, MinimalBranches, Mode, Shaper, convolved_zv, minimal_branches, minimal_two_mode
from shapegcode.shaping.bands import ModeBand
from shapegcode.shaping.design import evaluate
from shapegcode.shaping.modal_run import ModalRun, respond, shaped_step
from shapegcode.shaping.ranking import NO_RESIDUAL

__all__ = ["MODES", "ShaperDemo", "shaper_demo"]

FloatArray = NDArray[np.float64]

MODES = (Mode(1.0, 0.0), Mode(4.0, 0.0))
"""The paper's modes (section 3.2): no damping is stated, and its figures are those without."""
_PAPER_DURATIONS_S = {"short": 0.4, "medium": 0.6, "long": 0.8, "convolved ZV": 0.625}
_PAPER_NEGATIVE = {"short": [False, True, False], "medium": [False] * 3, "long": [False] * 3}
_PAPER_UNIFORM = {"short": True, "medium": False, "long": True}
_LONGEST_S = 0.81
_BAND = 0.05  # for the comparison of sensitivities; the paper shows curves only
_STEP_PERIOD_S = 5e-4  # all taps of the four shapers lie on it

# The stage of section 4. The paper states the way and that the stage stops after 3 s.
_WAY_MM = 200.0
_MOVE_S = 3.0
# Assumed, because not stated: ramps of constant acceleration, damping of the beams, error of the set frequencies.
_RAMP_S = 0.1
_DAMPING_RATIO = 0.005
_FREQUENCY_ERROR = 0.02

_BRANCH_RATIOS = np.linspace(1.05, 8.01, 349)
_BRANCH_LONGEST_S = 1.0


@dataclass(frozen=True)
class ShaperDemo:
    """Everything of the demonstration.

    Attributes:
        shapers: short, medium, long and convolved ZV.
        branches: minimal shapers over the second frequency, the first one at 1 Hz.
        runs: of the stage, by the shaper's name, "unshaped" among them.
        report: figures as plain values: `rows` (figure, what, paper, here, agrees), `shapers`, `stage`, `remark`.
    """

    shapers: dict[str, Shaper]
    branches: MinimalBranches
    runs: dict[str, ModalRun]
    report: dict[str, Any]


def shaper_demo() -> ShaperDemo:
    """The paper's shapers, branches, step responses, sensitivities and stage test."""
    found = minimal_two_mode(*MODES, _LONGEST_S)
    shapers = {name: _named(found, name) for name in _PAPER_NEGATIVE} | {"convolved ZV": convolved_zv(list(MODES))}
    branches = minimal_branches(MODES[0], 0.0, _BRANCH_RATIOS.tolist(), _BRANCH_LONGEST_S)
    runs = _stage_runs(shapers)
    stage = {name: _stage_figures(run) for name, run in runs.items()}
    bands = [ModeBand(mode, _BAND) for mode in MODES]
    worst = {name: 100.0 * evaluate(name, shaper, bands).worst_residual for name, shaper in shapers.items()}
    rows = [
        *_branch_rows(branches),
        *_shaper_rows(shapers),
        *_sensitivity_rows(shapers, worst),
        *_response_rows(shapers),
        *_stage_rows(stage, _phase_jump_degrees(runs["unshaped"], 1)),
    ]
    report = {
        "modes_hz": [mode.frequency_hz for mode in MODES],
        "rows": rows,
        "agrees": all(row["agrees"] is not False for row in rows),
        "shapers": {
            name: {
                "times_s": shaper.times_s.tolist(),
                "amplitudes": shaper.amplitudes.tolist(),
                "duration_s": shaper.duration_s,
                "worst_residual_percent": worst[name],
            }
            for name, shaper in shapers.items()
        },
        "all_minimal": [
            {"times_s": each.times_s.tolist(), "amplitudes": each.amplitudes.tolist()} for each in found
        ],
        "stage": {
            "way_mm": _WAY_MM,
            "move_s": _MOVE_S,
            "assumed": {
                "ramp_s": _RAMP_S, "damping_ratio": _DAMPING_RATIO, "frequency_error": _FREQUENCY_ERROR,
            },
            "vibration_mm": stage,
        },
        "remark": (
            "The paper's curves are pictures without numbers, so its statements are compared, not its curves. Of the "
            "stage it states 200 mm and a stop after 3 s; ramps of 0.1 s, damping ratio 0.005 and frequencies 2 % "
            "higher than set are assumptions, and the beams are taken as modes that do not act back on the stage. "
            "How large the vibration is, and whether start and stop add, cancel or reverse it, depends on them; that a "
            "little of the faster mode is left, and more of it behind the short shaper, does not. The paper compares "
            "three minimal shapers; there are seven up to 0.8 s."
        ),
    }  # fmt: skip
    return ShaperDemo(shapers, branches, runs, report)


def _named(found: Sequence[Shaper], name: str) -> Shaper:
    """The paper's shaper of that name: of its duration, with its signs and its spacing, its larger tap first."""
    matching = [
        each
        for each in found
        if abs(each.duration_s - _PAPER_DURATIONS_S[name]) < 1e-6
        and [bool(a < 0.0) for a in each.amplitudes] == _PAPER_NEGATIVE[name]
        and _is_uniform(each) == _PAPER_UNIFORM[name]
    ]
    return max(matching, key=lambda each: float(each.amplitudes[0]))


def _is_uniform(shaper: Shaper) -> bool:
    return bool(np.ptp(np.diff(shaper.times_s)) < 1e-6)


def _row(figure: str, what: str, paper: str, here: str, agrees: bool | None) -> dict[str, Any]:
    """A statement of the paper beside ours; None: the paper leaves open what it depends on."""
    return {"figure": figure, "what": what, "paper": paper, "here": here, "agrees": agrees}


def _branch_rows(branches: MinimalBranches) -> list[dict[str, Any]]:
    """Several shapers per frequency; the shortest branch is the closed form 2/(f1+f2)."""
    durations_s = branches.times_s[..., 2]
    counts = np.isfinite(durations_s).sum(axis=0)
    shortest = np.nanargmin(durations_s, axis=0)
    every = np.arange(len(shortest))
    seconds_hz = branches.ratios * MODES[0].frequency_hz
    miss_s = np.abs(durations_s[shortest, every] - 2.0 / (MODES[0].frequency_hz + seconds_hz)).max()
    middle = branches.amplitudes[shortest, every, 1]
    turning = float(branches.ratios[middle < 0.0].min())
    return [
        _row(
            "2", "shapers for one pair of frequencies, up to 1 s", "several", f"{counts.min()} to {counts.max()}",
            bool(counts.max() > 1),
        ),
        _row(
            "2", "shortest branch against 2/(f1+f2)", "(curve)", f"within {miss_s * 1e3:.1g} ms", bool(miss_s < 1e-9)
        ),
        _row("3", "middle tap of the shortest branch is negative", "(curve)", f"from f2/f1 = {turning:.3g} on", None),
    ]  # fmt: skip


def _shaper_rows(shapers: dict[str, Shaper]) -> list[dict[str, Any]]:
    rows = []
    for name, paper_s in _PAPER_DURATIONS_S.items():
        shaper = shapers[name]
        rows.append(
            _row(
                "4", f"{name}: duration", f"{paper_s:g} s", f"{shaper.duration_s:.6g} s",
                abs(shaper.duration_s - paper_s) < 1e-6,
            )
        )  # fmt: skip
    for name, negative in _PAPER_NEGATIVE.items():
        shaper = shapers[name]
        signs = ", ".join(f"{a:+.4f}" for a in shaper.amplitudes)
        paper = "second negative" if any(negative) else "all positive"
        spacing = "uniform" if _PAPER_UNIFORM[name] else "not uniform"
        agrees = [bool(a < 0.0) for a in shaper.amplitudes] == negative
        times = ", ".join(f"{t:.4g}" for t in shaper.times_s)
        rows.append(_row("4", f"{name}: taps", f"3, {paper}, {spacing}", f"{signs} at {times} s", agrees))
    count = len(shapers["convolved ZV"].times_s)
    rows.append(_row("4", "convolved ZV: number of taps", "4", str(count), count == 4))
    return rows


def _sensitivity_rows(shapers: dict[str, Shaper], worst: dict[str, float]) -> list[dict[str, Any]]:
    left = max(shaper.residual_ratio(mode) for shaper in shapers.values() for mode in MODES)
    listed = ", ".join(f"{name} {worst[name]:.1f} %" for name in worst)
    return [
        _row("5", "left at 1 Hz and 4 Hz, all shapers", "0", f"{left:.0e}", left < NO_RESIDUAL),
        _row(
            "5", "worst over ±5 %", "short highest; long good", listed,
            worst["short"] == max(worst.values()) and worst["long"] < worst["short"],
        ),
        _row(
            "5", "longer minimal shapers are less sensitive", "generally",
            "yes" if worst["short"] > worst["medium"] > worst["long"] else "no",
            worst["short"] > worst["medium"] > worst["long"],
        ),
    ]  # fmt: skip


def _response_rows(shapers: dict[str, Shaper]) -> list[dict[str, Any]]:
    """A step: after the last tap nothing of either mode is left, unshaped all of it."""
    until_s = max(shaper.duration_s for shaper in shapers.values()) + 1.0
    compared = {"unshaped": Shaper([0.0], [1.0])} | {name: shapers[name] for name in ("short", "long", "convolved ZV")}
    left = {
        name: respond(MODES, shaped_step(shaper, _STEP_PERIOD_S, until_s), _STEP_PERIOD_S).residuals
        for name, shaper in compared.items()
    }
    largest = max(float(values.max()) for name, values in left.items() if name != "unshaped")
    rises = ", ".join(f"{name} {shaper.duration_s:.4g} s" for name, shaper in compared.items() if name != "unshaped")
    return [
        _row(
            "6", "step of 1: vibration left, unshaped / shaped", "all removed",
            f"{left['unshaped'].max():.3f} / {largest:.0e}", largest < 1e-6,
        ),
        _row("6", "step: rise time", "very different", rises, True),
    ]  # fmt: skip


def _beams() -> list[Mode]:
    return [Mode(mode.frequency_hz * (1.0 + _FREQUENCY_ERROR), _DAMPING_RATIO) for mode in MODES]


def _stage_command() -> FloatArray:
    """Way of the stage, mm, every `_STEP_PERIOD_S`: ramps of constant acceleration, and a second of rest behind."""
    t = np.arange(round(_MOVE_S / _STEP_PERIOD_S) + 1) * _STEP_PERIOD_S
    speed = _WAY_MM / (_MOVE_S - _RAMP_S)
    starting, ending = 0.5 * speed * t**2 / _RAMP_S, _WAY_MM - 0.5 * speed * (_MOVE_S - t) ** 2 / _RAMP_S
    way = np.where(t < _RAMP_S, starting, np.where(t < _MOVE_S - _RAMP_S, speed * (t - 0.5 * _RAMP_S), ending))
    return np.concatenate([way, np.full(round(2.0 / _STEP_PERIOD_S), _WAY_MM)])


def _stage_runs(shapers: dict[str, Shaper]) -> dict[str, ModalRun]:
    """The beams on the stage: frequencies a little off what was designed for, a little damping."""
    beams = _beams()
    command = _stage_command()
    runs = {"unshaped": respond(beams, command, _STEP_PERIOD_S)}
    for name, shaper in shapers.items():
        delays = [round(t / _STEP_PERIOD_S) for t in shaper.times_s]
        shaped = Fir(delays, list(shaper.amplitudes)).apply(command)
        runs[name] = respond(beams, shaped, _STEP_PERIOD_S)
    return runs


def _stage_figures(run: ModalRun) -> dict[str, list[float]]:
    """Vibration of each beam before the stage slows down (what the start left), and behind the stop, mm."""
    steady = (run.times_s > _MOVE_S - _RAMP_S - 1.0) & (run.times_s < _MOVE_S - _RAMP_S)
    while_moving = np.abs(run.responses[steady] - run.command[steady, None]).max(axis=0)
    return {"before_stop": while_moving.tolist(), "after_stop": run.residuals.tolist()}


def _phase_jump_degrees(run: ModalRun, beam: int) -> float:
    """By how much the phase of a beam's vibration changes between start and stop, 0 to 180 degrees."""
    mode = _beams()[beam]
    waves = np.exp(mode.pole * run.times_s)
    deflection = run.responses[:, beam] - run.command
    phasors = []
    for begin_s, end_s in ((_RAMP_S, _MOVE_S - _RAMP_S), (_MOVE_S, run.times_s[-1])):
        part = (run.times_s >= begin_s) & (run.times_s <= end_s)
        columns = np.column_stack([waves[part].real, -waves[part].imag])
        real, imaginary = np.linalg.lstsq(columns, deflection[part], rcond=None)[0]
        phasors.append(complex(real, imaginary))
    return abs(math.degrees(cmath.phase(phasors[1] / phasors[0])))


def _stage_rows(stage: dict[str, dict[str, list[float]]], jump_degrees: float) -> list[dict[str, Any]]:
    slow, fast = stage["unshaped"]["after_stop"]

    def left(name: str, beam: int) -> float:
        return 100.0 * stage[name]["after_stop"][beam] / stage["unshaped"]["after_stop"][beam]

    before = stage["unshaped"]["before_stop"][1]
    rows = [
        _row(
            "8, 9", "unshaped, 4 Hz beam: start and stop superposed", "reverses after 3 s",
            f"{before:.2f} mm before, {fast:.2f} mm after, phase jumps by {jump_degrees:.0f}°", None,
        ),
        _row("8, 9", "unshaped, behind the stop, 1 Hz / 4 Hz", "(curve)", f"{slow:.2f} / {fast:.2f} mm", None),
    ]  # fmt: skip
    rows += [
        _row(
            figure, f"{name}: left of 1 Hz / 4 Hz", "removed, a little of 4 Hz left",
            f"{left(name, 0):.1f} / {left(name, 1):.1f} %", left(name, 0) < left(name, 1) < 25.0,
        )
        for figure, name in (("8", "short"), ("9", "long"))
    ]  # fmt: skip
    rows.append(
        _row(
            "8, 9", "more of 4 Hz left behind the short than behind the long one", "yes",
            "yes" if left("short", 1) > left("long", 1) else "no", left("short", 1) > left("long", 1),
        )
    )  # fmt: skip
    return rows
