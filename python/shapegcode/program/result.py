"""The result of expanding a program."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from shapegcode.results.json import hidden
from shapegcode.results.result import Result


@dataclass(frozen=True, repr=False, eq=False)
class Expansion(Result):
    """The expanded program: calls, macros and coordinate modes resolved.

    Attributes:
        program: name of the program.
        machine: name of the machine whose controller read it.
        text: the plain program; the text to the letter where there was nothing to expand.
        expanded: whether there was something to expand.
        lines: of the plain program.
        size_bytes: of the plain program.
        expanded_radii_mm: radius by D number, "D1", where cutter compensation is in the path now.
        origins: per line of the plain program the line of the source from which it comes, and its file where that is
            not the program's; empty where there was nothing to expand.
        warnings: what the reader noticed.
    """

    program: str
    machine: str
    text: bytes = field(metadata=hidden())
    expanded: bool
    lines: int
    size_bytes: int
    expanded_radii_mm: Mapping[str, float]
    origins: tuple[tuple[int, str], ...]
    warnings: tuple[str, ...]

    @property
    def ok(self) -> bool:
        """Whether it is done: always, as what cannot be read is refused."""
        return True

    @property
    def answer(self) -> str:
        """What came out, and whether it differs from what went in."""
        what = "expanded" if self.expanded else "nothing to expand: the program is unchanged"
        return f"{self.program}: {self.lines} lines, {self.size_bytes} bytes, {what}"

    @property
    def next_step(self) -> str:
        """The one thing to do next, in one sentence."""
        return self.next_step_after("OUT")

    def next_step_after(self, file: str) -> str:
        """The same with the name of the program that was written.

        Args:
            file: name of it.

        Returns:
            One sentence.
        """
        if self.expanded_radii_mm:
            return "use it with these radii alone: the offsets in the control do not act."
        return f"see how long it takes: shapegcode time {file} -m MACHINE."

    @property
    def notes(self) -> list[str]:
        """The radii that are in the path now, each in a line."""
        return [
            f"{name} = {radius:g} mm is in the path now: the offset in the control does not act"
            for name, radius in self.expanded_radii_mm.items()
        ]
