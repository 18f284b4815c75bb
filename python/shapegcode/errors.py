"""Errors of shapegcode, derived from :class:`ShapegcodeError`; the user can correct all but :class:`RoundTripError`.

From the core: :class:`ArgumentError`, :class:`DesignError`, :class:`NumericError`, :class:`ProgramError`. From settings
files: :class:`FileError` and its subclasses, such as :class:`MachineError`. From measured records:
:class:`RecordError`. Files that cannot be read or written raise Python's :class:`OSError`.
"""

from __future__ import annotations

from dataclasses import dataclass

from shapegcode._core import ArgumentError, DesignError, NumericError, ProgramError, ShapegcodeError

__all__ = [
    "ArgumentError", "DesignError", "FileError", "MachineError", "NumericError", "Problem", "ProgramError",
    "RecordError", "RoundTripError", "RunsFileError", "ShapegcodeError", "StockError", "ToolError",
]  # fmt: skip


def located_error(source: str, line: int, column: int, message: str, alarm: int = 0) -> ProgramError:
    """A ProgramError whose message starts with ``source:line:column``."""
    error = ProgramError(f"{source}:{line}:{column}: {message}")
    error.__dict__.update(line=line, column=column, alarm=alarm, file=source)
    return error


@dataclass(frozen=True)
class Problem:
    """One error in a settings file.

    Attributes:
        key: dotted name of the key, for example ``axes.x.max_feed_mm_per_min``; empty: no single key.
        value: the offending value as written in TOML; empty: the key is missing, or no single value is wrong.
        limit: rule for the value.
        line: line number in the file, None if unknown.
    """

    key: str
    value: str
    limit: str
    line: int | None = None

    def __str__(self) -> str:
        """The problem as ``key = value: limit``, without the file's name."""
        subject = f"{self.key} = {self.value}" if self.value else self.key
        return f"{subject}: {self.limit}" if subject else self.limit


class FileError(ShapegcodeError, ValueError):
    """A settings file that cannot be used; the message lists its problems, at most 100, one line each.

    Attributes:
        file: name of the file (or of the built-in data).
        problems: the listed ones, in the order of the keys; one more states how many are not listed.
    """

    def __init__(self, file: str, problems: tuple[Problem, ...]) -> None:
        """Build the message ``file[:line]: key = value: limit``, one line per problem."""
        self.file = file
        self.problems = problems
        heads = (file if problem.line is None else f"{file}:{problem.line}" for problem in problems)
        super().__init__("\n".join(f"{head}: {problem}" for head, problem in zip(heads, problems, strict=True)))


class MachineError(FileError):
    """A machine file, or a dump of a control's parameters, that cannot be used."""


class ToolError(FileError):
    """A tool file that cannot be used."""


class StockError(FileError):
    """A stock file that cannot be used, or that does not match the program."""


class RunsFileError(FileError):
    """A file of runs (programs and their logs) that cannot be used."""


class RecordError(ArgumentError):
    """A record cannot be used: the message gives the defect and the requirement."""


class RoundTripError(ShapegcodeError):
    """The emitted program is wrong: a defect of shapegcode, never of the input. Nothing is written."""
