"""Two programs compared: against LinuxCNC's interpreter, the judge's, and programs with one thing changed."""

import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings

import shapegcode as sg
from acceptance import SAMPLE_KEYS, SAMPLES, machine_with, read_sample
from command import run
from judge import interpret
from judge.draws import draw
from judge.generate import programs
from judge.plant import distances_from_polyline
from judge.samples import PROGRAMS
from random_verdict import convert
from rs274_tool import canonical_moves, run_rs274
from test_rapids import PROGRAM as RAPIDS
from test_second_opinion import TOOLS, for_rs274

MACHINE = sg.Machine.load("vx500")
PART = """%
O0001(PART)
G21 G17 G90 G94 G40 G49 G80
T1 M06
G54
S3000 M03
G00 X0 Y0
G43 H1 Z20. M08
Z2.
G01 Z-1. F200.
X30. F600.
Y20.
G00 Z20.
X50. Y0.
Z2.
G01 Z-1. F200.
G03 X50. Y20. R10. F500.
G04 P500
G00 Z20.
M09
T2 M06
S4000 M03
G55
G00 X80. Y5.
G43 H2 Z20.
G99 G81 X80. Y5. Z-5. R2. F100.
X90.
G80
M10
G52 X1. Y0. Z0.
M05
M30
%
"""
SHAPED = ["PROGRAM2.NC", "CONTOUR_R.NC", "G17_18_19.NC", "VINT_360arc.NC", "helical_bore.nc", "BOTTLE.NC"]
RANDOM = settings(max_examples=25, deadline=None, suppress_health_check=list(HealthCheck))


def compared(original: str, emitted: str, allow: str = "") -> sg.Comparison:
    read = [sg.Program.from_text(text, MACHINE, source=name) for text, name in ((original, "a.nc"), (emitted, "b.nc"))]
    return sg.compare(read[0], read[1], MACHINE, allow=allow)


def line_of(text: str, line: str) -> int:
    return text.splitlines().index(line) + 1


@pytest.mark.parametrize("name", SAMPLES)
def test_a_program_is_the_same_as_itself(name: str) -> None:
    machine = machine_with(SAMPLE_KEYS.get(name))
    program = sg.Program.read(PROGRAMS / name, machine)
    result = sg.compare(program, program, machine)
    assert result.ok and not result.differences and result.path_um == 0.0
    assert all(not each.differs for each in result.counts)


MUTATIONS = {
    # What is changed, into what, kind, line of the original, line of the other program.
    "a rapid moved": ("X50. Y0.\nZ2.", "X50. Y0.5\nZ2.", "rapids", 14, 14),
    "a tool swapped": ("T2 M06", "T3 M06", "tools", 21, 21),
    "another speed": ("S4000", "S4100", "spindle", 22, 22),
    "the spindle the other way": ("S3000 M03", "S3000 M04", "spindle", 6, 6),
    "H dropped": ("G43 H2 Z20.", "Z20.", "offsets", 25, None),
    "another H": ("H2", "H3", "offsets", 25, 25),
    "another work offset": ("G55", "G56", "offsets", 23, 23),
    "a local offset": ("G52 X1.", "G52 X1.1", "offsets", 30, 30),
    "coolant off dropped": ("M09\n", "", "coolant", 20, None),
    "coolant on dropped": (" M08", "", "coolant", 8, None),
    "a dwell changed": ("G04 P500", "G04 P600", "dwells", 18, 18),
    "a clamp dropped": ("M10\n", "", "functions", 29, None),
    "a stop added": ("M10\n", "M10\nM01\n", "stops", None, 30),
    "a hole dropped": ("X90.\n", "", "cycles", 27, None),
    "a hole deeper": ("Z-5. R2.", "Z-5.5 R2.", "cycles", 26, 26),
    "another feed": ("X30. F600.", "X30. F700.", "feeds", 11, 11),
    "another feed of holes": ("R2. F100.", "R2. F120.", "feeds", 26, 26),
    "a block divided": ("X30. F600.", "X10. F600.\nX30.", "blocks", 10, 10),
    "the path moved": ("Y20.\nG00 Z20.\nX50. Y0.", "Y20.01\nG00 Z20.\nX50. Y0.", "path", 10, 12),
    "another radius": ("R10. F500.", "R10.5 F500.", "path", 17, 16),
    "exact stops in a cut": ("X50. Y0.\nZ2.\n", "X50. Y0.\nZ2.\nG61\n", "modal", 16, 17),
    "a part of a cut dropped": ("X30. F600.\nY20.\n", "", "cuts", 10, 10),
}


@pytest.mark.parametrize("name", MUTATIONS)
def test_one_change_is_found_where_it_stands(name: str) -> None:
    old, new, kind, line, other_line = MUTATIONS[name]
    assert PART.count(old) == 1
    result = compared(PART, PART.replace(old, new))
    found = [each for each in result.differences if each.kind == kind]
    assert (found[0].original_line, found[0].emitted_line) == (line, other_line), result.differences
    assert not result.ok and result.exit_code == 1
    # And nothing that has nothing to do with it.
    follows = {"cuts": {"feeds", "blocks", "path"}, "rapids": {"path", "cuts"}}
    if name == "another radius":
        follows["path"] = {"cuts"}  # a third of a circle less
    assert {each.kind for each in result.differences} <= {kind} | follows.get(kind, set()), result.differences
    words = {"path=50mm", *({kind} | follows.get(kind, set())) - {"path"}}
    assert sg.compare(
        sg.Program.from_text(PART, MACHINE), sg.Program.from_text(PART.replace(old, new), MACHINE), MACHINE, allow=words
    ).ok


def test_a_cut_that_is_gone_and_cuts_that_change_places() -> None:
    first = "G01 Z-1. F200.\nX30. F600.\nY20.\n"
    second = "G01 Z-1. F200.\nG03 X50. Y20. R10. F500.\n"
    gone = compared(PART, PART.replace(first, "")).differences
    assert [(each.kind, each.original_line, each.emitted_line) for each in gone] == [("cuts", 10, None)]
    # Approach and cut of both contours the other way round.
    head, tail = PART[: PART.index("G00 X0 Y0")] + "G43 H1 Z20. M08\n", "M30\n%\n"
    one, other = f"G00 X0 Y0\nZ2.\n{first}G00 Z20.\n", f"G00 X50. Y0.\nZ2.\n{second}G00 Z20.\n"
    base, swapped = head + one + other + tail, head + other + one + tail
    result = compared(base, swapped)
    moved = [each for each in result.differences if each.kind == "order" and each.original.startswith("cut")]
    begins = {line_of(base, "G00 X50. Y0.") + 2, line_of(base, "X30. F600.") - 1}
    assert len(moved) == 1 and moved[0].original_line in begins
    assert result.count("cuts").unchanged == 1 and result.path_um == 0.0
    # A closed cut the other way round has the same ends and the same length.
    square = "G01 X10. F500.\nY10.\nX0\nY0\n"
    turned = "G01 Y10. F500.\nX10.\nY0\nX0\n"
    assert compared(PART.replace(first, square), PART.replace(first, turned)).path_um > 9000.0
    small, other_way = "G01 X0 F500.\nG03 I0.05 J0 F100.\n", "G01 X0 F500.\nG02 I0.05 J0 F100.\n"
    assert compared(PART.replace(first, small), PART.replace(first, other_way)).path_um > 90.0


def judged_cuts(text: str, machine: sg.Machine, centre: str) -> tuple[int, list[np.ndarray]]:
    """Rapids outside of cycles, and points of each run of cuts between them, as the judge reads them."""
    rapids, runs, open_run = 0, [], False
    for record in interpret(text, arc_centre=centre, calculator_decimal_point=True).lines:  # type: ignore[arg-type]
        for move in record.moves:
            if move.kind == "rapid":
                rapids, open_run = rapids + (not move.cycle), False
            elif move.is_cut and not np.isnan(move.start).any() and move.length > 0.0:
                points = move.points(np.linspace(0.0, 1.0, max(2, int(np.ceil(move.length / 0.02)) + 1)))
                if open_run:
                    runs[-1] = np.vstack([runs[-1], points])
                else:
                    runs.append(points)
                open_run = True
    return rapids, runs


@pytest.mark.parametrize("name", SHAPED)
def test_a_shaped_program_is_as_near_as_the_judge_finds_it(name: str, tmp_path: Path) -> None:
    machine = machine_with(
        {**SAMPLE_KEYS.get(name, {}), "emission.prologue": ["G05.1Q0"], "shaping.least_gain_um": 0.0}
    )
    conversion = sg.convert(sg.Program.read(PROGRAMS / name, machine), machine)
    emitted = tmp_path / "shaped.nc"
    emitted.write_bytes(conversion.text)
    limit_um = machine.tolerance.contour_um * 3.0
    result = sg.compare(PROGRAMS / name, emitted, machine, allow=f"feeds,blocks,path={limit_um}um")
    assert result.ok, list(result.refused)
    for kind in ("rapids", "tools", "spindle", "coolant", "offsets", "functions", "stops", "cuts", "cycles", "modal"):
        assert not result.count(kind).differs, result.counts
    assert re.fullmatch(
        r"(\d+) of \1 rapids, (\d+) of \2 tool calls, (\d+) of \3 offsets unchanged; "
        r"programmed paths within \d+\.\d µm of each other",
        result.answer,
    )
    centre = machine.input.arc_centre
    _, ours = judged_cuts(read_sample(name), machine, centre)
    _, theirs = judged_cuts(conversion.text.decode("ascii"), machine, "incremental")
    ours = [run for run in ours if len(run) > 1]
    worst_um = max(
        1e3 * max(distances_from_polyline(a, b).max(), distances_from_polyline(b, a).max())
        for a, b in zip(ours, theirs, strict=True)
    )
    # The judge takes the nearest place of the whole cut, also where that is another pass.
    assert worst_um - 0.05 <= result.path_um <= worst_um * 1.2 + 0.2


@RANDOM
@given(text=programs(cycles=False, inch=False))
def test_counts_are_those_of_linuxcnc(text: str, tmp_path_factory: pytest.TempPathFactory) -> None:
    text = re.sub(r"(?m)^.*G28.*\n", "", text)
    theirs = "\n".join(line for line in for_rs274(text, MACHINE).splitlines() if not line.startswith("G28"))
    lines = run_rs274(theirs, tmp_path_factory.mktemp("rs274"), tools=TOOLS)
    result = compared(text, text)
    assert not result.differences
    for kind, call in (("rapids", "STRAIGHT_TRAVERSE"), ("tools", "CHANGE_TOOL"), ("dwells", "DWELL")):
        assert result.count(kind).original == sum(f"{call}(" in line for line in lines), (kind, text)
    cuts = [move for move in canonical_moves(lines) if move.kind in ("line", "arc") and move.length_mm > 1e-3]
    assert bool(cuts) == (result.count("cuts").original > 0)


@pytest.mark.parametrize("seed", range(6))
def test_of_a_random_program_shaping_changes_nothing_else(seed: int) -> None:
    """Macros, coordinate modes, cycles, offsets and inches: all but feeds, blocks and path stays."""
    case = convert(draw(seed), shape_all=True)
    original = sg.Program.from_text(case.drawn.text, case.machine)
    emitted = sg.Program.from_text(case.conversion.text, case.machine, emitted=True)
    result = sg.compare(original, emitted, case.machine, allow="feeds,blocks,calls,path=0.1mm")
    assert result.ok, list(result.refused)
    assert result.count("cuts").original > 0


def test_shaped_rapids_are_a_difference_of_their_own() -> None:
    machine = machine_with({"shaping.rapids": True})
    program = sg.Program.from_text(RAPIDS, machine)
    conversion = sg.convert(program, machine, shape_all=True)
    emitted = sg.Program.from_text(conversion.text, machine, emitted=True)
    shaped = sum(region.was_rapid for region in emitted.regions)
    result = sg.compare(program, emitted, machine, allow="feeds,blocks,path=60um,shaped-rapids")
    found = [each for each in result.differences if each.kind == "shaped-rapids"]
    assert len(found) == shaped > 0
    assert result.ok, list(result.refused)
    assert result.count("rapids").unchanged == result.count("rapids").original - shaped
    assert not sg.compare(program, emitted, machine, allow="feeds,blocks,path=60um").ok


@pytest.mark.parametrize("lock", [("#33=#3004", "#3004=[#33OR2]"), ("M49",)])
def test_lines_around_cuts_are_allowed_with_blocks(lock: tuple[str, ...]) -> None:
    unlock = ("G53", "#3004=#33") if len(lock) > 1 else ("M48",)
    machine = machine_with(
        {
            "emission.override": "lock",
            "emission.lock_lines": list(lock),
            "emission.unlock_lines": list(unlock),
            "emission.prefill_dwell_s": 0.5,
            "emission.epilogue": ["G05.1Q1"],
            "shaping.least_gain_um": 0.0,
        }
    )
    program = sg.Program.read(PROGRAMS / "CONTOUR_R.NC", machine)
    emitted = sg.Program.from_text(sg.convert(program, machine).text, machine, emitted=True)
    result = sg.compare(program, emitted, machine, allow="feeds,blocks,path=60um")
    assert result.ok, list(result.refused)
    assert any(each.kind == "emission" for each in result.differences)
    # Taken away they are not covered.
    assert not sg.compare(emitted, program, machine, allow="feeds,blocks,path=60um").ok
    assert not sg.compare(program, emitted, machine, allow="feeds,path=60um").ok


def test_programs_with_little_in_common_are_aligned() -> None:
    """Far more differences than one pass of the alignment follows."""
    places = np.random.default_rng(5).integers(0, 100_000, (6000, 2))
    ours = [f"G00 X{x / 1000:.3f} Y{y / 1000:.3f}" for x, y in places[:4000]]
    theirs = [line for rank, line in enumerate(ours) if rank % 3]
    for rank, (x, y) in enumerate(places[4000:]):
        theirs.insert(2 * rank, f"G00 X{x / 1000:.3f} Y{y / 1000:.3f}")
    head, tail = "%\nO1\nG21 G90\n", "M30\n%\n"
    result = compared("\n".join([head, *ours, tail]), "\n".join([head, *theirs, tail]))
    common = sum(rank % 3 > 0 for rank in range(4000))
    count = result.count("rapids")
    assert (count.original, count.emitted) == (4000, len(theirs))
    assert 0.98 * common <= count.unchanged <= common
    assert result.count("stops").unchanged == 1


CALLING = (
    "%\nO0001\nG21 G17 G90 G94 G40 G49 G80\nT1 M06\nG54 S3000 M03\nG00 X0 Y0\nG43 H1 Z2.\nG01 Z-1. F200.\nM98 P100\n"
    "G65 P200 A5.\nG00 Z20.\nM30\nO0100\nX10.\nM99\nO0200\nG01 Y#1\nM99\n%\n"
)


def test_an_expanded_macro_differs_in_calls() -> None:
    program = sg.Program.from_text(CALLING, MACHINE, source="a.nc")
    plain = sg.Program.from_text(program.expanded_text, MACHINE, source="b.nc")
    result = sg.compare(program, plain, MACHINE)
    found = [(each.kind, each.original_line, each.emitted_line) for each in result.differences]
    assert found == [("calls", 9, None), ("calls", 10, None)]
    assert sg.compare(program, plain, MACHINE, allow="calls").ok
    assert sg.compare(program, program, MACHINE).ok


def test_inch_and_mm_are_compared_in_mm() -> None:
    def inch(match: re.Match[str]) -> str:
        return f"{match[1]}{float(match[2]) / 25.4:.4f}"

    words = re.sub(r"([XYZRF])(-?\d+\.?\d*)(?![\d.])", inch, PART).replace("G21", "G20")
    result = compared(PART, words, "feeds,path=3um")
    assert [each.kind for each in result.refused] == ["units"]
    assert result.path_um < 3.0


def test_a_program_that_is_cut_off(tmp_path: Path) -> None:
    (tmp_path / "a.nc").write_text(PART)
    for text, line in ((PART[: PART.index("G03 X50.")], 16), (PART[: PART.index("Y20. R10.")], 16)):
        (tmp_path / "b.nc").write_text(text)
        for names in (("a.nc", "b.nc"), ("b.nc", "a.nc")):
            done = run(tmp_path, "compare", *names, "--json", "-")
            assert done.returncode == 1
            ends = f"ends early at line {line}"
            assert ends in done.stdout or "end" in done.stdout, done.stdout
        result = sg.compare(tmp_path / "a.nc", tmp_path / "b.nc")
        (end,) = [each for each in result.differences if each.kind == "end"]
        assert end.emitted.startswith(f"ends early at line {line}") and end.emitted_line == line


def test_the_command(tmp_path: Path) -> None:
    (tmp_path / "a.nc").write_text(PART)
    (tmp_path / "b.nc").write_text(PART.replace("X30. F600.", "X30. F700."))
    (tmp_path / "none.nc").write_text("%\nO1\nG1 X1Y\nM30\n%\n")
    same = run(tmp_path, "compare", "a.nc", "a.nc")
    assert same.returncode == 0 and "built-in machine vx500" in same.stdout
    unchanged = "9 of 9 rapids, 2 of 2 tool calls, 6 of 6 offsets unchanged"
    assert same.stdout.startswith(f"{unchanged}; programmed paths within 0.0 µm of each other")
    assert run(tmp_path, "compare", "a.nc", "b.nc").returncode == 1
    allowed = run(tmp_path, "compare", "a.nc", "b.nc", "-m", "vx500", "--allow", "feeds")
    assert allowed.returncode == 0 and "built-in machine" not in allowed.stdout
    (tmp_path / "c.nc").write_text(PART.replace("X30. F600.\nY20.", "X30. Y0.02 F600.\nX30.05 Y20."))
    step = run(tmp_path, "compare", "a.nc", "c.nc").stdout.splitlines()[-1]
    allow = step.rpartition(" allow it: ")[2].rstrip(".").split()
    assert run(tmp_path, "compare", "a.nc", "c.nc", *allow).returncode == 0
    for words, said in (
        (("--allow", "feed"), "unknown kind of difference; known are cuts, rapids, tools"),
        (("--allow", "path=20"), "path needs a length with its unit"),
        (("--allow", "path=0um"), "must be above 0"),
        (("--allow", "path=-1um"), "must be above 0"),
        (("--allow", "path"), "path needs a length with its unit"),
    ):
        refused = run(tmp_path, "compare", "a.nc", "b.nc", *words)
        assert refused.returncode == 2 and said in refused.stderr, refused.stderr
    assert run(tmp_path, "compare", "a.nc", "none.nc").returncode == 2
    assert run(tmp_path, "compare", "a.nc", "missing.nc").returncode == 2


HEAD, TAIL = "%\nO1\nG21 G17 G90 G94 G40\nG00 X0 Y0 Z5.\n", "G00 Z50.\nM30\n%\n"
EXACT_STOPS = [
    "G61\nG01 X20. F5000\nY20.\nG64\n",
    "G01 X20. F5000\nY20.\nG61\nX0.\nG64\nG09 X30.\n",
    "G61 G01 X20. F5000\nY20.\nG64\n",
    "G61\nG01 X20. F5000\nG64\n",
    "G61\nG01 X10. F600\nY10.\nX0\nG64\nY0\n",
]


def stops(text: str) -> list[tuple[float, ...]]:
    """Where the tool comes to rest between cuts of absolute straight blocks, read word by word."""
    at, found, modal, motion = {"X": 0.0, "Y": 0.0, "Z": 0.0}, [], 64, 0
    for line in re.sub(r"\([^)]*\)", "", text).splitlines():
        words = [(letter, float(number)) for letter, number in re.findall(r"([A-Z])(-?[\d.]+)", line.replace(" ", ""))]
        codes = [number for letter, number in words if letter == "G"]
        modal = next((code for code in codes if code in (61, 64)), modal)
        motion = next((code for code in codes if code in (0, 1)), motion)
        before = dict(at)
        at.update((letter, number) for letter, number in words if letter in at)
        if motion == 1 and at != before and (modal == 61 or 9 in codes):
            found.append(tuple(at.values()))
    return found


@pytest.mark.parametrize("body", EXACT_STOPS)
def test_exact_stop_mode_survives_shaping(body: str) -> None:
    conversion = sg.convert(HEAD + body + TAIL, MACHINE, shape_all=True)
    assert not conversion.proof.refused
    assert stops(conversion.text.decode()) == stops(HEAD + body + TAIL) != []


def test_a_block_that_changes_to_g64_where_the_tool_is_cuts_nothing() -> None:
    original = HEAD + "G61\nG01 X20. F5000.\nY20.\nG64\n" + TAIL
    restated = "G61\nG64 G01 X{} Y0. Z5. F5000.\n{} X{}\nG61\n"
    emitted = HEAD + restated.format("0.", "X10.\nG09", "20.") + "G64 X20.\nY10.\nG09 Y20.\nG61\nG64\n" + TAIL
    assert compared(original, emitted, "blocks").ok
    # One stop less, and a block that does move.
    lost = compared(original, emitted.replace("G09 Y20.", "Y20."), "blocks")
    assert [each.kind for each in lost.refused] == ["modal"]
    assert not compared(original, emitted.replace("G64 X20.", "G64 X21."), "blocks").ok


def cut_along(points: np.ndarray) -> str:
    first, *rest = (f"X{x:.4f} Y{y:.4f}" for x, y in points)
    return HEAD.replace("X0 Y0", first) + "G01 F3000.\n" + "\n".join(rest) + "\n" + TAIL


def sawtooth(length_mm: float) -> np.ndarray:
    """Blocks of .01 mm, 18 µm high."""
    x = np.arange(0.0, length_mm + 0.005, 0.01)
    return np.column_stack([x, np.tile([0.0, 0.003, 0.006, 0.009, 0.012, 0.015, 0.018], x.size)[: x.size]])


def test_a_sawtooth_that_is_smoothed_is_the_same_cut() -> None:
    ours = sawtooth(28.0)
    length_mm = np.linalg.norm(np.diff(ours, axis=0), axis=1).sum()
    assert length_mm - 28.0 > 0.1 * length_mm + 1.0
    middle = [ours[0], (0.02, 0.009), (27.98, 0.009), ours[-1]]
    result = compared(cut_along(ours), cut_along(np.array(middle)), "blocks,feeds,path=30um")
    assert result.ok, list(result.refused)
    assert 9.0 <= result.path_um <= 16.0
    # The same way back, and less allowed than the tooth is away.
    assert compared(cut_along(np.array(middle)), cut_along(ours), "blocks,feeds,path=30um").ok
    assert not compared(cut_along(ours), cut_along(np.array(middle)), "blocks,feeds,path=5um").ok


RASTER = np.array([(x, y) for y in range(0, 40, 4) for x in ((0, 30) if y % 8 == 0 else (30, 0))] + [(0.0, 0.0)], float)
CIRCLE = np.array([(15.0 * np.cos(a), 15.0 * np.sin(a)) for a in np.linspace(0.0, 2.0 * np.pi, 100)])


@pytest.mark.parametrize(
    ("ours", "theirs"),
    [
        (RASTER, np.vstack([RASTER[:8], RASTER[12:]])),
        (RASTER, np.vstack([RASTER[:2], RASTER])),
        (CIRCLE, np.vstack([CIRCLE, CIRCLE[1:]])),
        (np.vstack([CIRCLE, CIRCLE[1:]]), CIRCLE),
        (CIRCLE, CIRCLE[::-1]),
        (sawtooth(28.0), np.array([(0.0, 0.0), (28.0, 0.0), (0.0, 0.0), sawtooth(28.0)[-1]])),
        (sawtooth(28.0), np.array([(0.0, 0.0), (15.0, 0.0), (8.0, 0.0), sawtooth(28.0)[-1]])),
    ],
    ids=["pass missing", "pass twice", "circle twice", "circle once", "circle backwards", "there and back", "one back"],
)
@pytest.mark.parametrize("allow", ["path=30um", "path=200um"])
def test_no_length_excuses_a_missing_doubled_or_reversed_part(ours: np.ndarray, theirs: np.ndarray, allow: str) -> None:
    assert not compared(cut_along(ours), cut_along(theirs), f"blocks,feeds,{allow}").ok


@pytest.mark.parametrize("step_mm", [0.3, 1.0, 4.0])
def test_the_proof_of_a_conversion_finds_that_two_of_sixty_passes_are_missing(step_mm: float) -> None:
    from shapegcode.conversion.outcome import prove

    passes = [(x, step_mm * y) for y in range(60) for x in ((0.0, 30.0) if y % 2 == 0 else (30.0, 0.0))]
    whole = np.array(passes)
    missing = np.vstack([whole[:40], whole[44:]])
    original, emitted = (sg.Program.from_text(cut_along(each), MACHINE) for each in (whole, missing))
    assert not prove(original, original, MACHINE, rapids_shaped=False).refused
    assert [each.kind for each in prove(original, emitted, MACHINE, rapids_shaped=False).refused] == ["path"]


def side_by_side_mm(ours: np.ndarray, theirs: np.ndarray, step_mm: float) -> float:
    """Discrete Fréchet distance (Eiter and Mannila 1994) of dense points: at most a step above that of the lines."""
    dense = []
    for points in (ours, theirs):
        along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
        at = np.union1d(along, np.arange(0.0, along[-1], step_mm))
        dense.append(np.column_stack([np.interp(at, along, points[:, axis]) for axis in (0, 1)]))
    gaps = np.linalg.norm(dense[0][:, None] - dense[1][None], axis=2)
    best = np.maximum.accumulate(gaps[0])
    for row in gaps[1:]:
        entered = np.minimum(best, np.concatenate([[np.inf], best[:-1]]))
        best = np.maximum(entered, row)
        for k in range(1, best.size):
            best[k] = max(row[k], min(entered[k], best[k - 1]))
    return float(best[-1])


@pytest.mark.parametrize("seed", range(6))
def test_paths_of_other_lengths_are_as_near_as_the_discrete_frechet_distance(seed: int) -> None:
    draws = np.random.default_rng(seed)
    # Back and forth along X too, so that the order in which the points come matters.
    ours = np.column_stack([np.linspace(0.0, 3.0, 60), np.zeros(60)]) + draws.normal(0.0, 0.12, (60, 2))
    theirs = np.column_stack([np.linspace(0.0, 3.0, 12), np.zeros(12)]) + draws.normal(0.0, 0.03, (12, 2))
    ours, theirs = ours.round(3), theirs.round(3)
    theirs[[0, -1]] = ours[[0, -1]]
    lengths = [np.linalg.norm(np.diff(each, axis=0), axis=1).sum() for each in (ours, theirs)]
    assert lengths[0] - lengths[1] > 0.1 * lengths[0] + 1.0
    expected = side_by_side_mm(ours, theirs, 0.01)
    for allowed_mm, is_same in ((expected + 0.001, True), (expected - 0.011, False)):
        result = compared(cut_along(ours), cut_along(theirs), f"blocks,feeds,path={allowed_mm * 1e3:.3f}um")
        assert result.ok == is_same
        assert (result.count("cuts").unchanged == 1) == is_same
