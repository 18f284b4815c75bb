"""``RESULTS.toml``, which the operator fills in, and the instructions that go with the programs."""

from __future__ import annotations

import dataclasses
import math
import re
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from shapegcode._core import ArgumentError
from shapegcode.characterization.plan import AXES, PATTERNS, Box, Part, Test
from shapegcode.characterization.timing import Timing, program_time_s

if TYPE_CHECKING:
    from shapegcode.machine import Machine

__all__ = ["Results", "read_results", "readme_text", "results_text"]

_MAX_COUNT = 1_000_000
_PART_KEYS = [each.name for each in dataclasses.fields(Part)]


@dataclass(frozen=True)
class Results:
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
    tests: dict[str, Test]
    times_s: dict[str, list[float]]
    logs: dict[str, Path]
    resolution_s: float
    reaction_s: float
    lines: dict[str, int]


def _part_text(part: Part) -> str:
    values = []
    for name in _PART_KEYS:
        value = getattr(part, name)
        values.append(f'{name} = "{value}"' if isinstance(value, str) else f"{name} = {round(value, 9)!r}")
    return "{ " + ", ".join(values) + " }"


def results_text(tests: Sequence[Test], machine: Machine, box: Box) -> str:
    """The file to fill in.

    Args:
        tests: what was written.
        machine: for the expected times.
        box: said in the head.
    """
    timing = Timing.of(machine)
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


def readme_text(tests: Sequence[Test], machine: Machine, box: Box) -> str:
    """Instructions for the operator.

    Args:
        tests: what was written.
        machine: for the expected times.
        box: where the tests move.
    """
    timing = Timing.of(machine)
    watch = [test for test in tests if test.kind == "stopwatch"]
    logs = [test for test in tests if test.kind == "log"]
    rates = ", ".join(f"{n} {a.rapid_mm_per_min:g}" for n, a in zip(AXES, machine.axes.as_tuple(), strict=True))
    feed = max(part.feed_mm_per_min for test in tests for part in test.parts if part.pattern != "rapid")

    def row(test: Test) -> str:
        seconds = program_time_s(test, timing)
        note = f"override {test.override_percent} %" if test.name.startswith("override") else ""
        return f"  {test.program}  {test.name:<15} {seconds:7.1f} s  {test.purpose.capitalize()}  {note}".rstrip()

    text = [
        f"Characterization of {machine.name}",
        "",
        "Before you start",
        "  No tool, no workpiece, no spindle. The programs only move the axes, in the air.",
        f"  From the point at which you start, the tests reach X {box.low[0]:g} to {box.high[0]:g}, "
        f"Y {box.low[1]:g} to {box.high[1]:g}, Z {box.low[2]:g} to {box.high[2]:g} mm.",
        "  Jog to a point from which all of this box is free, fixtures and tool changer included.",
        f"  Cutting feed up to {feed:g} mm/min; rapid at the machine's rate ({rates} mm/min in the machine file:",
        "  compare parameter 1420; a wrong rate makes the rapid time constants wrong).",
        "  The programs are incremental (G91) and end where they began. After a stop in the middle: reset, jog back",
        "  to the start point, begin that program anew. Never restart in the middle.",
        "  First run each program once in single block or dry run, to see where it goes; times count only without.",
        "  Overrides 100 % unless the table says otherwise. Switch look-ahead modes off (G05.1 Q0, G08 P0),",
        "  if you want the figures without them; write down which mode was on.",
        "",
        f"With a stopwatch: about {sum(program_time_s(test, timing) for test in watch) / 60:.0f} minutes",
        "  Time from cycle start to the end of the program, or read the cycle time off the control.",
        "  Put the times into RESULTS.toml (times_s = [34.2] or, for several runs, [34.2, 34.3]).",
        "  Tests may be left out: what then cannot be known is said. The order does not matter.",
        "",
        *(row(test) for test in watch),
        "",
        f"With a servo log: about {sum(program_time_s(test, timing) for test in logs):.0f} s of motion",
        "  Record time and the commanded positions of X, Y, Z (and the actual positions, if you can) every 1 ms, from",
        "  before the start to after the end. Save as CSV with a header line such as",
        "    time_ms,X,Y,Z,X_act,Y_act,Z_act",
        "  in mm, one file for each program, named after the test: log_cutting.csv and so on.",
        "",
        *(row(test) for test in logs),
        "",
        "Then",
        "  shapegcode characterize --fit RESULTS.toml -m MACHINE -o fitted.toml",
        "",
    ]
    return "\n".join(text)


class _Reader:
    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            self.text = path.read_bytes().decode("utf-8-sig")
        except UnicodeDecodeError as error:
            raise ArgumentError(f"{path}: not UTF-8 text") from error
        try:
            self.data = tomllib.loads(self.text)
        except tomllib.TOMLDecodeError as error:
            raise ArgumentError(f"{path}: {error}") from error

    def line(self, table: str, key: str = "") -> int:
        """Line of a key in a table (of the table, if the key is not found), 1 if neither is."""
        inside, found = not table, 1
        for number, line in enumerate(self.text.splitlines(), start=1):
            head = re.match(r"\s*\[\s*([^\]]+?)\s*\]", line)
            if head and "=" not in line[: head.end()]:
                inside = head[1] == table
                found = number if inside else found
            elif inside and key and re.match(rf"\s*{re.escape(key)}\s*=", line):
                return number
        return found

    def fail(self, table: str, key: str, why: str) -> ArgumentError:
        return ArgumentError(f"{self.path}:{self.line(table, key)}: {table}{'.' if table and key else ''}{key}: {why}")

    def number(self, data: dict[str, Any], table: str, key: str, low: float, high: float, default: float) -> float:
        value = data.get(key, default)
        if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
            raise self.fail(table, key, f"{value!r} must be a number from {low:g} to {high:g}")
        return float(value)


def _part(reader: _Reader, name: str, data: object) -> Part:
    table = f"tests.{name}"
    if not isinstance(data, dict) or set(data) - set(_PART_KEYS):
        raise reader.fail(table, "parts", f"{data!r} must be a table of {', '.join(_PART_KEYS)}")
    if data.get("pattern") not in PATTERNS:
        raise reader.fail(table, "parts", f"pattern {data.get('pattern')!r} must be one of {', '.join(PATTERNS)}")
    if data.get("axis", "X") not in AXES:
        raise reader.fail(table, "parts", f"axis {data.get('axis')!r} must be X, Y or Z")
    moving = data["pattern"] != "pause"
    values: dict[str, Any] = {"pattern": data["pattern"], "axis": data.get("axis", "X")}
    for key, low in (("count", 1), ("stride", 1)):
        value = data.get(key, 1)
        if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= _MAX_COUNT:
            raise reader.fail(table, "parts", f"{key} {value!r} must be a whole number from 1 to {_MAX_COUNT}")
        values[key] = value
    for key, limit in (("length_mm", 1e5), ("feed_mm_per_min", 1e6), ("dwell_s", 1e4)):
        value = data.get(key, 0.0)
        good = not isinstance(value, bool) and isinstance(value, int | float) and math.isfinite(value)
        if not good or abs(value) > limit or (key != "length_mm" and value < 0.0):
            raise reader.fail(table, "parts", f"{key} {value!r} must be a number up to {limit:g}")
        values[key] = float(value)
    if moving and (values["length_mm"] == 0.0 or values["feed_mm_per_min"] == 0.0):
        raise reader.fail(table, "parts", "length_mm and feed_mm_per_min of a move must not be 0")
    return Part(**values)


def _times(reader: _Reader, name: str, value: object) -> list[float]:
    table = f"tests.{name}"
    if not isinstance(value, list):
        raise reader.fail(table, "times_s", f"{value!r} must be a list of times in s, such as [34.2]")
    for time in value:
        good = not isinstance(time, bool) and isinstance(time, int | float) and math.isfinite(time)
        if not good or not 0.0 < time < 86_400.0:
            raise reader.fail(table, "times_s", f"{time!r} must be a time in s above 0 and below 86400")
    return [float(time) for time in value]


def read_results(path: Path) -> Results:
    """Read ``RESULTS.toml``; a log test without a name takes ``<test>.csv`` beside the file, if it is there.

    Raises:
        ArgumentError: what is wrong, with file, line, value and limit.
        OSError: the file cannot be read.
    """
    reader = _Reader(path)
    unknown = set(reader.data) - {"tests", "resolution_s", "reaction_s"}
    if unknown:
        key = sorted(unknown)[0]
        raise reader.fail("", key, "unknown key; known here: resolution_s, reaction_s, tests")
    tables = reader.data.get("tests")
    if not isinstance(tables, dict) or not tables:
        raise ArgumentError(f"{path}: no tests: write it with `shapegcode characterize --write`")
    tests: dict[str, Test] = {}
    times: dict[str, list[float]] = {}
    logs: dict[str, Path] = {}
    for name, data in tables.items():
        table = f"tests.{name}"
        if not isinstance(data, dict):
            raise reader.fail("tests", name, "must be a table")
        extra = sorted(set(data) - {"program", "override_percent", "times_s", "log", "parts"})
        if extra:
            known = "program, override_percent, times_s, log, parts"
            raise reader.fail(table, extra[0], f"unknown key; known here: {known}")
        parts = data.get("parts")
        if not isinstance(parts, list) or not parts:
            raise reader.fail(table, "parts", "missing or empty: they say what the program does")
        program = re.fullmatch(r"O(\d{1,8})\.nc", str(data.get("program", "")))
        if not program:
            raise reader.fail(table, "program", f"{data.get('program')!r} must be a name such as O7001.nc")
        percent = reader.number(data, table, "override_percent", 1, 254, 100)
        kind: Literal["stopwatch", "log"] = "log" if "log" in data else "stopwatch"
        tests[name] = Test(
            name, int(program[1]), kind, "", tuple(_part(reader, name, part) for part in parts), round(percent)
        )
        if data.get("times_s"):
            times[name] = _times(reader, name, data["times_s"])
        elif "times_s" in data:
            _times(reader, name, data["times_s"])
        if kind == "log":
            if not isinstance(data["log"], str):
                raise reader.fail(table, "log", f"{data['log']!r} must be the name of a file")
            file = path.parent / (data["log"] or f"{name}.csv")
            if data["log"] and not file.is_file():
                raise reader.fail(table, "log", f"no such file: {file}")
            if file.is_file():
                logs[name] = file
    lines = {name: reader.line(f"tests.{name}") for name in tests}
    resolution = reader.number(reader.data, "", "resolution_s", 1e-6, 10.0, 0.1)
    reaction = reader.number(reader.data, "", "reaction_s", 0.0, 10.0, 0.1)
    return Results(str(path), tests, times, logs, resolution, reaction, lines)
