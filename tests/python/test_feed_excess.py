"""Speed along the path beside the programmed feed: kept, reported with its line, and a miss where it is not kept."""

import math

import numpy as np
import pytest

import shapegcode as sg
from acceptance import machine_with
from judge import interpret, play
from judge.in_order import Haste, Way, deviation_um, haste, places
from judge.records import Move
from shapegcode import _core
from shapegcode.conversion import plan, write

#: A corner into circles of some hundredths of a millimetre at F342: bringing the contour back asks for bursts.
SMALL_ARCS = (
    "%\nO1\nG21G17G90G94\nG0X-10.Y-28.913Z9.705\nG1Y-29.344F341.8\n"
    "G2X-9.994Y-29.337I-0.012J0.016\nG3X-9.986Y-29.343Z9.708I-0.008J-0.018F436.\n"
    "G2Z9.7I-0.05J-0.002\nG0Z50.\nM30\n%\n"
)
FEED_DROP = "%\nO1\nG21G17G90G94\nG0X0Y0Z0\nG1X20.F3000.\nX40.F300.\nX60.F3000.\nG0Z50.\nM30\n%\n"


def converted(text: str, **keys: object) -> tuple[sg.Conversion, Haste]:
    """A conversion, and where its set-points run fastest against the program as the judge has it."""
    machine = machine_with({key.replace("__", "."): value for key, value in keys.items()})
    conversion = sg.convert(text, machine, shape_all=True)
    (region,) = conversion.to_dict()["regions"]
    programmed = cuts(text, region["lines"])
    found = []
    for rule in ("ceil", "carry"):
        points = play(cuts(conversion.text.decode(), region["emitted_lines"]), block_end=rule)  # type: ignore[arg-type]
        way, within = Way.of(programmed), 2e-3 * (region["contour_error_um"] + 1.0)
        s = places(points, way, within, 5.0)
        assert s is not None
        found += [
            haste(points, s, programmed, 0.001, window=5 * count, slack_mm=within, increment_mm=0.001)
            for count in (1, 4, 16)
        ]
    return conversion, max(found, key=lambda each: each.ratio)


def cuts(text: str, lines: list[int]) -> list[Move]:
    return [m for r in interpret(text).lines[lines[0] - 1 : lines[1]] for m in r.moves if m.length > 0.0]


def test_corrections_on_small_arcs_keep_the_feed() -> None:
    free, measured = converted(SMALL_ARCS, tolerance__feed_excess_ratio=10.0)
    assert measured.ratio > 1.07, "the case has lost its point"
    assert free.feed_excess.ratio == pytest.approx(measured.ratio, abs=0.05)
    assert free.feed_excess.line == measured.line
    kept, measured = converted(SMALL_ARCS)
    assert measured.ratio <= 1.05
    assert kept.feed_excess is not None and kept.feed_excess.ratio <= 1.05
    assert kept.ok
    assert kept.contour_error_um.response.emitted.max <= 20.0


def test_a_lower_feed_is_reached_before_it_begins_and_kept_to_its_end() -> None:
    free, measured = converted(FEED_DROP, tolerance__feed_excess_ratio=10.0)
    assert measured.ratio > 1.1 and measured.line == 6
    assert (free.feed_excess.line, free.feed_excess.programmed_mm_per_min) == (6, pytest.approx(300.0))
    kept, measured = converted(FEED_DROP)
    assert measured.ratio <= 1.05
    # It costs no more than the shaper at both ends of the slow line.
    assert kept.cutting_time_s.emitted - free.cutting_time_s.emitted < 2.0 * kept.shaper.duration_s


@pytest.fixture
def unlimited(monkeypatch: pytest.MonkeyPatch) -> None:
    """The core plans without a limit of the feed excess."""
    options = write.RegionWriter.options

    def options_of(self: write.RegionWriter, *args: object) -> _core.ShapingOptions:
        found = options(self, *args)  # type: ignore[arg-type]
        found.feed_excess_ratio = math.inf
        return found

    monkeypatch.setattr(write.RegionWriter, "options", options_of)


@pytest.mark.usefixtures("unlimited")
def test_what_runs_too_fast_is_a_miss_that_says_where(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plan, "_MIN_FEED_RATIO", 1.0)
    conversion, measured = converted(SMALL_ARCS)
    assert not conversion.ok
    (miss,) = conversion.misses()
    assert f"mm/min where line {measured.line} programs 341.8" in miss and miss.endswith("limit 5 %")
    (row,) = [r for r in conversion.tables()[0].rows if r.figure == "speed above the programmed feed"]
    assert row.limit == pytest.approx(5.0) and row.emitted > 5.0


@pytest.mark.usefixtures("unlimited")
def test_a_region_that_runs_too_fast_is_slowed() -> None:
    conversion, measured = converted(SMALL_ARCS)
    assert measured.ratio <= 1.05
    assert conversion.ok


@pytest.mark.parametrize("ratio", [0.0, 0.009, 11.0, math.nan])
def test_the_least_that_corrections_ask_for(ratio: float) -> None:
    with pytest.raises(sg.MachineError, match="feed_excess_ratio"):
        machine_with({"tolerance.feed_excess_ratio": ratio})


def circle(turns: int) -> list[Move]:
    lines = "\n".join(["G3I-10."] * turns)
    return interpret(f"G21G90G17G0X10.Y0Z0\nG1X10.001F600.\nG1X10.\n{lines}\nM30").cuts[2:]


def test_a_second_turn_is_not_the_first() -> None:
    """A motion that leaves out the second half of the first turn follows two turns badly, though all of it lies on
    them."""
    angle = np.linspace(0.0, 4.0 * math.pi, 4001)
    whole = np.column_stack([10.0 * np.cos(angle), 10.0 * np.sin(angle), 0.0 * angle])
    way = Way.of(circle(2))
    assert deviation_um(whole, way, 0.0, ahead=1.0) < 0.1
    out_and_back = np.concatenate([whole[:1000], whole[999::-1]])
    assert deviation_um(out_and_back, way, 0.0, ahead=40.0) > 1000.0


def test_speed_beside_the_feed() -> None:
    moves = interpret("G21G90G17G0X0Y0Z0\nG1X10.F600.\nX20.F1200.\nM30").cuts
    speed = np.concatenate([[0.0], np.full(500, 11.0), np.full(725, 20.0)])  # mm/s, where 10 and 20 are programmed
    points = np.column_stack([np.cumsum(speed) * 0.001, 0.0 * speed, 0.0 * speed])
    s = places(points, Way.of(moves), 1e-4, 1.0)
    assert s is not None
    found = haste(points, s, moves, 0.001, window=80, slack_mm=1e-4, increment_mm=0.001)
    assert (found.line, found.feed) == (2, pytest.approx(600.0))
    # Where the motion is at 20 mm/s already, the path still says 10.
    assert found.speed == pytest.approx(1200.0 - 60.0 * 0.002 / 0.08, rel=1e-6)
