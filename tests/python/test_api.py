"""`import shapegcode as sg`: public names, arrays, and forms that agree to the last bit."""

import ast
import inspect
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

import shapegcode as sg
from acceptance import PROGRAMS
from shapegcode import _core
from shapegcode.model.machine_model import motion_limits

GOOD = "%\nO1\nG21G17G90G94\nG0X0Y0Z0\nG1X20.F6000\nG3X40.Y20.R20.\nG1Y40.\nG0Z50.\nM30\n%\n"


def test_public_names() -> None:
    stub = ast.parse(Path(sg.__file__).with_suffix(".pyi").read_text())
    imports = [node for node in stub.body if isinstance(node, ast.ImportFrom)]
    names = [alias.asname for node in imports for alias in node.names]
    assert [alias.name for node in imports for alias in node.names] == names, "a name is exported as what it is"
    assert sg.__all__ == dir(sg) == sorted(set(names)) == sorted(names)
    for name in names:
        assert getattr(sg, name) is not None, name
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        sg.nothing  # noqa: B018


def test_every_public_name_says_what_it_takes() -> None:
    for name in sg.__all__:
        value = getattr(sg, name)
        # Nobody makes errors himself, and the methods of a segment make it.
        if callable(value) and not name.endswith("Error") and value is not sg.Segment:
            assert "args" not in inspect.signature(value).parameters, name


def test_signatures_of_the_core_are_true() -> None:
    assert str(inspect.signature(sg.zv)) == "(mode: 'Mode | float', damping_ratio: 'float | None' = None) -> 'Shaper'"
    mode = sg.Mode(46.0, 0.02)
    for function in (sg.zv, sg.convolved_zv, sg.grid_polynomial, sg.minimal_two_mode):
        given = {"modes": [mode], "period_s": 0.005, "max_duration_s": 0.02, "max_abs_sum": 10.0}
        bound = inspect.signature(function).bind(**{
            name: given.get(name, sg.Mode(131.0, 0.02) if name == "second" else mode)
            for name in inspect.signature(function).parameters
            if name != "damping_ratio"
        })  # fmt: skip
        assert function(**bound.arguments) == function(*bound.arguments.values())
        assert "Returns:" in function.__doc__
    made = "(frequency_hz: 'float', damping_ratio: 'float' = 0.0, participation: 'float' = 1.0, excited_by: "
    made += "'Sequence[float]' = [0.0, 0.0, 0.0])"
    assert str(inspect.signature(sg.Mode)) == made
    assert list(inspect.signature(sg.Shaper).parameters) == ["times_s", "amplitudes"]
    # Defaults that are no literals, and what must be named.
    assert inspect.signature(sg.MillingForce).parameters["sense"].default is sg.SpindleSense.clockwise
    limits = inspect.signature(sg.FeedLimits).parameters["mean_power_w"]
    assert (limits.default, limits.kind) == (math.inf, inspect.Parameter.KEYWORD_ONLY)


def test_read_convert_simulate(tmp_path: Path) -> None:
    file = tmp_path / "part.nc"
    file.write_text(GOOD)
    machine = sg.Machine.load("vx500")
    program = sg.Program.read(file, machine)
    assert len(program.regions) == 1
    assert program.source == str(file)
    conversion = sg.convert(program, machine)
    assert isinstance(conversion.text, bytes)
    assert conversion.ok is conversion.to_dict()["within_tolerance"] is True
    emitted = sg.Program.from_text(conversion.text, machine, source="emitted")
    simulation = sg.simulate(emitted, machine, shaped=True)
    (region,) = simulation.regions
    assert region.command_mm.shape == region.response_mm.shape
    assert region.command_mm.shape[1] == 3
    assert region.command_mm.dtype == np.float64
    assert region.command_mm[0] == pytest.approx([0, 0, 0])
    assert region.command_mm[-1] == pytest.approx([40, 40, 0])
    assert region.period_s == 0.001
    # The residual is what the arrays show.
    still = np.flatnonzero((np.abs(np.diff(region.command_mm, axis=0)) > 0).any(axis=1))[-1] + 1
    after = np.abs(region.response_mm - region.command_mm)[still:].max(axis=0) * 1e3
    reported = simulation.residual_vibration_um
    for k, axis in enumerate("xyz"):
        assert after[k] <= reported[axis] + 1e-9
        assert after[k] == pytest.approx(reported[axis], rel=0.1, abs=0.02)


@pytest.mark.parametrize("kind", [str, Path])
def test_a_file_name_does_for_a_program(tmp_path: Path, kind: type[str] | type[Path]) -> None:
    machine = sg.Machine.load("vx500")
    (tmp_path / "part.nc").write_text(GOOD)
    file = kind(tmp_path / "part.nc")
    program = sg.Program.read(file, machine)
    for function in (sg.check, sg.cycle_time, sg.simulate):
        assert function(file, machine).to_dict() == function(program, machine).to_dict()
    assert np.array_equal(sg.simulate_motion(file, machine).high, sg.simulate_motion(program, machine).high)
    assert sg.measure([file], machine, 3.0).to_dict() == sg.measure(program, machine, 3.0).to_dict()
    assert sg.measure(file, machine, 3.0, against=file).programs[0].measured_against == str(file)
    streamed, other = (next(sg.stream(each, machine)) for each in (file, program))
    assert np.array_equal(streamed.response_mm, other.response_mm)


def test_every_function_that_takes_a_program_takes_its_file() -> None:
    takers = 0
    for name in sg.__all__:
        if inspect.isfunction(function := getattr(sg, name)):
            for parameter in inspect.signature(function).parameters.values():
                # A batch takes folders and patterns as well, each program in a process of its own.
                if parameter.name in {"program", "programs", "against"} and name != "batch":
                    takers += 1
                    assert "Program | str | Path" in str(parameter.annotation), name
    assert takers > 7


def test_figures_only_keeps_no_samples() -> None:
    simulation = sg.simulate(sg.Program.from_text(GOOD, "vx500"), "vx500", record_samples=0)
    assert len(simulation.regions[0].command_mm) == 0
    assert simulation.residual_vibration_um.x > 1.0


def test_errors_are_one_family_and_carry_their_place() -> None:
    machine = sg.Machine.load("vx500")
    found = [getattr(sg, name) for name in sg.__all__ if name.endswith("Error")]
    assert len(found) > 9
    assert all(issubclass(error, sg.ShapegcodeError) for error in found)
    for error in (sg.MachineError, sg.ToolError, sg.StockError, sg.ArgumentError):
        assert issubclass(error, ValueError)
    with pytest.raises(sg.ProgramError, match=r"^part\.nc:2:3: ") as caught:
        sg.Program.from_text("%\nG1XF100\n%", machine, source="part.nc")
    assert (caught.value.line, caught.value.column) == (2, 3)
    with pytest.raises(sg.MachineError):
        sg.Machine.load("nothing")
    with pytest.raises(FileNotFoundError):
        sg.Program.read("/nowhere/part.nc", machine)
    for ratio in (0.0, -1.0, 1.01, math.nan):
        with pytest.raises(sg.MachineError, match="arc_feed_ratio"):
            sg.convert(sg.Program.from_text(GOOD, machine), machine, arc_feed_ratio=ratio)
    for period in (0.0, -0.005, 0.0051, 0.002, math.nan, math.inf):
        with pytest.raises(sg.ShapegcodeError):
            sg.convert(sg.Program.from_text(GOOD, machine), machine, block_period_s=period)


def test_progress_is_told() -> None:
    heard: list[tuple[str, float, int]] = []
    sg.convert(
        sg.Program.read(PROGRAMS / "TEST_G90.NC", "vx500"),
        "vx500",
        shape_all=True,
        on_progress=lambda *step: heard.append(step),
    )
    assert {stage for stage, _, _ in heard} == {"shaping", "round trip", "sensitivity to unverified parameters"}
    shaped = [(done, total) for which, done, total in heard if which == "shaping"]
    assert shaped == sorted(shaped)
    assert shaped[-1][0] == shaped[-1][1] == shaped[0][1]
    for stage in ("round trip", "sensitivity to unverified parameters"):
        steps = [(done, total) for which, done, total in heard if which == stage]
        assert steps == [(k, len(steps)) for k in range(1, len(steps) + 1)]


TAPS = st.lists(st.tuples(st.integers(0, 40), st.floats(-2.0, 2.0)), min_size=1, max_size=6, unique_by=lambda t: t[0])


@settings(max_examples=100)
@given(TAPS, st.integers(1, 4), st.integers(1, 200), st.integers(0, 2**32 - 1))
def test_streaming_filter_is_the_batch_filter_bit_for_bit(
    taps: list[tuple[int, float]], axes: int, rows: int, seed: int
) -> None:
    total = sum(weight for _, weight in taps)
    if abs(total) < 0.1:
        return
    taps.sort()
    fir = sg.Fir([delay for delay, _ in taps], [weight / total for _, weight in taps])
    samples = np.random.default_rng(seed).normal(0.0, 1e3, (rows, axes))
    batch = fir.apply(samples)
    assert batch.shape == (rows + fir.duration_samples, axes)
    stream = sg.FirStream(fir, axes)
    stream.reset(samples[0])
    held = np.concatenate([samples, np.repeat(samples[-1:], fir.duration_samples, axis=0)])
    assert (np.array([stream.step(row) for row in held]) == batch).all()


@pytest.mark.parametrize("length", [1, 2, 5, 48, 999])
def test_streaming_moving_average_is_the_batch_one_bit_for_bit(length: int) -> None:
    fir = sg.Fir.moving_average(length)
    samples = np.cumsum(np.random.default_rng(length).normal(0.0, 0.05, (3000, 3)), axis=0)
    batch = fir.apply(samples)
    stream = sg.FirStream(fir, 3)
    stream.reset(samples[0])
    held = np.concatenate([samples, np.repeat(samples[-1:], length - 1, axis=0)])
    assert (np.array([stream.step(row) for row in held]) == batch).all()
    plain = np.array([np.convolve(np.concatenate([np.full(length - 1, c[0]), c, np.full(length - 1, c[-1])]),
                                  np.full(length, 1 / length), "valid") for c in samples.T]).T  # fmt: skip
    assert batch == pytest.approx(plain, abs=1e-9)


def test_filter_takes_one_axis_and_any_memory_order() -> None:
    fir = sg.Fir([0, 3], [0.25, 0.75])
    table = np.random.default_rng(3).normal(size=(50, 3))
    expected = fir.apply(table)
    assert (fir.apply(np.asfortranarray(table)) == expected).all()
    assert (fir.apply(np.repeat(table, 2, axis=0)[::2]) == expected).all()
    for k in range(3):
        assert (fir.apply(table[:, k]) == expected[:, k]).all()
    with pytest.raises(sg.ArgumentError):
        fir.apply(np.zeros((2, 2, 2)))


@pytest.mark.parametrize("name", ["CONTOUR_R.NC", "TEST_G90.NC", "VINT_360arc.NC", "PARALLEL.NC"])
@pytest.mark.parametrize("period_s", [0.001, 0.0037])
def test_streaming_interpolator_is_the_batch_one_bit_for_bit(name: str, period_s: float) -> None:
    machine = sg.Machine.load("vx500")
    program = sg.Program.read(PROGRAMS / name, machine)
    path = min(program.regions, key=lambda region: region.path.length_mm).path
    profile = _core.plan_speed(path, motion_limits(machine))
    batch = np.asarray(_core.interpolate(path, profile, period_s))[:50_000]
    stream = _core.Interpolator(path, profile, period_s)
    for row in batch:
        moving, position = stream.step()
        assert moving
        assert (np.asarray(position) == row).all()
    if len(batch) < 50_000:
        assert len(batch) == stream.sample_count
        moving, position = stream.step()
        assert not moving
        assert (np.asarray(position) == batch[-1]).all()
        assert batch[-1] == pytest.approx(path.end_mm, abs=1e-12)


def test_results_are_read_only() -> None:
    machine = sg.Machine.load("vx500")
    path = sg.Program.from_text(GOOD, machine).regions[0].path
    profile = _core.plan_speed(path, motion_limits(machine))
    with pytest.raises(ValueError, match="read-only"):
        _core.interpolate(path, profile, 0.001)[0, 0] = 1.0
