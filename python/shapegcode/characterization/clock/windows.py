"""How far a model's clock runs apart from a log's, over stretches of a second, some seconds, and a whole section.

A control reports its line a few times a second: the time at which one is first seen is late by up to one reading. What
a stretch of the log takes is therefore known to a reading or two, whatever its length; the model's error grows with it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from shapegcode import _core
from shapegcode.characterization.clock.observed import ObservedRun
from shapegcode.characterization.clock.played import PlayedProgram

__all__ = ["SectionClock", "clocks_of", "line_starts", "misfit", "section_residuals"]

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

#: (length of the stretches in s, error beyond which it counts no more in s, weight).
_SCALES = ((1.0, 0.25, 1.0), (6.0, 0.5, 0.7), (30.0, 1.0, 0.5))
_SECTION = (2.0, 0.5)  # of whole sections: error per half minute in s beyond which it counts no more, weight
_LEAST_READINGS = 10


@dataclass(frozen=True, eq=False)
class SectionClock:
    """One section of a run: what was seen of it.

    Attributes:
        run: which.
        lines: first and last line.
        feed_override: ratio.
        time_s: (n,) when its lines were seen.
        line: (n,) which.
    """

    run: ObservedRun
    lines: tuple[int, int]
    feed_override: float
    time_s: FloatArray
    line: npt.NDArray[np.int64]

    @cached_property
    def stretches(self) -> tuple[tuple[IntArray, IntArray], ...]:
        """For each length of a stretch: readings at which one begins, and those at which it ends."""
        found = []
        for length_s, _, _ in _SCALES:
            upto = np.searchsorted(self.time_s, self.time_s + length_s)
            begins = np.flatnonzero(upto < len(self.time_s))
            found.append((begins, upto[begins]))
        return tuple(found)


def clocks_of(runs: Sequence[ObservedRun], least: int = _LEAST_READINGS) -> list[SectionClock]:
    """The sections of runs of which enough was seen."""
    found = []
    for run in runs:
        for stretch in run.stretches:
            inside = (run.line >= stretch.lines[0]) & (run.line <= stretch.lines[1])
            if int(inside.sum()) >= least:
                found.append(
                    SectionClock(run, stretch.lines, stretch.feed_override, run.time_s[inside], run.line[inside])
                )
    return found


def line_starts(played: PlayedProgram, model: _core.ControllerModel) -> FloatArray:
    """(line_count + 2,) When each line begins on a model; the last entry is the end of the program."""
    starts = played.starts(model)
    # A line without any move begins with the next one.
    missing = np.isnan(starts)
    following = np.minimum.accumulate(np.where(missing, len(starts), np.arange(len(starts)))[::-1])[::-1]
    return np.asarray(starts[following], dtype=np.float64)


class _Starts:
    """Line starts of a model by program and overrides, each played once."""

    def __init__(self, model: _core.ControllerModel) -> None:
        self._model = model
        self._found: dict[tuple[int, float, float], FloatArray] = {}

    def of(self, run: ObservedRun, feed_override: float) -> FloatArray:
        key = (id(run.played), feed_override, run.rapid_override)
        if key not in self._found:
            self._model.feed_override = feed_override
            self._model.rapid_override = run.rapid_override
            self._found[key] = line_starts(run.played, self._model)
        return self._found[key]


def section_residuals(clocks: Sequence[SectionClock], model: _core.ControllerModel) -> list[FloatArray]:
    """What was seen minus what the model says, in s, for each reading of each section."""
    starts = _Starts(model)
    return [clock.time_s - starts.of(clock.run, clock.feed_override)[clock.line] for clock in clocks]


def misfit(clocks: Sequence[SectionClock], model: _core.ControllerModel) -> float:
    """How badly a model keeps the time of sections: every program counts alike, outliers (holds) count to a limit."""
    square: dict[int, FloatArray] = {}
    count: dict[int, FloatArray] = {}
    for clock, residual in zip(clocks, section_residuals(clocks, model), strict=True):
        key = id(clock.run.played)
        sums = square.setdefault(key, np.zeros(len(_SCALES) + 1))
        counts = count.setdefault(key, np.zeros(len(_SCALES) + 1))
        for scale, (_, limit_s, _) in enumerate(_SCALES):
            begins, ends = clock.stretches[scale]
            apart = residual[ends] - residual[begins]
            sums[scale] += np.minimum(apart**2, limit_s**2).sum()
            counts[scale] += len(apart)
        whole = np.median(residual[-4:]) - np.median(residual[:4])
        whole /= max(1.0, np.sqrt((clock.time_s[-1] - clock.time_s[0]) / 30.0))
        sums[-1] += min(whole**2, _SECTION[0] ** 2)
        counts[-1] += 1
    weight = np.array([*(scale[2] for scale in _SCALES), _SECTION[1]])
    return float(
        np.mean([(np.sqrt(square[key] / np.maximum(count[key], 1.0)) * weight).sum() for key in square])
        if square
        else 0.0
    )
