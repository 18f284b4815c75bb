"""The test piece of paper 004's comparison: read by LinuxCNC's interpreter and milled out of a block here."""

import math
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

import shapegcode as sg
from acceptance import convert, machine_with
from rs274_tool import canonical_moves, run_rs274
from shapegcode.io.units import FloatArray

WRITER = Path(__file__).parents[1] / "tools" / "write_test_piece.py"
TEXT = (resources.files("shapegcode") / "data" / "iso10791_7.nc").read_text(encoding="ascii")
DIAMETERS_MM = {1: 63.0, 2: 20.0, 3: 16.0, 4: 10.0, 5: 14.0, 6: 16.0, 7: 26.0, 8: 30.0}
DRILLS = {4, 5, 7, 8}  # cut straight down
CELL_MM, STEP_MM = 0.5, 1.0
STOCK_HALF_MM, STOCK_TOP_MM = 90.0, 2.0
HOME_MM = 100.0  # above this: on the way to the reference position


@dataclass(frozen=True)
class Cut:
    """A straight or circular move as LinuxCNC understands it, as points, and its exact length."""

    tool: int
    rapid: bool
    points: FloatArray
    length_mm: float


def canonical(tmp_path: Path) -> list[str]:
    """LinuxCNC knows O words only as its own subprograms: that line goes."""
    text = "\n".join(line for line in TEXT.splitlines() if not line.startswith("O"))
    tools = "".join(f"T{number} P{number} Z2 D{diameter / 25.4:.6f}\n" for number, diameter in DIAMETERS_MM.items())
    return run_rs274(text, tmp_path, tools=tools, variables="5220\t1\n5223\t-20\n")


def cuts(lines: list[str]) -> Iterator[Cut]:
    """The moves of rs274's output; those from or to the reference position are left out."""
    for move in canonical_moves(lines):
        if move.kind != "dwell" and max(move.start[2], move.end[2]) < HOME_MM:
            count = max(2, math.ceil(move.length_mm / STEP_MM) + 1)
            yield Cut(move.tool, move.kind == "rapid", move.points(np.linspace(0.0, 1.0, count)), move.length_mm)


class Block:
    """The stock as the height of its top over a grid."""

    def __init__(self) -> None:
        count = round(2 * STOCK_HALF_MM / CELL_MM)
        self.axis = (np.arange(count) + 0.5) * CELL_MM - STOCK_HALF_MM
        self.top = np.full((count, count), STOCK_TOP_MM)

    def under(self, tool: int, point: FloatArray) -> tuple[tuple[slice, slice], npt.NDArray[np.bool_]]:
        """The window of the grid under a tool and the cells of it that the tool covers."""
        radius = DIAMETERS_MM[tool] / 2.0
        x, y = (slice(*np.searchsorted(self.axis, [value - radius, value + radius])) for value in (point[0], point[1]))
        gap = (self.axis[x, None] - point[0]) ** 2 + (self.axis[None, y] - point[1]) ** 2
        return (x, y), gap <= radius**2


def test_the_file_is_what_its_writer_writes() -> None:
    run = subprocess.run([sys.executable, WRITER], capture_output=True, text=True, check=True)
    assert run.stdout == TEXT


@pytest.mark.slow
def test_milled_out_of_a_block_it_is_the_piece_and_no_rapid_touches_material(tmp_path: Path) -> None:
    block = Block()
    for cut in cuts(canonical(tmp_path)):
        straight_down = not np.ptp(cut.points[:, :2], axis=0).any()
        # A vertical move covers the same cells all the way: its lowest point counts.
        points = cut.points[[int(cut.points[:, 2].argmin())]] if straight_down else cut.points
        for point in points:
            window, covered = block.under(cut.tool, point)
            heights = block.top[window]
            deepest = float(np.where(covered, heights, -math.inf).max(initial=-math.inf)) - point[2]
            where = f"tool {cut.tool} at {np.round(point, 3)}"
            if cut.rapid:
                lifts = straight_down and cut.points[-1, 2] > cut.points[0, 2]
                assert deepest < (1e-6 if lifts else -0.2), f"{where}: rapid {deepest:.3f} mm into the material"
            elif straight_down and cut.tool not in DRILLS:
                assert deepest < 1e-6, f"{where}: plunge {deepest:.3f} mm into the material"
            block.top[window] = np.where(covered, np.minimum(heights, point[2]), heights)

    x, y = np.meshgrid(block.axis, block.axis, indexing="ij")

    def outside_square(half: float, turn_deg: float) -> FloatArray:
        """Distance from the sides of a turned square, outwards positive."""
        c, s = math.cos(math.radians(turn_deg)), math.sin(math.radians(turn_deg))
        return np.maximum(np.abs(c * x + s * y), np.abs(-s * x + c * y)) - half

    radius = np.hypot(x, y)
    corner = np.hypot(np.abs(x) - 52.0, np.abs(y) - 52.0)
    edges = [
        outside_square(80, 0),
        outside_square(74, 3),
        outside_square(54, 30),
        radius - 54,
        corner - 14,
        corner - 13,
    ]
    height = np.select([edges[0] > 0, edges[1] > 0, edges[2] > 0, edges[3] > 0], [-40.0, -24.0, -16.0, -8.0], 0.0)
    height = np.where(corner < 14, -22.0, height)
    bored = (corner < 13) | (radius < 15)
    sharp = np.min([np.abs(edge) for edge in (*edges, radius - 15)], axis=0) > 0.75 * CELL_MM
    # Between the corners of two shapes nothing is left standing, and nothing is cut that belongs to the piece.
    assert block.top[sharp & ~bored] == pytest.approx(height[sharp & ~bored], abs=1e-6)
    assert block.top[sharp & bored].max() <= -44.0


def test_linuxcnc_and_the_package_cut_the_same_length(tmp_path: Path) -> None:
    program = sg.Program.from_text(TEXT, machine_with({}))
    assert program.warnings == []
    # Cycles are moves outside of the regions here: left out there by their tools.
    theirs = sum(cut.length_mm for cut in cuts(canonical(tmp_path)) if not cut.rapid and cut.tool not in DRILLS)
    ours = sum(region.path.length_mm for region in program.regions)
    assert ours == pytest.approx(theirs, rel=1e-6)


def test_feeds_are_those_of_a_machine_like_the_vx500_and_take_half_an_hour() -> None:
    program = sg.Program.from_text(TEXT, machine_with({}))
    feeds = [region.path[k].feed_mm_per_s * 60 for region in program.regions for k in range(len(region.path))]
    assert 80 <= min(feeds) <= max(feeds) <= 1000
    assert sum(region.path.programmed_time_s for region in program.regions) > 1800


@pytest.mark.slow
def test_it_converts_within_tolerance() -> None:
    judged = convert(TEXT, machine_with({}))
    assert judged.conversion.ok
