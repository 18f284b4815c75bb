"""Budgets of a conversion, measured on the emitted text by a reader and a clock that share no code with it."""

import functools
import itertools
import json
import math
import os
from dataclasses import replace
from pathlib import Path
from subprocess import CompletedProcess
from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st

import shapegcode as sg
from acceptance import Judged, convert, machine_with, read_sample
from command import run as run_command
from judge.player import durations
from shapegcode import _core

HEAD = "%\nO1\nG21G17G90G94\nG0X0Y0Z0\n"
TAIL = "G0Z50.\nM30\n%\n"
FEEDS = (9000, 60, 3000, 600, 12000, 1500, 6000)
#: Regions of one form at very different feeds, out of order: residuals of the original from 0.04 to 50 um.
PART = HEAD + "".join(f"G0X0Y0\nG1X{20 + k}.F{f}\nY{10 + k}.\nG0Z5.\n" for k, f in enumerate(FEEDS)) + TAIL
MACHINE = machine_with()
PERIOD = {"emission.block_period_s": 0.005}


def budgeted(text: str = PART, keys: dict[str, Any] | None = None, **limits: Any) -> Judged:
    """Converted under a budget; the judge holds shaped and kept lines against the original."""
    return convert(text, machine_with(keys), budget=sg.Budget(**limits))


@functools.cache
def free() -> Judged:
    """The part without a budget."""
    return convert(PART, MACHINE)


@functools.cache
def wide() -> Judged:
    """No region is written again, slower: its text is the first one of `free`."""
    return convert(PART, machine_with({"tolerance.contour_um": 50.0}))


def emitted_size(judged: Judged, entry: dict[str, Any]) -> int:
    """Bytes of a region's lines in the emitted text, less those of its lines in the original."""
    ours, theirs = judged.original.split("\n"), judged.conversion.text.decode().split("\n")
    (a, b), (c, d) = entry["lines"], entry["emitted_lines"]
    return sum(len(line) + 1 for line in theirs[c - 1 : d]) - sum(len(line) + 1 for line in ours[a - 1 : b])


def gain(entry: dict[str, Any]) -> float:
    was, now = (entry["residual_vibration_um"][side] for side in ("original", "emitted"))
    return float(max(was.values()) - max(now.values()))


def given_up(judged: Judged) -> set[int]:
    """First lines of the regions given up."""
    return {entry["lines"][0] for entry in judged.conversion.to_dict()["budget"]["left_unchanged"]}


def rates(judged: Judged) -> tuple[float, float]:
    """Bits per second and blocks per second of the busiest stretch, tick by tick."""
    report = judged.conversion.to_dict()
    tick = judged.machine.controller.interpolation_period_s
    stretch = round(report["shaper"]["times_s"][-1] / tick)
    lines = judged.emitted.split("\n")
    worst = np.zeros(2)
    for _, moves, _ in judged.regions():
        cuts = [move for move in moves if move.length > 0.0]
        ticks = np.round(durations(cuts, period_s=tick, block_end="ceil") / tick).astype(int)
        sizes = np.array([len(lines[move.line - 1]) + 1 for move in cuts])
        for which, amounts in enumerate((sizes, np.ones(len(cuts)))):
            flow = np.repeat(amounts / ticks, ticks)
            window = min(stretch, len(flow))
            worst[which] = max(worst[which], np.convolve(flow, np.ones(window), "valid").max() / (window * tick))
    return worst[0] * judged.machine.controller.dnc_bits_per_character, worst[1]


def test_least_gain_per_byte_is_given_up_first() -> None:
    """At every limit at which the choice changes, and one byte below."""
    entries = free().conversion.to_dict()["regions"]
    sizes = {entry["lines"][0]: emitted_size(free(), entry) for entry in entries}
    gains = {entry["lines"][0]: gain(entry) for entry in entries}
    assert min(sizes.values()) > 100
    assert max(gains.values()) > 40.0
    negative = sorted((line for line in sizes if gains[line] <= 0.0), key=gains.__getitem__)
    order = negative + sorted(set(sizes) - set(negative), key=lambda line: gains[line] / sizes[line])
    total = len(free().conversion.text)
    before = set[int]()
    for count in range(len(order)):
        prefix = set(order[:count])
        size = total - sum(sizes[line] for line in prefix)
        fits = budgeted(max_bytes=size)
        assert given_up(fits) == prefix
        assert len(fits.conversion.text) == size
        assert fits.conversion.shaped_cuts_within
        assert before <= prefix
        before = prefix
        if count + 1 == len(order):
            continue
        tighter = budgeted(max_bytes=size - 1)
        gone = given_up(tighter)
        # The next in the order goes; of the earlier ones those that gain something come back where there is room.
        assert order[count] in gone <= set(order[: count + 1])
        left = size - 1 - len(tighter.conversion.text)
        assert left >= 0
        assert all(sizes[line] > left for line in gone if gains[line] > 0.0)
    assert "keep their text" not in str(free().conversion.to_dict()["warnings"])


def test_what_is_given_up_is_said() -> None:
    limit = len(free().conversion.text) - 900
    report = budgeted(max_bytes=limit).conversion.to_dict()
    original = {tuple(e["lines"]): e for e in free().conversion.to_dict()["regions"]}
    budget = report["budget"]
    assert budget["limits"] == {"max_bytes": limit, "baud": None, "max_blocks_per_second": None}
    assert budget["before"]["bytes"] == len(free().conversion.text)
    assert budget["after"]["bytes"] == report["bytes_emitted"] <= limit
    assert budget["block_period_s"] == report["block_period_s"] == free().conversion.to_dict()["block_period_s"]
    assert len(budget["left_unchanged"]) + len(report["regions"]) == len(FEEDS)
    for entry in budget["left_unchanged"]:
        whole = original.pop(tuple(entry["lines"]))
        assert entry["residual_um"] == whole["residual_vibration_um"]["original"]
        assert entry["bytes"] == emitted_size(free(), whole)
        assert str(limit) in entry["reason"]
    (sentence,) = (warning for warning in report["warnings"] if "effect of the budget" in warning)
    first, last = budget["left_unchanged"][0]["lines"]
    assert (
        f"{len(budget['left_unchanged'])} of {len(FEEDS)} cuts are left unchanged (lines {first} to {last}" in sentence
    )


def test_everything_is_given_up_before_nothing_fits() -> None:
    judged = budgeted(max_bytes=len(PART))
    assert judged.conversion.text.decode() == PART
    assert judged.conversion.ok
    assert len(given_up(judged)) == len(FEEDS)
    with pytest.raises(sg.ArgumentError, match=rf"needs {len(PART)} bytes at least .* budget is {len(PART) - 1} bytes"):
        budgeted(max_bytes=len(PART) - 1)


def test_a_program_without_regions_may_be_too_large() -> None:
    text = HEAD + TAIL
    assert budgeted(text, max_bytes=len(text)).conversion.text.decode() == text
    with pytest.raises(sg.ArgumentError, match=f"needs {len(text)} bytes"):
        budgeted(text, max_bytes=len(text) - 1)


def test_a_region_that_becomes_shorter_is_shaped_although_the_original_is_too_large() -> None:
    """Thousands of points on a line: shaped they are fewer blocks."""
    points = "".join(f"G1X{k * 0.01:.2f}F3000.\n" for k in range(1, 3000))
    text = HEAD + points + TAIL
    free = convert(text, MACHINE)
    size = len(free.conversion.text)
    assert size < len(text)
    assert budgeted(text, max_bytes=size).conversion.text == free.conversion.text
    with pytest.raises(sg.ArgumentError, match=rf"needs {size} bytes at least \(the original has {len(text)}\)"):
        budgeted(text, max_bytes=size - 1)


def test_arcs_with_absolute_centres_cannot_be_given_up() -> None:
    text = HEAD + "G1X10.F60\nG2X20.Y0I15.J0\nG0Z5.\nG1X40.F6000\nG0Z9.\n" + TAIL
    keys = {"input.arc_centre": "absolute"}
    free = convert(text, machine_with(keys))
    arc, line = free.conversion.to_dict()["regions"]
    least = len(free.conversion.text) - emitted_size(free, line)
    fits = budgeted(text, keys, max_bytes=least)
    assert given_up(fits) == {line["lines"][0]}
    assert [entry["lines"] for entry in fits.conversion.to_dict()["regions"]] == [arc["lines"]]
    with pytest.raises(sg.ArgumentError, match=f"needs {least} bytes at least .* absolute centres"):
        budgeted(text, keys, max_bytes=least - 1)
    with pytest.raises(sg.ArgumentError, match="limit 1; their arcs have absolute centres"):
        budgeted(text, keys, max_blocks_per_second=1)


@functools.cache
def at_period(ms: int) -> Any:
    """The part on another block period: what several limits are held against."""
    return convert(PART, MACHINE, block_period_s=ms * 1e-3)


@pytest.mark.parametrize(
    ("limits", "which"),
    [
        pytest.param({"baud": 19200}, 0, marks=pytest.mark.slow),
        pytest.param({"baud": 16000}, 0, marks=pytest.mark.slow),
        pytest.param(
            {"baud": 9600},
            0,
            marks=[
                pytest.mark.slow,
                pytest.mark.xfail(
                    strict=True,
                    reason="the last block of lines 14 to 15, 1 um in 26 ms, has no F word: F2.4 lasts 25 ms",
                ),
            ],
        ),
        pytest.param({"max_blocks_per_second": 100}, 1, marks=pytest.mark.slow),
        pytest.param({"max_blocks_per_second": 20}, 1, marks=pytest.mark.slow),
    ],
    ids=str,
)
def test_the_shortest_shaper_whose_blocks_are_slow_enough(limits: dict[str, Any], which: int) -> None:
    (limit,) = limits.values()
    key = ("baud", "blocks_per_second")[which]
    judged = budgeted(**limits)
    report = judged.conversion.to_dict()
    assert rates(judged)[which] <= limit * (1 + 1e-9)
    assert rates(judged) == pytest.approx([report["budget"]["after"][k] for k in ("baud", "blocks_per_second")])
    assert report["budget"]["before"][key] == pytest.approx(rates(wide())[which])
    assert judged.conversion.ok
    assert not given_up(judged)
    chosen = round(report["block_period_s"] * 1e3)
    assert f"the block period is {chosen} ms instead of 5 ms" in str(report["warnings"])
    duration = report["shaper"]["times_s"][-1]
    for ms in range(5, 100):
        try:
            grid = sg.choose_grid(MACHINE, ms * 1e-3)
        except sg.DesignError:
            continue
        shorter = grid.shaper.duration_s - duration
        if shorter < -1e-9 or (shorter < 1e-9 and ms < chosen):
            other = at_period(ms)
            assert rates(other)[which] > limit, f"{ms} ms would do"


@functools.cache
def each_alone() -> dict[int, float]:
    """Blocks per second of every region by its first line, at the fixed block period and without a budget."""
    free = convert(PART, machine_with(PERIOD))
    found = {}
    for entry in free.conversion.regions:
        alone = replace(free, conversion=replace(free.conversion, regions=(entry,)))
        found[entry.lines[0]] = rates(alone)[1]
    return found


@pytest.mark.parametrize("limit", [99, 150, 200, *(pytest.param(k, marks=pytest.mark.slow) for k in (50, 100, 199))])
def test_with_a_fixed_block_period_only_the_fast_regions_are_given_up(limit: int) -> None:
    judged = budgeted(keys=PERIOD, max_blocks_per_second=limit)
    assert rates(judged)[1] <= limit * (1 + 1e-9)
    assert judged.conversion.to_dict()["block_period_s"] == 0.005
    for line, blocks_per_s in each_alone().items():
        assert (line in given_up(judged)) == (blocks_per_s > limit * (1 + 1e-9))


def test_an_argument_fixes_the_block_period_too() -> None:
    judged = convert(PART, MACHINE, block_period_s=0.005, budget=sg.Budget(baud=300))
    assert judged.conversion.to_dict()["block_period_s"] == 0.005
    assert len(given_up(judged)) == len(FEEDS)
    assert judged.conversion.text.decode() == PART
    assert "limit 300" in judged.conversion.to_dict()["budget"]["left_unchanged"][0]["reason"]


def test_what_misses_its_tolerance_only_for_the_longer_period_is_kept() -> None:
    """Circles within 1.2 um: 40 ms of them are no line."""
    circles = "G1X5.F3000\n" + "G2X5.Y0I5.\n" * 6 + "G1X0\n"
    text = HEAD + "G1X10.F600\nG0Z5.\nG0X0Y0\n" + circles + TAIL
    keys = {"tolerance.contour_um": 1.2, "shaping.contour": "command", "emission.rounding": "nearest"}
    assert convert(text, machine_with(keys)).conversion.ok
    judged = budgeted(text, keys, max_blocks_per_second=25)
    assert judged.conversion.shaped_cuts_within
    (entry,) = judged.conversion.to_dict()["budget"]["left_unchanged"]
    assert entry["lines"] == [8, 15]
    period_ms = judged.conversion.to_dict()["block_period_s"] * 1e3
    assert entry["reason"].endswith(f"limit 1.2 um, at a block period of {period_ms:g} ms")


def test_what_runs_too_fast_only_for_the_longer_period_is_kept() -> None:
    """A circle at F1, at whose feed blocks of that length do not last as long as they should."""
    keys = {"axes.x.modes": [], "axes.y.modes": [], "axes.z.modes": [{"frequency_hz": 46.0, "damping_ratio": 0.02}]}
    circles = "G1X5.F3000\n" + "G2X5.Y0I5.\n" * 6 + "G1X0\n"
    text = HEAD + "G03I.166J.116F1.\nG0Z5.\nX0Y0\n" + circles + TAIL
    assert convert(text, machine_with(keys)).conversion.ok
    judged = budgeted(text, keys, max_blocks_per_second=60)
    assert judged.conversion.shaped_cuts_within
    (entry,) = judged.conversion.to_dict()["budget"]["left_unchanged"]
    assert entry["lines"] == [5, 5]
    assert entry["reason"].startswith("runs in ")
    assert "too slow a feed" in entry["reason"]


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.slow) for name in ("TEST_G90.NC", "TEST_G91.NC", "PROGRAM2.NC")]
)
def test_sample_under_all_three(name: str) -> None:
    keys = {"controller.calculator_decimal_point": True}
    text = read_sample(name)
    free = convert(text, machine_with(keys))
    limit = (2 * len(free.conversion.text) + len(text)) // 3
    judged = budgeted(text, keys, max_bytes=limit, baud=38400, max_blocks_per_second=150)
    assert len(judged.conversion.text) <= limit
    baud, blocks = rates(judged)
    assert (baud <= 38400 * (1 + 1e-9), blocks <= 150 * (1 + 1e-9)) == (True, True)
    # The cuts left unchanged for the budget may miss their limits; the whole program is judged apart.
    assert judged.conversion.shaped_cuts_within


def test_comments_travel_on_the_line_too() -> None:
    text = HEAD + "G1X10.F600\n(" + "A" * 100 + ")\nY10.\n" + TAIL
    plain = text.replace("A" * 100, "A")
    loads = [budgeted(t, PERIOD, baud=1e9).conversion.to_dict()["budget"]["before"]["baud"] for t in (plain, text)]
    assert loads[1] > loads[0]


@given(st.lists(st.tuples(st.integers(1, 30), st.integers(0, 60)), min_size=1, max_size=30), st.integers(1, 50))
def test_busiest_stretch_is_that_of_every_stretch_tried(blocks: list[tuple[int, int]], stretch: int) -> None:
    ticks = np.array([duration for duration, _ in blocks])
    flow = np.repeat([amount / duration for duration, amount in blocks], ticks)
    window = min(stretch, len(flow))
    tried = max(math.fsum(flow[k : k + window]) for k in range(len(flow) - window + 1)) / window
    assert _core.busiest_per_s(ticks, [amount for _, amount in blocks], stretch) == pytest.approx(tried, abs=1e-12)


def test_a_budget_that_is_not_reached_changes_nothing() -> None:
    judged = budgeted(max_bytes=10**6, baud=10**6, max_blocks_per_second=1000)
    assert judged.conversion.text == free().conversion.text
    report = dict(judged.conversion.to_dict())
    budget = report.pop("budget")
    assert report == free().conversion.to_dict()
    assert budget["left_unchanged"] == []
    assert budget["before"] == budget["after"]
    assert "budget" not in free().conversion.to_dict()


@pytest.mark.parametrize(
    ("name", "value"),
    list(itertools.product(("max_bytes", "baud", "max_blocks_per_second"), (0, -1, math.nan, math.inf))),
)
def test_a_limit_is_finite_and_positive(name: str, value: float) -> None:
    with pytest.raises(sg.ArgumentError, match=f"budget {name} is .*must be finite and above 0"):
        sg.Budget(**{name: value})  # type: ignore[arg-type]


def run(folder: Path, *words: str) -> CompletedProcess[str]:
    (folder / "part.nc").write_text(PART)
    return run_command(folder, "convert", "part.nc", "-m", "vx500", "-o", "out.nc", *words)


def test_command(tmp_path: Path) -> None:
    done = run(tmp_path, "--max-bytes", "2k", "--baud", "38400", "--json", "report.json")
    assert (done.returncode, done.stderr) == (1, "")  # cuts that were given up stay out of their tolerance
    text = (tmp_path / "out.nc").read_bytes()
    assert len(text) <= 2048
    limits: dict[str, Any] = {"max_bytes": 2048, "baud": 38400.0, "max_blocks_per_second": None}
    budget = json.loads((tmp_path / "report.json").read_text())["budget"]
    assert budget["limits"] == limits
    assert budget["left_unchanged"]
    assert "effect of the budget" in done.stdout
    assert text == sg.convert(PART, MACHINE, budget=sg.Budget(**limits), shape_all=True).text


def test_command_with_an_impossible_budget_writes_nothing(tmp_path: Path) -> None:
    done = run(tmp_path, "--max-bytes", "50")
    assert done.returncode == 2
    assert f"part.nc: needs {len(PART)} bytes at least" in done.stderr
    assert "the budget is 50 bytes" in done.stderr
    assert os.listdir(tmp_path) == ["part.nc"]


@pytest.mark.parametrize(
    "words", [("--max-bytes", w) for w in ("0", "-1", "1T", "k", "nan")] + [("--baud", w) for w in ("0", "x", "inf")]
)
def test_command_refuses_limits_that_are_none(tmp_path: Path, words: tuple[str, str]) -> None:
    done = run(tmp_path, f"{words[0]}={words[1]}")
    assert done.returncode == 2
    assert words[0] in done.stderr
    assert os.listdir(tmp_path) == ["part.nc"]
