"""The registry's row of minimal multi-mode shapers: which region is searched, and in which order they are preferred."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from shapegcode._core import DesignError, MinimalShapers, Mode, Shaper, convolved_zv, minimal_shapers
from shapegcode.shaping.bands import ModeBand
from shapegcode.shaping.words import ms

if TYPE_CHECKING:
    from shapegcode.shaping.options import DesignOptions

__all__ = ["solve_minimal"]

_SPANS = (1.0, 2.0)  # durations of the convolved ZV that are searched, one after the other
_MOST_PERIODS = 100.0 - 1e-6  # of the fastest mode: the limit of minimal_shapers
_PROVEN_MODES = 3  # more modes take too many boxes for a proof; the starts alone search them


def solve_minimal(bands: Sequence[ModeBand], options: DesignOptions) -> list[Shaper]:
    """Minimal shapers of the bands' nominal modes: those without negative taps first, each part by duration.

    Searched up to the duration of the convolved ZV, and, only if there is none, up to twice that; never beyond
    `options.max_duration_s` or 100 periods of the fastest mode.
    """
    modes = [band.mode for band in bands]
    longest_s = min(options.max_duration_s, _MOST_PERIODS / max(mode.frequency_hz for mode in modes))
    usual_s = convolved_zv(modes).duration_s
    for span in _SPANS:
        found = _search(modes, min(span * usual_s, longest_s), options.max_abs_sum)
        if found.shapers or found.max_duration_s >= longest_s:
            break
    if not found.shapers:
        raise DesignError(_none_found(modes, found))
    return sorted(found.shapers, key=lambda shaper: shaper.has_negative)


def _search(modes: Sequence[Mode], max_duration_s: float, max_abs_sum: float) -> MinimalShapers:
    if len(modes) <= _PROVEN_MODES:
        return minimal_shapers(modes, max_duration_s, max_abs_sum=max_abs_sum)
    return minimal_shapers(modes, max_duration_s, max_abs_sum=max_abs_sum, max_boxes=0)


def _none_found(modes: Sequence[Mode], found: MinimalShapers) -> str:
    names = ", ".join(f"{mode.frequency_hz:g} Hz" for mode in modes)
    what = (
        f"no minimal shaper of {names} lasts up to {ms(found.max_duration_s)} with sum|a| up to {found.max_abs_sum:g}"
    )
    if found.complete:
        return what + ": proven; allow a longer one"
    return f"{what} was found from {found.starts} starts, proven up to {ms(found.complete_up_to_s)}"
