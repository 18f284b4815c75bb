"""Translate programs for a Haas mill: as FANUC's, except for a few words that are replaced, line by line.

Sources, by topic: docs/reference/input_dialects.md. A code without documentation is refused, not guessed.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Callable, Mapping
from itertools import accumulate
from pathlib import Path

from shapegcode.machine import Machine
from shapegcode.program.foreign.read import ForeignProgram, ForeignSettings, Note, refusal

_AS_FANUC = frozenset((
    "0", "1", "2", "3", "4", "9", "10", "17", "18", "19", "20", "21", "28", "40", "41", "42", "43", "49", "52", "53",
    "54", "54.1", "55", "56", "57", "58", "59", "61", "64", "65", "73", "74", "80", "81", "82", "83", "84", "85", "86",
    "89", "90", "91", "92", "94", "95", "98", "99",
))  # fmt: skip
_REFUSED: Mapping[str, str] = {
    "12": "circular pocket milling", "13": "circular pocket milling", "47": "engraving of a text",
    "70": "a bolt hole circle", "71": "a bolt hole arc", "72": "bolt holes along an angle",
    "76": "fine boring, whose shift a setting gives", "77": "back boring", "87": "boring with a manual retract (FANUC: "
    "back boring)", "88": "boring with a manual retract", "93": "inverse time; no documentation was found on F in "
    "arcs", "96": "constant surface speed", "150": "general pocket milling",
}  # fmt: skip
_CYCLES = frozenset(("73", "74", "81", "82", "83", "84", "85", "86", "89"))
_CALL_BASE = 90_000_000  # O number of a subprogram that M97 calls: this plus its N number

_NOT_THE_SAME = re.compile(
    r"[;GMFP](?:(?<=;)|(?<=G)[ \t]*(?:0*4(?![\d.])"
    r"|(?!(?:0*[0-3]|17|18|19|2[018]|4[0-39]|5[3-9]|6[14]|8[0-2]|9[0-2]|9[89])(?![\d.]))[\d.]+)"
    r"|(?<=M)[ \t]*0*9[678](?!\d)|(?<=F)[ \t]*[-+]?\d+(?![\d.])|(?<=P)[ \t]*\d*\.\d*)"
)
"""A program, in capitals, that contains none of these words means the same on FANUC."""

_LINE = re.compile(r"[^\n]*\n|[^\n]+")
_COMMENT = re.compile(r"\([^)\n]*\)?")
_G = re.compile(r"G[ \t]*(\d+(?:\.\d+)?)", re.IGNORECASE)
_P = re.compile(r"P[ \t]*([#\[]|[-+]?(?:\d+\.?\d*|\.\d+))", re.IGNORECASE)
_INTEGER_F = re.compile(r"F[ \t]*([-+]?\d+)(?![\d.])", re.IGNORECASE)
_LEFT_OUT = re.compile(r"G[ \t]*(103|187)(?![\d.])((?:[ \t]*[PE][ \t]*[\d.]+)*)", re.IGNORECASE)
_OFFSET = re.compile(r"G[ \t]*154[ \t]*P[ \t]*(\d+)", re.IGNORECASE)
_OLD_OFFSET = re.compile(r"G[ \t]*(1[12]\d)(?![\d.])", re.IGNORECASE)  # G110 ... G129 are G154 P1 ... P20
_M97 = re.compile(r"M[ \t]*0*97[ \t]*P[ \t]*(\d+)((?:[ \t]*L[ \t]*\d+)?)", re.IGNORECASE)
_M98 = re.compile(r"M[ \t]*0*98(?!\d)", re.IGNORECASE)
_PROGRAM = re.compile(r"P[ \t]*(?:\d{5,}(?![ \t]*\d)|#\d+|\[[^\]]*\])", re.IGNORECASE)
_UNREAD_M97 = re.compile(r"M[ \t]*0*97(?!\d)", re.IGNORECASE)
_CYCLE = re.compile(r"G[ \t]*0*(?:7[34]|8[1-9])(?![\d.])")
_PECKS = re.compile(r"[IJK][ \t]*[-+.\d#\[]", re.IGNORECASE)
_VARIABLE_P = re.compile(r"P[ \t]*[#\[]", re.IGNORECASE)
_N = re.compile(r"[ \t]*/?[ \t]*N[ \t]*0*(\d+)", re.IGNORECASE)
_O = re.compile(r"[ \t]*[O:][ \t]*\d", re.IGNORECASE)
_M99 = re.compile(r"M[ \t]*99(?!\d)", re.IGNORECASE)
_MACRO = re.compile(r"[ \t]*(?:N[ \t]*\d+[ \t]*)?(?:#|IF|WHILE|END|GOTO|DPRNT|POPEN|PCLOS)", re.IGNORECASE)


def read_haas(source: str, *, file: str, machine: Machine, folder: Path | None = None) -> ForeignProgram:
    """Translate a Haas program into FANUC's words: only words with another meaning are replaced or left out."""
    notes: dict[str, Note] = {}
    lines, called = _lines(source, file, notes)
    numbers = [*range(1, max(len(lines), 1) + 1)]
    if called:
        lines, numbers = _with_subprograms(lines, called, file)
    settings = ForeignSettings(calculator_decimal_point=None, called_text=called_haas_text)
    found = sorted(notes.values(), key=lambda note: note[0])
    return ForeignProgram("haas", "".join(lines), numbers, notes=tuple(found), settings=settings)


def called_haas_text(source: str, file: str) -> str:
    """Translate a program in another file, called by a Haas program, into FANUC's words, line by line."""
    lines, called = _lines(source, file, {})
    if called:
        line = min(called.values())
        raise refusal(file, line, "M97 in a program that another file calls is not read: put it into that file")
    return "".join(lines)


def _lines(source: str, file: str, notes: dict[str, Note]) -> tuple[list[str], dict[int, int]]:
    """The lines in FANUC's words, and the N numbers that M97 calls, each with the line of its first call."""
    lines = _LINE.findall(source)
    code = _COMMENT.sub(lambda comment: " " * len(comment[0]), source) if "(" in source else source
    capitals = code.upper()
    if _CYCLE.search(capitals) is not None:
        _refuse_in_cycles(capitals, file)
    found = [match.start() for match in _NOT_THE_SAME.finditer(capitals)]
    called: dict[int, int] = {}
    if not found:
        return lines, called
    starts = [0, *accumulate(map(len, lines))]
    for index in sorted({bisect_right(starts, at) - 1 for at in found}):
        line = code[starts[index] : starts[index + 1]]

        def note(key: str, text: str, number: int = index + 1) -> None:
            notes.setdefault(key, (number, text))

        try:
            lines[index] = _plain_line(lines[index], line, note)
        except ValueError as error:
            raise refusal(file, index + 1, str(error)) from None
        for call in _M97.finditer(line):
            called.setdefault(int(call[1]), index + 1)
    return lines, called


def _refuse_in_cycles(code: str, file: str) -> None:
    """Refuse words in drilling cycles that FANUC reads differently: I, J, K of pecks, and P from a variable."""
    cycle = ""
    for number, whole_line in enumerate(_LINE.findall(code), start=1):
        line = whole_line.partition(";")[0]
        if _MACRO.match(line):
            continue
        codes = [_code(match[1]) for match in _G.finditer(line)]
        for name in codes:
            if name in {"0", "1", "2", "3", "80"} or name in _CYCLES:
                cycle = name if name in _CYCLES else ""
        if not cycle or {"10", "65"} & {*codes}:
            continue
        if cycle in {"73", "74", "83", "84"} and (word := _PECKS.search(line)):
            what = "changes the pecks or the retract of a Haas, and K counts the holes on FANUC"
            raise refusal(file, number, f"{word[0][0]} in a drilling cycle {what}: it is not read")
        if _VARIABLE_P.search(line) and re.search(r"M[ \t]*0*9[789](?!\d)", line) is None:
            what = f"the dwell of G{cycle} by a variable"
            raise refusal(file, number, f"{what} is in seconds or milliseconds, depending on the point of its value")


def _plain_line(line: str, code: str, note: Callable[[str, str], None]) -> str:
    """Translate a line; `code` is the same line with its comments blanked out."""
    end = line[len(line.rstrip("\r\n")) :]
    text, code = line[: len(line) - len(end)], code[: len(line) - len(end)]
    if ";" in code:
        text, code = text[: code.index(";")], code[: code.index(";")]
    if _MACRO.match(code):
        return text + end
    codes = [_code(match[1]) for match in _G.finditer(code)]
    _refuse(codes, code)
    comments = "".join(_COMMENT.findall(text)) if "(" in text else ""
    words = code.rstrip()
    for match in _LEFT_OUT.finditer(words):
        limits = match[1] == "103"
        what = "limits the blocks that the control looks ahead" if limits else "sets smoothness and corner rounding"
        note(f"G{match[1]}", f"G{match[1]} {what}: left out; its effect on the time is not modelled")
    words = _LEFT_OUT.sub("", words)
    words = _OFFSET.sub(r"G54.1P\1", words)
    words = _OLD_OFFSET.sub(lambda match: f"G54.1P{int(match[1]) - 109}", words)
    words = _M97.sub(lambda match: f"M98P{_CALL_BASE + int(match[1])}{match[2].strip() or 'L1'}", words)
    if (unread := _UNREAD_M97.search(words)) is not None:
        raise ValueError(f"{unread[0]} takes an N number directly after it (M97 P1000): it is not read otherwise")
    if _M98.search(words) is not None and re.search(r"L[ \t]*[\d#\[]", words, re.IGNORECASE) is None:
        # Five digits or more are a program number on a Haas; FANUC would read repetitions and a number of four digits.
        words = _PROGRAM.sub(lambda match: f"{match[0]}L1", words)
    words = _with_dwell(words, codes, note)
    if "52" in codes or "92" in codes:
        note("setting 33", "G52 and G92 are read as with setting 33 = FANUC or HAAS; YASNAC's G92 sets G52")
    return words.rstrip() + comments + end


def _code(text: str) -> str:
    """A code without leading zeros: 04 is 4."""
    whole, point, decimals = text.partition(".")
    return str(int(whole)) + (point + decimals if decimals.strip("0") else "")


def _refuse(codes: list[str], code: str) -> None:
    for name in codes:
        if name in _REFUSED:
            raise ValueError(f"G{name} is {_REFUSED[name]} on a Haas: it is not read")
        if name not in _AS_FANUC and not re.fullmatch(r"103|154|187|1[12]\d", name):
            raise ValueError(f"G{name}: no documentation was found for it on a Haas: it is not supported")
    if (feed := _INTEGER_F.search(code)) is not None:
        value = int(feed[1])
        raise ValueError(
            f"F{feed[1]} without a decimal point: setting 77 of a Haas makes it F{value}. or F{value / 1000:g} mm (F"
            f"{value / 10000:g} inch), FANUC F{value}.: write the point"
        )
    if re.search(r"M[ \t]*96(?!\d)", code, re.IGNORECASE):
        raise ValueError("M96 jumps if an input is not set, which is known only at the machine: it is not supported")
    if "10" in codes and (word := re.search(r"L[ \t]*(1[23])(?!\d)", code, re.IGNORECASE)):
        raise ValueError(
            f"G10 L{word[1]}: a diameter or a radius, depending on setting 40 of a Haas; FANUC's is a radius: write "
            "the radius into input.tool_radius_mm"
        )
    if "10" in codes and re.search(r"L[ \t]*2(?!\d)", code, re.IGNORECASE) and re.search(r"P[ \t]*0+(?!\d)", code):
        raise ValueError("G10 L2 P0 sets the origin of G52 on a Haas, and an external offset on FANUC: it is not read")


def _with_dwell(words: str, codes: list[str], note: Callable[[str, str], None]) -> str:
    """Convert P of a dwell, which is in seconds with a decimal point and in milliseconds without one."""
    others = {"10", "54.1", "65", "154"} & {*codes} or re.search(r"M[ \t]*0*(?:19|9[789])(?!\d)", words, re.IGNORECASE)
    match = _P.search(words)
    if match is None or (others and "4" not in codes):
        return words
    if "4" in codes and match[1] in {"#", "["}:
        raise ValueError(
            "a dwell by a variable is in seconds or milliseconds, depending on the decimal point of its value"
        )
    if "." not in match[1]:
        return words  # milliseconds, as FANUC's, or a variable
    seconds = float(match[1])
    note(
        "dwell",
        f"P{match[1]} with a point is a dwell of {seconds:g} s on a Haas, without one milliseconds; FANUC's P is "
        "milliseconds and has no point",
    )
    milliseconds = round(seconds * 1e3)
    if "4" not in codes and abs(milliseconds - seconds * 1e3) > 1e-6:
        raise ValueError(f"P{match[1]} is not a whole number of milliseconds, the unit of FANUC's cycles")
    word = f"X{match[1]}" if "4" in codes else f"P{milliseconds}"
    return words[: match.start()] + word + words[match.end() :]


def _with_subprograms(lines: list[str], called: Mapping[int, int], file: str) -> tuple[list[str], list[int]]:
    """Append each part that M97 calls, from its N number to M99, as a program; return lines and their source lines."""
    end = "\r\n" if lines[0].endswith("\r\n") else "\n"
    plain = [_COMMENT.sub("", line) for line in lines]
    begins = {int(match[1]): index for index, line in reversed([*enumerate(plain)]) if (match := _N.match(line))}
    closing = next((i for i in range(len(lines) - 1, 0, -1) if lines[i].strip() == "%"), None)
    last = len(lines) if closing is None else closing
    head, tail = lines[:last], lines[last:]
    if head and not head[-1].endswith("\n"):
        head[-1] += end
    numbers = [*range(1, last + 1)]
    first = next((index for index, line in enumerate(plain) if line.strip() not in {"", "%"}), 0)
    if _O.match(plain[first]) is None:  # after a program without a number another one would be part of it
        head.insert(first, f"O{_CALL_BASE}{end}")
        numbers.insert(first, first + 1)
    for number, call in sorted(called.items()):
        if number not in begins:
            raise refusal(file, call, f"M97 P{number}: there is no N{number} in the program")
        begin = begins[number]
        stop = next((i for i in range(begin, last) if _M99.search(plain[i])), None)
        if stop is None:
            raise refusal(file, begin + 1, f"N{number}, which M97 calls, does not end with M99")
        head.append(f"O{_CALL_BASE + number}{end}")
        numbers.append(begin + 1)
        for index in range(begin, stop + 1):
            head.append(lines[index] if lines[index].endswith("\n") else lines[index] + end)
            numbers.append(index + 1)
    return [*head, *tail], [*numbers, *range(last + 1, len(lines) + 1)]
