"""SINUMERIK programs read: beside an independent interpreter, against pages of manuals, and what is refused."""

import math
import os
import re
import tomllib
from importlib import resources
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dialect_readers
import shapegcode as sg
from acceptance import machine_with, moves_of
from dialect_readers import ReadMove
from shapegcode import _core
from shapegcode.conversion.translate import translate
from shapegcode.program.foreign.read import ForeignProgram
from shapegcode.program.foreign.siemens import read_siemens
from siemens_programs import random_siemens

PROGRAMS = Path(__file__).parents[1] / "golden" / "programs"
KEYS = {"input.tool_change_unknown_axes": ""}
START = "G17 G90 G94 G71\nG0 X0 Y0 Z0\nG1 F1000\n"


def read(text: str, keys: dict[str, Any] | None = None, folder: Path | None = None) -> ForeignProgram:
    return read_siemens(text, file="part.mpf", machine=machine_with({**KEYS, **(keys or {})}), folder=folder)


def plain(text: str, keys: dict[str, Any] | None = None, folder: Path | None = None) -> list[str]:
    """Lines of the plain program, without head, end and blank lines (which keep the numbers of lines)."""
    lines = [line for line in read(text, keys, folder).text.splitlines() if line]
    assert lines[0] == lines[-1] == "%" and lines[1].startswith("O0001") and lines[2] == "G21G17G90G94G40"
    assert lines[-2] in ("M30", "M02")
    return lines[3:-2]


def program_of(text: str, keys: dict[str, Any] | None = None) -> sg.Program:
    return sg.Program.from_text(read(text, keys).text, machine_with({**KEYS, **(keys or {})}))


def words(line: str) -> list[tuple[str, float]]:
    return [(letter, float(value)) for letter, value in re.findall(r"([A-Z])(-?[\d.]+)", line)]


def same(found: list[str], expected: str) -> None:
    """Lines with the same words, figures within 0.1 um, centres within 0.5 um."""
    wanted = expected.split("/")
    assert len(found) == len(wanted), found
    for line, known in zip(found, wanted, strict=True):
        assert [letter for letter, _ in words(line)] == [letter for letter, _ in words(known)], (line, known)
        for (letter, value), (_, figure) in zip(words(line), words(known), strict=True):
            assert value == pytest.approx(figure, abs=5e-4 if letter in "IJK" else 1e-4), (line, known)


# ---- beside an independent interpreter -------------------------------------------------------------------------------


def compare(text: str, read_moves: list[ReadMove], program: sg.Program) -> float:
    """Largest distance of the paths in mm; ends, feeds, dwells and senses of arcs are asserted."""
    ours, farthest = iter(moves_of(program)), 0.0
    for move in read_moves:
        if move.dwell_s > 0.0:
            assert next(ours)[1] == pytest.approx(move.dwell_s, abs=1e-6)  # the interpreter has single precision
            continue
        if np.linalg.norm(move.end - move.start) < 1e-9 and move.centre is None:
            continue
        for _ in range(3):  # a large arc may be two or three
            segment, dwell_s = next(ours)
            assert dwell_s == 0.0
            assert (segment.kind == _core.SegmentKind.rapid) == move.rapid
            if not move.rapid:
                assert segment.feed_mm_per_s * 60.0 == pytest.approx(move.feed_mm_per_min, rel=1e-6)
            if segment.kind == _core.SegmentKind.arc:
                assert move.centre is not None and (segment.sweep_rad > 0.0) == (move.turn > 0)
            axes = ((segment.normal + 1) % 3, (segment.normal + 2) % 3)
            for share in (0.25, 0.5, 0.75):
                farthest = max(farthest, move.distance(segment.point_at(share * segment.length_mm), axes))
            if np.abs(segment.end_mm - move.end).max() < 1e-3:
                break
        else:
            raise AssertionError((text, segment.line_number, segment.end_mm, move))
    assert next(ours, None) is None
    return farthest


@pytest.mark.parametrize(
    "seeds", [range(20), pytest.param(range(20, 200), marks=pytest.mark.slow)], ids=["few", "many"]
)
def test_random_programs_beside_another_interpreter(seeds: range) -> None:
    for seed in seeds:
        text = random_siemens(seed)
        assert compare(text, dialect_readers.read_siemens(text), program_of(text)) < 1e-3, seed


ROUND_TRIP = ["CONTOUR_R.NC", "G17_18_19.NC", "TEST_G90.NC"]
ROUND_TRIP += ["VINT_360arc.NC", "helical_bore.nc", "mixed_ijk_r_planes.nc"]


def for_siemens(name: str) -> tuple[sg.Program, str]:
    """A program, and what it becomes in Siemens' words."""
    words = {"G28": "", "G49": "", "M01": ""}
    machine = machine_with({**KEYS, "emission.dialect": "siemens", "emission.words": words, "emission.header": False})
    program = sg.Program.from_text((PROGRAMS / name).read_text(), machine)
    return program, translate(program, machine).text.decode()


@pytest.mark.parametrize("name", ROUND_TRIP)
def test_what_convert_writes_for_siemens_is_read_back(name: str) -> None:
    program, text = for_siemens(name)
    again = iter(known_moves(program_of(text)))
    for one, dwell_s in known_moves(program):
        other, read_s = next(again)
        sweep = other.sweep_rad
        while abs(sweep) < abs(one.sweep_rad) - 0.1:  # a whole circle is two arcs
            other, read_s = next(again)
            sweep += other.sweep_rad
        assert dwell_s == pytest.approx(read_s, abs=1e-9)
        assert np.abs(one.end_mm - other.end_mm).max() < 1e-3
        assert one.kind == other.kind and one.sweep_rad == pytest.approx(sweep, abs=1e-3)
        assert one.feed_mm_per_s == pytest.approx(other.feed_mm_per_s, rel=1e-6, abs=1e-6)
    assert next(again, None) is None


def test_a_step_behind_a_tool_length_is_refused() -> None:
    """Whether the control adds the length to it is a setting: SD42442."""
    with pytest.raises(sg.ProgramError, match="Z incrementally after a change of its offset"):
        read(for_siemens("TEST_G91.NC")[1])


def known_moves(program: sg.Program) -> list[tuple[Any, float]]:
    """Without rapids: of G28, which is left out, one reader knows that the position is not known, the other not."""
    return [(segment, dwell) for segment, dwell in moves_of(program) if segment.kind != _core.SegmentKind.rapid]


# ---- derived by hand, each from the page named -----------------------------------------------------------------------

#: Program behind START, plain lines behind it, page (easymanua.ls manual and page where nothing else is said).
GOLDEN = {
    # Poles: (20, 10), then 10 less and 20 more than the position, then 40 and 20 from that pole.
    "polar (manualshive 374971 p. 55)": (
        "G111 X20 Y10\nG1 RP=50 AP=30\nG110 X-10 Y20\nG1 RP=30 AP=45\nG112 X40 Y20\nG1 RP=30 AP=135",
        "G01X63.301Y35.F1000./G01X74.514Y76.213/G01X72.088Y96.213",
    ),
    "the pole as centre (592300 p. 156)": (
        "G0 X30 Y40\nG111 X40 Y33\nG2 RP=12.207 AP=21",
        "G00X30.Y40./G02X51.396Y37.375I10.J-7.F1000.",
    ),
    "centre and end (592300 p. 154)": ("G0 X30 Y40\nG2 X50 Y40 I10 J-7", "G00X30.Y40./G02X50.Y40.I10.J-7.F1000."),
    "radius (592300 p. 154)": ("G0 X30 Y40\nG2 X50 Y40 CR=12.207", "G00X30.Y40./G02X50.Y40.I10.J-7.00077F1000."),
    "radius, more than half a turn (1265481 p. 192)": (
        "G0 X30 Y40\nG2 X50 Y40 CR=-12.207",  # above the chord; more than 270 degrees would be two arcs, these are 250
        "G00X30.Y40./G02X50.Y40.I10.J7.00077F1000.",
    ),
    # Through (40, 45): the centre (40, y) has 45 - y = sqrt(100 + (40 - y)^2), y = 32.5.
    "three points (592300 p. 157)": (
        "G0 X30 Y40\nCIP X50 Y40 I1=40 J1=45",
        "G00X30.Y40./G02X50.Y40.I10.J-7.5F1000.",
    ),
    "three points in G91, both from the start (592300 p. 157)": (
        "G0 X30 Y40\nG91\nCIP X20 Y0 I1=10 J1=5",
        "G00X30.Y40./G02X50.Y40.I10.J-7.5F1000.",
    ),
    "tangent (592300 p. 157)": ("G1 X20\nCT X30 Y10", "G01X20.F1000./G03X30.Y10.I0.J10."),
    "tangent to an arc (1265481 p. 201)": (
        "G3 X10 Y10 I0 J10\nCT X20 Y20",  # upwards at (10, 10), so about (20, 10), clockwise
        "G03X10.Y10.I0.J10.F1000./G02X20.Y20.I10.J0.",
    ),
    "opening angle and end (662598 p. 78)": ("G3 X10 Y10 AR=90", "G03X10.Y10.I0.J10.F1000."),
    "opening angle of 270 degrees": ("G2 X10 Y10 AR=270", "G02X10.Y10.I0.J10.F1000."),
    "opening angle and centre (662598 p. 78)": ("G3 I0 J10 AR=90", "G03X10.Y10.I0.J10.F1000."),
    # Half a turn and three more: seven halves, 17 mm down in all.
    "helix (662598 p. 78)": (
        "G0 Z50\nG1 X0 Y50\nG3 X0 Y0 Z33 I0 J-25 TURN= 3",
        "G00Z50./G01X0.Y50.F1000./G03X0.Y0.Z47.571I0.J-25./G03X0.Y50.Z45.143I0.J25./G03X0.Y0.Z42.714I0.J-25./"
        "G03X0.Y50.Z40.286I0.J25./G03X0.Y0.Z37.857I0.J-25./G03X0.Y50.Z35.429I0.J25./G03X0.Y0.Z33.I0.J-25.",
    ),
    "AC and IC (662598 p. 53)": ("G1 X10\nX=IC(5) Y=AC(7)\nG91\nX5 Y=AC(1)", "G01X10.F1000./G01X15.Y7./G01X20.Y1."),
    "centre by AC (662598 p. 53)": (
        "G0 X30 Y40\nG2 X50 Y40 I=AC(40) J=AC(33)",
        "G00X30.Y40./G02X50.Y40.I10.J-7.F1000.",
    ),
    "inch, F as it is (592300 p. 139)": ("G70 X10 Y30\nG71 X19 Y17.3", "G01X254.Y762.F1000./G01X19.Y17.3"),
    "inch, F too (592300 p. 139)": (
        "G700 X1 F10\nG2 X2 Y0 I.5 J0\nG3 X3 CR=.5\nG1 G710 X5 F10",
        "G01X25.4F254./G02X50.8Y0.I12.7J0./G03X76.2Y0.I12.7J0./G01X5.F10.",
    ),
    "G91 counts inches too": ("G70 G91 X1\nG71 X1", "G01X25.4F1000./G01X26.4"),
    "TRANS takes the place of all, ATRANS adds (662598 p. 56)": (
        "TRANS X10 Y5\nX1 Y1\nATRANS X1\nX1\nTRANS Z2\nX1 Y1 Z1\nTRANS\nX1 Z0",
        "G01X11.Y6.F1000./G01X12./G01X1.Y1.Z3./G01X1.Z0.",
    ),
    "ROT, and ATRANS in what it turned (662598 p. 56)": (
        "ROT RPL=30\nX10 Y0\nATRANS X5\nX10\nROT Z90\nX10 Y0",
        "G01X8.66Y5.F1000./G01X12.99Y7.5/G01X0.Y10.",
    ),
    "MIRROR turns arcs (1265481 p. 309)": ("MIRROR X0\nX-10\nG2 X-20 Y10 I0 J10", "G01X10.F1000./G03X20.Y10.I0.J10."),
    "SCALE (1265481 p. 309)": ("SCALE X2 Y2\nX10\nG3 X20 Y10 I0 J10", "G01X20.F1000./G03X40.Y20.I0.J20."),
    "an arc in a turned frame": ("ROT RPL=90\nG3 X10 Y10 I0 J10", "G03X-10.Y10.I-10.J0.F1000."),
    "dwell in seconds and in turns (cloud.tencent.com 1100156)": (
        "G4 F0.5\nS600 M3\nG4 S5\nG1 X1",
        "G04X0.5/S600/M03/G04X0.5/G01X1.F1000.",
    ),
    "feed per turn": ("S1000 M3\nG95 F0.1 X5\nG94 F50 X6", "S1000/M03/G95/G01X5.F0.1/G94/G01X6.F50."),
    "inverse time: F times the length": (
        "G93 X30 F2\nX30 Y40 F0.5\nG94 F100 X0",
        "G01X30.F60./G01X30.Y40.F20./G01X0.F100.",
    ),
    "leading zeros, no point, no blanks": ("G01X10Y-.5\nG03X20Y-.5CR=5", "G01X10.Y-0.5F1000./G03X20.Y-0.5I5.J0."),
    "G18 and G19": (
        "G18\nG3 X10 Z10 I0 K10\nG19\nG2 Y5 Z15 J5 K0",
        "G18/G03X10.Z10.I0.K10.F1000./G19/G02Y5.Z15.J5.K0.",
    ),
    "exact stops and smoothing": ("G60\nX1\nG642\nG9 X2\nX3", "G61/G01X1.F1000./G64/G09G01X2./G01X3."),
    "machine coordinates (679150 p. 100)": ("G0 SUPA Z0 D0\nG0 X1 Z5", "G49/G53G00Z0./G00X1.Z5."),
    "settable frames": ("G54\nG505\nG500\nG54", "G54/G54.1P5/G54.1P300/G54"),
    "tool and edge (i5cnc.com 126)": (
        'T5 M6\nG0 Z9\nT="MILL" D2\nM6\nG0 Z9\nD0\nG0 Z9',
        "T5/M06/G43H5/G00Z9./T901/M06/G43H801/G00Z9./G49/G00Z9.",
    ),
    "fixed points": ("G75 Z1=0\nG0 Z5", "G91/G30Z0./G90/G00Z5."),
    "M functions before and behind the motion": ("M8 X5 M5\nM1=4", "M08/G01X5.F1000./M05/M04"),
}  # fmt: skip


@pytest.mark.parametrize("name", GOLDEN)
def test_derived_from_manuals(name: str) -> None:
    text, expected = GOLDEN[name]
    same(plain(START + text + "\nM30")[1:], expected)


def test_words_that_change_no_path() -> None:
    text = (
        "G601 G450 KONT\nSOFT\nFFWON\nCOMPCAD\nRTLION\nCYCLE832(0.01,3,1)\nMSG(\"A ; B\")\nSTOPRE\nDIAMOF\nG40\n"
        "ADIS=0.1 CTOL=0.01\nG26 S4000\nX1\nSPOS=0\n"
    )  # fmt: skip
    assert plain(START + text + "M30")[1:] == ["G01X1.F1000.", "M19"]
    program = read(START + text + "M30")
    told = " ".join(text for _, text in program.notes)
    for word in ("CYCLE832", "COMPCAD", "RTLION", "SOFT", "G601", "FFWON", "CTOL", "G26", "SPOS"):
        assert word in told


#: Corners of 90 degrees at (10, 0): FANUC's reader works out its own words.
CORNERS = {
    "RND=2": [(8.0, 0.0), (10.0, 2.0)],
    "CHR=2": [(8.0, 0.0), (10.0, 2.0)],  # width along the blocks
    "CHF=2": [(10.0 - math.sqrt(2.0), 0.0), (10.0, math.sqrt(2.0))],  # length of the chamfer: 2 cos 45 times the width
    "RNDM=2": [(8.0, 0.0), (10.0, 2.0)],
}


@pytest.mark.parametrize("word", CORNERS)
@pytest.mark.parametrize("unit", ["G71", "G70"])
def test_corners(word: str, unit: str) -> None:
    """easymanua.ls 679150 pp. 193, 194; lengths in inch with G70."""
    scale = 25.4 if unit == "G70" else 1.0
    program = program_of(f"{START}{unit}\nX10 {word}\nY10 RNDM=0\nX0\nM30")
    ends = [segment.end_mm[:2] / scale for segment, _ in moves_of(program)][:2]
    assert np.allclose(ends, CORNERS[word], atol=1e-3)
    kinds = [segment.kind for segment, _ in moves_of(program)]
    assert (kinds[1] == _core.SegmentKind.arc) == word.startswith("RND") and len(kinds) == 4


def test_corner_between_line_and_arc_and_none_where_it_goes_on() -> None:
    program = program_of(f"{START}RNDM=1\nX5\nX10\nG3 X20 Y10 CR=10\nG1 X30\nRNDM=0 Y20\nM30")
    path = [segment for segment, _ in moves_of(program)]
    assert len(path) == 7  # tangents at (5, 0), (10, 0): none; corners at (20, 10) and (30, 10)
    for one, other in pairwise(path):
        ahead = one.end_mm - one.point_at(one.length_mm - 1e-4), other.point_at(1e-4) - other.start_mm
        assert np.abs(ahead[0] - ahead[1]).max() < 2e-6


# ---- expressions and control flow ------------------------------------------------------------------------------------

#: Priorities: easymanua.ls 1265481 p. 444; conversions: 662833 p. 54; the rest: nc-gcode-interpreter 0.2, which cites
#: the manual's section 4.1.3.
EXPRESSIONS = {
    "2+3*4": 14.0, "10-3-2": 5.0, "-2*-3": 6.0, "(2+3)*4": 20.0, "7/2": 3.5, "7 DIV 2": 3.0, "7 DIV 4.1": 1.0,
    "7 MOD 4": 3.0, "2*7 MOD 4": 2.0, "SIN(30)": 0.5, "COS(60)": 0.5, "TAN(45)": 1.0, "ASIN(0.5)": 30.0,
    "ACOS(0.5)": 60.0, "ATAN2(30.5,80.1)": 20.8455, "SQRT(2)": 1.414214, "POT(3)": 9.0, "ABS(-2.5)": 2.5,
    "TRUNC(2.9)": 2.0, "ROUND(2.5)": 3.0, "ROUND(-2.4)": -2.0, "ROUNDUP(3.1)": 4.0, "LN(EXP(2))": 2.0,
    "MINVAL(3,-2)": -2.0, "MAXVAL(3,-2)": 3.0, "BOUND(-5,5,7.2)": 5.0, "1.5EX1": 15.0, ".5": 0.5, "'H1F'": 31.0,
    "'B101'": 5.0, "1 B_OR 6 B_AND 4": 5.0, "1 OR 0 AND 0": 1.0, "NOT 5": 0.0, "1+NOT 0": 2.0, "6 B_XOR 3": 5.0,
    "(3>2)+(2<>2)": 1.0, "$PI": 3.141593, "TRUE+TRUE": 2.0,
}  # fmt: skip


@pytest.mark.parametrize("text", EXPRESSIONS)
def test_expressions(text: str) -> None:
    line = plain(f"{START}X={text}\nM30")[-1]
    assert dict(words(line))["X"] == pytest.approx(EXPRESSIONS[text], abs=5e-4)


def test_random_expressions_follow_the_priorities() -> None:
    """A tree is worked out and written with as few brackets as the table of priorities allows."""
    rng = np.random.default_rng(5)
    levels = {"*": 2, "/": 2, "+": 3, "-": 3}

    def tree(depth: int) -> tuple[float, str, int]:
        if depth == 0 or rng.random() < 0.2:
            value = round(float(rng.uniform(0.5, 9.0)), 2)
            return value, f"{value}", 0
        operator = str(rng.choice(list(levels)))
        (a, left, one), (b, right, two) = tree(depth - 1), tree(depth - 1)
        if operator == "/" and abs(b) < 0.1:
            return a, left, one
        level = levels[operator]
        left = f"({left})" if one > level else left
        right = f"({right})" if two >= level else right  # from left to right
        return (
            {"*": a * b, "/": a / b if b else 0.0, "+": a + b, "-": a - b}[operator],
            f"{left}{operator}{right}",
            level,
        )

    for _ in range(300):
        value, text, _ = tree(4)
        if abs(value) < 9999.0:
            line = plain(f"{START}X={text}\nM30")[-1]
            assert dict(words(line))["X"] == pytest.approx(value, abs=6e-4), text


FLOWS = {
    "conversions (662833 p. 54)": ("DEF INT N=2.5\nDEF BOOL B=7\nDEF REAL R=N/2\nX=N Y=R Z=B", [(3, 1.5, 1)]),
    "relative comparison (1572233 p. 37)": (
        "R1=61.01 R2=61.02 R3=0.01\nIF ABS(R2-R1) > R3 GOTOF ERROR\nX1\nM30\nERROR: X9",
        [(1,)],
    ),
    "loop by a jump backwards (nc-gcode-interpreter, manual 4.1.5.2)": (
        "N40 R1=30 R2=10 R4=3\nN41 LA1: X=R1\nN42 R1=R1+R2 R4=R4-1\nN43 IF R4>0 GOTOB LA1",
        [(30,), (40,), (50,)],
    ),
    "to a block number, several jumps in a block": (
        "N10 GOTOF 40\nN20 X99\nN40 X4\nR1=2\nIF R1==1 GOTOF ONE IF R1==2 GOTOF TWO\nONE: X1\nTWO: X2",
        [(4,), (2,)],
    ),
    "GOTOC to nowhere, GOTO backwards": ("GOTOC NOWHERE\nR1=0\nBACK: R1=R1+1\nIF R1<3 GOTO BACK\nX=R1", [(3,)]),
    "CASE": (
        "DEF INT V=7\nCASE(V) OF 7 GOTOF L7 9 GOTOF L9 DEFAULT GOTOF L0\nL9: X9\nL7: X7\nGOTOF OUT\nL0: X0\nOUT: Y1",
        [(7,), (1,)],
    ),
    "IF, ELSE, nested": (
        "R1=1\nIF R1==1\nIF R1>5\nX1\nELSE\nX2\nENDIF\nELSE\nX3\nENDIF\nIF NOT (R1==1)\nX4\nENDIF",
        [(2,)],
    ),
    "FOR, not entered, WHILE, REPEAT, LOOP": (
        "DEF INT N\nFOR N=1 TO 3\nX=N\nENDFOR\nFOR N=3 TO 1\nX99\nENDFOR\nR1=0\nWHILE R1<2\nR1=R1+1\nY=R1\nENDWHILE\n"
        "REPEAT\nR1=R1+1\nZ=R1\nUNTIL R1>=4\nLOOP\nR1=R1+1\nIF R1>5 GOTOF OUT\nX=R1\nENDLOOP\nOUT: Y0",
        [(1,), (2,), (3,), (1,), (2,), (3,), (4,), (5,), (0,)],
    ),
    "arrays, R by index": ("DEF REAL A[3]\nA[1]=4\nR[2]=5\nX=A[1] Y=R2 Z=A[0]", [(4, 5, 0)]),
    "REPEAT of a part (assumed)": ("AGAIN: G91 X1\nG90\nREPEAT AGAIN P=2\nY1", [(1,), (2,), (3,), (1,)]),
    "lower case": ("def real Len=2\nx=len\nif len>1 gotof Out\nx9\nout: y1", [(2,), (1,)]),
}


@pytest.mark.parametrize("name", FLOWS)
def test_control_flow(name: str) -> None:
    text, expected = FLOWS[name]
    found = [
        tuple(value for letter, value in words(line) if letter in "XYZ") for line in plain(START + text + "\nM30")[1:]
    ]
    assert found == expected


def test_subprograms(tmp_path: Path) -> None:
    """easymanua.ls 1265481 pp. 491 to 494: values, what is left out, VAR, SAVE, P, several in one file, end by RET."""
    (tmp_path / "RECT.SPF").write_text(
        "PROC RECT(REAL W, REAL H, VAR REAL AREA) SAVE DISPLOF\nG91\nX=W\nY=H\nAREA=W*H\nRET\n"
    )
    (tmp_path / "l10.spf").write_text("G91 X1\nG90\nM17\n")
    text = f"{START}DEF REAL A\nRECT(4,,A)\nX=A\nRECT(2,3,A)\nX=A\nL10 P3\nOWN\nX0\nM30\n%_N_OWN_SPF\nY7\nRET\n"
    program = read("%_N_MAIN_MPF\n" + text, folder=tmp_path)
    cut = [line for line in program.text.splitlines() if line.startswith("G01")]
    same(cut, "G01X4.F1000./G01Y0./G01X0./G01X2./G01Y3./G01X6./G01X7./G01X8./G01X9./G01Y7./G01X0.")
    lines = dict(zip(program.text.splitlines(), zip(program.lines, program.line_files, strict=True), strict=True))
    assert [Path(name).name for name in program.files] == ["RECT.SPF", "l10.spf"]
    assert lines["G01Y3."] == (4, 1) and lines["G01X7."] == (1, 2) and lines["G01Y7."] == (15, 0)


def test_a_subprogram_is_read_as_far_as_a_program_may_be_long_and_only_from_a_file(tmp_path: Path) -> None:
    (tmp_path / "LONG.SPF").write_text("G1 X1\n" * 1000)
    with pytest.raises(OSError, match=r"more than 500 bytes"):
        read(START + "LONG\nM30\n", {"controller.max_program_bytes": 500}, tmp_path)
    os.mkfifo(tmp_path / "PIPE.SPF")  # nobody writes to it: it is refused and not waited for
    with pytest.raises(OSError, match=r"a pipe, not a regular file"):
        read(START + "PIPE\nM30\n", None, tmp_path)


def test_lines_lead_back_to_the_source() -> None:
    source = f"%_N_A_MPF\n;$PATH=/_N_MPF_DIR\n{START}N10 X1 ; FIRST\nG3 X1 Y0 I5 J0\nM30\n"
    program = read(source)
    where = dict(zip(program.text.splitlines(), program.lines, strict=True))
    assert where["G00X0.Y0.Z0."] == 4 and where["G01X1.F1000."] == where["(FIRST)"] == 6
    assert len(program.lines) == program.text.count("\n") and where["M30"] == 8


# ---- what is refused -------------------------------------------------------------------------------------------------

#: Program behind START, the line, parts of the message.
BAD = {
    "X=1/0": (4, ["division by 0"]),
    "X=R7": (4, ["R7 is read before"]),
    "X=WIDTH": (4, ["WIDTH", "DEF"]),
    "X=$AA_IM[X]": (4, ["$AA_IM", "in the control"]),
    "X=SQRT(-1)": (4, ["SQRT(-1)"]),
    "X=SQRT(1,2)": (4, ["SQRT takes 1 value"]),
    "X=(1+2": (4, ["closing bracket"]),
    "X=": (4, ["a number, a variable"]),
    "X 10": (4, ["X without a value"]),
    "Y2O": (4, ["O"]),
    "X=5 MOD 0": (4, ["MOD"]),
    "WIDTH=5": (4, ["WIDTH=", "DEF"]),
    "DEF CHAR C": (4, ["CHAR", "REAL, INT, BOOL or STRING"]),
    "DEF REAL A[2]\nA[2]=1": (5, ["A[2]", "0 to 1"]),
    "CYCLE81(10,0,2,-5)": (4, ["CYCLE81", "cycles"]),
    "MCALL CYCLE81(10,0,2)": (4, ["MCALL"]),
    "HOLES1(0,0,0,10,10,5)": (4, ["HOLES1"]),
    "POCKET3(1,2)": (4, ["POCKET3"]),
    "CYCLE62(\"A\",1,,)": (4, ["CYCLE62"]),
    "ID=1 WHENEVER $AA_IW[X]>5 DO M7": (4, ["ID", "synchronous"]),
    "STOPFIFO": (4, ["STOPFIFO"]),
    "G41 X5": (4, ["G41", "outer corners"]),
    "BSPLINE": (4, ["BSPLINE"]),
    "F=FPO(1,2,3)": (4, ["FPO"]),
    "G33 Z-5 K1": (4, ["G33", "threads"]),
    "G96 S200": (4, ["G96", "turning"]),
    "DIAMON": (4, ["DIAMON"]),
    "G291": (4, ["G291", "ISO"]),
    "TRAORI": (4, ["TRAORI"]),
    "G58 X5": (4, ["G58", "TRANS"]),
    "G999": (4, ["G999"]),
    "NOWHERE": (4, ["NOWHERE", "NOWHERE.SPF"]),
    "GOTOF NOWHERE": (4, ["GOTOF NOWHERE", "after"]),
    "BEHIND: X1\nGOTOF BEHIND": (5, ["GOTOF BEHIND"]),
    "R1=0\nGOTOF INSIDE\nIF R1==0\nINSIDE: X1\nENDIF": (5, ["INSIDE"]),
    "IF R1==1\nX1": (4, ["IF is never closed", "ENDIF"]),
    "X1\nENDWHILE": (5, ["ENDWHILE without WHILE"]),
    "AGAIN: X1\nGOTOB AGAIN": (4, ["max_"]),
    "REPEATB AGAIN P=2": (4, ["REPEATB"]),
    "G2 X10 Y0 I3 J0": (4, ["start radius 3.000", "end radius 7.000"]),
    "G2 X10 Y0 CR=3": (4, ["CR=3", "5.000"]),
    "G2 X10 Y0 R5": (4, ["R alone", "R1=", "CR="]),
    "G2 X10 Y0": (4, ["G2", "I, J, K, CR= or AR="]),
    "G2 X10 Y0 I5 K1": (4, ["K", "plane G17"]),
    "G2 X0 Y0 CR=5": (4, ["CR=", "whole circle"]),
    "G2 X10 Y0 AR=400": (4, ["AR=400", "360"]),
    "CIP X10 Y0 I1=5 J1=0": (4, ["line"]),
    "CIP X10 Y5 Z3 I1=5 J1=5 K1=9": (4, ["oblique"]),
    "X10 I5": (4, ["I", "G2 or G3"]),
    "X10 CR=5": (4, ["CR=", "G2 or G3"]),
    "SCALE X2\nG2 X10 Y0 I5 J0": (5, ["G17", "ellipse"]),
    "ROT X30\nG2 X10 Y0 I5 J0": (5, ["tilts"]),
    "TRANS X5\nG91 X1": (5, ["X incrementally", "SD42440"]),
    "TRANS X5 F100": (4, ["F", "TRANS"]),
    "AP=30 RP=-1": (4, ["RP=-1"]),
    "AP=30": (4, ["AP= and RP="]),
    "F0 X5": (4, ["F0"]),
    "G93 F2 X5\nX6": (5, ["G93 without F"]),
    "G4": (4, ["G4", "F or S"]),
    "G4 X5": (4, ["X", "F in seconds"]),
    "G4 S5": (4, ["S"]),
    "G53 G1 X5": (4, ["G53", "G0"]),
    "A90 X5": (4, ["A", "rotary"]),
    "S2=1000": (4, ["S2", "spindle 2"]),
    "H5": (4, ["H", "PLC"]),
    "X5 RND=1\nG0 X9": (5, ["RND=1 in line 4", "feed"]),
    "G90 G91 X5": (4, ["G90 and G91"]),
    "/X5": (4, ["/", "input.block_skip"]),
    "G18 D1": (4, ["D1", "G17"]),
    "X5 FRC=100": (4, ["FRC"]),
    "D99": (4, ["D99"]),
    "X=IC(\"A\")": (4, ["number"]),
}  # fmt: skip


@pytest.mark.parametrize("text", BAD)
def test_refused(text: str) -> None:
    line, parts = BAD[text]
    with pytest.raises(sg.ProgramError) as error:
        read(START + text + "\nM30\n", {"controller.max_program_steps": 1000})
    message = str(error.value)
    assert re.match(rf"part\.mpf:{line}:\d+: ", message), message
    assert all(part in message for part in parts), message


@pytest.mark.parametrize(
    ("block", "column", "part"),
    [
        ("G1 X1 X2", 7, "X twice"), ("G1 X=5 X6", 8, "X twice"), ("G1 X5 F100 F200", 12, "F twice"),
        ("G2 X10 I5 I6", 11, "I twice"), ("G2 X10 CR=5 CR=6", 13, "CR twice"), ("S100 S200", 6, "S twice"),
        ("TRANS X1 X2", 10, "X twice"), ("G111 X1 X2 Y1", 9, "X twice"), ("G2 X10 CR=5 I5", 1, "CR= and I"),
        ("G2 X10 AR=180 CR=5", 15, "AR= and CR="), ("G1 X10 RND=2 CHF=1", 14, "RND= and CHF="),
    ],
)  # fmt: skip
def test_an_address_twice_is_refused(block: str, column: int, part: str) -> None:
    with pytest.raises(sg.ProgramError, match=rf"^part\.mpf:4:{column}: {part}.* in one block: leave one of them out"):
        read(START + block)


def test_what_stands_in_a_comment_is_not_executed() -> None:
    """A block ends with a line feed: neither with a byte of a letter in UTF-8 nor with a form feed."""
    for comment in ("\u00c5 G1 X99", "a\x0cX99", "\x85X99", "a\x1cX99", "a\rX99"):
        text = (START + f"G1 X5 ; {comment}\nY2\nM30\n").encode()
        program = sg.Program.from_text(text, machine_with({"controller.dialect": "siemens", **KEYS}), source="part.mpf")
        assert [np.round(segment.end_mm, 6).tolist() for segment, _ in moves_of(program)] == [[5, 0, 0], [5, 2, 0]]
        assert program.place(program.regions[0].path.segment_lines[-1]) == "part.mpf:5"


@pytest.mark.parametrize(
    "block",
    ["R1=" + "(" * 3000 + "1" + ")" * 3000, "R1=1" + "+1" * 5000, "G1 X1EX400", "R1=1EX300*1EX300\nG1 X=R1",
     "G1 X" + "9" * 5000, "M=1EX400", "G4 F1EX30"],
)  # fmt: skip
def test_values_beyond_all_measure_are_refused(block: str) -> None:
    with pytest.raises(sg.ProgramError, match=r"^part\.mpf:[45]:\d+: .*(nested too deep|too large)"):
        read(START + block)


@pytest.mark.parametrize(
    "block",
    ["R1=5\nX=R1", "X=IC(5)", "X=AC(5)", "GOTOF E1\nE1:", "TRANS X5\nX5", "AROT Z90", "R1 = 5 GOTO E1\nE1: Z=R1",
     "R1=5\nGOTO E1\nE1: Z=R1"],
)  # fmt: skip
def test_recognised_by_words_that_only_a_sinumerik_knows(block: str) -> None:
    try:
        said = sg.Program.from_text(START + block + "\nM30\n", machine_with(KEYS), source="part.mpf").warnings[0]
    except sg.ProgramError as error:
        said = str(error)
    assert said.startswith("part.mpf:1: read as a program for a Sinumerik: line 4: ") or "GOTO" in said, said
    assert "mixes" not in said


def test_before_the_first_move() -> None:
    with pytest.raises(sg.ProgramError, match="MD20150"):
        read("X5\nM30")
    with pytest.raises(sg.ProgramError, match="without a feed"):
        read("G1 X5\nM30")
    assert plain("G91 G0 X5\nM30") == ["G91", "G00X5.", "G90"]
    with pytest.raises(sg.ProgramError, match="start is not known"):
        read("G2 X5 I1 J0 F100\nM30")


def test_an_error_in_a_subprogram_names_its_file_and_who_called(tmp_path: Path) -> None:
    (tmp_path / "SUB.SPF").write_text("X1\nX=1/0\nM17\n")
    with pytest.raises(sg.ProgramError, match=r"SUB\.SPF:2:\d+: division by 0.*called from line 4"):
        read(f"{START}SUB\nM30", folder=tmp_path)
    (tmp_path / "ROUND.SPF").write_text("ROUND\nM17\n")
    with pytest.raises(sg.ProgramError, match="16 levels"):
        read(f"{START}ROUND\nM30", folder=tmp_path)


def test_block_skip() -> None:
    assert plain(f"{START}/N5 X5\nX6\nM30", {"input.block_skip": "on"})[-1:] == ["G01X6.F1000."]
    assert plain(f"{START}/N5 X5\nX6\nM30", {"input.block_skip": "off"})[-2:] == ["G01X5.F1000.", "G01X6."]


def test_the_page_names_every_word_that_is_left_out() -> None:
    page = (Path(__file__).parents[2] / "docs" / "reference" / "input_siemens.md").read_text(encoding="utf-8")
    table = tomllib.loads(
        (resources.files("shapegcode") / "data/control/siemens_input.toml").read_text(encoding="utf-8")
    )
    words = " ".join([*table["left_out"], *table["left_out_addresses"]]).split()
    assert [word for word in words if not re.search(rf"\b{word}\b", page)] == []


def test_siemens_in_and_siemens_out_keep_names() -> None:
    """Tools by name, other edges and frames are not FANUC's; written for a Sinumerik again they are what they were."""
    text = f'{START}T="MILL 10" M6\nG505\nG0 Z9 D2\nX1\nG500\nG0 X2 Y0 Z5\nT7 M6\nG0 Z9\nM30\n'
    machine = machine_with({**KEYS, "emission.dialect": "siemens", "controller.dialect": "siemens"})
    program = sg.Program.from_text(text, machine)
    written = translate(program, machine).text.decode()
    for words in ('T="MILL 10"', "G505", "D2", "G500", "T7", "D1"):
        assert re.search(rf"(?m)^{words}$|{words}", written), words
    assert not re.search(r"T901|G54\.1|H8", written)
    again = sg.Program.from_text(written, machine)
    words_of = [
        [line for line in one.expanded_text.splitlines() if line.startswith((b"G0", b"T", b"G5"))]
        for one in (again, program)
    ]
    assert words_of[0][0] == b"G54"  # the opening of what is written names the frame
    assert words_of[0][1:] == words_of[1]


def test_names_that_are_no_utf_8_are_kept(tmp_path: Path) -> None:
    """Of the program itself in errors, and of the subprogram that it calls: a file system holds any bytes."""
    folder = tmp_path / "teile\udce9"
    folder.mkdir()
    (folder / "SUB.SPF").write_text("G1 X=Q\nM17\n")
    text, machine = "G0 X0\nG1 F100\nSUB\nM30\n", machine_with({"input.tool_change_unknown_axes": ""}, "kimm004")
    with pytest.raises(sg.ProgramError, match=r"teile\\udce9/SUB\.SPF:1:6: Q is not a variable .*called from line 3"):
        read_siemens(text, file=str(folder / "a.mpf"), machine=machine, folder=folder)
    with pytest.raises(sg.ProgramError) as caught:
        read_siemens("G1 X=Q\nM30\n", file=str(folder / "a.mpf"), machine=machine)
    assert str(caught.value).startswith(f"{folder}/a.mpf:1:6: ") and caught.value.file == f"{folder}/a.mpf"
