"""A shaper and what it is worth for some modes; what a design may be; impulses that a user gives."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

from shapegcode._core import ArgumentError, DesignError, Shaper, worst_residual
from shapegcode.results.json import hidden
from shapegcode.shaping.bands import ON_GRID, ModeBand, ms

_EXACT = 1e-3  # of the vibration; taps that someone typed have four digits
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_TAP = re.compile(rf"\s*({_NUMBER})\s*(ms|s)?\s*:\s*({_NUMBER})\s*")
_FORM = "TIME:AMPLITUDE,TIME:AMPLITUDE with times in s or with ms behind them, for example 0:0.5,10.87ms:0.5"


@dataclass(frozen=True)
class Design:
    """One row of a comparison of shapers.

    Attributes:
        family: name of its row in the registry.
        shaper: the taps.
        period_s: grid on which its times lie and its zeros are exact, s; None: times are continuous.
        residual: largest residual ratio of the modes at their nominal frequencies.
        worst_residual: the same over the modes' bands.
        exact: whether the modes without a band are cancelled, to a thousandth.
        pareto: whether no other design of the comparison is at least as good in everything and better in something.
    """

    json_extra: ClassVar[dict[str, Any]] = {
        "times_s": tuple[float, ...],
        "amplitudes": tuple[float, ...],
        "duration_s": float,
        "variance_s2": float,
        "abs_sum": float,
        "negative": bool,
    }
    json_exact: ClassVar[tuple[str, ...]] = ("times_s", "amplitudes")

    family: str
    shaper: Shaper = field(metadata=hidden())
    period_s: float | None
    residual: float
    worst_residual: float
    exact: bool = True
    pareto: bool = False

    @property
    def times_s(self) -> tuple[float, ...]:
        """Times of the taps, s."""
        return tuple(self.shaper.times_s.tolist())

    @property
    def amplitudes(self) -> tuple[float, ...]:
        """Amplitudes of the taps; they add up to 1."""
        return tuple(self.shaper.amplitudes.tolist())

    @property
    def duration_s(self) -> float:
        """Time of the last tap, s."""
        return self.shaper.duration_s

    @property
    def variance_s2(self) -> float:
        """Contour cost, s²: dR/R = variance*(v/R)²/2."""
        return self.shaper.variance_s2

    @property
    def abs_sum(self) -> float:
        """Sum of the taps' magnitudes: 1 without negative impulses."""
        return self.shaper.abs_sum

    @property
    def negative(self) -> bool:
        """Whether any tap is negative."""
        return self.shaper.has_negative

    @staticmethod
    def hidden_from_json(data: Mapping[str, Sequence[float]]) -> dict[str, Shaper]:
        """The shaper, from what the JSON says of it."""
        return {"shaper": Shaper(data["times_s"], data["amplitudes"])}

    def radial_error_um(self, speed_mm_per_s: float, radius_mm: float) -> float:
        """By how much a circle comes out too small, µm: variance*v²/(2R)."""
        return self.variance_s2 * speed_mm_per_s**2 / (2.0 * radius_mm) * 1e3


def evaluate(family: str, shaper: Shaper, bands: Sequence[ModeBand], period_s: float | None = None) -> Design:
    """The figures of a shaper for modes and their bands; the worst residual is proven to 1e-6 of it."""
    residual = max(shaper.residual_ratio(band.mode) for band in bands)
    worst = max(_worst(shaper, band) for band in bands)
    exact = all(shaper.residual_ratio(band.mode) <= _EXACT for band in bands if not band.uncertainty)
    return Design(family, shaper, period_s, residual, worst, exact)


def _worst(shaper: Shaper, band: ModeBand) -> float:
    if band.uncertainty == 0.0:
        return shaper.residual_ratio(band.mode)
    ends_hz = (band.shifted(-1.0).frequency_hz, band.shifted(1.0).frequency_hz)
    return worst_residual(shaper, band.mode, *ends_hz).residual_ratio


@dataclass(frozen=True)
class DesignOptions:
    """What a design may be."""

    period_s: float | None = None  # grid on which the taps must lie, s; None: continuous times
    max_duration_s: float = 0.25  # longest shaper, s
    max_abs_sum: float = 10.0  # largest sum of the taps' magnitudes
    vibration_limit: float = 0.05  # residual ratio that a family with a tolerated residual (EI, SI, robust) may leave
    taps: Shaper | None = None  # the shaper of the family `taps`; no other family uses it

    @property
    def grid_period_s(self) -> float:
        """The period of the grid, s."""
        if self.period_s is None:
            raise ArgumentError("this family is designed on a grid: give its period")
        return self.period_s


def parse_taps(given: str | Sequence[Any] | dict[str, Any]) -> Shaper:
    """A shaper from text, or from what a JSON or TOML file holds."""
    if isinstance(given, str):
        text = given.strip()
        if not text.startswith(("[", "{")):
            return _from_text(text)
        try:
            given = json.loads(text)
        except json.JSONDecodeError as error:
            raise ArgumentError(f"the impulses are no JSON: {error}") from error
    if isinstance(given, dict):
        if set(given) != {"times_s", "amplitudes"}:
            raise ArgumentError(f"impulses as a table have the keys times_s and amplitudes: given {', '.join(given)}")
        return Shaper(_numbers(given["times_s"]), _numbers(given["amplitudes"]))
    pairs = [_numbers(pair) for pair in given]
    if any(len(pair) != 2 for pair in pairs):
        raise ArgumentError(f"impulses as a list are pairs of time in s and amplitude: given {given}")
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
        raise ArgumentError(f"a list of numbers is wanted among the impulses: given {values!r}")
    for value in values:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise ArgumentError(f"{value!r} is no number of the impulses")
    return [float(value) for value in values]
