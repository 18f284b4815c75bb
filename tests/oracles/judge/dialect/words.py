"""The words of an NC block: letters with numbers, variables or expressions."""

from __future__ import annotations

import re
from dataclasses import dataclass

from .expressions import Expression, Reader, half_away
from .tape import Alarm

_LITERAL = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)")
INTEGERS = "NOMTSDHLP"
#: Least increment of a computed length, mm and inch.
INCREMENT = {"G21": 0.001, "G20": 0.0001}


@dataclass(frozen=True)
class Word:
    """One word. `plain` is true for a literal without a decimal point."""

    letter: str  #: ",R" and ",C" for corner words
    value: float
    plain: bool = False
    literal: str = ""


def parse_words(text: str, line: int, read: Reader) -> list[Word]:
    """The words in order. A word whose value is a vacant variable is left out."""
    out: list[Word] = []
    at = 0
    while at < len(text):
        letter = text[at]
        at += 1
        if letter == ",":
            if text[at : at + 1] not in ("R", "C"):
                raise Alarm(line, f"',' without R or C in {text!r}", 9)
            letter += text[at]
            at += 1
        if not letter[-1].isalpha():
            raise Alarm(line, f"{letter!r} is no address", 9)
        if found := _LITERAL.match(text, at):
            literal = found.group()
            at = found.end()
            if len(literal.strip("+-").replace(".", "")) > 8:
                raise Alarm(line, f"{letter}{literal} has too many digits", 3)
            out.append(Word(letter, float(literal), "." not in literal, literal))
            continue
        if text[at : at + 1] not in ("#", "[", "-", "+"):
            raise Alarm(line, f"no number behind {letter} in {text!r}", 5)
        expression = Expression(text, at, read, line, in_word=True)
        value = expression.factor()
        at = expression.at
        if value is not None:
            out.append(Word(letter, value))
    return out


class BlockWords:
    """Look-up by letter (the last one of a letter counts) with the conversion that the address needs."""

    def __init__(self, words: list[Word], line: int, calculator: bool) -> None:
        self.words, self.line, self.calculator = words, line, calculator
        self.by_letter = {w.letter: w for w in words}

    def __contains__(self, letter: str) -> bool:
        return letter in self.by_letter

    def length(self, letter: str, units: str) -> float:
        """mm (or degrees of a rotation, which units do not touch: see `plain_number`)."""
        return self.counted(letter, INCREMENT[units]) * (25.4 if units == "G20" else 1.0)

    def counted(self, letter: str, increment: float) -> float:
        """A number that without a point counts increments unless the control is of the calculator type; computed
        values are rounded to the increment."""
        word = self.by_letter[letter]
        if word.plain:
            return word.value * (1.0 if self.calculator else increment)
        if word.literal:
            return word.value
        return half_away(word.value / increment) * increment

    def number(self, letter: str) -> float:
        return self.by_letter[letter].value

    def whole(self, letter: str) -> int:
        return int(half_away(self.by_letter[letter].value))
