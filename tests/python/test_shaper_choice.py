"""The choice among shapers: the Pareto front by brute force, the rule of the recommendation, what is refused."""

import itertools
import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

import shapegcode as sg
from shapegcode._core import ArgumentError, DesignError, Mode, Shaper
from shapegcode.shaping import (
    FAMILIES,
    Design,
    DesignOptions,
    ModeBand,
    candidate_periods,
    choose,
    choose_shaper,
    evaluate,
    machine_bands,
    pareto_front,
    recommend,
)
from shapegcode.shaping.grid import choose_grid
from shaper_residual import left_of

FEW = ("zv", "mzv", "polynomial", "non-negative", "robust")  # quick ones
PAPER = [ModeBand(Mode(46.0, 0.02), 0.05), ModeBand(Mode(131.0, 0.02))]


def made(duration: float, worst: float, negative: bool = False, period_s: float | None = None) -> Design:
    """A design of a given duration and worst residual."""
    taps = (0.75, -0.25, 0.5) if negative else (0.25, 0.5, 0.25)
    return Design("made", Shaper([0.0, duration / 2.0, duration], taps), period_s, worst, worst)


designs = st.builds(
    made,
    st.sampled_from([0.008, 0.01, 0.012, 0.02]),
    st.sampled_from([0.0, 1e-13, 0.01, 0.03, 0.05, 0.2]),
    st.booleans(),
    st.sampled_from([None, 0.001, 0.004]),
)


def dominates(one: Design, other: Design) -> bool:
    if one.period_s is None and other.period_s is not None:
        return False  # it cannot be written on a grid
    pairs = [
        (one.duration_s, other.duration_s),
        (max(one.worst_residual, 1e-9), max(other.worst_residual, 1e-9)),
        (abs(one.variance_s2), abs(other.variance_s2)),
        (one.abs_sum, other.abs_sum),
    ]
    differing = [(a, b) for a, b in pairs if not math.isclose(a, b, rel_tol=1e-8)]
    return bool(differing) and all(a < b for a, b in differing)


@given(st.lists(designs, min_size=1, max_size=12))
@settings(max_examples=100, deadline=None)
def test_pareto_front_by_brute_force(found: list[Design]) -> None:
    expected = [not any(dominates(one, other) for one in found) for other in found]
    assert pareto_front(found) == expected
    assert any(expected)


def test_pareto_front_of_a_real_comparison() -> None:
    result = choose(PAPER, [None, 0.002, 0.005], families=FEW)
    expected = [not any(dominates(one, other) for one in result.designs) for other in result.designs]
    assert [each.pareto for each in result.designs] == expected
    assert pareto_front([]) == []


@given(st.lists(designs, min_size=1, max_size=12), st.floats(0.005, 0.3), st.floats(0.005, 0.3), st.booleans())
@settings(max_examples=200, deadline=None)
def test_a_tighter_limit_is_never_shorter(found: list[Design], one: float, other: float, negative: bool) -> None:
    tight, loose = sorted((one, other))
    chosen = [found[recommend(found, limit, allow_negative=negative)] for limit in (tight, loose)]
    assert chosen[0].duration_s >= chosen[1].duration_s
    assert chosen[0].worst_residual <= chosen[1].worst_residual or chosen[1].worst_residual <= tight
    if not negative and any(not each.negative for each in found):
        assert not chosen[0].negative
    for limit, taken in zip((tight, loose), chosen, strict=True):
        rivals = [each for each in found if negative or not each.negative] or found
        good = [each for each in rivals if each.worst_residual <= limit]
        if good:
            assert taken.duration_s == min(each.duration_s for each in good)
        else:
            assert taken.worst_residual == min(each.worst_residual for each in rivals)


def test_tighter_limits_through_all_families() -> None:
    durations = [
        choose_shaper(["46:0.02±5%"], periods_s=[0.004], vibration_limit=limit, max_duration_s=0.04).design.duration_s
        for limit in (0.3, 0.1, 0.05)
    ]
    assert durations == sorted(durations)


def test_objectives_and_ties() -> None:
    found = [made(0.02, 0.01), made(0.01, 0.04), made(0.012, 0.0, period_s=0.004), made(0.012, 0.0, period_s=0.006)]
    assert recommend(found, 0.05) == 1
    assert recommend(found, 0.05, "contour") == 1
    assert recommend(found, 0.05, "robust") == 3  # equal but for the period: the longer one writes fewer blocks
    assert recommend(found, 0.02) == 3
    with pytest.raises(ArgumentError, match="0 given"):
        recommend([], 0.05)


def test_a_mode_without_a_band_is_cancelled_where_any_design_does_so() -> None:
    found = [replace(made(0.01, 0.04), exact=False), made(0.02, 0.0), made(0.03, 0.0)]
    assert recommend(found, 0.05) == 1
    assert recommend(found[:1], 0.05) == 0
    assert recommend([found[0], made(0.02, 0.2)], 0.05) == 0
    exact = evaluate("zv", Shaper([0.0, 0.01], [0.5, 0.5]), [ModeBand(Mode(50.0, 0.0)), ModeBand(Mode(20.0, 0.0), 0.1)])
    assert exact.exact
    assert exact.worst_residual > 0.5
    assert not evaluate("zv", exact.shaper, [ModeBand(Mode(20.0, 0.0))]).exact


def test_a_longer_period_wins_within_two_percent() -> None:
    found = [made(0.05, 0.0, period_s=0.002), made(0.051, 0.0, period_s=0.003), made(0.054, 0.0, period_s=0.009)]
    assert recommend(found, 0.05) == 1
    assert recommend(found, 0.05, "robust") == 0
    least = [made(0.05, 0.2, period_s=0.002), made(0.05, 0.203, period_s=0.003), made(0.05, 0.21, period_s=0.009)]
    assert recommend(least, 0.05) == 1
    assert recommend([*found, made(0.0499, 0.0)], 0.05) == 3  # at continuous times there is no period


def test_equal_taps_are_named_after_the_family_for_grids() -> None:
    taps = Shaper([0.0, 0.01], [0.5, 0.5])
    same = [Design(family, taps, 0.01, 0.0, 0.0) for family in ("negative-zv", "zv", "non-negative")]
    assert recommend(same, 0.05) == 2


def test_negative_taps_are_taken_only_where_allowed() -> None:
    found = [made(0.02, 0.01), made(0.01, 0.01, negative=True)]
    assert recommend(found, 0.05) == 0
    assert recommend(found, 0.05, allow_negative=True) == 1
    assert recommend(found[1:], 0.05) == 0


def test_reasons_say_what_happened() -> None:
    good = choose(PAPER, [0.005], families=FEW)
    assert good.ok
    assert "the shortest of" in good.reason
    assert "46 Hz ±5 % and 131 Hz stays within 5 %" in good.reason
    wide = choose([ModeBand(Mode(46.0, 0.02), 0.2)], [0.005], DesignOptions(max_duration_s=0.015), families=FEW)
    assert not wide.ok
    assert "this one has the least" in wide.reason


def test_every_design_keeps_the_limits_and_says_its_own_figures() -> None:
    options = DesignOptions(max_duration_s=0.05, max_abs_sum=3.0)
    result = choose(PAPER, [None, 0.001, 0.005], options, families=FEW)
    report = result.to_dict()
    assert {row["period_s"] for row in report["designs"]} == {None, 0.001, 0.005}
    for row in report["designs"]:
        times_s, amplitudes = row["times_s"], row["amplitudes"]
        assert row["duration_s"] == pytest.approx(times_s[-1], rel=1e-8)
        assert times_s[-1] <= 0.05
        assert row["abs_sum"] == pytest.approx(sum(map(abs, amplitudes)), rel=1e-8)
        assert row["abs_sum"] <= 3.0 + 1e-9
        mean = np.dot(times_s, amplitudes)
        assert row["variance_s2"] == pytest.approx(
            np.dot(np.square(times_s), amplitudes) - mean**2, rel=1e-8, abs=1e-15
        )
        assert row["negative"] == (min(amplitudes) < 0.0)
        shaper = Shaper(times_s, amplitudes)
        nominal = max(left_of(shaper, Mode(46.0, 0.02)), left_of(shaper, Mode(131.0, 0.02)))
        assert row["residual"] == pytest.approx(nominal, rel=1e-8, abs=1e-12)
        swept = [left_of(shaper, Mode(f, 0.02)) for f in np.linspace(46.0 * 0.95, 46.0 * 1.05, 41)]
        assert row["worst_residual"] == pytest.approx(max(*swept, nominal), rel=2e-3, abs=1e-9)
    refused = [row for row in report["refused"] if row["family"] == "polynomial"]
    assert [row["period_s"] for row in refused] == [0.001]
    assert "247.9" in refused[0]["reason"]


def test_what_leaves_least_is_searched_only_if_nothing_is_good_enough() -> None:
    bands = [ModeBand(Mode(46.0, 0.02), 0.2)]
    result = choose(bands, [0.005], DesignOptions(max_duration_s=0.02, vibration_limit=0.02))
    assert not result.ok
    assert result.design.family == "robust"
    others = [each for each in result.designs if each.family != "robust" and not each.negative]
    assert all(each.worst_residual > result.design.worst_residual for each in others)
    assert all(each.family != "robust" for each in result.refused)
    narrow = choose(bands, [0.005], DesignOptions(max_duration_s=0.02, vibration_limit=0.02), families=["zv"])
    assert {each.family for each in narrow.designs} == {"zv"}


def test_no_family_vanishes() -> None:
    for periods_s in ([None], [0.005]):
        result = choose(PAPER, periods_s)
        named = {each.family for each in result.designs} | {each.family for each in result.refused}
        assert named == {row.name for row in FAMILIES} - {"taps"}


def test_own_taps_are_compared() -> None:
    result = choose_shaper(
        ["46:0.02±5%", "131:0.02"], periods_s=[None, 0.002, 0.004], families=["zv"], taps="0:.5,10ms:.5"
    )
    options = DesignOptions(taps=Shaper([0.0, 0.01], [0.5, 0.5]))
    assert options.taps is not None
    rows = [each for each in result.designs if each.family == "taps"]
    assert [each.period_s for each in rows] == [None, 0.002]
    swept = [left_of(options.taps, Mode(f, 0.02)) for f in (46.0 * 0.95, 46.0, 46.0 * 1.05, 131.0)]
    assert rows[0].worst_residual == pytest.approx(max(swept), rel=1e-3)
    assert "10 ms is not on the 4 ms grid" in next(each.reason for each in result.refused if each.family == "taps")
    assert {each.family for each in choose(PAPER, [0.002], options, families=["zv"]).designs} == {"zv", "taps"}


def test_bad_questions() -> None:
    with pytest.raises(ArgumentError, match="0 given"):
        choose([])
    with pytest.raises(ArgumentError, match="modes 1 and 3 are equal"):
        choose([PAPER[0], PAPER[1], ModeBand(Mode(46.0, 0.02), 0.1)])
    with pytest.raises(ArgumentError, match="or None for continuous times: 0 given"):
        choose(PAPER, [])
    for bad in (0.0, -0.001, math.nan, math.inf):
        with pytest.raises(ArgumentError, match="period"):
            choose(PAPER, [0.005, bad, 0.004])
        with pytest.raises(ArgumentError, match="max_duration_s"):
            choose(PAPER, options=DesignOptions(max_duration_s=bad))
    with pytest.raises(ArgumentError, match="not an objective"):
        choose(PAPER, objective="best")
    with pytest.raises(ArgumentError, match="not a family"):
        choose(PAPER, families=["magic"])
    with pytest.raises(DesignError, match="200 Hz cannot be cancelled on a grid of 5 ms"):
        choose([ModeBand(Mode(200.0, 0.0))], [0.005])
    with pytest.raises(DesignError, match=r"no family has a shaper for 46 Hz .* within 1 ms"):
        choose(PAPER, options=DesignOptions(max_duration_s=0.001), families=["zv"])
    partly = choose([ModeBand(Mode(200.0, 0.0))], [0.005, 0.004], families=FEW)
    assert {each.period_s for each in partly.designs} == {0.004}
    assert "200 Hz" in next(each.reason for each in partly.refused if each.period_s == 0.005)


def test_modes_as_text_mode_or_band_and_their_own_bands() -> None:
    result = sg.choose_shaper(
        ["46:0.02±0%", Mode(80.0, 0.01), ModeBand(Mode(131.0, 0.02), 0.03), "200"],
        uncertainty=0.05,
        periods_s=[0.003],
        families=["zv"],
    )
    assert [band.uncertainty for band in result.modes] == [0.0, 0.05, 0.03, 0.05]
    with pytest.raises(ArgumentError, match="neither is given"):
        sg.choose_shaper()


def test_without_a_period_continuous_times_and_the_best_grids() -> None:
    result = sg.choose_shaper(["46:0.02", "131:0.02"], families=FEW)
    periods_s = {each.period_s for each in result.designs}
    assert None in periods_s
    assert {0.001, 0.002} <= {round(each, 9) for each in periods_s if each is not None}  # 12 ms at both
    assert result.max_duration_s == 0.066  # three periods of 46 Hz
    on_grid = result.recommended_on_grid
    assert on_grid is not None
    assert result.designs[on_grid].period_s is not None
    assert choose(PAPER, families=["zv"]).recommended_on_grid is None


def test_a_machine_gives_modes_bands_and_grids() -> None:
    machine = sg.Machine.load("vx500")
    result = sg.choose_shaper(machine=machine, families=[*FEW, "si"])
    assert result.machine == "VX500"
    assert "-m VX500 --shaper" in result.next_step
    assert repr(result) == f"<Recommendation: {result.answer}>"
    assert [band.mode for band in result.modes] == [Mode(46.0, 0.02), Mode(131.0, 0.02)]
    exact = next(each for each in result.designs if each.family == "non-negative")
    assert exact.period_s == pytest.approx(0.005)
    assert exact.duration_s == pytest.approx(0.02)  # T = 5 ms
    np.testing.assert_allclose(exact.shaper.amplitudes, [0.20394, 0.16162, 0.31387, 0.15731, 0.16327], atol=1e-5)
    assert result.design.duration_s <= exact.duration_s
    assert result.best_by_period[0.005] == result.recommended_on_grid == result.recommended
    assert all(each.period_s is not None and each.period_s >= 0.005 - 1e-12 for each in result.designs)
    for period_s, message in (
        (0.0055, "block period 5.5 ms is not a multiple of the interpolation period 1 ms"),
        (0.003, "block period 3 ms is below the block time 5 ms"),
        (math.nan, "block period is nan s, must be finite and above 0"),
    ):
        with pytest.raises(ArgumentError, match=message):
            sg.choose_shaper(machine=machine, periods_s=[period_s])
        with pytest.raises(ArgumentError, match=message):
            choose_grid(machine, period_s)


def test_long_shapers_only_where_no_short_one_is_good() -> None:
    # The shortest non-negative one lasts 96 ms.
    machine = sg.Machine.load("vx500").with_values("emission.block_period_s", 0.008)
    result = sg.choose_shaper(machine=machine, families=["zvd", "non-negative"])
    assert result.max_duration_s == 0.25
    assert min(each.duration_s for each in result.designs) == pytest.approx(0.096)
    usual = sg.choose_shaper(machine=sg.Machine.load("vx500"), families=["non-negative"])
    assert usual.max_duration_s == 0.066  # three periods of 46 Hz


def test_equal_modes_of_two_axes_count_once_with_the_wider_band() -> None:
    values = {
        f"axes.{name}.modes": [{"frequency_hz": 46.0, "damping_ratio": 0.02, "frequency_uncertainty_percent": percent}]
        for name, percent in (("x", 2.0), ("y", 5.0))
    }
    values["axes.z.modes"] = [{"frequency_hz": 90.0, "damping_ratio": 0.02}]
    machine = sg.Machine.load("vx500").with_values(values)
    assert machine_bands(machine, 0.03) == [ModeBand(Mode(46.0, 0.02), 0.05), ModeBand(Mode(90.0, 0.02), 0.03)]
    with pytest.raises(ArgumentError, match="no vibration mode"):
        machine_bands(machine.with_values({f"axes.{name}.modes": [] for name in "xyz"}))


def test_candidate_periods() -> None:
    machine = sg.Machine.load("vx500").with_values("emission.block_period_s", 0.007)
    assert candidate_periods(PAPER, machine, 0.25) == [0.007]
    periods_s = candidate_periods(PAPER, sg.Machine.load("vx500"), 0.25)
    assert periods_s[0] == pytest.approx(0.005)
    assert periods_s == sorted(periods_s)
    # no grid has a non-negative design so short: the finest ones that the controller simulates
    assert candidate_periods(PAPER, None, 0.003) == pytest.approx([0.001, 0.002, 0.003])
    slow = candidate_periods([ModeBand(Mode(0.5, 0.0))], None, 6.0)
    assert all(a < b for a, b in itertools.pairwise(slow))
    assert slow[0] >= 2.0 / 32.0


ROWS = re.findall(
    r"^\|[^|]*\| `([a-z-]+)` \|.*\| ([0-9.]+) \| ([0-9.]+) "
    r"\| `shapegcode shaper (.*) --block-period 1ms --family \1` \|$",
    (Path(__file__).resolve().parents[2] / "docs" / "concepts" / "choose_shaper.md").read_text(encoding="utf-8"),
    re.MULTILINE,
)


@pytest.mark.parametrize(("family", "periods", "left", "modes"), ROWS, ids=lambda value: value.replace("--mode ", ""))
def test_the_page_that_says_how_to_choose_says_what_is_designed(
    family: str, periods: str, left: str, modes: str
) -> None:
    bands = modes.removeprefix("--mode ").split(" --mode ")
    design = choose_shaper(bands, periods_s=[0.001], families=[family], allow_negative=True).design
    slowest = min(float(band.partition(":")[0]) for band in bands)
    assert f"{design.duration_s * slowest:.2f}" == periods
    assert f"{100.0 * design.worst_residual:.1f}" == left


def test_the_page_that_says_how_to_choose_has_its_rows() -> None:
    assert len(ROWS) == 9
