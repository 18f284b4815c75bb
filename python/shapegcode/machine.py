"""The machine file: what shapegcode knows about a machine tool and its controller.

A machine file is TOML. :class:`Machine` is its model and the only place in the project that holds defaults:
every other module takes the values from here. Each key carries its unit, its meaning and, where the number is
not known for real machines, the remark *assumed*; :func:`key_documentation` turns that into
``docs/machine.md``.
"""

from __future__ import annotations

import json
import math
import re
import tomllib
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, Strict, ValidationError, field_validator, model_validator

from shapegcode.machine_errors import MachineError, Problem, problems_of, syntax_problem
from shapegcode.machine_keys import (
    AxisRatios,
    AxisTimes,
    AxisValues,
    Bool,
    Count,
    Float,
    KeyInfo,
    KeyValue,
    NonNegative,
    PerAxis,
    Positive,
    PositiveAxisValues,
    Table,
    Text,
    key,
    toml,
)
from shapegcode.machine_text import documentation, values_of, write_toml

__all__ = [
    "Axes",
    "Axis",
    "Controller",
    "Emission",
    "Input",
    "KeyInfo",
    "KeyValue",
    "Machine",
    "MachineError",
    "Mode",
    "PerAxis",
    "PowerOn",
    "Problem",
    "Shaping",
    "Times",
    "Tolerance",
    "Verdict",
    "key_documentation",
]


class Mode(Table):
    """One vibration mode of an axis, excited by the motion of that axis."""

    frequency_hz: Annotated[Positive, Field(le=10_000)] = key(
        "natural frequency; from a tap test, or from the decay after a rapid stop", unit="Hz"
    )
    damping_ratio: Annotated[NonNegative, Field(lt=1)] = key("damping ratio (1 = critically damped)", unit="1")
    participation: Positive = key(
        "share of this mode in the axis's deflection; several modes of one axis need not add up to 1",
        unit="1",
        default=1.0,
    )
    frequency_uncertainty_percent: Annotated[NonNegative, Field(lt=100)] | None = key(
        "the frequency may be off by this much either way (position of the table, weight of the workpiece); "
        "left out: not known, and only the nominal frequency is designed for",
        unit="%",
        default=None,
    )


class Axis(Table):
    """Limits of one axis; all three tables are required."""

    max_feed_mm_per_min: Positive = key("largest cutting feed of this axis", unit="mm/min", fanuc="1430")
    rapid_mm_per_min: Positive = key("rapid traverse (G00)", unit="mm/min", fanuc="1420")
    max_acceleration_mm_s2: Positive = key("largest acceleration while cutting", unit="mm/s²", fanuc="1660")
    max_jerk_mm_s3: Positive | None = key(
        "largest jerk while cutting; left out: not limited", unit="mm/s³", default=None
    )
    modes: tuple[Mode, ...] = key("vibration modes, one table each; none: the axis is taken as rigid", default=())


class Axes(Table):
    """The three linear axes."""

    x: Axis = key("the X axis")
    y: Axis = key("the Y axis")
    z: Axis = key("the Z axis")

    def as_tuple(self) -> tuple[Axis, Axis, Axis]:
        """The three axes in the order X, Y, Z."""
        return (self.x, self.y, self.z)


class Controller(Table):
    """How the controller turns blocks into set-points, and what it accepts."""

    interpolation_period_s: Annotated[Positive, Field(le=0.1)] = key(
        "time between two set-points", unit="s", default=0.001, assumed=True
    )
    block_time_s: Annotated[NonNegative, Field(le=1)] = key(
        "shortest time in which the controller can take in a block; emitted blocks are not shorter",
        unit="s",
        default=0.005,
        assumed=True,
    )
    block_end: Literal["ceil", "carry"] = key(
        '"ceil": each block starts on a tick of the interpolation; "carry": the remainder of a period is '
        "carried into the next block. The round trip is judged under both",
        default="ceil",
        assumed=True,
    )
    motion: Literal["look_ahead", "after_interpolation"] = key(
        'how an ordinary program is played. "look_ahead": the speed is planned along the path before '
        'interpolation; "after_interpolation": each axis is smoothed after interpolation, and cutting blocks '
        "overlap",
        default="look_ahead",
        assumed=True,
    )
    law: Literal["constant_time", "jerk_limited"] = key(
        'speed change before interpolation. "constant_time": it lasts time_constant_s whatever the step; '
        '"jerk_limited": by the acceleration and jerk of the axes',
        default="constant_time",
        assumed=True,
    )
    time_constant_s: Annotated[NonNegative, Field(le=10)] = key(
        "duration of a speed change (look-ahead, constant time), or length of the moving average or time constant "
        "of the exponential (after interpolation)",
        unit="s",
        fanuc="1622, 1771",
        default=0.05,
        assumed=True,
    )
    bell_time_s: Annotated[NonNegative, Field(le=10)] = key(
        "time over which the acceleration itself is built up; length of the second moving average; 0: none",
        unit="s",
        fanuc="1772",
        default=0.0,
        assumed=True,
    )
    after_interpolation_shape: Literal["linear", "exponential"] = key(
        'how each axis is smoothed after interpolation. "linear": moving averages of the lengths time_constant_s '
        'and bell_time_s; "exponential": a first-order lag of time_constant_s',
        fanuc="1610#0, #1",
        default="linear",
        assumed=True,
    )
    look_ahead_filter_time_constant_s: Annotated[NonNegative, Field(le=10)] = key(
        "length of the moving average after interpolation in look-ahead mode; 0: none",
        unit="s",
        fanuc="1769",
        default=0.0,
        assumed=True,
    )
    corner_speed_difference_mm_per_min: AxisValues = key(
        "largest speed step of an axis where two blocks meet; 0: stop at every corner. One number, or x, y, z",
        unit="mm/min",
        fanuc="1783",
        default=500.0,
        assumed=True,
    )
    centripetal_acceleration_mm_s2: Positive = key(
        "largest acceleration across the path in arcs; it limits the feed there",
        unit="mm/s²",
        fanuc="1735",
        default=1000.0,
        assumed=True,
    )
    contour_acceleration_mm_s2: PositiveAxisValues | None = key(
        "largest acceleration of an axis along a contour, corners and curves alike; left out: not limited. One "
        "number, or x, y, z",
        unit="mm/s²",
        fanuc="1737",
        default=None,
    )
    rapid_path: Literal["linear", "non_linear"] = key(
        '"linear": a rapid goes straight; "non_linear": each axis travels at its own speed',
        fanuc="1401#1",
        default="linear",
        assumed=True,
    )
    rapid_time_constant_s: AxisTimes = key(
        "time in which a rapid reaches its speed. One number, or x, y, z",
        unit="s",
        fanuc="1620, 1773",
        default=0.15,
        assumed=True,
    )
    rapid_bell_time_s: Annotated[NonNegative, Field(le=10)] = key(
        "time over which the acceleration of a rapid is built up; 0: none",
        unit="s",
        fanuc="1621, 1774",
        default=0.0,
        assumed=True,
    )
    in_position_s: AxisValues = key(
        "wait for the axis to arrive after a rapid or an exact stop; the slowest axis that moved counts. One "
        "number, or x, y, z",
        unit="s",
        default={"x": 0.025, "y": 0.025, "z": 0.12},
        assumed=True,
    )
    in_position: Literal["measured", "servo_lag"] = key(
        'where the wait after a rapid or an exact stop comes from. "measured": in_position_s; "servo_lag": the time '
        "in which the lag left by position_gain_per_s and feed_forward_ratio falls to in_position_width_um",
        default="measured",
    )
    in_position_width_um: PositiveAxisValues = key(
        "an axis has arrived when it lags by less than this. One number, or x, y, z",
        unit="µm",
        fanuc="1826",
        default=20.0,
        assumed=True,
    )
    position_gain_per_s: PositiveAxisValues = key(
        "gain of the position loop (the parameter counts 0.01/s); the servo lag is feed / gain. One number, or x, y, z",
        unit="1/s",
        fanuc="1825",
        default=30.0,
        assumed=True,
    )
    feed_forward_ratio: AxisRatios = key(
        "share of the servo lag that the feed-forward takes away; 0: none. One number, or x, y, z",
        unit="1",
        fanuc="2005#1, 2068, 2092",
        default=0.0,
        assumed=True,
    )
    shaped_time_constant_s: Annotated[NonNegative, Field(le=10)] = key(
        "length of the controller's own moving average after interpolation while a shaped program runs (it "
        "smooths the shaped blocks once more); 0: off",
        unit="s",
        fanuc="1622, 1769",
        default=0.0,
        assumed=True,
    )
    program_memory_bytes: Annotated[int, Strict(), Field(gt=0)] = key(
        "memory for programs; a larger output gets a warning", unit="bytes", default=262_144, assumed=True
    )
    dnc_baud: Count = key(
        "speed of the serial line when programs are drip fed; 0: not drip fed",
        unit="baud",
        fanuc="0103",
        default=0,
    )
    dnc_bits_per_character: Annotated[int, Strict(), Field(ge=7, le=12)] = key(
        "bits on the serial line for each character, with start, parity and stop bits",
        unit="bits",
        default=11,
        assumed=True,
    )
    least_increment_mm: Annotated[Positive, Field(le=0.1)] = key(
        "smallest coordinate step in G21", unit="mm", default=0.001
    )
    least_increment_inch: Annotated[Positive, Field(le=0.01)] = key(
        "smallest coordinate step in G20", unit="inch", default=0.0001
    )
    arc_radius_tolerance_mm: Positive = key(
        "start and end radius of an arc may differ by this much; beyond it the block is an error (alarm 0020)",
        unit="mm",
        fanuc="3410",
        default=0.01,
        assumed=True,
    )
    calculator_decimal_point: Bool = key(
        "X10 without a decimal point: 10 mm or inch if true, 10 least increments if false",
        fanuc="3401#0",
        default=False,
    )
    feed_decimals_mm: Annotated[int, Strict(), Field(ge=0, le=6)] = key(
        "decimals of an F word in mm/min", unit="digits", default=1, assumed=True
    )
    feed_decimals_inch: Annotated[int, Strict(), Field(ge=0, le=6)] = key(
        "decimals of an F word in inch/min", unit="digits", default=2, assumed=True
    )
    minimum_feed_mm_per_min: Positive = key(
        "smallest feed written in a block", unit="mm/min", default=1.0, assumed=True
    )
    no_buffer_m_codes: tuple[Annotated[int, Strict(), Field(ge=0, le=99_999_999)], ...] = key(
        "M codes at which the controller stops reading ahead, besides M00, M01, M02 and M30",
        fanuc="3411-3432",
        default=(),
    )
    offset_memory: Literal["A", "B", "C"] = key(
        'which system variables hold the tool offsets. "A": one value for each; "B": geometry and wear; "C": '
        "geometry and wear, length and radius apart",
        default="C",
        assumed=True,
    )
    nesting_limit_subprogram: Annotated[int, Strict(), Field(ge=1, le=100)] = key(
        "how deep subprograms may call one another; 4 on old controls", unit="levels", default=10, assumed=True
    )
    max_program_steps: Annotated[int, Strict(), Field(ge=1, le=10**12)] = key(
        "a program that executes more blocks than this counts as endless", unit="blocks", default=10_000_000
    )


class Times(Table):
    """What takes time beside the motion."""

    tool_change_s: Annotated[NonNegative, Field(le=3600)] = key("an M06", unit="s", default=0.0, assumed=True)
    m_function_s: Annotated[NonNegative, Field(le=3600)] = key("any other M code", unit="s", default=0.0, assumed=True)


class PowerOn(Table):
    """Modal state before the first block of a program."""

    motion: Literal["G00", "G01", "G02", "G03"] = key("kind of motion", fanuc="3402#0", default="G00", assumed=True)
    plane: Literal["G17", "G18", "G19"] = key("plane of arcs", fanuc="3402#1, #2", default="G17", assumed=True)
    distance: Literal["G90", "G91"] = key(
        "absolute (G90) or incremental (G91) coordinates", fanuc="3402#3", default="G90", assumed=True
    )
    units: Literal["G20", "G21"] = key("inch (G20) or mm (G21)", default="G21", assumed=True)
    feed_mode: Literal["G93", "G94", "G95"] = key(
        "feed per minute (G94), inverse time (G93) or per revolution (G95)", default="G94", assumed=True
    )
    path_mode: Literal["G61", "G64"] = key("exact stop (G61) or cutting mode (G64)", default="G64", assumed=True)
    work_offset: Literal["G54", "G55", "G56", "G57", "G58", "G59"] = key(
        "work coordinate system", default="G54", assumed=True
    )
    cycle_return: Literal["G98", "G99"] = key(
        "level to which a drilling cycle returns: initial (G98) or R (G99)", default="G98", assumed=True
    )


_OFFSET_NAME = re.compile(r"G5[4-9]|G54\.1P[1-9][0-9]{0,2}")
_NUMBER_NAME = re.compile(r"[1-9][0-9]{0,7}")
_G_NAME = re.compile(r"[1-9][0-9]{0,3}(\.[1-9])?")


class Input(Table):
    """How programs are read."""

    arc_centre: Literal["incremental", "absolute"] = key(
        'I J K of an arc: "incremental" from its start, as FANUC reads them; "absolute" for programs posted '
        "for other controls",
        default="incremental",
    )
    tool_change_unknown_axes: Annotated[str, Strict(), Field(pattern=r"^X?Y?Z?$")] = key(
        "axes whose position is not known after M06, until they are programmed again; letters of XYZ in this order",
        default="XYZ",
        assumed=True,
    )
    work_offsets: dict[str, tuple[Float, Float, Float]] = key(
        'work offsets, for programs that use more than one: G54 = [x, y, z]; "G54.1P5" = [x, y, z]; one that '
        "is left out is zero",
        unit="mm",
        default={},
    )
    tool_radius_mm: dict[str, Float] = key(
        'cutter radius by offset number D, for programs with G41 or G42 that are expanded: { "1" = 5.0 }',
        unit="mm",
        default={},
    )
    tool_radius_wear_mm: dict[str, Float] = key("wear of the radius by offset number D", unit="mm", default={})
    tool_length_mm: dict[str, Float] = key(
        "tool length by offset number H; with it the Z travel of a tool length change is known",
        unit="mm",
        default={},
    )
    tool_length_wear_mm: dict[str, Float] = key("wear of the length by offset number H", unit="mm", default={})
    compensation: Literal["refuse", "expand", "keep"] = key(
        'what `convert` does with cutter compensation G41/G42. "refuse": says so and stops; "expand": shapes the tool '
        'path of the radius given here: the offset in the control no longer acts; "keep": leaves these moves as they '
        "are. The clock and the pictures always use the expanded path where the radius is known",
        default="refuse",
    )
    compensation_start_up: Literal["A", "B"] = key(
        "kind of the start-up and cancel moves of cutter compensation", fanuc="5003#0, #1", default="A", assumed=True
    )
    material_side: Literal["left", "right"] | None = key(
        "side of the programmed tool path on which the workpiece lies, seen along the travel: right where the contour "
        "is cut as with G41, left as with G42; with it deviations are reported as gouge and excess; left out: not "
        "known",
        default=None,
    )
    scale_unit: Annotated[Positive, Field(le=1)] = key(
        "unit of the factors P, I, J, K of scaling G51 without a decimal point",
        unit="1",
        fanuc="5400#7",
        default=0.001,
        assumed=True,
    )
    peck_clearance_mm: NonNegative = key(
        "distance to which a peck of G73 and G83 returns before it feeds on; for the clock",
        unit="mm",
        fanuc="5114, 5115",
        default=0.5,
        assumed=True,
    )
    block_skip: Literal["unknown", "on", "off"] = key(
        'block-skip switch on the panel: "on": blocks with / do not run; "off": they run; "unknown": either may be '
        "true, and nothing is shaped whose state depends on it",
        default="unknown",
    )
    variables: dict[str, Float] = key(
        'values of the variables that the control keeps, #500 ... #999, for macros that read them: { "500" = 12.5 }',
        default={},
    )
    program_folders: tuple[Text, ...] = key(
        "folders in which programs are looked for that a file calls and does not hold (O0123, O0123.nc, 0123.NC ...); "
        "the folder of the calling file comes first",
        default=(),
    )
    opaque_programs: tuple[Annotated[int, Strict(), Field(ge=0)], Annotated[int, Strict(), Field(ge=0)]] = key(
        "first and last O number of programs of the machine builder or of a probe: a call of one that is not at hand "
        "is kept as it stands, and position and variables are not known afterwards; a missing program outside of "
        "these is an error",
        default=(9000, 9999),
        assumed=True,
    )
    g_macros: dict[str, Annotated[int, Strict(), Field(ge=1, le=99_999_999)]] = key(
        'G codes that call a macro like G65: { "120" = 9010 }', fanuc="6050 ... 6059", default={}
    )
    m_macros: dict[str, Annotated[int, Strict(), Field(ge=1, le=99_999_999)]] = key(
        'M codes that call a macro like G65: { "200" = 9020 }', fanuc="6080 ... 6089", default={}
    )
    m_subprograms: dict[str, Annotated[int, Strict(), Field(ge=1, le=99_999_999)]] = key(
        'M codes that call a subprogram like M98: { "6" = 9001 }', fanuc="6071 ... 6079", default={}
    )
    tool_program: Annotated[int, Strict(), Field(ge=0, le=99_999_999)] = key(
        "program that every T code calls, with T in #149; 0: none", fanuc="6001#5", default=0
    )
    max_line_length: Annotated[int, Strict(), Field(ge=20, le=100_000)] = key(
        "a longer line is an error", unit="characters", default=250, assumed=True
    )

    @field_validator("work_offsets")
    @classmethod
    def _known_offsets(cls, offsets: dict[str, Any]) -> dict[str, Any]:
        for name in offsets:
            if not _OFFSET_NAME.fullmatch(name):
                raise ValueError(f'{name} is no work offset; names are G54 ... G59 and "G54.1P1" ... "G54.1P999"')
        return offsets

    @field_validator(
        "tool_radius_mm",
        "tool_radius_wear_mm",
        "tool_length_mm",
        "tool_length_wear_mm",
        "m_macros",
        "m_subprograms",
    )
    @classmethod
    def _numbers(cls, table: dict[str, Any]) -> dict[str, Any]:
        for name in table:
            if not _NUMBER_NAME.fullmatch(name):
                raise ValueError(f'{json.dumps(name)} is no number; names are whole numbers, for example "1"')
        return table

    @field_validator("g_macros")
    @classmethod
    def _g_codes(cls, table: dict[str, Any]) -> dict[str, Any]:
        for name in table:
            if not _G_NAME.fullmatch(name):
                raise ValueError(f'{json.dumps(name)} is no G code; names are for example "120" or "120.1"')
        return table

    @field_validator("variables")
    @classmethod
    def _retained(cls, table: dict[str, Any]) -> dict[str, Any]:
        for name in table:
            if not (_NUMBER_NAME.fullmatch(name) and 500 <= int(name) <= 999):
                raise ValueError(f'{json.dumps(name)} is no variable that the control keeps: "500" ... "999"')
        return table


_BLOCK_CHARACTERS = re.compile(r"[A-Z0-9 .,+\-*/=#\[\]()<>_:;&]*")


class Emission(Table):
    """How shaped programs are written."""

    block_period_s: Annotated[Positive, Field(le=1)] | None = key(
        "duration of a short block: a whole multiple of controller.interpolation_period_s and not below "
        "controller.block_time_s; left out: chosen for the shortest shaper",
        unit="s",
        default=None,
    )
    prologue: tuple[Text, ...] = key(
        'lines written before each shaped stretch, for example ["G05.1 Q0"] to switch a look-ahead mode off',
        default=(),
    )
    epilogue: tuple[Text, ...] = key("lines written after each shaped stretch", default=())
    prefill_dwell_s: Annotated[NonNegative, Field(le=60)] = key(
        "dwell before each shaped stretch, in which the block buffer fills; 0: none", unit="s", default=0.0
    )
    compensation_guard: Literal["alarm", "stop"] = key(
        'where cutter compensation was expanded: "alarm" compares the offset in the control with the expanded radius '
        'and raises an alarm if it differs; "stop" halts with M00 for the operator to compare (always so where '
        "programs are drip fed: IF cannot run from there)",
        default="alarm",
    )
    header: Bool = key(
        "write comments: tool version, machine, modes, block period, shaper length, override, time constant",
        default=True,
    )
    failed_suffix: Annotated[str, Strict(), Field(min_length=1, pattern=r"^[^/\\\x00-\x1f]+$")] = key(
        "added to the name of an output that misses its tolerance, so that nobody runs it by mistake",
        default=".out-of-tolerance",
    )
    max_line_length: Annotated[int, Strict(), Field(ge=30, le=250)] = key(
        "longest line written", unit="characters", default=60, assumed=True
    )
    arc_min_chord_mm: NonNegative = key(
        "a piece of an arc with a shorter chord is written as a line: rounding could turn it into a full circle",
        unit="mm",
        default=0.02,
    )
    merge_tolerance_increments: NonNegative = key(
        "blocks are merged into one where the path and the feed stay within this many least increments; "
        "0: only where they agree exactly",
        unit="increments",
        default=0.5,
    )

    @field_validator("prologue", "epilogue")
    @classmethod
    def _fanuc_lines(cls, lines: tuple[str, ...]) -> tuple[str, ...]:
        for line in lines:
            if not _BLOCK_CHARACTERS.fullmatch(line):
                raise ValueError(
                    f"the line {json.dumps(line)} has a character other than capital letters, digits and "
                    "signs that a program may hold (no %, no end of line)"
                )
        return lines

    @model_validator(mode="after")
    def _lines_fit(self) -> Emission:
        for line in (*self.prologue, *self.epilogue):
            if len(line) > self.max_line_length:
                raise ValueError(
                    f"the line {json.dumps(line)} has {len(line)} characters, emission.max_line_length is "
                    f"{self.max_line_length}"
                )
        return self


class Shaping(Table):
    """What is shaped, and how."""

    max_duration_s: Annotated[Positive, Field(le=10)] = key("longest shaper that is accepted", unit="s", default=0.25)
    arc_feed_ratio: Annotated[Positive, Field(le=1)] = key(
        "feed in arcs as a share of the programmed feed, reached before the arc begins; 1: no reduction",
        unit="1",
        default=1.0,
    )
    plunge_angle_deg: Annotated[NonNegative, Field(le=90)] = key(
        "a corner is a forced stop of the shaped command if a side of it leans from the Z axis by no more than "
        "this and the direction changes by 45 degrees or more: a shaper must not mix plunges with other cuts",
        unit="degrees",
        default=15.0,
    )


_Override = Annotated[Positive, Field(le=254)]


class Tolerance(Table):
    """When an emitted program is good: outside these limits the conversion says so and exits with 1."""

    contour_um: Positive = key(
        "largest deviation of the emitted command from the programmed path", unit="µm", default=50.0
    )
    residual_ratio: Annotated[NonNegative, Field(le=1)] = key(
        "residual vibration passes if it is below this share of the original program's, or below residual_floor_um",
        unit="1",
        default=0.25,
    )
    residual_floor_um: NonNegative = key(
        "residual vibration below this passes whatever the original's was", unit="µm", default=3.0
    )
    residual_floor_increments: NonNegative = key(
        "residual vibration below this passes too: rounding the words alone may leave a lightly damped mode so much",
        unit="increments",
        default=5.0,
    )


class Verdict(Table):
    """The stated band: which of the cases that are played decide. All are shown; 100 % override always counts."""

    override_percent: tuple[_Override, _Override] = key(
        "lowest and highest feed override under which the program will run: every case in between must be good. The "
        "header of a program asks for 100 %, so only that counts unless you state more",
        unit="%",
        default=(100.0, 100.0),
    )
    mode_uncertainty: Bool = key(
        "whether every mode must be allowed to be off by its frequency_uncertainty_percent; modes that state none "
        "are taken as exact",
        default=True,
    )
    block_end: Literal["both", "own"] = key(
        '"both": the program must be good under either rule of block timing; "own": under controller.block_end, '
        "for a controller whose rule is known",
        default="both",
    )
    look_ahead: Bool = key(
        "whether the program must be good with the look-ahead mode left on, which plans the shaped blocks anew; "
        "false: it is off while they run (emission.prologue)",
        default=False,
    )
    starved_block: Bool = key(
        "whether the program must be good if the block buffer runs empty once, at the worst place; false: it never "
        "does (memory or a data server, emission.prefill_dwell_s)",
        default=False,
    )
    starved_s: Annotated[Positive, Field(le=10)] = key(
        "how long the axes then wait for the next block", unit="s", default=0.02, assumed=True
    )

    @model_validator(mode="after")
    def _band_ascends(self) -> Verdict:
        low, high = self.override_percent
        if low > high:
            raise ValueError(f"override_percent = {toml(self.override_percent)}: the lower end comes first")
        return self


class Machine(Table):
    """A machine tool and its controller, as a machine file describes them."""

    name: Annotated[str, Strict(), Field(min_length=1, max_length=60, pattern=r"^[\x20-\x7e]+$")] = key(
        "short name, in plain ASCII because it goes into the header of programs"
    )
    description: Text = key("what machine this is and where its numbers come from", default="")
    axes: Axes = key("limits and vibration modes of the axes")
    controller: Controller = key("how the controller moves the axes and what it accepts", default={})
    times: Times = key("what takes time beside the motion", default={})
    power_on: PowerOn = key("modal state before the first block", default={})
    input: Input = key("how programs are read", default={})
    emission: Emission = key("how shaped programs are written", default={})
    shaping: Shaping = key("what is shaped, and how", default={})
    tolerance: Tolerance = key("when an emitted program is good", default={})
    verdict: Verdict = key("under which conditions it must be good", default={})

    @model_validator(mode="after")
    def _block_period_fits(self) -> Machine:
        period = self.emission.block_period_s
        if period is None:
            return self
        tick = self.controller.interpolation_period_s
        ratio = period / tick
        if round(ratio) < 1 or not math.isclose(ratio, round(ratio), rel_tol=0, abs_tol=1e-6):
            raise ValueError(
                f"emission.block_period_s = {toml(period)}: must be a whole multiple of "
                f"controller.interpolation_period_s = {toml(tick)}"
            )
        shortest = self.controller.block_time_s
        if period < shortest * (1 - 1e-9):
            raise ValueError(
                f"emission.block_period_s = {toml(period)}: must not be below "
                f"controller.block_time_s = {toml(shortest)}"
            )
        return self

    @classmethod
    def load(cls, path_or_name: str | Path) -> Machine:
        """Load a machine file, or a built-in machine by its name.

        A string without a folder and without ``.toml`` that names a built-in machine is that machine;
        everything else is a path.

        Raises:
            MachineError: the file is not TOML or has wrong keys or values; every problem is listed.
            OSError: the file cannot be read.
        """
        if isinstance(path_or_name, str) and path_or_name in cls.builtin_names():
            return cls.from_toml(cls.builtin_text(path_or_name), path_or_name)
        path = Path(path_or_name)
        if not path.suffix and path.name == str(path_or_name) and not path.exists():
            names = ", ".join(cls.builtin_names())
            problem = Problem("", "", f"no such file and no built-in machine; built in: {names}")
            raise MachineError(str(path), (problem,))
        try:
            text = path.read_bytes().decode("utf-8-sig")
        except UnicodeDecodeError as error:
            line = error.object[: error.start].count(b"\n") + 1
            problem = Problem("", "", f"not UTF-8 text (byte 0x{error.object[error.start]:02x})", line)
            raise MachineError(str(path), (problem,)) from error
        return cls.from_toml(text, str(path))

    @classmethod
    def from_toml(cls, text: str, source: str = "<text>") -> Machine:
        """Read the text of a machine file; *source* names it in messages.

        Raises:
            MachineError: not TOML, or wrong keys or values; every problem is listed.
        """
        try:
            data = tomllib.loads(text)
        except tomllib.TOMLDecodeError as error:
            raise MachineError(source, (syntax_problem(str(error), text),)) from error
        return cls.from_data(data, source, text)

    @classmethod
    def from_data(cls, data: dict[str, Any], source: str = "<data>", text: str = "") -> Machine:
        """Validate the tables of a machine file; *source* names it in messages, *text* gives them line numbers.

        Raises:
            MachineError: wrong keys or values; every problem is listed.
        """
        try:
            return cls.model_validate(data)
        except ValidationError as error:
            raise MachineError(source, problems_of(error, cls, data, text)) from error

    @staticmethod
    def builtin_names() -> tuple[str, ...]:
        """Names of the machines that come with shapegcode, sorted."""
        folder = resources.files("shapegcode") / "data"
        return tuple(
            sorted(entry.name.removesuffix(".toml") for entry in folder.iterdir() if entry.name.endswith(".toml"))
        )

    @classmethod
    def builtin_text(cls, name: str) -> str:
        """Text of a built-in machine's file, with its comments.

        Raises:
            MachineError: no built-in machine of that name.
        """
        names = cls.builtin_names()
        if name not in names:
            raise MachineError(name, (Problem("", "", f"no built-in machine; built in: {', '.join(names)}"),))
        return (resources.files("shapegcode") / "data" / f"{name}.toml").read_text(encoding="utf-8")

    def to_toml(self, remarks: Mapping[str, str] | None = None) -> str:
        """The machine as a commented machine file, which loads back to an equal machine.

        Args:
            remarks: text for the end of a key's line by its dotted key (modes count from 1:
                ``axes.x.modes.1.frequency_hz``), for example where the value comes from.

        Raises:
            KeyError: a remark for a key that does not exist.
        """
        return write_toml(self, remarks or {})

    def values(self) -> list[KeyValue]:
        """Every key with its value and origin, in the order of the file."""
        return list(values_of(self))


def key_documentation() -> str:
    """The reference of the machine file's keys as Markdown: what ``docs/machine.md`` holds, word for word.

    Regenerate with ``python -m shapegcode.machine > docs/machine.md``.
    """
    return documentation(Machine, Machine.builtin_names())


if __name__ == "__main__":
    print(key_documentation(), end="")
