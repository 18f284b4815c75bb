"""Turning programs, which are not shaped: recognised by what only a lathe's program holds, before they are read."""

from __future__ import annotations

import re

_LOOKED_AT_BYTES = 65536
_COMMENT = re.compile(rb"\([^)\n]*+\)?+")  # an unclosed one to the end of its line: linear
_OF_A_MILL = re.compile(rb"Y\s*[-+.\d#\[]|M0*6(?!\d)")
_SURE = (
    (re.compile(rb"G(?:50|0*92)(?=\s*S\s*\d)\s*S\s*\d+"), "spindle speed limit"),
    (re.compile(rb"G96(?![\d.])(?:\s*S\s*\d+)?"), "constant surface speed"),
    (re.compile(rb"G7[0-3]\s*(?:P\s*\d+\s*Q\s*\d+|U\s*[\d.]+\s*R\s*[\d.]+|W\s*[\d.]+\s*R\s*[\d.]+)"), "turning cycle"),
    (re.compile(rb"T\d{4}(?!\d)"), "tool and offset in one word"),
    (re.compile(rb"(?<![A-Z])[UW]\s*-?\d*\.?\d+"), "incremental diameter or length"),
)
_LIKELY = (
    (re.compile(rb"G97(?![\d.])(?:\s*S\s*\d+)?"), "constant spindle speed"),
    (re.compile(rb"F0?\.\d+"), "feed per revolution"),
)


def signs_of_turning(text: bytes) -> tuple[int, str] | None:
    """What shows that a program is one of a lathe; a program with Y words or a tool change M06 is none."""
    code = _COMMENT.sub(b"", text[:_LOOKED_AT_BYTES].upper())
    sure = [(found, meaning) for sign, meaning in _SURE if (found := sign.search(code))]
    likely = [(found, meaning) for sign, meaning in _LIKELY if (found := sign.search(code))]
    if not sure or len(sure) + len(likely) < 2 or _OF_A_MILL.search(code):
        return None
    signs = sorted((*sure, *likely), key=lambda sign: sign[0].start())
    said = ", ".join(f"{' '.join(found[0].decode('latin-1').split())} ({meaning})" for found, meaning in signs)
    return code.count(b"\n", 0, signs[0][0].start()) + 1, said
