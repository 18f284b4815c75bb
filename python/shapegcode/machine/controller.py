"""The controller of a machine file: how it moves the axes, additional times, its state at power-on; settings of the
planners of open controls, named as in their own configuration files.
"""

from copy import deepcopy
from functools import lru_cache
from itertools import pairwise
from typing import Annotated, Any, Literal, Self

from pydantic import Field, Strict, model_validator

from shapegcode.io.data_file import toml_value
from shapegcode.machine.axes import optional
from shapegcode.settings.keys import (
    AxisRatios,
    AxisTimes,
    AxisValues,
    Bool,
    Count,
    InlineTable,
    NonNegative,
    Positive,
    PositiveAxisValues,
    Text,
    TomlTable,
    key,
)

ControllerKind = Literal["fanuc", "linuxcnc", "klipper", "grbl"]
PLANNER_NAMES = {"fanuc": "FANUC", "linuxcnc": "LinuxCNC", "klipper": "Klipper", "grbl": "GRBL"}
"""Names of the kinds of controls."""


_NO_MEMORY_LIMIT = 4 * 10**9  # bytes

Code = Annotated[int, Strict(), Field(ge=0, le=99_999_999)]
Seconds = Annotated[NonNegative, Field(le=3600)]
_Time = Annotated[NonNegative, Field(le=10)]
_Decimals = Annotated[int, Strict(), Field(ge=0, le=6)]


class LinuxcncPlanner(TomlTable):
    """Motion settings of INI file and program; the servo period is interpolation_period_s."""

    blend_tolerance_mm: Annotated[NonNegative, Field(le=100)] = key(
        "G64 P of the program (emitted: P0.001): largest distance of a blend from a corner; 0: G64 without P",
        assumed=0.001,
    )
    naive_cam_tolerance_mm: Annotated[NonNegative, Field(le=100)] = key(
        "G64 Q of the program (emitted: Q0; without Q: P): within it, lines of one feed become one line, and an arc "
        "in XY becomes two lines; 0: off",
        assumed=0.0,
    )
    ramp_frequency_hz: Annotated[Positive, Field(ge=0.001, le=1e6)] = key(
        "[TRAJ] ARC_BLEND_RAMP_FREQ: in a segment that takes less time than its inverse the speed is a linear ramp",
        assumed=100.0,
    )
    kink_ratio: Annotated[Positive, Field(ge=0.001, le=1)] = key(
        "[TRAJ] ARC_BLEND_KINK_RATIO: ratio of the acceleration that the change of direction between two segments may "
        "use within one period; above it the speed is reduced. Effective up to 0.7071",
        assumed=0.1,
    )
    max_feed_override: Annotated[Positive, Field(ge=0.01, le=100)] = key(
        "[DISPLAY] MAX_FEED_OVERRIDE: override for which corners are planned", unit="1", assumed=1.0
    )
    optimization_depth: Annotated[int, Strict(), Field(ge=2, le=4096)] = key(
        "[TRAJ] ARC_BLEND_OPTIMIZATION_DEPTH: segments of the look-ahead", unit="segments", assumed=50
    )
    rapid_follows: Bool = key(
        "a rapid follows each cut; false: a dwell, an M function or the end of the program follows, and the last move "
        "decelerates with half of the acceleration",
        assumed=True,
    )


class KlipperPlanner(TomlTable):
    """Motion settings of printer.cfg, except max_velocity and max_accel: these are the smaller limits of X and Y."""

    square_corner_velocity_mm_per_s: Annotated[NonNegative, Field(le=1000)] = key(
        "[printer] square_corner_velocity: speed at a corner of 90 degrees", assumed=5.0
    )
    minimum_cruise_ratio: Annotated[NonNegative, Field(lt=1)] = key(
        "[printer] minimum_cruise_ratio: least part of a move at constant speed; if max_accel_to_decel is given "
        "instead: 1 - max_accel_to_decel / max_accel",
        assumed=0.5,
    )
    arc_resolution_mm: Annotated[Positive, Field(ge=0.001, le=100)] = key(
        "[gcode_arcs] resolution: length of the lines that replace arcs of the original; in programs emitted with "
        'emission.dialect = "klipper" arcs are chords already, and are simulated as such',
        assumed=1.0,
    )


class GrblPlanner(TomlTable):
    """Motion settings of `$$`, and compiled-in settings."""

    junction_deviation_mm: Annotated[Positive, Field(ge=1e-6, le=10)] = key(
        "$11: a corner is as fast as an arc this far from it, at the acceleration of the axes", assumed=0.01
    )
    arc_tolerance_mm: Annotated[Positive, Field(ge=1e-5, le=10)] = key(
        "$12: distance between an arc and the lines that replace it", assumed=0.002
    )
    look_ahead_blocks: Annotated[int, Strict(), Field(ge=2, le=4096)] = key(
        "blocks in the planner (BLOCK_BUFFER_SIZE minus 1); it can always stop at the end of the last one, which "
        "slows short blocks",
        unit="blocks",
        assumed=15,
    )


class Controller(TomlTable):
    """How the controller turns blocks into set-points, and its limits."""

    kind: ControllerKind = key(
        'control whose planner executes programs. "fanuc": by the keys below. "linuxcnc", "klipper", "grbl": by the '
        "rules of that control, with the limits of the axes and its own table below; shaped programs too, since such a "
        "planner cannot be switched off. motion, law, corner_rule and their keys are then used only with "
        'shaping.planner = "look-ahead"',
        default="fanuc",
    )
    dialect: Literal["auto", "fanuc", "linuxcnc", "haas", "siemens"] = key(
        'dialect in which programs are read. "auto": recognized by words that only one control has; a warning '
        "names the word; without such a word it is LinuxCNC's with kind = \"linuxcnc\", else FANUC's. A stated "
        "dialect refuses programs with words of another control",
        default="auto",
    )
    linuxcnc: LinuxcncPlanner | None = optional('settings of kind = "linuxcnc"; left out: the control\'s own defaults')
    klipper: KlipperPlanner | None = optional('settings of kind = "klipper"; left out: the control\'s own defaults')
    grbl: GrblPlanner | None = optional('settings of kind = "grbl"; left out: the control\'s own defaults')
    interpolation_period_s: Annotated[Positive, Field(ge=1e-5, le=0.1)] = key(
        "time between two set-points", assumed=0.001
    )
    block_time_s: Annotated[NonNegative, Field(le=1)] = key(
        "shortest time in which the control can execute a block; emitted blocks are not shorter", assumed=0.005
    )
    block_end: Literal["ceil", "carry"] = key(
        '"ceil": each block starts at an interpolation period; "carry": the remainder of a period is '
        "carried into the next block. The verdict covers both",
        assumed="ceil",
    )
    motion: Literal["look_ahead", "after_interpolation"] = key(
        'how an ordinary program is executed. "look_ahead": the speed is planned along the path before '
        'interpolation; "after_interpolation": each axis is smoothed after interpolation, and cutting blocks '
        "overlap",
        assumed="look_ahead",
    )
    law: Literal["constant_time", "jerk_limited"] = key(
        'speed change before interpolation. "constant_time": it lasts time_constant_s for any step, longer where an '
        'axis needs more; "jerk_limited": by the acceleration and jerk of the axes',
        assumed="constant_time",
    )
    time_constant_s: _Time = key(
        "duration of a speed change (look-ahead, constant time), or length of the moving average or time constant "
        "of the exponential (after interpolation)",
        fanuc="1622, 1771",
        assumed=0.05,
    )
    bell_time_s: _Time = key(
        "time constant of bell-shaped acc./dec. (look-ahead), or length of the second moving average (after "
        "interpolation); 0: none",
        fanuc="1772",
        assumed=0.0,
    )
    after_interpolation_shape: Literal["linear", "exponential"] = key(
        'how each axis is smoothed after interpolation. "linear": moving averages of the lengths time_constant_s '
        'and bell_time_s; "exponential": a first-order lag of time_constant_s',
        fanuc="1610#0, #1",
        assumed="linear",
    )
    look_ahead_filter_time_constant_s: _Time = key(
        "length of the moving average after interpolation in look-ahead mode; 0: none", fanuc="1769", assumed=0.0
    )
    corner_rule: Literal["speed_difference", "junction_deviation", "stops"] = key(
        'corner rule of look-ahead. "speed_difference": no axis changes its speed by more than '
        'corner_speed_difference_mm_per_min (FANUC); "junction_deviation": a corner is as fast as an arc '
        'within junction_deviation_mm of it (GRBL and others); "stops": the control stops where the direction turns by '
        "corner_stop_angle_deg or more. It does not change the dialect of emitted programs (emission.dialect)",
        fanuc="1783",
        default="speed_difference",
    )
    corner_speed_difference_mm_per_min: AxisValues = key(
        "largest speed step of an axis where two blocks meet; 0: stop at every corner. One number, or x, y, z",
        fanuc="1783",
        assumed=500.0,
    )
    centripetal_acceleration_mm_s2: Positive = key(
        "largest centripetal acceleration in arcs; it limits the feed there", fanuc="1735", assumed=1000.0
    )
    polyline_acceleration_mm_s2: Positive | None = optional(
        "largest centripetal acceleration where two lines of a polyline meet; left out: as in arcs with "
        'corner_rule = "speed_difference", else not limited'
    )
    junction_deviation_mm: Annotated[Positive, Field(le=10)] | None = optional(
        'deviation at a corner, passed at the acceleration of the axes; corner_rule = "junction_deviation" needs it'
    )
    corner_stop_angle_deg: Annotated[Positive, Field(le=180)] | None = optional(
        'smallest change of direction at a corner at which the control stops; corner_rule = "stops" needs it'
    )
    look_ahead_block_time_s: Annotated[NonNegative, Field(le=1)] = key(
        "shortest time per block in look-ahead mode (the time to read one); 0: not limited", default=0.0
    )
    contour_acceleration_mm_s2: PositiveAxisValues | None = optional(
        "largest acceleration of an axis along a contour, corners and curves alike; left out: not limited. One "
        "number, or x, y, z",
        fanuc="1737",
    )
    rapid_path: Literal["linear", "non_linear"] = key(
        '"linear": a rapid is straight; "non_linear": each axis travels at its own speed',
        fanuc="1401#1",
        assumed="linear",
    )
    rapid_time_constant_s: AxisTimes = key(
        "time in which a rapid reaches its speed. One number, or x, y, z", fanuc="1620, 1773", assumed=0.15
    )
    rapid_bell_time_s: _Time = key(
        "time constant of bell-shaped acc./dec. of a rapid; 0: none", fanuc="1621, 1774", assumed=0.0
    )
    in_position_s: AxisValues = key(
        "in-position wait after a rapid or an exact stop; the slowest axis that moved counts. One number, or x, y, z",
        assumed={"x": 0.025, "y": 0.025, "z": 0.12},
    )
    in_position: Literal["measured", "servo_lag"] = key(
        'origin of the wait after a rapid or an exact stop. "measured": in_position_s; "servo_lag": the time '
        "in which the lag by position_gain_per_s and feed_forward_ratio falls to in_position_width_um",
        default="measured",
    )
    in_position_width_um: PositiveAxisValues = key(
        "an axis is in position when it lags by less than this. One number, or x, y, z", fanuc="1826", assumed=20.0
    )
    position_gain_per_s: PositiveAxisValues = key(
        "gain of the position loop (the parameter: in 0.01/s); the servo lag is feed / gain. One number, or x, y, z",
        fanuc="1825",
        assumed=30.0,
    )
    feed_forward_ratio: AxisRatios = key(
        "ratio of the servo lag that feed-forward removes; 0: none. One number, or x, y, z",
        fanuc="2005#1, 2068, 2092",
        assumed=0.0,
    )
    shaped_time_constant_s: _Time = key(
        "length of the controller's own moving average after interpolation while a shaped program runs (it "
        "smooths the shaped blocks once more); 0: off",
        fanuc="1622, 1769",
        assumed=0.0,
    )
    shaped_bell_time_s: _Time = key(
        "length of the second moving average of the filter for shaped blocks (bell-shaped acc./dec.); 0: none",
        fanuc="1622 with 1610#1",
        assumed=0.0,
    )
    shaped_filter_shape: Literal["linear", "exponential"] = key(
        'shape of the filter for shaped blocks. "linear": moving averages of the lengths shaped_time_constant_s and '
        'shaped_bell_time_s; "exponential": a first-order lag of shaped_time_constant_s',
        fanuc="1610#0, #1",
        assumed="linear",
    )
    program_memory_bytes: Annotated[int, Strict(), Field(gt=0)] = key(
        "memory for programs; a larger output gets a warning. Left out with a kind other than FANUC: 4 GB, "
        "since such controls read from a disk",
        assumed=262_144,
    )
    dnc_baud: Count = key(
        "speed of the serial line when programs are drip fed; 0: not drip fed", fanuc="0103", default=0
    )
    macros: Bool = key(
        "whether programs may set and read variables (custom macros, an option of many controls)", assumed=True
    )
    dnc_bits_per_character: Annotated[int, Strict(), Field(ge=7, le=12)] = key(
        "bits on the serial line for each character, with start, parity and stop bits", unit="bits", assumed=11
    )
    least_increment_mm: Annotated[Positive, Field(le=0.1)] = key("smallest coordinate step in G21", default=0.001)
    least_increment_inch: Annotated[Positive, Field(le=0.01)] = key("smallest coordinate step in G20", default=0.0001)
    arc_radius_tolerance_mm: Positive = key(
        "start and end radius of an arc may differ by this much; beyond it the block is an error (alarm 0020)",
        fanuc="3410",
        assumed=0.01,
    )
    calculator_decimal_point: Bool = key(
        "X10 without a decimal point: 10 mm or inch if true, 10 least increments if false. With kind "
        "LinuxCNC, Klipper or GRBL only true is allowed, and is the default",
        fanuc="3401#0",
        default=False,
    )
    feed_decimals_mm: _Decimals = key("decimals of an F word in mm/min", unit="digits", assumed=1)
    feed_decimals_inch: _Decimals = key("decimals of an F word in inch/min", unit="digits", assumed=2)
    minimum_feed_mm_per_min: Positive = key("smallest feed written in a block", assumed=1.0)
    no_buffer_m_codes: tuple[Code, ...] = key(
        "M codes at which the controller stops reading ahead, in addition to M00, M01, M02 and M30",
        fanuc="3411-3432",
        default=(),
    )
    offset_memory: Literal["A", "B", "C"] = key(
        'which system variables hold the tool offsets. "A": one value for each; "B": geometry and wear; "C": '
        "geometry and wear, separately for length and radius",
        assumed="C",
    )
    nesting_limit_subprogram: Annotated[int, Strict(), Field(ge=1, le=100)] = key(
        "nesting depth of subprogram calls; 4 on old controls", unit="levels", assumed=10
    )
    max_program_steps: Annotated[int, Strict(), Field(ge=1, le=10**12)] = key(
        "blocks that may execute beyond one per line; more is an endless loop",
        unit="blocks",
        default=4_000_000,
    )
    max_program_moves: Annotated[int, Strict(), Field(ge=1, le=10**9)] = key(
        "largest number of moves of a program, with pecks of drilling cycles, dwells and blocks with M, S, T; and of "
        "the emitted program",
        unit="moves",
        default=100_000_000,
    )
    max_expansion_moves: Annotated[int, Strict(), Field(ge=1, le=10**9)] = key(
        "moves of loops, calls and drilling cycles beyond one per line",
        unit="moves",
        default=800_000,
    )
    max_program_bytes: Annotated[int, Strict(), Field(ge=1, le=4 * 10**9)] = key(
        "largest program that is read, with the programs that it calls, and largest program that is written",
        default=1_000_000_000,
    )
    max_expansion_bytes: Annotated[int, Strict(), Field(ge=1, le=4 * 10**9)] = key(
        "size by which the expanded program (macros, calls, modes resolved) may exceed the program",
        default=33_554_432,
    )
    max_program_s: Annotated[Positive, Field(le=1e9)] = key(
        "longest time of a program at its feeds, with rapids and dwells: a wrong F or dwell is refused at "
        "its line instead of being simulated for hours",
        default=100_000.0,
    )

    @model_validator(mode="before")
    @classmethod
    def _of_a_computer(cls, data: Any) -> Any:
        if isinstance(data, dict) and data.get("kind", "fanuc") != "fanuc":
            return {"calculator_decimal_point": True, "program_memory_bytes": _NO_MEMORY_LIMIT} | data
        return data

    @model_validator(mode="after")
    def _reads_whole_units_and_has_its_rule(self) -> Self:
        if self.kind != "fanuc" and not self.calculator_decimal_point:
            raise ValueError(f'calculator_decimal_point = false: with kind = "{self.kind}" X10 is 10 mm or inch')
        needed = {"junction_deviation": "junction_deviation_mm", "stops": "corner_stop_angle_deg"}.get(self.corner_rule)
        if needed is not None and getattr(self, needed) is None:
            raise ValueError(f'corner_rule = "{self.corner_rule}" needs {needed}')
        return self

    @property
    def holds_macros(self) -> bool:
        """True if a program may contain macro statements: the control has them, and is not drip fed."""
        return self.macros and self.dnc_baud == 0


class PowerOn(TomlTable):
    """Modal state before the first block of a program."""

    motion: Literal["G00", "G01", "G02", "G03"] = key("kind of motion", fanuc="3402#0", assumed="G00")
    plane: Literal["G17", "G18", "G19"] = key("plane of arcs", fanuc="3402#1, #2", assumed="G17")
    distance: Literal["G90", "G91"] = key(
        "absolute (G90) or incremental (G91) coordinates", fanuc="3402#3", assumed="G90"
    )
    units: Literal["G20", "G21"] = key("inch (G20) or mm (G21)", assumed="G21")
    feed_mode: Literal["G93", "G94", "G95"] = key(
        "feed per minute (G94), inverse time (G93) or per revolution (G95)", assumed="G94"
    )
    path_mode: Literal["G61", "G64"] = key("exact stop (G61) or cutting mode (G64)", assumed="G64")
    work_offset: Literal["G54", "G55", "G56", "G57", "G58", "G59"] = key("work coordinate system", assumed="G54")
    cycle_return: Literal["G98", "G99"] = key(
        "level to which a drilling cycle returns: initial (G98) or R (G99)", assumed="G98"
    )


class FeedControl(TomlTable):
    """How the controller follows changes of the feed."""

    interval_mm: Positive = key(
        "shortest path length over which the controller follows a change of the feed; scheduled blocks are not "
        "shorter. A test cut with feeds that change every 0.2, 0.4 and 0.6 mm shows it (paper 001, figure 8)",
        assumed=0.6,
    )
    max_change_mm_per_min: Positive | None = optional(
        "largest change of the feed from one block to the next; left out: not limited"
    )
    spindle_power_w: Positive | None = optional("continuous power of the spindle; left out: not limited")
    spindle_torque_nm: Positive | None = optional("continuous torque of the spindle; left out: not limited")


class MCodeTimes(InlineTable):
    """Times of single M codes."""

    code: tuple[Code, ...] = key("M codes")
    s: tuple[Seconds, ...] = key("their times", unit="s")

    @model_validator(mode="after")
    def _match(self) -> Self:
        if len(self.code) != len(self.s) or len(set(self.code)) != len(self.code):
            raise ValueError(f"{len(self.s)} times for {len(set(self.code))} M codes: one for each code is needed")
        return self


class SpindleTimes(InlineTable):
    """Time of the spindle over its speed: linear from 0 and between the rows, constant beyond the last."""

    rpm: tuple[Positive, ...] = key("speeds, ascending", unit="1/min")
    s: tuple[Seconds, ...] = key("times", unit="s")

    @model_validator(mode="after")
    def _match(self) -> Self:
        if len(self.rpm) != len(self.s) or not self.rpm:
            raise ValueError(f"{len(self.s)} times for {len(self.rpm)} speeds: one for each speed is needed")
        if any(after <= before for before, after in pairwise(self.rpm)):
            raise ValueError(f"rpm = {list(self.rpm)}: must ascend")
        return self

    @property
    def rows(self) -> list[tuple[float, float]]:
        """Rows of the table: speed in 1/min, and its time in s."""
        return list(zip(self.rpm, self.s, strict=True))


class TimeScatter(InlineTable):
    """Standard deviations of the random scatter of times."""

    cuts_percent: Annotated[NonNegative, Field(le=100)] = key("scatter of the cutting time of a tool")
    between_cuts_s: Seconds = key("scatter of the time between two cuts")
    runs_percent: Annotated[NonNegative, Field(le=100)] = key("scatter between repeated runs of a program")


# A calibration validates the same texts for every machine that it tries.
_known_value = lru_cache(maxsize=1024)(toml_value)


class OpenTime(TomlTable):
    """A direction in parameter space that run logs do not determine."""

    name: Text = key("parameter that varies most in this direction")
    values: tuple[Text, ...] = key('values of the machine one step in that direction: "KEY = VALUE"')
    weight: Annotated[Positive, Field(le=1e9)] = key(
        "variance in the direction divided by the square of that step", default=1.0
    )

    @model_validator(mode="after")
    def _readable(self) -> Self:
        self.by_key()
        return self

    def by_key(self) -> dict[str, Any]:
        """The values by their keys."""
        found = {}
        for text in self.values:
            name, _, value = text.partition("=")
            try:
                found[name.strip()] = deepcopy(_known_value(value))
            except ValueError as error:
                raise ValueError(f"{text!r}: must be KEY = VALUE: {error}") from error
        return found


class Times(TomlTable):
    """Times in addition to the motion."""

    program_start_s: Seconds = key("time from cycle start to the first block", assumed=0.0)
    last_tool_in_spindle: Bool = key(
        "parts are made in series: the last tool of a program is in the spindle when it starts again, and an M06 that "
        "calls it changes nothing; false: every M06 changes",
        assumed=False,
    )
    feed_override_percent: Annotated[Positive, Field(le=200)] = key(
        "feed override at which this shop usually runs; `time` uses it unless another is given",
        assumed=100.0,
    )
    rapid_override_percent: Annotated[Positive, Field(le=200)] = key(
        "rapid override at which this shop usually runs", assumed=100.0
    )
    tool_change_s: Seconds = key("time of a tool change (M06)", assumed=0.0)
    m_function_s: Seconds = key("time of an M code that is not in m_codes", assumed=0.0)
    m_codes: MCodeTimes | None = optional("times of single M codes, { code = [1, 8], s = [0.3, 5.1] }; left out: none")
    spindle_start: SpindleTimes | None = optional(
        "time of the spindle from rest to a speed, { rpm = [5000, 12000], s = [1.0, 7.3] }; it elapses "
        "while the axes move; the control waits for the remainder before the next M code or cut; left out: none"
    )
    spindle_stop: SpindleTimes | None = optional(
        "time of the spindle from a speed to rest after M05, as spindle_start; M00, M01, M02, M30, M06 and the next "
        "M03 or M04 wait for the remainder; left out: none"
    )
    unknown_move_s: AxisTimes = key(
        "time of a rapid whose start or end the program does not give: G28, G30, G53, and the first one "
        "after them or after M06. One number, or x, y, z",
        assumed=0.0,
    )
    scatter: TimeScatter | None = optional(
        "scatter of calibrated times, { cuts_percent = 1.1, between_cuts_s = 0.2, runs_percent = 0.3 }; `time` "
        "then gives a 95 % interval; left out: none"
    )
    open: tuple[OpenTime, ...] = key("directions of calibrated parameters that run logs do not determine", default=())
