"""Which programs a batch is of, and which files each of them needs."""

from __future__ import annotations

import glob
import os
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from shapegcode.batching.manifest import MANIFEST, short
from shapegcode.errors import ArgumentError
from shapegcode.io.data_file import MAX_SETTINGS_BYTES, read_file
from shapegcode.program.reading import PROGRAM_SUFFIXES, program_loader
from shapegcode.program.several import is_subprogram

if TYPE_CHECKING:
    from shapegcode.machine import Machine

_NUMBERED = re.compile(r"[Oo]\d{1,8}")
_COMMENT = re.compile(r"(?:^|\s)#.*")
_CALL = re.compile(rb"(?:M *0*(?:98|198)|G *0*(?:65|66))(?!\d)", re.IGNORECASE)
_NUMBER = re.compile(rb"P *0*(\d{1,8})", re.IGNORECASE)
_COMPUTED = re.compile(rb"P *[\[#]", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class Source:
    """A program of a batch."""

    path: str  # as it was given
    place: str  # where its results go below the output folder: its path below the folder that was given
    # it stands in a folder that was given, and only returns to who called it: it is done there
    subprogram: bool = False


def find_programs(given: Sequence[str], output: str | Path) -> tuple[Source, ...]:
    """The programs that folders, patterns and lists name."""
    found: list[Source] = []
    files, places = set[bytes](), set[bytes]()
    for source in _each(given, Path(output).absolute()):
        if (file := short(os.path.realpath(source.path))) in files:
            continue
        files.add(file)
        if (place := short(os.path.normcase(source.place))) in places:
            other = next(each for each in found if short(os.path.normcase(each.place)) == place)
            raise ArgumentError(
                f"{other.path} and {source.path} would both be written to {source.place}: "
                "give the folder above them, or rename one"
            )
        places.add(place)
        found.append(source)
    return tuple(found)


def _each(given: Iterable[str], avoid: Path) -> Iterator[Source]:
    for word in given:
        if word.startswith("@"):
            yield from _listed(Path(word[1:]), avoid)
        elif os.path.isdir(word):
            yield from _in_folder(Path(word), avoid)
        elif os.path.isfile(word):
            yield Source(word, os.path.basename(word))
        else:
            yield from _matching(word, avoid)


def _listed(file: Path, avoid: Path) -> Iterator[Source]:
    """What a list names; a message says where it stands."""
    try:
        text = read_file(file, MAX_SETTINGS_BYTES).decode()
    except UnicodeDecodeError:
        raise ArgumentError(f"{file}: no list of programs: it is no text") from None
    lines = [(number, _COMMENT.sub("", line).strip()) for number, line in enumerate(text.splitlines(), 1)]
    if not any(entry for _, entry in lines):
        raise ArgumentError(f"{file}: the list names no program")
    for number, entry in lines:
        if entry.startswith("@"):
            raise ArgumentError(f"{file}:{number}: {entry}: a list names no lists")
        try:
            yield from _each([str(file.parent / entry)] if entry else [], avoid)
        except ArgumentError as error:
            raise ArgumentError(f"{file}:{number}: {error}") from None


def _matching(pattern: str, avoid: Path) -> Iterator[Source]:
    root = _fixed_part(pattern)
    found = False
    for file in sorted(glob.glob(pattern, recursive=True)):
        if os.path.isfile(file) and avoid not in Path(file).absolute().parents:
            found = True
            yield Source(file, os.path.relpath(file, root))
    if not found:
        raise ArgumentError(f"{pattern}: no such file, folder or match")


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
                path = os.path.join(where, name)
                if os.path.exists(path) and not os.path.isfile(path):
                    continue  # a pipe; of a link that leads nowhere its run will say so
                count += 1
                yield Source(path, os.path.relpath(path, folder), _only_returns(path))
    if not count:
        raise ArgumentError(f"{folder}: no program in it; programs end in {', '.join(filter(None, PROGRAM_SUFFIXES))}")


def _only_returns(path: str) -> bool:
    try:
        return is_subprogram(read_file(path))
    except OSError:
        return False  # its run will say why


def called_files(path: str | Path, machine: Machine, base: str = ".") -> Iterator[tuple[str, str]]:
    """Files of programs that a program may call, and those that these may.

    More than are called may be among them: any number behind a P counts, of a program that calls at all.
    """
    beside = Path(path).parent
    folders = [beside, *(Path(base, Path(name).expanduser()) for name in machine.input.program_folders)]
    load = program_loader(folders, machine.controller.max_program_bytes)
    bound = machine.input
    numbers = [*bound.g_macros.values(), *bound.m_macros.values(), *bound.m_subprograms.values()]
    numbers += [bound.tool_program] if bound.tool_program else []
    seen: set[int] = set()
    waiting = [*numbers, *_mentioned(read_file(path), folders)]
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
