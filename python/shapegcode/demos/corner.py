"""Cornering cuts: three corners in closed form, the feeds of the paper's equation 7, and the scheduler on the same.

What the paper says (Kim and Ko, 2001; paper 001 in docs/evidence/references.md) is printed beside what comes from its
numbers; where the two differ, the difference stays.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from shapegcode.demos.corner_figures import DIAMETER_MM, PaperCorner, corner_figures
from shapegcode.demos.corner_program import BLOCK_MM, CASES, STRAIGHT_MM
from shapegcode.demos.corner_study import CornerStudy, study_corner
from shapegcode.demos.result import Demonstration, Statement, stated
from shapegcode.machine import Machine
from shapegcode.results.json import hidden
from shapegcode.results.table import Column, Table

__all__ = ["CornerDemo", "corner_demo"]

_PAPER_LEAST_FEED = 91.0
_PAPER_JUMP = 0.9  # of the diameter
_PAPER_DROP_PERCENT = 50.0


@dataclass(frozen=True, repr=False, eq=False, kw_only=True)
class CornerDemo(Demonstration):
    """Three corners, the feeds of equation 7, and what the scheduler makes of them.

    Attributes:
        machine: name of the machine that runs the scheduled programs.
        cases: figures of each corner.
        studies: everything about them, for the pictures.
    """

    machine: str
    cases: tuple[PaperCorner, ...]
    studies: tuple[CornerStudy, ...] = field(metadata=hidden())

    @property
    def ok(self) -> bool:
        """Whether the paper's statements agree, or why not is known; and the scheduler keeps its target and gains."""
        return super().ok and all(case.scheduled.ok for case in self.cases)

    @property
    def next_step(self) -> str:
        """The one thing to do next."""
        return "shapegcode feed YOUR.NC -m vx500 --tool T.toml --stock S.toml -o OUT.NC"

    def tables(self) -> list[Table]:
        """The scheduler on the corners; the paper's statements."""
        columns = (
            Column("case"),
            Column("target", "N", "scheduled.target_n", digits=2),
            Column("programmed", "N", "scheduled.resultant_force_n.original.max", digits=1),
            Column("equation 7", "N", "resultant_force_n.emitted.max", digits=1),
            Column("scheduled", "N", "scheduled.resultant_force_n.emitted.max", digits=2),
            Column("near", "%", lambda case: 100.0 * case.scheduled.share_within_5_percent, digits=1),
            Column("time", "s", "scheduled.cutting_time_s.scheduled", digits=1),
            Column("constant", "s", "scheduled.cutting_time_s.constant", digits=1),
            Column("gain", "%", "scheduled.gain_percent", digits=0),
        )
        caption = (
            "Largest peak resultant with each feed; share of the path within 5 % of the target; cutting time, and at "
            "the highest constant feed that keeps the target."
        )
        title = f"the scheduler, in blocks not shorter than {BLOCK_MM:g} mm, on {self.machine}"
        return [*super().tables(), Table(title, columns, self.cases, caption=caption)]


def corner_demo(on_progress: Callable[[float], None] = lambda _done: None) -> CornerDemo:
    """The three corners of the paper, and what the scheduler makes of them.

    Args:
        on_progress: called with the share that is done, 0 to 1.

    Returns:
        The paper's statements beside ours, and the figures of each corner.

    Source: Kim and Ko, 2001 (paper 001), table 1, equation 7 and figures 6, 9, 11 and 12.

    Returns:
        Each statement of the paper beside ours.
    """
    machine = Machine.load("vx500")
    studies: list[CornerStudy] = []
    for case in CASES:
        studies.append(study_corner(case, machine))
        on_progress(len(studies) / len(CASES))
    cases = tuple(map(corner_figures, studies))
    return CornerDemo(
        paper=CornerDemo.cited("001"),
        title="Cornering cut with an 8 mm end mill, 0.12 mm/rev, 15 mm deep, 0.8 mm wide",
        rows=(*_arc_statements(cases[0]), *(row for case in cases[1:] for row in _vertex_statements(case))),
        remark=(
            f"The wall is to the right (climb milling); k1 is taken in kgf/mm²; both are not stated. The schedule's "
            f"target is the peak resultant of the straight at the programmed feed, with {STRAIGHT_MM:g} mm of straight "
            f"before and behind the corner; its force is that of the feed which {machine.name} really runs, on the "
            "engagement in closed form, which the scheduler itself does not use. The paper's forces and surfaces are "
            "pictures without numbers; the tool's overhang is assumed."
        ),
        machine=machine.name,
        cases=cases,
        studies=tuple(studies),
    )


def _arc_statements(of: PaperCorner) -> list[Statement]:
    """Case 1, the one whose forces and feeds the paper computes."""
    depth, ratio, feed = of.radial_depth_mm, of.radial_depth_ratio, of.feed_mm_per_min
    blocks, above, constant = of.blocks.length_mm, of.above_straight_percent, of.constant_force_mm_per_min
    wall = of.wall_error_um
    return [
        stated(
            "case 1", "largest radial depth", "0.1 D to 0.3 D", f"{depth.max:.3f} mm, {ratio:.3f} D",
            abs(ratio - 0.3) < 0.05, f"{of.angle_deg:.1f}° into the tool centre's arc",
        ),
        stated(
            "case 1", "feeds by equation 7 with the mean resultant, mm/min", "91 to 216",
            f"{feed.min:.1f} to {feed.max:.0f}", abs(feed.min - _PAPER_LEAST_FEED) < 0.5,
            f"with the peak resultant {of.equation7_by_peak_mm_per_min:.1f}",
        ),
        stated(
            "case 1", "length of its blocks", "0.5 to 0.6 mm", f"{blocks.min:.2f} to {blocks.max:.2f} mm",
            blocks.min > 0.5 and blocks.max <= BLOCK_MM, f"{of.blocks.number} blocks",
        ),
        stated(
            "case 1", "drop of the largest resultant", "about 50 % (measured)", f"{of.drop_percent:.0f} %",
            abs(of.drop_percent - _PAPER_DROP_PERCENT) < 5.0,
        ),
        stated(
            "case 1", "equation 7 above the straight: mean, peak", "(none)",
            f"{above.mean:.0f} %, {above.peak:.0f} %", None,
            "one step only: the force does not fall as much as the feed",
        ),
        stated(
            "case 1", "feed of truly constant force at the worst place: mean, peak", "(none)",
            f"{constant.mean:.1f}, {constant.peak:.1f} mm/min", None,
        ),
        stated(
            "case 1", "largest error of the wall: programmed, equation 7, scheduled", "(none)",
            f"{wall.programmed:.1f}, {wall.equation7:.1f}, {wall.scheduled:.1f} µm", None,
            "of the cutting force on a tool whose overhang is assumed",
        ),
    ]  # fmt: skip


def _vertex_statements(of: PaperCorner) -> list[Statement]:
    """Cases 2 and 3, whose path has a vertex."""
    place, depth, feed = f"case {of.case}", of.radial_depth_mm, of.feed_mm_per_min
    circle = (of.full_circle_radial_depth_mm or 0.0) / DIAMETER_MM
    reason = (
        f"{circle:.2f} D is where the tool meets the full circle of the rough corner, behind the end of its arc"
        if circle > of.radial_depth_ratio + 1e-6
        else "the paper gives one number for both cases"
    )
    return [
        Statement(
            place, "jump of the radial depth", f"{_PAPER_JUMP:g} D", f"{of.radial_depth_ratio:.2f} D", "explained",
            note=f"{depth.max:.2f} mm before the vertex, {depth.behind:.2f} mm behind it; {reason}",
        ),
        stated(
            place, "feeds by equation 7 with the mean resultant, mm/min", "(none)",
            f"{feed.min:.1f} to {feed.max:.0f}", None,
            f"leaves mean and peak {of.above_straight_percent.mean:.0f} and "
            f"{of.above_straight_percent.peak:.0f} % above the straight",
        ),
    ]  # fmt: skip
