"""Load along a path: force, torque, power and deflection at the feed that the machine really runs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields

import numpy as np

from shapegcode import _core
from shapegcode.cutting.tool import Tool
from shapegcode.feed.plan import FeedPlan, goes_on, limits_of
from shapegcode.feed.travel import Mover, Travelled, Vector
from shapegcode.feed.walk import SurveyedMove, SurveyedRegion
from shapegcode.machine import Machine
from shapegcode.results.result import Pair

__all__ = ["LOADS", "Load", "PathLoad", "exceeded", "load_of", "move_load", "region_load"]

_SLACK = 1e-3  # of a limit: what its own search and the rounding of a figure may be off by
_IN_WORDS = {  # column of Load, which is the name of its limit in the core: name and unit for people
    "peak_resultant_n": ("peak resultant", "N"),
    "mean_resultant_n": ("mean resultant", "N"),
    "peak_deflection_um": ("deflection", "µm"),
    "peak_torque_nm": ("torque", "N m"),
    "mean_power_w": ("power", "W"),
}

LOADS = tuple(_IN_WORDS)
"""Names of what is limited: columns of `Load`."""


@dataclass(frozen=True)
class Load:
    """Load along a path, one value per station, (n,); the feed is what the machine really runs.

    Attributes:
        feed_mm_per_min: largest on the stretch before the station.
        time_s: on that stretch.
        mean_resultant_n: mean of the XY resultant over one revolution.
        peak_resultant_n: largest.
        peak_torque_nm: largest torque.
        mean_power_w: mean power.
        peak_deflection_um: largest deflection of the tip.
    """

    feed_mm_per_min: Vector
    time_s: Vector
    mean_resultant_n: Vector
    peak_resultant_n: Vector
    peak_torque_nm: Vector
    mean_power_w: Vector
    peak_deflection_um: Vector

    @classmethod
    def in_a_row(cls, loads: Sequence[Load]) -> Load:
        """One behind the other."""
        names = [field.name for field in fields(cls)]
        return cls(**{name: np.concatenate([getattr(load, name) for load in loads]) for name in names})


@dataclass(frozen=True)
class PathLoad(Pair[Load]):
    """Load along a path, `original` and `emitted`.

    Attributes:
        s_mm: the stations, along the path, (n,).
    """

    s_mm: Vector


def region_load(
    part: SurveyedRegion, plan: FeedPlan | None, written: _core.Path, machine: Machine, *, before: Mover, after: Mover
) -> PathLoad | None:
    """Load along a region as programmed and as written; None where engagement or spindle speed are not known."""
    if part.track is None or part.tool is None or not part.spindle_rev_per_min > 0.0 or len(part.track) == 0:
        return None
    stations = np.asarray(part.track.s_mm)
    window_s = 60.0 / (part.tool.tool.flutes * part.spindle_rev_per_min)
    was = load_of(part, before.travel(part.region.path, part.region.path, stations, window_s))
    if plan is None and before is after:
        return PathLoad(was, was, stations)
    travelled = after.travel(written, part.region.path, stations, window_s)
    return PathLoad(was, load_of(part, travelled), stations)


def move_load(move: SurveyedMove) -> PathLoad | None:
    """Load along a move outside of the regions at its programmed feed; None without a spindle speed."""
    if not move.spindle_rev_per_min > 0.0:
        return None
    stations = np.asarray(move.track.s_mm)
    times = np.diff(np.concatenate(([0.0], stations))) / move.feed_mm_per_min * 60.0
    load = load_of(move, Travelled(np.full(len(stations), move.feed_mm_per_min), times))
    return PathLoad(load, load, stations)


def load_of(part: SurveyedRegion | SurveyedMove, travelled: Travelled) -> Load:
    """Load along a region, or along a move outside of them."""
    assert part.tool is not None and part.track is not None
    # What a station meets is met with the feed of the stretch before it and of the one behind it.
    feeds = travelled.feed_mm_per_min.copy()
    feeds[:-1] = np.where(goes_on(part.track), np.maximum(feeds[:-1], feeds[1:]), feeds[:-1])
    force = part.tool.force(part.spindle_rev_per_min, part.sense)
    figures = force.figures_of(part.track, feeds, part.tool.beam())
    return Load(travelled.feed_mm_per_min, travelled.time_s, **{name: figures[name] for name in LOADS})


def exceeded(tool: Tool, load: Load, machine: Machine) -> Iterator[tuple[str, str, str, float]]:
    """Column, name, unit and limit of what a load exceeds."""
    limits = limits_of(tool, machine, 0.0)
    for column, (words, unit) in _IN_WORDS.items():
        limit = getattr(limits, column)
        if np.isfinite(limit) and (getattr(load, column) > limit * (1.0 + _SLACK)).any():
            yield column, words, unit, limit
