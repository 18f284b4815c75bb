"""Test cuts and their results as tables and lines of text."""

from __future__ import annotations

from typing import TYPE_CHECKING

from shapegcode.testcut.corner import CornerResult, IntervalResult
from shapegcode.testcut.taper import TaperResult

if TYPE_CHECKING:
    from rich.table import Table

    from shapegcode.testcut.plan import TestCut

__all__ = [
    "Result",
    "cut_table",
    "cutting_toml",
    "design_notes",
    "is_good",
    "next_step",
    "result_lines",
    "result_table",
]

Result = TaperResult | CornerResult | IntervalResult


def _table(title: str, *headings: str) -> Table:
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    table = Table(title=title, title_justify="left", box=SIMPLE_HEAD, pad_edge=False)
    for place, heading in enumerate(headings):
        table.add_column(heading, justify="right" if place else "left")
    return table


def cut_table(cut: TestCut) -> Table:
    """The passes of a test cut."""
    table = _table(f"{cut.kind} for {cut.machine}", "pass", "what", "radial depth mm", "feed mm/min", "blocks", "s")
    for number, each in enumerate(cut.passes, start=1):
        begin, seconds = each.start_mm, 0.0
        for end, feed in each.feeds:
            seconds += (end - begin) / feed * 60.0
            begin = end
        feeds = [feed for _, feed in each.feeds]
        low, high = min(each.edge_height_mm), max(each.edge_height_mm)
        depth = f"{low:.2f}" if high - low < 5e-3 else f"{low:.2f} ... {high:.2f}"
        shown = f"{min(feeds):g}" if each.constant_feed else f"{min(feeds):g} ... {max(feeds):g}"
        table.add_row(str(number), each.name.lower(), depth, shown, str(len(feeds)), f"{seconds:.1f}")
    return table


def design_notes(cut: TestCut) -> list[str]:
    """What is not as the user might think."""
    deeper = cut.about.get("deeper_than_corner")
    if deeper is None:
        return []
    return [
        f"X {deeper['from_mm']:.2f} to {deeper['to_mm']:.2f} mm: the passes meet up to {deeper['most_mm']:.3f} mm more "
        "than the corner: there its edge is hollow more sharply than the tool is round; the side file has what is met"
    ]


def result_table(result: Result) -> Table:
    """The result in figures."""
    if isinstance(result, TaperResult):
        table = _table("coefficients of the cutting force", "key", "value", "95 % interval", "unit")
        for found in result.fit.coefficients:
            table.add_row(found.name, f"{found.value:.4g}", f"{found.low:.4g} ... {found.high:.4g}", found.unit)
        for name, found in zip(("k1", "k2"), result.fit.at_chip, strict=True):
            chip = f"{name} at a chip of {1e3 * result.fit.middle_chip_mm:.2f} um"
            table.add_row(chip, f"{found.value:.4g}", f"{found.low:.4g} ... {found.high:.4g}", found.unit)
        return table
    if isinstance(result, CornerResult):
        table = _table(
            "largest resultant, N", "pass", "measured mean", "expected mean", "measured peak", "expected peak"
        )
        for row in result.peaks():
            cells = ("measured_mean_n", "expected_mean_n", "measured_peak_n", "expected_peak_n")
            table.add_row(str(row["pass"]), *(f"{row[name]:.1f}" for name in cells))
        return table
    table = _table(
        "how the feed is followed", "interval mm", "largest deviation", "at X mm", "noise", "lag ms", "follows"
    )
    for each in result.passes:
        table.add_row(
            f"{each.interval_mm:g}",
            f"{100 * each.deviation:.0f} %",
            f"{each.at_mm:.2f}",
            f"{100 * each.noise:.1f} %",
            f"{1e3 * each.lag_s:.0f}",
            "yes" if each.follows else "no",
        )
    return table


def result_lines(result: Result) -> list[str]:
    """Verdict and remarks."""
    report = result.report()
    lines = [f"note: {note}" for note in report["notes"]]
    if isinstance(result, TaperResult):
        chip = result.fit.chip_mm
        lines.insert(
            0,
            f"{len(chip)} mean forces, chips {1e3 * chip.min():.2f} to {1e3 * chip.max():.2f} um thick on average; the "
            f"law leaves {result.fit.rms_percent:.1f} % of the force",
        )
        return lines + [f"poor: {text}" for text in result.poor]
    if isinstance(result, CornerResult):
        scale = f"the measured resultant is {result.scale:.2f} times the expected one where the feed is constant"
        ratio = result.ratio
        if ratio is None:
            return [scale, *lines]
        said = f"largest mean resultant after over before: measured {ratio['measured']:.2f}"
        return [scale, f"{said}, expected {ratio['expected']:.2f}", *lines]
    if result.interval_mm is None:
        text = (
            "no measured interval is followed; 90 % of a step need about "
            f"{result.lag_interval_mm:.2f} mm at the largest feed"
        )
    else:
        text = (
            f"the controller follows from {result.interval_mm:g} mm on: feed_control.interval_mm = {result.interval_mm}"
        )
    return [text, *lines]


def is_good(result: Result) -> bool:
    """Whether there is nothing to complain about."""
    if isinstance(result, TaperResult):
        return not result.poor
    return result.as_expected if isinstance(result, CornerResult) else result.interval_mm is not None


def next_step(result: Result) -> str:
    """One next step."""
    if isinstance(result, TaperResult):
        return (
            "more passes, with other feeds or a longer stock"
            if result.poor
            else "put [cutting] into the tool file (-o FILE writes it)"
        )
    if isinstance(result, CornerResult):
        return (
            "shapegcode testcut taper measures the coefficients"
            if abs(result.scale - 1.0) > 0.1
            else ("shapegcode testcut interval shows how often the feed may change")
        )
    if result.interval_mm is None:
        return "shapegcode testcut interval --intervals with longer ones"
    return f"set feed_control.interval_mm = {result.interval_mm} in the machine file"


def cutting_toml(result: TaperResult) -> str:
    """The table ``[cutting]`` for a tool file, with the intervals as comments."""
    cut, fit = result.cut, result.fit
    lines = [
        "[cutting]",
        f"# measured: taper {cut.program} on {cut.machine}, D{cut.tool.diameter_mm:g} with {cut.tool.flutes} flutes, "
        f"{cut.spindle_rev_per_min:g} rev/min",
        f"# holds for chips {fit.chip_mm.min():.4f} to {fit.chip_mm.max():.4f} mm thick on average",
    ]
    for each in fit.coefficients:
        unit = f" {each.unit}" if each.unit else ""
        lines.append(f"{each.name} = {each.value:.6g}  # 95 %: {each.low:.5g} to {each.high:.5g}{unit}")
    return "\n".join([*lines, f'chip_thickness = "{fit.thickness}"']) + "\n"
