"""The dialects of output as Markdown: ``docs/reference/dialects.md``; ``make docs`` writes it."""

from __future__ import annotations

from shapegcode.machine.dialects import Dialect, all_dialects, fanuc_meaning

_HEAD = """\
# Dialects of output

<!-- Generated: make docs -->

    shapegcode convert part.nc -m mine.toml --dialect linuxcnc -o shaped.ngc

`emission.dialect` says for which control `convert` writes; programs are read in
[other dialects](input_dialects.md) too. Where a page or a
recording says what holds, it is named. What nobody found a text for is *assumed*, and the header of the program and the
answer of `convert` say so.

Words of the original are written only if they are in *the same* or *becomes*; all others are refused with their line,
what they are on FANUC and what they are there, unless `emission.words` says what they become.
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
        "| topic | what holds | source |",
        "|---|---|---|",
        *rows,
        "",
        f"* The same: {', '.join(f'`{code}`' for code in sorted(dialect.same))}.",
    ]
    lines += [f"* Becomes: {', '.join(becomes)}."] if becomes else []
    lines += [f"* Means something else or nothing there: {'; '.join(means)}."] if means else []
    lines += [f"* With a warning: {'; '.join(cautions)}."] if cautions else []
    return "\n".join([*lines, ""])


def _cell(text: str) -> str:
    return text.replace("|", "\\|")
