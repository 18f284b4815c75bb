"""Macro expressions: a recursive-descent evaluator of the custom macro B arithmetic.

Precedence: functions, then `* / AND MOD`, then `+ - OR XOR`; comparisons only as the condition of IF and WHILE, joined
by AND, OR, XOR between bracketed comparisons. `None` is the vacant variable: 0 in arithmetic, different from 0 in EQ
and NE.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable

from .tape import Alarm

Value = float | None
Reader = Callable[[int], Value]

FUNCTIONS = (
    "SIN", "COS", "TAN", "ASIN", "ACOS", "ATAN", "SQRT", "SQR", "ABS", "BIN", "BCD", "ROUND", "RND", "FIX", "FUP",
    "LN", "EXP", "POW",
)  # fmt: skip
COMPARISONS = ("EQ", "NE", "GT", "GE", "LT", "LE")
_NUMBER = re.compile(r"\d+\.?\d*|\.\d+")
DEEPEST_BRACKET = 5


def number(value: Value) -> float:
    return 0.0 if value is None else value


def half_away(value: float) -> float:
    """Nearest whole number, halves away from zero. Dust of the arithmetic (1e-9) does not turn a half down."""
    return math.copysign(math.floor(abs(value) + 0.5 + 1e-9), value)


def compare(name: str, a: Value, b: Value) -> bool:
    """A vacant variable equals only a vacant one; in order it counts as 0."""
    if name in ("EQ", "NE"):
        same = (a is None) == (b is None) and number(a) == number(b)
        return same == (name == "EQ")
    x, y = number(a), number(b)
    return {"GT": x > y, "GE": x >= y, "LT": x < y, "LE": x <= y}[name]


def to_bcd(value: float) -> float:
    return float(int(str(int(value)), 16))


def from_bcd(value: float) -> float:
    return float(int(f"{int(value):x}"))


class Expression:
    """Evaluates from a place of a text on; `at` is where it stopped."""

    def __init__(self, text: str, at: int, read: Reader, line: int, *, in_word: bool = False) -> None:
        self.text, self.at, self.read, self.line = text, at, read, line
        #: In a word ROUND goes to the least increment of its address, which the word does anyway.
        self.in_word = in_word
        self.depth = 0

    def fail(self, message: str, alarm: int) -> Alarm:
        return Alarm(self.line, f"{message} in {self.text!r}", alarm)

    def looking_at(self, *words: str) -> str | None:
        return next((w for w in words if self.text.startswith(w, self.at)), None)

    def take(self, *words: str) -> str | None:
        if found := self.looking_at(*words):
            self.at += len(found)
        return found

    # expression := term { (+ | - | OR | XOR) term }
    def expression(self) -> Value:
        value = self.term()
        while operator := self.take("+", "-", "OR", "XOR"):
            left, right = number(value), number(self.term())
            if operator == "+":
                value = left + right
            elif operator == "-":
                value = left - right
            else:
                a, b = self.whole(left), self.whole(right)
                value = float(a | b if operator == "OR" else a ^ b)
        return value

    # term := factor { (* | / | AND | MOD) factor }
    def term(self) -> Value:
        value = self.factor()
        while operator := self.take("*", "/", "AND", "MOD"):
            left, right = number(value), number(self.factor())
            if operator == "MOD":  # of whole numbers, with the sign of the first
                left, right = half_away(left), half_away(right)
            if operator in ("/", "MOD") and right == 0.0:
                raise self.fail("division by zero", 112)
            if operator == "*":
                value = left * right
            elif operator == "/":
                value = left / right
            elif operator == "MOD":
                value = math.fmod(left, right)
            else:
                value = float(self.whole(left) & self.whole(right))
        return value

    def whole(self, value: float) -> int:
        if value < 0.0:
            raise self.fail("negative operand of a bit operation", 119)
        return int(half_away(value))

    def factor(self) -> Value:
        if self.take("-"):
            return -number(self.factor())
        if self.take("+"):
            return self.factor()
        if self.looking_at("["):
            return self.bracket()
        if self.looking_at("#"):
            return self.read(self.variable())
        if found := _NUMBER.match(self.text, self.at):
            self.at = found.end()
            return float(found.group())
        if name := self.take(*FUNCTIONS):
            return self.function(name)
        raise self.fail("no value", 114)

    def variable(self) -> int:
        """The number behind #: digits, another variable, or a bracket."""
        self.at += 1
        if found := re.compile(r"\d+").match(self.text, self.at):
            self.at = found.end()
            return int(found.group())
        if self.looking_at("#", "["):
            return int(half_away(number(self.factor())))
        raise self.fail("# without a number", 114)

    def bracket(self) -> Value:
        self.at += 1
        self.depth += 1
        if self.depth > DEEPEST_BRACKET:
            raise self.fail("brackets nested too deep", 118)
        value = self.expression()
        if not self.take("]"):
            raise self.fail("bracket not closed", 118)
        self.depth -= 1
        return value

    def function(self, name: str) -> float:
        if not self.looking_at("["):
            raise self.fail(f"{name} without a bracket", 114)
        if name == "POW":
            self.at += 1
            base = number(self.expression())
            if not self.take(","):
                raise self.fail("POW needs two values", 114)
            power = number(self.expression())
            if not self.take("]"):
                raise self.fail("bracket not closed", 118)
            return float(base**power)
        if name == "ATAN":
            self.at += 1
            self.depth += 1
            first = number(self.expression())
            second = None
            if self.take(","):
                second = number(self.expression())
            if not self.take("]"):
                raise self.fail("bracket not closed", 118)
            self.depth -= 1
            if second is None and self.text.startswith("/[", self.at):
                self.at += 1
                second = number(self.bracket())
            if second is None:
                return math.degrees(math.atan(first))
            if first == 0.0 and second == 0.0:
                raise self.fail("ATAN of no direction", 112)
            return math.degrees(math.atan2(first, second)) % 360.0
        return self.one_value(name, number(self.bracket()))

    def one_value(self, name: str, x: float) -> float:
        if name in ("SQRT", "SQR") and x < 0.0:
            raise self.fail("root of a negative number", 119)
        if name in ("ASIN", "ACOS") and abs(x) > 1.0:
            raise self.fail(f"{name} of {x}", 119)
        if name == "LN" and x <= 0.0:
            raise self.fail(f"LN of {x}", 119)
        turn = math.radians(x)
        table: dict[str, Callable[[], float]] = {
            "SIN": lambda: math.sin(turn),
            "COS": lambda: math.cos(turn),
            "TAN": lambda: math.tan(turn),
            "ASIN": lambda: math.degrees(math.asin(x)),
            "ACOS": lambda: math.degrees(math.acos(x)),
            "SQRT": lambda: math.sqrt(x),
            "SQR": lambda: math.sqrt(x),
            "ABS": lambda: abs(x),
            "BIN": lambda: from_bcd(x),
            "BCD": lambda: to_bcd(x),
            "ROUND": lambda: x if self.in_word else half_away(x),
            "RND": lambda: x if self.in_word else half_away(x),
            "FIX": lambda: float(math.trunc(x)),
            "FUP": lambda: math.copysign(math.ceil(abs(x)), x),
            "LN": lambda: math.log(x),
            "EXP": lambda: math.exp(x),
        }
        return table[name]()

    # condition := '[' (comparison | condition-bracket { (AND|OR|XOR) condition-bracket }) ']'
    def condition(self) -> bool:
        if not self.take("["):
            raise self.fail("condition without a bracket", 114)
        if self.looking_at("[") and self.holds_comparison_in_bracket():
            result = self.condition()
            while operator := self.take("AND", "OR", "XOR"):
                other = self.condition()
                result = {"AND": result and other, "OR": result or other, "XOR": result != other}[operator]
        else:
            left = self.expression()
            name = self.take(*COMPARISONS)
            if name is None:
                raise self.fail("no comparison", 114)
            result = compare(name, left, self.expression())
        if not self.take("]"):
            raise self.fail("bracket not closed", 118)
        return result

    def holds_comparison_in_bracket(self) -> bool:
        """Whether the bracket that opens here has a comparison directly or deeper inside."""
        depth = 0
        for k in range(self.at, len(self.text)):
            depth += {"[": 1, "]": -1}.get(self.text[k], 0)
            if depth == 0:
                return False
            if any(self.text.startswith(c, k) for c in COMPARISONS):
                return True
        return False
