"""How a machine file has programs read: offsets, variables, other programs."""

from __future__ import annotations

import json
import re
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, Strict, field_validator

from shapegcode.settings.keys import Float, NonNegative, Positive, Text, TomlTable, key

_OFFSET_NAME = re.compile(r"G5[4-9]|G54\.1P[1-9][0-9]{0,2}")


def _named(pattern: str, wrong: str) -> AfterValidator:
    """Refuse a table with a name that does not have the form."""

    def check(table: dict[str, Any]) -> dict[str, Any]:
        for name in table:
            if not re.fullmatch(pattern, name):
                raise ValueError(f"{json.dumps(name)} {wrong}")
        return table

    return AfterValidator(check)


_NUMBERED = _named("[1-9][0-9]{0,7}", 'is no number; names are whole numbers, for example "1"')
_G_CODED = _named(r"[1-9][0-9]{0,3}(\.[1-9])?", 'is no G code; names are for example "120" or "120.1"')
_RETAINED = _named("[5-9][0-9]{2}", 'is no variable that the control keeps: "500" ... "999"')
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
        'G02 or G03 without R, I, J, K: "alarm" 0022, or a "line" to its end',
        fanuc="3403#5",
        default="alarm",
        assumed=True,
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
    tool_radius_mm: _Lengths = key(
        'cutter radius by offset number D, for programs with G41 or G42 that are expanded: { "1" = 5.0 }', default={}
    )
    tool_radius_wear_mm: _Lengths = key("wear of the radius by offset number D", default={})
    tool_length_mm: _Lengths = key(
        "tool length by offset number H; with it the Z travel of a tool length change is known", default={}
    )
    tool_length_wear_mm: _Lengths = key("wear of the length by offset number H", default={})
    compensation: Literal["refuse", "expand", "keep"] = key(
        'what `convert` does with cutter compensation G41/G42. "refuse": reports it and stops; "expand": shapes '
        'the tool path of the given radius: the offset in the control no longer acts; "keep": leaves these moves as '
        "they are. Cycle time and plots always use the expanded path where the radius is known",
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
        fanuc="5114, 5115",
        default=0.5,
        assumed=True,
    )
    block_skip: Literal["unknown", "on", "off"] = key(
        'block-skip switch on the panel: "on": blocks with / do not run; "off": they run; "unknown": either may be '
        "true, and nothing is shaped whose state depends on it",
        default="unknown",
    )
    variables: Annotated[dict[str, Float], _RETAINED] = key(
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
        "a longer line is an error", unit="characters", default=250, assumed=True
    )

    @field_validator("work_offsets")
    @classmethod
    def _known_offsets(cls, offsets: dict[str, Any]) -> dict[str, Any]:
        for name in offsets:
            if not _OFFSET_NAME.fullmatch(name):
                raise ValueError(f'{name} is no work offset; names are G54 ... G59 and "G54.1P1" ... "G54.1P999"')
        return offsets
