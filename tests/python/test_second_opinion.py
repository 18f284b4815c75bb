"""LinuxCNC's interpreter, which shares nothing with the package, reads the same programs: same places, paths, feeds."""

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import shapegcode as sg
from acceptance import MOVE_KINDS, SAMPLE_KEYS, SAMPLES, machine_with, moves_of, read_sample
from rs274_tool import CanonicalMove, canonical_moves, run_rs274

DIALECT = Path(__file__).parents[1] / "golden" / "dialect"
SETTINGS: dict[str, dict[str, Any]] = {
    **SAMPLE_KEYS,
    "block_skip": {"input.block_skip": "on"},
    # Goes on in G91 behind a tool change: from a known place only if the change leaves the axes where they were.
    "TEST_G91.NC": {"input.tool_change_unknown_axes": ""},
}

#: Programs whose meaning differs in LinuxCNC or that it cannot read even when expanded, and why.
LEFT_OUT = {
    "boring_shift": "G76 is a threading cycle in LinuxCNC, G87 asks for I J K",
    "cycle_in_subprogram": "L0 (keep the cycle's data, drill nothing) is refused",
    "drilled_row": "K0 is refused; R and Z of a G90 cycle are read again as increments in G91",
    "rotated_drilling": "R and Z of a G90 cycle are read again as increments in G91",
}
#: What is taken out of a program (and put in its place) before both read it, and why.
CHANGED = {
    "G83.NC": ([(r"P500\.", "")], "a wait in G83 is refused"),
    "cycles_all": (
        [(r"G98(G..)?Y10\.", "G80\nG00Z50."), ("P300", "P0")],
        "with G98 behind G99 LinuxCNC goes to the next hole at the initial level; its G84 keeps P behind G80",
    ),
    "incremental_cycle": ([(r"G98X10\.\n", "")], "with G98 behind G99 LinuxCNC goes on at the initial level"),
    "inch": ([(r"G91X.*K2\n", "")], "R and Z of a G90 cycle are read again as increments in G91"),
    "planes": ([(r"G18G98G81.*\nZ20\.\n", "")], "LinuxCNC first lifts to R where a cycle begins below it"),
    "polar_bolt_circle": ([(r"G91Y45\.K7\n", "")], "R and Z of a G90 cycle are read again as increments in G91"),
}
#: Least retract between pecks: 0.01 inch in LinuxCNC, a parameter on a FANUC control.
PECK_MM = 0.254
NAMES = sorted(path.stem for path in DIALECT.glob("*.nc") if path.stem not in LEFT_OUT)
#: Dialect programs that are shaped as well, of every kind.
SHAPED = ["bolt_circle_g65", "ellipse", "g41_arcs", "g42_inner_pocket", "helix_thread", "local_shift_g52"]
SHAPED += ["mirrored_g51_1", "planes", "polar_bolt_circle", "rotated_pattern", "scaled_pocket", "spiral_ramp"]
SHAPED += ["subprogram_repeats", "while_pocket"]

#: The reference position is at 4000 inches: a place beyond half the way is one that the program does not tell.
HALF_WAY_MM = 50000.0
VARIABLES = "5161\t4000\n5162\t4000\n5163\t4000\n5220\t1\n"
TOOLS = "".join(f"T{number} P{number} Z0 D0\n" for number in range(1, 100))


def for_rs274(text: str, machine: sg.Machine, *, emitted: bool = False) -> str:
    """A plain FANUC program in LinuxCNC's words; only what the two write differently is touched."""
    assert machine.controller.calculator_decimal_point, "X1000 is 1000 mm to LinuxCNC"
    absolute = machine.input.arc_centre == "absolute" and not emitted
    skips = machine.input.block_skip == "on"
    out = ["%", to_home("XYZ"), "G90.1" if absolute else "G91.1", machine.power_on.cycle_return]
    for raw in text.splitlines():
        line = re.sub(r"\([^)]*\)", "", raw).strip()
        if line == "%" or re.match(r"[O#]|G10L1[0-3]", line):
            continue  # program numbers, kept lines of variables, tool offsets (compensation is worked out)
        if skips:
            line = line.split("/")[0]
        # Additional work offsets are those behind G54 here.
        line = re.sub(r"G10L20P(\d+)", lambda m: f"G10L2P{2 + int(m[1]) % 5}", line)
        line = re.sub(r"G54(?:\.1)?P(\d+)", lambda m: f"G{55 + int(m[1]) % 5}", line)
        # FANUC counts the offset in G91 from its last value.
        if line.startswith("G91G10L2P1"):
            out.append("G91")
            # The variables of the offsets stay in inches.
            line = re.sub(r"([XYZ])(-?[\d.]+)", lambda m: f"{m[1]}[#{5221 + 'XYZ'.index(m[1])}*25.4+{m[2]}]", line[3:])
        if re.search(r"G(28|30)(?!\d)", line):  # with G00 in the same block there: two codes that use X Y Z
            line = re.sub(r"(.*)G0?0(?!\d)(.*)", r"G00\n\1\2", line)
        # Clamps.
        line = re.sub(r"M1[01](?!\d)", "", line)
        # An exact stop changes no path; LinuxCNC has only the modal one.
        line = re.sub(r"G0?9(?![\d.])", "", line)
        if re.search(r"G0?4(?![\d.])", line):
            line = re.sub(r"X", "P", line) if "X" in line else milliseconds(line)
        elif "G10" not in line:
            line = milliseconds(line)
        # Holes of a cycle are counted with L, and a left-hand tap wants its spindle to turn to the left.
        if re.search(r"K\d+$", line) and not re.search(r"G0?[123](?!\d)", line):
            line = re.sub(r"K(\d+)$", r"L\1", line)
        # No wait in these cycles, in either reading; LinuxCNC refuses the word, and wants it in G86.
        if re.search(r"G(73|8[1345])(?!\d)", line):
            line = re.sub(r"P[\d.]+", "", line)
        if "G86" in line and "P" not in line:
            line += "P0"
        if "G74" in line:
            out.append("M04")
        out.append(line)
        if re.search(r"M0?6(?!\d)", line):
            out.append(to_home(machine.input.tool_change_unknown_axes))
    return "\n".join([*out, "%", ""])


def to_home(axes: str) -> str:
    """Puts axes where nobody knows, in G90 and in G91: what a tool change does here."""
    return "G28 " + " ".join(f"{axis}[#{5420 + 'XYZ'.index(axis)}*#<_absolute>]" for axis in axes) if axes else ""


def milliseconds(line: str) -> str:
    """P of a dwell or a cycle in seconds."""
    return re.sub(r"P([\d.]+)", lambda m: f"P{float(m[1]) / 1000.0:g}", line)


def their_moves(text: str, tmp_path: Path) -> list[CanonicalMove]:
    """rs274's moves between places that the program tells."""
    moves = []
    for move in canonical_moves(run_rs274(text, tmp_path, tools=TOOLS, variables=VARIABLES)):
        if move.kind == "dwell":
            moves += [move] * (move.dwell_s > 0.0)
        elif move.length_mm > 1e-9:
            if max(np.abs(move.start).max(), np.abs(move.end).max()) < HALF_WAY_MM:
                moves.append(move)
            else:
                assert move.kind == "rapid", f"a cut from or to an unknown place: {move}"
    return moves


def difference(theirs: CanonicalMove, segment: Any, dwell: float, increment_mm: float) -> str:
    """What is not the same, in words; empty where nothing is."""
    if theirs.kind == "dwell" or dwell > 0.0:
        return "" if math.isclose(dwell, theirs.dwell_s, abs_tol=1e-4) else f"dwell {dwell}"
    if MOVE_KINDS[segment.kind] != theirs.kind:
        return f"a {MOVE_KINDS[segment.kind]} to {segment.end_mm}"
    count = max(2, min(200, math.ceil(segment.length_mm / 0.5)) + 1)
    shares = np.linspace(0.0, 1.0, count)
    ours = np.array([segment.point_at(share * segment.length_mm) for share in shares])
    off = float(np.linalg.norm(ours - theirs.points(shares), axis=1).max())
    if off > increment_mm and not only_the_peck(theirs, segment, increment_mm):
        return f"up to {off:.5f} mm off; {segment.start_mm} to {segment.end_mm}"
    feed = segment.feed_mm_per_s * 60.0
    if theirs.kind != "rapid" and not math.isclose(feed, theirs.feed, rel_tol=1e-4, abs_tol=2e-3):
        return f"feed {feed}"
    return ""


def only_the_peck(theirs: CanonicalMove, segment: Any, increment_mm: float) -> bool:
    """Whether the moves are along Z, share one end, and the other is off by a difference of the peck's retract."""
    off = np.abs([theirs.start - segment.start_mm, theirs.end - segment.end_mm])
    along_z = np.abs(theirs.end - theirs.start)[:2].max() < increment_mm > off[:, :2].max()
    return bool(along_z and off.min(axis=0)[2] <= increment_mm and off.max() < 0.5 - PECK_MM + 1e-6)


def agree(program: sg.Program, text: str, machine: sg.Machine, tmp_path: Path) -> int:
    """How many moves and dwells of the program agree with rs274's reading of a text; a difference is a failure."""
    theirs, ours = their_moves(text, tmp_path), moves_of(program)
    inches = re.search(r"G20(?!\d)", text)
    increment_mm = machine.controller.least_increment_inch * 25.4 if inches else machine.controller.least_increment_mm
    for k, (move, (segment, dwell)) in enumerate(zip(theirs, ours, strict=False)):
        wrong = difference(move, segment, dwell, increment_mm)
        assert not wrong, f"move {k} of line {segment.line_number}: {wrong}; rs274: {move}"
    assert len(ours) == len(theirs), f"{len(ours)} moves, rs274 {len(theirs)}; next {theirs[len(ours) :][:1]}"
    return len(ours)


#: Long, or the same part as another sample.
SLOW_WRITTEN = ("BOTTLE.NC", "PROGRAM2.NC", "TEST_G91.NC")


def source(name: str) -> str:
    text = read_sample(name) if name in SAMPLES else (DIALECT / f"{name}.nc").read_text()
    for pattern, instead in CHANGED.get(name, ([], ""))[0]:
        text, count = re.subn(pattern, instead, text)
        assert count > 0
    return text


@pytest.mark.parametrize("name", [*SAMPLES, *NAMES])
def test_same_path_read(name: str, tmp_path: Path) -> None:
    machine = machine_with(SETTINGS.get(name))
    program = sg.Program.from_text(source(name), machine, source=name)
    expanded = program.expanded_text.decode("ascii")
    assert agree(program, for_rs274(expanded, machine), machine, tmp_path) > 0


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=pytest.mark.slow) if name in SLOW_WRITTEN else name for name in (*SAMPLES, *SHAPED)],
)
def test_same_path_written(name: str, tmp_path: Path) -> None:
    machine = machine_with({"input.compensation": "expand", **SETTINGS.get(name, {})})
    conversion = sg.convert(sg.Program.from_text(source(name), machine, source=name), machine, shape_all=True)
    # What is not shaped is written as it was, with what rs274 does not know.
    emitted = conversion.text if conversion.placed else conversion.emitted.expanded_text
    again = sg.Program.from_text(emitted, machine, source=f"shaped {name}", emitted=True)
    assert agree(again, for_rs274(emitted.decode("ascii"), machine, emitted=True), machine, tmp_path) > 0


def test_enough_is_compared() -> None:
    assert len(NAMES) >= 30
    assert len(SHAPED) >= 10
    assert set(SHAPED) <= set(NAMES)
    assert all((DIALECT / f"{name}.nc").is_file() for name in LEFT_OUT)


def test_differences_are_seen(tmp_path: Path) -> None:
    machine = machine_with()
    text = "%\nG21G17G90G94\nG00X0Y0Z0\nN100000G01X10.F300.\nG03X20.Y10.R10.\nG04P500\nM30\n%\n"
    program = sg.Program.from_text(text, machine)
    assert agree(program, for_rs274(text, machine), machine, tmp_path) == 3
    changes = [("X10.", "X10.002"), ("F300.", "F301."), ("R10.", "R10.02"), ("G03", "G02"), ("P500", "P501")]
    for was, now in [*changes, ("G04P500\n", ""), ("M30", "G01Y0\nM30")]:
        with pytest.raises(AssertionError):
            agree(program, for_rs274(text.replace(was, now), machine), machine, tmp_path)
