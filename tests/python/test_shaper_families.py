"""The families of shapers: residuals by simulation and by a formula of its own, on continuous times and on grids."""

import itertools
import math
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import linprog

from shapegcode._core import (
    ArgumentError,
    DesignError,
    Mode,
    Shaper,
    extra_insensitive,
    insensitivity,
    minimal_two_mode,
    mzv_second_zero,
    worst_residual,
    zv,
)
from shapegcode.shaping import (
    FAMILIES,
    DesignOptions,
    ModeBand,
    choose_shaper,
    design,
    parse_mode_band,
    shortest_non_negative,
)
from shapegcode.shaping.bands import parse_taps
from shapegcode.shaping.grid_designs import Conditions, Zero, shortest_on_grid
from shapegcode.shaping.registry import distinct, simultaneous_zv
from shaper_residual import is_feasible, left_of, simulated

SLOW = parse_mode_band("46:0.02±5%")
FAST = parse_mode_band("131:0.02±5%")
PERIODS_S = (0.001, 0.002, 0.004, 0.005)
EXACT = ("zv", "zvd", "zvdd", "mzv", "ei2", "negative-zv")
TOLERANT = ("ei", "ei3", "si")


def sampled_worst(shaper: Shaper, band: ModeBand, count: int = 101) -> float:
    low, high = band.shifted(-1.0).frequency_hz, band.shifted(1.0).frequency_hz
    return max(left_of(shaper, Mode(float(f), band.mode.damping_ratio)) for f in np.linspace(low, high, count))


def options(
    period_s: float | None = None,
    *,
    max_duration_s: float = 0.25,
    max_abs_sum: float = 10.0,
    vibration_limit: float = 0.05,
) -> DesignOptions:
    return DesignOptions(period_s, max_duration_s, max_abs_sum, vibration_limit)


@pytest.mark.parametrize("zeta", [0.02, *(pytest.param(zeta, marks=pytest.mark.slow) for zeta in (0.0, 0.1))])
@pytest.mark.parametrize("name", [*EXACT, *TOLERANT])
def test_one_mode_on_any_times(name: str, zeta: float) -> None:
    band = ModeBand(Mode(46.0, zeta), 0.05)
    for period_s in (None, 0.002 if zeta else 0.005):
        found = design(name, [band], options(period_s))[0]
        shaper = found.shaper
        assert shaper.amplitudes.sum() == pytest.approx(1.0, abs=1e-12)
        assert found.residual == pytest.approx(simulated(shaper, band.mode), abs=1e-11)
        sampled = sampled_worst(shaper, band)
        assert sampled * (1.0 - 2e-6) - 1e-11 <= found.worst_residual <= sampled * (1.0 + 1e-3) + 1e-11
        assert found.residual <= (1e-10 if name in EXACT else 0.05 * (1.0 + 1e-9))
        if name == "si":
            assert found.worst_residual <= 0.05
        if name == "negative-zv":
            assert np.abs(shaper.amplitudes).max() <= 1.0 + 1e-9
        else:
            assert shaper.amplitudes.min() > 0.0
        if period_s is not None:
            steps = shaper.times_s / period_s
            assert np.abs(steps - np.round(steps)).max() < 1e-9


@pytest.mark.parametrize("name", ["zvd", "mzv", "ei", "negative-zv", "si"])
def test_two_modes_on_any_times(name: str) -> None:
    for period_s in (None, 0.005):
        found = design(name, [SLOW, FAST], options(period_s))[0]
        left = [simulated(found.shaper, band.mode) for band in (SLOW, FAST)]
        assert max(left) == pytest.approx(found.residual, abs=1e-11)
        assert max(left) <= (1e-10 if name in EXACT else 0.05 * (1.0 + 1e-9))


def test_every_row_says_what_it_is_and_is_designed_or_refused_as_it_says() -> None:
    assert len({row.name for row in FAMILIES}) == len(FAMILIES)
    for row in FAMILIES:
        assert row.title
        assert row.source
        assert row.validity
        given = zv(SLOW.mode) if row.name == "taps" else None
        if row.continuous:
            assert design(row.name, [SLOW], DesignOptions(taps=given))
        else:
            with pytest.raises(ArgumentError, match="specify its period"):
                design(row.name, [SLOW])
        if not row.on_grid:
            with pytest.raises(ArgumentError, match="omit the period"):
                design(row.name, [SLOW], options(0.005))


@pytest.mark.parametrize(("name", "multiplicity"), [("zv", 1), ("zvd", 2), ("zvdd", 3)])
@pytest.mark.parametrize("period_s", [*PERIODS_S, 0.008])
def test_zeros_on_a_grid_have_their_multiplicity(name: str, multiplicity: int, period_s: float) -> None:
    shaper = design(name, [SLOW], options(period_s))[0].shaper
    far, near = (left_of(shaper, Mode(46.0 * (1.0 + step), 0.02)) for step in (2e-3, 1e-3))
    assert near / far == pytest.approx(0.5**multiplicity, rel=0.02)


@pytest.mark.parametrize("multiplicity", [1, 2, 3])
@pytest.mark.parametrize("period_s", PERIODS_S)
def test_no_shorter_design_has_the_zeros(multiplicity: int, period_s: float) -> None:
    name = ("zv", "zvd", "zvdd")[multiplicity - 1]
    steps = round(design(name, [SLOW], options(period_s))[0].duration_s / period_s)
    for last, expected in ((steps, True), (steps - 1, False)):
        k = np.arange(last + 1)
        term = np.exp(-SLOW.mode.pole * period_s * (k - last))
        assert is_feasible([term * ((k - last / 2) / last) ** power for power in range(multiplicity)], last) == expected


@pytest.mark.parametrize("humps", [1, 2, 3])
def test_extra_insensitive_on_a_grid_keeps_its_zeros_and_humps(humps: int) -> None:
    zeros_hz = extra_insensitive(SLOW.mode, 0.05, humps).zeros_hz
    for period_s in PERIODS_S:
        shaper = design(f"ei{humps}" if humps > 1 else "ei", [SLOW], options(period_s))[0].shaper
        for frequency_hz in zeros_hz:
            assert left_of(shaper, Mode(frequency_hz, 0.02)) < 1e-10
        between = np.linspace(zeros_hz[0], zeros_hz[-1], 1001)
        assert max(left_of(shaper, Mode(float(f), 0.02)) for f in between) <= 0.05 * (1.0 + 1e-9)


def test_modified_zv_on_a_grid_keeps_both_zeros() -> None:
    for period_s in PERIODS_S:
        shaper = design("mzv", [SLOW], options(period_s))[0].shaper
        second = mzv_second_zero(SLOW.mode)
        assert left_of(shaper, Mode(46.0, 0.02)) < 1e-10
        assert left_of(shaper, second) < 1e-10


def test_zv_on_a_grid_is_the_shortest_non_negative_design() -> None:
    rng = np.random.default_rng(3)
    for _ in range(16):
        mode = Mode(float(rng.uniform(15.0, 150.0)), float(rng.uniform(0.0, 0.05)))
        period_s = float(rng.choice(PERIODS_S))
        try:
            expected = shortest_non_negative([mode], period_s)
        except DesignError:
            with pytest.raises(DesignError):
                design("zv", [ModeBand(mode)], options(period_s))
            continue
        found = design("zv", [ModeBand(mode)], options(period_s))[0].shaper
        assert found.duration_s == pytest.approx(expected.duration_s, rel=1e-9)
        assert found.variance_s2 == pytest.approx(expected.variance_s2, rel=0.05)


def test_negative_zv_on_a_grid_is_no_longer_than_the_polynomial_with_such_taps() -> None:
    for period_s in (0.002, 0.004, 0.005):
        shaper = design("negative-zv", [SLOW], options(period_s))[0].shaper
        polynomial = design("polynomial", [SLOW], options(period_s, max_abs_sum=100.0))[0].shaper
        if np.abs(polynomial.amplitudes).max() <= 1.0:
            assert shaper.duration_s == pytest.approx(polynomial.duration_s)
        assert shaper.duration_s <= design("zv", [SLOW], options(period_s))[0].duration_s + 1e-12


@pytest.mark.parametrize("period_s", [0.002, 0.004])
def test_no_shorter_design_stays_below_the_limit(period_s: float) -> None:
    """Sampled frequencies and directions relax the problem: where even they forbid it, nothing shorter exists."""
    band = ModeBand(Mode(46.0, 0.02), 0.15)
    shaper = design("si", [band], options(period_s))[0].shaper
    assert sampled_worst(shaper, band) <= 0.05
    last = round(shaper.duration_s / period_s) - 1
    k = np.arange(last + 1)
    rows = [
        np.real(np.exp(-1j * direction) * np.exp(Mode(float(f), 0.02).pole.conjugate() * period_s * (last - k)))
        for f in np.linspace(46.0 * 0.85, 46.0 * 1.15, 21)
        for direction in np.linspace(0.0, 2.0 * np.pi, 64, endpoint=False)
    ]
    relaxed = linprog(np.zeros(last + 1), A_ub=np.array(rows), b_ub=np.full(len(rows), 0.999 * 0.05),
                      A_eq=np.ones((1, last + 1)), b_eq=[1.0])  # fmt: skip
    assert relaxed.status == 2


def test_specified_insensitivity_over_a_zero_band_and_a_wide_one() -> None:
    narrow = design("si", [ModeBand(Mode(46.0, 0.0))], options(0.001))[0]
    wide = design("si", [ModeBand(Mode(46.0, 0.0), 0.3)], options(0.001))[0]
    assert narrow.worst_residual <= 0.05
    assert wide.worst_residual <= 0.05
    assert narrow.duration_s < wide.duration_s
    # EI with one hump has an insensitivity of .399: a band of .39 needs about its taps, one period
    ei_like = design("si", [ModeBand(Mode(46.0, 0.0), 0.195)], options(1.0 / (46.0 * 64)))[0]
    assert ei_like.duration_s == pytest.approx(1.0 / 46.0, rel=0.05)
    with pytest.raises(ArgumentError, match="above 0 and below 1"):
        design("si", [SLOW], options(0.001, vibration_limit=0.0))


def test_simultaneous_of_the_paper() -> None:
    shaper = design("simultaneous", [SLOW, FAST])[0].shaper
    assert shaper.times_s * 1e3 == pytest.approx([0.0, 6.514, 11.326], abs=5e-4)
    assert shaper.amplitudes == pytest.approx([0.49156, 0.06297, 0.44547], abs=5e-6)


def test_simultaneous_of_two_modes_is_the_shortest_non_negative_minimal_shaper() -> None:
    rng = np.random.default_rng(11)
    for _ in range(6):
        slow = float(rng.uniform(20.0, 60.0))
        modes = [Mode(slow, float(rng.uniform(0.0, 0.05))), Mode(slow * float(rng.uniform(1.3, 2.8)), 0.02)]
        minimal = [each for each in minimal_two_mode(modes[0], modes[1], 0.06) if not each.has_negative]
        shaper = simultaneous_zv(modes, 0.25)
        assert max(simulated(shaper, mode) for mode in modes) < 1e-11
        assert shaper.duration_s <= minimal[0].duration_s * (1.0 + 1e-9)
        if len(shaper.times_s) == 3:
            assert shaper.times_s == pytest.approx(minimal[0].times_s, rel=1e-7, abs=1e-12)


def test_simultaneous_of_three_and_four_modes() -> None:
    for frequencies in ((46.0, 131.0, 75.0), (30.0, 52.0, 87.0, 131.0)):
        modes = [Mode(f, 0.02) for f in frequencies]
        shaper = simultaneous_zv(modes, 0.25)
        assert max(simulated(shaper, mode) for mode in modes) < 1e-11
        assert shaper.amplitudes.min() > 0.0
        assert shaper.duration_s < sum(0.5 / f for f in frequencies)
        # no grid of a quarter of a millisecond holds a much shorter one
        assert shaper.duration_s <= shortest_non_negative(modes, 0.00025).duration_s
        assert shaper.duration_s >= shortest_non_negative(modes, 0.00025).duration_s - 0.0006


def test_equal_modes_count_once() -> None:
    twice = [SLOW, ModeBand(Mode(46.0 * (1.0 + 1e-12), 0.02), 0.1)]
    assert [band.uncertainty for band in distinct(twice)] == [0.1]
    for name in (*EXACT, *TOLERANT, "simultaneous"):
        assert design(name, [SLOW, SLOW])[0].duration_s == design(name, [SLOW])[0].duration_s, (
            f"{name} designed for the same mode twice"
        )


def test_bad_modes_are_refused_with_their_numbers() -> None:
    with pytest.raises(ArgumentError, match="46 Hz has damping ratio 1, must be at least 0 and below 1"):
        parse_mode_band("46:1")
    with pytest.raises(ArgumentError, match=r"46 Hz has damping ratio 1\.2"):
        Mode(46.0, 1.2)
    with pytest.raises(ArgumentError, match="mode frequency 0 Hz, must be finite and above 0"):
        Mode(0.0, 0.02)
    for name in ("zvd", "taps", "si"):
        with pytest.raises(ArgumentError, match="0 given"):
            design(name, [])


def test_a_grid_that_sees_no_vibration_is_refused_with_what_is_nearest() -> None:
    # 200 Hz at 5 ms: each tap meets the mode in the same phase
    with pytest.raises(DesignError, match=r"no ZVD for 200 Hz .* within 250 ms on a 5 ms grid, nor within 1000 ms; "
                       r"nor is there a polynomial design: mode 200 Hz cannot be cancelled"):  # fmt: skip
        design("zvd", [ModeBand(Mode(200.0, 0.0))], options(0.005))
    with pytest.raises(DesignError, match="within 20 ms on a 5 ms grid; the shortest takes 25 ms"):
        design("zvd", [SLOW], options(0.005, max_duration_s=0.02))
    with pytest.raises(DesignError, match=r"zvd takes 21\.7\d* ms with sum\|a\| 1: the limits are 20 ms and 10"):
        design("zvd", [SLOW], options(max_duration_s=0.02))
    with pytest.raises(DesignError, match=r"negative-zv takes .* with sum\|a\| 27: the limits are 250 ms and 10"):
        design("negative-zv", [SLOW, FAST, ModeBand(Mode(75.0, 0.02))])
    with pytest.raises(DesignError, match=r"within 10 ms; the convolved ZV shapers take 14\.689\d ms"):
        simultaneous_zv([SLOW.mode, FAST.mode], 0.01)
    with pytest.raises(DesignError, match="the polynomial with its zeros takes 4 ms with sum"):
        conditions = Conditions((Zero(SLOW.mode),), (ModeBand(Mode(23.5, SLOW.mode.damping_ratio), 45.0 / 47.0),), 0.05)
        shortest_on_grid(conditions, 0.002, 0.02, title="design that nothing meets")


def test_close_zeros_cost_no_precision() -> None:
    for distance in (1e-9, 1e-6, 1e-3):
        pair = (Zero(SLOW.mode), Zero(Mode(46.0 * (1.0 + distance), 0.02)))
        shaper = shortest_on_grid(Conditions(zeros=pair), 0.002, 0.25, title="pair")
        assert max(left_of(shaper, Mode(zero.mode.frequency_hz, 0.02)) for zero in pair) < 1e-10


def test_a_limit_is_proven_over_its_band() -> None:
    band = ModeBand(Mode(47.5, SLOW.mode.damping_ratio), 12.5 / 47.5)
    shaper = shortest_on_grid(Conditions(bands=(band,), limit=0.1), 0.002, 0.25, title="limit")
    assert worst_residual(shaper, SLOW.mode, 35.0, 60.0).upper_bound <= 0.1


def test_taps_in_every_form() -> None:
    expected = Shaper([0.0, 0.01], [0.75, 0.25])
    for given in (
        "0:0.75,0.01:0.25",
        " 0s : 0.75 , 10ms : .25 ",
        "[[0, 0.75], [0.01, 0.25]]",
        '{"times_s": [0, 0.01], "amplitudes": [0.75, 0.25]}',
        [[0, 0.75], (0.01, 0.25)],
        {"times_s": [0.0, 0.01], "amplitudes": [0.75, 0.25]},
    ):
        assert parse_taps(given) == expected
    found = design("taps", [SLOW], DesignOptions(taps=expected))[0]
    assert found.residual == pytest.approx(simulated(expected, SLOW.mode), rel=1e-9)
    assert design("taps", [SLOW], DesignOptions(taps=expected, period_s=0.005))[0].period_s == 0.005


def test_taps_that_are_none() -> None:
    for given, message in (
        ("", "is not an impulse"),
        ("0:0.5,0.01", "is not an impulse: TIME:AMPLITUDE"),
        ("0:0.5,0.01:0.4", "add up to"),
        ("0.01:1", "first time"),
        ("[[0, 1", "not valid JSON"),
        ("[[0, 1, 2]]", "pairs"),
        ("[[0, true]]", "is not a number"),
        ("[1]", "lists of numbers"),
        ('{"times_s": [0]}', "keys times_s and amplitudes"),
    ):
        with pytest.raises(ArgumentError, match=message):
            parse_taps(given)
    with pytest.raises(ArgumentError, match="none are"):
        design("taps", [SLOW])
    off = DesignOptions(taps=zv(SLOW.mode), period_s=0.005)
    with pytest.raises(DesignError, match=r"the impulse at 10\.87\d* ms is not on the 5 ms grid, nearest 10 ms"):
        design("taps", [SLOW], off)


def test_random_modes_on_random_grids() -> None:
    """Every grid design that is handed out cancels what it says, by a formula of the test."""
    rng = np.random.default_rng(5)
    names = itertools.cycle(("zv", "zvd", "mzv", "ei", "negative-zv", "si"))
    designed = 0
    for name, _ in zip(names, range(18), strict=False):
        band = ModeBand(Mode(float(rng.uniform(15.0, 150.0)), float(rng.uniform(0.0, 0.08))), 0.05)
        try:
            found = design(name, [band], options(float(rng.choice(PERIODS_S))))[0]
        except DesignError as error:
            assert "takes" in str(error) or "try another period" in str(error)
            continue
        designed += 1
        left = left_of(found.shaper, band.mode)
        assert left <= (0.05 * (1.0 + 1e-9) if name in TOLERANT else 1e-10)
        assert found.worst_residual >= sampled_worst(found.shaper, band) * (1.0 - 2e-6) - 1e-11
    assert designed > 15


def documented(columns: int) -> list[list[str]]:
    """The rows of the section's table with that many columns: the family, then the others."""
    text = (Path(__file__).resolve().parents[2] / "docs" / "concepts" / "shapers.md").read_text(encoding="utf-8")
    section = text.split("## Families")[1].split("\n## ")[0]
    rows = [
        [cell.strip(" `") for cell in line.strip("|").split("|")] for line in re.findall(r"^\| `.*$", section, re.M)
    ]
    return [row for row in rows if len(row) == columns]


def test_the_table_of_one_mode() -> None:
    rows = documented(6)
    assert len(rows) == 14
    mode = Mode(46.0, 0.0)
    for name, periods, taps, insensitive, abs_sum, _ in rows:
        fine = options(1.0 / (500.0 * 46.0) if name.startswith("smooth") else None)
        shaper = design(name, [ModeBand(mode)], fine)[0].shaper
        assert shaper.duration_s * 46.0 == pytest.approx(float(periods), abs=5e-4)
        assert len(shaper.times_s) == int(taps)
        assert insensitivity(shaper, mode, 0.05) == pytest.approx(float(insensitive), abs=5.1e-4)
        assert shaper.abs_sum == pytest.approx(float(abs_sum))


def test_the_table_of_two_modes() -> None:
    rows = documented(5)
    assert len(rows) == 11
    for name, continuous, fine, coarse, worst in rows:
        for period_s, lasts in ((None, continuous), (0.001, fine), (0.005, coarse)):
            if lasts in {"–", "none"}:
                with pytest.raises((ArgumentError, DesignError)):
                    design(name, [SLOW, FAST], options(period_s))
                continue
            found = design(name, [SLOW, FAST], options(period_s))[0]
            assert found.duration_s * 1e3 == pytest.approx(float(lasts), abs=0.051)
        if worst != "–":
            assert found.worst_residual * 100.0 == pytest.approx(float(worst), abs=0.051)


@pytest.mark.parametrize("text", ["46:0.02", "30:0.1", "30:0.3", "46:0.02±5%", "30:0.1-10%+13%", "46±8%"])
@pytest.mark.parametrize("period_s", [0.001, 0.005])
def test_mirrored_taps_are_the_same_read_backwards(text: str, period_s: float) -> None:
    band = parse_mode_band(text)
    found = design("mirrored", [band], options(period_s))[0]
    taps = found.shaper.amplitudes
    assert taps == pytest.approx(taps[::-1], abs=1e-12)
    assert found.shaper.times_s + found.shaper.times_s[::-1] == pytest.approx(found.duration_s)
    assert taps.min() > 0.0
    assert sampled_worst(found.shaper, band) <= (0.05 if band.uncertainty else 1e-10)


def test_no_shorter_mirrored_design_has_the_zero() -> None:
    """A linear program of its own over cosines about the middle: a mirrored sum has no other part."""
    mode, period_s = Mode(30.0, 0.1), 0.001
    steps = round(design("mirrored", [ModeBand(mode)], options(period_s))[0].duration_s / period_s)
    for last in range(1, steps + 1):
        t = (np.arange(last + 1) - 0.5 * last) * period_s
        growth = np.exp(mode.damping_ratio * 2.0 * np.pi * 30.0 * t)
        turn = 2.0 * np.pi * 30.0 * math.sqrt(1.0 - 0.01) * t
        pairs = (np.eye(last + 1) - np.eye(last + 1)[::-1])[: (last + 1) // 2]
        rows = np.vstack([np.ones(last + 1), growth * np.cos(turn), growth * np.sin(turn), pairs])
        found = linprog(np.zeros(last + 1), A_eq=rows, b_eq=np.eye(len(rows))[0], method="highs-ds")
        assert (found.status == 0) == (last == steps), last


def test_a_band_with_two_ends_is_that_of_its_middle() -> None:
    band = parse_mode_band("30:0.1-13%+19%")
    ends = [band.shifted(side).frequency_hz for side in (-1.0, 1.0)]
    assert ends == pytest.approx([30.0 * 0.87, 30.0 * 1.19])
    assert band.damping_ratio == 0.1
    in_hz = parse_mode_band("30:0.1-3Hz+6Hz")
    assert [in_hz.shifted(side).frequency_hz for side in (-1.0, 1.0)] == pytest.approx([27.0, 36.0])
    (through_the_command,) = choose_shaper(
        ["30:0.1-13%+19%"], periods_s=[0.001], families=["robust"], uncertainty=0.5
    ).modes
    assert through_the_command == band
    assert parse_mode_band("30-5%+5%").uncertainty == pytest.approx(0.05)
    for text in ("30:0.1-13%", "30:0.1+19%-13%", "30:0.1-13+19", "30:0.1--13%+19%"):
        with pytest.raises(ArgumentError, match=re.escape(f"{text!r} is not a mode")):
            parse_mode_band(text)
    with pytest.raises(ArgumentError, match="begins at -6 Hz: it must be above 0"):
        parse_mode_band("30:0.1-120%+19%")
