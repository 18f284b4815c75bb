"""The tests as FANUC programs, instructions for the operator, and ``RESULTS.toml``: written, and read for the fit."""

import dataclasses
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from importlib import resources
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from shapegcode.characterization import air_tests
from shapegcode.characterization.result import CharacterisationTests, WrittenTest
from shapegcode.errors import ArgumentError, FileError, Problem
from shapegcode.io.data_file import write_text
from shapegcode.machine import Machine
from shapegcode.program import decimal
from shapegcode.settings.keys import Count, Float, InlineTable, Positive, Text, TomlTable, key
from shapegcode.settings.load import KeyProblem, line_of, parsed, read_text, validated


def write_characterization_tests(
    folder: str | Path, machine: Machine, box: str | air_tests.AirBox = "0:100,0:100,0:20"
) -> CharacterisationTests:
    """Write test programs that identify a controller's parameters, and instructions for the operator.

    The folder gets the programs, ``RESULTS.toml`` to fill in, and ``README.txt``. All moves are in the air.

    Args:
        folder: output folder, created if missing.
        machine: source of least increment, largest feeds and rapid rates.
        box: range of the tests, mm from their start point, "X0:X1,Y0:Y1,Z0:Z1".

    Returns:
        The tests with their expected durations, in the order of ``RESULTS.toml``.

    Raises:
        ArgumentError: the box or the feeds are too small; the folder contains a RESULTS.toml, which may be filled in.
        OSError: the folder or a file cannot be written.
    """
    box = air_tests.AirBox.parse(box) if isinstance(box, str) else box
    out = Path(folder)
    tests = air_tests.make_tests(machine, box)
    if (out / SHEET).exists():
        raise ArgumentError(f"{out / SHEET} exists and may contain results: specify another folder")
    out.mkdir(parents=True, exist_ok=True)
    for test in {test.number: test for test in reversed(tests)}.values():
        write_text(out / test.program, program_text(test, box, machine))
    write_text(out / "README.txt", readme_text(tests, machine, box))
    write_text(out / SHEET, sheet_text(tests, machine, box))
    timing = air_tests.ControllerTiming.of(machine)
    written = tuple(
        WrittenTest(t.name, t.program, t.kind, t.override_percent, air_tests.program_time_s(t, timing), t.purpose)
        for t in tests
    )
    return CharacterisationTests(machine.name, str(folder), str(box), written)


def program_text(test: air_tests.AirTest, box: air_tests.AirBox, machine: Machine) -> str:
    """Program of a test: incremental, no spindle, no reference point, no tool change, without loops."""
    decimals = max(1, round(-math.log10(machine.controller.least_increment_mm)))
    shared = test.name.startswith("override")  # one program, run at several overrides
    title = "OVERRIDE" if shared else test.name.upper().replace("_", "-")
    seconds = air_tests.program_time_s(replace(test, override_percent=100), air_tests.ControllerTiming.of(machine))
    sides = [f"{a}{low:g}/{high:g}" for a, low, high in zip(air_tests.AXES, box.low, box.high, strict=True)]
    lines = ["%", f"O{test.number:04d}({title})", f"({test.purpose})"]
    lines += [f"(BOX FROM START POINT {sides[0]})", f"({sides[1]} {sides[2]} MM)"]
    lines += [f"(ABOUT {seconds:.0f} S IN TOTAL, AIR ONLY)", "(INCREMENTAL, ENDS WHERE IT BEGAN)"]
    lines.append("G21 G17 G91 G94 G64")
    for part in test.parts:
        mode: tuple[str, float] | None = None
        if part.pattern == "exact":
            lines.append("G61")
        for block in air_tests.steps(part):
            if block.length_mm == 0.0:
                lines.append(f"G04 P{round(block.dwell_s * 1000.0)}")
                continue
            word = _word(part.axis, block.length_mm, decimals)
            now = ("G00" if part.pattern == "rapid" else "G01", block.feed_mm_per_min)
            code = "" if mode is not None and now[0] == mode[0] else f"{now[0]} "
            feed = "" if now[0] == "G00" or now == mode else f" {_word('F', block.feed_mm_per_min, 1)}"
            lines.append(f"{code}{word}{feed}")
            mode = now
        if part.pattern == "exact":
            lines.append("G64")
    return "\n".join([*lines, "G90", "M30", "%"]) + "\n"


def _word(address: str, value: float, decimals: int) -> str:
    """Format a word with a decimal point and no zero before it."""
    return address + re.sub(r"^(-?)0\.(?=\d)", r"\1.", decimal(value, decimals))


def readme_text(tests: Sequence[air_tests.AirTest], machine: Machine, box: air_tests.AirBox) -> str:
    """Instructions for the operator."""
    timing = air_tests.ControllerTiming.of(machine)
    watch, logs = ([test for test in tests if test.kind == kind] for kind in ("stopwatch", "log"))
    axes = zip(air_tests.AXES, machine.axes.as_tuple(), strict=True)
    rates = ", ".join(f"{name} {axis.rapid_mm_per_min:g}" for name, axis in axes)
    feed = max(part.feed_mm_per_min for test in tests for part in test.parts if part.pattern != "rapid")

    def row(test: air_tests.AirTest) -> str:
        seconds = air_tests.program_time_s(test, timing)
        note = f"override {test.override_percent} %" if test.name.startswith("override") else ""
        return f"  {test.program}  {test.name:<15} {seconds:7.1f} s  {test.purpose.capitalize()}  {note}".rstrip()

    text = (resources.files("shapegcode") / "data" / "characterization_readme.txt").read_text(encoding="utf-8")
    return text.format(
        machine=machine.name, low=box.low, high=box.high, feed=feed, rates=rates,
        watch="\n".join(map(row, watch)), watch_min=sum(air_tests.program_time_s(test, timing) for test in watch) / 60,
        logs="\n".join(map(row, logs)), logs_s=sum(air_tests.program_time_s(test, timing) for test in logs),
    )  # fmt: skip


SHEET = "RESULTS.toml"  # file name

_Whole = Annotated[Count, Field(ge=1, le=1_000_000)]


class _PartTable(InlineTable):
    """A part, as `air_tests.Part`."""

    pattern: air_tests.Pattern = key("kind of move")
    axis: Literal["X", "Y", "Z"] = key("axis of the moves", default="X")
    count: _Whole = key("number of moves", default=1)
    length_mm: Annotated[Float, Field(ge=-1e5, le=1e5)] = key("length of a move", default=0.0)
    feed_mm_per_min: Annotated[Float, Field(ge=0, le=1e6)] = key("cutting feed, or the rapid rate", default=0.0)
    stride: _Whole = key("moves in one direction", default=1)
    dwell_s: Annotated[Float, Field(ge=0, le=1e4)] = key("dwell after each move, or the pause", default=0.0)

    @model_validator(mode="after")
    def _moves(self) -> Self:
        for name in ("length_mm", "feed_mm_per_min"):
            if self.pattern != "pause" and getattr(self, name) == 0.0:
                raise KeyProblem(name, 0.0, "must not be 0 with motion")
        return self


class _TestTable(TomlTable):
    program: Annotated[Text, Field(pattern=r"^O(\d{1,8})\.nc$")] = key("file name, such as O7001.nc")
    override_percent: Annotated[Count, Field(ge=1, le=254)] = key("feed override", default=100)
    times_s: tuple[Annotated[Positive, Field(lt=86_400)], ...] = key("stopwatch times", default=())
    log: Text | None = key("file of the servo log", default=None)
    parts: Annotated[tuple[_PartTable, ...], Field(min_length=1)] = key("parts of the program")


class _SheetTable(TomlTable):
    resolution_s: Annotated[Float, Field(ge=1e-6, le=10)] = key("step of the stopwatch", default=0.1)
    reaction_s: Annotated[Float, Field(ge=0, le=10)] = key("standard deviation of start and stop by hand", default=0.1)
    tests: Annotated[dict[str, _TestTable], Field(min_length=1)] = key(
        "as `shapegcode characterize --write` wrote them"
    )


@dataclass(frozen=True)
class FilledSheet:
    """Results of the tests."""

    file: str  # path
    tests: dict[str, air_tests.AirTest]  # every test of the file
    times_s: dict[str, tuple[float, ...]]  # stopwatch times by test; tests without times are omitted
    logs: dict[str, Path]  # servo log by test
    resolution_s: float  # step of the stopwatch
    reaction_s: float  # standard deviation of the operator's start and stop together
    lines: dict[str, int]  # line of each test in the file


def read_sheet(path: Path) -> FilledSheet:
    """Read ``RESULTS.toml``; a log test without a name uses ``<test>.csv`` next to the file, if present."""
    text = read_text(path, FileError)
    sheet = validated(_SheetTable, parsed(text, str(path), FileError), str(path), text, FileError)
    logs: dict[str, Path] = {}
    tests: dict[str, air_tests.AirTest] = {}
    for name, test in sheet.tests.items():
        kind: air_tests.Kind = "stopwatch" if test.log is None else "log"
        parts = tuple(air_tests.Part(**part.model_dump()) for part in test.parts)
        tests[name] = air_tests.AirTest(name, int(test.program[1:-3]), kind, "", parts, test.override_percent)
        if test.log is None:
            continue
        file = path.parent / (test.log or f"{name}.csv")
        if file.is_file():
            logs[name] = file
        elif test.log:
            where = f"tests.{name}.log"
            raise FileError(str(path), (Problem(where, test.log, f"no such file: {file}", line_of(where, text)),))
    times = {name: test.times_s for name, test in sheet.tests.items() if test.times_s}
    lines = {name: line_of(f"tests.{name}", text) or 1 for name in sheet.tests}
    return FilledSheet(str(path), tests, times, logs, sheet.resolution_s, sheet.reaction_s, lines)


def sheet_text(tests: Sequence[air_tests.AirTest], machine: Machine, box: air_tests.AirBox) -> str:
    """Text of the file to fill in."""
    timing = air_tests.ControllerTiming.of(machine)
    lines = [
        f"# Results of the characterization tests of {machine.name}; box from the start point, mm: {box}",
        "# Fill in times_s (one or more times in s, from cycle start to the end of the program), or put the servo log",
        "# of a log test next to this file and name it. Leave tests empty that were not run. Do not change parts.",
        "",
        "resolution_s = 0.1  # step of the stopwatch",
        "reaction_s = 0.1  # scatter (standard deviation) of starting and stopping by hand; 0 if read off the control",
        "",
    ]
    for test in tests:
        seconds = air_tests.program_time_s(test, timing)
        lines += [f"[tests.{test.name}]  # {test.purpose.lower()}", f'program = "{test.program}"']
        if test.kind == "stopwatch":
            lines += [f"override_percent = {test.override_percent}", f"times_s = []  # expected: about {seconds:.1f} s"]
        else:
            lines.append(f'log = ""  # for example "{test.name}.csv"; about {seconds:.0f} s')
        lines.append("parts = [")
        for part in test.parts:
            values = [
                f'{name} = "{value}"' if isinstance(value, str) else f"{name} = {round(value, 9)!r}"
                for name, value in dataclasses.asdict(part).items()
            ]
            lines.append(f"  {{ {', '.join(values)} }},")
        lines += ["]", ""]
    return "\n".join(lines)
