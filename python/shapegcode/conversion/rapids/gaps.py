"""Rapids between two cuts: candidates for shaped cutting moves, reasons against the others, and times."""

from __future__ import annotations

import math
import re
from collections import Counter, deque
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, Future
from dataclasses import dataclass
from itertools import accumulate

import numpy as np

from shapegcode import _core
from shapegcode.conversion.whole_text import why_off_grid
from shapegcode.conversion.write import EmittedRegion
from shapegcode.io.units import FloatArray
from shapegcode.machine import Machine
from shapegcode.model.machine_model import MachineModel
from shapegcode.model.modes import UNKNOWN_OFFSET, moving_axis
from shapegcode.program import MM_PER_INCH, Program
from shapegcode.verdict.figures import RegionVerdict

MOVE = _core.StepKind.move

# M codes after which the table need not have settled: stops, tool change, end of the program.
_ENDING_CODES = {0, 1, 2, 6, 30}
_BLOCK = re.compile(r"(?:[A-Z][+-]?[0-9]*\.?[0-9]*)+")
_WORD = re.compile(r"([A-Z])([+-]?[0-9]*\.?[0-9]*)")
_COMMENT = re.compile(r"\([^)]*\)")
_G_CODES = {0, 17, 18, 19, 20, 21, 40, 54, 55, 56, 57, 58, 59, 61, 64, 80, 90, 91, 94, 98, 99}
_UNCHANGED = (
    "plane", "distance", "feed_mode", "units", "compensation", "length_offset", "length_number", "cycle",
    "cycle_return", "coordinate_system", "coordinate_number", "exact_stop", "feed",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Rapid:
    """One rapid of a program."""

    line: int  # line in the program, from 1
    start_mm: FloatArray  # where it starts, (3,), as far as it is known
    end_mm: FloatArray  # where it ends, (3,)
    region: _core.Region | None  # the move as a region that can be written; None: left unchanged
    reason: str  # why it is left unchanged
    head: str  # its N word and comments; may be empty


@dataclass(frozen=True)
class Gap:
    """Rapids and other steps, in order, until a cut, a stop, a tool change or the end of the program."""

    steps: tuple[Rapid | float, ...]  # rapids, and durations of other steps, s
    cut_follows: bool  # a cut follows: the vibration must have settled at the end of the gap

    @property
    def rapids(self) -> list[Rapid]:
        """The rapids of the gap, in order."""
        return [step for step in self.steps if isinstance(step, Rapid)]


def find_gaps(program: Program, machine: Machine) -> list[Gap]:
    """Find the gaps of an emitted program that contain a rapid, in order."""
    core = program.core
    moves = core.other_moves
    functions = core.functions
    reader = _Reader(program, machine)
    gaps: list[Gap] = []
    steps: list[Rapid | float] = []

    def end(cut_follows: bool) -> None:
        if any(isinstance(step, Rapid) for step in steps):
            gaps.append(Gap(tuple(steps), cut_follows))
        steps.clear()

    unmeasured = deque(reader.unmeasured)
    for kind, index, line in core.steps:
        while unmeasured and unmeasured[0].line <= line:
            steps.append(unmeasured.popleft())
        if kind == _core.StepKind.function:
            codes = functions[index][0]
            if _ENDING_CODES.intersection(codes):
                end(cut_follows=False)
            steps.append(len(codes) * machine.times.m_function_s)
        elif kind == _core.StepKind.region:
            end(cut_follows=True)
        else:
            segment, dwell_s = moves[index]
            if dwell_s > 0.0:
                steps.append(dwell_s)
            elif segment.kind != _core.SegmentKind.rapid:
                end(cut_follows=True)
            elif (rapid := reader.rapid(segment, line)) is not None:
                steps.append(rapid)
    steps.extend(unmeasured)
    end(cut_follows=False)
    return gaps


class _Reader:
    def __init__(self, program: Program, machine: Machine) -> None:
        core = program.core
        self._program, self._machine = program, machine
        moves = core.other_moves
        self._texts = texts = core.text.decode("latin-1").split("\n")
        self._begins = list(accumulate((len(text) + 1 for text in texts), initial=0))
        rapids = {
            line
            for kind, index, line in core.steps
            if kind == MOVE and moves[index][1] <= 0.0 and moves[index][0].kind == _core.SegmentKind.rapid
        }
        counts = Counter(line for kind, _, line in core.steps if kind == MOVE)
        self._shared = {line for line, count in counts.items() if count > 1}  # lines that make several moves
        # The reader returns no move if the path is unknown.
        taken = set(counts)
        for region in core.regions:
            taken.update(range(region.first_line, region.last_line + 1))
        silent = [n for n, text in enumerate(texts, start=1) if n not in taken and _may_be_rapid(text)]
        lines = rapids.union(silent)
        probes = sorted(lines | {line - 1 for line in lines})
        probed = Program.from_text(core.text, machine, source=program.source, emitted=True, probe_lines=probes)
        self._states = dict(zip(probes, probed.core.probed, strict=True))
        self._largest_mm_per_s = np.array([axis.max_feed_mm_per_min / 60.0 for axis in machine.axes.as_tuple()])
        self.unmeasured = [rapid for line in silent if (rapid := self._unmeasured(line)) is not None]

    def rapid(self, segment: _core.Segment, line: int) -> Rapid | None:
        if segment.length_mm <= 0.0:
            return None
        start_mm, end_mm = np.array(segment.start_mm), np.array(segment.end_mm)
        reason = self._why_kept(line)
        if reason:
            return Rapid(line, start_mm, end_mm, None, reason, "")
        source = self._texts[line - 1]
        begin, end = self._begins[line - 1], min(self._begins[line], self._program.core.size)
        entry, after = self._states[line - 1], self._states[line]
        feed = self._feed_mm_per_s(end_mm - start_mm, entry.units)
        path = _core.Path([_core.Segment.line(start_mm, end_mm, feed)])
        region = _core.Region(path=path, entry=entry, exit=after, line=line, text_begin=begin, text_end=end)
        if why_off_grid(self._program, region, self._machine):
            reason = "its end lies between two increments, and the program changes between G20 and G21"
            return Rapid(line, start_mm, end_mm, None, reason, "")
        number = next((f"N{value}" for letter, value in _words(source) or () if letter == "N"), "")
        return Rapid(line, start_mm, end_mm, region, "", number + "".join(_COMMENT.findall(source)))

    def _unmeasured(self, line: int) -> Rapid | None:
        """A rapid of unknown travel: it is counted with zero time."""
        after = self._states[line]
        if after.motion != 0 or after.cycle != 80 or self._start_known(line):
            return None
        where = np.array(after.position_mm)
        return Rapid(line, where, where, None, self._why_kept(line), "")

    def _start_known(self, line: int) -> bool:
        block = _COMMENT.sub("", self._texts[line - 1]).upper()
        known = self._states[line - 1].known
        return all(is_known for letter, is_known in zip("XYZ", known, strict=True) if letter in block)

    def _why_kept(self, line: int) -> str:
        entry, after = self._states[line - 1], self._states[line]
        if entry.cycle != 80 or after.cycle != 80:
            return "drilling cycle"
        if entry.compensation != 40:
            return "cutter compensation"
        if entry.uncertain:
            return "the modal state depends on the block-skip switch"
        if line in self._shared or _words(self._texts[line - 1]) is None:
            return "other words in its block"
        if not self._start_known(line):
            return "start position not known"
        if after.motion != 0 or any(getattr(entry, name) != getattr(after, name) for name in _UNCHANGED):
            return "other codes in its block change the modal state"
        return ""

    def _feed_mm_per_s(self, travel_mm: FloatArray, units: int) -> float:
        """Largest feed along a travel, a whole F: each axis within its limit, the path within the largest of these."""
        share = np.abs(travel_mm) / np.linalg.norm(travel_mm)
        moved = share > 0.0
        along = float((self._largest_mm_per_s[moved] / share[moved]).min())
        unit = (MM_PER_INCH if units == 20 else 1.0) / 60.0
        return max(1.0, math.floor(min(along, float(self._largest_mm_per_s.max())) / unit + 1e-9)) * unit


def _words(source: str) -> list[tuple[str, str]] | None:
    """Words of a block with nothing but an N word, axis words and codes permitted for a rapid; else None."""
    block = _COMMENT.sub("", source).upper()
    block = "".join(block.split())
    if not _BLOCK.fullmatch(block):
        return None
    words = _WORD.findall(block)
    letters = [letter for letter, _ in words if letter != "G"]
    plain = len(set(letters)) == len(letters) and set(letters) <= set("NXYZ") and all(value for _, value in words)
    codes = {float(value) for letter, value in words if letter == "G" and value}
    return words if plain and codes <= _G_CODES else None


def _may_be_rapid(text: str) -> bool:
    """True if a block has axis words and no code that changes their meaning."""
    block = _COMMENT.sub("", text).upper()
    if not any(letter in block for letter in "XYZ"):
        return False
    codes = {value for letter, value in _WORD.findall("".join(block.split())) if letter == "G"}
    return {float(value) for value in codes if value} <= _G_CODES | {41, 42, 43, 44, 49}


NO_GAIN = "no time gained"


@dataclass
class Choice:
    """A rapid that may be replaced, and its replacement."""

    rapid: Rapid
    at: int  # its place among the steps of the gap
    region: _core.Region
    before: Timing
    original: Future[_core.SimulationFigures]
    shaped: EmittedRegion | None = None
    text: bytes = b""
    after: Timing | None = None
    slowed_blocks: int = 0
    verdict: RegionVerdict | None = None


class OpenGap:
    """A gap in which rapids may be replaced, with the effect on the time until the next cut can start."""

    def __init__(self, gap: Gap, plant: RapidPlant, pool: Executor, min_gain_s: float) -> None:
        self._plant = plant
        self._min_gain_s = min_gain_s
        self._steps = [
            # A pause: a dwell, an M function.
            Timing(step, 0.0, 0.0, np.zeros((1, 3))) if isinstance(step, float) else plant.rapid(step)
            for step in gap.steps
        ]
        self.choices: list[Choice] = []
        regions = [step.region for step in gap.steps if not isinstance(step, float) and step.region is not None]
        if not regions:
            return
        self._region = regions[-1]
        clock_s = math.fsum(step.clock_s for step in self._steps)
        self._before_s = plant.ready_s(self._steps, self._region)
        if self._before_s < clock_s + min_gain_s:
            return
        end_s = 0.0
        for at, (step, timing) in enumerate(zip(gap.steps, self._steps, strict=True)):
            end_s += timing.clock_s
            if isinstance(step, float) or step.region is None or timing.settling_s <= 0.0:
                continue
            if clock_s - end_s < plant.longest_memory_s:
                original = pool.submit(plant.simulate_original, step)
                self.choices.append(Choice(step, at, step.region, timing, original))

    def _ready_s(self, shaped: Sequence[bool]) -> float:
        """Time from the end of the last cut until the vibration has settled for the next one, s."""
        steps = list(self._steps)
        for choice, is_shaped in zip(self.choices, shaped, strict=True):
            if is_shaped and choice.after is not None:
                steps[choice.at] = choice.after
        return self._plant.ready_s(steps, self._region)

    def saved_s(self) -> float:
        """Time that the remaining replacements save, s."""
        flags = [bool(choice.text) for choice in self.choices]
        return self._before_s - self._ready_s(flags) if any(flags) else 0.0

    def extra_bytes(self) -> int:
        """Bytes that the remaining replacements add."""
        chosen = [choice for choice in self.choices if choice.text]
        return sum(len(each.text) - (each.region.text_end - each.region.text_begin) for each in chosen)

    def drop(self, reason: str, kept: Counter[str], condition: Callable[[Choice], bool]) -> None:
        """Leave the rapids unchanged that meet a condition."""
        for choice in self.choices:
            if condition(choice) and choice.text:
                choice.text = b""
                kept[reason] += 1

    def drop_useless(self, kept: Counter[str]) -> None:
        """Leave rapids unchanged whose replacement saves less than the minimum gain, and all if together they do."""
        # Start with all replaced: of two rapids with equal settling times, replacing one alone gains nothing.
        flags = [bool(choice.text) for choice in self.choices]
        ready_s = self._ready_s(flags)
        for k in range(len(flags)):
            if flags[k]:
                flags[k] = False
                without_s = self._ready_s(flags)
                if without_s < ready_s + self._min_gain_s:
                    ready_s = without_s
                else:
                    flags[k] = True
        if ready_s > self._before_s - self._min_gain_s:
            flags = [False] * len(flags)
        chosen = iter(flags)
        self.drop(NO_GAIN, kept, lambda _choice: not next(chosen))


_LONGEST_WAIT_S = 30.0  # after this time a vibration counts as settled
_LAG_MEMORY = 20.0  # time constants of the servo loop after which earlier motion is ignored


@dataclass(frozen=True, eq=False)
class Timing:
    """Times of a rapid, or of another step, between two cuts."""

    motion_s: float  # until the set-points rest, s
    arrival_s: float  # wait for in-position after them, s
    settling_s: float  # from the end of the set-points until the table stays within the band, s
    command_mm: FloatArray  # set-points, one per period, (n, 3); a pause has one

    @property
    def clock_s(self) -> float:
        """Time of the control: motion and wait for in-position."""
        return self.motion_s + self.arrival_s


class RapidPlant:
    """Simulates rapids with the controller and the modes of a machine."""

    def __init__(self, model: MachineModel) -> None:
        machine = model.machine
        self._machine_model = model
        self.model = model.ordinary.model
        self._band_mm = machine.tolerance.residual_floor_um * 1e-3
        self._moves = moving_axis(machine) is not None
        self.longest_memory_s = model.vibration_memory_s or math.inf  # earlier motion is ignored, s
        self._known: dict[tuple[float, ...], Timing] = {}

    def rapid(self, rapid: Rapid) -> Timing:
        """Simulate a rapid as G00; if it has no region, its work offset is unknown, and the nominal modes are used."""
        travel = rapid.end_mm - rapid.start_mm
        key = tuple(np.round(travel, 9))
        if not self._moves and key in self._known:
            return self._known[key]
        samples = _core.rapid_samples(rapid.start_mm, rapid.end_mm, self.model)
        motion_s, arrival_s = _core.rapid_time_s(travel, self.model), _core.in_position_wait_s(travel, self.model)
        self._known[key] = Timing(motion_s, arrival_s, self._settling_s(samples, rapid.region), samples)
        return self._known[key]

    def simulate_original(self, rapid: Rapid) -> _core.SimulationFigures:
        """The rapid's figures, with which those of the replacement are compared."""
        return self._machine_model.simulate_rapid(rapid.start_mm, rapid.end_mm, self._options(rapid.region))

    def blocks(self, blocks: _core.Path, region: _core.Region, stops_s: float) -> Timing:
        """Times of a replacement after dwells of `stops_s`, with the rule of block timing by which it settles later."""
        period = self.model.period_s
        offset = self._machine_model.offset(region)
        runs = []
        filter_periods = math.ceil(self._machine_model.shaped_filter.duration_s / period) + 1
        least = 2 + math.ceil(2.0 * blocks.programmed_time_s / period) + filter_periods
        for rule in self._machine_model.block_rules:
            figures = self._machine_model.simulate_emitted(
                blocks, region.path, rule, contour=False, record_samples=least, offset=offset
            )
            count = round(figures.duration_s / period) + 1
            command = np.array(figures.recorded_command[:count])
            still = np.repeat(command[:1], round(stops_s / period), axis=0)
            motion_s, arrival_s = len(still) * period + figures.duration_s, self._arrival_s(command)
            settling_s = self._settling_s(command, region)
            runs.append(Timing(motion_s, arrival_s, settling_s, np.concatenate([still, command])))
        return max(runs, key=lambda run: run.motion_s + max(run.arrival_s, run.settling_s))

    def ready_s(self, steps: Sequence[Timing], region: _core.Region) -> float:
        """Time of consecutive steps until the table has settled after all of them, s."""
        period = self.model.period_s
        clock_s = math.fsum(step.clock_s for step in steps)
        parts: list[FloatArray] = []
        end = next((step.command_mm[-1] for step in reversed(steps) if len(step.command_mm) > 1), np.zeros(3))
        after_s = 0.0
        for step in reversed(steps):
            if after_s > self.longest_memory_s:
                break
            wait = round(step.clock_s / period) + 1 - len(step.command_mm)
            samples = np.concatenate([step.command_mm, np.repeat(step.command_mm[-1:], wait, axis=0)])
            samples = samples + (end - samples[-1])  # join pieces whose positions are unknown
            parts.append(samples[:-1] if parts else samples)
            end = samples[0]
            after_s += step.clock_s
        command = np.concatenate(parts[::-1])
        settling_s = self._settling_s(command, region)
        moves = np.flatnonzero(np.abs(np.diff(command, axis=0)).max(axis=1))
        still_s = (len(command) - 1 - (moves[-1] + 1 if len(moves) else 0)) * period
        return clock_s + max(0.0, settling_s - still_s)

    def _options(self, region: _core.Region | None) -> _core.SimulationOptions:
        model = self._machine_model
        return model.options(offset=UNKNOWN_OFFSET if region is None else model.offset(region))

    def _settling_s(self, command_mm: FloatArray, region: _core.Region | None) -> float:
        """Time from the end of a command until the table stays within the band around it, s; at most 30 s."""
        still = _core.Path([_core.Segment.line(command_mm[0], command_mm[0], 1.0)])
        options, slowest_per_s = self._options(region), self._machine_model.slowest_decay_per_s
        options.measure_contour = False
        options.record_samples = 0
        figures = _core.simulate_samples(np.asfortranarray(command_mm), still, options)
        largest = float(figures.residual_mm.max())
        if largest <= self._band_mm:
            return 0.0
        # Several modes of an axis may cancel for a while.
        needed = math.log(4.0 * largest / self._band_mm) / slowest_per_s if slowest_per_s > 0.0 else math.inf
        hold = math.ceil(min(needed, _LONGEST_WAIT_S) / options.period_s)
        held = np.concatenate([command_mm, np.repeat(command_mm[-1:], hold, axis=0)])
        options.record_samples = len(held)
        simulated = _core.simulate_samples(np.asfortranarray(held), still, options)
        apart = np.abs(simulated.recorded_response - simulated.recorded_command).max(axis=1)
        outside = np.flatnonzero(apart > self._band_mm)
        rest = round(simulated.duration_s / options.period_s)
        return max(0.0, float(outside[-1] + 1 - rest) * options.period_s) if len(outside) else 0.0

    def _arrival_s(self, command: FloatArray) -> float:
        model = self.model
        moved = [bool(travel) for travel in np.ptp(command, axis=0) > 0.0]
        error = np.zeros(3)
        if model.in_position == _core.InPosition.servo_lag:
            lag = _core.ServoLag(model.position_gain_per_s, model.feed_forward_ratio, model.period_s)
            memory = math.ceil(_LAG_MEMORY / float(np.min(model.position_gain_per_s)) / model.period_s)
            tail = command[-memory:]
            lag.reset(tail[0])
            for point in tail[1:]:
                lag.step(point)
            error = np.array(lag.error_mm)
        return _core.in_position_wait_behind_s(error, moved, model)
