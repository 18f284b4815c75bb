"""What the tool meets on its way through a program: the stock is swept move by move, in the order of the program."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from shapegcode import _core
from shapegcode.cutting.stock import Stock
from shapegcode.cutting.stock_material import build_material
from shapegcode.cutting.tool import Tool
from shapegcode.feed.walk import SurveyedMove, SurveyedRegion, Walk, why_not_swept
from shapegcode.machine import Machine
from shapegcode.program import Program
from shapegcode.program.compensation import program_for_conversion

__all__ = ["Survey", "survey"]

_COARSEST = 0.1  # resolution, of the smallest tool's radius
_RESOLUTION_RATIO = 0.01  # of the smallest tool's diameter

Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class Survey:
    """A program swept through its stock.

    Attributes:
        program: what was swept.
        regions: its regions in order.
        moves: cutting moves outside of them that meet material.
        material: what is left.
        warnings: what was noticed on the way, each with its place.
    """

    program: Program
    regions: tuple[SurveyedRegion, ...]
    moves: tuple[SurveyedMove, ...]
    material: _core.Material
    warnings: tuple[str, ...]


def survey(
    program: Program | str | Path,
    machine: Machine | str | Path,
    tools: Tool | Sequence[Tool],
    stock: Stock,
    *,
    resolution_mm: float | None = None,
    on_progress: Progress = lambda _done, _total: None,
) -> Survey:
    """What the tool meets on its way through a program.

    Args:
        program: what to sweep, or its file.
        machine: whose controller runs it.
        tools: what cuts; several need their T numbers.
        stock: what is there before the first block.
        resolution_mm: grid of the material; None: a hundredth of the smallest tool's diameter.
        on_progress: called with steps done and steps in all.

    Returns:
        Per region of the program the engagement along its path, and the material that is left.

    Raises:
        ProgramError: the program cannot be read.
        ArgumentError: no tool, tools that cannot be told apart, no cutting move, or a grid that does not fit into
            memory.
        StockError: the stock does not suit the program.
    """
    machine = Machine.of(machine)
    tools = [tools] if isinstance(tools, Tool) else list(tools)
    if not tools:
        raise _core.ArgumentError("no tool is given: at least one must cut")
    program = program_for_conversion(program, machine)
    walk = Walk(program, tools)
    material = _material(walk, program, machine, tools, stock, resolution_mm)
    if any(tool.feed.air_feed_mm_per_min is not None for tool in tools):
        walk.cautious = material.copy()
        walk.cautious.take_whole_layers()
    regions: list[SurveyedRegion] = []
    total = len(program.core.steps)
    for done, (kind, index, line) in enumerate(program.core.steps):
        if kind == _core.StepKind.function:
            walk.function(index)
        elif kind == _core.StepKind.move:
            walk.sweep_other(material, index, line)
        else:
            regions.append(walk.sweep_region(material, index))
        on_progress(done + 1, total)
    walk.tell_collisions()  # first of all, as nothing else is right if they are
    known = [region.track for region in regions if region.track is not None]
    if known and not any(track.section_mm2.any() for track in known):
        walk.warnings.append(
            f"{program.source}: the tool never touches the stock: see where it lies, in the program's own coordinates"
        )
    return Survey(program, tuple(regions), tuple(walk.moves), material, tuple(walk.warnings))


def _material(
    walk: Walk, program: Program, machine: Machine, tools: Sequence[Tool], stock: Stock, resolution_mm: float | None
) -> _core.Material:
    """The stock on a grid, its layers where the program moves."""
    cutters = walk.tools_of_regions()
    reasons = [why_not_swept(region, walk.zero) for region in program.regions]
    swept = [index for index, reason in enumerate(reasons) if not reason and cutters[index] is not None]
    if not swept:
        why = next((f": {reason}" for reason in reasons if reason), walk.why_no_tool(cutters))
        if program.core.kept_compensated_moves:
            why = ': they run under cutter compensation that is kept as it stands; set input.compensation = "expand"'
        raise _core.ArgumentError(f"{program.source}: no cutting moves whose engagement can be computed{why}")
    smallest = min(tools, key=lambda tool: tool.radius_mm)
    if resolution_mm is not None and not 0.0 < resolution_mm <= _COARSEST * smallest.radius_mm:
        raise _core.ArgumentError(
            f"resolution is {resolution_mm:g} mm, must be above 0 and at most {_COARSEST * smallest.radius_mm:g} mm "
            f"(a tenth of the radius of {smallest.tool.name})"
        )
    resolution = resolution_mm or _RESOLUTION_RATIO * smallest.tool.diameter_mm
    # The walls of an allowance are those that the finishing tool leaves.
    walls = [program.regions[index].path for index in swept if cutters[index] is smallest]
    others = [program.regions[index].path for index in swept if cutters[index] is not smallest]
    return build_material(stock, walls, smallest, resolution, machine, others=[*others, *walk.cuts_elsewhere()])
