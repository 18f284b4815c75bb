"""Core model of a machine, made from the machine file and used by every simulation.

`SimulatedController` plans a path or simulates it block by block. Shaped blocks are planned only if
`MachineModel.always_plans`, or for the operating condition with the look-ahead left on.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, TypedDict, Unpack

import numpy as np

from shapegcode import _core
from shapegcode.io.units import FloatArray
from shapegcode.machine import Machine
from shapegcode.machine.controller import GrblPlanner, KlipperPlanner, LinuxcncPlanner
from shapegcode.machine.dialects import dialect_of
from shapegcode.model import modes
from shapegcode.model.modes import NO_OFFSET, Offset


def fanuc_model(
    machine: Machine, *, feed_override: float = 1.0, rapid_override: float = 1.0, shaped: bool | None = None
) -> _core.FanucModel:
    """Core model of a machine's controller, for times and simulation."""
    controller = machine.controller
    model = _core.FanucModel()
    model.planner = planner_rules(machine)
    dialect = dialect_of(machine.emission.dialect)
    model.chord_tolerance_mm = 0.0 if dialect is None else dialect.chord_tolerance_mm
    model.period_s = controller.interpolation_period_s
    model.block_end = getattr(_core.BlockEnd, controller.block_end)
    model.motion = getattr(_core.MotionKind, controller.motion)
    model.filter_shape = getattr(_core.FilterShape, controller.after_interpolation_shape)
    model.time_constant_s = controller.time_constant_s
    model.bell_time_s = controller.bell_time_s
    model.limits = motion_limits(machine)
    model.look_ahead_filter_time_constant_s = controller.look_ahead_filter_time_constant_s
    model.rapid_rate_mm_per_s = [axis.rapid_mm_per_min / 60.0 for axis in machine.axes.as_tuple()]
    model.rapid_time_constant_s = controller.rapid_time_constant_s.as_tuple()
    model.rapid_bell_time_s = controller.rapid_bell_time_s
    model.rapid_path = getattr(_core.RapidPath, controller.rapid_path)
    model.in_position = getattr(_core.InPosition, controller.in_position)
    model.in_position_s = controller.in_position_s.as_tuple()
    model.position_gain_per_s = controller.position_gain_per_s.as_tuple()
    model.feed_forward_ratio = controller.feed_forward_ratio.as_tuple()
    model.in_position_width_mm = [width * 1e-3 for width in controller.in_position_width_um.as_tuple()]
    kinds = _core.ShapedRegions
    model.shaped_regions = kinds.marked if shaped is None else kinds.all if shaped else kinds.none
    model.shaped_filter_shape = getattr(_core.FilterShape, controller.shaped_filter_shape)
    model.shaped_time_constant_s = controller.shaped_time_constant_s
    model.shaped_bell_time_s = controller.shaped_bell_time_s
    model.feed_override = feed_override
    model.rapid_override = rapid_override
    times = machine.times
    model.program_start_s = times.program_start_s
    model.last_tool_in_spindle = times.last_tool_in_spindle
    model.tool_change_s = times.tool_change_s
    model.m_function_s = times.m_function_s
    model.m_code_s = dict(zip(times.m_codes.code, times.m_codes.s, strict=True)) if times.m_codes else {}
    model.spindle_start_s = times.spindle_start.rows if times.spindle_start else []
    model.spindle_stop_s = times.spindle_stop.rows if times.spindle_stop else []
    model.unknown_move_s = times.unknown_move_s.as_tuple()
    if controller.kind != "fanuc":
        # Straight rapids with the axes' acceleration, and no wait after them.
        pairs = [(axis.rapid_mm_per_min / 60.0, axis.max_acceleration_mm_s2) for axis in machine.axes.as_tuple()]
        model.rapid_time_constant_s = [rate / acceleration for rate, acceleration in pairs]
        model.rapid_bell_time_s = 0.0
        model.rapid_path = _core.RapidPath.linear
        model.in_position = _core.InPosition.measured
        model.in_position_s = [0.0, 0.0, 0.0]
    return model


def planner_rules(machine: Machine) -> _core.PlannerRules:
    """Rules of the planner of a control; for FANUC only the kind and the period are set."""
    controller, rules = machine.controller, _core.PlannerRules()
    rules.kind = getattr(_core.ControllerKind, controller.kind)
    rules.period_s = controller.interpolation_period_s
    settings = {
        "linuxcnc": controller.linuxcnc or LinuxcncPlanner(),
        "klipper": controller.klipper or KlipperPlanner(),
        "grbl": controller.grbl or GrblPlanner(),
    }
    if table := settings.get(controller.kind):
        for name, value in table:
            setattr(rules, name, value)
    return rules


def command_planner(machine: Machine) -> _core.CommandPlanner:
    """Planner of a cut before shaping: `shaping.planner`."""
    planner = machine.shaping.planner
    if planner == "optimal" or (planner == "auto" and machine.controller.kind != "fanuc"):
        return _core.CommandPlanner.time_optimal
    return _core.CommandPlanner.look_ahead


def planned_jerk_mm_s3(machine: Machine) -> list[float]:
    """Jerk of each axis in a time-optimal cut; without a limit it follows from the acceleration's build-up time."""
    rise_s = machine.shaping.jerk_time_s
    return [axis.max_jerk_mm_s3 or axis.max_acceleration_mm_s2 / rise_s for axis in machine.axes.as_tuple()]


def motion_limits(machine: Machine, *, arc_feed_ratio: float = 1.0) -> _core.MotionLimits:
    """Look-ahead limits of a machine."""
    limits = _core.MotionLimits()
    controller = machine.controller
    axes = machine.axes.as_tuple()
    limits.law, limits.arc_feed_ratio = getattr(_core.AccelerationLaw, controller.law), arc_feed_ratio
    # A ramp of one interpolation period stands for "no ramp": zero time would need an infinite acceleration.
    limits.time_constant_s = max(controller.time_constant_s, controller.interpolation_period_s)
    limits.jerk_time_s = controller.bell_time_s
    limits.max_feed_mm_per_s = [axis.max_feed_mm_per_min / 60.0 for axis in axes]
    limits.max_acceleration_mm_per_s2 = [axis.max_acceleration_mm_s2 for axis in axes]
    limits.max_jerk_mm_per_s3 = [_limit(axis.max_jerk_mm_s3) for axis in axes]
    # A speed difference of 0 means a stop at every corner; the planner needs one above 0: 1e-3 mm/s is almost a stop.
    rule, along = controller.corner_rule, controller.polyline_acceleration_mm_s2
    if rule == "speed_difference":
        steps = controller.corner_speed_difference_mm_per_min.as_tuple()
        limits.corner_speed_difference_mm_per_s = [max(value / 60.0, 1e-3) for value in steps]
        along = controller.centripetal_acceleration_mm_s2 if along is None else along
    elif rule == "junction_deviation":
        limits.junction_deviation_mm = _limit(controller.junction_deviation_mm)
    else:
        limits.corner_stop_angle_rad = math.radians(_limit(controller.corner_stop_angle_deg))
    limits.polyline_acceleration_mm_per_s2 = _limit(along)
    limits.centripetal_acceleration_mm_per_s2 = controller.centripetal_acceleration_mm_s2
    limits.block_time_s = controller.look_ahead_block_time_s
    if controller.contour_acceleration_mm_s2 is not None:
        limits.contour_acceleration_mm_per_s2 = controller.contour_acceleration_mm_s2.as_tuple()
    return limits


def _limit(value: float | None) -> float:
    return math.inf if value is None else value


BLOCK_ENDS = (_core.BlockEnd.ceil, _core.BlockEnd.carry)  # both rules of block timing
PLANTS = ("modal", "feed-drive")  # ideal servo followed by modes; motor, ball screw and table with their servo loops
_DRIVE_REST_S = 0.5  # time after a stop in which the residual vibration of feed drives is evaluated
_MIN_DECAY_PER_S = 0.01  # below it a mode counts as undamped


@dataclass(frozen=True)
class OwnFilter:
    """The control's acceleration/deceleration after interpolation, while shaped blocks run."""

    shape: str  # "linear" (moving averages) or "exponential"
    time_constant_s: float  # length of the moving average, or time constant; 0: none
    bell_time_s: float  # length of the second moving average; 0: none
    duration_s: float  # duration of the step response

    @property
    def variance_s2(self) -> float:
        """Second moment about the mean: an arc of radius R shrinks by half of it times v²/R."""
        if self.shape == "exponential":
            return self.time_constant_s**2
        return (self.time_constant_s**2 + self.bell_time_s**2) / 12.0

    @property
    def mean_deviation_s(self) -> float:
        """Mean absolute deviation of the impulse response, upper bound; the error at a corner is proportional to it."""
        if self.shape == "exponential":
            return self.time_constant_s * 2.0 / math.e
        return (self.time_constant_s + self.bell_time_s) / 4.0


class SimulatedController:
    """A controller that turns paths into motion: planned by its look-ahead, or block by block."""

    def __init__(self, model: _core.FanucModel, override: float = 1.0) -> None:
        self.model = model
        self._override = override
        model.limits.feed_override *= override
        self.filters = _core.acceleration_filters(model)  # acceleration/deceleration after interpolation

    def _planned(self, path: _core.Path) -> tuple[_core.Path, _core.SpeedProfile] | None:
        """Planned motion of a path and its speed; None if the control executes block by block."""
        model = self.model
        look_ahead = model.motion == _core.MotionKind.look_ahead or model.planner.kind != _core.ControllerKind.fanuc
        return _core.controlled_motion(path, model.limits, model.planner) if look_ahead else None

    def simulate(
        self,
        path: _core.Path,
        options: _core.SimulationOptions,
        *,
        against: _core.Path | None = None,
        block_end: _core.BlockEnd | None = None,
    ) -> _core.SimulationFigures:
        """Simulate a path from rest to rest and measure it against itself or another path."""
        options.axis_filters = self.filters
        planned = self._planned(path)
        if planned is not None:
            is_own = against is None and planned[0].moves_as(path)
            return _core.simulate_path(*planned, options, *(() if is_own else (against or path,)))
        return _core.simulate_blocks(path, against or path, block_end or self.model.block_end, self._override, options)

    def stream(self, path: _core.Path, options: _core.SimulationOptions, rest_s: float) -> _core.SimulationStream:
        """Simulate the motion of `simulate` piece by piece, and the plant for `rest_s` after its end."""
        options.axis_filters = self.filters
        planned = self._planned(path)
        if planned is not None:
            return _core.SimulationStream.of_path(*planned, options, rest_s)
        return _core.SimulationStream.of_blocks(path, self.model.block_end, self._override, options, rest_s)

    def travel(self, path: _core.Path, along: _core.Path, stations_mm: FloatArray, window_s: float) -> _core.Travel:
        """Simulate `path`; return its speed at stations along `along`, mean over the window."""
        period_s, planned = self.model.period_s, self._planned(path)
        if planned is not None:
            return _core.travel_path(*planned, along, stations_mm, period_s, self.filters, window_s)
        return _core.travel_blocks(path, along, self.model.block_end, stations_mm, period_s, self.filters, window_s)


class _Given(TypedDict, total=False):
    """Arguments that simulations of a cut pass on to `MachineModel.options`."""

    shift: float
    only: str | None
    offset: Offset


class MachineModel:
    """Controller, limits and plant of a machine for the core."""

    def __init__(self, machine: Machine) -> None:
        self.machine, self.name = machine, machine.name
        self.period_s = machine.controller.interpolation_period_s
        self.own_rule: _core.BlockEnd = getattr(_core.BlockEnd, machine.controller.block_end)
        # True if the control plans shaped blocks too, since its planner cannot be switched off.
        self.always_plans = machine.controller.kind != "fanuc"
        # Rules of block timing under which emitted blocks are simulated; a planner has its own rule.
        self.block_rules = (self.own_rule,) if self.always_plans else BLOCK_ENDS
        slowest = [modes.slowest_mode(mode) for axis in machine.axes.as_tuple() for mode in axis.modes]
        rates = [damping * 2.0 * math.pi * frequency for frequency, damping in slowest]
        self.slowest_decay_per_s = min(rates, default=math.inf)  # decay rate of the mode that rings longest

    def __reduce__(self) -> tuple[type[MachineModel], tuple[Machine]]:
        """Pickle as the machine, from which the core objects are rebuilt."""
        return MachineModel, (self.machine,)

    def __eq__(self, other: object) -> bool:
        return self.machine == other.machine if isinstance(other, MachineModel) else NotImplemented

    def __hash__(self) -> int:
        return hash(self.machine)

    @cached_property
    def ordinary(self) -> SimulatedController:
        """Controller for an ordinary program."""
        return SimulatedController(fanuc_model(self.machine))

    @cached_property
    def shaped(self) -> SimulatedController:
        """Controller for shaped blocks: one by one, or with look-ahead if that cannot be switched off."""
        model = _core.for_shaped_blocks(fanuc_model(self.machine))
        model.block_end = self.own_rule
        return SimulatedController(model)

    @cached_property
    def shaped_filter(self) -> OwnFilter:
        """Acceleration/deceleration after interpolation for shaped blocks."""
        control = self.machine.controller
        times_s = control.shaped_time_constant_s, control.shaped_bell_time_s
        duration_s = sum(each.duration_samples + 1 for each in self.shaped.filters) * self.period_s
        return OwnFilter(control.shaped_filter_shape, *times_s, duration_s)

    def simulated(self, *, shaped: bool) -> SimulatedController:
        """The controller as it runs shaped blocks, or ordinary programs."""
        return self.shaped if shaped else self.ordinary

    @property
    def vibration_memory_s(self) -> float:
        """Time in which a vibration decays to a millionth, s; 0 without modes, or if one is undamped."""
        slowest = self.slowest_decay_per_s
        return math.log(1e6) / slowest if _MIN_DECAY_PER_S < slowest < math.inf else 0.0

    @cached_property
    def bounds_deviations(self) -> bool:
        """True if deviations at other overrides have a bound that is quick to compute: not with feed drives, filters,
        a planner, moving modes or a stated side of the material."""
        moves = modes.moving_axis(self.machine) is not None
        plain = self.machine.verdict.plant == "modal" and not self.shaped.filters and not moves
        return plain and not self.always_plans and self.machine.input.material_side is None

    def limits(self, *, arc_feed_ratio: float = 1.0) -> _core.MotionLimits:
        """Look-ahead limits, a new object at each call."""
        return motion_limits(self.machine, arc_feed_ratio=arc_feed_ratio)

    def offset(self, region: _core.Region) -> Offset:
        """Offset from program to machine positions in a region; see `region_offset`."""
        return modes.region_offset(region, self.machine)

    def options(
        self, *, plant: str = "modal", filters: Sequence[_core.Fir] = (), shift: float = 0.0, only: str | None = None,
        offset: Offset = NO_OFFSET,
    ) -> _core.SimulationOptions:  # fmt: skip
        """Options of a simulation: interpolation period, plant, and acceleration/deceleration after interpolation."""
        if plant not in PLANTS:
            raise _core.ArgumentError(f"plant = {plant!r}: must be one of {', '.join(PLANTS)}")
        options = _core.SimulationOptions()
        options.period_s = self.period_s
        pairs = modes.moving_modes(self.machine, shift, offset, only)
        if plant != "modal":
            options.drives = modes.drive_parameters(self.machine, shift, only)
            pairs = [[pair for pair in of if any(pair[0].excited_by)] for of in pairs]
        options.modes = [[mode for mode, _ in of] for of in pairs]
        options.mode_tables = [[table for _, table in of] for of in pairs]
        options.axis_filters = list(filters)
        return options

    def verdict_options(self, *, filters: Sequence[_core.Fir] = (), **given: Unpack[_Given]) -> _core.SimulationOptions:
        """Simulation options with the plant of the verdict."""
        plant = self.machine.verdict.plant
        options = self.options(plant=plant, filters=filters, **given)
        if plant != "modal":
            # Servo lag that settles at a stop is no vibration: the residual is that of table relative to motor.
            options.settling_limit_s = _DRIVE_REST_S
            options.arrived_mm = min(self.machine.controller.in_position_width_um.as_tuple()) * 1e-3
        return options

    def simulate_original(
        self, path: _core.Path, *, against: _core.Path | None = None, override: float = 1.0, record_samples: int = 0,
        emitted: bool = False, **given: Unpack[_Given],
    ) -> _core.SimulationFigures:  # fmt: skip
        """Simulate an unshaped cut; `emitted`: as left in the emitted program, where chords may replace its arcs."""
        options = self.verdict_options(**given)
        options.record_samples = record_samples
        controller = self._at_override(override, shaped=emitted and self.always_plans)
        return controller.simulate(path, options, against=against)

    def is_emitted_alike(self, path: _core.Path) -> bool:
        """Whether a cut left unchanged moves as in the original; arcs emitted as chords do not."""
        has_chords = self.always_plans and self.shaped.model.planner.chord_tolerance_mm > 0.0
        return not has_chords or path.largest_sweep_rad == 0.0

    def _at_override(self, override: float, *, shaped: bool) -> SimulatedController:
        if override == 1.0:
            return self.simulated(shaped=shaped)
        model = fanuc_model(self.machine)
        return SimulatedController(_core.for_shaped_blocks(model) if shaped else model, override)

    def simulate_rapid(
        self, start_mm: FloatArray, end_mm: FloatArray, options: _core.SimulationOptions
    ) -> _core.SimulationFigures:
        """Simulate a rapid from rest to rest, without its contour error."""
        options.measure_contour = False
        samples = _core.rapid_samples(start_mm, end_mm, self.ordinary.model)
        still = _core.Path([_core.Segment.line(start_mm, start_mm, 1.0)])
        return _core.simulate_samples(np.asfortranarray(samples), still, options)

    def simulate_emitted(
        self, blocks: _core.Path, path: _core.Path, block_end: _core.BlockEnd | None = None, *, override: float = 1.0,
        contour: bool = True, command_contour: bool = True, response_contour: bool = True, last_seconds: float = 0.0,
        record_samples: int = 0, starved_blocks: Sequence[int] = (), memory_s: float = 0.0,
        other_overrides: Sequence[float] = (), tracker: _core.ContourTracker | None = None,
        increment_mm: float | None = None, **given: Unpack[_Given],
    ) -> _core.SimulationFigures:  # fmt: skip
        """Simulate emitted blocks, measured against the programmed path."""
        options = self.verdict_options(filters=self.shaped.filters, **given)
        options.measure_contour = contour
        options.measure_command, options.measure_response = command_contour, response_contour
        if tracker is not None:
            options.tracker = tracker
        if increment_mm is not None:
            options.feed_window_s = max(self.machine.controller.block_time_s, self.period_s)
            options.feed_slack_mm = 2.0 * increment_mm
        options.record_samples = record_samples
        if self.always_plans:
            return self._at_override(override, shaped=True).simulate(blocks, options, against=path)
        options.last_seconds = last_seconds
        options.other_overrides = list(other_overrides)
        if starved_blocks:
            options.starved_blocks = list(starved_blocks)
            options.starved_s = self.machine.verdict.starved_s
            options.starved_memory_s = memory_s + self.shaped_filter.duration_s if memory_s > 0.0 else 0.0
        return _core.simulate_blocks(blocks, path, block_end or self.own_rule, override, options)

    def simulate_planned(
        self, blocks: _core.Path, path: _core.Path, *, offset: Offset = NO_OFFSET,
        tracker: _core.ContourTracker | None = None,
    ) -> _core.SimulationFigures:  # fmt: skip
        """Simulate emitted blocks replanned by a look-ahead left on, measured against the programmed path."""
        ticks = round(self.machine.controller.look_ahead_filter_time_constant_s / self.period_s)
        filters = [_core.Fir.moving_average(ticks)] if ticks > 1 else []
        options = self.verdict_options(filters=filters, offset=offset)
        if tracker is not None:
            options.tracker = tracker
        return _core.simulate_planned(blocks, self.limits(), options, path)

    def cycle_time_s(self, program: _core.ProgramText) -> float:
        """Time of a whole program in closed form, s; `shapegcode.cycle_time` splits it into parts."""
        return float(_core.time_program(program, self.ordinary.model).total_s)


RAMP_FREQUENCY_HZ = 10_000.0  # no emitted block is a ramp at this frequency
_CORNER_RAD = 0.1  # from this turn of the path LinuxCNC blends or stops
_MAX_KINK_RATIO = 0.7  # LinuxCNC reduces larger values to 0.7071
_KINK_MARGIN = 1.25
_STEPS = 20.0  # a kink ratio is rounded up to a multiple of 1/20


def ini_lines(
    paths: Iterable[_core.Path], machine: Machine
) -> Iterator[tuple[Literal["kink_ratio", "ramp_frequency"], int, str]]:
    """LinuxCNC settings to change: key, line of the worst kink (else 0), sentence; nothing for other controls."""
    if machine.controller.kind != "linuxcnc":
        return
    model = fanuc_model(machine)
    rules = model.planner
    found = [_core.linuxcnc_slowing(path, model.limits, rules, _CORNER_RAD) for path in paths]
    blocks = sum(each.segments for each in found)
    if kinks := sum(each.kinks for each in found):
        worst = max(found, key=lambda each: each.largest_ratio)
        ratio = min(_MAX_KINK_RATIO, math.ceil(worst.largest_ratio * _KINK_MARGIN * _STEPS) / _STEPS)
        more = "" if worst.largest_ratio < _MAX_KINK_RATIO else ", the highest accepted value"
        yield "kink_ratio", worst.line, (
            f"LinuxCNC slows where {kinks} of {blocks} shaped blocks meet: {worst.speed_mm_per_s:.0f} mm/s turn by "
            f"{worst.angle_rad * 1e3:.2f} mrad within {rules.period_s * 1e3:g} ms, which takes "
            f"{worst.largest_ratio:.2f} of the acceleration, and {rules.kink_ratio:g} is allowed; INI file: "
            f"[TRAJ] ARC_BLEND_KINK_RATIO = {ratio:g}{more}"
        )  # fmt: skip
    if ramps := sum(each.ramps for each in found):
        yield "ramp_frequency", 0, (
            f"LinuxCNC stretches {ramps} of {blocks} shaped blocks, as it ramps the speed over each that takes "
            f"less than {1e3 / rules.ramp_frequency_hz:g} ms; INI file: [TRAJ] ARC_BLEND_RAMP_FREQ = "
            f"{RAMP_FREQUENCY_HZ:.0f} (now {rules.ramp_frequency_hz:g})"
        )  # fmt: skip
