"""The stock of a stock file as the core's material, ready for the tool to be swept through it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from shapegcode import _core
from shapegcode.cutting.stock import Rough, Stock
from shapegcode.cutting.stock_shape import stock_polygons
from shapegcode.cutting.tool import Tool
from shapegcode.errors import StockError
from shapegcode.program import Program
from shapegcode.settings.keys import toml

if TYPE_CHECKING:
    from shapegcode.machine import Machine

__all__ = ["build_material"]

# Height of the layers on ramps and helices.
_RAMP_STEP_RATIO = 0.1  # of the tool's diameter
_MOST_LAYERS = 200  # sweeping one costs time in every layer above the tip


def build_material(
    stock: Stock,
    paths: Sequence[_core.Path],
    tool: Tool,
    resolution_mm: float,
    machine: Machine,
    *,
    others: Sequence[_core.Path] = (),
) -> _core.Material:
    """The material before the first block of a program.

    What a roughing program leaves is computed by sweeping its tool through what was there before.
    """
    pieces = stock_polygons(stock, paths, tool.radius_mm)
    bottom, top = pieces[0].bottom_mm, pieces[0].top_mm
    rings = [ring for piece in pieces for ring in piece.rings]
    step = _RAMP_STEP_RATIO * tool.tool.diameter_mm
    if stock.program is None:
        return _core.Material(rings, _fewer(_core.layer_borders([*paths, *others], bottom, top, step)), resolution_mm)
    rough = Tool.load(stock.beside(stock.program.tool))
    moves = _moves(stock, stock.program, machine)
    borders = _fewer(_core.layer_borders([*moves, *paths, *others], bottom, top, step))
    material = _core.Material(rings, borders, resolution_mm)
    for path in moves:
        _core.sweep(material, path, rough.tool.diameter_mm)
    return material


def _fewer(borders_mm: Sequence[float]) -> list[float]:
    """At most so many heights: those that lie closest together become one, as in a surface that is milled in 3-D."""
    borders = list(borders_mm)
    least_mm = (borders[-1] - borders[0]) / (4.0 * _MOST_LAYERS)
    while len(borders) > _MOST_LAYERS + 1:
        kept = borders[:1]
        for border in borders[1:-1]:
            if border - kept[-1] >= least_mm:
                kept.append(border)
        borders = [*kept, borders[-1]]
        least_mm *= 1.5
    return borders


def _moves(stock: Stock, rough: Rough, machine: Machine) -> list[_core.Path]:
    """The moves of the roughing program in order, each run of cutting moves as one path."""
    program = Program.read(stock.beside(rough.file), machine)

    def refuse(line: int, reason: str) -> StockError:
        return stock.error("program.file", toml(rough.file), f"{program.place(line)}: {reason}")

    tools = sorted({tool for _, tool, _ in program.core.functions if tool > 0})
    if len(tools) > 1:
        names = ", ".join(f"T{tool}" for tool in tools)
        raise stock.error(
            "program.file", toml(rough.file), f"uses the tools {names}: must use one, as program.tool says"
        )
    systems = {(region.exit.coordinate_system, region.exit.coordinate_number) for region in program.regions}
    if len(systems) > 1:
        names = ", ".join(f"G{system}" for system, _ in sorted(systems))
        raise stock.error("program.file", toml(rough.file), f"cuts in the work coordinates {names}: must cut in one")
    paths, moves = [], program.core.other_moves
    for kind, index, line in program.core.steps:
        if kind == _core.StepKind.region:
            region = program.regions[index]
            if region.incremental:
                raise refuse(line, "the place of these moves is not known")
            paths.append(region.path)
        elif kind == _core.StepKind.move:
            segment, dwell_s = moves[index]
            if dwell_s == 0 and segment.length_mm > 0:
                paths.append(_core.Path([segment]))
    for path in paths:
        for index in range(len(path)):
            if path[index].kind == _core.SegmentKind.arc and path[index].normal != 2:
                raise refuse(path[index].line_number, "an arc that is not in the XY plane (G17)")
    if not program.regions:
        raise stock.error("program.file", toml(rough.file), "holds no cutting moves")
    return paths
