"""The dialects of output as Markdown: ``docs/reference/dialects.md``; ``make docs`` writes it."""

from __future__ import annotations

from shapegcode.machine.dialects import Dialect, all_dialects, fanuc_meaning

_HEAD = """\
# Dialects of output

<!-- Generated: make docs -->

    shapegcode convert part.nc -m mine.toml --dialect linuxcnc -o shaped.ngc

`emission.dialect` selects the control for which `convert` writes; programs for
[other controls](input_dialects.md) can be read, too. The *source* of a statement is a document or a recording.
Statements without a source are *assumed*, and the header of the program and the report of `convert` say so.

A word of the original is written only if it is listed under *the same* or *becomes*; every other word is refused with
its line and its meaning on both controls, unless `emission.words` states a replacement.
"""


def dialects_documentation() -> str:
    """Every row of the table."""
    return "\n".join([_HEAD, *(_section(name, dialect) for name, dialect in all_dialects().items())])


def _section(name: str, dialect: Dialect) -> str:
    rows = [
        f"| {topic} | {_cell(fact.text)} | {_cell(fact.source) or '*assumed*'} |"
        for topic, fact in dialect.facts.items()
    ]
    becomes = [f"`{code}` → {f'`{text}`' if text else 'left out'}" for code, text in sorted(dialect.becomes.items())]
    means = [f"`{code}`: {dialect.means[code]} (FANUC: {fanuc_meaning(code)})" for code in sorted(dialect.means)]
    cautions = [f"`{code}`: {text}" for code, text in dialect.cautions.items()]
    lines = [
        f"## {name}: {dialect.control}\n",
        "| topic | statement | source |",
        "|---|---|---|",
        *rows,
        "",
        f"* The same: {', '.join(f'`{code}`' for code in sorted(dialect.same))}.",
    ]
    lines += [f"* Becomes: {', '.join(becomes)}."] if becomes else []
    lines += [f"* Other meaning, or unknown, on this control: {'; '.join(means)}."] if means else []
    lines += [f"* With a warning: {'; '.join(cautions)}."] if cautions else []
    return "\n".join([*lines, ""])


def _cell(text: str) -> str:
    return text.replace("|", "\\|")
