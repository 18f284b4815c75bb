"""Parameter dumps of the control: both grammars, which value counts, and how a bad dump is refused."""

import json
import math
import re
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from hypothesis import given, strategies as st

from effort import cpu_s
from shapegcode.cli import main
from shapegcode.errors import MachineError
from shapegcode.machine import Machine
from shapegcode.machine.control_import import import_parameters
from shapegcode.machine.fanuc_dump import ControlTables, read_table
from shapegcode.machine.result import ParameterImport
from shapegcode.results.json import schema

DUMPS = Path(__file__).resolve().parents[1] / "golden" / "parameters"


def test_dump_with_q_and_axes_in_another_order() -> None:
    machine = import_parameters(DUMPS / "with_q.txt").machine
    controller = machine.controller
    assert [axis.rapid_mm_per_min for axis in machine.axes.as_tuple()] == [20000, 18000, 15000]
    assert [axis.max_feed_mm_per_min for axis in machine.axes.as_tuple()] == [8000, 8000, 6000]
    assert [axis.max_acceleration_mm_s2 for axis in machine.axes.as_tuple()] == [900, 900, 700]
    assert (controller.motion, controller.law) == ("look_ahead", "jerk_limited")
    assert (controller.look_ahead_filter_time_constant_s, controller.bell_time_s) == (0.02, 0.04)
    assert controller.rapid_time_constant_s.as_tuple() == (0.15, 0.15, 0.16)
    assert controller.position_gain_per_s.as_tuple() == (30, 35, 40)
    assert controller.feed_forward_ratio.as_tuple() == (0.95, 0.9, 0)
    assert controller.centripetal_acceleration_mm_s2 == 1100
    assert (controller.calculator_decimal_point, controller.arc_radius_tolerance_mm) == (True, 0.02)
    assert (machine.power_on.motion, machine.power_on.distance, machine.power_on.plane) == ("G01", "G91", "G17")
    assert (controller.dnc_baud, controller.no_buffer_m_codes) == (19200, (46,))


def test_old_dump_with_bell_keeps_the_radial_error_of_the_manual() -> None:
    base = Machine.load("vx500")
    machine = import_parameters(DUMPS / "old.txt", base, keep_modes="x").machine
    controller = machine.controller
    assert controller.motion == "after_interpolation"
    variance = (controller.time_constant_s**2 + controller.bell_time_s**2) / 12
    assert math.isclose(variance / 2, 0.064**2 / 24)
    assert machine.axes.x.modes == base.axes.x.modes
    assert machine.axes.y.modes == ()
    assert controller.rapid_path == "non_linear"
    assert controller.centripetal_acceleration_mm_s2 == 500


CLAMPS = b"""%
N01420Q1A1P30000.0A2P30000.0A3P20000.0
N01422Q1P10000.0
N01430Q1A1P12000.0A2P10000.0A3P8000.0
N01432Q1A1P9000.0A2P15000.0A3P12000.0
N01604Q1P00000001
N01660Q1A1P3000.0A2P3000.0A3P2500.0
N01769Q1P24
%
"""


def test_shaped_cuts_run_with_the_look_ahead_off_and_keep_the_smallest_clamp() -> None:
    found = import_parameters(CLAMPS, source="d.txt")
    assert [axis.max_feed_mm_per_min for axis in found.machine.axes.as_tuple()] == [9000, 10000, 8000]
    assert found.machine.emission.prologue == ("G05.1Q0",)
    assert found.remarks["axes.z.max_feed_mm_per_min"] == "FANUC 1430, the smallest (1422: 10000, 1432: 12000)"


def test_what_no_key_comes_from_is_listed_and_an_open_axis_is_asked_for() -> None:
    dump = CLAMPS.replace(b"N01430Q1A1P12000.0", b"N01430Q1A1P9500.0").replace(
        b"N01432Q1A1P9000.0", b"N01432Q1A1P9900.0"
    )
    dump = dump.replace(b"%\nN01420", b"%\nN00020Q1P17\nN00103Q1P12\nN01020Q1A1P88A2P89A3P90\nN01420")
    dump = dump.replace(b"P24\n%", b"P24\nN09998Q1P0\nN09999Q1P0\n%")
    base = Machine.load("vx500")
    found = import_parameters(dump, base, keep_modes="x", rigid="z", source="d.txt")
    said = {row.parameter: (row.line, row.why) for row in found.missing if row.line}
    assert said["1432"][0] == 8 and "1422, 1430, 1432" in said["1432"][1]
    assert said["1020"][0] == 4 and "read" in said["1020"][1]
    assert said["103"][0] == 3 and said["103"][1].startswith("read")
    assert said[""] == (12, "2 parameters not known here and not read, such as 9998")
    listed = {row.parameter for row in (*found.read, *found.missing)}
    assert {str(row.parameter) for row in found.read} | {"20", "1020", "1604"} <= {str(each) for each in listed}
    assumed = sum(value.assumed and value.key.startswith("axes.z.drive") for value in found.machine.values())
    count = re.search(r" (\d+) assumed \(and (\d+) that were assumed in the machine of --from\)", found.answer)
    assert count and int(count[1]) == len(found.assumed) and int(count[2]) >= assumed
    assert found.next_step.startswith("tap Y, ")
    assert "tap" not in import_parameters(dump, base, keep_modes="xy", rigid="z", source="d.txt").next_step
    assert "assumed in the machine" not in import_parameters(dump, source="d.txt").answer


VALUES = st.tuples(*[st.integers(1, 9000)] * 3)


@given(VALUES, VALUES, VALUES, VALUES)
def test_all_grammars_say_the_same(
    rapid: tuple[int, ...], feed: tuple[int, ...], ramp: tuple[int, ...], gain: tuple[int, ...]
) -> None:
    parameters = {1420: rapid, 1430: feed, 1620: ramp, 1825: gain}
    base = Machine.load("vx500")

    def write(q: str, gap: str, end: str) -> bytes:
        lines = ["%"]
        for number, values in parameters.items():
            words = [f"{gap}A{k}{gap}P{gap}{value}" for k, value in enumerate(values, start=1)]
            lines.append(f"N{number:05d}{q}{''.join(words)}")
        return (end.join([*lines, "%"]) + end).encode()

    forms = [("Q1", "", "\n"), ("", "", "\r\n"), ("", " ", "\n\r\r"), ("Q1", "", " \n")]
    machines = [import_parameters(write(*form), base, source="CNC-PARA.TXT").machine for form in forms]
    assert machines.count(machines[0]) == len(forms)
    machine = machines[0]
    assert tuple(axis.rapid_mm_per_min for axis in machine.axes.as_tuple()) == rapid
    assert tuple(axis.max_feed_mm_per_min for axis in machine.axes.as_tuple()) == feed
    assert machine.controller.rapid_time_constant_s.as_tuple() == tuple(value / 1000 for value in ramp)
    assert machine.controller.position_gain_per_s.as_tuple() == pytest.approx(tuple(value / 100 for value in gain))


def test_inch_values_and_the_first_path() -> None:
    text = b"%\nN01420Q1A1I100.A2I200.A3M300.\nN01420Q1A1P1A2P1A3P1\n%\n"
    found = import_parameters(text, Machine.load("vx500"), source="d.txt")
    rapids = [axis.rapid_mm_per_min for axis in found.machine.axes.as_tuple()]
    assert rapids == pytest.approx([2540, 5080, 300])
    assert any(row.parameter == "1420" and row.line == 3 for row in found.missing)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "d.txt: no parameter record"),
        (b"G90 G01 X10\n", "d.txt: no parameter record"),
        (b"%\nN10 G01 X5.\n", "d.txt:2: "),
        (b"%\n\0\1", "d.txt:2: binary data"),
        (b"%\nN01420Q1A1P\n%", "d.txt:2: .*cut or not numeric"),
        (b"%\nN01420Q1A1Pfast\n%", "d.txt:2: .*cut or not numeric"),
        (b"%\nN01420Q1A1P1A1P2\n%", "d.txt:2: parameter 1420: A1 is given twice"),
        (b"%\nN01420Q1A1P0A2P1A3P1\n%", "d.txt:2: parameter 1420 A1 = 0: must be 0.001 to"),
        (b"%\nN01620Q1A1P-5A2P1A3P1\n%", "d.txt:2: parameter 1620 A1 = -5: must be 0 to 10000 .unit: ms"),
        (b"%\nN03401Q1P2\n%", "d.txt:2: parameter 3401 = 2: must be eight bits"),
        (b"%\nN01020Q1A1P88A2P90\n%", "d.txt:2: parameter 1020: no axis is named Y"),
    ],
)
def test_bad_dump(data: bytes, message: str) -> None:
    with pytest.raises(MachineError, match=message):
        import_parameters(data, Machine.load("vx500"), source="d.txt")


def test_limits_that_nobody_gives_are_asked_for() -> None:
    with pytest.raises(MachineError, match=r"axes\.x\.rapid_mm_per_min: not in the dump .*--from"):
        import_parameters(b"%\nN01622 A1 P 64 A2 P 64 A3 P 64\n%\n", source="d.txt")


def test_acceleration_of_a_control_without_1660_is_assumed_from_its_time_constant() -> None:
    dump = b"%\nN01420 A1 P 12000 A2 P 12000 A3 P 9000\nN01422 P 6000\nN01622 A1 P 50 A2 P 50 A3 P 50\n%\n"
    result = import_parameters(dump)
    # 6000 mm/min within 50 ms
    assert [axis.max_acceleration_mm_s2 for axis in result.machine.axes.as_tuple()] == [2000.0] * 3
    assert any(row.key == "axes.x.max_acceleration_mm_s2" for row in result.assumed)


def test_time_grows_with_the_length_of_a_dump() -> None:
    def dump(records: int) -> bytes:
        axes = "".join(f"A{k}P0" for k in range(1, 21))
        lines = "".join(f"N{n:05d}Q1{axes}\n" for n in range(10000, 10000 + records))
        return (DUMPS / "with_q.txt").read_bytes().removesuffix(b"%\n") + lines.encode() + b"%\n"

    small, large = dump(900), dump(9000)
    assert cpu_s(lambda: import_parameters(large), 1) < 30.0 * cpu_s(lambda: import_parameters(small))


def test_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output = tmp_path / "m.toml"
    argv = ["machine", "import", str(DUMPS / "with_q.txt"), "-o", str(output)]
    assert main([*argv, "--json", "-"]) == 0
    report = json.loads(capsys.readouterr().out)
    jsonschema.validate(report, schema(ParameterImport))
    rapid = [row for row in report["read"] if row["key"] == "axes.y.rapid_mm_per_min"]
    assert rapid == [
        {"parameter": 1420, "axis": "A3", "raw": "P18000.0", "line": 6, "key": rapid[0]["key"], "value": 18000.0}
    ]
    assert {"key": "controller.rapid_bell_time_s", "value": 0.04} in [
        {name: row[name] for name in ("key", "value")} for row in report["assumed"]
    ]
    assert Machine.load(output) == import_parameters(DUMPS / "with_q.txt").machine
    assert "FANUC 1420" in output.read_text(encoding="utf-8")
    before = output.read_bytes()
    assert main(argv) == 2
    assert "--force" in capsys.readouterr().err
    assert output.read_bytes() == before
    assert main([*argv, "--force"]) == 0
    said = capsys.readouterr().out
    assert len(said.splitlines()) <= 30 and "rapid_mm_per_min" in said
    assert f"identify TAP.csv --update {output}" in said.splitlines()[-1]
    assert main([*argv, "--force", "--verbose"]) == 0
    assert "line 6: 1420 A1 P20000.0" in capsys.readouterr().out
    assert main(["machine", "import", "--help"]) == 0
    assert "  shapegcode machine import" in capsys.readouterr().out


AHEAD = "N01660Q1A1P900.A2P900.A3P900.\nN01769Q1P24"  # 0.0831384 is 0.024 times the root of twelve


def taken(text: str, **options: Any) -> ParameterImport:
    """A dump with some records, on the built-in machine."""
    return import_parameters(f"%\n{text}\n%\n".encode(), Machine.load("vx500"), source="HM1_CNC-PARA.TXT", **options)


@pytest.mark.parametrize(
    ("text", "key", "value"),
    [
        # Filter that acts on shaped programs, too: 1610#0 linear, neither bit exponential.
        ("N01622Q1A1P100A2P100A3P100\nN01610Q1A1P00000001", "controller.shaped_time_constant_s", 0.1),
        ("N01622Q1A1P100A2P100A3P100\nN01610Q1A1P00000001", "controller.shaped_filter_shape", "linear"),
        ("N01622Q1A1P100A2P100A3P100\nN01610Q1A1P00000000", "controller.shaped_filter_shape", "exponential"),
        ("N01622Q1A1P40A2P50A3P60\nN01610Q1A1P00000001", "controller.shaped_time_constant_s", 0.06),
        # Look-ahead on when a program starts.
        ("N01604Q1P00000001", "emission.prologue", ("G05.1Q0",)),
        ("N01604Q1P00000001", "emission.epilogue", ("G05.1Q1",)),
        ("N01604Q1P00000001", "verdict.look_ahead", True),
        ("N01604Q1P00000000", "verdict.look_ahead", False),
        ("N01604Q1P00000000", "emission.prologue", ()),
        # A serial line only where the channel is one, at the speed of that channel.
        ("N00020Q1P0\nN00103Q1P12", "controller.dnc_baud", 19200),
        ("N00020Q1P1\nN00103Q1P12\nN00113Q1P11", "controller.dnc_baud", 9600),
        ("N00020Q1P4\nN00103Q1P12", "controller.dnc_baud", 0),
        ("N00020Q1P17\nN00103Q1P12", "controller.dnc_baud", 0),
        ("N00103Q1P12", "controller.dnc_baud", 0),
        # Increment systems.
        ("N01013Q1A1P00000000A2P00000000A3P00000000", "controller.least_increment_mm", 0.001),
        ("N01013Q1A1P00000010A2P00000010A3P00000010", "controller.least_increment_mm", 0.0001),
        ("N01013Q1A1P00000010A2P00000010A3P00000010", "controller.least_increment_inch", 0.00001),
        ("N01013Q1A1P00000001A2P00000001A3P00000001", "controller.least_increment_mm", 0.01),
        ("N01004 P 00000010", "controller.least_increment_mm", 0.0001),
        # Programs.
        ("N05400Q1P10000000", "input.scale_unit", 0.001),
        ("N05400Q1P00000000", "input.scale_unit", 0.00001),
        ("N05114Q1P0.2", "input.peck_clearance_mm", 0.2),
        ("N05114 P 200\nN05115 P 500", "input.peck_clearance_mm", 0.5),
        ("N05003Q1P00000001", "input.compensation_start_up", "B"),
        ("N05003Q1P00000000", "input.compensation_start_up", "A"),
        ("N03403Q1P00100000", "input.arc_without_centre", "alarm"),
        ("N03403Q1P00000000", "input.arc_without_centre", "line"),
        ("N06071Q1P6\nN06072Q1P0", "input.m_subprograms", {"6": 9001}),
        ("N06079Q1P199", "input.m_subprograms", {"199": 9009}),
        ("N06080Q1P200\nN06089Q1P201", "input.m_macros", {"200": 9020, "201": 9029}),
        ("N06050Q1P120\nN06059Q1P0", "input.g_macros", {"120": 9010}),
        ("N06001Q1P00100000", "input.tool_program", 9000),
        ("N00000Q1P00000100", "power_on.units", "G20"),
        ("N01220Q1A1M1.0A2M0.0A3M0.0\nN01221Q1A1M-10.5A2M2.0A3M0.25", "input.work_offsets", {"G54": (-9.5, 2.0, 0.25)}),
        ("N01222 A1 P -10500 A2 P 0 A3 P 0", "input.work_offsets", {"G55": (-10.5, 0.0, 0.0)}),
        # Filter of the look-ahead: linear, bell, exponential with the same second moment.
        (f"{AHEAD}\nN01602Q1P01000000", "controller.look_ahead_filter_time_constant_s", 0.024),
        (
            f"{AHEAD}\nN01602Q1P00000000",
            "controller.look_ahead_filter_time_constant_s",
            pytest.approx(0.0831384, rel=1e-5),
        ),
    ],
)
def test_a_parameter_and_its_key(text: str, key: str, value: object) -> None:
    found = taken(text).machine.model_dump()
    for part in key.split("."):
        found = found[part]
    assert found == value


@pytest.mark.parametrize(
    ("multiplier", "system", "width_um"),
    [
        (2, "00000000", 5000.0),
        (20, "00000000", 500.0),
        (1, "00000000", 10000.0),
        (102, "00000000", 10000.0),
        (20, "00000010", 50.0),
        (None, "00000000", 5000.0),
    ],
)
def test_in_position_width_counts_detection_units(multiplier: int | None, system: str, width_um: float) -> None:
    """A detection unit is a least increment over the command multiplier; 1820 = 20 is a multiplier of 10."""
    per_axis = {1013: system, 1826: 5000} | ({1820: multiplier} if multiplier else {})
    text = "\n".join(f"N{n:05d}Q1A1P{v}A2P{v}A3P{v}" for n, v in per_axis.items())
    assert taken(text).machine.controller.in_position_width_um.x == pytest.approx(width_um)


def test_bell_of_the_filter_on_shaped_programs_keeps_the_radial_error_of_the_manual() -> None:
    controller = taken("N01622Q1A1P64A2P64A3P64\nN01610Q1A1P00000010").machine.controller
    assert controller.shaped_filter_shape == "linear"
    variance = (controller.shaped_time_constant_s**2 + controller.shaped_bell_time_s**2) / 12
    assert math.isclose(variance / 2, 0.064**2 / 24)


def test_what_is_read_and_not_used_is_said() -> None:
    found = taken("N05003Q1P00000010\nN01732Q1P100\nN00103Q1P12\nN06080Q1P-5")
    said = {row.parameter: row.why for row in found.missing}
    assert "type C" in said["5003"]
    assert "without a key" in said["1732"]
    assert "0020" in said["103"]
    assert "not used" in said["6080"]


def test_the_machine_is_called_as_its_control() -> None:
    assert taken("N01420Q1A1P9000A2P9000A3P9000").machine.name == "HM1"
    found = taken("N01420Q1A1P9000A2P9000A3P9000", name="Halle 3")
    assert (found.machine.name, "VX500" in found.machine.description) == ("Halle 3", True)


TABLES = {
    "TOOLOFST.TXT": "%\nG10G90L10P1R185.676 \nG10G90L11P1R-0.010 \nG10G90L12P1R5.000 \nG10G90L13P1R0.000 \n"
    "G10G90L10P2R0.000\nG10G90L11P2R0.000\nG10G90L12P2R0.000\nG10G90L13P2R0.000\nM02 \n%\n",
    "EXT_WKZ.TXT": "%\nG90 \nG10L2P0X0.5Y0.0Z0.0B0.0 \nG10L2P1X-865.475Y-934.435Z-833.845B0.0\n"
    "G10L2P2X-0.5Y0.0Z0.0B0.0\nG10L20P12X1.0Y2.0Z3.0B0.0\nM02 \n%\n",
    "MACRO.TXT": "%\nG10L85P504(40B1940000000000)\nG10L85P505(FFFFFFFFFFFFFFFF)\nG10L85P100(4044000000000000)\n"
    "SETVN500[]\nM02 \n%\n",
}


def written(folder: Path, tables: dict[str, str]) -> list[Path]:
    """Tables as files."""
    for name, text in tables.items():
        (folder / name).write_text(text, encoding="ascii")
    return [folder / name for name in tables]


def test_tables_of_offsets_and_variables(tmp_path: Path) -> None:
    found = taken("N01420Q1A1P9000A2P9000A3P9000", tables=written(tmp_path, TABLES))
    read, controller = found.machine.input, found.machine.controller
    assert (read.tool_length_mm, read.tool_length_wear_mm) == ({"1": 185.676}, {"1": -0.01})
    assert (read.tool_radius_mm, read.tool_radius_wear_mm) == ({"1": 5.0}, {})
    assert controller.offset_memory == "C"
    assert read.work_offsets == {"G54": (-864.975, -934.435, -833.845), "G54.1P12": (1.5, 2.0, 3.0)}
    # 40B1940000000000 is the double 4500.0; all ones is a vacant variable.
    assert read.variables == {"504": 4500.0}
    assert any("#100" in row.why for row in found.missing)
    assert any("1 of 2 tool offsets are all zero" in row.why for row in found.missing)
    assert {row.key for row in found.tables_read} >= {"input.variables", "input.tool_length_mm", "input.work_offsets"}


@pytest.mark.parametrize(
    ("text", "key", "value"),
    [
        ("%\nG10P3R12500\n%", "tool_length_mm", {"3": 12.5}),
        ("%\nG10L10P3R100.\nG10L11P3R.1\n%", "tool_radius_mm", {"3": 100.0}),
        ("%\nG10L10P3R100.\nG10L11P3R.1\n%", "tool_length_wear_mm", {"3": 0.1}),
        ("%\n#500=[25283*65536+65536]/134217728\n#501=#0\n#502=-2.5\nM02\n%", "variables", {"500": None, "502": -2.5}),
    ],
)
def test_tables_of_older_series(tmp_path: Path, text: str, key: str, value: dict[str, float | None]) -> None:
    found = taken("N01420Q1A1P9000A2P9000A3P9000", tables=written(tmp_path, {"T.TXT": text}))
    read = getattr(found.machine.input, key)
    wanted = {number: (25283 * 65536 + 65536) / 134217728 if v is None else v for number, v in value.items()}
    assert read == pytest.approx(wanted)


@pytest.mark.parametrize(
    "line", ["G10L10P1R", "G10L2P9X1.", "G10L85P500(12)", "#500=__import__", "#500=1/0", "G10L10P1R1.R2.X"]
)
def test_bad_table_names_its_line(tmp_path: Path, line: str) -> None:
    (table,) = written(tmp_path, {"BAD.TXT": f"%\nG10L2P1X1.Y1.Z1.\n{line}\n%\n"})
    with pytest.raises(MachineError, match=r"BAD\.TXT:3"):
        taken("N01420Q1A1P9000A2P9000A3P9000", tables=[table])


def test_dump_of_which_nothing_is_read_fails(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output = tmp_path / "m.toml"
    (dump,) = written(tmp_path, {"D.TXT": "%\nN09999Q1P1\n%\n"})
    for more in (["--from", "vx500"], []):
        assert main(["machine", "import", str(dump), "-o", str(output), *more]) == 1
        assert "no parameter of motion or programs" in capsys.readouterr().out
        assert not output.exists()


def test_command_with_tables(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output = tmp_path / "m.toml"
    files = [str(DUMPS / "with_q.txt"), *map(str, written(tmp_path, TABLES))]
    assert main(["machine", "import", *reversed(files), "-o", str(output), "--name", "Mill 2"]) == 0
    machine = Machine.load(output)
    assert (machine.name, machine.input.variables) == ("Mill 2", {"504": 4500.0})
    assert "FANUC MACRO.TXT" in output.read_text(encoding="utf-8")
    capsys.readouterr()
    assert main(["machine", "import", *files[1:], "-o", str(output), "--force"]) == 2
    assert "parameter dump" in capsys.readouterr().err


@given(st.lists(st.sampled_from("G10L85P2XR#500=[](),.-+*/% \nAN4"), max_size=120))
def test_any_table_is_read_or_refused_with_its_line(characters: list[str]) -> None:
    tables = ControlTables()
    try:
        read_table("".join(["%\nG10L10P1R1.\n", *characters]).encode(), "T.TXT", tables)
    except MachineError as refused:
        assert re.match(r"T\.TXT:\d+: ", str(refused))
    else:
        assert 1 in tables.tools[10]
