"""Gaps between cuts in which rapids may be replaced, and what that does to the time until the next cut can begin."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, Future
from dataclasses import dataclass

from shapegcode import _core
from shapegcode.conversion.rapids.candidates import Gap, Rapid
from shapegcode.conversion.rapids.plant import RapidPlant, Timing
from shapegcode.conversion.region_text import EmittedRegion
from shapegcode.verdict.figures import RegionVerdict

__all__ = ["NO_GAIN", "Choice", "OpenGap"]

NO_GAIN = "no time gained"


@dataclass
class Choice:
    """A rapid that may be replaced, and what is known of it."""

    rapid: Rapid
    region: _core.Region
    before: Timing
    original: Future[_core.PlaybackFigures]
    shaped: EmittedRegion | None = None
    text: bytes = b""
    after: Timing | None = None
    slowed_blocks: int = 0
    verdict: RegionVerdict | None = None

    @property
    def extra_bytes(self) -> int:
        """What the replacement adds to the text."""
        return len(self.text) - (self.region.text_end - self.region.text_begin)


class OpenGap:
    """A gap in which rapids may be replaced, and what that does to the time until the next cut can begin."""

    def __init__(self, gap: Gap, plant: RapidPlant, pool: Executor, least_gain_s: float) -> None:
        self._plant = plant
        self._least_gain_s = least_gain_s
        self._steps = [plant.pause(step) if isinstance(step, float) else plant.rapid(step) for step in gap.steps]
        self.choices: list[Choice] = []
        self._at: list[int] = []
        regions = [step.region for step in gap.steps if not isinstance(step, float) and step.region is not None]
        if not regions:
            return
        self._region = regions[-1]
        clock_s = math.fsum(step.clock_s for step in self._steps)
        self._before_s = plant.ready_s(self._steps, self._region)
        if self._before_s < clock_s + least_gain_s:
            return
        end_s = 0.0
        for at, (step, timing) in enumerate(zip(gap.steps, self._steps, strict=True)):
            end_s += timing.clock_s
            if isinstance(step, float) or step.region is None or timing.settling_s <= 0.0:
                continue
            if clock_s - end_s < plant.longest_memory_s:
                original = pool.submit(plant.play_original, step)
                self.choices.append(Choice(step, step.region, timing, original))
                self._at.append(at)

    def _ready_s(self, shaped: Sequence[bool]) -> float:
        """Time from the last cut until the next one finds the table settled, s."""
        steps = list(self._steps)
        for at, choice, is_shaped in zip(self._at, self.choices, shaped, strict=True):
            if is_shaped and choice.after is not None:
                steps[at] = choice.after
        return self._plant.ready_s(steps, self._region)

    def saved_s(self) -> float:
        """What the replacements that are left save, s."""
        flags = [bool(choice.text) for choice in self.choices]
        return self._before_s - self._ready_s(flags) if any(flags) else 0.0

    def extra_bytes(self) -> int:
        """What they add to the text."""
        return sum(choice.extra_bytes for choice in self.choices if choice.text)

    def drop(self, reason: str, kept: Counter[str], condition: Callable[[Choice], bool]) -> None:
        """Keep the rapids that meet a condition."""
        for choice in self.choices:
            if condition(choice) and choice.text:
                choice.text = b""
                kept[reason] += 1

    def drop_useless(self, kept: Counter[str]) -> None:
        """Keep every rapid without whose replacement the next cut begins as soon; the earlier ones first."""
        # All together first: of two rapids that ring equally long, replacing one alone gains nothing.
        flags = [bool(choice.text) for choice in self.choices]
        ready_s = self._ready_s(flags)
        for k in range(len(flags)):
            if flags[k]:
                flags[k] = False
                without_s = self._ready_s(flags)
                if without_s < ready_s + self._least_gain_s:
                    ready_s = without_s
                else:
                    flags[k] = True
        if ready_s > self._before_s - self._least_gain_s:
            flags = [False] * len(flags)
        chosen = iter(flags)
        self.drop(NO_GAIN, kept, lambda _choice: not next(chosen))
