"""Where values come from: measured, dump, inherited, assumed; it stays so through every command that writes a file."""

import json
import re
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import shapegcode as sg
from acceptance import Judged, convert, machine_with
from judge import Mode, contour_error_um, play, residual_um, response, starts
from shapegcode.cli import main
from shapegcode.conversion.tables import _Region
from shapegcode.identification.result import Estimate, IdentifiedMode
from shapegcode.identification.update import update_modes
from shapegcode.settings.edit import with_remarks, without_origins
from shapegcode.settings.keys import origin_of, remarks_of
from shapegcode.shaping.grid import choose_grid

DUMP = b"""%
N01013Q1A1P00000000A2P00000000A3P00000000
N01420Q1A1P20000.0A2P20000.0A3P20000.0
N01610Q1A1P00000001A2P00000001A3P00000001
N01622Q1A1P24A2P24A3P24
N01820Q1A1P2A2P2A3P2
N01826Q1A1P10A2P10A3P10
%
"""


def origins(machine: sg.Machine) -> dict[str, str]:
    """Per key its origin, as `machine show` says it."""
    return {value.key: value.origin for value in machine.values()}


@pytest.mark.parametrize(
    ("remark", "origin"),
    [
        ("measured (paper 000)", "measured"),
        ("95 %: 46.1 ... 46.3", "measured"),
        ("half of the 95 % interval", "measured"),
        ("FANUC 1622, 1610", "dump"),
        ("FANUC 1826: detection unit 1 µm assumed", "dump"),
        ("FANUC", "file"),
        ("from VX500: measured (paper 000)", "inherited"),
        ("assumed", "assumed"),
        ("assumed: not in the dump", "assumed"),
        ("not known", "assumed"),
        ("share of the residues 1/m, not measured", "assumed"),
        ("choice, not a property of the machine", "choice"),
        ("default", "default"),
        ("paper 004", "file"),
        ("", "file"),
    ],
)
def test_what_a_remark_says(remark: str, origin: str) -> None:
    assert origin_of(remark) == origin


def test_remarks_are_read_as_toml_reads_its_comments() -> None:
    text = """\
name = "a # in a name"  # measured  # twice
list = [
  "x", # inside
]  # behind
[axes.x]  # the X axis
'quoted' = 1
value = '#'# close
# unset = ...  # not known
# prose = with # a sign
[[axes.x.modes]]  # first
frequency_hz = 1
[[axes.x.modes]]
frequency_hz = 2  # second
# [[axes.z.modes]]  # rigid
"""
    assert tomllib.loads(text)["axes"]["x"]["modes"][1] == {"frequency_hz": 2}
    assert remarks_of(text) == {
        "name": "measured  # twice",
        "axes.x.value": "close",
        "axes.x.unset": "not known",
        "axes.x.modes.2.frequency_hz": "second",
        "axes.z.modes": "rigid",
    }
    changed = with_remarks(text, lambda key, remark: f"<{remark}>" if remark else "")
    again = with_remarks(changed, lambda key, remark: re.sub("[<>]", "", remark)).replace("'  # close", "'# close")
    assert again.partition("\n\n[origin]")[0] + "\n" == text
    data = tomllib.loads(changed)
    assert data.pop("origin")["axes"] == {
        "x": {"value": "stated: <close>", "unset": "stated: <not known>",
              "modes": {"2": {"frequency_hz": "stated: <second>"}}},
        "z": {"modes": "stated: <rigid>"},
    }  # fmt: skip
    assert data == tomllib.loads(text)


AXES = "".join(
    f"[axes.{axis}]\nmax_feed_mm_per_min = 1e4\nrapid_mm_per_min = 2e4\nmax_acceleration_mm_s2 = 3e3\n"
    for axis in "xyz"
)
FEED = "axes.x.max_feed_mm_per_min"


@pytest.mark.parametrize(
    ("word", "origin", "unmeasured"),
    [
        ("measured: tap of 3 May", "measured", False),
        ("parameters", "dump", False),
        ("inherited: from VX500", "inherited", True),
        ("assumed", "assumed", True),
        ("choice", "choice", False),
        ("stated: measured? no", "file", False),
    ],
)
def test_an_origin_is_stated_as_data(word: str, origin: str, unmeasured: bool) -> None:
    table = f'name = "m"\n{AXES}[origin]\n{FEED} = "{word}"\n'
    inline = f'name = "m"\n{AXES}'.replace("= 1e4", f'= {{ value = 1e4, origin = "{word}" }}', 1)
    for text in (table, inline, table.replace(f"[origin]\n{FEED}", "[origin.axes.x]\nmax_feed_mm_per_min")):
        machine = sg.Machine.from_toml(text)
        assert (machine.axes.x.max_feed_mm_per_min, machine.origin_warning) == (1e4, "")
        (value,) = (each for each in machine.values() if each.key == FEED)
        assert (value.origin, value.unmeasured) == (origin, unmeasured)
        for written in (machine.to_toml(), machine.to_toml(short=True)):
            assert origins(sg.Machine.from_toml(written))[FEED] == origin


def test_comments_say_nothing_where_origins_are_data() -> None:
    text = f'name = "m"\n{AXES}'.replace("= 1e4", "= 1e4  # measured").replace("= 2e4", "= 2e4  # measured? no")
    described = text.replace("[axes.x]", 'description = """\n[axes.x]\nrapid_mm_per_min = 1  # measured\n"""\n[axes.x]')
    for each in (described, described + f'[origin]\n{FEED} = "assumed"\n'):
        machine = sg.Machine.from_toml(each)
        new = "[origin]" in each
        found = origins(machine)
        assert (found[FEED], found["axes.y.max_feed_mm_per_min"]) == (("assumed", "file") if new else ("measured",) * 2)
        assert found["axes.x.rapid_mm_per_min"] == ("file" if new else "assumed")
        assert bool(machine.origin_warning) != new
        assert "rapid_mm_per_min = 20000.0  # measured\n" not in machine.to_toml()
    guessed = sg.Machine.from_toml(text.replace("# measured", "# guess", 1))
    assert origins(guessed)[FEED] == "assumed"


@pytest.mark.parametrize(
    ("line", "message"),
    [
        (f'{FEED} = "guess"', 'origin.axes.x.max_feed_mm_per_min = "guess": must be measured, parameters'),
        (f'{FEED} = "measured? no"', "must be measured, parameters"),
        (f"{FEED} = 3", "must be measured, parameters"),
        ('axes.x.modes.1.frequency_hz = "measured"', "no such key of this machine"),
    ],
)
def test_a_wrong_origin_is_an_error_with_its_line(line: str, message: str) -> None:
    with pytest.raises(sg.MachineError) as wrong:
        sg.Machine.from_toml(f'name = "m"\n{AXES}[origin]\n{line}\n', "m.toml")
    assert str(wrong.value).startswith("m.toml:15: origin.axes.x.")
    assert message in str(wrong.value)
    with pytest.raises(sg.MachineError, match=r"^m\.toml:3: origin\.axes\.x\.max_feed"):
        sg.Machine.from_toml(f'name = "m"\n{AXES}'.replace("1e4", '{ value = 1e4, origin = "?" }', 1), "m.toml")


def test_an_older_file_is_rewritten(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "old.toml"
    old = f'name = "m"\n{AXES}'.replace("= 1e4", "= 1e4  # measured: by me", 1).replace("= 2e4", "= 2e4  # FANUC 1420")
    file.write_text(old)
    assert main(["machine", "show", str(file)]) == 0
    assert "--write-origins" in capsys.readouterr().out
    part = tmp_path / "part.nc"
    part.write_text("%\nO1\nG21G17G90G94\nG0X0Y0Z0\nG1X2.F600\nM30\n%\n")
    main(["time", str(part), "-m", str(file)])
    assert f"shapegcode machine show {file} --write-origins" in capsys.readouterr().err
    assert main(["machine", "show", str(file), "--write-origins"]) == 0
    new = file.read_text()
    assert new.startswith(old)
    assert tomllib.loads(new)["origin"]["axes"]["x"] == {
        "max_feed_mm_per_min": "measured: by me", "rapid_mm_per_min": "parameters: FANUC 1420",
    }  # fmt: skip
    assert origins(sg.Machine.load(file)) == origins(sg.Machine.from_toml(old))
    capsys.readouterr()
    main(["time", str(part), "-m", str(file)])
    assert "write-origins" not in capsys.readouterr().err
    assert main(["machine", "show", str(file), "--write-origins"]) == 0
    assert file.read_text() == new


def test_an_update_moves_the_origins_with_the_modes() -> None:
    text = sg.Machine.load("vx500").to_toml(short=True)
    two = update_modes(text, "x", [identified(47.0), identified(90.0)], source="tap", keep_modes="y").text
    one = update_modes(two, "x", [identified(90.5)], source="tap")
    modes = tomllib.loads(one.text)["origin"]["axes"]["x"]["modes"]
    assert list(modes) == ["1"]
    assert modes["1"]["frequency_hz"] == "measured: 95 %: 90.4095 ... 90.5905"
    # A value with its origin beside it is written into the table first.
    inline = f'name = "m"\n{AXES}'.replace("= 1e4", '= { value = 1e4, origin = "measured" }', 1)
    machine = update_modes(inline, "y", [identified(50.0)], source="tap").machine
    assert (origins(machine)[FEED], machine.axes.x.max_feed_mm_per_min) == ("measured", 1e4)


def test_init_inherits_what_was_measured_on_the_built_in_machine(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    assert main(["machine", "init", "vx500", "--full", "-o", str(file)]) == 0
    built_in, mine = sg.Machine.load("vx500"), sg.Machine.load(file)
    assert mine == built_in
    found = origins(mine)
    assert found["axes.x.modes.1.frequency_hz"] == "inherited"
    assert found["axes.x.modes.1.damping_ratio"] == "assumed"
    assert found["tolerance.contour_um"] == "choice"
    # Nothing of the machine itself is stated here: nobody has said anything of it yet.
    stated = [key for key, origin in found.items() if origin in ("measured", "file") and key.startswith("controller.")]
    assert stated == []
    assert origins(built_in)["axes.x.modes.1.frequency_hz"] == "measured"


def test_show_counts_and_names_origins(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "mine.toml"
    main(["machine", "init", "vx500", "-o", str(file)])
    capsys.readouterr()
    assert main(["machine", "show", str(file), "--json", "-"]) == 0
    report = json.loads(capsys.readouterr().out)
    mode = report["keys"]["axes.y.modes.1.frequency_hz"]
    assert (mode["origin"], mode["assumed"]) == ("inherited", False)
    assert mode["remark"].startswith("from VX500: measured")
    assert report["keys"]["controller.rapid_path"]["assumed"] is True
    assert main(["machine", "show", str(file)]) == 0
    shown = capsys.readouterr().out
    assert re.search(r"inherited +\d", shown)
    assert "assumed or inherited" in shown


def test_import_says_of_every_value_where_it_comes_from() -> None:
    found = origins(sg.import_parameters(DUMP, sg.Machine.load("vx500"), source="HM.TXT").machine)
    assert found["controller.shaped_time_constant_s"] == "dump"
    assert found["controller.in_position_width_um"] == "dump"
    assert found["axes.x.max_acceleration_mm_s2"] == "assumed"
    assert found["controller.time_constant_s"] == "dump"
    assert found["controller.law"] == "inherited"
    assert found["axes.z.modes"] == "assumed"


def test_modes_are_never_taken_over_in_silence() -> None:
    base = sg.Machine.load("vx500")
    result = sg.import_parameters(DUMP, base, source="HM.TXT")
    axes = result.machine.axes
    assert [axis.modes for axis in axes.as_tuple()] == [(), (), ()]
    assert any("46 Hz of VX500" in row.why and "--keep-modes X" in row.why for row in result.missing)
    kept = sg.import_parameters(DUMP, base, source="HM.TXT", keep_modes="x", rigid="yz").machine
    assert (kept.axes.x.modes, kept.axes.y.modes) == (base.axes.x.modes, ())
    assert (kept.axes.y.rigid, kept.axes.z.rigid, kept.axes.x.rigid) == (True, True, False)
    assert origins(kept)["axes.x.modes.1.frequency_hz"] == "inherited"
    for wrong in ({"keep_modes": "z"}, {"keep_modes": "x", "rigid": "x"}, {"rigid": "q"}):
        with pytest.raises(sg.ArgumentError):
            sg.import_parameters(DUMP, base, **wrong)


def test_origins_survive_writing_reading_and_changing() -> None:
    machine = sg.import_parameters(DUMP, sg.Machine.load("vx500"), source="HM.TXT", keep_modes="xy").machine
    again = sg.Machine.from_toml(machine.to_toml())
    assert again == machine
    before, after = origins(machine), origins(again)
    assert {key: origin for key, origin in after.items() if origin != before[key]} == {
        # A default that is written down is still not known.
        key: "assumed"
        for key, origin in before.items()
        if origin == "default" and after[key] == "assumed"
    }
    changed = machine.with_values("axes.x.modes.1.frequency_hz", 47.0)
    assert origins(changed)["axes.x.modes.1.frequency_hz"] == "file"
    assert origins(changed)["axes.x.modes.1.damping_ratio"] == "assumed"
    assert "axes.y.modes.1.frequency_hz" not in origins(machine.with_values("axes.y.modes", []))


def test_a_mode_and_rigid_contradict_each_other() -> None:
    with pytest.raises(sg.MachineError, match="rigid is true, but there are modes"):
        machine_with({"axes.x.rigid": True})


def without_terminal(monkeypatch: pytest.MonkeyPatch, answers: str) -> None:
    """Standard input and error that say they are a terminal, with answers typed ahead."""

    class Typed:
        def __init__(self) -> None:
            self.lines = iter(answers.splitlines(keepends=True))

        def isatty(self) -> bool:
            return True

        def readline(self) -> str:
            return next(self.lines, "")

    monkeypatch.setattr("sys.stdin", Typed())
    monkeypatch.setattr("sys.stderr.isatty", lambda: True, raising=False)


def test_at_a_terminal_the_import_asks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: Any) -> None:
    dump, file = tmp_path / "HM.TXT", tmp_path / "m.toml"
    dump.write_bytes(DUMP)
    without_terminal(monkeypatch, "k\nr\n")
    assert main(["machine", "import", str(dump), "--from", "vx500", "-o", str(file)]) == 0
    machine = sg.Machine.load(file)
    assert [mode.frequency_hz for mode in machine.axes.x.modes] == [46.0]
    assert (machine.axes.y.modes, machine.axes.y.rigid) == ((), True)
    assert "X has 46 Hz (of VX500)" in capfd.readouterr().err


def identified(frequency_hz: float) -> IdentifiedMode:
    """A mode that data support."""
    near = Estimate(frequency_hz, 0.999 * frequency_hz, 1.001 * frequency_hz)
    return IdentifiedMode(near, Estimate(0.03, 0.029, 0.031), None, None, None, "")


@pytest.fixture
def started(tmp_path: Path) -> Path:
    """A machine file as `machine init` leaves it."""
    file = tmp_path / "mine.toml"
    main(["machine", "init", "vx500", "-o", str(file)])
    return file


def test_a_tap_on_x_does_not_keep_the_mode_of_another_machine_in_y(started: Path) -> None:
    text = started.read_text(encoding="utf-8")
    with pytest.raises(sg.ArgumentError, match=r"Y: 131\.0 Hz \(from VX500.*--keep-modes Y .* --rigid Y"):
        update_modes(text, "x", [identified(47.0)], source="tap")
    rigid = update_modes(text, "x", [identified(47.0)], source="tap", rigid="yz")
    assert (rigid.machine.axes.y.modes, rigid.machine.axes.y.rigid, rigid.machine.axes.z.rigid) == ((), True, True)
    assert origins(rigid.machine)["axes.x.modes.1.frequency_hz"] == "measured"
    before, after = tomllib.loads(text), tomllib.loads(rigid.text)
    assert (before.pop("origin")["axes"]["y"]["modes"]["1"], after.pop("origin")["axes"]["y"]) != ({}, {})
    for axis, table in (("x", before), ("x", after), ("y", before)):
        table["axes"][axis].pop("modes")
    for axis in "yz":
        before["axes"][axis]["rigid"] = True
    assert after == before
    # The shaper is that of the measured mode alone.
    design = [choose_grid(each).duration_s for each in (rigid.machine, sg.Machine.load(started))]
    assert design[0] < 0.8 * design[1]


def test_a_mode_that_is_kept_stays_inherited_and_is_asked_for_once(started: Path) -> None:
    text = started.read_text(encoding="utf-8")
    kept = update_modes(text, "x", [identified(47.0)], source="tap", keep_modes="y")
    assert origins(kept.machine)["axes.y.modes.1.frequency_hz"] == "inherited"
    assert any("Y: kept" in note for note in kept.notes)
    again = update_modes(kept.text, "x", [identified(47.0)], source="tap")
    assert again.text == kept.text
    # In the end it is measured.
    measured = update_modes(kept.text, "y", [identified(130.0)], source="tap")
    assert origins(measured.machine)["axes.y.modes.1.frequency_hz"] == "measured"
    assert any("no mode of Z is known" in note for note in measured.notes)


def test_a_mode_measured_on_a_rigid_axis_takes_that_back(started: Path) -> None:
    text = started.read_text(encoding="utf-8")
    rigid = update_modes(text, "x", [identified(47.0)], source="tap", rigid="y").text
    back = update_modes(rigid, "y", [identified(130.0)], source="tap")
    assert (back.machine.axes.y.rigid, len(back.machine.axes.y.modes)) == (False, 1)
    assert "axes.y.rigid" not in {value.key for value in back.machine.values() if value.unmeasured}
    z = update_modes(text, "z", [identified(60.0)], source="tap", keep_modes="xy")
    assert "axes.z.rigid" not in {value.key for value in z.machine.values() if value.unmeasured}
    with pytest.raises(sg.ArgumentError, match="cannot be rigid"):
        update_modes(text, "x", [identified(47.0)], source="tap", rigid="x", keep_modes="y")


@pytest.mark.parametrize("name", sg.Machine.builtin_names())
@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_rigid_changes_nothing_else(name: str, end: str) -> None:
    text = sg.Machine.builtin_text(name).replace("\n", end)
    update = update_modes(text, "x", [identified(47.0)], source="tap", rigid="yz")
    plain = update_modes(text, "x", [identified(47.0)], source="tap")
    wanted, found = tomllib.loads(plain.text), tomllib.loads(update.text)
    said, here = (each.pop("origin")["axes"] for each in (wanted, found))
    assert here["x"] == said["x"]
    assert [here[axis]["rigid"] for axis in "yz"] == ["stated: decided: it has no significant mode"] * 2
    for axis in "yz":
        wanted["axes"][axis].pop("modes", None)
        wanted["axes"][axis]["rigid"] = True
    assert found == wanted
    assert set(re.findall(r"\r?\n", update.text)) == {end}


def test_identify_asks_or_fails(
    started: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    record = tmp_path / "stop.csv"
    t = np.arange(0, 2.0, 1 / 2048)
    ring = np.exp(-0.02 * 2 * np.pi * 46 * t) * np.sin(2 * np.pi * 46 * t)
    noise = np.random.default_rng(1).normal(0, 1e-3, len(t))
    lines = ["time [s],acceleration [m/s^2]", *(f"{a:.9f},{b:.9f}" for a, b in zip(t, ring + noise, strict=True))]
    record.write_text("\n".join(lines), encoding="utf-8")
    argv = ["identify", str(record), "--decay", "--axis", "x", "--update", str(started)]
    before = started.read_bytes()
    assert main(argv) == 2
    assert "--rigid Y" in capsys.readouterr().err
    assert started.read_bytes() == before
    assert main([*argv, "--rigid", "Y"]) in (0, 1)
    assert sg.Machine.load(started).axes.y.rigid
    started.write_bytes(before)
    without_terminal(monkeypatch, "k\n")
    assert main(argv) in (0, 1)
    assert len(sg.Machine.load(started).axes.y.modes) == 1


PART = "%\nO0001\nG21G90G17\nG0X0Y0\nG1X50.F6000\nG3X65.Y15.J15.\nG1Y40.\nM30\n%\n"
CIRCLE = "%\nO0001\nG21G90G17\nG0X-60.Y50.\nG1X0F4000\nG2J-50.\nG1X60.\nM30\n%\n"


def unmeasured_machine(keys: dict[str, Any], remarks: dict[str, str]) -> sg.Machine:
    """The built-in machine with other values, and all of them measured but for those with another remark."""
    machine = machine_with(keys)
    return machine.with_remarks({value.key: "measured" for value in machine.values()} | remarks)


def replayed(judged: Judged, modes: list[list[Mode]], filter_ms: int) -> tuple[float, float, float, float]:
    """Contour error of the table and residuals X, Y, Z, µm: the worst region, as somebody else simulates the text."""
    worst = np.zeros(4)
    tick = judged.machine.controller.interpolation_period_s
    for programmed, blocks, _ in judged.regions():
        cuts = [move for move in blocks if move.length > 0.0]
        points = play(cuts, period_s=tick, block_end="ceil", acceleration_samples=filter_ms)
        points = points + np.round(starts(programmed)[0] - points[0], 2)
        _, _, moved = response(points, modes, tick)
        over = (len(moved) - 1) // (len(points) - 1)
        contour = contour_error_um(moved[::over], programmed)[0]
        worst = np.maximum(worst, [contour, *residual_um(points, modes, tick, still_mm=1e-9)])
    return tuple(worst)


def test_verdict_rests_on_a_filter_that_nobody_measured() -> None:
    """1622 unknown: 24 ms of it would take the circle inwards, by what a second simulation finds."""
    judged = convert(CIRCLE, unmeasured_machine({}, {"controller.shaped_time_constant_s": "assumed"}))
    rows = [row for row in judged.conversion.parameter_sensitivity if row.key == "controller.shaped_time_constant_s"]
    (row,) = rows
    assert (row.origin, row.value, row.tested_value) == ("assumed", "0.0 s", "0.024 s")
    assert row.figure == "contour error of the machine table"
    before, after = (replayed(judged, judged.modes, ms)[0] for ms in (0, 24))
    assert row.figure_um == pytest.approx(before, rel=0.05, abs=0.1)
    assert row.tested_um == pytest.approx(after, rel=0.05)
    assert row.tested_um > row.figure_um + 1.0


def test_verdict_rests_on_a_mode_of_another_machine() -> None:
    """An inherited frequency is moved both ways by 5 %, or by what is stated; the worse way counts."""
    inherited = {"axes.x.modes.1.frequency_hz": "from VX500: measured"}
    for stated, percent in ((None, 5.0), (2.0, 2.0)):
        keys = {"axes.x.modes.1.frequency_uncertainty_percent": stated, "verdict.mode_uncertainty": False}
        judged = convert(PART, unmeasured_machine(keys, inherited))
        (row,) = judged.conversion.parameter_sensitivity
        assert (row.key, row.origin, row.tested_value[1:]) == (*list(inherited), "inherited", f"{percent:g} %")
        x, y, z = judged.modes
        left = []
        for sign in (-1.0, 1.0):
            moved = [replace(m, frequency_hz=m.frequency_hz * (1.0 + sign * percent / 100.0)) for m in x]
            left.append(replayed(judged, [moved, y, z], 0))
        figures = ["contour error of the machine table", *(f"residual vibration {axis}" for axis in "XYZ")]
        place = figures.index(row.figure)
        assert row.tested_um == pytest.approx(max(each[place] for each in left), rel=0.05, abs=0.02)
        assert row.figure_um == pytest.approx(replayed(judged, judged.modes, 0)[place], rel=0.05, abs=0.02)
        assert row.tested_um > 1.2 * row.figure_um


def test_what_is_measured_is_nothing_to_rest_on() -> None:
    judged = convert(PART, unmeasured_machine({}, {}))
    assert (judged.conversion.parameter_sensitivity, judged.conversion.unverified_parameters_tested) == ((), 0)
    assert not any("rests on" in str(table.title) for table in judged.conversion.tables())


def test_verdict_ends_with_what_it_rests_on(started: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    part, report = tmp_path / "part.nc", tmp_path / "r.json"
    part.write_text(PART, encoding="ascii")
    out = str(tmp_path / "out.nc")
    main(["convert", str(part), "-m", str(started), "-o", out, "--shape-all", "--json", str(report)])
    shown = capsys.readouterr().out
    rows = json.loads(report.read_text(encoding="utf-8"))["parameter_sensitivity"]
    keys = [row["key"] for row in rows]
    assert "axes.x.modes.1.frequency_hz" in keys
    assert "axes.z.modes" not in keys  # Z stands still
    moves = [(row["tested_um"] - row["figure_um"]) / row["limit_um"] for row in rows]
    assert moves == sorted(moves, reverse=True)
    assert min(moves) >= 0.01
    assert all(row["tested_um"] >= row["figure_um"] for row in rows)
    assert len(keys) == len(set(keys)) <= 8
    assert shown.index("sensitivity to unverified parameters") > shown.index("operating conditions:")


def test_an_axis_of_which_nobody_knows_is_tried_with_a_mode() -> None:
    keys = {"axes.y.modes": [], "axes.z.modes": []}
    (row,) = convert(PART, unmeasured_machine(keys, {})).conversion.parameter_sensitivity
    assert (row.key, row.value, row.tested_value) == ("axes.y.modes", "none", "a mode of 40 Hz")
    assert convert(PART, unmeasured_machine(keys | {"axes.y.rigid": True}, {})).conversion.parameter_sensitivity == ()


def test_an_axis_that_moves_elsewhere_is_named_too() -> None:
    """Z moves in a region that does not decide."""
    text = PART.replace("M30", "G0Z1.\nM8\nG1Z0.5F50.\nM30")
    keys = {"input.tool_change_unknown_axes": "XYZ", "axes.z.modes": []}
    conversion = convert(text, unmeasured_machine(keys, {})).conversion
    assert [row.key for row in conversion.parameter_sensitivity] == ["axes.z.modes"]


def test_what_it_rests_on_costs_no_more_than_the_verdict(monkeypatch: pytest.MonkeyPatch) -> None:
    """Motion simulated with its contour for unmeasured values: no more than twice the program, or a minute."""
    simulated: list[float] = []
    whole = _Region.simulate

    def counted(region: _Region, trial: Any, *, contour: bool) -> Any:
        figures = whole(region, trial, contour=contour)
        simulated.append(figures.time_s if contour else 0.0)
        return figures

    monkeypatch.setattr(_Region, "simulate", counted)
    text = PART.replace("F6000", "F60")  # some two minutes in one region
    machine = machine_with({}).with_remarks({value.key: "assumed" for value in machine_with({}).values()})
    conversion = convert(text, machine, shape_all=True).conversion
    assert conversion.cutting_time_s.emitted > 90.0
    assert len(simulated) >= 8
    assert 0.0 < sum(simulated) <= 2.01 * conversion.cutting_time_s.emitted


@pytest.mark.parametrize("twice", ["beside it", "another spelling"])
def test_one_value_has_one_origin(twice: str) -> None:
    text = sg.Machine.load("vx500").to_toml()
    if twice == "beside it":
        text = re.sub(
            r"max_feed_mm_per_min = (\S+)", r'max_feed_mm_per_min = { value = \1, origin = "measured" }', text, count=1
        )
    else:
        text += '"axes.x.max_feed_mm_per_min" = "measured"\n'
    with pytest.raises(sg.MachineError, match=r"origin\.axes\.x\.max_feed_mm_per_min = .*this value has two"):
        sg.Machine.from_toml(text)


@pytest.mark.parametrize(
    ("text", "plain"),
    [
        ('a.b = { value = 1, origin = "measured" }\n', "a.b = 1\n"),  # no heading at all
        ('[a]\nb = 1\n[origin]\na.b = "measured"\n', "[a]\nb = 1\n"),
        ('[origin]\na.b = "measured"\n[a]\nb = 1  # stays\n', "[a]\nb = 1  # stays\n"),
        ('a = """\n[origin]\n"""\nb = { value = 1, origin = "measured" }\n', 'a = """\n[origin]\n"""\nb = 1\n'),
        ("a = 1\n", "a = 1\n"),
    ],
)
def test_origins_are_taken_out_wherever_they_stand(text: str, plain: str) -> None:
    assert without_origins(text) == plain
