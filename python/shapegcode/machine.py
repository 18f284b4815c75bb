"""The machine file: what shapegcode knows about a machine tool and its controller.

A machine file is TOML. :class:`Machine` is its model and the only place in the project that holds defaults:
every other module takes the values from here. Each key carries its unit, its meaning and, where the number is
not known for real machines, the remark *assumed*; :func:`key_documentation` turns that into
``docs/machine.md``.
"""

from __future__ import annotations

import difflib
import json
import math
import re
import textwrap
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    Strict,
    ValidationError,
    field_validator,
    model_validator,
)
from pydantic.fields import FieldInfo

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
    "Tolerance",
    "key_documentation",
]

_LINE_WIDTH = 110

# Numbers are strict: a string or a truth value in place of a number is an error; 3 for 3.0 is not.
_Float = Annotated[float, Strict(), Field(allow_inf_nan=False)]
_Positive = Annotated[float, Strict(), Field(gt=0, allow_inf_nan=False)]
_NonNegative = Annotated[float, Strict(), Field(ge=0, allow_inf_nan=False)]
_Count = Annotated[int, Strict(), Field(ge=0)]
_Bool = Annotated[bool, Strict()]
_Text = Annotated[str, Strict()]


@dataclass(frozen=True)
class Problem:
    """One thing wrong in a machine file.

    Attributes:
        key: dotted name of the key, for example ``axes.x.max_feed_mm_per_min``; empty if the file is bad.
        value: the offending value as written in TOML; empty where there is none (a missing key).
        limit: what the value must be.
        line: line number in the file where it is known, else None.
    """

    key: str
    value: str
    limit: str
    line: int | None = None

    def __str__(self) -> str:
        """The problem as ``key = value: limit``, without the file's name."""
        subject = f"{self.key} = {self.value}" if self.value else self.key
        return f"{subject}: {self.limit}" if subject else self.limit


class MachineError(ValueError):
    """A machine file that cannot be used; the message lists every problem, one line each.

    Attributes:
        file: name of the file (or of the built-in machine).
        problems: what is wrong, in the order of the keys.
    """

    def __init__(self, file: str, problems: tuple[Problem, ...]) -> None:
        """Build the message ``file[:line]: key = value: limit``, one line per problem."""
        self.file = file
        self.problems = problems
        super().__init__(
            "\n".join(
                f"{file}:{problem.line}: {problem}" if problem.line is not None else f"{file}: {problem}"
                for problem in problems
            )
        )


def _key(meaning: str, *, unit: str = "", fanuc: str = "", assumed: bool = False, **field: Any) -> Any:
    """A pydantic field with the four facts that the documentation of a key needs.

    Left out of *field*, ``default`` makes the key mandatory.
    """
    facts: dict[str, Any] = {"unit": unit, "fanuc": fanuc, "assumed": assumed}
    return Field(description=meaning, json_schema_extra=facts, **field)


class _Table(BaseModel):
    """Base of every table of the file: unknown keys are errors and values never change after loading."""

    model_config = ConfigDict(extra="forbid", frozen=True, validate_default=True)


class PerAxis(_Table):
    """One value per axis. A machine file may give a single number, which then holds for all three."""

    x: _NonNegative = _key("value of the X axis")
    y: _NonNegative = _key("value of the Y axis")
    z: _NonNegative = _key("value of the Z axis")

    def as_tuple(self) -> tuple[float, float, float]:
        """The three values in the order X, Y, Z."""
        return (self.x, self.y, self.z)


def _spread(value: object) -> object:
    """A single number stands for all three axes; a table must name all three."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        return {"x": value, "y": value, "z": value}
    return value


_AxisValues = Annotated[PerAxis, BeforeValidator(_spread)]


class Mode(_Table):
    """One vibration mode of an axis, excited by the motion of that axis."""

    frequency_hz: Annotated[_Positive, Field(le=10_000)] = _key(
        "natural frequency; from a tap test, or from the decay after a rapid stop", unit="Hz"
    )
    damping_ratio: Annotated[_NonNegative, Field(lt=1)] = _key("damping ratio (1 = critically damped)", unit="1")
    participation: _Positive = _key(
        "share of this mode in the axis's deflection; several modes of one axis need not add up to 1",
        unit="1",
        default=1.0,
    )
    frequency_uncertainty_percent: Annotated[_NonNegative, Field(lt=100)] | None = _key(
        "the frequency may be off by this much either way (position of the table, weight of the workpiece); "
        "left out: not known, and only the nominal frequency is designed for",
        unit="%",
        default=None,
    )


class Axis(_Table):
    """Limits and vibration modes of one axis."""

    max_feed_mm_per_min: _Positive = _key("largest cutting feed of this axis", unit="mm/min", fanuc="1430")
    rapid_mm_per_min: _Positive = _key("rapid traverse (G00)", unit="mm/min", fanuc="1420")
    max_acceleration_mm_s2: _Positive = _key("largest acceleration while cutting", unit="mm/s²", fanuc="1660")
    max_jerk_mm_s3: _Positive | None = _key(
        "largest jerk while cutting; left out: not limited", unit="mm/s³", default=None
    )
    modes: tuple[Mode, ...] = _key("vibration modes, one table each; none: the axis is taken as rigid", default=())


class Axes(_Table):
    """The three linear axes."""

    x: Axis = _key("the X axis")
    y: Axis = _key("the Y axis")
    z: Axis = _key("the Z axis")

    def as_tuple(self) -> tuple[Axis, Axis, Axis]:
        """The three axes in the order X, Y, Z."""
        return (self.x, self.y, self.z)


class Controller(_Table):
    """How the controller turns blocks into set-points, and what it accepts."""

    interpolation_period_s: Annotated[_Positive, Field(le=0.1)] = _key(
        "time between two set-points", unit="s", default=0.001, assumed=True
    )
    block_time_s: Annotated[_NonNegative, Field(le=1)] = _key(
        "shortest time in which the controller can take in a block; emitted blocks are not shorter",
        unit="s",
        default=0.005,
        assumed=True,
    )
    block_end: Literal["ceil", "carry"] = _key(
        '"ceil": each block starts on a tick of the interpolation; "carry": the remainder of a period is '
        "carried into the next block. The round trip is judged under both",
        default="ceil",
        assumed=True,
    )
    motion: Literal["look_ahead", "after_interpolation"] = _key(
        'how an ordinary program is played. "look_ahead": the speed is planned along the path before '
        'interpolation; "after_interpolation": each axis is smoothed after interpolation, and cutting blocks '
        "overlap",
        default="look_ahead",
        assumed=True,
    )
    law: Literal["constant_time", "jerk_limited"] = _key(
        'speed change before interpolation. "constant_time": it lasts time_constant_s whatever the step; '
        '"jerk_limited": by the acceleration and jerk of the axes',
        default="constant_time",
        assumed=True,
    )
    time_constant_s: Annotated[_NonNegative, Field(le=10)] = _key(
        "duration of a speed change (look-ahead, constant time) or length of the moving average (after interpolation)",
        unit="s",
        fanuc="1622, 1769",
        default=0.05,
        assumed=True,
    )
    bell_time_s: Annotated[_NonNegative, Field(le=10)] = _key(
        "time over which the acceleration itself is built up; length of the second moving average; 0: none",
        unit="s",
        fanuc="1772",
        default=0.0,
        assumed=True,
    )
    corner_speed_difference_mm_per_min: _AxisValues = _key(
        "largest speed step of an axis where two blocks meet; 0: stop at every corner. One number, or x, y, z",
        unit="mm/min",
        fanuc="1783",
        default=500.0,
        assumed=True,
    )
    centripetal_acceleration_mm_s2: _Positive = _key(
        "largest acceleration across the path in arcs; it limits the feed there",
        unit="mm/s²",
        fanuc="1735",
        default=1000.0,
        assumed=True,
    )
    rapid_path: Literal["linear", "non_linear"] = _key(
        '"linear": a rapid goes straight; "non_linear": each axis travels at its own speed',
        fanuc="1401#1",
        default="linear",
        assumed=True,
    )
    rapid_time_constant_s: Annotated[_NonNegative, Field(le=10)] = _key(
        "time in which a rapid reaches its speed", unit="s", fanuc="1620", default=0.15, assumed=True
    )
    rapid_bell_time_s: Annotated[_NonNegative, Field(le=10)] = _key(
        "time over which the acceleration of a rapid is built up; 0: none",
        unit="s",
        fanuc="1621",
        default=0.0,
        assumed=True,
    )
    in_position_s: _AxisValues = _key(
        "wait for the axis to arrive after a rapid or an exact stop; the slowest axis that moved counts. One "
        "number, or x, y, z",
        unit="s",
        default={"x": 0.025, "y": 0.025, "z": 0.12},
        assumed=True,
    )
    shaped_time_constant_s: Annotated[_NonNegative, Field(le=10)] = _key(
        "length of the controller's own moving average after interpolation while a shaped program runs (it "
        "smooths the shaped blocks once more); 0: off",
        unit="s",
        fanuc="1622, 1769",
        default=0.0,
        assumed=True,
    )
    program_memory_bytes: Annotated[int, Strict(), Field(gt=0)] = _key(
        "memory for programs; a larger output gets a warning", unit="bytes", default=262_144, assumed=True
    )
    dnc_baud: _Count = _key(
        "speed of the serial line when programs are drip fed; 0: not drip fed",
        unit="baud",
        fanuc="0103",
        default=0,
    )
    dnc_bits_per_character: Annotated[int, Strict(), Field(ge=7, le=12)] = _key(
        "bits on the serial line for each character, with start, parity and stop bits",
        unit="bits",
        default=11,
        assumed=True,
    )
    least_increment_mm: Annotated[_Positive, Field(le=0.1)] = _key(
        "smallest coordinate step in G21", unit="mm", default=0.001
    )
    least_increment_inch: Annotated[_Positive, Field(le=0.01)] = _key(
        "smallest coordinate step in G20", unit="inch", default=0.0001
    )
    arc_radius_tolerance_mm: _Positive = _key(
        "start and end radius of an arc may differ by this much; beyond it the block is an error (alarm 0020)",
        unit="mm",
        fanuc="3410",
        default=0.01,
        assumed=True,
    )
    calculator_decimal_point: _Bool = _key(
        "X10 without a decimal point: 10 mm or inch if true, 10 least increments if false",
        fanuc="3401#0",
        default=False,
    )
    feed_decimals_mm: Annotated[int, Strict(), Field(ge=0, le=6)] = _key(
        "decimals of an F word in mm/min", unit="digits", default=1, assumed=True
    )
    feed_decimals_inch: Annotated[int, Strict(), Field(ge=0, le=6)] = _key(
        "decimals of an F word in inch/min", unit="digits", default=2, assumed=True
    )
    minimum_feed_mm_per_min: _Positive = _key(
        "smallest feed written in a block", unit="mm/min", default=1.0, assumed=True
    )


class PowerOn(_Table):
    """Modal state before the first block of a program."""

    motion: Literal["G00", "G01", "G02", "G03"] = _key("kind of motion", fanuc="3402#0", default="G00", assumed=True)
    plane: Literal["G17", "G18", "G19"] = _key("plane of arcs", fanuc="3402#1, #2", default="G17", assumed=True)
    distance: Literal["G90", "G91"] = _key(
        "absolute (G90) or incremental (G91) coordinates", fanuc="3402#3", default="G90", assumed=True
    )
    units: Literal["G20", "G21"] = _key("inch (G20) or mm (G21)", default="G21", assumed=True)
    feed_mode: Literal["G93", "G94", "G95"] = _key(
        "feed per minute (G94), inverse time (G93) or per revolution (G95)", default="G94", assumed=True
    )
    path_mode: Literal["G61", "G64"] = _key("exact stop (G61) or cutting mode (G64)", default="G64", assumed=True)
    work_offset: Literal["G54", "G55", "G56", "G57", "G58", "G59"] = _key(
        "work coordinate system", default="G54", assumed=True
    )
    cycle_return: Literal["G98", "G99"] = _key(
        "level to which a drilling cycle returns: initial (G98) or R (G99)", default="G98", assumed=True
    )


_OFFSET_NAME = re.compile(r"G5[4-9]|G54\.1P[1-9][0-9]{0,2}")


class Input(_Table):
    """How programs are read."""

    arc_centre: Literal["incremental", "absolute"] = _key(
        'I J K of an arc: "incremental" from its start, as FANUC reads them; "absolute" for programs posted '
        "for other controls",
        default="incremental",
    )
    tool_change_unknown_axes: Annotated[str, Strict(), Field(pattern=r"^X?Y?Z?$")] = _key(
        "axes whose position is not known after M06, until they are programmed again; letters of XYZ in this order",
        default="XYZ",
        assumed=True,
    )
    work_offsets: dict[str, tuple[_Float, _Float, _Float]] = _key(
        'work offsets, for programs that use more than one: G54 = [x, y, z]; "G54.1P5" = [x, y, z]; one that '
        "is left out is zero",
        unit="mm",
        default={},
    )
    max_line_length: Annotated[int, Strict(), Field(ge=20, le=100_000)] = _key(
        "a longer line is an error", unit="characters", default=250, assumed=True
    )

    @field_validator("work_offsets")
    @classmethod
    def _known_offsets(cls, offsets: dict[str, Any]) -> dict[str, Any]:
        for name in offsets:
            if not _OFFSET_NAME.fullmatch(name):
                raise ValueError(f'{name} is no work offset; names are G54 ... G59 and "G54.1P1" ... "G54.1P999"')
        return offsets


_BLOCK_CHARACTERS = re.compile(r"[A-Z0-9 .,+\-*/=#\[\]()<>_:;&]*")


class Emission(_Table):
    """How shaped programs are written."""

    block_period_s: Annotated[_Positive, Field(le=1)] | None = _key(
        "duration of a short block: a whole multiple of controller.interpolation_period_s and not below "
        "controller.block_time_s; left out: chosen for the shortest shaper",
        unit="s",
        default=None,
    )
    prologue: tuple[_Text, ...] = _key(
        'lines written before each shaped stretch, for example ["G05.1 Q0"] to switch a look-ahead mode off',
        default=(),
    )
    epilogue: tuple[_Text, ...] = _key("lines written after each shaped stretch", default=())
    prefill_dwell_s: Annotated[_NonNegative, Field(le=60)] = _key(
        "dwell before each shaped stretch, in which the block buffer fills; 0: none", unit="s", default=0.0
    )
    header: _Bool = _key("write a comment that names the machine, the shaper and the verdict", default=True)
    failed_suffix: Annotated[str, Strict(), Field(min_length=1, pattern=r"^[^/\\\x00-\x1f]+$")] = _key(
        "added to the name of an output that misses its tolerance, so that nobody runs it by mistake",
        default=".out-of-tolerance",
    )
    max_line_length: Annotated[int, Strict(), Field(ge=30, le=250)] = _key(
        "longest line written", unit="characters", default=60, assumed=True
    )
    arc_min_chord_mm: _NonNegative = _key(
        "a piece of an arc with a shorter chord is written as a line: rounding could turn it into a full circle",
        unit="mm",
        default=0.02,
    )
    merge_tolerance_increments: _NonNegative = _key(
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


class Shaping(_Table):
    """What is shaped, and how."""

    max_duration_s: Annotated[_Positive, Field(le=10)] = _key("longest shaper that is accepted", unit="s", default=0.25)
    arc_feed_ratio: Annotated[_Positive, Field(le=1)] = _key(
        "feed in arcs as a share of the programmed feed, reached before the arc begins; 1: no reduction",
        unit="1",
        default=1.0,
    )
    plunge_angle_deg: Annotated[_NonNegative, Field(le=90)] = _key(
        "a cutting move that leans from the tool axis Z by no more than this is a plunge or retract: the "
        "tool comes to rest where it meets a move across, because a shaper must not mix the two",
        unit="degrees",
        default=15.0,
    )


class Tolerance(_Table):
    """When an emitted program is good: outside these limits the conversion says so and exits with 1."""

    contour_um: _Positive = _key(
        "largest deviation of the emitted command from the programmed path", unit="µm", default=50.0
    )
    residual_ratio: Annotated[_NonNegative, Field(le=1)] = _key(
        "residual vibration passes if it is below this share of the original program's, or below residual_floor_um",
        unit="1",
        default=0.25,
    )
    residual_floor_um: _NonNegative = _key(
        "residual vibration below this passes whatever the original's was", unit="µm", default=3.0
    )


@dataclass(frozen=True)
class KeyInfo:
    """One key of the machine file with what the documentation says of it.

    Attributes:
        key: dotted name; ``axes.x.modes.1.frequency_hz`` for values, ``axes.<x|y|z>`` and ``modes[]`` in the
            documentation of the format.
        unit: unit, "1" for a ratio, empty where there is none.
        default: default as written in TOML, or "required", or "not set".
        meaning: what it is.
        fanuc: numbers of the FANUC parameters that correspond to it, or empty.
        assumed: True where the default is an assumption and not a known value.
    """

    key: str
    unit: str
    default: str
    meaning: str
    fanuc: str
    assumed: bool


@dataclass(frozen=True)
class KeyValue:
    """One value of a loaded machine.

    Attributes:
        info: the key.
        value: the value as TOML, "not set" for an optional key without one.
        origin: "file" where the machine file gives the value, else "default".
    """

    info: KeyInfo
    value: str
    origin: Literal["file", "default"]

    @property
    def assumed(self) -> bool:
        """True where the value is a default that is an assumption."""
        return self.origin == "default" and self.info.assumed


class Machine(_Table):
    """A machine tool and its controller, as a machine file describes them."""

    name: Annotated[str, Strict(), Field(min_length=1, max_length=60, pattern=r"^[\x20-\x7e]+$")] = _key(
        "short name, in plain ASCII because it goes into the header of programs"
    )
    description: _Text = _key("what machine this is and where its numbers come from", default="")
    axes: Axes = _key("limits and vibration modes of the axes")
    controller: Controller = _key("how the controller moves the axes and what it accepts", default={})
    power_on: PowerOn = _key("modal state before the first block", default={})
    input: Input = _key("how programs are read", default={})
    emission: Emission = _key("how shaped programs are written", default={})
    shaping: Shaping = _key("what is shaped, and how", default={})
    tolerance: Tolerance = _key("when an emitted program is good", default={})

    @model_validator(mode="after")
    def _block_period_fits(self) -> Machine:
        period = self.emission.block_period_s
        if period is None:
            return self
        tick = self.controller.interpolation_period_s
        ratio = period / tick
        if round(ratio) < 1 or not math.isclose(ratio, round(ratio), rel_tol=0, abs_tol=1e-6):
            raise ValueError(
                f"emission.block_period_s = {_toml(period)}: must be a whole multiple of "
                f"controller.interpolation_period_s = {_toml(tick)}"
            )
        shortest = self.controller.block_time_s
        if period < shortest * (1 - 1e-9):
            raise ValueError(
                f"emission.block_period_s = {_toml(period)}: must not be below "
                f"controller.block_time_s = {_toml(shortest)}"
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
            raise MachineError(source, (_toml_problem(str(error), text),)) from error
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
            raise MachineError(source, _problems(error, data, text)) from error

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
        return _TomlWriter(dict(remarks or {})).write(self)

    def values(self) -> list[KeyValue]:
        """Every key with its value and origin, in the order of the file."""
        return list(_values(self, ""))


def _toml_problem(message: str, text: str) -> Problem:
    """The place of a TOML syntax error, which tomllib only tells in words."""
    found = re.search(r"\s*\(at line (\d+), column (\d+)\)$", message)
    if found:
        return Problem("", "", f"{message[: found.start()]} (column {found[2]})", int(found[1]))
    last = text.rstrip().count("\n") + 1
    return Problem("", "", message.replace(" (at end of document)", " (end of file)"), last)


def _toml(value: object) -> str:
    """A value in TOML notation."""
    if isinstance(value, PerAxis):
        if value.x == value.y == value.z:
            return _toml(value.x)
        return "{ " + ", ".join(f"{axis} = {_toml(getattr(value, axis))}" for axis in "xyz") + " }"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return _toml_float(value)
    if isinstance(value, int):
        return str(value)
    if isinstance(value, str):
        # JSON strings are TOML basic strings, but for DEL, which TOML wants escaped.
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_toml(item) for item in value) + "]"
    if isinstance(value, dict):
        return (
            "{ " + ", ".join(f"{_toml_key(key)} = {_toml(item)}" for key, item in value.items()) + " }"
            if value
            else "{}"
        )
    return str(value)


def _toml_float(value: float) -> str:
    if not math.isfinite(value):
        return str(value)
    if value == int(value) and abs(value) < 1e15:
        return f"{value:.1f}"
    return repr(value)


def _toml_key(key: str) -> str:
    return key if re.fullmatch(r"[A-Za-z0-9_-]+", key) else json.dumps(key)


def _number(limit: float) -> str:
    return f"{limit:g}" if abs(limit) < 1e6 else str(limit)


def _limit(kind: str, context: Mapping[str, Any], message: str) -> str:
    """What a value must be, in words, from pydantic's description of the error."""
    match kind:
        case "missing":
            return "required, but missing"
        case "greater_than":
            return f"must be greater than {_number(context['gt'])}"
        case "greater_than_equal":
            return f"must be {_number(context['ge'])} or more"
        case "less_than":
            return f"must be less than {_number(context['lt'])}"
        case "less_than_equal":
            return f"must be {_number(context['le'])} or less"
        case "finite_number":
            return "must be a finite number"
        case "float_type":
            return "must be a number"
        case "int_type" | "int_from_float":
            return "must be a whole number"
        case "bool_type":
            return "must be true or false"
        case "string_type":
            return "must be a text in quotes"
        case "literal_error":
            return f"must be {context['expected']}".replace("'", '"')
        case "model_type" | "model_attributes_type" | "dict_type":
            return "must be a table"
        case "tuple_type" | "list_type":
            return "must be a list"
        case "value_error":
            return str(context["error"])
        case _:
            return message[:1].lower() + message[1:]


def _problems(error: ValidationError, data: dict[str, Any], text: str) -> tuple[Problem, ...]:
    """Pydantic's errors as problems of the file: dotted keys, TOML values, limits with units."""
    problems: list[Problem] = []
    for detail in error.errors(include_url=False):
        location, value = _locate(detail["loc"], data, detail["type"])
        # A list counts from 0 in pydantic, from 1 for people.
        key = ".".join(str(part + 1) if isinstance(part, int) else _toml_key(part) for part in location)
        limit = _limit(detail["type"], detail.get("ctx", {}), detail["msg"])
        if detail["type"] == "value_error" and not location:
            found = re.fullmatch(r"(\S+) = (\S+): (.*)", limit)
            problem = Problem(found[1], found[2], found[3]) if found else Problem("", "", limit)
        elif detail["type"] == "extra_forbidden":
            problem = Problem(key, _short(value), "unknown key" + _suggestion(location))
        elif detail["type"] == "missing":
            problem = Problem(key, "", limit + _unit_remark(location))
        elif detail["type"] == "value_error" and isinstance(value, dict):
            problem = Problem(key, "", limit)
        elif detail["type"] == "string_pattern_mismatch":
            field = _field(location)
            problem = Problem(key, _short(value), f"malformed; {field.description if field else limit}")
        else:
            problem = Problem(key, _short(value), limit + _unit_remark(location))
        problem = Problem(problem.key, problem.value, problem.limit, _line_of(problem.key, text))
        if problem not in problems:
            problems.append(problem)
    return tuple(problems)


def _short(value: object) -> str:
    text = "{...}" if isinstance(value, dict) and value else _toml(value)
    return text if len(text) <= 60 else text[:57] + "..."


def _locate(location: tuple[int | str, ...], data: object, kind: str) -> tuple[tuple[int | str, ...], object]:
    """The part of a pydantic location that exists in the file, and the value there."""
    value = data
    for depth, part in enumerate(location):
        in_table = isinstance(value, dict) and part in value
        in_list = isinstance(value, list) and isinstance(part, int) and part < len(value)
        if in_table or in_list:
            value = value[part]  # type: ignore[index]
        elif kind == "missing" and isinstance(value, dict | list):
            return location, None
        else:
            return location[:depth], value
    return location, value


def _field(location: tuple[int | str, ...]) -> FieldInfo | None:
    """The field of the model at a location, None if there is none."""
    model: type[BaseModel] | None = Machine
    field: FieldInfo | None = None
    for part in location:
        if isinstance(part, int):
            continue
        if model is None or part not in model.model_fields:
            return field if model is None else None
        field = model.model_fields[part]
        model = _submodel(field)
    return field


def _submodel(field: FieldInfo) -> type[_Table] | None:
    """The table type of a field: a table itself or the items of a list of tables; None for a plain value."""
    annotation = field.annotation
    if isinstance(annotation, type) and issubclass(annotation, _Table):
        return annotation
    if annotation == tuple[Mode, ...]:
        return Mode
    return None


def _facts(field: FieldInfo | None) -> dict[str, Any]:
    extra = field.json_schema_extra if field is not None else None
    return dict(extra) if isinstance(extra, dict) else {}


def _unit_remark(location: tuple[int | str, ...]) -> str:
    # The keys x, y, z of a PerAxis have the unit of the key above them.
    unit = _facts(_field(location)).get("unit") or _facts(_field(location[:-1])).get("unit")
    return f" (unit: {unit})" if unit and unit != "1" else ""


def _suggestion(location: tuple[int | str, ...]) -> str:
    """The known key that an unknown one most likely stands for."""
    parent = [part for part in location[:-1] if not isinstance(part, int)]
    model: type[BaseModel] | None = Machine
    for part in parent:
        field = model.model_fields.get(part) if model is not None else None
        model = _submodel(field) if field is not None else None
    if model is None:
        return ""
    name = str(location[-1])
    close = difflib.get_close_matches(name, model.model_fields, n=1, cutoff=0.5)
    if close:
        return f"; did you mean {close[0]}?"
    return f"; known here: {', '.join(model.model_fields)}"


_HEADER = re.compile(r"\s*\[{1,2}\s*([^\[\]]+?)\s*\]{1,2}\s*(?:#.*)?")


def _line_of(key: str, text: str) -> int | None:
    """Line of a dotted key in the plain layout ``[table]`` / ``key = value``; None if not found there."""
    table, counts = "", dict[str, int]()
    for number, line in enumerate(text.splitlines(), start=1):
        header = _HEADER.fullmatch(line)
        if header:
            table = re.sub(r"\s*\.\s*", ".", header[1])
            if line.lstrip().startswith("[["):
                counts[table] = counts.get(table, 0) + 1
                table = f"{table}.{counts[table]}"
            if table == key:
                return number
            continue
        assignment = re.match(r'\s*([A-Za-z0-9_.-]+|"[^"]*")\s*=', line)
        if assignment:
            name = f"{table}.{assignment[1]}" if table else assignment[1]
            if key == name or key.startswith(name + "."):
                return number
    return None


def _info(field: FieldInfo, key: str) -> KeyInfo:
    facts = _facts(field)
    if field.is_required():
        default = "required"
    elif field.default is None:
        default = "not set"
    else:
        default = _toml(field.default)
    return KeyInfo(
        key=key,
        unit=facts.get("unit", ""),
        default=default,
        meaning=field.description or "",
        fanuc=facts.get("fanuc", ""),
        assumed=bool(facts.get("assumed")),
    )


def _values(table: _Table, prefix: str, given: bool = True) -> Iterator[KeyValue]:
    for name, field in type(table).model_fields.items():
        value, key = getattr(table, name), f"{prefix}{name}"
        from_file = given and name in table.model_fields_set
        if isinstance(value, _Table) and not isinstance(value, PerAxis):
            yield from _values(value, f"{key}.", from_file)
        elif name == "modes" and value:
            for number, mode in enumerate(value, start=1):
                yield from _values(mode, f"{key}.{number}.", from_file)
        else:
            yield KeyValue(
                info=_info(field, key),
                value="not set" if value is None else _toml(value),
                origin="file" if from_file else "default",
            )


class _TomlWriter:
    """Writes a machine as commented TOML."""

    def __init__(self, remarks: dict[str, str]) -> None:
        self._remarks = remarks
        self._lines: list[str] = []

    def write(self, machine: Machine) -> str:
        self._lines = []
        self._comment(
            "Machine file of shapegcode. Keys and defaults: docs/machine.md. A key that is left "
            "out has its default; `shapegcode machine show FILE` prints every value."
        )
        self._lines.append("")
        self._table(machine, "")
        if self._remarks:
            raise KeyError(f"remarks for unknown keys: {', '.join(sorted(self._remarks))}")
        return "\n".join(self._lines).rstrip("\n") + "\n"

    def _comment(self, text: str) -> None:
        self._lines += textwrap.wrap(
            text,
            _LINE_WIDTH,
            initial_indent="# ",
            subsequent_indent="# ",
            break_long_words=False,
            break_on_hyphens=False,
        )

    def _table(self, table: _Table, prefix: str) -> None:
        """Plain keys first, then the tables below, as TOML asks."""
        below: list[tuple[str, FieldInfo, Any]] = []
        for name, field in type(table).model_fields.items():
            value = getattr(table, name)
            if (isinstance(value, _Table) and not isinstance(value, PerAxis)) or name == "modes":
                below.append((name, field, value))
            else:
                self._plain(f"{prefix}{name}", name, field, value)
        for name, field, value in below:
            key = f"{prefix}{name}"
            if name == "modes":
                self._modes(key, field, value)
            elif isinstance(value, Axes):
                self._table(value, f"{key}.")
            else:
                self._head(f"[{key}]", field.description or "")
                self._table(value, f"{key}.")

    def _head(self, header: str, meaning: str) -> None:
        if self._lines and self._lines[-1]:
            self._lines.append("")
        self._lines.append(f"{header}  # {meaning}" if meaning else header)

    def _plain(self, key: str, name: str, field: FieldInfo, value: object) -> None:
        info = _info(field, key)
        meaning = info.meaning[:1].upper() + info.meaning[1:]
        unit = f" [{info.unit}]" if info.unit and info.unit != "1" else ""
        fanuc = f" (FANUC parameter {info.fanuc})" if info.fanuc else ""
        self._comment(f"{meaning}{unit}{fanuc}.")
        remark = self._remarks.pop(key, "")
        line = f"# {name} = ..." if value is None else f"{name} = {_toml(value)}"
        self._lines.append(f"{line}  # {remark}" if remark else line)

    def _modes(self, key: str, field: FieldInfo, modes: tuple[Mode, ...]) -> None:
        if not modes:
            self._lines.append("")
            self._comment(f"{key}: {field.description}.")
            remark = self._remarks.pop(key, "")
            self._lines += [
                f"# [[{key}]]" + (f"  # {remark}" if remark else ""),
                "# frequency_hz = ...",
                "# damping_ratio = ...",
            ]
        for number, mode in enumerate(modes, start=1):
            self._head(f"[[{key}]]", (Mode.__doc__ or "").rstrip(".") if number == 1 else "")
            self._table(mode, f"{key}.{number}.")


def _documented(model: type[_Table], prefix: str) -> Iterator[tuple[str, str, list[KeyInfo]]]:
    """Per table of the file: its name, its meaning, its keys."""
    keys: list[KeyInfo] = []
    below: list[tuple[str, str, type[_Table]]] = []
    for name, field in model.model_fields.items():
        sub = _submodel(field)
        if sub is None or sub is PerAxis:
            keys.append(_info(field, f"{prefix}{name}"))
        elif sub is Mode:
            below.append((f"{prefix}modes[].", f"{field.description}", sub))
        elif sub is Axis:
            if name == "x":
                below.append((f"{prefix}<x|y|z>.", "limits of one axis; all three tables are required", sub))
        else:
            below.append((f"{prefix}{name}.", f"{field.description}", sub))
    if keys:
        yield prefix.rstrip("."), "", keys
    for sub_prefix, meaning, sub in below:
        for table, text, infos in _documented(sub, sub_prefix):
            yield table, text or meaning, infos


def key_documentation() -> str:
    """The reference of the machine file's keys as Markdown: what ``docs/machine.md`` holds, word for word.

    Regenerate with ``python -m shapegcode.machine > docs/machine.md``.
    """
    builtin = ", ".join(f"`{name}`" for name in Machine.builtin_names())
    lines = [
        "# The machine file",
        "",
        "<!-- Generated: python -m shapegcode.machine > docs/machine.md -->",
        "",
        "A machine file is TOML. `shapegcode machine init` writes a commented one to start from,",
        "`shapegcode machine show FILE` prints every value with its origin. An unknown key, a number that is",
        "not finite or a value outside its limits is an error, and all errors of a file are listed at once.",
        "",
        f"Built-in machines, usable by name in place of a file: {builtin}.",
        "",
        "A default marked **assumed** is not known for real controllers in general: look it up or measure",
        "it. The FANUC column names the parameter that corresponds to a key; numbers differ between series,",
        "so check your manual.",
    ]
    for table, meaning, infos in _documented(Machine, ""):
        lines += ["", f"## {_heading(table)}", ""]
        if meaning:
            lines += [f"{meaning[:1].upper()}{meaning[1:]}.", ""]
        lines += ["| key | unit | default | FANUC | meaning |", "|---|---|---|---|---|"]
        for info in infos:
            name = info.key.removeprefix(f"{table}.")
            default = info.default if info.default in ("required", "not set") else f"`{info.default}`"
            cells = (
                f"`{name}`",
                info.unit or "–",
                default + (" **assumed**" if info.assumed else ""),
                info.fanuc or "–",
                info.meaning,
            )
            lines.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    return "\n".join(lines) + "\n"


def _heading(table: str) -> str:
    if not table:
        return "Top level"
    if table.endswith("[]"):
        return f"`[[{table.removesuffix('[]')}]]`"
    return f"`[{table}]`"


if __name__ == "__main__":
    print(key_documentation(), end="")
