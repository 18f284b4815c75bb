"""Results of characterization: the parameters of a controller with intervals, and its tests."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar, Self

from shapegcode.characterization.air_tests import Kind
from shapegcode.machine import Machine
from shapegcode.results.json import hidden
from shapegcode.results.result import Result
from shapegcode.results.table import Column, Table

CUTTING_SUM = "cutting time constant + bell time"  # acceleration after interpolation, as from a stopwatch
#: Usual interpolation periods of controls, s.
PERIODS_S = tuple(ms / 1000.0 for ms in (0.125, 0.25, 0.5, 1, 1.5, 2, 2.5, 3, 4, 5, 6, 8, 10, 12, 16))


@dataclass(frozen=True)
class ControllerFact:
    """One parameter of the controller: value, interval and source."""

    quantity: str  # its name, the same for every source
    value: float | str | None  # a number, a word, or None if unknown
    low: float | None  # lower end of the 95 % interval; None for a word, or without a bound
    high: float | None  # upper end
    unit: str  # of value, low and high
    key: str  # dotted key in the machine file; empty: none
    source: str  # how it was measured, "log" or "stopwatch"; empty: not measured
    note: str = ""  # its basis; for an unknown value, the reason
    assumed: float | str | None = None  # former value in the machine file; None: no such key

    @property
    def width(self) -> float:
        """Width of the interval: infinite for an unknown value, 0 for a value that is a word."""
        if self.value is None:
            return math.inf
        return 0.0 if self.low is None or self.high is None else self.high - self.low

    def contradicts(self, other: Self) -> bool:
        """Whether both are numbers whose intervals do not overlap, or texts of which neither contains the other."""
        if self.value is None or other.value is None:
            return False
        if isinstance(self.value, str) or isinstance(other.value, str):
            # "linear or bell" contains "bell"
            return str(self.value) not in str(other.value) and str(other.value) not in str(self.value)
        if self.low is None or self.high is None or other.low is None or other.high is None:
            return False
        return self.low > other.high or other.low > self.high


@dataclass
class Facts:
    """Collects the facts of one source."""

    source: str  # "log" or "stopwatch"
    found: list[ControllerFact] = field(default_factory=list)  # one for each quantity, including unknown ones

    def add(self, quantity: str, value: float, half: float, key: str = "", note: str = "", unit: str = "s") -> None:
        """Add a number with a symmetric interval of half-width *half*, limited to 0 or above."""
        self.add_interval(quantity, value, max(0.0, value - half), value + half, key, note, unit)

    def add_interval(
        self, quantity: str, value: float, low: float, high: float, key: str = "", note: str = "", unit: str = "s"
    ) -> None:
        """Add a number with its interval."""
        self.found.append(ControllerFact(quantity, value, low, high, unit, key, self.source, note))

    def add_word(self, quantity: str, word: str, key: str = "", note: str = "") -> None:
        """Add a quantity whose value is a word."""
        self.found.append(ControllerFact(quantity, word, None, None, "", key, self.source, note))

    def add_unknown(self, quantity: str, why: str, unit: str = "s", high: float | None = None) -> None:
        """Add a quantity that the data do not determine; *high*: an upper limit, if known."""
        self.found.append(ControllerFact(quantity, None, None, high, unit, "", self.source, why))


def mean(values: Sequence[float], halves: Sequence[float]) -> tuple[float, float]:
    """Weighted mean of values with 95 % half-widths, and its half-width; wider if the values disagree."""
    weights = [1.0 / max(half, 1e-9) ** 2 for half in halves]
    total = sum(weights)
    centre = sum(w * v for w, v in zip(weights, values, strict=True)) / total
    half = 1.0 / math.sqrt(total)
    if len(values) > 1:
        chi = sum(w * (v - centre) ** 2 for w, v in zip(weights, values, strict=True)) / (len(values) - 1)
        half *= math.sqrt(max(1.0, 1.96**2 * chi))
    return centre, half


def combine(first: Sequence[ControllerFact], second: Sequence[ControllerFact]) -> list[ControllerFact]:
    """For each quantity the better known of two facts; the note reports a contradiction."""
    other = {each.quantity: each for each in second}
    out: list[ControllerFact] = []
    for each in first:
        rival = other.pop(each.quantity, None)
        if rival is None:
            out.append(each)
            continue
        better, worse = (each, rival) if each.width <= rival.width else (rival, each)
        note = better.note
        if better.contradicts(worse):
            shown = worse.value if isinstance(worse.value, str) else f"{worse.value:.6g} {worse.unit}"
            note = f"{note}; the {worse.source} contradicts it: {shown}".removeprefix("; ")
        out.append(replace(better, note=note))
    return [*out, *other.values()]


@dataclass(frozen=True)
class WrittenTest:
    """One run of one program."""

    name: str  # name of the test, as in ``RESULTS.toml``
    program: str  # program file name
    kind: Kind  # "stopwatch": timed from start to end; "log": recorded by the control
    override_percent: int  # feed override of this run
    expected_s: float  # expected duration by the machine file
    purpose: str  # its purpose


@dataclass(frozen=True, repr=False, eq=False)
class CharacterisationTests(Result):
    """Written test programs.

    Attributes:
        machine: name of the machine.
        folder: folder of the programs, with ``README.txt`` and ``RESULTS.toml``.
        box: range of the moves, mm from the start point, "X0:X1,Y0:Y1,Z0:Z1".
        tests: in the order of their programs; several may share one.
        warnings: none.
    """

    machine: str
    folder: str
    box: str
    tests: tuple[WrittenTest, ...]
    warnings: tuple[str, ...] = ()

    @property
    def answer(self) -> str:
        """Number of tests, folder, duration."""
        watch, log = (sum(test.expected_s for test in self.tests if test.kind == kind) for kind in ("stopwatch", "log"))
        return (
            f"{len(self.tests)} tests of {self.machine} in {self.folder}: {watch / 60.0:.0f} min with a stopwatch, "
            f"{log:.0f} s with a servo log; box from the start point, mm: {self.box}"
        )

    @property
    def next_step(self) -> str:
        """Next step: run the tests and fill in the results."""
        return f"read {self.folder}/README.txt, run the tests, fill in {self.folder}/RESULTS.toml"

    def tables(self) -> list[Table]:
        """Table with one row for each test."""
        columns = (
            Column("program", text=True),
            Column("test", value="name", text=True),
            Column("for", value=lambda row: f"{row.kind} {row.override_percent} %".removesuffix(" 100 %"), text=True),
            Column("expected", "s", "expected_s", digits=1),
            Column("purpose", value=lambda test: test.purpose.lower(), text=True),
        )
        return [Table("", columns, self.tests)]


@dataclass(frozen=True, repr=False, eq=False)
class Characterisation(Result):
    """Controller parameters from the results of the tests.

    Attributes:
        machine: name of the machine with which the facts are compared.
        findings: one for each quantity, including unknown ones.
        files: files read.
        fitted: the machine with all known parameters.
        remarks: interval and source of each key that was set in the machine file, by dotted name.
        warnings: contradictions: results that do not agree with the others, with their location.
    """

    published: ClassVar[tuple[str, ...]] = ("block overlap",)
    machine: str
    findings: tuple[ControllerFact, ...]
    files: tuple[str, ...]
    fitted: Machine = field(metadata=hidden())
    remarks: Mapping[str, str] = field(metadata=hidden())
    warnings: tuple[str, ...]

    @property
    def ok(self) -> bool:
        """True if no result contradicts the others."""
        return not self.warnings

    @property
    def answer(self) -> str:
        """Numbers of known quantities and measured keys."""
        known = sum(each.value is not None for each in self.findings)
        sentence = (
            f"{known} of {len(self.findings)} quantities of {self.machine} are known, {len(self.remarks)} keys measured"
        )
        return sentence if self.ok else f"{sentence}; {len(self.warnings)} CONTRADICTIONS"

    @property
    def next_step(self) -> str:
        """Next step: repeat the tests that contradict others; if there are none, use the machine file."""
        if not self.ok:
            return "repeat the tests that contradict the others"
        return "shapegcode machine show explains the machine file with these values, which -o FILE writes"

    def _next_after(self, file: str) -> str:
        return f"shapegcode machine show {file} explains it" if self.ok else self.next_step

    def to_toml(self) -> str:
        """Text of the machine file with all known parameters, and a remark at each measured key."""
        return self.fitted.to_toml(self.remarks)

    def tables(self) -> list[Table]:
        """Table with one row for each quantity: value, interval, value in the machine file; times in ms."""
        columns = (
            Column("quantity", text=True),
            Column("value", value=lambda fact: "unknown" if fact.value is None else _shown(fact, fact.value, True)),
            Column("95 % interval", value=_interval),
            Column("file has", value=lambda fact: _shown(fact, fact.assumed)),
            Column("remark", value=lambda fact: ": ".join(filter(None, (fact.source, fact.note))), text=True),
        )
        return [Table("", columns, self.findings)]


def _shown(fact: ControllerFact, value: float | str | None, with_unit: bool = False) -> str:
    if not isinstance(value, int | float):
        return value or ""
    scale, unit = (1e3, "ms") if fact.unit == "s" else (1.0, "" if fact.unit == "1" else fact.unit)
    return f"{value * scale:.4g} {unit if with_unit else ''}".rstrip()


def _interval(fact: ControllerFact) -> str:
    if fact.high is None:
        return ""
    if fact.low is None:
        return f"at most {_shown(fact, fact.high)}"
    return f"{_shown(fact, fact.low)} ... {_shown(fact, fact.high)}"
