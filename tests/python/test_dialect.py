"""Programs in the full dialect: what the package reads against what the independent judge plays."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import HealthCheck, given, settings

import shapegcode as sg
from acceptance import MOVE_KINDS, machine_with, moves_of
from judge.dialect import Alarm, Item, play
from judge.dialect.generate import compensated_programs, coordinate_programs, macro_programs

Vector = npt.NDArray[np.float64]
DIALECT = Path(__file__).parents[1] / "golden" / "dialect"
NAMES = sorted(path.stem for path in DIALECT.glob("*.nc"))
#: The block skip switch is a setting; programs that have `/` are read with it off and on.
SKIPPING = [name for name in NAMES if "/" in (DIALECT / f"{name}.nc").read_text() and name.startswith("block_skip")]
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
    if MOVE_KINDS[segment.kind] != item.kind:
        return f"{MOVE_KINDS[segment.kind]}, judged {item.kind}"
    known = ~np.isnan(item.end)
    if np.any(np.abs(segment.end_mm - item.end)[known] > place_mm):
        return f"ends at {segment.end_mm}, judged {item.end}"
    if item.kind == "arc":
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
    judged, read = played_moves(text, **settings), read_moves(text, machine)
    place_mm = place_tolerance(text) if place_mm is None else place_mm
    if place_mm > PLACE_MM:
        # What is shorter than the rounding of its end points may or may not be there.
        judged = [
            item
            for item in judged
            if item.kind in ("arc", "dwell") or not math.dist(item.start, item.end) < 3 * place_mm
        ]
        read = [(move, dwell) for move, dwell in read if dwell > 0.0 or move.length_mm >= 3 * place_mm]
    for k, (item, (segment, dwell)) in enumerate(zip(judged, read, strict=False)):
        wrong = difference(item, segment, dwell, place_mm)
        assert not wrong, f"move {k} of source line {item.line}: {wrong}"
    assert len(read) == len(judged), f"{len(read)} moves, judged {len(judged)}; next {judged[len(read) :][:1]}"


@pytest.mark.parametrize("name", [name for name in NAMES if name not in SKIPPING])
def test_read_as_judged(name: str) -> None:
    compare((DIALECT / f"{name}.nc").read_text(), machine_with())


@pytest.mark.parametrize("name", SKIPPING)
@pytest.mark.parametrize("switch", ["on", "off"])
def test_block_skip(name: str, switch: str) -> None:
    on = frozenset(range(1, 10)) if switch == "on" else frozenset()
    compare((DIALECT / f"{name}.nc").read_text(), machine_with({"input.block_skip": switch}), switches=on)


# ---- programs at random ----------------------------------------------------------------------------------------------

RANDOM = settings(max_examples=150, deadline=None, suppress_health_check=list(HealthCheck))
MACHINE = machine_with()


@RANDOM
@given(text=macro_programs())
def test_random_macro_programs(text: str) -> None:
    try:
        play(text)
    except Alarm as alarm:
        with pytest.raises(sg.ProgramError) as caught:
            read_moves(text, MACHINE)
        # The judge leaves out what is no alarm of arithmetic.
        assert (caught.value.line, f"(alarm {alarm.alarm:04d})" in str(caught.value)) == (alarm.line, True), str(alarm)
        return
    # A computed word that lies on the half of an increment may go either way by the last bit of its value.
    compare(text, MACHINE, place_mm=1.001e-3)


@RANDOM
@given(text=coordinate_programs())
def test_random_coordinate_modes_and_cycles(text: str) -> None:
    compare(text, MACHINE, place_mm=1.001e-3)


@RANDOM
@given(text=compensated_programs())
def test_random_compensation(text: str) -> None:
    # The rounded end of an arc is up to 0.7 µm off its circle, which a corner of 30 degrees makes 1.4 µm.
    compare(text, MACHINE, place_mm=2.5e-3)
