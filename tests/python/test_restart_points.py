"""Restart points inside of shaped cuts, and what single block does there, by the judge's interpreter and player."""

import math
import re
from pathlib import Path

import numpy as np
import pytest

import shapegcode as sg
from command import run
from judge import Move, interpret
from judge.plant import response
from judge.player import durations, play
from shapegcode.conversion.restart import RestartPoint

HEAD = "G21 G90 G17 G54\nT3 M06\nS5000 M03\nG43 H3 Z50.\nG00 X0 Y0\nZ2.\n"


def zigzag(rows: int, *, numbered: bool = False) -> str:
    """Passes of 60 mm with a pause of the path at both ends: reversals in X, steps in Y."""
    lines = ["G01 Z-1. F600."]
    for row in range(rows):
        lines += [f"X{60 * (row % 2 == 0)}. F2400.", f"X{60 * (row % 2)}.", f"X{60 * (row % 2 == 0)}.", f"Y{row + 1}."]
    text = HEAD + "\n".join(f"N{10 * k + 10}{line}" if numbered else line for k, line in enumerate(lines))
    return f"%\nO0007\n{text}\nG00 Z50.\nM30\n%\n"


def circles(turns: int) -> str:
    """A path that is nowhere near rest: one polygon of many corners of less than a degree."""
    corners = 400
    points = [(20.0 * math.cos(2 * math.pi * k / corners), 20.0 * math.sin(2 * math.pi * k / corners)) for k in
              range(turns * corners + 1)]  # fmt: skip
    moves = "\n".join(f"X{x:.3f} Y{y:.3f}" for x, y in points)
    return f"%\nO0008\n{HEAD}G00 X20. Y0\nG01 Z-1. F600.\nF1500.\n{moves}\nG00 Z50.\nM30\n%\n"


def converted(text: str, **emission: float | bool) -> sg.Conversion:
    values = {f"emission.{key}": value for key, value in emission.items()}
    machine = sg.Machine.load("vx500").with_values(values, source="test")
    return sg.convert(sg.Program.from_text(text, machine, source="part.nc"), machine, shape_all=True)


def cuts(text: str) -> list[Move]:
    return [move for record in interpret(text).lines for move in record.moves if move.is_cut]


def point_lines(conversion: sg.Conversion) -> list[str]:
    lines = conversion.text.decode().splitlines()
    return [lines[point.line - 1] for point in conversion.restart_points]


def begin(moves: list[Move], point: RestartPoint) -> int:
    """Set-point at which the block of a point begins."""
    before = moves[: next(k for k, move in enumerate(moves) if move.line == point.line)]
    return round(float(durations(before).sum()) / 1e-3)


@pytest.fixture(scope="module")
def long_cut() -> sg.Conversion:
    return converted(zigzag(8), restart_interval_s=5.0)


def test_a_restart_point_changes_neither_path_nor_time(long_cut: sg.Conversion) -> None:
    without = converted(zigzag(8), restart_interval_s=1e6)
    assert not without.restart_points and len(long_cut.restart_points) >= 3
    ours, theirs = cuts(long_cut.text.decode()), cuts(without.text.decode())
    assert [(move.kind, move.feed) for move in ours] == [(move.kind, move.feed) for move in theirs]
    np.testing.assert_array_equal([move.end for move in ours], [move.end for move in theirs])
    np.testing.assert_array_equal(durations(ours), durations(theirs))
    # And nothing else stands there than the words of the points.
    pairs = zip(long_cut.text.decode().splitlines(), without.text.decode().splitlines(), strict=True)
    changed = [line for line, other in pairs if line != other and not line.startswith("(CHECKSUM")]
    assert changed == point_lines(long_cut)


def test_no_more_than_the_interval_lies_between_two_points(long_cut: sg.Conversion) -> None:
    times = [0.0, *(point.time_s for point in long_cut.restart_points), long_cut.regions[0].time_s.emitted]
    assert np.diff(times).min() > 0.4 and np.diff(times).max() < 5.1


def test_the_whole_modal_line_stands_at_a_point(long_cut: sg.Conversion) -> None:
    for point, line in zip(long_cut.restart_points, point_lines(long_cut), strict=True):
        assert re.fullmatch(rf"N{point.number}G17G21G90G54G94G40G64G01X-?[\d.]+Y-?[\d.]+Z-?[\d.]+F[\d.]+", line), line
        assert len(line) <= 60
        assert (point.tool, point.length_offset, point.coordinate_system) == (3, 3, "G54")
        assert point.spindle_rev_per_min == 5000.0


def test_a_program_that_begins_at_a_point_runs_the_rest_of_the_path(long_cut: sg.Conversion) -> None:
    lines = long_cut.text.decode().splitlines()
    whole = interpret(long_cut.text.decode())
    prologue = zigzag(8).split("G01 Z-1.")[0]
    for point in long_cut.restart_points:
        rest = interpret(prologue + "\n".join(lines[point.line - 1 :]) + "\n")
        expected = [move for record in whole.lines[point.line - 1 :] for move in record.moves]
        actual = [move for record in rest.lines for move in record.moves][-len(expected) :]
        assert [(move.kind, move.feed) for move in actual if move.is_cut] == [
            (move.kind, move.feed) for move in expected if move.is_cut
        ]
        np.testing.assert_allclose([move.end for move in actual], [move.end for move in expected], atol=1e-9)
        # Its own block goes where it went; the tool stands at the position of the list before it.
        np.testing.assert_allclose(expected[0].start, point.position_mm, atol=1e-9)
        first = next(record for record in rest.lines if record.text.startswith(f"N{point.number}G"))
        before = whole.lines[point.line - 1]
        for key in ("plane", "distance", "units", "wcs", "feed_mode", "comp", "length_offset", "motion", "F"):
            assert first.modal[key] == before.modal[key], key


def test_the_command_is_nearly_at_rest_where_a_point_stands(long_cut: sg.Conversion) -> None:
    moves = cuts(long_cut.text.decode())
    speed = np.linalg.norm(np.diff(play(moves), axis=0), axis=1) / 1e-3
    for point in long_cut.restart_points:
        tick = begin(moves, point)
        assert speed[max(tick - 2, 0) : tick + 2].max() < 0.25 * 2400.0 / 60.0
        assert point.vibration_um <= 20.0 and point.speed_mm_per_s <= 0.2 * 2400.0 / 60.0


def test_a_start_at_a_point_leaves_what_is_said_of_it(long_cut: sg.Conversion) -> None:
    moves = cuts(long_cut.text.decode())
    modes = [(46.0, 0.02), (131.0, 0.02), None]
    whole = play(moves)
    for point in long_cut.restart_points[:3]:
        tick = begin(moves, point)
        span = slice(tick, min(tick + 200, len(whole)))
        _, _, started = response(whole[span], modes, 1e-3)
        _, _, went_on = response(whole[: span.stop], modes, 1e-3)
        off_um = np.abs(started - went_on[-len(started) :]).max() * 1e3
        # Said of a table that follows its mode at once: within a fifth, and increments of 1 µm.
        assert off_um < 1.2 * point.vibration_um + 1.5


def test_numbers_of_the_program_are_left_to_it() -> None:
    numbered = zigzag(8, numbered=True).replace("N20X", "N99999X").replace("N30X", "N10002X")
    conversion = converted(numbered, restart_interval_s=5.0)
    words = [int(word) for word in re.findall(r"^N(\d+)", conversion.text.decode(), re.MULTILINE)]
    assert len(words) == len(set(words))
    own = {int(word) for word in re.findall(r"N(\d+)", numbered)}
    points = {point.number for point in conversion.restart_points}
    assert points and not points & own and points | own == set(words)


def test_an_interval_below_a_block_period_is_refused(tmp_path: Path) -> None:
    (tmp_path / "part.nc").write_text(zigzag(2))
    told = run(
        tmp_path, "convert", "part.nc", "-m", "vx500", "-o", "out.nc", "--set", "emission.restart_interval_s=0.002"
    )
    assert told.returncode == 2
    assert "emission.restart_interval_s = 0.002 s: must be at least a block period, which is 0.005 s" in told.stderr


def test_a_cut_of_unknown_position_has_none_and_says_why() -> None:
    moves = "\n".join(f"X{60 if k % 2 == 0 else -60}. Y0.5" for k in range(12))
    text = f"%\nO0009\nG21 G91 G17 G54\nG01 F2400.\n{moves}\nG90\nM30\n%\n"
    conversion = converted(text, restart_interval_s=5.0)
    assert b"G91" in conversion.text and not conversion.restart_points
    note = next(each.text for each in conversion.at_the_control if each.topic == "restart")
    assert "the position of X, Y, Z is not known" in note
    # Where the position is known, a program in G91 has points in G90, and its mode back behind the cut.
    known = converted(text.replace("G21 G91", "G21 G90 G00 X0 Y0 Z5.\nG91"), restart_interval_s=5.0)
    assert known.restart_points and all("G90" in line for line in point_lines(known))
    assert interpret(known.text.decode()).lines[known.placed[0].last_line - 1].modal["distance"] == "G91"


def test_a_further_coordinate_system_stands_in_the_list_and_not_in_the_cut() -> None:
    conversion = converted(zigzag(8).replace("G17 G54\n", "G17\nG54.1 P3\n"), restart_interval_s=5.0)
    assert {point.coordinate_system for point in conversion.restart_points} == {"G54.1P3"}
    assert all("G90G94" in line for line in point_lines(conversion))


@pytest.mark.parametrize("system", ["G55", "G59"])
@pytest.mark.parametrize("end", ["\r\n", "\n\r\r"], ids=["CR LF", "LF CR CR"])
def test_points_of_a_program_in_inch_with_other_line_ends(system: str, end: str) -> None:
    text = zigzag(8).replace("G21", "G20").replace("G54", system)
    text = re.sub(r"([XYZ])(-?[\d.]+)", lambda word: f"{word[1]}{float(word[2]) / 25.4:.4f}", text)
    text = text.replace("F2400.", "F94.5").replace("F600.", "F23.6").replace("\n", end)
    conversion = converted(text, restart_interval_s=5.0)
    lines = conversion.text.decode().split(end)
    assert len(conversion.restart_points) >= 3
    for point in conversion.restart_points:
        line = lines[point.line - 1]
        assert re.fullmatch(rf"N{point.number}G17G20G90{system}G94G40G64G01X[-.\d]+Y[-.\d]+Z[-.\d]+F[\d.]+", line), line


def test_without_a_place_of_rest_there_are_points_only_where_stops_are_asked_for() -> None:
    text = circles(3)
    none = converted(text, restart_interval_s=5.0)
    note = next(each.text for each in none.at_the_control if each.topic == "restart")
    assert len(none.restart_points) <= 1 and "emission.restart_stops = true adds a stop" in note
    stopped = converted(text, restart_interval_s=5.0, restart_stops=True)
    note = next(each.text for each in stopped.at_the_control if each.topic == "restart")
    assert len(stopped.restart_points) >= 2
    told = re.search(r"(\d+) of these points are stops that were added .*: ([\d.]+) s more, and a dwell mark", note)
    cost_s = stopped.cutting_time_s.emitted - none.cutting_time_s.emitted
    assert float(told[2]) == pytest.approx(cost_s, abs=0.1) and cost_s > 0.05
    moves = cuts(stopped.text.decode())
    speed = np.linalg.norm(np.diff(play(moves), axis=0), axis=1) / 1e-3
    for point in stopped.restart_points:
        tick = begin(moves, point)
        assert speed[tick - 2 : tick + 2].max() < 2.5


def test_what_single_block_does_is_as_the_independent_player_has_it() -> None:
    conversion = converted(zigzag(1))
    note = next(each.text for each in conversion.at_the_control if each.topic == "single block")
    told = re.search(r"lines (\d+) to (\d+) would take .* \((\d+) stops, .*marks of up to (\d+) µm", note)
    assert "graphic display, machine lock, or dry run above the part" in note
    first, last, stops, mark_um = map(int, told.groups())
    moves = [move for move in cuts(conversion.text.decode()) if first <= move.line <= last and move.length > 0.0]
    assert stops == len(moves)
    largest_um = 0.0
    for move in moves:
        _, command, table = response(play([move]), [(46.0, 0.02), (131.0, 0.02), None], 1e-3, rest_s=0.1)
        largest_um = max(largest_um, float(np.abs(table - command).max()) * 1e3)
    assert mark_um == pytest.approx(largest_um, rel=0.03, abs=0.6)


def test_the_list_is_in_tables_and_json(long_cut: sg.Conversion) -> None:
    point = long_cut.restart_points[0]
    assert isinstance(point, RestartPoint)
    assert f"N{point.number}" in "".join(map(str, long_cut.tables()))
    report = long_cut.to_json()["restart_points"]
    assert [each["number"] for each in report] == [each.number for each in long_cut.restart_points]
