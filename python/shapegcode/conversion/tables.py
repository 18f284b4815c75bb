"""The tables of a conversion: original against emitted, and the sensitivity to unverified parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from shapegcode import _core
from shapegcode.conversion.sensitivity import Sensitivity
from shapegcode.program import Program
from shapegcode.results.json import OldNames
from shapegcode.results.result import Pair, Xyz
from shapegcode.results.table import NO_BREAK, Column, Table
from shapegcode.verdict.cases import unbroken
from shapegcode.verdict.figures import RegionVerdict

# Rounding in sums of increments stays far below this, a least increment far above.
# A percentage of less than this compares rounding with rounding.
_LEAST_COMPARED_UM = 1.0


def change_percent(original: float, emitted: float) -> float:
    """Change from original to emitted; the original is not zero."""
    return (emitted - original) / abs(original) * 100


def percent(change: float) -> str:
    """A change in words."""
    return "0 %" if abs(change) < 0.05 else f"{change:+.1f} %"


@dataclass(frozen=True)
class BeforeAfter:
    """One line of the table: a figure of both programs, or of the emitted one alone."""

    figure: str  # what it is
    unit: str  # its unit
    original: float | None  # figure of the original program; None where there is none
    emitted: float  # figure of the emitted program
    digits: int = 1  # behind the point
    limit: float | None = None  # what the emitted figure is judged by; None where it is not judged

    @property
    def change(self) -> str:
        """From original to emitted; empty without an original, and where it is too small to compare with."""
        least = _LEAST_COMPARED_UM if self.unit == "µm" else 0.5 * 10.0**-self.digits
        if self.original is None or abs(self.original) < least:
            return ""
        return percent(change_percent(self.original, self.emitted))

    def text(self, value: float | None) -> str:
        """One of its figures with its digits."""
        return "" if value is None else f"{float(value):z.{self.digits}f}"


_BEFORE_AFTER = (
    Column("figure", text=True),
    Column("unit", text=True),
    Column("original", value=lambda row: row.text(row.original)),
    Column("emitted", value=lambda row: row.text(row.emitted)),
    Column("change"),
    Column("limit", value=lambda row: row.text(row.limit)),
)


def before_after_table(groups: Sequence[Sequence[BeforeAfter]]) -> Table:
    """Original against emitted, in groups of figures."""
    filled = [group for group in groups if group]
    sections = [sum(len(group) for group in filled[:rank]) for rank in range(1, len(filled))]
    return Table("", _BEFORE_AFTER, [row for group in filled for row in group], sections=sections)


def sensitivity_table(rows: Sequence[Sensitivity], tried: int) -> Table:
    """The sensitivity to unverified parameters as a table."""
    columns = (
        Column("key", left=True),
        Column("assumed → tested", value=lambda row: unbroken(f"{row.value} {row.origin} → {row.moved}"), text=True),
        Column("figure, µm", value=_figure, text=True),
        Column("limit", value="limit_um", digits=1),
    )
    return Table(
        "sensitivity to unverified parameters: assumed values, changed one at a time",
        columns,
        rows,
        caption=f"{tried} values changed, one at a time, in the cut that comes nearest to a limit",
        row_style=lambda row: "red" if row.moved_um > row.limit_um else "",
    )


def _figure(row: Sensitivity) -> str:
    """A short name of the figure, and how far it moves."""
    name = row.figure.replace("residual vibration", "residual").replace("contour error", "contour")
    return f"{name.partition(' of ')[0]} " + f"{row.figure_um:.1f} → {row.moved_um:.1f}".replace(" ", NO_BREAK)


Lines = tuple[int, int]

_SHOWN = 12
_TOOL_CHANGE = 6


@dataclass(frozen=True)
class CutOutcome(OldNames):
    """One cut, shaped or left unchanged."""

    lines: Lines  # of the original, first and last
    emitted_lines: Lines  # of the emitted program
    tool: int | None  # T number that cuts; null: the program names none before it
    is_shaped: bool  # False: it was left unchanged
    reason: str  # why it was left unchanged; empty: it is shaped
    # what shaping gains: the larger fall of residual vibration and contour error; of a cut left unchanged what it would
    # gain, as far as that was tried
    gain_um: float
    residual_um: Pair[float]  # residual vibration of the worst axis
    contour_um: Pair[float]  # contour error of what the tolerance is about
    tolerance_um: float  # contour tolerance that it was shaped for; above the machine's where the price asks for it
    time_s: Pair[float]  # until the set-points rest
    bytes: Pair[int]  # of its text
    misses: tuple[str, ...]  # limits that it misses, in words
    # what would keep the limits that a cut left unchanged misses; empty: nothing is missed, or nothing known
    remedy: str = ""

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
        remedy="" if is_shaped or not cut.misses else _remedy(reason),
    )


def _remedy(reason: str) -> str:
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


def cut_table(cuts: Sequence[CutOutcome], *, every: bool) -> Table:
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
        Column("bytes", value=lambda cut: _change(cut.bytes, 0), priority=3),
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


def _change(pair: Pair[float] | Pair[int], digits: int = 1) -> str:
    before, after = (f"{each:z.{digits}f}" for each in (pair.original, pair.emitted))
    return before if before == after else f"{before} → {after}"


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
    for index, (first, to) in enumerate(spans):
        is_left = any(first <= end and begin <= to for begin, end in leave)
        is_chosen = any(first <= end and begin <= to for begin, end in only or ())
        if is_left and is_chosen:
            raise _core.ArgumentError(
                f"--only and --leave both name the cut in lines {first} to {to}: name it in one of them"
            )
        if is_left:
            found[index] = "named by --leave"
        elif only is not None and not is_chosen:
            found[index] = "not chosen by --only"
    return found


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


@dataclass(frozen=True)
class RapidMove:
    """A rapid that is a shaped cutting move now."""

    lines: tuple[int, int]  # of the original, first and last
    emitted_lines: tuple[int, int]  # of the emitted program
    time_s: Pair[float]  # until the set-points rest
    in_position_s: Pair[float]  # wait for in-position behind them
    settling_s: Pair[float]  # from the end of the set-points until the table stays within the band
    residual_vibration_um: Pair[Xyz[float]]  # largest |table - command| while the set-points rest
    residual_limit_um: Xyz[float]  # what the emitted one is judged by
    misses: tuple[str, ...]  # tolerances that it leaves; always empty: such a rapid is left unchanged


@dataclass(frozen=True)
class RapidsOutcome:
    """The rapids of a program: how many are shaped moves now, why the others stay, and what that saves."""

    found: int  # rapids in the program
    shaped: int  # of them, shaped moves now
    kept: Mapping[str, int]  # how many stay, by reason
    time_saved_s: float  # by which the table is ready for the next cuts sooner, in all
    settle_band_um: float  # half the width of the band in which vibration counts as having decayed
    blocks: int  # shaped blocks that replace them
    slowed_blocks: int  # of these, such as step an axis by more than the corner limit of the look-ahead
    moves: tuple[RapidMove, ...]  # those that are shaped
