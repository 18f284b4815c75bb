"""Write the manual pages of the command and of its sub-commands, from their parsers: `write_man.py FOLDER`."""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

from argparse_manpage.manpage import Manpage

from shapegcode.cli import COMMANDS, parser_of
from shapegcode.cli.arguments import CommandParser
from shapegcode.results.json import this_version

_WHO = {"project_name": "shapegcode", "version": this_version().split()[-1], "manual_title": "shapegcode"}


def pages() -> dict[str, str]:
    """Text of each page by the name of its file."""
    os.environ["COLUMNS"] = "78"  # the usage stands in the page as wide as the parser makes it
    found = {"shapegcode.1": _page(parser_of(None), "shapegcode")}
    for command in COMMANDS:
        whole = parser_of(command)
        (actions,) = [each for each in whole._actions if isinstance(each, argparse._SubParsersAction)]
        name = f"shapegcode-{command}"
        found[f"{name}.1"] = _page(actions.choices[command], name)
    return found


def _page(parser: argparse.ArgumentParser, name: str) -> str:
    parser.format_help()  # puts the groups into their order
    parser.epilog = parser.epilogue() if isinstance(parser, CommandParser) else parser.epilog
    parser.prog = name.replace("-", " ", 1)
    page = Manpage(parser, _data=_WHO)
    page.prog = name
    return str(page)


if __name__ == "__main__":
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    for file, text in pages().items():
        (folder / file).write_text(text, encoding="utf-8")
    print(f"wrote {len(pages())} pages into {folder}; man {folder}/shapegcode-convert.1 shows one")
