"""The page of any result: answer, tables, pictures, warnings, the next step, provenance."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache
from html import escape
from importlib import resources
from itertools import pairwise
from pathlib import Path
from typing import Any

from shapegcode.results.json import Provenance, plain, this_version
from shapegcode.results.outcome import NotKeptError, Outcome
from shapegcode.results.page import model
from shapegcode.results.page.scene import Scene
from shapegcode.results.table import Column, Table

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


def sections_of(result: Outcome, figures: Sequence[model.Figure] = ()) -> tuple[model.Section, ...]:
    """Key figures, warnings, next step, tables and pictures of any result."""
    glance = [model.Section("gain", "At a glance", (model.Figures(tuple(figures)),))] if figures else []
    first = (*glance, *warnings_of(result), next_steps(result))
    try:
        tables = result.tables()
    except NotKeptError:
        return (*first, _json(result.to_dict()))
    return (*first, *_tables(tables), *pictures_of(result))


def warnings_of(result: Outcome) -> Iterator[model.Section]:
    """The warnings, if there are any."""
    if result.warnings:
        yield model.Section("warnings", "Warnings", (model.Text(tuple(result.warnings), warning=True),))


def next_steps(result: Outcome, *further: model.NextStep) -> model.Section:
    """The section of the next steps."""
    text = result.next_step
    is_command = text.startswith("shapegcode ")
    sentence = text if is_command else text[:1].upper() + text[1:]
    command = text if _is_typed(text) else next(iter(re.findall(r"`(shapegcode [^`]+)`", text)), "")
    sentence = "Then:" if command == text else sentence
    return model.Section("next", "What to do next", (model.NextSteps((model.NextStep(sentence, command), *further)),))


def _is_typed(text: str) -> bool:
    """True if the text is a complete command line: command, options with their values, and files."""
    program, _, *words = text.split(" ") if " " in text else (text, "")
    is_typed = all(before.startswith("-") or _NO_WORD.search(word) for before, word in pairwise(("", *words)))
    return program == "shapegcode" and bool(words) and is_typed


def _tables(tables: Sequence[Table]) -> Iterator[model.Section]:
    """Sections of tables: short ones together, each long one separate and folded."""
    short: tuple[model.Part, ...] = tuple(table for table in tables if len(table.rows) <= _UNFOLDED_ROWS)
    if short:
        yield model.Section("figures", "Figures", short)
    for rank, table in enumerate(table for table in tables if len(table.rows) > _UNFOLDED_ROWS):
        title = table.title or f"{len(table.rows)} rows"
        key = "table" if rank == 0 else f"table-{rank + 1}"
        yield model.Section(key, title[:1].upper() + title[1:], (table,), printed=False, folded=True)


@cache
def _captions() -> dict[str, str]:
    """Explanations of the pictures, by the names in `plots()`."""
    text = (resources.files("shapegcode") / "data" / "page" / "captions.txt").read_text(encoding="utf-8")
    return dict(line.split(": ", 1) for line in text.splitlines())


def pictures_of(result: Outcome, printed: Sequence[str] = ()) -> Iterator[model.Section]:
    """The pictures, each with an explanation."""
    how = _captions()
    pictures = [model.Picture(name, plot, how.get(name, _UNKNOWN)) for name, plot in result.plots().items()]
    chosen = [each for each in pictures if each.name in printed] or pictures[:_PRINTED_PICTURES]
    if chosen:
        yield model.Section("pictures", "Pictures", tuple(chosen))
    if others := tuple(each for each in pictures if each not in chosen):
        yield model.Section("more-pictures", "More pictures", others, printed=False)
    if result.from_json:
        left_out = "Pictures that need the samples of the run are missing: the JSON does not contain them."
        yield model.Section("no-pictures", "Missing pictures", (model.Text((left_out,)),), printed=False)


def provenance_section(provenance: Provenance) -> model.Section:
    """Command, version and files with their hashes."""
    rows = [("by", provenance.by), *([("command", provenance.command)] if provenance.command else [])]
    for file in provenance.files:
        rows.append((file.role, f"{file.name}, {file.size_bytes} bytes, SHA-256 {file.sha256 or 'not known'}"))
    how = "Any changed byte changes the hash of a file: compare it before you rely on this page."
    return model.Section(
        "provenance", "Command, version and files", (model.Notes(tuple(rows)),), how=how, folded=True, printed=False
    )


def page_of(
    result: Outcome, light: tuple[model.Light, str], sections: tuple[model.Section, ...], scene: Scene | None,
    provenance: Provenance | None, problems: Sequence[str],
) -> model.Page:  # fmt: skip
    """The page of a result."""
    report: dict[str, Any] = result.to_json()
    if provenance is not None:
        report["provenance"] = plain(provenance)
        sections = (*sections, provenance_section(provenance))
        scene = _named(scene, provenance)
    above = next((rank + 1 for rank, section in enumerate(sections) if section.key == "next"), 0)
    said = title_of(result), light[0], result.answer, light[1]
    return model.Page(*said, sections, report, scene, above, tuple(problems))


def _named(scene: Scene | None, provenance: Provenance) -> Scene | None:
    """Add the name of the output file to the scene, which was unknown when it was made."""
    output = provenance.file("output")
    if scene is None or output is None or len(scene.variants) < 2:
        return scene
    *others, last = scene.variants
    return replace(scene, variants=(*others, replace(last, file=output.name)))


def raw_page(report: Mapping[str, Any], why: str) -> model.Page:
    """The page of a result that cannot be read back: its unchanged JSON."""
    provenance = report.get("provenance", report.get("made"))
    by = provenance.get("by", "another version") if isinstance(provenance, dict) else "another version"
    return model.Page(
        title="JSON of a result",
        light="amber",
        verdict=f"This result was written by {by}, and {this_version()} cannot read it back from its JSON.",
        reason="it is shown unchanged; run the command again for a page",
        sections=(_json(report),),
        report=report,
        problems=(why,),
    )


def _json(report: Mapping[str, Any]) -> model.Section:
    """The JSON itself, if no page can be made from it."""
    texts = {key: json.dumps(value, ensure_ascii=False) for key, value in report.items()}
    rows = [(key, text if len(text) <= _SHORT_TEXT else f"{text[: _SHORT_TEXT - 1]}…") for key, text in texts.items()]
    columns = (Column("key", value=lambda row: row[0], left=True), Column("value", value=lambda row: row[1], text=True))
    return model.Section("json", "The JSON", (Table("", columns, rows),), how="Key by key; long values are cut.")


def short_html(result: Outcome) -> str:
    """Answer, warnings and tables for a notebook."""
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
