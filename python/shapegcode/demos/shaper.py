"""Minimal two-mode shapers for 1 Hz and 4 Hz, their sensitivity, and their test on a stage.

Park, Hong and Danielson, 2009 (paper 002 in docs/evidence/references.md) print durations and signs; their curves are
pictures without numbers. So what can be compared is what the text states, beside what the models here give; nothing is
tuned.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from shapegcode._core import MinimalBranches, Shaper, convolved_zv, minimal_branches, minimal_two_mode
from shapegcode.demos import stage
from shapegcode.demos.result import Demonstration, Statement, compared, stated
from shapegcode.demos.stage import MODES, PERIOD_S, StageVibration
from shapegcode.results.json import hidden
from shapegcode.shaping.bands import ModeBand
from shapegcode.shaping.designs import evaluate
from shapegcode.shaping.modal_run import ModalRun, respond, shaped_step
from shapegcode.shaping.ranking import NO_RESIDUAL

__all__ = ["DemoShaper", "ShaperDemo", "shaper_demo"]

_PAPER_DURATIONS_S = {"short": 0.4, "medium": 0.6, "long": 0.8, "convolved ZV": 0.625}
_PAPER_NEGATIVE = {"short": [False, True, False], "medium": [False] * 3, "long": [False] * 3}
_PAPER_UNIFORM = {"short": True, "medium": False, "long": True}
_LONGEST_S = 0.81
_BAND = 0.05  # for the comparison of sensitivities; the paper shows curves only

_BRANCH_RATIOS = np.linspace(1.05, 8.01, 349)
_BRANCH_LONGEST_S = 1.0
_REMARK = (
    "The paper's curves are pictures without numbers, so its statements are compared, not its curves. Of the "
    "stage it states 200 mm and a stop after 3 s; ramps of 0.1 s, damping ratio 0.005 and frequencies 2 % "
    "higher than set are assumptions, and the beams are taken as modes that do not act back on the stage. "
    "How large the vibration is, and whether start and stop add, cancel or reverse it, depends on them; that a "
    "little of the faster mode is left, and more of it behind the short shaper, does not. The paper compares "
    "three minimal shapers; there are seven up to 0.8 s."
)


@dataclass(frozen=True)
class DemoShaper:
    """A shaper of the comparison.

    Attributes:
        times_s: of the taps.
        amplitudes: of the taps.
        duration_s: time of the last tap.
        worst_residual_percent: largest share of the vibration left within 5 % of the modes' frequencies.
    """

    times_s: tuple[float, ...]
    amplitudes: tuple[float, ...]
    duration_s: float
    worst_residual_percent: float


@dataclass(frozen=True, repr=False, eq=False, kw_only=True)
class ShaperDemo(Demonstration):
    """Two-mode shapers, their branches, step responses and sensitivities, and the test on a stage.

    Attributes:
        modes_hz: of the paper, undamped.
        compared: short, medium, long and convolved ZV.
        all_minimal_s: times of every minimal shaper up to 0.8 s, ascending in duration.
        stage_vibration: of the stage, by the shaper's name, "unshaped" among them.
        stage_way_mm: of the stage, as the paper states.
        stage_move_s: time of the move, as the paper states.
        assumed_ramp_s: of constant acceleration, which the paper does not state.
        assumed_damping_ratio: of the beams, which the paper does not state.
        assumed_frequency_error: of the set frequencies, relative, which the paper does not state.
        shapers: what is compared, by name.
        branches: minimal shapers over the second frequency, the first one at 1 Hz.
        runs: of the stage, by the shaper's name, "unshaped" among them.
    """

    modes_hz: tuple[float, ...]
    compared: Mapping[str, DemoShaper]
    all_minimal_s: tuple[tuple[float, ...], ...]
    stage_vibration: Mapping[str, StageVibration]
    stage_way_mm: float
    stage_move_s: float
    assumed_ramp_s: float
    assumed_damping_ratio: float
    assumed_frequency_error: float
    shapers: Mapping[str, Shaper] = field(metadata=hidden())
    branches: MinimalBranches = field(metadata=hidden())
    runs: Mapping[str, ModalRun] = field(metadata=hidden())

    @property
    def next_step(self) -> str:
        """The one thing to do next."""
        return "shapegcode shaper --mode 1 --mode 4 --continuous --max-duration 1s"


def shaper_demo(on_progress: Callable[[float], None] = lambda _: None) -> ShaperDemo:
    """The paper's shapers, branches, step responses, sensitivities and stage test.

    Args:
        on_progress: called with the share of the work done, 0 to 1.

    Source: Park, Hong and Danielson, 2009 (paper 002), sections 3 and 4.

    Returns:
        Each statement of the paper beside ours.
    """
    found = minimal_two_mode(*MODES, _LONGEST_S)
    shapers = {name: _named(found, name) for name in _PAPER_NEGATIVE} | {"convolved ZV": convolved_zv(list(MODES))}
    branches = minimal_branches(MODES[0], 0.0, _BRANCH_RATIOS.tolist(), _BRANCH_LONGEST_S)
    on_progress(0.5)
    runs = stage.run_stage(shapers)
    shaken = {name: stage.vibration(run) for name, run in runs.items()}
    bands = [ModeBand(mode, _BAND) for mode in MODES]
    worst = {name: 100.0 * evaluate(name, shaper, bands).worst_residual for name, shaper in shapers.items()}
    return ShaperDemo(
        paper=ShaperDemo.cited("002"),
        title="Two-mode shapers for 1 Hz and 4 Hz",
        rows=(
            *_branch_rows(branches),
            *_shaper_rows(shapers),
            *_sensitivity_rows(shapers, worst),
            *_response_rows(shapers),
            *stage.statements(shaken, stage.phase_jump_degrees(runs["unshaped"], 1)),
        ),
        remark=_REMARK,
        modes_hz=tuple(mode.frequency_hz for mode in MODES),
        compared={
            name: DemoShaper(tuple(each.times_s), tuple(each.amplitudes), each.duration_s, worst[name])
            for name, each in shapers.items()
        },
        all_minimal_s=tuple(tuple(each.times_s) for each in found),
        stage_vibration=shaken,
        stage_way_mm=stage.WAY_MM,
        stage_move_s=stage.MOVE_S,
        assumed_ramp_s=stage.RAMP_S,
        assumed_damping_ratio=stage.DAMPING_RATIO,
        assumed_frequency_error=stage.FREQUENCY_ERROR,
        shapers=shapers,
        branches=branches,
        runs=runs,
    )


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


def _branch_rows(branches: MinimalBranches) -> list[Statement]:
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
        stated(
            "figure 2", "shapers for one pair of frequencies, up to 1 s", "several",
            f"{counts.min()} to {counts.max()}", bool(counts.max() > 1),
        ),
        stated(
            "figure 2", "shortest branch against 2/(f1+f2)", "(curve)", f"within {miss_s * 1e3:.1g} ms",
            bool(miss_s < 1e-9),
        ),
        stated(
            "figure 3", "middle tap of the shortest branch is negative", "(curve)",
            f"from f2/f1 = {turning:.3g} on", None,
        ),
    ]  # fmt: skip


def _shaper_rows(shapers: dict[str, Shaper]) -> list[Statement]:
    rows = [
        compared("figure 4", f"{name}: duration", paper_s, shapers[name].duration_s, "s", digits=3, within=1e-6)
        for name, paper_s in _PAPER_DURATIONS_S.items()
    ]
    for name, negative in _PAPER_NEGATIVE.items():
        shaper = shapers[name]
        signs = ", ".join(f"{a:+.4f}" for a in shaper.amplitudes)
        paper = "second negative" if any(negative) else "all positive"
        spacing = "uniform" if _PAPER_UNIFORM[name] else "not uniform"
        agrees = [bool(a < 0.0) for a in shaper.amplitudes] == negative
        times = ", ".join(f"{t:.4g}" for t in shaper.times_s)
        rows.append(stated("figure 4", f"{name}: taps", f"3, {paper}, {spacing}", f"{signs} at {times} s", agrees))
    count = len(shapers["convolved ZV"].times_s)
    rows.append(stated("figure 4", "convolved ZV: number of taps", "4", str(count), count == 4))
    return rows


def _sensitivity_rows(shapers: dict[str, Shaper], worst: dict[str, float]) -> list[Statement]:
    left = max(shaper.residual_ratio(mode) for shaper in shapers.values() for mode in MODES)
    listed = ", ".join(f"{name} {worst[name]:.1f} %" for name in worst)
    return [
        stated("figure 5", "left at 1 Hz and 4 Hz, all shapers", "0", f"{left:.0e}", left < NO_RESIDUAL),
        stated(
            "figure 5", "worst over ±5 %", "short highest; long good", listed,
            worst["short"] == max(worst.values()) and worst["long"] < worst["short"],
        ),
        stated(
            "figure 5", "longer minimal shapers are less sensitive", "generally",
            "yes" if worst["short"] > worst["medium"] > worst["long"] else "no",
            worst["short"] > worst["medium"] > worst["long"],
        ),
    ]  # fmt: skip


def _response_rows(shapers: dict[str, Shaper]) -> list[Statement]:
    """A step: after the last tap nothing of either mode is left, unshaped all of it."""
    until_s = max(shaper.duration_s for shaper in shapers.values()) + 1.0
    compared = {"unshaped": Shaper([0.0], [1.0])} | {name: shapers[name] for name in ("short", "long", "convolved ZV")}
    left = {
        name: respond(MODES, shaped_step(shaper, PERIOD_S, until_s), PERIOD_S).residuals
        for name, shaper in compared.items()
    }
    largest = max(float(values.max()) for name, values in left.items() if name != "unshaped")
    rises = ", ".join(f"{name} {shaper.duration_s:.4g} s" for name, shaper in compared.items() if name != "unshaped")
    return [
        stated(
            "figure 6", "step of 1: vibration left, unshaped / shaped", "all removed",
            f"{left['unshaped'].max():.3f} / {largest:.0e}", largest < 1e-6,
        ),
        stated("figure 6", "step: rise time", "very different", rises, True),
    ]  # fmt: skip
