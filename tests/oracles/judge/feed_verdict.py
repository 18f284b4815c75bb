"""What the judge finds of one scheduled program: every limit, the path, the blocks, the text, the figures."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from .feeds import Forces, Run, Travel, beside_mm, commanded, rest_of, runs, travelled
from .interpreter import interpret
from .milling_programs import INCH_MM, Case
from .player import BlockEnd
from .records import Interpretation, Move

Array = npt.NDArray[np.float64]

COLUMNS = {
    "resultant_n": "peak_n",
    "deflection_um": "deflection_um",
    "torque_nm": "torque_nm",
    "power_w": "power_w",
}


@dataclass(frozen=True)
class Control:
    """What the judge needs to know of the machine."""

    after_interpolation: bool
    samples: int
    block_end: BlockEnd = "ceil"
    period_s: float = 0.001
    interval_mm: float = 0.6
    max_change: float = math.inf
    max_feed: float = 15000.0
    min_feed: float = 1.0


@dataclass
class Verdict:
    """Findings in words, and figures."""

    findings: list[str] = field(default_factory=list)
    worst: dict[str, float] = field(default_factory=dict)  # largest value over its limit
    place: dict[str, str] = field(default_factory=dict)
    near_share: float = math.nan  # of the limited path, within 5 % of a limit
    limited_share: float = math.nan
    emitted: dict[str, float] = field(default_factory=dict)
    original: dict[str, float] = field(default_factory=dict)
    gain: float = math.nan  # time of the constant feed over that of the schedule, both in material


def real(run: Run, emitted: list[Move], case: Case, control: Control) -> Travel:
    """How the control runs the blocks."""
    if not control.after_interpolation:
        return commanded(run, emitted)
    return travelled(
        run, emitted, window_s=case.mill.tooth_s, period_s=control.period_s, samples=control.samples,
        block_end=control.block_end,
    )  # fmt: skip


def kept_lines(report: Mapping[str, Any]) -> list[tuple[int, int]]:
    """Ranges of lines that the report says are left alone, or held by the least feed."""
    return [tuple(e["lines"]) for e in report["limits"] if e["limit"] in ("kept", "minimum")]


def judge(
    case: Case, text: str, report: Mapping[str, Any], met: list[Run], forces: Forces, control: Control,
    *, mean: bool = False, max_feed: float = math.inf, raised: bool = False,
) -> Verdict:  # fmt: skip
    """Everything of one emitted program."""
    verdict = Verdict()
    say = verdict.findings.append
    emitted = interpret(text)
    new = runs(emitted)
    if len(new) != len(met):
        say(f"{len(met)} runs before, {len(new)} after")
        return verdict
    increment = INCH_MM * 1e-4 if case.inch else 1e-3
    if rest_of(case.program) != rest_of(text):
        say("something besides motion, place and feed words changed")
    _modal(case, emitted, say)
    kept = kept_lines(report)
    limits = dict(case.limits)
    columns = {**COLUMNS, "resultant_n": "mean_n" if mean else "peak_n"}
    after: list[tuple[Array, dict[str, Array], Array]] = []
    before: list[tuple[Array, dict[str, Array], Array]] = []
    near = limited = total = 0.0
    for run, blocks in zip(met, new, strict=True):
        off = beside_mm(run.moves, blocks)
        # Half an increment in each axis, and the radii of R words and centres likewise.
        if off > 1.5 * increment:
            say(f"path {off / increment:.2f} increments beside the original, line {blocks[0].line}")
        _blocks(run, blocks, kept, control, increment, max_feed, say)
        travel = real(run, blocks, case, control)
        was = real(run, run.moves, case, control)
        lines = np.array([move.line for move in run.moves])[run.move]
        free = np.array([not any(a <= line <= b for a, b in kept) for line in lines])
        level = np.array(
            [math.hypot(*move.delta[:2]) / move.length if move.kind == "line" else 1.0 for move in run.moves]
        )
        new_figures = forces.along(run, travel.feed * level[run.move])
        old_figures = forces.along(run, was.feed * level[run.move])
        after.append((travel.time, new_figures, run.move))
        before.append((was.time, old_figures, run.move))
        share = np.zeros(len(run.s_mm))
        for name, limit in limits.items():
            if name not in columns:
                continue
            use = new_figures[columns[name]] / limit
            share = np.maximum(share, use)
            use = np.where(free, use, 0.0)
            k = int(np.argmax(use))
            if use[k] > verdict.worst.get(name, 0.0):
                verdict.worst[name] = float(use[k])
                verdict.place[name] = (
                    f"original line {lines[k]}, s {run.s_mm[k]:.3f} of run, feed {travel.feed[k]:.1f}, "
                    f"arcs {np.round(run.arcs[k], 3).tolist()}"
                )
        programmed = np.array([move.feed for move in run.moves])[run.move]
        ceiling = np.full(len(programmed), min(max_feed, control.max_feed)) if raised else programmed
        cut = np.array([bool(arcs) for arcs in run.arcs])
        word = commanded(run, blocks).feed
        if math.isfinite(case.limits.get("feed_per_tooth_max_mm", math.inf)):
            _chips(case, run, word, cut & free & _within(run), control, say)
        held = (word >= ceiling * 0.999) | ~cut | ~free
        step = np.diff(run.s_mm, prepend=0.0)
        total += float(step[cut].sum())
        limited += float(step[~held].sum())
        near += float(step[~held & (share >= 0.95)].sum())
    verdict.near_share = near / limited if limited else math.nan
    verdict.limited_share = limited / total if total else 0.0
    verdict.emitted, verdict.original = _sums(after), _sums(before)
    return verdict


def _within(run: Run) -> npt.NDArray[np.bool_]:
    """Stations with material on both sides, so that no block of the air reaches them."""
    cut = np.array([bool(arcs) for arcs in run.arcs])
    return cut & np.concatenate([[False], cut[:-1]]) & np.concatenate([cut[1:], [False]])


def _sums(parts: list[tuple[Array, dict[str, Array], Array]]) -> dict[str, float]:
    time = impulse = 0.0
    for at, figures, _ in parts:
        step = np.diff(at, prepend=at[0])
        cut = figures["peak_n"] > 1e-9
        # A stretch belongs to the station at its end, as in the report.
        time += float(step[cut].sum())
        impulse += float((step * figures["mean_n"])[cut].sum())
    return {
        "mean": impulse / time if time > 0.0 else 0.0,
        "max": max(float(figures["peak_n"].max()) for _, figures, _ in parts),
        "time": time,
        **{name: max(float(f[name].max()) for _, f, _ in parts) for name in ("torque_nm", "power_w", "deflection_um")},
    }


def _modal(case: Case, emitted: Interpretation, say: Any) -> None:
    """Modal state at the end, and position at each stop."""
    old, new = interpret(case.program), emitted
    for name, value in old.modal.items():
        if not np.array_equal(np.asarray(value), np.asarray(new.modal[name])) and not (
            isinstance(value, np.ndarray) and np.allclose(value, new.modal[name], atol=1e-9, equal_nan=True)
        ):
            say(f"modal {name} is {new.modal[name]} at the end, was {value}")
    ends_old = [run[-1].end for run in runs(old)]
    ends_new = [run[-1].end for run in runs(new)]
    off = max(float(np.abs(a - b).max()) for a, b in zip(ends_old, ends_new, strict=True))
    if off > 1e-9:
        say(f"a run ends {off:g} mm from where it did")
    rapid_old = [m.end for m in old.moves if m.kind == "rapid"]
    rapid_new = [m.end for m in new.moves if m.kind == "rapid"]
    if len(rapid_old) != len(rapid_new) or not np.allclose(rapid_old, rapid_new, atol=1e-9, equal_nan=True):
        say("rapids go elsewhere")
    # What a block behind each run would be run with.
    last_old = [next(r.modal for r in old.lines if r.number == run[-1].line) for run in runs(old)]
    behind = [run[-1].line for run in runs(new)]
    for k, state in enumerate(last_old):
        stop = behind[k]
        later = [r for r in new.lines if r.number >= stop]
        until = next((i for i, r in enumerate(later) if i and r.words and not _only_feed(r.words)), 1)
        got = later[until - 1].modal
        for name in ("motion", "plane", "distance", "units", "feed_mode", "F"):
            if state[name] != got[name]:
                say(f"behind the run to line {stop}: modal {name} is {got[name]}, was {state[name]}")


def _only_feed(words: Any) -> bool:
    return all(a in "FN" for a, _ in words)


def _blocks(
    run: Run, blocks: list[Move], kept: list[tuple[int, int]], control: Control, increment: float, max_feed: float,
    say: Any,
) -> None:  # fmt: skip
    """Lengths and feeds of the blocks."""
    originals = np.array([move.length for move in run.moves])
    feeds = np.array([move.feed for move in blocks])
    for move in blocks:
        if move.length < control.interval_mm - 2 * increment and np.abs(originals - move.length).min() > 3 * increment:
            say(f"line {move.line}: block of {move.length:.4f} mm, shorter than {control.interval_mm} and not original")
    change = np.flatnonzero(np.diff(feeds) != 0.0)
    if math.isfinite(control.max_change):
        near_lines = _lines_near(run, blocks, change)
        for k in change:
            step = abs(feeds[k + 1] - feeds[k])
            # As far as feeds that are kept allow.
            beside_kept = any(any(a <= line <= b for a, b in kept) for line in near_lines[int(k)])
            if step > control.max_change + 0.26 and not beside_kept:
                say(f"line {blocks[k + 1].line}: feed changes by {step:.1f} > {control.max_change:g} mm/min")
    borders = np.concatenate([[0], change + 1, [len(blocks)]])
    lengths = np.array([move.length for move in blocks])
    for a, b in pairwise(borders):
        stretch = float(lengths[a:b].sum())
        if stretch < control.interval_mm - 3 * increment and stretch < run.length - 3 * increment:
            say(f"line {blocks[a].line}: feed {feeds[a]:g} stays for {stretch:.4f} mm < {control.interval_mm}")
    if feeds.max() > min(max_feed, control.max_feed) + 1e-6:
        say(f"feed {feeds.max():g} above the largest {min(max_feed, control.max_feed):g}")


def _lines_near(run: Run, blocks: list[Move], change: npt.NDArray[np.intp]) -> dict[int, list[int]]:
    """Lines of the original on both sides of each change of the feed."""
    ends = np.cumsum([move.length for move in blocks])
    original = np.cumsum([move.length for move in run.moves])
    out = {}
    for k in change:
        first = int(np.searchsorted(original, ends[k] - 0.01))
        last = int(np.searchsorted(original, ends[k] + 0.01))
        out[int(k)] = [move.line for move in run.moves[max(first, 0) : last + 1]]
    return out


def _chips(case: Case, run: Run, word: Array, cut: npt.NDArray[np.bool_], control: Control, say: Any) -> None:
    """Feed words in material, per tooth."""
    teeth = case.mill.flutes * case.mill.rev_per_min
    most = case.limits.get("feed_per_tooth_max_mm", math.inf) * teeth
    least = max(case.limits.get("feed_per_tooth_min_mm", 0.0) * teeth, control.min_feed)
    programmed = np.array([move.feed for move in run.moves])[run.move]
    for k in np.flatnonzero(cut):
        # At a border the larger one was taken.
        if word[k] > max(most, programmed[k] if not math.isfinite(most) else 0.0) * (1.0 + 1e-4):
            say(f"s {run.s_mm[k]:.3f}: {word[k] / teeth:.5f} mm per tooth, most {most / teeth:g}")
        if word[k] < min(least * (1.0 - 1e-4) - 0.26, programmed[k]):
            say(f"s {run.s_mm[k]:.3f}: feed {word[k]:g} below the least {least:g}")


def constant_feed_time(
    met: list[Run], forces: Forces, limits: Mapping[str, float], mean: bool, highest: float
) -> float:
    """Time in material, s, at the one feed that just keeps every limit everywhere."""
    columns = {**COLUMNS, "resultant_n": "mean_n" if mean else "peak_n"}
    arcs = [a for run in met for a in run.arcs if a]
    worst = sorted(arcs, key=lambda a: -forces.at(a, highest).peak_n)[:150]
    low, high = 1.0, highest
    for _ in range(25):
        feed = 0.5 * (low + high)
        use = max(
            getattr(forces.at(a, feed), columns[name]) / limit
            for a in worst
            for name, limit in limits.items()
            if name in columns
        )
        low, high = (feed, high) if use <= 1.0 else (low, feed)
    way = sum(float(np.diff(run.s_mm, prepend=0.0)[np.array([bool(a) for a in run.arcs])].sum()) for run in met)
    return way / low * 60.0
