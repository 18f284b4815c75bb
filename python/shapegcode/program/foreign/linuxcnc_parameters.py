"""What a LinuxCNC program holds while it runs: files with their O words, calls, parameters numbered and named."""

from __future__ import annotations

import re
from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, field

from shapegcode.program.foreign.linuxcnc_state import AXES, Modes, State

MAX_ARGUMENTS = 30
_LAST_USER = 5000
_O_LINE = re.compile(
    r"^[ \t]*(?:N[ \t]*\d+[ \t]*)?O[ \t]*(<[^>\n]*>|\d+|\[[^\n]*?\](?=[ \t]*call))[ \t]*([a-z]*)([^\n]*)",
    re.MULTILINE | re.IGNORECASE,
)


@dataclass(frozen=True)
class OLine:
    """An O word: its label, its keyword ("": the head of a program, as FANUC's), and what follows."""

    label: str
    keyword: str
    rest: str


class SourceFile:
    """One file of a program."""

    def __init__(self, name: str, text: str, index: int) -> None:
        """Find its lines and O words; `index`: 0: the main program, n: the n-th of the files that were read besides."""
        self.name, self.index = name, index
        self.text = text.replace("\r\n", "\n").replace("\r", " ")  # alone it is a blank to LinuxCNC
        if not self.text.endswith("\n"):
            self.text += "\n"
        self.starts = [0, *(match.end() for match in re.finditer("\n", self.text))]  # of each line; the text's end
        self.o_lines: dict[int, OLine] = {}  # by line, from 0
        self._places: dict[str, list[int]] = {}
        for match in _O_LINE.finditer(self.text):
            line = bisect_right(self.starts, match.start(1)) - 1
            label = "".join(match[1].split()).lower()
            label = label if label.startswith(("<", "[")) else str(int(label))
            self.o_lines[line] = OLine(label, match[2].lower(), match[3])
            self._places.setdefault(label, []).append(line)

    @property
    def count(self) -> int:
        """Lines."""
        return len(self.starts) - 1

    def line(self, index: int) -> str:
        """A line without its end."""
        return self.text[self.starts[index] : self.starts[index + 1] - 1]

    def find(self, label: str, keyword: str) -> int | None:
        """The first line with this O word."""
        return next((line for line in self._places.get(label, ()) if self.o_lines[line].keyword == keyword), None)

    def after(self, line: int, label: str, keywords: Sequence[str]) -> int | None:
        """The next line behind `line` with this label and one of these keywords."""
        places = self._places.get(label, [])
        behind = places[bisect_right(places, line) :]
        return next((place for place in behind if self.o_lines[place].keyword in keywords), None)

    def before(self, line: int, label: str, keywords: Sequence[str]) -> int | None:
        """The last line before `line` likewise."""
        places = self._places.get(label, [])
        return next(
            (p for p in reversed(places[: bisect_left(places, line)]) if self.o_lines[p].keyword in keywords), None
        )

    def closes_do(self, line: int, label: str) -> bool:
        """Whether a WHILE is the end of a DO: the last loop word of its label before it is that DO."""
        opening = self.before(line, label, ("do", "while", "endwhile"))
        return opening is not None and self.o_lines[opening].keyword == "do"


@dataclass
class Frame:
    """A call that runs."""

    back: int  # line behind the call
    caller: SourceFile
    locals: list[float] = field(default_factory=lambda: [0.0] * (MAX_ARGUMENTS + 1))
    names: dict[str, float] = field(default_factory=dict)
    repeats: dict[tuple[int, int], int] = field(default_factory=dict)
    saved: Modes | None = None
    restores: bool = False
    again: int = 0  # repetitions of M98 that are left
    begin: int = 0
    by_m98: bool = False


class ParameterTable:
    """Values of parameters while a program runs."""

    def __init__(self, state: State, frames: list[Frame]) -> None:
        """No parameter has a value yet: the numbered ones are 0."""
        self._state, self._frames = state, frames
        self._numbered: dict[int, float] = {}
        self._global: dict[str, float] = {}

    def numbered(self, number: int) -> float:
        """The value of `#number`; #1 to #30 are the subroutine's own."""
        if 1 <= number <= MAX_ARGUMENTS:
            return self._frames[-1].locals[number]
        if 1 <= number <= _LAST_USER:
            return self._numbered.get(number, 0.0)
        value = self._of_state(number)
        if value is None:
            raise ValueError(
                f"parameter #{number} is known to the machine only (its parameter file, a probe, an offset)"
            )
        return value

    def named(self, name: str) -> float:
        """The value of `#<name>`; those that begin with _ are global."""
        own = self._global if name.startswith("_") else self._frames[-1].names
        if name in own:
            return own[name]
        value = self._predefined(name) if name.startswith("_") else None
        if value is None:
            raise ValueError(f"parameter #<{name}> has no value here")
        return value

    def exists(self, name: str) -> bool:
        """Whether `#<name>` has a value."""
        try:
            self.named(name)
        except ValueError:
            return False
        return True

    def set(self, name: str | float, value: float) -> None:
        """Give a parameter a value."""
        if isinstance(name, str):
            (self._global if name.startswith("_") else self._frames[-1].names)[name] = value
            return
        number = round(name)
        if 1 <= number <= MAX_ARGUMENTS:
            self._frames[-1].locals[number] = value
        elif 1 <= number <= _LAST_USER:
            self._numbered[number] = value
        elif number != 5599:  # whether (DEBUG,) comments are shown
            raise ValueError(f"parameter #{number} is LinuxCNC's own: programs that set it are not read")

    def _of_state(self, number: int) -> float | None:
        """#5210 ... #5428, #5599: offsets in the machine's unit, the position in the program's."""
        state = self._state
        value: float | None = None
        unit = state.unit_mm if number >= 5400 else state.machine_unit_mm
        if 5211 <= number <= 5213:
            value = state.g92[number - 5211]
        elif number == 5220:
            return float(state.modes.system)
        elif 5221 <= number <= 5383 and 1 <= (number - 5200) % 20 <= 3:
            value = state.offsets((number - 5201) // 20)[(number - 5200) % 20 - 1]
        elif number == 5400:
            return float(state.tool)
        elif 5401 <= number <= 5410:  # the tool in the spindle, in the unit of the table whatever the program's is
            if state.table is None or (row := state.table.tools.get(state.tool)) is None:
                return None
            value = row.offset_mm[number - 5401] if number <= 5403 else row.diameter_mm if number == 5410 else 0.0
            return value / state.table.unit_mm
        elif 5420 <= number <= 5422:
            value = state.position[number - 5420]
        elif 5423 <= number <= 5428:
            return 0.0
        elif number == 5599:
            return 1.0
        return None if value is None else value / unit

    def _predefined(self, name: str) -> float | None:
        """Named parameters that LinuxCNC defines."""
        state, modes = self._state, self._state.modes
        if name in {"_x", "_y", "_z"}:
            here = state.position[AXES.index(name[1])]
            return None if here is None else here / state.unit_mm
        values: dict[str, float] = {
            "_vmajor": 2.9, "_vminor": 0.0, "_task": 0.0, "_motion_mode": float(modes.motion),
            "_plane": float(modes.plane), "_coord_system": float(530 + 10 * modes.system if modes.system <= 6
                                                                 else 584 + modes.system),
            "_metric": float(modes.units == 210), "_imperial": float(modes.units == 200),
            "_absolute": float(modes.distance == 900), "_incremental": float(modes.distance == 910),
            "_inverse_time": float(modes.feed_mode == 930), "_units_per_minute": float(modes.feed_mode == 940),
            "_units_per_rev": float(modes.feed_mode == 950), "_spindle_on": float(modes.spindle in {3, 4}),
            "_spindle_cw": float(modes.spindle == 3), "_mist": float(modes.mist), "_flood": float(modes.flood),
            "_feed": modes.feed, "_rpm": modes.speed, "_current_tool": float(state.tool),
            "_selected_tool": float(state.selected), "_call_level": len(self._frames) - 1.0, "_value": 0.0,
            "_value_returned": 0.0, "_ccomp": 400.0, "_tool_offset": float(state.length_number != 0),
        }  # fmt: skip
        return values.get(name)
