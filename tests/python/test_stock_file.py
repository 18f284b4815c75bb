"""Stock files: what they hold, what is said about a bad one, and the stock that an even allowance leaves, against plane
geometry: distances from walls and from the centres of arcs, and areas."""

import math
import re
from collections.abc import Sequence
from importlib import resources
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import shapely
from tool_files_page import STOCK_EXAMPLES

from shapegcode import _core
from shapegcode.cutting.material import stock_polygons
from shapegcode.cutting.stock import Stock, StockPiece
from shapegcode.errors import FileError, StockError

DATA = resources.files("shapegcode") / "data" / "milling"
RADIUS = 4.0  # of the tool
Z = -5.0
NEAR_MM = 5e-4  # as docs/reference/tool_files.md says
NEAR_MM2 = 5e-3  # between outlines some 100 mm long


def line(start: Sequence[float], end: Sequence[float], z: float = Z) -> _core.Segment:
    return _core.Segment.line([*start, z], [*end, z], 10.0)


def arc(start: Sequence[float], end: Sequence[float], centre: Sequence[float], degrees: float) -> _core.Segment:
    return _core.Segment.arc([*start, Z], [*end, Z], [*centre, Z], math.radians(degrees), 10.0)


def corner(straight: float = 30.0) -> _core.Path:
    """Inside corner of paper 001, case 1: finished radius 8, walls at y = -4 and x = 8, corner's centre at (0, 4)."""
    return _core.Path([line((-straight, 0), (0, 0)), arc((0, 0), (4, 4), (0, 4), 90), line((4, 4), (4, 4 + straight))])


def rectangle(width: float, depth: float, z: float = Z) -> list[_core.Segment]:
    """Path round a rectangle about the origin, counter-clockwise from the middle of its lower side; depth < 0: cw."""
    x, y = width / 2, depth / 2
    corners = [(0, -y), (x, -y), (x, y), (-x, y), (-x, -y), (0, -y)]
    return [line(a, b, z) for a, b in pairwise(corners)]


def allowance(text: str = "", **values: object) -> Stock:
    keys = {"allowance_mm": 0.8, "corner_radius_mm": 8.0, "wall": '"right"', "z_mm": [-15.0, 0.0], **values}
    return Stock.from_toml("[allowance]\n" + "".join(f"{key} = {value}\n" for key, value in keys.items()), "s.toml")


def area(pieces: Sequence[StockPiece]) -> shapely.Geometry:
    return shapely.union_all([shapely.Polygon(piece.rings[0], piece.rings[1:]) for piece in pieces])


def within_reach(shape: shapely.Polygon, core: shapely.Polygon, reach: float) -> None:
    """The shape is what lies within a distance of a rectangle, point by point and in its size."""
    distances = shapely.distance(core, shapely.points(shapely.segmentize(shape.exterior, 0.05).coords))
    assert distances == pytest.approx(reach, abs=NEAR_MM)
    assert shape.area == pytest.approx(core.area + core.length * reach + math.pi * reach**2, rel=2e-5)


def complaint(text: str) -> str:
    with pytest.raises(StockError) as caught:
        Stock.from_toml(text, "s.toml")
    return str(caught.value)


def test_a_box() -> None:
    (piece,) = stock_polygons(Stock.from_toml("[box]\nx_mm = [1, 5]\ny_mm = [-2, 3]\nz_mm = [-4, 0]\n"), [], RADIUS)
    assert area([piece]).equals(shapely.box(1, -2, 5, 3))
    assert (piece.bottom_mm, piece.top_mm) == (-4, 0)
    assert shapely.LinearRing(piece.rings[0]).is_ccw


def test_a_polygon_with_a_hole_in_either_sense() -> None:
    text = """\
[polygon]
points_mm = [[0, 0], [0, 10], [20, 10], [20, 0]]
holes_mm = [[[5, 3], [9, 3], [9, 7], [5, 7]]]
z_mm = [-4, 1]
"""
    (piece,) = stock_polygons(Stock.from_toml(text), [], RADIUS)
    outline, hole = piece.rings
    assert (len(outline), len(hole)) == (4, 4)
    assert shapely.LinearRing(outline).is_ccw
    assert not shapely.LinearRing(hole).is_ccw
    assert area([piece]).area == pytest.approx(200 - 16)


def test_a_hole_that_cuts_the_polygon_in_two_leaves_two_pieces() -> None:
    text = """\
[polygon]
points_mm = [[0, 0], [20, 0], [20, 10], [0, 10]]
holes_mm = [[[8, -1], [12, -1], [12, 11], [8, 11]]]
z_mm = [-4, 1]
"""
    pieces = stock_polygons(Stock.from_toml(text), [], RADIUS)
    assert sorted(area([piece]).area for piece in pieces) == pytest.approx([80, 80])


def test_of_a_roughing_program_the_stock_before_it() -> None:
    stock = Stock.from_toml(STOCK_EXAMPLES["What a roughing program left of a block"], folder="/jobs")
    assert stock.kind == "program"
    assert stock.beside(stock.program.file) == Path("/jobs/rough.nc")
    assert area(stock_polygons(stock, [], RADIUS)).equals(shapely.box(0, 0, 120, 80))


@pytest.mark.parametrize("title", STOCK_EXAMPLES)
def test_examples_load(title: str) -> None:
    assert Stock.from_toml(STOCK_EXAMPLES[title]).kind in {"box", "polygon", "allowance", "program"}


def test_the_corner_of_paper_001() -> None:
    stock = Stock.from_toml((DATA / "paper001_stock.toml").read_text(encoding="utf-8"))
    (piece,) = stock_polygons(stock, [corner()], RADIUS)
    assert (piece.bottom_mm, piece.top_mm) == (-15, 0)
    rough = shapely.LinearRing(piece.rings[0])
    # Rough walls 0.8 mm in front of the finished ones, joined by a radius of 8 about (-0.8, 4.8).
    centre = np.array([8 - 0.8 - 8, -4 + 0.8 + 8])
    for x in (-30, -10, centre[0]):
        assert rough.distance(shapely.Point(x, -3.2)) < NEAR_MM
    for y in (centre[1], 20, 34):
        assert rough.distance(shapely.Point(7.2, y)) < NEAR_MM
    for degrees in np.linspace(270, 360, 37):
        direction = np.array([math.cos(math.radians(degrees)), math.sin(math.radians(degrees))])
        assert rough.distance(shapely.Point(centre + 8 * direction)) < NEAR_MM
    # Nothing in front of the wall, the part behind it.
    stock_area = area([piece])
    assert not stock_area.intersects(shapely.Point(0, 4))
    assert not stock_area.intersects(shapely.box(-30, -3.19, -10, 40))
    for point in ((0, -5), (9, 10), (8, -4), (0, -3.3)):
        assert stock_area.contains(shapely.Point(point))


def test_radial_depth_in_the_corner_is_that_of_paper_001() -> None:
    """Largest radial depth 2.103 mm at 14 degrees, from the polygon alone (paper 001, case 1)."""
    (piece,) = stock_polygons(allowance(), [corner()], RADIUS)
    rough = shapely.Polygon(piece.rings[0])
    depths = []
    for degrees in range(31):
        heading = math.radians(degrees)
        centre = np.array([4 * math.sin(heading), 4 - 4 * math.cos(heading)])
        to_wall = np.array([math.sin(heading), -math.cos(heading)])
        circle = shapely.Point(centre).buffer(RADIUS, quad_segs=2000).exterior
        # The points of the tool's circle in the rough stock; the one furthest from the tangent at the wall, ahead.
        crossing = shapely.get_coordinates(circle.intersection(rough.boundary))
        ahead = crossing[(crossing - centre) @ np.array([math.cos(heading), math.sin(heading)]) > 0]
        depths.append(RADIUS - float(((ahead - centre) @ to_wall).min()))
    assert max(depths) == pytest.approx(2.103, abs=1e-3)
    assert int(np.argmax(depths)) == 14


INSIDE = [line((-30, 0), (0, 0)), arc((0, 0), (16, 16), (0, 16), 90), line((16, 16), (16, 46))]
OUTSIDE = [line((-30, 4), (0, 4)), arc((0, 4), (4, 0), (0, 0), -90), line((4, 0), (4, -30))]


@pytest.mark.parametrize(
    ("cut", "centre", "radius", "degrees"),
    [
        # A corner of 20 mm in the part is one of 19.2 mm before, if roughing could do 8.
        (INSIDE, (0, 16), 19.2, (270, 360, 19)),
        # Round a corner of the part, wall on the right, the layer is 0.8 mm everywhere: an arc of 0.8 about the edge.
        (OUTSIDE, (0, 0), 0.8, (0, 90, 10)),
    ],
)
def test_corners_get_the_allowance_all_round(
    cut: list[_core.Segment], centre: tuple[float, float], radius: float, degrees: tuple[float, float, int]
) -> None:
    (piece,) = stock_polygons(allowance(), [_core.Path(cut)], RADIUS)
    rough = shapely.LinearRing(piece.rings[0])
    for angle in np.radians(np.linspace(*degrees)):
        place = shapely.Point(centre[0] + radius * math.cos(angle), centre[1] + radius * math.sin(angle))
        assert rough.distance(place) < NEAR_MM


def test_a_straight_wall_is_a_plain_layer_that_goes_on_beyond_its_ends() -> None:
    stock = allowance(width_mm=6.0)
    result = area(stock_polygons(stock, [_core.Path([line((0, 0), (50, 0))])], RADIUS))
    inside = result.intersection(shapely.box(-2 * RADIUS, -30, 50 + 2 * RADIUS, 30))
    assert inside.area == pytest.approx((50 + 4 * RADIUS) * (6.0 + 2 * 0.8), rel=1e-5)  # it grows to the back as well
    assert inside.bounds == pytest.approx((-8, -4 - 6.8, 58, -3.2), abs=NEAR_MM)


def test_a_pocket() -> None:
    """Path 40 x 20 with a tool of 8: a pocket 48 x 28; with corners of 4, where roughing left 8."""
    (piece,) = stock_polygons(allowance(wall='"right"'), [_core.Path(rectangle(40, 20))], RADIUS)
    assert len(piece.rings) == 2
    hole = shapely.Polygon(piece.rings[1])
    within_reach(hole, shapely.box(-24 + 0.8 + 8, -14 + 0.8 + 8, 24 - 0.8 - 8, 14 - 0.8 - 8), 8)
    assert hole.area == pytest.approx((48 - 1.6) * (28 - 1.6) - (4 - math.pi) * 64, rel=1e-5)


def test_a_boss() -> None:
    """The same path, the other way round: the part is 32 x 12 and has an even layer, rounded at its corners."""
    (piece,) = stock_polygons(allowance(wall='"left"', width_mm=30), [_core.Path(rectangle(40, 20))], RADIUS)
    assert len(piece.rings) == 1
    within_reach(shapely.Polygon(piece.rings[0]), shapely.box(-16, -6, 16, 6), 0.8)


def test_a_wall_of_thousands_of_short_moves_is_one_piece() -> None:
    """A wavy wall, as CAM writes it: the layer is even where the waves are wider than the roughing tool."""
    along = np.linspace(0, 120, 2001)
    points = np.column_stack([along, 3 * np.sin(along / 15)])
    path = _core.Path([line(a, b) for a, b in pairwise(points)])
    (piece,) = stock_polygons(allowance(allowance_mm=0.5, corner_radius_mm=6.0), [path], RADIUS)
    assert len(piece.rings) == 1
    outline = shapely.LineString(piece.rings[0])
    inner = outline.intersection(shapely.box(10, -20, 110, 20))
    front = shapely.get_coordinates(inner)
    front = front[front[:, 1] > 3 * np.sin(front[:, 0] / 15) - 6]
    distances = shapely.distance(shapely.LineString(points), shapely.points(front))
    assert distances == pytest.approx(RADIUS - 0.5, abs=NEAR_MM)


ROUND = _core.Path(rectangle(40, 20))
BEHIND = [line((0, -10), (2, -10)), line((2, -10), (2, -8))]  # over the beginning of the contour, and away
LEAD_IN = line((0, -8), (0, -10))
DOWN = _core.Segment.line([0, -10, Z], [0, -10, 2 * Z], 10.0)
ABOVE = _core.Path([line((-60, 5), (60, 5), 1.0)])
LED_CORNER = _core.Path(
    [
        arc((-35, 5), (-30, 0), (-30, 5), 90),
        line((-30, 0), (0, 0)),
        arc((0, 0), (4, 4), (0, 4), 90),
        line((4, 4), (4, 34)),
        line((4, 34), (-3, 40)),
    ]
)


@pytest.mark.parametrize(
    ("keys", "paths", "same"),
    [
        ({"wall": '"left"'}, [_core.Path(rectangle(40, -20))], [ROUND]),
        ({}, [_core.Path([line((-3, -7), (-3, -7.0001)), line((-3, -7.0001), (0, -10)), *rectangle(40, 20),
                          line((0, -10), (3, -7))])], [ROUND]),
        # Once with a point where the contour began, once straight through it.
        ({}, [_core.Path([LEAD_IN, *rectangle(40, 20), *BEHIND])], [ROUND]),
        ({}, [_core.Path([LEAD_IN, *rectangle(40, 20)[:-1], line((-20, -10), (2, -10)), BEHIND[1]])], [ROUND]),
        ({}, [_core.Path([*rectangle(40, 20), DOWN, *rectangle(40, 20, 2 * Z)])], [ROUND]),
        ({}, [ROUND, ROUND], [ROUND]),
        ({}, [ABOVE, corner()], [corner()]),
        ({"lead_in_mm": 5 * math.pi / 2, "lead_out_mm": math.hypot(7, 6)}, [LED_CORNER], [corner()]),
    ],
    ids=["clockwise, wall on the left", "lead-in and lead-out of a closed contour", "runs over its beginning",
         "straight through its beginning", "two levels", "twice", "moves above the stock", "open with leads"],
)  # fmt: skip
def test_the_same_wall(keys: dict[str, object], paths: list[_core.Path], same: list[_core.Path]) -> None:
    found, plain = (
        area(stock_polygons(allowance(**keys), paths, RADIUS)),
        area(stock_polygons(allowance(), same, RADIUS)),
    )
    assert found.symmetric_difference(plain).area < NEAR_MM2


def test_the_wall_may_be_on_the_left() -> None:
    path = _core.Path([line((0, 0), (50, 0))])
    right = area(stock_polygons(allowance(), [path], RADIUS))
    left = area(stock_polygons(allowance(wall='"left"'), [path], RADIUS))
    mirrored = shapely.transform(right, lambda points: points * [1, -1])
    assert left.symmetric_difference(mirrored).area < NEAR_MM2


def test_a_thin_wall_between_two_pockets_is_no_stock_inside_either() -> None:
    shift = 52.0  # pockets 48 wide: 4 mm between them
    aside = np.array([shift, 0, 0])
    second = [_core.Segment.line(one.start_mm + aside, one.end_mm + aside, 10.0) for one in rectangle(40, 20)]
    result = area(stock_polygons(allowance(), [_core.Path(rectangle(40, 20)), _core.Path(second)], RADIUS))
    between = result.intersection(shapely.LineString([(0, 0), (shift, 0)]))
    assert between.length == pytest.approx(4 + 2 * 0.8, abs=NEAR_MM)


LOOP = [line((50, 0), (52, 0)), line((52, 0), (52, 2)), line((52, 2), (50, 2)), line((50, 2), (50, 0))]
CROSSING = [line((0, 0), (20, 0)), line((20, 0), (20, 10)), line((20, 10), (10, 10)), line((10, 10), (10, -15))]


@pytest.mark.parametrize(
    ("keys", "path", "expected"),
    [
        ({"corner_radius_mm": 3}, corner(), "s.toml:3: allowance.corner_radius_mm = 3.0: tool larger than the corner: "
         "must not be below the tool's radius, 4 mm"),
        ({"corner_radius_mm": 14}, ROUND, "needs 29.6 mm, the pocket is 28 mm wide"),
        ({"wall": '"left"'}, _core.Path(rectangle(8, 8)), "the tool removes everything inside the closed contour"),
        ({}, _core.Path([line((0, 0), (50, 0)), *LOOP, line((50, 0), (50, -40))]),
         "only 8 of 98 mm of a sequence of cutting moves are closed"),
        ({"wall": '"left"'}, _core.Path(CROSSING), "describe the stock as [polygon]"),
        ({}, ABOVE, "s.toml:5: allowance.z_mm = [-15.0, 0.0]: no cutting move of the program is below the top"),
        ({"lead_in_mm": 60, "lead_out_mm": 60}, LED_CORNER, "no wall remains"),
    ],
)  # fmt: skip
def test_a_stock_that_does_not_suit_the_program(keys: dict[str, object], path: _core.Path, expected: str) -> None:
    with pytest.raises(StockError, match=re.escape(expected)):
        stock_polygons(allowance(**keys), [path], RADIUS)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", "s.toml: must have exactly one of the tables box, polygon, allowance, program: has none of them"),
        (
            "[box]\nx_mm = [0, 1]\ny_mm = [0, 1]\nz_mm = [0, 1]\n"
            "[polygon]\npoints_mm = [[0, 0], [1, 0], [1, 1]]\nz_mm = [0, 1]\n",
            "s.toml: must have exactly one of the tables box, polygon, allowance, program: has box and polygon",
        ),
        (
            "[box]\nx_mm = [0, 1]\ny_mm = [2, 2]\nz_mm = [0, 1]\n",
            "s.toml:3: box.y_mm = [2.0, 2.0]: the first number must be smaller than the second",
        ),
        (
            "[box]\nx_mm = [0, 1, 2]\ny_mm = [0, 2]\nz_mm = [0, 1]\n",
            "s.toml:2: box.x_mm = [0, 1, 2]: must have 2 or fewer values",
        ),
        (
            "[box]\nx_mm = [0, inf]\ny_mm = [0, 2]\nz_mm = [0, 1]\n",
            "s.toml:2: box.x_mm.2 = inf: must be a finite number",
        ),
        ("[box]\nx_mm = [0, 1]\nz_mm = [0, 1]\n", "s.toml: box.y_mm: required, but missing (unit: mm)"),
        (
            "[polygon]\npoints_mm = [[0,0],[1,0]]\nz_mm = [0,1]\n",
            "s.toml:2: polygon.points_mm = [[0, 0], [1, 0]]: must have 3 or more values",
        ),
        ("[circle]\nr = 1\n", "s.toml:1: circle = {...}: unknown key; known here: box, polygon, allowance, program"),
        (
            '[allowance]\nallowance_mm = 0.5\ncorner_radius_mm = 8\nwall = "inside"\nz_mm = [-1, 0]\n',
            's.toml:4: allowance.wall = "inside": must be "left" or "right"',
        ),
        (
            '[program]\nfile = "a.nc"\ntool = "t.toml"\n[program.on]\n',
            "s.toml:4: program.on: must have exactly one of the tables box, polygon: has none of them",
        ),
    ],
)
def test_a_bad_value_is_named_with_its_line_and_limit(text: str, expected: str) -> None:
    assert expected in complaint(text)


def test_a_bad_point_is_the_only_problem_of_its_list() -> None:
    text = '[polygon]\npoints_mm = [\n  [0, 0],\n  [1, "a"],\n  [1, 1]\n]\nz_mm = [0, 1]\n'
    assert complaint(text) == 's.toml:2: polygon.points_mm.2.2 = "a": must be a number (unit: mm)'


@pytest.mark.parametrize(
    ("points", "holes", "expected"),
    [
        ("[[0,0],[2,2],[2,0],[0,2]]", "[]", "s.toml:2: polygon.points_mm: must enclose an area: Self-intersection"),
        ("[[0,0],[1,1],[2,2]]", "[]", "s.toml:2: polygon.points_mm: must enclose an area"),
        ("[[0,0],[9,0],[9,9]]", "[[[1,1],[2,2],[2,1],[1,2]]]", "s.toml:3: polygon.holes_mm.1: must enclose an area"),
    ],
)
def test_a_polygon_that_is_none(points: str, holes: str, expected: str) -> None:
    stock = Stock.from_toml(f"[polygon]\npoints_mm = {points}\nholes_mm = {holes}\nz_mm = [0, 1]\n", "s.toml")
    with pytest.raises(StockError) as caught:
        stock_polygons(stock, [], RADIUS)
    assert expected in str(caught.value)


def test_a_file_is_read_from_disk(tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text(STOCK_EXAMPLES["A block"], encoding="utf-8")
    stock = Stock.load(tmp_path / "s.toml")
    assert stock.kind == "box"
    assert stock.beside("a.nc") == tmp_path / "a.nc"
    with pytest.raises(FileNotFoundError):
        Stock.load(tmp_path / "none.toml")
    assert issubclass(StockError, FileError)
