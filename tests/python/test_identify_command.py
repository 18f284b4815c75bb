"""``shapegcode identify``: exit codes, JSON, table, pictures, machine file; the records are made by SciPy."""

import json
import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest

import shapegcode as sg
from shapegcode.cli import main
from shapegcode.io.units import FloatArray
from shapegcode.results import plot as canvas
from shapegcode.results.json import schema
from shapegcode.shaping.bands import machine_bands
from shapegcode.verdict.figures import stated_cases
from tap_truth import TrueMode, acceleration

PERIOD_S = 1.0 / 2048.0
TWO = ((46.0, 0.02, 120.0), (131.0, 0.03, 60.0))
ESTIMATES = ("frequency_hz", "damping_ratio", "mass_kg", "damping_n_s_per_m", "stiffness_n_per_m")


def times(samples: int) -> FloatArray:
    return np.asarray(np.arange(samples) * PERIOD_S, dtype=np.float64)


def pulse(samples: int, newton: float = 500.0) -> FloatArray:
    """A half sine of 4 ms that begins after 20 ms."""
    t = times(samples) - 0.02
    return np.where((t > 0.0) & (t < 0.004), newton * np.sin(np.pi * t / 0.004), 0.0)


def response(force: FloatArray, modes: Sequence[tuple[float, float, float]], snr_db: float, seed: int) -> FloatArray:
    """Acceleration with white noise."""
    sampled = acceleration([TrueMode(*mode) for mode in modes], force, PERIOD_S)
    noise = np.random.default_rng(seed).normal(size=len(sampled))
    return np.asarray(sampled + noise * np.sqrt(np.mean(sampled**2)) * 10.0 ** (-snr_db / 20.0))


def write_csv(file: Path, columns: dict[str, FloatArray]) -> Path:
    values = np.column_stack(list(columns.values()))
    np.savetxt(file, values, delimiter=",", header=",".join(columns), comments="", fmt="%.9g")
    return file


def write_tap(
    file: Path, modes: Sequence[tuple[float, float, float]] = TWO, *, seed: int = 1, snr_db: float = 40.0,
    samples: int = 2048, axis: str = "_x",
) -> Path:  # fmt: skip
    force = pulse(samples, 400.0 + 50.0 * seed)
    noise = np.random.default_rng(100 + seed).normal(size=samples) * 0.05
    columns = {
        "time [s]": times(samples),
        "force [N]": force + noise,
        f"acc{axis} [m/s^2]": response(force, modes, snr_db, seed),
    }
    return write_csv(file, columns)


def write_stop(file: Path, axis: str = "") -> Path:
    """The free decay of paper 000's modes after a stop at .3 s, 40 dB."""
    t = times(3072) - 0.3
    decay = sum(
        size * np.exp(-zeta * 2.0 * math.pi * hertz * t.clip(0.0)) * np.cos(2.0 * math.pi * hertz * t)
        for hertz, zeta, size in ((46.0, 0.02, 0.8), (131.0, 0.02, 0.5))
    ) * (t >= 0.0)
    noise = np.random.default_rng(5).normal(size=len(t)) * 0.003
    return write_csv(file, {"time [s]": t + 0.3, f"acc{axis} [m/s^2]": decay + noise})


@pytest.fixture(scope="module")
def taps(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    folder = tmp_path_factory.mktemp("taps")
    return [str(write_tap(folder / f"tap{seed}.csv", seed=seed, samples=1024)) for seed in (1, 2, 3)]


@pytest.fixture
def mine(tmp_path: Path) -> Path:
    file = tmp_path / "mine.toml"
    file.write_text(sg.Machine.builtin_text("vx500"), encoding="utf-8")
    return file


def asked(capsys: pytest.CaptureFixture[str], *words: str, code: int = 0) -> dict[str, Any]:
    assert main(["identify", *words, "--json", "-"]) == code
    result: dict[str, Any] = json.loads(capsys.readouterr().out)
    jsonschema.validate(result, schema(sg.Identification))
    assert result["ok"] == (code == 0)
    return result


def test_taps_to_machine_file(capsys: pytest.CaptureFixture[str], taps: list[str], mine: Path) -> None:
    result = asked(capsys, *taps, "--update", str(mine))
    assert (result["axis"], result["decay"], result["order"], result["refused"]) == ("x", False, 2, [])
    assert [row["used"] for row in result["records"]] == [True] * 3
    assert len(result["modes"]) == 2
    for mode, (hertz, zeta, mass) in zip(result["modes"], TWO, strict=True):
        omega = 2.0 * math.pi * hertz
        true = (hertz, zeta, mass, 2.0 * zeta * omega * mass, mass * omega**2)
        for name, value, within in zip(ESTIMATES, true, (1e-3, 0.02, 0.02, 0.03, 0.02), strict=True):
            assert mode[name]["value"] == pytest.approx(value, rel=within), name
            assert mode[name]["low"] < mode[name]["value"] < mode[name]["high"]
    evidence = {int(order): value for order, value in result["evidence"].items()}
    assert min(evidence, key=evidence.__getitem__) == 2
    assert result["machine_file"]["path"] == str(mine)
    assert "would be 0.33" in " ".join(result["machine_file"]["notes"])

    machine = sg.Machine.load(mine)
    assert machine.axes.y == sg.Machine.load("vx500").axes.y
    for mode, found in zip(machine.axes.x.modes, result["modes"], strict=True):
        hertz = found["frequency_hz"]
        assert mode.frequency_hz == pytest.approx(hertz["value"], rel=1e-6)
        half = max(abs(hertz[end] - hertz["value"]) for end in ("low", "high")) / hertz["value"]
        assert mode.frequency_uncertainty_percent == pytest.approx(100.0 * half, rel=2e-2, abs=1e-4)
        assert mode.mass_kg == pytest.approx(found["mass_kg"]["value"], rel=1e-6)
        assert mode.source == "tap test tap1.csv, tap2.csv, tap3.csv, 3 taps"


def test_the_shaper_and_the_verdict_use_it(capsys: pytest.CaptureFixture[str], tmp_path: Path, mine: Path) -> None:
    narrow = str(write_tap(tmp_path / "good.csv", TWO[:1]))
    wide = str(write_tap(tmp_path / "noisy.csv", [(46.0, 0.15, 120.0)], snr_db=12.0, samples=1024))
    for file, designed in ((narrow, False), (wide, True)):
        asked(capsys, file, "--update", str(mine))
        machine = sg.Machine.load(mine)
        (mode,) = machine.axes.x.modes
        band = next(band for band in machine_bands(machine) if band.mode.frequency_hz == mode.frequency_hz)
        assert band.uncertainty == (mode.frequency_uncertainty_percent / 100.0 if designed else 0.0)
        assert band.mode.damping_ratio == mode.damping_ratio
        names = [case.name for case in stated_cases(machine) if case.counts]
        damping = f"damping -{mode.damping_uncertainty_percent:.3g} %"
        assert sum(damping in name for name in names) == 2


def test_the_same_again_changes_nothing(taps: list[str], mine: Path) -> None:
    assert main(["identify", taps[0], "--update", str(mine)]) == 0
    once = mine.read_bytes()
    assert main(["identify", taps[0], "--update", str(mine)]) == 0
    assert mine.read_bytes() == once


def test_what_people_see(capsys: pytest.CaptureFixture[str], taps: list[str]) -> None:
    assert main(["identify", *taps]) == 0
    out = capsys.readouterr().out
    for said in ("2 modes of the X axis in 3 taps: ", "frequency Hz", "damping %", "m kg", "c N s/m", "k N/µm"):
        assert said in out
    assert f"next: shapegcode identify {' '.join(taps)} --axis x --update mine.toml" in out


def test_the_next_command_finds_the_same_modes(capsys: pytest.CaptureFixture[str], taps: list[str]) -> None:
    determining = ["--response-scale=1.5", "--freq", "20:400", "--max-modes", "3"]
    assert main(["identify", *determining, "-q", taps[0], "--json", "-"]) == 0
    said = json.loads(capsys.readouterr().out)["next_step"]
    assert f"identify {taps[0]} --axis x {' '.join(determining)} --update mine.toml" in said


def test_one_mode_has_the_check_of_the_paper(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    result = asked(capsys, str(write_tap(tmp_path / "one.csv", TWO[:1])))
    (mode,) = result["modes"]
    assert mode["mass_kg"]["value"] == pytest.approx(120.0, rel=0.02)
    for name in ("closed_form_kg", "bisection_kg"):
        assert result["mass_check"][name] == pytest.approx(120.0, rel=0.02)
    assert main(["identify", str(tmp_path / "one.csv")]) == 0
    assert "check, equivalent mass as in paper 003: closed form 1" in capsys.readouterr().out


def test_a_decay_gives_modes_without_mass(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, mine: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(canvas, "FORMATS", (".svg",))
    stop, plots = str(write_stop(tmp_path / "stop.csv")), tmp_path / "plots"
    result = asked(capsys, stop, "--plots", str(plots))
    assert (result["decay"], result["axis"], result["mass_check"]) == (True, None, None)
    assert [mode["frequency_hz"]["value"] for mode in result["modes"]] == pytest.approx([46.0, 131.0], rel=1e-3)
    assert [mode["damping_ratio"]["value"] for mode in result["modes"]] == pytest.approx([0.02, 0.02], rel=0.03)
    assert all(mode[name] is None for mode in result["modes"] for name in ESTIMATES[2:])
    spectrum = (plots / "identify-spectrum.svg").read_text(encoding="utf-8")
    labels = re.findall(r">([0-9.]+) Hz<", spectrum)
    assert sorted(map(float, labels)) == pytest.approx([46.0, 131.0], abs=0.5)

    before = mine.read_bytes()
    assert main(["identify", stop, "--update", str(mine)]) == 2
    assert "does not say along which axis" in capsys.readouterr().err
    assert mine.read_bytes() == before
    assert main(["identify", stop, "--update", str(mine), "--axis", "y"]) == 0
    machine = sg.Machine.load(mine)
    assert [mode.mass_kg for mode in machine.axes.y.modes] == [None, None]
    assert machine.axes.y.modes[0].source == "free decay stop.csv"
    assert machine.axes.x == sg.Machine.load("vx500").axes.x


def test_the_force_may_be_ignored_and_the_start_be_told(capsys: pytest.CaptureFixture[str], taps: list[str]) -> None:
    result = asked(capsys, taps[0], "--decay", "--start", "30ms")
    assert result["decay"]
    assert result["records"][0]["start_s"] == pytest.approx(0.03, abs=PERIOD_S)
    assert result["modes"][0]["frequency_hz"]["value"] == pytest.approx(46.0, rel=2e-3)


def test_some_modes_refused(capsys: pytest.CaptureFixture[str], tmp_path: Path, mine: Path) -> None:
    file = str(write_tap(tmp_path / "weak.csv", [TWO[0], (131.0, 0.02, 8000.0)], snr_db=32.0))
    result = asked(capsys, file, "--update", str(mine), code=1)
    assert [round(mode["frequency_hz"]["value"]) for mode in result["modes"]] == [46]
    (refused,) = result["refused"]
    assert refused["frequency_hz"]["value"] == pytest.approx(131.0, rel=0.05)
    assert "limit" in refused["refusal"]
    assert [round(mode.frequency_hz) for mode in sg.Machine.load(mine).axes.x.modes] == [46]
    assert main(["identify", file]) == 1
    out = capsys.readouterr().out
    assert "not supported by the data" in out
    assert "next: tap again" in out


def test_nothing_supported(capsys: pytest.CaptureFixture[str], tmp_path: Path, mine: Path) -> None:
    noise = np.random.default_rng(3).normal(size=2048)
    silent = write_csv(
        tmp_path / "noise.csv", {"time [s]": times(2048), "force [N]": pulse(2048), "acc_x [m/s^2]": noise}
    )
    before = mine.read_bytes()
    result = asked(capsys, str(silent), "--update", str(mine), "--plots", str(tmp_path / "plots"), code=2)
    assert result["modes"] == []
    assert result["reason"]
    assert result["machine_file"] is None
    assert mine.read_bytes() == before


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ({"time [s]": "t", "force [N]": "0", "acc [m/s^2]": "a"}, "zero force"),
        ({"time [s]": "t", "force [N]": "f"}, "required: an acceleration"),
        ({"time [s]": "t", "force [N]": "f", "acc [m/s^2]": "short"}, "short"),
    ],
)
def test_bad_input_is_told_in_the_json_too(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, columns: dict[str, str], message: str
) -> None:
    rows = 60 if "short" in columns.values() else 2048
    t = times(rows)
    values = {"t": t, "0": 0.0 * t, "f": pulse(rows), "a": np.sin(300.0 * t) * np.exp(-t), "short": t**2}
    file = write_csv(tmp_path / "bad.csv", {header: values[name] for header, name in columns.items()})
    out = tmp_path / "out.json"
    assert main(["identify", str(file), "--json", str(out)]) == 2
    captured = capsys.readouterr()
    result = json.loads(out.read_text(encoding="utf-8"))
    assert result["modes"] == []
    assert message in result["reason"]
    assert result["reason"] in captured.out
    assert captured.err == ""
    assert "next: shapegcode identify --tap-plan" in captured.out


def test_what_the_user_says_of_a_file(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    force = pulse(2048)
    answer = response(force, TWO, 40.0, 1)
    values = np.column_stack([answer / 9.80665, np.arange(2048) * PERIOD_S * 1e3, force / 1e3])
    file = tmp_path / "columns.csv"
    np.savetxt(file, values, delimiter=";", header="a;b;c", comments="", fmt="%.9g")
    result = asked(
        capsys, str(file), "--time-column", "b", "--time-unit", "ms", "--force-column", "3", "--force-unit", "kN",
        "--response-column", "a", "--response-unit", "g", "--quantity", "acceleration", "--axis", "z",
    )  # fmt: skip
    assert result["axis"] == "z"
    assert [mode["mass_kg"]["value"] for mode in result["modes"]] == pytest.approx([120.0, 60.0], rel=0.02)


def test_band_and_number_of_modes(capsys: pytest.CaptureFixture[str], taps: list[str]) -> None:
    result = asked(capsys, taps[0], "--modes", "2", "--frequencies", "20:300")
    assert result["order"] == 2
    assert len(result["modes"]) == 2
    for words in ("--frequencies 300:20", "--frequencies 20", "--modes 0", "--start 1", "--force-scale 0"):
        assert main(["identify", taps[0], *words.split()]) == 2
        assert "must be" in capsys.readouterr().err


def test_pictures(tmp_path: Path, taps: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(canvas, "FORMATS", (".svg",))
    assert main(["identify", *taps, "--plots", str(tmp_path / "plots")]) == 0
    names = sorted(file.name for file in (tmp_path / "plots").iterdir())
    assert names == [f"identify-{name}.svg" for name in ("decay", "response", "stabilisation", "traces")]
    texts = {name: (tmp_path / "plots" / name).read_text(encoding="utf-8") for name in names}
    assert "coherence" in texts["identify-response.svg"]
    assert "46 Hz" in texts["identify-response.svg"]
    assert "force in N" in texts["identify-traces.svg"]
    assert "chosen: 2" in texts["identify-stabilisation.svg"]
    assert main(["identify", taps[0], "--plots", str(tmp_path / "one")]) == 0
    assert "coherence" not in (tmp_path / "one" / "identify-response.svg").read_text(encoding="utf-8")


def test_what_is_refused_before_the_work(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, taps: list[str], mine: Path
) -> None:
    mine.write_text("name = 1\n", encoding="utf-8")
    for words, message in (
        ([], "identify --tap-plan"),
        (["--tap-plan", taps[0]], "reads no file"),
        ([taps[0], "--update", "vx500"], "shapegcode machine init vx500 -o mine.toml"),
        ([taps[0], "--update", str(mine)], "must be a text"),
        ([taps[0], "--update", str(tmp_path / "none.toml")], "no such file"),
        ([taps[0], "--json", taps[0]], "would overwrite"),
        ([taps[0], "-m", str(mine)], "--update gives the machine file"),
        ([str(tmp_path / "none.csv")], "no such file"),
    ):
        assert main(["identify", *words]) == 2
        assert message in capsys.readouterr().err


def test_tap_plan(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert main(["identify", "--tap-plan", "-m", "vx500", "--json", str(tmp_path / "plan.json")]) == 0
    out = capsys.readouterr().out
    plan = json.loads((tmp_path / "plan.json").read_text(encoding="utf-8"))
    jsonschema.validate(plan, schema(sg.TapPlan))
    assert plan["instructions"] in out
    assert plan["recordings"][0]["modes_hz"] == [46.0]
    assert main(["identify", "--tap-plan"]) == 0
    assert "hammer" in capsys.readouterr().out


def test_from_python(taps: list[str]) -> None:
    found = sg.identify(taps)
    assert [mode.frequency_hz.value for mode in found.modes] == pytest.approx([46.0, 131.0], rel=1e-3)
    single = sg.identify(taps[0], modes=2)
    assert single.order == 2
    force = pulse(2048)
    record = sg.Record("memory", PERIOD_S, response(force, TWO, 40.0, 9), force_n=force)
    (slow, _) = sg.identify([record]).modes
    assert slow.mass_kg.value == pytest.approx(120.0, rel=0.02)
    with pytest.raises(sg.RecordError, match="zero force"):
        sg.identify([sg.Record("memory", PERIOD_S, record.response, force_n=np.zeros(2048))])


def test_a_result_prints_as_a_line_per_mode(taps: list[str]) -> None:
    found = sg.identify(taps)
    lines = repr(found).splitlines()
    assert len(lines) <= 2 + len(found.modes)
    assert lines[0].startswith("<Identification: use: 2 modes of the X axis in 3 taps: ")
    assert re.match(r"  frequency 4[56]\.\d+ ± 0\.\d+ Hz, damping .* %, m 1\d\d.* kg, c .* N s/m, k .* N/µm$", lines[1])
    assert all(type(end) is float for mode in found.modes for end in vars(mode.frequency_hz).values())


def test_a_refusal_is_said_once(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    file = write_tap(tmp_path / "noisy.csv", TWO[:1], snr_db=-5.0)
    assert main(["identify", str(file)]) == 2
    captured = capsys.readouterr()
    assert " ".join(captured.out.split()).count("known only to") == 1
    assert captured.err == ""


def test_pictures_are_drawn_into_the_callers_axes(taps: list[str]) -> None:
    found = sg.identify(taps)
    drawn = found.plots()
    assert list(drawn) == [f"identify-{name}" for name in ("traces", "stabilisation", "decay", "response")]
    for draw in drawn.values():
        figure = canvas.figure(9.0, 9.0)
        ax = figure.subplots()
        assert draw(ax).figure.figure is figure
        assert draw().figure.figure is not figure


def test_a_number_of_modes_has_its_limits(taps: list[str]) -> None:
    for wrong in ({"modes": 0}, {"modes": 100}, {"max_modes": 0}):
        with pytest.raises(sg.ArgumentError, match="must be from 1 to 99"):
            sg.identify(taps[0], **wrong)
