"""Studies: against closed forms, SciPy, and the interpreter, player and plant of the tests."""

import json
import math
import re
import shlex
import tomllib
from concurrent.futures import ThreadPoolExecutor
from functools import cache, partial
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from scipy import stats
from scipy.stats import qmc

import shapegcode as sg
from acceptance import under_modes
from command import run
from judge import Mode, interpret, play, residual_um
from shapegcode.cli.machine import file_schema
from shapegcode.demos.path import path_program
from shapegcode.errors import ArgumentError, MachineError
from shapegcode.machine.programs import ANY_PRICE
from shapegcode.results.json import schema
from shapegcode.studies import replay as replays
from shapegcode.studies.replay import SamplesJob, simulate_all
from shapegcode.studies.study import interval_of, parameter_sensitivity
from shapegcode.studies.study_file import StudyFileError
from shapegcode.studies.varied import sampled_columns, varied_values

ROOT = Path(__file__).resolve().parents[2]
X_HZ, Y_HZ = "axes.x.modes.1.frequency_hz", "axes.y.modes.1.frequency_hz"
X_DAMPING = "axes.x.modes.1.damping_ratio"
VX500 = sg.Machine.load("vx500")
SHORT = "%\nO0001\nG21 G90 G17\nG00 X0 Y0 Z0\nG01 X4.5 F6000.\nM30\n%\n"


@cache
def paper_study() -> sg.MachineStudy:
    vary = {X_HZ: sg.normal(46, 2), Y_HZ: sg.uniform(124, 138), X_DAMPING: sg.lognormal(0.02, 40)}
    return sg.study(path_program(200, VX500), VX500, vary, n=50, sampling="lhs")


def test_quantiles_are_those_of_fifty_machines_played_one_by_one() -> None:
    """The text is read, simulated and shaken by code that shares nothing with the package."""
    program, draws = path_program(200, VX500), paper_study().draws
    columns = zip(draws[X_HZ], draws[Y_HZ], draws[X_DAMPING], strict=True)
    machines = [[[Mode(x_hz, x_damping)], [Mode(y_hz, 0.02)], []] for x_hz, y_hz, x_damping in columns]
    tick_s = VX500.controller.interpolation_period_s
    residuals, contours = under_modes(sg.convert(program, VX500), program, tick_s, machines)
    for name, brute in (("residual_um", residuals), ("contour_um", contours)):
        found = paper_study().quantity(name)
        expected = np.percentile(brute, (5, 25, 50, 75, 95, 99))
        assert [found.p5, found.p25, found.p50, found.p75, found.p95, found.p99] == pytest.approx(expected, rel=0.02)


def test_one_mode_behind_zv_leaves_what_the_closed_form_says() -> None:
    """A line at feed v, time T: (2 v / w) |sin(w T / 2)| of swing; ZV leaves |cos(pi w / 2 w0)| of it.

    The ramps of one block of 5 ms come to half the speed in the first and in the last block: |cos(w 5 ms / 2)|. All in
    all it rises with the frequency here, so that its quantiles are those of the frequency.
    """
    known_hz, speed, time_s = 50.0, 100.0, 0.045
    machine = VX500.with_values(
        {
            **ANY_PRICE,
            "axes.x.modes": [{"frequency_hz": known_hz, "damping_ratio": 1e-6}],
            "axes.y.modes": [], "axes.y.rigid": True, "emission.block_period_s": 0.005,
            "shaping.family": "zv", "shaping.contour": "off", "controller.block_end": "ceil",
            "controller.time_constant_s": 0.005, "axes.x.max_acceleration_mm_s2": 1e6,
        }
    )  # fmt: skip
    program = sg.Program.from_text(SHORT, machine)
    low, high = 51.0, 55.0
    found = sg.study(
        program, machine, {X_HZ: sg.uniform(low, high)}, n=256, measure=["residual_x_um"], shape_all=True
    ).quantity("residual_x_um")

    def left_um(hz: float) -> float:
        omega = 2.0 * math.pi * hz
        swing = 2e3 * speed / omega * abs(math.sin(omega * time_s / 2.0) * math.cos(omega * 0.0025))
        return swing * abs(math.cos(math.pi * hz / (2.0 * known_hz)))

    for share, value in ((0.05, found.p5), (0.25, found.p25), (0.5, found.p50), (0.75, found.p75), (0.95, found.p95)):
        assert value == pytest.approx(left_um(low + share * (high - low)), rel=0.02)
    assert found.nominal < 0.01 * found.p50


def test_distributions_have_the_quantiles_of_scipy() -> None:
    shares = np.linspace(0.01, 0.99, 33)
    for mine, theirs in (
        (sg.normal(46, 2), stats.norm(46, 2)),
        (sg.normal(-40, percent=5), stats.norm(-40, 2)),
        (sg.lognormal(0.02, 50), stats.lognorm(math.log(1.5), scale=0.02)),
        (sg.uniform(-1, 3), stats.uniform(-1, 4)),
    ):
        assert mine.at(shares) == pytest.approx(theirs.ppf(shares), rel=1e-9)
    assert sg.listed(["a", "b", "c", "d"]).at(np.array([0.0, 0.3, 0.74, 0.76, 1.0])) == ["a", "b", "c", "d", "d"]


@pytest.mark.parametrize("sampling", ["sobol", "lhs"])
def test_draws_fill_the_cube_as_the_sequences_do(sampling: str) -> None:
    varied = varied_values(VX500, {X_HZ: sg.uniform(40, 50), Y_HZ: sg.uniform(120, 140)})
    columns = sampled_columns(varied, 256, sampling, 3, indices=False)
    points = np.column_stack([(np.array(columns[0], float) - 40) / 10, (np.array(columns[1], float) - 120) / 20])
    random = np.random.default_rng(0).random((256, 2))
    assert qmc.discrepancy(points) < 0.5 * qmc.discrepancy(random)
    # One draw in each of 256 slices of each value.
    assert all(sorted((column * 256).astype(int)) == list(range(256)) for column in points.T)


def test_a_grid_has_every_combination_once() -> None:
    varied = varied_values(VX500, {X_HZ: sg.uniform(40, 50), "controller.block_end": ["ceil", "carry"]})
    columns = sampled_columns(varied, 11, "grid", 0, indices=False)
    rows = list(zip(*columns, strict=True))
    assert rows == [(hz, rule) for hz in (41.0, 43.0, 45.0, 47.0, 49.0) for rule in ("ceil", "carry")]
    with pytest.raises(ArgumentError, match="n = 1: the lists alone have 2 combinations"):
        sampled_columns(varied, 1, "grid", 0, indices=False)


def test_sobol_indices_of_a_sum_are_its_shares_of_the_variance() -> None:
    keys = {X_HZ: sg.uniform(40, 50), Y_HZ: sg.uniform(120, 140), X_DAMPING: sg.uniform(0.01, 0.02)}
    varied = varied_values(VX500, keys)
    columns = sampled_columns(varied, 10_000, "sobol", 0, indices=True)
    x, y = np.array(columns[0], float) - 40.0, np.array(columns[1], float) - 120.0
    found = parameter_sensitivity(varied, columns, 3.0 * x + y / 2.0, indices=True, seed=0)
    # Variances 9 · 100 / 12 and 100 / 12.
    assert [each.key for each in found] == [X_HZ, Y_HZ, X_DAMPING]
    assert [each.first for each in found] == pytest.approx([0.9, 0.1, 0.0], abs=0.02)
    assert [each.total for each in found] == pytest.approx([0.9, 0.1, 0.0], abs=0.02)


def test_the_interval_of_a_probability_is_that_of_clopper_and_pearson() -> None:
    for good, count in ((0, 20), (17, 20), (20, 20), (999_000, 1_000_000)):
        low = stats.beta.ppf(0.025, good, count - good + 1) if good else 0.0
        high = stats.beta.ppf(0.975, good + 1, count - good) if good < count else 1.0
        assert interval_of(good, count) == pytest.approx((low, high))


@pytest.mark.parametrize(
    ("vary", "texts"),
    [
        ({X_HZ: sg.normal(46, 1), "controller.shaped_time_constant_s": [0.0, 0.008]}, 1),
        ({X_HZ: sg.normal(46, 1), "controller.block_time_s": [0.004, 0.005, 0.006]}, 3),
        ({X_HZ: sg.listed([45.0, 47.0], known=True), Y_HZ: sg.normal(131, 2)}, 2),
    ],
)
def test_a_text_is_made_for_what_the_converter_knows_and_for_nothing_else(
    vary: dict[str, Any], texts: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = []
    original = replays.convert
    monkeypatch.setattr(replays, "convert", lambda *args, **options: made.append(1) or original(*args, **options))
    found = sg.study(path_program(200, VX500), VX500, vary, n=12)
    # One more for the machine file, where none of them is for it.
    assert len(made) - texts in (0, 1)
    assert found.conversions == texts


def test_where_a_mode_moves_is_simulated_and_not_converted_for() -> None:
    """Z stands still: what is left there is in proportion to the share of Z, and to that of X, which alone moves."""
    keys = {
        "axes.y.modes.1.frequency_hz": 46.0, "axes.y.modes.1.excited_by": {"y": 1.0, "x": 0.5},
        "axes.y.modes.1.moves": {"y": 1.0, "z": 0.5}, "axes.z.rigid": True, "shaping.contour": "command", **ANY_PRICE,
    }  # fmt: skip
    shares = [0.1, 0.2, 0.4]
    for key in ("axes.y.modes.1.moves.z", "axes.y.modes.1.excited_by.x"):
        vary = {key: shares, "axes.y.modes.1.frequency_hz": [43.0]}
        program = sg.Program.from_text(SHORT, VX500.with_values(keys))
        found = sg.study(
            program, VX500.with_values(keys), vary, sampling="grid", shape_all=True, measure=["residual_z_um"]
        )
        left = dict(zip(found.draws[key], found.draws["residual_z_um"], strict=True))
        assert found.conversions == 1
        assert left[0.1] > 0.01
        assert [left[share] / left[0.1] for share in shares] == pytest.approx([1.0, 2.0, 4.0], rel=1e-3)


def test_a_known_value_is_converted_for() -> None:
    hz = 52.0
    measure = ["residual_um", "contour_um", "time_s", "original_residual_um", "cutting_time_s"]
    vary = {X_HZ: sg.listed([hz], known=True)}
    found = sg.study(path_program(200, VX500), VX500, vary, n=1, measure=measure)
    machine = VX500.with_values(X_HZ, hz)
    conversion = sg.convert(path_program(200, machine), machine)
    ceil = next(case for case in conversion.cases if case.name == "nominal, ceil")
    assert found.quantity("residual_um").p50 == pytest.approx(max(ceil.residual_um))
    assert found.quantity("contour_um").p50 == pytest.approx(ceil.contour_error_um.response)
    assert found.quantity("time_s").p50 == pytest.approx(conversion.cycle_time_s.emitted)
    assert found.quantity("original_residual_um").p50 == pytest.approx(max(conversion.residual_vibration_um.original))
    shaped_s = sum(cut.time_s.emitted for cut in conversion.regions)
    assert found.quantity("cutting_time_s").p50 == pytest.approx(shaped_s, abs=0.002)


def test_residuals_alone_come_from_the_end_of_a_cut() -> None:
    """Nothing else changes them, and the verdict says that it is about them alone."""
    vary = {X_HZ: sg.normal(46, 2), X_DAMPING: sg.lognormal(0.02, 20)}
    program = sg.Program.from_text(path_program(200, VX500).text.replace(b"Y40.", b"Y400."), VX500)
    ask = partial(sg.study, program, VX500, vary, n=20, shape_all=True)
    whole, end = ask(measure=["residual_um", "contour_um"]), ask(measure=["residual_um"])
    assert end.draws["residual_um"] == pytest.approx(whole.draws["residual_um"], rel=1e-3)
    assert "residual vibration alone" in end.warnings[0] and not whole.warnings
    # Where nothing is asked for but residuals, they are all that is held against a limit.
    assert max(end.draws["share_of_limit"]) < max(whole.draws["share_of_limit"])


def test_draws_without_a_text_are_out_of_tolerance_and_listed() -> None:
    """A shaper must not last longer than it may: ten microseconds are too little for any."""
    vary = {"shaping.max_duration_s": [1e-5, 0.05], X_HZ: sg.normal(46, 0.1)}
    found = sg.study(path_program(200, VX500), VX500, vary, n=16)
    assert (found.n, found.within) == (8, 0.5)
    assert [each.draws for each in found.refused] == [8]
    assert "8 of 16 samples have no program" in found.warnings[0]


def test_the_dataset_has_every_draw_with_units() -> None:
    data = paper_study().to_xarray()
    assert data.sizes["draw"] == 50
    assert data[X_HZ].attrs["units"] == "Hz" and data["residual_um"].attrs["units"] == "µm"
    assert float(data["residual_um"].quantile(0.95)) == pytest.approx(paper_study().quantity("residual_um").p95)
    quantiles = paper_study().to_xarray("quantities")
    assert float(quantiles["contour_um"].sel(percent=50)) == paper_study().quantity("contour_um").p50
    with pytest.raises(ArgumentError, match="modes: must be draws or quantities"):
        paper_study().to_xarray("modes")


def test_a_time_that_differs_comes_from_the_machine_that_plays() -> None:
    found = sg.study(path_program(200, VX500), VX500, {"times.feed_override_percent": [50.0, 100.0]}, n=2)
    half, full = sorted(found.draws["time_s"], reverse=True)
    assert full == pytest.approx(found.quantity("time_s").nominal)
    assert half > full + 0.3


STUDY = """program = "part.nc"
machine = "vx500"
n = 40
[vary]
axes.x.modes.1.frequency_hz = { mean = 46.0, sd = 2.0 }
"axes.y.modes.1.damping_ratio" = { median = 0.02, percent = 40.0 }
controller.shaped_time_constant_s = [0.0, 0.008]
"""


def written(folder: Path, text: str = STUDY) -> Path:
    (folder / "part.nc").write_bytes(path_program(200, VX500).text)
    (folder / "STUDY.toml").write_text(text)
    return folder


def test_the_command_says_what_python_says(tmp_path: Path) -> None:
    done = run(written(tmp_path), "study", "STUDY.toml", "--json", "s.json", "--csv", "s.csv")
    assert done.returncode == 0, done.stderr
    report = json.loads((tmp_path / "s.json").read_text())
    options = sg.load_study(tmp_path / "STUDY.toml").options()
    found = sg.study(tmp_path / "part.nc", VX500, **options)
    assert report["quantities"][0]["p95"] == pytest.approx(found.quantities[0].p95, rel=1e-6)
    assert report["within"] == found.within
    assert len((tmp_path / "s.csv").read_text().splitlines()) == 41
    assert sg.load_result(tmp_path / "s.json").answer == found.answer


def test_pictures_show_what_decides_and_the_band(tmp_path: Path) -> None:
    found = paper_study()
    bars = found.plot("study-tornado")
    assert [label.get_text() for label in bars.get_yticklabels()] == [each.key for each in found.parameter_sensitivity]
    assert [bar.get_width() for bar in bars.patches] == pytest.approx(
        [each.high - each.low for each in found.parameter_sensitivity]
    )
    bands = found.plot("study-bands")
    (median,) = [line for line in bands.lines if len(line.get_xdata()) > 2]
    first = next(bins for bins in found.curves if bins.key == found.parameter_sensitivity[0].key)
    assert list(median.get_ydata()) == [each.median for each in first.bins]


@pytest.mark.slow
def test_the_command_draws_and_writes_its_page(tmp_path: Path) -> None:
    done = run(written(tmp_path), "study", "STUDY.toml", "--html", "s.html", "--plots", "plots")
    assert done.returncode == 0, done.stderr
    assert {file.name for file in (tmp_path / "plots").iterdir()} >= {"study-tornado.png", "study-bands.svg"}
    assert "Influence on the verdict" in (tmp_path / "s.html").read_text()


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("n = 40", "n = 0", "n = 0: must be 1 or more"),
        ("sd = 2.0", "sd = -2.0", 'STUDY.toml:5: vary."axes.x.modes.1.frequency_hz".sd = -2.0: must be greater than 0'),
        ("sd = 2.0", "sd = 30.0", "axes.x.modes.1.frequency_hz = -"),
        ("x.modes.1", "x.modes.0", "axes.x.modes.0.frequency_hz: no such key: axes.x.modes counts from 1"),
        (
            "x.modes.1",
            "x.modes.2",
            "axes.x.modes.2.frequency_hz: no such key: axes.x.modes counts from 1, and there is 1",
        ),
        ("frequency_hz", "frequenzy_hz", "did you mean frequency_hz?"),
        (
            "controller.shaped_time_constant_s = [0.0, 0.008]",
            "shaping.family = { low = 1, high = 2 }",
            'must be "auto"',
        ),
        ("[0.0, 0.008]", "[0.0, -0.008]", "controller.shaped_time_constant_s = -0.008: must be"),
        ("[0.0, 0.008]", "[]", "= []: must have 1 or more values"),
        ("[vary]", 'measure = ["shake_um"]\n[vary]', 'measure = "shake_um": must be one of residual_um'),
        ("median = 0.02, ", "", "give mean and sd (or percent)"),
        ("{ mean = 46.0, sd = 2.0 }", "{ triangular = [45.0] }", "frequency_hz\": triangular: no such key here"),
        ("{ mean = 46.0, sd = 2.0 }", "{ triangular = [45.0, 47.0] }", ": triangular: no such key here: give mean and"),
        ("{ mean = 46.0, sd = 2.0 }", "46.0", "frequency_hz\" = 46.0: must be a list or a table: give mean and sd"),
        ("{ mean = 46.0, sd = 2.0 }", "{ mean = nan, sd = 2.0 }", "mean = nan: must be a finite number"),
        ("axes.y.modes.1.damping_ratio", "axes.x.modes.1.frequency_hz", "given twice, in quotes and without"),
        ("n = 40", "n = 100000000", "STUDY.toml:3: n = 100000000: must be 1000000 or less"),
        ("[0.0, 0.008]", "[0.0, 0.008]\ncontroller.block_time_s = [0.004, 0.02]\nemission.block_period_s = [0.005]",
         "emission.block_period_s = 0.005: must not be below controller.block_time_s = 0.02"),
        ("part.nc", "nothing.nc", "no such file"),
    ],
)  # fmt: skip
def test_bad_files_name_key_value_and_limit(tmp_path: Path, old: str, new: str, said: str) -> None:
    done = run(written(tmp_path, STUDY.replace(old, new)), "study", "STUDY.toml", "--csv", "s.csv")
    assert done.returncode == 2
    assert said in done.stderr
    assert not (tmp_path / "s.csv").exists()


CHOICES = """
[choose]
shaping.family = ["zv", "zvd"]
"emission.block_period_s" = [0.006, 0.005]
"""


@cache
def editor_validator() -> jsonschema.Draft202012Validator:
    return jsonschema.Draft202012Validator(json.loads(file_schema("study")))


def test_the_schema_for_editors_takes_good_files(tmp_path: Path) -> None:
    """As `jsonschema` reads it: the golden file, the examples of the manual, all kinds of distributions."""
    validator = editor_validator()
    validator.check_schema(validator.schema)
    assert json.loads(run(tmp_path, "machine", "schema", "study").stdout) == validator.schema
    manual = (ROOT / "docs" / "howto" / "studies.md").read_text()
    example = next(part for part in re.findall(r"```toml\n(.*?)```", manual, re.DOTALL) if "STUDY.toml" in part)
    kinds = """program = "p.nc"
        [vary.axes.x.modes.1]
        frequency_hz = { mean = 46, percent = 5, known = true }
        damping_ratio = { one_of = [0.01, 0.02] }
        [vary]
        axes.y.modes = [[], [{ frequency_hz = 131.0, damping_ratio = 0.02 }]]
        controller.in_position_s.y = { low = 0.01, high = 0.02 }
        input.work_offsets.G54 = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]
        """
    golden = (ROOT / "tests" / "golden" / "study" / "STUDY.toml").read_text()
    for text in (golden, example, STUDY + CHOICES, STUDY, kinds):
        validator.validate(tomllib.loads(text))
        (tmp_path / "S.toml").write_text(text)
        sg.load_study(tmp_path / "S.toml")


REFUSED = {
    'program = "part.nc"': [""],
    "n = 40": [
        "n = 0",
        "n = 2000000",
        'n = "many"',
        "m = 40",
        "at_least = 1.5",
        "seed = -1",
        'sampling = "monte carlo"',
        'measure = ["shake_um"]',
    ],
    "sd = 2.0": ["sd = -2.0", 'sd = "2"', "sd = 2.0, percent = 4.0"],
    "mean = 46.0, sd = 2.0": ["mean = 46.0", "shape = 3.0"],
    "{ mean = 46.0, sd = 2.0 }": ["46.0"],
    "[0.0, 0.008]": ["[]"],
    '["zv", "zvd"]': ["[]", '"zv"'],
}


@pytest.mark.parametrize(("old", "new"), [(old, new) for old, several in REFUSED.items() for new in several])
def test_what_the_schema_refuses_the_file_is_refused_for(tmp_path: Path, old: str, new: str) -> None:
    text = (STUDY + CHOICES).replace(old, new)
    assert text != STUDY + CHOICES
    with pytest.raises(jsonschema.ValidationError):
        editor_validator().validate(tomllib.loads(text))
    (tmp_path / "S.toml").write_text(text)
    with pytest.raises(StudyFileError, match=r"S\.toml"):
        sg.load_study(tmp_path / "S.toml")


def test_the_schema_knows_the_keys_of_the_machine_file() -> None:
    validator = editor_validator()
    for old, new in (("frequency_hz", "frequenzy_hz"), ("x.modes.1", "x.modes.0"), ("shaping.family", "shaping.famly")):
        with pytest.raises(jsonschema.ValidationError):
            validator.validate(tomllib.loads((STUDY + CHOICES).replace(old, new, 1)))
    machine = json.loads(file_schema("machine"))
    here, there = (
        each["$defs"][name]["properties"]["frequency_hz"]["description"]
        for each, name in ((validator.schema, "vary.AxisMode"), (machine, "AxisMode"))
    )
    assert here == there


def test_the_command_chooses_as_python_does(tmp_path: Path) -> None:
    done = run(written(tmp_path, STUDY.replace("controller.shaped_time_constant_s = [0.0, 0.008]\n", CHOICES)),
               "optimize", "STUDY.toml", "--json", "o.json", "--set", "times.tool_change_s=3")  # fmt: skip
    assert done.returncode == 0, done.stderr
    report = json.loads((tmp_path / "o.json").read_text())
    jsonschema.validate(report, schema(sg.Optimum))
    file = sg.load_study(tmp_path / "STUDY.toml")
    machine = VX500.with_values("times.tool_change_s", 3)
    found = sg.optimize(tmp_path / "part.nc", machine, **file.choice_options())
    assert report["best"]["time_s"] == pytest.approx(found.best.time_s, rel=1e-6)
    assert done.stdout.splitlines()[0] == found.answer == sg.load_result(tmp_path / "o.json").answer
    (convert,) = [line for line in done.stdout.splitlines() if line.startswith("next: ")]
    words = shlex.split(convert)[2:]
    assert words[:5] == ["convert", "part.nc", "-m", "vx500", "--set"]
    again = run(tmp_path, *words, "--json", "c.json")
    assert again.returncode == 0, again.stderr
    time_s = json.loads((tmp_path / "c.json").read_text())["cycle_time_s"]["emitted"]
    assert time_s == pytest.approx(found.best.time_s, rel=1e-6)


def test_a_choice_that_nothing_bears_is_code_1_and_draws_none(tmp_path: Path) -> None:
    text = STUDY.replace("controller.shaped_time_constant_s = [0.0, 0.008]\n", CHOICES)
    done = run(written(tmp_path, text), "optimize", "STUDY.toml", "--set", "tolerance.contour_um=0.2", "--plots", "p")
    assert done.returncode == 1, done.stderr
    assert done.stdout.startswith("none of 4 choices stays within tolerance on 95 % of the machines")
    assert "pictures: this result has none" in done.stdout


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('"zvd"]', '"zvd"]\nmost = 3', "choose.most"),
        ('["zv", "zvd"]', '["soft"]', 'shaping.family = "soft": must be "auto"'),
        ("shaping.family", "shaping.famly", "did you mean family?"),
        ("shaping.family", "axes.x.modes.1.frequency_hz", "either sampled or chosen"),
        ("n = 40", "most = 0", "STUDY.toml:3: most = 0: must be 1 or more"),
        ("n = 40", "n = 400000", "n = 400000: must be at most 250000"),
        ("sd = 2.0", "sd = 2.0, known = true", "put it into choose"),
        ("x.modes.1", "x.modes.0", "counts from 1, and there is 1"),
        ("part.nc", "nothing.nc", "no such file"),
        ('machine = "vx500"', "", "no machine: give one there, or with -m"),
    ],
)
def test_bad_choices_name_key_value_and_limit(tmp_path: Path, old: str, new: str, said: str) -> None:
    text = STUDY.replace("controller.shaped_time_constant_s = [0.0, 0.008]\n", CHOICES).replace(old, new)
    done = run(written(tmp_path, text), "optimize", "STUDY.toml", "--json", "o.json")
    assert done.returncode == 2
    assert said in done.stderr
    assert not (tmp_path / "o.json").exists()


def test_bad_arguments_name_key_value_and_limit() -> None:
    ask = partial(sg.study, path_program(200, VX500), VX500)
    for given, options, said in (
        ({}, {}, "nothing is varied"),
        ({X_HZ: [45.0]}, {"n": 0}, "n = 0: must be a whole number of samples, 1 or more"),
        ({X_HZ: 46}, {}, "46: must be a distribution or a list of values"),
        ({"shaping.family": sg.listed(["zv"], known=False)}, {}, "family: known = false: only the converter reads it"),
        ({X_HZ: [45.0]}, {"sampling": "monte carlo"}, "'monte carlo': must be one of sobol, lhs, grid"),
        ([X_HZ], {}, r"vary = .*: must be a mapping by keys of the machine file"),
        ({1: [45.0]}, {}, r"vary = .*: must be a mapping by keys of the machine file"),
        ({X_HZ: [45.0]}, {"n": 10**12}, r"n = 1000000000000: .* at most 1000000"),
        ({X_HZ: [45.0]}, {"seed": -1}, "seed = -1: must be a whole number, 0 or more"),
        ({X_HZ: [45.0]}, {"at_least": math.nan}, "at_least = nan: must be a probability"),
    ):
        with pytest.raises(ArgumentError, match=said):
            ask(given, **options)
    with pytest.raises(MachineError, match=r"axes\.x\.mode: no such key"):
        ask({"axes.x.mode": [45.0]})
    for call, arguments, said in (
        (sg.listed, ("zv",), "'zv': must be a list of values"),
        (partial(sg.normal, percent=5), (0,), "percent = 5: must be of a mean that is not 0: give sd"),
        (sg.normal, (math.nan, 1), "mean = nan: must be a finite number"),
        (sg.uniform, (3, 2), "high = 2: must be above low = 3"),
    ):
        with pytest.raises(ArgumentError, match=said):
            call(*arguments)
    with pytest.raises(StudyFileError):
        sg.load_study(Path(__file__))


def test_a_text_that_travels_as_bytes_is_played_to_the_bit() -> None:
    """With `frequency_over` and remarks: nothing of the machine is lost on the way."""
    over = {"axis": "x", "position_mm": [0.0, 60.0], "frequency_hz": [44.0, 48.0]}
    machine = VX500.with_values("axes.x.modes.1.frequency_over", over)
    replay = replays.Replay.of(path_program(200, machine), machine)
    rows = tuple({Y_HZ: 120.0 + draw} for draw in range(70))
    job = SamplesJob("vx500", rows, tuple(range(70)), ("residual_um", "contour_um", "time_s"), times=True)
    with ThreadPoolExecutor(2) as pool:
        assert simulate_all(replay, job, pool) == simulate_all(replay, job, None)


@pytest.mark.slow
def test_a_cluster_finds_the_same_to_the_bit() -> None:
    vary = {X_HZ: sg.normal(46, 2), Y_HZ: sg.normal(131, 5)}
    here = sg.study(path_program(200, VX500), VX500, vary, n=200)
    there = sg.study(path_program(200, VX500), VX500, vary, n=200, scheduler="local")
    assert all(np.array_equal(here.draws[name], there.draws[name]) for name in here.draws)


def share_within(text: bytes, lines: tuple[int, int], draws: list[tuple[float, float]], limit_um: float) -> float:
    """Of machines, by the tests' own interpreter, player and plant: those whose residual vibration is small enough."""
    emitted = interpret(text.decode()).lines[lines[0] - 1 : lines[1]]
    command = play([move for line in emitted for move in line.moves if move.length > 0.0])
    left = [
        residual_um(command, [[Mode(x_hz, 0.02)], [Mode(y_hz, 0.02)], []], 0.001, still_mm=1e-9).max()
        for x_hz, y_hz in draws
    ]
    return float(np.mean(np.array(left) <= limit_um))


def test_the_optimum_is_the_shortest_that_is_likely_enough() -> None:
    """ZV is shorter than ZVD, and leaves too much on too many of machines that are known badly."""
    machine = VX500.with_values(
        {
            "tolerance.contour_um": 500.0, "tolerance.residual_ratio": 0.001, "tolerance.residual_floor_um": 1.2,
            "tolerance.residual_floor_increments": 0.5,
        }
    )  # fmt: skip
    program = path_program(200, machine)
    vary = {X_HZ: sg.normal(46, percent=6), Y_HZ: sg.normal(131, percent=6)}
    choose = {"shaping.family": ["zvd", "zv", "mzv"], "emission.block_period_s": [0.006, 0.005]}
    found = sg.optimize(program, machine, vary, choose=choose, probability=0.9, n=64)
    random = np.random.default_rng(5)
    draws = [(46.0 * (1 + 0.06 * x), 131.0 * (1 + 0.06 * y)) for x, y in random.standard_normal((150, 2))]
    good = []
    for family in choose["shaping.family"]:
        for period in choose["emission.block_period_s"]:
            values = {"shaping.family": family, "emission.block_period_s": period}
            conversion = sg.convert(program, machine.with_values(values))
            (region,) = conversion.regions
            share = share_within(conversion.text, region.emitted_lines, draws, max(region.residual_limit_um))
            if share >= 0.9:
                good.append((conversion.cycle_time_s.emitted, values))
    assert found.values == min(good, key=lambda pair: pair[0])[1]
    assert found.best is not None and found.best.checked == pytest.approx(1.0, abs=0.02)
    assert [each.within is None for each in found.candidates] == [False, False, False, True, True, True]


def test_more_choices_than_conversions_are_searched() -> None:
    choose = {
        "shaping.family": ["zv", "mzv", "zvd", "ei"], "emission.block_period_s": [0.005, 0.006, 0.007],
        "shaping.arc_feed_ratio": [1.0, 0.9, 0.8],
    }  # fmt: skip
    ask = partial(sg.optimize, path_program(200, VX500), VX500, {X_HZ: sg.normal(46, 1)}, n=8)
    progress: list[float] = []
    found = ask(choose=choose, most=10, on_progress=progress.append)
    assert (len(found.candidates), found.combinations) == (10, 36)
    assert progress == pytest.approx([0.1 * (k + 1) for k in range(10)])
    assert found.best is not None and found.best.time_s == min(each.time_s for each in found.candidates if each.time_s)
    assert ask(choose=choose, most=10).values == found.values
    for options, said in (
        ({"probability": 1.5}, r"probability = 1\.5: must be a probability, above 0 and at most 1"),
        ({"most": 0}, "most = 0: must be a whole number of conversions, 1 or more"),
        ({"most": "3"}, "most = '3': must be a whole number of conversions"),
        ({"choose": ["zv"]}, r"choose = \['zv'\]: must be a mapping by keys of the machine file"),
        ({"choose": {"shaping.family": []}}, "must be a list of one value or more"),
    ):
        with pytest.raises(ArgumentError, match=said):
            ask(**options)
    with pytest.raises(MachineError, match=r"shaping\.family = \"soft\": must be"):
        ask(choose={"shaping.family": ["soft"]})
    with pytest.raises(ArgumentError, match=r"controller\.block_time_s: the converter reads it"):
        sg.optimize(path_program(200, VX500), VX500, {"controller.block_time_s": [0.005]})
