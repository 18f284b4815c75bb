"""State of a SINUMERIK program: modes, frames, positions, and the moves that it writes.

Sources: frames easymanua.ls 662598 p. 56 and 1265481 p. 309; incremental moves behind them 32519 p. 729; inch 592300
p. 139; polar coordinates 1265481 pp. 174, 175; FLIN 662833 p. 458; chamfers 679150 pp. 193, 194.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from shapegcode.machine import Machine
from shapegcode.program.foreign import arcs
from shapegcode.program.foreign.arcs import PLANES, Element, Vector, flat
from shapegcode.program.foreign.read import PlainProgram, number_text
from shapegcode.program.foreign.siemens_expressions import AtColumn, WordError

_FLIN_ERROR_MM = 0.0005  # of blocks of constant feed in the place of one whose feed is linear
_MAX_SWEEP = 1.5 * math.pi  # of one arc of the plain program: its rounded ends tell it from a small one
_TANGENT = math.radians(0.05)  # two blocks that meet at less have no corner


@dataclass(frozen=True)
class SiemensFrame:
    """The programmable frame: where programmed coordinates lie in those of the work offset."""

    linear: Vector = field(default_factory=lambda: np.eye(3))
    offset: Vector = field(default_factory=lambda: np.zeros(3))

    def then(self, other: SiemensFrame) -> SiemensFrame:
        """Both, the other one in the coordinates of this one (ATRANS, AROT ...)."""
        return SiemensFrame(self.linear @ other.linear, self.offset + self.linear @ other.offset)

    @cached_property
    def is_shift(self) -> bool:
        """Whether it moves, and neither turns nor scales."""
        return bool(np.array_equal(self.linear, np.eye(3)))

    def apply(self, point: Vector) -> Vector:
        """In the coordinates of the work offset; NaN: not known."""
        return self.offset + _product(self.linear, point)

    def undo(self, point: Vector) -> Vector:
        """The inverse."""
        return _product(np.asarray(np.linalg.inv(self.linear), dtype=np.float64), point - self.offset)


def _product(matrix: Vector, point: Vector) -> Vector:
    """What is not known counts only where it is needed."""
    matrix = np.where(np.abs(matrix) < 1e-12, 0.0, matrix)
    return np.array([sum((row[k] * point[k] for k in range(3) if row[k] != 0.0), 0.0) for row in matrix])


@dataclass
class SiemensModes:
    """What is in force."""

    motion: str = ""  # G0, G1, G2, G3, CIP, CT
    plane: int = 17
    incremental: bool = False
    unit: float = 1.0  # mm of a length
    feed_unit: float = 1.0
    feed_mode: int = 94
    feed: float | None = None  # mm/min, mm/rev or 1/min
    is_linear: bool = False  # FLIN
    offset: str = ""  # G54 ...
    frame: SiemensFrame = field(default_factory=SiemensFrame)
    rounding_mm: float = 0.0  # RNDM


@dataclass
class Given(AtColumn):
    """Words of one block that say where to go; lengths in mm."""

    axes: dict[int, tuple[float, bool, int]] = field(default_factory=dict)  # value, whether from the start, column
    centre: dict[int, tuple[float, bool, int]] = field(default_factory=dict)
    middle: dict[int, tuple[float, bool, int]] = field(default_factory=dict)
    radius: float | None = None
    angle: float | None = None
    turns: int = 0
    polar: dict[str, tuple[float, str, int]] = field(default_factory=dict)  # AP, RP: value, AC or IC, column
    corner: tuple[str, float] | None = None  # RND, CHR, CHF
    start_feed: float | None = None  # that was in force before the block
    has_feed: bool = False
    exact: bool = False  # G9
    column: int = 1


@dataclass(frozen=True)
class _HeldCorner:
    """A corner whose second block is not yet known."""

    element: Element
    kind: str
    size: float
    is_modal: bool
    column: int


class SiemensPath:
    """Follows the moves of a program and writes them for FANUC."""

    def __init__(self, machine: Machine, out: PlainProgram) -> None:
        self.machine, self.out = machine, out
        self.modes = SiemensModes()
        self.at = np.full(3, math.nan)  # in the coordinates of the work offset
        self.shifted = [False] * 3  # an offset of the axis changed since it was programmed absolutely
        self.pole = np.zeros(3)
        self.polar: dict[str, float] = {}
        self._step: Vector | None = None  # along the end of the last move
        self.line, self.file = 1, 0
        self.moves = 0
        self.names: dict[str, str] = {}  # words written, and those that they stand for
        self._plane, self._mode, self._feed = 17, 94, ""
        self._corner: _HeldCorner | None = None
        self._held: list[tuple[str, int, int]] = []  # lines of the block before a corner, and behind it
        self._increment = machine.controller.least_increment_mm
        self._decimals = max(0, round(-math.log10(self._increment)))

    def put(self, text: str) -> None:
        """Write a line."""
        if self._corner is not None and not text.startswith("("):
            self._held.append((text, self.line, self.file))
        else:
            self.out.put(text, self.line, self.file)

    def note(self, text: str, key: str = "") -> None:
        """Tell something once; nothing of an empty text."""
        if text:
            self.out.note(self.line, text, key)

    # ---- frames and offsets ------------------------------------------------------------------------------------------

    def set_frame(self, frame: SiemensFrame) -> None:
        """Another programmable frame."""
        before, self.modes.frame = self.modes.frame, frame
        changed = np.abs(frame.linear - before.linear).max(axis=1) + np.abs(frame.offset - before.offset)
        self.shifted = [was or change > 1e-12 for was, change in zip(self.shifted, changed, strict=True)]

    def set_plane(self, plane: int) -> None:
        """Another plane."""
        self.modes.plane = plane
        self.polar.pop("AP", None)
        self._write_plane(plane)

    def _write_plane(self, plane: int) -> None:
        if plane != self._plane:
            self._plane = plane
            self.put(f"G{plane}")

    def set_offset(self, name: str) -> None:
        """Another work offset."""
        if name == self.modes.offset:
            return
        table, before = self.machine.input.work_offsets, self.modes.offset
        self.modes.offset = name
        self.shifted = [True] * 3
        self.put(offset_word(name))
        if table and before:
            zero = (0.0, 0.0, 0.0)
            self.at = self.at + np.array(table.get(offset_word(before), zero)) - table.get(offset_word(name), zero)
        else:
            self.at = np.full(3, math.nan)

    def forget(self, axes: str, *, shifted: bool = False) -> None:
        """The position of axes is not known from here on."""
        self._step = None
        for axis in axes:
            self.at["XYZ".index(axis)] = math.nan
            self.shifted["XYZ".index(axis)] |= shifted

    def define_pole(self, code: int, given: Given) -> None:
        """G110 from the position, G111 from zero, G112 from the last pole."""
        first, second, _ = PLANES[self.modes.plane]
        if given.polar:
            if set(given.polar) != {"AP", "RP"}:
                raise given.error(f"G{code} with {' and '.join(given.polar)} alone: AP= and RP= must be given")
            step = cmath.rect(given.polar["RP"][0], math.radians(given.polar["AP"][0]))
        elif {first, second} <= given.axes.keys():
            step = complex(given.axes[first][0], given.axes[second][0])
        else:
            raise given.error(f"G{code}: both axes of the plane must be given, or AP= and RP=")
        origin = {110: self.modes.frame.undo(self.at), 111: np.zeros(3), 112: self.pole}[code]
        if not np.all(np.isfinite(origin[[first, second]])):
            raise given.error(f"G{code}: the position is not known here: the axes must be programmed before")
        self.pole = arcs.moved_to(origin, self.modes.plane, flat(origin, self.modes.plane) + step)
        self.polar.pop("AP", None)

    def quick_move(self, code: str, words: list[tuple[str, str]], feed: str) -> bool:
        """A line in G90 of nothing but numbers, which most blocks are; false: it needs another look.

        It does what `move` does, in a tenth of the time.
        """
        modes = self.modes
        motion = f"G{code}" if code else modes.motion
        if (
            motion not in ("G0", "G1") or modes.incremental or modes.is_linear or modes.feed_mode != 94
            or self._mode != 94 or modes.rounding_mm or self._corner is not None or not modes.frame.is_shift
            or (motion == "G1" and not feed and not modes.feed) or len({axis for axis, _ in words}) < len(words)
        ):  # fmt: skip
            return False
        if feed:
            modes.feed = float(feed) * modes.feed_unit
            if modes.feed <= 0.0:
                return False
        modes.motion = motion
        start, is_known, text = self.at.copy(), True, "G00" if motion == "G0" else "G01"
        for axis, number in sorted(words):
            k = "XYZ".index(axis)
            is_known &= not math.isnan(self.at[k])
            value = float(number) * modes.unit + float(modes.frame.offset[k])
            self.at[k], self.shifted[k] = value, False
            text += axis + self._length(value)
        self.out.put(text if motion == "G0" else text + self._feed_word(modes.feed or 0.0), self.line, self.file)
        self._step = np.nan_to_num(self.at - start) if is_known else None
        self.moves += 1
        return True

    @property
    def direction(self) -> Vector | None:
        """Unit vector along the end of the last move; None: not known."""
        length = 0.0 if self._step is None else float(np.linalg.norm(self._step))
        return None if self._step is None or length == 0.0 else self._step / length

    # ---- moves -------------------------------------------------------------------------------------------------------

    def move(self, given: Given) -> None:
        """One block with axes."""
        modes = self.modes
        if given.polar:
            self._polar_end(given)
        here = modes.frame.undo(self.at)
        target = here.copy()
        for axis, (value, incremental, column) in given.axes.items():
            if incremental and self.shifted[axis]:
                setting = "whether the control adds that depends on a setting (SD42440, SD42442)"
                what = f"{'XYZ'[axis]} incrementally behind a change of its offset: {setting}"
                raise WordError(f"{what}; it must be programmed absolutely before", column)
            target[axis] = here[axis] + value if incremental else value
            if not incremental:
                self.shifted[axis] = False
        if modes.motion in ("G0", "G1"):
            self._straight(given, target)
        elif modes.motion in ("G2", "G3", "CIP", "CT"):
            self._round(given, here, target)
        else:
            raise given.error("which of G0, G1 ... is in force at the start is set in MD20150: one must be given")

    def _polar_end(self, given: Given) -> None:
        first, second, _ = PLANES[self.modes.plane]
        if {first, second} & given.axes.keys():
            raise given.error("AP=, RP= beside an axis of the plane: leave one of them out")
        for name, (value, mode, column) in given.polar.items():
            if name == "AP" and mode == "" and self.modes.incremental:
                raise WordError("AP= in G91: it must be AP=AC( ) or AP=IC( )", column)
            if mode == "IC" and (name == "RP" or name not in self.polar):
                raise WordError(f"{name}=IC( ) without a value before it: it must be absolute", column)
            self.polar[name] = self.polar[name] + value if mode == "IC" else value
        if len(self.polar) < 2:
            raise given.error("AP= and RP=: both must be given, here or before")
        angle = math.radians(self.polar["AP"])
        for axis, share in ((first, math.cos(angle)), (second, math.sin(angle))):
            given.axes[axis] = (self.pole[axis] + self.polar["RP"] * share, False, given.column)
        if self.modes.motion in ("G2", "G3") and not given.centre and given.radius is None:
            given.centre = {axis: (float(self.pole[axis]), False, given.column) for axis in (first, second)}

    def _straight(self, given: Given, target: Vector) -> None:
        frame = self.modes.frame
        end = frame.apply(target)
        moved = [bool(np.any(np.abs(frame.linear[k, list(given.axes)]) > 1e-12)) for k in range(3)]
        if any(moved[k] and math.isnan(end[k]) for k in range(3)):
            self._by_distance(given, end, moved)
            return
        still = np.nan_to_num(self.at)  # axes at rest count for nothing
        element = Element(np.where(moved, self.at, still), np.where(moved, end, still))
        self._write_element(element, given, moved)

    def _by_distance(self, given: Given, end: Vector, moved: list[bool]) -> None:
        """A move of an axis whose position is not known: by its distance."""
        words, linear = "", self.modes.frame.linear
        for k in (k for k in range(3) if moved[k]):
            sources = [axis for axis in range(3) if abs(linear[k, axis]) > 1e-12]
            if math.isnan(end[k]):
                axis = sources[0]
                if len(sources) != 1 or axis not in given.axes:
                    raise given.error(f"the position of {'XYZ'[k]} is not known here: it must be programmed before")
                step = float(linear[k, axis]) * given.axes[axis][0]
            elif math.isnan(self.at[k]):
                raise given.error(
                    f"{'XYZ'[k]} absolutely beside an axis whose position is not known: in a block of its own"
                )
            else:
                step = float(self._grid(end[k]) - self._grid(self.at[k]))
                self.at[k] = end[k]
            words += f"{'XYZ'[k]}{self._length(step)}"
        feed = "" if self.modes.motion == "G0" else self._feed_word(self._constant_feed(given, math.nan))
        self.put("G91")
        self.put(f"{'G00' if self.modes.motion == 'G0' else 'G01'}{words}{feed}")
        self.put("G90")
        self._step = None
        self.moves += 1

    def _round(self, given: Given, here: Vector, target: Vector) -> None:
        modes, column = self.modes, given.column
        first, second, across = PLANES[modes.plane]
        needed = [0, 1, 2] if modes.motion == "CIP" else [first, second, *([across] if across in given.axes else [])]
        if not np.all(np.isfinite(here[needed])):
            raise WordError("an arc whose start is not known: its axes must be programmed before", column)
        here, target = (np.where(np.isnan(each), 0.0, each) for each in (here, target))
        try:
            element = self._arc(given, here, target)
        except ValueError as error:
            raise error if isinstance(error, WordError) else WordError(str(error), column) from None
        turns = given.turns * math.tau * math.copysign(1.0, element.sweep_rad)
        if given.turns and element.centre is None:
            raise WordError("TURN= of a line: it must be an arc", column)
        element = Element(element.start, element.end, element.centre, element.plane, element.sweep_rad + turns)
        moved = [k in PLANES[element.plane][:2] or k in given.axes for k in range(3)]
        self._write_element(self._in_offset(element, column), given, moved)

    def _arc(self, given: Given, here: Vector, target: Vector) -> Element:
        modes = self.modes
        first, second, _ = PLANES[modes.plane]
        tolerance = self.machine.controller.arc_radius_tolerance_mm
        if modes.motion == "CIP":
            middle = here.copy()
            for axis, (value, incremental, _) in given.middle.items():
                middle[axis] = here[axis] + value if incremental else value
            if len(given.middle) < 2:
                raise ValueError("CIP: the intermediate point must be given by two or three of I1=, J1=, K1=")
            return arcs.through(here, middle, target)
        if modes.motion == "CT":
            if self.direction is None:
                raise ValueError("CT needs the direction of a move before it, whose start is known")
            return arcs.tangential(here, target, modes.frame.linear.T @ self.direction, modes.plane)
        turn = 1 if modes.motion == "G3" else -1
        about = here.copy()
        for axis, (value, incremental, column) in given.centre.items():
            if axis not in (first, second):
                raise WordError(f"{'IJK'[axis]} lies across the plane G{modes.plane}: it must be left out", column)
            about[axis] = here[axis] + value if incremental else value
        start, centre = flat(here, modes.plane), flat(about, modes.plane)
        if given.radius is not None:
            return arcs.by_radius(here, target, given.radius, modes.plane, turn, tolerance)
        if given.angle is not None:
            if not 0.0 < given.angle < 360.0:
                raise ValueError(f"AR={given.angle:g}: it must lie between 0 and 360 degrees")
            if given.centre:
                end = centre + (start - centre) * cmath.rect(1.0, turn * math.radians(given.angle))
                target = arcs.moved_to(target, modes.plane, end)
                return arcs.by_centre(here, target, centre, modes.plane, turn, tolerance)
            return arcs.by_angle(here, target, given.angle, modes.plane, turn)
        if not given.centre:
            raise ValueError(f"{modes.motion} without I, J, K, CR= or AR=: one of them must be given")
        return arcs.by_centre(here, target, centre, modes.plane, turn, tolerance)

    def _in_offset(self, element: Element, column: int) -> Element:
        """An arc in the coordinates of the work offset."""
        frame = self.modes.frame
        start, end = frame.apply(element.start), frame.apply(element.end)
        start = np.where(np.isnan(self.at), start, self.at)
        if element.centre is None:
            return Element(start, end)
        first, second, across = PLANES[element.plane]
        linear = frame.linear
        inner = linear[np.ix_([first, second], [first, second])]
        turned = inner[0, 0] * inner[1, 1] - inner[0, 1] * inner[1, 0]  # its determinant
        scale = math.sqrt(abs(turned))
        tilt = np.abs(np.r_[linear[across, [first, second]], linear[[first, second], across]]).max()
        if tilt > 1e-9 or np.abs(inner @ inner.T - scale * scale * np.eye(2)).max() > 1e-9:
            what = "a frame that tilts its plane or makes it an ellipse (ROT, SCALE)"
            raise WordError(f"an arc in G{element.plane} under {what}: it is not read", column)
        side = math.copysign(1.0, turned)
        return Element(start, end, frame.apply(element.centre), element.plane, element.sweep_rad * side)

    # ---- writing -----------------------------------------------------------------------------------------------------

    def _write_element(self, element: Element, given: Given, moved: list[bool]) -> None:
        motion = "G0" if self.modes.motion == "G0" else "G1"
        ahead = element.direction_at(0.0)
        self._end_corner(element, ahead, motion, moved)
        known = bool(np.all(np.isfinite(element.start[moved])))
        kind, size = given.corner or ("RND", self.modes.rounding_mm)
        is_possible = self.modes.motion != "G0" and known and size > 0.0
        if is_possible:
            self._corner = _HeldCorner(element, kind, size, given.corner is None, given.column)
        elif size < 0.0 or (size > 0.0 and given.corner is not None):
            raise given.error(f"{kind}={size:g}: it must be more than 0, in a block with a feed whose start is known")
        exact = "G09" if given.exact else ""
        if motion == "G0":
            self.put(f"{exact}G00{self._axes(element.end, moved)}")
        else:
            self._write_cut(element, given, moved, exact, known)
        self.at = np.where(moved, element.end, self.at)
        self._step = element.direction_at(1.0) if known else None
        self.moves += 1

    def _write_cut(self, element: Element, given: Given, moved: list[bool], exact: str, known: bool) -> None:
        pieces = self._pieces(element, given, known)
        if self._mode != (95 if self.modes.feed_mode == 95 else 94):
            self._mode = 95 if self.modes.feed_mode == 95 else 94
            self._feed = ""
            self.put(f"G{self._mode}")
        if element.centre is not None:
            self._write_plane(element.plane)
        for begin, end, time_min, feed in pieces:
            part = element if (begin, end) == (0.0, 1.0) else element.part(begin, end)
            self._write_part(part, moved, exact, feed, time_min)
        self._write_plane(self.modes.plane)  # a circle through three points has its own

    def _write_part(self, part: Element, moved: list[bool], exact: str, feed: float, time_min: float) -> None:
        """One block of constant feed; with a time its feed is that which takes it between the rounded ends."""
        count = 1 if abs(part.sweep_rad) <= _MAX_SWEEP else math.ceil(abs(part.sweep_rad) / math.pi)
        for k in range(count):
            piece = part if count == 1 else part.part(k / count, (k + 1) / count)
            start, end = self._grid(piece.start), self._grid(piece.end)
            if time_min > 0.0:
                length = piece.length_mm if piece.centre is not None else float(np.linalg.norm(end - start))
                if length == 0.0:
                    continue
                feed = length * count / time_min
            words, code = "", "G01"
            if piece.centre is not None:
                begin, centre = flat(piece.start, piece.plane), flat(piece.centre, piece.plane)
                if abs(begin - centre) * abs(piece.sweep_rad) >= 3.0 * self._increment:
                    code = "G03" if piece.sweep_rad > 0.0 else "G02"
                    begin = flat(start, piece.plane)
                    spoke = _between(centre, begin, flat(end, piece.plane)) - begin
                    parts = sorted(zip(PLANES[piece.plane], (spoke.real, spoke.imag), strict=False))
                    words = "".join(f"{'IJK'[k]}{number_text(round(part, 5))}" for k, part in parts)
            self.put(f"{exact}{code}{self._axes(piece.end, moved)}{words}{self._feed_word(feed)}")

    def _pieces(self, element: Element, given: Given, known: bool) -> list[tuple[float, float, float, float]]:
        """Fraction of the length, duration in minutes (0: by the feed) and feed of the blocks that a block becomes."""
        modes = self.modes
        feed = self._constant_feed(given, element.length_mm if known else math.nan)
        start = given.start_feed
        if not (modes.is_linear and given.has_feed and modes.feed_mode == 94) or start is None or start == feed:
            return [(0.0, 1.0, 0.0, feed)]
        length = element.length_mm
        if start <= 0.0 or not known or length <= 0.0:
            raise given.error(f"FLIN from F{start:g}: the feed before it must be more than 0, and the start known")
        slope = (feed - start) / length  # 1/min
        total = math.log(feed / start) / slope
        acceleration = max(feed, start) * abs(slope)  # mm/min²
        count = max(1, math.ceil(total / math.sqrt(8.0 * _FLIN_ERROR_MM / acceleration)))
        how = "it is read as blocks of constant feed, within 0.5 um"
        self.note(f"FLIN: the feed is linear along the path of a block; {how}", "FLIN")
        ends = [start * math.expm1(slope * total * k / count) / slope / length for k in range(1, count)]
        bounds = [0.0, *ends, 1.0]
        return [(bounds[k], bounds[k + 1], total / count, 0.0) for k in range(count)]

    def _constant_feed(self, given: Given, length_mm: float) -> float:
        feed = self.modes.feed
        if feed is None or feed <= 0.0:
            raise given.error(f"{self.modes.motion} without a feed: F must be programmed before, more than 0")
        if self.modes.feed_mode != 93:
            return feed
        if not given.has_feed:
            raise given.error("G93 without F: every block with a feed must hold one")
        if math.isnan(length_mm):
            raise given.error("G93 and a start that is not known: its axes must be programmed before")
        return max(feed * length_mm, 1e-4)

    def _feed_word(self, feed: float) -> str:
        text = number_text(feed)
        if text == self._feed:
            return ""
        self._feed = text
        return f"F{text}"

    def _grid(self, value: Vector) -> Vector:
        return np.round(np.asarray(value, dtype=float) / self._increment) * self._increment

    def _length(self, value: float) -> str:
        text = f"{round(value / self._increment) * self._increment:.{self._decimals}f}"
        text = text.rstrip("0") if "." in text else text + "."
        return "0." if text in ("-0.", "0.") else text

    def _axes(self, end: Vector, moved: list[bool]) -> str:
        return "".join(f"{'XYZ'[k]}{self._length(float(end[k]))}" for k in range(3) if moved[k])

    # ---- corners -----------------------------------------------------------------------------------------------------

    def _end_corner(self, element: Element, ahead: Vector, motion: str, moved: list[bool]) -> None:
        """Write the corner between the block that was held and this one."""
        corner = self._corner
        if corner is None:
            return
        first, second, across = PLANES[self.modes.plane]
        behind = corner.element.direction_at(1.0)
        in_plane = element.centre is None or element.plane == self.modes.plane
        in_plane = in_plane and not moved[across] and abs(behind[across]) < 1e-9
        cosine = float(np.clip(behind[[first, second]] @ ahead[[first, second]], -1.0, 1.0))
        if motion == "G0" or not in_plane or len(self._held) != 1:
            if not corner.is_modal:
                where = f"{corner.kind}={corner.size:g} in line {self._held[0][1]}"
                raise WordError(f"{where}: a move with a feed in the same plane must follow", 1)
            self.release()
            return
        word = ""
        if math.acos(cosine) > _TANGENT:
            size = corner.size
            if corner.kind == "CHF":  # its length; FANUC's word is that along the blocks
                size /= 2.0 * math.cos(math.acos(cosine) / 2.0)
            word = f",{'R' if corner.kind == 'RND' else 'C'}{number_text(round(size, 5))}"
        text, line, file = self._held[0]
        self._held[0] = (text + word, line, file)
        self.release()

    def release(self) -> None:
        """Write what was held for a corner."""
        held, self._held, self._corner = self._held, [], None
        for text, line, file in held:
            self.out.put(text, line, file)


def _between(centre: complex, start: complex, end: complex) -> complex:
    """The centre as near as possible that has both rounded ends at one radius; itself where that is far."""
    if abs(end - start) < 0.01:
        return centre
    along = (end - start) / abs(end - start)
    off = ((centre - 0.5 * (start + end)) * along.conjugate()).real
    return centre if abs(off) > 0.002 else centre - off * along


def offset_word(name: str) -> str:
    """A settable frame as FANUC's work offset: G505 is G54.1P5, G500 (no offset of its own) G54.1P300."""
    code = int(name[1:])
    return name if code < 500 else f"G54.1P{code - 500 or 300}"
