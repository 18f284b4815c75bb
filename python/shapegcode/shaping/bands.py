"""Modes to cancel, each with the band of its frequency; designs and their figures."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

from shapegcode._core import ArgumentError, DesignError, Mode, Shaper, WorstResidual, worst_residual
from shapegcode.machine.axes import AxisMode, as_mode
from shapegcode.results.json import hidden

if TYPE_CHECKING:
    from shapegcode.machine import Machine

NO_MODE = (
    "the machine file gives no vibration mode (axes.x.modes): nothing to cancel; `shapegcode identify --tap-plan` "
    "describes the test"
)
NARROW_PERCENT = 0.2  # half width above which a shaper is designed for a mode's band
_SLOWEST_HZ = 0.1  # of a load on 25 m of rope; no machine tool has a slower mode
_FASTEST_HZ = 10_000.0  # as in a machine file
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_SIZE = r"(?:\d+\.?\d*|\.\d+)"
_TEXT = re.compile(
    rf"({_NUMBER})(?::({_NUMBER}))?(?:(?:±|\+-|\+/-)({_NUMBER})(%|Hz)?|[-−]({_SIZE})(%|Hz)/?\+({_SIZE})(%|Hz))?"
)
VIBRATION_LIMIT = 0.05  # default limit of a robust design's residual ratio within the bands
# Relative difference of durations (or, if none is within the limit, of worst residuals) below which the longer block
# period is preferred.
SAME = 0.02
ON_GRID = 1e-9  # periods; tolerance for rounding of a quotient


@dataclass(frozen=True)
class ModeBand:
    """A mode and the uncertainty of its frequency.

    Attributes:
        mode: nominal frequency and damping.
        uncertainty: the frequency lies within (1 - uncertainty) to (1 + uncertainty) times the nominal one. At least
            0 and below 1; with 0 a shaper is designed for the nominal frequency only.
    """

    json_extra: ClassVar[dict[str, Any]] = {"frequency_hz": float, "damping_ratio": float}

    mode: Mode = field(metadata=hidden())
    uncertainty: float = 0.0

    @property
    def frequency_hz(self) -> float:
        """Nominal natural frequency, Hz."""
        return self.mode.frequency_hz

    @property
    def damping_ratio(self) -> float:
        """1 = critically damped."""
        return self.mode.damping_ratio

    @staticmethod
    def hidden_from_json(data: Mapping[str, float]) -> dict[str, Mode]:
        """Restore the field `mode`, which is not in the JSON, from frequency and damping ratio.

        Args:
            data: JSON of a `ModeBand`.

        Returns:
            Value of the field by its name.
        """
        return {"mode": Mode(data["frequency_hz"], data["damping_ratio"])}

    def __post_init__(self) -> None:
        if not 0.0 <= self.uncertainty < 1.0:
            raise ArgumentError(
                f"uncertainty of the mode at {self.mode.frequency_hz:g} Hz is {self.uncertainty:.4g}: "
                "it must be at least 0 and below 1"
            )

    def shifted(self, share: float) -> Mode:
        """The mode with its frequency moved by `share` (-1 to 1) of the band's half width.

        Args:
            share: -1 (lower end of the band) to 1 (upper end).

        Returns:
            The mode at the shifted frequency, with the same damping.
        """
        scale = 1.0 + share * self.uncertainty
        return Mode(self.mode.frequency_hz * scale, self.mode.damping_ratio, self.mode.participation)

    def __str__(self) -> str:
        text = f"{self.mode.frequency_hz:g}:{self.mode.damping_ratio:g}"
        return f"{text}±{100.0 * self.uncertainty:g}%" if self.uncertainty else text


def parse_mode_band(text: str, uncertainty: float = 0.0) -> ModeBand:
    """Parse ``46``, ``46:0.02±5%``, ``46:0.02+-2.3Hz``, or ``30:0.1-13%+19%`` to the mode at mid-band."""
    match = _TEXT.fullmatch(text.strip())
    if match is None:
        raise ArgumentError(
            f"{text!r} is not a mode: FREQUENCY[:DAMPING][±BAND], such as 46:0.02±5%, or with both ends 46:0.02-5%+8%"
        )
    frequency_hz, damping = float(match[1]), float(match[2] or 0.0)
    mode = Mode(frequency_hz, damping)
    if not _SLOWEST_HZ <= frequency_hz <= _FASTEST_HZ:
        raise ArgumentError(
            f"mode frequency {frequency_hz:g} Hz, in {text!r}: must be {_SLOWEST_HZ:g} to {_FASTEST_HZ:g} Hz"
        )
    if match[3] is not None:
        return ModeBand(mode, float(match[3]) / (frequency_hz if match[4] == "Hz" else 100.0))
    if match[5] is None:
        return ModeBand(mode, uncertainty)
    below, above = (
        float(size) / (frequency_hz if unit == "Hz" else 100.0)
        for size, unit in ((match[5], match[6]), (match[7], match[8]))
    )
    if below >= 1.0:
        raise ArgumentError(f"the band of {text!r} begins at {frequency_hz * (1.0 - below):g} Hz: it must be above 0")
    middle = 1.0 + 0.5 * (above - below)
    return ModeBand(Mode(frequency_hz * middle, damping), 0.5 * (above + below) / middle)


def machine_bands(machine: Machine, uncertainty: float = 0.0) -> list[ModeBand]:
    """The modes of all axes of a machine, with their bands; equal ones once, with the wider band.

    Bands as narrow as those of a tap test are ignored: there a shaper with zero residual at the nominal frequency is
    better than one for `shaping.vibration_limit` over the band. The verdict still simulates the ends of the band.
    """
    from shapegcode.model.modes import still_mode

    widths: dict[tuple[float, float], float] = {}
    for axis in machine.axes.as_tuple():
        for mode in axis.modes:
            stated = mode.frequency_uncertainty_percent
            width = uncertainty
            if stated is not None:
                width = stated / 100.0 if stated > NARROW_PERCENT else 0.0
            still = still_mode(mode, machine.shaping.part_mass_kg)
            key = still.frequency_hz, still.damping_ratio
            widths[key] = max(width, widths.get(key, 0.0))
    if not widths:
        raise ArgumentError(NO_MODE)
    return [ModeBand(Mode(*key), width) for key, width in widths.items()]


def mode_band(given: Any, uncertainty: float = 0.0) -> ModeBand:
    """Convert a frequency in Hz, a text for `parse_mode_band`, a pair (Hz, damping ratio) or a mode to a `ModeBand`."""
    if isinstance(given, ModeBand):
        return given
    given = as_mode(tuple(given) if isinstance(given, list) else given)
    if isinstance(given, AxisMode):
        given = Mode(given.frequency_hz, given.damping_ratio)
    if isinstance(given, Mode):
        return ModeBand(given, uncertainty)
    return parse_mode_band(given if isinstance(given, str) else f"{float(given):.17g}", uncertainty)


def ms(time_s: float) -> str:
    """Format a time, s, in ms."""
    return f"{time_s * 1e3:.6g} ms"


def mode_names(modes: Sequence[Mode]) -> str:
    """Format modes by frequency and damping ratio."""
    return ", ".join(f"{mode.frequency_hz:g} Hz (zeta {mode.damping_ratio:g})" for mode in modes)


def band_names(bands: Sequence[ModeBand]) -> str:
    """Format modes with their bands, as in the command line."""
    return ", ".join(f"{band} Hz" for band in bands)


def spoken(bands: Sequence[ModeBand]) -> str:
    """Format modes with their bands for a sentence."""

    def one(band: ModeBand) -> str:
        text = f"{band.mode.frequency_hz:g} Hz"
        return f"{text} ±{100.0 * band.uncertainty:g} %" if band.uncertainty else text

    return " and ".join(map(one, bands))


def check_times(**times_s: float) -> None:
    """Refuse times that are not finite and above 0."""
    for name, value in times_s.items():
        if not (math.isfinite(value) and value > 0.0):
            raise ArgumentError(f"{name} is {value} s: it must be finite and above 0")


def check_modes_and_times(modes: Sequence[object], **times_s: float) -> None:
    """Refuse an empty list of modes, and times that are not finite and above 0."""
    if not modes:
        raise ArgumentError("a shaper needs at least one mode: 0 given")
    check_times(**times_s)


def whole_periods(duration_s: float, period_s: float) -> int:
    """Number of whole periods within a duration."""
    return math.floor(duration_s / period_s + ON_GRID)


_EXACT = 1e-3  # residual ratio that counts as zero; typed impulses have four digits
_TAP = re.compile(rf"\s*({_NUMBER})\s*(ms|s)?\s*:\s*({_NUMBER})\s*")
_FORM = "TIME:AMPLITUDE,TIME:AMPLITUDE with times in s, or in ms with the unit, for example 0:0.5,10.87ms:0.5"


@dataclass(frozen=True)
class Design:
    """One row of a comparison of shapers."""

    json_extra: ClassVar[dict[str, Any]] = {
        "times_s": tuple[float, ...],
        "amplitudes": tuple[float, ...],
        "duration_s": float,
        "variance_s2": float,
        "abs_sum": float,
        "negative": bool,
    }
    json_exact: ClassVar[tuple[str, ...]] = ("times_s", "amplitudes")

    family: str  # name of its row in the registry
    shaper: Shaper = field(metadata=hidden())  # impulses
    period_s: float | None  # grid on which its times lie and its zeros are exact, s; None: times are continuous
    residual: float  # largest residual ratio of the modes at their nominal frequencies
    worst_residual: float  # largest residual ratio over the modes' bands
    exact: bool = True  # the modes without a band are cancelled, to a thousandth
    # Pareto-optimal: no other design is at least as good in every figure and better in one
    pareto: bool = False

    @property
    def times_s(self) -> tuple[float, ...]:
        """Times of the impulses, s."""
        return tuple(self.shaper.times_s.tolist())

    @property
    def amplitudes(self) -> tuple[float, ...]:
        """Amplitudes of the impulses; they add up to 1."""
        return tuple(self.shaper.amplitudes.tolist())

    @property
    def duration_s(self) -> float:
        """Time of the last impulse, s."""
        return self.shaper.duration_s

    @property
    def variance_s2(self) -> float:
        """Second central moment of the impulses (contour cost), s²: dR/R = variance*(v/R)²/2."""
        return self.shaper.variance_s2

    @property
    def abs_sum(self) -> float:
        """Sum of the impulses' magnitudes: 1 without negative impulses."""
        return self.shaper.abs_sum

    @property
    def negative(self) -> bool:
        """Whether any impulse is negative."""
        return self.shaper.has_negative

    @staticmethod
    def hidden_from_json(data: Mapping[str, Sequence[float]]) -> dict[str, Shaper]:
        """Restore the shaper from JSON."""
        return {"shaper": Shaper(data["times_s"], data["amplitudes"])}

    def radial_error_um(self, speed_mm_per_s: float, radius_mm: float) -> float:
        """Radius error of a circle (too small), µm: variance*v²/(2R)."""
        return self.variance_s2 * speed_mm_per_s**2 / (2.0 * radius_mm) * 1e3


def evaluate(family: str, shaper: Shaper, bands: Sequence[ModeBand], period_s: float | None = None) -> Design:
    """Compute a shaper's figures for modes and bands; the worst residual is proven to 1e-6 relative."""
    residual = max(shaper.residual_ratio(band.mode) for band in bands)
    worst = max(_worst(shaper, band).residual_ratio for band in bands)
    exact = all(shaper.residual_ratio(band.mode) <= _EXACT for band in bands if not band.uncertainty)
    return Design(family, shaper, period_s, residual, worst, exact)


def proven_worst(shaper: Shaper, bands: Sequence[ModeBand]) -> float:
    """Upper bound on the residual ratio over the bands."""
    return max(_worst(shaper, band).upper_bound for band in bands)


def _worst(shaper: Shaper, band: ModeBand) -> WorstResidual:
    return worst_residual(shaper, band.mode, band.shifted(-1.0).frequency_hz, band.shifted(1.0).frequency_hz)


@dataclass(frozen=True)
class DesignOptions:
    """Limits of a design."""

    period_s: float | None = None  # grid on which the impulses must lie, s; None: continuous times
    max_duration_s: float = 0.25  # longest shaper, s
    max_abs_sum: float = 10.0  # largest sum of the impulses' magnitudes
    # residual limit of families with a tolerated residual (EI, SI, robust, mirrored)
    vibration_limit: float = VIBRATION_LIMIT
    taps: Shaper | None = None  # the shaper of the family `taps`; no other family uses it

    @property
    def grid_period_s(self) -> float:
        """The period of the grid, s."""
        assert self.period_s is not None  # `design` refuses a family without its grid
        return self.period_s


def parse_taps(given: str | Sequence[Any] | dict[str, Any]) -> Shaper:
    """Parse a shaper from text, or from values of a JSON or TOML file."""
    if isinstance(given, str):
        text = given.strip()
        if not text.startswith(("[", "{")):
            taps = []
            for part in text.split(","):
                match = _TAP.fullmatch(part)
                if match is None:
                    raise ArgumentError(f"{part.strip()!r} is not an impulse: {_FORM}")
                taps.append((float(match[1]) * (1e-3 if match[2] == "ms" else 1.0), float(match[3])))
            return Shaper(*zip(*taps, strict=True))
        try:
            given = json.loads(text)
        except json.JSONDecodeError as error:
            raise ArgumentError(f"the impulses are not valid JSON: {error}") from error
    if isinstance(given, dict):
        if set(given) != {"times_s", "amplitudes"}:
            raise ArgumentError(f"impulses as a table need the keys times_s and amplitudes: given {', '.join(given)}")
        return Shaper(_numbers(given["times_s"]), _numbers(given["amplitudes"]))
    pairs = [_numbers(pair) for pair in given]
    if any(len(pair) != 2 for pair in pairs):
        raise ArgumentError(f"impulses as a list are pairs of time in s and amplitude: given {given}")
    return Shaper([pair[0] for pair in pairs], [pair[1] for pair in pairs])


def on_grid(shaper: Shaper, period_s: float) -> Shaper:
    """Return the shaper if its times are multiples of a period (s), else raise."""
    for time_s in shaper.times_s.tolist():
        steps = time_s / period_s
        if abs(steps - round(steps)) > ON_GRID * max(1.0, steps):
            raise DesignError(
                f"the impulse at {ms(time_s)} is not on the {ms(period_s)} grid, nearest "
                f"{ms(round(steps) * period_s)}; rounding would destroy the zeros: design on the grid"
            )
    return shaper


def _numbers(values: Any) -> list[float]:
    if isinstance(values, str | bytes) or not isinstance(values, Sequence):
        raise ArgumentError(f"the impulses must be lists of numbers: given {values!r}")
    for value in values:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise ArgumentError(f"{value!r} is not a number")
    return [float(value) for value in values]
