"""What the tests do: parts of equal moves, the box they stay in, and the values they are drawn up for.

A test is one program. A part of it is a number of equal moves on one axis that go out and come back, so that every
program ends where it began. The fit needs only these facts, which ``RESULTS.toml`` repeats.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

from shapegcode.errors import ArgumentError

__all__ = ["AXES", "AirBox", "AirTest", "BlockEnd", "Kind", "Part", "Pattern", "Step", "check", "steps"]

AXES = ("X", "Y", "Z")
BlockEnd = Literal["ceil", "carry"]
"""What becomes of the rest of a period at the end of a block."""
Kind = Literal["stopwatch", "log"]
Pattern = Literal["pause", "continuous", "dwell", "exact", "rapid", "feed_steps"]
_LARGEST_BOX_MM = 10_000.0


@dataclass(frozen=True)
class AirBox:
    """Where the tests may move, relative to the point at which the operator starts them.

    Attributes:
        low: smallest X, Y, Z in mm, 0 or below.
        high: largest X, Y, Z in mm, 0 or above.
    """

    low: tuple[float, float, float] = (0.0, 0.0, 0.0)
    high: tuple[float, float, float] = (100.0, 100.0, 20.0)

    @classmethod
    def parse(cls, text: str) -> AirBox:
        """Read ``X0:X1,Y0:Y1,Z0:Z1`` in mm from the start point, for example ``0:100,-50:50,0:20``."""
        number = r"([-+]?\d+(?:\.\d*)?)"
        found = re.fullmatch(",".join([rf"\s*{number}:{number}\s*"] * 3), text)
        if not found:
            raise ArgumentError(f"--box {text}: must be X0:X1,Y0:Y1,Z0:Z1 in mm from the start point")
        values = [float(word) for word in found.groups()]
        for axis, low, high in zip(AXES, values[::2], values[1::2], strict=True):
            if not low <= 0.0 <= high or low == high:
                raise ArgumentError(
                    f"--box {text}: {axis} from {low:g} to {high:g} mm does not hold the start point, which is 0"
                )
            if max(-low, high) > _LARGEST_BOX_MM:
                raise ArgumentError(f"--box {text}: {axis} reaches {max(-low, high):g} mm, the limit is 10000")
        return cls(tuple(values[::2]), tuple(values[1::2]))  # type: ignore[arg-type]

    def travel_mm(self, axis: str) -> float:
        """Signed way from the start point to the farther side, in mm."""
        index = AXES.index(axis)
        low, high = self.low[index], self.high[index]
        return high if high >= -low else low

    def __str__(self) -> str:
        """As :meth:`parse` reads it."""
        return ",".join(f"{low:g}:{high:g}" for low, high in zip(self.low, self.high, strict=True))


@dataclass(frozen=True)
class Part:
    """A number of equal moves on one axis.

    Attributes:
        pattern: ``continuous``: cutting moves that overlap; ``dwell``: a dwell after each; ``exact``: exact stop (G61)
            after each; ``rapid``: G00; ``feed_steps``: cutting moves, alternately at the feed and at half of it;
            ``pause``: one dwell, no motion.
        axis: X, Y or Z.
        count: number of moves.
        length_mm: length of a move, negative if the first goes in the negative direction.
        feed_mm_per_min: cutting feed; the rapid rate at 100 % for a rapid, as the machine file has it.
        stride: moves in one direction before the direction turns.
        dwell_s: dwell after each move (``dwell``), or the pause.
    """

    pattern: Pattern
    axis: str = "X"
    count: int = 1
    length_mm: float = 0.0
    feed_mm_per_min: float = 0.0
    stride: int = 1
    dwell_s: float = 0.0

    @property
    def duration_s(self) -> float:
        """Length over feed of one move, in s, at 100 % override."""
        return abs(self.length_mm) / self.feed_mm_per_min * 60.0 if self.feed_mm_per_min else 0.0


@dataclass(frozen=True)
class AirTest:
    """One run of one program.

    Attributes:
        name: of the test, as in ``RESULTS.toml``.
        number: O number of its program.
        kind: ``stopwatch``: timed from start to end; ``log``: recorded by the control.
        purpose: what it is for, in one line.
        parts: what it does.
        override_percent: feed override at which it is run.
    """

    name: str
    number: int
    kind: Kind
    purpose: str
    parts: tuple[Part, ...]
    override_percent: int = 100

    @property
    def program(self) -> str:
        """Name of the program's file."""
        return f"O{self.number:04d}.nc"


@dataclass(frozen=True)
class Step:
    """One block of a part: a move, or a dwell where ``length_mm`` is 0.

    Attributes:
        length_mm: signed length of the move.
        feed_mm_per_min: its feed; 0 for a rapid and for a dwell.
        dwell_s: dwell.
    """

    length_mm: float
    feed_mm_per_min: float
    dwell_s: float = 0.0


def steps(part: Part) -> Iterator[Step]:
    """The blocks of a part in their order."""
    if part.pattern == "pause":
        yield Step(0.0, 0.0, part.dwell_s)
        return
    for index in range(part.count):
        sign = 1 if index // part.stride % 2 == 0 else -1
        slow = part.pattern == "feed_steps" and index % 2 == 1
        feed = 0.0 if part.pattern == "rapid" else part.feed_mm_per_min * (0.5 if slow else 1.0)
        yield Step(sign * part.length_mm, feed)
        if part.pattern == "dwell":
            yield Step(0.0, 0.0, part.dwell_s)


def check(test: AirTest, box: AirBox) -> None:
    """Make sure that a test stays inside the box and ends where it began."""
    at = dict.fromkeys(AXES, 0.0)
    for part in test.parts:
        index = AXES.index(part.axis)
        for step in steps(part):
            at[part.axis] += step.length_mm
            place = at[part.axis]
            if not box.low[index] - 1e-6 <= place <= box.high[index] + 1e-6:
                raise ArgumentError(
                    f"test {test.name}: {part.axis} would go to {place:.3f} mm, the box is "
                    f"{box.low[index]:g} to {box.high[index]:g} mm"
                )
    if not all(math.isclose(place, 0.0, abs_tol=1e-6) for place in at.values()):
        raise ArgumentError(f"test {test.name} would not end where it began: {at}")
