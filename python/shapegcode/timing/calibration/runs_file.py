"""The file of runs (RUNS.toml): programs with the logs of their runs, and their use.

[[runs]]
program = "programs/COVER.NC"
logs = ["logs/COVER-run*.txt"]
"""

from __future__ import annotations

import glob
import re
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, Strict, model_validator

from shapegcode.errors import Problem, RecordError, RunsFileError
from shapegcode.io.data_file import open_file
from shapegcode.io.run_items import ItemTable, stated_feed_unit
from shapegcode.io.run_log import LogFormat, read_run_logs
from shapegcode.io.runs import RunLog
from shapegcode.settings.keys import Positive, Text, TomlTable, key, toml
from shapegcode.settings.load import KeyProblem, line_of, parsed, read_text, validated

Use = Literal["fit", "test"]
_HEAD_BYTES = 4096
_Path = Annotated[str, Strict(), Field(min_length=1)]
_Percent = Annotated[Positive, Field(le=200)]


@dataclass(frozen=True)
class RunEntry:
    """A program and the logs of its runs.

    Attributes:
        program: file.
        logs: files, sorted within each pattern.
        use: "fit", or "test": predicted only, never fitted.
        feed_unit: unit of the feed in the logs; None: found from the data.
        items: (role, name in the log) of the named items.
        format: format of the logs; None: recognized by content.
        override_percent: feed override set by the operator, if a log does not contain it; None: unknown.
        rapid_override_percent: rapid override likewise.
        leave_out: reason not to use the entry; None: used.
        logged_as: name of the program in the logs; None: that of its file, or its O number.
        shared: logs shared with other programs: only runs that name this program are used.
        line: line of the entry in the file; None: unknown.
    """

    program: Path
    logs: tuple[Path, ...]
    use: Use = "fit"
    feed_unit: str | None = None
    items: tuple[tuple[str, str], ...] = ()
    format: LogFormat | None = None
    override_percent: float | None = None
    rapid_override_percent: float | None = None
    leave_out: str | None = None
    logged_as: str | None = None
    shared: tuple[Path, ...] = ()
    line: int | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Names that a log may give to the program."""
        if self.logged_as is not None:
            return (self.logged_as,)
        with open_file(self.program) as file:
            head = file.read(_HEAD_BYTES).decode("latin-1")
        number = re.search(r"^\s*:?(O\d{1,8})\b", head, re.MULTILINE)
        return (self.program.name, number[1]) if number and int(number[1][1:]) else (self.program.name,)

    def read(self) -> tuple[RunLog, ...]:
        """Read the runs in the logs of this entry; a run that names another program is left out.

        Returns:
            The runs, log by log.

        Raises:
            RecordError: a log cannot be used.
            OSError: a log or the program cannot be read.
        """
        found: list[RunLog] = []
        for log in self.logs:
            runs = read_run_logs(
                log, items=dict(self.items), format=self.format, program_name=self.names, feed_unit=self.feed_unit
            )
            if log in self.shared and any(run.program is None for run in runs):
                raise RecordError(
                    f"{log}: it is a log of several programs, and a run in it (from line {runs[0].lines[0]}) names "
                    f"none: it is unknown whether {self.program.name} made it; split the log"
                )
            found += runs
        return tuple(found)


@dataclass(frozen=True)
class RunsFile:
    """A file of runs.

    Attributes:
        path: path of the file.
        entries: in file order, including unused ones.
    """

    path: Path
    entries: tuple[RunEntry, ...]

    @property
    def used(self) -> tuple[RunEntry, ...]:
        """The used entries."""
        return tuple(entry for entry in self.entries if entry.leave_out is None)


class _RunsRow(TomlTable):
    """A program and the logs of its runs."""

    program: _Path = key("the program, relative to this file")
    log: _Path | None = key('one log, or a pattern such as "logs/COVER-*.txt"', default=None)
    logs: Annotated[tuple[_Path, ...], Field(min_length=1)] | None = key(
        "several logs, or patterns, in place of log", default=None
    )
    use: Use = key('"fit": used for the calibration; "test": predicted only', default="fit")
    feed_unit: Text | None = key("unit of the feed in the logs; left out: found from the data", default=None)
    items: dict[Text, Text] | None = key("names of the items in the logs by role", default=None)
    format: LogFormat | None = key("format of the logs; left out: recognized by their content", default=None)
    override_percent: _Percent | None = key(
        "feed override set by the operator, if the log does not contain it", default=None
    )
    rapid_override_percent: _Percent | None = key("rapid override likewise", default=None)
    logged_as: _Path | None = key(
        "name of the program in the logs; left out: that of its file, or its O number", default=None
    )
    leave_out: _Path | None = key("reason not to use it", default=None)

    @model_validator(mode="after")
    def _fits(self) -> _RunsRow:
        if self.log is None and self.logs is None:
            raise ValueError("one of log and logs is required")
        if self.log is not None and self.logs is not None:
            raise KeyProblem("logs", self.logs, "specify only one of log and logs")
        for name, read in (("feed_unit", stated_feed_unit), ("items", ItemTable)):
            value = getattr(self, name)
            try:
                if value is not None:
                    read(value)
            except RecordError as error:
                raise KeyProblem(name, value, str(error).partition(": ")[2]) from error
        return self


class _RunsTable(TomlTable):
    """Contents of a file of runs."""

    runs: Annotated[tuple[_RunsRow, ...], Field(min_length=1)] = key("programs and logs")


def load_runs(path: str | Path) -> RunsFile:
    """Read a file of runs.

    Args:
        path: of the file.

    Returns:
        Its entries; the logs are found, not read.

    Raises:
        RunsFileError: not TOML, wrong keys or values, a program or a log that does not exist, a pattern without a
            match, a log twice for one program; every problem is listed.
        OSError: the file cannot be read.
    """
    path = Path(path)
    text = read_text(path, RunsFileError)
    rows = validated(_RunsTable, parsed(text, str(path), RunsFileError), str(path), text, RunsFileError).runs
    found = _Found(path, text)
    entries = tuple(found.entry(number, row) for number, row in enumerate(rows, start=1))
    if found.problems:
        raise RunsFileError(str(path), tuple(found.problems))
    return RunsFile(path, tuple(replace(entry, shared=found.shared(entry)) for entry in entries))


class _Found:
    """The programs and logs of a file of runs, found on disk."""

    def __init__(self, path: Path, text: str) -> None:
        self.problems: list[Problem] = []
        self._folder = path.parent
        self._text = text
        self._users: dict[Path, list[tuple[int, Path]]] = {}  # by log: number and program of its entries

    def entry(self, number: int, row: _RunsRow) -> RunEntry:
        """Check an entry; its missing or repeated files are added to the problems unless the entry is left out."""
        where = f"runs.{number}"
        program = self._folder / row.program
        if row.leave_out is None and not program.is_file():
            self._problem(f"{where}.program", row.program, "no such file")
        key, used = "log" if row.logs is None else "logs", row.leave_out is None
        logs = [self._logs(f"{where}.{key}", each, number, program, used) for each in row.logs or [row.log or ""]]
        same = ("use", "format", "override_percent", "rapid_override_percent", "leave_out", "logged_as")
        return RunEntry(
            program, tuple(chain.from_iterable(logs)), items=tuple((row.items or {}).items()),
            feed_unit=None if row.feed_unit is None else stated_feed_unit(row.feed_unit),
            line=line_of(where, self._text), **{name: getattr(row, name) for name in same},
        )  # fmt: skip

    def shared(self, entry: RunEntry) -> tuple[Path, ...]:
        """Logs of an entry that others use too."""
        return tuple(log for log in entry.logs if len(self._users.get(log.resolve(), ())) > 1)

    def _logs(self, where: str, pattern: str, number: int, program: Path, used: bool) -> list[Path]:
        found = [Path(each) for each in sorted(glob.glob(str(self._folder / pattern)))]
        found = found or [self._folder / pattern]
        if used and not found[0].is_file():
            self._problem(where, pattern, "matches no file" if glob.has_magic(pattern) else "no such file")
        for log in found if used else ():
            users = self._users.setdefault(log.resolve(), [])
            before = next((one for one, other in users if other.resolve() == program.resolve()), None)
            if before is not None:
                self._problem(where, pattern, f"{log.name} is already a log of runs.{before}: each run counts once")
            users.append((number, program))
        return found

    def _problem(self, where: str, value: str, limit: str) -> None:
        self.problems.append(Problem(where, toml(value), limit, line_of(where, self._text)))
