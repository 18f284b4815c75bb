"""Random SINUMERIK programs that PyPI's nc-gcode-interpreter reads as a control does (dialect_readers.read_siemens).

The interpreter (0.1.9) works out expressions, loops, conditions, IC and TRANS. It counts operators of every kind from
left to right, so expressions stand in brackets; it takes distances of G91 as they are, which the reader adds up, and no
IC stands behind them; TRANS without values does not clear there, so zeros stand in it.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field

import numpy as np

from dialect_readers import Vector

PLANES = {"G17": (0, 1, 2), "G18": (2, 0, 1), "G19": (1, 2, 0)}


@dataclass
class _Writer:
    """A program that is being made up, and where it is."""

    rng: np.random.Generator
    lines: list[str] = field(default_factory=list)
    at: Vector = field(default_factory=lambda: np.zeros(3))
    plane: str = "G17"
    incremental: bool = False
    shift: Vector = field(default_factory=lambda: np.zeros(3))
    values: dict[str, float] = field(default_factory=dict)
    stale: set[int] = field(default_factory=set)
    was_incremental: bool = False

    def number(self, value: float, depth: int = 2) -> str:
        """An expression that comes to a number, or the number."""
        if depth == 0 or self.rng.random() < 0.6 or not self.values:
            return (
                f"{value:.4f}" if value >= 0.0 else f"(0-{-value:.4f})" if self.rng.random() < 0.3 else f"{value:.4f}"
            )
        name = str(self.rng.choice(sorted(self.values)))
        known = self.values[name]
        kind = self.rng.choice(["+", "-", "*", "/"])
        if kind == "+":
            return f"({name}+{self.number(value - known, depth - 1)})"
        if kind == "-":
            return f"({name}-({self.number(known - value, depth - 1)}))"
        if kind == "*":
            return f"(({name}*2)+({self.number(value - 2.0 * known, depth - 1)}))"
        return f"(({name}/4)+({self.number(value - known / 4.0, depth - 1)}))"

    def word(self, address: str, value: float) -> str:
        """A word, with = where its value is an expression."""
        text = self.number(value)
        plain = re.fullmatch(r"-?[\d.]+", text) and len(address) == 1 and self.rng.random() < 0.7
        return f"{address}{'' if plain else '='}{text}"

    def axes(self, end: Vector, which: list[int]) -> str:
        """Words of axes as G90 or G91, TRANS and IC have them."""
        words = []
        for axis in sorted(which):
            incremental = self.incremental
            self.was_incremental |= incremental
            steps = not (self.was_incremental or axis in self.stale or np.any(self.shift))
            if steps and self.rng.random() < 0.15:
                words.append(f"{'XYZ'[axis]}=IC({self.number(end[axis] - self.at[axis], 1)})")
                continue
            value = end[axis] - self.at[axis] if incremental else end[axis] - self.shift[axis]
            words.append(self.word("XYZ"[axis], value))
            self.stale.discard(axis)
        return " ".join(words)


def random_siemens(seed: int) -> str:
    """Expressions, loops, conditions, IC, TRANS, planes, arcs by I J K, CR and three points, dwells."""
    rng = np.random.default_rng(seed)
    make = _Writer(rng)
    names = ["AA", "BETA", "VAL_C"]
    make.lines = ["%_N_RANDOM_MPF", "; random"]
    for name in names:
        make.values[name] = round(float(rng.uniform(-20.0, 20.0)), 3)
        make.lines.append(f"DEF REAL {name}={make.values[name]}")
    make.lines += ["DEF INT NN", "G17 G90 G94 G71", "G0 X0 Y0 Z0", f"F{rng.integers(200, 3000)}"]
    for _ in range(int(rng.integers(10, 25))):
        kind = str(rng.choice(list(_KINDS), p=[0.08, 0.22, 0.14, 0.12, 0.1, 0.05, 0.06, 0.06, 0.07, 0.1]))
        _KINDS[kind](make)
    return "\n".join([*make.lines, "M30", ""])


def _feed(make: _Writer) -> str:
    return f" F{make.rng.integers(50, 6000)}" if make.rng.random() < 0.4 else ""


def _rapid(make: _Writer) -> None:
    end = np.round(make.rng.uniform(-40.0, 40.0, 3), 3)
    make.lines.append(f"G0 {make.axes(end, [0, 1, 2])}")
    make.at = end


def _line(make: _Writer) -> None:
    which = sorted({int(axis) for axis in make.rng.choice(3, size=int(make.rng.integers(1, 4)), replace=False)})
    end = make.at.copy()
    end[which] = np.round(make.rng.uniform(-40.0, 40.0, len(which)), 3)
    make.lines.append(f"G1 {make.axes(end, which)}{_feed(make)}")
    make.at = end


def _circle_about(make: _Writer) -> tuple[Vector, float, float, int]:
    """Centre, begin, sweep and sense of a circle through where the program is."""
    first, second, _ = PLANES[make.plane]
    radius, begin = float(make.rng.uniform(1.0, 30.0)), float(make.rng.uniform(0.0, math.tau))
    centre = make.at.copy()
    centre[[first, second]] -= np.round(radius * np.array([math.cos(begin), math.sin(begin)]), 4)
    return centre, radius, float(make.rng.uniform(0.2, 5.5)), int(make.rng.choice([-1, 1]))


def _on(make: _Writer, centre: Vector, angle: float) -> Vector:
    """Where the program is, turned about a centre."""
    first, second, _ = PLANES[make.plane]
    spoke = complex(make.at[first] - centre[first], make.at[second] - centre[second]) * complex(
        math.cos(angle), math.sin(angle)
    )
    point = make.at.copy()
    point[first], point[second] = round(centre[first] + spoke.real, 4), round(centre[second] + spoke.imag, 4)
    return point


def _arc(make: _Writer) -> None:
    centre, _, sweep, turn = _circle_about(make)
    first, second, across = PLANES[make.plane]
    end = _on(make, centre, turn * sweep)
    which = [first, second]
    if make.rng.random() < 0.2:  # a whole circle
        end, which = make.at.copy(), []
    if make.rng.random() < 0.3:
        end[across] = round(float(make.at[across] + make.rng.uniform(-5.0, 5.0)), 3)
        which.append(across)
    words = " ".join(make.word("IJK"[k], centre[k] - make.at[k]) for k in sorted((first, second)))
    make.lines.append(f"G{3 if turn > 0 else 2} {make.axes(end, which)} {words}{_feed(make)}")
    make.at = end


def _arc_by_radius(make: _Writer) -> None:
    centre, _, sweep, turn = _circle_about(make)
    if abs(sweep - math.pi) < 0.2:
        sweep = 1.0
    first, second, _ = PLANES[make.plane]
    end = _on(make, centre, turn * sweep)
    radius = float(np.hypot(*(make.at - centre)[[first, second]]))
    text = make.word("CR", radius if sweep < math.pi else -radius)
    make.lines.append(f"G{3 if turn > 0 else 2} {make.axes(end, [first, second])} {text}{_feed(make)}")
    make.at = end


def _arc_through(make: _Writer) -> None:
    if np.any(make.shift) or make.incremental:
        return _arc(make)
    centre, _, sweep, turn = _circle_about(make)
    first, second, _ = PLANES[make.plane]
    middle, end = _on(make, centre, turn * 0.6 * sweep), _on(make, centre, turn * sweep)
    words = " ".join(make.word(f"{'IJK'[k]}1", middle[k]) for k in sorted((first, second)))
    make.lines.append(f"CIP {make.axes(end, [first, second])} {words}{_feed(make)}")
    make.at = end
    return None


def _dwell(make: _Writer) -> None:
    make.lines.append(f"G4 F{make.rng.integers(1, 3000) / 1000:.3f}")


def _modes(make: _Writer) -> None:
    make.plane = str(make.rng.choice(list(PLANES)))
    make.incremental = bool(make.rng.random() < 0.4) and not np.any(make.shift) and not make.stale
    make.lines.append(f"{make.plane} {'G91' if make.incremental else 'G90'}")


def _trans(make: _Writer) -> None:
    if make.incremental:
        make.incremental = False
        make.lines.append("G90")
    if np.any(make.shift) and make.rng.random() < 0.5:
        make.shift = np.zeros(3)
        make.lines.append("TRANS X0 Y0 Z0")
    elif np.any(make.shift):
        step = round(float(make.rng.uniform(-9.0, 9.0)), 3)
        make.shift = make.shift + np.array([step, 0.0, 0.0])
        make.lines.append(f"ATRANS X{step}")
    else:
        make.shift = np.round(make.rng.uniform(-9.0, 9.0, 3), 3)
        make.lines.append("TRANS " + " ".join(f"{'XYZ'[k]}={value}" for k, value in enumerate(make.shift)))
    make.stale = {0, 1, 2}


def _condition(make: _Writer) -> None:
    name = str(make.rng.choice(sorted(make.values)))
    holds = bool(make.rng.random() < 0.5)
    limit = make.values[name] + (1.0 if holds else -1.0)
    make.lines.append(f"IF {name}<({limit:.4f})")
    before, stale = make.at.copy(), set(make.stale)
    (_line if holds else _rapid)(make)
    taken, at, cleared = make.at.copy(), before, set(make.stale)
    make.lines.append("ELSE")
    make.at, make.stale = at, stale
    (_rapid if holds else _line)(make)
    if holds:
        make.at, make.stale = taken, cleared
    make.lines.append("ENDIF")


def _loop(make: _Writer) -> None:
    """Squares and half circles that come back, or go on by a step, in G91."""
    if np.any(make.shift) or make.stale:
        return _line(make)
    count, step = int(make.rng.integers(2, 5)), round(float(make.rng.uniform(0.5, 3.0)), 3)
    first, second, _ = PLANES[make.plane]
    a, b, centre = "XYZ"[first], "XYZ"[second], "IJK"[first]
    before = "G91" if make.rng.random() < 0.7 else "G91 F900"
    body = [f"G1 {a}=(NN*{step})", f"G2 {a}{2 * step:.3f} {b}0 {centre}{step:.3f}", f"G1 {b}-{step}"]
    if make.rng.random() < 0.5:
        make.lines += [f"FOR NN=1 TO {count}", before, *body, "ENDFOR"]
    else:
        make.lines += ["NN=1", f"WHILE NN<={count}", before, *body, "NN=(NN+1)", "ENDWHILE"]
    make.at = make.at.copy()
    make.at[first] += step * count * (count + 1) / 2 + 2.0 * step * count
    make.at[second] -= step * count
    make.incremental = make.was_incremental = True
    return None


_KINDS = {
    "rapid": _rapid, "line": _line, "arc": _arc, "radius": _arc_by_radius, "through": _arc_through, "dwell": _dwell,
    "modes": _modes, "trans": _trans, "condition": _condition, "loop": _loop,
}  # fmt: skip
