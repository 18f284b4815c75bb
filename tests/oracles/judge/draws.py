"""Random programs by seed: what a mill is asked to do, over decades of feed, length and radius.

Every program is valid. Coordinates are whole least increments, so that each word is exact; a move lasts some
milliseconds to half a second at its feed, so that hundreds of programs can be simulated.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .records import AXES, CENTRE_WORDS, INCH_MM, PLANES

REACH_MM = 120.0
WORK_OFFSETS = {"G54": [0.0, 0.0, 0.0], "G55": [7.5, -3.25, 1.0]}
#: What a machine is told, one of each row per draw; most often what it has by itself.
SETTINGS: tuple[tuple[str, tuple[Any, ...]], ...] = (
    ("shaping.contour", ("response", "response", "command", "off")),
    ("shaping.per_axis", (False, False, False, True)),
    ("tolerance.contour_um", (20.0, 20.0, 10.0, 5.0)),
    ("controller.block_end", ("ceil", "carry")),
    ("emission.rounding", ("vibration", "vibration", "nearest")),
)


@dataclass(frozen=True)
class Draw:
    """One program, the built-in machine that runs it, and the values that differ from the machine's file."""

    seed: int
    text: str
    machine: str
    keys: dict[str, Any]


@dataclass
class _Tape:
    """Program text in the making and what its reader then knows; places in least increments, as programmed."""

    rng: np.random.Generator
    increment_mm: float
    lines: list[str] = field(default_factory=list)
    at: list[int] = field(default_factory=lambda: [0, 0, 0])
    plane: str = "G17"
    incremental: bool = False
    arcs: bool = True  #: whether arcs may be drawn: not under unequal scaling

    def chance(self, share: float) -> bool:
        return bool(self.rng.random() < share)

    def among(self, *choices: Any) -> Any:
        return choices[int(self.rng.integers(len(choices)))]

    def decade(self, low: float, high: float) -> float:
        """Evenly distributed over the logarithm."""
        return float(np.exp(self.rng.uniform(math.log(low), math.log(high))))

    def whole(self, mm: float) -> int:
        return round(mm / self.increment_mm)

    def number(self, increments: int) -> str:
        digits = 4 if self.increment_mm > 1.5e-3 else 3
        text = f"{increments / 10**digits:.{digits}f}".rstrip("0")
        return "0" if increments == 0 else text

    def words(self, to: list[int], letters: str = AXES) -> str:
        """Axis words to a place, in the mode that holds; the tape is then there."""
        out = ""
        for k, axis in enumerate(AXES):
            if axis in letters and (to[k] != self.at[k] or self.chance(0.1)):
                out += axis + self.number(to[k] - self.at[k] if self.incremental else to[k])
                self.at[k] = to[k]
        return out

    def feed(self, mm_per_min: float) -> str:
        value = mm_per_min / INCH_MM if self.increment_mm > 1.5e-3 else mm_per_min
        return f"F{value:.2f}" if self.increment_mm > 1.5e-3 else f"F{value:.1f}".replace(".0", ".")

    def put(self, line: str) -> None:
        if line:
            self.lines.append(line)

    def go(self, to_mm: tuple[float, float, float] | None = None) -> None:
        """A rapid to a place that is said in full."""
        place = to_mm or tuple(self.rng.uniform(-40.0, 40.0, 3))
        self.at = [self.whole(v) for v in place]
        self.put("G90G00" + "".join(a + self.number(v) for a, v in zip(AXES, self.at, strict=True)))
        if self.incremental:
            self.put("G91")


def _time_s(tape: _Tape) -> float:
    return tape.decade(0.004, 0.5)


def _line(tape: _Tape, feed: float) -> str:
    step = tape.rng.normal(size=3) * tape.among((1, 1, 0), (1, 1, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1))
    length = min(REACH_MM, max(2.0 * tape.increment_mm, feed / 60.0 * _time_s(tape)))
    step *= length / max(float(np.linalg.norm(step)), 1e-9)
    return _straight(tape, [v + tape.whole(s) for v, s in zip(tape.at, step, strict=True)])


def _straight(tape: _Tape, to: list[int]) -> str:
    if max(abs(v) for v in to) > tape.whole(REACH_MM):
        to = [v // 3 for v in to]
    if to == tape.at:
        to[PLANES[tape.plane][0]] += 5
    return "G01" + tape.words(to)


def _reversal(tape: _Tape, feed: float) -> str:
    here = list(tape.at)
    there = _line(tape, feed)
    return f"{there}{tape.feed(feed)}\n" + _straight(tape, here)


def _polyline(tape: _Tape, feed: float) -> str:
    """Short lines with slight changes of direction, as a CAM system writes a curve."""
    a, b, _ = PLANES[tape.plane]
    heading, step = (
        tape.rng.uniform(0.0, math.tau),
        max(3.0 * tape.increment_mm, feed / 60.0 * tape.decade(0.002, 0.03)),
    )
    turn = tape.rng.normal() * 0.2
    lines = []
    for _ in range(int(tape.rng.integers(3, 20))):
        to = list(tape.at)
        to[a] += tape.whole(step * math.cos(heading))
        to[b] += tape.whole(step * math.sin(heading))
        heading += turn
        lines.append(_straight(tape, to) + (tape.feed(feed) if not lines else ""))
    return "\n".join(lines)


def _arc(tape: _Tape, feed: float, *, full: bool = False, helix: bool = False, by_r: bool = False) -> str:
    a, b, normal = PLANES[tape.plane]
    ccw = tape.chance(0.5)
    sweep = math.tau if full else math.radians(tape.rng.uniform(5.0, 170.0 if by_r else 350.0))
    length = feed / 60.0 * _time_s(tape)
    radius = min(50.0, max(length / sweep, 0.02 if not full else 0.05))
    radius = max(radius, 10.0 * tape.increment_mm)
    start = tape.rng.uniform(0.0, math.tau)
    centre = [tape.whole(-radius * math.cos(start)), tape.whole(-radius * math.sin(start))]
    true = math.hypot(*centre)
    angle = math.atan2(-centre[1], -centre[0]) + (sweep if ccw else -sweep)
    to = list(tape.at)
    if not full:
        to[a] += round(centre[0] + true * math.cos(angle))
        to[b] += round(centre[1] + true * math.sin(angle))
    if max(abs(v) for v in to) > tape.whole(REACH_MM) or (to == tape.at and not full):
        return _line(tape, feed)
    if helix:
        to[normal] += tape.whole(tape.rng.uniform(-0.5, 0.5) * radius)
    chord = math.hypot(to[a] - tape.at[a], to[b] - tape.at[b])
    code = "G03" if ccw else "G02"
    if by_r and not full and chord > 8.0:
        size = max(round(true), math.ceil(0.5 * chord) + 1)
        longer = tape.chance(0.15) and size > 0.52 * chord
        return code + tape.words(to) + "R" + tape.number(-size if longer else size)
    words = [f"{CENTRE_WORDS[k]}{tape.number(v)}" for k, v in sorted(zip((a, b), centre, strict=True))]
    return code + tape.words(to) + "".join(words)


def _contour(tape: _Tape) -> None:
    """Cutting moves with what stands between them in real programs."""
    feed = tape.decade(10.0, 12000.0)
    makers: list[Callable[..., str]] = [_line, _line, _reversal, _polyline]
    options: list[dict[str, bool]] = [{}] * len(makers)
    if tape.arcs:
        makers += [_arc] * 6
        options += [{}, {}, {"by_r": True}, {"full": True}, {"helix": True}, {"full": True, "helix": True}]
    for _ in range(int(tape.rng.integers(2, 8))):
        if tape.chance(0.35):
            feed = tape.decade(10.0, 12000.0)
        if tape.chance(0.15):
            tape.incremental = not tape.incremental
            tape.put("G91" if tape.incremental else "G90")
        k = int(tape.rng.integers(len(makers)))
        stop = "G09" if tape.chance(0.06) else ""
        tape.put(stop + makers[k](tape, feed, **options[k]) + tape.feed(feed))
        if tape.chance(0.06):
            tape.put(tape.among("G04P100", "G04X.25", "(A COMMENT)", "M08", "S2000M03"))


def _cycle(tape: _Tape) -> None:
    """Holes: some in G90, some in a row in G91."""
    if tape.incremental:
        tape.put("G90")
        tape.incremental = False
    a, b, normal = (AXES[k] for k in PLANES[tape.plane])
    code = tape.among("G81", "G82", "G83", "G73", "G84", "G85", "G86", "G89")
    top = tape.at[PLANES[tape.plane][2]]
    level = top - tape.whole(tape.rng.uniform(0.5, 4.0))
    bottom = level - tape.whole(tape.rng.uniform(1.0, 9.0))
    x, y = (tape.whole(v) for v in tape.rng.uniform(-30.0, 30.0, 2))
    tail = {"G83": "Q" + tape.number(tape.whole(2.5)), "G73": "Q" + tape.number(tape.whole(1.5))}.get(code, "")
    tail += "P250" if code in ("G82", "G84", "G89") else ""
    place = f"{a}{tape.number(x)}{b}{tape.number(y)}{normal}{tape.number(bottom)}R{tape.number(level)}"
    tape.put(f"{tape.among('G98', 'G99')}{code}{place}{tail}{tape.feed(tape.decade(50.0, 900.0))}")
    if tape.chance(0.5):
        tape.put(f"{a}{tape.number(x + tape.whole(9.0))}{b}{tape.number(y - tape.whole(3.0))}")
    if tape.chance(0.3):
        tape.put(f"G91{a}{tape.number(tape.whole(4.0))}K{int(tape.rng.integers(1, 4))}")
        tape.put("G90")
    tape.put("G80")


def _polar(tape: _Tape) -> None:
    """A polygon by radius and angle."""
    a, b, _ = (AXES[k] for k in PLANES[tape.plane])
    if tape.incremental:
        tape.put("G90")
        tape.incremental = False
    radius = tape.whole(tape.decade(0.5, 30.0))
    tape.put("G16")
    for _ in range(int(tape.rng.integers(2, 6))):
        angle = tape.rng.uniform(0.0, 360.0)
        tape.put(f"G01{a}{tape.number(radius)}{b}{angle:.3f}{tape.feed(tape.decade(300.0, 6000.0))}")
    tape.put("G15")


def _modes(tape: _Tape) -> tuple[list[str], list[str]]:
    """Lines that change the coordinates, and those that take it back."""
    a, b, _ = (AXES[k] for k in PLANES[tape.plane])
    where = (
        f"{a}{tape.number(tape.whole(tape.rng.uniform(-9, 9)))}{b}{tape.number(tape.whole(tape.rng.uniform(-9, 9)))}"
    )
    begin: list[str] = []
    end: list[str] = []
    if tape.chance(0.3):
        begin.append(tape.among("G52X3.5Y-2.25Z.5", "G52Y4.", "G55"))
        end.append("G54" if begin[-1] == "G55" else "G52X0Y0Z0")
    if tape.chance(0.3):
        begin.append(f"G51.1{tape.among(a, b)}{tape.number(tape.whole(tape.rng.uniform(-9, 9)))}")
        end.append("G50.1X0Y0Z0")
    if tape.chance(0.25):
        if tape.chance(0.7):
            begin.append(f"G51X1.Y-2.Z0P{int(tape.rng.integers(300, 2500))}")
        else:
            factors = tape.rng.integers(300, 2500, 3)
            begin.append("G51X1.Y-2.Z0" + "".join(f"{c}{f}" for c, f in zip("IJK", factors, strict=True)))
            tape.arcs = False
        end.append("G50")
    if tape.chance(0.35):
        begin.append(f"G68{where}R{tape.rng.uniform(-180.0, 180.0):.3f}")
        end.append("G69")
    return begin, end[::-1]


def draw(seed: int) -> Draw:
    """The program of a seed: the same text whenever it is asked for."""
    rng = np.random.default_rng(seed)
    inch = bool(rng.random() < 0.2)
    tape = _Tape(rng, INCH_MM * 1e-4 if inch else 1e-3)
    tape.lines += ["%", "O0001", ("G20" if inch else "G21") + "G17G90G94G40G80G54", "S3000M03"]
    for _ in range(int(rng.integers(1, 4))):
        tape.plane = tape.among("G17", "G17", "G17", "G18", "G19")
        tape.put(tape.plane)
        tape.go()
        if tape.chance(0.1):
            tape.put("G92X5.Y-4.Z10.")
        begin, end = _modes(tape) if tape.chance(0.4) else ([], [])
        tape.lines += begin
        tape.go()
        if tape.chance(0.2):
            _cycle(tape)
            tape.go()
        if tape.chance(0.1) and not begin:
            _polar(tape)
            tape.go()
        _contour(tape)
        tape.arcs, tape.incremental = True, False
        tape.lines += ["G90", *end]
    tape.go((0.0, 0.0, 50.0))
    text = "\n".join([*tape.lines, "M30", "%", ""])
    keys: dict[str, Any] = {key: tape.among(*values) for key, values in SETTINGS if tape.chance(0.5)}
    if keys.get("shaping.contour") == "off":  # different shapers would distort the path
        keys.pop("shaping.per_axis", None)
    keys["input.work_offsets"] = WORK_OFFSETS
    machine = tape.among("vx500", "vx500", "kimm004")
    if machine == "kimm004":  # which states none
        for axis, low, high in (("x", 30.0, 90.0), ("y", 60.0, 160.0)):
            mode = {
                "frequency_hz": round(tape.decade(low, high), 1),
                "damping_ratio": round(tape.decade(0.005, 0.06), 4),
            }
            keys[f"axes.{axis}.modes"] = [mode]
    return Draw(seed, text, machine, keys)
