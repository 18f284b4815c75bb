"""Budgets of a conversion: size of the text, speed of the serial line, blocks per second; and what is given up.

Steady motion costs one block whether it is shaped or not; what costs are the transitions. A text whose blocks come
too fast is first written with a longer block period; regions that are still too fast keep their text. If the text is
too large, the regions whose shaping gains least per byte keep theirs.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from shapegcode import _core
from shapegcode.conversion.write import EmittedRegion
from shapegcode.machine import Machine
from shapegcode.program import Program, least_increment_mm
from shapegcode.shaping.grid import Grid

__all__ = ["Budget", "Load", "Spending", "busiest_per_s", "keepable", "measure_load", "residual_unit_um"]

_ROUNDING = 1e-9  # relative; rates are quotients
# A stretch of a longer period may hold fewer blocks than one of a shorter period, but hardly less than this share.
_LEAST_FILLED = 0.5
_LINES_NAMED = 5  # lines of regions in the one sentence

FloatArray = npt.NDArray[np.float64]


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


@dataclass(frozen=True)
class Load:
    """What a shaped region asks of memory, line and control.

    Attributes:
        extra_bytes: size of its text less that of the original's.
        baud: what its busiest stretch needs of the line, bit/s.
        blocks_per_second: blocks in its busiest stretch.
    """

    extra_bytes: int
    baud: float
    blocks_per_second: float


def busiest_per_s(durations_s: npt.ArrayLike, amounts: npt.ArrayLike, stretch_s: float) -> float:
    """Largest amount per second in any stretch of a duration; each block's amount is spread evenly over it.

    Args:
        durations_s: of the blocks, s.
        amounts: what each of them needs: its characters, or 1.
        stretch_s: the stretch, s; all blocks together if they last less.

    Returns:
        Amount per second.
    """
    times = np.concatenate([[0.0], np.cumsum(np.asarray(durations_s, dtype=np.float64))])
    sums = np.concatenate([[0.0], np.cumsum(np.asarray(amounts, dtype=np.float64))])
    if times[-1] <= 0.0:
        return 0.0
    stretch = min(stretch_s, float(times[-1]))
    # The sum over a stretch is piecewise linear in its place: it is largest where a block begins or ends at its edge.
    begins = np.clip(np.concatenate([times, times - stretch]), 0.0, times[-1] - stretch)
    amount = np.interp(begins + stretch, times, sums) - np.interp(begins, times, sums)
    return float(amount.max()) / stretch


def measure_load(region: _core.Region, shaped: EmittedRegion, grid: Grid, machine: Machine) -> Load:
    """The load of a shaped region; a stretch lasts as long as the shaper: no transition is shorter."""
    durations = shaped.periods * grid.block_period_s
    stretch = max(grid.duration_s, grid.block_period_s)
    characters = busiest_per_s(durations, _block_bytes(shaped), stretch)
    return Load(
        len(shaped.text) - (region.text_end - region.text_begin),
        characters * machine.controller.dnc_bits_per_character,
        busiest_per_s(durations, np.ones(len(durations)), stretch),
    )


def _block_bytes(shaped: EmittedRegion) -> FloatArray:
    """Characters of each block with its line end; comment lines count with the block that follows."""
    text = np.frombuffer(shaped.text, dtype=np.uint8)[shaped.blocks_begin : shaped.blocks_end]
    ends = np.flatnonzero(text == ord("\n")) + 1
    begins = np.concatenate([[0], ends[:-1]])
    last = ends[text[begins] != ord("(")][: len(shaped.periods)].copy()
    last[-1] = len(text)  # comments and N words behind the last block
    sizes: FloatArray = np.diff(last, prepend=0).astype(np.float64)
    return sizes


def residual_unit_um(region: _core.Region, machine: Machine) -> float:
    """What residual vibration is measured by: the tolerance that does not depend on the original, µm."""
    tolerance = machine.tolerance
    increment_um = least_increment_mm(machine, region.exit.units) * 1e3
    return max(tolerance.residual_floor_um, tolerance.residual_floor_increments * increment_um) or 1.0


def keepable(region: _core.Region, machine: Machine) -> bool:
    """Whether a region's text can stand in an emitted program: absolute arc centres cannot."""
    return machine.input.arc_centre != "absolute" or region.path.largest_sweep_rad <= 0.0


class Written(Protocol):
    """A text and the loads of its shaped regions, per index."""

    @property
    def text(self) -> bytes:
        """The whole text."""

    @property
    def loads(self) -> Mapping[int, Load]:
        """In the order of the regions."""


@dataclass
class Spending:
    """The choice under a budget, and the record of what was given up.

    Attributes:
        budget: the limits.
        program: what is converted.
        machine: controller and tolerances.
        longer: the block period is longer than it would be without the budget.
        before: figures of the text with everything shaped; where the block period is longer: of that on the shorter
            one, before any region is slowed for the contour tolerance.
        given_up: reason per index of a region.
        entries: figures of the regions given up, per index.
    """

    budget: Budget
    program: Program
    machine: Machine
    longer: bool = False
    before: dict[str, Any] = field(default_factory=dict)
    given_up: dict[int, str] = field(default_factory=dict)
    entries: dict[int, dict[str, Any]] = field(default_factory=dict)

    def choose_period(
        self,
        grid: Grid,
        residuals_mm: Sequence[float],
        design: Callable[[float], Grid],
        write: Callable[[Grid], Written],
    ) -> Grid:
        """The block period on which the most that is worth shaping is not too fast; of equals the shortest shaper.

        Args:
            grid: what is used without a budget.
            residuals_mm: residual vibration of each of the original's regions: what shaping it is worth.
            design: grid of a block period.
            write: writes all regions on a grid.

        Returns:
            The grid of that period.
        """
        regions = self.program.regions
        weights = [
            residual * 1e3 / residual_unit_um(region, self.machine)
            for region, residual in zip(regions, residuals_mm, strict=True)
        ]
        written = write(grid)
        loads = written.loads
        if self.machine.emission.block_period_s is not None or not self._factors(loads):
            return grid
        tick = self.machine.controller.interpolation_period_s
        most = math.floor(self.machine.shaping.max_duration_s / tick + _ROUNDING)
        ticks = measured = round(grid.block_period_s / tick)
        best, best_loads = grid, loads
        while self._factors(best_loads) or ticks * tick < best.shaper.duration_s:
            # A shaper lasts a period at least: where nothing is too fast any more, a shorter one is still looked for.
            factors = self._factors(loads)
            ticks = max(ticks + 1, math.floor(measured * min(factors, default=1.0) * _LEAST_FILLED))
            if ticks > most:
                break
            try:
                longer = design(ticks * tick)
                if not self._factors(best_loads) and longer.shaper.duration_s >= best.shaper.duration_s:
                    continue
                loads = write(longer).loads
            except (_core.DesignError, _core.ProgramError):  # no shaper on this grid, or no region on it
                continue
            measured = ticks
            if self._worth(longer, loads, weights) > self._worth(best, best_loads, weights):
                best, best_loads = longer, loads
        self.longer = best is not grid
        if self.longer:  # else noted from the text as it is judged
            self._note_before(grid, written)
        return best

    def give_up(self, grid: Grid, written: Written, figures: Mapping[str, Any]) -> bool:
        """Choose regions that must keep their text; False if the text fits.

        Args:
            grid: on which the text is written.
            written: the whole text with its loads.
            figures: of the shaped regions, as in the report.

        Returns:
            Whether any was given up.

        Raises:
            ArgumentError: no choice fits; with value and limit.
        """
        self._note_before(grid, written)
        loads = written.loads
        entries = dict(zip(loads, figures["regions"], strict=True))
        chosen = {index: reason for index, load in loads.items() if (reason := self._too_fast(load))}
        regions = self.program.regions
        for index, reason in chosen.items():
            if not keepable(regions[index], self.machine):
                raise self._impossible(index, reason)
        if self.longer:
            at = f"at a block period of {grid.block_period_s * 1e3:g} ms"
            missed = (index for index in loads if entries[index]["misses"] and keepable(regions[index], self.machine))
            chosen = {index: f"{entries[index]['misses'][0]}, {at}" for index in missed} | chosen
        size = len(written.text) - sum(loads[index].extra_bytes for index in chosen)
        chosen |= self._too_large(size, {k: load for k, load in loads.items() if k not in chosen}, entries)
        for index in chosen:
            self.entries[index] = {
                "lines": entries[index]["lines"],
                "reason": chosen[index],
                "residual_um": entries[index]["residual_vibration_um"]["original"],
                "bytes": loads[index].extra_bytes,
            }
        self.given_up |= chosen
        return bool(chosen)

    def report(self, grid: Grid, written: Written) -> dict[str, Any]:
        """The report's key `budget`."""
        return {
            "limits": asdict(self.budget),
            "before": self.before,
            "after": self._figures(grid, written),
            "block_period_s": grid.block_period_s,
            "given_up": [self.entries[index] for index in sorted(self.entries)],
        }

    def warning(self, grid: Grid) -> str:
        """One sentence on what was given up; empty if nothing was."""
        said = []
        if self.longer:
            was, now = self.before["block_period_s"] * 1e3, grid.block_period_s * 1e3
            said.append(f"the block period is {now:g} ms instead of {was:g} ms")
        if self.entries:
            entries = [self.entries[index] for index in sorted(self.entries)]
            lines = ", ".join("{} to {}".format(*entry["lines"]) for entry in entries[:_LINES_NAMED])
            lines += f" and {len(entries) - _LINES_NAMED} more" if len(entries) > _LINES_NAMED else ""
            stays = max(max(entry["residual_um"].values()) for entry in entries)
            said.append(
                f"{len(entries)} of {len(self.program.regions)} regions keep their text (lines {lines}) "
                f"and up to {stays:.1f} um of residual vibration"
            )
        return f"{self.program.source}: given up for the budget: {'; '.join(said)}" if said else ""

    def _note_before(self, grid: Grid, written: Written) -> None:
        if not self.before:
            self.before = self._figures(grid, written)

    def _figures(self, grid: Grid, written: Written) -> dict[str, Any]:
        loads = written.loads.values()
        return {
            "bytes": len(written.text),
            "baud": max((load.baud for load in loads), default=0.0),
            "blocks_per_second": max((load.blocks_per_second for load in loads), default=0.0),
            "block_period_s": grid.block_period_s,
        }

    def _factors(self, loads: Mapping[int, Load]) -> list[float]:
        """How many times too fast the regions are that are."""
        factors = (max(value / limit for _, value, limit in self._rates(load)) for load in loads.values())
        return [factor for factor in factors if factor > 1.0 + _ROUNDING]

    def _rates(self, load: Load) -> list[tuple[str, float, float]]:
        pairs = (
            ("baud", load.baud, self.budget.baud),
            ("blocks per second", load.blocks_per_second, self.budget.max_blocks_per_second),
        )
        return [(unit, value, limit) for unit, value, limit in pairs if limit is not None]

    def _too_fast(self, load: Load) -> str:
        for unit, value, limit in self._rates(load):
            if value > limit * (1.0 + _ROUNDING):
                return f"needs {value:.0f} {unit}, limit {limit:g}"
        return ""

    def _worth(self, grid: Grid, loads: Mapping[int, Load], weights: Sequence[float]) -> tuple[float, int, int]:
        """Gain of the regions that are not too fast, how many they are, and how short the shaper is, in ticks."""
        slow = [index for index, load in loads.items() if not self._too_fast(load)]
        duration = round(grid.duration_s / self.machine.controller.interpolation_period_s)
        return math.fsum(weights[index] for index in slow), len(slow), -duration

    def _too_large(
        self, size: int, loads: Mapping[int, Load], figures: Mapping[int, Mapping[str, Any]]
    ) -> dict[int, str]:
        """Regions to keep so that the text fits: least gain per byte first."""
        limit = self.budget.max_bytes
        if limit is None or not loads or size <= limit:
            if limit is not None and not loads and self.program.core.size > limit:
                raise self._too_large_error(self.program.core.size)
            return {}
        regions = self.program.regions
        gain = {k: _gain(figures[k], residual_unit_um(regions[k], self.machine)) for k in loads}
        costly = [k for k, load in loads.items() if load.extra_bytes > 0 and keepable(regions[k], self.machine)]
        # Where the gain is negative, more of it per byte would be less: such regions go first, the worst before all.
        order = sorted(costly, key=lambda k: (gain[k] / (loads[k].extra_bytes if gain[k] > 0.0 else 1.0), k))
        kept: list[int] = []
        for index in order:
            if size <= limit:
                break
            kept.append(index)
            size -= loads[index].extra_bytes
        if size > limit or len(kept) == len(loads):
            # Without a shaped region there is no header comment either.
            return self._nothing_shaped(size, loads)
        # What was given up for the sake of a large one may fit beside the rest.
        for index in reversed(kept.copy()):
            if gain[index] > 0.0 and size + loads[index].extra_bytes <= limit:
                kept.remove(index)
                size += loads[index].extra_bytes
        return dict.fromkeys(kept, self._memory_reason())

    def _nothing_shaped(self, size: int, loads: Mapping[int, Load]) -> dict[int, str]:
        limit = self.budget.max_bytes
        regions = self.program.regions
        possible = all(keepable(regions[k], self.machine) for k in loads)
        if limit is None or not possible or self.program.core.size > limit:
            if possible:
                raise self._too_large_error(min(size, self.program.core.size))
            raise self._too_large_error(size, "; arcs with absolute centres cannot be kept as they are")
        return dict.fromkeys(loads, self._memory_reason())

    def _memory_reason(self) -> str:
        return f"gains least per byte, limit {self.budget.max_bytes} bytes"

    def _too_large_error(self, least: int, why: str = "") -> _core.ArgumentError:
        return _core.ArgumentError(
            f"{self.program.source}: needs {least} bytes at least (the original has {self.program.core.size}), "
            f"the budget is {self.budget.max_bytes} bytes (--max-bytes){why}"
        )

    def _impossible(self, index: int, reason: str) -> _core.ArgumentError:
        region = self.program.regions[index]
        return _core.ArgumentError(
            f"{self.program.source}:{region.first_line}: lines {region.first_line} to {region.last_line}: {reason}; "
            "their arcs have absolute centres and cannot be kept as they are"
        )


def _gain(figure: Mapping[str, Any], unit_um: float) -> float:
    """Residual vibration that shaping a region removes, of its worst axis, in units of the tolerance."""
    was, now = figure["residual_vibration_um"]["original"], figure["residual_vibration_um"]["emitted"]
    return (float(max(was.values())) - float(max(now.values()))) / unit_um
