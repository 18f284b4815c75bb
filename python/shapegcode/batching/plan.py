"""The runs of a batch: programs times machines, each with its command line and the files it reads."""

from __future__ import annotations

import glob
import os
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from shapegcode.batching import WRITES
from shapegcode.batching.manifest import MANIFEST, short
from shapegcode.batching.process import Base, BatchJob
from shapegcode.errors import ArgumentError
from shapegcode.io.data_file import MAX_SETTINGS_BYTES, read_file
from shapegcode.machine import Machine
from shapegcode.program.reading import CALLS, PROGRAM_SUFFIXES, is_subprogram, program_loader

_NUMBERED = re.compile(r"[Oo]\d{1,8}")
_COMMENT = re.compile(r"(?:^|\s)#.*")
_NUMBER = re.compile(rb"P *0*(\d{1,8})", re.IGNORECASE)
_COMPUTED = re.compile(rb"P *[\[#]", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class Source:
    """A program of a batch."""

    path: str  # as given
    place: str  # position of its results in the output folder: its path below the given folder
    # a subprogram (M99) found in a given folder: not run on its own, but with the programs that call it
    subprogram: bool = False


def find_programs(given: Sequence[str], output: str | Path) -> tuple[Source, ...]:
    """Find the programs of folders, patterns and lists."""
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
    """Programs of a list file; an error message gives the line in that file."""
    try:
        text = read_file(file, MAX_SETTINGS_BYTES).decode()
    except UnicodeDecodeError:
        raise ArgumentError(f"{file}: not a list of programs: it is not text") from None
    lines = [(number, _COMMENT.sub("", line).strip()) for number, line in enumerate(text.splitlines(), 1)]
    if not any(entry for _, entry in lines):
        raise ArgumentError(f"{file}: the list contains no program")
    for number, entry in lines:
        if entry.startswith("@"):
            raise ArgumentError(f"{file}:{number}: {entry}: a list must not contain lists")
        try:
            yield from _each([str(file.parent / entry)] if entry else [], avoid)
        except ArgumentError as error:
            raise ArgumentError(f"{file}:{number}: {error}") from None


def _matching(pattern: str, avoid: Path) -> Iterator[Source]:
    root = os.path.dirname(re.split(r"[*?\[]", pattern, maxsplit=1)[0]) or "."  # the part before the first wildcard
    found = False
    for file in sorted(glob.glob(pattern, recursive=True)):
        if os.path.isfile(file) and avoid not in Path(file).absolute().parents:
            found = True
            yield Source(file, os.path.relpath(file, root))
    if not found:
        raise ArgumentError(f"{pattern}: no such file, folder or match")


def _in_folder(folder: Path, avoid: Path) -> Iterator[Source]:
    count = 0
    for where, folders, names in os.walk(folder):
        if MANIFEST in names:  # results of a batch
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
                    continue  # a pipe; a dead link is reported by its run
                count += 1
                yield Source(path, os.path.relpath(path, folder), _only_returns(path))
    if not count:
        raise ArgumentError(f"{folder}: no program in it; programs end in {', '.join(filter(None, PROGRAM_SUFFIXES))}")


def _only_returns(path: str) -> bool:
    try:
        return is_subprogram(read_file(path))
    except OSError:
        return False  # reported by its run


def called_files(path: str | Path, machine: Machine, base: str = ".") -> Iterator[tuple[str, str]]:
    """Names and paths of the files a program may call, also by bound codes and tool changes, recursively."""
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
    """Numbers of programs that a program may call: in one with calls any number after P."""
    if not CALLS.search(text):
        return []
    if _COMPUTED.search(text):
        # A computed number is known only when executed: take all existing programs.
        names = [file.stem for folder in folders if folder.is_dir() for file in folder.iterdir()]
        return [int(digits) for name in names if (digits := name.lstrip("Oo")).isdigit() and len(digits) <= 8]
    return [int(number) for number in _NUMBER.findall(text)]


_AMOUNT = frozenset({"-q", "--quiet", "-v", "--verbose"})
_OF_ONE_RUN = (
    "-o", "--output", "-m", "--machine", "--json", "--html", "--html-script", "--csv", "--npz", "--plots",
)  # fmt: skip


@dataclass(frozen=True)
class _OnMachine:
    """What all runs on one machine share: its name as given, the argument of -m, and the folder of the results."""

    given: str
    word: str
    below: str
    machine: Machine
    files: tuple[str, ...]


@dataclass(frozen=True)
class Plan:
    """The runs to be done, created on demand, machine by machine."""

    base: Base  # folder in which the batch was started
    sources: Sequence[Source]  # the programs, in the given order
    lines: tuple[_OnMachine, ...]  # one per machine
    command: str  # one of `COMMANDS`
    words: tuple[str, ...]  # further arguments of each command line
    output: str  # folder of the results, as seen by a run
    html: str  # likewise folder of the pages; empty: none
    shared: Mapping[str, bytes]  # content of common files, by name

    def __len__(self) -> int:
        return len(self.sources) * len(self.lines)

    def job(self, rank: int) -> BatchJob:
        """Make the job of run number *rank*, from 0."""
        line, source = self._of(rank)
        target = os.path.join(self.output, line.below, source.place)
        page = os.path.join(self.html, line.below, f"{source.place}.html") if self.html else ""
        words = [self.command, self.base.name_of(source.path), "-m", line.word]
        words += ["-o", target] if self.command in WRITES else []
        words += ["--json", f"{target}.json", *(["--html", page, "--html-script", "beside"] if page else [])]
        words += [*(["-q"] if _AMOUNT.isdisjoint(self.words) else []), *self.words]
        return BatchJob(source.path, line.given, tuple(words), target)

    def files(self, rank: int) -> dict[str, bytes]:
        """Files that a run reads, by name."""
        line, source = self._of(rank)
        found = {self.base.name_of(source.path): read_file(source.path)}
        for called, path in called_files(source.path, line.machine, self.base.path_of(".")):
            found[self.base.name_of(called)] = read_file(path)
        return found | {key: content for key, content in self.shared.items() if key in line.files}

    def size_bytes(self, rank: int) -> int:
        """Size of the program of a run, bytes."""
        try:
            return os.path.getsize(self._of(rank)[1].path)
        except OSError:
            return 0

    def _of(self, rank: int) -> tuple[_OnMachine, Source]:
        line, source = divmod(rank, len(self.sources))
        return self.lines[line], self.sources[source]


def plan(
    sources: Sequence[Source], machines: Sequence[str], output: str, command: str, options: Sequence[str],
    html: str | Path | None, base: Base,
) -> Plan:  # fmt: skip
    """Plan the runs of programs on machines."""
    if not machines:
        raise ArgumentError("no machine: give one with -m")
    labels = [Path(machine).stem for machine in machines]
    if twice := {label for label in labels if labels.count(label) > 1}:
        raise ArgumentError(f"two machines would be written to {output}/{min(twice)}: rename one of the files")
    for word in options:
        if word.partition("=")[0] in _OF_ONE_RUN:
            raise ArgumentError(f"{word} after --: is a file of one run; use -m, -o and --html of the batch")
    words, given = _with_files(options, base)
    shared = {name: read_file(path) for name, path in given}
    lines: list[_OnMachine] = []
    for name, label in zip(machines, labels, strict=True):
        machine = Machine.load(name)
        own = [base.name_of(name)] if os.path.exists(name) else []
        shared |= {key: read_file(name) for key in own}
        below = label if len(machines) > 1 else ""
        lines.append(_OnMachine(name, own[0] if own else name, below, machine, (*own, *(key for key, _ in given))))
    page = base.name_of(html) if html else ""
    return Plan(base, sources, tuple(lines), command, tuple(words), base.name_of(output), page, shared)


def _with_files(options: Sequence[str], base: Base) -> tuple[list[str], list[tuple[str, str]]]:
    """The arguments as seen by a run, and the files among them, by name."""
    words: list[str] = []
    files: list[tuple[str, str]] = []
    for word in options:
        option, sign, value = word.partition("=") if word.startswith("--") else ("", "", word)
        if is_file := bool(value) and os.path.isfile(value):
            files.append((base.name_of(value), value))
        words.append(f"{option}{sign}{files[-1][0]}" if is_file else word)
    return words, files
