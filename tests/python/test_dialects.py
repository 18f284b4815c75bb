"""One battery over every dialect of output: read back by readers that share nothing with the package; refusals."""

import math
import re
from collections.abc import Mapping, Set
from itertools import product
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings

import shapegcode as sg
from acceptance import machine_with, moves_of
from command import run
from dialect_readers import (
    ReadMove,
    plan_klipper,
    read_haas,
    read_isg,
    read_klipper,
    read_linuxcnc,
    read_mitsubishi,
    read_siemens,
)
from effort import trials
from judge import residual_um
from judge.generate import programs
from shapegcode import _core
from shapegcode.conversion.translate import translate
from shapegcode.machine.dialects import DialectName, all_dialects
from test_planner_models import MODES, PAPER, READING

PROGRAMS = Path(__file__).parents[1] / "golden" / "programs"
READERS = {
    "haas": read_haas, "mitsubishi": read_mitsubishi, "siemens": read_siemens, "linuxcnc": read_linuxcnc,
    "klipper": read_klipper, "isg": read_isg,
}  # fmt: skip
#: What a shop states of codes that its control does not have, or has in its own way.
WORDS = {
    "klipper": {"M06": "", "M03": "", "M05": "", "M08": "", "M09": "", "G43": "", "G61": ""},
    "isg": {"M06": "M6", "M08": "M8", "M09": "M9"},
}
LEFT_OUT = dict.fromkeys(("G28", "G49", "M00", "M01"), "")
TEXT = """%
O0012(BATTERY)
(MSG, A NOTE)
N1G21G17G90G94G40G80
G54G00X0.Y0.Z100.
N2T5M06
S5000M03
G00Z5.M08
G01Z-.05F100.
G04P600
N10G01X20.F6000.
G03X40.Y20.R20.
G01Y40.
G04X1.5
G91G01X5.Y-.5
G02X2.Y2.I2.J0.
G90G18G03X60.Z-3.R14.
G17G09G01X30.
Y0.F3000.
G00Z100.M09
X0.Y0.
M05
M30
%
"""


def machine_for(dialect: str, keys: Mapping[str, Any] | None = None) -> sg.Machine:
    own = {"emission.dialect": dialect, "emission.words": WORDS.get(dialect, {})} if dialect != "fanuc" else {}
    return machine_with({**READING, **own, **(keys or {})})


def converted(dialect: str, text: str = TEXT, **options: Any) -> sg.Conversion:
    program = sg.Program.from_text(text, machine_with(READING))
    return sg.convert(program, machine_for(dialect, options.pop("keys", None)), shape_all=True, **options)


WITH_INCHES = ["haas", "mitsubishi", "siemens", "linuxcnc"]


def test_every_dialect_has_a_reader() -> None:
    assert {"fanuc", *READERS} == {"fanuc", *all_dialects()} == set(get_args(DialectName))


# ---- read back -------------------------------------------------------------------------------------------------------


def compare(dialect: str, conversion: sg.Conversion, read: list[ReadMove]) -> tuple[int, float]:
    """The program as it was judged beside what the other reader makes of what was written."""
    blocks = [place.blocks(conversion.emitted) for place in conversion.placed]
    in_cuts = {int(line) for path in blocks for line in path.segment_lines}
    return compare_moves(dialect, conversion.emitted, read, in_cuts, conversion.block_period_s)


def compare_moves(
    dialect: str, program: sg.Program, read: list[ReadMove], in_cuts: Set[int] = frozenset(), period_s: float = 1.0
) -> tuple[int, float]:
    """Every move and dwell of a program beside what the other reader makes of it in a dialect.

    Gives the number of moves and the largest distance in mm.
    """
    tick_s = machine_for(dialect).controller.interpolation_period_s
    left, farthest, skipped, moves = iter(read), 0.0, 0, moves_of(program)
    for segment, dwell_s in moves:
        if dwell_s > 0.0:
            assert next(left).dwell_s == pytest.approx(dwell_s, abs=1e-9)
            continue
        axes = ((segment.normal + 1) % 3, (segment.normal + 2) % 3)
        known = next(left)
        is_rapid = segment.kind == _core.SegmentKind.rapid
        while is_fast(known) and not (is_rapid and near(known.end, segment)):
            known, skipped = next(left), skipped + 1  # to the first known position, of which the core has no move
        steps = [known]
        while dialect == "klipper" and segment.kind == _core.SegmentKind.arc and not near(steps[-1].end, segment):
            steps.append(next(left))
        assert near(steps[-1].end, segment), (segment.line_number, steps[-1].end, segment.end_mm)
        for share in (0.25, 0.5, 0.75):
            point = segment.point_at(share * segment.length_mm)
            farthest = max(farthest, min(step.distance(point, axes) for step in steps))
        if segment.kind == _core.SegmentKind.arc and dialect != "klipper":
            assert known.turn == (1 if segment.sweep_rad > 0.0 else -1)
        assert known.rapid == is_rapid or dialect == "klipper"
        if not math.isnan(known.time_s):
            assert segment.line_number in in_cuts
            exact_s = segment.length_mm / segment.feed_mm_per_s
            assert known.time_s == pytest.approx(round(known.time_s / period_s) * period_s, abs=1e-9)
            assert -1e-9 <= known.time_s - exact_s < tick_s
        elif is_rapid:
            assert dialect != "klipper" or known.feed_mm_per_min == pytest.approx(24_000.0)
        else:
            assert dialect != "isg" or segment.line_number not in in_cuts
            for step in steps:
                assert step.feed_mm_per_min == pytest.approx(segment.feed_mm_per_s * 60.0, rel=1e-9, abs=1e-4)
    assert next(left, None) is None
    assert skipped < 4
    return len(moves), farthest


def is_fast(move: ReadMove) -> bool:
    """Whether it is a rapid: in Klipper one is nothing but a move at the rapid's speed."""
    return move.rapid or move.feed_mm_per_min == pytest.approx(24_000.0)


def near(point: Any, segment: _core.Segment) -> bool:
    # Axes that the program never named before stay at the reader's zero.
    return bool(np.abs(point - segment.end_mm).max() < 1e-3)


@pytest.mark.parametrize("dialect", READERS)
def test_what_is_written_reads_back(dialect: str, tmp_path: Path) -> None:
    conversion = converted(dialect)
    assert len(conversion.placed) >= 2
    read = READERS[dialect](conversion.text.decode(), tmp_path)
    count, farthest = compare(dialect, conversion, read)
    assert count > 150
    assert farthest < 1e-3


@pytest.mark.parametrize("dialect", ["haas", "mitsubishi"])
def test_our_own_reader_reads_it(dialect: str) -> None:
    """But for a dwell in seconds, which is an alarm to FANUC and not another time."""
    conversion = converted(dialect)
    text = conversion.text.decode()
    if dialect == "haas":
        with pytest.raises(sg.ProgramError, match="G04 P takes whole milliseconds"):
            sg.Program.from_text(text, machine_with(READING))
        text = re.sub(r"G04P([\d.]+)", r"G04X\1", text)
    read = sg.Program.from_text(text, machine_with(READING))
    assert read.stamp is not None and read.shaped_regions == len(conversion.placed)
    for (ours, dwell_s), (segment, judged_s) in zip(moves_of(read), moves_of(conversion.emitted), strict=True):
        assert dwell_s == pytest.approx(judged_s, abs=1e-12)
        assert np.array_equal(ours.end_mm, segment.end_mm) and ours.feed_mm_per_s == segment.feed_mm_per_s
        assert (ours.kind, ours.sweep_rad) == (segment.kind, segment.sweep_rad)


@pytest.mark.parametrize("dialect", READERS)
def test_shaped_rapids_and_no_header(dialect: str, tmp_path: Path) -> None:
    conversion = converted(dialect, rapids=True, keys={"emission.header": False})
    assert b"SHAPEGCODE" not in conversion.text and b"DIALECT" not in conversion.text
    compare(dialect, conversion, READERS[dialect](conversion.text.decode(), tmp_path))


REAL = ["CONTOUR_R.NC", "G17_18_19.NC", "TEST_G90.NC", "TEST_G91.NC"]
REAL += ["VINT_360arc.NC", "helical_bore.nc", "mixed_ijk_r_planes.nc"]


@pytest.mark.slow
@pytest.mark.parametrize(("dialect", "name"), [*product(READERS, REAL), *product(WITH_INCHES, ["PARALLEL.NC"])])
def test_real_programs_read_back(dialect: str, name: str, tmp_path: Path) -> None:
    text = (PROGRAMS / name).read_text()
    words = {**LEFT_OUT, **({"G43": ""} if dialect in ("klipper", "isg") else {})}
    conversion = converted(dialect, text, keys={"emission.words": {**WORDS.get(dialect, {}), **words}})
    compare(dialect, conversion, READERS[dialect](conversion.text.decode(), tmp_path))


#: mm/s² of the planner; largest residual in X and Y of the shaped program, µm (46 and 131 Hz behind it).
PLANNED = [(10_000.0, 1.5), (50_000.0, 1.5), (5_000.0, 3.0)]


@pytest.mark.parametrize(("acceleration", "limit_um"), PLANNED)
def test_klipper_plans_the_shaped_program(acceleration: float, limit_um: float, tmp_path: Path) -> None:
    machine = machine_for("klipper")
    conversion = converted("klipper", PAPER)
    original = translate(sg.Program.from_text(PAPER, machine), machine).text
    found = []
    for program in (original, conversion.text):
        cut = [each for each in read_klipper(program.decode(), tmp_path) if not is_fast(each) and not each.dwell_s]
        points, time_s = plan_klipper(cut, acceleration, tmp_path)
        found.append((residual_um(points, MODES, 0.001)[:2], time_s))
    (before, _), (after, shaped_s) = found
    assert np.all(after < limit_um) and np.all(after < 0.5 * before)
    assert shaped_s == pytest.approx(conversion.cutting_time_s.emitted, rel=0.01, abs=0.01)


def random_program_reads_back(dialect: str, text: str, folder: Path) -> None:
    # Without a tool's offset, so that every position is known and every move is compared.
    text = re.sub(r"G43 ?H0?1", "", text).replace("G54\n", "G54\nG00 X0. Y0. Z0.\n", 1)
    machine = machine_for(dialect, {"emission.words": {**WORDS.get(dialect, {}), **LEFT_OUT}})
    program = sg.Program.from_text(text, machine)
    read = READERS[dialect](translate(program, machine).text.decode(), folder)
    _, farthest = compare_moves(dialect, program, read)
    assert farthest < 1e-3


RANDOM = given(programs(inch=False, cycles=False))


@pytest.mark.parametrize("dialect", READERS)
@settings(max_examples=15, suppress_health_check=list(HealthCheck))
@RANDOM
def test_random_programs_read_back(dialect: str, tmp_path: Path, text: str) -> None:
    random_program_reads_back(dialect, text, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("dialect", READERS)
@settings(max_examples=trials(185), suppress_health_check=list(HealthCheck))
@RANDOM
def test_many_random_programs_read_back(dialect: str, tmp_path: Path, text: str) -> None:
    random_program_reads_back(dialect, text, tmp_path)


# ---- derived by hand, each from the page named -----------------------------------------------------------------------

UNITS = "G21G90\nG00X1.Y-.5Z5.\nG04P600\nG04X1.5\nG01X2.F500\nG09X3.\nG02X5.Y-2.5R2.\nG64\nG03X3.Y-.5I-2.J0.F50.\nM30\n"
GOLDEN = {
    # G04 P with a point is seconds: https://pastebin.com/prSjxEWB
    "haas": "G21G90/G00X1.Y-.5Z5./G04P0.6/G04P1.5/G01X2.F500./G09X3./G02X5.Y-2.5R2./G64/G03X3.Y-.5I-2.J0.F50./M30",
    # as FANUC (no page was found: assumed, and the program says so)
    "mitsubishi": "G21G90/G00X1.Y-.5Z5./G04P600/G04P1500/G01X2.F500./G09X3./G02X5.Y-2.5R2./G64/"
    "G03X3.Y-.5I-2.J0.F50./M30",
    # G710 counts for F too, G4 F in seconds: easymanua.ls 662598 p. 53; cloud.tencent.com/developer/article/1100156
    "siemens": "G710 G90/G0 X1.Y-0.5Z5./G4 F0.6/G4 F1.5/G1 X2. F500./G9 X3./G2 X5.Y-2.5CR=2./G64/"
    "G3 X3.Y-0.5I-2.J0.F50./M30",
    # G4 P in seconds, G61.1 for stops: linuxcnc.org/docs, gcode/g-code.html
    "linuxcnc": "G21G90/G00X1.Y-.5Z5./G04P0.6/G04P1.5/G01X2.F500./G61.1/X3./G64P0.001Q0/G02X5.Y-2.5R2./G64P0.001Q0/"
    "G03X3.Y-.5I-2.J0.F50./M30",
    # G04 X in seconds, alone: 206132747; G60: 206301707; G71, no G64: 5251491951026763659 of TF5200's manual
    "isg": "G71G90/G00X1.Y-.5Z5./G04 X0.6/G04 X1.5/G01X2.F500./G60X3./G02X5.Y-2.5R2./G359/G03X3.Y-.5I-2.J0.F50./M30",
}


def translated(dialect: str, text: str, keys: Mapping[str, Any] | None = None) -> list[str]:
    machine = machine_for(dialect, {"emission.header": False, **(keys or {})})
    found = translate(sg.Program.from_text(text, machine), machine)
    return found.text.decode().splitlines()[found.lines[1] - 2 :]  # without what stands before the first block


@pytest.mark.parametrize("dialect", GOLDEN)
def test_every_word_with_a_unit(dialect: str) -> None:
    assert "/".join(translated(dialect, UNITS)) == GOLDEN[dialect]


def test_every_word_with_a_unit_in_klipper() -> None:
    # klipper3d.org/G-Codes.html: G4 P in milliseconds, G0 as fast as G1, no arcs without [gcode_arcs].
    lines = translated("klipper", UNITS)
    assert lines[:7] == [
        "G90", "G0 X1. Y-.5 Z5. F24000", "G4 P600", "G4 P1500", "G1 X2. F500.", "G1 X3.", "M400",
    ]  # fmt: skip
    assert all(re.fullmatch(r"G1 X-?[\d.]+ Y-?[\d.]+( F50\.)?", line) for line in lines[7:])


@pytest.mark.parametrize("dialect", sorted({*READERS} - {"siemens", "isg", "klipper"}))
def test_dwell_of_a_cycle(dialect: str) -> None:
    lines = translated(dialect, "G21G90\nG00X0.Y0.Z5.\nG82Z-1.R1.P500F100.\nX5.\nG80\nM30\n")
    assert lines[2] == {"mitsubishi": "G82Z-1.R1.P500F100."}.get(dialect, "G82Z-1.R1.P0.5F100.")


@pytest.mark.parametrize("dialect", READERS)
def test_numbers_without_a_point(dialect: str) -> None:
    keys = {"controller.calculator_decimal_point": False}
    line = translated(dialect, "G21G90\nG00X1000Y-500Z5000\nM30\n", keys)[1]
    assert re.findall(r"[XYZ]-?[\d.]+", line) == ["X1.", "Y-0.5", "Z5."]


@pytest.mark.parametrize("dialect", WITH_INCHES)
def test_inch(dialect: str, tmp_path: Path) -> None:
    conversion = converted(dialect, TEXT.replace("G21", "G20").replace("F6000.", "F200.").replace("F3000.", "F120."))
    assert {"siemens": b"G700", "linuxcnc": b"G64P0.00004Q0"}.get(dialect, b"G20") in conversion.text
    compare(dialect, conversion, READERS[dialect](conversion.text.decode(), tmp_path))


# ---- refused ---------------------------------------------------------------------------------------------------------

REFUSED = [
    ("linuxcnc", "G05.1Q1", "G05.1 is AI contour control on or off on FANUC, and a quadratic spline on LinuxCNC 2.9"),
    ("linuxcnc", "G08P1", "G08 is advanced preview control on or off on FANUC, and radius mode of a lathe"),
    ("linuxcnc", "M88", "M88 is a function of the machine builder on FANUC, and not known on LinuxCNC 2.9"),
    ("linuxcnc", "G10L2P1X0.", "G10 is setting of offsets or parameters on FANUC"),
    ("haas", "G05.1Q1", "G05.1 is AI contour control on or off on FANUC, and not known on Haas"),
    ("haas", "#500=1.", "macro statements and names are not translated"),
    ("siemens", "G91G28Z0.", "homing is G74"),
    ("siemens", "G58", "G58 is work coordinate system 5 on FANUC, and a programmable offset of single axes"),
    ("linuxcnc", "G43Z5.", "G43 without H"),
    ("siemens", "G43H7", "G43 H7 is offset 7 on FANUC and D1 of the tool in the spindle"),
    ("isg", "G08P1", "acceleration at the beginning of the block"),
    ("isg", "G20", "G20 is inch on FANUC, and mirroring off"),
    ("isg", "G53X0.", "G53 is the machine coordinate system in this block on FANUC, and work offsets off"),
    ("klipper", "G28X0.", "G28 is the move to the reference position through the programmed one on FANUC, and homing"),
    ("klipper", "M00", "M00 is a stop on FANUC"),
    ("klipper", "G20", "G20 is inch on FANUC, and refused (inch) on Klipper"),
    ("klipper", "/G00X1.", "/ (block skip) is not known to Klipper"),
    ("mitsubishi", "G04X.0015", "a dwell of 1.5 ms: Mitsubishi M700V/M800 takes whole milliseconds"),
]


@pytest.mark.parametrize(("dialect", "block", "message"), REFUSED)
def test_a_word_that_means_another_thing_is_refused(dialect: str, block: str, message: str, tmp_path: Path) -> None:
    source = tmp_path / "part.nc"
    source.write_text(f"%\nO1\nG21G90G00X0.Y0.Z5.\n{block}\nG01X50.F3000.\nM30\n%\n")
    done = run(tmp_path, "convert", "part.nc", "-m", "vx500", "--dialect", dialect, "-o", "out.nc")
    assert done.returncode == 2 and "part.nc:4:1: " in done.stderr and message in done.stderr
    assert [*tmp_path.iterdir()] == [source]


def test_what_a_shop_states_is_written() -> None:
    keys = {"emission.words": {"M88": "M61", "G28": "SUPA G0 Z0 D0", "G08": ""}}
    lines = translated("siemens", "G21G90\nM88\nG91G28Z0.\nG08P1\nG00X1.\nM30\n".replace("G08P1\n", "G08\n"), keys)
    assert lines[1:] == ["M61", "G91 SUPA G0 Z0 D0", "G0 X1.", "M30"]
    keys = {"emission.words": {"G43": "D5", "M06": "G0 Z200. M6"}}
    assert translated("isg", "G21G90\nT5M06\nG43Z5.H05\nM30\n", keys)[1:] == ["T5G0 Z200. M6", "D5Z5.", "M30"]


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"emission.dialect": "okuma"}, "emission.dialect"),
        ({"emission.words": {"M88": "M61"}}, "has an effect only if emission.dialect is not fanuc"),
        ({"emission.dialect": "haas", "emission.words": {"X": "Y"}}, "is not a G or M code"),
        ({"emission.dialect": "haas", "emission.words": {"M8": "M8", "M08": "M9"}}, "a code is named twice"),
        ({"emission.dialect": "haas", "controller.block_time_s": 0.0005}, "controller.block_time_s = 0.0005"),
        ({"emission.dialect": "linuxcnc", "emission.prologue": ["G05.1Q0"]}, "a quadratic spline on LinuxCNC"),
        ({"emission.dialect": "siemens", "emission.override": "lock"}, "no word that switches the feed override"),
        ({"emission.dialect": "klipper", "emission.override": "lock"}, "no word that switches the feed override"),
    ],
)
def test_settings_that_a_dialect_cannot_have(keys: dict[str, Any], message: str) -> None:
    with pytest.raises(sg.MachineError, match=re.escape(message)):
        machine_with(keys)


def test_no_shaper_on_the_blocks_of_a_slow_control(tmp_path: Path) -> None:
    source = tmp_path / "part.nc"
    source.write_text(TEXT)
    slow = ("--dialect", "siemens", "--set", "controller.block_time_s=0.5")
    done = run(tmp_path, "convert", "part.nc", "-m", "vx500", *slow, "-o", "out.nc")
    assert done.returncode == 2 and "block time of 500 ms" in done.stderr
    assert [*tmp_path.iterdir()] == [source]


def test_a_position_beyond_eight_digits() -> None:
    text = "G21G90\nG00X0.Y0.Z5.\nG01X1200.F6000.\nM30\n"
    with pytest.raises(sg.ProgramError, match=r":3:1: .* it reaches 1200.000 mm.* emission.decimals to 4"):
        converted("linuxcnc", text)
    assert b"X1200." in converted("linuxcnc", text, keys={"emission.decimals": 4}).text


@pytest.mark.parametrize(
    ("dialect", "key", "code"),
    [
        ("klipper", "units", "G20"),
        ("isg", "units", "G20"),
        ("isg", "feed_mode", "G93"),
        ("siemens", "work_offset", "G58"),
    ],
)
def test_a_mode_at_power_on_that_the_control_lacks(dialect: str, key: str, code: str) -> None:
    keys = {f"power_on.{key}": code}
    for first, is_refused in (("G90", True), ("G21G94G54G90", False)):
        machine = machine_for(dialect, keys)
        program = sg.Program.from_text(f"{first}\nG00X1.\nM30\n", machine)
        if is_refused:
            with pytest.raises(sg.ProgramError, match=rf"^<text>:1:1: {code} is "):
                translate(program, machine)
        else:
            assert "X1." in translate(program, machine).text.decode()


def test_several_programs(tmp_path: Path) -> None:
    (tmp_path / "memory.nc").write_text(TEXT)
    done = run(tmp_path, "convert", "memory.nc", "-m", "vx500", "--program", "all", "-o", "out.nc", "--dialect", "haas")
    assert done.returncode == 2 and "--program all writes FANUC's words alone" in done.stderr


OTHERS = [
    ("G21\nG64 P0.01\nG1 X1 F100\nM2\n", 2, "LinuxCNC: G64 P0.01 (tolerance of the path"),
    ("G21\no100 sub\nG1 X1 F100\no100 endsub\nM2\n", 2, "LinuxCNC: O100 SUB (O word of control flow)"),
    ("G21 (A)\n#<depth> = 3\nM2\n", 2, "LinuxCNC: #<DEPTH> (named parameter)"),
    ("; a comment\nG1 X1 F100\nG4 F2.5\nM30\n", 3, "a Sinumerik: G4 F2.5 (dwell in seconds"),
    ("G2 X10 Y0 CR=5 F100\nM30\n", 1, "a Sinumerik: CR= (radius of an arc)"),
]


@pytest.mark.parametrize(("text", "line", "message"), OTHERS)
def test_a_program_for_another_control_is_not_read_as_fanuc(text: str, line: int, message: str) -> None:
    with pytest.raises(sg.ProgramError, match=rf"^<text>:{line}:1: this is a program for {re.escape(message)}"):
        sg.Program.from_text(text, machine_with({"controller.dialect": "fanuc"}))


def test_what_was_written_for_another_control_is_not_read_as_fanuc() -> None:
    for dialect, sign in (("linuxcnc", "G91.1"), ("siemens", "G710")):
        with pytest.raises(sg.ProgramError, match=sign):
            sg.Program.from_text(converted(dialect).text.decode(), machine_with({"controller.dialect": "fanuc"}))


@pytest.mark.parametrize("command", ["expand", "feed", "sweep"])
def test_commands_that_write_fanuc_alone(command: str, tmp_path: Path) -> None:
    (tmp_path / "part.nc").write_text(TEXT)
    words = {"sweep": ["sweep", "-o", "out.nc", "--axis", "x"]}.get(command, [command, "part.nc", "-o", "out.nc"])
    words += ["--tool", "t.toml", "--stock", "s.toml"] * (command == "feed")
    done = run(tmp_path, *words, "-m", "vx500", "--set", "emission.dialect=linuxcnc")
    assert done.returncode == 2 and "writes for FANUC only, and emission.dialect is linuxcnc" in done.stderr


def test_what_stands_behind_the_end_is_left_out() -> None:
    text = TEXT.replace("M30\n%\n", "M30\nG00X5.\n%\nG01X1000.\n")
    for dialect in READERS:
        conversion = converted(dialect, text)
        assert b"X1000" not in conversion.text and b"X5." not in conversion.text.partition(b"M30")[2]
        assert any("after the end of the program are left out" in each for each in conversion.warnings)
    assert not any("behind the end" in each for each in converted("haas").warnings)


def test_exact_stop_in_exact_stop_mode() -> None:
    text = "G21G90\nG00X0.\nG61\nG01X5.F500.\nG09X6.\nG64\nX7.\nM30\n"
    assert translated("linuxcnc", text)[2:] == [
        "G61.1", "G01X5.F500.", "G61.1", "X6.", "G61.1", "G64P0.001Q0", "X7.", "M30",
    ]  # fmt: skip


# ---- budget, restart, override, what is said -------------------------------------------------------------------------


@pytest.mark.parametrize("dialect", READERS)
def test_budget(dialect: str) -> None:
    if dialect == "klipper":
        with pytest.raises(sg.ArgumentError, match="give none"):
            converted(dialect, budget=sg.Budget(max_bytes=9000))
        return
    limit = len(converted(dialect).text) - 600
    try:
        cut = converted(dialect, budget=sg.Budget(max_bytes=limit))
    except sg.ArgumentError as error:  # FANUC's words fit, the dialect's do not
        less = re.search(rf"has (\d+) bytes, the budget is {limit} .* give (\d+),", str(error))
        assert less is not None and int(less[1]) > limit > int(less[2])
        cut = converted(dialect, budget=sg.Budget(max_bytes=int(less[2])))
    assert len(cut.text) == cut.bytes_emitted <= limit
    assert cut.budget is not None and cut.budget.left_unchanged
    if dialect in ("siemens", "isg"):
        with pytest.raises(sg.ArgumentError, match="computed for FANUC's blocks"):
            converted(dialect, budget=sg.Budget(max_blocks_per_second=100.0))
    else:
        assert converted(dialect, budget=sg.Budget(max_blocks_per_second=100.0)).block_period_s >= 0.01


@pytest.mark.parametrize("dialect", READERS)
def test_restart_points(dialect: str, tmp_path: Path) -> None:
    keys = {"emission.restart_interval_s": 0.05, "emission.restart_stops": True}
    conversion = converted(dialect, keys=keys)
    assert conversion.restart_points
    lines = conversion.text.decode().splitlines()
    for point in conversion.restart_points:
        line = lines[point.line - 1]
        assert dialect == "klipper" or line.startswith(f"N{point.number}")
    compare(dialect, conversion, READERS[dialect](conversion.text.decode(), tmp_path))
    restart = next(note.text for note in conversion.at_the_control if note.topic == "restart")
    assert all_dialects()[dialect].facts["restart"].text in restart


@pytest.mark.parametrize("dialect", ["haas", "mitsubishi", "linuxcnc", "isg"])
def test_locked_override(dialect: str, tmp_path: Path) -> None:
    conversion = converted(dialect, keys={"emission.override": "lock"})
    text, cuts = conversion.text.decode(), len(conversion.placed)
    assert "EMISSION" not in text
    if dialect == "isg":
        shaped = sum(len(place.blocks(conversion.emitted)) for place in conversion.placed)
        assert len(re.findall(r"(?m)^(?:N\d+)?G166", text)) == shaped
    else:
        on, off = {"linuxcnc": ("M50P0", "M50P1")}.get(dialect, ("#3004=[#33OR2]", "#3004=#33"))
        assert text.count(on) == text.count(off) == cuts
    if dialect == "linuxcnc":
        compare(dialect, conversion, READERS[dialect](text, tmp_path))


def test_lines_of_the_shop_around_a_cut() -> None:
    keys = {"emission.prologue": ["M101", "G187P1"], "emission.epilogue": ["M102"], "emission.prefill_dwell_s": 0.25}
    lines = converted("haas", keys=keys).text.decode().splitlines()
    at = lines.index("M101")
    assert lines[at - 1 : at + 2] == ["(SHAPED)", "M101", "G187P1"] and "G04P0.25" in lines[at + 3 : at + 4]
    assert lines.count("M102") == sum("M101" in line for line in lines)


@pytest.mark.parametrize("dialect", READERS)
def test_what_is_assumed_is_said(dialect: str) -> None:
    conversion, row = converted(dialect), all_dialects()[dialect]
    assert conversion.dialect is not None and conversion.dialect.assumed == row.assumed
    assert {"words", "dwell", "feed", "decimals", "shortest block", "look-ahead", "override", "restart"} <= {*row.facts}
    report = conversion.to_dict()["dialect"]
    assert report["name"] == dialect and report["facts"]["look-ahead"] == row.facts["look-ahead"].text
    header = conversion.text.decode().partition("SHAPED)")[0].replace("-", " ")
    for topic in row.assumed:
        assert topic.upper().replace("-", " ") in header and topic in conversion.answer
    assert next(note.text for note in conversion.at_the_control if note.topic == "look-ahead").endswith(
        row.facts["look-ahead"].text
    )


def test_fanuc_stays_as_it_is() -> None:
    conversion = sg.convert(TEXT, machine_with(READING), shape_all=True)
    assert conversion.dialect is None and "dialect" not in conversion.to_dict()
    assert conversion.text == conversion.emitted.text


def test_option_of_the_function_and_the_line_of_a_caution() -> None:
    text = TEXT.replace("M05\n", "G91G28Z0.\nG90\nM05\n")
    conversion = sg.convert(text, machine_with(READING), dialect="linuxcnc", shape_all=True)
    assert conversion.dialect is not None and conversion.dialect.control == "LinuxCNC 2.9"
    assert any("G54: there is one" in each for each in converted("klipper").warnings)
    assert not any("G54" in each for each in converted("klipper", TEXT.replace("G54", "")).warnings)
    line = text.splitlines().index("G91G28Z0.") + 1
    assert f"<text>:{line}: G28: it goes to the position that G28.1 stored" in " ".join(conversion.warnings)


def test_a_comment_that_would_act_on_linuxcnc() -> None:
    assert b"(NOTE MSG, A NOTE)" in converted("linuxcnc").text
    assert b"(MSG, A NOTE)" in converted("haas").text


def test_cuts_left_unchanged_keep_the_path_tolerance_of_a_linuxcnc_program(tmp_path: Path) -> None:
    """G64 P0.2 around them; a shaped cut has P0.001 Q0 of its own, and gives the program's back."""
    program = (
        "G21 G90 G17 G64 P0.2\nG0 X0 Y0 Z5\nG1 Z0 F6000\nX50\nY50\nX0\nG0 Z5\n"
        "X100\nG1 Z0 F100\nX101 F20\nX102\nG0 Z5\nM2\n"
    )
    (tmp_path / "part.ngc").write_text(program)
    machine = sg.Machine.load("vx500").with_values(
        {"controller.kind": "linuxcnc", "emission.dialect": "linuxcnc", "price.cut_time_percent": 300.0}
    )
    for leave, expected in (((), ["P0.2", "P0.001Q0", "P0.001Q0", "P0.2"]), (((1, 13),), ["P0.2"])):
        conversion = sg.convert(tmp_path / "part.ngc", machine, leave=leave, max_time_increase_percent=300.0)
        assert conversion.nothing_shaped == bool(leave)
        assert re.findall(r"G64(P[\d.]+(?:Q[\d.]+)?)", conversion.text.decode()) == expected
