"""Compares moves, tools, offsets and functions of two programs and their order: counts, list of differences.

Both programs are read as the control executes them, independently of any conversion; then their sequences of moves and
functions are aligned (Myers 1986).
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
    "cuts": "cuts in only one of the programs, or of different length",
    "rapids": "rapids, and moves to a reference point or in machine coordinates",
    "tools": "T, M06",
    "spindle": "S, M03, M04, M05, M19",
    "coolant": "M07, M08, M09",
    "offsets": "G43, G44, G49, H, G54 to G59, G54.1, G10, G52, G92, G40, G41, G42, D",
    "cycles": "blocks of drilling cycles",
    "calls": "M98, M198, G65, G66 and codes that call a program; their blocks are compared as executed",
    "functions": "other M and G codes, moves of further axes, macro statements left to the control",
    "dwells": "G04",
    "stops": "M00, M01, M02, M30, M99",
    "modal": "plane, G90 or G91, G94, G61 and the like at the start of a cut; exact stops in it",
    "feeds": "feeds of cuts and drilling cycles",
    "blocks": "number of blocks of a cut; the lines of emission.* around the cuts of a shaped program",
    "order": "an item that both programs have, at another position in the sequence",
    "shaped-rapids": "rapids as cutting moves, marked (SHAPED RAPID)",
    "compensation": "G41 and G42 expanded: the control's offset has no effect",
    "units": "G20 or G21",
    "end": "one program ends early",
}
"""Words that may be allowed in addition to ``path=LENGTH``, with their meaning."""


@dataclass(frozen=True)
class Allowed:
    """Differences to ignore.

    Attributes:
        kinds: names in `KINDS`.
        path_um: allowed distance of the paths, µm.
    """

    kinds: frozenset[str] = frozenset()
    path_um: float = 0.0

    @classmethod
    def of(cls, words: str | Iterable[str]) -> Allowed:
        """Parse allowed differences such as ``feeds,blocks,path=20um,calls``.

        Args:
            words: one text with commas, or single words.

        Returns:
            The allowed differences.

        Raises:
            ArgumentError: a word that is neither in `KINDS` nor a ``path=LENGTH`` above 0 with its unit.
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
                    f"allow {word.strip()!r}: unknown kind of difference; known are {', '.join(KINDS)} and path=20um"
                )
        return cls(frozenset(kinds), path_um)

    def covers(self, kind: str, distance_um: float = 0.0) -> bool:
        """Whether a difference is allowed.

        Args:
            kind: kind of difference.
            distance_um: distance of the paths, for such a difference.

        Returns:
            True if it is allowed.
        """
        return distance_um <= self.path_um if kind == "path" else kind in self.kinds

    @property
    def words(self) -> tuple[str, ...]:
        """What is allowed, as words that `of` accepts."""
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
_JOINT_TOLERANCES = 3.0  # multiple of tolerance.contour_um, as the command may deviate more than the response


@dataclass(frozen=True)
class KindCount:
    """Counts of one kind.

    Attributes:
        kind: one of `shapegcode.program.comparison.KINDS`, or "emission": lines of emission.* at cuts.
        original: number in the original.
        emitted: number in the other program.
        unchanged: number equal in both, in the same order.
    """

    kind: str
    original: int
    emitted: int
    unchanged: int

    @property
    def differs(self) -> bool:
        """Whether the programs differ in this kind."""
        return not self.original == self.emitted == self.unchanged

    @property
    def changed(self) -> int:
        """Number of items of the original that are missing or differ; if 0, number that only the other program has."""
        return self.original - self.unchanged or self.emitted - self.unchanged


@dataclass(frozen=True)
class ProgramDifference:
    """One difference of two programs.

    Attributes:
        kind: one of `shapegcode.program.comparison.KINDS`, "path", or "emission" for a line of emission.* at a cut.
        original_line: line in the original, from 1; None: nothing there.
        emitted_line: line in the other program, likewise.
        original: content of the original; empty: nothing.
        emitted: content of the other program.
        allowed: the difference is allowed.
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
        """Line of the original, else that of the other program."""
        if self.original_line is not None:
            return f"line {self.original_line}"
        return f"line {self.emitted_line} of the other program"


@dataclass(frozen=True, repr=False, eq=False)
class Comparison(Result):
    """Differences between two programs.

    Attributes:
        original: name of the first program.
        emitted: name of the second program.
        machine: name of the machine whose controller read them.
        counts: counts of each kind that occurs in the first program, the second or both.
        path_um: largest distance of a point of either path from the other path, in cuts that both programs have, µm.
        differences: all differences; those of compensation and of a missing end come last.
        allow: allowed differences, in the form for `shapegcode.program.comparison.Allowed.of`.
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
        """Whether there are no differences except allowed ones."""
        return not any(True for _ in self.refused)

    @property
    def refused(self) -> Iterator[ProgramDifference]:
        """The differences that are not allowed."""
        return (each for each in self.differences if not each.allowed)

    def count(self, kind: str) -> KindCount:
        """Find the counts of a kind.

        Args:
            kind: its name.

        Returns:
            The counts; zeros if neither program has items of this kind.
        """
        return next((each for each in self.counts if each.kind == kind), KindCount(kind, 0, 0, 0))

    @property
    def answer(self) -> str:
        """Unchanged items, distance of the paths; of the differences not allowed an early end, else the first."""
        always = (self.count(kind) for kind in _ALWAYS)
        unchanged = ", ".join(f"{each.unchanged} of {each.original} {_noun(each.kind)}" for each in always)
        others = (each for each in self.counts if each.differs and each.kind not in (*_ALWAYS, "emission"))
        changed = ", ".join(f"{each.changed} of {each.original} {_noun(each.kind)}" for each in others)
        refused = list(self.refused)
        if changed:
            changed = f", {changed} changed{'' if refused else ' as allowed'}"
        sentence = f"{unchanged} unchanged{changed}; programmed paths within {self.path_um:.1f} µm of each other"
        if not refused:
            return sentence
        first = next((each for each in refused if each.kind == "end"), refused[0])
        many = f"{len(refused)} differences, one" if len(refused) > 1 else "1 difference,"
        return f"{sentence}; {many} at {first.place}: {first.kind}"

    @property
    def next_step(self) -> str:
        """What to do next, in one sentence."""
        first = next(self.refused, None)
        if first is None:
            return f"nothing: the programs do the same{', except for allowed differences' if self.differences else ''}."
        if first.kind == "emission" and first.original_line is not None:
            lacks = "the other program lacks lines that a shaped cut needs for a valid verdict"
            return f"check {first.place}: {lacks}."
        words = [*self.allow, first.kind.replace("emission", "blocks")]
        if first.kind == "path":
            words = [word for word in self.allow if not word.startswith("path=")]
            words.append(f"path={math.ceil(max(each.distance_um for each in self.refused))}um")
        return f"check {first.place}; if intended, allow it: --allow {','.join(words)}."

    def key_figures(self) -> tuple[Figure, ...]:
        """Distance of the paths, and number of differences that are not allowed."""
        from shapegcode.results.page.model import Figure

        return (
            Figure("path within", "µm", None, self.path_um, 1, key_after="path_um"),
            Figure("differences not allowed", "", None, len(list(self.refused)), 0),
        )

    def tables(self) -> list[Table]:
        """Counts of each kind, then the differences, those not allowed first."""
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
    """Compare two programs, and list what differs.

    Calls, macros and coordinate modes are compared as expanded blocks. Of a cut the two paths are compared, by the
    largest distance of one from the other: its blocks may differ.

    Args:
        original: the first program, or its file; a truncated file is read up to its end.
        emitted: the second one, for example the output of `convert`.
        machine: whose controller reads them; None: that of a given `Program`, else the built-in
            ``vx500``.
        allow: differences that are allowed, for example ``"feeds,blocks,path=20um"``.

    Returns:
        Counts, distance of the paths, and every difference with its lines.

    Raises:
        ArgumentError: an unknown word in `allow`; a program was read with other settings than the machine's.
        ProgramError: a program cannot be read.
        OSError: a file cannot be read.
    """
    if machine is None:
        machine = next((each.reading.machine for each in (original, emitted) if isinstance(each, Program)), "vx500")
    machine = Machine.of(machine)
    allowed = allow if isinstance(allow, Allowed) else Allowed.of(allow)
    (first, first_is_cut), (second, second_is_cut) = _read(original, machine), _read(emitted, machine)
    # Distance within which cuts of different lengths match; a conversion allows any distance, and checks it later.
    joint_um = allowed.path_um if allowed.path_um < math.inf else _JOINT_TOLERANCES * machine.tolerance.contour_um
    emission = machine.emission
    lines = [line for group in emission.around_cuts.values() for line in group]
    lines += [*emission.prefill_lines, *guard_lines(first.core.expanded_radii_mm, machine)]
    written = ["".join(re.sub(r"\([^)]*\)", "", line).split()) for line in lines]  # as compared by the core
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
    """Read a program; returns also whether it is truncated: after a whole line, or within one."""
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
    """Differences of expanded cutter compensation, by offset number."""
    radii = [program.core.expanded_radii_mm for program in (first, second)]
    for number in sorted(radii[0].keys() | radii[1].keys()):
        if radii[0].get(number) == radii[1].get(number):
            continue
        lines: list[int | None] = [None, None]
        texts = ["expanded", "expanded"]
        for at, program in enumerate((first, second)):
            if number in radii[at]:
                found = _COMPENSATED.search(program.text)
                lines[at] = None if found is None else 1 + program.text.count(b"\n", 0, found.start())
                texts[at] = f"G41 or G42 with D{number}, radius {radii[at][number]:g} mm"
        is_allowed = allowed.covers("compensation")
        yield ProgramDifference("compensation", lines[0], lines[1], texts[0], texts[1], is_allowed)
