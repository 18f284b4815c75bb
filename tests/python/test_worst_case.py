"""The cases of the verdict against the judge's player and plant, which share no code with the package."""

import cmath
import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import shapegcode as sg
from acceptance import Judged, close, convert, machine_with
from command import run
from judge import Mode, Move, contour_error_um, durations, play, residual_um, response, starts
from judge.plant import distances_from_polyline
from judge.player import BlockEnd, moving_average
from shapegcode.cli import main
from shapegcode.io.units import FloatArray
from shapegcode.model.machine_model import MachineModel
from shapegcode.results.outcome import Deviation
from shapegcode.shaping import choose_shaper
from shapegcode.verdict.figures import CaseFigures, RegionLimits, judge_region, stated_cases

TICK = 0.001
UNCERTAIN = {
    "axes.x.modes": [
        {
            "frequency_hz": 46.0,
            "damping_ratio": 0.02,
            "frequency_uncertainty_percent": 5.0,
            "damping_uncertainty_percent": 20.0,
        }
    ],
    "axes.y.modes": [{"frequency_hz": 131.0, "damping_ratio": 0.02, "frequency_uncertainty_percent": 3.0}],
}
# The path of paper 000 at 200 mm/s, and a slanting leg behind it.
PART = "%\nO1\nG21G17G90G94\nG54G00X0.Y0.\nG01X20.F12000\nG03X40.Y20.R20.\nG01Y40.\nX60.Y50.\nG00X0.\nM30\n%\n"
# Of the vibration only what equal blocks leave with the dial turned is too much.
STRICT = {
    "tolerance.contour_um": 500.0,
    "tolerance.residual_ratio": 0.0,
    "tolerance.residual_floor_um": 0.5,
    "tolerance.residual_floor_increments": 0.5,
}
LINE = "%\nO2\nG21G17G90G94\nG54G00X0.Y0.\nG01X40.F6000\nG00X0.\nM30\n%\n"


@pytest.fixture(scope="module")
def judged() -> Judged:
    return convert(PART, machine_with(UNCERTAIN))


def emitted_cuts(judged: Judged) -> list[Move]:
    ((_, blocks, _),) = judged.regions()
    return [move for move in blocks if move.length > 0.0]


def shifted_modes(judged: Judged, which: str | None, shift: float) -> list[list[Mode]]:
    """The modes of the machine with one of them ("x.1") or all off by their uncertainty, damping at its low end."""
    uncertainty = {"x": 0.05, "y": 0.03, "z": 0.0}
    less = {"x": 0.2, "y": 0.0, "z": 0.0}
    return [
        [
            Mode(
                mode.frequency_hz * (1.0 + (shift * uncertainty[axis] if which in ("all", f"{axis}.1") else 0.0)),
                mode.damping_ratio * (1.0 - (less[axis] if which in ("all", f"{axis}.1") else 0.0)),
            )
            for mode in modes
        ]
        for axis, modes in zip("xyz", judged.modes, strict=True)
    ]


def test_overrides_and_shifted_modes_are_the_judges_too(judged: Judged) -> None:
    cuts = emitted_cuts(judged)
    compared = 0
    for case in judged.conversion.to_dict()["cases"]:
        if case["look_ahead"] or case["underrun_ms"]:
            continue
        points = play(cuts, period_s=TICK, block_end=case["block_end"], override=case["override"])
        found = residual_um(points, shifted_modes(judged, case["mode"], case["shift"]), TICK, still_mm=1e-9)
        # The judge looks every 0.1 ms: 131 Hz moves on by 5 degrees, so a peak is low by 0.1 % at most.
        for axis, theirs in zip("xyz", found, strict=True):
            assert close(case["residual_um"][axis], theirs, relative=0.02, absolute_um=0.02), (case, found)
        lasts = durations(cuts, period_s=TICK, block_end=case["block_end"], override=case["override"]).sum()
        assert abs(case["time_s"] - lasts) < 1.1 * TICK, case["name"]
        compared += 1
    assert compared == 2 + 7 + 2 * 2 + 2


@pytest.mark.parametrize(
    ("stated", "names"),
    [
        ({}, []),
        (
            {"frequency_uncertainty_percent": 5.0, "damping_uncertainty_percent": 20.0},
            ["X 46 Hz -5 %, damping -20 %", "X 46 Hz +5 %, damping -20 %", "all modes low", "all modes high"],
        ),
        ({"damping_uncertainty_percent": 20.0}, ["X 46 Hz, damping -20 %", "all modes low"]),
    ],
)
def test_an_uncertain_damping_has_its_cases(stated: dict[str, float], names: list[str]) -> None:
    machine = machine_with({"axes.x.modes": [{"frequency_hz": 46.0, "damping_ratio": 0.02} | stated]})
    cases = [case for case in stated_cases(machine) if case.mode is not None]
    assert [case.name for case in cases] == names
    if "damping_uncertainty_percent" in stated:
        assert MachineModel(machine).vibration_memory_s == pytest.approx(math.log(1e6) / (0.016 * 2.0 * math.pi * 46.0))


def test_less_damping_is_the_worse_end() -> None:
    """Both ends of the damping leave the same to first order, and the lower end more: so it alone is simulated."""
    worst = {-1.0: 0.0, 1.0: 0.0}
    families = ["zv", "mzv", "ei", "non-negative"]
    for design in choose_shaper(["46:0.02±2%", "131:0.02±1%"], periods_s=[0.005], families=families).designs:
        for frequency, band in ((46.0, 0.02), (131.0, 0.01)):
            # left at the last tap: a complex sum over the taps, as no vibration is excited but theirs
            left = {
                way: max(
                    abs(
                        sum(
                            a * cmath.exp(pole(frequency * (1.0 + band * side), 0.02 * (1.0 + 0.2 * way)) * (last - t))
                            for t, a in zip(design.shaper.times_s, design.shaper.amplitudes, strict=True)
                        )
                    )
                    for side in (-1.0, 1.0)
                )
                for way in worst
                for last in (design.shaper.times_s[-1],)
            }
            assert left[-1.0] > left[1.0] * 0.98, (design.family, left)
            worst = {way: max(worst[way], left[way]) for way in worst}
    assert worst[-1.0] > worst[1.0]


def pole(frequency_hz: float, damping: float) -> complex:
    omega = 2.0 * math.pi * frequency_hz
    return complex(-damping * omega, omega * math.sqrt(1.0 - damping**2))


def test_the_contour_at_other_overrides_and_of_a_mode_that_is_off_is_the_judges_too(judged: Judged) -> None:
    ((programmed, _, _),) = judged.regions()
    compared = 0
    for case in judged.conversion.to_dict()["cases"]:
        if case["mode"] is None and case["override"] == 1.0:
            continue
        points = play(emitted_cuts(judged), period_s=TICK, block_end="ceil", override=case["override"])
        _, _, moved = response(points, shifted_modes(judged, case["mode"], case["shift"]), TICK)
        over = (len(moved) - 1) // (len(points) - 1)
        for name, track in (("command", points), ("response", moved[::over])):
            # How near the track comes to the one corner and to the end counts too.
            missed = distances_from_polyline(np.array([[40.0, 40.0, 0.0], [60.0, 50.0, 0.0]]), track)
            theirs = max(contour_error_um(track, programmed).max_um, 1e3 * missed.max())
            assert close(case["contour_error_um"][name], theirs, relative=0.01, absolute_um=0.05), (case, name)
        compared += 1
    assert compared == 7 + 6


@pytest.mark.parametrize("keys", [{}, {"controller.shaped_time_constant_s": 0.008}, {"input.material_side": "left"}])
def test_no_override_is_without_its_contour(keys: dict[str, Any]) -> None:
    machine = machine_with(keys)
    assert MachineModel(machine).bounds_deviations == (not keys)
    conversion = convert(PART, machine).conversion
    turned = [case for case in conversion.cases if case.override != 1.0]
    assert [round(case.override * 100.0) for case in turned] == [50, 60, 70, 80, 90, 110, 120]
    assert all(case.contour_error_um.command and case.contour_error_um.response for case in turned)
    assert all((case.gouge_um is None) == ("input.material_side" not in keys) for case in turned)


def test_a_stated_uncertainty_is_part_of_the_feed_search(judged: Judged) -> None:
    # The table as such has room left, so that it stays within the tolerance with its modes off.
    report = judged.conversion.to_dict()
    assert judged.conversion.ok
    assert report["worst_case"]["mode"] is not None
    assert report["worst_case"]["contour_error_um"]["response"] > report["cases"][0]["contour_error_um"]["response"]


def starved_points(cuts: list[Move], after: int, wait_s: float, rule: BlockEnd) -> tuple[FloatArray, int, int]:
    """Set-points of blocks with a wait behind one of them; first and last row of the wait."""
    head = play(cuts[: after + 1], period_s=TICK, block_end=rule)
    tail = play(cuts[after + 1 :], period_s=TICK, block_end=rule)
    tail = tail + (starts(cuts)[after + 1] - tail[0])
    rest = round(wait_s / TICK)
    return np.concatenate([head, np.repeat(head[-1:], rest, axis=0), tail[1:]]), len(head) - 1, len(head) - 1 + rest


@pytest.mark.parametrize("time_constant_ticks", [0, 8])
def test_a_starved_block_is_as_bad_as_the_worst_of_all_places(time_constant_ticks: int) -> None:
    keys = {**UNCERTAIN, "controller.shaped_time_constant_s": time_constant_ticks * TICK}
    judged = convert(PART, machine_with(keys))
    cuts = emitted_cuts(judged)
    case = judged.conversion.to_dict()["cases"][-1]
    assert (case["name"], case["underrun_ms"]) == ("underrun 20 ms", 20.0)
    worst = np.zeros(3)
    for after in range(len(cuts) - 1):
        points, begin, end = starved_points(cuts, after, 0.020, "ceil")
        points = moving_average(points, time_constant_ticks)
        times, command, moved = response(points, judged.modes, TICK)
        rests = (times >= (begin + max(time_constant_ticks - 1, 0)) * TICK - 1e-9) & (times <= end * TICK + 1e-9)
        swing = 1e3 * np.abs(moved - command)[rests].max(axis=0)
        worst = np.maximum(worst, np.maximum(swing, residual_um(points, judged.modes, TICK, still_mm=1e-9)))
    assert worst[0] > 100.0
    # A stop rings by the speed at which it happens. What is left from before adds a little, up or down, so that a
    # place with slightly less speed may be the worst: hence a lower bound for the few places that are tried.
    for axis, theirs in zip("xy", worst, strict=False):
        assert 0.98 * theirs <= case["residual_um"][axis] <= 1.005 * theirs, (axis, worst)
    nominal = judged.conversion.to_dict()["cases"][0]
    assert case["time_s"] == pytest.approx(nominal["time_s"] + 0.020)


def planned_points(cuts: list[Move], acceleration_mm_s2: float) -> FloatArray:
    """Set-points along X under a speed that keeps every block's feed and an acceleration, from rest to rest."""
    lengths = np.array([move.length for move in cuts])
    feeds = np.array([move.feed / 60.0 for move in cuts])
    s = np.linspace(0.0, lengths.sum(), 400_001)
    border = np.cumsum(lengths)[:-1]
    left = feeds[np.searchsorted(border, s, side="left")]
    right = feeds[np.searchsorted(border, s, side="right")]
    square = np.minimum(left, right) ** 2
    square[[0, -1]] = 0.0
    slope = 2.0 * acceleration_mm_s2
    square = np.minimum.accumulate(square - slope * s) + slope * s
    square = np.minimum.accumulate((square + slope * s)[::-1])[::-1] - slope * s
    speed = np.sqrt(np.maximum(square, 0.0))
    times = np.concatenate([[0.0], np.cumsum(2.0 * np.diff(s) / (speed[1:] + speed[:-1]))])
    ticks = np.arange(math.ceil(times[-1] / TICK) + 1) * TICK
    return np.stack([np.interp(ticks, times, s), 0.0 * ticks, 0.0 * ticks], axis=1)


def test_look_ahead_left_on_is_planned_within_feeds_and_acceleration() -> None:
    machine = machine_with(
        {"controller.law": "jerk_limited", "controller.bell_time_s": 0.0, "axes.x.max_acceleration_mm_s2": 1500.0}
    )
    judged = convert(LINE, machine)
    (case,) = (case for case in judged.conversion.to_dict()["cases"] if case["look_ahead"])
    points = planned_points(emitted_cuts(judged), 1500.0)
    nominal = judged.conversion.to_dict()["cases"][0]
    assert case["time_s"] > nominal["time_s"] + 0.01
    assert abs(case["time_s"] - (len(points) - 1) * TICK) < 2.1 * TICK
    # The planned speed is the same but for the grid of 0.1 um on which it is integrated here.
    theirs = residual_um(points, judged.modes, TICK, still_mm=1e-9)
    assert close(case["residual_um"]["x"], theirs[0], relative=0.02, absolute_um=0.05)


def test_a_band_decides_what_counts() -> None:
    def counted(keys: dict[str, Any]) -> set[str]:
        return {case.name for case in stated_cases(machine_with({**UNCERTAIN, **keys})) if case.counts}

    off = {"X 46 Hz -5 %, damping -20 %", "X 46 Hz +5 %, damping -20 %"}
    modes = off | {"Y 131 Hz -3 %", "Y 131 Hz +3 %", "all modes low", "all modes high"}
    assert counted({}) == {"nominal, ceil", "nominal, carry", *modes}
    only = {"verdict.mode_uncertainty": False, "verdict.block_end": "own"}
    assert counted(only) == {"nominal, ceil"}
    assert counted({**only, "controller.block_end": "carry"}) == {"nominal, carry"}
    band = {**only, "verdict.override_percent": [75, 105]}
    assert counted(band) == {"nominal, ceil", *(f"override {each} %" for each in (75, 80, 90, 105))}
    corners = {f"override {at} %, all modes {way}" for at in (75, 105) for way in ("low", "high")}
    assert counted({**band, "verdict.mode_uncertainty": True}) == counted(band) | modes | corners
    everything = {**only, "verdict.look_ahead": True, "verdict.starved_block": True, "verdict.starved_s": 0.03}
    assert counted(everything) == {"nominal, ceil", "look-ahead on", "underrun 30 ms"}
    # A controller without look-ahead has no such case, unless it is asked for.
    names = [case.name for case in stated_cases(sg.Machine.load("kimm004"))]
    assert "look-ahead on" not in names
    assert len(names) == len(set(names))


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"verdict.override_percent": [80, 100], **STRICT}, "override"),
        ({"verdict.look_ahead": True}, "look-ahead on"),
        ({"verdict.starved_block": True}, "underrun 20 ms"),
    ],
)
def test_the_worst_case_that_counts_decides(keys: dict[str, Any], words: str) -> None:
    judged = convert(PART, machine_with(keys))
    report = judged.conversion.to_dict()
    worst = report["worst_case"]
    assert not judged.conversion.ok
    assert worst["counts"] and not worst["within"] and worst["name"].startswith(words)
    assert worst["value_um"] > worst["limit_um"] and worst["share_of_limit"] > 1.0
    shares = [case["share_of_limit"] for case in report["cases"] if case["counts"]]
    assert worst["share_of_limit"] == max(shares)
    assert any(f"({worst['name']})" in miss for miss in report["regions"][0]["misses"])
    # What counts is measured in full.
    assert worst["contour_error_um"]["command"] is not None


def test_exit_code_and_table_follow_the_worst_case(tmp_path: Path) -> None:
    (tmp_path / "part.nc").write_text(PART)
    for low, code in ((100.0, 0), (80.0, 1)):
        machine = machine_with({"verdict.override_percent": [low, 100.0], **STRICT})
        (tmp_path / "machine.toml").write_text(machine.to_toml(), encoding="utf-8")
        args = ["part.nc", "-m", "machine.toml", "-o", f"out{low:g}.nc", "--shape-all", "--json", "report.json"]
        done = run(tmp_path, "convert", *args)
        assert done.returncode == code
        out = done.stdout
        report = json.loads((tmp_path / "report.json").read_text())
        (line,) = (line for line in out.splitlines() if "← decides" in line)
        assert line.startswith(report["worst_case"]["name"])
        assert ("OUT" in line) == bool(code)
    assert "(out)" in out and "(within)" in out


#: A mode of Z alone: nothing of a cut in the plane is shaped, and only F words say how long its blocks last.
ONLY_Z = {"axes.x.modes": [], "axes.y.modes": [], "axes.z.modes": [{"frequency_hz": 46.0, "damping_ratio": 0.02}]}
CREEP = "%\nO3\nG21G17G90G94\nG00X0Y0Z0\nG03I.166J.116F1.\nG00Z50.\nM30\n%\n"


def test_a_region_that_runs_faster_than_programmed_is_missed(tmp_path: Path) -> None:
    judged = convert(CREEP, machine_with(ONLY_Z), block_period_s=0.007)
    (miss,) = judged.conversion.to_dict()["regions"][0]["misses"]
    ((_, blocks, entry),) = judged.regions()
    rules: tuple[BlockEnd, ...] = ("ceil", "carry")
    lasts_s = max(sum(durations(blocks, period_s=TICK, block_end=rule)) for rule in rules)
    assert entry["time_s"]["emitted"] == pytest.approx(lasts_s, abs=0.5)
    programmed_s = 2.0 * math.pi * math.hypot(0.166, 0.116) * 60.0
    assert entry["time_s"]["original"] == pytest.approx(programmed_s, abs=0.1)
    assert lasts_s < 0.6 * programmed_s
    was_s, now_s = entry["time_s"]["original"], entry["time_s"]["emitted"]
    assert miss.startswith(f"runs in {now_s:.1f} s instead of {was_s:.1f} s: too slow a feed for blocks of 7 ms")
    # The same feed where its F word fits blocks of 5 ms.
    assert convert(CREEP, machine_with(ONLY_Z), block_period_s=0.005).conversion.ok

    (tmp_path / "part.nc").write_text(CREEP)
    (tmp_path / "machine.toml").write_text(machine_with(ONLY_Z).to_toml(), encoding="utf-8")
    args = ["part.nc", "-m", "machine.toml", "-o", "out.nc", "--shape-all", "--block-period", "7ms"]
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path)
        assert main(["convert", *args]) == 1


def test_a_region_is_not_too_fast_because_its_original_is_slow() -> None:
    """1 mm at 100 mm/s takes 10 ms, the original .3 s for its long time constant; the shaped one is faster."""
    machine = machine_with({"controller.motion": "after_interpolation", "controller.time_constant_s": 0.3})
    judged = convert("%\nO4\nG21G17G90G94\nG00X0Y0Z0\nG01X1.F6000\nG00Z50.\nM30\n%\n", machine)
    (entry,) = judged.conversion.to_dict()["regions"]
    assert entry["time_s"]["emitted"] < 0.5 * entry["time_s"]["original"]
    assert entry["misses"] == []


def test_keys_of_a_case_are_stable(judged: Judged) -> None:
    keys = {
        "name", "block_end", "override", "mode", "shift", "look_ahead", "underrun_ms", "counts", "residual_um",
        "contour_error_um", "time_s", "within", "figure", "value_um", "limit_um", "share_of_limit", "lines",
    }  # fmt: skip
    report = judged.conversion.to_dict()
    for case in [*report["cases"], report["worst_case"]]:
        assert set(case) == keys
        assert set(case["residual_um"]) == {"x", "y", "z"}
        assert set(case["contour_error_um"]) == {"command", "response"}
        assert case["lines"] == report["regions"][0]["lines"]
    ceil, carry = report["cases"][:2]
    assert (ceil["block_end"], carry["block_end"]) == ("ceil", "carry")
    for axis in "xyz":
        worse = max(ceil["residual_um"][axis], carry["residual_um"][axis])
        assert report["residual_vibration_um"]["emitted"][axis] == worse
    by_name = {case["name"]: case for case in report["cases"]}
    for entry in report["override_residual"]:
        assert entry["residual_um"] == by_name[f"override {entry['override'] * 100:g} %"]["residual_um"]
    assert [entry["shift"] for entry in report["frequency_residual"]] == [-1.0, 1.0]


def test_nothing_shaped_has_no_cases() -> None:
    conversion = sg.convert("%\nO1\nG21G90\nG00X1.\nM30\n%\n", machine_with())
    assert (conversion.cases, conversion.worst_case, conversion.tables()) == ((), None, [])


@pytest.mark.parametrize("side", ["left", "right"])
def test_gouge_is_what_lies_on_the_side_of_the_material(side: str) -> None:
    judged = convert(PART, machine_with({"shaping.contour": "off", "input.material_side": side}))
    report = judged.conversion.to_dict()
    points = play(emitted_cuts(judged), period_s=TICK, block_end="ceil")[:, :2]
    # A filter cuts the counter-clockwise arc about (20, 20) short, on its inside: left of the travel.
    turn = np.degrees(np.arctan2(points[:, 0] - 20.0, 20.0 - points[:, 1]))
    inside = 1e3 * (20.0 - np.hypot(points[:, 0] - 20.0, points[:, 1] - 20.0))[(turn > 5.0) & (turn < 85.0)].max()
    assert inside > 15.0
    found = report["contour_error_um"]["command"]["emitted"]
    assert found["left"] == pytest.approx(inside, rel=0.02)
    assert found["gouge"] == found[side]
    assert found["excess"] == found["right" if side == "left" else "left"]
    for case in report["cases"]:
        assert set(case["gouge_um"]) == set(case["excess_um"]) == {"command", "response"}
        assert (case["gouge_um"]["response"] is None) == (case["contour_error_um"]["response"] is None)
    assert report["cases"][0]["gouge_um"]["command"] == pytest.approx(found["gouge"], abs=1.0)
    rows = {row.figure: row for row in judged.conversion.tables()[0].rows}
    assert rows["contour error of the command, gouge"].emitted == pytest.approx(found["gouge"])


def test_the_contour_limit_is_for_the_targeted_deviation() -> None:
    figures = CaseFigures(np.array([0.001, 0.0, 0.0]), Deviation(0.03, 0.03, 0.0), Deviation(0.06, 0.0, 0.06), 1.0)
    limits = {target: RegionLimits(np.full(3, 4.0), 50.0, target) for target in ("command", "response")}
    assert [each.is_missed for each in judge_region(figures, limits["command"])] == [False] * 4
    *residuals, contour = judge_region(figures, limits["response"])
    assert contour.is_missed and str(contour) == "contour error of the machine table 60.0 um, limit 50.0 um"
    assert str(replace(contour, value_um=50.004)) == "contour error of the machine table 50.004 um, limit 50.000 um"
    assert [each.share for each in residuals] == pytest.approx([0.25, 0.0, 0.0])
    # Nothing allowed: whatever there is misses it by more than any number says.
    tight = judge_region(figures, RegionLimits(np.zeros(3), 0.0, "command"))
    assert [each.share for each in tight] == [math.inf, 0.0, 0.0, math.inf]


def test_behind_feed_drives_only_the_stated_overrides_have_a_contour() -> None:
    keys = {"verdict.plant": "feed-drive", "verdict.override_percent": [90.0, 100.0]}
    cases = convert(LINE, machine_with(keys)).conversion.cases
    turned = {round(case.override * 100.0): case for case in cases if case.override != 1.0 and case.mode is None}
    measured = {at: case.contour_error_um.response is not None for at, case in turned.items()}
    assert measured == {at: at == 90 for at in (50, 60, 70, 80, 90, 110, 120)}
    assert all(max(case.residual_um) > 0.0 for case in turned.values())


def test_what_has_to_be_measured_depends_on_the_target() -> None:
    cases = {case.name: case for case in stated_cases(machine_with(UNCERTAIN))}
    shift, override = cases["X 46 Hz +5 %, damping -20 %"], cases["override 90 %"]
    assert (shift.needs_contour("command"), shift.needs_contour("response")) == (False, True)
    assert (override.needs_contour("command"), override.needs_contour("response")) == (True, True)


def test_table_shows_what_only_stands_beside_in_brackets(judged: Judged) -> None:
    (table,) = (each for each in judged.conversion.tables() if each.title.startswith("operating conditions"))
    lines = str(table).splitlines()
    assert sum("← decides" in line for line in lines) == 1
    rows = {case.name: line for case in judged.conversion.cases for line in lines if case.name in line}
    assert "(out)" in rows["underrun 20 ms"]
    assert "within" in rows["all modes low"] and "(" not in rows["all modes low"]
    assert "8 of 17 operating conditions count" in " ".join(lines[-2:])
    assert max(map(len, lines)) <= 80


@pytest.mark.parametrize("band", [[110, 90], [0, 100], [90], [90, 300]])
def test_bands_that_cannot_be_are_refused(band: list[float]) -> None:
    with pytest.raises(sg.MachineError, match="override_percent"):
        machine_with({"verdict.override_percent": band})
