"""Budgets of a conversion: size of the program, speed of the serial line, blocks per second."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass

from shapegcode import _core
from shapegcode.conversion.whole_text import Written
from shapegcode.conversion.write import TransferLoad, keepable
from shapegcode.machine import Machine
from shapegcode.program import Program
from shapegcode.results.json import OldNames
from shapegcode.results.outcome import Xyz
from shapegcode.shaping.grid import Grid
from shapegcode.verdict.figures import RegionVerdict
from shapegcode.verdict.judge import residual_floor_um

_ROUNDING = 1e-9  # relative; rates are quotients


@dataclass(frozen=True)
class Budget:
    """Limits of the emitted program; None: no limit.

    Attributes:
        max_bytes: size of the whole program.
        baud: speed of the serial line, bit/s; a character takes `controller.dnc_bits_per_character`.
        max_blocks_per_second: blocks that the control reads per second.

    Raises:
        ArgumentError: a limit is not finite and above 0.
    """

    max_bytes: int | None = None
    baud: float | None = None
    max_blocks_per_second: float | None = None

    def __post_init__(self) -> None:
        for name, value in asdict(self).items():
            if value is not None and not (math.isfinite(value) and value > 0):
                raise _core.ArgumentError(f"budget {name} is {value}, must be finite and above 0")

    @property
    def limits_rate(self) -> bool:
        """True if it limits the rate of blocks or characters."""
        return self.baud is not None or self.max_blocks_per_second is not None

    def excess(self, load: TransferLoad) -> float:
        """Largest ratio of a region's data and block rates to the permitted ones.

        Args:
            load: load of the region.

        Returns:
            1 or less: within the limit; 0 if no rate is limited.
        """
        return max((value / limit for _, value, limit in self._rates(load)), default=0.0)

    def too_fast(self, load: TransferLoad) -> str:
        """Describe the rate of a region that exceeds a limit.

        Args:
            load: load of the region.

        Returns:
            The text; empty if it exceeds none.
        """
        for unit, value, limit in self._rates(load):
            if value > limit * (1.0 + _ROUNDING):
                return f"needs {value:.0f} {unit}, limit {limit:g}"
        return ""

    def _rates(self, load: TransferLoad) -> list[tuple[str, float, float]]:
        rates = [("baud", load.baud, self.baud)]
        rates.append(("blocks per second", load.blocks_per_second, self.max_blocks_per_second))
        return [(unit, value, limit) for unit, value, limit in rates if limit is not None]


@dataclass(frozen=True)
class TextNeeds:
    """Memory, data rate and block rate that a whole program needs."""

    bytes: int  # its size
    baud: float  # required line speed in its section with the most characters per second, bit/s
    blocks_per_second: float  # in its busiest section
    block_period_s: float  # block period of the program


@dataclass(frozen=True)
class GivenUp:
    """A region that is left unchanged."""

    lines: tuple[int, int]  # first and last line in the original
    reason: str  # as text
    residual_um: Xyz[float]  # remaining residual vibration
    bytes: int  # additional size if shaped


@dataclass(frozen=True)
class BudgetOutcome(OldNames):
    """Effect of a budget on a conversion."""

    limits: Budget  # the budget; null: no limit
    # needs before the budget leaves cuts unchanged; if it lengthens the block period: at the period without budget,
    # before any region is slowed for the contour tolerance
    before: TextNeeds
    after: TextNeeds  # of the emitted program
    block_period_s: float  # block period of the program
    left_unchanged: tuple[GivenUp, ...]  # regions left unchanged


# Lowest expected ratio of the blocks per period of a section on a longer block period to those before.
_MIN_FILLED = 0.5
_LINES_NAMED = 5  # regions listed in the warning


class Spending:
    """Choices under a budget, and the record of regions left unchanged."""

    def __init__(self, budget: Budget, program: Program, machine: Machine) -> None:
        self.budget = budget
        self.left_unchanged: dict[int, GivenUp] = {}  # regions left unchanged, by index
        self._program = program
        self._period_s = machine.controller.interpolation_period_s
        self._max_periods = math.floor(machine.shaping.max_duration_s / self._period_s + _ROUNDING)
        self._keepable = [keepable(region, program) for region in program.regions]
        self._unit_um = [residual_floor_um(region, machine) or 1.0 for region in program.regions]
        self._longer = False  # the block period is longer than it would be without the budget
        self._before: TextNeeds | None = None

    def choose_period(
        self,
        grid: Grid,
        residuals_mm: Sequence[float],
        design: Callable[[float], Grid],
        write: Callable[[Grid], Written],
    ) -> Grid:
        """Choose the block period of the largest `_worth`; the given one if all its cuts keep the rates."""
        weights = [residual * 1e3 / unit for unit, residual in zip(self._unit_um, residuals_mm, strict=True)]
        written = write(grid)
        loads = written.loads
        if not self._factors(loads):
            return grid
        periods = measured = round(grid.block_period_s / self._period_s)
        best, best_loads = grid, loads
        while self._factors(best_loads) or periods * self._period_s < best.shaper.duration_s:
            # After the first period without excess, shorter shapers are still tried; none is shorter than a period.
            factors = self._factors(loads)
            periods = max(periods + 1, math.floor(measured * min(factors, default=1.0) * _MIN_FILLED))
            if periods > self._max_periods:
                break
            try:
                longer = design(periods * self._period_s)
                if not self._factors(best_loads) and longer.shaper.duration_s >= best.shaper.duration_s:
                    continue
                loads = write(longer).loads
            except (_core.DesignError, _core.ProgramError):  # no shaper or no region on this grid
                continue
            measured = periods
            if self._worth(longer, loads, weights) > self._worth(best, best_loads, weights):
                best, best_loads = longer, loads
        self._longer = best is not grid
        if self._longer:  # otherwise `give_up` sets it
            self._before = _needs(grid, written)
        return best

    def give_up(self, grid: Grid, written: Written, verdicts: Sequence[RegionVerdict]) -> bool:
        """Choose further regions to leave unchanged; False if there are none: then the program fits."""
        self._before = self._before or _needs(grid, written)
        loads = written.loads
        simulated = dict(zip(loads, verdicts, strict=True))
        chosen = {index: reason for index, load in loads.items() if (reason := self.budget.too_fast(load))}
        for index, reason in chosen.items():
            if not self._keepable[index]:
                cut = self._program.regions[index]
                raise _core.ArgumentError(
                    f"{self._program.source}:{cut.first_line}: lines {cut.first_line} to {cut.last_line}: "
                    f"{reason}; their arcs have absolute centres and cannot be kept as they are"
                )
        if self._longer:
            at = f"at a block period of {grid.block_period_s * 1e3:g} ms"
            missed = (index for index in loads if simulated[index].misses and self._keepable[index])
            chosen = {index: f"{simulated[index].misses[0]}, {at}" for index in missed} | chosen
        size = written.size - sum(loads[index].extra_bytes for index in chosen)
        chosen |= self._too_large(size, {k: load for k, load in loads.items() if k not in chosen}, simulated)
        for index, reason in chosen.items():
            region = simulated[index]
            self.left_unchanged[index] = GivenUp(
                region.lines, reason, region.residual_vibration_um.original, loads[index].extra_bytes
            )
        return bool(chosen)

    def outcome(self, grid: Grid, written: Written) -> BudgetOutcome:
        """Effect of the budget, once the program fits."""
        after = _needs(grid, written)
        left_unchanged = tuple(self.left_unchanged[index] for index in sorted(self.left_unchanged))
        return BudgetOutcome(self.budget, self._before or after, after, grid.block_period_s, left_unchanged)

    def warning(self, grid: Grid) -> str:
        """One sentence on the effects of the budget; empty without any."""
        parts = []
        if self._longer and self._before is not None:
            was, now = self._before.block_period_s * 1e3, grid.block_period_s * 1e3
            parts.append(f"the block period is {now:g} ms instead of {was:g} ms")
        if self.left_unchanged:
            entries = [self.left_unchanged[index] for index in sorted(self.left_unchanged)]
            lines = ", ".join("{} to {}".format(*entry.lines) for entry in entries[:_LINES_NAMED])
            lines += f" and {len(entries) - _LINES_NAMED} more" if len(entries) > _LINES_NAMED else ""
            stays = max(max(entry.residual_um) for entry in entries)
            parts.append(
                f"{len(entries)} of {len(self._program.regions)} cuts are left unchanged (lines {lines}) "
                f"with up to {stays:.1f} um of residual vibration"
            )
        return f"{self._program.source}: effect of the budget: {'; '.join(parts)}" if parts else ""

    def _factors(self, loads: Mapping[int, TransferLoad]) -> list[float]:
        factors = (self.budget.excess(load) for load in loads.values())
        return [factor for factor in factors if factor > 1.0 + _ROUNDING]

    def _worth(self, grid: Grid, loads: Mapping[int, TransferLoad], weights: Sequence[float]) -> tuple[float, int, int]:
        """Rank of a grid: weight of regions within the rate limits, then their number, then the shorter shaper."""
        slow = [index for index, load in loads.items() if not self.budget.too_fast(load)]
        return math.fsum(weights[index] for index in slow), len(slow), -round(grid.duration_s / self._period_s)

    def _too_large(
        self, size: int, loads: Mapping[int, TransferLoad], simulated: Mapping[int, RegionVerdict]
    ) -> dict[int, str]:
        limit = self.budget.max_bytes
        if limit is None:
            return {}
        original = self._program.core.size
        if not loads and original > limit:
            raise self._too_large_error(original)
        if not loads or size <= limit:
            return {}
        # Residual vibration removed by shaping a region, worst axis, relative to the one that always passes.
        gain = {
            index: (max(both.original) - max(both.emitted)) / self._unit_um[index]
            for index, both in ((index, simulated[index].residual_vibration_um) for index in loads)
        }
        costly = [index for index, load in loads.items() if load.extra_bytes > 0 and self._keepable[index]]
        # Regions with a negative gain come first, the worst of all first; per byte they would be sorted wrongly.
        order = sorted(costly, key=lambda k: (gain[k] / (loads[k].extra_bytes if gain[k] > 0.0 else 1.0), k))
        kept: list[int] = []
        for index in order:
            if size <= limit:
                break
            kept.append(index)
            size -= loads[index].extra_bytes
        if size > limit or len(kept) == len(loads):
            # Without a shaped region there is no header either.
            if not all(self._keepable[index] for index in loads):
                raise self._too_large_error(size, "; arcs with absolute centres cannot be left unchanged")
            if original > limit:
                raise self._too_large_error(min(size, original))
            kept = list(loads)
        else:  # a region given up before a large one may still fit
            for index in reversed(kept.copy()):
                if gain[index] > 0.0 and size + loads[index].extra_bytes <= limit:
                    kept.remove(index)
                    size += loads[index].extra_bytes
        return dict.fromkeys(kept, f"gains least per byte, limit {limit} bytes")

    def _too_large_error(self, least: int, why: str = "") -> _core.ArgumentError:
        return _core.ArgumentError(
            f"{self._program.source}: needs {least} bytes at least (the original has {self._program.core.size}), "
            f"the budget is {self.budget.max_bytes} bytes (--max-bytes){why}"
        )


def _needs(grid: Grid, written: Written) -> TextNeeds:
    loads = written.loads.values()
    return TextNeeds(
        written.size,
        max((load.baud for load in loads), default=0.0),
        max((load.blocks_per_second for load in loads), default=0.0),
        grid.block_period_s,
    )
