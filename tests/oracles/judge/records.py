"""What the judge makes of a program: words, moves, a record of every line."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

Vector = npt.NDArray[np.float64]
Kind = Literal["rapid", "line", "arc"]

AXES = "XYZ"
CENTRE_WORDS = "IJK"
#: plane → (first axis, second axis, normal axis); first × second = normal, so G03 is counter-clockwise seen
#: from +normal.
PLANES: dict[str, tuple[int, int, int]] = {"G17": (0, 1, 2), "G18": (2, 0, 1), "G19": (1, 2, 0)}
INCH_MM = 25.4
FULL_TURN = 2.0 * math.pi
#: Lengths below this are floating-point dust (the finest word is 0.1 µm).
DUST_MM = 1e-7

MODAL_GROUPS: dict[str, str] = {
    **dict.fromkeys(("G00", "G01", "G02", "G03"), "motion"),
    **dict.fromkeys(("G17", "G18", "G19"), "plane"),
    **dict.fromkeys(("G90", "G91"), "distance"),
    **dict.fromkeys(("G93", "G94", "G95"), "feed_mode"),
    **dict.fromkeys(("G20", "G21"), "units"),
    **dict.fromkeys(("G40", "G41", "G42"), "comp"),
    **dict.fromkeys(("G43", "G44", "G49"), "length_offset"),
    **dict.fromkeys(
        ("G73", "G74", "G76", "G80", "G81", "G82", "G83", "G84", "G85", "G86", "G87", "G88", "G89"), "cycle"
    ),
    **dict.fromkeys(("G98", "G99"), "return_level"),
    **dict.fromkeys(("G54", "G55", "G56", "G57", "G58", "G59", "G54.1"), "wcs"),
    **dict.fromkeys(("G61", "G62", "G63", "G64"), "exact_stop"),
}
#: The modal state a control wakes up in.
WAKE_UP = {
    "motion": "G00", "plane": "G17", "distance": "G90", "feed_mode": "G94", "units": "G21", "comp": "G40",
    "length_offset": "G49", "cycle": "G80", "return_level": "G98", "wcs": "G54", "exact_stop": "G64",
}  # fmt: skip
#: One-shot codes that take the axis words of their block for themselves.
AXIS_TAKERS = frozenset({"G04", "G10", "G28", "G30", "G52", "G53", "G92", "G92.1"})
#: Codes that are accepted and change nothing this judge follows.
INERT = frozenset({"G05", "G05.1", "G08", "G09", "G11", "G15", "G23", "G50", "G50.1", "G64.1", "G69", "G96", "G97"})
INTEGER_ADDRESSES = frozenset("MSTNODHL")
SCALED_ADDRESSES = frozenset("XYZIJKRQABCUVW")

_WORD = re.compile(r"([A-Z])([+-]?(?:\d+\.?\d*|\.\d+))")
_COMMENT = re.compile(r"\(([^()]*)\)")


class JudgeError(ValueError):
    """A program error, with the 1-based number of the line it was found on."""

    def __init__(self, line: int, message: str) -> None:
        super().__init__(f"line {line}: {message}")
        self.line = line
        self.message = message


@dataclass(frozen=True)
class Move:
    """One straight or circular movement.

    `start` and `end` are absolute (mm, NaN where unknown). `delta` is end − start wherever that is known,
    also when both ends are not: 0 for an axis that is not commanded, the word itself in G91, NaN only for an
    absolute word met from an unknown position. The arc fields are None for a straight move. `sweep` is
    signed, positive counter-clockwise seen from the positive end of `normal_axis`. `centre_offset` is centre
    − start (0 along the normal); `radius` is the one at the start, `end_radius` the one at the end: in
    between it changes linearly with the angle.
    """

    kind: Kind
    line: int
    start: Vector
    end: Vector
    delta: Vector
    feed: float = math.nan
    centre: Vector | None = None
    centre_offset: Vector | None = None
    radius: float | None = None
    end_radius: float | None = None
    sweep: float | None = None
    normal_axis: int | None = None
    cycle: bool = False

    @property
    def is_cut(self) -> bool:
        """Whether this is a programmed G01, G02 or G03 (not the inside of a drilling cycle)."""
        return self.kind != "rapid" and not self.cycle

    @property
    def length(self) -> float:
        """Length along the line, arc or helix in mm; NaN if an axis displacement is unknown."""
        if self.kind != "arc":
            return float(np.sqrt(np.sum(self.delta**2)))
        assert self.radius is not None and self.end_radius is not None
        assert self.sweep is not None and self.normal_axis is not None
        in_plane = 0.5 * (self.radius + self.end_radius) * abs(self.sweep)
        return math.hypot(in_plane, float(self.delta[self.normal_axis]))

    def offsets(self, fraction: npt.ArrayLike) -> Vector:
        """Displacement from `start` at fractions 0…1 of the move, shape (n, 3)."""
        s = np.atleast_1d(np.asarray(fraction, dtype=float))
        out = s[:, None] * self.delta[None, :]
        if self.kind == "arc":
            assert self.centre_offset is not None and self.normal_axis is not None
            assert self.radius is not None and self.end_radius is not None and self.sweep is not None
            a, b = (self.normal_axis + 1) % 3, (self.normal_axis + 2) % 3
            ca, cb = self.centre_offset[a], self.centre_offset[b]
            angle = math.atan2(-cb, -ca) + s * self.sweep
            radius = self.radius + s * (self.end_radius - self.radius)
            out[:, a] = ca + radius * np.cos(angle)
            out[:, b] = cb + radius * np.sin(angle)
        return out

    def points(self, fraction: npt.ArrayLike) -> Vector:
        """Absolute positions at fractions 0…1 of the move, shape (n, 3)."""
        return self.start[None, :] + self.offsets(fraction)


@dataclass(frozen=True)
class LineRecord:
    """What one source line said and did. `words` are (address, text of the number) pairs in order."""

    number: int
    text: str
    words: tuple[tuple[str, str], ...]
    moves: tuple[Move, ...]
    modal_before: dict[str, Any]
    modal: dict[str, Any]
    comments: tuple[str, ...] = ()
    dwell_s: float = 0.0
    executed: bool = True
    exact_stop: bool = False

    @property
    def n_words(self) -> tuple[int, ...]:
        """The sequence numbers of the line."""
        return tuple(int(v) for a, v in self.words if a == "N")

    @property
    def g_codes(self) -> tuple[str, ...]:
        """The G codes of the line in canonical spelling (`G1` is `G01`)."""
        return tuple(canonical_g(v) for a, v in self.words if a == "G")

    @property
    def is_blank(self) -> bool:
        """Nothing but white space, end-of-block signs and comments."""
        return not self.words and not self.text.lstrip().startswith("%")

    @property
    def cuts(self) -> bool:
        """Whether the line has moves and every one of them is a programmed cut."""
        return bool(self.moves) and all(m.is_cut for m in self.moves)


@dataclass
class Interpretation:
    """The records of every source line, and remarks (line number, text) on what is legal but doubtful."""

    lines: list[LineRecord]
    remarks: list[tuple[int, str]] = field(default_factory=list)
    one_digit_feeds: list[int] = field(default_factory=list)

    @property
    def moves(self) -> list[Move]:
        """Every move of the program in order."""
        return [m for r in self.lines for m in r.moves]

    @property
    def cuts(self) -> list[Move]:
        """Every programmed cutting move in order."""
        return [m for m in self.moves if m.is_cut]

    @property
    def modal(self) -> dict[str, Any]:
        """The modal state at the end."""
        return self.lines[-1].modal


def canonical_g(number: str) -> str:
    """`1` → `G01`, `5.1` → `G05.1`, `054` → `G54`."""
    whole, _, tail = number.lstrip("+").partition(".")
    tail = tail.rstrip("0")
    return f"G{int(whole or 0):02d}" + (f".{tail}" if tail else "")


def split_line(text: str, number: int) -> tuple[list[tuple[str, str]], list[str]]:
    """Words and comments of one line. Raises JudgeError on anything that is neither."""
    comments = _COMMENT.findall(text)
    code = _COMMENT.sub(" ", text)
    if "(" in code or ")" in code:
        raise JudgeError(number, f"unbalanced or nested comment: {text.strip()!r}")
    code, _, after_eob = code.partition(";")
    if after_eob.strip():
        raise JudgeError(number, f"text after the end-of-block sign: {after_eob.strip()!r}")
    code = re.sub(r"\s+", "", code).upper()
    if code.startswith("/"):
        code = re.sub(r"^/\d?", "", code)
    words: list[tuple[str, str]] = []
    at = 0
    while at < len(code):
        found = _WORD.match(code, at)
        if found is None:
            raise JudgeError(number, f"cannot read {code[at:]!r} (macro statements are not judged)")
        words.append((found.group(1), found.group(2)))
        at = found.end()
    return words, comments
