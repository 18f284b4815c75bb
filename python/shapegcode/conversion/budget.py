"""Budgets of a conversion: size of the text, speed of the serial line, blocks per second."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass

import numpy as np
import numpy.typing as npt

from shapegcode import _core
from shapegcode.conversion.region_text import EmittedRegion
from shapegcode.results.result import Xyz
from shapegcode.shaping.grid import Grid

__all__ = ["Budget", "BudgetOutcome", "GivenUp", "TextNeeds", "TransferLoad", "measure_load"]

FloatArray = npt.NDArray[np.float64]

_ROUNDING = 1e-9  # relative; rates are quotients


@dataclass(frozen=True)
class Budget:
    """What the emitted program may need; None: no limit.

    Attributes:
        max_bytes: size of the whole text.
        baud: speed of the serial line, bit/s; a character takes `controller.dnc_bits_per_character`.
        max_blocks_per_second: blocks that the control reads per second.

    Raises:
        ArgumentError: a limit is not finite and above 0.
    """

    max_bytes: int | None = None
    baud: float | None = None
    max_blocks_per_second: float | None = None

    def __post_init__(self) -> None:
        """Check the limits."""
        for name, value in asdict(self).items():
            if value is not None and not (math.isfinite(value) and value > 0):
                raise _core.ArgumentError(f"budget {name} is {value}, must be finite and above 0")

    @property
    def limits_rate(self) -> bool:
        """Whether blocks may come too fast for it."""
        return self.baud is not None or self.max_blocks_per_second is not None

    def excess(self, load: TransferLoad) -> float:
        """How many times as fast as allowed a region's blocks come.

        Args:
            load: of the region.

        Returns:
            1 or less: not too fast; 0 where no rate is limited.
        """
        return max((value / limit for _, value, limit in self._rates(load)), default=0.0)

    def too_fast(self, load: TransferLoad) -> str:
        """What of a region comes too fast.

        Args:
            load: of the region.

        Returns:
            In words; empty if nothing does.
        """
        for unit, value, limit in self._rates(load):
            if value > limit * (1.0 + _ROUNDING):
                return f"needs {value:.0f} {unit}, limit {limit:g}"
        return ""

    def _rates(self, load: TransferLoad) -> list[tuple[str, float, float]]:
        pairs = (
            ("baud", load.baud, self.baud),
            ("blocks per second", load.blocks_per_second, self.max_blocks_per_second),
        )
        return [(unit, value, limit) for unit, value, limit in pairs if limit is not None]


@dataclass(frozen=True)
class TransferLoad:
    """What a shaped region asks of memory, line and control.

    Attributes:
        extra_bytes: size of its text less that of the original's.
        baud: what its section with the most blocks per second needs of the line, bit/s.
        blocks_per_second: blocks in its busiest stretch.
    """

    extra_bytes: int
    baud: float
    blocks_per_second: float


@dataclass(frozen=True)
class TextNeeds:
    """What a whole text asks of memory, line and control.

    Attributes:
        bytes: its size.
        baud: what its section with the most blocks per second needs of the line, bit/s.
        blocks_per_second: blocks in its busiest stretch.
        block_period_s: on which it is written.
    """

    bytes: int
    baud: float
    blocks_per_second: float
    block_period_s: float


@dataclass(frozen=True)
class GivenUp:
    """A region that keeps its text.

    Attributes:
        lines: of the original, first and last.
        reason: in words.
        residual_um: residual vibration that stays.
        bytes: that it would need more.
    """

    lines: tuple[int, int]
    reason: str
    residual_um: Xyz[float]
    bytes: int


@dataclass(frozen=True)
class BudgetOutcome:
    """What a budget did to a conversion.

    Attributes:
        limits: the budget; null: no limit.
        before: of the text with everything shaped; where the block period is longer: of that on the shorter one,
            before any region is slowed for the contour tolerance.
        after: of the text as it is.
        block_period_s: on which it is written.
        given_up: regions that keep their text.
    """

    limits: Budget
    before: TextNeeds
    after: TextNeeds
    block_period_s: float
    given_up: tuple[GivenUp, ...]


def measure_load(region: _core.Region, shaped: EmittedRegion, grid: Grid, bits_per_character: float) -> TransferLoad:
    """The load of a shaped region; a stretch lasts as long as the shaper: no transition is shorter."""
    durations = np.empty(shaped.blocks)
    np.concatenate(shaped.block_periods, out=durations, casting="same_kind")
    durations *= grid.block_period_s
    stretch = max(grid.duration_s, grid.block_period_s)
    sizes = np.empty(shaped.blocks)
    np.concatenate(shaped.block_bytes, out=sizes, casting="same_kind")
    characters = _core.busiest_per_s(durations, sizes, stretch)
    return TransferLoad(
        shaped.text.size - (region.text_end - region.text_begin),
        characters * bits_per_character,
        _core.busiest_per_s(durations, None, stretch),
    )
