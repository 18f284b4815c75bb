"""LinuxCNC's G and M codes: their groups, which words they use, and which of them are not read.

Held against rs274 2.9, which refuses a block with a word that none of its codes uses.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from shapegcode.program.foreign.arcs import PLANES
from shapegcode.program.foreign.linuxcnc_state import CYCLES, Modes

_MOTION = frozenset({0, 10, 20, 30, 800}) | CYCLES
_ONE_SHOT = frozenset({40, 100, 280, 281, 300, 301, 520, 530, 920, 921, 922, 923})
_GROUPS: dict[int, str] = {
    **dict.fromkeys(_MOTION, "motion"),
    **dict.fromkeys(_ONE_SHOT - {40, 530}, "one-shot"),
    40: "dwell", 530: "machine", 170: "plane", 180: "plane", 190: "plane", 900: "distance", 910: "distance",
    901: "centres", 911: "centres", 930: "feed", 940: "feed", 950: "feed", 200: "units", 210: "units",
    400: "compensation", 430: "length", 431: "length", 490: "length", 610: "path", 611: "path", 640: "path",
    980: "retract", 990: "retract", 960: "spindle", 970: "spindle", 80: "lathe",
    **dict.fromkeys((540, 550, 560, 570, 580, 590, 591, 592, 593), "system"),
}  # fmt: skip
SYSTEMS = {540: 1, 550: 2, 560: 3, 570: 4, 580: 5, 590: 6, 591: 7, 592: 8, 593: 9}

REFUSED: dict[int, str] = {
    50: "a cubic spline", 51: "a quadratic spline", 52: "a NURBS block", 53: "the end of a NURBS block",
    60: "a NURBS block", 61: "a NURBS block", 62: "a NURBS block",
    70: "diameter mode of a lathe", 171: "the UV plane", 181: "the WU plane", 191: "the VW plane",
    330: "motion that the spindle's encoder leads", 331: "rigid tapping, led by the spindle's encoder",
    **dict.fromkeys((382, 383, 384, 385), "a probing move: where it ends, only the machine knows"),
    **dict.fromkeys((410, 411, 420, 421), "cutter compensation, which rounds outer corners with arcs where FANUC's "
                    "lengthens the lines: write the path of the tool's centre"),
    432: "a second tool length offset beside the first", 700: "a turning cycle", 710: "a turning cycle",
    711: "a turning cycle", 712: "a turning cycle", 720: "a turning cycle", 721: "a turning cycle",
    722: "a turning cycle", 760: "a threading cycle (FANUC's G76 is fine boring)", 870: "back boring, which LinuxCNC "
    "moves otherwise than FANUC", 880: "boring that waits for the operator",
}  # fmt: skip
"""G codes that are not read, in tenths, and what they are."""
_REFUSED_M = {66: "wait for an input: its result, #5399, only the machine knows"}
_GROUPS_OF_M = ((0, 1, 2, 30, 60), (3, 4, 5, 19), (6, 61), (7, 8, 9), (48, 49, 50, 51, 52, 53))
_ARCS = frozenset({20, 30})
_USERS: dict[str, tuple[frozenset[int], frozenset[int]]] = {
    "d": (frozenset({960}), frozenset()),  # G41, G42 and G96 are refused
    "e": (frozenset(), frozenset({67, 68})),
    "h": (frozenset({430}), frozenset()),
    "i": (_ARCS | {100}, frozenset()),
    "j": (_ARCS | {100}, frozenset()),
    "k": (_ARCS, frozenset()),
    "l": (CYCLES | {100}, frozenset()),
    "p": (
        _ARCS | {40, 100, 640, 740, 820, 840, 860, 890},
        frozenset({19, 50, 51, 52, 53, 62, 63, 64, 65, *range(100, 200)}),
    ),
    "q": (frozenset({100, 640, 730, 830}), frozenset({19, 61, 67, 68, *range(100, 200)})),
    "r": (_ARCS | CYCLES | {100}, frozenset({19})),
}
"""G codes in tenths and M codes that use a letter: without one of them LinuxCNC refuses the block."""


def code_text(code: int) -> str:
    """A G code of tenths."""
    return f"G{code // 10}" if code % 10 == 0 else f"G{code // 10}.{code % 10}"


def sorted_words(words: Sequence[tuple[str, float]]) -> tuple[list[int], list[int], dict[str, float]]:
    """G codes in tenths, M codes, and the other words."""
    codes: list[int] = []
    functions: list[int] = []
    values: dict[str, float] = {}
    for letter, value in words:
        if letter == "g":
            if abs(value * 10.0 - round(value * 10.0)) > 1e-3 or value < 0.0:
                raise ValueError(f"G{value:g} is no G code of LinuxCNC")
            codes.append(round(value * 10.0))
        elif letter == "m":
            if abs(value - round(value)) > 1e-4 or value < 0.0:
                raise ValueError(f"M{value:g} is no M code of LinuxCNC")
            functions.append(round(value))
        elif letter != "n":
            values[letter] = value
    return codes, functions, values


def by_group_of(codes: Sequence[int], functions: Sequence[int], values: Mapping[str, float]) -> dict[str, int]:
    """The G codes of a block by their groups; what is not read is refused."""
    for code in codes:
        if code in REFUSED:
            raise ValueError(f"{code_text(code)} is {REFUSED[code]}: it is not read")
        if code not in _GROUPS:
            raise ValueError(f"{code_text(code)} is no G code of LinuxCNC")
    for function in functions:
        if function in _REFUSED_M:
            raise ValueError(f"M{function} is a {_REFUSED_M[function]}: it is not read")
    if letter := next((letter for letter in "uvw" if letter in values), None):
        raise ValueError(f"{letter.upper()} is an axis beside X, Y, Z, and another thing on FANUC: it is not read")
    if "$" in values and values["$"] != 0.0:
        raise ValueError("$ selects another spindle: it is not read")
    found: dict[str, int] = {}
    for code in codes:
        if (other := found.setdefault(_GROUPS[code], code)) != code or codes.count(code) > 1:
            raise ValueError(f"{code_text(other)} and {code_text(code)} in one block")
    return found


def refuse_unused(
    modes: Modes, by_group: Mapping[str, int], functions: Sequence[int], values: Mapping[str, float]
) -> None:
    """Words that no code of the block uses, as LinuxCNC refuses them: X1e3 is X1 and E3, not 1000."""
    codes = {*by_group.values()}
    goes_on = any(letter in values for letter in "xyzabcijk@^") and not codes & (_ONE_SHOT - {530})
    motion = by_group.get("motion", modes.motion if goes_on else None)
    codes |= {motion} if motion is not None else set()
    for letter, (of_codes, of_functions) in _USERS.items():
        if letter in values and not codes & of_codes and not {*functions} & of_functions:
            raise ValueError(
                f"{letter.upper()}{values[letter]:g} and no word in the block that uses it: LinuxCNC refuses it"
            )
    plane = by_group.get("plane", modes.plane)
    if motion in _ARCS and (across := "ijk"[PLANES[plane // 10][2]]) in values:
        raise ValueError(f"{across.upper()} is no centre of an arc in {code_text(plane)}: LinuxCNC refuses it")
    if motion in CYCLES and (axis := next((name for name in "abc" if name in values), None)):
        raise ValueError(f"{axis.upper()} in a drilling cycle: LinuxCNC refuses it")
    if "t" in values and abs(values["t"] - round(values["t"])) > 1e-4:
        raise ValueError(f"T{values['t']:g} is no whole number")
    if values.get("s", 0.0) < 0.0:
        raise ValueError(f"S{values['s']:g} is negative")
    for group in _GROUPS_OF_M:
        if len(both := [function for function in functions if function in group]) > 1:
            raise ValueError(f"M{both[0]} and M{both[1]} in one block")
