"""Errors of shapegcode, derived from :class:`ShapegcodeError`; the user can correct all but :class:`RoundTripError`.

From the core: :class:`ArgumentError`, :class:`DesignError`, :class:`NumericError`, :class:`ProgramError`. From settings
files: :class:`FileError` and its subclasses, such as :class:`MachineError`. From measured records:
:class:`RecordError`. Files that cannot be read or written raise Python's :class:`OSError`.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, TypeVar

from shapegcode._core import ArgumentError, DesignError, NumericError, ProgramError, ShapegcodeError

__all__ = [
    "ArgumentError", "DesignError", "FileError", "MachineError", "NumericError", "Problem", "ProgramError",
    "RecordError", "RoundTripError", "RunsFileError", "ShapegcodeError", "StockError", "ToolError",
]  # fmt: skip


def hint(name: str, known: Iterable[str]) -> str:
    """``; did you mean 'known'?`` with the names, at most two, closest to an unknown one; empty if none is."""
    if name.startswith("_"):
        return ""
    import difflib

    names = sorted(each for each in known if not each.startswith("_"))
    words = set(name.lower().split("_"))
    with_all = sorted((each for each in names if words <= {*each.split("_")}), key=len)
    close = difflib.get_close_matches(name, names, n=1) or difflib.get_close_matches(name.lower(), names, n=1)
    alike = sorted(names, key=lambda each: -len(words.intersection(each.split("_"))))[:1]
    near = with_all[:2] or close or [each for each in alike if words & {*each.split("_")}]
    return f"; did you mean {' or '.join(map(repr, near))}?" if near else ""


F = TypeVar("F", bound=Callable[..., Any])

# What gives the thing that a user of other packages looks for: by class, then by attribute.
_INSTEAD = {
    "Machine": {"save": "Path(file).write_text(machine.to_toml())", "list": "Machine.builtin_names()"},
    "Program": {
        "length": "sg.cycle_time(program, machine)",
        "plot": "sg.plot_path(sg.simulate_motion(program, machine))",
    },
    "Shaper": {"apply": "shaper.to_fir(period_s).apply(samples)", "plot": "sg.plot_sensitivity(shaper)"},
}  # fmt: skip
_SAME = {"filter": "apply", "convolve": "apply", "write": "save", "names": "list", "duration": "length"}


def missing_attribute(owner: object, name: str, meant: str = "") -> AttributeError:
    """An AttributeError whose hint is the attribute of `owner`, an object or a class, closest to `meant`."""
    kind = owner if isinstance(owner, type) else type(owner)
    instead = _INSTEAD.get(kind.__name__, {})
    if found := instead.get(name) or instead.get(_SAME.get(name, "")):
        near = f"; use {found}"
    else:  # Python and NumPy ask for many names with an underscore.
        near = "" if name.startswith("_") else hint(meant or name, dir(owner))
    what = f"type object {kind.__name__!r}" if owner is kind else f"{kind.__name__!r} object"
    return AttributeError(f"{what} has no attribute {name!r}{near}")


def with_keyword_hint(function: F) -> F:
    """The function, which names the keyword that was probably meant by one that it does not have."""

    @functools.wraps(function)
    def called(*args: Any, **kwargs: Any) -> Any:
        try:
            return function(*args, **kwargs)
        except TypeError as error:
            wrong = re.search(r"unexpected keyword argument '(\w+)'$", str(error))
            # A deeper traceback: an error inside of the function.
            if wrong is None or error.__traceback__ is None or error.__traceback__.tb_next is not None:
                raise
            import inspect

            names = [name for name in inspect.signature(function).parameters if name != "cls"]
            near = f"{hint(wrong[1], names)}; it takes {', '.join(names)}"
            raise TypeError(f"{function.__qualname__}() has no argument {wrong[1]!r}{near}") from None

    return called  # type: ignore[return-value]


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
