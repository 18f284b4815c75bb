"""What a shaper is designed for: modes, each with the band in which its frequency may lie."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

from shapegcode._core import ArgumentError, Mode
from shapegcode.results.json import hidden

if TYPE_CHECKING:
    from shapegcode.machine import Machine

NO_MODE = (
    "the machine file gives no vibration mode (axes.x.modes): nothing to shape for; `shapegcode identify --tap-plan` "
    "says how to find them"
)
"""Why there is no shaper."""
NARROW_PERCENT = 0.2
"""A band of a mode of a machine is designed for if it is wider than this, either way."""
_SLOWEST_HZ = 0.1  # the period of a load on 25 m of rope; no machine tool has a slower mode
_FASTEST_HZ = 10_000.0  # as in a machine file
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_SIZE = r"(?:\d+\.?\d*|\.\d+)"
_TEXT = re.compile(
    rf"({_NUMBER})(?::({_NUMBER}))?(?:(?:±|\+-|\+/-)({_NUMBER})(%|Hz)?|[-−]({_SIZE})(%|Hz)/?\+({_SIZE})(%|Hz))?"
)
ON_GRID = 1e-9
"""Periods; forgives the rounding of a quotient."""


@dataclass(frozen=True)
class ModeBand:
    """A mode and how far its frequency may be off.

    Attributes:
        mode: nominal frequency and damping.
        uncertainty: the frequency lies within (1 - uncertainty) to (1 + uncertainty) times the nominal one;
            0 to below 1, 0: only the nominal frequency is designed for.
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
        """The mode, from what the JSON says of it.

        Args:
            data: JSON of such an object.

        Returns:
            The hidden field.
        """
        return {"mode": Mode(data["frequency_hz"], data["damping_ratio"])}

    def __post_init__(self) -> None:
        """Check the range."""
        if not 0.0 <= self.uncertainty < 1.0:
            raise ArgumentError(
                f"uncertainty of the mode at {self.mode.frequency_hz:g} Hz is {self.uncertainty:.4g}: "
                "it must be at least 0 and below 1"
            )

    def shifted(self, share: float) -> Mode:
        """The mode with its frequency moved by `share` (-1 to 1) of the band's half width.

        Args:
            share: -1 to 1: the lower end of the band to the upper one.

        Returns:
            The mode of that frequency, with the same damping.
        """
        scale = 1.0 + share * self.uncertainty
        return Mode(self.mode.frequency_hz * scale, self.mode.damping_ratio, self.mode.participation)

    def __str__(self) -> str:
        """As `parse_mode_band` reads it."""
        text = f"{self.mode.frequency_hz:g}:{self.mode.damping_ratio:g}"
        return f"{text}±{100.0 * self.uncertainty:g}%" if self.uncertainty else text


def parse_mode_band(text: str, uncertainty: float = 0.0) -> ModeBand:
    """A mode such as ``46``, ``46:0.02``, ``46:0.02±5%`` or ``46:0.02+-2.3Hz``: Hz, damping ratio, band.

    A band that reaches further to one side, ``30:0.1-13%+19%``, is that of its middle: ``30.9:0.1±15.534%``.
    """
    match = _TEXT.fullmatch(text.strip())
    if match is None:
        raise ArgumentError(
            f"{text!r} is no mode: FREQUENCY[:DAMPING][±BAND], for example 46:0.02±5%, or with both ends 46:0.02-5%+8%"
        )
    frequency_hz, damping = float(match[1]), float(match[2] or 0.0)
    mode = Mode(frequency_hz, damping)
    if not _SLOWEST_HZ <= frequency_hz <= _FASTEST_HZ:
        raise ArgumentError(
            f"mode frequency {frequency_hz:g} Hz, as typed in {text!r}: must be {_SLOWEST_HZ:g} to {_FASTEST_HZ:g} Hz"
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
    """The modes of all axes of a machine with the bands that it states; equal ones once, with the wider band.

    A band as narrow as a tap test gives is none: a shaper that is exact at the nominal frequency leaves less there than
    one that spends `shaping.vibration_limit` all over it. The verdict simulates its ends nevertheless.
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


def mode_band(given: float | str | Mode | ModeBand, uncertainty: float = 0.0) -> ModeBand:
    """A mode with its band, from a frequency in Hz, a text as `parse_mode_band` reads it, a mode, or as it is."""
    if isinstance(given, Mode):
        return ModeBand(given, uncertainty)
    if isinstance(given, ModeBand):
        return given
    return parse_mode_band(given if isinstance(given, str) else f"{float(given):.17g}", uncertainty)


def ms(time_s: float) -> str:
    """A time, s, in ms."""
    return f"{time_s * 1e3:.6g} ms"


def mode_names(modes: Sequence[Mode]) -> str:
    """Modes by frequency and damping ratio."""
    return ", ".join(f"{mode.frequency_hz:g} Hz (zeta {mode.damping_ratio:g})" for mode in modes)


def band_names(bands: Sequence[ModeBand]) -> str:
    """Modes with their bands, as they are typed."""
    return ", ".join(f"{band} Hz" for band in bands)


def spoken(bands: Sequence[ModeBand]) -> str:
    """Modes with their bands in a sentence."""

    def one(band: ModeBand) -> str:
        text = f"{band.mode.frequency_hz:g} Hz"
        return f"{text} ±{100.0 * band.uncertainty:g} %" if band.uncertainty else text

    return " and ".join(map(one, bands))


def check_times(**times_s: float) -> None:
    """Refuse times that are not finite and above 0."""
    for name, value in times_s.items():
        if not (math.isfinite(value) and value > 0.0):
            raise ArgumentError(f"{name} is {value} s: it must be finite and above 0")


def check_modes_and_times(modes: Sequence[Mode | ModeBand], **times_s: float) -> None:
    """Refuse no mode, and times that are not finite and above 0."""
    if not modes:
        raise ArgumentError("a shaper needs at least one mode: 0 given")
    check_times(**times_s)


def whole_periods(duration_s: float, period_s: float) -> int:
    """How many periods fit into a duration."""
    return math.floor(duration_s / period_s + ON_GRID)
