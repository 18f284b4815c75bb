"""Of what a command made its result: what it was typed as, and the files, with their hashes."""

from __future__ import annotations

import argparse
import shlex
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from shapegcode.results.made import Made, MadeFile
    from shapegcode.results.result import Result

READ = (
    "input", "inputs", "files", "machine", "tool", "stock", "against", "records", "cut", "update", "dump", "base",
)  # fmt: skip
"""Options that name a file which a command reads."""


MACHINES = ("machine", "base", "files")
"""Those of them that may name a built-in machine."""


def given_files(args: argparse.Namespace) -> Iterator[tuple[str, str]]:
    """What was given to the options that name files to read."""
    for role in READ:
        value = getattr(args, role, None)
        for entry in value if isinstance(value, list | tuple) else [value]:
            if entry is not None:
                yield role, str(entry)


def made_by(
    result: Result,
    args: argparse.Namespace,
    output: tuple[str | Path, bytes | memoryview] | None = None,
    wrote: Sequence[str | Path] = (),
) -> Made:
    """Of what a command made its result."""
    from shapegcode.results.made import FORMAT, Made, MadeFile, this_version

    files = [_read(role, name) for role, name in given_files(args)]
    if output is not None:
        # Programs of one file are written together, behind the last of them.
        alone = getattr(args, "several", None) is None
        files.append(MadeFile.of("output" if alone else "output of all", output[0], output[1]))
    files += [MadeFile.of("wrote", name) for name in wrote if Path(name).is_file()]
    return Made(type(result).__name__, this_version(), FORMAT, _command(args), tuple(files))


def _read(role: str, name: str) -> MadeFile:
    from shapegcode.results.made import MadeFile

    if role in MACHINES and not Path(name).exists():
        from shapegcode.machine import Machine

        if name in Machine.builtin_names():
            return MadeFile.of(role, name, Machine.builtin_text(name).encode())
    return MadeFile.of(role, name)


def _command(args: argparse.Namespace) -> str:
    """As it was typed; of several programs of a file the one that is done."""
    words = list(getattr(args, "typed", ()))
    if getattr(args, "several", None) is not None:
        at = next((rank for rank, word in enumerate(words) if word.startswith("--program")), None)
        if at is not None:
            words[at : at + (1 if "=" in words[at] else 2)] = ["--program", str(args.program)]
    return shlex.join(["shapegcode", *words]) if words else ""
