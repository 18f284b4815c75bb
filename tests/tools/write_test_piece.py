#!/usr/bin/env python3
"""Writes the test piece of paper 004's page: `write_test_piece.py > python/shapegcode/data/iso10791_7.nc`.

A piece with the features of ISO 10791-7's contouring test (outer square, diamond, circle, sloped sides, bores); the
dimensions, tools and passes are this project's own. Origin: centre of the finished top. All lengths in mm.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator

# (half width across the sides, turn in degrees, floor) from the outside in; the circle has the width of the diamond.
SQUARE = (80.0, 0.0, -40.0)
SLOPED = (74.0, 3.0, -24.0)
DIAMOND = (54.0, 30.0, -16.0)
CIRCLE_RADIUS, CIRCLE_FLOOR = 54.0, -8.0
CORNERS = ((52.0, 52.0), (-52.0, 52.0), (-52.0, -52.0), (52.0, -52.0))
BORE_RADIUS, SEAT_RADIUS, SEAT_FLOOR, BORE_FLOOR = 13.0, 14.0, -22.0, -46.0
CENTRE_RADIUS = 15.0
STOCK_HALF, STOCK_TOP = 90.0, 2.0
SAFE, CLEAR = 30.0, 5.0  # levels of rapids across the piece and above a start

HEADER = """\
%
O1079(TEST PIECE WITH THE FEATURES OF ISO 10791-7)
(CENTRE BORE 30, CIRCLE 108, DIAMOND 108 AT 30 DEG,)
(SLOPED SIDES 148 AT 3 DEG, OUTER SQUARE 160, 4 BORES 26)
(DIMENSIONS, TOOLS AND PASSES ARE OUR OWN, NOT THE STANDARD S)
(STOCK 180 X 180 X 100, CAST IRON GG25, 2 MM ON TOP)
(G54: CENTRE OF THE FINISHED TOP; VICE JAWS BELOW Z-60)
(T1 FACE MILL 63, T2 END MILL 20 ROUGHING)
(T3 END MILL 16 FINISHING, T4 SPOT DRILL 10, T5 DRILL 14)
(T6 END MILL 16 BORES, T7 BORING BAR 26, T8 BORING BAR 30)
(TOOLS STICK OUT BY 60 AT LEAST; NO CUTTER COMPENSATION)
G21 G17 G90 G94
G40 G49 G80 G64"""


def word(letter: str, value: float) -> str:
    """A word with at most three decimals and always a point."""
    text = f"{round(value, 3) + 0.0:.3f}".rstrip("0")
    return letter + text


def at(**words: float) -> str:
    """Words in the order given."""
    return " ".join(word(letter.upper(), value) for letter, value in words.items())


def tool(number: int, name: str, speed: int, x: float, y: float) -> Iterator[str]:
    """Change the tool, start the spindle over the first place and come down to the safe level."""
    yield f"N{number}({name})"
    yield "G53 G00 Z0."
    yield f"T{number:02d} M06"
    yield f"G00 G90 G54 {at(x=x, y=y)} S{speed} M03"
    yield f"G43 {at(z=SAFE)} H{number:02d} M08"
    yield "G04 P1500"


def tool_end() -> Iterator[str]:
    """Stop spindle and coolant, clear of the piece."""
    yield f"G00 {at(z=SAFE)} M09"
    yield "M05"


def descend(z: float, feed: float) -> Iterator[str]:
    """Down beside the material: rapid to 2 mm above the level, the rest at feed."""
    yield f"G00 {at(z=z + 2.0)}"
    yield f"G01 {at(z=z, f=feed)}"


def square_loop(half: float, turn_deg: float, offset: float, z: float, feed: float, lead: float = 14.0) -> list[str]:
    """Once around a square, climb milling, corners rounded by the offset, quarter circles in and out.

    The first line goes to the start, above which the tool must stand clear.
    """
    turn = math.radians(turn_deg)

    def place(x: float, y: float) -> tuple[float, float]:
        return x * math.cos(turn) - y * math.sin(turn), x * math.sin(turn) + y * math.cos(turn)

    def to(x: float, y: float) -> str:
        px, py = place(x, y)
        return at(x=px, y=py)

    reach = half + offset
    lines = [f"G00 {to(-reach - lead, -lead)}", *descend(z, feed)]
    lines.append(f"G03 {to(-reach, 0.0)} {at(r=lead)}")
    # Left side upwards, then clockwise: end of each side, centre of the corner behind it, end of that corner.
    signs = ((-1, 1), (1, 1), (1, -1), (-1, -1))
    for number, (sx, sy) in enumerate(signs):
        corner = (sx * half, sy * half)
        along = number % 2 == 0  # this side runs along Y
        end = (sx * reach, corner[1]) if along else (corner[0], sy * reach)
        leave = (corner[0], sy * reach) if along else (sx * reach, corner[1])
        (ex, ey), (cx, cy) = (tuple(round(v, 3) for v in place(*p)) for p in (end, corner))
        lines.append(f"G01 {to(*end)}")
        lines.append(f"G02 {to(*leave)} {at(i=cx - ex, j=cy - ey)}")
    lines.append(f"G01 {to(-reach, 0.0)}")
    lines.append(f"G03 {to(-reach - lead, lead)} {at(r=lead)}")
    lines.append(f"G00 {at(z=CLEAR)}")
    return lines


def circle_loop(radius: float, z: float, feed: float, lead: float = 14.0) -> list[str]:
    """Once around a circle from outside, climb milling, quarter circles in and out."""
    return [
        f"G00 {at(x=-radius - lead, y=-lead)}",
        *descend(z, feed),
        f"G03 {at(x=-radius, y=0.0, r=lead)}",
        f"G02 {at(i=radius, j=0.0)}",
        f"G03 {at(x=-radius - lead, y=lead, r=lead)}",
        f"G00 {at(z=CLEAR)}",
    ]


def levels(top: float, floor: float, step: float) -> list[float]:
    """Depths from below the top to the floor, equally spaced, none deeper than the step."""
    count = math.ceil((top - floor) / step)
    return [top + (floor - top) * (k + 1) / count for k in range(count)]


def facing() -> Iterator[str]:
    """Two passes over the top, zigzag."""
    side, rows = STOCK_HALF + 31.5 + 5.0, (-67.5, -22.5, 22.5, 67.5)
    yield from tool(1, "FACE MILL 63", 600, -side, rows[0])
    for number, (z, feed) in enumerate(((0.3, 720.0), (0.0, 600.0))):
        if number:
            yield f"G00 {at(x=-side, y=rows[0])}"
        yield from descend(z, feed)
        x = -side
        for row, y in enumerate(rows):
            if row:
                yield f"G01 {at(y=y)}"
            x = -x
            yield f"G01 {at(x=x)}"
        yield f"G00 {at(z=CLEAR)}"
    yield from tool_end()


def roughing() -> Iterator[str]:
    """End mill 20 around the four shapes from the outside in; 0.5 mm stay on the walls."""
    feed, offset = 900.0, 10.5
    yield from tool(2, "END MILL 20, ROUGHING", 2230, -STOCK_HALF - 20.0, 0.0)
    yield "(OUTER SQUARE)"
    for z in levels(0.0, SQUARE[2], 5.0):
        yield from square_loop(*SQUARE[:2], offset, z, feed)
    yield "(SLOPED SIDES)"
    for z in levels(0.0, SLOPED[2], 6.0):
        yield from square_loop(*SLOPED[:2], offset, z, feed)
    yield "(DIAMOND)"
    for z in levels(0.0, DIAMOND[2], 8.0):
        for more in (36.0, 24.0, 12.0, 0.0):
            yield from square_loop(*DIAMOND[:2], offset + more, z, feed)
    yield "(CIRCLE)"
    for z in levels(0.0, CIRCLE_FLOOR, 4.0):
        for more in (12.0, 0.0):
            yield from circle_loop(CIRCLE_RADIUS + offset + more, z, feed)
    yield from tool_end()


def finishing() -> Iterator[str]:
    """End mill 16 along every wall: 0.1 mm before the size, then to size."""
    yield from tool(3, "END MILL 16, FINISHING", 2400, -STOCK_HALF - 20.0, 0.0)
    for name, shape in (("OUTER SQUARE", SQUARE), ("SLOPED SIDES", SLOPED), ("DIAMOND", DIAMOND)):
        yield f"({name})"
        for allowance, feed in ((0.1, 700.0), (0.0, 500.0)):
            yield from square_loop(*shape[:2], 8.0 + allowance, shape[2], feed)
    yield "(CIRCLE)"
    for allowance, feed in ((0.1, 700.0), (0.0, 500.0)):
        yield from circle_loop(CIRCLE_RADIUS + 8.0 + allowance, CIRCLE_FLOOR, feed)
    yield from tool_end()


def drilling() -> Iterator[str]:
    """Spot drill with a dwell, then pilot holes for the bores with pecks."""
    first, *others = CORNERS
    for number, name, speed, cycle, feed, tip in (
        (4, "SPOT DRILL 10", 2200, "G82", 180.0, None),
        (5, "DRILL 14", 1500, "G83", 300.0, BORE_FLOOR),
    ):
        yield from tool(number, name, speed, *first)
        extra = "P300 " if cycle == "G82" else "Q8. "
        bottom = DIAMOND[2] - 4.0 if tip is None else tip
        yield f"G98 {cycle} {at(x=first[0], y=first[1], z=bottom, r=DIAMOND[2] + 3.0)} {extra}{at(f=feed)}"
        for x, y in others:
            yield at(x=x, y=y)
        yield at(x=0.0, y=0.0, z=-4.0 if tip is None else tip, r=3.0)
        yield "G80"
        yield from tool_end()


def helix(x: float, y: float, radius: float, top: float, bottom: float, pitch: float, feed: float) -> Iterator[str]:
    """Mill a bore to a radius of the tool centre: down in turns of a pitch, once around the floor, back to the axis.

    The tool stands over the axis of the bore.
    """
    yield f"G00 {at(z=top + 2.0)}"
    yield f"G01 {at(z=top, f=feed)}"
    yield f"G03 {at(x=x + radius, y=y, r=radius / 2.0)}"
    for z in levels(top, bottom, pitch):
        yield f"G03 {at(z=z, i=-radius, j=0.0)}"
    yield f"G03 {at(i=-radius, j=0.0)}"
    yield f"G03 {at(x=x, y=y, r=radius / 2.0)}"
    yield f"G00 {at(z=CLEAR)}"


def bore_milling() -> Iterator[str]:
    """End mill 16 in a helix: 0.2 mm stay in the bores for the boring bars; the seats are finished."""
    yield from tool(6, "END MILL 16, BORES", 2400, *CORNERS[0])
    floor = DIAMOND[2]
    for number, (x, y) in enumerate(CORNERS):
        if number:
            yield f"G00 {at(x=x, y=y)}"
        yield from helix(x, y, BORE_RADIUS - 0.2 - 8.0, floor + 1.0, BORE_FLOOR + 1.0, 2.0, 400.0)
    yield "(SEATS 28)"
    for x, y in CORNERS:
        yield f"G00 {at(x=x, y=y)}"
        yield from helix(x, y, SEAT_RADIUS - 8.0, floor + 1.0, SEAT_FLOOR, 3.5, 300.0)
    yield "(CENTRE BORE)"
    yield "G00 X0. Y0."
    yield from helix(0.0, 0.0, CENTRE_RADIUS - 0.2 - 8.0, 1.0, BORE_FLOOR + 1.0, 2.0, 500.0)
    yield from tool_end()


def boring() -> Iterator[str]:
    """Bores to size: feed in and out, at the centre bore with a dwell at the bottom."""
    first, *others = CORNERS
    yield from tool(7, "BORING BAR 26", 1200, *first)
    yield f"G98 G85 {at(x=first[0], y=first[1], z=BORE_FLOOR + 2.0, r=SEAT_FLOOR + 3.0, f=96.0)}"
    for x, y in others:
        yield at(x=x, y=y)
    yield "G80"
    yield from tool_end()
    yield from tool(8, "BORING BAR 30", 1050, 0.0, 0.0)
    yield f"G98 G89 {at(x=0.0, y=0.0, z=BORE_FLOOR + 2.0, r=3.0)} P500 {at(f=84.0)}"
    yield "G80"
    yield from tool_end()


def program() -> str:
    """The whole program with a line feed behind every line."""
    lines = [HEADER]
    for part in (facing, roughing, finishing, drilling, bore_milling, boring):
        lines += part()
    lines += ["G53 G00 Z0.", "G53 G00 X0. Y0.", "M30", "%"]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    sys.stdout.write(program())
