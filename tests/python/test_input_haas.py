"""Programs in a Haas mill's words: goldens derived from what its manuals and articles say, each with its source."""

from pathlib import Path
from typing import Any

import pytest

import shapegcode as sg
from acceptance import machine_with, moves_of

HEAD = "G21 G17 G90 G94\nG00 X0. Y0. Z5.\n"
LINE = 3
"""Of the first line of a body."""

M97_EXAMPLE = """\
%
O00011 (M97 CALL)
T1 M06
G00 G90 G54 X0 Y0 S1000 M03
G43 H01 Z1.
G01 Z0 F20.
M97 P1000 L5 (L5 WILL CAUSE THE PROGRAM TO RUN THE N1000 LINE FIVE TIMES)
G00 G90 Z1.
M30
N1000 (N LINE THAT WILL RUN AFTER M97 P1000 IS RUN)
G01 G91 Z-0.1
G90 X2.
G91 Z-0.1
G90 X0
M99
%
"""


def read(body: str, **keys: Any) -> sg.Program:
    machine = machine_with({"controller.dialect": "haas", "input.tool_change_unknown_axes": "", **keys})
    return sg.Program.from_text(f"{HEAD}{body}\nM30\n", machine, source="part.nc")


def plain(body: str) -> list[str]:
    """The lines of a body in FANUC's words."""
    foreign = read(body).foreign
    return foreign.text.splitlines()[LINE - 1 : -1]


def dwells(program: sg.Program) -> list[float]:
    return [dwell_s for _, dwell_s in moves_of(program) if dwell_s > 0.0]


def test_a_program_in_which_nothing_differs_stays_as_it_is() -> None:
    text = f"{HEAD}G01 X10. F500.\nG02 X20. R5.\nG04 P500\nM30\n"
    program = sg.Program.from_text(text, machine_with({"controller.dialect": "haas"}))
    assert program.foreign is not None and program.foreign.text == text
    fanuc = sg.Program.from_text(text, machine_with({"controller.dialect": "fanuc"}))
    assert program.expanded_text == fanuc.expanded_text == text.encode()


def test_dwell() -> None:
    """P with a point is seconds, without one milliseconds: the source named in data/control/dialects.toml."""
    assert dwells(read("G04 P1.5\nG04 P500\nG4P.25\nG04 P2.")) == [1.5, 0.5, 0.25, 2.0]
    assert dwells(read("G82 X1. Z-1. R1. P0.5 F100.\nX2.\nG80")) == [0.5, 0.5]
    assert dwells(read("G82 X1. Z-1. R1. P500 F100.\nG80")) == [0.5]
    assert any("P1.5 with a point is a dwell of 1.5 s on a Haas" in each for each in read("G04 P1.5").warnings)
    for wrong in ("G04 P#1", "G04 P[1+1]"):
        with pytest.raises(sg.ProgramError, match=r"^part\.nc:3:1: a dwell by a variable"):
            read(wrong)


def test_numbers_without_a_point() -> None:
    """Settings 77 and 162: haas.co.uk, "Help with the Decimal Points"."""
    ends = [moves_of(read("G01 X100 F100.", **{"controller.calculator_decimal_point": on}))[-1][0].end_mm[0]
            for on in (True, False)]  # fmt: skip
    assert ends == [100.0, pytest.approx(0.1)]
    with pytest.raises(sg.ProgramError, match=r"^part\.nc:3:1: F12 without a decimal point: setting 77"):
        read("G01 X1. F12")
    assert moves_of(read("G20\nG01 X1. F12."))[-1][0].feed_mm_per_s == pytest.approx(12.0 * 25.4 / 60.0)
    turning = moves_of(read("S1000 M03\nG95 G01 X1. F.1"))[-1][0]
    assert turning.feed_mm_per_s == pytest.approx(100.0 / 60.0)


def test_g10() -> None:
    """L2, L10, L11, L20 are FANUC's, L12 and L13 a diameter: haas.co.uk, "Programmable Offsets"."""
    offsets = {"input.work_offsets": {f"G{n}": [0.0, 0.0, 0.0] for n in range(54, 60)}}
    moved = read("G10 L2 P1 G91 X60.\nG90 G01 X0. F100.", **offsets)
    assert moves_of(moved)[-1][0].start_mm[0] == -60.0  # the origin of G54 moved by 60 mm to the right
    assert read("G10 L20 P2 G90 X100. Y80.\nG111 X0. Y0.").core.final_state.coordinate_number == 2
    for word in ("G10 L12 P1 R5.", "G10 L13 P1 R.1"):
        with pytest.raises(sg.ProgramError, match="a diameter or a radius, depending on setting 40"):
            read(word)
    with pytest.raises(sg.ProgramError, match="the origin of G52"):
        read("G10 L2 P0 X1.")


def test_additional_work_offsets() -> None:
    """G154 P1 to P99, and G110 to G129 for the first twenty: haas.co.uk, "Programmable Offsets"."""
    assert plain("G154 P3 X1.\nG110\nG129 Y2. (A)") == ["G54.1P3 X1.", "G54.1P1", "G54.1P20 Y2.(A)"]


def test_m97() -> None:
    """The example of Haas' manual 96-8000, p. 217 (easymanua.ls/haas/96-8000/manual?p=217)."""
    program = sg.Program.from_text(M97_EXAMPLE, machine_with({"input.tool_change_unknown_axes": ""}), source="m97.nc")
    reason = "line 7: `M97 P1000` (call of a subprogram by its N number): Haas"
    assert program.warnings[0] == f"m97.nc:1: read as a program for Haas: {reason}"
    ends = [tuple(segment.end_mm) for segment, _ in moves_of(program)]
    depth = [-0.1 * step for step in range(1, 11)]
    down = ends[1:-1]
    assert len(down) == 20 and down[-1] == pytest.approx((0.0, 0.0, -1.0))
    assert [end[2] for end in down[::2]] == pytest.approx(depth) and {end[0] for end in down} == {0.0, 2.0}
    lines = [program.core.origin(int(n))[0] for region in program.regions for n in region.path.segment_lines]
    assert lines[1:5] == [11, 12, 13, 14] and lines[-4:] == [11, 12, 13, 14]


def test_calls(tmp_path: Path) -> None:
    """M98 P takes five digits of a program's number, L the repetitions: the same page."""
    (tmp_path / "O10001.nc").write_text("O10001\nG04 P0.5\nG91 G01 X1. F100.\nG90\nM99\n")
    machine = machine_with({"controller.dialect": "haas"})
    program = sg.Program.from_text(f"{HEAD}M98 P10001\nM30\n", machine, folder=tmp_path, source="part.nc")
    assert dwells(program) == [0.5]  # the called program is a Haas' as well
    assert program.place(program.regions[0].first_line) == f"{tmp_path / 'O10001.nc'}:3"
    (tmp_path / "O10001.nc").write_text("O10001\nG12 I1. F10. D1\nM99\n")
    with pytest.raises(sg.ProgramError, match=r"O10001\.nc:2:1: G12 is circular pocket milling"):
        sg.Program.from_text(f"{HEAD}M98 P10001\nM30\n", machine, folder=tmp_path)
    with pytest.raises(sg.ProgramError, match=r"^part\.nc:3:1: M97 P7: there is no N7"):
        read("M97 P7")
    with pytest.raises(sg.ProgramError, match=r"^part\.nc:5:1: N7, which M97 calls, does not end with M99"):
        read("M97 P7\nM00\nN7 G01 X1. F100.")


def test_what_moves_nothing_is_left_out_and_said() -> None:
    """G103: gcodes.net/haas-g103-limit-block-buffering; G187: cnccode.com, industrialmonitordirect.com."""
    program = read("G103 P1\nG187 P3 E0.01 (SMOOTH)\nG01 X1. F100.\nG103")
    assert [region.blocks for region in program.regions] == [1]
    for code in ("G103 limits the blocks", "G187 sets smoothness"):
        assert sum(code in each for each in program.warnings) == 1


def test_macros_are_fanucs() -> None:
    program = read("#100=2.\nWHILE[#100GT0]DO1\nG01X#100F100.\n#100=#100-1.\nEND1")
    assert [segment.end_mm[0] for segment, _ in moves_of(program)] == [2.0, 1.0]


@pytest.mark.parametrize(
    ("word", "meaning"),
    [
        ("G12 I1. F10. D1", "circular pocket milling"), ("G13 I1. F10. D1", "circular pocket milling"),
        ("G47 P0 X1.", "engraving"), ("G70 I1. J0 L4", "a bolt hole circle"), ("G71 I1. J0 K10. L4", "a bolt hole arc"),
        ("G72 I1. J0 L4", "bolt holes along an angle"), ("G150 P1 Z-1. Q1.", "general pocket milling"),
        ("G76 X1. Z-1. R1.", "fine boring"), ("G77 X1. Z-1. R1.", "back boring"), ("G87 X1. Z-1.", "manual retract"),
        ("G88 X1. Z-1.", "manual retract"), ("G93", "inverse time"), ("G96 S100", "constant surface speed"),
        ("G68 X0. Y0. R10.", "no documentation"), ("G51 P2.", "no documentation"), ("G141 X1.", "no documentation"),
        ("G83 Z-1. R1. I1. J.1 K.2 F10.", "changes the pecks"), ("G83 Z-1. R1. Q.5 I-.5", "changes the pecks"),
        ("G83 Z-1. R1. Q.5 K#5", "changes the pecks"), ("G84 Z-1. R1. J[2] F10.", "changes the pecks"),
        ("G82 Z-1. R1. P#1", "the dwell of G82 by a variable"), ("G89 Z-1. R1. P[#1]", "the dwell of G89"),
        ("M97 L2 P100", "M97 takes an N number directly after it"), ("M97 P#1", "M97 takes an N number"),
        ("M96 P10 Q8", "if an input is not set"),
    ],
)  # fmt: skip
def test_refused(word: str, meaning: str) -> None:
    """Names of the codes: Haas' "Machinist's CNC Reference Guide"; gcodes.net."""
    with pytest.raises(sg.ProgramError, match=r"^part\.nc:3:1: ") as error:
        read(word)
    assert meaning in str(error.value)


@pytest.mark.parametrize("word", ["K2", "I.5", "P#1"])
def test_words_of_a_cycle_hold_for_the_holes_behind_it(word: str) -> None:
    with pytest.raises(sg.ProgramError, match=r"^part\.nc:4:1: .*(changes the pecks|by a variable)"):
        read(f"G83 X1. Z-1. R1. Q.5 F10.\nX2. {word}\nG80")
    assert moves_of(read(f"G83 X1. Z-1. R1. Q.5 F10.\nX2. ({word}) ; {word}\nG80\nG02 X4. I1. F10."))


def test_the_p_of_m19_is_no_dwell() -> None:
    assert plain("M19 P90.") == ["M19 P90."]


@pytest.mark.parametrize("call", ["M98 P10001", "P10001 M98", "M98 P#1", "M98 P[#1]", "M098P10001", "M98 L1 P10001"])
def test_a_number_of_five_digits_is_a_program(call: str, tmp_path: Path) -> None:
    """Not FANUC's O1, called once."""
    (tmp_path / "O10001.nc").write_text("O10001\nG01 X7. F100.\nM99\n")
    (tmp_path / "O0001.nc").write_text("O0001\nG01 X9. F100.\nM99\n")
    machine = machine_with({"controller.dialect": "haas"})
    program = sg.Program.from_text(f"{HEAD}#1=10001\n{call}\nM30\n", machine, folder=tmp_path, source="part.nc")
    assert [segment.end_mm[0] for segment, _ in moves_of(program)] == [7.0]


@pytest.mark.parametrize("sign", ["G154 P3", "G187 P2", "G103 P1", "M97 P1", "G150 P1"])
def test_recognised_by_content(sign: str) -> None:
    program_or_error = ""
    try:
        program_or_error = "".join(sg.Program.from_text(f"{HEAD}{sign}\nM30\nN1 M99\n", machine_with()).warnings)
    except sg.ProgramError as error:
        program_or_error = str(error)
    assert "read as a program for Haas" in program_or_error or "on a Haas" in program_or_error
