"""Which programs a batch is of, and which files each of them needs."""

from __future__ import annotations

import glob
import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from shapegcode.batching.manifest import MANIFEST
from shapegcode.errors import ArgumentError
from shapegcode.program.reading import PROGRAM_SUFFIXES, program_loader
from shapegcode.program.several import is_subprogram

if TYPE_CHECKING:
    from shapegcode.machine import Machine

__all__ = ["Source", "called_files", "find_programs"]

_NUMBERED = re.compile(r"[Oo]\d{1,8}")
_CALL = re.compile(rb"(?:M *0*(?:98|198)|G *0*(?:65|66))(?!\d)", re.IGNORECASE)
_NUMBER = re.compile(rb"P *0*(\d{1,8})", re.IGNORECASE)
_COMPUTED = re.compile(rb"P *[\[#]", re.IGNORECASE)


@dataclass(frozen=True)
class Source:
    """A program of a batch.

    Attributes:
        path: as it was given.
        place: where its results go below the output folder: its path below the folder that was given.
        subprogram: it stands in a folder that was given, and only returns to who called it: it is done there.
    """

    path: str
    place: str
    subprogram: bool = False


def find_programs(given: Sequence[str], output: str | Path) -> tuple[Source, ...]:
    """The programs that folders, patterns and lists name.

    Args:
        given: files, folders (all programs in them and below), patterns such as ``parts/*.nc``, and ``@LIST``, a file
            with one of these per line (``#`` begins a comment; relative to the list).
        output: folder of the results, in which no program is looked for.

    Returns:
        Each program once, in the order in which they were given, those of a folder by name.

    Raises:
        ArgumentError: something names no program, or two programs would have the same results.
        OSError: a list or a folder cannot be read.
    """
    found: dict[str, Source] = {}
    avoid = Path(output).absolute()
    for source in _each(given, avoid):
        found.setdefault(os.path.realpath(source.path), source)
    places: dict[str, Source] = {}
    for source in found.values():
        other = places.setdefault(os.path.normcase(source.place), source)
        if other is not source:
            raise ArgumentError(
                f"{other.path} and {source.path} would both be written to {source.place}: "
                "give the folder above them, or rename one"
            )
    return tuple(found.values())


def _each(given: Sequence[str], avoid: Path, base: Path | None = None) -> Iterator[Source]:
    for word in given:
        path = word if base is None or os.path.isabs(word) else str(base / word)
        if word.startswith("@"):
            file = Path(word[1:])
            lines = (line.split("#", 1)[0].strip() for line in file.read_text().splitlines())
            entries = [line for line in lines if line]
            if not entries:
                raise ArgumentError(f"{file}: the list names no program")
            yield from _each(entries, avoid, file.parent)
        elif os.path.isdir(path):
            yield from _in_folder(Path(path), avoid)
        elif os.path.isfile(path):
            yield Source(path, os.path.basename(path))
        elif matches := sorted(glob.glob(path, recursive=True)):
            root = _fixed_part(path)
            files = [
                match for match in matches if os.path.isfile(match) and avoid not in Path(match).absolute().parents
            ]
            yield from (Source(file, os.path.relpath(file, root)) for file in files)
        else:
            raise ArgumentError(f"{path}: no such file, folder or match")


def _fixed_part(pattern: str) -> str:
    """The folder of a pattern that stands before its first wildcard."""
    fixed = pattern[: re.search(r"[*?\[]", pattern).start()] if glob.has_magic(pattern) else pattern  # type: ignore[union-attr]
    return os.path.dirname(fixed) or "."


def _in_folder(folder: Path, avoid: Path) -> Iterator[Source]:
    count = 0
    for where, folders, names in os.walk(folder):
        if MANIFEST in names:  # the results of a batch
            folders.clear()
            continue
        folders[:] = sorted(
            name for name in folders if not name.startswith(".") and Path(where, name).absolute() != avoid
        )
        for name in sorted(names):
            stem, suffix = os.path.splitext(name)
            if suffix in PROGRAM_SUFFIXES and (suffix or _NUMBERED.fullmatch(stem)):
                count += 1
                path = os.path.join(where, name)
                yield Source(path, os.path.relpath(path, folder), is_subprogram(Path(path).read_bytes()))
    if not count:
        raise ArgumentError(f"{folder}: no program in it; programs end in {', '.join(filter(None, PROGRAM_SUFFIXES))}")


def called_files(path: str | Path, machine: Machine) -> Iterator[tuple[str, str]]:
    """Files of programs that a program may call, and those that these may.

    More than are called may be among them: any number behind a P counts, of a program that calls at all.

    Args:
        path: of the program.
        machine: whose folders and macro codes count too.

    Returns:
        Name of each, beside the program, and the file.

    Raises:
        OSError: a file cannot be read.
    """
    beside = Path(path).parent
    folders = [beside, *(Path(name).expanduser() for name in machine.input.program_folders)]
    load = program_loader(folders, machine.controller.max_program_bytes)
    bound = machine.input
    numbers = [*bound.g_macros.values(), *bound.m_macros.values(), *bound.m_subprograms.values()]
    numbers += [bound.tool_program] if bound.tool_program else []
    seen: set[int] = set()
    waiting = [*numbers, *_mentioned(Path(path).read_bytes(), folders)]
    while waiting:
        number = waiting.pop()
        if number in seen:
            continue
        seen.add(number)
        if (found := load(number)) is not None:
            file, content = found
            yield str(beside / Path(file).name), file
            waiting += _mentioned(content, folders)


def _mentioned(text: bytes, folders: Sequence[Path]) -> list[int]:
    """Numbers of programs that a text may call."""
    if not _CALL.search(text):
        return []
    if _COMPUTED.search(text):
        # Only running it would tell: all that are there.
        names = [file.stem for folder in folders if folder.is_dir() for file in folder.iterdir()]
        return [int(digits) for name in names if (digits := name.lstrip("Oo")).isdigit() and len(digits) <= 8]
    return [int(number) for number in _NUMBER.findall(text)]
