"""The figures of contour-preserving shaping: `python tests/benchmarks/contour_figures.py` prints them.

Everything is measured on the emitted text by an interpreter, player and plant that share no code with the tool.
"""

from __future__ import annotations

import argparse
import functools
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import places  # noqa: F401

import shapegcode as sg
from acceptance import Judged, convert, machine_with
from judge import Move, path_polyline, play, residual_um, response
from judge.plant import contour_error_um
from shapegcode import _core
from shapegcode.conversion.write import RegionWriter
from shapegcode.demos.path import path_program
from shapegcode.model.machine_model import MachineModel, motion_limits
from shapegcode.shaping.grid import choose_grid

Vector = npt.NDArray[np.float64]

MODES = [[(46.0, 0.02)], [(131.0, 0.02)], None]
TICK_S = 1e-3
ARC_FEED_RATIO = 0.99
TARGETS = ("off", "command", "response")
TOLERANCES_UM = (2.0, 5.0, 10.0, 20.0)


@dataclass(frozen=True)
class Figures:
    """What an emitted program does; µm, s, mm/s²."""

    command_um: float  # largest distance of the set-points from the programmed path
    response_um: float  # of the table
    residual_um: Vector  # X and Y, from the stop on
    time_s: float  # from the first block to the last set-point
    peak_acceleration: Vector  # of X and Y; change of the block velocity per block period
    orbit_percent: float  # area between the set-points and the arc of paper 000, of the quarter disc (paper only)
    # of the set-points where they are nearest to the corner of `corner`, mm/s (there only)
    corner_speed: float = math.nan


def peak_acceleration(points: Vector, block_period_s: float) -> Vector:
    """Largest second difference on the block grid of X and Y, at rest before and behind."""
    grid = points[:: round(block_period_s / TICK_S), :2]
    held = np.concatenate([grid[:1], grid[:1], grid, points[-1:, :2], points[-1:, :2]])
    return np.asarray(np.abs(np.diff(held, 2, axis=0)).max(axis=0) / block_period_s**2)


def orbit_percent(points: Vector) -> float:
    """Area between the set-points and the quarter arc of 20 mm about (20, 20), of the quarter disc in %."""
    across = np.array([20.0, 20.0]) - points[:, :2]
    angle = np.arctan2(-across[:, 0], across[:, 1])
    inside = (angle >= 0.0) & (angle <= np.pi / 2)
    gap = 20.0**2 - (across[inside] ** 2).sum(axis=1)
    area = np.trapezoid(np.abs(gap), angle[inside]) / 2
    return float(area / (np.pi * 100.0) * 100.0)


def judge(judged: Judged, blocks: list[Move], programmed: list[Move], block_period_s: float, rule: Any) -> Figures:
    """Plays the blocks of a region and measures them against the programmed moves."""
    points = play([move for move in blocks if move.length > 0.0], period_s=TICK_S, block_end=rule)
    points = points + (path_polyline(programmed)[0] - points[0])
    _, _, moved = response(points, MODES, TICK_S)

    return Figures(
        contour_error_um(points, programmed).max_um, contour_error_um(moved, programmed).max_um,
        residual_um(points, MODES, TICK_S, still_mm=1e-9)[:2], (len(points) - 1) * TICK_S,
        peak_acceleration(points, block_period_s), orbit_percent(points), corner_speed(points, (30.0, 0.0)),
    )  # fmt: skip


@functools.cache
def paper_text() -> str:
    core = path_program(200.0, sg.Machine.load("vx500")).core
    return core.slice(0, core.size).decode()


@functools.cache
def paper(target: str, block_period_s: float = 0.005, rule: str = "ceil") -> Figures:
    """Paper 000's path at 200 mm/s with 99 % on the arc, emitted with a target."""
    keys = {"shaping.contour": target, "controller.block_time_s": block_period_s, "tolerance.contour_um": 50.0}
    judged = convert(paper_text(), machine_with(keys), arc_feed_ratio=ARC_FEED_RATIO, block_period_s=block_period_s)
    *_, (programmed, blocks, _) = judged.regions()
    return judge(judged, blocks, programmed, block_period_s, rule)


@functools.cache
def paper_unshaped(block_period_s: float = 0.005) -> Figures:
    """The same motion as programmed, every millisecond."""
    machine = sg.Machine.load("vx500")
    path = path_program(200.0, machine).regions[-1].path
    profile = _core.plan_speed(path, motion_limits(machine, arc_feed_ratio=ARC_FEED_RATIO))
    points = np.asarray(_core.interpolate(path, profile, TICK_S))
    programmed_s = _core.plan_speed(path, motion_limits(machine)).duration_s
    _, _, moved = response(points, MODES, TICK_S)
    return Figures(
        0.0, paper_distance_um(moved), residual_um(points, MODES, TICK_S)[:2], programmed_s,
        peak_acceleration(points, block_period_s), 0.0,
    )  # fmt: skip


def paper_distance_um(points: Vector) -> float:
    """Largest distance from paper 000's path in closed form."""
    x, y = points[:, 0], points[:, 1]
    arc = np.abs(np.hypot(x - 20.0, y - 20.0) - 20.0)
    return float(1e3 * np.where(x <= 20.0, np.abs(y), np.where(y >= 20.0, np.abs(x - 40.0), arc)).max())


def arcs_and_corners(feed_mm_per_min: float = 9000.0) -> str:
    """Lines with corners of 90, 135, 45 and 20 degrees and tangent arcs of 1.5, 4, 10 and 25 mm."""
    lines = ["%", "O1", "G21G17G90G94G40G64G00X0Y0Z0"]
    x = y = heading = 0.0
    f = f"F{feed_mm_per_min:.0f}."

    def line(length: float) -> None:
        nonlocal x, y, f
        x, y = x + length * math.cos(heading), y + length * math.sin(heading)
        lines.append(f"G01X{x:.3f}Y{y:.3f}{f}")
        x, y, f = round(x, 3), round(y, 3), ""

    def arc(radius: float, degrees: float) -> None:
        nonlocal x, y, heading
        sense, sweep = math.copysign(1.0, degrees), math.radians(abs(degrees))
        x += sense * radius * (math.sin(heading + sense * sweep) - math.sin(heading))
        y -= sense * radius * (math.cos(heading + sense * sweep) - math.cos(heading))
        heading += sense * sweep
        lines.append(f"G0{3 if sense > 0 else 2}X{x:.3f}Y{y:.3f}R{radius:.3f}")
        x, y = round(x, 3), round(y, 3)

    line(40.0)
    turns = ((1.5, 90.0), (4.0, -90.0), (0.0, 90.0), (10.0, 90.0), (0.0, -45.0), (25.0, -90.0), (0.0, 20.0))
    for radius, degrees in turns:
        if radius > 0.0:
            arc(radius, degrees)
        else:
            heading += math.radians(degrees)
        line(40.0)
    heading += math.radians(135.0)
    line(60.0)
    return "\n".join([*lines, "M30", "%", ""])


def corner(feed_mm_per_min: float = 6000.0) -> str:
    """A corner of 90 degrees between two lines of 30 mm."""
    return f"%\nO1\nG21G17G90G94G40G64G00X0Y0Z0\nG01X30.F{feed_mm_per_min:.0f}.\nY30.\nM30\n%\n"


@functools.cache
def within(text: str, target: str, tolerance_um: float, block_period_s: float = 0.005) -> tuple[Figures, Any]:
    """A program of one region, emitted with a target and its tolerance; and the conversion's report."""
    keys = {"shaping.contour": target, "tolerance.contour_um": tolerance_um, "controller.block_time_s": block_period_s}
    judged = convert(text, machine_with(keys), block_period_s=block_period_s)
    ((programmed, blocks, entry),) = judged.regions()
    report = {**judged.conversion.to_dict(), "within": judged.conversion.ok, "entry": entry}
    return judge(judged, blocks, programmed, block_period_s, "ceil"), report


def corner_speed(points: Vector, at: tuple[float, float]) -> float:
    """Speed of the set-points where they come nearest to a corner, mm/s."""
    k = int(np.hypot(points[:, 0] - at[0], points[:, 1] - at[1]).argmin())
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    return float(steps[max(k - 1, 0) : k + 1].min() / TICK_S)


@functools.cache
def exact(target: str, smoothness: float, block_period_s: float) -> tuple[float, tuple[Vector, ...]]:
    """Paper 000's path before it is rounded to words, with a weight of the correction.

    Largest deviation of what the target names, and residual of X and Y for modes at 90, 95, 100, 105 and 110 % (µm).
    """
    machine = machine_with({"shaping.contour": target, "controller.block_time_s": block_period_s})
    grid = choose_grid(machine, block_period_s)
    model = MachineModel(machine)
    writer = RegionWriter(model, grid)
    options = writer.options(model.limits(arc_feed_ratio=ARC_FEED_RATIO), writer.tolerance(1e6))
    options.contour_smoothness = smoothness
    shaper = _core.RegionShaper(path_program(200.0, machine).regions[-1].path, grid.fir, [], options)
    piece = shaper.next(10**7)
    assert piece is not None
    rows = np.asarray(piece.grid_mm)
    residual = tuple(
        residual_um(rows, [[(46.0 * k, 0.02)], [(131.0 * k, 0.02)], None], block_period_s, still_mm=1e-9)[:2]
        for k in (0.9, 0.95, 1.0, 1.05, 1.1)
    )
    # Without a target the shaper measures no deviation.
    return paper_distance_um(rows) if target == "off" else shaper.largest_deviation_mm * 1e3, residual


def _print_paper() -> None:
    print("| blocks | target | orbit error | command | response | residual X, Y | time | acceleration |")
    print("|---|---|---|---|---|---|---|---|")
    for period_s in (0.005, 0.002):
        before = paper_unshaped(period_s)
        if period_s == 0.005:
            print(f"| – | unshaped | – | – | {before.response_um:.1f} µm | {_pair(before.residual_um)} µm "
                  f"| {before.time_s * 1e3:.0f} ms | {before.peak_acceleration.max():.0f} mm/s² |")  # fmt: skip
        for target in TARGETS:
            found = paper(target, period_s)
            print(
                f"| {period_s * 1e3:g} ms | {target} | {found.orbit_percent:.4f} % | {found.command_um:.1f} µm "
                f"| {found.response_um:.1f} µm | {_pair(found.residual_um)} µm "
                f"| {100 * (found.time_s / before.time_s - 1):+.1f} % "
                f"| {100 * (found.peak_acceleration.max() / before.peak_acceleration.max() - 1):+.0f} % |"
            )


def _print_within(text: str, block_period_s: float) -> None:
    print(f"| blocks of {block_period_s * 1e3:g} ms: tolerance | target | time | command | response | within |")
    print("|---|---|---|---|---|---|")
    for tolerance_um in TOLERANCES_UM:
        for target in TARGETS:
            found, report = within(text, target, tolerance_um, block_period_s)
            print(f"| {tolerance_um:g} µm | {target} | {found.time_s:.3f} s | {found.command_um:.1f} µm "
                  f"| {found.response_um:.1f} µm | {report['within']} |")  # fmt: skip


def _print_corner() -> None:
    print("| tolerance | F | " + " | ".join(f"{target}: speed, time" for target in TARGETS) + " |")
    print("|---|---|" + "---|" * len(TARGETS))
    for feed in (3000.0, 6000.0):
        for tolerance_um in (5.0, 10.0, 20.0, 50.0):
            cells = []
            for target in TARGETS:
                found, report = within(corner(feed), target, tolerance_um)
                cells.append(f"{found.corner_speed:.1f} mm/s, {found.time_s:.3f} s" + "!" * (not report["within"]))
            print(f"| {tolerance_um:g} µm | {feed:g} | " + " | ".join(cells) + " |")


def _print_smoothness() -> None:
    print("| blocks | target | weight | deviation | residual X at 90, 95, 105, 110 % | Y |")
    print("|---|---|---|---|---|---|")
    for period_s in (0.005, 0.002):
        for target in TARGETS:
            for weight in (3.0, 1.0, 0.4, 0.1, 0.01) if target != "off" else (1.0,):
                deviation, residual = exact(target, weight, period_s)
                assert max(float(left.max()) for left in residual[2:3]) < 1e-4
                axes = np.array([*residual[:2], *residual[3:]])
                print(f"| {period_s * 1e3:g} ms | {target} | {weight if target != 'off' else '–'} "
                      f"| {deviation:.1f} µm | {_pair(axes[:, 0])} µm | {_pair(axes[:, 1])} µm |")  # fmt: skip


def _pair(values: Any) -> str:
    return " / ".join(f"{value:.2f}" for value in values)


if __name__ == "__main__":
    argparse.ArgumentParser(description=__doc__).parse_args()
    _print_paper()
    print()
    for period_s in (0.005, 0.002):
        _print_within(arcs_and_corners(), period_s)
        print()
    _print_corner()
    print()
    _print_smoothness()
