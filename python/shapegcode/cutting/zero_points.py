"""Which lines of a program speak of positions in the coordinates of the stock."""

from __future__ import annotations

import re
from bisect import bisect_right

from shapegcode.program import Program

__all__ = ["ZeroPoints"]

_COMMENT = re.compile(rb"\([^)]*\)")
_CODE = re.compile(rb"G0*(52|53|54\.1|54|55|56|57|58|59|92|10)(?![\d.])")
_P = re.compile(rb"P0*(\d+)")
_SHIFT_WORD = re.compile(rb"[XYZIJK]\s*([+-]?[\d.]+)")


class ZeroPoints:
    """Work coordinates and shifts of the zero point along the (expanded) text of a program.

    The stock lies in the coordinates that hold at the first cutting move; where others hold, positions are not
    comparable.

    Args:
        program: the program.
    """

    def __init__(self, program: Program) -> None:
        self._lines: list[int] = []  # at which something changes
        self._states: list[tuple[str, str]] = []  # work coordinates, what shifted them
        self._machine: set[int] = set()  # lines with positions of the machine (G53)
        system, shift = "", ""
        for number, raw in enumerate(program.core.text.split(b"\n"), start=1):
            if b"G" not in raw and b"g" not in raw:
                continue
            line = _COMMENT.sub(b"", raw).upper().replace(b" ", b"")
            for code in (match.group(1) for match in _CODE.finditer(line)):
                if code == b"53":
                    self._machine.add(number)
                    continue
                if code == b"54.1":
                    chosen = _P.search(line)
                    system = f"G54.1P{chosen.group(1).decode() if chosen else '?'}"
                elif code in (b"52", b"92", b"10"):
                    shift = self._shift(code, line, number, shift)
                else:
                    system = f"G{code.decode()}"
                self._lines.append(number)
                self._states.append((system, shift))
        regions = program.regions
        self._first = self._state(regions[0].first_line) if regions else ("", "")

    @staticmethod
    def _shift(code: bytes, line: bytes, number: int, shift: str) -> str:
        if code == b"10" and not (b"L2" in line and b"L12" not in line):  # tools, parameters: no zero point
            return shift
        values = [float(value) for value in _SHIFT_WORD.findall(line.split(b"G" + code, 1)[-1]) if value != b"."]
        if code == b"52" and values and not any(values) and (not shift or shift.startswith("G52")):
            return ""  # back where it was
        return f"G{code.decode()} in line {number}"

    def _state(self, line: int) -> tuple[str, str]:
        at = bisect_right(self._lines, line)
        return self._states[at - 1] if at else ("", "")

    def why_elsewhere(self, line: int) -> str:
        """Why the positions of a line are not in the coordinates of the stock; empty if they are."""
        if line in self._machine:
            return "its positions are those of the machine (G53)"
        system, shift = self._state(line)
        first_system, first_shift = self._first
        if (system or "G54") != (first_system or "G54"):
            return (
                f"it is cut in other work coordinates ({system or 'G54'}) than the first cutting move "
                f"({first_system or 'G54'}), in which the stock lies"
            )
        if shift != first_shift:
            what = f"the zero point has been moved ({shift})" if shift else f"the shift of {first_shift} has ended"
            return f"{what} since the first cutting move, in whose coordinates the stock lies"
        return ""
