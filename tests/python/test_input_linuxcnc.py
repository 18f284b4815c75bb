"""Programs in LinuxCNC's words: held against its own interpreter rs274, and word by word against its documentation."""

import pickle
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import shapegcode as sg
from acceptance import machine_with, moves_of
from command import run
from linuxcnc_compare import agree, compare, machine
from rs274_tool import canonical_moves, run_rs274

HEAD = "G21 G17 G90 G94\nG0 X0 Y0 Z5\nF600\n"


def read(body: str, folder: Path | None = None, **keys: Any) -> sg.Program:
    return sg.Program.from_text(f"{HEAD}{body}\nM2\n", machine(**keys), source="part.ngc", folder=folder)


def ends(program: sg.Program) -> list[list[float]]:
    return [np.round(np.array(segment.end_mm) + 0.0, 6).tolist() for segment, _ in moves_of(program)]


def dwells(program: sg.Program) -> list[float]:
    return [dwell_s for _, dwell_s in moves_of(program) if dwell_s > 0.0]


@pytest.mark.parametrize("seed", range(20))
def test_random_programs_move_as_in_linuxcnc(seed: int, tmp_path: Path) -> None:
    assert compare(seed, tmp_path) > 5


def test_the_comparison_can_fail(tmp_path: Path) -> None:
    """A tool that is 0.1 mm longer, a dwell of another unit, another feed: each is found."""
    body = f"{HEAD}G4 P0.5\nG1 X5\nG2 X10 I2.5\nM2\n"
    theirs = [*canonical_moves(run_rs274(body, tmp_path))]
    assert agree(sg.Program.from_text(body, machine()), theirs) == 3
    for was, now in (("P0.5", "P0.6"), ("X5", "X5.002"), ("I2.5", "I2.5 Z4"), ("F600", "F601")):
        with pytest.raises((AssertionError, sg.ProgramError)):
            agree(sg.Program.from_text(body.replace(was, now), machine()), theirs)


# ---- expressions, parameters, control flow ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("expression", "value"),
    [
        ("2**3**2", 64.0), ("-2**2", 4.0), ("1+2*3-4/2", 5.0), ("7 mod -3", 1.0), ("-7 mod 3", 2.0),
        ("1 or 0 and 0", 0.0), ("1 eq 1.00009", 1.0), ("1 eq 1.0002", 0.0), ("1 le 0.99991", 0.0), ("2 lt 1", 0.0),
        ("1 xor 1", 0.0),
        ("fix[-2.5]", -3.0), ("fup[-2.5]", -2.0), ("round[-2.5]", -3.0), ("round[2.5]", 3.0), ("abs[-3]", 3.0),
        ("atan[1]/[-1]", 135.0), ("acos[0.5]", 60.0), ("sin[30]", 0.5), ("exists[#<x>]", 1.0), ("exists[#<y>]", 0.0),
        ("-[3] + [- 2]", -5.0), ("sqrt[16] + ln[exp[2]]", 6.0), ("#[1+2]", 7.0), ("##4", 7.0),
    ],
)  # fmt: skip
def test_expressions(expression: str, value: float) -> None:
    """Values that rs274 2.9 printed for the same expressions."""
    program = read(f"#<x> = 1\n#3 = 7\n#4 = 3\nG1 X[[{expression}] + 100]")
    assert ends(program)[-1][0] == pytest.approx(value + 100.0, abs=1e-5)


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ("G1 X#<nothing>", "#<nothing> has no value"), ("G1 X[1/0]", "division by zero"), ("G1 X[SQRT[-1]]", "SQRT"),
        ("G1 X[1 + ]", "a value is expected"), ("G1 X[1", "operator or ]"), ("G1 X1 X2", "X is given twice"),
        ("G1 X1 X[2]", "X is twice"),
        ("G1 X#5061", "known to the machine only"), ("#5220 = 2", "LinuxCNC's own"), ("G1 X[0 ** -1]", "no value"),
        ("O1 endwhile", "without WHILE"), ("O1 while [0]", "no ENDWHILE after it"), ("O1 if", "one value in brackets"),
        ("O<none> call", "subroutine O<none> is neither in the file"), ("O1 return", "outside of a subroutine"),
        ("O1 while [1]\n#1=[#1+1]\nO1 endwhile", "does not seem to end"), ("G1 G2 X1", "G1 and G2 in one block"),
        ("O1 sub\nO1 call\nO1 endsub\nO1 call", "nested more than 10 deep"), ("G80\nX5", "axis words while no G code"),
        ("G1 X(a (b) c)1", "a comment does not close"), ("G1 &5", "'&5' is not a word"),
        ("G93 G1 X1 F1\nX3", "a move in G93 without F"),
    ],
)  # fmt: skip
def test_what_cannot_be_read(body: str, message: str) -> None:
    with pytest.raises(sg.ProgramError, match=r"^part\.ngc:\d+:\d+: ") as error:
        read(body, **{"controller.max_program_steps": 2000})
    assert message in str(error.value)


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ("G1 X1e3", "E3 and no word in the block that uses it"), ("G1 X5 D3", "D3"), ("G1 X5 H3", "H3"),
        ("G1 X5\nX6 I3", "I3"), ("G2 X10 I5 K3", "K is not a centre word of an arc in G17"), ("G1 X5 P3", "P3"),
        ("G18\nG2 X10 I5 J1", "J is not a centre word of an arc"), ("G90.1\nG2 X10 I5 J0 K3", "K is not a centre"),
        ("G81 X1 Z-1 R1 P3", "P3"), ("G81 X1 Z-1 R1\nX2 Q3", "Q3"), ("G82 X1 Z-1 R1 P1 K3", "K3"),
        ("G2 X10 I5 L2", "L2"), ("G92 X1 P2", "P2"), ("G54 P2", "P2"), ("G64 P1 R2", "R2"), ("G49 H1", "H1"),
        ("G81 X1 Z-1 R1 A5", "A in a drilling"), ("M3 M5", "M3 and M5 in one block"), ("M7 M8", "M7 and M8"),
        ("T1.5", "not a whole number"), ("S-5", "negative"),
        ("G1 X1(a)2", "a comment is inside a word"), ("G1 X1(a).5", "a comment is inside"), ("G1 Y(a)2", "a comment"),
        ("#1(a)=5", "a comment is inside"), ("#1=[1(a)+1]", "a comment"), ("G1 X5 (a) 3", "a comment is inside"),
        ("G1 X5\x0bY3", "is not a word"),
    ],
)  # fmt: skip
def test_what_linuxcnc_refuses_is_not_read_otherwise(body: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(sg.ProgramError, match=r"^part\.ngc:\d+:1: ") as error:
        read(body)
    assert message in str(error.value)
    with pytest.raises(RuntimeError, match="rs274 rejects the program"):
        run_rs274(f"{HEAD}{body}\nM2\n", tmp_path)


@pytest.mark.parametrize(
    "body",
    [
        *(f"O1 repeat [{n}]\nG91 G1 X1\nO1 endrepeat\nG90 X9" for n in (0.4, 0.6, 1.5, 2.2, 2.5, 2.7, 3.5, -0.6)),
        "G1 X1\r5 Y2", "G1 X5 (a)(b) Y3 (c)", "O1 repeat [2] (twice)\nG91 G1 X1\nO1 endrepeat ; end\nG90 X9",
        "G2 X10 I5\nI5", "M19 R90 P1\nG1 X1", "M50 P1\nG1 X1", "G64 P1 Q2\nG1 X1", "G18\nG2 X10 Z5 I5 K0\nX20 I5",
    ],
)  # fmt: skip
def test_the_same_moves_as_rs274(body: str, tmp_path: Path) -> None:
    theirs = [*canonical_moves(run_rs274(f"{HEAD}{body}\nM2\n", tmp_path))]
    assert agree(read(body), theirs) > 0


@pytest.mark.parametrize("value", ["[" * 3000 + "1" + "]" * 3000, "[" + "-" * 5000 + "[1]]", "1" * 400])
def test_values_beyond_all_measure_are_refused(value: str) -> None:
    with pytest.raises(sg.ProgramError, match=r"^part\.ngc:4:1: .*(nested too deep|too large)"):
        read(f"G1 X{value}")


def test_settings_of_a_line_take_effect_together() -> None:
    assert ends(read("#31 = 1 #32 = 2\n#31 = #32 #32 = #31\nG1 X#31 Y#32"))[-1][:2] == [2.0, 1.0]


def test_scopes() -> None:
    body = (
        "o<s> sub\n#<mine> = #1\n#<_all> = #1\n#40 = #1\n#1 = 99\nG1 X#<mine>\no<s> endsub [#2 * 2]\n"
        "#1 = 7\n#<mine> = 3\no<s> call [11] [12]\nG1 X#1 Y#<mine> Z#<_all>\nG1 X#40 Y#<_value>"
    )
    assert ends(read(body))[-3:] == [[11.0, 0.0, 5.0], [7.0, 3.0, 11.0], [11.0, 24.0, 11.0]]


def test_subroutines_in_files_beside_and_where_their_lines_come_from(tmp_path: Path) -> None:
    (tmp_path / "hole.ngc").write_text("; a hole\no<hole> sub\nG1 X#1 Z-1\nG1 Z5\no<hole> endsub\n")
    program = read("o<hole> call [4]\no<hole> call [8]", tmp_path)
    assert ends(program)[-1] == [8.0, 0.0, 5.0]
    places = {program.place(int(line)) for region in program.regions for line in region.path.segment_lines}
    assert places == {f"{tmp_path / 'hole.ngc'}:3", f"{tmp_path / 'hole.ngc'}:4"}
    (tmp_path / "hole.ngc").write_text("o<hole> sub\nG38.2 Z-1\no<hole> endsub\n")
    with pytest.raises(sg.ProgramError, match=r"hole\.ngc:2:1: G38\.2 is a probing move.*called from part\.ngc line 4"):
        read("o<hole> call", tmp_path)


def test_names_are_the_same_in_every_file(tmp_path: Path) -> None:
    """Letters beyond ASCII too; a file's own name may be no UTF-8."""
    (tmp_path / "hole.ngc").write_bytes("o<hole> sub\nG1 X#<_größe>\no<hole> endsub\n".encode())
    assert ends(read("#<_größe> = 4\no<hole> call", tmp_path))[-1] == [4.0, 0.0, 5.0]
    with pytest.raises(sg.ProgramError, match=r":1:1: division by zero") as error:
        sg.Program.from_text("G1 X[1/0]\nM2\n", machine(), source="part\udce9.ngc")
    assert vars(error.value)["file"] == "part\udce9.ngc"


def test_rapids_without_a_feed_are_many() -> None:
    """Minutes, if every line looked at the whole rest for a feed."""
    program = sg.Program.from_text("G21\n" + "G0 X1\nG0 X2\n" * 10_000 + "M2\n", machine())
    assert program.expanded_text.count(b"G00X2.\n") == 10_000


def test_m98_m99_and_m70_m72() -> None:
    assert ends(read("M98 P100 L2\nM2\nO100\nG91 G1 X1\nG90\nM99"))[-1][0] == 2.0
    assert ends(read("M70\nG91 G20\nG1 X1\nM72\nG1 X3"))[-2:] == [[25.4, 0.0, 5.0], [3.0, 0.0, 5.0]]


# ---- words with a unit -----------------------------------------------------------------------------------------------


def feeds(program: sg.Program) -> list[float]:
    return [round(segment.feed_mm_per_s * 60.0, 6) for segment, dwell_s in moves_of(program) if dwell_s == 0.0]


def test_every_word_with_a_unit(tmp_path: Path) -> None:
    assert dwells(read("G4 P2\nG4 P0.25\nG4 P500")) == [2.0, 0.25, 500.0]  # seconds, whatever the point
    assert feeds(read("G1 X10 F100\nG20\nX1 F10"))[-2:] == [100.0, 254.0]
    before = read("G1 X10 F100\nG20 X1 F10")  # F counts before the unit changes, as rs274 says too
    assert feeds(before)[-2:] == [100.0, 10.0] and any("F10 in the block of G20 is in mm" in w for w in before.warnings)
    assert feeds(read("G1 X10 F100\nG20 X1"))[-1] == pytest.approx(100.0)  # a feed stays what it is
    assert feeds(read("S1000 M3\nG95 G1 X10 F0.1"))[-1] == pytest.approx(100.0)  # mm per revolution
    assert feeds(read("G93 G1 X10 F2"))[-1] == pytest.approx(20.0)  # blocks per minute
    quarter = read("G93 G2 X10 Y10 I10 F2")  # of the whole arc
    assert feeds(quarter)[-1] == pytest.approx(np.pi / 2.0 * 10.0 * 2.0, rel=1e-5)
    assert ends(read("G1 X10"))[-1][0] == 10.0  # no least increments
    assert ends(read("G1 X10", **{"controller.calculator_decimal_point": False}))[-1][0] == 10.0
    assert ends(read("G20 G1 X1"))[-1][0] == 25.4
    assert ends(read("G20 G2 X2 I1"))[-1][0] == 50.8
    assert dwells(read("G82 X1 Z-1 R1 P0.25")) == [0.25]
    assert dwells(read("G89 X1 Z-1 R1 P0.0005")) == [0.0005]  # FANUC's cycles wait whole milliseconds
    inch = read("G20 G83 X1 Z-1 R0.1 Q0.5")
    assert [end[2] for end in ends(inch)][2:4] == pytest.approx([0.1 * 25.4 - 0.5 * 25.4, 0.1 * 25.4])
    assert ends(read("G10 L2 P1 X0\nG10 L20 P1 X2\nG1 X3"))[-1][0] == 3.0
    assert read("G20 G10 L2 P1 X1\nG1 X1").core.final_state.position_mm[0] == pytest.approx(25.4)


def test_drilling_goes_back_to_r_where_nothing_is_said() -> None:
    assert [end[2] for end in ends(read("G81 X1 Z-1 R1"))][-1] == 1.0  # G99 is in force when LinuxCNC starts


@pytest.mark.parametrize(("unit", "mm"), [("mm", 1.0), ("inch", 25.4)])
def test_tool_table(unit: str, mm: float, tmp_path: Path) -> None:
    (tmp_path / "tool.tbl").write_text("T1 P1 Z10 D6 ; mill\nT12 P2 X0.0 Z+2.5 D-0.5\n\n")
    body = "T12 M6\nG43\nG1 X[#5403] Y[#5410]\nG43 H1\nG1 X1"
    program = read(body, tmp_path, **{"input.machine_unit": unit})
    assert ends(program)[-2:] == [[2.5, -0.5, 5.0 - 2.5 * mm], [1.0, -0.5, 5.0 - 10.0 * mm]]
    (tmp_path / "mill.ini").write_text(f"[EMCIO]\nTOOL_TABLE = other.tbl\n[TRAJ]\nLINEAR_UNITS = {unit}\n")
    (tmp_path / "other.tbl").write_text("T1 P1 Z3\n")
    keys = {"input.tool_table": str(tmp_path / "mill.ini"), "input.machine_unit": "mm"}
    assert ends(read("G43 H1\nG1 X1", tmp_path, **keys))[-1][2] == pytest.approx(5.0 - 3.0 * mm)
    # As `setup` reads it: comments behind values, any case.
    (tmp_path / "mill.ini").write_text(f"[emcio]\ntool_table = other.tbl  # mine\n[TRAJ]\nLINEAR_UNITS={unit} ; so\n")
    assert ends(read("G43 H1\nG1 X1", tmp_path, **keys))[-1][2] == pytest.approx(5.0 - 3.0 * mm)
    with pytest.raises(sg.ProgramError, match=r"part\.ngc:4:1: G43 H7: .*other\.tbl has no tool 7"):
        read("G43 H7", tmp_path, **keys)
    (tmp_path / "other.tbl").write_text("T1 P1 Z3\nZ4\n")
    with pytest.raises(sg.ProgramError, match=r"other\.tbl:2:1: 'Z4' is not a row"):
        read("G43 H1", tmp_path, **keys)


def test_block_skip() -> None:
    assert ends(read("/G1 X5\nG1 Y2", **{"input.block_skip": "on"}))[-1] == [0.0, 2.0, 5.0]
    assert ends(read("/G1 X5\nG1 Y2", **{"input.block_skip": "off"}))[-1] == [5.0, 2.0, 5.0]
    assert any("`/` lines are executed" in each for each in read("/G1 X5").warnings)


# ---- refused by name -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("word", "meaning"),
    [
        ("G5 X1 I1", "a cubic spline"), ("G5.1 X1 I1", "a quadratic spline"), ("G5.2 X1", "a NURBS block"),
        ("G7", "diameter mode"), ("G33 Z-1 K1", "spindle's encoder"), ("G33.1 Z-1 K1", "rigid tapping"),
        ("G38.2 Z-1", "a probing move"), ("G41 D1", "cutter compensation"), ("G42.1 D5", "cutter compensation"),
        ("G43.2 H1", "a second tool length"), ("G76 P1", "a threading cycle"), ("G87 Z1", "back boring"),
        ("G88 Z1", "waits for the operator"), ("G71 Q1", "a turning cycle"), ("G17.1", "the UV plane"),
        ("M66 P0", "wait for an input"), ("G1 U1", "a further axis"), ("G96 S100 D1000", "constant surface speed"),
        ("G10 L10 P1 Z1", "G10 L10 is not read"), ("G10 L2 P1 R5", "turns the work coordinate system"),
        ("G68 X0 Y0 R5", "not a G code of LinuxCNC"), ("G54.1 P1", "a program for FANUC"),
        ("G53 G2 X1 I1", "G0 or G1 only"),
    ],
)  # fmt: skip
def test_refused(word: str, meaning: str) -> None:
    with pytest.raises(sg.ProgramError, match=r"^part\.ngc:4:1: ") as error:
        read(word)
    assert meaning in str(error.value)


# ---- which dialect it is ---------------------------------------------------------------------------------------------


def test_recognised_by_content() -> None:
    program = sg.Program.from_text("G21\nG64 P0.01\nG0 X0\nM2\n", "vx500", source="a.ngc")
    assert program.warnings[0] == (
        "a.ngc:1: read as a program for LinuxCNC: line 2: `G64 P0.01` (tolerance of the path; FANUC's G64 has no P): "
        "LinuxCNC"
    )
    assert program.foreign is not None and program.foreign.dialect == "linuxcnc"
    assert sg.Program.from_text("G21\nG0 X0\nG4 P500\nM30\n", "vx500").foreign is None


def test_the_kind_of_the_control_decides_where_nothing_tells() -> None:
    text, own = "G21\nG0 X0\nG4 P5\nM30\n", machine_with({"controller.kind": "linuxcnc"})
    program = sg.Program.from_text(text, own)
    assert dwells(program) == [5.0]
    assert any(
        "G4 P5 is a dwell of 5 s on LinuxCNC; on FANUC P counts milliseconds" in each for each in program.warnings
    )
    assert dwells(sg.Program.from_text(text, own.with_values({"controller.dialect": "fanuc"}))) == [0.005]
    assert dwells(sg.Program.from_text(f"O0001\n{text}", own)) == [0.005]  # a program number


def test_a_dwell_that_nothing_tells_is_said_with_both_meanings() -> None:
    program = sg.Program.from_text("G21\nG0 X0\nG4 P2\nM30\n", "vx500", source="a.nc")
    assert dwells(program) == [0.002]
    assert program.warnings[0].startswith("a.nc:3: G04 P2 is read as 2 ms (FANUC, Haas); on LinuxCNC it is 2 s")
    for text, machine_ in (("G4 P500", machine_with()), ("G4 P2", machine_with({"controller.dialect": "fanuc"}))):
        assert not any(
            "LinuxCNC" in each for each in sg.Program.from_text(f"G21\nG0 X0\n{text}\nM30\n", machine_).warnings
        )


def test_a_called_file_is_read_as_strictly_as_the_program(tmp_path: Path) -> None:
    (tmp_path / "O100.nc").write_text("O100\nG1 X5. ; Y9.\nM99\n")
    with pytest.raises(sg.ProgramError, match=r"O100\.nc:2:1: words after `;`"):
        sg.Program.from_text("O1\nG21 G0 X0. Y0.\nF100.\nM98 P100\nM30\n", machine_with(), folder=tmp_path)
    (tmp_path / "hole.ngc").write_bytes(b"\xef\xbb\xbfo<hole> sub\r\nG1 X#1\r\no<hole> endsub\r\n")
    assert ends(read("o<hole> call [5]", tmp_path))[-1][0] == 5.0
    (tmp_path / "L10.SPF").write_bytes(b"\xef\xbb\xbfG1 X5 F100 ; a\rX9\r\nM17\r\n")
    siemens = machine_with({"controller.dialect": "siemens"})
    assert ends(sg.Program.from_text("G0 X0 Y0 Z0\nL10\nM30\n", siemens, folder=tmp_path))[-1] == [5.0, 0.0, 0.0]


@pytest.mark.parametrize("dialect", ["fanuc", "linuxcnc", "haas", "siemens"])
def test_an_empty_program_ends_in_no_traceback(dialect: str) -> None:
    for text in ("", "\n", "%\n", "%"):
        try:
            assert not moves_of(sg.Program.from_text(text, machine_with({"controller.dialect": dialect})))
        except sg.ProgramError as error:
            assert str(error).startswith("<text>:")


def test_an_o_word_behind_a_slash_is_refused_by_name() -> None:
    with pytest.raises(sg.ProgramError, match=r"^part\.ngc:4:1: an O word after `/`"):
        read("/O1 repeat [2]\nG91 G1 X1\n/O1 endrepeat")


def test_turns_of_an_arc_that_nothing_tells_are_said() -> None:
    program = sg.Program.from_text("G21\nG0 X0 Y0\nG2 X0 I5 F100 P3\nM30\n", "vx500", source="a.nc")
    assert program.warnings[0].startswith("a.nc:3: P3 of an arc is not read, as FANUC knows none; on LinuxCNC the arc")
    for other in ("G2 X0 I5 F100 M98 P3", "G2 X0 I5 F100 P1", "(G2 X0 I5 P3)"):
        text = f"O1\nG21\nG0 X0 Y0\n{other}\nM30\nO3\nM99\n"
        assert not any("turns" in each for each in sg.Program.from_text(text, "vx500").warnings)


@pytest.mark.parametrize("dialect", ["auto", "fanuc"])
def test_words_behind_a_semicolon_are_neither_executed_nor_left_out_unsaid(dialect: str) -> None:
    machine_ = machine_with({"controller.dialect": dialect})
    head = "G21\nG0 X0. Y0.\nF100.\n"
    for line in ("G1 X10. ; G1 Y5.", "; Y5.", "G1 X10. (A) ;;Y5."):
        with pytest.raises(sg.ProgramError, match=r"^a\.nc:4:1: words after `;`: FANUC begins a block there"):
            sg.Program.from_text(f"{head}{line}\nM30\n", machine_, source="a.nc")
    for line in ("G1 X10.;", "G1 X10.; (Y5.)", "G1 X10.;; \r", "(A; Y5.)\nG1 X10.;", "G1 X10.\n%;"):
        program = sg.Program.from_text(f"{head}{line}\nM30\n", machine_, source="a.nc")
        assert ends(program)[-1][:2] == [10.0, 0.0]
    linuxcnc = sg.Program.from_text(f"{head}G1 X10. ; G1 Y5.\nM30\n", machine())
    assert ends(linuxcnc)[-1][:2] == [10.0, 0.0]


def test_a_program_for_a_mitsubishi_is_not_taken_for_one_of_linuxcnc() -> None:
    """G61.1 is its high-accuracy control, P of G04 its milliseconds."""
    with pytest.raises(sg.ProgramError, match=r"^<text>:3:1: unknown G code G61\.1"):
        sg.Program.from_text("G21\nG0 X0. Y0.\nG61.1\nG1 X10. F100.\nG4 P500\nM30\n", machine_with())


def test_what_stands_behind_the_end_says_nothing_of_the_control() -> None:
    program = sg.Program.from_text("%\nO1\nG21 G0 X0.\nM30\n%\nNOT FOR THE HAAS: G154 P3 M97 P1\n", machine_with())
    assert program.foreign is None


def test_mixed_and_misstated_programs_are_refused() -> None:
    mixed = "G21\n#<depth> = 3\nIF [#1 EQ 2] GOTO 10\nM2\n"
    with pytest.raises(
        sg.ProgramError, match=r"^<text>:3:1: GOTO is a word of FANUC \(jump of a macro\), and #<DEPTH>"
    ):
        sg.Program.from_text(mixed, "vx500")
    with pytest.raises(sg.ProgramError, match=r"^<text>:2:1: this is a program for LinuxCNC: #<DEPTH>"):
        sg.Program.from_text("G21\n#<depth> = 3\nM2\n", machine_with({"controller.dialect": "haas"}))
    with pytest.raises(sg.ProgramError, match=r"^<text>:2:1: this is a program for FANUC: G05\.1 Q1"):
        sg.Program.from_text("G21\nG05.1 Q1\nM2\n", machine())


# ---- the rest works on it --------------------------------------------------------------------------------------------

LOOP = (
    "(A LOOP)\nG21 G17 G90 G64 P0.01\nS2000 M3\nG0 X0 Y0 Z1\n#1 = 0\no1 while [#1 LT 3]\n  #1 = [#1 + 1]\n"
    "  G1 X[#1 * 10] F3000\n  G3 X[#1 * 10] Y20 I0 J10\n  G1 Y0\n  G0 Z1\no1 endwhile\nM5\nM2\n"
)


def test_errors_and_findings_name_lines_of_the_source() -> None:
    with pytest.raises(sg.ProgramError, match=r"^loop\.ngc:9:1: arc end is .* off its radius"):
        sg.Program.from_text(LOOP.replace("J10", "J3"), machine(), source="loop.ngc")
    program = sg.Program.from_text(LOOP, machine(), source="loop.ngc")
    assert [program.place(region.first_line) for region in program.regions] == ["loop.ngc:8"] * 3
    assert program.text.decode() == LOOP and b"G03X10.Y20." in program.expanded_text
    expansion = sg.expand(program, machine())
    assert expansion.expanded and expansion.origins[-2] == (14, "")
    assert pickle.loads(pickle.dumps(program)).warnings == program.warnings


def test_lines_keep_their_numbers_where_nothing_is_repeated() -> None:
    body = "; a part\nG21 G17 G90 G94\nG64 P0.01\n\nG91.1\nG0 X0 Y0\nG1 X1.5 F100\nX3\nG4 P1\nG1 Y5.123456789\nM2\n"
    program = sg.Program.from_text(f"%\n{body}%\n", "vx500")
    assert [program.core.origin(line)[0] for line in range(1, program.core.line_count + 1)] == [*range(1, 14)]
    assert b"X3\n" in program.expanded_text and b"Y5.1234568" in program.expanded_text


def test_n_words_stay_where_a_search_finds_one_block() -> None:
    """N40 stands twice, FANUC has no N0 and no N100000, a loop would repeat N50; pages of both controls."""
    body = (
        "N7 G1 X[5+6]\nN40 X[5+7]\nN40 X[5+8]\nN0 X[5+9]\nN100000 X[5+10]\nO1 repeat [2]\nN50 G91 G1 X[1+1]\n"
        "O1 endrepeat\nN1 00 G90 G0 X3\nN00060 (TEXT) G2 X10 I3.5\nN99999 G4 P[1/2]"
    )
    program = read(body)
    text = program.expanded_text.decode()
    found = re.findall(r"N(\d+)(.*)\n", text)
    assert [number for number, _ in found] == ["7", "50", "60", "99999"]
    blocks = dict(found)
    assert "X11." in blocks["7"] and "X2." in blocks["50"] and "X10." in blocks["60"] and blocks["99999"] == "G04X0.5"
    without = re.sub(r"(?m)^N[\d ]+", "", body)
    assert ends(program) == ends(read(without)) and dwells(program) == dwells(read(without))


def test_n_words_of_plain_lines_too() -> None:
    """N100 stands twice, N300 in a loop, N400 in a subroutine."""
    body = (
        "O2 sub\nN400 G1 Y1\nO2 endsub\nF600\nN100 G1 X5\nN100 G1 X6\nN200 X7\nX8\nN0 X9\nO1 repeat [2]\n"
        "N300 G1 Y2\nY0\nO1 endrepeat\nO2 call"
    )
    text = read(body).expanded_text.decode()
    assert re.findall(r"N(\d+)", text) == ["200", "300", "400"]
    without = re.sub(r"(?m)^N[\d ]+", "", body)
    assert ends(read(body)) == ends(read(without))


def test_time_check_and_convert_to_linuxcnc(tmp_path: Path) -> None:
    (tmp_path / "loop.ngc").write_text(LOOP)
    for command in ("time", "check", "simulate"):
        assert run(tmp_path, command, "loop.ngc", "-m", "vx500").returncode == 0
    done = run(tmp_path, "convert", "loop.ngc", "-m", "vx500", "--dialect", "linuxcnc", "-o", "shaped.ngc")
    assert done.returncode == 0 and "shaped" in done.stdout
    text = (tmp_path / "shaped.ngc").read_text()
    assert "(SHAPED)" in text and "o1" not in text.lower().splitlines()
    moves = [*canonical_moves(run_rs274(text, tmp_path))]
    assert len(moves) > 100 and moves[-1].end[:2] == pytest.approx([30.0, 0.0], abs=1e-3)
    again = sg.Program.read(tmp_path / "shaped.ngc", "vx500")
    assert again.foreign is not None and again.stamp is not None and again.shaped_regions == 3


def test_what_is_not_shaped_is_written_in_the_words_that_are_asked_for() -> None:
    text = "G21 G90 G64 P0.01\nG0 X0 Y0 Z0\nG4 P0.5\nG0 X10\nM2\n"
    done = sg.convert(text, machine_with())
    assert b"G04X0.5" in done.text
    assert "its motion is unchanged, written as a FANUC program" in done.answer
    own = sg.convert(text, machine_with({"emission.dialect": "linuxcnc"}))
    assert b"G04P0.5" in own.text.replace(b" ", b"").replace(b"G4P", b"G04P")
    assert "its motion is unchanged\nwritten for LinuxCNC" in own.answer


def test_restart_points_name_the_lines_of_the_source() -> None:
    """A zigzag in a loop: the cut is lines 3 to 10 of the source, whatever the plain program has."""
    text = (
        "G21 G17 G90 G94 G64 P0.01\nG0 X0 Y0 Z2\nG1 Z-1 F600\n\n#1 = 0\no1 while [#1 LT 12]\n  G1 X60 F2400\n  X0\n"
        "  #1 = [#1 + 1]\n  G1 Y#1\no1 endwhile\nG0 Z50\nM2\n"
    )
    keys = {"emission.restart_interval_s": 5.0}
    conversion = sg.convert(text, machine_with(keys), shape_all=True)
    assert conversion.restart_points and {point.lines for point in conversion.restart_points} == {(3, 10)}


def test_one_program_in_a_file(tmp_path: Path) -> None:
    (tmp_path / "loop.ngc").write_text(LOOP)
    for choice, message in (
        ("all", "a file for LinuxCNC is one program"),
        ("O1", "a file for LinuxCNC is one program"),
    ):
        done = run(tmp_path, "time", "loop.ngc", "-m", "vx500", "--program", choice)
        assert done.returncode == 2 and message in done.stderr


def test_numbers_without_a_point_stay_whole_units_in_what_is_emitted(tmp_path: Path) -> None:
    """Where the machine file reads X20 as increments, LinuxCNC's X20 gets its point: it was emitted as .02 mm."""
    program = "G21 G17 G90 G94\nT1 M6\nS5000 M3\nG0 X0 Y0 Z5\nG1 Z-1 F200\nG1 X20 F50\nY20\nG2 X40 I10\nG0 Z50\nM2\n"
    (tmp_path / "p.ngc").write_text(program)
    machine = sg.Machine.load("vx500").with_values(
        {"controller.calculator_decimal_point": False, "controller.dialect": "linuxcnc"}
    )
    conversion = sg.convert(tmp_path / "p.ngc", machine)
    assert conversion.ok
    text = conversion.text.decode()
    assert re.search(r"(?<![A-Z(])[XYZIJKF]-?\d+(?![\d.])", re.sub(r"\(.*?\)", "", text)) is None
    assert re.search(r"Z50\.", text) and re.search(r"Y20\.", text)


@pytest.mark.parametrize("comment", ["; DIALECT KLIPPER", "(DIALECT ISG KERNEL BECKHOFF TWINCAT CNC TF5200)"])
def test_what_is_emitted_for_a_control_that_is_not_read_is_refused_by_its_name(comment: str) -> None:
    with pytest.raises(sg.ProgramError, match=r"2:1: emitted for .*: keep the original"):
        sg.Program.from_text(f"%\n{comment}\nG21G90\nG01X1.F100.\nM30\n%\n", sg.Machine.load("vx500"))
