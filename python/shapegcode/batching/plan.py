"""The runs of a batch: programs times machines, each with the words of its command line and the files it reads."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from shapegcode.batching.inputs import Source, called_files
from shapegcode.batching.job import BatchJob, working_name
from shapegcode.errors import ArgumentError
from shapegcode.machine import Machine

__all__ = ["COMMANDS", "Plan", "plan"]

COMMANDS = ("convert", "time", "check", "feed", "measure", "simulate")
"""Commands of one program that can be run over many."""

_WRITES = ("convert", "feed")
_OF_ONE_RUN = (
    "-o", "--output", "-m", "--machine", "--json", "--html", "--html-script", "--csv", "--npz", "--plots",
)  # fmt: skip


@dataclass(frozen=True)
class Plan:
    """What is to be done.

    Attributes:
        jobs: in the order in which the programs were given, machine by machine.
        shared: content of the files that many of them read, by name.
    """

    jobs: tuple[BatchJob, ...]
    shared: Mapping[str, bytes]


def plan(
    sources: Sequence[Source],
    machines: Sequence[str],
    output: str,
    command: str,
    options: Sequence[str],
    html: str | Path | None,
) -> Plan:
    """The runs of programs on machines.

    Args:
        sources: the programs.
        machines: files or names of built-in ones.
        output: folder of the results.
        command: of `COMMANDS`.
        options: further words of each command line.
        html: folder of the pages; None: none.

    Returns:
        The runs.

    Raises:
        ArgumentError: there is no machine, or two would have the same folder.
        MachineError: one is none.
        OSError: a file cannot be read.
    """
    if not machines:
        raise ArgumentError("no machine: name one with -m")
    labels = [Path(machine).stem for machine in machines]
    if twice := {label for label in labels if labels.count(label) > 1}:
        raise ArgumentError(f"two machines would be written to {output}/{min(twice)}: rename one of the files")
    loaded = [Machine.load(machine) for machine in machines]
    for word in options:
        if word.partition("=")[0] in _OF_ONE_RUN:
            raise ArgumentError(f"{word} behind --: names a file of one run; a batch has -m, -o and --html itself")
    words, given = _with_files(options)
    shared = {name: Path(path).read_bytes() for name, path in given}
    jobs: list[BatchJob] = []
    for name, label, machine in zip(machines, labels, loaded, strict=True):
        below = label if len(machines) > 1 else ""
        own = [(working_name(name), name)] if os.path.exists(name) else []
        shared |= {key: Path(path).read_bytes() for key, path in own}
        machine_word = own[0][0] if own else name
        for source in sources:
            target = os.path.join(working_name(output), below, source.place)
            page = os.path.join(working_name(html), below, f"{source.place}.html") if html else ""
            program = working_name(source.path)
            line = [command, program, "-m", machine_word, *(["-o", target] if command in _WRITES else [])]
            line += ["--json", f"{target}.json", *(["--html", page, "--html-script", "beside"] if page else [])]
            line += [*([] if _says_how_much(words) else ["-q"]), *words]
            files = dict(_read_by(source, machine))
            jobs.append(
                BatchJob(
                    source.path, name, tuple(line), (*files.items(), *own, *given), target, os.path.getsize(source.path)
                )
            )
    return Plan(tuple(jobs), shared)


def _read_by(source: Source, machine: Machine) -> Iterator[tuple[str, str]]:
    yield working_name(source.path), source.path
    for name, file in called_files(source.path, machine):
        yield working_name(name), file


def _with_files(options: Sequence[str]) -> tuple[list[str], list[tuple[str, str]]]:
    """The words as a run sees them, and the files among them, by name."""
    words: list[str] = []
    files: list[tuple[str, str]] = []
    for word in options:
        option, sign, value = word.partition("=") if word.startswith("--") else ("", "", word)
        if value and os.path.isfile(value):
            name = working_name(value)
            files.append((name, value))
            words.append(f"{option}{sign}{name}")
        else:
            words.append(word)
    return words, files


def _says_how_much(words: Sequence[str]) -> bool:
    return any(word in ("-q", "--quiet", "-v", "--verbose") for word in words)
