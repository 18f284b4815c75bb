"""A program in whatever control's words as a plain program in FANUC's: which dialect it is, and its reader."""

from __future__ import annotations

from codecs import BOM_UTF8
from collections.abc import Callable
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from shapegcode.program.foreign.plain import ForeignProgram, refusal
from shapegcode.program.foreign.recognize import CONTROLS, recognize, words_behind_semicolon

if TYPE_CHECKING:
    from shapegcode.machine import Machine

Reader = Callable[..., ForeignProgram]


def foreign_program(data: bytes, machine: Machine, source: str, folder: Path | None) -> ForeignProgram | None:
    """The plain program of a text in another control's words; None: it is in FANUC's.

    The dialect is that of `controller.dialect`; "auto": as words tell that only one control knows, and where none
    does, that of a control whose planner is LinuxCNC's (`controller.kind`).
    """
    dialect, reason = input_dialect(data, machine, source)
    if dialect == "fanuc":
        refuse_words_behind_semicolon(data, source)
        return None
    text = data.removeprefix(BOM_UTF8).decode("latin-1")
    read = _reader(dialect)
    program = read(text, file=source, machine=machine, folder=folder)
    return replace(program, reason=reason)


def refuse_words_behind_semicolon(data: bytes, source: str) -> None:
    """A semicolon ends a block for FANUC, and begins a comment for other controls."""
    line = words_behind_semicolon(data)
    if line is not None:
        raise refusal(
            source,
            line,
            "words behind `;`: FANUC begins a block there, LinuxCNC, a Haas and a Sinumerik have a comment; write a "
            "line end or ( ), or say whose program it is: --set controller.dialect=linuxcnc, haas or siemens",
        )


def input_dialect(data: bytes, machine: Machine, source: str) -> tuple[str, str]:
    """In whose words a program is."""
    stated = machine.controller.dialect
    # A machine of FANUC's kind and a program without foreign words: the usual case takes one look.
    expected = stated if stated != "auto" else machine.controller.kind
    signs = recognize(data, of_fanuc=expected in {"linuxcnc", "siemens"})
    if stated != "auto":
        for sign in signs:
            if sign.dialect != stated:
                raise refusal(
                    source,
                    sign.line,
                    f"this is a program for {CONTROLS[sign.dialect]}: {sign.words} ({sign.meaning}), which "
                    f"{CONTROLS[stated]} does not know; controller.dialect is {stated}: "
                    f"--set controller.dialect={sign.dialect} reads it",
                )
        return stated, f"controller.dialect = {stated}"
    if len(signs) > 1:
        first, second = signs[0], signs[1]
        raise refusal(
            source,
            second.line,
            f"{second.words} is a word of {CONTROLS[second.dialect]} ({second.meaning}), and {first.words} in line "
            f"{first.line} one of {CONTROLS[first.dialect]} ({first.meaning}): the program mixes them; "
            "controller.dialect says which control reads it",
        )
    if signs:
        return signs[0].dialect, signs[0].reason
    if machine.controller.kind == "linuxcnc":
        return "linuxcnc", "controller.kind = linuxcnc"
    return "fanuc", ""


def _reader(dialect: str) -> Reader:
    """Loaded when a program of its dialect is read: most are FANUC's."""
    module = import_module(f"shapegcode.program.foreign.{dialect}")
    reader: Reader = getattr(module, f"read_{dialect}")
    return reader
