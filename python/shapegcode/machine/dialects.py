"""What controls other than FANUC's read: one row for each dialect in which `convert` writes.

A row holds facts with their sources. What nobody found a text for is *assumed*: the written program and the answer of
`convert` say so. Words of the original are written only where they are known to mean the same, or what they become.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Literal

DialectName = Literal["fanuc", "haas", "mitsubishi", "siemens", "linuxcnc", "klipper", "isg"]

FANUC_MEANINGS: Mapping[str, str] = MappingProxyType(
    {
        "G05": "high-speed machining",
        "G05.1": "AI contour control on or off",
        "G08": "advanced preview control on or off",
        "G09": "an exact stop in this block",
        "G10": "setting of offsets or parameters",
        "G20": "inch",
        "G21": "mm",
        "G28": "the move to the reference position through the programmed one",
        "G30": "the move to the second reference position",
        "G41": "cutter compensation on the left",
        "G42": "cutter compensation on the right",
        "G43": "the tool length offset H",
        "G52": "a shift of the coordinate system",
        "G49": "tool length offset off",
        "G53": "the machine coordinate system in this block",
        "G54.1": "an additional work coordinate system",
        "G55": "work coordinate system 2",
        "G58": "work coordinate system 5",
        "G59": "work coordinate system 6",
        "G61": "an exact stop in every block",
        "G64": "cutting mode, without stops between blocks",
        "G65": "a macro call",
        **{f"G{code}": "a drilling cycle" for code in (73, 74, 76, *range(81, 90))},
        "G92": "the coordinate system set by a position",
        "G93": "inverse time, F in 1/min",
        "G95": "feed per revolution",
        "M00": "a stop",
        "M01": "an optional stop",
        "M03": "the spindle on",
        "M04": "the spindle on, to the left",
        "M05": "the spindle off",
        "M06": "a tool change",
        "M07": "coolant on",
        "M08": "coolant on",
        "M09": "coolant off",
        "M30": "the end of the program",
        "M98": "a subprogram call",
        "M99": "the end of a subprogram",
    }
)
"""What words say on a FANUC control, for messages."""


@dataclass(frozen=True)
class Fact:
    """One thing that is known of a control, or assumed."""

    text: str
    source: str = ""  # page or recording; empty: assumed


@dataclass(frozen=True)
class Dialect:
    """How programs for a control are written.

    Attributes:
        control: its name.
        facts: by topic, what holds there and where that is written.
        same: words that mean what they mean on a FANUC control.
        becomes: words that are written otherwise, and how; empty: left out, as it says nothing there.
        means: words that mean something else there, for the refusal.
        cautions: words that mean the same as far as the control is set up so.
        frame: "tape": `%` and the O number; "percent": `%` alone; "name": `%` and the name in the first line; "none".
        comment: "(" for comments in brackets, ";" for those that reach to the end of the line.
        opening: lines before the first block.
        dwell: of one; `{s}` seconds, `{ms}` milliseconds.
        arc_radius: address of the radius of an arc; empty: arcs are written as chords.
        time_feed: shaped blocks carry their time in seconds, with G93.
        one_code: a line holds one code, and each move its own G.
        short_codes: codes have no leading zeros.
        decimals: digits of positions in mm in shaped blocks; None: as many as `controller.least_increment_mm` has.
        feed_decimals: likewise of F; None: `controller.feed_decimals_mm`.
        least_block_s: shortest block that the control runs; None: not known.
        lock: lines that switch the feed override off, and on again; empty: none are known.
        lock_word: word of every shaped block that does it instead.
        exact_stop: lines before and behind a block with G09, "" behind: the mode in force; None: a word like others.
        header: comments for the operator.
    """

    control: str
    facts: Mapping[str, Fact]
    same: frozenset[str]
    becomes: Mapping[str, str] = field(default_factory=dict)
    means: Mapping[str, str] = field(default_factory=dict)
    cautions: Mapping[str, str] = field(default_factory=dict)
    frame: Literal["tape", "percent", "name", "none"] = "tape"
    comment: str = "("
    opening: tuple[str, ...] = ()
    dwell: str = "G04P{ms}"
    arc_radius: str = "R"
    time_feed: bool = False
    one_code: bool = False
    short_codes: bool = False
    decimals: int | None = None
    feed_decimals: int | None = None
    least_block_s: float | None = None
    lock: tuple[tuple[str, ...], tuple[str, ...]] = ((), ())
    lock_word: str = ""
    exact_stop: tuple[str, str] | None = None
    header: tuple[str, ...] = ()

    @property
    def assumed(self) -> tuple[str, ...]:
        """Topics for which there is no source."""
        return tuple(topic for topic, fact in self.facts.items() if not fact.source)


_MOTION = "G00 G01 G02 G03 G17 G18 G19 G40 G90 G91 G94"
_STOPS = "M00 M01 M02 M03 M04 M05 M08 M09 M30"
_TAPE = "G09 G20 G21 G28 G41 G42 G43 G49 G53 G54 G55 G56 G57 G58 G59 G61 G64 G73 G80 G81 G82 G83 G85 G95 G98 G99"
_G2 = "https://github.com/synthetos/g2/wiki/g2dialect-Consensus-Mcodes"
_HAAS = "https://github.com/sebarenzi/cncinfo/blob/main/codigosg.md"
_HAAS_DWELL = "https://pastebin.com/prSjxEWB"
_HAAS_LOCK = "https://zappettiniconsulting.com/wiki/feed-hold"
_HAAS_TIME = "the maker's article on the high-speed option; gcodes.net, haas-g93"
_SIEMENS = "https://www.easymanua.ls/siemens/sinumerik-808d-advanced/manual/662598?p=53"
_READER = "PyPI nc-gcode-interpreter 0.1.9 reads it"
_BECKHOFF = "https://infosys.beckhoff.com/content/1033/tf5200_programming_manual/"
_KLIPPER = "https://www.klipper3d.org/G-Codes.html"
_RECORDED = "recorded from its own planner: docs/howto/control_linuxcnc.md, control_klipper.md"
_RS274 = "LinuxCNC 2.9, its interpreter rs274 reads it"


def _words(text: str) -> frozenset[str]:
    return frozenset(text.split())


_UNKNOWN_BLOCK = Fact("the shortest block is not known: controller.block_time_s of the machine file counts")
_NO_LOCK = Fact("no word that switches the feed override off was found")
_BY_NUMBER = Fact("search the N number of a restart point, with spindle, tool and offset in force")

DIALECTS: Mapping[str, Dialect] = MappingProxyType({
    "haas": Dialect(
        "Haas",
        {
            "words": Fact("G and M codes as on a FANUC mill, those of the table alone", f"{_HAAS}; {_G2}"),
            "dwell": Fact("G04 P with a point is seconds, without one milliseconds", _HAAS_DWELL),
            "feed": Fact("G94, F in mm/min with a point", _HAAS),
            "decimals": Fact("three in mm, four in inch"),
            "least block": Fact("1 000 blocks/s: no block below 1 ms; blocks of 2 ms and more suit", _HAAS_TIME),
            "look-ahead": Fact(
                "it cannot be switched off; it slows with the angle between blocks, and no setting that prevents that "
                "was found: make a first run and compare its time", _HAAS_TIME,
            ),
            "override": Fact(f"#3004=2 switches the feed override off (macro option; {_HAAS_LOCK}); that a G53 alone "
                             "keeps it from being given back too early is assumed"),
            "restart": _BY_NUMBER,
        },
        _words(f"{_MOTION} {_TAPE} {_STOPS} M06"),
        means={"G10": "setting of offsets, whose L numbers were not compared",
               "G12": "circular pocket milling", "G13": "circular pocket milling"},
        dwell="G04P{s}",
        least_block_s=0.001,
        lock=(("#33=#3004", "#3004=[#33OR2]"), ("G53", "#3004=#33")),
    ),
    "mitsubishi": Dialect(
        "Mitsubishi M700V/M800",
        {
            "words": Fact("the G codes of its M system are those of a FANUC mill"),
            "dwell": Fact("G04 P in milliseconds"),
            "feed": Fact("G94; its G93 would be clamped to .001 to 999 999.999 per minute",
                         "programming manual, manualshive 238523, p. 125"),
            "decimals": Fact("three in mm, four in inch"),
            "least block": _UNKNOWN_BLOCK,
            "look-ahead": Fact("high-accuracy control (G08P1, G61.1, G05P2) must be off in shaped cuts; blocks shorter "
                               "than an interpolation period may be merged"),
            "override": Fact("#3004=2 switches the feed override off, as on FANUC"),
            "restart": _BY_NUMBER,
        },
        _words(f"{_MOTION} {_TAPE} {_STOPS} M06"),
        lock=(("#33=#3004", "#3004=[#33OR2]"), ("G53", "#3004=#33")),
    ),
    "siemens": Dialect(
        "SINUMERIK 840D sl, 828D, 808D (DIN mode)",
        {
            "words": Fact("DIN words; G43 H of the tool in the spindle is D1, cycles are refused", _READER),
            "dwell": Fact("G4 F in seconds, in a block of its own", "https://cloud.tencent.com/developer/article/1100156"),
            "feed": Fact("G94; G700/G710 for the unit, because G70/G71 leave F as it is", _SIEMENS),
            "decimals": Fact("three in mm, four in inch"),
            "least block": _UNKNOWN_BLOCK,
            "look-ahead": Fact("G64 without a compressor (COMPOF), BRISK, no smoothing of the axes (MD32400): which of "
                               "them slows short blocks is not known"),
            "override": _NO_LOCK,
            "restart": Fact("block search with calculation to the N number of a restart point"),
        },
        _words(f"{_MOTION} G54 G55 G56 G57 G64 {_STOPS} M06"),
        {"G09": "G9", "G20": "G700", "G21": "G710", "G61": "G60", "G49": "D0", "G80": "", "G98": "", "G99": ""},
        {"G10": "not known", "G28": "not known (homing is G74, a fixed point G75)", "G43": "not known (D n)",
         "G05.1": "not known", "G08": "not known",
         "G53": "frames suppressed in this block, which of them is set by the machine builder",
         "G58": "a programmable offset of single axes", "G59": "a programmable offset of single axes",
         "G92": "the largest spindle speed", "G93": "inverse time, in an F that is needed in every block"},
        frame="none", comment=";", dwell="G4 F{s}", arc_radius="CR=", short_codes=True,
    ),
    "linuxcnc": Dialect(
        "LinuxCNC 2.9",
        {
            "words": Fact("RS274/NGC; O words are subroutines, M100 and above user programs", _RS274),
            "dwell": Fact("G4 P in seconds", _RS274),
            "feed": Fact("G94, F with three decimals", _RECORDED),
            "decimals": Fact("five in mm: on 1 µm a block of 1 mm has an angle of 1 mrad, at which it slows",
                             _RECORDED),
            "least block": Fact("blocks of 5 ms with [TRAJ]ARC_BLEND_RAMP_FREQ = 10000; as delivered (100) blocks "
                                "below 10 ms are stretched", _RECORDED),
            "look-ahead": Fact("set [TRAJ]ARC_BLEND_RAMP_FREQ = 10000 and [TRAJ]ARC_BLEND_KINK_RATIO = 0.7 in the INI "
                               "file: as delivered the shaped program is worse than the original; acceleration of the "
                               "axes twice the largest step of speed per block period", _RECORDED),
            "override": Fact("M50P0 switches the feed override off, M50P1 on",
                             "https://github.com/machinekit/machinekit-docs src/gcode/m-code.asciidoc"),
            "restart": Fact("run from the line of a restart point; N numbers are not searched"),
        },
        _words(f"{_MOTION} G20 G21 G28 G43 G49 G53 G54 G55 G56 G57 G58 G59 G73 G80 G81 G82 G83 G85 G95 G98 G99 "
               f"{_STOPS} M06 M07"),
        {"G61": "G61.1", "G64": "G64P{blend}"},
        {"G05": "a cubic spline", "G05.1": "a quadratic spline", "G08": "radius mode of a lathe",
         "G10": "setting of offsets, whose L numbers differ", "G65": "not known", "M98": "not known",
         "M99": "an endless loop", "G93": "inverse time, in an F that is needed in every block",
         "G54.1": "not known (G59.1 to G59.3)"},
        {"G28": "it goes to the position that G28.1 stored, to machine zero where none was stored",
         "G43": "H is the number of a tool in the tool table"},
        frame="percent", opening=("G91.1",), dwell="G04P{s}", decimals=5, feed_decimals=3,
        lock=(("M50P0",), ("M50P1",)), exact_stop=("G61.1", ""),
        header=("INI TRAJ ARC_BLEND_RAMP_FREQ 10000", "INI TRAJ ARC_BLEND_KINK_RATIO 0.7"),
    ),
    "klipper": Dialect(
        "Klipper",
        {
            "words": Fact("G0, G1, G4, G90, G91; everything else is a macro of the machine", _KLIPPER),
            "dwell": Fact("G4 P in milliseconds", _KLIPPER),
            "feed": Fact("F in mm/min", _KLIPPER),
            "decimals": Fact("five: positions are floating-point numbers", "klippy/extras/gcode_move.py"),
            "arcs": Fact("chords within 0.5 µm: G2 and G3 need [gcode_arcs], which has chords of 1 mm",
                         "klippy/extras/gcode_arcs.py"),
            "least block": Fact("blocks of 5 ms", _RECORDED),
            "look-ahead": Fact("max_accel of 10 000 mm/s² and more, no [input_shaper] beside", _RECORDED),
            "override": Fact("M220 S100 sets the speed factor to 100 %, nothing locks it", _KLIPPER),
            "restart": Fact("none: a file runs from its begin", _KLIPPER),
        },
        _words("G00 G01 G02 G03 G90 G91"),
        {"G17": "", "G18": "", "G19": "", "G40": "", "G49": "", "G54": "", "G64": "", "G80": "", "G94": "", "G98": "",
         "G99": "", "G21": "G21", "M02": "", "M30": ""},
        {"G20": "refused (inch)", "G28": "homing of the axes", "G92": "the position without a coordinate system",
         "G61": "not known", "M00": "not known", "M06": "a macro, if the machine has one"},
        {"G54": "there is one coordinate system"},
        frame="none", comment=";", dwell="G4 P{ms}", arc_radius="", one_code=True, decimals=5, feed_decimals=3,
        exact_stop=("", "M400"),
    ),
    "isg": Dialect(
        "ISG kernel, Beckhoff TwinCAT CNC (TF5200)",
        {
            "words": Fact("DIN words; G05, G08, G20, G21, G53, G61, G80 to G89 are others than FANUC's",
                          f"{_BECKHOFF}5251491951026763659.html"),
            "dwell": Fact("G04 X in seconds, in a block of its own", f"{_BECKHOFF}206132747.html"),
            "feed": Fact("shaped blocks with G93, F in seconds: the control reports a time that it cannot keep; "
                         "all others in mm/min, as it is delivered",
                         f"{_BECKHOFF}206602507.html"),
            "arcs": Fact("R, and I J K from the start with G162",
                         "https://infosys.beckhoff.com/content/1033/tccncprogramming/15556639883.html, 15556764811"),
            "decimals": Fact("three in mm"),
            "least block": _UNKNOWN_BLOCK,
            "look-ahead": Fact("slope of the type STEP and no contouring (G61, #HSC): not tried"),
            "override": Fact("G166 in a block sets the override to 100 % there", f"{_BECKHOFF}206744331.html"),
            "restart": Fact("block search to the N number of a restart point"),
        },
        _words(f"{_MOTION} G54 G55 G56 G57 G58 G59 M00 M01 M02 M03 M04 M05 M30"),
        {"G09": "G60", "G21": "G71", "G61": "G360", "G64": "G359", "G80": "", "G98": "", "G99": ""},
        {"G05": "tangential selection of tool radius compensation", "G05.1": "not known",
         "G08": "acceleration at the begin of the block", "G10": "constant feed in tool radius compensation",
         "G20": "mirroring off (inch is G70, of which is not known whether it counts for F)", "G28": "not known",
         "G43": "not known (D n)", "G49": "not known", "G51": "diameter programming", "G52": "diameter programming off",
         "G53": "work offsets off until the next one", "G93": "the time of the block in seconds",
         "M06": "a subprogram, where one is configured", "M08": "no function unless it is configured",
         "M09": "no function unless it is configured"},
        frame="name", opening=("G162",), dwell="G04 X{s}", time_feed=True, lock_word="G166",
    ),
})  # fmt: skip
"""By name; `fanuc` has no row: it is what everything else here reads and writes."""


def code_name(word: str) -> str:
    """A code with two digits: G4 is G04."""
    number, point, decimals = word[1:].partition(".")
    return f"{word[0]}{number.zfill(2)}{point}{decimals}" if number.isdigit() else word
