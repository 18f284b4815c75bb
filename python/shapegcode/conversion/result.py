"""What a conversion made: figures before and after, cases, regions, warnings, the next step, the emitted program."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

from shapegcode.conversion.benefit import KeptRegion
from shapegcode.conversion.budget import BudgetOutcome
from shapegcode.conversion.operating import ControlNote, control_table, restart_table
from shapegcode.conversion.rapids.result import RapidsOutcome
from shapegcode.conversion.restart_points import RestartPoint
from shapegcode.conversion.rests import RestsOn
from shapegcode.conversion.tables import (
    BeforeAfter,
    before_after_table,
    case_table,
    change_percent,
    percent,
    rests_table,
)
from shapegcode.model.machine_model import MachineModel
from shapegcode.model.playable import PlayedPrograms
from shapegcode.program import Program
from shapegcode.results.figures import CONTOURS, ContourError
from shapegcode.results.json import exact, hidden, sparse
from shapegcode.results.made import Made
from shapegcode.results.page.model import Light, Page, Section
from shapegcode.results.result import Pair, Plot, Result, Xyz
from shapegcode.results.table import Table
from shapegcode.verdict.figures import AppliedLimits, BlockCount, PlayedFigures, UsedShaper
from shapegcode.verdict.placed import Placed

__all__ = ["Conversion"]

_VIBRATIONS = {"residual_vibration_um": "residual vibration", "peak_vibration_um": "peak vibration"}
_DEVIATIONS = {"max": "largest", "rms": "RMS", "gouge": "gouge", "excess": "excess"}


@dataclass(frozen=True, repr=False, kw_only=True)
class Conversion(PlayedFigures, Result):
    """A program, shaped: the emitted text, and what playing it beside the original showed.

    Attributes:
        program: name of the original.
        machine: name of the machine.
        cycle_time_s: whole program: regions, rapids with in-position wait, dwells, drilling cycles.
        cutting_time_s: the regions alone, until the set-points rest.
        block_period_s: grid of the shaped blocks.
        shaper: the design on it.
        blocks: how many there are.
        expanded: the original was expanded (calls, macros, coordinate modes) before it was shaped.
        expanded_radii_mm: radii of cutter compensation that are in the path now, by offset.
        bytes_read: size of the original, expanded.
        bytes_emitted: size of the emitted program.
        limits: tolerances that were applied.
        warnings: what to heed.
        budget: only under one: what it allowed, and what was given up for it.
        rapids: only where rapids may be shaped: what became of them.
        kept: regions that keep their text because shaping them gains too little, or would miss a tolerance.
        least_gain_um: what is too little.
        rests_on: values that nobody measured on this machine, by how far each moves the deciding figure to its limit.
        unmeasured_tried: how many such values were moved.
        at_the_control: what to heed when it is loaded and run; empty where nothing was shaped.
        restart_points: blocks inside of shaped cuts at which the control can begin.
        emitted: the same, read back.
        placed: the shaped regions and their places in it.
        model: the machine that it was played on.
        played: original and emitted program, to play them again for a page.
    """

    json_extra: ClassVar[dict[str, Any]] = Result.json_extra | {"within_tolerance": bool, "recommendation": str}

    program: str
    machine: str
    cycle_time_s: Pair[float]
    cutting_time_s: Pair[float]
    block_period_s: float
    shaper: UsedShaper = field(metadata=exact())
    blocks: BlockCount
    expanded: bool
    expanded_radii_mm: Mapping[str, float]
    bytes_read: int
    bytes_emitted: int
    limits: AppliedLimits
    warnings: tuple[str, ...]
    budget: BudgetOutcome | None = field(default=None, metadata=sparse())
    rapids: RapidsOutcome | None = field(default=None, metadata=sparse())
    kept: tuple[KeptRegion, ...] = ()
    least_gain_um: float = 0.0
    rests_on: tuple[RestsOn, ...] = ()
    unmeasured_tried: int = 0
    at_the_control: tuple[ControlNote, ...] = ()
    restart_points: tuple[RestartPoint, ...] = ()
    emitted: Program = field(metadata=hidden())
    placed: tuple[Placed, ...] = field(metadata=hidden())
    model: MachineModel = field(metadata=hidden())
    played: PlayedPrograms | None = field(default=None, compare=False, metadata=hidden())

    @property
    def text(self) -> bytes:
        """The emitted program, as a file holds it."""
        return self.emitted.text

    @property
    def ok(self) -> bool:
        """Whether every region keeps its tolerances in every case that counts."""
        return self.within_tolerance

    @property
    def nothing_shaped(self) -> bool:
        """Whether the program is as it was."""
        return self.blocks.emitted == 0

    @property
    def recommendation(self) -> str:
        """One of three: "worth running", "no benefit: run the original", "do not run"."""
        if self.nothing_shaped:
            return "no benefit: run the original"
        return "worth running" if self.ok else "do not run"

    @property
    def answer(self) -> str:
        """What to do with it, and the three figures that people look at first."""
        if self.nothing_shaped:
            if self._gave_up:
                why = "nothing fits the budget"
            elif self.kept:
                best = max(self.kept, key=lambda region: region.gain_um)
                if best.gain_um >= self.least_gain_um:
                    why = "a tolerance would be missed (lines {} to {}: {})".format(*best.lines, best.reason)
                else:
                    why = f"shaping would gain {best.gain_um:.1f} µm at most (least: {self.least_gain_um:g})"
            else:
                why = "there is nothing to shape"
            return f"{self.recommendation}: {why}; the text is unchanged"
        vibration = self.residual_vibration_um
        axis = max("xyz", key=lambda each: vibration.original[each])
        target = getattr(self.contour_error_um, self.limits.contour_target)
        change = change_percent(self.cycle_time_s.original, self.cycle_time_s.emitted)
        verdict = self.recommendation + ("" if self.within_tolerance else ", OUT OF TOLERANCE")
        return (
            f"{verdict}: residual vibration {axis.upper()} "
            f"{vibration.original[axis]:.1f} → {vibration.emitted[axis]:.1f} µm, "
            f"contour {target.original.max:.1f} → {target.emitted.max:.1f} µm, time {percent(change)}{self._share}"
        )

    @property
    def _share(self) -> str:
        """Of which cuts the figures are, where some keep their text."""
        left = len(self.kept) + (len(self.budget.given_up) if self.budget is not None else 0)
        shaped = len(self.regions)
        return f" ({shaped} of {shaped + left} cuts shaped, the others as before)" if left else ""

    @property
    def _gave_up(self) -> bool:
        return self.budget is not None and bool(self.budget.given_up)

    @property
    def next_step(self) -> str:
        """The one thing to do next, in one sentence."""
        if self.nothing_shaped:
            # A program read in the wrong unit was judged at a twenty-fifth of its size, or its speed.
            if any("(power_on.units)" in warning for warning in self.warnings):
                return (
                    "make sure of the unit, as the program has neither G20 nor G21: convert it with "
                    "--set power_on.units=G20 (inch) or G21 (mm), and write that code into it."
                )
            return "run the original program: nothing in it was shaped."
        if not self.ok:
            stated = any("; feasible: " in warning for warning in self.warnings)
            remedy = "a warning says which limit is feasible" if stated else "lower the feed there, and convert again"
            return f"do not run it ({next(self.misses())}): {remedy}."
        if self.warnings:
            return "settle the warnings, then run the emitted program above the workpiece, without a tool."
        return "run the emitted program above the workpiece, without a tool, at 100 % feed override."

    def misses(self) -> Iterator[str]:
        """Every tolerance that a region misses, with the lines of the original program."""
        for region in self.regions:
            for miss in region.misses:
                yield "lines {} to {}: {}".format(*region.lines, miss)

    def tables(self) -> list[Table]:
        """Original against emitted; the cases of the verdict; what it rests on. None where nothing was shaped."""
        if self.nothing_shaped:
            return []
        cases = [case_table(self.cases, self.worst_case)] if self.cases else []
        rests = [rests_table(self.rests_on, self.unmeasured_tried)] if self.rests_on else []
        points = [restart_table(self.restart_points)] if self.restart_points else []
        return [before_after_table(self.before_after()), *cases, *rests, control_table(self.at_the_control), *points]

    def before_after(self) -> list[list[BeforeAfter]]:
        """Every figure of original and emitted, in groups."""
        return [self._times(), *self._vibrations(), *self._contours(), self._orbits(), self._feeds(), self._sizes()]

    def _times(self) -> list[BeforeAfter]:
        pairs = (("cycle time", self.cycle_time_s), ("cutting time", self.cutting_time_s))
        return [BeforeAfter(name, "s", pair.original, pair.emitted, 3) for name, pair in pairs]

    def _vibrations(self) -> Iterator[list[BeforeAfter]]:
        for key, name in _VIBRATIONS.items():
            both: Pair[Xyz[float]] = getattr(self, key)
            yield [
                BeforeAfter(
                    f"{name} {axis.upper()}",
                    "µm",
                    both.original[axis],
                    both.emitted[axis],
                    limit=self.residual_limit_um(axis) if name.startswith("residual") else None,
                )
                for axis in "xyz"
                if both.original[axis] or both.emitted[axis]
            ]

    def residual_limit_um(self, axis: str) -> float | None:
        """Limit of the region with the largest emitted residual, the one that is shown.

        Args:
            axis: "x", "y" or "z".

        Returns:
            The limit; None: nothing was shaped.
        """
        worst = max(self.regions, key=lambda each: each.residual_vibration_um.emitted[axis], default=None)
        return None if worst is None else worst.residual_limit_um[axis]

    def _contours(self) -> Iterator[list[BeforeAfter]]:
        for track, name in CONTOURS.items():
            both: Pair[ContourError] = getattr(self.contour_error_um, track)
            rows = []
            for statistic, suffix in _DEVIATIONS.items():
                original, emitted = getattr(both.original, statistic), getattr(both.emitted, statistic)
                if original is not None and emitted is not None:
                    judged = (track, statistic) == (self.limits.contour_target, "max")
                    limit = self.limits.contour_um if judged else None
                    rows.append(BeforeAfter(f"{name}, {suffix}", "µm", original, emitted, limit=limit))
            yield rows

    def _orbits(self) -> list[BeforeAfter]:
        errors = self.orbit_error_percent
        if not errors:
            return []
        name = "orbit error" if len(errors) == 1 else f"largest orbit error of {len(errors)} arcs"
        return [BeforeAfter(name, "%", None, max(errors, key=abs), 4)]

    def _feeds(self) -> list[BeforeAfter]:
        if self.feed_excess is None:
            return []
        above = max(0.0, self.feed_excess.ratio - 1.0) * 100.0
        return [
            BeforeAfter(
                "speed above the programmed feed", "%", None, above, limit=self.limits.feed_excess_ratio * 100.0
            )
        ]

    def _sizes(self) -> list[BeforeAfter]:
        """Figures of the emitted program and its shaper."""
        rows = [
            BeforeAfter("blocks", "", self.blocks.read, self.blocks.emitted, 0),
            BeforeAfter("size of the program", "bytes", self.bytes_read, self.bytes_emitted, 0),
            BeforeAfter("block period", "ms", None, self.block_period_s * 1e3, 3),
        ]
        if self.budget is not None:
            rows.append(BeforeAfter("regions given up for the budget", "", None, len(self.budget.given_up), 0))
        rows.append(BeforeAfter("duration of the shaper", "ms", None, self.shaper.duration_s * 1e3, 3))
        if self.shaper.per_axis_duration_s:
            shorter_ms = self.shaper.per_axis_duration_s * 1e3
            rows.append(BeforeAfter("with one for each axis (--per-axis)", "ms", None, shorter_ms, 3))
        return rows

    def plots(self) -> Mapping[str, Plot]:
        """`path`, `feed` and `vibration` of the region that vibrates most, before and after."""
        return self._drawn_beside()

    @property
    def light(self) -> tuple[Light, str]:
        """Colour of the traffic light on its page, and the reason."""
        found: tuple[Light, str] = self._beside("page").light_of(self)
        return found

    def page(self, **options: Any) -> Page:
        """The conversion as a page, see `Result.page`; the emitted program stands there with its verdict.

        Args:
            options: of `Result.page`.

        Returns:
            The page, as data.

        Raises:
            MachineError, NumericError: a program cannot be played.
        """
        page = super().page(**options)
        if page.scene is None or self.from_json:
            return page
        # It was read back before it had one.
        *others, last = page.scene.variants
        told = replace(last, text=self.text.decode("utf-8", "replace"))
        return replace(page, scene=replace(page.scene, variants=(*others, told)))

    def page_sections(self, made: Made | None = None) -> tuple[Section, ...]:
        """What it gains, what that rests on, where the time goes, and the operator's run sheet.

        Args:
            made: of what it was made; None: it is not known.

        Returns:
            The sections.
        """
        found: tuple[Section, ...] = self._beside("page").sections_of(self, made)
        return found
