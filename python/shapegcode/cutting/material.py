"""The core's material before the first block of a program, from its stock file."""

from collections.abc import Sequence

import numpy as np

from shapegcode import _core
from shapegcode.cutting.stock import Rough, Stock, StockPiece
from shapegcode.cutting.tool import Tool
from shapegcode.errors import StockError
from shapegcode.machine import Machine
from shapegcode.program import Program
from shapegcode.settings.keys import toml

_RAMP_STEP_RATIO = 0.1  # of the tool's diameter: height of the layers on ramps and helices
_MAX_LAYERS = 200  # a sweep takes time for every layer above the tip


def stock_polygons(stock: Stock, paths: Sequence[_core.Path], tool_radius_mm: float) -> list[StockPiece]:
    """The stock as prisms over polygons; for the kind `program`, the stock before the roughing program."""
    solid = stock if stock.program is None else stock.program.on
    if solid.box is None:
        # Only here, because Shapely takes time to load.
        from shapegcode.cutting.stock_shape import shaped_pieces

        return shaped_pieces(stock, paths, tool_radius_mm)
    (left, right), (front, back) = solid.box.x_mm, solid.box.y_mm
    outline = np.array([(left, front), (right, front), (right, back), (left, back)])
    return [StockPiece((outline,), *solid.box.z_mm)]


def build_material(
    stock: Stock,
    paths: Sequence[_core.Path],
    tool: Tool,
    resolution_mm: float,
    machine: Machine,
    *,
    others: Sequence[_core.Path] = (),
) -> _core.Material:
    """Build the material before the first block of a program; stock of kind `program` is swept by the roughing tool."""
    pieces = stock_polygons(stock, paths, tool.radius_mm)
    rough = stock.program
    diameter_mm = 0.0 if rough is None else Tool.load(stock.beside(rough.tool)).tool.diameter_mm
    moves = [] if rough is None else _moves(stock, rough, machine)
    step = _RAMP_STEP_RATIO * tool.tool.diameter_mm
    borders = _core.layer_borders([*moves, *paths, *others], pieces[0].bottom_mm, pieces[0].top_mm, step)
    material = _core.Material([ring for piece in pieces for ring in piece.rings], _fewer(borders), resolution_mm)
    for path in moves:
        _core.sweep(material, path, diameter_mm)
    return material


def _fewer(borders_mm: Sequence[float]) -> list[float]:
    """Limit the number of heights by merging the closest ones: a surface milled in 3-D has very many."""
    borders = list(borders_mm)
    least_mm = (borders[-1] - borders[0]) / (4.0 * _MAX_LAYERS)
    while len(borders) > _MAX_LAYERS + 1:
        kept = borders[:1]
        for border in borders[1:-1]:
            if border - kept[-1] >= least_mm:
                kept.append(border)
        borders = [*kept, borders[-1]]
        least_mm *= 1.5
    return borders


def _moves(stock: Stock, rough: Rough, machine: Machine) -> list[_core.Path]:
    program = Program.read(stock.beside(rough.file), machine)

    def refusal(reason: str, line: int = 0) -> StockError:
        where = f"{program.place(line)}: " if line else ""
        return stock.error("program.file", toml(rough.file), f"{where}{reason}")

    tools = sorted({tool for _, tool, _ in program.core.functions if tool > 0})
    if len(tools) > 1:
        names = ", ".join(f"T{tool}" for tool in tools)
        raise refusal(f"uses the tools {names}: must use one, that of program.tool")
    systems = {(region.exit.coordinate_system, region.exit.coordinate_number) for region in program.regions}
    if len(systems) > 1:
        names = ", ".join(f"G{system}" for system, _ in sorted(systems))
        raise refusal(f"cuts in the work coordinates {names}: must cut in one")
    paths, moves = [], program.core.other_moves
    for kind, index, line in program.core.steps:
        if kind == _core.StepKind.region:
            region = program.regions[index]
            if region.incremental:
                raise refusal("the position of these moves is unknown", line)
            paths.append(region.path)
        elif kind == _core.StepKind.move:
            segment, dwell_s = moves[index]
            if dwell_s == 0 and segment.length_mm > 0:
                paths.append(_core.Path([segment]))
    for path in paths:
        for index in range(len(path)):
            if path[index].kind == _core.SegmentKind.arc and path[index].normal != 2:
                raise refusal("an arc that is not in the XY plane (G17)", path[index].line_number)
    if not program.regions:
        raise refusal("has no cutting moves")
    return paths
