"""The material that a stock file makes: volumes in closed form, the analytic corner, what a roughing program leaves."""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import shapely

from shapegcode import _core
from shapegcode.cutting.material import build_material, stock_polygons
from shapegcode.cutting.stock import Stock
from shapegcode.cutting.tool import Tool
from shapegcode.errors import StockError
from shapegcode.machine import Machine

TOOL = """\
[tool]
name = "tool"
diameter_mm = {diameter}
flutes = 4
helix_deg = 30
flute_length_mm = 20
overhang_mm = 30
[cutting]
material = "steel-s55c"
"""
ON_BLOCK = """\
[program]
file = "rough.nc"
tool = "rough.toml"
[program.on.box]
x_mm = [0, 60]
y_mm = [0, 40]
z_mm = [-10, 0]
"""
ROUGH = """\
%
O1 (ROUGH)
G90 G54 G00 X-10. Y20. Z5.
S2000 M03
G01 Z-5. F300.
X70. F500.
G00 Z5.
M30
%
"""


def tool(diameter: float) -> Tool:
    return Tool.from_toml(TOOL.format(diameter=diameter))


def straight(z: float) -> _core.Path:
    return _core.Path([_core.Segment.line([-20, 0, z], [80, 0, z], 10.0)])


@pytest.fixture(scope="module")
def machine() -> Machine:
    return Machine.load("vx500")


Job = Callable[..., Stock]


@pytest.fixture
def job(tmp_path: Path) -> Job:
    """Writes a stock file with its roughing program and tool, and loads it."""

    def write(program: str = ROUGH, diameter: float = 10.0, stock: str = ON_BLOCK) -> Stock:
        (tmp_path / "rough.nc").write_text(program, encoding="ascii")
        (tmp_path / "rough.toml").write_text(TOOL.format(diameter=diameter), encoding="ascii")
        (tmp_path / "s.toml").write_text(stock, encoding="ascii")
        return Stock.load(tmp_path / "s.toml")

    return write


def test_a_polygon_with_a_hole_has_its_volume(machine: Machine) -> None:
    stock = Stock.from_toml(
        "[polygon]\npoints_mm = [[0, 0], [40, 0], [40, 30], [0, 30]]\n"
        "holes_mm = [[[10, 10], [20, 10], [20, 20], [10, 20]]]\nz_mm = [-8, 2]\n"
    )
    material = build_material(stock, [straight(-3)], tool(8), 0.1, machine)
    assert material.volume_mm3 == pytest.approx((1200 - 100) * 10, rel=2e-3)
    assert (material.bottom_mm, material.top_mm) == (-8, 2)
    assert any(border == pytest.approx(-3) for border in material.borders_mm)
    assert not material.is_material(15, 15, 0)
    assert material.is_material(5, 15, 0)


def test_an_allowance_is_the_stock_of_the_analytic_corner() -> None:
    """Three cases of paper 001: the polygon of the allowance against that of the corner in closed form."""
    for rough, finish in ((8.0, 8.0), (4.0, 4.0), (8.0, 4.0)):
        cut = _core.CornerCut(4.0, rough, finish, 0.8, before_mm=20, after_mm=20)
        stock = Stock.from_toml(
            f'[allowance]\nallowance_mm = 0.8\ncorner_radius_mm = {rough}\nwall = "right"\nz_mm = [-15, 0]\n'
        )
        pieces = stock_polygons(stock, [cut.path(3.6, -15.0)], 4.0)
        mine = shapely.union_all([shapely.Polygon(piece.rings[0], piece.rings[1:]) for piece in pieces])
        theirs = shapely.Polygon(cut.stock(10.0))
        # Where the tool comes to: both go on beyond the ends, each as far as it likes, and behind the finished wall.
        track = np.array(cut.path(3.6, -15.0).polyline(0.01))[:, :2]
        reach = shapely.LineString(track).buffer(4.0, quad_segs=200)
        difference = mine.intersection(reach).symmetric_difference(theirs.intersection(reach))
        assert difference.area < 0.02  # mm², over 60 mm of wall: 0.3 µm


def test_the_tool_meets_the_allowance_as_in_paper_001(machine: Machine) -> None:
    cut = _core.CornerCut(4.0, 8.0, 8.0, 0.8, before_mm=20, after_mm=20)
    stock = Stock.from_toml('[allowance]\nallowance_mm = 0.8\ncorner_radius_mm = 8\nwall = "right"\nz_mm = [-15, 0]\n')
    path = cut.path(3.6, -15.0)
    material = build_material(stock, [path], tool(8), 0.04, machine)
    track = _core.sweep(material, path, 8.0)
    middle = (track.s_mm > 2) & (track.s_mm < 10)
    assert track.radial_depth_mm[middle] == pytest.approx(0.8, abs=0.02)
    assert track.radial_depth_mm.max() == pytest.approx(2.103, abs=0.03)


def test_a_roughing_program_leaves_the_block_less_its_slot(job: Job, machine: Machine) -> None:
    material = build_material(job(), [straight(-8)], tool(8), 0.1, machine)
    assert material.volume_mm3 == pytest.approx(60 * 40 * 10 - 60 * 10 * 5, rel=2e-3)
    assert any(border == pytest.approx(-5) for border in material.borders_mm)  # of the roughing program
    assert any(border == pytest.approx(-8) for border in material.borders_mm)  # of this one
    assert not material.is_material(30, 20, -4.9)
    assert material.is_material(30, 20, -5.1)
    assert material.is_material(30, 25.2, -1)


def test_single_moves_of_the_roughing_program_count(job: Job, machine: Machine) -> None:
    """A pocket as deep as the tool plunges with a rapid that the stock file's owner will have to explain: gone, too."""
    plunge = ROUGH.replace("G01 Z-5. F300.\nX70. F500.", "G00 X30.\nG00 Z-5.")
    with pytest.raises(StockError, match="has no cutting moves"):
        build_material(job(plunge), [straight(-8)], tool(8), 0.1, machine)
    plunge = ROUGH.replace("X70. F500.", "G00 Z5.\nG00 X30.\nG00 Z-5.")
    material = build_material(job(plunge), [straight(-8)], tool(8), 0.1, machine)
    assert material.volume_mm3 == pytest.approx(60 * 40 * 10 - math.pi * 25 * 5, rel=2e-3)


BACK = "G00 Z5.\nM30"


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("S2000 M03", "T1 M06\nS2000 M03\nT2", "uses the tools T1, T2: must use one"),
        ("X70. F500.", "G18 G03 X-4. Z1. I3. K3. F500.", "rough.nc:6: an arc that is not in the XY plane (G17)"),
        (BACK, f"G55\nG00 X0 Y0\nG01 Z-6. F100.\nX50.\n{BACK}", "cuts in the work coordinates G54, G55: must cut in"),
        ("G54 G00 X-10. Y20. Z5.", "G91 G01 X1. F500.", "the position of these moves is unknown"),
    ],
    ids=["tools", "plane", "coordinates", "place"],
)
def test_a_roughing_program_that_cannot_be_swept(job: Job, machine: Machine, old: str, new: str, expected: str) -> None:
    assert old in ROUGH
    program = ROUGH.replace(old, new)
    with pytest.raises(StockError) as caught:
        build_material(job(program), [straight(-8)], tool(8), 0.1, machine)
    assert 's.toml:2: program.file = "rough.nc": ' in str(caught.value)
    assert expected in str(caught.value)


def test_a_missing_file_is_named(job: Job, machine: Machine, tmp_path: Path) -> None:
    stock = job()
    (tmp_path / "rough.nc").unlink()
    with pytest.raises(FileNotFoundError, match=r"rough\.nc"):
        build_material(stock, [straight(-8)], tool(8), 0.1, machine)
    (tmp_path / "rough.toml").unlink()
    with pytest.raises(FileNotFoundError, match=r"rough\.toml"):
        build_material(stock, [straight(-8)], tool(8), 0.1, machine)
