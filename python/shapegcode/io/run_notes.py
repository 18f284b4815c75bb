"""What reading a log of runs bridges or leaves out: each kind with its first lines, the rest counted."""

from __future__ import annotations

from typing import TypeAlias

from shapegcode.io.run_items import Item

__all__ = ["Event", "FileNotes"]

Event: TypeAlias = tuple[int, float, bytes, Item, bytes]
"""(line, time in s, time stamp, item, value as text)."""

_SHOWN = 3


class FileNotes:
    """Notes since the last run.

    Attributes:
        feed_unit: what the file itself says of the unit of the feed.
    """

    def __init__(self) -> None:
        """None yet."""
        self.feed_unit: str | None = None
        self._kinds: dict[str, tuple[list[str], int, int]] = {}

    def add(self, kind: str, line: int, text: str) -> None:
        """Note something."""
        shown, count, _ = self._kinds.get(kind, ([], 0, 0))
        if len(shown) < _SHOWN:
            shown.append(f"line {line}: {text}" if line else text)
        self._kinds[kind] = shown, count + 1, line

    def taken(self) -> tuple[str, ...]:
        """The notes, which are forgotten then."""
        found: list[str] = []
        for shown, count, line in self._kinds.values():
            found += shown
            if count > len(shown):
                found.append(f"{count - len(shown)} more like the last one" + (f", up to line {line}" if line else ""))
        self._kinds = {}
        return tuple(found)
