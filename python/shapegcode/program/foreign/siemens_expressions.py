"""Expressions of SINUMERIK programs: operators, functions, R parameters and variables.

Priorities of the operators: Programming Manual 12/2019, easymanua.ls 1265481 p. 444; comparisons with a relative
tolerance of 1e-12: easymanua.ls 1572233 p. 37; conversions between types: easymanua.ls 662833 p. 54.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Protocol

Value = float | int | bool | str  # value of an expression: REAL, INT, BOOL or STRING


class WordError(ValueError):
    """A word that is not supported; `column` counts from 1."""

    def __init__(self, message: str, column: int) -> None:
        super().__init__(message)
        self.column = column


class AtColumn:
    """A token with its column in the line."""

    column: int

    def error(self, message: str) -> WordError:
        """An error of it."""
        return WordError(message, self.column)


class Scope(Protocol):
    """Where an expression finds the values of names."""

    def value_of(self, name: str, index: tuple[Value, ...], column: int) -> Value:
        """Value of a variable, an R parameter or an element of an array."""


Expression = Callable[[Scope], Value]  # function that returns its value in a scope

_SPACE = re.compile(r"[ \t]*")
_NUMBER = re.compile(r"(?:\d+\.?\d*|\.\d+)(?:EX[-+]?\d+)?")
_BITS = re.compile(r"'([HB])([0-9A-F]+)'")
_STRING = re.compile(r'"([^"]*)"')
NAME = re.compile(r"[$A-Z_][A-Z0-9_]*")
_OPERATOR = re.compile(r"==|<>|>=|<=|<<|>|<|[-+*/]|(?:B_AND|B_OR|B_XOR|AND|OR|XOR|DIV|MOD)(?![A-Z0-9_])")
_UNARY = re.compile(r"[-+]|(?:B_NOT|NOT)(?![A-Z0-9_])")
# From the weakest to the strongest.
_LEVELS = (
    ("==", "<>", ">", "<", ">=", "<="), ("<<",), ("OR",), ("XOR",), ("AND",), ("B_OR",), ("B_XOR",), ("B_AND",),
    ("+", "-"), ("*", "/", "DIV", "MOD"),
)  # fmt: skip
_RANKS = {operator: rank for rank, operators in enumerate(_LEVELS) for operator in operators}
_RELATIVE = 1e-12


@dataclass
class SiemensScanner:
    """A line of a program in capitals, read from left to right."""

    text: str
    at: int = 0

    def error(self, message: str, at: int | None = None) -> WordError:
        """An error at a character, from 0; None: at the next one."""
        return WordError(message, (self.at if at is None else at) + 1)

    def take(self, pattern: re.Pattern[str]) -> str:
        """Skip blanks and read what matches here; empty: nothing."""
        begin = _SPACE.match(self.text, self.at)
        found = pattern.match(self.text, begin.end() if begin else self.at)
        if found is None:
            return ""
        self.at = found.end()
        return found[0]

    def takes(self, sign: str) -> bool:
        """Read this sign if it comes next; whether it did."""
        self.skip()
        if not self.text.startswith(sign, self.at):
            return False
        self.at += len(sign)
        return True

    def skip(self) -> None:
        """Skip blanks."""
        begin = _SPACE.match(self.text, self.at)
        self.at = begin.end() if begin else self.at

    @property
    def is_done(self) -> bool:
        """Whether nothing but blanks is left."""
        self.skip()
        return self.at >= len(self.text)

    @property
    def rest(self) -> str:
        """What is left, for messages."""
        return self.text[self.at :].strip()[:30]

    def require(self, sign: str, what: str) -> None:
        """Read a sign that must be here."""
        if not self.takes(sign):
            raise self.error(f"{self.rest or 'the end of the block'} where {what} is expected")


def expression(scan: SiemensScanner, above: int = -1) -> Expression:
    """Read an expression, as far as it reaches, or as operators of a higher rank do."""
    left = _unary(scan)
    while True:
        scan.skip()
        begin = scan.at
        operator = scan.take(_OPERATOR)
        rank = _RANKS.get(operator, -1)
        if rank <= above:
            scan.at = begin
            return left
        left = _binary(operator, left, expression(scan, rank), begin + 1)


def _binary(operator: str, left: Expression, right: Expression, column: int) -> Expression:
    work = _OPERATORS[operator]

    def value(scope: Scope) -> Value:
        a, b = left(scope), right(scope)
        if isinstance(a, str) != isinstance(b, str) and operator != "<<":
            raise WordError(f"{operator} of a number and a string: both must be of one kind", column)
        return work(a, b, column)

    return value


def _unary(scan: SiemensScanner) -> Expression:
    begin = scan.at
    operator = scan.take(_UNARY)
    if not operator:
        return _primary(scan)
    inner, column = _unary(scan), begin + 1
    if operator == "NOT":
        return lambda scope: not inner(scope)
    if operator == "B_NOT":
        return lambda scope: ~whole(inner(scope), "B_NOT", column)
    sign = -1 if operator == "-" else 1
    return lambda scope: sign * number(inner(scope), column)


def _primary(scan: SiemensScanner) -> Expression:
    scan.skip()
    begin, column = scan.at, scan.at + 1
    if scan.takes("("):
        inner = expression(scan)
        scan.require(")", "a closing bracket )")
        return inner
    if text := scan.take(_NUMBER):
        return constant(int(text) if text.isdigit() else float(text.replace("EX", "e")))
    if text := scan.take(_STRING):
        return constant(text[1:-1])
    if text := scan.take(_BITS):
        return constant(int(text[2:-1], 16 if text[1] == "H" else 2))
    name = scan.take(NAME)
    if not name:
        raise scan.error(f"{scan.rest or 'the end of the block'} where a number, a variable or ( is expected")
    if name in ("TRUE", "FALSE"):
        return constant(name == "TRUE")
    if name == "$PI":
        return constant(math.pi)
    if name in _FUNCTIONS:
        count, function = _FUNCTIONS[name]
        given = [each for each in arguments(scan, name) if each is not None]
        if len(given) != count:
            raise scan.error(f"{name} takes {count} value{'s' * (count > 1)}, not {len(given)}", begin)
        return lambda scope: _worked(name, function, [number(each(scope), column) for each in given], column)
    if name.startswith("$"):
        raise scan.error(f"{name}: system variables are not read, their values are in the control", begin)
    if scan.text[scan.at : scan.at + 1] == "(":
        raise scan.error(f"{name}( ) is no function that is read", begin)
    index = indices(scan)
    return lambda scope: scope.value_of(name, tuple(each(scope) for each in index), column)


def indices(scan: SiemensScanner) -> tuple[Expression, ...]:
    """Read `[...]` behind a name, or nothing."""
    if not scan.takes("["):
        return ()
    found = [expression(scan)]
    while scan.takes(","):
        found.append(expression(scan))
    scan.require("]", "a closing bracket ]")
    return tuple(found)


def arguments(scan: SiemensScanner, name: str) -> list[Expression | None]:
    """Read the values in brackets behind a name; None: left out."""
    scan.require("(", f"the opening bracket of {name}(")
    if scan.takes(")"):
        return []
    found: list[Expression | None] = []
    while True:
        scan.skip()
        left_out = scan.text[scan.at : scan.at + 1] in (",", ")")
        found.append(None if left_out else expression(scan))
        if scan.takes(")"):
            return found
        scan.require(",", f"a comma or the closing bracket of {name}(")


def constant(value: Value) -> Expression:
    """An expression that is a value."""
    return lambda _scope: value


def number(value: Value, column: int) -> float | int:
    """A value as a number; a string is none."""
    if isinstance(value, str):
        raise WordError(f'"{value}" where a number is expected', column)
    if not math.isfinite(value):
        raise WordError("a value is too large to be computed", column)
    return int(value) if isinstance(value, bool) else value


def whole(value: Value, what: str, column: int) -> int:
    """A value as a whole number."""
    given = number(value, column)
    if given != int(given):
        raise WordError(f"{what} of {given:g}: it must be a whole number", column)
    return int(given)


def rounded(value: float, column: int) -> int:
    """To the nearest whole number; halves of positive numbers upwards."""
    if value < 0.0 and value - math.floor(value) == 0.5:
        raise WordError(
            f"{value:g} lies between two whole numbers: to which one the control rounds it is not known", column
        )
    return math.floor(value + 0.5)


def convert(value: Value, kind: str, column: int) -> Value:
    """A value as the control keeps it in a variable of this kind."""
    if kind == "STRING":
        if not isinstance(value, str):
            raise WordError(f"{value} where a string is expected", column)
        return value
    given = number(value, column)
    if kind == "BOOL":
        return given != 0
    return rounded(given, column) if kind == "INT" else float(given)


def is_equal(a: Value, b: Value) -> bool:
    """Whether two values are one to the control."""
    if isinstance(a, str) or isinstance(b, str):
        return a == b
    return abs(a - b) <= _RELATIVE * max(abs(a), abs(b))


def _worked(name: str, function: Callable[..., float], given: list[float], column: int) -> Value:
    try:
        return function(*given)
    except WordError as error:
        raise WordError(str(error), column) from None
    except (ValueError, OverflowError):
        shown = ", ".join(f"{each:g}" for each in given)
        raise WordError(f"{name}({shown}) is no number: the value lies outside of what {name} takes", column) from None


def _divide(a: Value, b: Value, column: int) -> Value:
    divisor = number(b, column)
    if divisor == 0:
        raise WordError("division by 0: the divisor must be another number", column)
    return number(a, column) / divisor


def _modulo(a: Value, b: Value, column: int) -> Value:
    left, right = whole(a, "MOD", column), whole(b, "MOD", column)
    if left < 0 or right <= 0:
        raise WordError(f"{left} MOD {right}: the first must be 0 or more and the second more than 0", column)
    return left % right


def _compared(test: Callable[[Value, Value], bool]) -> Callable[[Value, Value, int], Value]:
    return lambda a, b, _column: test(a, b)


def _bits(test: Callable[[int, int], int], name: str) -> Callable[[Value, Value, int], Value]:
    return lambda a, b, column: test(whole(a, name, column), whole(b, name, column))


_OPERATORS: Mapping[str, Callable[[Value, Value, int], Value]] = {
    "==": _compared(is_equal),
    "<>": _compared(lambda a, b: not is_equal(a, b)),
    ">=": _compared(lambda a, b: is_equal(a, b) or a > b),  # type: ignore[operator]
    "<=": _compared(lambda a, b: is_equal(a, b) or a < b),  # type: ignore[operator]
    ">": _compared(lambda a, b: not is_equal(a, b) and a > b),  # type: ignore[operator]
    "<": _compared(lambda a, b: not is_equal(a, b) and a < b),  # type: ignore[operator]
    "<<": lambda a, b, _column: f"{a}{b}",
    "OR": _compared(lambda a, b: bool(a) or bool(b)),
    "XOR": _compared(lambda a, b: bool(a) != bool(b)),
    "AND": _compared(lambda a, b: bool(a) and bool(b)),
    "B_OR": _bits(lambda a, b: a | b, "B_OR"),
    "B_XOR": _bits(lambda a, b: a ^ b, "B_XOR"),
    "B_AND": _bits(lambda a, b: a & b, "B_AND"),
    "+": lambda a, b, column: number(a, column) + number(b, column),
    "-": lambda a, b, column: number(a, column) - number(b, column),
    "*": lambda a, b, column: number(a, column) * number(b, column),
    "/": _divide,
    "DIV": lambda a, b, column: math.trunc(number(_divide(a, b, column), column)),
    "MOD": _modulo,
}


def _bound(least: float, most: float, value: float) -> float:
    if least > most:
        raise ValueError
    return min(max(value, least), most)


_FUNCTIONS: Mapping[str, tuple[int, Callable[..., float]]] = {
    "SIN": (1, lambda a: math.sin(math.radians(a))),
    "COS": (1, lambda a: math.cos(math.radians(a))),
    "TAN": (1, lambda a: math.tan(math.radians(a))),
    "ASIN": (1, lambda a: math.degrees(math.asin(a))),
    "ACOS": (1, lambda a: math.degrees(math.acos(a))),
    "ATAN2": (2, lambda a, b: math.degrees(math.atan2(a, b))),  # of 30.5 and 80.1: 20.8455
    "SQRT": (1, math.sqrt),
    "POT": (1, lambda a: a * a),
    "ABS": (1, abs),
    "TRUNC": (1, math.trunc),
    "ROUND": (1, lambda a: rounded(a, 0)),
    "ROUNDUP": (1, math.ceil),
    "LN": (1, math.log),
    "EXP": (1, math.exp),
    "MINVAL": (2, min),
    "MAXVAL": (2, max),
    "BOUND": (3, _bound),
}


@dataclass
class Variable:
    """A variable of a program: a value, or an array by indices."""

    kind: str  # REAL, INT, BOOL, STRING
    shape: tuple[int, ...] = ()
    values: dict[tuple[int, ...], Value] = field(default_factory=dict)

    def place(self, name: str, index: tuple[Value, ...], column: int) -> tuple[int, ...]:
        """Indices as whole numbers within the array."""
        if len(index) != len(self.shape):
            needs = f"{len(self.shape)} indices" if self.shape else "no index"
            raise WordError(f"{name} with {len(index)} indices: it has {needs}", column)
        found = tuple(whole(each, f"index of {name}", column) for each in index)
        for each, size in zip(found, self.shape, strict=True):
            if not 0 <= each < size:
                raise WordError(f"{name}[{each}]: the index must be 0 to {size - 1}", column)
        return found

    def read(self, name: str, index: tuple[Value, ...], column: int) -> Value:
        """Its value; what was not set is 0."""
        place = self.place(name, index, column)
        if place in self.values:
            return self.values[place]
        return "" if self.kind == "STRING" else convert(0, self.kind, column)

    def write(self, name: str, index: tuple[Value, ...], value: Value, column: int) -> None:
        """Keep a value."""
        self.values[self.place(name, index, column)] = convert(value, self.kind, column)
