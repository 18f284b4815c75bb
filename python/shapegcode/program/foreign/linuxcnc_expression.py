"""Expressions and words of LinuxCNC: a line's text becomes words whose values are worked out when it runs.

Precedence and functions: LinuxCNC's G-code overview, "Binary operators" and "Functions"; its interpreter rs274 confirms
them (tests/python/test_input_linuxcnc.py).
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

if TYPE_CHECKING:
    from shapegcode.program.foreign.linuxcnc_parameters import ParameterTable

_EQUAL = 1e-4  # EQ, NE: values nearer to each other are equal; in later versions than 2.9.0~pre1 for LE and GE too

Value = Callable[["ParameterTable"], float]


Setting: TypeAlias = tuple["str | Value", "Value"]  # `#5 = ...`, or `#<name> = ...`: what is set, and to what


@dataclass(frozen=True)
class Block:
    """A line: its words in order, its settings, its comments."""

    words: tuple[tuple[str, float | Value], ...]
    settings: tuple[Setting, ...] = ()
    comments: tuple[str, ...] = ()
    skips: bool = False


def _divide(a: float, b: float) -> float:
    if b == 0.0:
        raise ValueError("division by zero")
    return a / b


def _modulo(a: float, b: float) -> float:
    if b == 0.0:
        raise ValueError("MOD by zero")
    rest = math.fmod(a, b)
    return rest + abs(b) if rest < 0.0 else rest


def _power(a: float, b: float) -> float:
    if (a < 0.0 and b != math.floor(b)) or (a == 0.0 and b < 0.0):
        raise ValueError(f"{a:g} to the power of {b:g} has no value")
    return float(a**b)


_OPERATORS: dict[str, tuple[int, Callable[[float, float], float]]] = {
    "**": (6, _power),
    "*": (5, lambda a, b: a * b),
    "/": (5, _divide),
    "mod": (5, _modulo),
    "+": (4, lambda a, b: a + b),
    "-": (4, lambda a, b: a - b),
    "eq": (3, lambda a, b: float(abs(a - b) < _EQUAL)),
    "ne": (3, lambda a, b: float(abs(a - b) >= _EQUAL)),
    "lt": (3, lambda a, b: float(a < b)),
    "gt": (3, lambda a, b: float(a > b)),
    "le": (3, lambda a, b: float(a <= b)),
    "ge": (3, lambda a, b: float(a >= b)),
    "and": (2, lambda a, b: float(a != 0.0 and b != 0.0)),
    "or": (2, lambda a, b: float(a != 0.0 or b != 0.0)),
    "xor": (2, lambda a, b: float((a != 0.0) != (b != 0.0))),
}


def _of_some(name: str, must: str, function: Callable[[float], float]) -> Callable[[float], float]:
    """A function that has no value for every number: then Python's raises."""

    def checked(value: float) -> float:
        try:
            return function(value)
        except ValueError:
            raise ValueError(f"{name} of {value:g}: it must {must}") from None

    return checked


_FUNCTIONS: dict[str, Callable[[float], float]] = {
    "abs": abs,
    "acos": _of_some("ACOS", "be -1 to 1", lambda value: math.degrees(math.acos(value))),
    "asin": _of_some("ASIN", "be -1 to 1", lambda value: math.degrees(math.asin(value))),
    "cos": lambda value: math.cos(value * math.pi / 180.0),
    "exp": math.exp,
    "fix": lambda value: float(math.floor(value)),
    "fup": lambda value: float(math.ceil(value)),
    "ln": _of_some("LN", "be positive", math.log),
    "round": lambda value: float(int(value + (0.5 if value >= 0.0 else -0.5))),
    "sin": lambda value: math.sin(value * math.pi / 180.0),
    "sqrt": _of_some("SQRT", "not be negative", math.sqrt),
    "tan": lambda value: math.tan(value * math.pi / 180.0),
}

_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)")
_NAME = re.compile(r"#<([^>]*)>")
_OPERATOR = re.compile(r"\*\*|\*|/|\+|-|mod|eq|ne|lt|gt|le|ge|and|or|xor")
_FUNCTION = re.compile(r"(abs|acos|asin|atan|cos|exists|exp|fix|fup|ln|round|sin|sqrt|tan)(?=\[)")
_COMMENT = re.compile(r"\(([^()]*)\)|;(.*)")
_BLANKS = {ord(blank): None for blank in " \t\r"}  # what LinuxCNC leaves out; other ones it refuses
_IN_A_WORD = re.compile(r"[a-z#=+*\[-]\0|\0[\d.=+*\]]")
_LETTERS = frozenset("abcdefghijklmnpqrstuvwxyz@^$")


class Scanner:
    """Reads values and words of one line, whose blanks are gone and letters small."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.at = 0

    @property
    def left(self) -> str:
        """What was not read yet."""
        return self.text[self.at :]

    def take(self, sign: str) -> bool:
        """Whether `sign` stands here; it is read then."""
        if self.text.startswith(sign, self.at):
            self.at += len(sign)
            return True
        return False

    def value(self) -> float | Value:
        """A number, a parameter, an expression in brackets or a function, each with its sign."""
        if (number := _NUMBER.match(self.text, self.at)) is not None:
            self.at = number.end()
            return float(number[0])
        if self.take("-"):
            operand = _worked_out(self.value())
            return lambda parameters: -operand(parameters)
        if self.take("+"):
            return self.value()
        if self.take("["):
            return self._expression()
        if self.text.startswith("#", self.at):
            return self._parameter()
        if (function := _FUNCTION.match(self.text, self.at)) is not None:
            self.at = function.end() + 1
            return self._function(function[1])
        raise ValueError(f"a value is expected at {self.left[:12]!r}" if self.left else "a value is missing at the end")

    def setting(self) -> Setting:
        """`#5=...`; the `#` stands here."""
        name: str | Value
        if (named := _NAME.match(self.text, self.at)) is not None:
            self.at = named.end()
            name = named[1]
        else:
            self.at += 1
            name = _worked_out(self.value())
        if not self.take("="):
            raise ValueError(f"= is expected at {self.left[:12]!r}")
        return name, _worked_out(self.value())

    def _parameter(self) -> Value:
        if (named := _NAME.match(self.text, self.at)) is not None:
            self.at = named.end()
            name = named[1]
            return lambda parameters: parameters.named(name)
        self.at += 1
        number = self.value()
        if isinstance(number, float):
            fixed = _whole(number)
            return lambda parameters: parameters.numbered(fixed)
        worked_out = number
        return lambda parameters: parameters.numbered(_whole(worked_out(parameters)))

    def _function(self, name: str) -> Value:
        if name == "exists":
            named = _NAME.match(self.text, self.at)
            if named is None or not self.text.startswith("]", named.end()):
                raise ValueError("EXISTS takes a named parameter: EXISTS[#<name>]")
            self.at = named.end() + 1
            asked = named[1]
            return lambda parameters: float(parameters.exists(asked))
        argument = self._expression()
        if name == "atan":
            if not self.take("/["):
                raise ValueError("ATAN takes two values: ATAN[y]/[x]")
            other = self._expression()
            return lambda parameters: math.degrees(math.atan2(argument(parameters), other(parameters)))
        function = _FUNCTIONS[name]
        return lambda parameters: function(argument(parameters))

    def _expression(self) -> Value:
        """Up to the bracket that closes it; operators of one precedence from left to right."""
        value = self._operation(0)
        if not self.take("]"):
            raise ValueError(f"an operator or ] is expected at {self.left[:12]!r}")
        return value

    def _operation(self, above: int) -> Value:
        """Values and the operators of a higher rank between them."""
        left = _worked_out(self.value())
        while (found := _OPERATOR.match(self.text, self.at)) and (rank := _OPERATORS[found[0]][0]) > above:
            self.at = found.end()
            left = _joined(_OPERATORS[found[0]][1], left, self._operation(rank))
        return left


def _joined(operator: Callable[[float, float], float], left: Value, right: Value) -> Value:
    return lambda parameters: operator(left(parameters), right(parameters))


def _worked_out(value: float | Value) -> Value:
    if isinstance(value, float):
        fixed = value
        return lambda parameters: fixed
    return value


def _whole(value: float) -> int:
    number = round(value)
    if abs(value - number) > _EQUAL:
        raise ValueError(f"parameter number {value:g} is not whole")
    return number


def evaluate(value: float | Value, parameters: ParameterTable) -> float:
    """The value of a word when its line runs."""
    try:
        result = value if isinstance(value, float) else value(parameters)
    except OverflowError:
        raise ValueError("a value is too large to be computed") from None
    if not math.isfinite(result):
        raise ValueError("a value is too large to be computed")
    return result


def without_comments(line: str) -> tuple[str, tuple[str, ...]]:
    """A line without comments and blanks, its letters small, and the comments."""
    if "(" not in line and ";" not in line:
        return line.translate(_BLANKS).lower(), ()
    comments: list[str] = []

    def found(match: re.Match[str]) -> str:
        comments.append((match[1] if match[1] is not None else match[2]).strip())
        return "\0"

    code = _COMMENT.sub(found, line)
    if "(" in code or ")" in code or "\0" in line:
        raise ValueError("a comment does not close, or stands inside another one")
    code = re.sub("\0+", "\0", code.translate(_BLANKS).lower())
    if _IN_A_WORD.search(code) is not None:
        raise ValueError("a comment stands inside a word: `X1(a)2` is not X12")
    return code.replace("\0", ""), tuple(comments)


def read_block(line: str) -> Block:
    """The words of a line that is no O line."""
    code, comments = without_comments(line)
    skips = code.startswith("/")
    if code.startswith("/o"):
        raise ValueError("an O word behind `/`: it is not read; take the `/` away, or the line")
    scanner = Scanner(code[1:] if skips else code)
    words: list[tuple[str, float | Value]] = []
    settings: list[Setting] = []
    seen: set[str] = set()
    while scanner.left:
        letter = scanner.text[scanner.at]
        if letter == "#":
            settings.append(scanner.setting())
            continue
        if letter not in _LETTERS:
            raise ValueError(f"{scanner.left[:12]!r} is no word")
        scanner.at += 1
        if letter in seen and letter not in "gm":
            raise ValueError(f"{letter.upper()} stands twice in a block")
        seen.add(letter)
        words.append((letter, scanner.value()))
    return Block(tuple(words), tuple(settings), comments, skips)
