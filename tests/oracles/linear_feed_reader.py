"""Blocks with FLIN read from a program's text, and their motion by an ODE solver: shares nothing with the package.

ds/dt = v0 + (v1 - v0) s / L in each block, v0 the F before it and v1 its own (easymanua.ls 662833 p. 458).
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.integrate import solve_ivp

Vector = npt.NDArray[np.float64]


@dataclass(frozen=True)
class FeedBlock:
    """A block with its feeds in mm/min; the centre in the XY plane of an arc."""

    start: Vector
    end: Vector
    before: float
    feed: float
    centre: complex | None = None
    sweep: float = 0.0

    @property
    def length(self) -> float:
        if self.centre is None:
            return float(np.linalg.norm(self.end - self.start))
        return math.hypot(abs(complex(*self.start[:2]) - self.centre) * self.sweep, self.end[2] - self.start[2])

    def at(self, share: float) -> Vector:
        """The point at a share of the length."""
        point = self.start + share * (self.end - self.start)
        if self.centre is not None:
            spoke = (complex(*self.start[:2]) - self.centre) * complex(
                math.cos(self.sweep * share), math.sin(self.sweep * share)
            )
            point[:2] = (self.centre + spoke).real, (self.centre + spoke).imag
        return point

    def motion(self, period_s: float, begin_s: float) -> tuple[Vector, float]:
        """Points at the ticks of a clock that began `begin_s` before it, and the time that it takes."""
        v0, v1, length = self.before / 60.0, self.feed / 60.0, self.length
        reached = lambda _t, s: s[0] - length  # noqa: E731
        reached.terminal = True  # type: ignore[attr-defined]
        speed = lambda _t, s: [v0 + (v1 - v0) * s[0] / length]  # noqa: E731
        limit = 2.0 * length / min(v0, v1)
        found = solve_ivp(speed, (0.0, limit), [0.0], events=reached, dense_output=True, rtol=1e-11, atol=1e-12)
        time_s = float(found.t_events[0][0])
        ticks = np.arange(
            math.floor(begin_s / period_s + 1e-6) + 1, math.floor((begin_s + time_s) / period_s + 1e-6) + 1
        )
        if not len(ticks):
            return np.zeros((0, 3)), time_s
        shares = found.sol(np.clip(ticks * period_s - begin_s, 0.0, time_s))[0] / length
        return np.array([self.at(float(share)) for share in shares]).reshape(-1, 3), time_s


def cuts_with_flin(text: str) -> list[list[FeedBlock]]:
    """Shaped cuts of a program in Siemens' words (G90, G17, mm), each between its comment and the block behind it."""
    cuts: list[list[FeedBlock]] = []
    at, motion, feed, linear, inside = np.full(3, math.nan), "G0", math.nan, False, False
    for raw in text.splitlines():
        if raw.startswith("; SHAPED"):
            cuts.append([])
            inside = True
        line = raw.partition(";")[0]
        words = dict(re.findall(r"(CR=|[XYZF])(-?[\d.]+)", line)) if "G4 " not in line else {}
        if "G4 " in line or re.search(r"\bG0\b", line):
            inside = False
        motion = (re.findall(r"\bG([0123])\b", line) or [motion])[-1]
        linear = (linear or "FLIN" in line) and "FNORM" not in line
        before, feed = feed, float(words.get("F", feed))
        end = np.array([float(words.get(axis, at[k])) for k, axis in enumerate("XYZ")])
        if inside and not np.array_equal(end, at) and np.all(np.isfinite(at)):
            centre, sweep = _centre(at, end, float(words["CR="]), motion == "3") if "CR=" in words else (None, 0.0)
            cuts[-1].append(FeedBlock(at, end, before if linear else feed, feed, centre, sweep))
        at = end
    return [cut for cut in cuts if cut]


def _centre(start: Vector, end: Vector, radius: float, left_turn: bool) -> tuple[complex, float]:
    a, b = complex(*start[:2]), complex(*end[:2])
    half = abs(b - a) / 2.0
    sweep = 2.0 * math.asin(min(1.0, half / radius)) * (1.0 if left_turn else -1.0)
    return (a + b) / 2.0 + 1j * (b - a) / 2.0 / math.tan(sweep / 2.0), sweep


def command(blocks: list[FeedBlock], period_s: float) -> Vector:
    """Set-points of a cut at a period, its start first and its end last."""
    points, begin_s = [blocks[0].start[None]], 0.0
    for block in blocks:
        part, time_s = block.motion(period_s, begin_s)
        points.append(part)
        begin_s += time_s
    return np.concatenate([*points, blocks[-1].end[None]])
