"""The dialect's canonical moves as those that the player and the plant take."""

from __future__ import annotations

import numpy as np

from ..records import Move
from .items import Item


def as_move(item: Item) -> Move:
    """A rapid, a line or an arc; not a dwell."""
    assert item.kind != "dwell"
    # What is not commanded does not move, also where nobody knows its place.
    delta = np.where(np.isnan(item.start) & np.isnan(item.end), 0.0, item.end - item.start)
    if item.kind != "arc":
        return Move(item.kind, item.line, item.start, item.end, delta, feed=item.feed)
    assert item.centre is not None
    offset = item.centre - item.start
    offset[item.axes[2]] = 0.0
    end_radius = float(np.hypot(*(item.flat(item.end) - item.flat(item.centre))))
    return Move(
        "arc", item.line, item.start, item.end, delta, feed=item.feed, centre=item.centre, centre_offset=offset,
        radius=item.radius, end_radius=end_radius, sweep=item.sweep, normal_axis=item.axes[2],
    )  # fmt: skip
