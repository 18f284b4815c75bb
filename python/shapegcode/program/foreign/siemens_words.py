"""Words of SINUMERIK blocks: their effect, those that are left out because they change no path, those that are refused.

Sources: codes and their groups as PyPI nc-gcode-interpreter lists them; G70 to G710 easymanua.ls 592300 p. 139; G53,
G153, SUPA, G500 679150 p. 100; G450 and G451 1265481 p. 268; D number i5cnc.com 126; FRC 1918352 p. 282.
"""

from __future__ import annotations

import math
import re
import tomllib
from functools import cache
from importlib import resources
from typing import Protocol

import numpy as np

from shapegcode.io.units import MM_PER_INCH
from shapegcode.program.foreign.read import number_text, words_of
from shapegcode.program.foreign.siemens_blocks import SiemensBlock, Word
from shapegcode.program.foreign.siemens_expressions import Scope, Value, WordError, number, whole
from shapegcode.program.foreign.siemens_path import Given, SiemensFrame, SiemensModes, SiemensPath, offset_word
from shapegcode.program.stamp import plain_comment

_AXES = {"X": 0, "Y": 1, "Z": 2}
_CENTRES = {"I": 0, "J": 1, "K": 2}
_MIDDLES = {"I1": 0, "J1": 1, "K1": 2}
_ROTARY = {"A", "B", "C", "U", "V", "W"}
_FRAMES = {"TRANS", "ATRANS", "ROT", "AROT", "SCALE", "ASCALE", "MIRROR", "AMIRROR"}
_ONE_OF = (("CR", "AR"), ("RND", "CHF", "CHR"))  # words that exclude each other
_BEHIND = {0, 1, 2, 5, 9, 30}  # M functions behind the motion of their block
_OF_THE_MACHINE = ("G53", "G153", "SUPA")  # coordinates
_ENDS = ("M17", "M2", "M30")

_BLOCKS_OF_THEIR_OWN = ("G4", "G110", "G111", "G112", "G74", "G75", "G25", "G26")
_GROUPS = (
    {"G0", "G1", "G2", "G3", "CIP", "CT"}, {"G17", "G18", "G19"}, {"G90", "G91"}, {"G70", "G71", "G700", "G710"},
    {"G93", "G94", "G95"}, {"FLIN", "FNORM"}, {"G60", "G64", "G641", "G642", "G643", "G644", "G645"},
)  # fmt: skip
"""Groups of which only one word is allowed in a block."""


@cache
def _tables() -> tuple[dict[str, str], dict[str, str], dict[re.Pattern[str], str]]:
    """Words and addresses that are left out, with their notes, and words that are refused."""
    file = resources.files("shapegcode") / "data" / "control" / "siemens_input.toml"
    tables = tomllib.loads(file.read_text(encoding="utf-8"))
    words, addresses = (
        {word: told for words, told in tables[name].items() for word in words.split()}
        for name in ("left_out", "left_out_addresses")
    )
    return words, addresses, {re.compile(pattern): reason for pattern, reason in tables["refused"].items()}


class Run(Scope, Protocol):
    """What words need of the program that holds them."""

    def knows(self, name: str) -> bool:
        """Whether something can be set by this name."""

    def assign(self, word: Word, value: Value) -> None:
        """Set it."""

    def call_named(self, name: str, word: Word) -> None:
        """Call a program by a string."""


class BlockWords:
    """Executes blocks of words."""

    def __init__(self, path: SiemensPath, run: Run, *, uses_m6: bool) -> None:
        self.path, self._run = path, run
        self._uses_m6 = uses_m6
        self._tool, self._next_tool, self._edge, self._next_edge = 0, 0, -1, -1
        self._tools: dict[str, int] = {}
        self._offsets: dict[tuple[int, int], int] = {}  # by tool and edge
        self._spindle = math.nan  # 1/min
        self._path_mode = ""

    def comment(self, text: str) -> None:
        """A comment of a block, as far as FANUC's may hold it."""
        if not text or text.startswith("$PATH"):
            return
        shown = " ".join(plain_comment(text.encode("ascii", "replace").decode().replace("?", " ")).split())
        if shown:
            self.path.put(f"({shown[:100]})")

    def may_be_call(self, word: Word) -> bool:
        """Whether a bare word may be the name of a program."""
        name = word.name
        known = name in _FRAMES or name in _tables()[0] or name in ("CIP", "CT", "FLIN", "SUPA", "RET")
        return not known and re.fullmatch(r"L\d+|[A-Z_][A-Z_][A-Z0-9_]*", name) is not None

    def restore(self, modes: SiemensModes) -> None:
        """What was in force before a subprogram with SAVE."""
        now = self.path.modes
        self.path.set_plane(modes.plane)
        if modes.offset and modes.offset != now.offset:
            self.path.set_offset(modes.offset)
        self.path.set_frame(modes.frame)
        self.path.modes = modes

    def execute(self, block: SiemensBlock) -> str:
        """One block; says which word ends the program, or nothing."""
        words = block.words
        names = {word.name for word in words if word.value is None or word.name == "M"}
        self._refuse_twice(words)
        if words[0].name in _FRAMES:
            self._frame(words)
            return ""
        if name := next((name for name in _BLOCKS_OF_THEIR_OWN if name in names), ""):
            self._special(name, words)
            return ""
        if (call := words[0]).name in ("CALL", "EXTCALL"):
            called = call.given[0](self._run) if len(words) == 1 and call.given and call.given[0] else None
            if not isinstance(called, str):
                must = "the name of a program in quotes and brackets must follow"
                raise call.error(f'{call.name}: {must}: {call.name}("NAME")')
            self._run.call_named(called, call)
            return ""
        given = Given(column=block.column, start_feed=self.path.modes.feed)
        own_frame = next((word.name for word in reversed(words) if word.name in _OF_THE_MACHINE), "")
        for group in _GROUPS:
            if len(group & names) > 1:
                one, other = sorted(group & names)[:2]
                raise block.error(f"{one} and {other} in one block: leave one of them out")
        for word in words:
            if word.value is None and word.name not in _OF_THE_MACHINE:
                self._code(word, given)
        rotary: dict[str, float] = {}
        functions: list[Word] = []
        for word in words:
            if word.value is not None:
                self._address(word, given, rotary, functions)
        behind = self._before(functions)
        self._go(given, rotary, own_frame)
        for code in behind:
            self.path.put(f"M{code:02d}")
        if "RET" in names:
            return "M17"
        codes = {f"M{self._whole(word)}" for word in functions if word.name == "M"}
        return next((code for code in _ENDS if code in codes), "")

    def _refuse_twice(self, words: tuple[Word, ...]) -> None:
        """An address twice (alarm 12010), and the words that exclude each other."""
        seen: set[str] = set()
        for word in words:
            if word.value is None or word.name == "M" or self._run.knows(word.name):
                continue
            same = next((group for group in _ONE_OF if word.name in group), (word.name,))
            for other in same:
                if other in seen:
                    what = f"{other} twice" if other == word.name else f"{other}= and {word.name}="
                    raise word.error(f"{what} in one block: leave one of them out")
            seen.add(word.name)
        if "CR" in seen and (other := next((name for name in ("I", "J", "K") if name in seen), "")):
            raise words[0].error(f"CR= and {other} in one block: leave one of them out")

    # ---- values ------------------------------------------------------------------------------------------------------

    def _number(self, word: Word) -> float:
        assert word.value is not None
        return float(number(word.value(self._run), word.column))

    def _length(self, word: Word) -> float:
        return self._number(word) * self.path.modes.unit

    def _is_incremental(self, word: Word) -> bool:
        return word.mode == "IC" or (word.mode == "" and self.path.modes.incremental)

    def _whole(self, word: Word) -> int:
        assert word.value is not None
        return whole(word.value(self._run), word.name, word.column)

    # ---- codes -------------------------------------------------------------------------------------------------------

    def _code(self, word: Word, given: Given) -> None:
        """A word without a value."""
        modes, name = self.path.modes, word.name
        if name in ("G0", "G1", "G2", "G3", "CIP", "CT"):
            modes.motion = name
        elif name in ("G17", "G18", "G19"):
            self.path.set_plane(int(name[1:]))
        elif name in ("G90", "G91"):
            modes.incremental = name == "G91"
        elif name in ("G70", "G71", "G700", "G710"):
            modes.unit = MM_PER_INCH if name in ("G70", "G700") else 1.0
            modes.feed_unit = MM_PER_INCH if name == "G700" else 1.0
        elif name in ("G93", "G94", "G95"):
            if modes.feed_mode != int(name[1:]):
                modes.feed, given.start_feed = None, None  # its number means another thing now
            modes.feed_mode = int(name[1:])
        elif name in ("FLIN", "FNORM"):
            modes.is_linear = name == "FLIN"
        elif name == "G9":
            given.exact = True
        elif name in ("G60", "G64", "G641", "G642", "G643", "G644", "G645"):
            code = "G61" if name == "G60" else "G64"
            if code != self._path_mode:
                self._path_mode = code
                self.path.put(code)
            if name not in ("G60", "G64"):
                what = "by how much the control rounds corners is its own"
                self.path.note(f"G641 to G645 are read as G64: {what}", "G641")
        elif re.fullmatch(r"G5[4-7]|G500|G50[5-9]|G5[1-9]\d", name):
            self.path.set_offset(name)
            if int(name[1:]) >= 500:
                self.path.names[offset_word(name)] = name
                self.path.note(f"{name} is written as {offset_word(name)}", name)
        elif name in _tables()[0]:
            self.path.note(_tables()[0][name])
        elif name != "RET":
            raise self._refusal(word)

    def _refusal(self, word: Word) -> WordError:
        for pattern, reason in _tables()[2].items():
            if pattern.fullmatch(word.name):
                return word.error(f"{word.name}: {reason}")
        if re.fullmatch(r"G\d+", word.name):
            return word.error(f"{word.name} is not a supported code")
        if word.value is not None:
            return word.error(f"{word.name}= is neither an address that is read nor a variable: DEF must come before")
        wanted = f"{word.name}.SPF must be in the same folder as this one"
        return word.error(f"{word.name} is neither a word that is read nor a program: {wanted}")

    # ---- addresses ---------------------------------------------------------------------------------------------------

    def _address(self, word: Word, given: Given, rotary: dict[str, float], functions: list[Word]) -> None:
        """A word with a value."""
        name, modes = word.name, self.path.modes
        assert word.value is not None
        if self._run.knows(name):
            self._run.assign(word, word.value(self._run))
        elif name in _AXES:
            given.axes[_AXES[name]] = (self._length(word), self._is_incremental(word), word.column)
        elif name in _CENTRES or name in _MIDDLES:
            self._centre(word, given)
        elif name in ("CR", "AR", "TURN", "AP", "RP"):
            self._round_word(word, given)
        elif name == "F":
            given.has_feed = True
            modes.feed = self._number(word) * (modes.feed_unit if modes.feed_mode != 93 else 1.0)
            if modes.feed <= 0.0:
                raise word.error(f"F{modes.feed:g}: it must be more than 0")
        elif name in ("RND", "CHR", "CHF"):
            given.corner = (name, self._length(word))
        elif name == "RNDM":
            modes.rounding_mm = self._length(word)
        elif name in ("M", "S", "T", "D", "SPOS", "SPOSA") or re.fullmatch(r"[MS]\d", name):
            functions.append(word)
        elif name in _ROTARY:
            rotary[name] = self._number(word)
        elif name in _tables()[1]:
            self.path.note(_tables()[1][name])
        else:
            raise self._refusal(word)

    def _centre(self, word: Word, given: Given) -> None:
        motion = self.path.modes.motion
        is_middle = word.name in _MIDDLES
        if motion != "CIP" if is_middle else motion not in ("G2", "G3"):
            wanted = "CIP" if is_middle else "G2 or G3"
            raise word.error(f"{word.name} with {motion or 'no G code'}: {wanted} must be in force")
        if is_middle:
            given.middle[_MIDDLES[word.name]] = (self._length(word), self._is_incremental(word), word.column)
        else:
            given.centre[_CENTRES[word.name]] = (self._length(word), word.mode != "AC", word.column)

    def _round_word(self, word: Word, given: Given) -> None:
        name = word.name
        if name == "CR":
            given.radius = self._length(word)
        elif name == "AR":
            given.angle = self._number(word)
        elif name == "TURN":
            given.turns = self._whole(word)
            if not 0 <= given.turns <= 999:
                raise word.error(f"TURN={given.turns}: it must be 0 to 999")
        else:
            value = self._length(word) if name == "RP" else self._number(word)
            if name == "RP" and value < 0.0:
                raise word.error(f"RP={value:g}: a polar radius must be 0 or more")
            given.polar[name] = (value, word.mode, word.column)
        if name in ("CR", "AR", "TURN") and self.path.modes.motion not in ("G2", "G3"):
            raise word.error(f"{name}= with {self.path.modes.motion or 'no G code'}: G2 or G3 must be in force")

    def _go(self, given: Given, rotary: dict[str, float], own_frame: str) -> None:
        if rotary:
            if given.axes or given.polar or self.path.modes.motion != "G0":
                name = next(iter(rotary))
                raise given.error(f"{name}: moves of rotary axes are read with G0 alone, in a block of their own")
            self.path.put("G00" + words_of(rotary, "".join(rotary)))
        if own_frame:
            self._in_machine(given, own_frame)
        elif given.axes or given.polar or (given.centre and self.path.modes.motion in ("G2", "G3")):
            self.path.move(given)
        elif given.corner is not None or given.radius is not None or given.middle:
            raise given.error("a word of a contour without an axis: the end of the block must be programmed")

    def _in_machine(self, given: Given, code: str) -> None:
        """G53, G153 or SUPA: a rapid in machine coordinates."""
        if not given.axes:
            return
        if self.path.modes.motion != "G0" or given.polar:
            raise given.error(f"{code} with {self.path.modes.motion or 'no G code'}: it is read with G0 and axes alone")
        to: dict[str, float] = {}
        for axis, (value, is_incremental, column) in given.axes.items():
            if is_incremental:
                raise WordError(f"{code} incrementally: the axis must be programmed absolutely", column)
            to["XYZ"[axis]] = round(value, 5)
        self.path.put(f"G53G00{words_of(to, 'XYZ')}")
        self.path.forget("".join(to))
        self.path.note(f"{code} is written as G53: which offsets it suppresses is set by the machine builder", "SUPA")

    # ---- functions ---------------------------------------------------------------------------------------------------

    def _before(self, functions: list[Word]) -> list[int]:
        """Functions that come before the motion of their block; gives the M codes that come behind it."""
        codes = []
        changes = [word for word in functions if word.name == "M" and self._whole(word) == 6]
        for word in functions:
            name = word.name
            if re.fullmatch(r"[MS]\d", name) and name[1] != "1":
                raise word.error(f"{name}= is one of spindle {name[1]}: only spindle 1 is read")
            if name[0] == "S" and not name.startswith("SPOS"):
                self._spindle = self._number(word)
                if self._spindle != round(self._spindle):
                    self.path.note(f"S{self._spindle:g} is written without decimals", "S")
                self.path.put(f"S{round(self._spindle)}")
            elif name.startswith("SPOS"):
                self.path.put("M19")
                self.path.note("SPOS is written as M19", "SPOS")
            elif name == "T":
                self._select_tool(word)
            elif name[0] == "M":
                codes.append(self._whole(word))
        if changes:
            self._change_tool()
        for word in functions:
            if word.name == "D":
                edge = self._whole(word)
                if not 0 <= edge <= 9:
                    raise word.error(f"D{edge}: it must be 0 to 9")
                if changes or not (self._uses_m6 and self._next_tool):
                    self._offset(edge, word.column)
                else:
                    self._next_edge = edge
        if changes and self._edge < 0:
            self._offset(self._next_edge if self._next_edge >= 0 else 1, changes[0].column)
        for code in codes:
            if code not in _BEHIND | {6, 17}:
                self.path.put(f"M{code:02d}")
        return [code for code in codes if code in _BEHIND - {2, 30}]

    def _select_tool(self, word: Word) -> None:
        assert word.value is not None
        value = word.value(self._run)
        if isinstance(value, str):
            if value not in self._tools:
                self._tools[value] = 901 + len(self._tools)
                self.path.names[f"T{self._tools[value]}"] = f'T="{value}"'
                self.path.note(f'T="{value}" is written as T{self._tools[value]}', f"T {value}")
            tool = self._tools[value]
        else:
            tool = whole(value, "T", word.column)
        self.path.put(f"T{tool}")
        self._next_tool, self._next_edge = tool, -1
        if not self._uses_m6:
            self._change_tool()
            self.path.note("T changes the tool: the program has no M6", "T")
            self._offset(1, word.column)

    def _change_tool(self) -> None:
        if self._uses_m6:
            self.path.put("M06")
            self.path.forget(self.path.machine.input.tool_change_unknown_axes)
        self._tool = self._next_tool or self._tool
        self._next_tool, self._edge = 0, -1

    def _offset(self, edge: int, column: int) -> None:
        """The length offset of an edge of the tool."""
        if edge == self._edge:
            return
        if self.path.modes.plane != 17 and edge:
            raise WordError(f"D{edge} in G{self.path.modes.plane}: G17 must be in force, a length along Z", column)
        self._edge = edge
        offset = self._offset_number(edge)
        self.path.put("G49" if edge == 0 else f"G43H{offset}")
        self.path.forget("Z", shifted=True)

    def _offset_number(self, edge: int) -> int:
        """The number of the tool for its first edge, one from 801 for others: FANUC's offsets end with 999."""
        tool = self._tool or edge
        if edge <= 1 and (tool <= 800 or tool > 900) and tool <= 999:
            return tool
        found = self._offsets.setdefault((tool, edge), 801 + len(self._offsets))
        self.path.names[f"H{found}"] = f"D{edge}"
        self.path.note(f"D{edge} of T{tool} is written as H{found}", f"H{found}")
        return found

    # ---- blocks of their own -----------------------------------------------------------------------------------------

    def _frame(self, words: tuple[Word, ...]) -> None:
        """TRANS and its relatives."""
        path, name = self.path, words[0].name
        values: dict[str, float] = {}
        for word in words[1:]:
            if word.value is None or word.name not in (*_AXES, "RPL"):
                raise word.error(f"{word.name} in a block of {name}: it must be in a separate block")
            if word.mode:
                raise word.error(f"{word.name}={word.mode}( ) in a block of {name}: a value is expected")
            values[word.name] = self._length(word) if name.endswith("TRANS") else self._number(word)
        kind = name.removeprefix("A")
        if "RPL" in values and kind != "ROT":
            raise words[0].error(f"RPL= is an angle: ROT or AROT must come before it, not {name}")
        frame = _frame_of(kind, values, path.modes.plane, words[0].column) if values else SiemensFrame()
        path.set_frame(path.modes.frame.then(frame) if name != kind else frame)

    def _special(self, name: str, words: tuple[Word, ...]) -> None:
        others = [word for word in words if word.name != name]
        if name in ("G25", "G26"):
            what = "limits of the working area and the spindle change no programmed path"
            self.path.note(f"{name} is left out: {what}", name)
        elif name == "G4":
            self._dwell(others)
        elif name in ("G74", "G75"):
            self._reference(name, others)
        else:
            given = Given(column=words[0].column)
            for word in others:
                if word.name in _AXES and word.value is not None and word.mode != "IC":
                    given.axes[_AXES[word.name]] = (self._length(word), False, word.column)
                elif word.name in ("AP", "RP"):
                    value = self._length(word) if word.name == "RP" else self._number(word)
                    given.polar[word.name] = (value, "", word.column)
                elif word.name not in ("G17", "G18", "G19", "G90", "G91"):
                    raise word.error(f"{word.name} beside {name}: axes of the plane or AP= and RP= is expected")
            self.path.define_pole(int(name[1:]), given)

    def _dwell(self, others: list[Word]) -> None:
        for word in others:
            if word.name == "F" and word.value is not None:
                seconds = self._number(word)
            elif word.name in ("S", "S1") and word.value is not None:
                if not self._spindle > 0.0:
                    raise word.error("G4 S counts turns of the spindle: S must be programmed before")
                seconds = self._number(word) * 60.0 / self._spindle
            else:
                raise word.error(f"{word.name} beside G4: F in seconds or S in turns is expected, alone")
            if seconds < 0.0:
                raise word.error(f"G4 {word.name}{seconds:g}: it must be 0 or more")
            self.path.put(f"G04X{number_text(round(seconds, 4))}")
        if not others:
            raise WordError("G4 without F or S: one of them must be given", 1)

    def _reference(self, name: str, others: list[Word]) -> None:
        """G74 to the reference point, G75 to a fixed one: where the axes are then only the control knows."""
        axes = ""
        for word in others:
            axis = word.name.removesuffix("1")
            if axis in _AXES and word.value is not None:
                axes += axis
            elif word.name not in ("FP", "G0", "G90", "G91", "G53", "G153", "SUPA"):
                raise word.error(f"{word.name} beside {name}: the axes that go there must be alone in this block")
        words = "".join(f"{axis}0." for axis in sorted(axes))
        for line in ("G91", f"G{28 if name == 'G74' else 30}{words}", "G90"):
            self.path.put(line)
        self.path.forget(axes)
        self.path.note(f"{name} is written as G{28 if name == 'G74' else 30}", name)


def _frame_of(kind: str, values: dict[str, float], plane: int, column: int) -> SiemensFrame:
    vector = np.array([values.get(axis, 0.0) for axis in "XYZ"])
    if kind == "TRANS":
        return SiemensFrame(offset=vector)
    if kind == "MIRROR":
        return SiemensFrame(np.diag([-1.0 if axis in values else 1.0 for axis in "XYZ"]))
    if kind == "SCALE":
        if any(value <= 0.0 for value in values.values()):
            raise WordError("SCALE: factors must be more than 0", column)
        return SiemensFrame(np.diag([values.get(axis, 1.0) for axis in "XYZ"]))
    if len(values) != 1:
        raise WordError("ROT about several axes is not read: RPL= or one axis is expected", column)
    name, angle = next(iter(values.items()))
    axis = {17: 2, 18: 1, 19: 0}[plane] if name == "RPL" else _AXES[name]
    cosine, sine = math.cos(math.radians(angle)), math.sin(math.radians(angle))
    linear = np.eye(3)
    first, second = (axis + 1) % 3, (axis + 2) % 3
    linear[[first, first, second, second], [first, second, first, second]] = cosine, -sine, sine, cosine
    return SiemensFrame(linear)
