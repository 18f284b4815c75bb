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
from typing import Any

import numpy as np
import numpy.typing as npt
from nc_gcode_interpreter import nc_to_dataframe

from rs274_tool import canonical_moves, run_rs274

Vector = npt.NDArray[np.float64]
ROOT = Path(__file__).resolve().parents[2]
TOOLS = "".join(f"T{number} P{number} Z0 D0\n" for number in range(1, 100))
_PLANES = {"G17": (0, 1), "G18": (2, 0), "G19": (1, 2)}
_SIEMENS_WORDS = ["I", "J", "K", "CR", "IM", "JM", "KM", "TURN"]
_SIEMENS_UNITS = {"G70": (25.4, 1.0), "G71": (1.0, 1.0), "G700": (25.4, 25.4), "G710": (1.0, 1.0)}  # of lengths, feeds


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


def read_siemens(text: str, _folder: Path | None = None) -> list[ReadMove]:
    """Moves and dwells, in mm, mm/min and s."""
    lines = [line.partition(";")[0].strip() for line in text.splitlines()]
    # It knows no names with digits: I1= is IM= to it.
    shown = re.sub(r"\b([IJK])1=", r"\1M=", "\n".join(line for line in lines if line and not line.startswith("%")))
    rows = nc_to_dataframe(shown + "\n", extra_axes=_SIEMENS_WORDS, disable_forward_fill=True)[0].to_dicts()
    at, motion, axes, distance, feed, found = np.zeros(3), "G0", (0, 1), "G90", math.nan, list[ReadMove]()
    unit = _SIEMENS_UNITS["G71"]
    for row in rows:
        # Its numbers have single precision: what was written is the shortest decimal.
        values = {name: float(str(np.float32(value))) if isinstance(value, float) else value
                  for name, value in row.items() if value is not None}  # fmt: skip
        motion = values.get("gg01_motion", motion)
        axes = _PLANES.get(values.get("gg06_plane_select", ""), axes)
        distance = values.get("gg14_wp_measure_mode", distance)
        unit = _SIEMENS_UNITS.get(values.get("gg13_wp_measure", ""), unit)
        if "gg02_wait" in values:
            found.append(ReadMove(at, at, dwell_s=values["F"]))
            continue
        feed = values["F"] * unit[1] if "F" in values else feed
        named = {name: values[name] * unit[0] for name in ("X", "Y", "Z", *_SIEMENS_WORDS) if name in values}
        base = at if distance == "G91" else np.zeros(3)
        end = np.array([base[k] + named[axis] if axis in named else at[k] for k, axis in enumerate("XYZ")])
        if same(end, at) and not named.keys() & {*"IJK"}:
            continue
        if motion in ("G0", "G1"):
            found.append(ReadMove(at, end, motion == "G0", math.nan if motion == "G0" else feed))
        else:
            centre, turn = _siemens_circle(at, end, motion, axes, named)
            found.append(ReadMove(at, end, False, feed, centre=centre, turn=turn))
        at = end
    return found


def _siemens_circle(
    at: Vector, end: Vector, motion: str, axes: tuple[int, int], words: dict[str, float]
) -> tuple[Vector, int]:
    """Centre and sense of an arc by radius, by its centre, or (CIP) through a point."""
    turn = 1 if motion == "G3" else -1
    if motion == "CIP":
        middle = np.array([words.get(name, at[k]) for k, name in enumerate(("IM", "JM", "KM"))])
        return _through(at, middle, end, axes)
    if "CR" in words:
        return centre_of(at, end, words["CR"], turn, axes), turn
    return at + np.array([words.get(name, 0.0) for name in "IJK"]), turn


def _through(start: Vector, middle: Vector, end: Vector, axes: tuple[int, int]) -> tuple[Vector, int]:
    """Centre of a circle where the bisectors of two chords meet, and its sense."""
    a, b, c = (complex(each[axes[0]], each[axes[1]]) for each in (start, middle, end))
    w = (c - a) / (b - a)
    at = (b - a) * (w - abs(w) ** 2) / (2j * w.imag) + a
    at = a + b - at if abs(abs(at - a) - abs(at - c)) > 1e-6 else at
    centre = start.copy()
    centre[axes[0]], centre[axes[1]] = at.real, at.imag
    return centre, 1 if ((b - a).conjugate() * (c - b)).imag > 0.0 else -1


def in_klipper(script: Path, asked: str, *arguments: str) -> Any:
    """What a script answers in Klipper's environment."""
    fetch = [ROOT / "tests" / "tools" / "fetch_peers.sh"]
    python = subprocess.run(fetch, stdout=subprocess.PIPE, text=True, check=True).stdout.splitlines()[-1]
    done = subprocess.run([python, script, *arguments], input=asked, stdout=subprocess.PIPE, text=True, check=True)
    return json.loads(done.stdout)


def klipper_set_points(
    start: Vector, pieces: list[dict[str, Any]], limits: dict[str, float], folder: Path
) -> tuple[Vector, float]:
    """Set-points at 1 ms of pieces from rest to rest as Klipper's look-ahead plans them, and their time."""
    file = folder / "points"
    path = {"start": list(start), "pieces": pieces, "file": str(file)}
    asked = {"paths": [path], "limits": limits, "period_s": 0.001}
    answer = in_klipper(ROOT / "tests" / "benchmarks" / "peer_klipper.py", json.dumps(asked))
    return np.fromfile(file).reshape(-1, 3), answer["paths"][0]["duration_s"]


def plan_klipper(moves: list[ReadMove], acceleration: float, folder: Path) -> tuple[Vector, float]:
    """The same of moves."""
    pieces = [{"kind": "line", "end": list(each.end), "feed": each.feed_mm_per_min / 60.0} for each in moves]
    limits = {"velocity": 500.0, "acceleration": acceleration, "square_corner_velocity": 5.0, "arc_mm": 1.0}
    return klipper_set_points(moves[0].start, pieces, limits, folder)


def read_klipper(text: str, _folder: Path, arc_mm: float | None = None) -> list[ReadMove]:
    """The moves of a program; `arc_mm`: resolution of [gcode_arcs], None: there is no such section."""
    reader = Path(__file__).with_name("klipper_moves.py")
    answer = in_klipper(reader, text, *([] if arc_mm is None else [str(arc_mm)]))
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
