"""Parameter dumps of the control: both grammars, which value counts, and how a bad dump is refused."""

from __future__ import annotations

import json
import math
from pathlib import Path

import jsonschema
import pytest
from hypothesis import given, strategies as st

from effort import cpu_s
from shapegcode.cli import main
from shapegcode.errors import MachineError
from shapegcode.machine import Machine
from shapegcode.machine.fanuc_import import import_parameters
from shapegcode.machine.result import ParameterImport
from shapegcode.results.json import schema

DUMPS = Path(__file__).resolve().parents[1] / "golden" / "parameters"


def test_dump_with_q_and_axes_in_another_order() -> None:
    machine = import_parameters(DUMPS / "with_q.txt").machine
    controller = machine.controller
    assert [axis.rapid_mm_per_min for axis in machine.axes.as_tuple()] == [20000, 18000, 15000]
    assert [axis.max_feed_mm_per_min for axis in machine.axes.as_tuple()] == [9000, 9000, 7000]
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
    machine = import_parameters(DUMPS / "old.txt", base).machine
    controller = machine.controller
    assert controller.motion == "after_interpolation"
    variance = (controller.time_constant_s**2 + controller.bell_time_s**2) / 12
    assert math.isclose(variance / 2, 0.064**2 / 24)
    assert machine.axes.x.modes == base.axes.x.modes
    assert controller.rapid_path == "non_linear"
    assert controller.centripetal_acceleration_mm_s2 == 500


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
        {"parameter": 1420, "axis": "A3", "raw": "P18000.0", "line": 5, "key": rapid[0]["key"], "value": 18000.0}
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
    assert main(["machine", "import", "--help"]) == 0
    assert "example: shapegcode machine import" in capsys.readouterr().out
