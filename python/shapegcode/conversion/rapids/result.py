"""What became of the rapids of a program."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from shapegcode.results.result import Pair, Xyz

__all__ = ["RapidMove", "RapidsOutcome"]


@dataclass(frozen=True)
class RapidMove:
    """A rapid that is a shaped cutting move now.

    Attributes:
        lines: of the original, first and last.
        emitted_lines: of the emitted program.
        time_s: until the set-points rest.
        in_position_s: wait for in-position behind them.
        settling_s: from the end of the set-points until the table stays within the band.
        residual_vibration_um: largest |table - command| while the set-points rest.
        residual_limit_um: what the emitted one is judged by.
        misses: tolerances that it leaves; always empty: such a rapid keeps its text.
    """

    lines: tuple[int, int]
    emitted_lines: tuple[int, int]
    time_s: Pair[float]
    in_position_s: Pair[float]
    settling_s: Pair[float]
    residual_vibration_um: Pair[Xyz[float]]
    residual_limit_um: Xyz[float]
    misses: tuple[str, ...]


@dataclass(frozen=True)
class RapidsOutcome:
    """The rapids of a program: how many are shaped moves now, why the others stay, and what that saves.

    Attributes:
        found: rapids in the program.
        shaped: of them, shaped moves now.
        kept: how many stay, by reason.
        time_saved_s: by which the table is ready for the next cuts sooner, in all.
        settle_band_um: half the width of the band in which vibration counts as having decayed.
        blocks: shaped blocks that replace them.
        slowed_blocks: of these, such as step an axis by more than the corner limit of the look-ahead.
        moves: those that are shaped.
    """

    found: int
    shaped: int
    kept: Mapping[str, int]
    time_saved_s: float
    settle_band_um: float
    blocks: int
    slowed_blocks: int
    moves: tuple[RapidMove, ...]
