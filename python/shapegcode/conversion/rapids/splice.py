"""Replacements put into a text, and where everything then stands."""

from __future__ import annotations

from bisect import bisect
from collections.abc import Sequence
from dataclasses import dataclass

from shapegcode.conversion.rapids.gaps import Choice
from shapegcode.verdict.placed import Placed

__all__ = ["Spliced", "original_line", "splice"]


@dataclass(frozen=True)
class Spliced:
    """A text with replacements, and the places of regions and replacements in it."""

    text: bytes
    placed: list[Placed]
    moves: list[Placed]

    @property
    def everything(self) -> list[Placed]:
        """Both, in the order of the text."""
        return sorted([*self.placed, *self.moves], key=lambda place: place.first_line)


def splice(text: bytes, placed: Sequence[Placed], choices: Sequence[Choice]) -> Spliced:
    """A text with replacements in the places of rapids."""
    parts, at = [], 0
    shifts = []  # (line behind which it holds, lines that were added)
    added = 0
    moves = []
    for choice in choices:
        region = choice.region
        parts += [text[at : region.text_begin], choice.text]
        at = region.text_end
        first = region.first_line + added
        moves.append(Placed(region, first, first + choice.text.count(b"\n") - 1))
        added += choice.text.count(b"\n") - 1
        shifts.append((region.first_line, added))
    parts.append(text[at:])
    lines = [line for line, _ in shifts]
    moved = []
    for place in placed:
        index = bisect(lines, place.first_line)
        shift = shifts[index - 1][1] if index else 0
        moved.append(Placed(place.region, place.first_line + shift, place.last_line + shift))
    return Spliced(b"".join(parts), moved, moves)


def original_line(line: int, placed: Sequence[Placed]) -> int:
    """Line of the original from which a kept line of the emitted text comes."""
    index = bisect([place.first_line for place in placed], line)
    if index:
        before = placed[index - 1]
        return line - before.last_line + before.region.last_line
    return line - placed[0].first_line + placed[0].region.first_line
