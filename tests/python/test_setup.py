"""The guided start: answers become a short machine file; a dialogue asks again; no other machine is taken."""

import json
import os
import pty
import re
import select
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from prompt_toolkit.application import create_app_session
from prompt_toolkit.input import create_pipe_input
from prompt_toolkit.output import DummyOutput

import shapegcode as sg
from command import run
from faults import ANSWERS
from shapegcode.machine.programs import ANY_PRICE
from shapegcode.results.json import schema
from shapegcode.settings.describe import toml_schema
from shapegcode.setup.ask import ask_all

PART = "%\nO0001\nG90 G21 G17 G54\nG0 X0 Y0 Z5.\nG1 Z0. F3000.\nX30. Y40.\nX60. Y0.\nG0 Z5.\nM30\n%\n"
ROOT = Path(__file__).resolve().parents[2]


def answered(folder: Path, text: str = ANSWERS, name: str = "a.toml", code: int = 0) -> str:
    (folder / name).write_text(text)
    done = run(folder, "setup", "--answers", name, "-o", "m.toml", "--json", "r.json")
    assert done.returncode == code, done.stderr
    return done.stdout if code == 0 else done.stderr


def test_answers_become_a_short_file_that_says_why(tmp_path: Path) -> None:
    said = answered(tmp_path)
    text = (tmp_path / "m.toml").read_text()
    assert len(text.partition("[origin]")[0].splitlines()) < 45
    data = tomllib.loads(text)
    assert data["axes"]["z"]["rapid_mm_per_min"] == 18000.0
    assert data["axes"]["x"]["modes"] == [{"frequency_hz": 46.0, "damping_ratio": 0.02}]
    assert data["controller"] == {"dnc_baud": 9600}
    assert data["emission"] == {"prologue": ["G05.1 Q0"], "epilogue": ["G05.1 Q1"]}
    machine = sg.Machine.load(tmp_path / "m.toml")
    assert machine.axes.z.rigid and not machine.axes.y.modes and not machine.axes.y.rigid
    origins = {value.key: value.origin for value in machine.values()}
    assert origins["axes.x.rapid_mm_per_min"] == "file"
    assert origins["axes.x.max_acceleration_mm_s2"] == "assumed"
    assert "vibration of Y is not known" in said.splitlines()[0]
    report = json.loads((tmp_path / "r.json").read_text())
    jsonschema.validate(report, schema(sg.MachineSetup))
    assert report["open"][0]["key"] == "axes.y.modes"
    assert "axes.x.modes.1.damping_ratio" in report["answered"]


def test_a_name_is_an_answer(tmp_path: Path) -> None:
    said = answered(tmp_path, 'name = "A"\n')
    assert json.loads((tmp_path / "r.json").read_text())["answered"] == ["name"]
    assert "1 value answered" in said.splitlines()[0]


def test_the_short_file_converts_like_the_full_one(tmp_path: Path) -> None:
    """The same values whatever is written down: the emitted program is the same, byte for byte."""
    answered(tmp_path)
    (tmp_path / "full.toml").write_text(sg.Machine.load(tmp_path / "m.toml").to_toml())
    (tmp_path / "part.nc").write_text(PART)
    for name in ("m", "full"):
        done = run(tmp_path, "convert", "part.nc", "-m", f"{name}.toml", "-o", f"{name}.nc")
        assert done.returncode == 0, done.stdout
    assert (tmp_path / "m.nc").read_bytes() == (tmp_path / "full.nc").read_bytes()
    same = run(tmp_path, "machine", "diff", "m.toml", "full.toml")
    assert same.returncode == 0 and "values are the same" in same.stdout.splitlines()[0]


@pytest.mark.parametrize("name", sg.Machine.builtin_names())
def test_init_writes_the_short_form_of_the_same_machine(name: str, tmp_path: Path) -> None:
    for words in ([], ["--full"]):
        assert run(tmp_path, "machine", "init", name, "-o", f"m{len(words)}.toml", *words).returncode == 0
    short, full = (sg.Machine.load(tmp_path / f"m{count}.toml") for count in (0, 1))
    assert short == full
    texts = [(tmp_path / f"m{count}.toml").read_text().partition("[origin]") for count in (0, 1)]
    lines = [len(text.splitlines()) for text, _, _ in texts]
    assert len(texts[0][2]) < len(texts[1][2])
    assert lines[0] < lines[1] / 4
    ours, theirs = ({value.key: value for value in each.values()} for each in (short, full))
    for key, value in ours.items():
        assert value.unmeasured == theirs[key].unmeasured, key


def test_a_dump_and_a_tap_test_are_read(tmp_path: Path) -> None:
    dump = ROOT / "tests" / "golden" / "parameters" / "with_q.txt"
    (tmp_path / "taps").mkdir()
    (tmp_path / "taps" / "CNC-PARA.TXT").write_bytes(dump.read_bytes())
    time = [index / 2000.0 for index in range(3000)]
    from math import exp, pi, sin

    rows = "\n".join(f"{t:.6f},{exp(-0.02 * 2 * pi * 40 * t) * sin(2 * pi * 40 * t):.8f}" for t in time)
    (tmp_path / "taps" / "x.csv").write_text("time s,acceleration x m/s^2\n" + rows + "\n")
    text = 'name = "HM"\ndump = "taps/CNC-PARA.TXT"\nmodes = { x = "taps/x.csv", y = "rigid", z = "rigid" }\n'
    said = answered(tmp_path, text)
    assert "parameters read from" in said
    machine = sg.Machine.load(tmp_path / "m.toml")
    assert machine.name == "HM"
    assert machine.axes.x.modes[0].frequency_hz == pytest.approx(40.0, rel=0.005)
    assert machine.axes.x.modes[0].damping_ratio == pytest.approx(0.02, rel=0.05)
    assert {value.origin for value in machine.values() if value.key == "axes.x.modes.1.frequency_hz"} == {"measured"}
    imported = json.loads((tmp_path / "r.json").read_text())["imported"]
    assert "axes.x.rapid_mm_per_min" in imported


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('name = "Fräse"\nrapid_mm_per_min = 9000\n', "plain ASCII"),
        ('name = "A"\nrapid_mm_per_min = -1\n', "rapid_mm_per_min"),
        ('name = "A"\nrapid_mm_per_min = 9000\nspindle = 3\n', "spindle"),
        ('name = "A"\nrapid_mm_per_min = 9000\ndelivery = "pigeon"\n', "delivery"),
        ('name = "A"\nrapid_mm_per_min = 9000\ndnc_baud = 9600\n', 'delivery is not "dnc"'),
        ('name = "A"\nrapid_mm_per_min = 9000\nmodes = { x = "none.csv" }\n', "none.csv"),
        ('name = "A"\nrapid_mm_per_min = 9000\nmodes = { x = "5000:3" }\n', "a.toml:3: modes.x"),
        ('name = "A"\nrapid_mm_per_min = 24\n', "24.0: must be 100 to 500000 (unit: mm/min; 24 m/min are 24000)"),
        ('name = "A"\ndump = "none.txt"\n', 'a.toml:2: dump = "none.txt": no such file'),
        ('name = "A\n', "a.toml:1:"),
    ],
)  # fmt: skip
def test_bad_answers_are_refused_and_nothing_is_written(text: str, said: str, tmp_path: Path) -> None:
    assert said in answered(tmp_path, text, code=2)
    assert not (tmp_path / "m.toml").exists()


def test_a_line_of_unknown_speed_is_a_warning(tmp_path: Path) -> None:
    """Nobody can say then whether blocks arrive in time; the speed of the line is left at its default."""
    assert "set controller.dnc_baud" in answered(tmp_path, 'delivery = "dnc"\n')
    assert "controller" not in tomllib.loads((tmp_path / "m.toml").read_text())


def test_an_existing_file_stays(tmp_path: Path) -> None:
    (tmp_path / "m.toml").write_text("mine")
    assert "--force overwrites it" in answered(tmp_path, code=2)
    assert (tmp_path / "m.toml").read_text() == "mine"
    alone = run(tmp_path, "setup", "-o", "n.toml")
    assert alone.returncode == 2 and "--answers FILE" in alone.stderr


DOWN, UP, ENTER = "\x1b[B", "\x1b[A", "\r"


@pytest.fixture
def typed() -> Iterator[Any]:
    """A terminal into which a test types."""
    with create_pipe_input() as pipe, create_app_session(input=pipe, output=DummyOutput()):
        yield pipe


def test_the_dialogue_asks_until_the_answers_do(typed: Any, capsys: pytest.CaptureFixture[str]) -> None:
    keys = [
        "VMC-3" + ENTER,  # name
        DOWN + ENTER,  # control: fanuc
        ENTER,  # no dump
        "fast" + ENTER + "\x7f" * 4 + "24" + ENTER,  # rapid: refused, and in mm/min as well
        " m/min" + ENTER,
        ENTER,  # feed: not known yet
        "4000, 4000, 3000" + ENTER,  # acceleration
        ENTER,  # increment: not known yet
        DOWN * 2 + ENTER,  # delivery: dnc
        "9600" + ENTER,
        DOWN * 2 + ENTER,  # look-ahead: G05.1
        "10" + ENTER,  # contour
        DOWN * 2 + ENTER + "46:3" + ENTER + "\x7f0.02" + ENTER,  # X: known; a damping ratio of 3 is refused
        DOWN * 3 + ENTER,  # Y: rigid
        ENTER,  # Z: not known yet
    ]
    typed.send_text("".join(keys))
    answers = ask_all()
    assert answers.rapid_mm_per_min is not None and answers.rapid_mm_per_min.as_tuple() == (24000.0,) * 3
    assert answers.max_feed_mm_per_min is None
    assert answers.max_acceleration_mm_s2.as_tuple() == (4000.0, 4000.0, 3000.0)
    assert (answers.delivery, answers.dnc_baud, answers.look_ahead) == ("dnc", 9600, "G05.1")
    assert answers.modes.model_dump() == {"x": "46:0.02", "y": "rigid", "z": "unknown"}
    said = capsys.readouterr().out
    assert "873 characters, or some 35 short blocks a second" in said
    assert "Until Z is tapped it is simulated as rigid" in said


def test_a_dump_that_lacks_the_rapids_has_them_asked(
    typed: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its feeds are read, and what neither it nor anybody says is assumed; a file that is no dump is asked again."""
    monkeypatch.chdir(tmp_path)
    Path("no.txt").write_text("hello\n")
    Path("p.txt").write_text("%\nN01430Q1A1P8000.0A2P6000.0A3P8000.0\n%\n")
    name = "no.txt" + ENTER + "\x7f" * 6 + "p.txt" + ENTER
    rest = ENTER * 6  # delivery, look-ahead, contour, modes
    typed.send_text("HM" + ENTER + ENTER + name + "20000" + ENTER + rest)
    answers = ask_all()
    assert answers.dump == "p.txt" and answers.rapid_mm_per_min is not None
    machine = sg.set_up(answers).text
    axis = tomllib.loads(machine)["axes"]["y"]
    assert (axis["rapid_mm_per_min"], axis["max_feed_mm_per_min"]) == (20000.0, 6000.0)
    assert re.search(r"max_acceleration_mm_s2 = .*# assumed", machine)
    alone = sg.set_up(sg.read_answers({"name": "HM", "dump": "p.txt"})).text
    assert tomllib.loads(alone)["axes"]["y"]["max_feed_mm_per_min"] == 6000.0
    assert len(re.findall(r"rapid_mm_per_min = 24000.0  # assumed", alone)) == 3


def test_back_and_another_answer(typed: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """`<` or the last choice goes to the question before, also over those that were left out; files are taken back."""
    monkeypatch.chdir(tmp_path)
    keys = [
        "<" + ENTER + "A" + ENTER,  # name: nothing lies before it
        DOWN * 2 + ENTER,  # control: another one, so that no dump is asked for
        "<" + ENTER + DOWN + ENTER,  # rapid: back to the control, which is a FANUC one
        "none.txt" + ENTER + "\x7f" * 8 + ENTER,  # dump: no such file, so none
        "<" + ENTER + ENTER,  # rapid: back to the dump, and on
        "9000" + ENTER + "<" + ENTER + ENTER,  # feed: back to the rapid, which is not known after all
        ENTER * 3,  # feed, acceleration, increment
        DOWN * 2 + ENTER + "<" + ENTER + DOWN + ENTER,  # delivery: a line, or rather the memory
        "64" + ENTER,
        UP + ENTER + "32" + ENTER + DOWN * 2 + ENTER,  # look-ahead: back to the memory, and G05.1
        ENTER,  # contour
        DOWN + ENTER + "<" + ENTER + DOWN * 3 + ENTER,  # X: tapped, back, rigid
        DOWN + ENTER + "none.csv" + ENTER + "\x7f" * 8 + ENTER,  # Y: tapped, no such file, not known yet
        UP + ENTER + DOWN * 2 + ENTER + "40" + ENTER,  # Z: back to Y, which is known
        DOWN * 2 + ENTER + "<" + ENTER + ENTER,  # Z: known, taken back, not known yet
    ]
    typed.send_text("".join(keys))
    assert ask_all().model_dump(exclude_unset=True) == {
        "name": "A",
        "control": "fanuc",
        "delivery": "memory",
        "program_memory_kb": 32.0,
        "look_ahead": "G05.1",
        "modes": {"x": "rigid", "y": "40"},
    }


def test_enter_at_every_question_claims_nothing(tmp_path: Path) -> None:
    """At a terminal: a machine file that every command reads, whose every value is assumed or a default."""
    shown = at_a_terminal(tmp_path, "setup", "-o", "m.toml")
    questions = shown.count("not known yet")
    assert questions >= 12, shown
    machine = sg.Machine.load(tmp_path / "m.toml")
    origins = {value.key: value.origin for value in machine.values()}
    assert {key for key, origin in origins.items() if origin not in ("assumed", "default")} == {"name", "description"}
    assert "answered" not in (tmp_path / "m.toml").read_text()
    assert not any(axis.modes or axis.rigid for axis in machine.axes.as_tuple())
    assert run(tmp_path, "machine", "show", "m.toml").returncode == 0
    (tmp_path / "part.nc").write_text(PART)
    assert run(tmp_path, "simulate", "part.nc", "-m", "m.toml").returncode == 0
    nothing = run(tmp_path, "convert", "part.nc", "-m", "m.toml", "-o", "o.nc")
    assert "no vibration mode" in nothing.stderr and "--tap-plan" in nothing.stderr
    mode = [f"axes.{axis}.modes=[{{frequency_hz=46, damping_ratio=0.02}}]" for axis in "xy"]
    done = run(tmp_path, "convert", "part.nc", "-m", "m.toml", "-o", "o.nc", "--set", mode[0], "--set", mode[1])
    assert done.returncode == 0, done.stderr


def at_a_terminal(folder: Path, *words: str) -> str:
    """A command at a pseudo-terminal; Enter is pressed wherever it waits for an answer. What was shown."""
    child, terminal = pty.fork()
    if child == 0:
        os.chdir(folder)
        os.environ |= {"TERM": "xterm", "PROMPT_TOOLKIT_NO_CPR": "1"}
        os.execv(sys.executable, [sys.executable, "-m", "shapegcode", *words])
    shown, pressed = "", 0
    while True:
        if not select.select([terminal], [], [], 0.3)[0]:  # it waits for an answer, or works
            assert pressed < 100, shown
            pressed += os.write(terminal, ENTER.encode()) if "?" in shown else 0
            continue
        try:
            shown += os.read(terminal, 65536).decode(errors="replace")
        except OSError:  # the command has ended, and with it the terminal
            break
    _, status = os.waitpid(child, 0)
    os.close(terminal)
    assert os.waitstatus_to_exitcode(status) == 0, shown
    return shown


def test_giving_up_writes_nothing(typed: Any) -> None:
    typed.send_text("VMC-3" + ENTER + "\x03")
    with pytest.raises(KeyboardInterrupt):
        ask_all()


def test_show_ranks_what_nobody_measured_on_a_program(tmp_path: Path) -> None:
    """The first line names the value that matters most; the order is that of the conversion's own ranking."""
    answered(tmp_path)
    (tmp_path / "part.nc").write_text(PART)
    plain = run(tmp_path, "machine", "show", "m.toml")
    assert re.match(r"VMC-3: \d+ of \d+ values are assumed or inherited", plain.stdout)
    assert "--for part.nc" in plain.stdout
    ranked = run(tmp_path, "machine", "show", "m.toml", "--for", "part.nc", "--json", "s.json")
    report = json.loads((tmp_path / "s.json").read_text())
    conversion = sg.convert(
        tmp_path / "part.nc", sg.Machine.load(tmp_path / "m.toml").with_values(ANY_PRICE), shape_all=True
    )
    assert [row["key"] for row in report["matters"]] == [row.key for row in conversion.parameter_sensitivity]
    assert f"most of all {conversion.parameter_sensitivity[0].key}" in ranked.stdout.splitlines()[0]
    assert len(ranked.stdout.splitlines()) <= 30
    whole = run(tmp_path, "machine", "show", "m.toml", "--for", "part.nc", "--verbose")
    assert "largest cutting feed of this axis" in whole.stdout and "largest cutting feed" not in ranked.stdout


def test_without_any_mode_the_axis_to_tap_first_is_named(tmp_path: Path) -> None:
    """Nothing can be shaped yet; a usual mode oscillates as it does in the simulation of a machine that has it."""
    answered(tmp_path, 'name = "A"\nrapid_mm_per_min = 24000\nmodes = { z = "rigid" }\n')
    (tmp_path / "part.nc").write_text(PART)
    done = run(tmp_path, "machine", "show", "m.toml", "--for", "part.nc", "--json", "s.json")
    assert done.returncode == 0, done.stderr
    rows = {row["key"]: row["effect"] for row in json.loads((tmp_path / "s.json").read_text())["matters"]}
    assert set(rows) == {"axes.x.modes", "axes.y.modes"}
    assert f"most of all {next(iter(rows))}" in done.stdout.splitlines()[0]
    assert "identify --tap-plan" in done.stdout
    mode = [{"frequency_hz": 40.0, "damping_ratio": 0.02}]
    shaking = sg.Machine.load(tmp_path / "m.toml").with_values({"axes.x.modes": mode, "axes.y.modes": mode})
    swing = sg.simulate(tmp_path / "part.nc", shaking).residual_vibration_um
    for axis in "xy":
        assert f"0.0 → {getattr(swing, axis):.1f}, limit 3.0 µm" in rows[f"axes.{axis}.modes"]
    convert = run(tmp_path, "convert", "part.nc", "-m", "m.toml", "-o", "o.nc")
    assert convert.returncode == 2 and "--tap-plan" in convert.stderr


def test_diff_names_what_differs(tmp_path: Path) -> None:
    answered(tmp_path)
    machine = sg.Machine.load(tmp_path / "m.toml").with_values({"controller.dnc_baud": 19200, "name": "OTHER"})
    (tmp_path / "n.toml").write_text(machine.to_toml(short=True))
    done = run(tmp_path, "machine", "diff", "m.toml", "n.toml", "--json", "d.json")
    assert done.returncode == 1
    rows = {row["key"]: row for row in json.loads((tmp_path / "d.json").read_text())["different"]}
    assert set(rows) == {"name", "controller.dnc_baud"}
    assert (rows["controller.dnc_baud"]["first"], rows["controller.dnc_baud"]["second"]) == ("9600", "19200")
    assert rows["controller.dnc_baud"]["unit"] == "baud"


MODELS: dict[str, tuple[Any, list[str]]] = {
    "machine": (sg.Machine, ["python/shapegcode/data/vx500.toml", "python/shapegcode/data/kimm004.toml"]),
    "tool": (sg.Tool, ["tests/golden/feed/pocket_tool.toml", "python/shapegcode/data/milling/paper001_tool.toml"]),
    "stock": (sg.Stock, ["tests/golden/feed/pocket_stock.toml", "python/shapegcode/data/milling/paper001_stock.toml"]),
}


@pytest.mark.parametrize("kind", MODELS)
def test_schemas_for_editors_take_real_files_and_refuse_wrong_ones(kind: str, tmp_path: Path) -> None:
    """As `jsonschema` reads them: every shipped file passes; a wrong key, a wrong kind, a wrong limit do not."""
    model, files = MODELS[kind]
    done = run(tmp_path, "machine", "schema", kind)
    found = json.loads(done.stdout)
    assert found == toml_schema(model, f"{kind} file of shapegcode", origins=kind == "machine")
    jsonschema.Draft202012Validator.check_schema(found)
    for file in files:
        data = tomllib.loads((ROOT / file).read_text())
        jsonschema.validate(data, found)
        with pytest.raises(jsonschema.ValidationError, match="unheard"):
            jsonschema.validate(data | {"unheard": 1}, found)
        table = next(iter(key for key, value in data.items() if isinstance(value, dict)))
        with pytest.raises(jsonschema.ValidationError, match=r"is not of type|is not valid under any"):
            jsonschema.validate(data | {table: "much"}, found)


def test_the_schema_takes_what_is_written_and_documented(tmp_path: Path) -> None:
    """The file of a dialogue, short and full forms, the first example of the manual; not a value beyond its limit."""
    answered(tmp_path)
    found = toml_schema(sg.Machine, "", origins=True)
    example = re.search(r"```toml\n(.*?)```", (ROOT / "docs" / "reference" / "machine.md").read_text(), re.DOTALL)
    sg.Machine.from_toml(example[1], "example")
    machine = sg.Machine.load(tmp_path / "m.toml")
    for text in ((tmp_path / "m.toml").read_text(), machine.to_toml(), example[1]):
        data = tomllib.loads(text)
        jsonschema.validate(data, found)
        limits = data["axes"]["x"]
        limits["rapid_mm_per_min"] = {"value": limits["rapid_mm_per_min"], "origin": "measured: stopwatch"}
        jsonschema.validate(data, found)
        for wrong in (0, {"value": 1e4, "origin": "guess"}, {"value": 1e4}):
            limits["rapid_mm_per_min"] = wrong
            with pytest.raises(jsonschema.ValidationError, match=r"exclusive|guess|valid under any|required"):
                jsonschema.validate(data, found)
        limits["rapid_mm_per_min"], data["origin"] = 1e4, {"axes.x.rapid_mm_per_min": "guess"}
        with pytest.raises(jsonschema.ValidationError):
            jsonschema.validate(data, found)


def test_the_schema_says_unit_and_parameter() -> None:
    axis = toml_schema(sg.Machine, "")["$defs"]["Axis"]["properties"]
    assert axis["rapid_mm_per_min"]["description"] == "rapid traverse (G00) [mm/min] (FANUC parameter 1420)"
    assert axis["rapid_mm_per_min"]["exclusiveMinimum"] == 0
