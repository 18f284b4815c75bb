"""What feeds and shaping in one go made: a conversion that also keeps the limits of the cut."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from shapegcode.conversion.result import Conversion
from shapegcode.feed.result import FeedSchedule
from shapegcode.results.result import Plot
from shapegcode.results.table import Table

__all__ = ["ScheduledConversion"]


@dataclass(frozen=True, repr=False, eq=False, kw_only=True)
class ScheduledConversion(Conversion):
    """A program with scheduled feeds, shaped; `original` is the program with these feeds, not yet shaped.

    Attributes:
        feed_schedule: the feeds; its loads of the emitted program are those of the shaped one.
    """

    feed_schedule: FeedSchedule

    @property
    def ok(self) -> bool:
        """Whether the shaped program keeps the machine's tolerances and the tool's limits."""
        return super().ok and self.feed_schedule.ok

    @property
    def answer(self) -> str:
        """The verdict on the motion and that on the cut."""
        return f"{super().answer}; {self.feed_schedule.answer}"

    @property
    def next_step(self) -> str:
        """The one thing to do next, in one sentence."""
        if self.within_tolerance and not self.feed_schedule.ok:
            return f"do not run it: {self.feed_schedule.next_step}"
        return super().next_step

    def tables(self) -> list[Table]:
        """Those of the schedule, then those of the conversion."""
        return [*self.feed_schedule.tables(), *super().tables()]

    def plots(self) -> Mapping[str, Plot]:
        """Those of the conversion and those of the schedule."""
        return {**super().plots(), **self.feed_schedule.plots()}
