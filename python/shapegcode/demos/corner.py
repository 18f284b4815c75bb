"""Paper 001 repeated: three corners in closed form, equation 7, and the scheduler on the same corners.

What the paper says is printed beside what is computed from its numbers; where the two differ, the difference stays.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from shapegcode.demos.corner_study import (
    ALLOWANCE_MM,
    AXIAL_DEPTH_MM,
    BLOCK_MM,
    CASES,
    STRAIGHT_MM,
    TOOL_RADIUS_MM,
    AlongCorner,
    CornerStudy,
    study_corner,
)
from shapegcode.machine import Machine

__all__ = ["CornerDemo", "corner_demo"]

_DIAMETER_MM = 2.0 * TOOL_RADIUS_MM
_PAPER_LEAST_FEED = 91.0
_PAPER_JUMP = 0.9  # of the diameter
_PAPER_DROP_PERCENT = 50.0
_DIFFERS = "differs"
_WALL_EVERY = 20
_WALL_ROWS = 16


@dataclass(frozen=True)
class CornerDemo:
    """Everything of the demonstration.

    Attributes:
        report: figures as plain values: `rows` (case, what, paper, here, agrees, note), `agrees`, `machine`, `cases`,
            `remark`.
        studies: of the cases, for the pictures.
    """

    report: dict[str, Any]
    studies: tuple[CornerStudy, ...]


def corner_demo(on_progress: Callable[[float], None] = lambda _done: None) -> CornerDemo:
    """The three corners of the paper, and what the scheduler makes of them.

    Args:
        on_progress: called with the share that is done, 0 to 1.
    """
    machine = Machine.load("vx500")
    studies, rows, cases = [], [], []
    for done, case in enumerate(CASES):
        study = study_corner(case, machine)
        figures = _figures(study)
        cases.append(figures)
        rows += [*(_first_rows(figures) if case.number == 1 else _jump_rows(figures)), *_scheduled_rows(figures)]
        studies.append(study)
        on_progress((done + 1) / len(CASES))
    report = {
        "rows": rows,
        "agrees": all(row["agrees"] is not False or row["note"].startswith(_DIFFERS) for row in rows),
        "machine": machine.name,
        "cases": cases,
        "remark": (
            f"The wall is to the right (climb milling); k1 is taken in kgf/mm²; both are not stated. The schedule's "
            f"target is the peak resultant of the straight at the programmed feed, with {STRAIGHT_MM:g} mm of straight "
            f"before and behind the corner; its force is that of the feed which {machine.name} really runs, on the "
            "engagement in closed form, which the scheduler itself does not use. The paper's forces and surfaces are "
            "pictures without numbers; the tool's overhang is assumed."
        ),
    }
    return CornerDemo(report, tuple(studies))


def _figures(study: CornerStudy) -> dict[str, Any]:
    case, scheduled, length = study.case, study.scheduled, study.length_mm
    programmed, blocks = study.programmed, np.diff(study.blocks_mm)
    deepest = study.deepest()
    after = study.equation7
    target = float(programmed.peak_n[0])
    return {
        "case": case.number,
        "spindle_rev_per_min": case.spindle_rev_per_min,
        "rough_radius_mm": case.rough_radius_mm,
        "finish_radius_mm": case.finish_radius_mm,
        "radial_depth_mm": {
            "straight": ALLOWANCE_MM,
            "max": deepest.radial_depth_mm,
            "behind": float(study.track.radial_depth_mm[min(study.worst + 1, len(study.track) - 1)]),
        },
        "radial_depth_ratio": deepest.radial_depth_mm / _DIAMETER_MM,
        "angle_deg": math.degrees(deepest.turned_rad),
        "full_circle_radial_depth_mm": _full_circle_mm(case.rough_radius_mm, case.finish_radius_mm),
        "blocks": {"number": len(blocks), "length_mm": {"min": float(blocks.min()), "max": float(blocks.max())}},
        "feed_mm_per_min": {"min": float(after.feed_mm_per_min.min()), "max": float(after.feed_mm_per_min.max())},
        "resultant_force_n": {"before": programmed.figures(length), "after": after.figures(length)},
        "above_straight_percent": {
            "mean": 100.0 * float(after.mean_n.max() / programmed.mean_n[0] - 1.0),
            "peak": 100.0 * float(after.peak_n.max() / target - 1.0),
        },
        "drop_percent": 100.0 * float(1.0 - after.peak_n.max() / programmed.peak_n.max()),
        "equation7_by_peak_mm_per_min": case.feed_mm_per_min * target / float(programmed.peak_n[study.worst]),
        "constant_force_mm_per_min": study.constant_force_mm_per_min,
        "scheduled": {
            "target_n": target,
            "feed_mm_per_min": vars(scheduled.result.feed_mm_per_min),
            "resultant_force_n": {"before": programmed.figures(length), "after": scheduled.along.figures(length)},
            "share_within_5_percent": study.share_within(),
            "blocks": {"before": scheduled.result.blocks.original, "after": scheduled.result.blocks.emitted},
            "cutting_time_s": {"scheduled": scheduled.time_s, "constant": scheduled.constant_time_s},
            "constant_feed_mm_per_min": scheduled.constant_feed_mm_per_min,
            "gain_percent": 100.0 * scheduled.gain,
            "warnings": list(scheduled.result.warnings),
        },
        "wall_error_um": {
            name: _largest_wall_um(study, along)
            for name, along in (
                ("programmed", programmed), ("equation7", after), ("scheduled", scheduled.along),
            )
        },
    }  # fmt: skip


def _full_circle_mm(rough_mm: float, finish_mm: float) -> float | None:
    """Radial depth at the vertex if the rough corner were a whole circle, not an arc; None: no vertex."""
    if finish_mm > TOOL_RADIUS_MM:
        return None
    tool = np.array([-TOOL_RADIUS_MM, TOOL_RADIUS_MM])
    rough = np.array([-1.0, 1.0]) * (rough_mm + ALLOWANCE_MM)
    apart = float(np.hypot(*(rough - tool)))
    towards = (rough - tool) / apart
    along = (apart**2 + TOOL_RADIUS_MM**2 - rough_mm**2) / (2.0 * apart)
    across = math.sqrt(TOOL_RADIUS_MM**2 - along**2)
    # The upper of the two points where the circles meet; the wall is the X axis.
    return float(tool[1] + along * towards[1] + across * abs(towards[0]))


def _largest_wall_um(study: CornerStudy, along: AlongCorner) -> float:
    heights = np.linspace(0.0, AXIAL_DEPTH_MM, _WALL_ROWS)
    return float(np.nanmax(np.abs(study.wall_error_um(along, _WALL_EVERY, heights))))


def _row(case: int, what: str, paper: str, here: str, agrees: bool | None, note: str = "") -> dict[str, Any]:
    """A figure of the paper beside ours; None: nothing to agree with."""
    return {"case": case, "what": what, "paper": paper, "here": here, "agrees": agrees, "note": note}


def _first_rows(of: dict[str, Any]) -> list[dict[str, Any]]:
    """Case 1, the one whose forces and feeds the paper computes."""
    depth, ratio, feed = of["radial_depth_mm"], of["radial_depth_ratio"], of["feed_mm_per_min"]
    blocks, above, constant = of["blocks"]["length_mm"], of["above_straight_percent"], of["constant_force_mm_per_min"]
    wall = of["wall_error_um"]
    return [
        _row(
            1, "largest radial depth", "0.1 D to 0.3 D", f"{depth['max']:.3f} mm, {ratio:.3f} D",
            bool(abs(ratio - 0.3) < 0.05), f"{of['angle_deg']:.1f}° into the tool centre's arc",
        ),
        _row(
            1, "feeds by equation 7 with the mean resultant, mm/min", "91 to 216",
            f"{feed['min']:.1f} to {feed['max']:.0f}", bool(abs(feed["min"] - _PAPER_LEAST_FEED) < 0.5),
            f"with the peak resultant {of['equation7_by_peak_mm_per_min']:.1f}",
        ),
        _row(
            1, "length of its blocks", "0.5 to 0.6 mm", f"{blocks['min']:.2f} to {blocks['max']:.2f} mm",
            bool(blocks["min"] > 0.5 and blocks["max"] <= BLOCK_MM), f"{of['blocks']['number']} blocks",
        ),
        _row(
            1, "drop of the largest resultant", "about 50 % (measured)", f"{of['drop_percent']:.0f} %",
            bool(abs(of["drop_percent"] - _PAPER_DROP_PERCENT) < 5.0),
        ),
        _row(
            1, "equation 7 above the straight: mean, peak", "(none)",
            f"{above['mean']:.0f} %, {above['peak']:.0f} %", None,
            "one step only: the force does not fall as much as the feed",
        ),
        _row(
            1, "feed of truly constant force at the worst place: mean, peak", "(none)",
            f"{constant['mean']:.1f}, {constant['peak']:.1f} mm/min", None,
        ),
        _row(
            1, "largest error of the wall: programmed, equation 7, scheduled", "(none)",
            ", ".join(f"{wall[name]:.1f}" for name in ("programmed", "equation7", "scheduled")) + " µm", None,
            "of the cutting force on a tool whose overhang is assumed",
        ),
    ]  # fmt: skip


def _jump_rows(of: dict[str, Any]) -> list[dict[str, Any]]:
    """Cases 2 and 3, whose path has a vertex."""
    number, depth, feed = of["case"], of["radial_depth_mm"], of["feed_mm_per_min"]
    circle = of["full_circle_radial_depth_mm"] / _DIAMETER_MM
    reason = (
        f"{circle:.2f} D is where the tool meets the full circle of the rough corner, behind the end of its arc"
        if circle > of["radial_depth_ratio"] + 1e-6
        else "the paper gives one number for both cases"
    )
    return [
        _row(
            number, "jump of the radial depth", f"{_PAPER_JUMP:g} D", f"{of['radial_depth_ratio']:.2f} D", False,
            f"{_DIFFERS}: {depth['max']:.2f} mm before the vertex, {depth['behind']:.2f} mm behind it; {reason}",
        ),
        _row(
            number, "feeds by equation 7 with the mean resultant, mm/min", "(none)",
            f"{feed['min']:.1f} to {feed['max']:.0f}", None,
            f"leaves mean and peak {of['above_straight_percent']['mean']:.0f} and "
            f"{of['above_straight_percent']['peak']:.0f} % above the straight",
        ),
    ]  # fmt: skip


def _scheduled_rows(of: dict[str, Any]) -> list[dict[str, Any]]:
    """What the scheduler makes of the corner."""
    number, scheduled = of["case"], of["scheduled"]
    after, time = scheduled["resultant_force_n"]["after"], scheduled["cutting_time_s"]
    target = scheduled["target_n"]
    return [
        _row(
            number, "scheduled: largest peak resultant", "(none)",
            f"{after['max']:.2f} N, target {target:.2f} N", bool(after["max"] <= target),
            f"programmed: {scheduled['resultant_force_n']['before']['max']:.1f} N",
        ),
        _row(
            number, "scheduled: path within 5 % of the target", "(none)",
            f"{100.0 * scheduled['share_within_5_percent']:.1f} %", None,
            f"{scheduled['blocks']['after']} blocks, not shorter than {BLOCK_MM:g} mm",
        ),
        _row(
            number, "scheduled: time against the constant feed that keeps the target", "(none)",
            f"{time['scheduled']:.1f} s, {time['constant']:.1f} s: {-scheduled['gain_percent']:.0f} %",
            bool(scheduled["gain_percent"] >= 15.0),
            f"constant: {scheduled['constant_feed_mm_per_min']:.1f} mm/min",
        ),
    ]  # fmt: skip
