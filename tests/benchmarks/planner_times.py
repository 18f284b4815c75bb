"""Cycle times by the models of open planners beside Klipper's own host: the table of docs/concepts/planner_models.md.

    .venv/bin/python tests/benchmarks/planner_times.py

Cuts of the programs of tests/golden/programs at six times their feed, 2 000 mm/s² in all axes, at most 25 of each.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

from places import GOLDEN
from table import markdown

import shapegcode as sg
from planner_references import klipper_points
from shapegcode import _core
from shapegcode.machine.controller import PLANNER_NAMES
from shapegcode.model.machine_model import fanuc_model

NAMES = ("CONTOUR_R.NC", "VINT_360arc.NC", "helical_bore.nc", "TEST_G90.NC", "PROGRAM2.NC", "PARALLEL.NC")
KLIPPER = {"velocity": 500.0, "acceleration": 2000.0, "square_corner_velocity": 5.0, "arc_mm": 1.0}
MAX_CUTS, FASTER = 25, 6.0


def machine_of(kind: str) -> sg.Machine:
    """The same limits for every control."""
    axes = {f"axes.{axis}.max_acceleration_mm_s2": 2000.0 for axis in "xyz"}
    rates = {f"axes.{axis}.max_feed_mm_per_min": 30_000.0 for axis in "xyz"}
    own = {"controller.kind": kind, "input.tool_change_unknown_axes": ""}
    return sg.Machine.load("vx500").with_values({**axes, **rates, **own})


def time_s(path: _core.Path, machine: sg.Machine) -> float:
    """By the model."""
    model = fanuc_model(machine, feed_override=FASTER)
    limits = model.limits
    limits.feed_override = FASTER
    rules = model.planner
    rules.max_feed_override = max(rules.max_feed_override, FASTER)
    return float(_core.controlled_motion(path, limits, rules)[1].duration_s)


def faster(path: _core.Path) -> _core.Path:
    """The feeds of the table."""
    return _core.Path([
        _core.Segment.line(each.start_mm, each.end_mm, each.feed_mm_per_s * FASTER)
        if each.kind == _core.SegmentKind.line
        else _core.Segment.arc(
            each.start_mm, each.end_mm, each.centre_mm, each.sweep_rad, each.feed_mm_per_s * FASTER, each.normal
        )
        for each in path  # type: ignore[attr-defined]
    ])  # fmt: skip


def main() -> None:
    """Print the table."""
    machines = {kind: machine_of(kind) for kind in PLANNER_NAMES}
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for name in NAMES:
            program = sg.Program.from_text((GOLDEN / name).read_text(), machines["fanuc"])
            paths = [region.path for region in program.regions[:MAX_CUTS]]
            own = sum(klipper_points(faster(path), KLIPPER, Path(folder))[1] for path in paths)
            times = [sum(time_s(path, machine) for path in paths) for machine in machines.values()]
            rows.append([name, str(len(paths)), *(f"{each:.3f}" for each in times), f"{own:.3f}"])
    print(markdown(["program", "cuts", *(f"{each}, s" for each in PLANNER_NAMES.values()), "Klipper's host, s"], rows))


if __name__ == "__main__":
    main()
