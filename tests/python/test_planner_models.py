"""The planners of open controls as they are modelled, beside their own and beside independent calculations."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import shapegcode as sg
from acceptance import machine_with
from judge import Mode, residual_um
from planner_references import PERIOD_S, Grbl, grbl_lines, klipper_points, smoothed
from shapegcode import _core
from shapegcode.machine.controller import PLANNER_NAMES
from shapegcode.model.machine_model import fanuc_model

PROGRAMS = Path(__file__).parents[1] / "golden" / "programs"
NAMES = ["CONTOUR_R.NC", "VINT_360arc.NC", "helical_bore.nc", "TEST_G90.NC", "PARALLEL.NC"]
PAPER = "G21G90\nG00X0.Y0.Z0.\nG01X20.F12000.\nG03X40.Y20.R20.\nG01Y40.\nG04P500\nM30\n"
MODES = [[Mode(46.0, 0.02)], [Mode(131.0, 0.02)], []]
READING = {"input.tool_change_unknown_axes": ""}


def machine_of(kind: str, acceleration: float = 1000.0, **settings: Any) -> sg.Machine:
    """The same limits for all axes; no rate of an axis is reached."""
    axes = {f"axes.{axis}.max_acceleration_mm_s2": acceleration for axis in "xyz"}
    rates = {f"axes.{axis}.max_feed_mm_per_min": 30_000.0 for axis in "xyz"}
    own = {f"controller.{kind}": settings} if settings else {}
    return machine_with({**READING, **axes, **rates, "controller.kind": kind, **own})


def paths_of(name: str, machine: sg.Machine, scale: float = 1.0) -> list[_core.Path]:
    """The first cuts of a program, at most 40."""
    text = PAPER if name == "paper" else (PROGRAMS / name).read_text()
    paths = [region.path for region in sg.Program.from_text(text, machine).regions[:40]]
    return [
        _core.Path([
            _core.Segment.line(each.start_mm, each.end_mm, each.feed_mm_per_s * scale)
            if each.kind == _core.SegmentKind.line
            else _core.Segment.arc(
                each.start_mm, each.end_mm, each.centre_mm, each.sweep_rad, each.feed_mm_per_s * scale, each.normal
            )
            for each in path
        ])
        for path in paths
    ]  # fmt: skip


def planned(path: _core.Path, machine: sg.Machine, *, emitted: bool = False) -> tuple[np.ndarray, float]:
    """Set-points and time by the model, arcs as in an original or as they are emitted."""
    model = fanuc_model(machine)
    model = _core.for_shaped_blocks(model) if emitted else model
    followed, profile = _core.controlled_motion(path, model.limits, model.planner)
    return np.asarray(_core.interpolate(followed, profile, PERIOD_S)), profile.duration_s


@pytest.mark.parametrize("name", ["paper", *NAMES])
@pytest.mark.parametrize(("acceleration", "ratio", "corner"), [(1000.0, 0.5, 5.0), (10_000.0, 0.0, 20.0)])
def test_klippers_own_host(name: str, acceleration: float, ratio: float, corner: float, tmp_path: Path) -> None:
    machine = machine_of("klipper", acceleration, minimum_cruise_ratio=ratio, square_corner_velocity_mm_per_s=corner)
    limits = {
        "velocity": 500.0, "acceleration": acceleration, "square_corner_velocity": corner, "arc_mm": 1.0,
        "minimum_cruise_ratio": ratio,
    }  # fmt: skip
    for path in paths_of(name, machine, 1.0 if name == "paper" else 6.0)[:4]:
        own, own_s = klipper_points(path, limits, tmp_path)
        points, time_s = planned(path, machine)
        assert time_s == pytest.approx(own_s, rel=1e-5, abs=1e-6)
        common = min(len(own), len(points))
        assert np.abs(own[:common] - points[:common]).max() < 2e-3


def test_klippers_own_host_on_random_polylines(tmp_path: Path) -> None:
    rng = np.random.default_rng(11)
    machine = machine_of("klipper", 3000.0, minimum_cruise_ratio=0.7)
    limits = {
        "velocity": 500.0, "acceleration": 3000.0, "square_corner_velocity": 5.0, "arc_mm": 1.0,
        "minimum_cruise_ratio": 0.7,
    }  # fmt: skip
    for _ in range(12):
        count = int(rng.integers(2, 200))
        points = np.cumsum(rng.normal(0.0, 10.0 ** rng.uniform(-2.0, 1.0), (count + 1, 3)), axis=0)
        feeds = rng.uniform(1.0, 300.0, count)
        path = _core.Path([_core.Segment.line(*each) for each in zip(points, points[1:], feeds, strict=False)])
        own, own_s = klipper_points(path, limits, tmp_path)
        found, time_s = planned(path, machine)
        assert time_s == pytest.approx(own_s, rel=1e-9)
        common = min(len(own), len(found))
        assert np.abs(own[:common] - found[:common]).max() < 1e-6


@pytest.mark.parametrize("name", ["paper", *NAMES])
@pytest.mark.parametrize("buffer", [15, 100])
def test_grbl_by_another_calculation(name: str, buffer: int) -> None:
    machine = machine_of("grbl", 700.0, junction_deviation_mm=0.02, look_ahead_blocks=buffer)
    grbl = Grbl(np.full(3, 700.0), np.full(3, 500.0), 0.02, buffer)
    for path in paths_of(name, machine, 6.0)[:10]:
        times_s = grbl.block_times_s(grbl_lines(path, 0.002))
        # Arcs whose start and end radius differ by rounding are spirals in the core.
        assert planned(path, machine)[1] == pytest.approx(sum(times_s), rel=1e-5)


def test_grbl_corner_in_closed_form() -> None:
    """Two lines of 100 mm with a right angle: v^2 = a d s / (1 - s), s = sin 45 degrees; the axes share a corner."""
    acceleration, deviation, feed = 500.0, 0.05, 100.0
    machine = machine_of("grbl", acceleration, junction_deviation_mm=deviation)
    path = _core.Path([
        _core.Segment.line([0, 0, 0], [100, 0, 0], feed), _core.Segment.line([100, 0, 0], [100, 100, 0], feed)
    ])  # fmt: skip
    half = math.sqrt(0.5)
    corner = math.sqrt(acceleration * math.sqrt(2.0) * deviation * half / (1.0 - half))
    ramps = (feed**2 + feed**2 - corner**2) / (2.0 * acceleration)
    expected = (2.0 * feed - corner) / acceleration + (100.0 - ramps) / feed
    assert planned(path, machine)[1] == pytest.approx(2.0 * expected, rel=1e-9)


def test_short_blocks_slow_grbl() -> None:
    """It can stop within its buffer: v^2 = 2 a l over the blocks behind the one that runs."""
    machine = machine_of("grbl", 500.0)
    path = _core.Path([_core.Segment.line([0.1 * k, 0, 0], [0.1 * k + 0.1, 0, 0], 100.0) for k in range(1000)])
    model = fanuc_model(machine)
    _, profile = _core.controlled_motion(path, model.limits, model.planner)
    fastest = np.asarray(profile.phases)[:, 3].max()
    assert fastest == pytest.approx(math.sqrt(2.0 * 500.0 * 0.1 * 14.5), rel=0.02)  # between 14 and 15 blocks


def test_chords_lie_within_their_tolerance_and_one_less_does_not() -> None:
    rng = np.random.default_rng(7)
    for radius, sweep, tolerance in zip(
        10.0 ** rng.uniform(-1, 3, 200), rng.uniform(-6.28, 6.28, 200), 10.0 ** rng.uniform(-4, -2, 200), strict=True
    ):
        start, end = [radius, 0, 0], [radius * math.cos(sweep), radius * math.sin(sweep), 5.0]
        count = _core.Segment.arc(start, end, [0, 0, 0], sweep, 10.0).chords_within(tolerance)

        def off_mm(chords: float, radius: float = radius, sweep: float = sweep) -> float:
            return radius - radius * math.cos(0.5 * sweep / chords)

        assert count == int(count) and off_mm(count) <= tolerance * (1.0 + 1e-6)
        assert count == 1 or off_mm(count - 1) > tolerance
    assert _core.Segment.line([0, 0, 0], [9, 0, 0], 10.0).chords_within(1e-3) == 1
    for tolerance in (0.0, -1.0, float("nan")):
        with pytest.raises(_core.ArgumentError, match="above 0"):
            _core.Segment.line([0, 0, 0], [9, 0, 0], 10.0).chords_within(tolerance)


def test_a_line_in_linuxcnc_in_closed_form() -> None:
    """20 mm at 100 mm/s and 5 000 mm/s²: 0.2 s and 0.02 s; without a rapid behind it half of the acceleration."""
    line = _core.Path([_core.Segment.line([0, 0, 0], [20, 0, 0], 100.0)])
    assert planned(line, machine_of("linuxcnc", 5000.0))[1] == pytest.approx(0.22, abs=0.0011)
    assert planned(line, machine_of("linuxcnc", 5000.0, rapid_follows=False))[1] == pytest.approx(0.24, abs=0.0011)


def test_linuxcnc_passes_no_corner_outside_of_its_tolerance() -> None:
    corner = _core.Path([
        _core.Segment.line([0, 0, 0], [20, 0, 0], 100.0), _core.Segment.line([20, 0, 0], [20, 20, 0], 100.0)
    ])  # fmt: skip
    for tolerance_mm in (0.001, 0.05, 0.5):
        points, _ = planned(corner, machine_of("linuxcnc", 5000.0, blend_tolerance_mm=tolerance_mm))
        nearest = np.min(np.hypot(points[:, 0] - 20.0, points[:, 1]))
        off = np.minimum(np.abs(points[:, 0] - 20.0), np.abs(points[:, 1])).max()
        assert off < tolerance_mm / math.sqrt(2.0) + 1e-6
        assert nearest > 0.4 * tolerance_mm  # it does leave the corner


@pytest.mark.parametrize("kind", ["linuxcnc", "klipper", "grbl"])
def test_everything_that_simulates_a_program_uses_the_same_planner(kind: str) -> None:
    machine = machine_of(kind, 2000.0)
    program = sg.Program.from_text(PAPER, machine)
    points, time_s = planned(program.regions[0].path, machine)
    simulated = sg.simulate(program, machine)
    timed = sg.cycle_time(program, machine)
    assert simulated.regions[0].time_s == pytest.approx((len(points) - 1) * PERIOD_S, abs=2.5 * PERIOD_S)
    assert timed.regions[0].duration_s == pytest.approx(time_s, abs=3.5 * PERIOD_S)


@pytest.mark.parametrize("kind", ["linuxcnc", "klipper", "grbl"])
def test_a_conversion_is_judged_by_the_planner(kind: str) -> None:
    own = {
        "linuxcnc": {"emission.dialect": "linuxcnc", "controller.linuxcnc": {"kink_ratio": 0.7}},
        "klipper": {"emission.dialect": "klipper"}, "grbl": {"controller.grbl": {"look_ahead_blocks": 100}},
    }  # fmt: skip
    machine = machine_of(kind, 10_000.0).with_values(own[kind])
    conversion = sg.convert(PAPER, machine, shape_all=True)
    cases = conversion.cases
    names = [case.name for case in cases]
    assert names[0] == f"nominal, planner of {PLANNER_NAMES[kind]}" and cases[0].counts
    assert not any(name.startswith(("nominal, c", "look-ahead", "underrun")) for name in names)
    # What the report says of the shaped cut is what the planner makes of its blocks.
    blocks = conversion.placed[0].blocks(conversion.emitted)
    points, _ = planned(blocks, machine, emitted=True)
    points = smoothed(points) if kind == "linuxcnc" else points
    residual = residual_um(points, MODES, PERIOD_S)
    assert cases[0].residual_um.x == pytest.approx(residual[0], abs=0.02)
    assert cases[0].residual_um.y == pytest.approx(residual[1], abs=0.02)
    assert conversion.cutting_time_s.emitted == pytest.approx((len(points) - 1) * PERIOD_S, abs=3.0 * PERIOD_S)


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"controller.kind": "marlin"}, 'must be "fanuc", "linuxcnc", "klipper" or "grbl"'),
        ({"controller.grbl": {"junction_deviation_mm": 0.0}}, "must be 1e-06 or more"),
        ({"controller.grbl": {"look_ahead_blocks": 1}}, "must be 2 or more"),
        ({"controller.klipper": {"minimum_cruise_ratio": 1.0}}, "must be less than 1"),
        ({"controller.linuxcnc": {"kink_ratio": 2.0}}, "must be 1 or less"),
        ({"controller.klipper": {"square_corner_velocity": 5.0}}, "square_corner_velocity"),
    ],
)
def test_bad_settings_are_refused(keys: dict[str, Any], message: str) -> None:
    with pytest.raises(sg.MachineError, match=message):
        machine_with(keys)


def test_the_core_checks_what_it_is_given() -> None:
    rules = _core.PlannerRules()
    rules.kind, rules.minimum_cruise_ratio = _core.ControllerKind.klipper, 1.5
    path = _core.Path([_core.Segment.line([0, 0, 0], [1, 0, 0], 1.0)])
    with pytest.raises(_core.ArgumentError, match=r"minimum cruise ratio is 1\.5.*0 to below 1"):
        _core.controlled_motion(path, _core.MotionLimits(), rules)
    rules.minimum_cruise_ratio = 0.5
    with pytest.raises(_core.ArgumentError, match="acceleration"):  # none is stated
        _core.controlled_motion(path, _core.MotionLimits(), rules)
