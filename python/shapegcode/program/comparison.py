"""Compare two programs: the same moves, tools, offsets and functions in the same order? Counts and list of differences.

Both are read as the control executes them. Nothing of a conversion is looked at: the words and canonical moves of
either program are put in order by themselves, and aligned by what they do (Myers 1986).
"""

from __future__ import annotations

import contextlib
import math
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from shapegcode import _core
from shapegcode._core import ArgumentError, ProgramError
from shapegcode.io.units import find_unit
from shapegcode.machine import Machine
from shapegcode.program import Program
from shapegcode.program.compensation import guard_lines
from shapegcode.program.reading import is_program_text, program_bytes, reader_options
from shapegcode.results.result import Result
from shapegcode.results.table import Column, Table

if TYPE_CHECKING:
    from shapegcode.results.page.model import Figure

KINDS = {
    "cuts": "cuts that one program has and the other has not, or that are not the same length",
    "rapids": "rapids, and moves to a reference point or in machine coordinates",
    "tools": "T, M06",
    "spindle": "S, M03, M04, M05, M19",
    "coolant": "M07, M08, M09",
    "offsets": "G43, G44, G49, H, G54 to G59, G54.1, G10, G52, G92, G40, G41, G42, D",
    "cycles": "blocks of drilling cycles",
    "calls": "M98, M198, G65, G66 and codes that call a program; their blocks are compared as they are executed",
    "functions": "other M and G codes, moves of further axes, macro statements left to the control",
    "dwells": "G04",
    "stops": "M00, M01, M02, M30, M99",
    "modal": "plane, G90 or G91, G94, G61 and the like where a cut begins; exact stops in it",
    "feeds": "feeds of cuts and drilling cycles",
    "blocks": "number of blocks of a cut; the lines of emission.* around the cuts of a shaped program",
    "order": "the same, but elsewhere in the program",
    "shaped-rapids": "rapids as cutting moves, marked (SHAPED RAPID)",
    "compensation": "G41 and G42 worked out: the control's offset no longer acts",
    "units": "G20 or G21",
    "end": "one program ends early",
}
"""What may be allowed beside ``path=LENGTH``, and what it covers."""


@dataclass(frozen=True)
class Allowed:
    """Differences that count as none.

    Attributes:
        kinds: of `KINDS`.
        path_um: distance of the paths that is allowed, µm.
    """

    kinds: frozenset[str] = frozenset()
    path_um: float = 0.0

    @classmethod
    def of(cls, words: str | Iterable[str]) -> Allowed:
        """Parse allowed differences such as ``feeds,blocks,path=20um,calls``.

        Args:
            words: in one text with commas, or one by one.

        Returns:
            What they allow.

        Raises:
            ArgumentError: a word is none of `KINDS` and no ``path=LENGTH`` above 0 with its unit.
        """
        kinds, path_um = set(), 0.0
        for word in (words.split(",") if words else ()) if isinstance(words, str) else words:
            name, sign, length = word.strip().partition("=")
            if name == "path":
                path_um = _length_um(word.strip(), length)
            elif name in KINDS and not sign:
                kinds.add(name)
            else:
                raise ArgumentError(
                    f"allow {word.strip()!r}: no difference of this name; there are {', '.join(KINDS)} and path=20um"
                )
        return cls(frozenset(kinds), path_um)

    def covers(self, kind: str, distance_um: float = 0.0) -> bool:
        """Whether a difference is allowed.

        Args:
            kind: of it.
            distance_um: of the paths, where it is one of these.

        Returns:
            Whether it is.
        """
        return distance_um <= self.path_um if kind == "path" else kind in self.kinds

    @property
    def words(self) -> tuple[str, ...]:
        """As `of` takes them."""
        path = (f"path={self.path_um:g}um",) if self.path_um > 0.0 else ()
        return (*(kind for kind in KINDS if kind in self.kinds), *path)


def _length_um(word: str, length: str) -> float:
    match = re.fullmatch(r"([-+]?(?:\d+\.?\d*|\.\d+))\s*([a-zµ]+)", length.strip())
    unit = find_unit(match[2]) if match else None
    if match is None or unit is None or unit.measures != "displacement":
        raise ArgumentError(f"allow {word!r}: path needs a length with its unit (um, mm, inch), for example path=20um")
    value = float(match[1]) * unit.factor * 1e6
    if not 0.0 < value < math.inf:
        raise ArgumentError(f"allow {word!r}: the length must be above 0, for example path=20um")
    return value


_NOUNS = {"tools": "tool calls", "functions": "other functions", "cycles": "drilling blocks", "modal": "modal states"}
_ALWAYS = ("rapids", "tools", "offsets")
_SHOWN = 20
_JOINT_TOLERANCES = 3.0  # a command may leave the path further than the response to it does


@dataclass(frozen=True)
class KindCount:
    """How many there are of one kind.

    Attributes:
        kind: of them, as `shapegcode.program.comparison.KINDS` names it.
        original: in the original.
        emitted: in the other program.
        unchanged: the same in both, at the same place in their order.
    """

    kind: str
    original: int
    emitted: int
    unchanged: int

    @property
    def differs(self) -> bool:
        """Whether one has some that the other has not."""
        return not self.original == self.emitted == self.unchanged


@dataclass(frozen=True)
class ProgramDifference:
    """One thing in which two programs differ.

    Attributes:
        kind: of `shapegcode.program.comparison.KINDS`, "path", or "emission" for a line of emission.* around a cut.
        original_line: from 1; None: the original has nothing there.
        emitted_line: likewise of the other program.
        original: what the original has; empty: nothing.
        emitted: what the other program has.
        allowed: whether it was allowed.
        distance_um: largest distance of the two paths of a cut, µm; 0 for other kinds.
    """

    kind: str
    original_line: int | None
    emitted_line: int | None
    original: str
    emitted: str
    allowed: bool
    distance_um: float = 0.0

    @property
    def place(self) -> str:
        """The line of the original, else that of the other program."""
        if self.original_line is not None:
            return f"line {self.original_line}"
        return f"line {self.emitted_line} of the other program"


@dataclass(frozen=True, repr=False, eq=False)
class Comparison(Result):
    """What differs between two programs.

    Attributes:
        original: name of the one program.
        emitted: name of the other.
        machine: name of the machine whose controller read them.
        counts: of each kind of which one of them has some.
        path_um: largest distance of the paths of a cut that both have, seen from either, µm.
        differences: all, in the order of the original.
        allow: what was allowed, as `shapegcode.program.comparison.Allowed.of` takes it.
        warnings: none.
    """

    published: ClassVar[tuple[str, ...]] = ("comparison of programs",)
    original: str
    emitted: str
    machine: str
    counts: tuple[KindCount, ...]
    path_um: float
    differences: tuple[ProgramDifference, ...]
    allow: tuple[str, ...]
    warnings: tuple[str, ...] = ()

    @property
    def ok(self) -> bool:
        """Whether nothing differs but what was allowed."""
        return not any(True for _ in self.refused)

    @property
    def refused(self) -> Iterator[ProgramDifference]:
        """The differences that were not allowed."""
        return (each for each in self.differences if not each.allowed)

    def count(self, kind: str) -> KindCount:
        """How many there are of a kind.

        Args:
            kind: its name.

        Returns:
            The counts; zeros where neither program has one.
        """
        return next((each for each in self.counts if each.kind == kind), KindCount(kind, 0, 0, 0))

    @property
    def answer(self) -> str:
        """What is unchanged, and how near the paths are; the first difference that was not allowed."""
        shown_counts = [self.count(kind) for kind in _ALWAYS]
        shown_counts += [each for each in self.counts if each.differs and each.kind not in (*_ALWAYS, "emission")]
        counts = ", ".join(f"{each.unchanged} of {each.original} {_noun(each.kind)}" for each in shown_counts)
        sentence = f"{counts} unchanged; path within {self.path_um:.1f} µm"
        refused = list(self.refused)
        if not refused:
            return sentence
        first = next((each for each in refused if each.kind == "end"), refused[0])
        many = f"{len(refused)} differences, one" if len(refused) > 1 else "1 difference,"
        return f"{sentence}; {many} at {first.place}: {first.kind}"

    @property
    def next_step(self) -> str:
        """The one thing to do next, in one sentence."""
        first = next(self.refused, None)
        if first is None:
            return f"nothing: the programs do the same{', but for what was allowed' if self.differences else ''}."
        if first.kind == "emission" and first.original_line is not None:
            lacks = "the other program lacks lines that a shaped cut needs for its verdict to hold"
            return f"look at {first.place}: {lacks}."
        words = [*self.allow, first.kind.replace("emission", "blocks")]
        if first.kind == "path":
            words = [word for word in self.allow if not word.startswith("path=")]
            words.append(f"path={math.ceil(max(each.distance_um for each in self.refused))}um")
        return f"look at {first.place}; if that is meant, allow it: --allow {','.join(words)}."

    def key_figures(self) -> tuple[Figure, ...]:
        """The distance of the paths, and how many differences there are."""
        from shapegcode.results.page.model import Figure

        return (
            Figure("path within", "µm", None, self.path_um, 1, key_after="path_um"),
            Figure("differences not allowed", "", None, len(list(self.refused)), 0),
        )

    def tables(self) -> list[Table]:
        """Number of differences of each kind, then the differences, with those that are not allowed first."""
        what = Column("what", value=lambda row: _noun(row.kind), left=True)
        counts = Table(
            "", (what, Column("original"), Column("other", value="emitted"), Column("unchanged")), self.counts
        )
        if not self.differences:
            return [counts]
        refused = list(self.refused)
        shown = [*refused, *(each for each in self.differences if each.allowed)][:_SHOWN]
        more = len(self.differences) - len(shown)
        columns = (
            Column("kind", left=True),
            Column("line", value="original_line"),
            Column("other line", value="emitted_line"),
            Column(Path(self.original).name, value="original", text=True),
            Column(Path(self.emitted).name, value="emitted", text=True),
            Column("allowed", value=lambda row: "yes" if row.allowed else "no"),
        )
        caption = f"{more} more: --json FILE has all" if more else ""
        return [counts, Table("differences", columns, shown, caption=caption, sections=(min(len(refused), _SHOWN),))]


def _noun(kind: str) -> str:
    return _NOUNS.get(kind, kind)


_COMPENSATED = re.compile(rb"G4[12](?!\d)", re.IGNORECASE)


def compare(
    original: Program | str | Path,
    emitted: Program | str | Path,
    machine: Machine | str | Path | None = None,
    *,
    allow: Allowed | str | Iterable[str] = (),
) -> Comparison:
    """Hold a program against another one: what has one of them that the other has not?

    Calls, macros and coordinate modes are compared as the plain blocks that they come to. The paths of a cut are
    followed along each other, so that it may have other blocks.

    Args:
        original: the one program, or its file; a file that is cut off is read as far as it goes.
        emitted: the other one, for example what `convert` made of it.
        machine: whose controller reads them; None: that which read a `Program` of the two, else the built-in
            ``vx500``.
        allow: differences that are allowed, for example ``"feeds,blocks,path=20um"``.

    Returns:
        Counts, distance of the paths, and every difference with its lines.

    Raises:
        ArgumentError: `allow` has a word that is none; a program was read with other settings than the machine has.
        ProgramError: a file is no program that can be read.
        OSError: a file cannot be read.
    """
    if machine is None:
        machine = next((each.reading.machine for each in (original, emitted) if isinstance(each, Program)), "vx500")
    machine = Machine.of(machine)
    allowed = allow if isinstance(allow, Allowed) else Allowed.of(allow)
    (first, first_is_cut), (second, second_is_cut) = _read(original, machine), _read(emitted, machine)
    # Within which cuts of other lengths are the same: a conversion allows any, and judges it later.
    joint_um = allowed.path_um if allowed.path_um < math.inf else _JOINT_TOLERANCES * machine.tolerance.contour_um
    emission = machine.emission
    lines = [line for group in emission.around_cuts.values() for line in group]
    lines += [*emission.prefill_lines, *guard_lines(first.core.expanded_radii_mm, machine)]
    written = ["".join(re.sub(r"\([^)]*\)", "", line).split()) for line in lines]  # as the core compares them
    core = _core.compare_programs(first.core, second.core, reader_options(machine), written, joint_um * 1e-3)
    is_shaped = second.stamp is not None
    differences = [
        ProgramDifference(
            kind=_name(kind),
            original_line=line or None,
            emitted_line=other_line or None,
            original=text,
            emitted=other_text,
            allowed=allowed.covers(_name(kind), distance_mm * 1e3)
            or (kind == _core.ComparedKind.emission and is_shaped and line == 0 and allowed.covers("blocks")),
            distance_um=distance_mm * 1e3,
        )
        for kind, line, other_line, text, other_text, distance_mm in core.differences
    ]
    differences += _compensation(first, second, allowed)
    if (first_is_cut or second_is_cut) and not any(each.kind == "end" for each in differences):
        ends = [max(1, program.text.rstrip().count(b"\n") + 1) for program in (first, second)]
        texts = [f"ends early at line {line}" for line in ends]
        texts[1 if first_is_cut else 0] = "has an end"
        differences.append(ProgramDifference("end", ends[0], ends[1], texts[0], texts[1], allowed.covers("end")))
    return Comparison(
        original=first.source,
        emitted=second.source,
        machine=machine.name,
        counts=tuple(
            KindCount(_name(kind), ours, theirs, unchanged)
            for kind, ours, theirs, unchanged in core.counts
            if ours + theirs
        ),
        path_um=core.path_mm * 1e3,
        differences=tuple(differences),
        allow=allowed.words,
    )


def _name(kind: _core.ComparedKind) -> str:
    return kind.name.replace("_", "-")


def _read(program: Program | str | Path, machine: Machine) -> tuple[Program, bool]:
    """The program, and whether it is cut off: without its end, or within its last line."""
    if isinstance(program, Program):
        program.require_machine(machine)
        return program, False
    try:
        return Program.read(program, machine), False
    except ProgramError:
        if is_program_text(program):
            raise
        text = program_bytes(program, machine.controller.max_program_bytes)
        whole_lines = text[: text.rfind(b"\n") + 1]
        for kept in (text, whole_lines):
            with contextlib.suppress(ProgramError):
                found = Program.from_text(kept + b"\n%\n", machine, source=str(program), folder=Path(program).parent)
                return found, True
        raise


def _compensation(first: Program, second: Program, allowed: Allowed) -> Iterator[ProgramDifference]:
    """Cutter compensation that only one of the programs still has, by offset number."""
    radii = [program.core.expanded_radii_mm for program in (first, second)]
    for number in sorted(radii[0].keys() | radii[1].keys()):
        if radii[0].get(number) == radii[1].get(number):
            continue
        lines: list[int | None] = [None, None]
        texts = ["worked out", "worked out"]
        for at, program in enumerate((first, second)):
            if number in radii[at]:
                found = _COMPENSATED.search(program.text)
                lines[at] = None if found is None else 1 + program.text.count(b"\n", 0, found.start())
                texts[at] = f"G41 or G42 with D{number}"
        is_allowed = allowed.covers("compensation")
        yield ProgramDifference("compensation", lines[0], lines[1], texts[0], texts[1], is_allowed)
