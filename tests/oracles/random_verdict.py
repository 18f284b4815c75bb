"""A drawn program, converted by the package and judged by what shares nothing with it: every figure beside the report.

The original and the emitted text are read by the judge's interpreter, the emitted one is simulated by its player and
plant. What differs is listed; nothing is decided by the package.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

import shapegcode as sg
from acceptance import memory
from judge import Mode, Move, contour_error_um, play, residual_um, response, rest_index
from judge.dialect import Item, play as play_dialect
from judge.dialect.moves import as_move
from judge.draws import Draw
from judge.in_order import Way, deviation_um, haste, missed_um, places
from judge.player import BlockEnd
from shapegcode.machine.programs import ANY_PRICE

Vector = npt.NDArray[np.float64]
RULES: tuple[BlockEnd, ...] = ("ceil", "carry")
RELATIVE, ABSOLUTE_UM = 0.05, 0.5
#: What coordinate modes come to is written in least increments: places, and by so much the contour.
_PLACE, _CONTOUR = 1.001, 1.5
#: Block periods over which a speed is taken.
WINDOWS = (1, 4, 16)
_COMPUTED = re.compile(r"G(16|51|51\.1|68)(?!\d)")


def agree(ours: float, theirs: float) -> bool:
    """Within 5 % or half a micrometre."""
    return abs(ours - theirs) <= max(ABSOLUTE_UM, RELATIVE * max(abs(ours), abs(theirs)))


@dataclass(frozen=True)
class Case:
    """A draw with its conversion, and both texts as the judge reads them."""

    drawn: Draw
    machine: sg.Machine
    program: sg.Program
    conversion: sg.Conversion
    original: list[Item]
    emitted: list[Item]

    @property
    def increment_mm(self) -> float:
        controller = self.machine.controller
        return controller.least_increment_inch * 25.4 if "G20" in self.drawn.text else controller.least_increment_mm

    @property
    def tick_s(self) -> float:
        return self.machine.controller.interpolation_period_s

    @cached_property
    def regions(self) -> list[dict[str, Any]]:
        """Of the report; `lines` are those of the text that was drawn, where the report's are of it expanded."""
        entries: list[dict[str, Any]] = self.conversion.to_dict()["regions"]
        origin = self.program.core.origin
        return [e | {"lines": [origin(line)[0] for line in e["lines"]]} for e in entries]

    @property
    def modes(self) -> list[list[Mode]]:
        return modes_of(self.machine)


def modes_of(machine: sg.Machine) -> list[list[Mode]]:
    """The modes of a machine file for the judge's plant, by the axis which they move."""
    found: list[list[Mode]] = [[], [], []]
    for axis, table in zip("xyz", machine.axes.as_tuple(), strict=True):
        own = dict.fromkeys("xyz", 0.0) | {axis: 1.0}
        for mode in table.modes:
            by = own if mode.excited_by is None else mode.excited_by.model_dump()
            moves = own if mode.moves is None else mode.moves.model_dump()
            for modes, letter in zip(found, "xyz", strict=True):
                if share := mode.participation * moves[letter]:
                    modes.append(Mode(mode.frequency_hz, mode.damping_ratio, share, (by["x"], by["y"], by["z"])))
    return found


def read(text: str, drawn: Draw) -> list[Item]:
    """Moves and dwells of a text without those that lead nowhere."""
    offsets = {name: (v[0], v[1], v[2]) for name, v in drawn.keys["input.work_offsets"].items()}
    items = play_dialect(text, work_offsets=offsets)
    return [i for i in items if i.dwell_s > 0.0 or (i.kind != "dwell" and _length(i) > 1e-9)]


def _length(item: Item) -> float:
    return as_move(item).length


def convert(drawn: Draw, *, shape_all: bool) -> Case:
    """The package's conversion of a draw."""
    machine = sg.Machine.load(drawn.machine).with_values(drawn.keys | (ANY_PRICE if shape_all else {}))
    program = sg.Program.from_text(drawn.text, machine, source=f"draw {drawn.seed}")
    conversion = sg.convert(program, machine, shape_all=shape_all)
    emitted = conversion.text.decode("latin-1")
    return Case(drawn, machine, program, conversion, read(drawn.text, drawn), read(emitted, drawn))


def complaints(case: Case) -> list[str]:
    """Everything in which the judge and the report differ."""
    found = list(_outside(case))
    for entry in case.regions:
        programmed = _cuts(case.original, entry["lines"])
        blocks = _cuts(case.emitted, entry["emitted_lines"])
        found += [f"lines {entry['lines']}: {what}" for what in _region(case, programmed, blocks, entry)]
    return found + list(_largest(case)) + _unchanged(case) + _price(case)


def _cuts(items: Sequence[Item], lines: Sequence[int]) -> list[Move]:
    return [as_move(i) for i in items if lines[0] <= i.line <= lines[1] and i.kind in ("line", "arc")]


def _outside(case: Case) -> list[str]:
    """What was not shaped is the same motion; between there are the same runs of cuts, with the same ends."""
    regions = case.regions
    ours = _sequence(case.original, [r["lines"] for r in regions])
    theirs = _sequence(case.emitted, [r["emitted_lines"] for r in regions])
    if len(ours) != len(theirs) and _COMPUTED.search(case.drawn.text):
        # A computed move below the least increment is none in the plain program.
        ours, theirs = (
            [each for each in events if each[0] != "line" or _length(each[1]) > _CONTOUR * case.increment_mm]
            for events in (ours, theirs)
        )
    if [kind for kind, _ in ours] != [kind for kind, _ in theirs]:
        return [f"{len(ours)} events in the original, {len(theirs)} in the emitted text, or others"]
    off = _PLACE * case.increment_mm
    return [
        f"line {a.line} {kind} to {a.end}, emitted line {b.line} to {b.end}"
        for (kind, a), (_, b) in zip(ours, theirs, strict=True)
        if np.nanmax(np.abs(a.end - b.end), initial=0.0) > off or abs(a.dwell_s - b.dwell_s) > 1e-9
        or (kind != "region" and not np.isclose(a.feed, b.feed, rtol=1e-6, equal_nan=True))
    ]  # fmt: skip


def _sequence(items: Sequence[Item], regions: Sequence[Sequence[int]]) -> list[tuple[str, Item]]:
    """Every event outside of the regions, and the last move of each region."""
    out: list[tuple[str, Item]] = []
    where = -1
    for item in items:
        inside = next((k for k, (a, b) in enumerate(regions) if a <= item.line <= b and item.kind != "rapid"), -1)
        if inside >= 0 and inside == where:
            out[-1] = ("region", item)
        else:
            out.append((item.kind if inside < 0 else "region", item))
        where = inside
    return out


def _region(case: Case, programmed: list[Move], blocks: list[Move], entry: dict[str, Any]) -> list[str]:
    """One region's residual, contour, time and speed beside its entry."""
    if not programmed or not blocks:
        return ["nothing was programmed or nothing emitted"]
    found: list[str] = []
    runs = [_set_points(case, blocks, rule) for rule in RULES]
    residuals = [
        residual_um(p[-memory(case.modes, case.tick_s) :], case.modes, case.tick_s, still_mm=1e-9) for p in runs
    ]
    for axis, ours in zip("xyz", np.max(residuals, axis=0), strict=True):
        theirs = entry["residual_vibration_um"]["emitted"][axis]
        if not agree(ours, theirs):
            found.append(f"residual {axis} {ours:.3f} um, report {theirs:.3f}")
    found += _original(case, programmed, entry)
    lasts = max(rest_index(points, still_mm=1e-9) for points in runs) * case.tick_s
    if abs(lasts - entry["time_s"]["emitted"]) > 1e-6 + 1e-9 * lasts:
        found.append(f"takes {lasts:.6f} s, report {entry['time_s']['emitted']:.6f}")
    way = Way.of(programmed)
    by_target = [_followed(case, points) for points in runs]
    nearest = max(contour_error_um(points, programmed).max_um for points in by_target)
    theirs = entry["contour_error_um"]
    rounded = _CONTOUR * case.increment_mm * 1e3 if _COMPUTED.search(case.drawn.text) else 0.0
    if theirs < nearest - max(ABSOLUTE_UM, RELATIVE * nearest) - rounded:
        found.append(f"contour {nearest:.2f} um, report {theirs:.2f}")
    elif not agree(nearest, theirs):
        ahead = 20.0 * max(float(np.linalg.norm(np.diff(p, axis=0), axis=1).max()) for p in runs) + 1e-2
        in_order = max(deviation_um(points, way, nearest, ahead=ahead) for points in by_target)
        if theirs <= in_order * (1.0 + RELATIVE) + ABSOLUTE_UM + rounded:
            return found + _speeds(case, runs, programmed, way)
        missed = max(missed_um(points, way, 1.02 * in_order, ahead=ahead) for points in by_target)
        if theirs > max(in_order, missed) * (1.0 + RELATIVE) + ABSOLUTE_UM + rounded:
            found.append(f"contour {nearest:.2f} um, in order {in_order:.2f}, missed {missed:.2f}, report {theirs:.2f}")
    return found + _speeds(case, runs, programmed, way)


def _original(case: Case, programmed: list[Move], entry: dict[str, Any]) -> list[str]:
    """The region as programmed, where the control smooths after interpolation: what the judge can play itself."""
    controller = case.machine.controller
    # A tick's dust decides how long a line lasts whose ends are computed places.
    if controller.motion != "after_interpolation" or _COMPUTED.search(case.drawn.text):
        return []
    ticks = round(controller.time_constant_s / case.tick_s)
    points = play(programmed, period_s=case.tick_s, block_end=controller.block_end, acceleration_samples=ticks)
    residual = residual_um(points, case.modes, case.tick_s, still_mm=1e-9)
    lasts = rest_index(points, still_mm=1e-9) * case.tick_s
    found = [
        f"original: residual {axis} {ours:.3f} um, report {theirs:.3f}"
        for axis, ours in zip("xyz", residual, strict=True)
        if not agree(ours, theirs := entry["residual_vibration_um"]["original"][axis])
    ]
    if abs(lasts - entry["time_s"]["original"]) > 1e-6 + 1e-9 * lasts:
        found.append(f"original: takes {lasts:.6f} s, report {entry['time_s']['original']:.6f}")
    return found


def _unchanged(case: Case) -> list[str]:
    """The cuts left unchanged in the emitted program, where the judge can simulate an ordinary control."""
    controller = case.machine.controller
    if controller.motion != "after_interpolation" or _COMPUTED.search(case.drawn.text):
        return []
    found = []
    ticks = round(controller.time_constant_s / case.tick_s)
    origin, emitted_origin = case.program.core.origin, case.conversion.emitted.core.origin
    for entry in case.conversion.to_dict()["unchanged"]:
        programmed = _cuts(case.original, [origin(line)[0] for line in entry["lines"]])
        blocks = _cuts(case.emitted, [emitted_origin(line)[0] for line in entry["emitted_lines"]])
        points = play(blocks, period_s=case.tick_s, block_end=controller.block_end, acceleration_samples=ticks)
        residual = residual_um(points, case.modes, case.tick_s, still_mm=1e-9)
        where = f"unchanged lines {entry['lines']}"
        for axis, ours in zip("xyz", residual, strict=True):
            if not agree(ours, theirs := entry["residual_vibration_um"]["emitted"][axis]):
                found.append(f"{where}: residual {axis} {ours:.3f} um, report {theirs:.3f}")
        nearest = contour_error_um(_followed(case, points), programmed).max_um
        if entry["contour_error_um"] < nearest - max(ABSOLUTE_UM, RELATIVE * nearest):
            found.append(f"{where}: contour {nearest:.3f} um, report {entry['contour_error_um']:.3f}")
        over = any(
            ours > limit * 1.001 for ours, limit in zip(residual, entry["residual_limit_um"].values(), strict=True)
        )
        over |= nearest > case.machine.tolerance.contour_um + 0.01
        if over and not entry["misses"]:
            found.append(
                f"{where}: residual {residual} um, contour {nearest:.3f} um, and no limit is said to be missed"
            )
    return found


def _price(case: Case) -> list[str]:
    """Nothing takes more time than its price: the program by the report, a cut by the judge's own times."""
    price, times = case.machine.price, case.conversion.cycle_time_s
    found = []
    if times.emitted > times.original * (1.0 + price.program_time_percent / 100.0) + 1e-6:
        found.append(f"the program takes {times.emitted:.3f} s for {times.original:.3f} s")
    for cut in case.conversion.cuts:
        if cut.time_s.emitted > cut.time_s.original * (1.0 + price.cut_time_percent / 100.0) + 1e-6:
            found.append(f"lines {cut.lines}: takes {cut.time_s.emitted:.3f} s for {cut.time_s.original:.3f} s")
    return found


def _set_points(case: Case, blocks: list[Move], rule: BlockEnd) -> Vector:
    ticks = round(case.machine.controller.shaped_time_constant_s / case.tick_s)
    return play(blocks, period_s=case.tick_s, block_end=rule, acceleration_samples=ticks)


def _followed(case: Case, points: Vector) -> Vector:
    """What the contour tolerance is about, at the ticks."""
    if case.conversion.limits.contour_target == "command":
        return points
    _, _, moved = response(points, case.modes, case.tick_s)
    return moved[:: (len(moved) - 1) // (len(points) - 1)]


def _speeds(case: Case, runs: list[Vector], programmed: list[Move], way: Way) -> list[str]:
    """Set-points that run faster along the path than the program says, by more than the machine allows."""
    period = case.conversion.block_period_s
    limit = 1.0 + case.machine.tolerance.feed_excess_ratio
    found = []
    for points in runs[RULES.index(case.machine.controller.block_end) :][:1]:
        ahead = 20.0 * float(np.linalg.norm(np.diff(points, axis=0), axis=1).max()) + 1e-2
        within, s = 1.2e-3 * contour_error_um(points, programmed).max_um + 1e-4, None
        while s is None and within < 0.2:
            within, s = 2.0 * within, places(points, way, within, ahead)
        if s is None:
            continue
        worst = max(
            (
                haste(points, s, programmed, case.tick_s, window=count * round(period / case.tick_s), slack_mm=within,
                      increment_mm=case.increment_mm)
                for count in WINDOWS
            ),
            key=lambda each: each.ratio,
        )  # fmt: skip
        if worst.ratio > limit:
            found.append(f"F{worst.speed:.1f} where line {worst.line} says F{worst.feed:.1f} ({worst.ratio:.3f})")
    return found


def _largest(case: Case) -> list[str]:
    """Figures of the whole program: peak vibration."""
    regions = case.regions
    if not regions:
        return []
    peaks = []
    for entry in regions:
        for rule in RULES:
            points = _set_points(case, _cuts(case.emitted, entry["emitted_lines"]), rule)
            points = points[: rest_index(points, still_mm=1e-9) + 1]
            _, command, moved = response(points, case.modes, case.tick_s)
            peaks.append(1e3 * np.abs(moved - command).max(axis=0))
    theirs = case.conversion.peak_vibration_um.emitted
    # Of cuts left unchanged too, which the judge does not simulate.
    exact = not case.conversion.unchanged
    return [
        f"peak vibration {axis} {ours:.3f} um, report {theirs[axis]:.3f}"
        for axis, ours in zip("xyz", np.max(peaks, axis=0), strict=True)
        if (exact or ours > theirs[axis]) and not agree(ours, theirs[axis])
    ]
