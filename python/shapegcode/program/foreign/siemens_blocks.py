"""Blocks of SINUMERIK programs: heads, words, statements of control flow, definitions.

How blocks are made up: Programming Manual 12/2019, easymanua.ls 1265481 pp. 43 to 45; statements of control flow as
nc-gcode-interpreter 0.2 reads them, which cites the SINUMERIK ONE manual, sections 4.1.5 and 4.1.7.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace
from functools import lru_cache

from shapegcode.program.foreign.siemens_expressions import (
    NAME,
    AtColumn,
    Expression,
    SiemensScanner,
    WordError,
    arguments,
    expression,
    indices,
)


@dataclass(frozen=True)
class Word(AtColumn):
    """One word of a block."""

    name: str  # "X", "CR", "M"; of a G code with its number, "G1"; of a call or a bare word its name
    column: int  # where it stands, from 1
    value: Expression | None = None  # what stands behind the address; None: nothing
    mode: str = ""  # "AC" or "IC" of `=AC(...)` and `=IC(...)`
    index: tuple[Expression, ...] = ()  # of `NAME[...]=`
    given: tuple[Expression | None, ...] | None = None  # of a call `NAME(...)`; None: no brackets


@dataclass(frozen=True)
class Jump(AtColumn):
    """A jump, and under which condition."""

    condition: Expression | None
    command: str  # GOTO, GOTOF, GOTOB, GOTOC
    target: str  # label, or N and the number of a block
    column: int


@dataclass(frozen=True)
class Definition:
    """A variable of DEF, or a parameter of PROC."""

    kind: str
    name: str
    column: int
    shape: tuple[Expression, ...] = ()
    start: Expression | None = None
    by_reference: bool = False


@dataclass(frozen=True)
class SiemensBlock(AtColumn):
    """A block as it was read; what `kind` says decides which fields count."""

    kind: str = "WORDS"
    skip: bool = False
    number: str = ""  # "N10"
    label: str = ""
    column: int = 1
    words: tuple[Word, ...] = ()
    condition: Expression | None = None  # of IF, WHILE, UNTIL; what CASE chooses by; where FOR ends; how often of AGAIN
    jumps: tuple[Jump, ...] = ()
    name: str = ""  # of the variable of FOR, the label of AGAIN, the program of PROC
    index: tuple[Expression, ...] = ()
    start: Expression | None = None  # of FOR
    definitions: tuple[Definition, ...] = ()
    saves: bool = False  # PROC ... SAVE
    comment: str = ""


_HEAD = re.compile(r"\s*(/\d?)?\s*(?:(N|:)\s*(\d+))?")
_LABEL = re.compile(r"([A-Z_][A-Z0-9_]+)\s*:(?!=)")
_ADDRESS = re.compile(r"([A-Z])([-+]?(?:\d+\.?\d*|\.\d+)(?:EX[-+]?\d+)?)")
_ASSIGNED = re.compile(r"\s*=(?!=)")
_MODE = re.compile(r"(AC|IC|DC|ACP|ACN|CAC|CIC|CDC)\s*\(")
_JUMP = re.compile(r"GOTO[FBC]?(?![A-Z0-9_])")
_TARGET = re.compile(r"N?\d+|[A-Z_][A-Z0-9_]*")
_TYPE = re.compile(r"(?:REAL|INT|BOOL|STRING|CHAR|AXIS|FRAME)(?![A-Z0-9_])")
_WORD = {word: re.compile(rf"{word}(?![A-Z0-9_])") for word in ("TO", "OF", "DEFAULT", "IF", "VAR", "SAVE")}
_SYNCHRONOUS = {"ID", "IDS", "WHEN", "WHENEVER", "FROM", "EVERY", "DO"}
_BARE = {"ELSE", "ENDIF", "ENDWHILE", "ENDFOR", "LOOP", "ENDLOOP"}
_ENDS_OF = {"ELSE": "IF", "ENDIF": "IF", "ENDWHILE": "WHILE", "ENDFOR": "FOR", "ENDLOOP": "LOOP", "UNTIL": "REPEAT"}
_HEADING = re.compile(r"\s*%\s*(?:_N_)?([A-Z0-9_]+?)(?:_(MPF|SPF))?\s*$")


def split_comment(line: str) -> tuple[str, str]:
    """A line without its comment, and the comment."""
    if '"' not in line:
        code, _, comment = line.partition(";")
        return code, comment.strip()
    quoted = False
    for at, sign in enumerate(line):
        if sign == '"':
            quoted = not quoted
        elif sign == ";" and not quoted:
            return line[:at], line[at + 1 :].strip()
    return line, ""


@lru_cache(maxsize=4096)
def block_of(line: str) -> SiemensBlock:
    """Read a line."""
    code, comment = split_comment(line.rstrip())
    parts = code.split('"')  # strings keep their small letters
    scan = SiemensScanner('"'.join(part if index % 2 else part.upper() for index, part in enumerate(parts)))
    head = _HEAD.match(scan.text)
    assert head is not None  # all of it may be left out
    scan.at = head.end()
    label = _LABEL.match(scan.text, _begin(scan))
    if label is not None:
        scan.at = label.end()
    block = SiemensBlock(
        skip=head[1] is not None, number=f"N{int(head[3])}" if head[3] else "", label=label[1] if label else "",
        column=_begin(scan) + 1, comment=comment,
    )  # fmt: skip
    if scan.is_done:
        return block
    name = NAME.match(scan.text, scan.at)
    found = _statement(scan, name[0], block) if name is not None else None
    if found is None:
        return replace(block, words=_words(scan))
    if not scan.is_done:
        raise scan.error(f"{scan.rest} behind {name[0] if name else ''}: the block must end here")
    return found


def _begin(scan: SiemensScanner) -> int:
    scan.skip()
    return scan.at


def _statement(scan: SiemensScanner, name: str, block: SiemensBlock) -> SiemensBlock | None:
    """A statement of control flow or a definition; None: the block is one of words."""
    begin = scan.at
    scan.at += len(name)
    if name in _BARE:
        return replace(block, kind=name)
    if name in ("WHILE", "UNTIL"):
        return replace(block, kind=name, condition=expression(scan))
    if name == "IF":
        condition = expression(scan)
        if scan.is_done:
            return replace(block, kind="IF", condition=condition)
        return replace(block, kind="JUMPS", jumps=_jumps(scan, condition))
    if _JUMP.fullmatch(name):
        scan.at = begin
        return replace(block, kind="JUMPS", jumps=_jumps(scan, None))
    if name == "DEF":
        return replace(block, kind="DEF", definitions=_definitions(scan))
    if (read := _READERS.get(name)) is not None:
        return read(scan, block)
    if name not in {"EXTERN", *_SYNCHRONOUS}:
        scan.at = begin
        return None
    scan.at = len(scan.text)
    return replace(block, kind="EXTERN") if name == "EXTERN" else replace(block, words=(Word(name, begin + 1),))


def _jumps(scan: SiemensScanner, condition: Expression | None) -> tuple[Jump, ...]:
    """One jump or several, each behind its condition."""
    found = [_jump(scan, condition)]
    while scan.take(_WORD["IF"]):
        found.append(_jump(scan, expression(scan)))
    return tuple(found)


def _jump(scan: SiemensScanner, condition: Expression | None) -> Jump:
    column = _begin(scan) + 1
    command = scan.take(_JUMP)
    if not command:
        raise scan.error(f"{scan.rest} behind the condition: GOTOF, GOTOB, GOTO or GOTOC must follow, or nothing")
    target = scan.take(_TARGET)
    if not target:
        raise scan.error(f"{command} without a label: one must follow, or N and the number of a block")
    return Jump(condition, command, f"N{int(target)}" if target.isdigit() else target, column)


def _case(scan: SiemensScanner, block: SiemensBlock) -> SiemensBlock:
    chosen = expression(scan)
    if not scan.take(_WORD["OF"]):
        raise scan.error(f"{scan.rest or 'the end of the block'} where OF is expected")
    jumps = []
    while not scan.is_done:
        jumps.append(_jump(scan, None if scan.take(_WORD["DEFAULT"]) else expression(scan)))
    return replace(block, kind="CASE", condition=chosen, jumps=tuple(jumps))


def _for(scan: SiemensScanner, block: SiemensBlock) -> SiemensBlock:
    name = scan.take(NAME)
    index = indices(scan)
    scan.require("=", "= and the first value of FOR")
    start = expression(scan)
    if not scan.take(_WORD["TO"]):
        raise scan.error(f"{scan.rest or 'the end of the block'} where TO is expected")
    return replace(block, kind="FOR", name=name, index=index, start=start, condition=expression(scan))


def _repeat(scan: SiemensScanner, block: SiemensBlock) -> SiemensBlock:
    """REPEAT of a loop, or `REPEAT label P=n` of a part of the program."""
    if scan.is_done:
        return replace(block, kind="REPEAT")
    label = scan.take(NAME)
    if not scan.is_done and not re.match(r"\s*P\s*=?\s*\d|\s*P\s*=", scan.text[scan.at :]):
        raise scan.error(f"{scan.rest} behind REPEAT {label}: P= and a number must follow; an end label is not read")
    words = _words(scan)
    return replace(block, kind="AGAIN", name=label, condition=words[0].value if words else None)


def _definitions(scan: SiemensScanner) -> tuple[Definition, ...]:
    kind = _type(scan, "DEF")
    found = []
    while True:
        column = _begin(scan) + 1
        name = scan.take(NAME)
        if not name or name.startswith("$"):
            raise scan.error(f"{scan.rest or 'the end of the block'} where the name of a variable is expected")
        shape = indices(scan)
        start = None
        if scan.takes("="):
            if shape:
                raise scan.error(f"values of the array {name}: they must be set one by one")
            start = expression(scan)
        found.append(Definition(kind, name, column, shape, start))
        if not scan.takes(","):
            return tuple(found)


def _type(scan: SiemensScanner, what: str) -> str:
    kind = scan.take(_TYPE)
    if kind in ("", "CHAR", "AXIS", "FRAME"):
        raise scan.error(f"{kind or scan.rest or 'nothing'} behind {what}: REAL, INT, BOOL or STRING is expected")
    if kind == "STRING":
        indices(scan)
    return kind


def _procedure(scan: SiemensScanner, block: SiemensBlock) -> SiemensBlock:
    name = scan.take(NAME)
    found: list[Definition] = []
    if scan.takes("(") and not scan.takes(")"):
        while True:
            by_reference = bool(scan.take(_WORD["VAR"]))
            kind, column = _type(scan, "PROC ("), _begin(scan) + 1
            parameter = scan.take(NAME)
            if indices(scan):
                raise scan.error(f"{parameter}: arrays as parameters are not read")
            start = expression(scan) if scan.takes("=") else None
            found.append(Definition(kind, parameter, column, (), start, by_reference))
            if scan.takes(")"):
                break
            scan.require(",", "a comma or the closing bracket )")
    saves = _WORD["SAVE"].search(scan.text, scan.at) is not None
    scan.at = len(scan.text)  # attributes of the display: DISPLOF, SBLOF ...
    return replace(block, kind="PROC", name=name, definitions=tuple(found), saves=saves)


_READERS = {"CASE": _case, "FOR": _for, "REPEAT": _repeat, "PROC": _procedure}


def _words(scan: SiemensScanner) -> tuple[Word, ...]:
    found = []
    while not scan.is_done:
        found.append(_word(scan))
    return tuple(found)


def _word(scan: SiemensScanner) -> Word:
    begin = scan.at
    name = NAME.match(scan.text, begin)
    if name is None:
        raise scan.error(f"{scan.rest} where a word must begin: an address, a name or a code")
    scan.at = name.end()
    index = indices(scan) if scan.text[scan.at : scan.at + 1] == "[" else ()
    address = _ADDRESS.match(scan.text, begin)
    if _ASSIGNED.match(scan.text, scan.at) and not (address and _ends_before_a_word(address, name, scan.at)):
        return _assigned(scan, name[0], index, begin)
    if index:
        raise scan.error(f"{name[0]}[...] without a value: = and a value must follow")
    if address is not None and (address.end() >= name.end() or not _is_name(name[0])):
        scan.at = address.end()
        letter, digits = address[1], address[2]
        if letter == "G":
            if not digits.isdigit():
                raise scan.error(f"G{digits}: a G code must be a whole number", begin)
            return Word(f"G{int(digits)}", begin + 1)
        if letter == "L":
            return Word(f"L{digits}", begin + 1)  # zeros at the begin of it count: L1 is not L01
        constant: float | int = int(digits) if re.fullmatch(r"[-+]?\d+", digits) else float(digits.replace("EX", "e"))
        return Word(letter, begin + 1, lambda _scope: constant)
    if len(name[0]) == 1:
        raise scan.error(f"{name[0]} without a value: a number must follow it directly, or = and a value", begin)
    scan.skip()
    if scan.text[scan.at : scan.at + 1] == "(":
        return Word(name[0], begin + 1, given=tuple(arguments(scan, name[0])))
    return Word(name[0], begin + 1)


def _is_name(name: str) -> bool:
    """Whether it can be the name of a word or a program and not an address with its number: two letters begin it."""
    return len(name) > 1 and (name[1].isalpha() or name[1] == "_")


def _ends_before_a_word(address: re.Match[str], name: re.Match[str], at: int) -> bool:
    """Whether the next word begins within what looks like a name: `X10Y=5`."""
    begins = address.end() < name.end() == at and name.string[address.end()].isalpha()
    return begins and address[1] in "GMXYZFS" and not _is_name(name[0])


def _assigned(scan: SiemensScanner, name: str, index: tuple[Expression, ...], begin: int) -> Word:
    scan.require("=", "=")
    scan.skip()
    mode = _MODE.match(scan.text, scan.at)
    if mode is None:
        return Word(name, begin + 1, expression(scan), "", index)
    if mode[1] not in ("AC", "IC"):
        raise scan.error(f"{name}={mode[1]}( ) is one of a rotary axis: AC( ) or IC( ) is expected")
    scan.at = mode.end()
    value = expression(scan)
    scan.require(")", "a closing bracket )")
    return Word(name, begin + 1, value, mode[1], index)


@dataclass(frozen=True)
class ProgramLines:
    """One program: its lines, and where it stands."""

    name: str  # in capitals, without _N_ and _SPF
    file: str  # that holds it
    first: int  # line of the file at which `lines` begins, from 1
    lines: tuple[str, ...]  # as they stand there
    partners: dict[int, int] = field(default_factory=dict, compare=False)  # of IF, ELSE and loops: the next of them
    starts: dict[int, int] = field(default_factory=dict, compare=False)  # of the end of a loop: its begin

    def block(self, index: int) -> SiemensBlock:
        """The block of a line, from 0."""
        return block_of(self.lines[index])

    def find_structure(self) -> None:
        """Find what belongs together, once."""
        if self.partners:
            return
        open_ones: list[tuple[str, int, int]] = []  # word, first line, last line that it led to
        for index, line in enumerate(self.lines):
            if not _MAY_BE_STRUCTURE.search(line):
                continue
            try:
                block = self.block(index)
            except WordError:
                continue  # said when it is reached
            if block.kind in ("IF", "WHILE", "FOR", "REPEAT", "LOOP"):
                open_ones.append((block.kind, index, index))
            elif block.kind in _ENDS_OF:
                wanted = _ENDS_OF[block.kind]
                if not open_ones or open_ones[-1][0] != wanted:
                    raise StructureError(index, f"{block.kind} without {wanted}: {wanted} must come before it")
                _, first, last = open_ones.pop()
                self.partners[last] = index
                self.starts[index] = first
                if block.kind == "ELSE":
                    open_ones.append(("IF", first, index))
        if open_ones:
            word, first, _ = open_ones[-1]
            end = next(end for end, begin in reversed(_ENDS_OF.items()) if begin == word)
            raise StructureError(first, f"{word} is never closed: {end} must follow")
        self.partners.setdefault(-1, -1)

    def depth_path(self, index: int) -> tuple[int, ...]:
        """The structures around a line, by their first lines."""
        return tuple(
            first
            for end, first in sorted(self.starts.items())
            if first < index < end and self.block(end).kind != "ELSE"
        )


class StructureError(ValueError):
    """Of control flow; `index` is the line from 0."""

    def __init__(self, index: int, message: str) -> None:
        super().__init__(message)
        self.index = index


_MAY_BE_STRUCTURE = re.compile(r"(?i)IF|ELSE|WHILE|FOR|LOOP|REPEAT|UNTIL")


def programs_of_source(source: str, file: str) -> list[ProgramLines]:
    """The programs of a text: one, or several with heads `%_N_NAME_SPF`."""
    # A block ends with LF alone: str.splitlines would end a comment at a form feed or at a byte of an "Å", too.
    lines = source.replace("\r\n", "\n").replace("\r", " ").removesuffix("\n").split("\n")
    heads = [
        (index, head)
        for index, line in enumerate(lines)
        if line.lstrip().startswith("%") and (head := _HEADING.match(split_comment(line)[0].upper()))
    ]
    stem = re.sub(r"(?i)^_N_|_(MPF|SPF)$|\.[A-Z0-9]+$", "", re.split(r"[/\\]", file)[-1]).upper()
    if not heads:
        return [ProgramLines(stem, file, 1, tuple(lines))]
    ends = [index for index, _ in heads[1:]] + [len(lines)]
    return [
        ProgramLines(head[1], file, index + 2, tuple(lines[index + 1 : end]))
        for (index, head), end in zip(heads, ends, strict=True)
    ]
