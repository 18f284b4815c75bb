"""Feeds written into programs, held against the judge's interpreter, which shares no code with the writer."""

import math

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import HealthCheck, Phase, given, settings, strategies as st

from judge.generate import programs
from judge.interpreter import interpret
from judge.records import Move
from shapegcode import _core
from shapegcode.machine import Machine
from shapegcode.program import MM_PER_INCH, Program, least_increment_mm

MIN_MM = 0.6
MACHINE = Machine.load("vx500")


def writer_options(region: _core.Region) -> _core.FeedWriterOptions:
    inch = region.exit.units == 20
    return _core.FeedWriterOptions(
        increment_mm=least_increment_mm(MACHINE, region.exit.units),
        unit_mm=MM_PER_INCH if inch else 1.0,
        position_decimals=4 if inch else 3,
        absolute_centres=False,
    )


Feeds = list[list[_core.FeedStretch]]


def with_random_feeds(program: Program, seed: int) -> tuple[str, Feeds, list[tuple[int, int]]]:
    """The text with random feeds in every region, those feeds, and the lines at which the regions stand there."""
    random = np.random.default_rng(seed)
    core = program.core
    parts, position, all_stretches, lines, line = [], 0, [], [], 1
    for region in program.regions:
        path, options = region.path, writer_options(region)
        stations = np.append(np.arange(0.3, path.length_mm - 0.3, 0.3), path.length_mm)
        feeds = 300.0 * np.exp(np.cumsum(random.normal(0.0, 0.3, len(stations))).clip(-2.0, 1.5))
        unit = MM_PER_INCH * 0.01 if region.exit.units == 20 else 0.1
        divisible = _core.divisible_segments(core, region, options)
        stretches = _core.schedule_feed(
            path.segment_ends_mm, np.zeros(len(path)), divisible, stations, feeds, MIN_MM, math.inf, unit
        )
        between, text = (
            core.slice(position, region.text_begin),
            _core.write_feeds(core, region, stretches, options).text,
        )
        parts += [between, text]
        line += between.count(b"\n")
        lines.append((line, line + text.count(b"\n") - (1 if text.endswith(b"\n") else 0)))
        line += text.count(b"\n")
        position = region.text_end
        all_stretches.append(stretches)
    parts.append(core.slice(position, core.size))
    return b"".join(parts).decode(), all_stretches, lines


def runs_of(moves: list[Move], lines: list[tuple[int, int]]) -> list[list[Move]]:
    """The cuts in each range of lines."""
    return [[move for move in moves if first <= move.line <= last and move.length > 0.0] for first, last in lines]


def points_at(run: list[Move], s_mm: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Displacement from the start of the run at distances along it."""
    ends = np.cumsum([move.length for move in run])
    out = np.empty((len(s_mm), 3))
    starts = np.vstack([np.zeros(3), np.cumsum([move.delta for move in run], axis=0)])
    for k, s in enumerate(s_mm):
        i = min(int(np.searchsorted(ends, s)), len(run) - 1)
        begin = ends[i] - run[i].length
        out[k] = starts[i] + run[i].offsets((s - begin) / run[i].length)[0]
    return out


@pytest.mark.slow
@settings(
    max_examples=15, deadline=None, phases=(Phase.explicit, Phase.generate), suppress_health_check=list(HealthCheck)
)
@given(text=programs(cycles=False), seed=st.integers(0, 2**32 - 1))
def test_other_feeds_leave_the_path_where_it_is(text: str, seed: int) -> None:
    program = Program.from_text(text, MACHINE)
    if program.core.expanded or not program.regions:
        return
    written, all_stretches, lines = with_random_feeds(program, seed)
    before, after = interpret(text), interpret(written)
    originals = runs_of(before.cuts, [(region.first_line, region.last_line) for region in program.regions])
    emitted = runs_of(after.cuts, lines)
    assert len(after.cuts) - sum(map(len, emitted)) == len(before.cuts) - sum(map(len, originals))
    for old, run, stretches, region in zip(originals, emitted, all_stretches, program.regions, strict=True):
        increment = least_increment_mm(MACHINE, region.exit.units)
        ends = np.cumsum([move.length for move in run])
        total = sum(move.length for move in old)
        # Pieces end on the increment: half of one beside the path in each axis, and as much along it.
        assert ends[-1] == pytest.approx(total, abs=increment * (len(run) + 1))
        samples = np.linspace(0.0, 1.0, 60)
        apart = np.linalg.norm(points_at(old, samples * total) - points_at(run, samples * ends[-1]), axis=1)
        assert apart.max() <= increment * (2.0 + len(run))
        nearest = [
            np.linalg.norm(points_at(old, np.linspace(s - 0.02, s + 0.02, 81).clip(0.0, total)) - p, axis=1).min()
            for s, p in zip(samples * total, points_at(run, samples * ends[-1]), strict=True)
        ]
        assert max(nearest) <= increment * math.sqrt(3.0) / 2.0 + 1e-3 * increment + 3e-4
        borders = np.array([stretch.end_mm for stretch in stretches])
        for move, end in zip(run, ends, strict=True):
            middle = (end - move.length / 2.0) * total / ends[-1]
            stretch = stretches[min(int(np.searchsorted(borders, middle)), len(stretches) - 1)]
            if np.abs(borders - middle).min() > 3.0 * increment:  # of a longer block than the border is rounded by
                assert move.feed == pytest.approx(stretch.feed_mm_per_min, rel=1e-6)
            original = any(abs(move.length - whole.length) < 2.5 * increment for whole in old)
            assert move.length >= MIN_MM - 2.0 * increment or original
    for name, value in before.modal.items():
        if name != "line":
            np.testing.assert_array_equal(value, after.modal[name], err_msg=name)


def test_everything_but_words_of_position_and_feed_stays() -> None:
    text = (
        "%\nO1\nG90 G54 G17 G21\nG00 X0. Y0.\nZ0.\nN10  G01 X3. F200. (first)\n(between)\nX4.  (as it is)\n"
        "N20 G02 X4. Y8. I0. J4.\nF77.\nG91 G01 Y.5\nG90\nX0.\nM05\nG01 Y0.\nM30\n%\n"
    )
    program = Program.from_text(text, MACHINE)
    region = program.regions[0]
    length = region.path.length_mm
    stretches = [_core.FeedStretch(0.0, 1.5, 150.0), _core.FeedStretch(1.5, length, 90.5)]
    refed = _core.write_feeds(program.core, region, stretches, writer_options(region))
    assert refed.text.decode() == (
        "N10  G01 X1.5 F150. (first)\nX3.F90.5\n(between)\nX4.  (as it is)\nN20 G02 X4. Y8. I0. J4.\nG91 G01 Y.5\n"
        "G90\nX0.\nF77.\n"
    )
    assert refed.blocks == 6
    assert refed.lines == [0, 1, 3, 4, 5, 7]


def test_a_full_circle_by_its_centre_and_an_arc_by_its_radius_are_divided() -> None:
    text = "G90 G54 G17 G21\nG00 X0. Y0. Z0.\nG01 X1. F100.\nG03 I4. J0.\nG02 X9. Y0. R4. F100.\nM30\n"
    program = Program.from_text(text, MACHINE)
    region = program.regions[0]
    length = region.path.length_mm
    cut = [1.0, 1.0 + 2.0 * math.pi, 1.0 + 8.0 * math.pi, 1.0 + 10.0 * math.pi]
    feeds = [100.0, 50.0, 60.0, 70.0, 80.0]
    borders = [0.0, *cut, length]
    stretches = [_core.FeedStretch(a, b, f) for a, b, f in zip(borders, borders[1:], feeds, strict=False)]
    written = _core.write_feeds(program.core, region, stretches, writer_options(region)).text.decode()
    assert written == (
        "G01 X1. F100.\nG03 X5. Y-4.I4. J0. F50.\nX1.Y0.I0.J4.F60.\nG02 X5. Y4. R4. F70.\nX9.Y0.R4.F80.\nF100.\n"
    ).replace("G03 X5. Y-4.I4. J0. F50.", "G03 I4. J0.X5.Y-4.F50.")


def test_a_piece_of_a_wide_arc_is_written_by_its_centre() -> None:
    text = "G90 G54 G17 G21\nG00 X0. Y0. Z0.\nG01 X1. F100.\nG02 X101. Y0. R50. F100.\nM30\n"
    program = Program.from_text(text, MACHINE)
    region = program.regions[0]
    length = region.path.length_mm
    stretches = [_core.FeedStretch(0.0, 1.64, 100.0), _core.FeedStretch(1.64, length, 50.0)]
    written = _core.write_feeds(program.core, region, stretches, writer_options(region)).text.decode()
    after = interpret(text.replace("G01 X1. F100.\nG02 X101. Y0. R50. F100.\n", written)).cuts
    assert [move.kind for move in after] == ["line", "arc", "arc"]
    for move in after[1:]:
        assert np.linalg.norm(move.centre[:2] - [51.0, 0.0]) < 0.002 if move.sweep and abs(move.sweep) > 1.0 else True
    assert sum(move.length for move in after) == pytest.approx(length, abs=0.003)


def test_a_stretch_that_ends_in_an_indivisible_block_is_refused() -> None:
    program = Program.from_text("G90 G54 G17 G21\nG00 X0. Y0. Z0.\nG01 G09 X10. F100.\nM30\n", MACHINE)
    region = program.regions[0]
    options = writer_options(region)
    assert _core.divisible_segments(program.core, region, options) == [False]
    stretches = [_core.FeedStretch(0.0, 4.0, 150.0), _core.FeedStretch(4.0, 10.0, 90.0)]
    with pytest.raises(_core.ArgumentError, match="line 3, which cannot be divided"):
        _core.write_feeds(program.core, region, stretches, options)
    with pytest.raises(_core.ArgumentError, match="must cover the region's path of 10"):
        _core.write_feeds(program.core, region, stretches[:1], options)
