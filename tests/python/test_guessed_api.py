"""What a notebook user guesses: each line works without a look at the book, or says what to do."""

import dataclasses
import functools
import inspect
import json
import pickle
import re
import sys
import tomllib
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest

import shapegcode as sg

TEXT = "%\nO1\nG21 G90 G17 G94\nG00 X0. Y0. Z0.\nG01 X10. F500.\nY10.\nM30\n%\n"
AXIS_X = sg.ReadOptions(axis="x")
TIME_S = np.arange(0.0, 1.0, 1e-3)


def decay(frequency_hz: float, damping_ratio: float) -> np.ndarray:
    omega = 2.0 * np.pi * frequency_hz
    damped = omega * np.sqrt(1.0 - damping_ratio**2)
    noise = 1e-3 * np.random.default_rng(1).standard_normal(TIME_S.size)
    return np.asarray(np.exp(-damping_ratio * omega * TIME_S) * np.sin(damped * TIME_S) + noise)


def test_zv_of_a_frequency_and_a_damping_ratio() -> None:
    """Smith 1958: amplitudes 1/(1+K), K/(1+K), half the damped period apart."""
    shaper = sg.zv(46, 0.02)
    k = np.exp(-0.02 * np.pi / np.sqrt(1.0 - 0.02**2))
    assert shaper.times_s == pytest.approx([0.0, 0.5 / (46.0 * np.sqrt(1.0 - 0.02**2))])
    assert shaper.amplitudes == pytest.approx([1.0 / (1.0 + k), k / (1.0 + k)])
    assert sg.zv(46) == sg.zv(sg.Mode(46, 0.0))
    with pytest.raises(sg.ArgumentError, match="damping"):
        sg.zv(sg.Mode(46, 0.02), 0.03)


def test_residual_of_many_frequencies_at_once() -> None:
    """Of undamped modes ZV leaves |cos(pi f / (2 f0))|."""
    frequencies = np.linspace(10.0, 200.0, 50)
    assert sg.zv(46).residual(frequencies) == pytest.approx(np.abs(np.cos(0.5 * np.pi * frequencies / 46.0)), abs=1e-12)
    assert sg.zv(46, 0.02).residual(46.0, 0.02) == pytest.approx(0.0, abs=1e-12)
    with pytest.raises(sg.ArgumentError):
        sg.zv(46).residual([46.0, -1.0])


@pytest.mark.parametrize("modes", [[46, 131], 46.0, np.array([46.0, 131.0]), ["46:0.02"], [sg.Mode(46, 0.02)]])
def test_choose_shaper_takes_frequencies_and_modes(modes: object) -> None:
    assert sg.choose_shaper(modes, families=["zv", "zvd"]).ok  # type: ignore[arg-type]


def test_plot_sensitivity_of_a_shaper() -> None:
    curve = sg.plot_sensitivity(sg.zv(50)).lines[0]
    frequencies, percent = np.asarray(curve.get_xdata()), np.asarray(curve.get_ydata())
    assert percent == pytest.approx(100.0 * np.abs(np.cos(0.5 * np.pi * frequencies / 50.0)), abs=1e-9)
    for several in ({"zv": sg.zv(50), "other": sg.zv(60)}, [sg.zv(50), sg.zv(60)]):
        sg.plot_sensitivity(several, modes=[50, "60:0.01±5%"])
    plt.close("all")


def test_identify_arrays() -> None:
    (mode,) = (found := sg.identify(TIME_S, decay(46.0, 0.02), options=sg.ReadOptions(axis="x"))).modes
    assert mode.frequency_hz.value == pytest.approx(46.0, rel=1e-3) and found.axis == "x"
    assert mode.damping_ratio.value == pytest.approx(0.02, rel=0.02)
    with pytest.raises(sg.RecordError, match=r"\(1000,\) instants and \(5,\) samples"):
        sg.identify(TIME_S, TIME_S[:5])
    with pytest.raises(sg.RecordError, match=r"identify\(time_s, response, force\)"):
        sg.identify(TIME_S, decay(46, 0.02), np.random.default_rng(2).standard_normal(1000))
    with pytest.raises(sg.ArgumentError, match="force is given without a response"):
        sg.identify(TIME_S, force=TIME_S)


def test_identify_arrays_with_a_force() -> None:
    """A half sine of 2 ms on a mass of 100 kg, its acceleration summed from the closed impulse response."""
    period_s, omega, zeta, mass_kg = 2e-4, 2.0 * np.pi * 120.0, 0.02, 100.0
    time_s = period_s * np.arange(8192)
    start_s = 0.05
    within = (time_s >= start_s) & (time_s < start_s + 2e-3)
    force = np.where(within, 2000.0 * np.sin(np.pi * (time_s - start_s) / 2e-3), 0.0)
    damped = omega * np.sqrt(1.0 - zeta**2)
    impulse = np.exp(-zeta * omega * time_s) * np.sin(damped * time_s) / (mass_kg * damped)
    displacement = np.convolve(force, impulse)[: time_s.size] * period_s
    (mode,) = sg.identify(time_s, displacement, force, quantity="displacement").modes
    assert mode.frequency_hz.value == pytest.approx(120.0, rel=1e-3)
    assert mode.mass_kg is not None and mode.mass_kg.value == pytest.approx(mass_kg, rel=0.02)


def test_convert_takes_a_text_a_file_and_a_program(tmp_path: Path) -> None:
    file = tmp_path / "part.nc"
    file.write_text(TEXT)
    by_name = sg.convert(TEXT, "vx500")
    assert by_name.text == sg.convert(file, sg.Machine.load("vx500")).text
    assert by_name.text == sg.convert(sg.Program.read(TEXT, "vx500"), "vx500").text
    with pytest.raises(sg.ArgumentError, match="must be a Machine, a file or a built-in name, not int"):
        sg.convert(TEXT, 5)  # type: ignore[arg-type]


@pytest.mark.parametrize("function", ["simulate", "check", "cycle_time", "compare", "expand"])
def test_a_machine_is_named_wherever_one_is_taken(function: str) -> None:
    assert getattr(sg, function)(*[TEXT] * (2 if function == "compare" else 1), "vx500") is not None


def test_a_controller_takes_a_mode() -> None:
    """Its set-points are those of the ZV on its grid, which leaves nothing of the mode."""
    mode = sg.Mode(46, 0.02)
    shaper = sg.zv_on_grid(mode, 0.001)
    assert shaper.residual_ratio(mode) < 1e-12 and min(shaper.amplitudes) > 0.0

    def set_points(given: sg.Mode | sg.Shaper) -> np.ndarray:
        controller = sg.MotionController(max_acceleration_mm_per_s2=3000.0, max_jerk_mm_per_s3=5e4, shaper=given)
        controller.push(sg.Segment.line([0.0, 0.0, 0.0], [10.0, 0.0, 0.0], 50.0))
        return np.asarray(controller.run(1000))

    assert np.array_equal(set_points(mode), set_points(shaper))


def test_a_simple_machine() -> None:
    machine = sg.Machine.simple(modes={"x": 46, "y": [sg.Mode(131, 0.01), 200.0]})
    assert [mode.frequency_hz for mode in machine.axes.y.modes] == [131.0, 200.0]
    assert machine.axes.z.modes == ()
    assert sg.convert(TEXT, machine).machine == "simple"
    assert machine.to_toml().count("max_acceleration_mm_s2 = 3000.0  # assumed") == 3
    both = sg.Machine.simple(modes={"x": [sg.Mode(46, 0.02, excited_by=[1.0, 0.5, 0.0])]}).axes.x.modes[0]
    assert both.excited_by is not None and both.excited_by.as_tuple() == (1.0, 0.5, 0.0)
    stated = sg.Machine.simple(modes={"x": 46}, max_acceleration_mm_per_s2=2000.0)
    assert stated.axes.x.max_acceleration_mm_s2 == 2000.0
    assert "max_acceleration_mm_s2 = 2000.0  # assumed" not in stated.to_toml()
    with pytest.raises(sg.ArgumentError, match="'a' is not an axis"):
        sg.Machine.simple(modes={"a": 46})
    with pytest.raises(sg.MachineError, match="frequency_hz"):
        sg.Machine.simple(modes={"x": -46})


@pytest.mark.parametrize(
    ("guess", "said"),
    [
        ("sg.conver", "did you mean 'convert'"),
        ("sg.MotionController().push_line([10, 0], 50)", "end_mm: list.2., feed_mm_per_s: int; it takes"),
        ("sg.zv(46).duration", "did you mean 'duration_s'"),
        ("sg.Mode(frequency=46)", "did you mean 'frequency_hz'"),
        ("sg.MotionController(shaper='zv')", "was given shaper: str"),
        ("sg.zv(46).residual(46, damping=0.02)", "did you mean 'damping_ratio'"),
        ("sg.Machine('vx500')", "Machine.load"),
        ("sg.Machine.simple({'x': (46, 0.02)})", "is Mode"),
        ("sg.Machine.load('vx500').with_values('contour_um', 5)", "did you mean tolerance.contour_um"),
        ("sg.Machine.load('vx500').to_toml('mine.toml')", "write_text"),
        ("sg.cycle_time(TEXT, 'vx500').time", "did you mean 'cycle_time_s'"),
        ("sg.cycle_time(TEXT, 'vx500', feed_override=50)", "0.5 is 50 %"),
        ("sg.convert(TEXT, 'vx500').cycle_time_s.real", "original.real"),
        ("sg.convert(TEXT, 'vx500').report('out.json')", "to_json"),
        ("sg.identify(TIME_S, TIME_S, quantity='mm')", "acceleration, velocity, displacement"),
        ("sg.identify(TIME_S)", "time_s, response"),
        ("sg.simulate(b'part.nc', 'vx500')", "file name is needed"),
        ("sg.convert(TEXT, 'vx500', tolerance=10)", "use contour_tolerance_um"),
        ("sg.convert(TEXT, 'vx500').plots(show=False)", "use plot"),
        ("sg.convert(TEXT)", "it takes program, machine"),
        ("sg.Shaper('ei', 46, 0.02)", "choose_shaper"),
        ("sg.ZVD(46)", "use repeated_zv"),
        ("sg.Program('part.nc')", "use sg.Program.read"),
        ("sg.Program.load('part.nc')", "use sg.Program.read"),
        ("sg.Conversion.from_json('part.json')", "use sg.load_result"),
        ("next(sg.stream(TEXT, 'vx500')).t", "use time_s"),
        ("sg.convert(TEXT, 'vx500').contour_error_um.max", "use .response"),
        ("sg.convert(TEXT, 'vx500').plots('out')", "use plot.name., or save_plots"),
        ("sg.corner_cut('vx500')", "sg.CutConditions.* is needed, not str"),
        ("sg.FrequencyResponse(TIME_S, TIME_S)", "use sg.FrequencyResponse"),
        ("sg.FrequencyResponse('x', TIME_S + 1, TIME_S, 'receptance')", "one of acceleration"),
        ("sg.identify('tap.csv', quantity='displacement')", "quantity is that of arrays"),
        ("sg.identify(1.0 - TIME_S, TIME_S)", "must ascend; identify.time_s"),
        ("sg.simulate(TEXT, 'vx500', record_samples=-3)", "record_samples = -3"),
        ("sg.MotionController().push(x=10)", "push_line"),
        ("sg.Tool(10)", "only keywords are taken; use sg.Tool.load"),
        ("sg.survey(TEXT, 'vx500', 10, None)", "sg.Tool.load.file. is needed, not int"),
        ("sg.study('STUDY.toml')", "sg.load_study"),
        ("sg.Tool(diameter=10)", "Tool: .*; use sg.Tool.load"),
        ("sg.Machine.load('vx500').update", "use sg.update_machine"),
        ("sg.convert(TEXT, 'vx500', only=(10, 20))", "only: pairs of lines"),
        ("sg.convert(TEXT, 'vx500', shape_all='no')", "shape_all = 'no': must be True or False"),
        ("sg.identify(TIME_S, TIME_S + 1j)", "complex; of a frequency response"),
        ("sg.identify(TIME_S, TIME_S, axis='x')", "use options=sg.ReadOptions"),
        ("sg.batch('a.nc', sg.Machine.load('vx500'), 'out')", "files or built-in names"),
        (
            "sg.update_machine(sg.Machine.load('vx500'), sg.identify(TIME_S, decay(46, 0.02), options=AXIS_X))",
            "not Machine",
        ),
        ("sg.Machine.load('vx500').modes", "use machine.axes.x.modes"),
        ("sg.Machine.load(file='vx500')", "it takes path_or_name"),
        ("sg.convert('vx500', TEXT)", "not the text of a program"),
        ("sg.Machine.list()", "use Machine.builtin_names"),
        ("sg.Machine.load('vx500').axis", "did you mean 'axes'"),
        ("sg.Program.read(TEXT).length", "sg.cycle_time"),
        ("sg.zv(46).filter([0.0, 1.0])", "to_fir"),
        ("sg.zv(46).to_fir(0.001)", "is not on the grid"),
        ("sg.MotionController().feed_override(50)", "0.5 is 50 %"),
    ],
)
def test_errors_say_what_to_do(guess: str, said: str) -> None:
    with pytest.raises((AttributeError, TypeError, sg.ShapegcodeError), match=said) as caught:
        eval(guess)
    assert "\n" not in str(caught.value)


def test_what_is_suggested_is_there() -> None:
    """Each table of hints.toml is of something public; none of its names exists, all that is suggested does."""
    tables = tomllib.loads((Path(sg.__file__).parent / "hints.toml").read_text(encoding="utf-8"))
    for each in dir(sg):
        getattr(sg, each)
    modules = [module for name, module in sys.modules.items() if name.startswith("shapegcode")]
    for owner, table in tables.items():
        if [*table] == ["()"]:
            continue  # of any method of this name
        homes = (module for module in (sg, *modules) if hasattr(module, owner.partition(".")[0]))
        at = sg if owner == "shapegcode" else functools.reduce(getattr, owner.split("."), next(homes))
        keywords = [] if owner == "shapegcode" or isinstance(at, type) else list(inspect.signature(at).parameters)
        fields = {field.name for field in dataclasses.fields(at)} if dataclasses.is_dataclass(at) else set()
        for name in " ".join(table).split():
            assert name not in (keywords or {*dir(at)} | fields), (owner, name)
        for use in table.values():
            assert set(re.findall(r"sg\.(\w+)", use)) <= set(dir(sg)), use
            if keywords and use.isidentifier():
                assert use in keywords


def test_a_value_is_set_by_with_values() -> None:
    with pytest.raises(AttributeError, match="with_values"):
        sg.Machine.load("vx500").name = "other"  # type: ignore[misc]


def test_what_one_function_gives_the_others_take() -> None:
    """Modes that were identified; numbers in Hz wherever modes are taken; the emitted text, which is bytes."""
    (found,) = sg.identify(TIME_S, decay(46.0, 0.02)).modes
    mode = sg.Mode(float(found.frequency_hz), float(found.damping_ratio))
    assert f"{found.frequency_hz:.0f}" == "46" and sg.zv(found) == sg.zv(mode)  # type: ignore[arg-type]
    shaper = sg.choose_shaper([found], families="zv", periods_s=0.001).shaper
    assert shaper.amplitudes == pytest.approx(sg.zv_on_grid(mode, 0.001).amplitudes)
    vx500 = sg.Machine.load("vx500").axes.x
    several = (vx500, vx500.modes, [(46.0, 0.02)], (46.0, 0.02))
    assert len({str(sg.choose_shaper(each, families="zv", periods_s=0.001)) for each in several}) == 1  # type: ignore[arg-type]
    assert sg.Machine.simple({"x": found}).axes.x.modes == sg.Machine.simple({"x": mode}).axes.x.modes  # type: ignore[dict-item]
    assert sg.repeated_zv(46, 2) == sg.repeated_zv(sg.Mode(46), 2)  # type: ignore[arg-type]
    assert sg.shortest_non_negative([46], 0.005) == sg.shortest_non_negative([sg.Mode(46)], 0.005)  # type: ignore[list-item]
    conversion = sg.convert(TEXT, "vx500")
    assert sg.simulate(conversion.text, "vx500").ok  # type: ignore[arg-type]
    assert sg.compare(TEXT, conversion, "vx500", allow="blocks,feeds,path=30um").ok  # type: ignore[arg-type]
    compared = sg.choose_shaper(sg.Machine.load("vx500"), families=["zv", "zvd"], periods_s=0.005)  # type: ignore[arg-type]
    assert compared.designs == sg.choose_shaper(machine="vx500", families=["zv", "zvd"], periods_s=0.005).designs


def test_a_shaper_filters_samples() -> None:
    """Against NumPy's convolution of a step; an axis of a machine by its name."""
    shaper = sg.zv_on_grid(sg.Mode(46, 0.02), 0.001)
    impulses = np.zeros(round(shaper.duration_s / 0.001) + 1)
    impulses[np.rint(shaper.times_s / 0.001).astype(int)] = shaper.amplitudes
    step = np.repeat([0.0, 1.0], 40)
    shaped = shaper.to_fir(0.001).apply(step)
    assert shaped[: step.size] == pytest.approx(np.convolve(step, impulses)[: step.size], abs=1e-15)
    machine = sg.Machine.load("vx500")
    assert machine.axes["y"] is machine.axes.y
    with pytest.raises(KeyError):
        machine.axes["a"]


def test_a_result_is_kept_as_json(tmp_path: Path) -> None:
    """As a file of `json.dump`, and as its content; functions can be pickled."""
    result = sg.cycle_time(TEXT, "vx500")
    (file := tmp_path / "time.json").write_text(json.dumps(result.to_json()))
    assert str(sg.load_result(file)) == str(sg.load_result(result.to_json())) == str(result)
    (program := tmp_path / "part.nc").write_text(TEXT)
    batch = sg.batch(program, "vx500", tmp_path / "out", command="time")
    (file := tmp_path / "batch.json").write_text("".join(json.JSONEncoder().iterencode(batch.to_json())))
    assert str(sg.load_result(file)) == str(batch)
    with pytest.raises(sg.ArgumentError, match=r"use to_json\(\)"):
        sg.load_result(result.to_dict())
    assert pickle.loads(pickle.dumps(sg.cycle_time)) is sg.cycle_time


def test_modes_that_no_machine_has_are_questioned() -> None:
    """Times in ms."""
    assert not any("below 1 Hz" in each for each in sg.identify(TIME_S, decay(46.0, 0.02)).warnings)
    assert any("below 1 Hz" in each for each in sg.identify(1e3 * TIME_S, decay(46.0, 0.02)).warnings)


def test_names_of_the_version_before_are_read_with_a_warning() -> None:
    with pytest.warns(FutureWarning, match="shapegcode.learn_clock is shapegcode.calibrate_cycle_time now"):
        assert sg.learn_clock is sg.calibrate_cycle_time  # type: ignore[attr-defined]
    with pytest.warns(FutureWarning, match="CycleTimeCalibration"):
        assert sg.LearnedClock is sg.CycleTimeCalibration  # type: ignore[attr-defined]
    assert "LearnedClock" not in dir(sg)
