"""``RESULTS.toml``, which the operator fills in: written with the tests, read for the fit."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field, model_validator

from shapegcode.characterization.plan import AirBox, AirTest, Part, Pattern
from shapegcode.characterization.timing import ControllerTiming, program_time_s
from shapegcode.errors import FileError, Problem
from shapegcode.settings.keys import Count, Float, InlineTable, Positive, Text, TomlTable, key
from shapegcode.settings.load import parsed, read_text, validated
from shapegcode.settings.problems import KeyProblem, line_of

if TYPE_CHECKING:
    from shapegcode.machine import Machine

__all__ = ["SHEET", "FilledSheet", "read_sheet", "sheet_text"]

SHEET = "RESULTS.toml"
"""Name of the file."""

_Whole = Annotated[Count, Field(ge=1, le=1_000_000)]
_Length = Annotated[Float, Field(ge=-1e5, le=1e5)]
_Feed = Annotated[Float, Field(ge=0, le=1e6)]
_Dwell = Annotated[Float, Field(ge=0, le=1e4)]
_Time = Annotated[Positive, Field(lt=86_400)]
_PROGRAM = re.compile(r"O(\d{1,8})\.nc")


class _PartTable(InlineTable):
    """What a part does, as `plan.Part`."""

    pattern: Pattern = key("kind of move")
    axis: Literal["X", "Y", "Z"] = key("of the moves", default="X")
    count: _Whole = key("number of moves", default=1)
    length_mm: _Length = key("of a move", unit="mm", default=0.0)
    feed_mm_per_min: _Feed = key("cutting feed, or the rapid rate", unit="mm/min", default=0.0)
    stride: _Whole = key("moves in one direction", default=1)
    dwell_s: _Dwell = key("after each move, or the pause", unit="s", default=0.0)

    @model_validator(mode="after")
    def _moves(self) -> _PartTable:
        for name in ("length_mm", "feed_mm_per_min"):
            if self.pattern != "pause" and getattr(self, name) == 0.0:
                raise KeyProblem(name, 0.0, "must not be 0 where something moves")
        return self


class _TestTable(TomlTable):
    """One test."""

    program: Annotated[Text, Field(pattern=_PROGRAM.pattern + "$")] = key("name of its file, such as O7001.nc")
    override_percent: Annotated[Count, Field(ge=1, le=254)] = key("feed override", unit="%", default=100)
    times_s: tuple[_Time, ...] = key("stopwatch times", unit="s", default=())
    log: Text | None = key("file of the servo log", default=None)
    parts: Annotated[tuple[_PartTable, ...], Field(min_length=1)] = key("what the program does")


class _SheetTable(TomlTable):
    """The file."""

    resolution_s: Annotated[Float, Field(ge=1e-6, le=10)] = key("step of the stopwatch", unit="s", default=0.1)
    reaction_s: Annotated[Float, Field(ge=0, le=10)] = key("scatter of start and stop", unit="s", default=0.1)
    tests: Annotated[dict[str, _TestTable], Field(min_length=1)] = key(
        "as `shapegcode characterize --write` wrote them"
    )


@dataclass(frozen=True)
class FilledSheet:
    """What was measured.

    Attributes:
        file: where it was read.
        tests: every test of the file.
        times_s: stopwatch times by test; a test without times is left out.
        logs: servo log by test.
        resolution_s: step of the stopwatch.
        reaction_s: standard deviation of the operator's start and stop together.
        lines: line of each test in the file.
    """

    file: str
    tests: dict[str, AirTest]
    times_s: dict[str, tuple[float, ...]]
    logs: dict[str, Path]
    resolution_s: float
    reaction_s: float
    lines: dict[str, int]


def read_sheet(path: Path) -> FilledSheet:
    """Read ``RESULTS.toml``; a log test without a name takes ``<test>.csv`` beside the file, if it is there."""
    text = read_text(path, FileError)
    sheet = validated(_SheetTable, parsed(text, str(path), FileError), str(path), text, FileError)
    logs: dict[str, Path] = {}
    for name, test in sheet.tests.items():
        if test.log is None:
            continue
        file = path.parent / (test.log or f"{name}.csv")
        if file.is_file():
            logs[name] = file
        elif test.log:
            place = f"tests.{name}.log"
            raise FileError(str(path), (Problem(place, test.log, f"no such file: {file}", line_of(place, text)),))
    return FilledSheet(
        file=str(path),
        tests={name: _test(name, test) for name, test in sheet.tests.items()},
        times_s={name: test.times_s for name, test in sheet.tests.items() if test.times_s},
        logs=logs,
        resolution_s=sheet.resolution_s,
        reaction_s=sheet.reaction_s,
        lines={name: line_of(f"tests.{name}", text) or 1 for name in sheet.tests},
    )


def _test(name: str, table: _TestTable) -> AirTest:
    number = _PROGRAM.fullmatch(table.program)
    assert number is not None
    parts = tuple(Part(**part.model_dump()) for part in table.parts)
    return AirTest(name, int(number[1]), "stopwatch" if table.log is None else "log", "", parts, table.override_percent)


def sheet_text(tests: Sequence[AirTest], machine: Machine, box: AirBox) -> str:
    """The file to fill in."""
    timing = ControllerTiming.of(machine)
    lines = [
        f"# Results of the characterization tests of {machine.name}; box from the start point, mm: {box}",
        "# Fill in times_s (one or more times in s, from cycle start to the end of the program), or put the servo log",
        "# of a log test beside this file and name it. Tests that were not run stay empty. Leave parts as they are.",
        "",
        "resolution_s = 0.1  # step of the stopwatch",
        "reaction_s = 0.1  # scatter (standard deviation) of starting and stopping by hand; 0 if read off the control",
        "",
    ]
    for test in tests:
        lines.append(f"[tests.{test.name}]  # {test.purpose.lower()}")
        lines.append(f'program = "{test.program}"')
        if test.kind == "stopwatch":
            lines.append(f"override_percent = {test.override_percent}")
            lines.append(f"times_s = []  # expected: about {program_time_s(test, timing):.1f} s")
        else:
            lines.append(f'log = ""  # for example "{test.name}.csv"; about {program_time_s(test, timing):.0f} s')
        lines += ["parts = [", *(f"  {_part_text(part)}," for part in test.parts), "]", ""]
    return "\n".join(lines)


def _part_text(part: Part) -> str:
    values = []
    for name, value in dataclasses.asdict(part).items():
        values.append(f'{name} = "{value}"' if isinstance(value, str) else f"{name} = {round(value, 9)!r}")
    return "{ " + ", ".join(values) + " }"
