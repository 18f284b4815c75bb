"""LinuxCNC's drilling cycles as FANUC's where both move alike, else move by move.

What moves: recorded from its interpreter rs274 (2.9). A row's first level and R are FANUC's; G89 feeds out to the level
of G98, G86 waits and starts the spindle again, G84 waits once, G73 and G83 come within 0.254 mm of the last depth.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from shapegcode.program.foreign.arcs import PLANES
from shapegcode.program.foreign.linuxcnc_state import AXES, CycleWords, State
from shapegcode.program.foreign.read import number_text, words_of

PECK_CLEARANCE_MM = 0.254
_NEEDS_DWELL = {820: "G82", 860: "G86", 890: "G89"}
_MAX_REPEATS = 10_000
_REVERSED = {3: 4, 4: 3}


def drill(state: State, code: int, words: Mapping[str, float], fresh: bool) -> Iterator[str]:
    """The lines of one block of a drilling cycle; the state is behind it then."""
    modes, unit = state.modes, state.unit_mm
    *plane_axes, normal = PLANES[modes.plane // 10]
    row = state.cycle
    if row is None:
        row = state.cycle = CycleWords(state.position[normal])
    incremental = modes.distance == 910
    _read_words(row, code, words, AXES[normal], fresh)
    if code in {740, 840} and row.dwell is None:
        row.dwell = state.cycle_dwell
    state.cycle_dwell = row.dwell if row.dwell is not None else state.cycle_dwell
    r, bottom = (row.r or 0.0) * unit, (row.bottom or 0.0) * unit
    if incremental:
        if row.initial is None:
            raise ValueError(f"the position of {AXES[normal].upper()} is not known, from which G91 counts")
        r, bottom = row.initial + r, row.initial + r + bottom
    if bottom > r:
        raise ValueError(f"R {r / unit:g} is below the bottom {bottom / unit:g} of the hole")
    repeats = words.get("l", 1.0)
    if repeats != int(repeats) or not 1 <= repeats <= _MAX_REPEATS:
        raise ValueError(f"L{repeats:g}: a cycle is repeated 1 to {_MAX_REPEATS} times")
    here = state.position[normal]
    initial = row.initial if row.initial is not None else here
    if modes.retract == 980 and initial is None:
        raise ValueError(f"the position of {AXES[normal].upper()} is not known, to which G98 returns")
    if initial is not None and initial < r:
        if here != r:
            yield f"G00{AXES[normal].upper()}{number_text(r / unit)}"
            state.position[normal], row.entered = r, None
        here = initial = r
    clear = r if modes.retract == 990 or initial is None else initial
    # The first hole of a block is approached at this level, straight from where the tool is.
    level = clear if modes.retract == 980 else None if here is None else max(here, r)
    lift = None if level == here else level
    for _ in range(int(repeats)):
        for axis in sorted(plane_axes):
            given = words.get(AXES[axis])
            if given is None:
                continue
            here = state.position[axis]
            if incremental and here is None:
                raise ValueError(f"the position of {AXES[axis].upper()} is not known, from which G91 counts")
            state.position[axis] = given * unit + ((here or 0.0) if incremental else 0.0)
        known = ((axis, state.position[axis]) for axis in sorted(plane_axes))
        place = words_of({AXES[axis]: value / unit for axis, value in known if value is not None})
        if lift is not None:
            yield f"G00{place}{AXES[normal].upper()}{number_text(lift / unit)}"
            state.position[normal], row.entered, lift = lift, None, None
        yield from _hole(state, code, row, place, (r, bottom, clear))
        state.position[normal] = clear


def _read_words(row: CycleWords, code: int, words: Mapping[str, float], normal: str, fresh: bool) -> None:
    """What the block says of the cycle; what it does not say holds on in a row."""
    if fresh and normal not in words:
        raise ValueError(f"a drilling cycle begins without {normal.upper()}")
    row.r = words.get("r", row.r)
    row.bottom = words.get(normal, row.bottom)
    row.peck = words.get("q", None if fresh else row.peck)
    row.dwell = words.get("p", None if fresh else row.dwell)
    if row.r is None:
        raise ValueError("a drilling cycle begins without R")
    if code in {730, 830} and (row.peck is None or row.peck <= 0.0):
        raise ValueError(f"G{code // 10} needs Q, the depth of a peck, greater than 0")
    if code in _NEEDS_DWELL and row.dwell is None:
        raise ValueError(f"{_NEEDS_DWELL[code]} needs P, the dwell in seconds")


def _hole(state: State, code: int, row: CycleWords, place: str, levels: tuple[float, float, float]) -> Iterator[str]:
    unit = state.unit_mm
    r, _, clear = levels
    normal = PLANES[state.modes.plane // 10][2]
    axis = AXES[normal].upper()
    at_r, at_bottom, at_clear = (f"{axis}{number_text(level / unit)}" for level in levels)
    dwell = row.dwell or 0.0
    begun = state.position[normal]
    if _moves_as_fanuc(code, row, levels, unit, returns_to_r=clear == r) and (
        clear == r or clear in {row.entered, begun}
    ):
        if row.entered is not None and clear not in {r, row.entered}:
            yield "G80"  # the level of G98 is that at which FANUC's row begins
            row.entered = None
        row.entered = begun if row.entered is None else row.entered
        peck = f"Q{number_text(row.peck or 0.0)}" if code in {730, 830} else ""
        wait = f"P{round(dwell * 1e3)}" if code in {820, 890} else ""
        mode = "G99" if clear == r else "G98"
        yield f"G{code // 10}{mode}{place}{at_bottom}{at_r.replace(axis, 'R', 1)}{peck}{wait}"
        return
    row.entered = None
    yield f"G00{place}" if place else "G00"
    yield f"G00{at_r}"
    if code in {730, 830}:
        for depth in _depths(row.peck or 0.0, levels, unit):
            yield f"G01{axis}{number_text(depth)}"
            if code == 830:
                yield f"G00{at_r}"
            yield f"G00{axis}{number_text(depth + PECK_CLEARANCE_MM / unit)}"
    yield f"G01{at_bottom}"
    spindle = state.modes.spindle
    if code in {840, 740}:
        yield "M05"
        yield f"M{_REVERSED.get(spindle, 4):02d}"
    if code != 850 and dwell > 0.0:
        yield f"G04X{number_text(dwell)}"
    if code == 860:
        yield "M05"
    if code == 850:
        yield f"G01{at_r}"
    yield f"G01{at_clear}" if code in {740, 840, 890} else f"G00{at_clear}"
    if code in {840, 740}:
        yield "M05"
    if code in {840, 740, 860}:
        yield f"M{spindle:02d}"


def _depths(peck: float, levels: tuple[float, float, float], unit: float) -> Iterator[float]:
    """Where the pecks before the last one end, in the program's unit, summed up as LinuxCNC does."""
    depth, bottom = levels[0] / unit - peck, levels[1] / unit
    while depth > bottom:
        yield depth
        depth -= peck


def _moves_as_fanuc(
    code: int, row: CycleWords, levels: tuple[float, float, float], unit: float, *, returns_to_r: bool
) -> bool:
    """Whether FANUC's cycle of the same number makes the same moves and waits."""
    dwell = row.dwell or 0.0
    if code in {730, 830}:
        # Depths are summed up: the last peck may be one more than the division says, of next to nothing.
        peck = row.peck or 0.0
        count = math.ceil((levels[0] - levels[1]) / unit / peck)
        return peck * unit > PECK_CLEARANCE_MM and len([*_depths(peck, levels, unit)]) == count - 1
    if code in {840, 740}:
        return dwell == 0.0 and returns_to_r
    if code in {820, 890}:  # FANUC's P is whole milliseconds
        return abs(dwell * 1e3 - round(dwell * 1e3)) < 1e-9 and (code == 820 or returns_to_r)
    return code in {810, 850}
