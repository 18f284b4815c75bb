"""Content of the page of a result, as data; `html` converts it to one file.

The module `page` in a result's folder, if any, makes the sections of its page. Numbers are from the JSON or the scene.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from html import escape
from importlib import resources
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from shapegcode.results.json import Provenance, plain, this_version
from shapegcode.results.outcome import NotKeptError, Outcome, Pair, Plot
from shapegcode.results.table import Column, Table

if TYPE_CHECKING:
    from shapegcode.results.page.scene import Scene

Script = Literal["inline", "beside"]  # Plotly's script of a page: in its file, or in a file of the same folder

Light = Literal["green", "calm", "amber", "red"]
"""Green: run it; calm: nothing to do; amber: do something first; red: do not run it."""


@dataclass(frozen=True)
class Figure:
    """A figure before and after, with its limit."""

    name: str  # its name
    unit: str  # unit of the numbers shown
    before: float | None  # figure of the original; None: none
    after: float  # figure of the result, or the only one
    digits: int = 1  # decimals
    limit: float | None = None  # limit of `after`; None: no limit
    key_before: str = ""  # its position in the JSON: names and indices joined by dots; empty: none
    key_after: str = ""
    factor: float = 1.0  # ratio of the number shown to the one in the JSON


@dataclass(frozen=True)
class Figures:
    """The few main figures, shown as cards."""

    rows: tuple[Figure, ...]


@dataclass(frozen=True)
class HeatRow:
    """A line of a heat map."""

    name: str  # heading of the line
    values: tuple[float | None, ...]  # by column; None: not measured
    shares: tuple[float | None, ...]  # ratios to a limit, for the colours: up to 1 is within; None: no colour
    remark: str = ""  # text at its end
    counts: bool = True  # it counts in the verdict; False: it is only shown
    keys: tuple[str, ...] = ()  # position of each value in the JSON, as in `Figure`; empty: none


@dataclass(frozen=True)
class HeatMap:
    """Numbers in rows and columns, coloured by their ratio to a limit."""

    columns: tuple[str, ...]  # headings, with units
    rows: tuple[HeatRow, ...]  # from top to bottom
    digits: int = 2  # decimals
    caption: str = ""  # text below the map
    factors: tuple[float, ...] = ()  # by column, ratio of the numbers shown to those in the JSON; empty: 1


@dataclass(frozen=True)
class Bars:
    """Parts of a whole as bars, such as time components."""

    unit: str  # unit of the values
    rows: tuple[tuple[str, tuple[float, ...]], ...]  # name and values, one value for each label
    labels: tuple[str, ...] = ("",)  # names of the values of a row, for example "original" and "emitted"
    digits: int = 1  # decimals
    # position of each value in the JSON by row, as in `Figure`; empty: none
    keys: tuple[tuple[str, ...], ...] = ()


@dataclass(frozen=True)
class Notes:
    """Topics with a sentence each, such as an operator's run sheet; `strong` ones are highlighted."""

    rows: tuple[tuple[str, str], ...]
    strong: frozenset[str] = frozenset()


@dataclass(frozen=True)
class NextStep:
    """One step."""

    text: str  # the sentence
    command: str = ""  # command to type; empty: none


@dataclass(frozen=True)
class NextSteps:
    """Steps in their order."""

    rows: tuple[NextStep, ...]


@dataclass(frozen=True)
class Picture:
    """A matplotlib picture, as SVG."""

    name: str  # name of the picture, as in the file of --plots
    plot: Plot  # draws it
    how: str  # one line: how to read it


@dataclass(frozen=True)
class Text:
    """Paragraphs; `warning` ones are highlighted."""

    paragraphs: tuple[str, ...]
    warning: bool = False


@dataclass(frozen=True)
class CutRow:
    """A cut that may be shaped or left unchanged."""

    lines: tuple[int, int]  # first and last line of the original program
    tool: str  # tool, for example "T3"; empty: unknown
    gain_um: float | None  # gain of shaping; None: not tried
    residual_um: Pair[float | None]  # maximum residual vibration, original and shaped; None: not simulated
    contour_um: Pair[float | None]  # maximum contour error, likewise
    time_s: Pair[float | None]  # until the set-points rest, likewise
    bytes: Pair[int | None]  # size of its program text, likewise
    outcome: str  # "shaped", or why not
    is_shaped: bool  # it is shaped in the emitted program; only such rows are printed
    selected: bool  # ticked when the page opens
    can_be_shaped: bool = True  # False: it has no check box


@dataclass(frozen=True)
class CutTotals:
    """Initial values and limits of the totals over the ticked cuts."""

    time_s: float  # cycle time of the original program
    bytes: int  # size of the original program
    residual_limit_um: float | None = None  # limit of the maximum residual vibration; None: no limit
    contour_limit_um: float | None = None  # limit of the maximum contour error; None: no limit


@dataclass(frozen=True)
class CutPicker:
    """A table of cuts to sort and to select; cost and gain of the selected ones, and the command that shapes only
    them."""

    rows: tuple[CutRow, ...]  # rows of the table, in program order
    command: str  # to type; `{lines}` is replaced by the lines of the ticked cuts, such as `12-80,95-240`
    totals: CutTotals  # totals of the original program


Part = Figures | HeatMap | Bars | Notes | NextSteps | Picture | Text | Table | CutPicker


@dataclass(frozen=True)
class Section:
    """A part of the page with a heading."""

    key: str  # its anchor: lower-case letters and hyphens, unique on the page
    title: str  # heading
    parts: tuple[Part, ...]  # below it, in order
    how: str = ""  # explanation, one line below the heading
    printed: bool = True  # printed on paper, too
    sheet: bool = False  # a separate page on paper, such as the run sheet
    folded: bool = False  # closed until it is opened


@dataclass(frozen=True)
class Page:
    """A result as a page."""

    title: str  # kind of result and program
    light: Light  # traffic light
    verdict: str  # the answer in one sentence
    reason: str  # why the light has this colour
    sections: tuple[Section, ...]  # from top to bottom; the scene comes after the first `before_scene` of them
    report: Mapping[str, Any]  # the JSON of the result, with `provenance` if its files are known
    scene: Scene | None = None  # the motion; None: none
    before_scene: int = 1  # number of sections above the scene
    # problems of the page itself, such as a program that was changed since
    problems: Sequence[str] = field(default=())


_WORD = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])")
_NO_WORD = re.compile(r"^-|[A-Z0-9./=]")
_UNFOLDED_ROWS = 24
_SHORT_ROWS = 12
_SHORT_TEXT = 120
_UNKNOWN = "Labels and units are at the axes."
_PRINTED_PICTURES = 2  # so that the page stays within four sheets


def title_of(result: Outcome) -> str:
    """Title of a page: kind of result, program and machine."""
    words = " ".join(word.lower() for word in _WORD.findall(type(result).__name__))
    name = getattr(result, "program", None)
    machine = getattr(result, "machine", None)
    of = f" of {Path(name).name}" if isinstance(name, str) and name else ""
    on = f" on {machine}" if isinstance(machine, str) and machine else ""
    return words[:1].upper() + words[1:] + of + on


def sections_of(result: Outcome, figures: Sequence[Figure] = ()) -> tuple[Section, ...]:
    """Key figures, warnings, next step, tables and pictures of any result."""
    glance = [Section("gain", "At a glance", (Figures(tuple(figures)),))] if figures else []
    first = (*glance, *warnings_of(result), next_steps(result))
    try:
        tables = result.tables()
    except NotKeptError:
        return (*first, _json(result.to_dict()))
    return (*first, *_tables(tables), *pictures_of(result))


def warnings_of(result: Outcome) -> Iterator[Section]:
    """The warnings, if there are any."""
    if result.warnings:
        yield Section("warnings", "Warnings", (Text(tuple(result.warnings), warning=True),))


def next_steps(result: Outcome, *further: NextStep) -> Section:
    """The section of the next steps."""
    text = result.next_step
    is_command = text.startswith("shapegcode ")
    sentence = text if is_command else text[:1].upper() + text[1:]
    command = text if _is_typed(text) else next(iter(re.findall(r"`(shapegcode [^`]+)`", text)), "")
    sentence = "Then:" if command == text else sentence
    return Section("next", "What to do next", (NextSteps((NextStep(sentence, command), *further)),))


def _is_typed(text: str) -> bool:
    """True if the text is a complete command line: command, options with their values, and files."""
    program, _, *words = text.split(" ") if " " in text else (text, "")
    is_typed = all(before.startswith("-") or _NO_WORD.search(word) for before, word in pairwise(("", *words)))
    return program == "shapegcode" and bool(words) and is_typed


def _tables(tables: Sequence[Table]) -> Iterator[Section]:
    """Sections of tables: short ones together, each long one separate and folded."""
    short: tuple[Part, ...] = tuple(table for table in tables if len(table.rows) <= _UNFOLDED_ROWS)
    if short:
        yield Section("figures", "Figures", short)
    for rank, table in enumerate(table for table in tables if len(table.rows) > _UNFOLDED_ROWS):
        title = table.title or f"{len(table.rows)} rows"
        key = "table" if rank == 0 else f"table-{rank + 1}"
        yield Section(key, title[:1].upper() + title[1:], (table,), printed=False, folded=True)


@cache
def _captions() -> dict[str, str]:
    """Explanations of the pictures, by the names in `plots()`."""
    text = (resources.files("shapegcode") / "data" / "page" / "captions.txt").read_text(encoding="utf-8")
    return dict(line.split(": ", 1) for line in text.splitlines())


def pictures_of(result: Outcome, printed: Sequence[str] = ()) -> Iterator[Section]:
    """The pictures, each with an explanation."""
    how = _captions()
    pictures = [Picture(name, plot, how.get(name, _UNKNOWN)) for name, plot in result.plots().items()]
    chosen = [each for each in pictures if each.name in printed] or pictures[:_PRINTED_PICTURES]
    if chosen:
        yield Section("pictures", "Pictures", tuple(chosen))
    if others := tuple(each for each in pictures if each not in chosen):
        yield Section("more-pictures", "More pictures", others, printed=False)
    if result.is_read_back:
        left_out = "Pictures that need the samples of the run are missing: the JSON does not contain them."
        yield Section("no-pictures", "Missing pictures", (Text((left_out,)),), printed=False)


def provenance_section(provenance: Provenance) -> Section:
    """Command, version and files with their hashes."""
    rows = [("by", provenance.by), *([("command", provenance.command)] if provenance.command else [])]
    for file in provenance.files:
        rows.append((file.role, f"{file.name}, {file.size_bytes} bytes, SHA-256 {file.sha256 or 'not known'}"))
    how = "Any changed byte changes the hash of a file: compare it before you rely on this page."
    return Section(
        "provenance", "Command, version and files", (Notes(tuple(rows)),), how=how, folded=True, printed=False
    )


def page_of(
    result: Outcome, light: tuple[Light, str], sections: tuple[Section, ...], scene: Scene | None,
    provenance: Provenance | None, problems: Sequence[str],
) -> Page:  # fmt: skip
    """The page of a result."""
    report: dict[str, Any] = result.to_json()
    if provenance is not None:
        report["provenance"] = plain(provenance)
        sections = (*sections, provenance_section(provenance))
        scene = _named(scene, provenance)
    above = next((rank + 1 for rank, section in enumerate(sections) if section.key == "next"), 0)
    said = title_of(result), light[0], result.answer, light[1]
    return Page(*said, sections, report, scene, above, tuple(problems))


def _named(scene: Scene | None, provenance: Provenance) -> Scene | None:
    """Add the name of the output file, which was unknown when the scene was made."""
    output = provenance.file("output")
    if scene is None or output is None or len(scene.variants) < 2:
        return scene
    *others, last = scene.variants
    return replace(scene, variants=(*others, replace(last, file=output.name)))


def raw_page(report: Mapping[str, Any], why: str) -> Page:
    """The page of a result that cannot be read back: its unchanged JSON."""
    provenance = report.get("provenance", report.get("made"))
    by = provenance.get("by", "another version") if isinstance(provenance, dict) else "another version"
    return Page(
        title="JSON of a result",
        light="amber",
        verdict=f"This result was written by {by}, and {this_version()} cannot read it back from its JSON.",
        reason="it is shown unchanged; run the command again for a page",
        sections=(_json(report),),
        report=report,
        problems=(why,),
    )


def _json(report: Mapping[str, Any]) -> Section:
    """The JSON itself, if no page can be made from it."""
    texts = {key: json.dumps(value, ensure_ascii=False) for key, value in report.items()}
    rows = [(key, text if len(text) <= _SHORT_TEXT else f"{text[: _SHORT_TEXT - 1]}…") for key, text in texts.items()]
    columns = (Column("key", value=lambda row: row[0], left=True), Column("value", value=lambda row: row[1], text=True))
    return Section("json", "The JSON", (Table("", columns, rows),), how="Key by key; long values are cut.")


def short_html(result: Outcome) -> str:
    """Answer, warnings, the first rows of each table, and next step, for a notebook."""
    parts = [f"<p><b>{escape(result.answer)}</b></p>"]
    parts += [f"<p>warning: {escape(warning)}</p>" for warning in result.warnings]
    for table in result.tables():
        heads, *rows = table.cells()
        title = f"<caption>{escape(table.title)}</caption>" if table.title else ""
        head = "".join(f"<th>{escape(cell)}</th>" for cell in heads)
        body = "".join(
            "<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows[:_SHORT_ROWS]
        )
        more = f"<p>and {len(rows) - _SHORT_ROWS} more rows</p>" if len(rows) > _SHORT_ROWS else ""
        parts.append(f"<table>{title}<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>{more}")
    return "".join([*parts, f"<p>next: {escape(result.next_step)}</p>"])
