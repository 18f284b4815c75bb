"""Rapids in time, as a machine makes them: motion, wait for in-position, and the settling of the modes."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, Future
from dataclasses import dataclass

import numpy as np

from shapegcode import _core
from shapegcode.conversion.rapids.candidates import Gap, Rapid
from shapegcode.conversion.write import EmittedRegion
from shapegcode.io.units import FloatArray
from shapegcode.model.machine_model import MachineModel
from shapegcode.model.modes import NO_OFFSET
from shapegcode.verdict.figures import RegionVerdict

NO_GAIN = "no time gained"


@dataclass
class Choice:
    """A rapid that may be replaced, and what is known of it."""

    rapid: Rapid
    region: _core.Region
    before: Timing
    original: Future[_core.SimulationFigures]
    shaped: EmittedRegion | None = None
    text: bytes = b""
    after: Timing | None = None
    slowed_blocks: int = 0
    verdict: RegionVerdict | None = None

    @property
    def extra_bytes(self) -> int:
        """What the replacement adds to the text."""
        return len(self.text) - (self.region.text_end - self.region.text_begin)


class OpenGap:
    """A gap in which rapids may be replaced, and what that does to the time until the next cut can begin."""

    def __init__(self, gap: Gap, plant: RapidPlant, pool: Executor, least_gain_s: float) -> None:
        self._plant = plant
        self._least_gain_s = least_gain_s
        self._steps = [plant.pause(step) if isinstance(step, float) else plant.rapid(step) for step in gap.steps]
        self.choices: list[Choice] = []
        self._at: list[int] = []
        regions = [step.region for step in gap.steps if not isinstance(step, float) and step.region is not None]
        if not regions:
            return
        self._region = regions[-1]
        clock_s = math.fsum(step.clock_s for step in self._steps)
        self._before_s = plant.ready_s(self._steps, self._region)
        if self._before_s < clock_s + least_gain_s:
            return
        end_s = 0.0
        for at, (step, timing) in enumerate(zip(gap.steps, self._steps, strict=True)):
            end_s += timing.clock_s
            if isinstance(step, float) or step.region is None or timing.settling_s <= 0.0:
                continue
            if clock_s - end_s < plant.longest_memory_s:
                original = pool.submit(plant.simulate_original, step)
                self.choices.append(Choice(step, step.region, timing, original))
                self._at.append(at)

    def _ready_s(self, shaped: Sequence[bool]) -> float:
        """Time from the end of the last cut until the vibration has settled for the next one, s."""
        steps = list(self._steps)
        for at, choice, is_shaped in zip(self._at, self.choices, shaped, strict=True):
            if is_shaped and choice.after is not None:
                steps[at] = choice.after
        return self._plant.ready_s(steps, self._region)

    def saved_s(self) -> float:
        """What the replacements that are left save, s."""
        flags = [bool(choice.text) for choice in self.choices]
        return self._before_s - self._ready_s(flags) if any(flags) else 0.0

    def extra_bytes(self) -> int:
        """What they add to the text."""
        return sum(choice.extra_bytes for choice in self.choices if choice.text)

    def drop(self, reason: str, kept: Counter[str], condition: Callable[[Choice], bool]) -> None:
        """Keep the rapids that meet a condition."""
        for choice in self.choices:
            if condition(choice) and choice.text:
                choice.text = b""
                kept[reason] += 1

    def drop_useless(self, kept: Counter[str]) -> None:
        """Keep every rapid without whose replacement the next cut begins as soon; the earlier ones first."""
        # All together first: of two rapids that ring equally long, replacing one alone gains nothing.
        flags = [bool(choice.text) for choice in self.choices]
        ready_s = self._ready_s(flags)
        for k in range(len(flags)):
            if flags[k]:
                flags[k] = False
                without_s = self._ready_s(flags)
                if without_s < ready_s + self._least_gain_s:
                    ready_s = without_s
                else:
                    flags[k] = True
        if ready_s > self._before_s - self._least_gain_s:
            flags = [False] * len(flags)
        chosen = iter(flags)
        self.drop(NO_GAIN, kept, lambda _choice: not next(chosen))


_LONGEST_WAIT_S = 30.0  # a vibration that takes longer counts as settled then: nobody waits so long
_LAG_MEMORY = 20.0  # time constants of the servo loop beyond which the past does not count


@dataclass(frozen=True, eq=False)
class Timing:
    """One step between two cuts, in time."""

    motion_s: float  # until the set-points rest, s
    arrival_s: float  # wait for in-position behind them, s
    settling_s: float  # from the end of the set-points until the table stays within the band, s
    command_mm: FloatArray  # set-points, one per period, (n, 3); a pause has one

    @property
    def clock_s(self) -> float:
        """What the control takes: motion and wait for in-position."""
        return self.motion_s + self.arrival_s

    @property
    def settled_s(self) -> float:
        """Time until the axes have arrived and the vibration has settled."""
        return self.motion_s + max(self.arrival_s, self.settling_s)


def settling_time_s(
    command_mm: FloatArray, options: _core.SimulationOptions, slowest_per_s: float, band_mm: float
) -> float:
    """Time from the end of a command until the table stays within a band around it, s; at most 30 s."""
    still = _core.Path([_core.Segment.line(command_mm[0], command_mm[0], 1.0)])
    options.measure_contour = False
    options.record_samples = 0
    figures = _core.simulate_samples(np.asfortranarray(command_mm), still, options)
    largest = float(figures.residual_mm.max())
    if largest <= band_mm:
        return 0.0
    # Several modes of an axis may cancel for a while.
    needed = math.log(4.0 * largest / band_mm) / slowest_per_s if slowest_per_s > 0.0 else math.inf
    hold = math.ceil(min(needed, _LONGEST_WAIT_S) / options.period_s)
    held = np.concatenate([command_mm, np.repeat(command_mm[-1:], hold, axis=0)])
    options.record_samples = len(held)
    simulated = _core.simulate_samples(np.asfortranarray(held), still, options)
    apart = np.abs(simulated.recorded_response - simulated.recorded_command).max(axis=1)
    outside = np.flatnonzero(apart > band_mm)
    rest = round(simulated.duration_s / options.period_s)
    return max(0.0, float(outside[-1] + 1 - rest) * options.period_s) if len(outside) else 0.0


class RapidPlant:
    """Rapids as the controller and the modes of a machine make them."""

    def __init__(self, model: MachineModel) -> None:
        machine = model.machine
        self._machine_model = model
        self.model = model.ordinary.model
        self.band_mm = machine.tolerance.residual_floor_um * 1e-3
        self._moving = any(mode.frequency_over is not None for axis in machine.axes.as_tuple() for mode in axis.modes)
        self.longest_memory_s = model.vibration_memory_s or math.inf
        """What moved longer ago no longer counts, s."""
        self._known: dict[tuple[float, ...], Timing] = {}

    def rapid(self, rapid: Rapid) -> Timing:
        """A rapid as the original makes it. Where its region is not known, its modes are the nominal ones."""
        travel = rapid.travel_mm
        key = tuple(np.round(travel, 9))
        if not self._moving and key in self._known:
            return self._known[key]
        samples = _core.rapid_samples(rapid.start_mm, rapid.end_mm, self.model)
        motion_s, arrival_s = _core.rapid_time_s(travel, self.model), _core.in_position_wait_s(travel, self.model)
        self._known[key] = Timing(motion_s, arrival_s, self._settling_s(samples, rapid.region), samples)
        return self._known[key]

    def simulate_original(self, rapid: Rapid) -> _core.SimulationFigures:
        """The rapid's figures, with which those of the replacement are compared."""
        return self._machine_model.simulate_rapid(rapid.start_mm, rapid.end_mm, self._options(rapid.region))

    def blocks(self, blocks: _core.Path, region: _core.Region, stops_s: float) -> Timing:
        """The replacement as the text has it: the slower of both rules of block end; `stops_s`: dwells before it."""
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
        return max(runs, key=lambda run: run.settled_s)

    def pause(self, seconds: float) -> Timing:
        """What moves no axis: a dwell, an M function."""
        return Timing(seconds, 0.0, 0.0, np.zeros((1, 3)))

    def ready_s(self, steps: Sequence[Timing], region: _core.Region) -> float:
        """Time of steps one after the other until the table has settled behind all of them together, s."""
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
            samples = samples + (end - samples[-1])  # where positions are not known, pieces do not join by themselves
            parts.append(samples[:-1] if parts else samples)
            end = samples[0]
            after_s += step.clock_s
        command = np.concatenate(parts[::-1])
        settling_s = self._settling_s(command, region)
        moves = np.flatnonzero(np.abs(np.diff(command, axis=0)).max(axis=1))
        still_s = (len(command) - 1 - (moves[-1] + 1 if len(moves) else 0)) * period
        return clock_s + max(0.0, settling_s - still_s)

    def _options(self, region: _core.Region | None) -> _core.SimulationOptions:
        return self._machine_model.options(offset=NO_OFFSET if region is None else self._machine_model.offset(region))

    def _settling_s(self, command_mm: FloatArray, region: _core.Region | None) -> float:
        slowest_per_s = self._machine_model.slowest_decay_per_s
        return settling_time_s(command_mm, self._options(region), slowest_per_s, self.band_mm)

    def _arrival_s(self, command: FloatArray) -> float:
        """Wait for in-position behind a command."""
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
