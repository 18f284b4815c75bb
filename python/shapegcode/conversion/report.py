"""The verdict of a conversion: traces for the pictures, and the table of original against emitted.

The report itself is a plain dictionary, the JSON that ``--json`` writes. Its keys::

    cycle_time_s, cutting_time_s              {original, emitted}
    residual_vibration_um, peak_vibration_um  {original: {x, y, z}, emitted: {x, y, z}}
    contour_error_um                          {command | response: {original | emitted: {max, rms}}}
    orbit_error_percent                       one number per arc
    block_period_s, bytes_read, bytes_emitted numbers
    shaper                                    {times_s, amplitudes}
    blocks                                    {read, emitted}
    override_residual                         [{override, residual_um: {x, y, z}}]
    within_tolerance                          true or false
    frequency_residual                        [{shift, residual_um: {x, y, z}}]
    cases                                     [{name, counts, within, residual_um: {x, y, z}, ...}]
    worst_case                                the one of them that decides
    limits                                    {contour_um, ...}
    budget                                    {limits, before, after, block_period_s, given_up: [...]}
    regions                                   [{lines: [first, last], misses: [text]}], and more
    warnings                                  list of texts

``override`` is a ratio (0.9 = 90 %). A key that does not apply may be left out or be null; its row then is
left out too.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from rich.table import Table
    from rich.text import Text

__all__ = [
    "Row",
    "before_after_rows",
    "before_after_table",
    "next_step",
    "nothing_to_shape",
]

# Rounding in sums of increments stays far below this, a least increment far above.
# A percentage of less than this compares rounding with rounding.
_LEAST_COMPARED_UM = 1.0
CONTOURS = {"command": "contour error of the command", "response": "contour error of the table (response)"}

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Row:
    """One line of the table: a figure of both programs, or of the emitted one alone.

    Attributes:
        figure: what it is.
        unit: its unit.
        original: figure of the original program, None where there is none.
        emitted: figure of the emitted program, or several of them.
        decimals: digits after the point.
        section: True where a new group of figures begins.
        limit: what the emitted figure is judged by, None where it is not judged.
    """

    figure: str
    unit: str
    original: float | None
    emitted: float | tuple[float, ...]
    decimals: int = 1
    section: bool = False
    limit: float | None = None

    @property
    def change_percent(self) -> float | None:
        """Change from original to emitted; None without an original, and where it is too small to compare with."""
        least = _LEAST_COMPARED_UM if self.unit == "µm" else 0.5 * 10.0**-self.decimals
        if self.original is None or isinstance(self.emitted, tuple) or abs(self.original) < least:
            return None
        return (self.emitted - self.original) / abs(self.original) * 100


def _pair(value: object, *keys: str) -> tuple[float, float] | None:
    """Original and emitted of a figure; None where the report has not both."""
    if not isinstance(value, Mapping):
        return None
    found: list[float] = []
    for side in ("original", "emitted"):
        item: Any = value.get(side)
        for key in keys:
            item = item.get(key) if isinstance(item, Mapping) else None
        if item is None:
            return None
        found.append(float(item))
    return found[0], found[1]


def before_after_rows(report: Mapping[str, Any]) -> Iterator[Row]:
    """The figures of a report in the order in which they are read: time, vibration, contour, program."""
    for key, name in (("cycle_time_s", "cycle time"), ("cutting_time_s", "cutting time")):
        pair = _pair(report.get(key))
        if pair is not None:
            yield Row(name, "s", *pair, decimals=3)

    vibrations = (("residual_vibration_um", "residual vibration"), ("peak_vibration_um", "peak vibration"))
    for key, name in vibrations:
        section = True
        for axis in "xyz":
            pair = _pair(report.get(key), axis)
            if pair is not None and any(pair):
                limit = _residual_limit(report, axis) if key == "residual_vibration_um" else None
                yield Row(f"{name} {axis.upper()}", "µm", *pair, section=section, limit=limit)
                section = False

    section = True
    contour = report.get("contour_error_um") or {}
    for key, name in CONTOURS.items():
        for statistic, suffix in (("max", "largest"), ("rms", "RMS"), ("gouge", "gouge"), ("excess", "excess")):
            pair = _pair(contour.get(key), statistic)
            if pair is not None:
                limits = report.get("limits") or {}
                judged = (key, statistic) == (limits.get("contour_target", "command"), "max")
                limit = limits.get("contour_um") if judged else None
                yield Row(f"{name}, {suffix}", "µm", *pair, section=section, limit=limit)
                section = False

    orbit = report.get("orbit_error_percent") or []
    if orbit:
        name = "orbit error" if len(orbit) == 1 else f"largest orbit error of {len(orbit)} arcs"
        yield Row(name, "%", None, max(orbit, key=abs), decimals=4, section=True)

    yield from _program_rows(report)
    yield from _robustness_rows(report)


def _residual_limit(report: Mapping[str, Any], axis: str) -> float | None:
    """Limit of the region with the largest emitted residual, the one that the table shows."""
    regions = [each for each in report.get("regions") or [] if "residual_limit_um" in each]
    if not regions:
        return None
    worst = max(regions, key=lambda each: float(each["residual_vibration_um"]["emitted"][axis]))
    return float(worst["residual_limit_um"][axis])


def _program_rows(report: Mapping[str, Any]) -> Iterator[Row]:
    """Figures of the emitted program and its shaper."""
    rows: list[tuple[str, str, float | None, float, int]] = []
    blocks = report.get("blocks")
    if blocks:
        rows.append(("blocks", "", float(blocks["read"]), float(blocks["emitted"]), 0))
    if report.get("bytes_emitted") is not None:
        read = report.get("bytes_read")
        size = None if read is None else float(read)
        rows.append(("size of the program", "bytes", size, float(report["bytes_emitted"]), 0))
    if report.get("block_period_s") is not None:
        rows.append(("block period", "ms", None, report["block_period_s"] * 1e3, 3))
    budget = report.get("budget")
    if budget:
        rows.append(("regions given up for the budget", "", None, float(len(budget["given_up"])), 0))
    shaper = report.get("shaper") or {}
    times = shaper.get("times_s")
    if times:
        rows.append(("duration of the shaper", "ms", None, shaper.get("duration_s", times[-1]) * 1e3, 3))
    if shaper.get("per_axis_duration_s"):
        rows.append(("with one for each axis (--per-axis)", "ms", None, shaper["per_axis_duration_s"] * 1e3, 3))
    for number, (name, unit, original, emitted, decimals) in enumerate(rows):
        yield Row(name, unit, original, emitted, decimals, section=number == 0)


def _robustness_rows(report: Mapping[str, Any]) -> Iterator[Row]:
    """Residual vibration at other feed overrides and at other frequencies, one row per axis; the cases say more."""
    if report.get("cases"):
        return
    overrides = report.get("override_residual") or []
    shifts = report.get("frequency_residual") or []
    at = "/".join(f"{entry['override'] * 100:g}" for entry in overrides)
    shifted = "/".join("high" if entry["shift"] > 0 else "low" for entry in shifts)
    for entries, condition in ((overrides, f"at {at} % override"), (shifts, f"with the modes {shifted}")):
        section = True
        for axis in "xyz":
            values = tuple(float(entry["residual_um"].get(axis) or 0.0) for entry in entries)
            original = ((report.get("residual_vibration_um") or {}).get("original") or {}).get(axis)
            if entries and (any(values) or original):
                yield Row(f"residual {axis.upper()} {condition}", "µm", None, values, section=section)
                section = False


def _text(value: float | tuple[float, ...] | None, decimals: int) -> str:
    if value is None:
        return ""
    values = value if isinstance(value, tuple) else (value,)
    return "/".join(f"{each:.{decimals}f}" for each in values)


def _change(row: Row) -> str:
    change = row.change_percent
    if change is None:
        return ""
    return "0 %" if abs(change) < 0.05 else f"{change:+.1f} %"


def nothing_to_shape(report: Mapping[str, Any]) -> bool:
    """Whether the conversion left the program as it was."""
    blocks = report.get("blocks")
    return blocks is not None and blocks["emitted"] == 0


def before_after_table(report: Mapping[str, Any]) -> Table | Text:
    """The report as a rich table: figure, unit, original, emitted, change, limit; the verdict is its caption.

    One line of text where nothing was shaped.
    """
    from rich.table import Table
    from rich.text import Text

    if nothing_to_shape(report):
        given_up = (report.get("budget") or {}).get("given_up")
        return Text(f"nothing {'fits the budget' if given_up else 'to shape'}: the text is unchanged")
    rows = list(before_after_rows(report))
    limits = any(row.limit is not None for row in rows)
    table = Table(show_edge=False, pad_edge=False, caption_justify="left")
    table.add_column("figure")
    table.add_column("unit")
    for heading in ("original", "emitted", "change", *(["limit"] if limits else [])):
        table.add_column(heading, justify="right", no_wrap=True)
    for row in rows:
        if row.section:
            table.add_section()
        cells = [row.figure, row.unit, _text(row.original, row.decimals), _text(row.emitted, row.decimals)]
        cells += [_change(row), *([_text(row.limit, row.decimals)] if limits else [])]
        table.add_row(*(Text(cell) for cell in cells))
    if "within_tolerance" in report:
        good = bool(report["within_tolerance"])
        table.caption = Text(
            "within tolerance" if good else "OUT OF TOLERANCE", style="bold green" if good else "bold red"
        )
    return table


def next_step(report: Mapping[str, Any]) -> str:
    """The one thing to do next, in one sentence."""
    if nothing_to_shape(report):
        return "run the original program: nothing in it was shaped."
    if report.get("within_tolerance", True):
        if report.get("warnings"):
            return "settle the warnings, then run the emitted program above the workpiece, without a tool."
        return "run the emitted program above the workpiece, without a tool, at 100 % feed override."
    missed = next(iter(_misses(report)), "it misses its tolerance")
    return f"do not run it ({missed}): lower the feed there, and convert again."


def _misses(report: Mapping[str, Any]) -> Iterator[str]:
    """Every tolerance that a region misses, with the lines of the original program."""
    for region in report.get("regions") or []:
        first, last = region["lines"]
        for miss in region.get("misses") or []:
            yield f"lines {first} to {last}: {miss}"
