"""The whole conversion, judged by an interpreter, a player and a plant that share no code with it."""

import functools
import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings

import shapegcode as sg
from acceptance import (
    SAMPLE_KEYS,
    SAMPLES,
    Judged,
    check_figures,
    close,
    convert,
    figures,
    machine_with,
    read_sample,
    whole_periods,
)
from judge import interpret
from judge.generate import programs

HEAD = "%\nO1\nG21G17G90G94\nG0X0Y0Z0\n"
TAIL = "G0Z50.\nM30\n%\n"
#: Samples whose coordinates mean what they say only in calculator notation.
CALCULATOR = {"controller.calculator_decimal_point": True}
#: Regions of each sample, counted by hand or with the judge's strong lines.
LONG_SAMPLES = ("BOTTLE.NC", "PARALLEL.NC", "VINT_360arc.NC")
BLOCK = re.compile(
    r"(N\d+)?(G09)?(G1[789])?(G0[123])?(X-?\d*\.\d*)?(Y-?\d*\.\d*)?(Z-?\d*\.\d*)?(R\d*\.\d*)?(F\d*\.\d+|F\d\d+\.)?\r?"
)


def part(body: str, head: str = HEAD) -> str:
    return head + body + TAIL


@functools.cache
def sample(name: str) -> Judged:
    return convert(read_sample(name), machine_with({**CALCULATOR, **SAMPLE_KEYS.get(name, {})}))


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=pytest.mark.slow) if name in ("BOTTLE.NC", "PARALLEL.NC") else name for name in SAMPLES],
)
def test_sample_program(name: str) -> None:
    """Text, states, end points, sweeps and N words (in `convert`); then block durations and the report's figures."""
    judged = sample(name)
    whole_periods(judged)
    check_figures(judged, contour_budget_s=3.0)
    report = judged.conversion.to_dict()
    assert report["within_tolerance"], report["warnings"]
    assert report["blocks"]["read"] == sum(
        bool(r.words) for r in judged.interpretation(judged.original, emitted=False).lines if r.executed
    )


@pytest.mark.slow
@pytest.mark.parametrize("name", ["CONTOUR_R.NC", "TEST_G90.NC"])
def test_contour_of_whole_sample(name: str) -> None:
    check_figures(sample(name), contour_budget_s=1e9)


@pytest.mark.parametrize("name", SAMPLES)
def test_sample_in_standard_notation_is_converted_or_refused(name: str) -> None:
    """`X50` as 50 um: what the file says to such a control, be it sense or not."""
    machine = machine_with({"controller.calculator_decimal_point": False, **SAMPLE_KEYS.get(name, {})})
    if name == "G17_18_19.NC":
        with pytest.raises(sg.ProgramError, match=r"^part.nc:11:\d+: arc end is .* off its radius"):
            convert(read_sample(name), machine)
    elif name not in (*LONG_SAMPLES, "PROGRAM2.NC", "TEST_G90.NC", "TEST_G91.NC"):  # all with points
        convert(read_sample(name), machine)


def test_absolute_and_incremental_sample_are_the_same_part() -> None:
    travels = []
    for name in ("TEST_G90.NC", "TEST_G91.NC"):
        regions = sample(name).regions()
        travels.append([np.sum([m.delta for m in moves if m.length > 0], axis=0) for _, moves, _ in regions])
    assert len(travels[0]) == len(travels[1]) > 3
    for absolute, incremental in zip(*travels, strict=True):
        assert absolute == pytest.approx(incremental, abs=2e-3)


@pytest.mark.parametrize("seed", range(6))
def test_an_axis_at_rest_stays_where_it_is_whatever_the_unit(seed: int) -> None:
    """Z stands between two increments of an inch; what the judge's interpreter reads of it never moves."""
    rng = np.random.default_rng(seed)
    # Z: 5 mm and others that no inch word of four digits names; then cuts in both units.
    height, axis = 5.0 + rng.integers(0, 90) / 100.0, "XY"[seed % 2]
    lines, at = [f"G0Z{height:.2f}"], 0.0
    for unit in ("G21", "G20", "G21", "G20", "G21"):
        scale, digits, feed = (25.4, 4, 80.0) if unit == "G20" else (1.0, 3, 2000.0)
        lines.append(unit)
        for _ in range(4):
            at += rng.uniform(20.0, 60.0)
            lines.append(f"G1{axis}{at / scale:.{digits}f}F{feed}")
    text = part("\n".join(lines) + "\n")
    judged = convert(text, machine_with())
    assert len(judged.conversion.placed) == 5
    # What stands before the first cut, and behind the last one, moves as in the original.
    first, last = judged.conversion.placed[0].first_line, judged.conversion.placed[-1].last_line
    records = interpret(judged.conversion.text.decode()).lines[first - 1 : last]
    still = "Y" if axis == "X" else "X"
    for move in (move for record in records for move in record.moves):
        assert abs(move.delta[2]) == 0.0 and move.end[2] == pytest.approx(height, abs=1e-12), move
        assert move.delta["XY".index(still)] == 0.0


def test_a_cut_whose_end_its_unit_cannot_name_is_left_unchanged_with_its_reason() -> None:
    text = part("X5.\nZ5.\nG1X40.F2000\nX81.2\nG20\nG91\nG1X1.F80.\nX1.Y1.\nG90\nG21\nG1X140.Y10.F2000\nX180.Y0\n")
    judged = convert(text, machine_with())
    outcomes = judged.conversion.cuts
    assert [each.is_shaped for each in outcomes] == [True, False, True]
    # 81.2 mm and 2 inches are 51968.504 increments of an inch.
    assert "it ends at X 132.00000 mm, 1.26 um off the increments of G20" in outcomes[1].reason
    assert "limit 0.50 um" in outcomes[1].reason


INCH = HEAD.replace("G21", "G20")
G91_UNKNOWN = "%\nO1\nG21G17G94\nG91G1X10.F600\nY5.\nG2X5.Y5.I5.\nM30\n%\n"
CASES: dict[str, tuple[str, dict[str, Any]]] = {
    "one line": (part("G1X10.F600\n"), {}),
    "inch": (part("G1X1.F40.\nY1.\nG2X2.Y0.I0.J-1.F20.\nX2.2345Y-.1234R.3\n", INCH), {}),
    "inch and mm": (
        part("Z5.\nG1X40.Y10.F2000\nX76.2Y0\nG20\nG1X4.Y.5F80.\nX5.Y0\nG21\nX140.Y10.F2000\nX180.Y0\n"),
        {},
    ),
    "inch slow": (part("G1X.1F.1\nY.1\n", INCH), {}),
    "G61": (part("G61\nG1X10.F600\nY10.\nX0\nG64\nY0\n"), {}),
    "G61 with a move": (part("G61G1X10.F600\nY10.\nG64X0\nY0\n"), {}),
    "G09": (part("G1X10.F600\nG09Y10.\nX0\nG09G1Y0\n"), {}),
    "G18": (part("G18G1X10.F600\nG2X20.Z0I5.\nG3X30.Z10.I0.K10.F1200\nG1Z0\n"), {}),
    "G19": (part("G19G1Y10.F600\nG2Y20.Z0J5.\nG3Y30.Z10.J0.K10.F1200\nG1Z0\n"), {}),
    "three planes": (part("G1X10.F900\nG18G2X20.Z0I5.\nG17G3X25.Y5.J5.\nG19G2Y10.Z5.K5.\nG17G1X0\n"), {}),
    "helices": (part("G1X10.F900\n" + "".join(f"G2X10.Y0Z-{k + 1}.I-5.\n" for k in range(8))), {}),
    "helix G18": (part("G1X10.F900\nG18\n" + "".join(f"G3X10.Z0Y{k + 1}.I-5.\n" for k in range(4))), {}),
    "dense N": (part("".join(f"N{10 + k}G1X{(k + 1) * 0.003:.3f}Y{k % 3 * 0.002:.3f}F3000\n" for k in range(300))), {}),
    "comments": (part("G1X1.F600\n(AAA)\nX2.(BBB)\n\nY5.\n(CCC)\n"), {}),
    "comments around words": (part("G1X10.F600(A)\n(A)G1X20.(B)\n(C)\nX30.(D)(E)\n"), {}),
    "N alone": (part("N5G1X1.F600\nN10\nN20(X)\nX2.\nN30 G90\nY5.\nN40\n"), {}),
    "N repeated": (part("N5G1X1.F600\nN5X2.\nN5\nN7Y5.\nN7X0\n"), {}),
    "large coordinates": (part("G1X90010.F600\nY-89990.\nG3X90020.I5.\n", HEAD.replace("X0Y0", "X90000.Y-90000.")), {}),
    "edge of the range": (part("G1X99999.F600\nY-99999.\n", HEAD.replace("X0Y0", "X99990.Y-99990.")), {}),
    "F1": (part("G1X.5F1.0\nY.3\n"), {}),
    "F5": (part("G1X.5F5.0\nY.3\n"), {}),
    "F in 5 decimals": (part("G1X10.F600.12345\nX11.\n"), {}),
    "fast": (part("G1X100.F15000\nG2X150.Y-50.R50.\nG1Y-100.\n"), {}),
    "fast corner": (part("G1X100.F15000\nY100.\nG2X150.Y50.R50.\nG1Y0\n"), {}),
    "tiny": (part("G1X.0004F100\nX.0002\n"), {}),
    "one increment": (part("G1X.001F100\n"), {}),
    "a few increments": (part("G1X.0015F100\nX.0025\nG2X.0125I.005\n"), {}),
    "small arcs": (part("G1X1.F600\nG2X1.Y0I-.05\nG3X1.I.01\nG2X1.I.001F60\nG1X2.\n"), {}),
    "zero moves": (part("G1X0F600\nX10.\nX10.\nY0\nY10.\nY10.\nG1\nF300\nX20.\n"), {}),
    "steep helix": (part("G1X1.F500\nG19G2X1.5Y-.016Z.015J.288K.305\n"), {}),
    "plunge and retract": (part("Z2.\nG1Z-1.F300\nX10.F900\nY10.\nZ2.\n"), {}),
    "G93": (part("G93G1X10.F30.\nY10.F15.\nX0F20.\nM5\n"), {}),
    "G93 to G94": (part("G93G1X10.F30.\nY10.F15.\nG94X0F200\n"), {}),
    "G52": (part("G1X10.F600\nY5.\nG52X100.\nG1X-80.\nG52X0\nG1X0\n"), {}),
    "G92": (part("G1X10.F600\nY5.\nG92X100.\nG1X120.\nG1X0\n"), {}),
    "idle codes": (part("G1X10.F600\nG54\nY5.\nG21\nX0.\nG49\nG40G1Y0.\n"), {}),
    "lower case": (part("G1X10.F600\nY5.\n").lower(), {}),
    "LF CR CR": (part("G1X10.F600\nY5.\n").replace("\n", "\n\r\r"), {}),
    "R negative": (part("G1X10.F900\nG2X20.Y0R-20.\nG3X10.R-6.\n"), {}),
    "full circles": (part("G1X10.F900\nG2I-10.\nG3I-10.F300\nG2X10.Y0I5.\n"), {}),
    "block skip of modes": (part("G1X10.F600\n/N20G1Y5.\nN30X20.Y5.\n/G91\nG90G1X0\nY0\n"), {}),
    "optional skip": (part("G1X10.F600\n/Y5.\nX20.Y0\n/M8\nX30.\n"), {}),
    "dwell": (part("G1X10.F600\nG4P500\nX20.\nG04X.5\nX30.\n"), {}),
    "M S T": (part("G1X10.F600\nX20.M8\nS500\nX30.\nM0\nY5.\nT2\nY0.\n"), {}),
    "G91 from unknown": (G91_UNKNOWN, {}),
    "G91 with Z unknown": ("%\nG21G94\nG90G0X0Y0\nG91\nG1X10.F600\nZ5.\nG2X5.Y5.I5.\nG90X20.Y20.R50.\nM30\n%\n", {}),
    "G91 and back": (part("G91\nG1X10.F600\nZ5.\nG2X5.Y5.I5.\nG90\nG1X0.\nY0.\nG91\nM5\nG90\n"), {}),
    "no tape marks": ("G90G21G94G17\nG0X0Y0Z0\nG1X10.F600\nM30", {}),
    "ends inside a region": ("%\nG90G21G94G17\nG0X0Y0Z0\nG1X10.F600\nY5.\n%", {}),
    "O below the cut": ("%\nG21G17G90G94\nG0X0Y0Z0\nG1X10.F600\nO1234\nG1X20.\nM30\n%\n", {}),
    "prologue": (
        part("G1X10.F600\nY10.\nG4P100\nG1X0\n"),
        {"emission.prologue": ["G05.1Q0", "G64"], "emission.epilogue": ["G05.1Q1"], "emission.prefill_dwell_s": 0.1},
    ),
    "own filter 24 ms": (part("G1X10.F600\nY10.\nX20.\nG2X30.I5.\n"), {"controller.shaped_time_constant_s": 0.024}),
    "carry": (part("G1X10.F600\nY10.\nX20.\nG2X30.I5.\n"), {"controller.block_end": "carry"}),
    "IS-C": (part("G1X10.F600\nY10.0004\nX20.1234\nG2X30.1234I5.\n"), {"controller.least_increment_mm": 0.0001}),
    "IS-C inch": (part("G1X1.F40.\nY1.\nG2X2.Y0.I0.J-1.F20.\n", INCH), {"controller.least_increment_inch": 0.00001}),
    "IS-A": (part("G1X10.F600\nY10.\nX20.12\nG2X30.12I5.\n"), {"controller.least_increment_mm": 0.01}),
    "F without decimals": (part("G1X10.F600\nY10.\nG2X20.I5.\n"), {"controller.feed_decimals_mm": 0}),
    "no header": (part("G1X10.F600\nY10.\n"), {"emission.header": False}),
    "no merging": (part("G1X10.F600\nG2X20.I5.\n"), {"emission.merge_tolerance_increments": 0.0}),
    "after interpolation": (part("G1X10.F600\nY10.\nG2X20.I5.\n"), {"controller.motion": "after_interpolation"}),
    "jerk limited": (
        part("G1X10.F900\nY10.\nG2X20.I5.\n"),
        {"controller.law": "jerk_limited", "controller.bell_time_s": 0.02},
    ),
    **{
        f"block period {ms} ms": (
            part("G1X10.F1200\nY10.\nX20.\nG2X30.I5.\nG1X50.\n"),
            {"controller.block_time_s": 0.001, "emission.block_period_s": ms * 1e-3},
        )
        for ms in (1, 2, 4, 8)
    },
}


#: What they are about is in another case too, among more.
SLOW_CASES = {
    "G18", "G19", "helix G18", "F5", "fast corner", "a few increments", "lower case",
    "block period 2 ms", "block period 4 ms",
}  # fmt: skip
MARKED_CASES = [pytest.param(name, marks=pytest.mark.slow) if name in SLOW_CASES else name for name in CASES]


@functools.cache
def case(name: str) -> Judged:
    text, keys = CASES[name]
    return convert(text, machine_with(keys))


@pytest.mark.parametrize("name", MARKED_CASES)
def test_case(name: str) -> None:
    judged = case(name)
    whole_periods(judged)
    check_figures(judged, contour_budget_s=3.0)


CRLF_CASES = ("inch", "G61", "three planes", "comments", "comments around words", "N alone", "tiny", "G93 to G94",
              "optional skip", "G91 from unknown", "ends inside a region", "O below the cut", "prologue")  # fmt: skip


@pytest.mark.parametrize("name", CRLF_CASES)
def test_case_with_crlf(name: str) -> None:
    text, keys = CASES[name]
    judged = convert(text.replace("\n", "\r\n"), machine_with(keys))
    lines = judged.conversion.text.decode("latin-1").split("\n")
    assert all(line.endswith("\r") for line in lines[:-1])
    assert judged.conversion.text.replace(b"\r", b"") == case(name).conversion.text


@pytest.mark.parametrize("name", MARKED_CASES)
def test_emitted_blocks_are_plain(name: str) -> None:
    """Between safe line and restore line stand nothing but N, G, axis words, R, F in this order, and comments."""
    judged = case(name)
    machine = judged.machine
    frame = [*machine.emission.prologue, *machine.emission.epilogue]
    lines = judged.emitted.split("\n")
    for entry in judged.conversion.to_dict()["regions"]:
        first, last = (line - judged.header_lines for line in entry["emitted_lines"])
        inside = [line for line in lines[first - 1 : last] if line not in frame and not line.startswith("(")]
        safe = [line for line in inside if "G94G40G64G01" in line]
        assert len(safe) == 1
        for line in inside[inside.index(safe[0]) + 1 : -1]:
            assert BLOCK.fullmatch(line) or line.startswith("G04P"), line
            assert len(line) <= machine.emission.max_line_length


def test_no_final_newline_and_end_inside_a_region() -> None:
    text = part("G1X10.F600\nY10.\n")[:-1]
    assert convert(text, machine_with()).conversion.text.endswith(b"M30\n%")
    ends_inside = CASES["ends inside a region"][0]
    assert convert(ends_inside, machine_with()).conversion.text.endswith(b"\n%")


@pytest.mark.parametrize(
    "text",
    [
        "%\nG90G21\nG0X0Y0Z0\nM30\n%",
        part("G81Z-5.R2.F100\nX10.\nG80\n"),
        part("G1X0F100\nX0Y0\n"),
        part("(ONLY TALK)\nM8\n"),
    ],
)
def test_program_without_cutting_moves_stays_as_it_is(text: str) -> None:
    judged = convert(text, machine_with())
    assert judged.conversion.text == text.encode()
    assert judged.conversion.to_dict()["regions"] == []
    assert any("unchanged" in w for w in judged.conversion.to_dict()["warnings"])


def test_bytes_of_a_comment_are_kept() -> None:
    """Whatever code page a shop's comments are in: their bytes are not the converter's."""
    text = part("G1X10.F600(\xe9)\n(\xfc\xb5)\nX0\n").encode("latin-1")
    lines = sg.convert(text, machine_with(), shape_all=True).text.split(b"\n")
    assert b"(\xe9)" in lines
    assert b"(\xfc\xb5)" in lines


COMPENSATED = part("G41D1G1X10.F600\nY10.\nG40G1X0\nG0X5.Y5.\nG1X20.,R2.\nY20.\n")


def test_compensation_is_refused_unless_the_machine_file_decides() -> None:
    machine = machine_with({"input.tool_radius_mm": {"1": 3.0}})
    for program in (COMPENSATED, sg.Program.from_text(COMPENSATED, machine, expand_compensation=False)):
        text = program if isinstance(program, sg.Program) else sg.Program.from_text(program, machine)
        with pytest.raises(sg.ProgramError, match="cutter compensation"):
            sg.convert(text, machine)


def test_compensation_that_is_kept_stays_to_the_letter() -> None:
    machine = machine_with({"input.compensation": "keep"})
    converted = sg.convert(sg.Program.from_text(COMPENSATED, machine, expand_compensation=False), machine)
    lines = converted.text.decode().split("\n")
    for line in ("G41D1G1X10.F600", "Y10.", "G40G1X0"):
        assert line in lines
    assert any("compensation" in warning for warning in converted.to_dict()["warnings"])


@pytest.mark.parametrize("guard", ["alarm", "stop"])
def test_expanded_compensation_says_so_and_guards_its_radius(guard: str) -> None:
    machine = machine_with(
        {
            "input.compensation": "expand",
            "input.tool_radius_mm": {"1": 3.0},
            "input.tool_radius_wear_mm": {"1": -0.02},
            "emission.compensation_guard": guard,
        }
    )
    converted = sg.convert(COMPENSATED, machine)
    text = converted.text.decode()
    assert converted.to_dict()["expanded_radii_mm"] == {"D1": 2.98}
    assert "(D1 RADIUS 2.98 MM EXPANDED - OFFSET DOES NOT ACT)\n" in text
    assert not re.search(r"G4[12](?!\d)|D1G|,R", text)
    if guard == "stop":
        assert "\nM00(CHECK D1 RADIUS 2.98 WITH WEAR)\n" in text
        return
    assert re.search(r"\nIF\[.*#13001\+#12001.*\]THEN#3000=1\(D1 CHANGED\)\n", text)
    # With another offset in the control the program stops before it moves.
    other = machine_with({"input.tool_radius_mm": {"1": 3.0}, "input.tool_radius_wear_mm": {"1": 0.01}})
    with pytest.raises(sg.ProgramError, match="3001"):
        sg.Program.from_text(text, other)


def test_a_radius_that_is_not_known_cannot_be_expanded() -> None:
    machine = machine_with({"input.compensation": "expand"})
    with pytest.raises(sg.ProgramError, match=r"radius of offset D1 is not known"):
        sg.convert(COMPENSATED, machine)


def test_inserted_lines_stand_at_every_region() -> None:
    lines = case("prologue").emitted.split("\n")
    for inserted in ("G05.1Q0", "G05.1Q1", "G04P100"):
        assert lines.count(inserted) == 2
    at = lines.index("G05.1Q0")
    assert lines[at + 1] == "G64"
    assert lines[at + 2].startswith("G17G90G94G40G64G01X0.")
    assert lines[at + 3] == "G04P100"


def test_prefill_dwell_counts_in_the_cycle_time() -> None:
    text, keys = CASES["prologue"]
    with_dwell = case("prologue").conversion.to_dict()["cycle_time_s"]["emitted"]
    without = convert(text, machine_with({**keys, "emission.prefill_dwell_s": 0.0}))
    assert with_dwell - without.conversion.to_dict()["cycle_time_s"]["emitted"] == pytest.approx(0.2)


def test_every_region_starts_with_a_full_safe_line() -> None:
    judged = sample("PROGRAM2.NC")
    lines = judged.emitted.split("\n")
    for _, moves, entry in judged.regions():
        first = entry["emitted_lines"][0] - judged.header_lines
        assert lines[first - 1].rstrip() == "(SHAPED)"
        line = lines[first]
        assert re.fullmatch(r"(N\d+)?G1[789]G9[01]G94G40G64G01(X\S+)?(Y\S+)?(Z\S+)?F\d+\.\d*\r?", line), line
        assert moves[0].length == pytest.approx(0.0, abs=1e-9) or np.isnan(moves[0].start).any()


def test_a_reversal_is_reached_or_reported() -> None:
    """What the tool does not reach is a contour error too, though it never leaves the line."""
    for feed in (3000, 15000):
        text = part(f"G1X50.F{feed}\nX0\n")
        judged = convert(text, machine_with())
        reached = max(m.end[0] for m in interpret(judged.emitted).cuts)
        stated = judged.conversion.to_dict()["contour_error_um"]["command"]["emitted"]["max"]
        assert (50.0 - reached) * 1e3 <= stated + 1.0, f"F{feed}: {reached}, reported {stated} um"


def test_original_after_interpolation_is_what_the_judge_plays() -> None:
    """The figures of the original, too, are the judge's: blocks at their feed, smoothed on each axis."""
    keys = {"controller.motion": "after_interpolation", "controller.time_constant_s": 0.05}
    judged = convert(part("G1X20.F900\nG3X40.Y20.R20.\nG1Y40.\n"), machine_with(keys))
    filtered = replace(judged, machine=machine_with({**keys, "controller.shaped_time_constant_s": 0.05}))
    for programmed, _, entry in judged.regions():
        run = figures(filtered, programmed, programmed, "ceil")
        for axis, ours in zip("xyz", run.residual, strict=True):
            assert close(ours, entry["residual_vibration_um"]["original"][axis])
        stated = judged.conversion.to_dict()["contour_error_um"]
        assert close(run.command[0], stated["command"]["original"]["max"])
        assert close(run.response[0], stated["response"]["original"]["max"])


def test_arc_feed_ratio_slows_arcs_before_they_begin() -> None:
    judged = convert(part("G1X40.F3000\nG3X60.Y20.R20.\nG1Y60.\n"), machine_with(), arc_feed_ratio=0.5)
    for _, moves, _ in judged.regions():
        on_arc = [m.feed for m in moves if m.end[0] > 41.0 and m.start[1] < 19.0]  # the whole arc may be one block
        assert on_arc
        assert max(on_arc) <= 1500.0 * 1.01
        assert max(m.feed for m in moves) == pytest.approx(3000.0, rel=0.01)


def test_corner_between_z_and_xy_is_a_forced_stop() -> None:
    judged = case("plunge and retract")
    for _, moves, _ in judged.regions():
        for move in moves:
            assert move.delta[2] == 0.0 or not move.delta[:2].any()


def check_made_up(text: str) -> None:
    judged = convert(text, machine_with())
    whole_periods(judged)
    check_figures(judged, contour_budget_s=1.0)


@settings(max_examples=8, deadline=None, suppress_health_check=list(HealthCheck))
@given(programs(max_contours=2, max_elements=5))
def test_made_up_program(text: str) -> None:
    check_made_up(text)


MANY = settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
test_many_made_up_programs = pytest.mark.slow(MANY(given(programs())(check_made_up)))
