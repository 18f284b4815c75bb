"""LinuxCNC's stand-alone interpreter rs274 as an independent judge of what a program means."""

from __future__ import annotations

import functools
import math
import os
import re
import subprocess
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

_ROOT = Path(__file__).resolve().parents[2]


@functools.cache
def _linuxcnc_folder() -> Path:
    """The unpacked LinuxCNC packages, fetched when missing. Without rs274 a test fails, it does not skip."""
    fetch = subprocess.run([_ROOT / "tests" / "tools" / "fetch_rs274.sh"], capture_output=True, text=True, check=False)
    if fetch.returncode != 0:
        raise RuntimeError(f"rs274 could not be fetched: {fetch.stderr}")
    return Path(fetch.stdout.splitlines()[-1])


def rs274_command(
    program: Path, folder: Path, tools: str = "", variables: str = ""
) -> tuple[list[str | Path], dict[str, str]]:
    """The command that interprets a program, and its environment."""
    linuxcnc = _linuxcnc_folder()
    tool_table, parameters = folder / "tools.tbl", folder / "variables.var"
    tool_table.write_text(tools)
    parameters.write_text(variables)  # rs274 rewrites it: every run starts from this one
    # PYTHON* variables of our own interpreter must not reach the one inside rs274.
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    environment |= {"HOME": str(folder), "LD_LIBRARY_PATH": f"{linuxcnc}/usr/lib:{linuxcnc}/usr/lib/x86_64-linux-gnu"}
    return [linuxcnc / "usr/bin/rs274", "-g", "-t", tool_table, "-v", parameters, program], environment


def run_rs274(program_text: str, tmp_path: Path, *, tools: str = "", variables: str = "") -> list[str]:
    """The canonical lines that rs274 prints for the program, as they come: `1 N..... STRAIGHT_FEED(...)`.

    `tools` is the text of a tool table, `variables` that of a parameter file; their lengths are inches.

    Raises RuntimeError with rs274's message when it rejects the program.
    """
    program = tmp_path / "program.ngc"
    program.write_text(program_text)
    command, environment = rs274_command(program, tmp_path, tools, variables)
    run = subprocess.run(
        command, env=environment, cwd=tmp_path, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False
    )
    if run.returncode != 0:
        raise RuntimeError(f"rs274 rejects the program (exit {run.returncode}): {run.stderr.strip()}")
    return run.stdout.splitlines()


# ---- canonical calls -------------------------------------------------------------------------------------------------

# A long N number runs into the call's name. Places have four decimals of the program's unit.
_CALL = re.compile(r"(?:\bN[\d.]+ *)?([A-Z][A-Z_0-9]*)\((.*)\)$")
_MM = {"CANON_UNITS_MM": 1.0, "CANON_UNITS_INCHES": 25.4}
#: First, second and normal axis of an arc's numbers.
_PLANES = {"CANON_PLANE_XY": (0, 1, 2), "CANON_PLANE_XZ": (2, 0, 1), "CANON_PLANE_YZ": (1, 2, 0)}


@dataclass(frozen=True)
class CanonicalMove:
    """A move or a dwell as LinuxCNC understands it, in mm of the program's coordinates and mm/min.

    `centre` and `sweep_rad` (positive counter-clockwise about axis `normal`) are those of an arc.
    """

    kind: str
    start: FloatArray
    end: FloatArray
    feed: float = 0.0
    dwell_s: float = 0.0
    centre: FloatArray | None = None
    sweep_rad: float = 0.0
    normal: int = 2
    tool: int = 0

    @property
    def length_mm(self) -> float:
        """Exact length."""
        step = self.end - self.start
        if self.centre is None:
            return float(np.linalg.norm(step))
        a, b = (self.normal + 1) % 3, (self.normal + 2) % 3
        radius = math.hypot(self.end[a] - self.centre[a], self.end[b] - self.centre[b])
        return math.hypot(radius * self.sweep_rad, step[self.normal])

    def points(self, shares: FloatArray) -> FloatArray:
        """Points at these shares (0 ... 1) of the way, shape (n, 3)."""
        points = self.start + np.outer(shares, self.end - self.start)
        if self.centre is not None:
            a, b = (self.normal + 1) % 3, (self.normal + 2) % 3
            begin, finish = ((place - self.centre)[[a, b]] for place in (self.start, self.end))
            # The two radii differ by the rounding of the words.
            radii = np.hypot(*begin) * (1.0 - shares) + np.hypot(*finish) * shares
            angles = math.atan2(begin[1], begin[0]) + self.sweep_rad * shares
            points[:, a] = self.centre[a] + radii * np.cos(angles)
            points[:, b] = self.centre[b] + radii * np.sin(angles)
        return points


def _sweep(begin: FloatArray, finish: FloatArray, turns: int) -> float:
    """The angle from one place to the other (about the centre) with that many turns, negative clockwise."""
    sweep = math.atan2(finish[1], finish[0]) - math.atan2(begin[1], begin[0])
    sweep = math.copysign(1.0, turns) * (math.copysign(1.0, turns) * sweep % math.tau)
    # A full circle: its places have four decimals.
    if abs(sweep) * np.hypot(*begin) < 2e-4 or (math.tau - abs(sweep)) * np.hypot(*begin) < 2e-4:
        sweep = math.copysign(math.tau, turns)
    return sweep + math.copysign(math.tau * (abs(turns) - 1), turns)


def canonical_moves(lines: Iterable[str]) -> Iterator[CanonicalMove]:
    """The moves and dwells of rs274's output, in order."""
    place = np.zeros(3)
    offsets = {"SET_G5X_OFFSET": np.zeros(3), "SET_G92_OFFSET": np.zeros(3)}
    length = np.zeros(3)
    unit, feed, per_turn, spindle, tool, axes = 1.0, 0.0, False, 0.0, 0, (0, 1, 2)
    for line in lines:
        match = _CALL.search(line)
        if match is None:
            continue
        name, words = match[1], match[2].replace(",", " ").split()
        if name == "USE_LENGTH_UNITS":
            unit = _MM[words[0]]
        elif name in offsets:
            # The machine stays where it is: its place in the program's coordinates changes.
            new = unit * np.array([float(word) for word in words[-6:-3]])
            place = place + offsets[name] - new
            offsets[name] = new
        elif name == "USE_TOOL_LENGTH_OFFSET":
            new = unit * np.array([float(word) for word in words[:3]])
            place, length = place + length - new, new
        elif name == "SELECT_PLANE":
            axes = _PLANES[words[0]]
        elif name == "SET_FEED_MODE":
            per_turn = words[-1] == "1"
        elif name == "SET_FEED_RATE":
            feed = unit * float(words[0])  # a later change of the unit leaves the feed what it is
        elif name == "SET_SPINDLE_SPEED":
            spindle = float(words[-1])
        elif name == "CHANGE_TOOL":
            tool = int(words[0])
        elif name == "DWELL":
            yield CanonicalMove("dwell", place, place, dwell_s=float(words[0]), tool=tool)
        elif name in {"STRAIGHT_TRAVERSE", "STRAIGHT_FEED", "ARC_FEED"}:
            numbers = [unit * float(word) for word in words]
            speed = feed * (spindle if per_turn else 1.0)
            if name == "ARC_FEED":
                a, b, normal = axes
                end, centre = np.empty(3), np.zeros(3)
                end[[a, b, normal]] = numbers[0], numbers[1], numbers[5]
                centre[[a, b]] = numbers[2], numbers[3]
                sweep = _sweep((place - centre)[[a, b]], (end - centre)[[a, b]], int(words[4]))
                yield CanonicalMove("arc", place, end, speed, 0.0, centre, sweep, normal, tool)
            else:
                end, straight = np.array(numbers[:3]), name == "STRAIGHT_FEED"
                yield CanonicalMove("line" if straight else "rapid", place, end, speed if straight else 0.0, tool=tool)
            place = end
