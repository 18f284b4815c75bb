"""A conversion on one core and on several: the same bytes, the same verdict, the same refusal."""

import random
import threading
import zlib
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest

import shapegcode as sg
from shapegcode import _core
from shapegcode.conversion import convert as module, write
from shapegcode.conversion.whole_text import Prefetch
from shapegcode.conversion.write import RegionWriter
from shapegcode.program import stamp
from shapegcode.results.json import plain


def pockets(count: int) -> str:
    """Squares and arcs of several sizes, each of them a region of its own."""
    lines = ["G21 G17 G90 G54"]
    for index in range(count):
        x, side = 12.0 * index, 6.0 + index % 3
        lines += [
            f"G00 X{x:.3f} Y0. Z5.", "G01 Z0. F1000.", f"G01 X{x + side:.3f} F{2000 + 100 * index}.", f"Y{side:.3f}",
            f"G03 X{x:.3f} Y{side:.3f} R{side:.3f}", "G01 Y0.", "G00 Z5.",
        ]  # fmt: skip
    return "\n".join([*lines, "M30", ""])


def converted(text: str, threads: int, monkeypatch: pytest.MonkeyPatch, **values: Any) -> sg.Conversion:
    monkeypatch.setattr(module, "cores", lambda: threads)
    machine = sg.Machine.load("vx500").with_values({"shaping.least_gain_um": 0.0, **values})
    return sg.convert(sg.Program.from_text(text, machine, source="pockets.nc"), machine)


def test_the_text_does_not_depend_on_the_number_of_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    one, two, five = (converted(pockets(9), threads, monkeypatch) for threads in (1, 2, 5))
    assert len(one.placed) == 9
    for other in (two, five):
        assert other.text == one.text
        assert plain(other) == plain(one)


def test_what_has_no_room_does_not_depend_on_it_either(monkeypatch: pytest.MonkeyPatch) -> None:
    # Room for some of the regions, not for all.
    whole = converted(pockets(9), 2, monkeypatch)
    values = {"controller.max_program_moves": whole.blocks.read + whole.blocks.emitted // 2}
    one, five = (converted(pockets(9), threads, monkeypatch, **values) for threads in (1, 5))
    assert 0 < len(one.placed) < 9
    assert (five.text, five.warnings) == (one.text, one.warnings)


def test_what_was_written_for_a_feed_that_does_not_hold_leaves_no_trace(monkeypatch: pytest.MonkeyPatch) -> None:
    """Some seconds of slow lines, then a corner that must be slowed: the pieces written before it are void."""
    monkeypatch.setattr(write, "_PIECE_PERIODS", 64)
    lines = ["G21 G17 G90 G54", "G00 X0. Y0. Z0.", "G01 X0.1 F600."]
    lines += [f"X{2.0 * k:.3f} Y{0.001 * (k % 2):.3f}" for k in range(1, 32)]
    lines += ["X80. F3000.", "Y40.", "X50. Y60.", "M30", ""]
    withdrawn: list[bool] = []
    begin_anew = _core.RegionShaper.begin_anew

    def noted(self: _core.RegionShaper) -> bool:
        withdrawn.append(begin_anew(self))
        return withdrawn[-1]

    monkeypatch.setattr(_core.RegionShaper, "begin_anew", noted)
    text = "\n".join(lines)
    early = converted(text, 2, monkeypatch, **{"tolerance.contour_um": 4.0})
    assert withdrawn == [True]
    assert len(early.placed) == 1
    monkeypatch.setattr(_core.RegionShaper, "begin_early", lambda _self: None)
    assert converted(text, 2, monkeypatch, **{"tolerance.contour_um": 4.0}).text == early.text
    assert withdrawn == [True]


def test_regions_are_shaped_at_the_same_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two threads meet within the shaping of two regions: neither goes on before the other has begun."""
    meeting = threading.Barrier(2, None, 60.0)
    write_region = RegionWriter.write

    def both(self: RegionWriter, program: sg.Program, region: _core.Region, *rest: Any) -> Any:
        meeting.wait()
        return write_region(self, program, region, *rest)

    monkeypatch.setattr(RegionWriter, "write", both)
    assert len(converted(pockets(2), 2, monkeypatch).placed) == 2


def test_the_first_refusal_in_the_text_is_the_one_that_is_told() -> None:
    def task(number: int) -> Callable[[Callable[[float], None]], int]:
        def run(on_share: Callable[[float], None]) -> int:
            on_share(0.5)
            if number in (3, 7):
                raise ValueError(number)
            return number

        return run

    for threads in (1, 2, 5):
        told: list[float] = []
        with ThreadPoolExecutor(threads) as pool:
            ahead = Prefetch(pool, {n: task(n) for n in range(9)}, dict.fromkeys(range(9), 2.0), told.append)
            assert [ahead.result(number) for number in range(3)] == [0, 1, 2]
            with pytest.raises(ValueError, match="3"):
                ahead.result(3)
        assert told == sorted(told)
        assert told[-1] >= 8.0


def test_the_mark_of_a_long_text_is_that_of_its_plain_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    """Looked at in pieces, with what does not count strewn over it: the CRC of the lines themselves."""
    rng = random.Random(1)
    plain_lines = [f"G01X{rng.uniform(0.0, 99.0):.3f}Y{index}.F200." for index in range(3000)]
    strewn = []
    for index, line in enumerate(plain_lines):
        number = f"N{index}" if index % 3 == 0 else ""
        comment = "(a (b)".replace("(b", "b") if index % 5 == 0 else ""
        strewn.append(f"{number} {line.lower().replace('y', ' y')}{comment}" + ("\r\n\r\n" if index % 7 == 0 else "\n"))
    text = ("%\nO0001\n" + "".join(strewn) + "%\n").encode()
    expected = f"{zlib.crc32(chr(10).join(plain_lines).encode()):08X}"
    for chunk in (64, 1000, 1 << 20):
        monkeypatch.setattr(stamp, "_CHUNK", chunk)
        assert stamp.text_mark(text) == expected
