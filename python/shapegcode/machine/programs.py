"""Machine file: how programs are read (offsets, variables, called programs), shaped and written; their tolerances."""

import json
import re
from collections.abc import Callable, Mapping
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, Field, Strict, field_validator, model_validator

from shapegcode.machine.axes import optional
from shapegcode.machine.dialects import DialectName, code_name, dialect_of
from shapegcode.settings.keys import Bool, Float, NonNegative, Positive, Text, TomlTable, key, toml


def _named(pattern: str, wrong: str, shown: Callable[[str], str] = json.dumps) -> AfterValidator:
    """Make a validator that refuses names in a table that do not match the pattern."""

    def check(table: dict[str, Any]) -> dict[str, Any]:
        for name in table:
            if not re.fullmatch(pattern, name):
                raise ValueError(f"{shown(name)} {wrong}")
        return table

    return AfterValidator(check)


_OFFSETS = _named(
    r"G5[4-9]|G54\.1P[1-9][0-9]{0,2}", 'is not a work offset; names are G54 ... G59 and "G54.1P1" ... "G54.1P999"', str
)
_NUMBERED = _named("[1-9][0-9]{0,7}", 'is not a number; names are whole numbers, for example "1"')
_G_CODED = _named(r"[1-9][0-9]{0,3}(\.[1-9])?", 'is not a G code; names are for example "120" or "120.1"')
_RETAINED = _named("[5-9][0-9]{2}", 'is not a retained variable: "500" ... "999"')
_Whole = Annotated[int, Strict(), Field(ge=0)]
_Lengths = Annotated[dict[str, Float], _NUMBERED]
_Programs = dict[str, Annotated[int, Strict(), Field(ge=1, le=99_999_999)]]


class Input(TomlTable):
    """How programs are read."""

    arc_centre: Literal["incremental", "absolute"] = key(
        'I J K of an arc: "incremental" from its start, as FANUC reads them; "absolute" for programs posted '
        "for other controls",
        default="incremental",
    )
    arc_without_centre: Literal["alarm", "line"] = key(
        'G02 or G03 without R, I, J, K: "alarm" 0022, or a "line" to its end', fanuc="3403#5", assumed="alarm"
    )
    tool_change_unknown_axes: Annotated[str, Strict(), Field(pattern=r"^X?Y?Z?$")] = key(
        "axes whose position is unknown after M06 until programmed again; letters of XYZ in this order",
        assumed="XYZ",
    )
    work_offsets: Annotated[dict[str, tuple[Float, Float, Float]], _OFFSETS] = key(
        'work offsets, for programs that use more than one: G54 = [x, y, z]; "G54.1P5" = [x, y, z]; one that '
        "is left out is zero",
        unit="mm",
        default={},
    )
    tool_radius_mm: _Lengths = key(
        'cutter radius by offset number D, for programs with G41 or G42 that are expanded: { "1" = 5.0 }', default={}
    )
    tool_radius_wear_mm: _Lengths = key("wear of the radius by offset number D", default={})
    tool_length_mm: _Lengths = key(
        "tool length by offset number H; with it the Z travel of a tool length change is known", default={}
    )
    tool_table: Text = key(
        "LinuxCNC's tool table, or the INI file that refers to it ([EMCIO] TOOL_TABLE, [TRAJ] LINEAR_UNITS), for "
        "programs in its dialect; left out: tool.tbl in the folder of the program, if it exists. tool_length_mm and "
        "tool_radius_mm take precedence",
        default="",
    )
    machine_unit: Literal["mm", "inch"] = key(
        "unit of LinuxCNC's machine ([TRAJ] LINEAR_UNITS), of its tool table, its offsets #5211 to #5383 and "
        "those of the tool #5401 to #5410; an INI file in tool_table takes precedence",
        default="mm",
    )
    tool_length_wear_mm: _Lengths = key("wear of the length by offset number H", default={})
    compensation: Literal["refuse", "expand", "keep"] = key(
        'what `convert` does with cutter compensation G41/G42. "refuse": stops with an error; "expand": shapes the '
        'tool path for input.tool_radius_mm; the offset in the control is then without effect; "keep": leaves these '
        "moves unchanged. Cycle time and pictures always use the expanded path where the radius is known",
        default="refuse",
    )
    compensation_start_up: Literal["A", "B"] = key(
        "kind of the start-up and cancel moves of cutter compensation", fanuc="5003#0, #1", assumed="A"
    )
    material_side: Literal["left", "right"] | None = optional(
        "side of the programmed tool path on which the workpiece lies, in the direction of travel: right if the "
        "contour is cut as with G41, left as with G42; with it deviations are reported as gouge and excess; left out: "
        "not known"
    )
    scale_unit: Annotated[Positive, Field(le=1)] = key(
        "unit of the factors P, I, J, K of scaling G51 without a decimal point", unit="1", fanuc="5400#7", assumed=0.001
    )
    peck_clearance_mm: NonNegative = key(
        "clearance at which a peck of G73 and G83 changes to feed; for the cycle time",
        fanuc="5114, 5115",
        assumed=0.5,
    )
    block_skip: Literal["unknown", "on", "off"] = key(
        'block-skip switch on the panel: "on": blocks with / do not run; "off": they run; "unknown": either may be '
        "true, and cuts whose state depends on it are not shaped",
        default="unknown",
    )
    variables: Annotated[dict[str, Float], _RETAINED] = key(
        'values of the retained variables, #500 ... #999, for macros that read them: { "500" = 12.5 }',
        default={},
    )
    program_folders: tuple[Text, ...] = key(
        "folders to search for called programs that are not in the file (O0123, O0123.nc, 0123.NC ...); "
        "the folder of the calling file comes first",
        default=(),
    )
    opaque_programs: tuple[_Whole, _Whole] = key(
        "first and last O number of programs of the machine builder or of a probe: a call of one that is not available "
        "is left unchanged, and position and variables are unknown after it; outside this range a missing program "
        "is an error",
        assumed=(9000, 9999),
    )
    g_macros: Annotated[_Programs, _G_CODED] = key(
        'G codes that call a macro like G65: { "120" = 9010 }', fanuc="6050 ... 6059", default={}
    )
    m_macros: Annotated[_Programs, _NUMBERED] = key(
        'M codes that call a macro like G65: { "200" = 9020 }', fanuc="6080 ... 6089", default={}
    )
    m_subprograms: Annotated[_Programs, _NUMBERED] = key(
        'M codes that call a subprogram like M98: { "6" = 9001 }', fanuc="6071 ... 6079", default={}
    )
    tool_program: Annotated[int, Strict(), Field(ge=0, le=99_999_999)] = key(
        "program that every T code calls, with T in #149; 0: none", fanuc="6001#5", default=0
    )
    max_line_length: Annotated[int, Strict(), Field(ge=20, le=100_000)] = key(
        "a longer line is an error", unit="characters", assumed=250
    )


_BLOCK_CHARACTERS = re.compile(r"[A-Z0-9 .,+\-*/=#\[\]()<>_:;&]*")
_FANUC_LOCK = (("#33=#3004", "#3004=[#33OR2]"), ("G53", "#3004=#33"))
_LOOK_AHEAD = re.compile(r"G(?:0?5\.1 *Q|0?[58] *P)(\d+)")


class Emission(TomlTable):
    """How shaped programs are written."""

    dialect: DialectName = key(
        "control for which `convert` writes the program; the control of the original is controller.dialect. Other "
        "commands that write programs refuse any control but fanuc",
        default="fanuc",
    )
    words: dict[str, Text] = key(
        "replacements for codes of the original that mean something else in the dialect, or are unknown in it: "
        '{ "M11" = "M61", "G49" = "" } ("": left out). A replacement for G10, G28, G30, G52, G53, G92 also replaces '
        'the coordinates in the block, unless it is one code: { "G28" = "SUPA G0 Z0 D0" }',
        default={},
    )
    feed_form: Literal["constant", "linear"] = key(
        'feed of shaped blocks. "constant": each block has its own; "linear": from the F of the previous block to its '
        'own, linear along its path (FLIN), which needs fewer blocks; only for dialect = "siemens", and not tested on '
        "a control",
        default="constant",
    )
    decimals: Annotated[int, Strict(), Field(ge=2, le=6)] | None = optional(
        "decimals of positions in mm in shaped blocks, one more in inch; left out: those of the dialect, else those of "
        "controller.least_increment_mm",
        unit="digits",
    )
    block_period_s: Annotated[Positive, Field(le=1)] | None = optional(
        "duration of a shaped block that is not merged: a multiple of controller.interpolation_period_s, not below "
        "controller.block_time_s; left out: chosen for the shortest shaper"
    )
    prologue: tuple[Text, ...] = key(
        'lines written before each shaped cut, for example ["G05.1 Q0"] to switch a look-ahead mode off', default=()
    )
    epilogue: tuple[Text, ...] = key("lines written after each shaped cut", default=())
    override: Literal["ask", "any", "lock"] = key(
        'treatment of the feed override in shaped cuts. "ask": the header asks the operator for 100 %; with a wider '
        'verdict.override_percent it acts as "any". "lock": lock_lines switch the feed override off before each '
        'shaped cut, unlock_lines switch it on again after it; "any": blocks of equal duration and a block period for '
        "which other overrides cause little vibration (a larger program)",
        default="ask",
    )
    lock_lines: tuple[Text, ...] = key(
        'lines that switch the feed override off, for override = "lock"; a builder\'s own code, for example ["M49"], '
        "goes here",
        fanuc="#3004",
        default=_FANUC_LOCK[0],
    )
    unlock_lines: tuple[Text, ...] = key(
        "lines that restore the feed override. Macro statements are executed when they are read, so G53 comes first: "
        'the control does not read beyond it until the moves before it are finished. For a builder\'s own code ["M48"]',
        fanuc="#3004",
        default=_FANUC_LOCK[1],
    )
    prefill_dwell_s: Annotated[NonNegative, Field(le=60)] = key(
        "dwell before each shaped cut, in which the block buffer fills; 0: none", default=0.0
    )
    restart_interval_s: Positive = key(
        "longest cutting time between restart points of a shaped cut, which are at positions where its command is "
        "slow; a block period or more; longer than the cuts: no restart points",
        default=60.0,
    )
    restart_stops: Bool = key(
        "let a shaped cut stop for a restart point if it is never slow within restart_interval_s: costs "
        "time, and the tool dwells in the cut",
        default=False,
    )
    compensation_guard: Literal["alarm", "stop"] = key(
        'where cutter compensation was expanded: "alarm" compares the offset in the control with the expanded radius '
        'and raises an alarm if it differs; "stop" halts with M00 for the operator to compare (always where IF cannot '
        "run: drip feed, no macros, another dialect)",
        default="alarm",
    )
    header: Bool = key(
        "write comments: shapegcode version, machine, modes, block period, shaper duration, override, time constant",
        default=True,
    )
    failed_suffix: Annotated[str, Strict(), Field(min_length=1, pattern=r"^[^/\\\x00-\x1f]+$")] = key(
        "suffix for an output that misses its tolerance, so that it is not run by mistake",
        default=".out-of-tolerance",
    )
    max_line_length: Annotated[int, Strict(), Field(ge=30, le=250)] = key(
        "longest line written", unit="characters", assumed=60
    )
    arc_min_chord_mm: NonNegative = key(
        "part of an arc with a shorter chord is written as a line: rounding could turn it into a full circle",
        default=0.02,
    )
    merge_tolerance_increments: NonNegative = key(
        "blocks are merged into one that deviates from the shaped command by this many least increments at most, per "
        "axis; 0: only where they agree exactly",
        unit="increments",
        default=0.35,
    )
    rounding: Literal["vibration", "nearest"] = key(
        'rounding of block ends. "vibration": to that of the two neighbouring increments that leaves the '
        'modes at rest; "nearest": each to the nearest increment, with a vibration of up to several increments',
        default="vibration",
    )

    @field_validator("words")
    @classmethod
    def _codes(cls, words: dict[str, str]) -> dict[str, str]:
        for word, text in words.items():
            if not re.fullmatch(r"[GM]\d{1,4}(\.\d)?", word):
                raise ValueError(f'{json.dumps(word)} is not a G or M code; names are for example "M11" or "G05.1"')
            if not _BLOCK_CHARACTERS.fullmatch(text):
                raise ValueError(f"{json.dumps(text)} for {word} has a character that is not allowed in a program")
        if len({code_name(word) for word in words}) < len(words):
            raise ValueError("a code is named twice, with leading zeros and without")
        return words

    @field_validator("prologue", "epilogue", "lock_lines", "unlock_lines")
    @classmethod
    def _fanuc_lines(cls, lines: tuple[str, ...]) -> tuple[str, ...]:
        for line in lines:
            if not _BLOCK_CHARACTERS.fullmatch(line):
                raise ValueError(
                    f"the line {json.dumps(line)} has a character other than capital letters, digits and "
                    "signs allowed in a program (no %, no end of line)"
                )
        return lines

    @model_validator(mode="after")
    def _fits_its_lines_and_dialect(self) -> Self:
        for line in (*self.prologue, *self.epilogue, *self.lock_lines, *self.unlock_lines):
            if len(line) > self.max_line_length:
                limit = f"emission.max_line_length is {self.max_line_length}"
                raise ValueError(f"the line {json.dumps(line)} has {len(line)} characters, {limit}")
        for name, stated in (("words", self.words), ("decimals", self.decimals)):
            if stated and self.dialect == "fanuc":
                raise ValueError(f"{name} has an effect only if emission.dialect is not fanuc")
        if self.feed_form == "linear" and self.dialect != "siemens":
            raise ValueError(
                f'feed_form = "linear" with dialect = "{self.dialect}": no word for a feed linear along a block is '
                "known there; a Sinumerik has FLIN"
            )
        return self

    @property
    def around_cuts(self) -> Mapping[str, tuple[str, ...]]:
        """Lines before and after a shaped cut, by purpose; no LOCK and UNLOCK: no lock, or one by `lock_word`."""
        lock, unlock = (self.lock_lines, self.unlock_lines) if self.override == "lock" else ((), ())
        if (own := dialect_of(self.dialect)) is not None:  # FANUC's usual lines become those of the dialect
            lock = own.lock[0] if lock == _FANUC_LOCK[0] else lock
            unlock = own.lock[1] if unlock == _FANUC_LOCK[1] else unlock
        return {"PROLOGUE": self.prologue, "EPILOGUE": self.epilogue, "LOCK": lock, "UNLOCK": unlock}

    @property
    def position_decimals(self) -> int | None:
        """Decimals of positions in mm; None: those of the control's increment."""
        own = dialect_of(self.dialect)
        return self.decimals if own is None or self.decimals is not None else own.decimals

    @property
    def prefill_lines(self) -> tuple[str, ...]:
        """The dwell before each shaped cut as a line; empty if it is 0."""
        return (f"G04P{round(self.prefill_dwell_s * 1e3)}",) if self.prefill_dwell_s > 0.0 else ()

    @property
    def leaves_look_ahead(self) -> bool:
        """True if the last word for a look-ahead mode in the prologue is G05.1 Q0, G05 P0 or G08 P0."""
        last = [found for line in self.prologue for found in _LOOK_AHEAD.findall(line)]
        return bool(last) and last[-1] == "0"


_Family = Literal[
    "auto", "zv", "zvd", "zvdd", "mzv", "ei", "ei2", "ei3", "si", "negative-zv", "polynomial", "non-negative",
    "robust", "mirrored", "smooth-zv", "smooth-mzv", "smooth-ei", "smooth-ei2", "smooth-si", "smooth-zvd-ei",
]  # fmt: skip


class Shaping(TomlTable):
    """What is shaped, and how."""

    max_duration_s: Annotated[Positive, Field(le=10)] = key("longest shaper that is accepted", default=0.25)
    family: _Family = key(
        'family of the shaper (`shapegcode shaper` compares them). "auto": the shortest one without negative impulses '
        "that has zero residual at every mode; or, if modes have frequency_uncertainty_percent, a residual below "
        "vibration_limit over the whole band of each",
        default="auto",
    )
    per_axis: Bool = key(
        "one shaper per axis, for that axis' modes only: shorter than one for all. Not possible with "
        'contour = "off", with a named family, or if a mode has frequency_uncertainty_percent or a frequency that '
        "depends on an axis position (frequency_over)",
        default=False,
    )
    vibration_limit: Annotated[Positive, Field(lt=1)] = key(
        "largest residual ratio over the modes' bands, for families with a residual",
        unit="1",
        default=0.05,
    )
    arc_feed_ratio: Annotated[Positive, Field(le=1)] = key(
        "feed in arcs relative to the programmed feed, reached before the arc begins; 1: no reduction", default=1.0
    )
    contour: Literal["response", "command", "off"] = key(
        "what contour compensation keeps within tolerance.contour_um of the programmed path, at the highest possible "
        'feed. "response": the motion of the machine table, vibration included; "command": the set-points; "off": '
        "no compensation; the set-points are kept within the tolerance by a lower feed",
        default="response",
    )
    planner: Literal["auto", "look-ahead", "optimal"] = key(
        'how a cut is planned before it is shaped. "look-ahead": as by a FANUC control\'s look-ahead, with its law of '
        'acceleration and corner rule; "optimal": as fast as feed, acceleration and jerk of the axes allow, corners '
        'and short moves rounded within tolerance.contour_um; "auto": "look-ahead" where controller.kind is "fanuc" '
        '(there "optimal" needs axes.*.max_jerk_mm_s3), else "optimal"',
        default="auto",
    )
    jerk_time_s: Annotated[Positive, Field(ge=0.001, le=1)] = key(
        'time in which a cut planned by "optimal" builds up max_acceleration_mm_s2 of an axis without max_jerk_mm_s3, '
        'where controller.kind is not "fanuc": those planners have no jerk limit',
        assumed=0.05,
    )
    rapids: Bool = key(
        "write rapids (G00) as shaped cutting moves where the vibration then settles sooner for the next cut; rapid "
        "override does not act on them",
        default=False,
    )
    least_gain_um: NonNegative = key(
        "a cut is left unchanged unless shaping lowers residual vibration or the contour error of the machine table by "
        "at least this; --shape-all shapes such cuts too",
        default=3.0,
    )
    plunge_angle_deg: Annotated[NonNegative, Field(le=90)] = key(
        "a corner is a forced stop of the shaped command if one side of it is inclined to the Z axis by no more than "
        "this and the direction changes by 45 degrees or more: a shaper must not mix plunges with other cuts",
        default=15.0,
    )
    part_mass_kg: NonNegative | None = optional(
        "mass of the part on the worktable, for modes whose frequency depends on it (frequency_over); "
        "without a value in the machine file or by --part-mass these have their nominal frequency"
    )


_Override = Annotated[Positive, Field(le=254)]


class Tolerance(TomlTable):
    """Tolerances of an emitted program; if one is missed, the conversion reports it and exits with 1."""

    contour_um: Annotated[Positive, Field(ge=0.001, le=1e6)] = key(
        "largest contour error: of the response or of the command, as shaping.contour says",
        default=20.0,
    )
    residual_ratio: Annotated[NonNegative, Field(le=1)] = key(
        "residual vibration passes if it is below this ratio to the original program's, or below residual_floor_um",
        default=0.25,
    )
    residual_floor_um: NonNegative = key(
        "residual vibration below this passes whatever the original's was", default=3.0
    )
    residual_floor_increments: NonNegative = key(
        "residual vibration below this passes too: rounding of words may excite a lightly damped mode that much",
        unit="increments",
        default=5.0,
    )
    feed_excess_ratio: Annotated[NonNegative, Field(ge=0.01, le=10)] = key(
        "ratio by which the set-points may be faster along the path than the programmed feed at the same position, "
        "averaged over 1, 4 and 16 times the shortest block; two increments are subtracted, since rounding may "
        "lengthen a block by that much. Contour compensation keeps to it, and needs at least 0.01",
        default=0.05,
    )


class Price(TomlTable):
    """Limits of the added time: a cut beyond them gets the tightest tolerance within them or is left unchanged."""

    program_time_percent: Annotated[Positive, Field(le=1e6)] = key(
        "largest increase of the program's time", default=10.0
    )
    cut_time_percent: Annotated[Positive, Field(le=1e6)] = key("largest increase of the time of one cut", default=25.0)


ANY_PRICE = {"price.program_time_percent": 1e6, "price.cut_time_percent": 1e6}
"""Keys that remove the limits of added time, to determine the effect of shaping whatever time it costs."""


class Verdict(TomlTable):
    """Operating conditions that decide the verdict. All are simulated and shown; 100 % override always counts."""

    plant: Literal["modal", "feed-drive"] = key(
        'model between command and machine table. "modal": ideal servo and vibration modes, so that the verdict does '
        'not include servo lag; "feed-drive": motor, screw, friction and servo loops of axes.*.drive, where they are '
        "known, and the modes: the contour error then includes the lag, the residual is the vibration of the table "
        "relative to its motor",
        default="modal",
    )
    override_percent: tuple[_Override, _Override] = key(
        "lowest and highest feed override of the program: those tested in between must be within tolerance. The "
        "header of a program asks for 100 %: by default only 100 % counts",
        default=(100.0, 100.0),
    )
    mode_uncertainty: Bool = key(
        "whether modes shifted by their frequency_uncertainty_percent count, with damping reduced by their "
        "damping_uncertainty_percent; modes without these are taken as exact",
        default=True,
    )
    block_end: Literal["both", "own"] = key(
        '"both": within tolerance with either rule of block timing; "own": with controller.block_end, '
        "for a controller whose rule is known",
        default="both",
    )
    look_ahead: Bool = key(
        "whether the program must stay within tolerance with the look-ahead mode left on, which plans the speed of "
        "shaped blocks again; false: it is off in shaped cuts (emission.prologue)",
        default=False,
    )
    starved_block: Bool = key(
        "whether the program must be within tolerance if the buffer runs empty once, at the worst position; false: it "
        "never does (memory or a data server, emission.prefill_dwell_s)",
        default=False,
    )
    starved_s: Annotated[Positive, Field(le=10)] = key("duration of the buffer underrun", assumed=0.02)

    @model_validator(mode="after")
    def _band_ascends(self) -> Self:
        low, high = self.override_percent
        if low > high:
            raise ValueError(f"override_percent = {toml(self.override_percent)}: the lower end comes first")
        return self
