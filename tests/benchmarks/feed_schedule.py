"""What a feed schedule reaches, and what it costs: `python tests/benchmarks/feed_schedule.py [--json FILE] [--quick]`.

The corners of paper 001 with 30 mm of straight before and behind them, and a pocket (tests/golden/feed): peak resultant
against the limit, at another resolution and by brute force too (tests/oracles/judge), share of the path near the limit,
time against the constant feed that keeps the same limit. Then the speed of engagement and force over the number of
blocks. Exit code 1 if a figure misses its target.
"""

from __future__ import annotations

import argparse
import json
import re
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import shapely
from places import TESTS
from table import markdown

from judge import interpret
from judge.cutting import Cut, EndMill
from judge.engagement import Block, Material, layers_of
from judge.feeds import known, runs
from shapegcode import _core
from shapegcode.cutting.stock import Stock
from shapegcode.cutting.tool import Tool
from shapegcode.feed.plan import OrdinaryMotion, limits_of
from shapegcode.feed.result import FeedSchedule
from shapegcode.feed.schedule import MARGIN, schedule_feed
from shapegcode.feed.survey import SurveyedRegion, survey
from shapegcode.machine import Machine
from shapegcode.program import Program
from shapegcode.timing.cycle_time import cycle_time

Vector = npt.NDArray[np.float64]
FEED = TESTS / "golden" / "feed"
LAYER_MM = 0.25  # of ramps, for the judge
SAMPLES = 150
LEVEL_MM, ROW_MM, BLOCK_MM = 1.0, 3.2, 0.5  # of the long program
BLOCK_MM_MIN = 0.6
LARGEST_S = 10.0


def paper_001() -> dict[int, Any]:
    """The corners of docs/evidence/paper001.md, as its page works them out."""
    from page_code import run_page

    found: dict[int, Any] = run_page("evidence/paper001.md")["corners"]
    return found


def corner_row(corner: Any) -> dict[str, Any]:
    """A corner of the paper."""
    scheduled = corner.scheduled
    return {
        "limit_n": scheduled.target_n,
        "peak_n": float(scheduled.schedule.resultant_force_n.emitted.max),
        "finer_peak_n": float(scheduled.along.peak.max()),
        "share_within_5_percent": scheduled.share_near,
        "share_possible": _share_possible(corner),
        "time_s": scheduled.time_s,
        "constant_feed_mm_per_min": scheduled.constant_mm_per_min,
        "constant_time_s": scheduled.constant_s,
        "gain_percent": scheduled.gain_percent,
    }


def _share_possible(corner: Any) -> float:
    """Largest share of the path near the limit that blocks of the least length or longer can have, by trying them all.

    A block has one feed, that of its worst station, and ends where its line or arc does; steps of the feed are at once.
    """
    target = corner.scheduled.target_n
    most, enough = (
        np.asarray(_core.largest_feeds(corner.force, corner.track, limits, 1.0, 2000.0)[0])
        for limits in (
            _core.FeedLimits(peak_resultant_n=(1.0 - MARGIN) * target),
            _core.FeedLimits(peak_resultant_n=0.95 * target),
        )
    )
    segment, s_mm, length = np.asarray(corner.track.segment), corner.s_mm, corner.length_mm
    best_of_all = 0.0
    for number in np.unique(segment):
        inside = np.flatnonzero(segment == number)
        best = np.full(len(inside) + 1, -np.inf)  # near the limit on the first so many stations
        best[0] = 0.0
        ends = np.append(s_mm[inside] - length[inside], s_mm[inside[-1]])
        for end in range(1, len(inside) + 1):
            # Blocks twice as long as the least one are two blocks with feeds at least as high.
            first = int(np.searchsorted(ends, ends[end] - 2.0 * BLOCK_MM_MIN - 1e-6))
            for begin in range(first, end):
                if ends[end] - ends[begin] < BLOCK_MM_MIN - 1e-6 or not np.isfinite(best[begin]):
                    continue
                block = inside[begin:end]
                near = float(length[block][most[block].min() >= enough[block]].sum())
                best[end] = max(best[end], best[begin] + near)
        best_of_all += float(best[-1])
    return best_of_all / float(length.sum())


def pocket(machine: Machine, samples: int) -> dict[str, Any]:
    """The pocket: two levels with sharp inner corners, slots and air moves, then the walls."""
    tool, stock = Tool.load(FEED / "pocket_tool.toml"), Stock.load(FEED / "pocket_stock.toml")
    program = Program.read(FEED / "POCKET.NC", machine)
    result = schedule_feed(program, machine, tool, stock)
    limit = float(tool.limits.resultant_n or np.inf)
    written = result.written
    constant = _constant_feed(result, tool, machine)
    text = re.sub(r"F1500\.", f"F{constant:.1f}", (FEED / "POCKET.NC").read_text(encoding="ascii"))
    times = [cycle_time(each, machine).cycle_time_s for each in (written, Program.from_text(text, machine))]
    return {
        "limit_n": limit,
        "peak_n": float(result.resultant_force_n.emitted.max),
        "programmed_peak_n": float(result.resultant_force_n.original.max),
        **_finer(written, machine, tool, stock),
        **_brute_force(written, machine, tool, stock, samples),
        **_shares(result, limit),
        "time_s": times[0],
        "constant_feed_mm_per_min": constant,
        "constant_time_s": times[1],
        "programmed_time_s": result.cycle_time_s.original,
        "air_time_s": result.air_time_s.emitted,
        "gain_percent": 100.0 * (1.0 - times[0] / times[1]),
        "warnings": result.warnings,
    }


def _constant_feed(result: FeedSchedule, tool: Tool, machine: Machine) -> float:
    """Highest constant feed that keeps the limits, without a margin, on everything that is not left as it was."""
    highest = np.inf
    for part, plan in zip(result.survey.regions, result.plans, strict=True):
        assert plan is not None
        assert part.track is not None
        free = np.array([not reason for reason in plan.kept])[np.asarray(part.track.segment)]
        feeds, _, _ = _core.largest_feeds(
            tool.force(part.spindle_rev_per_min, part.sense),
            part.track,
            limits_of(tool, machine, 0.0),
            1.0,
            machine.axes.x.max_feed_mm_per_min,
        )
        highest = min(highest, float(feeds[free].min()))
    return float(np.floor(10.0 * highest) / 10.0)


def _shares(result: FeedSchedule, limit: float) -> dict[str, float]:
    """Of the path in material: near the limit, and held by the chip or left as it was instead."""
    total = near = otherwise = 0.0
    for part, plan, load in zip(result.survey.regions, result.plans, result.loads, strict=True):
        assert plan is not None
        assert load is not None
        assert part.track is not None
        length = np.diff(load.s_mm, prepend=0.0)
        material = load.emitted.peak_resultant_n > 0.0
        close = load.emitted.peak_resultant_n >= 0.95 * limit
        total += float(length[material].sum())
        near += float(length[material & close].sum())
        otherwise += float(length[material & ~close & (plan.holds != "resultant")].sum())
    return {"share_within_5_percent": near / total, "share_held_otherwise": otherwise / total}


def _finer(written: Program, machine: Machine, tool: Tool, stock: Stock) -> dict[str, Any]:
    """The written program swept again through a grid of half the width; its stations are its own."""
    swept = survey(written, machine, tool, stock, resolution_mm=0.005 * tool.tool.diameter_mm)
    peaks = [float(_peaks(part, machine).max()) for part in swept.regions]
    return {"finer_peak_n": max(peaks)}


def _peaks(part: SurveyedRegion, machine: Machine) -> Vector:
    assert part.tool is not None
    assert part.track is not None
    feeds = _run(part.region.path, np.asarray(part.track.s_mm), part, machine)
    force = part.tool.force(part.spindle_rev_per_min, part.sense)
    return np.asarray(force.figures_of(part.track, feeds)["peak_resultant_n"])


def _run(path: _core.Path, stations: Vector, part: SurveyedRegion, machine: Machine) -> Vector:
    assert part.tool is not None
    window_s = 60.0 / (part.tool.tool.flutes * part.spindle_rev_per_min)
    return OrdinaryMotion(machine).travel(path, path, stations, window_s).feed_mm_per_min


def _brute_force(written: Program, machine: Machine, tool: Tool, stock: Stock, samples: int) -> dict[str, Any]:
    """Some stations of the written program by the judge: those with the largest peaks, and random ones."""
    swept = survey(written, machine, tool, stock)
    block = stock.box
    assert block is not None
    shape = shapely.box(block.x_mm[0], block.y_mm[0], block.x_mm[1], block.y_mm[1])
    material = Material([Block(shape, *block.z_mm)])
    read = interpret(written.text.decode())
    layers = layers_of(known(read), material.blocks, LAYER_MM)
    of_run = {id(move): (part, number) for part, run in zip(swept.regions, runs(read), strict=True)
              for number, move in enumerate(run)}  # fmt: skip
    random = np.random.default_rng(1)
    ours: list[float] = []
    theirs: list[float] = []
    for move in known(read):
        if id(move) in of_run:
            part, number = of_run[id(move)]
            assert part.track is not None
            if number == 0:
                peaks, stations = _peaks(part, machine), np.asarray(part.track.s_mm)
                feeds = _run(part.region.path, stations, part, machine)
                level = np.flatnonzero((np.asarray(part.track.horizontal) == 1.0) & (peaks > 0.0))
                share = samples // len(swept.regions)
                chosen = np.union1d(level[np.argsort(peaks[level])[-share // 2 :]], random.choice(level, share // 2))
                begin = 0.0
            here = chosen[np.asarray(part.track.segment)[chosen] == number]
            along = np.clip(stations[here] - begin, 0.0, move.length)
            mill = _mill(tool, part.spindle_rev_per_min)
            places = material.meet(move, tool.radius_mm, along, layers) if len(here) else []
            for station, met in zip(here, places, strict=True):
                theirs.append(Cut(mill, met.arcs).figures(float(feeds[station])).peak_n)
                ours.append(float(peaks[station]))
            begin += move.length
        material.sweep(move, tool.radius_mm)
    difference = np.abs(np.array(ours) - np.array(theirs)) / float(tool.limits.resultant_n or 1.0)
    return {
        "brute_force_peak_n": max(theirs),
        "brute_force_stations": len(theirs),
        "brute_force_difference": {"median": float(np.median(difference)), "max": float(difference.max())},
    }


def _mill(tool: Tool, rev_per_min: float) -> EndMill:
    """The tool for the judge."""
    law, of = tool.coefficients(), tool.tool
    return EndMill(
        of.diameter_mm, of.flutes, of.helix_deg, law.specific_n_per_mm2, law.specific_exponent, law.ratio,
        law.ratio_exponent, 0.0, 0.0, False, rev_per_min, of.overhang_mm, of.flute_length_mm, of.diameter_mm,
        0.8 * of.diameter_mm, 600.0,
    )  # fmt: skip


def long_program(blocks: int) -> str:
    """A pocket cut in rows, level by level, in blocks of 0.5 mm."""
    return "\n".join(
        ["%", "O1", "G21 G17 G90 G94", "M03 S6000", "G00 X10. Y10.", "G00 Z5.", *_rows(blocks), "M30", "%"]
    )


def _rows(blocks: int) -> Iterator[str]:
    along = np.arange(10.0, 110.0 + 1e-9, BLOCK_MM)
    across = np.arange(10.0, 60.0, ROW_MM)
    written, level = 0, 0
    while True:
        level += 1
        yield f"G01 Z{-level * LEVEL_MM:.3f} F300."
        yield "G01 F1200."
        for row, y in enumerate(across if level % 2 else across[::-1]):
            ways = along if (row + level) % 2 else along[::-1]
            for x in ways:
                yield f"X{x:.3f} Y{y:.3f}"
                written += 1
                if written == blocks:
                    return


def speed(machine: Machine, blocks: int) -> dict[str, float]:
    """Seconds for the engagement and force of a program of so many blocks; reading it is not in them."""
    tool = Tool.load(FEED / "pocket_tool.toml")
    text = long_program(blocks)
    program = Program.from_text(text, machine, source="long program")
    paths = [region.path for region in program.regions]
    levels = [-LEVEL_MM * n for n in range(int(np.ceil(blocks / 3000)) + 1)]
    stock = Stock.from_toml(
        f"[box]\nx_mm = [0.0, 120.0]\ny_mm = [0.0, 70.0]\nz_mm = [{levels[-1] - 5.0}, 0.0]\n", "stock", Path()
    )
    begin, busy = time.perf_counter(), time.process_time()
    swept = survey(program, machine, [tool], stock)
    middle = time.perf_counter()
    stations = 0
    for part in swept.regions:
        assert part.track is not None
        stations += len(part.track)
        tool.force(part.spindle_rev_per_min, part.sense).figures_of(part.track, np.full(len(part.track), 1200.0))
    end = time.perf_counter()
    return {
        "blocks": sum(len(path) for path in paths),
        "stations": stations,
        "engagement_s": middle - begin,
        "force_s": end - middle,
        "both_s": end - begin,
        "processor_s": time.process_time() - busy,
    }


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", type=Path, help="file for all figures")
    parser.add_argument("--quick", action="store_true", help="fewer stations by brute force, a tenth of the blocks")
    arguments = parser.parse_args()
    scale = 10 if arguments.quick else 1
    machine = Machine.load("vx500")
    cuts = {f"corner {number}": corner_row(corner) for number, corner in paper_001().items()}
    cuts["pocket"] = pocket(machine, SAMPLES // scale)
    speeds = [speed(machine, blocks // scale) for blocks in (25_000, 50_000, 100_000, 200_000)]
    print(markdown(["what", *cuts], list(_rows_of(cuts))))
    head = ["blocks", "stations", "engagement s", "force s", "both s", "processor time s", "µs of it per block"]
    print()
    print(markdown(head, [_speed_row(row) for row in speeds]))
    if arguments.json is not None:
        arguments.json.write_text(json.dumps({**cuts, "speed": speeds}, indent=1) + "\n", encoding="utf-8")
    missed = [
        f"{name}: {key}"
        for name, cut in cuts.items()
        for key in ("peak_n", "finer_peak_n", "brute_force_peak_n")
        if cut.get(key, 0.0) > cut["limit_n"]
    ]
    missed += [f"{name}: gain" for name, cut in cuts.items() if cut["gain_percent"] < 15.0]
    missed += ["speed" for row in speeds if row["blocks"] <= 100_100 and row["both_s"] > LARGEST_S]
    if missed:
        raise SystemExit("missed: " + ", ".join(missed))


def _rows_of(cuts: dict[str, dict[str, Any]]) -> Iterator[list[str]]:
    def row(what: str, key: str, unit: str, digits: int, scale: float = 1.0) -> list[str]:
        return [what, *(f"{scale * cut[key]:.{digits}f} {unit}" if key in cut else "" for cut in cuts.values())]

    yield row("limit of the peak resultant", "limit_n", "N", 2)
    yield row("largest peak, as the schedule reports", "peak_n", "N", 2)
    yield row("the same on other, finer stations", "finer_peak_n", "N", 2)
    yield row("the same by brute force", "brute_force_peak_n", "N", 2)
    yield row("path in material within 5 % of the limit", "share_within_5_percent", "%", 1, 100.0)
    yield row("the best possible with blocks of 0.6 mm", "share_possible", "%", 1, 100.0)
    yield row("path with another limit reached", "share_held_otherwise", "%", 1, 100.0)
    yield row("time", "time_s", "s", 2)
    yield row("constant feed that keeps the limit", "constant_feed_mm_per_min", "mm/min", 1)
    yield row("time with it", "constant_time_s", "s", 2)
    yield row("gain", "gain_percent", "%", 1)


def _speed_row(row: dict[str, float]) -> list[str]:
    each = 1e6 * row["processor_s"] / row["blocks"]
    return [
        f"{row['blocks']:.0f}", f"{row['stations']:.0f}", f"{row['engagement_s']:.2f}", f"{row['force_s']:.2f}",
        f"{row['both_s']:.2f}", f"{row['processor_s']:.2f}", f"{each:.1f}",
    ]  # fmt: skip


if __name__ == "__main__":
    main()
