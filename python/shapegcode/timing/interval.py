"""The 95 % interval of a predicted time: uncertainty of calibrated parameters, and unexplained scatter."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import pairwise

from shapegcode import _core
from shapegcode.machine import Machine
from shapegcode.model.machine_model import fanuc_model
from shapegcode.program import Program

_DEVIATIONS = 1.96  # standard deviations of a 95 % interval
_KINDS = "kind of look-ahead"
CUTS, BETWEEN, RUNS = "scatter, cuts of a tool", "scatter between cuts", "repeated runs"


@dataclass(frozen=True)
class OpenPart:
    """Contribution of one source to the interval of a time."""

    name: str  # a parameter, the kind of look-ahead, or a scatter
    half_width_s: float  # half of the 95 % interval from this source alone, s
    share: float  # ratio of the variance, 0 to 1


@dataclass(frozen=True)
class LogNext:
    """A program that could be logged next for calibration."""

    program: str  # its name
    half_width_s: float  # half of the 95 % interval that would remain for the timed program, s


# Contents of a program that determines a parameter, by a word of its name; the first match.
_TELLS = {
    _KINDS: "a program unlike those logged, with corners of many angles and moves of many lengths",
    "block is read": "a program with many moves below {move:.2g} mm",
    "acceleration is built up": "a program with many moves below {move:.2g} mm",
    "step of Z": "a program of a surface, in which Z changes its speed from move to move",
    "step of X and Y": "a program with sharp corners at the full feed",
    "at a corner": "a program with corners of many angles at the full feed",
    "corners that are stops": "a program with corners of 1° to 90° at the full feed",
    "in arcs": "a program with small arcs at a high feed",
    "acceleration of Z": "a program that cuts up and down with Z",
    "acceleration of X": "a program with many starts and stops of X and Y",
    "feed is reached": "a program with many starts and stops",
    "rapid": "a program with many rapids, short and long",
    "spindle": "a program with several spindle speeds, each with its M03 and M05",
    "cuts of a tool": "this program itself, or one with the same kind of work",
}


@dataclass(frozen=True)
class TimeInterval:
    """The 95 % interval of a program's time."""

    total_s: float
    mean_move_mm: float  # mean length of its moves in cuts
    steps: Mapping[str, float]  # change of the time by each undetermined direction, s
    scatters: Mapping[str, float]  # standard deviation of scatter that no parameter explains, s

    @property
    def half_width_s(self) -> float:
        """Half of the interval, s."""
        return _half(self.steps.values(), self.scatters.values())

    def parts(self) -> tuple[OpenPart, ...]:
        """Its components, the largest first."""
        found: dict[str, float] = defaultdict(float)
        for name, value in (*self.steps.items(), *self.scatters.items()):
            found[_KINDS if name.startswith(_KINDS) else name] += value**2
        whole = sum(found.values()) or 1.0
        parts = [OpenPart(name, _DEVIATIONS * math.sqrt(each), each / whole) for name, each in found.items() if each]
        return tuple(sorted(parts, key=lambda part: -part.share))

    def narrowed_by(self) -> str:
        """What a program must contain so that its log narrows the interval; no log narrows the scatter between runs."""
        name = next((part.name for part in self.parts() if part.name not in (BETWEEN, RUNS)), CUTS)
        text = next((text for word, text in _TELLS.items() if word in name), f"a program in which {name} occurs alone")
        return text.format(move=self.mean_move_mm)

    def after_logging(self, other: TimeInterval) -> float:
        """Half-width, s, once another program's time is known up to its scatter (least squares)."""
        common = sum(value * other.steps.get(name, 0.0) for name, value in self.steps.items())
        known = sum(value**2 for value in (*other.steps.values(), *other.scatters.values()))
        left = sum(value**2 for value in self.steps.values()) - (common**2 / known if known > 0.0 else 0.0)
        return _half((math.sqrt(max(left, 0.0)),), self.scatters.values())


def _half(*values: Iterable[float]) -> float:
    return _DEVIATIONS * math.sqrt(sum(value**2 for each in values for value in each))


def time_interval(
    program: Program, machine: Machine, feed_override: float, rapid_override: float
) -> TimeInterval | None:
    """Interval of a program's time; None: the machine file holds no calibration scatter."""
    times = machine.times
    if times.scatter is None:
        return None

    def timed(of: Machine) -> _core.CycleTime:
        model = fanuc_model(of, feed_override=feed_override, rapid_override=rapid_override)
        return _core.time_program(program.core, model, False)

    best = timed(machine)
    steps: dict[str, float] = {}
    for row in times.open:
        change = timed(machine.with_values(row.by_key())).total_s - best.total_s
        steps[row.name] = math.hypot(steps.get(row.name, 0.0), change * math.sqrt(row.weight))
        steps[row.name] *= math.copysign(1.0, change)
    cuts: dict[int, float] = defaultdict(float)
    for region in best.regions:
        cuts[int(region["tool"])] += float(region["duration_s"])
    move = float(best.regions["length_mm"].sum()) / max(program.core.block_count, 1)
    gaps = [0, *sorted({line for kind, _, line in program.core.steps if kind == _core.StepKind.function})]
    sections = sum(after - before > 2 for before, after in pairwise([*gaps, program.core.line_count + 1]))
    scatters = {
        CUTS: times.scatter.cuts_percent / 100.0 * math.hypot(*cuts.values()),
        BETWEEN: times.scatter.between_cuts_s * math.sqrt(sections),
        RUNS: times.scatter.runs_percent / 100.0 * best.total_s,
    }
    return TimeInterval(best.total_s, move, steps, scatters)
