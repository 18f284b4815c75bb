"""What the runs of one command over the programs of a file came to, before it is written."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from shapegcode.program.several import ProgramPlace


@dataclass
class Gathered:
    """What the runs of one command over a file came to."""

    source: str  # the file
    text: bytes
    places: tuple[ProgramPlace, ...]  # its programs
    reports: list[dict[str, Any]] = field(default_factory=list)  # what --json writes of each
    # by place, the file that a command wants to write and the program in it
    written: dict[int, tuple[Path | str, bytes]] = field(default_factory=dict)
    at: int = 0  # the place that is being done

    @property
    def address(self) -> str:
        """Of the program that is being done."""
        return self.places[self.at].address

    def names(self, indices: set[int]) -> str:
        """Addresses of some of the programs, in their order."""
        return ", ".join(self.places[index].address for index in sorted(indices))

    def add(self, report: dict[str, Any], output: tuple[Path | str, bytes | memoryview] | None) -> None:
        """Keep what a run wants written."""
        self.reports.append({**report, "program_address": self.address})
        if output is not None:
            self.written[self.at] = output[0], bytes(output[1])

    def joined(self) -> bytes:
        """The file with every program that was written in its place; all else to the letter."""
        parts, position = [], 0
        for place in self.places:
            parts.append(self.text[position : place.text_begin])
            written = self.written.get(place.index)
            parts.append(self.text[place.text_begin : place.text_end] if written is None else _unframed(written[1]))
            position = place.text_end
        return b"".join([*parts, self.text[position:]])


def _unframed(text: bytes) -> bytes:
    """A program that stands alone without its '%' lines."""
    begin = text.find(b"\n") + 1 if text.startswith(b"%") else 0
    end = text.rfind(b"%")
    # The line end of the first mark may be LF CR CR: what is left of it belongs to it.
    while text[begin : begin + 1] == b"\r":
        begin += 1
    return text[begin : end if end > begin else len(text)]
