"""The machine file: what it accepts, how it refuses, and the commands that write and show it."""

import copy
import json
import math
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from command import run
from shapegcode.cli import main
from shapegcode.cli.runner import write_json
from shapegcode.errors import MachineError
from shapegcode.io.data_file import write_text
from shapegcode.machine import AxisMode, Machine
from shapegcode.machine.result import MachineDescription
from shapegcode.results.json import schema
from shapegcode.settings.keys import PerAxis

MINIMAL = """
name = "M"
[axes.x]
max_feed_mm_per_min = 5000
rapid_mm_per_min = 10000
max_acceleration_mm_s2 = 1000
[axes.y]
max_feed_mm_per_min = 5000
rapid_mm_per_min = 10000
max_acceleration_mm_s2 = 1000
[axes.z]
max_feed_mm_per_min = 5000
rapid_mm_per_min = 10000
max_acceleration_mm_s2 = 1000
"""


def problems(text: str) -> list[str]:
    """Messages of a bad file, without its name."""
    with pytest.raises(MachineError) as caught:
        Machine.from_toml(text, "m.toml")
    lines = str(caught.value).splitlines()
    assert len(lines) == len(caught.value.problems)
    assert all(line.startswith("m.toml:") for line in lines)
    return [line.removeprefix("m.toml:") for line in lines]


def test_minimal_file_gets_the_documented_defaults() -> None:
    machine = Machine.from_toml(MINIMAL)
    controller = machine.controller
    assert controller.interpolation_period_s == 0.001
    assert controller.in_position_s.as_tuple() == (0.025, 0.025, 0.12)
    assert controller.corner_speed_difference_mm_per_min == PerAxis(x=500, y=500, z=500)
    assert machine.axes.x.modes == ()
    assert machine.axes.x.max_jerk_mm_s3 is None
    assert machine.emission.block_period_s is None
    assert controller.after_interpolation_shape == "linear"
    assert controller.look_ahead_filter_time_constant_s == 0
    assert controller.contour_acceleration_mm_s2 is None
    assert controller.position_gain_per_s.as_tuple() == (30, 30, 30)
    assert controller.feed_forward_ratio.as_tuple() == (0, 0, 0)
    assert (controller.in_position, controller.in_position_width_um.as_tuple()) == ("measured", (20, 20, 20))
    assert (controller.offset_memory, controller.nesting_limit_subprogram) == ("C", 10)
    assert controller.max_program_steps == 4_000_000
    assert controller.no_buffer_m_codes == ()
    assert (machine.times.tool_change_s, machine.times.m_function_s) == (0, 0)


def test_one_number_or_one_per_axis() -> None:
    for text, values in (("0.2", (0.2, 0.2, 0.2)), ("{ x = 0.1, y = 0.2, z = 0.3 }", (0.1, 0.2, 0.3))):
        machine = Machine.from_toml(f"{MINIMAL}[controller]\nrapid_time_constant_s = {text}\n")
        assert machine.controller.rapid_time_constant_s.as_tuple() == values
        assert Machine.from_toml(machine.to_toml()) == machine


def test_zero_is_a_value_and_not_a_missing_one() -> None:
    machine = Machine.from_toml(
        MINIMAL
        + """
[[axes.x.modes]]
frequency_hz = 40
damping_ratio = 0
[controller]
time_constant_s = 0
in_position_s = 0
[tolerance]
residual_floor_um = 0
"""
    )
    assert machine.axes.x.modes == (AxisMode(frequency_hz=40, damping_ratio=0),)
    assert machine.controller.time_constant_s == 0
    assert machine.controller.in_position_s.as_tuple() == (0, 0, 0)
    assert machine.tolerance.residual_floor_um == 0


@pytest.mark.parametrize("kind", ["linuxcnc", "klipper", "grbl"])
def test_controls_without_increments_read_whole_units(kind: str) -> None:
    """X100 is 100 mm for LinuxCNC, Klipper and GRBL, and .1 mm for a FANUC control with 3401#0 = 0."""
    assert not Machine.from_toml(MINIMAL).controller.calculator_decimal_point
    own = MINIMAL + f'[controller]\nkind = "{kind}"\n'
    assert Machine.from_toml(own).controller.calculator_decimal_point
    assert Machine.from_toml(own).controller.program_memory_bytes == 4 * 10**9  # a disk
    (message,) = problems(own + "calculator_decimal_point = false\n")
    assert f'with kind = "{kind}" X10 is 10 mm or inch' in message
    assert Machine.from_toml(MINIMAL).with_values("controller.kind", kind).controller.calculator_decimal_point


def test_other_values_are_checked_as_those_of_a_file() -> None:
    machine = Machine.load("vx500")
    other = machine.with_values({"tolerance.contour_um": 5, "axes.x.modes.1.damping_ratio": 0.03, "name": "B"})
    assert (other.tolerance.contour_um, other.axes.x.modes[0].damping_ratio, other.name) == (5.0, 0.03, "B")
    assert machine == Machine.load("vx500")
    assert other.with_values({}) == other
    assert machine.with_values("tolerance.contour_um", 5).tolerance.contour_um == 5.0
    assert machine.with_values("axes.y.modes", machine.axes.x.modes).axes.y.modes == machine.axes.x.modes
    assert machine.with_values('input.work_offsets."G54.1P2"', [1, 2, 3]).input.work_offsets["G54.1P2"] == (1, 2, 3)
    with pytest.raises(MachineError) as caught:
        machine.with_values({"tolerance.contour_um": -5, "shaping.famly": "zvd"})
    assert str(caught.value).splitlines() == [
        'VX500: shaping.famly = "zvd": unknown key; did you mean family?',
        "VX500: tolerance.contour_um = -5: must be 0.001 or more (unit: µm)",
    ]
    with pytest.raises(MachineError, match=r"^here: name.x = 0.5: no such key$"):
        machine.with_values("name.x", 0.5, source="here")
    for axis, rank, there in (("x", 3, "is 1"), ("x", 0, "is 1"), ("x", -1, "is 1"), ("z", 1, "is none")):
        key = f"axes.{axis}.modes.{rank}.damping_ratio"
        said = rf"^here: {key} = 0.5: no such key: axes.{axis}.modes counts from 1, and there {there}$"
        with pytest.raises(MachineError, match=said):
            machine.with_values(key, 0.5, source="here")
    two = machine.with_values({"axes.z.modes": [{"frequency_hz": 50, "damping_ratio": 0.02}],
                               "axes.z.modes.1.damping_ratio": 0.1})  # fmt: skip
    assert two.axes.z.modes[0].damping_ratio == 0.1


def test_other_values_leave_the_defaults_what_they_are() -> None:
    machine = Machine.from_toml(MINIMAL)
    other = machine.with_values("controller.in_position_s.y", 0.5)
    assert other.controller.in_position_s.as_tuple() == (0.025, 0.5, 0.12)
    from_file = {value.key for value in other.values() if value.origin == "file"}
    assert from_file - {value.key for value in machine.values() if value.origin == "file"} == {
        "controller.in_position_s"
    }
    assert other.with_values("controller.in_position_s", None) == machine
    with pytest.raises(MachineError, match="rapid_mm_per_min: required, but missing"):
        machine.with_values("axes.x.rapid_mm_per_min", None)


def test_machine_never_changes_after_loading() -> None:
    machine = Machine.load("vx500")
    with pytest.raises(AttributeError, match="with_values"):
        machine.controller.block_time_s = 1  # type: ignore[misc]


def test_vx500_does_not_limit_the_path_of_paper_000() -> None:
    machine = Machine.load("vx500")
    feed_mm_s, radius_mm = 200, 20
    controller = machine.controller
    for axis in (machine.axes.x, machine.axes.y):
        assert axis.max_feed_mm_per_min > feed_mm_s * 60
        assert axis.max_acceleration_mm_s2 > feed_mm_s / controller.time_constant_s
    assert controller.centripetal_acceleration_mm_s2 > feed_mm_s**2 / radius_mm
    assert [mode.frequency_hz for mode in machine.axes.x.modes + machine.axes.y.modes] == [46, 131]
    assert machine.axes.z.modes == ()


@pytest.mark.parametrize("builtin", Machine.builtin_names())
def test_builtin_file_names_every_key_and_the_origin_of_every_machine_value(builtin: str) -> None:
    text = Machine.builtin_text(builtin)
    lines = text.splitlines()
    for value in Machine.load(builtin).values():
        name = value.key.rpartition(".")[2]
        if name in ("modes", "open"):  # lists of tables
            continue
        assert any(line.removeprefix("# ").startswith(f"{name} = ") for line in lines), name
    assert Machine.from_toml(text).to_toml().count("\n") == len(lines)
    section = ""
    for line in lines:
        if line.startswith("["):
            section = line
        is_value = " = " in line and not line.startswith("#")
        if is_value and section.startswith(("[axes", "[[axes", "[controller", "[power_on")):
            assert line.count("#") == 1 and any(w in line for w in ("assumed", "paper", "measured")), line


def test_kimm004_has_the_first_set_of_constants_of_paper_004() -> None:
    machine = Machine.load("kimm004")
    controller = machine.controller
    assert controller.motion == "after_interpolation"
    assert (controller.rapid_time_constant_s.as_tuple(), controller.rapid_bell_time_s) == ((0.15,) * 3, 0.03)
    assert controller.time_constant_s == 0.05
    assert controller.rapid_path == "linear"
    assert controller.in_position_s.as_tuple() == (0.025, 0.025, 0.12)
    assert {axis.rapid_mm_per_min for axis in machine.axes.as_tuple()} == {10_000.0}


def test_written_file_loads_back_to_an_equal_machine() -> None:
    odd = Machine.from_toml(
        MINIMAL
        + """
[[axes.y.modes]]
frequency_hz = 1e-3
damping_ratio = 0.123456789012345
frequency_uncertainty_percent = 12.5
[input]
work_offsets = { G54 = [1, -2.5, 1e20], "G54.1P48" = [0, 0, 1e-9] }
[emission]
prologue = ["G05.1 Q0", ""]
block_period_s = 0.007
""".replace('name = "M"', 'name = "a \\"b\\" \\\\ c"')
    )
    described = odd.model_copy(update={"description": 'two\nlines, "quoted", µ, \x7f'})
    for machine in (odd, described, Machine.load("vx500")):
        assert Machine.from_toml(machine.to_toml()) == machine


def test_remarks_stand_at_their_lines() -> None:
    machine = Machine.load("vx500")
    text = machine.to_toml({"axes.x.modes.1.frequency_hz": "tap test of 3 May", "axes.z.modes": "rigid"})
    assert "frequency_hz = 46.0  # tap test of 3 May\n" in text
    assert "# [[axes.z.modes]]  # rigid\n" in text
    with pytest.raises(KeyError, match=r"axes\.x\.modes\.2"):
        machine.to_toml({"axes.x.modes.2.frequency_hz": "there is no second mode"})


DATA = Machine.load("vx500").model_dump(mode="python")


@pytest.mark.parametrize(
    "key", [v.key for v in Machine.load("vx500").values() if v.value.replace(".", "").isdigit() and "." in v.value]
)
def test_no_number_may_be_nan_or_infinite(key: str) -> None:
    data = copy.deepcopy(DATA)
    *parents, last = key.split(".")
    table: Any = data
    for part in parents:
        table = table[int(part) - 1] if part.isdigit() else table[part]
    for number in (math.nan, math.inf, -math.inf):
        table[last] = number
        with pytest.raises(ValueError, match=rf"{last}(\.\w)?\n.*finite number"):
            Machine.model_validate(data)


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("max_feed_mm_per_min", "-5", "-5: must be 1 or more (unit: mm/min)"),
        ("max_feed_mm_per_min", "0", "0: must be 1 or more (unit: mm/min)"),
        # A conversion with it did not end.
        ("max_acceleration_mm_s2", "1e300", "1e+300: must be 1000000.0 or less (unit: mm/s²)"),
        ("max_feed_mm_per_min", "nan", "nan: must be a finite number (unit: mm/min)"),
        ("max_feed_mm_per_min", '"5000"', '"5000": must be a number (unit: mm/min)'),
        ("name", '"Fräse"', '"Fräse": malformed; short name, in plain ASCII for the header of programs'),
    ],
)
def test_message_has_file_line_key_value_and_limit(key: str, value: str, message: str) -> None:
    lines = MINIMAL.splitlines()
    line = next(rank for rank, text in enumerate(lines) if text.startswith(f"{key} = "))
    lines[line] = f"{key} = {value}"
    place = key if key == "name" else f"axes.x.{key}"
    assert f"{line + 1}: {place} = {message}" in problems("\n".join(lines))


def test_a_key_that_is_missing_and_one_that_is_unknown() -> None:
    assert " name: required, but missing" in problems(MINIMAL.replace('name = "M"', ""))
    found = problems(MINIMAL.replace("max_feed_mm_per_min", "max_feed", 1))
    assert " axes.x.max_feed_mm_per_min: required, but missing (unit: mm/min)" in found
    assert "4: axes.x.max_feed = 5000: unknown key; did you mean max_feed_mm_per_min?" in found


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("controller.law", "'fast'", ' = "fast": must be "constant_time" or "jerk_limited"'),
        ("controller.in_position_s", "-1", " = -1: must be 0 or more (unit: s)"),
        ("controller.in_position_s", "{x = 1, y = -1, z = 1}", ".y = -1: must be 0 or more (unit: s)"),
        ("controller.in_position_s", "{x = 1, y = 1}", ".z: required, but missing (unit: s)"),
        ("controller.rapid_time_constant_s", "11", " = 11: must be 10 or less (unit: s)"),
        ("controller.feed_forward_ratio", "{x = 0, y = 1.1, z = 0}", ".y = 1.1: must be 1 or less"),
        ("controller.position_gain_per_s", "0", " = 0: must be greater than 0 (unit: 1/s)"),
        (
            "controller.contour_acceleration_mm_s2",
            "{x = 1, y = 1, z = 0}",
            ".z = 0: must be greater than 0 (unit: mm/s²)",
        ),
        ("controller.no_buffer_m_codes", "[46, -1]", ".2 = -1: must be 0 or more"),
        ("controller.nesting_limit_subprogram", "0", " = 0: must be 1 or more (unit: levels)"),
        ("times.tool_change_s", "-1", " = -1: must be 0 or more (unit: s)"),
        ("controller.interpolation_period_s", "1", " = 1: must be 0.1 or less (unit: s)"),
        ("controller.program_memory_bytes", "1.5", " = 1.5: must be a whole number (unit: bytes)"),
        ("controller.calculator_decimal_point", "1", " = 1: must be true or false"),
        ("input.work_offsets", "{G60 = [1, 2, 3]}", ": G60 is not a work offset; names are G54 ... G59 and"),
        (
            "emission.block_period_s",
            "0.0125",
            " = 0.0125: must be a whole multiple of controller.interpolation_period_s",
        ),
        ("emission.block_period_s", "0.004", " = 0.004: must not be below controller.block_time_s = 0.005"),
        ("emission.prologue", '["%"]', ' = ["%"]: the line "%" has a character other than capital letters, digits'),
    ],
)
def test_bad_values(key: str, value: str, said: str) -> None:
    table, _, name = key.partition(".")
    found = problems(f"{MINIMAL}[{table}]\n{name} = {value}\n")
    assert any(problem.startswith(f"16: {key}{said}") for problem in found)


MODE = "[[axes.x.modes]]\nfrequency_hz = 46\ndamping_ratio = 0.1\n"


@pytest.mark.parametrize(
    ("tables", "message"),
    [
        ("[[axes.x.modes]]\nfrequency_hz = 46\ndamping_ratio = 1.0\n", "17: axes.x.modes.1.damping_ratio = 1.0: must"),
        (MODE + "[[axes.x.modes]]\nfrequency_hz = true\n", "19: axes.x.modes.2.frequency_hz = true: must be a number"),
        (f"[emission]\nprologue = ['{'X' * 61}']\n", "has 61 characters, emission.max_line_length is 60"),
        ('[emission]\nfailed_suffix = "/../x"\n', "failed_suffix"),
        ("[tolerances]\n", "15: tolerances = {}: unknown key; did you mean tolerance?"),
        ("[controller]\nbogus = 1\n", "bogus"),
        ("axes = 3\n", ""),
    ],
)
def test_bad_tables(tables: str, message: str) -> None:
    assert any(message in problem for problem in problems(MINIMAL + tables))


def test_every_problem_is_listed_once() -> None:
    found = problems("[axes.x]\nmax_feed_mm_per_min = -1\nrapid_mm_per_min = inf\n[nonsense]\n")
    assert len(found) == len(set(found))
    for part in ("name: req", "max_feed_mm_per_min = -1", "rapid_mm_per_min = inf", "axes.y: ", "axes.z: ", "nonsense"):
        assert sum(part in line for line in found) == 1, part


@pytest.mark.parametrize(
    ("text", "start"), [("a = 1\n\n[b\n", "3: "), ('name = """', "1: "), ("x = 1\nx = 2\n", "2: "), ("\ufeff", " ")]
)
def test_bad_toml_gives_the_line(text: str, start: str, tmp_path: Path) -> None:
    file = tmp_path / "bad.toml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(MachineError) as caught:
        Machine.load(file)
    assert str(caught.value).startswith(f"{file}:{start}")


def test_file_that_is_not_text(tmp_path: Path) -> None:
    file = tmp_path / "binary.toml"
    file.write_bytes(b'name = "x"\n\xff\xfe')
    with pytest.raises(MachineError, match=r"binary\.toml:2: not UTF-8"):
        Machine.load(file)


def test_unknown_name_lists_the_builtin_machines() -> None:
    with pytest.raises(MachineError, match="no such file and no built-in machine; built in: kimm004, vx500"):
        Machine.load("vx600")
    with pytest.raises(FileNotFoundError):
        Machine.load("vx600.toml")


UNITS = (
    "mm_per_min:mm/min mm_s2:mm/s² mm_s3:mm/s³ kg_m2:kg·m² kg:kg n_per_um:N/µm n_s_per_m:N·s/m n_m_s_per_rad:N·m·s/rad "
    "n_m:N·m nm:N·m w:W mm_per_s:mm/s hz:Hz um:µm percent:% deg:degrees bytes:bytes per_s:1/s s:s mm:mm inch:inch"
)


def test_every_key_has_a_meaning_and_every_dimensioned_key_a_unit_that_agrees_with_its_name() -> None:
    units = dict(pair.split(":") for pair in UNITS.split())
    for value in Machine.load("vx500").values():
        name = value.key.rpartition(".")[2]
        assert value.meaning, value.key
        suffix = next((end for end in units if name.endswith(f"_{end}")), None)
        if suffix is not None and not name.startswith("feed_decimals"):
            assert value.unit == units[suffix].replace("·", " "), value.key


def test_origin_tells_file_from_default() -> None:
    values = {v.key: v for v in Machine.from_toml(MINIMAL + "[controller]\nblock_time_s = 0.005\n").values()}
    assert values["controller.block_time_s"].origin == "file"
    assert not values["controller.block_time_s"].assumed
    assert values["controller.block_end"].origin == "default"
    assert values["controller.block_end"].assumed
    assert not values["controller.least_increment_mm"].assumed


# The command.


def test_init_writes_a_file_that_loads_and_never_overwrites(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["machine", "init"]) == 0
    assert Machine.load(tmp_path / "machine.toml") == Machine.load("vx500")
    (tmp_path / "machine.toml").write_text("mine")
    assert main(["machine", "init"]) == 2
    assert "--force" in capsys.readouterr().err
    assert (tmp_path / "machine.toml").read_text() == "mine"
    assert main(["machine", "init", "--force", "-q"]) == 0
    assert len(capsys.readouterr().out.splitlines()) == 1
    assert list(tmp_path.iterdir()) == [tmp_path / "machine.toml"]


def test_show_prints_values_units_and_origin(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "140")
    assert main(["machine", "show", "vx500"]) == 0
    out = capsys.readouterr().out
    for part in ("[axes.x.modes.1]", "46.0", "mm/min", "file", "natural frequency"):
        assert part in out


def test_show_json_is_alone_on_standard_output(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["machine", "show", "vx500", "--json", "-"]) == 0
    out = capsys.readouterr().out
    report = json.loads(out)
    jsonschema.validate(report, schema(MachineDescription))
    assert report["machine"]["axes"]["y"]["modes"][0]["frequency_hz"] == 131
    assert report["keys"]["controller.block_time_s"]["unit"] == "s"
    assert main(["machine", "show", "vx500", "--json", "-"]) == 0
    assert capsys.readouterr().out == out


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("show nothing.toml", "nothing.toml: no such file"),
        ("show no/such/machine.toml", "no/such/machine.toml: the folder no/such does not exist"),
        ("show vx600", "built in: kimm004, vx500"),
        ("show vx500 --json no/x.json", "no/x.json: the folder no does not exist"),
        ("init -o no/x.toml", "no/x.toml: the folder no does not exist"),
        ("init -o /dev/full --force", "/dev/full: No space left on device"),
    ],
)
def test_bad_input_is_one_line_and_exit_2(words: str, said: str, tmp_path: Path) -> None:
    done = run(tmp_path, "machine", *words.split())
    assert done.returncode == 2 and done.stderr.count("\n") == 1
    assert done.stderr.startswith("shapegcode: ") and said in done.stderr


def test_write_text_keeps_the_old_file_when_it_fails(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "program.nc"
    file.write_bytes(b"old")
    file.chmod(0o640)

    def full_disk(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr("shapegcode.io.data_file.os.fsync", full_disk)
        with pytest.raises(OSError, match=r"No space left on device: '.*program\.nc'"):
            write_text(file, "new")
    assert file.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [file]
    write_text(file, "new\r\n")
    assert file.read_bytes() == b"new\r\n"
    assert file.stat().st_mode & 0o777 == 0o640


def test_json_refuses_nan(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="JSON compliant"):
        write_json({"a": math.nan}, tmp_path / "x.json")
    assert not list(tmp_path.iterdir())


def test_known_keys_are_listed_with_the_first_unknown_one_of_a_table() -> None:
    first, second = problems(Machine.load("vx500").to_toml().replace("[verdict]", "[verdict]\nqqqq = 1\nzzzzz = 2 ", 1))
    assert "verdict.qqqq = 1: unknown key; known here: " in first
    assert second.endswith("verdict.zzzzz = 2: unknown key")
