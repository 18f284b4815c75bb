"""Hypothesis strategies that draw valid FANUC milling programs.

Coordinates are kept as whole least increments (0.001 mm or 0.0001 inch), so that every word is exact. An
arc's end lies within 1 µm of its radius. Words carry a decimal point (zero may go without: it is the same in
both notations), so a program reads the same whatever the decimal-point setting.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from hypothesis import strategies as st

from .records import AXES, CENTRE_WORDS, INCH_MM, PLANES

#: Directions (a, b) with small whole numbers: a line along one has an exact normal, so tangent arcs are
#: exact.
DIRECTIONS = ((1, 0), (0, 1), (-1, 0), (0, -1), (3, 4), (-4, 3), (4, -3), (5, 12), (-12, -5), (1, 1), (2, -1), (-1, 2))
LARGEST_END_ERROR_MM = 0.95e-3
REACH_MM = 200.0
COMMENTS = ("FINISH WALL", "ROUGH 2", "TOOL D10 R1.5", "POCKET-3", "PASS 1", "N10 X5. NOT A WORD")


@dataclass
class _Writer:
    """Program text in the making, with the modal state its reader will be in."""

    increment_mm: float
    incremental: bool = False
    spaced: bool = True
    padded: bool = True
    n_step: int = 0
    n_next: int = 10
    motion: str = ""
    plane: str = "G17"
    feed: float = 0.0
    at: list[int] = field(default_factory=lambda: [0, 0, 0])
    lines: list[str] = field(default_factory=list)

    def number(self, increments: int) -> str:
        """A coordinate with a point: `10.`, `-.5` as `-0.5`, `0`."""
        if increments == 0:
            return "0"
        digits = 4 if self.increment_mm > 1.5e-3 else 3
        text = f"{abs(increments) / 10**digits:.{digits}f}".rstrip("0")
        return ("-" if increments < 0 else "") + text

    def code(self, name: str) -> str:
        """`G01` or, in a program that does not pad, `G1`."""
        return name if self.padded else name[0] + name[1:].lstrip("0") if name[1:].strip("0") else name[:2]

    def put(self, *words: str) -> None:
        """One line, numbered if this program has sequence numbers."""
        parts = [w for w in words if w]
        if self.n_step and parts and not parts[0].startswith(("%", "O", "(")):
            parts.insert(0, f"N{self.n_next}")
            self.n_next += self.n_step
        self.lines.append((" " if self.spaced else "").join(parts))

    def axis_words(self, to: list[int], *, always: tuple[int, ...] = ()) -> list[str]:
        """Words for the axes that change (and those in `always`), and go there."""
        words = []
        for k in range(3):
            if to[k] != self.at[k] or k in always:
                words.append(AXES[k] + self.number(to[k] - self.at[k] if self.incremental else to[k]))
        self.at = list(to)
        return words

    def motion_word(self, code: str) -> str:
        """The motion code where it changes."""
        if code == self.motion:
            return ""
        self.motion = code
        return self.code(code)

    def feed_word(self, feed_mm_per_min: float) -> str:
        """The feed where it changes, with a point where one digit would be left."""
        if feed_mm_per_min == self.feed:
            return ""
        self.feed = feed_mm_per_min
        if self.increment_mm > 1.5e-3:
            return f"F{feed_mm_per_min / INCH_MM:.2f}"
        return f"F{feed_mm_per_min:.1f}" if feed_mm_per_min % 1 else f"F{feed_mm_per_min:.0f}."


def _on_circle(centre: tuple[int, int], radius: float, angle: float, increment_mm: float) -> tuple[int, int] | None:
    """A grid point near this angle of the circle that is within 1 µm of the radius."""
    step = 1.0 / max(radius, 1.0)
    for k in range(60):
        turned = angle + step * ((k + 1) // 2) * (-1) ** k
        p = round(centre[0] + radius * math.cos(turned)), round(centre[1] + radius * math.sin(turned))
        error = abs(math.hypot(p[0] - centre[0], p[1] - centre[1]) - radius)
        if error * increment_mm <= LARGEST_END_ERROR_MM:
            return p
    return None


@st.composite
def _elements(draw: st.DrawFn, writer: _Writer, size: int) -> None:
    """A contour of lines and arcs in the current plane, appended to the writer."""
    w = writer
    a, b, _ = PLANES[w.plane]
    limit = round(REACH_MM / w.increment_mm)
    heading: tuple[int, int] | None = None
    for _ in range(size):
        kind = draw(st.sampled_from(("line", "line", "free", "tangent", "ij", "r", "circle", "helix")))
        feed = draw(st.sampled_from((0.0, 0.0, 50.0, 120.0, 244.5, 500.0, 1000.0, 2500.0, 6000.0)))
        tail = [w.feed_word(feed)] if feed else []
        if draw(st.integers(0, 11)) == 0:
            tail.insert(0, "G09" if w.padded else "G9")
        if draw(st.integers(0, 15)) == 0:
            w.put(f"({draw(st.sampled_from(COMMENTS))})")
        to = list(w.at)
        if kind in ("line", "free"):
            heading = draw(st.sampled_from(DIRECTIONS)) if kind == "line" else None
            if heading:
                length = draw(st.integers(1, round(4.0 / w.increment_mm)))
                to[a] += heading[0] * length
                to[b] += heading[1] * length
            else:
                for k in range(3):
                    to[k] += draw(st.integers(-20000, 20000)) * draw(st.sampled_from((0, 1)))
                if to == w.at:
                    to[a] += 1
            if max(abs(v) for v in to) < limit:
                w.put(w.motion_word("G01"), *w.axis_words(to), *tail)
            else:
                w.feed = math.nan if tail else w.feed
            continue
        ccw = draw(st.booleans())
        words = _arc_words(draw, w, kind, heading, ccw, to)
        heading = None
        if words is None or max(abs(v) for v in to) >= limit:
            w.feed = math.nan if tail else w.feed
            continue
        always = (a, b) if draw(st.booleans()) and kind != "circle" else ()
        if "R" in words[0] and not always and to[a] == w.at[a] and to[b] == w.at[b]:
            continue
        w.put(w.motion_word("G03" if ccw else "G02"), *w.axis_words(to, always=always), *words, *tail)


def _arc_words(
    draw: st.DrawFn, w: _Writer, kind: str, heading: tuple[int, int] | None, ccw: bool, to: list[int]
) -> list[str] | None:
    """Centre or radius words of an arc from the current position; `to` is set to its end."""
    a, b, normal = PLANES[w.plane]
    here = (w.at[a], w.at[b])
    if kind == "r":
        da, db = draw(st.integers(-9000, 9000)), draw(st.integers(-9000, 9000))
        if abs(da) + abs(db) < 20:
            da += 100
        smallest = math.ceil(0.505 * math.hypot(da, db)) + 1
        radius = draw(st.integers(smallest, 6 * smallest))
        to[a], to[b] = here[0] + da, here[1] + db
        return ["R" + w.number(-radius if draw(st.integers(0, 3)) == 0 else radius)]
    if kind == "tangent" and heading is not None:
        times = draw(st.integers(40, 3000)) * (1 if ccw else -1)
        ca, cb = -heading[1] * times, heading[0] * times
    else:
        ca, cb = draw(st.integers(-15000, 15000)), draw(st.integers(-15000, 15000))
        if abs(ca) + abs(cb) < 50:
            ca += 1000
    centre, radius_f = (here[0] + ca, here[1] + cb), math.hypot(ca, cb)
    full = kind == "circle" or (kind == "helix" and draw(st.booleans()))
    if not full:
        sweep = math.radians(draw(st.integers(2, 355))) * (1 if ccw else -1)
        end = _on_circle(centre, radius_f, math.atan2(-cb, -ca) + sweep, w.increment_mm)
        if end is None or end == here:
            return None
        to[a], to[b] = end
    if kind == "helix":
        to[normal] += draw(st.integers(-5000, 5000))
    words = [CENTRE_WORDS[a] + w.number(ca), CENTRE_WORDS[b] + w.number(cb)]
    if ca == 0 or cb == 0:
        words = [t for t, v in zip(words, (ca, cb), strict=True) if v or draw(st.booleans())]
    return sorted(words)


def _rapid_to(draw: st.DrawFn, w: _Writer, safe: int) -> None:
    """Retract, go to a new place, come down: three rapids."""
    reach = round(60.0 / w.increment_mm)
    up = [w.at[0], w.at[1], safe]
    if up != w.at:
        w.put(w.motion_word("G00"), *w.axis_words(up))
    to = [draw(st.integers(-reach, reach)), draw(st.integers(-reach, reach)), safe]
    if to == w.at:
        to[0] += 1
    w.put(w.motion_word("G00"), *w.axis_words(to))
    w.put(w.motion_word("G00"), *w.axis_words([*to[:2], safe // 4]))


def _between(draw: st.DrawFn, w: _Writer) -> None:
    """Things that stand between contours."""
    for _ in range(draw(st.integers(0, 3))):
        match draw(st.integers(0, 7)):
            case 0:
                w.put(w.code("G04"), f"P{draw(st.sampled_from((100, 500, 2000)))}")
            case 1:
                w.put(w.code("G04"), f"X{draw(st.sampled_from(('0.5', '1.', '2.25')))}")
            case 2:
                w.put(w.code(draw(st.sampled_from(("M08", "M09", "M01", "M00")))))
            case 3:
                w.put(f"S{draw(st.integers(500, 12000))}", w.code("M03"))
            case 4:
                w.put(f"({draw(st.sampled_from(COMMENTS))})")
            case 5:
                w.lines.append("")
            case 6:
                w.put(draw(st.sampled_from(("G61", "G64"))))
            case _:
                w.incremental = not w.incremental
                w.put("G91" if w.incremental else "G90")


def _cycle(draw: st.DrawFn, w: _Writer, safe: int) -> None:
    """A drilling cycle with a few holes, absolute, cancelled by G80."""
    if w.incremental:
        w.incremental = False
        w.put("G90")
    _rapid_to(draw, w, safe)
    level = w.at[2]
    code = draw(st.sampled_from(("G81", "G82", "G83", "G73")))
    extra = {"G82": ["P500"], "G83": ["Q" + w.number(2000)], "G73": ["Q" + w.number(1500)]}.get(code, [])
    back, r_level = draw(st.sampled_from(("G98", "G99"))), level // 2
    w.feed = -1.0
    to = [w.at[0], w.at[1]]
    depth = -draw(st.integers(1000, 20000))
    w.put(
        back,
        code,
        "X" + w.number(to[0]),
        "Y" + w.number(to[1]),
        "Z" + w.number(depth),
        "R" + w.number(r_level),
        *extra,
        w.feed_word(draw(st.sampled_from((60.0, 150.0)))),
    )
    for _ in range(draw(st.integers(0, 3))):
        to = [v + draw(st.integers(-9000, 9000)) for v in to]
        w.put("X" + w.number(to[0]), "Y" + w.number(to[1]))
    w.put("G80")
    w.at = [*to, level if back == "G98" else r_level]


@st.composite
def programs(
    draw: st.DrawFn,
    *,
    max_contours: int = 3,
    max_elements: int = 8,
    inch: bool | None = None,
    planes: tuple[str, ...] = ("G17", "G18", "G19"),
    cycles: bool = True,
) -> str:
    """A complete program: frame, tool, contours (lines, arcs, circles, helices), cycles, end."""
    use_inch = draw(st.booleans()) if inch is None else inch
    w = _Writer(increment_mm=INCH_MM * 1e-4 if use_inch else 1e-3)
    w.spaced, w.padded = draw(st.booleans()), draw(st.booleans())
    w.n_step = draw(st.sampled_from((0, 0, 5, 10)))
    w.lines.append("%")
    w.lines.append("O0001" + draw(st.sampled_from(("", "(GENERATED)", " (PART 7)"))))
    w.put("G20" if use_inch else "G21", "G17", "G90", "G94", "G40", "G49", "G80")
    w.put("T1", w.code("M06"))
    w.put("G54")
    w.put(w.code("S3000"), w.code("M03"))
    safe = round(25.0 / w.increment_mm)
    start = [draw(st.integers(-40000, 40000)), draw(st.integers(-40000, 40000)), safe]
    w.at = [start[0], start[1], 0]
    w.put(w.motion_word("G00"), "G90", "X" + w.number(start[0]), "Y" + w.number(start[1]))
    w.at = start
    w.put("G43", w.code("H01"), "Z" + w.number(safe), w.code("M08"))
    for _ in range(draw(st.integers(1, max_contours))):
        _between(draw, w)
        if cycles and draw(st.integers(0, 3)) == 0:
            _cycle(draw, w, safe)
            continue
        plane = draw(st.sampled_from(planes))
        if plane != w.plane:
            w.plane = plane
            w.put(plane)
        _rapid_to(draw, w, safe)
        w.feed = -1.0  # Every plunge says its feed.
        plunge = [w.at[0], w.at[1], -draw(st.integers(0, 9000))]
        w.put(
            w.motion_word("G01"),
            *w.axis_words(plunge),
            w.feed_word(draw(st.sampled_from((50.0, 100.0, 300.0)))),
        )
        draw(_elements(w, draw(st.integers(1, max_elements))))
        w.feed = -1.0
        if draw(st.booleans()):
            w.put(w.motion_word("G01"), *w.axis_words([w.at[0], w.at[1], w.at[2] + 2000]), w.feed_word(800.0))
    w.put(w.code("G00"), "G90", "Z" + w.number(safe))
    w.put(w.code("M09"))
    w.put(w.code("M05"))
    w.put("G91", "G28", "Z0")
    w.put("G28", "X0", "Y0")
    w.put("G90")
    w.put("M30")
    w.lines.append("%")
    return "\n".join(w.lines) + draw(st.sampled_from(("", "\n")))
