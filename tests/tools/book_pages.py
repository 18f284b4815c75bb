"""Pages of the book that come from the code: what each command says of itself, the Python package, the C++ headers,
the schemas of the results.
"""

from __future__ import annotations

import argparse
import contextlib
import inspect
import os
import re
from collections.abc import Iterator
from pathlib import Path

import write_docs
import write_schemas

import shapegcode as sg
from shapegcode import cli

ROOT = Path(__file__).resolve().parents[2]
HEADERS = ROOT / "cpp" / "include" / "shapegcode"

PARTS = {
    "core": "Building blocks of the core: shapers, filters, plants, cutting force",
    "machine": "The machine",
    "program": "Programs",
    "conversion": "Conversion",
    "simulation": "Simulation",
    "timing": "Cycle time",
    "checking": "Checking",
    "comparison": "Two programs compared",
    "metrology": "Virtual metrology",
    "shaping": "Shapers",
    "identification": "Modes from taps, position loops from logs",
    "characterization": "Controllers from tests and logs",
    "feed": "Feeds by force",
    "cutting": "Tool, stock, materials",
    "testcut": "Test cuts",
    "demos": "Demonstrations",
    "model": "Plants of a machine",
    "results": "What every result has",
    "io": "Files",
    "setup": "Setup",
    "errors": "Errors",
}
"""Title of the page of each folder of the package, in the order of the book; one that is not here has its own name."""


def generated() -> dict[str, str]:
    """Text of each page, and of the schemas, by its place in the book."""
    schemas = {f"schema/{name}": text for name, text in write_schemas.texts().items()}
    linked = {"reference/schemas.md": write_docs.schema_documentation(linked=True)}
    return {**_commands(), **_python(), **_cpp(), **schemas, **linked}


# --- Commands ---------------------------------------------------------------------------------------------------------
def parsers(parser: argparse.ArgumentParser) -> Iterator[argparse.ArgumentParser]:
    """A parser and, behind it, those of its actions."""
    yield parser
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for below in dict.fromkeys(action.choices.values()):
                yield from parsers(below)


@contextlib.contextmanager
def _page_width(columns: int) -> Iterator[None]:
    """Help is laid out for a page of so many columns."""
    before = {name: os.environ.get(name) for name in ("COLUMNS", "NO_COLOR")}
    os.environ |= {"COLUMNS": str(columns), "NO_COLOR": "1"}
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name)
            else:
                os.environ[name] = value


def _commands() -> dict[str, str]:
    rows, found = [], {}
    with _page_width(88):
        for command, line in cli.COMMANDS.items():
            whole = cli.parser_of(command)
            own = next(each for each in parsers(whole) if each.prog.split()[1:] == [command])
            parts = [f"# `shapegcode {command}`\n\n{line[:1].upper()}{line[1:]}.\n"]
            for each in parsers(own):
                if each is not own:
                    parts.append(f"## `{each.prog}`\n")
                parts.append(f"```text\n{each.format_help().rstrip()}\n```\n")
            found[f"reference/commands/{command}.md"] = "\n".join(parts)
            rows.append(f"| [`{command}`]({command}.md) | {line} |")
    head = "# Commands\n\nWhat `shapegcode COMMAND --help` says.\n\n| command | what it does |\n|---|---|\n"
    names = "\n".join(cli.COMMANDS)
    found["reference/commands/index.md"] = head + "\n".join(rows) + f"\n\n```{{toctree}}\n:hidden:\n\n{names}\n```\n"
    return found


# --- Python -----------------------------------------------------------------------------------------------------------
def _python() -> dict[str, str]:
    folders: dict[str, list[str]] = {name: [] for name in PARTS}
    for name, home in sg._home().items():
        if not name.startswith("_"):
            folders.setdefault(home.split(".")[1].lstrip("_"), []).append(name)
    found, rows = {}, []
    for folder, names in folders.items():
        if names:
            title = PARTS.get(folder, folder)
            found[f"reference/python/{folder}.md"] = _part(title, names)
            rows.append(folder)
    head = "# The Python package, name by name\n\nAll names are those of `import shapegcode as sg`. "
    head += "One table of all of them: [the Python API](../api.md).\n"
    found["reference/python/index.md"] = head + "\n```{toctree}\n" + "\n".join(rows) + "\n```\n"
    return found


def _part(title: str, names: list[str]) -> str:
    table = "".join(f"| [`{name}`](#shapegcode.{name}) | {_said(name)} |\n" for name in names)
    parts = [f"# {title}\n\n| name | what it is |\n|---|---|\n{table}"]
    for name in names:
        value = getattr(sg, name)
        kind = "autoclass" if inspect.isclass(value) else "autofunction" if callable(value) else "autodata"
        parts.append(f"```{{eval-rst}}\n.. {kind}:: shapegcode.{name}\n```\n")
    return "\n".join(parts)


def _said(name: str) -> str:
    return write_docs.first_sentence(inspect.getdoc(getattr(sg, name)) or "")


# --- C++ --------------------------------------------------------------------------------------------------------------
def _cpp() -> dict[str, str]:
    found, rows = {}, []
    headers = [file for kind in ("*.hpp", "*.h") for file in HEADERS.rglob(kind)]
    for header in sorted(headers, key=lambda file: (len(file.relative_to(HEADERS).parts), file)):
        name = header.relative_to(HEADERS).as_posix()
        stem = name.removesuffix(".hpp").replace("/", "-").replace(".", "-")
        body = f'# {name}\n\n`#include "shapegcode/{name}"`\n\n'
        said = _comment_of(header)
        if said:
            body += f"```cpp\n{said}\n```\n\n"
        if name != "shapegcode.hpp":  # it only includes the others
            body += f"```{{eval-rst}}\n.. doxygenfile:: {header.name}\n```\n"
        found[f"reference/cpp/{stem}.md"] = body
        rows.append(stem)
    head = "# The C++ headers, and the one for C\n\nThe library is `shapegcode::core`, found with\n"
    head += "`find_package(shapegcode)`; what a control embeds is `shapegcode::rt`, its component `rt`.\n"
    head += "Programs that embed it stand under [Embed it in a\n"
    head += "controller](../../tutorials/embed.md).\n"
    found["reference/cpp/index.md"] = head + "\n```{toctree}\n" + "\n".join(rows) + "\n```\n"
    return found


def _comment_of(header: Path) -> str:
    """The comment that stands alone at the head of a header: what it is for, with an example."""
    text = header.read_text(encoding="utf-8")
    found = re.search(r"^((?:// ?[^/\n]*.*\n|//\n){3,})\n", text, re.MULTILINE)
    return found[1].rstrip() if found and "    " in found[1] else ""
