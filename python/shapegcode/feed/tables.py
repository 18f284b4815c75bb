"""The tables of ``shapegcode feed``."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.table import Table

__all__ = ["feed_tables", "next_step", "verdict"]

_PEAKS = (
    ("peak_resultant_n", "resultant, peak", "N", 1),
    ("mean_resultant_n", "resultant, mean of a revolution", "N", 1),
    ("peak_deflection_um", "deflection of the tip, peak", "µm", 1),
    ("peak_torque_nm", "torque, peak", "N m", 3),
    ("mean_power_w", "power, mean of a revolution", "W", 1),
)
_SHOWN_RANGES = 24
_SHOWN_MISSES = 3
_LIMIT_WORDS = {
    "resultant": "resultant force",
    "chip_load": "feed per tooth",
    "programmed": "feed as programmed",
    "max_feed": "largest feed of tool or axes",
    "air": "nothing to cut",
    "minimum": "least feed",
    "kept": "left as it was",
}


def feed_tables(report: Mapping[str, Any]) -> Iterator[Table]:
    """Before and after, and what holds the feed of which lines (see docs/feed.md)."""
    from rich.table import Table

    table = Table(title=f"{report['program']} on {report['machine']}, tool {', '.join(report['tools']) or '-'}")
    table.add_column("largest along the program")
    for column in ("before", "after"):
        table.add_column(column, justify="right")
    table.add_column("unit")
    table.add_column("line", justify="right")
    for key, name, unit, digits in _PEAKS:
        pair = report["peak"][key]
        values = [f"{pair[when]:.{digits}f}" for when in ("before", "after")]
        table.add_row(name, *values, unit, pair["place"].rpartition(":")[2])
    resultant = report["resultant_force_n"]
    table.add_row(
        "resultant, mean of the time in material", *(f"{resultant[when]['mean']:.1f}" for when in ("before", "after")),
        "N", end_section=True,
    )  # fmt: skip
    for key, name, unit, digits in (
        ("cycle_time_s", "cycle time", "s", 2),
        ("air_time_s", "of it cutting moves in air", "s", 2),
        ("blocks", "cutting blocks", "", 0),
    ):
        table.add_row(name, *(f"{report[key][when]:.{digits}f}" for when in ("before", "after")), unit)
    yield table
    yield _limit_table(report)


def _limit_table(report: Mapping[str, Any]) -> Table:
    """What holds the feed: the ranges of lines with the lowest feeds."""
    from rich.table import Table

    ranges = sorted(report["limits"], key=lambda entry: float(entry["feed_mm_per_min"]["min"]))
    shown = sorted(ranges[:_SHOWN_RANGES], key=lambda entry: int(entry["lines"][0]))
    title = "what holds the feed"
    if len(ranges) > len(shown):
        title += f" (the {len(shown)} slowest of {len(ranges)} ranges; --json has all)"
    table = Table(title=title)
    table.add_column("lines")
    table.add_column("feed mm/min", justify="right")
    table.add_column("held by")
    for entry in shown:
        first, last = entry["lines"]
        feed = entry["feed_mm_per_min"]
        feeds = f"{feed['min']:g}" if feed["min"] == feed["max"] else f"{feed['min']:g} to {feed['max']:g}"
        table.add_row(
            f"{first}" if first == last else f"{first} to {last}",
            feeds,
            _LIMIT_WORDS.get(entry["limit"], entry["limit"]),
        )
    return table


def verdict(report: Mapping[str, Any]) -> str:
    """Whether every limit is kept, and where not."""
    misses = [miss for entry in (*report["regions"], *report["moves"]) for miss in entry["misses"]]
    if not misses:
        return "every limit is kept"
    more = f"; and {len(misses) - _SHOWN_MISSES} more" if len(misses) > _SHOWN_MISSES else ""
    return f"NOT within limits: {'; '.join(misses[:_SHOWN_MISSES])}{more}"


def next_step(report: Mapping[str, Any]) -> str:
    """The one thing to do now."""
    if report["within_limits"]:
        return "shapegcode convert shapes this program too; or both in one go: convert --feed-schedule"
    if any("not known" in miss for entry in (*report["regions"], *report["moves"]) for miss in entry["misses"]):
        return "say what is not known: S in the program or feed.spindle_rev_per_min in the tool file"
    return "take less material at once there, lower the feed of what stays as it was, or choose another limit"
