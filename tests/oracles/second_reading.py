"""What the package reads of a program beside what the independent judge plays: move by move."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np

import shapegcode as sg
from acceptance import MOVE_KINDS, moves_of
from judge.dialect import Item, play
from judge.dialect.moves import as_move

__all__ = ["compare", "read_moves"]

PLACE_MM = 1e-4
#: What coordinate modes and compensation come to is written in least increments, as the plain program needs it.
WRITTEN_MM = {False: 0.0005 + 1e-6, True: 0.00127 + 1e-6}


def read_moves(text: str, machine: sg.Machine) -> list[tuple[Any, float]]:
    return moves_of(sg.Program.from_text(text, machine, source="dialect.nc"))


def played_moves(text: str, **settings: Any) -> list[Item]:
    """The judge's moves without those that lead nowhere; what starts or ends at an unknown place counts as such."""
    out = []
    for item in play(text, **settings):
        step = np.nan_to_num(item.end - item.start)
        if item.dwell_s > 0.0 or item.kind == "arc" or np.hypot(np.hypot(step[0], step[1]), step[2]) > 1e-9:
            out.append(item)
    return out


def place_tolerance(text: str) -> float:
    """1e-4 mm for programmed places, half a least increment for computed ones."""
    computed = re.search(r"G(16|51|51\.1|68|41|42)(?!\d)|,[RC]", text)
    return WRITTEN_MM[bool(re.search(r"G20(?!\d)", text))] if computed else PLACE_MM


def difference(item: Item, segment: Any, dwell: float, place_mm: float) -> str:
    """What is not the same, in words; empty where nothing is."""
    if item.kind == "dwell":
        return "" if math.isclose(dwell, item.dwell_s, abs_tol=1e-9) else f"dwell {dwell}, judged {item.dwell_s}"
    if dwell > 0.0:
        return f"a dwell of {dwell} s, judged a {item.kind}"
    # An arc that rounding makes as flat as a line may be written as one.
    flat = item.kind == "arc" and item.radius * (1.0 - math.cos(0.5 * item.sweep)) < 0.5 * place_mm
    is_flat = flat and MOVE_KINDS[segment.kind] == "line" and place_mm > PLACE_MM
    if MOVE_KINDS[segment.kind] != item.kind and not is_flat:
        return f"{MOVE_KINDS[segment.kind]}, judged {item.kind}"
    known = ~np.isnan(item.end)
    if np.any(np.abs(segment.end_mm - item.end)[known] > place_mm):
        return f"ends at {segment.end_mm}, judged {item.end}"
    if item.kind == "arc" and not is_flat:
        assert item.centre is not None
        a, b, normal = item.axes
        if segment.normal != normal:
            return f"turns about axis {segment.normal}, judged {normal}"
        off = np.abs(np.asarray(segment.centre_mm) - item.centre)
        # The end points' rounding moves the centre of a short arc by more than theirs.
        slack = place_mm * max(2.0, 2.0 / min(1.0, abs(item.sweep)) ** 2)
        if max(off[a], off[b]) > slack:
            return f"centre {segment.centre_mm}, judged {item.centre}"
        if abs(segment.sweep_rad - item.sweep) > 4.0 * slack / item.radius + 1e-9:
            return f"sweep {segment.sweep_rad}, judged {item.sweep}"
    feed = segment.feed_mm_per_s * 60.0
    if item.kind != "rapid" and not math.isclose(feed, item.feed, rel_tol=1e-6, abs_tol=1e-6):
        return f"feed {feed}, judged {item.feed}"
    return ""


def compare(text: str, machine: sg.Machine, place_mm: float | None = None, **settings: Any) -> None:
    """Every move and dwell in order; a difference is an AssertionError.

    Where places are computed, what is shorter than the rounding of its end points may be there or not.
    """
    judged, read = played_moves(text, **settings), read_moves(text, machine)
    place_mm = place_tolerance(text) if place_mm is None else place_mm
    optional_mm = 4.0 * place_mm if place_mm > PLACE_MM else 0.0
    i = j = 0
    while i < len(judged) and j < len(read):
        (segment, dwell), item = read[j], judged[i]
        wrong = difference(item, segment, dwell, place_mm)
        if not wrong:
            i, j = i + 1, j + 1
        elif item.kind != "dwell" and as_move(item).length < optional_mm:
            i += 1
        elif dwell == 0.0 and segment.length_mm < optional_mm:
            j += 1
        else:
            raise AssertionError(f"move {j} of source line {item.line}: {wrong}")
    left = [as_move(item).length for item in judged[i:] if item.kind != "dwell"]
    left += [segment.length_mm for segment, _dwell in read[j:]]
    assert all(length < optional_mm for length in left), f"{len(read)} moves, judged {len(judged)}"
