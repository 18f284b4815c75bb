"""Taps that a user gives."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from typing import Any

from shapegcode._core import ArgumentError, DesignError, Shaper
from shapegcode.shaping.words import ON_GRID, ms

__all__ = ["on_grid", "parse_taps"]

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_TAP = re.compile(rf"\s*({_NUMBER})\s*(ms|s)?\s*:\s*({_NUMBER})\s*")
_FORM = "TIME:AMPLITUDE,TIME:AMPLITUDE with times in s or with ms behind them, for example 0:0.5,10.87ms:0.5"


def parse_taps(given: str | Sequence[Any] | dict[str, Any]) -> Shaper:
    """A shaper from text, or from what a JSON or TOML file holds."""
    if isinstance(given, str):
        text = given.strip()
        if not text.startswith(("[", "{")):
            return _from_text(text)
        try:
            given = json.loads(text)
        except json.JSONDecodeError as error:
            raise ArgumentError(f"the taps are no JSON: {error}") from error
    if isinstance(given, dict):
        if set(given) != {"times_s", "amplitudes"}:
            raise ArgumentError(f"taps as a table have the keys times_s and amplitudes: given {', '.join(given)}")
        return Shaper(_numbers(given["times_s"]), _numbers(given["amplitudes"]))
    pairs = [_numbers(pair) for pair in given]
    if any(len(pair) != 2 for pair in pairs):
        raise ArgumentError(f"taps as a list are pairs of time in s and amplitude: given {given}")
    return Shaper([pair[0] for pair in pairs], [pair[1] for pair in pairs])


def on_grid(shaper: Shaper, period_s: float) -> Shaper:
    """The shaper, if its times are multiples of a period (s)."""
    for time_s in shaper.times_s.tolist():
        steps = time_s / period_s
        if abs(steps - round(steps)) > ON_GRID * max(1.0, steps):
            raise DesignError(
                f"the tap at {ms(time_s)} is not on the {ms(period_s)} grid, nearest "
                f"{ms(round(steps) * period_s)}; rounding would undo the zeros: design on the grid"
            )
    return shaper


def _from_text(text: str) -> Shaper:
    times_s, amplitudes = [], []
    for part in text.split(","):
        match = _TAP.fullmatch(part)
        if match is None:
            raise ArgumentError(f"{part.strip()!r} is no tap: {_FORM}")
        times_s.append(float(match[1]) * (1e-3 if match[2] == "ms" else 1.0))
        amplitudes.append(float(match[3]))
    return Shaper(times_s, amplitudes)


def _numbers(values: Any) -> list[float]:
    """The numbers of a list; a text or a truth value is none."""
    if isinstance(values, str | bytes) or not isinstance(values, Sequence):
        raise ArgumentError(f"a list of numbers is wanted among the taps: given {values!r}")
    for value in values:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise ArgumentError(f"{value!r} is no number of the taps")
    return [float(value) for value in values]
