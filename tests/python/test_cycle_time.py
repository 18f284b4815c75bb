"""Cycle time: closed form against NumPy convolutions, the paper's formulas, hand sums and the full interpolation."""

import functools
import itertools
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy import signal

import shapegcode as sg
from acceptance import PROGRAMS, SAMPLE_KEYS, machine_with
from shapegcode import _core
from shapegcode.io.units import FloatArray
from shapegcode.model.machine_model import fanuc_model

SAMPLES = sorted(path for path in PROGRAMS.iterdir() if path.suffix.upper() == ".NC")


def model(**values: object) -> _core.FanucModel:
    """A controller with acceleration after interpolation, 1 ms; keyword arguments override."""
    made = _core.FanucModel()
    made.motion = _core.MotionKind.after_interpolation
    for name, value in values.items():
        setattr(made, name, value)
    return made


def read(text: str) -> _core.ProgramText:
    options = _core.ReaderOptions()
    options.unknown_after_tool_change = [False, False, False]
    return _core.read_program(f"%\nO1\n{text}\nM30\n%\n".encode(), options)


# --- Block overlap ----------------------------------------------------------------------------------------------------


def increments(lengths: FloatArray, feeds: FloatArray, period_s: float, block_end: _core.BlockEnd) -> FloatArray:
    """Way per period of blocks run off at their feed, by cutting each block into pieces of F T."""
    if block_end == _core.BlockEnd.carry:
        ends = np.concatenate([[0.0], np.cumsum(lengths / feeds)])
        ticks = np.arange(0.0, ends[-1] + period_s * (1.0 - 1e-6), period_s)
        return np.diff(np.interp(ticks, ends, np.concatenate([[0.0], np.cumsum(lengths)])))
    pieces = []
    for length, feed in zip(lengths, feeds, strict=True):
        full = np.arange(0.0, length * (1.0 + 1e-12), feed * period_s)
        pieces.append(np.diff(np.append(full, length)))
    way = np.concatenate(pieces)
    return way[way > 1e-6 * feeds.min() * period_s]


@st.composite
def sequences(draw: st.DrawFn) -> tuple[_core.FanucModel, list[FloatArray], list[tuple[FloatArray, FloatArray]]]:
    """A controller, its filters' kernels, and ten sequences of normal, short or mixed blocks."""
    period = draw(st.sampled_from([0.001, 0.002, 0.004]))
    length = draw(st.integers(2, 60))
    shape = draw(st.sampled_from(["linear", "bell", "exponential"]))
    made = model(
        period_s=period,
        time_constant_s=length * period,
        block_end=draw(st.sampled_from([_core.BlockEnd.ceil, _core.BlockEnd.carry])),
    )
    kernels = [np.full(length, 1.0 / length)]
    if shape == "bell":
        bell = draw(st.integers(2, 30))
        made.bell_time_s = bell * period
        kernels.append(np.full(bell, 1.0 / bell))
    elif shape == "exponential":
        made.filter_shape = _core.FilterShape.exponential
        made.exponential_rest = draw(st.sampled_from([1e-2, 1e-4]))
        taps = np.exp(-np.arange(math.ceil(-math.log(made.exponential_rest) * length)) / length)
        kernels = [taps / taps.sum()]
    # Duration of a block relative to the time constant: short below 1, normal above.
    low, high = {"short": (0.02, 1.0), "normal": (1.0, 3.0), "mixed": (0.02, 3.0)}[
        draw(st.sampled_from(["short", "normal", "mixed"]))
    ]
    generator = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    found = []
    for _ in range(10):
        count = int(generator.integers(1, 12))
        feeds = generator.uniform(1.0, 200.0, count)
        found.append((feeds * made.time_constant_s * generator.uniform(low, high, count), feeds))
    return made, kernels, found


def check_block_overlap(case: tuple[_core.FanucModel, list[FloatArray], list[tuple[FloatArray, FloatArray]]]) -> None:
    """The closed form is the time until the convolved increments end, to one period."""
    made, kernels, found = case
    for lengths, feeds in found:
        way = increments(lengths, feeds, made.period_s, made.block_end)
        for kernel in kernels:
            way = np.convolve(way, kernel)
        assert way.sum() == pytest.approx(lengths.sum(), rel=1e-9)
        moving_s = (np.flatnonzero(way > 0.0)[-1] + 1) * made.period_s
        closed_s = _core.block_overlap_time_s(lengths, feeds, made)
        assert abs(closed_s - moving_s) <= made.period_s * (1.0 + 1e-6)


@settings(max_examples=200, deadline=None)
@given(sequences())
def test_block_overlap_is_the_moving_average(
    case: tuple[_core.FanucModel, list[FloatArray], list[tuple[FloatArray, FloatArray]]],
) -> None:
    check_block_overlap(case)


MANY = settings(max_examples=1000, deadline=None)
test_block_overlap_of_10000_sequences_is_the_moving_average = pytest.mark.slow(
    MANY(given(sequences())(check_block_overlap))
)


@given(st.lists(st.tuples(st.floats(0.01, 50.0), st.floats(0.5, 300.0)), min_size=1, max_size=20), st.integers(1, 100))
def test_block_overlap_is_the_sum_of_the_specification(blocks: list[tuple[float, float]], length: int) -> None:
    """Sum of ceil(l / (F T)) T plus A; nothing is added where there is no acceleration."""
    lengths, feeds = (np.array(column) for column in zip(*blocks, strict=True))
    periods = np.ceil(lengths / feeds / 1e-3 - 1e-6).sum()
    assert _core.block_overlap_time_s(lengths, feeds, model(time_constant_s=0.0)) == pytest.approx(periods * 1e-3)
    expected = periods + (length if length > 1 else 0)
    found = _core.block_overlap_time_s(lengths, feeds, model(time_constant_s=length * 1e-3))
    assert found == pytest.approx(expected * 1e-3)


# --- Rapids -----------------------------------------------------------------------------------------------------------

travels = st.tuples(*[st.one_of(st.just(0.0), st.floats(-400.0, 400.0).filter(lambda x: abs(x) > 1e-3))] * 3).filter(
    any
)


@given(travels, st.sampled_from([0.001, 0.008]), st.integers(1, 30), st.integers(0, 10), st.booleans())
def test_rapid_time_is_the_papers(
    travel: tuple[float, float, float], period: float, ramp: int, bell: int, linear: bool
) -> None:
    """Paper 004, eq. 6 to 16, for axes of one rate: F_r along the longest axis."""
    rate, ramp_s = 10_000 / 60.0, ramp * period
    made = model(
        period_s=period,
        rapid_rate_mm_per_s=[rate] * 3,
        rapid_time_constant_s=[ramp_s] * 3,
        rapid_bell_time_s=bell * period,
        rapid_path=_core.RapidPath.linear if linear else _core.RapidPath.non_linear,
    )
    # With one rate for all axes, v = min(1420 L / d) covers the longest axis at that rate: both ways take equally long.
    longest = max(map(abs, travel))
    if longest >= rate * ramp_s:
        expected = math.ceil(longest / (rate * period) - 1e-6) * period + ramp_s
    else:
        expected = 2.0 * max(1, math.ceil(math.sqrt(longest * ramp_s / rate) / period - 1e-6)) * period
    assert _core.rapid_time_s(travel, made) == pytest.approx(expected + bell * period, abs=1e-9)


@given(
    travels, st.tuples(*[st.floats(50.0, 600.0)] * 3), st.tuples(*[st.floats(0.005, 0.3)] * 3), st.integers(0, 40),
    st.booleans(), st.sampled_from([0.25, 0.5, 1.0]),
)  # fmt: skip
def test_rapid_set_points_keep_rate_and_acceleration_and_take_the_closed_time(
    travel: tuple[float, float, float],
    rates: tuple[float, float, float],
    ramps: tuple[float, float, float],
    bell: int,
    linear: bool,
    override: float,
) -> None:
    made = model(
        rapid_rate_mm_per_s=rates,
        rapid_time_constant_s=ramps,
        rapid_bell_time_s=bell * 1e-3,
        rapid_override=override,
        rapid_path=_core.RapidPath.linear if linear else _core.RapidPath.non_linear,
    )
    start = np.array([3.0, -7.0, 11.0])
    points = _core.rapid_samples(start, start + travel, made)
    assert len(points) - 1 == round(_core.rapid_time_s(travel, made) / 1e-3)
    np.testing.assert_allclose(points[[0, -1]], [start, start + travel], atol=1e-9)
    speed = np.abs(np.diff(points, axis=0)).max(axis=0) / 1e-3
    assert (speed <= np.array(rates) * override * (1 + 1e-6) + 1e-9).all()
    change = np.abs(np.diff(np.diff(points, axis=0, prepend=[start]), axis=0)).max(axis=0) / 1e-6
    # A ramp is a whole number of periods, to the nearest: it may be half a period short.
    shortened = 1.0 - 0.5e-3 / (min(ramps) * override)
    assert (change <= np.array(rates) / np.array(ramps) / shortened * (1.0 + 1e-6) + 1e-3).all()
    if linear:
        unit = np.array(travel) / np.linalg.norm(travel)
        aside = (points - start) - np.outer((points - start) @ unit, unit)
        assert np.abs(aside).max() < 1e-9
    else:
        # Not slower than the axes ask for: constant acceleration to the rate, plus bell, plus rounding to periods.
        needed = max(
            way / rate / override + ramp * override
            if way >= rate * override * ramp * override
            else 2.0 * math.sqrt(way * ramp / rate)
            for way, rate, ramp in zip(map(abs, travel), rates, ramps, strict=True)
            if way
        )
        assert len(points) - 1 <= needed / 1e-3 + bell + 2.5


@pytest.mark.parametrize("linear", [True, False])
@pytest.mark.parametrize("forward", [0.0, 0.7])
@pytest.mark.parametrize("travel", [(120.0, 0.0, 0.0), (0.4, -90.0, 12.0), (0.0, 0.0, 1.5), (30.0, 200.0, -0.05)])
def test_servo_wait_is_the_decay_of_the_lag(travel: tuple[float, float, float], forward: float, linear: bool) -> None:
    """Against SciPy: (K + a s) / (s + K) behind the set-points, simulated until every axis is within the width."""
    gains, widths = (30.0, 40.0, 50.0), (0.02, 0.01, 0.005)
    made = model(
        in_position=_core.InPosition.servo_lag,
        position_gain_per_s=gains,
        feed_forward_ratio=[forward] * 3,
        in_position_width_mm=widths,
        rapid_bell_time_s=0.03,
        rapid_path=_core.RapidPath.linear if linear else _core.RapidPath.non_linear,
    )
    points = _core.rapid_samples((0.0, 0.0, 0.0), travel, made)
    held = np.vstack([points, np.repeat(points[-1:], 2000, axis=0)])
    time = np.arange(len(held)) * 1e-3
    late = np.zeros(len(held), dtype=bool)
    for axis in range(3):
        _, follows, _ = signal.lsim((-gains[axis], 1.0, gains[axis] * (1.0 - forward), forward), held[:, axis], time)
        late |= np.abs(held[:, axis] - follows) > widths[axis]
    waited = max(0, np.flatnonzero(late)[-1] + 1 - (len(points) - 1))
    assert _core.in_position_wait_s(travel, made) == pytest.approx(waited * 1e-3, abs=1.001e-3)


def test_measured_wait_is_that_of_the_slowest_axis_that_moved() -> None:
    made = model(in_position_s=[0.025, 0.03, 0.12])
    waits = [_core.in_position_wait_s(t, made) for t in [(1, 0, 0), (1, 2, 0), (0, 0, -1), (0, 0, 0)]]
    assert waits == [0.025, 0.03, 0.12, 0.0]


# --- Circles ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("forward", [0.0, 0.6])
@pytest.mark.parametrize("shape", ["linear", "bell", "exponential"])
def test_radial_error_is_the_manuals(shape: str, forward: float) -> None:
    """(T1^2/24 + (1 - a^2) T2^2/2) v^2/r linear and bell, T1^2/2 instead exponential; for bell T1^2 = a^2 + b^2."""
    gain, first, bell = 30.0, 0.05, 0.04
    made = model(
        period_s=0.0005,
        time_constant_s=first,
        bell_time_s=bell if shape == "bell" else 0.0,
        filter_shape=_core.FilterShape.exponential if shape == "exponential" else _core.FilterShape.linear,
        exponential_rest=1e-6,
        position_gain_per_s=[gain] * 3,
        feed_forward_ratio=[forward] * 3,
    )
    squared = first**2 + (bell**2 if shape == "bell" else 0.0)
    filters = squared / (2.0 if shape == "exponential" else 24.0)
    servo = (1.0 - forward**2) / gain**2 / 2.0
    for radius, feed in itertools.product((5.0, 20.0, 60.0, 200.0), (2.0, 10.0, 40.0, 100.0)):
        # The manual's formulas are the first term of a series in (T v / r)^2; beyond this the next one shows.
        if feed / radius * max(1.0 / gain, first) > 0.1:
            continue
        found = _core.simulate_circle(radius, feed, made)
        assert found.command_error_mm == pytest.approx(filters * feed**2 / radius, rel=0.01)
        assert found.radial_error_mm == pytest.approx((filters + servo) * feed**2 / radius, rel=0.01)


@pytest.mark.parametrize("constant", [0.4, 7.3, 60.0])
def test_exponential_filter_is_the_recursive_one(constant: float) -> None:
    walk = np.cumsum(np.random.default_rng(3).normal(size=5000)) + 100.0
    fir = _core.Fir.exponential(constant, 1e-12)
    q = math.exp(-1.0 / constant)
    expected, _ = signal.lfilter([1.0 - q], [1.0, -q], walk, zi=[q * walk[0]])
    np.testing.assert_allclose(fir.apply(walk)[:5000], expected, atol=1e-8)
    assert fir.variance_samples2 == pytest.approx(q / (1.0 - q) ** 2, rel=1e-6)


# --- Programs ---------------------------------------------------------------------------------------------------------


def varied(name: str, **values: object) -> Callable[[sg.Machine], _core.FanucModel]:
    def make(of: sg.Machine) -> _core.FanucModel:
        made = fanuc_model(of)
        for key, value in values.items():
            setattr(made, key, value)
        return made

    make.__name__ = name
    return make


AFTER, AHEAD = _core.MotionKind.after_interpolation, _core.MotionKind.look_ahead
LAG = _core.InPosition.servo_lag
VARIANTS = [
    varied("linear", motion=AFTER),
    varied("bell_lag_8ms", motion=AFTER, bell_time_s=0.024, rapid_bell_time_s=0.03, in_position=LAG, period_s=0.008),
    varied("exponential_carry", motion=AFTER, filter_shape=_core.FilterShape.exponential,
           block_end=_core.BlockEnd.carry, rapid_path=_core.RapidPath.non_linear),
    varied("look_ahead", motion=AHEAD, in_position=LAG, feed_forward_ratio=[0.5] * 3),
    varied("look_ahead_filter_override", motion=AHEAD, look_ahead_filter_time_constant_s=0.024, feed_override=1.2,
           rapid_override=0.5, tool_change_s=4.0, m_function_s=0.3),
]  # fmt: skip


@functools.cache
def program(path: Path) -> tuple[sg.Program, sg.Machine]:
    of = machine_with(SAMPLE_KEYS.get(path.name))
    return sg.Program.read(path, of), of


@pytest.mark.parametrize("variant", VARIANTS, ids=lambda variant: variant.__name__)
@pytest.mark.parametrize("path", SAMPLES, ids=lambda path: path.name)
def test_closed_form_is_the_full_interpolation(path: Path, variant: Callable[[sg.Machine], _core.FanucModel]) -> None:
    source, of = program(path)
    made = variant(of)
    closed = _core.time_program(source.core, made, per_block=True)
    full = _core.interpolate_program(source.core, made)
    assert full.set_points > 0
    assert closed.total_s == pytest.approx(full.total_s, rel=0.005)
    for part in ("dwell_s", "tool_change_s", "function_s"):
        assert getattr(closed, part) == pytest.approx(getattr(full, part), abs=1e-9)
    assert closed.in_position_s == pytest.approx(full.in_position_s, rel=0.005)
    np.testing.assert_allclose(closed.regions["duration_s"], full.region_s, rtol=0.005)
    check_sums(closed)


def check_sums(closed: _core.CycleTime) -> None:
    """Every breakdown adds up to the total."""
    parts = ("cutting_s", "rapid_s", "in_position_s", "dwell_s", "acceleration_s", "tool_change_s", "function_s")
    assert closed.total_s == pytest.approx(sum(getattr(closed, part) for part in parts))
    for part in (*parts, "total_s"):
        assert sum(getattr(tool, part) for tool in closed.tools) == pytest.approx(getattr(closed, part), abs=1e-9)
        assert getattr(closed, part) >= 0.0
    regions, blocks = closed.regions, closed.blocks
    np.testing.assert_allclose(
        regions["duration_s"], regions["cutting_s"] + regions["acceleration_s"] + regions["in_position_s"]
    )
    inside = (regions["cutting_s"] + regions["acceleration_s"]).sum()
    assert closed.outside_regions_s + inside == pytest.approx(closed.total_s)
    assert blocks["duration_s"].sum() == pytest.approx(closed.total_s)
    np.testing.assert_allclose(blocks["start_s"][1:], (blocks["start_s"] + blocks["duration_s"])[:-1], atol=1e-6)
    moving = blocks["kind"] <= int(_core.BlockKind.rapid)
    assert (blocks["feed_mm_per_s"][moving] > 0.0).all()
    assert not blocks.flags.writeable


def test_hand_sum() -> None:
    """A program added up on paper: 1 ms, A 50 ms, rapid 200 mm/s over 100 ms, tool change 3 s, M functions 0.5 s."""
    made = model(
        rapid_rate_mm_per_s=[200.0] * 3, rapid_time_constant_s=[0.1] * 3, in_position_s=[0.02, 0.03, 0.12],
        tool_change_s=3.0, m_function_s=0.5,
    )  # fmt: skip
    text = "\n".join(
        [
            "G21 G17 G90 G94 G54",
            "T7 M06",  # 3 s
            "G00 X0. Y0. Z100.",  # from where it is not known: no time
            "S5000 M03",  # 0.5 s
            "G00 X100. Y50.",  # X 0.5 s + 0.1 s, wait of Y 0.03 s
            "Z98.",  # short: 2 sqrt(2 / 2000) = 0.0632 -> 2 x 32 ms, wait 0.12 s
            "G01 Z88. F600.",  # 1 s
            "X100.105",  # 10.5 ms -> 11 ms
            "X100.205",  # 10 ms, then 50 ms
            "G04 P1500",  # 1.5 s
            "G09 G01 Y60. F1200.",  # 0.5 s + 50 ms, wait 0.03 s
            "T8",
            "G93 G01 Y80. F30.",  # a thirtieth of a minute: 2 s, 50 ms
            "M06",  # 3 s
            "G94 G01 Y80. F100.",  # no way: no time
            "M01",  # 0.5 s
        ]
    )
    closed = _core.time_program(read(text), made, per_block=True)
    assert closed.rapid_s == pytest.approx(0.5 + 0.01)
    assert closed.in_position_s == pytest.approx(0.03 + 0.12 + 0.03)
    assert closed.cutting_s == pytest.approx(1.0 + 0.011 + 0.010 + 0.5 + 2.0)
    assert closed.acceleration_s == pytest.approx(0.1 + (0.064 - 0.01) + 3 * 0.05)
    assert closed.dwell_s == 1.5
    assert closed.tool_change_s == 6.0
    assert closed.function_s == pytest.approx(0.5 + 0.5 + 0.5)  # M03, M01, M30
    assert [tool.tool for tool in closed.tools] == [7, 8]
    assert closed.tools[1].total_s == pytest.approx(3.0 + 0.5 + 0.5)
    assert [int(line) for line in closed.regions["first_line"]] == [9, 13, 15]
    check_sums(closed)
    full = _core.interpolate_program(read(text), made)
    assert full.total_s == pytest.approx(closed.total_s, abs=8e-3)


def test_overrides_scale_feeds_and_rates() -> None:
    made = model(time_constant_s=0.0, rapid_time_constant_s=[0.0] * 3, rapid_rate_mm_per_s=[200.0] * 3)
    text = "G90 G94\nG00 X0. Y0. Z0.\nG00 X100.\nG01 X160. F3600."
    plain = _core.time_program(read(text), made)
    assert (plain.rapid_s, plain.cutting_s) == (pytest.approx(0.5), pytest.approx(1.0))
    made.feed_override, made.rapid_override = 0.5, 0.25
    slow = _core.time_program(read(text), made)
    assert (slow.rapid_s, slow.cutting_s) == (pytest.approx(2.0), pytest.approx(2.0))
    # No axis above its largest feed, whatever the override.
    limits = made.limits
    limits.max_feed_mm_per_s = [40.0, 10.0, 10.0]
    made.limits, made.feed_override = limits, 1.2
    assert _core.time_program(read(text), made).cutting_s == pytest.approx(1.5)


@pytest.mark.parametrize("motion", [AFTER, AHEAD])
def test_a_row_of_short_blocks_reaches_its_feed_and_a_lonely_one_does_not(motion: _core.MotionKind) -> None:
    made = model(motion=motion, time_constant_s=0.1)
    limits = made.limits
    limits.time_constant_s = 0.1
    made.limits = limits
    row = "G90 G94\nG00 X0. Y0. Z0.\nG01 F6000. " + "\n".join(f"X{k}." for k in range(1, 41))
    feeds = _core.time_program(read(row), made, per_block=True).blocks["feed_mm_per_s"]
    assert feeds[20] == pytest.approx(100.0)
    lonely = "G90 G94\nG00 X0. Y0. Z0.\nG01 F6000. X1."
    feed = _core.time_program(read(lonely), made, per_block=True).blocks["feed_mm_per_s"][0]
    # After interpolation 1 mm in 100 ms; in look-ahead up and down within 1 mm at 1000 mm/s2.
    assert feed == pytest.approx(10.0 if motion == AFTER else math.sqrt(1000.0))


def test_contour_acceleration_slows_arcs_and_polylines() -> None:
    """On a circle v = sqrt(a r); a polyline along it has that at the corners whose turn is along one axis."""
    made = model(motion=AHEAD)
    limits = made.limits
    limits.law = _core.AccelerationLaw.jerk_limited
    limits.max_acceleration_mm_per_s2 = [500.0] * 3
    radius, feed, allowed = 20.0, 100.0, 200.0
    angles = [math.tau * k / 720 for k in range(1, 721)]
    corners = "\n".join(f"X{radius - radius * math.cos(a):.6f} Y{-radius * math.sin(a):.6f}" for a in angles)
    start = "G90 G94 G17\nG00 X0. Y0. Z0.\n"
    arc, polyline = (
        read(start + text) for text in (f"G03 X0. Y0. I{radius} F{feed * 60}", f"G01 F{feed * 60} {corners}")
    )
    limits.contour_acceleration_mm_per_s2 = [allowed] * 3
    made.limits = limits
    slow = math.sqrt(allowed * radius)
    assert _core.time_program(arc, made, per_block=True).blocks["feed_mm_per_s"][0] == pytest.approx(slow)
    feeds = _core.time_program(polyline, made, per_block=True).blocks["feed_mm_per_s"][:720]
    assert feeds[60:660].min() == pytest.approx(slow, rel=0.02)
    assert slow <= feeds[60:660].max() <= 1.25 * slow  # in the diagonal both axes share the turn


def test_machine_file_reaches_the_model() -> None:
    keys = {
        "controller.motion": "after_interpolation", "controller.after_interpolation_shape": "exponential",
        "controller.time_constant_s": 0.07, "controller.bell_time_s": 0.03, "controller.block_end": "carry",
        "controller.look_ahead_filter_time_constant_s": 0.024, "controller.interpolation_period_s": 0.002,
        "controller.block_time_s": 0.004, "controller.contour_acceleration_mm_s2": {"x": 1.0, "y": 2.0, "z": 3.0},
        "controller.rapid_time_constant_s": {"x": 0.1, "y": 0.2, "z": 0.3}, "controller.rapid_bell_time_s": 0.04,
        "controller.rapid_path": "non_linear", "controller.in_position": "servo_lag",
        "controller.in_position_s": {"x": 0.01, "y": 0.02, "z": 0.03}, "controller.in_position_width_um": 5.0,
        "controller.position_gain_per_s": 42.0, "controller.feed_forward_ratio": 0.9, "times.tool_change_s": 6.0,
        "times.m_function_s": 0.4,
    }  # fmt: skip
    made = fanuc_model(machine_with(keys), feed_override=0.8, rapid_override=0.25)
    assert (made.motion, made.filter_shape) == (AFTER, _core.FilterShape.exponential)
    assert (made.rapid_path, made.in_position) == (_core.RapidPath.non_linear, LAG)
    assert made.block_end == _core.BlockEnd.carry
    single = {
        "period_s": 0.002, "time_constant_s": 0.07, "bell_time_s": 0.03, "look_ahead_filter_time_constant_s": 0.024,
        "rapid_bell_time_s": 0.04, "feed_override": 0.8, "rapid_override": 0.25, "tool_change_s": 6.0,
        "m_function_s": 0.4,
    }  # fmt: skip
    assert {name: getattr(made, name) for name in single} == single
    per_axis = {
        "rapid_time_constant_s": [0.1, 0.2, 0.3], "in_position_s": [0.01, 0.02, 0.03],
        "in_position_width_mm": [0.005] * 3, "position_gain_per_s": [42.0] * 3, "feed_forward_ratio": [0.9] * 3,
    }  # fmt: skip
    for name, values in per_axis.items():
        assert list(getattr(made, name)) == values
    assert list(made.limits.contour_acceleration_mm_per_s2) == [1.0, 2.0, 3.0]


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("period_s", 0.0, "interpolation period"),
        ("time_constant_s", -1.0, "time constant"),
        ("feed_override", 0.0, "feed override"),
        ("rapid_rate_mm_per_s", [1.0, 0.0, 1.0], "rapid rate"),
        ("feed_forward_ratio", [0.0, 0.0, 1.1], "feed-forward"),
        ("in_position_width_mm", [1.0, math.nan, 1.0], "in-position width"),
        ("exponential_rest", 1.0, "exponential"),
    ],
)
def test_refuses_a_controller_that_cannot_be(name: str, value: object, said: str) -> None:
    with pytest.raises(_core.ArgumentError, match=said):
        _core.time_program(read("G90 G00 X1."), model(**{name: value}))
