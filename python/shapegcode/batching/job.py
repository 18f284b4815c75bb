"""One run of a command as data: what travels to a process, here or on another machine, and what comes back.

The folder of a run looks like the folder the batch was started in, with nothing but the files of the run in it. So a
run reads and writes the very bytes that the same command would, typed by hand.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from shapegcode.results.made import this_version

Ending = Literal["ended", "crashed", "killed", "out of time", "out of memory", "other version"]
"""How a run ended: by itself with an exit code, or not."""

FAILED_CODES = {97: "crashed", 98: "out of memory"}
"""Exit codes of a run that are no command's."""


@dataclass(frozen=True)
class Base:
    """The folder in which a batch was begun: a run sees names from there, also when it goes on from another folder."""

    folder: str  # its absolute path

    def name_of(self, path: str | Path) -> str:
        """Name of a file in the folder of a run."""
        return os.path.relpath(path, self.folder)

    def path_of(self, name: str) -> str:
        """The inverse of it."""
        return os.path.normpath(os.path.join(os.path.relpath(self.folder), name))


@dataclass(frozen=True)
class BatchJob:
    """A run that is to be done."""

    program: str  # what it is of, as it was given
    machine: str
    words: tuple[str, ...]  # of the command line
    output: str  # its main file, as a name in its folder; the JSON is beside it

    @property
    def key(self) -> str:
        """What it is called in the manifest: its main file."""
        return self.output

    @property
    def report(self) -> str:
        """Name of its JSON."""
        return f"{self.output}.json"


@dataclass(frozen=True)
class Packed:
    """A run with all that it reads; nothing in it names a file of the machine that sends it."""

    words: tuple[str, ...]  # of the command line
    files: Mapping[str, bytes]  # content by name in the folder of the run
    version: str  # of shapegcode that it is meant for
    fingerprint: str  # of all of this: equal ones give equal results
    seconds: float = 0.0  # that it may take; 0: any time
    memory_bytes: int = 0  # that it may need; 0: any
    scratch: str = ""  # folder for the folder of the run; empty: where temporary files go


@dataclass(frozen=True)
class JobOutcome:
    """What came back."""

    ending: Ending  # how it ended
    code: int  # exit code of the command; 0 where it did not end by itself
    said: str  # what it wrote to standard output
    complained: str  # what it wrote to standard error, or why it did not end by itself
    files: Mapping[str, bytes]  # content of what it wrote, by name in its folder
    wall_s: float = 0.0  # how long it took
    cpu_s: float = 0.0  # processor time
    peak_bytes: int = 0  # most memory that it had at a time


def pack(
    job: BatchJob, files: Mapping[str, bytes], *, seconds: float = 0.0, memory_bytes: int = 0, scratch: str = ""
) -> Packed:
    """A run that can travel."""
    version = this_version()
    return Packed(
        job.words, files, version, _fingerprint(job.words, files, version), seconds, memory_bytes, scratch
    )  # fmt: skip


def _fingerprint(words: Sequence[str], files: Mapping[str, bytes], version: str) -> str:
    hashes = {name: hashlib.sha256(content).hexdigest() for name, content in files.items()}
    whole = json.dumps([version, list(words), hashes], sort_keys=True)
    return hashlib.sha256(whole.encode()).hexdigest()
