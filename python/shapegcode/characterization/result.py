"""What the tests of a controller are, and what their results say: figures, tables, next step."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from shapegcode.characterization.facts import ControllerFact
from shapegcode.characterization.plan import Kind
from shapegcode.machine import Machine
from shapegcode.results.json import hidden
from shapegcode.results.result import Result
from shapegcode.results.table import Column, Table

__all__ = ["Characterisation", "CharacterisationTests", "WrittenTest"]


@dataclass(frozen=True)
class WrittenTest:
    """One run of one program.

    Attributes:
        name: of the test, as in ``RESULTS.toml``.
        program: name of its file.
        kind: "stopwatch": timed from start to end; "log": recorded by the control.
        override_percent: feed override at which it is run.
        expected_s: how long it lasts on a controller as the machine file says.
        purpose: what it is for.
    """

    name: str
    program: str
    kind: Kind
    override_percent: int
    expected_s: float
    purpose: str


@dataclass(frozen=True, repr=False, eq=False)
class CharacterisationTests(Result):
    """The test programs that were written.

    Attributes:
        machine: name of the machine.
        folder: where they are, with ``README.txt`` and ``RESULTS.toml``.
        box: where they move, mm from the start point, "X0:X1,Y0:Y1,Z0:Z1".
        tests: in the order of the folder; several may share a program.
        warnings: none.
    """

    machine: str
    folder: str
    box: str
    tests: tuple[WrittenTest, ...]
    warnings: tuple[str, ...] = ()

    @property
    def ok(self) -> bool:
        """They are written."""
        return True

    @property
    def answer(self) -> str:
        """How many, and where."""
        watch, log = (sum(test.expected_s for test in self.tests if test.kind == kind) for kind in ("stopwatch", "log"))
        return (
            f"{len(self.tests)} tests of {self.machine} in {self.folder}: {watch / 60.0:.0f} min with a stopwatch, "
            f"{log:.0f} s with a servo log; box from the start point, mm: {self.box}"
        )

    @property
    def next_step(self) -> str:
        """To run them."""
        return f"read {self.folder}/README.txt, run the tests, fill in {self.folder}/RESULTS.toml"

    def tables(self) -> list[Table]:
        """One row for each test."""
        columns = (
            Column("program", text=True),
            Column("test", value="name", text=True),
            Column("for", value=_run_for, text=True),
            Column("expected", "s", "expected_s", digits=1),
            Column("purpose", value=lambda test: test.purpose.lower(), text=True),
        )
        return [Table("", columns, self.tests)]


def _run_for(test: WrittenTest) -> str:
    return test.kind if test.override_percent == 100 else f"{test.kind} {test.override_percent} %"


@dataclass(frozen=True, repr=False, eq=False)
class Characterisation(Result):
    """What a controller does with blocks, as the results of its tests say.

    Attributes:
        machine: name of the machine whose file the facts are compared with.
        findings: one for each quantity, known or not.
        files: what was read.
        fitted: the machine with everything that is known.
        remarks: for each key of the machine file that was set, by its dotted name: interval and source.
        warnings: contradictions: results that do not go with the others, with their place.
    """

    machine: str
    findings: tuple[ControllerFact, ...]
    files: tuple[str, ...]
    fitted: Machine = field(metadata=hidden())
    remarks: Mapping[str, str] = field(metadata=hidden())
    warnings: tuple[str, ...]

    @property
    def ok(self) -> bool:
        """No result contradicts the others."""
        return not self.warnings

    @property
    def answer(self) -> str:
        """How much is known."""
        known = sum(each.value is not None for each in self.findings)
        said = (
            f"{known} of {len(self.findings)} quantities of {self.machine} are known, {len(self.remarks)} keys measured"
        )
        return said if self.ok else f"{said}; {len(self.warnings)} CONTRADICTIONS"

    @property
    def next_step(self) -> str:
        """To repeat what contradicts, else to use the machine file."""
        if not self.ok:
            return "repeat the tests that contradict the others"
        return "shapegcode machine show explains the machine file with these values, which -o FILE writes"

    def next_step_after(self, file: str) -> str:
        """The same where the machine file was written.

        Args:
            file: name of it.

        Returns:
            One sentence.
        """
        return f"shapegcode machine show {file} explains it" if self.ok else self.next_step

    def to_toml(self) -> str:
        """The machine file with everything that is known; a remark stands behind each key that was measured."""
        return self.fitted.to_toml(self.remarks)

    def tables(self) -> list[Table]:
        """One row for each quantity: value, interval, what the machine file has; times in ms."""
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
