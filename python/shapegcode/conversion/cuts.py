"""Cut by cut: what shaping each one gains and costs, and why one was left unchanged; the choice of cuts by lines."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from shapegcode import _core
from shapegcode.program import Program
from shapegcode.results.result import Pair
from shapegcode.results.table import Column, Table
from shapegcode.verdict.figures import RegionVerdict

__all__ = ["CutOutcome", "chosen_cuts", "cut_table", "outcome_of", "tools_of_cuts"]

Lines = tuple[int, int]

_SHOWN = 12
_TOOL_CHANGE = 6


@dataclass(frozen=True)
class CutOutcome:
    """One cut, shaped or left unchanged.

    Attributes:
        lines: of the original, first and last.
        emitted_lines: of the emitted program.
        tool: T number that cuts; null: the program names none before it.
        is_shaped: False: it was left unchanged.
        reason: why it was left unchanged; empty: it is shaped.
        gain_um: what shaping gains: the larger fall of residual vibration and contour error; of a cut left unchanged
            what it would gain, as far as that was tried.
        residual_um: residual vibration of the worst axis.
        contour_um: contour error of what the tolerance is about.
        tolerance_um: contour tolerance that it was shaped for; above the machine's where the price asks for it.
        time_s: until the set-points rest.
        bytes: of its text.
        misses: limits that it misses, in words.
        cure: what would keep the limits that a cut left unchanged misses; empty: nothing is missed, or nothing known.
    """

    lines: Lines
    emitted_lines: Lines
    tool: int | None
    is_shaped: bool
    reason: str
    gain_um: float
    residual_um: Pair[float]
    contour_um: Pair[float]
    tolerance_um: float
    time_s: Pair[float]
    bytes: Pair[int]
    misses: tuple[str, ...]
    cure: str = ""

    @property
    def cutting_s(self) -> float:
        """How long it takes as programmed."""
        return self.time_s.original


def outcome_of(
    cut: RegionVerdict,
    *,
    is_shaped: bool,
    reason: str,
    gain_um: float,
    tolerance_um: float,
    tool: int | None,
    size: Pair[int],
) -> CutOutcome:
    """A row of the table."""
    residual = cut.residual_vibration_um
    return CutOutcome(
        lines=cut.lines,
        emitted_lines=cut.emitted_lines,
        tool=tool,
        is_shaped=is_shaped,
        reason=reason,
        gain_um=gain_um,
        residual_um=Pair(max(residual.original), max(residual.emitted)),
        contour_um=Pair(cut.original_contour_error_um, cut.contour_error_um),
        tolerance_um=tolerance_um,
        time_s=cut.time_s,
        bytes=size,
        misses=cut.misses,
        cure="" if is_shaped or not cut.misses else _cure(reason),
    )


def _cure(reason: str) -> str:
    """What the reason of a cut left unchanged suggests."""
    if "price." in reason:
        return "allow more time (--max-cut-time-increase, --max-time-increase) or a larger --contour-tolerance"
    if "--only" in reason or "--leave" in reason:
        return "choose it too"
    if "minimum_feed" in reason or "feed" in reason.partition(" ")[0]:
        return "a programmed feed within controller.minimum_feed_mm_per_min"
    if "max_program" in reason or "bytes" in reason or "baud" in reason:
        return "a larger size or rate limit for the program: the limits are in the reason"
    return "a lower programmed feed there, or --shape-all to see what shaping it does"


def cut_table(cuts: Sequence[CutOutcome], *, every: bool = False) -> Table:
    """The cuts: those first that miss a limit, then those with the largest gain."""
    ranked = sorted(cuts, key=lambda cut: (not cut.misses, -cut.gain_um))
    shown = list(cuts) if every else sorted(ranked[:_SHOWN], key=lambda cut: cut.lines)
    columns = (
        Column("lines", value=lambda cut: "{}-{}".format(*cut.lines), left=True),
        Column("tool", value=lambda cut: "" if cut.tool is None else f"T{cut.tool}"),
        Column("gain µm", value="gain_um", digits=1),
        Column("residual µm", value=lambda cut: _change(cut.residual_um)),
        Column("contour µm", value=lambda cut: _change(cut.contour_um)),
        Column("time s", value=lambda cut: _change(cut.time_s, 2), priority=2),
        Column("bytes", value=lambda cut: _sizes(cut.bytes), priority=3),
        Column("shaped, or why not", value=lambda cut: "shaped" if cut.is_shaped else cut.reason, text=True),
    )
    left = f"; {len(cuts) - len(shown)} more in --verbose, --html and --json" if len(shown) < len(cuts) else ""
    shaped = sum(cut.is_shaped for cut in cuts)
    return Table(
        "cut by cut: original → emitted",
        columns,
        shown,
        caption=f"{shaped} of {len(cuts)} cuts shaped{left}",
        row_style=lambda cut: "red" if cut.misses else "" if cut.is_shaped else "dim",
    )


def _change(pair: Pair[float], digits: int = 1) -> str:
    before, after = (f"{each:z.{digits}f}" for each in (pair.original, pair.emitted))
    return before if before == after else f"{before} → {after}"


def _sizes(pair: Pair[int]) -> str:
    return str(pair.original) if pair.original == pair.emitted else f"{pair.original} → {pair.emitted}"


def chosen_cuts(program: Program, only: Sequence[Lines] | None, leave: Sequence[Lines]) -> dict[int, str]:
    """Cuts that are not to be shaped because their lines were not chosen."""
    last = program.core.line_count
    spans = [(region.first_line, region.last_line) for region in program.regions]
    for option, ranges in (("--only", only or ()), ("--leave", leave)):
        for begin, end in ranges:
            if not 1 <= begin <= end <= last:
                raise _core.ArgumentError(f"{option} {begin}-{end}: {program.source} has lines 1 to {last}")
            if not any(first <= end and begin <= to for first, to in spans):
                near = ", ".join("{}-{}".format(*span) for span in spans[:4]) + (" ..." if len(spans) > 4 else "")
                raise _core.ArgumentError(
                    f"{option} {begin}-{end}: no cut that can be shaped there; cuts are in lines {near or 'none'}"
                )
    found = {}
    for span in spans:
        if (
            only is not None
            and any(_overlap(span, each) for each in leave)
            and any(_overlap(span, each) for each in only)
        ):
            raise _core.ArgumentError(
                f"--only and --leave both name the cut in lines {span[0]} to {span[1]}: name it in one of them"
            )
    for index, span in enumerate(spans):
        if any(_overlap(span, each) for each in leave):
            found[index] = "named by --leave"
        elif only is not None and not any(_overlap(span, each) for each in only):
            found[index] = "not chosen by --only"
    return found


def _overlap(one: Lines, other: Lines) -> bool:
    return one[0] <= other[1] and other[0] <= one[1]


def tools_of_cuts(program: Program) -> Mapping[int, int]:
    """T number in the spindle while each cut runs."""
    functions = program.core.functions
    changes = any(_TOOL_CHANGE in codes for codes, _, _ in functions)  # else T alone changes the tool
    found: dict[int, int] = {}
    ready = current = -1
    for kind, index, _ in program.core.steps:
        if kind == _core.StepKind.function:
            codes, tool, _ = functions[index]
            ready = tool if tool >= 0 else ready
            if _TOOL_CHANGE in codes or not changes:
                current = ready
        elif kind == _core.StepKind.region and current >= 0:
            found[index] = current
    return found
