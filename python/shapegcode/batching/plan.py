"""The runs of a batch: programs times machines, each with the words of its command line and the files it reads."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from shapegcode.batching.inputs import Source, called_files
from shapegcode.batching.process import Base, BatchJob
from shapegcode.errors import ArgumentError
from shapegcode.io.data_file import read_file
from shapegcode.machine import Machine

COMMANDS = ("convert", "time", "check", "feed", "measure", "simulate")
"""Commands of one program that can be run over many."""

WRITES = ("convert", "feed")
"""Those that write a program."""
_AMOUNT = frozenset({"-q", "--quiet", "-v", "--verbose"})
_OF_ONE_RUN = (
    "-o", "--output", "-m", "--machine", "--json", "--html", "--html-script", "--csv", "--npz", "--plots",
)  # fmt: skip


@dataclass(frozen=True)
class _OnMachine:
    """What the runs on one machine have in common: its name as given, in a run, and its folder below the results."""

    given: str
    word: str
    below: str
    machine: Machine
    files: tuple[str, ...]


@dataclass(frozen=True)
class Plan:
    """What is to be done: a run is made when its turn comes, machine by machine."""

    base: Base  # folder in which the batch was begun
    sources: Sequence[Source]  # the programs, in the order in which they were given
    lines: tuple[_OnMachine, ...]  # one for each machine
    command: str  # of `COMMANDS`
    words: tuple[str, ...]  # further ones of each command line
    output: str  # folder of the results, as a run sees it
    html: str  # likewise of the pages; empty: none
    shared: Mapping[str, bytes]  # content of the files that many of them read, by name

    def __len__(self) -> int:
        """How many runs there are."""
        return len(self.sources) * len(self.lines)

    def job(self, rank: int) -> BatchJob:
        """A run."""
        line, source = self._of(rank)
        target = os.path.join(self.output, line.below, source.place)
        page = os.path.join(self.html, line.below, f"{source.place}.html") if self.html else ""
        words = [self.command, self.base.name_of(source.path), "-m", line.word]
        words += ["-o", target] if self.command in WRITES else []
        words += ["--json", f"{target}.json", *(["--html", page, "--html-script", "beside"] if page else [])]
        words += [*(["-q"] if _AMOUNT.isdisjoint(self.words) else []), *self.words]
        return BatchJob(source.path, line.given, tuple(words), target)

    def files(self, rank: int) -> dict[str, bytes]:
        """What a run reads."""
        line, source = self._of(rank)
        name = self.base.name_of(source.path)
        found = {name: read_file(source.path)}
        for called, path in called_files(source.path, line.machine, self.base.path_of(".")):
            found[self.base.name_of(called)] = read_file(path)
        return found | {key: content for key, content in self.shared.items() if key in line.files}

    def size_bytes(self, rank: int) -> int:
        """How large the program of a run is."""
        try:
            return os.path.getsize(self._of(rank)[1].path)
        except OSError:
            return 0

    def _of(self, rank: int) -> tuple[_OnMachine, Source]:
        line, source = divmod(rank, len(self.sources))
        return self.lines[line], self.sources[source]


def plan(
    sources: Sequence[Source],
    machines: Sequence[str],
    output: str,
    command: str,
    options: Sequence[str],
    html: str | Path | None,
    base: Base,
) -> Plan:
    """The runs of programs on machines."""
    if not machines:
        raise ArgumentError("no machine: name one with -m")
    labels = [Path(machine).stem for machine in machines]
    if twice := {label for label in labels if labels.count(label) > 1}:
        raise ArgumentError(f"two machines would be written to {output}/{min(twice)}: rename one of the files")
    for word in options:
        if word.partition("=")[0] in _OF_ONE_RUN:
            raise ArgumentError(f"{word} behind --: names a file of one run; a batch has -m, -o and --html itself")
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
    """The words as a run sees them, and the files among them, by name."""
    words: list[str] = []
    files: list[tuple[str, str]] = []
    for word in options:
        option, sign, value = word.partition("=") if word.startswith("--") else ("", "", word)
        if value and os.path.isfile(value):
            name = base.name_of(value)
            files.append((name, value))
            words.append(f"{option}{sign}{name}")
        else:
            words.append(word)
    return words, files
