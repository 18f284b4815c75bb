"""Modes that move: the machine's tables, the plant that varies, the shapers that follow, and what they leave."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.integrate import solve_ivp

import moving_scenario as scenario
from shapegcode import _core
from shapegcode._core import ArgumentError, DesignError, Fir, FollowingFir, Mode, ModeTable, Shaper, VaryingFir
from shapegcode.errors import MachineError
from shapegcode.machine import Machine
from shapegcode.model.machine_model import MachineModel
from shapegcode.model.modes import (
    axis_modes,
    machine_warnings,
    moving_axis,
    moving_modes,
    region_offset,
    region_range_warnings,
    slowest_mode,
    still_mode,
)
from shapegcode.program import Program
from shapegcode.shaping import shortest_non_negative
from shapegcode.shaping.grid import shaper_track
from shapegcode.shaping.track import MovingMode, design_track, shaper_of_mean
from shaper_residual import left_of

OVER_Z = '{ axis = "z", position_mm = [0, 200, 400], frequency_hz = [52, 46, 41] }'
OVER_MASS = "{ mass_kg = [0, 100, 300], frequency_hz = [50, 46, 40], damping_ratio = [0.02, 0.03, 0.05] }"


def machine_with(over: str, nominal: float = 46.0, more: str = "") -> Machine:
    """The VX500, its X mode with a table, and further lines of [shaping]."""
    text = Machine.builtin_text("vx500")
    text = text.replace("frequency_hz = 46.0", f"frequency_hz = {nominal}\nfrequency_over = {over}", 1)
    return Machine.from_toml(text.replace("# part_mass_kg = ...", more, 1), "m.toml")


@pytest.mark.parametrize("over", [OVER_Z, OVER_MASS])
def test_a_table_survives_being_written(over: str) -> None:
    machine = machine_with(over)
    assert Machine.from_toml(machine.to_toml()) == machine
    assert machine.axes.x.modes[0].frequency_over is not None


@pytest.mark.parametrize(
    ("over", "nominal", "said"),
    [
        (OVER_Z, 60.0, "frequency_hz is 60.0: must lie within frequency_over, 41.0 to 52.0"),
        ('{ axis = "u", position_mm = [0, 1], frequency_hz = [52, 41] }', 46.0, 'axis = "u": must be "x", "y" or "z"'),
        ('{ axis = "z", position_mm = [0, 2, 1], frequency_hz = [52, 46, 41] }', 46.0, "ascend: 1.0 follows 2.0"),
        ('{ axis = "z", position_mm = [0, 0], frequency_hz = [52, 41] }', 46.0, "must ascend: 0.0 follows 0.0"),
        ('{ axis = "z", position_mm = [0, 1], frequency_hz = [52, 46, 41] }', 46.0, "3 values for 2 of position_mm"),
        ('{ axis = "z", position_mm = [0], frequency_hz = [46] }', 46.0, "1 values: must have 2 or more"),
        ('{ axis = "z", position_mm = [0, 1], frequency_hz = [46, 0] }', 46.0, "frequency_hz.2 = 0: must be greater"),
        ('{ axis = "z", position_mm = [0, inf], frequency_hz = [46, 47] }', 46.0, "must be a finite number (unit: mm)"),
        ('{ position_mm = [0, 1], frequency_hz = [46, 47] }', 46.0, "position_mm is given, axis is not"),
        ('{ axis = "z", mass_kg = [0, 1], frequency_hz = [46, 47] }', 46.0, "axis is given, position_mm is not"),
        ("{ frequency_hz = [46, 47] }", 46.0, "needs position_mm (with axis) or mass_kg"),
        ('{ axis = "z", position_mm = [0, 1], mass_kg = [0, 1], frequency_hz = [46, 47] }', 46.0, "both are given"),
        ("{ mass_kg = [-1, 1], frequency_hz = [46, 47] }", 46.0, "must be 0 or more (unit: kg)"),
        ("{ mass_kg = [0, 1], frequency_hz = [46, 47], damping_ratio = [0.1, 1] }", 46.0, "must be less than 1"),
        ("{ mass_kg = [0, 1], frequency_hz = [46, 47], damping_ratio = [0.1] }", 46.0, "damping_ratio has 1 values"),
        ("{ mass = [0, 1], frequency_hz = [46, 47] }", 46.0, "unknown key; did you mean mass_kg?"),
        ("[46, 47]", 46.0, "must be a table"),
    ],
)  # fmt: skip
def test_bad_tables_are_refused_in_words(over: str, nominal: float, said: str) -> None:
    with pytest.raises(MachineError) as caught:
        machine_with(over, nominal)
    assert said in str(caught.value)
    assert "axes.x.modes.1" in str(caught.value)


@given(st.floats(-100.0, 500.0))
def test_tables_are_linear_and_constant_beyond_their_ends(at: float) -> None:
    mode = machine_with(OVER_MASS).axes.x.modes[0]
    here = still_mode(mode, abs(at))
    assert here.frequency_hz == pytest.approx(np.interp(abs(at), [0, 100, 300], [50, 46, 40]), rel=1e-13)
    assert here.damping_ratio == pytest.approx(np.interp(abs(at), [0, 100, 300], [0.02, 0.03, 0.05]), rel=1e-13)
    table = moving_modes(machine_with(OVER_Z))[0][0][1]
    there = table.mode_at(Mode(46.0, 0.02, 0.7), at)
    assert there.frequency_hz == pytest.approx(np.interp(at, [0, 200, 400], [52, 46, 41]), rel=1e-13)
    assert (there.damping_ratio, there.participation) == (0.02, 0.7)


def test_a_mass_fixes_the_mode_for_the_whole_program() -> None:
    machine = machine_with(OVER_MASS, more="part_mass_kg = 200")
    assert axis_modes(machine)[0] == [Mode(43.0, 0.04, 1.0)]
    assert all(not len(table.position_mm) for pairs in moving_modes(machine) for _, table in pairs)
    assert moving_axis(machine) is None
    assert slowest_mode(machine.axes.x.modes[0]) == (40.0, 0.02)


def test_position_tables_go_to_the_plant_shifted_and_in_program_coordinates() -> None:
    machine = machine_with(OVER_Z).with_values("axes.x.modes.1.frequency_uncertainty_percent", 10)
    assert moving_axis(machine) == 2
    table = MachineModel(machine).options(shift=-1.0, offset=(0.0, 0.0, 150.0)).mode_tables[0][0]
    assert table.axis == 2
    assert list(table.position_mm) == [-150.0, 50.0, 250.0]
    assert list(table.frequency_hz) == pytest.approx([46.8, 41.4, 36.9])
    assert len(moving_modes(machine, offset=(0.0, 0.0, None))[0][0][1].position_mm) == 0


def test_what_the_user_is_told() -> None:
    assert machine_warnings(machine_with(OVER_Z)) == []
    (missing,) = machine_warnings(machine_with(OVER_MASS))
    assert "part_mass_kg is not given" in missing
    assert "46 Hz" in missing
    (unused,) = machine_warnings(machine_with(OVER_Z, more="part_mass_kg = 20"))
    assert "has no effect" in unused
    (outside,) = machine_warnings(machine_with(OVER_MASS, more="part_mass_kg = 400"))
    assert "outside the table of axes.x.modes.1, 0 to 300 kg" in outside
    assert "40 Hz" in outside
    assert machine_warnings(machine_with(OVER_MASS, more="part_mass_kg = 300")) == []


def test_positions_of_a_program_are_those_of_the_machine() -> None:
    offsets = {"input.work_offsets": {"G55": [1, 2, 300]}, "input.tool_length_mm": {"3": 70}}
    machine = machine_with(OVER_Z).with_values(offsets)
    body = b"G21 G90 G55 G00 X0 Y0 Z50.\nG43 H3 Z40.\nG01 X10. F1000\nX0 Z-20.\nG49\nM30\n"
    program = Program.from_text(b"%\nO0001\n" + body + b"%\n", machine)
    (region,) = program.regions
    assert region_offset(region, machine) == (1.0, 2.0, 370.0)
    (beyond,) = region_range_warnings(program.regions, machine)
    assert "Z moves between 350 and 410 mm" in beyond
    assert "covers 0 to 400 mm" in beyond
    unknown = Program.from_text(b"%\nO0001\nG21 G90 G54 G00 X0 Y0\nG01 X10. F1000\nX20. Y5.\nM30\n%\n", machine)
    (said,) = region_range_warnings(unknown.regions, machine)
    assert "position of Z is unknown" in said
    assert region_offset(unknown.regions[0], machine)[2] is None


def test_modes_over_two_axes_are_refused() -> None:
    over_x = {"axis": "x", "position_mm": [0, 400], "frequency_hz": [140, 120]}
    machine = machine_with(OVER_Z).with_values("axes.y.modes.1.frequency_over", over_x)
    with pytest.raises(ArgumentError, match="positions of X and Z"):
        moving_axis(machine)
    with pytest.raises(ArgumentError, match="no mode of the machine file varies"):
        shaper_track(Machine.load("vx500"), 0.005)


def test_the_plant_solves_the_varying_equation() -> None:
    """Against SciPy's solution of u'' + 2 zeta w(z) u' + w(z)^2 u = 2 zeta w(z) x' + w(z)^2 x, w at the moving z."""
    tick, count = 0.001, 500
    time = np.arange(count + 1) * tick
    x = 20.0 * np.clip((time - 0.02) / 0.2, 0.0, 1.0) + 3.0 * np.sin(40.0 * time) * (time < 0.3)
    z = 200.0 - 210.0 * np.cos(2.0 * np.pi * time / 0.5)
    options = _core.SimulationOptions()
    options.period_s = tick
    options.modes = [[Mode(46.0, 0.02)], [], []]
    options.mode_tables = [[scenario.TABLE], [], []]
    options.measure_contour = False
    options.record_samples = count + 1
    positions = np.column_stack([x, 0.0 * x, z])
    simulated = _core.simulate_samples(positions, _core.Path([]), options).recorded_response[:, 0]

    def slope(t: float, state: np.ndarray) -> list[float]:
        omega = 2.0 * np.pi * np.interp(np.interp(t, time, z), [0.0, 200.0, 400.0], [52.0, 46.0, 41.0])
        k = min(int(t / tick + 1e-9), count - 1)
        speed = (x[k + 1] - x[k]) / tick
        here = x[k] + speed * (t - time[k])
        u, rate = state
        return [rate, 2.0 * 0.02 * omega * (speed - rate) + omega**2 * (here - u)]

    state, worst, largest = np.array([x[0], 0.0]), 0.0, 0.0
    for k in range(count):
        state = solve_ivp(slope, (time[k], time[k + 1]), state, rtol=1e-9, atol=1e-11).y[:, -1]
        worst = max(worst, abs(state[0] - simulated[k + 1]))
        largest = max(largest, abs(state[0] - x[k + 1]))
    assert largest > 0.3
    assert worst < 5e-5 * largest  # Z travels at up to 2.6 m/s; the error falls with the square of the tick


def same_zero() -> list[Fir]:
    """Filters of different lengths and mean delays that all cancel 46 Hz on a 5 ms grid."""
    mode = Mode(46.0, 0.02)
    others = [Mode(f, 0.02) for f in (70.0, 25.0, 131.0)]
    shapers = [shortest_non_negative([mode, *more], 0.005) for more in ([], *([other] for other in others))]
    return [Fir([round(t / 0.005) for t in s.times_s], list(s.amplitudes)) for s in shapers]


def impulse_residual(positions: np.ndarray, mode: Mode, period_s: float) -> float:
    """Vibration that a command's increments leave in a mode: each is an impulse, and the impulses add up."""
    increments = np.diff(positions, axis=0)[:, 0]
    lag = (len(increments) - np.arange(len(increments))) * period_s
    return float(abs(np.sum(increments * np.exp(mode.pole * lag))))


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1))
def test_zeros_survive_any_switching_in_the_scatter_form_only(seed: int) -> None:
    rng = np.random.default_rng(seed)
    filters, mode = same_zero_filters, Mode(46.0, 0.02)
    walk = np.cumsum(rng.normal(size=(80, 1)), axis=0)
    for place in (rng.integers(0, 4, size=80), rng.uniform(-0.5, 3.5, size=80)):
        shaped = VaryingFir(filters).apply(walk, place)
        assert impulse_residual(shaped, mode, 0.005) < 1e-11
    index = rng.integers(0, 4, size=80)
    held = np.vstack([walk, np.repeat(walk[-1:], 40, axis=0)])
    each = [np.asarray(fir.apply(held))[: len(held)] for fir in filters]
    gather = np.array([each[k][row] for row, k in enumerate([*index, *[index[-1]] * 40])])
    assert impulse_residual(gather, mode, 0.005) > 1e-3


same_zero_filters = same_zero()


def test_varying_filters_by_step_and_by_batch_agree_and_refuse() -> None:
    varying = VaryingFir(same_zero_filters)
    walk = np.cumsum(np.random.default_rng(1).normal(size=(200, 3)), axis=0)
    place = np.linspace(-0.2, 3.2, 200)
    batch = varying.apply(walk, place)
    stream = _core.VaryingFirStream(varying, 3)
    stream.reset(list(walk[0]))
    steps = [stream.step(list(row), at) for row, at in zip(walk, place, strict=True)]
    assert np.array_equal(np.array(steps), batch[:200])
    assert np.array_equal(batch[-1], walk[-1])
    following = FollowingFir(varying, 1, [-10.0, 0.0, 5.0, 12.0])
    middle = np.concatenate([walk[:1, 1], 0.5 * (walk[1:, 1] + walk[:-1, 1])])
    expected = varying.apply(walk, np.interp(middle, [-10.0, 0.0, 5.0, 12.0], [0.0, 1.0, 2.0, 3.0]))
    assert np.allclose(following.apply(walk), expected, rtol=0.0, atol=1e-12)
    with pytest.raises(ArgumentError, match="1 places for 200 samples"):
        varying.apply(walk, [0.0])
    with pytest.raises(ArgumentError, match="not finite"):
        varying.apply(walk * np.nan, place)
    with pytest.raises(ArgumentError, match="ascend"):
        FollowingFir(varying, 1, [0.0, 2.0, 1.0, 3.0])


@pytest.mark.parametrize("period_s", [0.002, 0.005])
@pytest.mark.parametrize("limit", [0.01, 0.003])
def test_a_track_keeps_its_limit_everywhere(period_s: float, limit: float) -> None:
    moving = [MovingMode(scenario.MODE, scenario.TABLE), MovingMode(Mode(131.0, 0.02))]
    track = design_track(moving, 2, (0.0, 400.0), period_s, residual_limit=limit)
    assert track.worst_residual <= limit
    assert np.ptp([node.shaper.mean_s for node in track.nodes]) < 1e-9
    filters = track.following(offset_mm=30.0)
    width = filters.fir.duration_samples + 1
    taps = []
    for fir in filters.fir.set:
        assert min(fir.taps) > 0.0
        row = np.zeros(width)
        row[list(fir.delays)] = fir.taps
        taps.append(row)
    worst, times_s = 0.0, (np.arange(width) * period_s).tolist()
    for z in np.linspace(0.0, 400.0, 401):
        place = filters.place(z - 30.0)
        low = min(int(place), len(taps) - 2)
        mixed = (low + 1 - place) * taps[low] + (place - low) * taps[low + 1]
        mode = Mode(float(np.interp(z, [0, 200, 400], [52, 46, 41])), 0.02)
        worst = max(worst, left_of(Shaper(times_s, mixed.tolist()), mode))
        assert left_of(Shaper(times_s, mixed.tolist()), Mode(131.0, 0.02)) < 1e-9
    # The longest shaper sets the end here, each shaper's own last tap in the design: e^(-zeta w t) lies between.
    assert worst <= limit * 1.1


def test_the_shaper_of_a_mean_has_the_least_spread() -> None:
    """Against a search over the free taps of a short grid: one mode on four taps leaves one freedom."""
    mode, period = Mode(46.0, 0.02), 0.005
    shaper = shaper_of_mean([mode], period, 4, 0.0065)
    assert shaper.mean_s == pytest.approx(0.0065, rel=1e-12)
    steps = np.arange(5.0)
    terms = np.exp(-mode.pole * steps * period)
    matrix = np.vstack([terms.real, terms.imag, np.ones(5), steps * period])
    some = np.linalg.lstsq(matrix, np.array([0.0, 0.0, 1.0, 0.0065]), rcond=None)[0]
    free = np.linalg.svd(matrix)[2][-1]
    best = min(
        float(((steps * period) ** 2) @ taps - 0.0065**2)
        for share in np.linspace(-1.0, 1.0, 20001)
        if (taps := some + share * free).min() >= -1e-12
    )
    assert shaper.variance_s2 <= best * (1.0 + 1e-9)
    assert shaper.variance_s2 == pytest.approx(best, rel=1e-3)
    assert shaper_of_mean([mode], period, 4, 0.001) is None


def test_tracks_refuse_what_they_cannot_do() -> None:
    moving = [MovingMode(scenario.MODE, scenario.TABLE)]
    with pytest.raises(ArgumentError, match="at least one mode"):
        design_track([], 2, (0.0, 400.0), 0.005)
    for error, axis, bounds, options, said in (
        (ArgumentError, 2, (400.0, 0.0), {}, "must be finite and ascend"),
        (ArgumentError, 1, (0.0, 400.0), {}, "can follow one axis"),
        (ArgumentError, 2, (0.0, 400.0), {"residual_limit": 0.0}, "must be above 0"),
        (DesignError, 2, (0.0, 400.0), {"residual_limit": 1e-4, "max_nodes": 4}, "more than 4 are not tried"),
        (DesignError, 2, (0.0, 400.0), {"max_duration_s": 0.006}, "no non-negative design within"),
    ):
        with pytest.raises(error, match=said):
            design_track(moving, axis, bounds, 0.005, **options)
    single = design_track(moving, 2, (100.0, 100.0), 0.005)
    assert [node.modes for node in single.nodes] == [(Mode(49.0, 0.02),)]


def test_a_machine_gets_its_track() -> None:
    track = shaper_track(machine_with(OVER_Z), 0.005)
    assert track.axis == 2
    assert (track.nodes[0].position_mm, track.nodes[-1].position_mm) == (0.0, 400.0)
    assert [mode.frequency_hz for mode in track.nodes[0].modes] == [52.0, 131.0]
    assert track.worst_residual <= 0.01
    assert track.duration_s < 0.03


def test_a_zig_zag_along_z_leaves_next_to_nothing_at_its_stops() -> None:
    """docs/concepts/moving_modes.md: 20 stops over 400 mm, and four long strokes."""
    unshaped, fixed, _, followed, *_ = (residuals for _, _, residuals in scenario.table(20))
    assert unshaped.max() > 100.0
    assert fixed.max() > 0.1 * unshaped.max()
    assert followed.max() < 0.01 * unshaped.max()
    runs = scenario.strokes(4)
    long_unshaped = scenario.played_residuals_um(runs, lambda run: run)
    followed = scenario.played_residuals_um(runs, scenario.following(scenario.main_track()))
    gathered = scenario.played_residuals_um(runs, scenario.gathered(scenario.main_track(11, equal_means=False)))
    assert followed.max() < 0.01 * long_unshaped.max()
    assert gathered.max() > 10.0 * followed.max()


def test_the_verdict_sees_the_mode_that_moves() -> None:
    """A stop at Z 400 oscillates at 41 Hz: the simulation of a machine with a table says what one with 41 Hz says."""
    machine, slow = machine_with(OVER_Z), machine_with(OVER_Z, nominal=41.0)
    plain = slow.with_values("axes.x.modes.1.frequency_over", None)
    path = _core.Path([_core.Segment.line([0.0, 0.0, 100.0], [30.0, 0.0, 100.0], 100.0)])
    deep = MachineModel(machine).simulate_original(path, offset=(0.0, 0.0, 300.0)).residual_mm[0]
    assert deep == pytest.approx(MachineModel(plain).simulate_original(path).residual_mm[0], rel=1e-4)
    unknown = MachineModel(machine).simulate_original(path, offset=(0.0, 0.0, None)).residual_mm[0]
    nominal = MachineModel(Machine.load("vx500")).simulate_original(path).residual_mm[0]
    assert unknown == nominal
    assert abs(deep - nominal) > 1e-4


def test_tables_of_the_core_refuse_what_is_no_table() -> None:
    for bad in (
        {"axis": 3, "position_mm": [0.0], "frequency_hz": [50.0]},
        {"position_mm": [0.0, 0.0], "frequency_hz": [50.0, 51.0]},
        {"position_mm": [0.0, 1.0], "frequency_hz": [50.0]},
        {"position_mm": [0.0, 1.0], "frequency_hz": [50.0, -1.0]},
        {"position_mm": [0.0, 1.0], "frequency_hz": [50.0, 51.0], "damping_ratio": [1.0, 0.0]},
    ):
        with pytest.raises(ArgumentError):
            ModeTable(**bad)  # type: ignore[arg-type]
