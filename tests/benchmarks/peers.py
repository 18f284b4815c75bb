"""The control's motion beside other engines' in one run: the tables of docs/evidence/planners.md.

    .venv/bin/python tests/benchmarks/peers.py [--quick] [--json FILE]

Ruckig and Klipper's host come as packages into an environment of their own; LinuxCNC was recorded
(tests/benchmarks/data). Every engine's set-points are differenced in the same way. Exit code 1 if a limit is passed or
the look-ahead loses more than asked.
"""

from __future__ import annotations

import argparse
import gzip
import json
import os
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from datetime import date
from pathlib import Path
from typing import Any

import native
import numpy as np
import workload
from motion_figures import (
    PERIOD_S,
    Array,
    Figures,
    Limits,
    Piece,
    Route,
    figures,
    ours,
    read_points,
    read_program,
)
from places import GOLDEN, ROOT
from table import markdown

import shapegcode as sg
from time_optimal import Limits as OracleLimits, rounded_polyline, time_optimal

HERE = Path(__file__).resolve().parent
ARCS = HERE / "data" / "linuxcnc_small_arcs.ngc"
RECORDED = HERE / "data" / "linuxcnc_small_arcs.csv.gz"
WINDOWS = (10, 20, 50, 100, 170, 200, 500)
ASKED_WINDOW, ASKED_LOSS = 100, 0.01
ALLOWED_RATIO = 1.001
ASKED_MEDIAN, ASKED_WORST = 1.03, 1.10  # of our time over the shortest
CURVE_LINES = 4_000

ONE_AXIS = Limits.of(100.0, 1000.0, 50_000.0)
THREE_AXES = Limits((200.0, 200.0, 100.0), (2000.0, 2000.0, 1000.0), (100_000.0, 100_000.0, 50_000.0))
MOVES = (
    ("X 1", (1.0, 0.0, 0.0), ONE_AXIS),
    ("X 10", (10.0, 0.0, 0.0), ONE_AXIS),
    ("X 100", (100.0, 0.0, 0.0), ONE_AXIS),
    ("X 40 Y 20 Z 5", (40.0, 20.0, 5.0), THREE_AXES),
    ("X 10 Y -7 Z 3", (10.0, -7.0, 3.0), THREE_AXES),
)
LINUXCNC = Limits.of(200.0, 1750.0, 87_500.0)  # LinuxCNC itself has no jerk limit
JERKY = Limits.of(200.0, 1750.0, 1.7e6)
MILL = Limits.of(250.0, 1000.0, 50_000.0)
KLIPPER = {"velocity": 250.0, "acceleration": 1000.0, "square_corner_velocity": 5.0, "arc_mm": 0.1}


class Peers:
    """The environment of the other engines."""

    def __init__(self) -> None:
        fetch = subprocess.run(
            [ROOT / "tests" / "tools" / "fetch_peers.sh"], stdout=subprocess.PIPE, text=True, check=True
        )
        self._python = fetch.stdout.splitlines()[-1]

    def ask(self, script: str, question: dict[str, Any]) -> dict[str, Any] | None:
        """What a script there answers; None, and why on stderr, if its package is not to be had."""
        run = subprocess.run(
            [self._python, "-I", HERE / script], input=json.dumps(question), capture_output=True, text=True, check=False
        )
        if run.returncode == 0:
            answer: dict[str, Any] = json.loads(run.stdout)
            return answer
        if "ModuleNotFoundError" not in run.stderr:
            raise RuntimeError(run.stderr)
        print(f"{script}: {run.stderr.splitlines()[-1]}", file=sys.stderr)
        return None


def row(what: str, who: str, found: Figures, *more: str) -> list[str]:
    """A line of a table about a motion."""
    off = "" if np.isnan(found.off_mm) else f"{1e3 * found.off_mm:.1f}"
    shares = [f"{share:.3f}" if share < 10.0 else f"{share:.0f}" for share in found.shares]
    return [what, who, f"{found.time_s:.3f}", *shares, off, *more]


HEAD = ["", "engine", "time, s", "speed / limit", "acceleration / limit", "jerk / limit", "off the path, um"]


def single_moves(driver: Path, peers: Peers, folder: Path, passes: int) -> tuple[str, list[float]]:
    """From rest to rest; every figure of ours that must not pass its limit."""
    asked = [
        {
            "target": list(target), "feed": limits.feed, "acceleration": limits.acceleration, "jerk": limits.jerk,
            "synchronization": how, "file": str(folder / f"{name}-{how}"),
        }
        for name, target, limits in MOVES
        for how in (("Phase", "Time") if target[1] else ("Phase",))
    ]  # fmt: skip
    answer = peers.ask("peer_ruckig.py", {"period_s": PERIOD_S, "passes": passes, "moves": asked})
    lines, kept = [], []
    for name, target, limits in MOVES:
        route = Route([Piece(target, 1e6)])
        for question, told in zip(asked, answer["moves"] if answer else [], strict=bool(answer)):
            if question["target"] == list(target):
                found = figures(read_points(Path(question["file"])), limits, route)
                who = f"Ruckig {answer['version']}" + (f", {question['synchronization']}" if target[1] else "")
                times = (f"{told['calculation_us']:.1f}", f"{told['step_us']:.2f}", f"{told['longest_step_us']:.1f}")
                lines.append(row(name, who, found, *times))
        points, told = ours(driver, route, limits, folder / "ours", tolerance=0.05, passes=passes)
        found = figures(points, limits, route)
        kept += found.shares
        times = (f"{told['push_us']:.1f}", f"{told['step_us']:.2f}", f"{told['longest_step_us']:.1f}")
        lines.append(row(name, "shapegcode online", found, *times))
        points, told = ours(driver, route, limits, folder / "ours", "plan", tolerance=0.05, passes=passes)
        found = figures(points, limits, route)
        kept += found.shares
        lines.append(row(name, "shapegcode, time-optimal", found, f"{told['plan_us']:.0f}", "", ""))
    return markdown([*HEAD, "calculation or push, us", "set-point, us", "longest, us"], lines), kept


def klipper(
    peers: Peers, folder: Path, routes: dict[str, Route], limits: dict[str, float]
) -> dict[str, tuple[Array, str]]:
    """Set-points under Klipper's look-ahead, and microseconds for a move."""
    paths = [
        {
            "start": route.start, "file": str(folder / f"klipper-{number}"),
            "pieces": [
                {"kind": "arc" if piece.centre else "line", "end": piece.end, "feed": piece.feed,
                 "centre": piece.centre, "sweep": piece.sweep, "normal": piece.normal}
                for piece in route.pieces
            ],
        }
        for number, route in enumerate(routes.values())
    ]  # fmt: skip
    answer = peers.ask("peer_klipper.py", {"period_s": PERIOD_S, "limits": limits, "paths": paths})
    if answer is None:
        return {}
    return {
        name: (read_points(Path(path["file"])), f"{told['move_us']:.1f}")
        for name, path, told in zip(routes, paths, answer["paths"], strict=True)
    }


def small_arcs(driver: Path, peers: Peers, folder: Path) -> tuple[str, list[float]]:
    """Blended small arcs as LinuxCNC commanded them, and the same path here and by Klipper's host."""
    if not ARCS.is_file():
        return f"{ARCS.relative_to(ROOT)} is not there: nothing of LinuxCNC to compare with", []
    route = read_program(ARCS.read_text(encoding="ascii"), LINUXCNC.feed[0])
    lines, kept = [], []
    if RECORDED.is_file():
        with gzip.open(RECORDED, "rt", encoding="ascii") as text:
            points = np.loadtxt(text, delimiter=",", skiprows=1)
        points = np.column_stack([points, np.zeros(len(points))])
        lines.append(row("small arcs", "LinuxCNC, recorded", figures(points, LINUXCNC, route)))
    else:
        lines.append(["small arcs", f"LinuxCNC: no {RECORDED.name}", *[""] * 5])
    settings = {**KLIPPER, "velocity": LINUXCNC.feed[0], "acceleration": LINUXCNC.acceleration[0]}
    for points, _ in klipper(peers, folder, {"arcs": route}, settings).values():
        lines.append(row("small arcs", "Klipper's host, chords of 0.1 mm", figures(points, LINUXCNC, route)))
    for tolerance_mm, limits in ((0.1, LINUXCNC), (0.01, LINUXCNC), (0.1, JERKY)):
        more = f", tolerance {tolerance_mm} mm" + (", as much jerk as LinuxCNC" if limits is JERKY else "")
        for who, how in (("shapegcode online", "play"), ("shapegcode, time-optimal", "plan")):
            points, _ = ours(driver, route, limits, folder / "ours", how, tolerance=tolerance_mm)
            kept += figures(points, limits).shares
            lines.append(row("small arcs", f"{who}{more}", figures(points, LINUXCNC, route)))
    return markdown(HEAD, lines), kept


def cutting_paths(folder: Path) -> dict[str, Route]:
    """The longest cutting path of each."""
    curve = folder / "curve.nc"
    workload.write_program(curve, 3000)
    routes = {}
    for name, file in (("PARALLEL.NC", GOLDEN / "PARALLEL.NC"), ("finishing curve, 3 000 lines", curve)):
        path = max((region.path for region in sg.Program.read(file, sg.Machine.load("vx500")).regions), key=len)
        start, pieces = tuple(map(float, path[0].start_mm)), []
        for number in range(len(path)):
            segment = path[number]
            arc = segment.kind.name == "arc"
            centre = tuple(map(float, segment.centre_mm)) if arc else None
            end = tuple(map(float, segment.end_mm))
            pieces.append(Piece(end, segment.feed_mm_per_s, centre, segment.sweep_rad, segment.normal))
        routes[name] = Route(pieces, start)
    return routes


def programs(driver: Path, peers: Peers, folder: Path) -> tuple[str, list[float]]:
    """Whole cutting paths, by Klipper's host and here."""
    routes = cutting_paths(folder)
    batch = klipper(peers, folder, routes, KLIPPER)
    lines, kept = [], []
    for name, route in routes.items():
        if name in batch:
            points, move_us = batch[name]
            lines.append(row(name, "Klipper's host", figures(points, MILL, route), move_us))
        else:
            lines.append([name, "Klipper's host: not available as a package", *[""] * 6])
        points, told = ours(driver, route, MILL, folder / "ours", tolerance=0.05)
        found = figures(points, MILL, route)
        kept += found.shares
        spent_us = told["step_us"] * told["steps"] / len(route.pieces)
        lines.append(row(name, "shapegcode online", found, f"{spent_us:.1f}"))
        points, told = ours(driver, route, MILL, folder / "ours", "plan", tolerance=0.05)
        found = figures(points, MILL, route)
        kept += found.shares
        lines.append(row(name, "shapegcode, time-optimal", found, f"{told['plan_us']:.1f}"))
    return markdown([*HEAD, "us per move"], lines), kept


def short_blocks(curved: bool, block_mm: float, feed: float) -> Route:
    """Rows of 300 mm, or 600 mm of a curve whose radius is 33 mm and more, in blocks of a length."""
    if not curved:
        ways = np.arange(round(300.0 / block_mm) + 1) * block_mm
        rows = [np.column_stack([ways if n % 2 == 0 else 300.0 - ways, np.full(len(ways), float(n))]) for n in range(4)]
        points = np.concatenate(rows)[1:]
    else:
        along = np.arange(round(600.0 / block_mm)) * block_mm
        heading = np.cumsum(0.03 * np.sin(along / 15.0)) * block_mm
        points = np.cumsum(block_mm * np.column_stack([np.cos(heading), np.sin(heading)]), axis=0)
    return Route([Piece((float(x), float(y), 0.0), feed) for x, y in np.round(points, 4)])


def throughput(driver: Path, folder: Path) -> tuple[str, list[float]]:
    """What planning takes where every period brings new blocks: blocks a second, and of a core as they are run."""
    limits, feed = Limits.of(250.0, 5000.0, 500_000.0), 250.0
    lines, kept = [], []
    for curved in (False, True):
        for block_mm in (0.2, 0.05):
            route = short_blocks(curved, block_mm, feed)
            hardest = curved and block_mm == 0.05
            for window in (
                (8, 12, 16, 24, 32, 64, 128, 256, 512, 1024, 2048, 8192) if hardest else (128, 512, 2048, 8192)
            ):
                points, told = ours(driver, route, limits, folder / "ours", tolerance=0.05, window=window)
                found = figures(points, limits, route)
                kept += found.shares
                step_us, longest_us = told["step_us"], told["longest_step_us"]
                spent_us = step_us * told["steps"] / len(route.pieces)
                lines.append(
                    ["curve" if curved else "rows", f"{block_mm}", f"{feed / block_mm:.0f}", f"{window}",
                     f"{found.time_s:.3f}", f"{spent_us:.0f}", f"{1e6 / spent_us:.0f}", f"{0.1 * step_us:.1f} %",
                     f"{1e-3 * longest_us:.0f}", f"{told['late_plans']}"]
                )  # fmt: skip
    head = ["path", "block, mm", "programmed, 1/s", "window", "time, s", "us per segment", "segments/s", "of a core"]
    return markdown([*head, "longest plan, ms", "late plans"], lines), kept


def random_route(seed: int) -> tuple[Route, Limits, float]:
    """A polyline in space, gently bent in a plane, or nearly in a plane, with limits and a tolerance for it."""
    draw = np.random.default_rng(seed)
    count = int(draw.integers(3, 25))
    if seed % 3 == 0:
        legs = draw.normal(0.0, 10.0 ** draw.uniform(-0.3, 0.9), (count, 3))
    elif seed % 3 == 1:
        heading, length = np.cumsum(draw.normal(0.0, 0.25, count)), 10.0 ** draw.uniform(-0.5, 0.7, count)
        legs = np.column_stack([length * np.cos(heading), length * np.sin(heading), np.zeros(count)])
    else:
        legs = draw.normal(0.0, 3.0, (count, 3)) * [1.0, 1.0, 0.05]
    acceleration = 10.0 ** draw.uniform(2.5, 3.5)
    jerk, feed = acceleration * 10.0 ** draw.uniform(1.2, 2.2), 10.0 ** draw.uniform(1.2, 2.3)
    each = [
        tuple(float(value) for value in most * draw.uniform(low, high, 3))
        for most, low, high in ((feed, 0.7, 1.5), (acceleration, 0.6, 1.0), (jerk, 0.6, 1.0))
    ]
    pieces = [Piece(tuple(map(float, point)), feed) for point in np.cumsum(legs, axis=0)]
    return Route(pieces), Limits(*each), 10.0 ** draw.uniform(-2.2, -1.0)


def half_widths(route: Route, tolerance_mm: float) -> Array:
    """Over which each corner is rounded: the largest d with which the corners within 2 d stay within the tolerance."""
    points = np.vstack([route.start, [piece.end for piece in route.pieces]])
    legs = np.diff(points, axis=0)
    lengths = np.linalg.norm(legs, axis=1)
    turn = np.linalg.norm(np.diff(legs / lengths[:, None], axis=0), axis=1)
    at, whole = np.cumsum(lengths)[:-1], float(lengths.sum())
    found = []
    for place in at:
        away = np.abs(at - place)
        order = np.argsort(away)
        total = np.cumsum(turn[order])
        reach = np.append(away[order][1:], np.inf) / 2.0
        width = next(max(6.0 * tolerance_mm / sum_, low) for sum_, low, high in zip(
            total, away[order] / 2.0, reach, strict=True) if 6.0 * tolerance_mm / sum_ < high)  # fmt: skip
        found.append(min(width, 3.0, place, whole - place))
    return np.array(found)


def shortest_time(driver: Path, folder: Path, count: int) -> tuple[str, list[float]]:
    """Our time over that of an oracle on the same rounded path."""
    ratios, kept = [], []
    for seed in range(count):
        route, limits, tolerance_mm = random_route(seed)
        points, _ = ours(driver, route, limits, folder / "ours", "plan", tolerance=tolerance_mm)
        found = figures(points, limits, route)
        kept += [*found.shares, found.off_mm / tolerance_mm]
        corners = np.vstack([route.start, [piece.end for piece in route.pieces]])
        oracle = time_optimal(
            rounded_polyline(corners, half_widths(route, tolerance_mm)),
            OracleLimits(
                np.array(limits.feed), np.array(limits.acceleration), np.array(limits.jerk),
                feed=lambda p, feed=route.pieces[0].feed: np.full(len(p), feed),
            ),
        )  # fmt: skip
        ratios.append(found.time_s / oracle.time_s)
    shares = np.percentile(ratios, [50, 90, 100])
    text = markdown(
        ["paths", "median", "90 % below", "worst", "largest share of a limit or the tolerance"],
        [[str(count), *(f"{share:.3f}" for share in shares), f"{max(kept):.4f}"]],
    )
    return text, [*kept, shares[0] / ASKED_MEDIAN, shares[2] / ASKED_WORST]


def fine_blocks() -> str:
    """Rows of 300 mm in blocks of 0.2 mm: what asks for the longest look-ahead, for nothing but a row's end is slow."""
    lines = ["G21 G17 G90 G94", "G0 X0 Y0 Z0", "G1 F15000"]
    for number in range(4):
        ways = range(1, 1501) if number % 2 == 0 else range(1499, -1, -1)
        lines += [f"X{0.2 * way:.1f} Y{number}" for way in ways]
        lines.append(f"Y{number + 1}")
    return "\n".join(["%", "O1", *lines, "M30", "%", ""])


def windows(driver: Path, folder: Path, quick: bool) -> tuple[str, list[float]]:
    """How much longer the path takes when only so many segments are seen; the losses at the window asked for."""
    curve = folder / "long_curve.nc"
    workload.write_program(curve, CURVE_LINES // (4 if quick else 1))
    golden = [file for file in sorted(GOLDEN.iterdir()) if file.suffix.upper() == ".NC"]
    fine = folder / "fine.nc"
    fine.write_text(fine_blocks(), encoding="ascii")
    machines = (
        ("as programmed", 0.0, (1000.0, 50_000.0), [*golden, curve]),
        ("as programmed", 0.0, (5000.0, 500_000.0), [*golden, curve]),
        ("15 m/min", 250.0, (1000.0, 50_000.0), [GOLDEN / "PARALLEL.NC", curve, fine]),
        ("15 m/min", 250.0, (5000.0, 500_000.0), [GOLDEN / "PARALLEL.NC", curve, fine]),
    )
    lines, losses = [], []
    for feed, feed_mm_per_s, (acceleration, jerk), files in machines:
        task = f"feed 250 250 250\nacceleration {f'{acceleration} ' * 3}\njerk {f'{jerk} ' * 3}\ntolerance 0.05\n"
        task += f"program_feed {feed_mm_per_s}\n"
        for file in files:
            run = subprocess.run(
                [driver, "window", *map(str, WINDOWS), "--", file],
                input=task, capture_output=True, text=True, check=False,
            )  # fmt: skip
            name = {curve: "finishing curve", fine: "straight rows in blocks of 0.2 mm"}.get(file, file.name)
            if run.returncode:
                print(f"{name} is left out: {run.stderr.strip()}", file=sys.stderr)
                continue
            found = json.loads(run.stdout)[0]
            excess = [found["windows"][str(window)] / found["planned_s"] - 1.0 for window in WINDOWS]
            if file != fine:
                losses.append(excess[WINDOWS.index(ASKED_WINDOW)])
            lines.append(
                [name, feed, f"{acceleration:.0f}, {jerk:.0f}", str(found["segments"]), str(found["longest_path"]),
                 f"{found['planned_s']:.3f}", *(f"{100.0 * loss:.2f} %" for loss in excess)]
            )  # fmt: skip
    head = ["program", "feed", "acceleration, jerk", "segments", "longest path", "whole path, s"]
    return markdown([*head, *(f"window {window}" for window in WINDOWS)], lines), losses


def random_paths(driver: Path, count: int) -> tuple[str, list[float]]:
    """Largest of each order over every set-point of so many random paths, a hundred at a time on each processor."""

    def run(first: int) -> dict[str, Any]:
        command = [driver, "random", str(min(100, count - first)), str(first)]
        found: dict[str, Any] = json.loads(subprocess.run(command, stdout=subprocess.PIPE, check=True).stdout)
        print(f"random paths from {first} on: {json.dumps(found)}", file=sys.stderr, flush=True)
        return found

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        parts = list(pool.map(run, range(0, count, 100)))
    orders, lines, worst = ("speed", "acceleration", "jerk"), [], []
    for key, what in (("fixed", "all others"), ("following", "a shaper that follows an axis")):
        groups = [part[key] for part in parts]
        lost = sum(group["lost"] for group in groups)
        lines.append([what, str(sum(group["paths"] for group in groups)), str(lost)])
        for order in orders:
            most = max((group[order] for group in groups), key=lambda found: float(found["worst"]))
            above = sum(group[order]["above"] for group in groups)
            lines[-1].append(f"{most['worst']:.6f} (seed {most['seed']}, {above} above {ALLOWED_RATIO})")
            worst.append(most["worst"])
        longest = max((group["segment_s"] for group in groups), key=lambda found: float(found["worst"]))
        lines[-1].append(f"{longest['worst']:.1f} s (seed {longest['seed']})")
        crawls = sum(group["segment_s"]["above"] for group in groups)
        worst += [np.inf] if lost or crawls else []
    text = markdown(
        [
            "paths with",
            "number",
            "not at their end",
            *(f"{order} / limit" for order in orders),
            "longest time in a segment",
        ],
        lines,
    )
    totals = ", ".join(
        f"{sum(part[key] for part in parts)} {what}"
        for key, what in (("set_points", "set-points"), ("overrides", "overrides"), ("holds", "holds"))
    )
    return f"{totals}\n\n{text}", worst


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="50 random paths, a shorter curve, fewer passes")
    parser.add_argument(
        "--paths", type=int, default=1000, help="random paths (default: %(default)s, a quarter of an hour)"
    )
    parser.add_argument("--parts", nargs="+", metavar="TITLE", help="only the parts whose title contains one of these")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write what was judged to FILE")
    arguments = parser.parse_args()
    driver, peers = native.built("peers"), Peers()
    ratios: dict[str, list[float]] = {}
    with tempfile.TemporaryDirectory(prefix="shapegcode-peers-") as name:
        folder = Path(name)
        parts = {
            "Single moves": lambda: single_moves(driver, peers, folder, 3 if arguments.quick else 20),
            "Small arcs": lambda: small_arcs(driver, peers, folder),
            "Programs": lambda: programs(driver, peers, folder),
            "Throughput": lambda: throughput(driver, folder),
            "Beside the shortest time": lambda: shortest_time(driver, folder, 20 if arguments.quick else 200),
            "Window of the look-ahead": lambda: windows(driver, folder, arguments.quick),
            "Random paths": lambda: random_paths(driver, 50 if arguments.quick else arguments.paths),
        }
        for title, part in parts.items():
            if arguments.parts and not any(asked.lower() in title.lower() for asked in arguments.parts):
                continue
            text, ratios[title] = part()
            print(f"## {title}\n\n{text}\n", flush=True)
    losses = ratios.pop("Window of the look-ahead", [0.0])
    worst = {title: max(values, default=0.0) for title, values in ratios.items()}
    print(date.today().isoformat(), worst, f"largest loss at a window of {ASKED_WINDOW}: {100.0 * max(losses):.2f} %")
    if arguments.json:
        arguments.json.write_text(json.dumps({"worst": worst, "losses": losses}, indent=2) + "\n", encoding="utf-8")
    return int(max(worst.values(), default=0.0) > ALLOWED_RATIO or max(losses) > ASKED_LOSS)


if __name__ == "__main__":
    sys.exit(main())
