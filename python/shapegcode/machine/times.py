"""What takes time beside the motion: tool changes, M codes, the spindle, ways that the program does not tell."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Self

from pydantic import Field, Strict, model_validator

from shapegcode.settings.keys import AxisTimes, Bool, InlineTable, NonNegative, Positive, TomlTable, key

Seconds = Annotated[NonNegative, Field(le=3600)]


class MCodeTimes(InlineTable):
    """Times of single M codes."""

    code: tuple[Annotated[int, Strict(), Field(ge=0, le=99_999_999)], ...] = key("M codes")
    s: tuple[Seconds, ...] = key("their times", unit="s")

    @model_validator(mode="after")
    def _match(self) -> Self:
        if len(self.code) != len(self.s) or len(set(self.code)) != len(self.code):
            raise ValueError(f"{len(self.s)} times for {len(set(self.code))} M codes: one for each code is needed")
        return self


class SpindleTimes(InlineTable):
    """Time that the spindle needs, by its speed: linear between the rows, and from 0 below the first."""

    rpm: tuple[Positive, ...] = key("speeds, ascending", unit="1/min")
    s: tuple[Seconds, ...] = key("times", unit="s")

    @model_validator(mode="after")
    def _match(self) -> Self:
        if len(self.rpm) != len(self.s) or not self.rpm:
            raise ValueError(f"{len(self.s)} times for {len(self.rpm)} speeds: one for each speed is needed")
        if any(after <= before for before, after in pairwise(self.rpm)):
            raise ValueError(f"rpm = {list(self.rpm)}: must ascend")
        return self

    @property
    def rows(self) -> list[tuple[float, float]]:
        """(speed in 1/min, time in s)."""
        return list(zip(self.rpm, self.s, strict=True))


class Times(TomlTable):
    """What takes time beside the motion."""

    program_start_s: Seconds = key("from the start key to the first block", unit="s", default=0.0, assumed=True)
    last_tool_in_spindle: Bool = key(
        "parts are made in series: the last tool of a program is in the spindle when it starts anew, and an M06 that "
        "calls it changes nothing; false: every M06 changes",
        default=False,
        assumed=True,
    )
    feed_override_percent: Annotated[Positive, Field(le=200)] = key(
        "override of the feed at which this shop usually runs; `time` counts with it unless it is told another",
        unit="%",
        default=100.0,
        assumed=True,
    )
    rapid_override_percent: Annotated[Positive, Field(le=200)] = key(
        "the same of rapids", unit="%", default=100.0, assumed=True
    )
    tool_change_s: Seconds = key("an M06", unit="s", default=0.0, assumed=True)
    m_function_s: Seconds = key("any other M code that m_codes does not name", unit="s", default=0.0, assumed=True)
    m_codes: MCodeTimes | None = key(
        "M codes with a time of their own, { code = [1, 8], s = [0.3, 5.1] }; left out: none", default=None
    )
    spindle_start: SpindleTimes | None = key(
        "time in which the spindle comes from rest to a speed, { rpm = [5000, 12000], s = [1.0, 7.3] }; it passes "
        "while the axes move, and what is left is waited for before the next M code or cut; left out: none",
        default=None,
    )
    spindle_stop: SpindleTimes | None = key(
        "likewise to rest behind M05; what is left is waited for by M00, M01, M02, M30, M06 and the next M03; left "
        "out: none",
        default=None,
    )
    unknown_move_s: AxisTimes = key(
        "a rapid of an axis on a way of which the program does not tell start or end: G28, G30, G53, and the first one "
        "behind them or behind M06. One number, or x, y, z",
        unit="s",
        default=0.0,
        assumed=True,
    )
