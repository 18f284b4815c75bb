"""Programs for other controls read by readers that share nothing with the package, as moves and dwells in mm.

LinuxCNC: its interpreter rs274. Sinumerik: PyPI nc-gcode-interpreter. Klipper: its own host. For controls without a
reader of their own a few lines read what their manual says: Beckhoff TF5200 (pages 206602507, 206132747, 206089483 of
infosys.beckhoff.com), Haas (G04 P with a point is seconds).
"""

from __future__ import annotations

import json
import math
import re
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
from nc_gcode_interpreter import nc_to_dataframe

from rs274_tool import canonical_moves, run_rs274

Vector = npt.NDArray[np.float64]
ROOT = Path(__file__).resolve().parents[2]
TOOLS = "".join(f"T{number} P{number} Z0 D0\n" for number in range(1, 100))
_PLANES = {"G17": (0, 1), "G18": (2, 0), "G19": (1, 2)}


@dataclass(frozen=True)
class ReadMove:
    """A move or a dwell."""

    start: Vector
    end: Vector
    rapid: bool = False
    feed_mm_per_min: float = math.nan  # NaN: it carries its time
    time_s: float = math.nan
    dwell_s: float = 0.0
    centre: Vector | None = None  # of an arc
    turn: int = 0  # 1 counter-clockwise, -1 clockwise

    def distance(self, point: Vector, axes: tuple[int, int] = (0, 1)) -> float:
        """Distance of a point from it, which lies beside it."""
        if self.centre is not None:
            a, b = axes
            radius = math.hypot(self.end[a] - self.centre[a], self.end[b] - self.centre[b])
            return abs(math.hypot(point[a] - self.centre[a], point[b] - self.centre[b]) - radius)
        step = self.end - self.start
        share = float(np.clip((point - self.start) @ step / max(float(step @ step), 1e-18), 0.0, 1.0))
        return float(np.linalg.norm(self.start + share * step - point))


def same(one: Vector, other: Vector) -> bool:
    """Whether two positions are one, but for the round-off of a sum of increments."""
    return bool(np.abs(one - other).max() < 1e-9)


def centre_of(start: Vector, end: Vector, radius: float, turn: int, axes: tuple[int, int]) -> Vector:
    """Centre of an arc given by its radius: negative for more than half a turn."""
    a, b = axes
    chord = np.array([end[a] - start[a], end[b] - start[b]])
    half = 0.5 * float(np.hypot(*chord))
    height = math.sqrt(max(0.0, radius * radius - half * half)) * (1 if radius > 0 else -1) * turn
    left = np.array([-chord[1], chord[0]]) / (2.0 * half)
    centre = start.copy()
    centre[[a, b]] = start[[a, b]] + 0.5 * chord + height * left
    return centre


def read_linuxcnc(text: str, folder: Path) -> list[ReadMove]:
    # rs274 prints four decimals: it reads a program a hundred times as large.
    plain = re.sub(r"\([^)]*\)", "", text)
    large = re.sub(r"([XYZIJKRF])(-?[\d.]+)", lambda word: f"{word[1]}{float(word[2]) * 100:.5f}", plain)
    found = []
    for move in canonical_moves(run_rs274(large, folder, tools=TOOLS)):
        if move.kind != "dwell" and np.array_equal(move.start, move.end) and move.centre is None:
            continue
        turn = 0 if move.centre is None else (1 if move.sweep_rad > 0.0 else -1)
        feed = math.nan if move.kind in ("rapid", "dwell") else move.feed / 100.0
        centre = None if move.centre is None else move.centre / 100.0
        found.append(
            ReadMove(
                move.start / 100.0, move.end / 100.0, move.kind == "rapid", feed, math.nan, move.dwell_s, centre, turn
            )
        )
    return found


def read_siemens(text: str, _folder: Path) -> list[ReadMove]:
    lines = [line.partition(";")[0].strip() for line in text.splitlines()]
    lines = [line for line in lines if line]
    table = nc_to_dataframe("\n".join(lines) + "\n", disable_forward_fill=True)[0].to_dicts()
    # Its numbers have single precision: what was written is the shortest decimal.
    rows = [
        {name: float(str(np.float32(held))) if isinstance(held, float) else held for name, held in row.items()}
        for row in table
    ]
    assert len(rows) == len(lines)
    at, motion, axes, feed, unit, found = np.zeros(3), "G0", (0, 1), math.nan, 1.0, []
    distance = "G90"
    for line, row in zip(lines, rows, strict=True):
        motion = row.get("gg01_motion") or motion
        axes = _PLANES[row["gg06_plane_select"]] if row.get("gg06_plane_select") else axes
        unit = {"G700": 25.4, "G710": 1.0}.get(row.get("gg13_wp_measure") or "", unit)
        distance = row.get("gg14_wp_measure_mode") or distance
        from_last = distance == "G91"
        if row.get("gg02_wait"):
            found.append(ReadMove(at, at, dwell_s=row["F"]))
            continue
        feed = row["F"] * unit if row.get("F") is not None else feed
        named = [row.get(axis) for axis in "XYZ"]
        end = np.array([at[k] if named[k] is None else named[k] * unit + from_last * at[k] for k in range(3)])
        centre, turn = None, {"G2": -1, "G3": 1}.get(motion, 0)
        names = nc_to_dataframe(line + "\n")[1]["symbol_table"] if turn else {}
        if same(end, at) and not names.keys() & {*"IJK"}:
            continue
        if turn:
            if "CR" in names:
                centre = centre_of(at, end, names["CR"] * unit, turn, axes)
            else:
                centre = at + unit * np.array([names.get(each, 0.0) for each in "IJK"])
        found.append(ReadMove(at, end, motion == "G0", math.nan if motion == "G0" else feed, centre=centre, turn=turn))
        at = end
    return found


def in_klipper(script: str, asked: str, *arguments: str) -> str:
    """What a script answers in Klipper's environment."""
    fetch = [ROOT / "tests" / "tools" / "fetch_peers.sh"]
    python = subprocess.run(fetch, stdout=subprocess.PIPE, text=True, check=True).stdout.splitlines()[-1]
    command = [python, Path(__file__).with_name(script), *arguments]
    return subprocess.run(command, input=asked, stdout=subprocess.PIPE, text=True, check=True).stdout


def plan_klipper(moves: list[ReadMove], acceleration: float, folder: Path) -> tuple[Vector, float]:
    """Set-points at 1 ms of moves from rest to rest as Klipper's look-ahead plans them, and their time."""
    pieces = [{"kind": "line", "end": list(each.end), "feed": each.feed_mm_per_min / 60.0} for each in moves]
    limits = {"velocity": 500.0, "acceleration": acceleration, "square_corner_velocity": 5.0, "arc_mm": 1.0}
    asked = {
        "path": {"start": list(moves[0].start), "pieces": pieces}, "limits": limits, "period_s": 0.001,
        "file": str(folder / "points.npy"),
    }  # fmt: skip
    time_s = float(in_klipper("klipper_plan.py", json.dumps(asked)))
    return np.load(folder / "points.npy"), time_s


def read_klipper(text: str, _folder: Path, arc_mm: float | None = None) -> list[ReadMove]:
    """The moves of a program; `arc_mm`: resolution of [gcode_arcs], None: there is no such section."""
    answer = json.loads(in_klipper("klipper_moves.py", text, *([] if arc_mm is None else [str(arc_mm)])))
    assert answer["unknown"] == []
    at, found = np.zeros(3), []
    for move in answer["moves"]:
        if "dwell_s" in move:
            found.append(ReadMove(at, at, dwell_s=move["dwell_s"]))
            continue
        end = np.array(move["end"])
        if not same(end, at):
            found.append(ReadMove(at, end, False, move["speed_mm_per_s"] * 60.0))
        at = end
    return found


def read_haas(text: str, _folder: Path) -> list[ReadMove]:
    return list(_read_words(text, haas=True))


def read_mitsubishi(text: str, _folder: Path) -> list[ReadMove]:
    return list(_read_words(text, haas=False))


def read_isg(text: str, _folder: Path) -> list[ReadMove]:
    assert text.startswith("%")
    return list(_read_words(text.partition("\n")[2], isg=True))


def _read_words(text: str, *, haas: bool = False, isg: bool = False) -> Iterator[ReadMove]:
    at, motion, axes, feed, timed, unit, absolute = np.zeros(3), 0, (0, 1), math.nan, False, 1.0, True
    for raw in text.splitlines():
        line = re.sub(r"\([^)]*\)", "", raw).strip()
        if not line or line[0] in "%O":
            continue
        words = re.findall(r"([A-Z])(-?[\d.]+)", line)
        assert re.sub(r"[A-Z]-?[\d.]+", "", line).strip() == "", line
        named = {letter: value for letter, value in words if letter != "G"}
        codes = [float(value) for letter, value in words if letter == "G"]
        for code in codes:
            motion = int(code) if code in (0, 1, 2, 3) else motion
            axes = _PLANES[f"G{code:g}"] if code in (17, 18, 19) else axes
            absolute = code == 90 if code in (90, 91) else absolute
            timed = code == 93 if code in (93, 94) else timed
            unit = {20.0: 25.4, 21.0: 1.0}.get(code, unit) if not isg else unit
        assert not (isg and {20.0, 21.0, 8.0, 9.0, 10.0, 28.0, 43.0, 53.0, 61.0} & {*codes}), line
        if 4 in codes:
            seconds = isg or (haas and "." in named["P"])
            time_s = float(named["X" if isg else "P"]) * (1.0 if seconds else 1e-3)
            yield ReadMove(at, at, dwell_s=time_s)
            continue
        assert all("." in named[letter] for letter in "XYZIJKRF" if letter in named), line
        if "F" in named:
            feed = float(named["F"]) * (1.0 if timed else unit)
        given = [float(named["XYZ"[k]]) * unit if "XYZ"[k] in named else math.nan for k in range(3)]
        end = np.where(np.isnan(given), at, np.array(given) + (0.0 if absolute else at))
        centre, turn = None, {2: -1, 3: 1}.get(motion, 0)
        if same(end, at) and not (turn and named.keys() & {*"IJK"}):
            continue
        if turn and "R" in named:
            centre = centre_of(at, end, float(named["R"]) * unit, turn, axes)
        elif turn:
            centre = at + unit * np.array([float(named.get(each, 0.0)) for each in "IJK"])
        plain, time_s = (math.nan, feed) if timed and motion else (math.nan if motion == 0 else feed, math.nan)
        assert not timed or motion == 0 or "F" in named, line  # the time of each block stands in it
        yield ReadMove(at, end, motion == 0, plain, time_s, 0.0, centre, turn)
        at = end
