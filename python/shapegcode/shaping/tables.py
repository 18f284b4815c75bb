"""The answer of ``shapegcode shaper`` as tables, and as one next step."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from shapegcode.shaping.choose import Recommendation, Refusal
from shapegcode.shaping.design import Design
from shapegcode.shaping.ranking import NO_RESIDUAL
from shapegcode.shaping.registry import FAMILIES

if TYPE_CHECKING:
    from rich.table import Table

__all__ = [
    "designs_table",
    "families_table",
    "next_step",
    "radial_error_um",
    "refusals_table",
    "shown",
    "times_name",
    "verdict",
]

_MARK, _GRID_MARK = "=>", "->"
_PARETO_OF_A_FAMILY = 3  # rows, beside the preferred one


def radial_error_um(design: Design, speed_mm_per_s: float, radius_mm: float) -> float:
    """By how much a circle comes out too small, µm: variance*v²/(2R)."""
    return design.variance_s2 * speed_mm_per_s**2 / (2.0 * radius_mm) * 1e3


def times_name(period_s: float | None) -> str:
    """Kind of times in words."""
    return "continuous" if period_s is None else f"{period_s * 1e3:.4g} ms grid"


def shown(result: Recommendation, *, everything: bool = False) -> list[int]:
    """Indices of the designs for a table, shortest first.

    What is recommended, at all and for each grid; of each family at continuous times the preferred design and the
    shortest ones of the Pareto front, and on grids the shortest one of all.
    """
    if everything:
        return sorted(range(len(result.designs)), key=lambda index: (result.designs[index].duration_s, index))
    kept = {result.index, *result.best_by_period.values()}
    families: dict[tuple[str, bool], list[int]] = {}
    for index, each in enumerate(result.designs):
        families.setdefault((each.family, each.period_s is None), []).append(index)

    def length(index: int) -> tuple[float, float]:
        # Of equally long ones the longest period: it writes the fewest blocks.
        return round(result.designs[index].duration_s, 9), -(result.designs[index].period_s or 0.0)

    for (_, continuous), members in families.items():
        by_duration = sorted(members, key=length)
        front = [index for index in by_duration if result.pareto[index]]
        kept |= {members[0], *front[:_PARETO_OF_A_FAMILY]} if continuous else set(by_duration[:1])
    return sorted(kept, key=lambda index: (result.designs[index].duration_s, index))


def designs_table(
    result: Recommendation, speed_mm_per_s: float, radius_mm: float, *, everything: bool = False
) -> Table:
    """One row per design that is shown, with what it costs and what it leaves."""
    from rich.table import Table
    from rich.text import Text

    rows = shown(result, everything=everything)
    left_out = len(result.designs) - len(rows)
    meaning = f"µm: by how much an arc R{radius_mm:g} comes out too small at {speed_mm_per_s:g} mm/s"
    table = Table(
        title=f"shapers for {', '.join(map(str, result.bands))}",
        caption=meaning + (f"; {left_out} more designs: --all shows them" if left_out else ""),
        show_edge=False,
        pad_edge=False,
    )
    table.add_column("", no_wrap=True)
    table.add_column("family", no_wrap=True)
    table.add_column("times", no_wrap=True)
    for heading in ("lasts ms", "worst %", "nominal %", "σ² ms²", "µm", "Σ|a|", "taps < 0"):
        table.add_column(heading, justify="right")
    table.add_column("Pareto")
    for index in rows:
        each = result.designs[index]
        table.add_row(
            _mark(result, index),
            Text(each.family),
            times_name(each.period_s),
            f"{each.duration_s * 1e3:.2f}",
            _percent(each.worst_residual),
            _percent(each.residual),
            f"{each.variance_s2 * 1e6:.4g}",
            f"{radial_error_um(each, speed_mm_per_s, radius_mm):.4g}",
            f"{each.abs_sum:.3g}",
            str(int((each.shaper.amplitudes < 0.0).sum()) or ""),
            "yes" if result.pareto[index] else "",
            style="bold" if index == result.index else None,
        )
    return table


def refusals_table(refusals: Sequence[Refusal]) -> Table:
    """The families without a design on some kind of times, and why; the same reason on several is one row."""
    from rich.table import Table
    from rich.text import Text

    table = Table(title="no design", show_edge=False, pad_edge=False)
    table.add_column("family", no_wrap=True)
    table.add_column("times", overflow="fold", max_width=24)
    table.add_column("why", overflow="fold")
    times: dict[tuple[str, str], list[float | None]] = {}
    for refusal in refusals:
        times.setdefault((refusal.family, refusal.reason), []).append(refusal.period_s)
    for (family, reason), periods_s in times.items():
        table.add_row(Text(family), ", ".join(map(times_name, periods_s)), Text(reason))
    return table


def verdict(result: Recommendation) -> list[str]:
    """What to take and why, a line each for the recommendation and for what can be written as blocks."""
    taken = result.design
    word = "recommended" if result.within_limit else "the best there is"
    lines = [f"{_MARK} {word}: {taken.family}, {_spoken(taken)}: {result.reason}"]
    if result.grid_index is not None and result.grid_index != result.index:
        other = result.designs[result.grid_index]
        left = f"{_percent(other.worst_residual)} % left at worst"
        lines.append(f"{_GRID_MARK} for the blocks of a program: {other.family}, {_spoken(other)} ({left})")
    if len(result.best_by_period) > 1:
        best = (result.designs[index] for index in result.best_by_period.values())
        compared = ", ".join(
            f"{times_name(each.period_s)}: {each.family} {each.duration_s * 1e3:.4g} ms" for each in best
        )
        lines.append(f"best of each grid: {compared}")
    return lines


def families_table() -> Table:
    """Every family of the registry: what it is, where it comes from, where it is valid."""
    from rich.table import Table
    from rich.text import Text

    table = Table(title="families of shapers", show_edge=False, pad_edge=False, show_lines=True)
    table.add_column("family", no_wrap=True)
    for heading in ("what", "times", "valid for", "source"):
        table.add_column(heading, overflow="fold")
    for row in FAMILIES:
        kinds = [name for name, has in (("continuous", row.continuous), ("grid", row.on_grid)) if has]
        table.add_row(*(Text(cell) for cell in (row.name, row.title, ", ".join(kinds), row.validity, row.source)))
    return table


def next_step(result: Recommendation, machine: str | None) -> str:
    """The one thing to do next; `machine` is the machine file as it was named, None without one."""
    if not result.within_limit:
        return (
            "measure the frequencies more closely (a narrower band), or allow more: --max-duration, --vibration-limit, "
            "--negative"
        )
    place = result.grid_index
    if place is None:
        return "blocks of a program need taps on a grid: compare some with --period 5ms, or name the machine with -m"
    best = result.designs[place]
    options = f"--shaper {best.family} --block-period {(best.period_s or 0.0) * 1e3:.6g}ms -o shaped.nc"
    if best.family == "taps":
        return "taps of your own cannot be written by convert: take a family, or use the Python interface"
    if machine is None:
        return (
            f"put the modes into a machine file (shapegcode machine init -o mine.toml), then "
            f"shapegcode convert part.nc -m mine.toml {options}"
        )
    return f"shapegcode convert part.nc -m {machine} {options}"


def _mark(result: Recommendation, index: int) -> str:
    if index == result.index:
        return _MARK
    return _GRID_MARK if index == result.grid_index else ""


def _spoken(each: Design) -> str:
    return f"{each.duration_s * 1e3:.4g} ms, {times_name(each.period_s).replace('continuous', 'continuous times')}"


def _percent(ratio: float) -> str:
    return "0" if ratio < NO_RESIDUAL else f"{100.0 * ratio:.3g}"
