"""Our shapers beside the Vibration Guard of ISG's CNC kernel, on its own terms: docs/evidence/comparison.md.

Run from the root of the repository: ``python tests/benchmarks/compare_shapers.py --bands``. One mode of 30 Hz (the
rival's default) damped by .1; the band in which at most 5 % is left is found by the formula of
tests/oracles/vibration_guard.py, for the rival's derived kernels and for ours alike.
"""

from __future__ import annotations

import numpy as np
import places  # noqa: F401
from table import markdown

import vibration_guard as guard
from shapegcode import Mode, Shaper
from shapegcode._core import DesignError
from shapegcode.shaping import FAMILIES, DesignOptions, ModeBand, design, minimax_robust

FREQUENCY_HZ = 30.0
FINE_S, BLOCK_S = 1e-4, 1e-3  # as good as continuous times; a grid of blocks
ARC_SPEED, ARC_RADIUS = 200.0, 20.0  # mm/s, mm
CORNER_SPEED = 10.0  # mm/s
NEGATIVE_SUM = 1.5  # of the taps' magnitudes, in the rows with negative taps
_HALVINGS = 10
_LEFT_OUT = {"taps", "robust", "si", "polynomial"}  # made for a band: the table above; no use on a fine grid
_MAX_S = 0.2


def band_of(low: float, high: float) -> ModeBand:
    """The band from `low` to `high` times the mode's frequency."""
    return ModeBand(Mode(0.5 * (low + high) * FREQUENCY_HZ, guard.DAMPING), (high - low) / (high + low))


def periods(shaper: Shaper) -> tuple[np.ndarray, np.ndarray]:
    """Times in periods of the mode, and amplitudes."""
    return shaper.times_s * FREQUENCY_HZ, shaper.amplitudes


def shortest(low: float, high: float, period_s: float, *, mirrored: bool = False, negative: bool = False) -> Shaper:
    """The shortest design with that band."""
    return minimax_robust(
        [band_of(low, high)], period_s, max_duration_s=_MAX_S, mirrored=mirrored, non_negative=not negative,
        max_abs_sum=NEGATIVE_SUM, vibration_limit=guard.LIMIT, hints=False,
    ).shaper  # fmt: skip


def widest(mode: guard.GuardMode, duration_s: float, period_s: float, *, mirrored: bool = False) -> Shaper:
    """The design no longer than that with the widest band; both ends of the published one are stretched alike."""
    found, enough, too_much = shortest(*mode.band, period_s, mirrored=mirrored), 1.0, 4.0
    for _ in range(_HALVINGS):
        scale = 0.5 * (enough + too_much)
        try:
            found = minimax_robust(
                [band_of(1.0 - scale * mode.below, 1.0 + scale * mode.above)], period_s, max_duration_s=duration_s,
                mirrored=mirrored, vibration_limit=guard.LIMIT, hints=False,
            ).shaper  # fmt: skip
            enough = scale
        except DesignError:
            too_much = scale
    return found


def guard_table() -> str:
    """Each mode of the rival, and ours with its band and with its duration."""
    rows = []
    for mode in guard.MODES:
        taps = mode.taps()
        own = len(taps[0]) - 1
        on_grid = _on_grid(mode)
        rows.append([f"**mode {mode.number}**, published", _band(mode.band), "not published", *["–"] * 3, "1"])
        rows.append([f"– {mode.kernel}, derived", *_figures(*taps), _ms(on_grid), "1"])
        kinds = ((False, "robust"), (True, "mirrored")) if mode.symmetric else ((False, "robust"),)
        for mirrored, name in kinds:
            same_band = shortest(*mode.band, FINE_S, mirrored=mirrored)
            grid_band = shortest(*mode.band, BLOCK_S, mirrored=mirrored)
            as_long = widest(mode, float(taps[0][own]) / FREQUENCY_HZ, FINE_S, mirrored=mirrored)
            grid_long = widest(mode, on_grid.duration_s, BLOCK_S, mirrored=mirrored)
            rows.append([f"`{name}`, same band", *_figures(*periods(same_band)), _ms(grid_band), "any"])
            rows.append([f"`{name}`, as long", *_figures(*periods(as_long)), _ms(grid_long), "any"])
        low, high = mode.band
        signed, grid = (shortest(low, high, period_s, negative=True) for period_s in (FINE_S, BLOCK_S))
        rows.append(
            [f"same band, taps < 0, Σ\\|a\\| ≤ {NEGATIVE_SUM:g}", *_figures(*periods(signed)), _ms(grid), "any"]
        )
    return markdown(["shaper", "band at 5 %", "duration, periods", "arc, µm", "corner, µm", "1 ms grid", "modes"], rows)


def families_table() -> str:
    """Each family made for the mode alone, and the shortest design with the band that it has."""
    rows = []
    for row in FAMILIES:
        if row.name in _LEFT_OUT:
            continue
        fine = None if row.continuous else FINE_S
        band = [ModeBand(Mode(FREQUENCY_HZ, guard.DAMPING))]
        shaper = design(row.name, band, DesignOptions(period_s=fine, max_duration_s=_MAX_S))[0].shaper
        times, amplitudes = periods(shaper)
        low, high = guard.five_percent_band(times, amplitudes)
        try:
            same = shortest(low, high, FINE_S)
            beside = f"{same.duration_s * FREQUENCY_HZ:.3f}"
        except DesignError:
            beside = "–"
        figures = _figures(times, amplitudes)
        rows.append([f"`{row.name}`", *figures, beside, _grid_of(row.name, band) if row.on_grid else "–"])
    head = [
        "family",
        "band at 5 %",
        "duration, periods",
        "arc, µm",
        "corner, µm",
        "duration of `robust` for that band",
        "1 ms grid",
    ]
    return markdown(head, rows)


def _grid_of(name: str, band: list[ModeBand]) -> str:
    return _ms(design(name, band, DesignOptions(period_s=BLOCK_S, max_duration_s=_MAX_S))[0].shaper)


def _on_grid(mode: guard.GuardMode) -> Shaper:
    """The rival's kernel on the grid of blocks, with its zeros exact there."""
    name = "mirrored" if mode.symmetric else ("zv", "zvd", "zvdd")[mode.number - 1]
    band = [ModeBand(Mode(FREQUENCY_HZ, guard.DAMPING))]
    return design(name, band, DesignOptions(period_s=BLOCK_S, max_duration_s=_MAX_S))[0].shaper


def _figures(times: np.ndarray, amplitudes: np.ndarray) -> list[str]:
    arc = 1e3 * guard.arc_error(times, amplitudes) / FREQUENCY_HZ**2 * ARC_SPEED**2 / (2.0 * ARC_RADIUS)
    corner = 1e3 * guard.corner_error(times, amplitudes) / FREQUENCY_HZ * CORNER_SPEED
    return [
        _band(guard.five_percent_band(times, amplitudes)), f"{times[-1]:.3f}", f"{arc:.1f}",
        f"{corner:.1f}" if amplitudes.min() >= 0.0 else "–",
    ]  # fmt: skip


def _band(ends: tuple[float, float]) -> str:
    low, high = (100.0 * (end - 1.0) for end in ends)
    return f"−{-low:.1f} / " + (f"+{high:.1f} %" if high < 299.0 else "all %")


def _ms(shaper: Shaper) -> str:
    low, high = guard.five_percent_band(*periods(shaper))
    return f"{1e3 * shaper.duration_s:.0f} ms ({_band((low, high))})"


def tables() -> str:
    """Both tables, with what they are of."""
    mode = f"**{FREQUENCY_HZ:g} Hz, ζ {guard.DAMPING:g}**"
    return (
        f"{mode}: the Vibration Guard's modes, and ours\n\n{guard_table()}\n\n"
        f"{mode}: every family, made for this mode alone\n\n{families_table()}\n"
    )
