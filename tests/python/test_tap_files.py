"""Records from files: dialects of CSV, universal files, WAV, and every way in which they may be wrong."""

import csv
import io
import struct
import wave
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyuff
from hypothesis import given, strategies as st
from scipy.io import wavfile

from shapegcode.errors import RecordError
from shapegcode.identification.identify import identify
from shapegcode.io.read import read_records
from shapegcode.io.record import ReadOptions, Record, UnevenTimeError, even_period
from shapegcode.io.servo_log import read_log
from shapegcode.io.units import FloatArray, find_unit, tap_label
from shapegcode.testcut.record import read_forces
from tap_truth import TrueMode, acceleration

COUNT = 24
PERIOD_S = 0.0005
RNG = np.random.default_rng(5)
FORCE = np.round(RNG.uniform(0.0, 500.0, COUNT), 3)
RESPONSE = np.round(RNG.uniform(-9.0, 9.0, COUNT), 4)


def rows(delimiter: str = ",", point: str = ".", *, scale: float = 1.0, end: str = "\n", columns: int = 3) -> str:
    """Time, force, response and more responses as text."""
    lines = []
    for k in range(COUNT):
        cells = [f"{k * PERIOD_S * scale:.4f}", f"{FORCE[k]:.3f}", *[f"{RESPONSE[k] * n:.4f}" for n in range(1, 9)]]
        lines.append(delimiter.join(cell.replace(".", point) for cell in cells[:columns]))
    return end.join(lines) + end


def read(tmp_path: Path, content: str | bytes, name: str = "tap.csv", **options: Any) -> list[Record]:
    path = tmp_path / name
    path.write_bytes(content.encode("utf-8") if isinstance(content, str) else content)
    return read_records(path, ReadOptions(**options))


def only(records: list[Record]) -> Record:
    assert len(records) == 1
    return records[0]


LABVIEW = """LabVIEW Measurement\t
Writer_Version\t2
Reader_Version\t2
Separator\tTab
Decimal_Separator\t.
Multi_Headings\tNo
X_Columns\tOne
Time_Pref\tRelative
***End_of_Header***\t
\t
Channels\t2\t
Samples\t24\t24\t
Date\t2026/11/21\t2026/11/21\t
Time\t10:55:01.25\t10:55:01.25\t
Y_Unit_Label\tN\tm/s^2\t
X_Dimension\tTime\tTime\t
X0\t0.0000000000000000E+0\t0.0000000000000000E+0\t
Delta_X\t0.000500\t0.000500\t
***End_of_Header***\t\t\t
X_Value\tHammer\tAccel\tComment
"""

DIALECTS = {
    "plain": "time_s,force_N,acc_m/s^2\n" + rows(),
    "windows": "time_s,force_N,acc_m/s^2\r\n" + rows(end="\r\n"),
    "old mac": "time_s,force_N,acc_m/s^2\r" + rows(end="\r"),
    "byte order mark": "\ufefftime [s], force [N], acc [m/s²]\n" + rows(", "),
    "german excel": "Zeit [s];Kraft [N];Beschleunigung [m/s²]\r\n" + rows(";", ",", end="\r\n"),
    "german excel, its code page": "Zeit [s];Kraft [N];Beschleunigung [m/s²]\r\n".encode("cp1252")
    + rows(";", ",", end="\r\n").encode(),
    "excel unicode text": "Zeit/s\tKraft/N\tBeschleunigung/(m/s²)\r\n".encode("utf-16")
    + rows("\t", ",", end="\r\n").encode("utf-16-le"),
    "quoted": '"Time (s)","Force (N)","Acceleration, m/s^2"\n'
    + "".join('"' + line.replace(",", '","') + '"\n' for line in rows().splitlines()),
    "semicolon and point": "t;f;a\ns;N;m/s²\n" + rows(";"),
    "trailing delimiter": "time_s;force_N;acc_m/s^2;\n" + rows(";").replace("\n", ";\n"),
    "blanks and comment": "# t_s  f_N  a_m/s2\n" + rows("   "),
    "tab and milliseconds": "Time\tHammer\tResponse\n(ms)\t(kN)\t(mm/s²)\n"
    + "".join(f"{1000 * k * PERIOD_S:.1f}\t{FORCE[k] / 1000:.6f}\t{RESPONSE[k] * 1000:.1f}\n" for k in range(COUNT)),
    "logger": "Logger 3000, serial 17\nChannel 1: hammer\n\nSampling rate: 2 kHz\nTime (s),Force (N),Accel (m/s^2)\n"
    + rows(),
    "labview": LABVIEW + rows("\t"),
    "units only": "s,N,m/s^2\n" + rows(),
    "text column": "date;time_s;force_N;acc_m/s^2\n"
    + "".join(f"21.11.2026 10:55;{line}\n" for line in rows(";").splitlines()),
    "comments between": "time_s,force_N,acc_m/s^2\n" + rows().replace("\n", "\n# still running\n\n", 3),
}


@pytest.mark.parametrize("name", DIALECTS)
def test_every_dialect_reads_the_same(name: str, tmp_path: Path) -> None:
    record = only(read(tmp_path, DIALECTS[name]))
    assert record.period_s == pytest.approx(PERIOD_S, rel=1e-9)
    np.testing.assert_allclose(record.force_n, FORCE, rtol=1e-12)
    np.testing.assert_allclose(record.response, RESPONSE, rtol=1e-12)
    assert record.quantity == "acceleration"
    assert not [text for text in record.warnings if "unit" in text]


def test_a_preamble_is_counted(tmp_path: Path) -> None:
    (note,) = only(read(tmp_path, DIALECTS["logger"])).notes
    assert note.endswith(".csv: 4 lines before the header in line 5 ignored")
    assert not only(read(tmp_path, DIALECTS["logger"])).warnings
    assert not only(read(tmp_path, DIALECTS["plain"])).notes


@pytest.mark.parametrize(
    ("text", "measures", "axis", "factor"),
    [
        ("time_ms", "time", None, 1e-3),
        ("Zeit in µs", "time", None, 1e-6),
        ("T [min]", "time", None, 60.0),
        ("Hammer force (lbf)", "force", None, 0.45359237 * 9.80665),
        ("F/kN", "force", None, 1000.0),
        ("Acc_X_g", "acceleration", "x", 9.80665),
        ("ay", "acceleration", "y", None),
        ("accel_z_m_s2", "acceleration", "z", 1.0),
        ("Response Y [mm/s²]", "acceleration", "y", 1e-3),
        ("Acc (X) [m/s/s]", "acceleration", "x", 1.0),
        ("a, m s^-2", "acceleration", None, 1.0),
        ("vel_mm/s", "velocity", None, 1e-3),
        ("Displacement (um)", "displacement", None, 1e-6),
        ("Weg in μm", "displacement", None, 1e-6),
        ("Channel 3 [N]", "force", None, 1.0),
        ("x", "response", "x", None),
        ("temperature", None, None, None),
    ],
)
def test_labels(text: str, measures: str | None, axis: str | None, factor: float | None) -> None:
    label = tap_label(text)
    assert (label.measures, label.axis) == (measures, axis)
    assert (label.unit.factor if label.unit else None) == (None if factor is None else pytest.approx(factor, rel=1e-12))


def test_unknown_units_stay_unknown() -> None:
    assert [find_unit(text) for text in ("V", "mN", "furlong", "", "m/s³", "Hz")] == [None] * 6
    assert tap_label("force [V]").unknown_unit == "V"


@pytest.mark.parametrize("unit", ["V", "mV", "pC", "lb", "daN", "counts", "%FS", "% FS"])
def test_a_unit_that_is_not_converted_is_no_part_of_a_name(unit: str, tmp_path: Path) -> None:
    for name in ("force", "acc_x", "Hammer"):
        for sign in ("_", " ", "/"):
            assert tap_label(f"{name}{sign}{unit}").unknown_unit == unit
    with pytest.raises(RecordError, match=rf"the unit '{unit}' is not known.*--force-scale, --response-scale"):
        read(tmp_path, f"time_s,force_{unit},acc_x_m/s^2\n" + rows())
    record = only(read(tmp_path, f"time_s,force_{unit},acc_x_m/s^2\n" + rows(), force_scale=2.0))
    np.testing.assert_array_equal(record.force_n, 2.0 * FORCE)
    assert not record.warnings


@pytest.mark.parametrize(("unit", "newton"), [("N", 1.0), ("kN", 1e3), ("kgf", 9.80665), ("lbf", 0.45359237 * 9.80665)])
@pytest.mark.parametrize("form", ["{}_{}", "{} [{}]", "{} ({})", "{}/{}"])
def test_a_unit_is_the_same_in_every_kind_of_file(tmp_path: Path, unit: str, newton: float, form: str) -> None:
    head = ",".join(["time_s", *(form.format(name, unit) for name in ("fx", "fy"))])
    (tmp_path / "cut.csv").write_text(f"{head}\n" + rows(), encoding="utf-8")
    cut = read_forces(tmp_path / "cut.csv", on="tool")
    np.testing.assert_allclose(cut.force_n[:, 0], FORCE * newton, rtol=1e-12)
    record = only(read(tmp_path, f"time_s,{form.format('force', unit)},acc_x_m/s^2\n" + rows()))
    np.testing.assert_allclose(record.force_n, FORCE * newton, rtol=1e-12)
    with pytest.raises(RecordError, match="the unit 'V' is not known; required: one of N, kN, kgf, lbf"):
        (tmp_path / "cut.csv").write_text(f"{head}\n".replace(unit, "V") + rows(), encoding="utf-8")
        read_forces(tmp_path / "cut.csv")


@pytest.mark.parametrize(("unit", "millimetre"), [("mm", 1.0), ("um", 1e-3), ("m", 1e3), ("inch", 25.4), ("in", 25.4)])
def test_ways_in_logs_forces_and_taps(tmp_path: Path, unit: str, millimetre: float) -> None:
    count = 120
    body = "".join(f"{k},{k / 8},0.5\n" for k in range(count))
    (tmp_path / "log.csv").write_text(f"time_ms,X_{unit},X_act_{unit}\n{body}", encoding="utf-8")
    (tmp_path / "cut.csv").write_text(f"position_{unit},fx_n,fy_n\n{body}", encoding="utf-8")
    np.testing.assert_allclose(read_log(tmp_path / "log.csv").command_mm[:, 0], np.arange(count) / 8 * millimetre)
    np.testing.assert_allclose(read_forces(tmp_path / "cut.csv").position_mm, np.arange(count) * millimetre)
    record = only(read(tmp_path, f"time_ms,disp_{unit},constant\n" + body))
    np.testing.assert_allclose(record.response, np.arange(count) / 8 * millimetre * 1e-3)


def test_names_that_look_like_units_stay_names(tmp_path: Path) -> None:
    for name in ("x_v", "acc_a", "force_in", "force hammer", "acc 2", "sensor a", "acc_x", "v"):
        assert not tap_label(name).unknown_unit
    assert tap_label("x_v").measures == "velocity"
    assert (tap_label("x_V").measures, tap_label("x_V").unknown_unit) == ("response", "V")
    assert only(read(tmp_path, "time_s,force_N,acc_x_m/s^2\n" + rows())).axis == "x"


def test_without_units_si_is_taken_and_said(tmp_path: Path) -> None:
    record = only(read(tmp_path, "t,f,a\n" + rows()))
    np.testing.assert_array_equal(record.response, RESPONSE)
    text = " / ".join(record.warnings)
    assert "'f' has no unit: N is assumed" in text
    assert "'a' has no unit: m/s² is assumed" in text
    assert "time has no unit: s is assumed, 2000 samples per second" in text


def test_one_record_per_axis(tmp_path: Path) -> None:
    content = "t_s,f_N,ax_g,ay_g,az_g\n" + rows(columns=5)
    records = read(tmp_path, content)
    assert [record.axis for record in records] == ["x", "y", "z"]
    for n, record in enumerate(records, start=1):
        np.testing.assert_allclose(record.response, np.round(RESPONSE * n, 4) * 9.80665, rtol=1e-12)
        assert record.force_n is not None
    chosen = only(read(tmp_path, content, axis="y"))
    np.testing.assert_array_equal(chosen.response, records[1].response)
    named = only(read(tmp_path, content, response_columns=("AZ_G",)))
    np.testing.assert_array_equal(named.response, records[2].response)
    numbered = only(read(tmp_path, content, response_columns=("4",)))
    np.testing.assert_array_equal(numbered.response, records[1].response)


def test_columns_by_number_need_no_header(tmp_path: Path) -> None:
    options = {"time_column": "1", "force_column": "2", "response_columns": ("3",), "axis": "z"}
    record = only(read(tmp_path, rows(";", ","), **options))
    np.testing.assert_array_equal(record.response, RESPONSE)
    assert record.axis == "z"


def test_options_over_the_header(tmp_path: Path) -> None:
    content = "time,f [V],a [V]\n" + rows(scale=1000.0)
    options = {"time_unit": "ms", "force_scale": 22.4, "response_scale": -98.0, "quantity": "velocity"}
    record = only(read(tmp_path, content, **options))
    assert record.period_s == pytest.approx(PERIOD_S, rel=1e-9)
    np.testing.assert_allclose(record.force_n, FORCE * 22.4, rtol=1e-12)
    np.testing.assert_allclose(record.response, RESPONSE * -98.0, rtol=1e-12)
    assert record.quantity == "velocity"
    free = only(read(tmp_path, "t_s,f_N,x\n" + rows(), response_unit="µm", ignore_force=True))
    assert free.force_n is None
    assert free.quantity == "displacement"
    np.testing.assert_allclose(free.response, RESPONSE * 1e-6, rtol=1e-12)


def test_a_period_stands_for_the_time(tmp_path: Path) -> None:
    alone = "".join(f"{value:.4f}\n".replace(".", ",") for value in RESPONSE)
    record = only(read(tmp_path, "acc [g]\n" + alone, period_s=2e-4))
    assert (record.period_s, record.force_n) == (2e-4, None)
    np.testing.assert_allclose(record.response, RESPONSE * 9.80665, rtol=1e-12)
    preamble = only(read(tmp_path, "Sample rate [Hz];5000\nforce [N];acc [m/s²]\n" + rows(";", columns=2)))
    assert preamble.period_s == 2e-4
    assert any("5000 samples per second" in text for text in preamble.warnings)


def test_rounded_times_give_the_mean_period(tmp_path: Path) -> None:
    times = np.round(np.arange(3000) / 6000.0, 5)
    content = "t_s,a_m/s2\n" + "".join(f"{time:.5f},{k % 7}\n" for k, time in enumerate(times))
    record = only(read(tmp_path, content))
    assert record.period_s == pytest.approx(1 / 6000.0, rel=1e-5)
    coarse = np.round(np.arange(3000) / 6000.0, 3)
    content = "t_s,a_m/s2\n" + "".join(f"{time:.3f},{k % 7}\n" for k, time in enumerate(coarse))
    with pytest.raises(RecordError, match=r":3: time 0 s is repeated.*state the period"):
        read(tmp_path, content)
    assert only(read(tmp_path, content, period_s=1 / 6000.0)).period_s == 1 / 6000.0


def test_the_rate_must_not_change() -> None:
    steps = np.concatenate((np.full(500, 1.0e-3), np.full(500, 1.3e-3)))
    with pytest.raises(UnevenTimeError, match="from even spacing"):
        even_period(np.cumsum(steps))
    jitter = np.arange(1000) * 1e-3 + np.random.default_rng(1).uniform(-4e-5, 4e-5, 1000)
    period, notes = even_period(jitter)
    assert period == pytest.approx(1e-3, rel=1e-3)
    assert not notes
    assert even_period(np.round(np.arange(1000) * 1.7, 0))[1]


HEADER = "time_s,force_N,acc_m/s^2\n"


def replaced(line: int, column: int, cell: str, delimiter: str = ",") -> str:
    lines = (HEADER + rows(delimiter)).splitlines()
    cells = lines[line - 1].split(delimiter)
    cells[column - 1] = cell
    lines[line - 1] = delimiter.join(cells)
    return "\n".join(lines) + "\n"


def without_row(line: int) -> str:
    lines = (HEADER + rows()).splitlines(keepends=True)
    return "".join(lines[: line - 1] + lines[line:])


#: What is wrong: the file, the message, options of the reader.
BAD: dict[str, tuple[Any, ...]] = {
    "empty": (b"", "the file is empty"),
    "blank": (b" \n\n", "the file is empty"),
    "binary": (b"\x89PNG\r\n\x1a\n\x00\x00", r"a binary file \(byte 0x00 at 8\)"),
    "no header": (rows(), r":1: no header: the first line is '0\.0000,"),
    "no numbers": ("hello\nworld\n", r":1: no rows of numbers.*'hello'"),
    "wrong delimiter": ("time|force|acc\n" + rows("|"), r"separated by comma, semicolon, tab or blanks"),
    "header otherwise divided": ("time;force;acc\n" + rows(), r":1: header cells, separated by comma: 1; of line 2: 3"),
    "decimal commas and commas": (HEADER + rows(",", ","), r"export with semicolons or decimal points"),
    "text instead of a number": (replaced(9, 2, "over"), r":9: column 2 \(force_N\) 'over' is not a finite number"),
    "text in the first row": (replaced(2, 2, "over"), r":2: column 2.* 'over' is not a"),
    "text in the second row": (replaced(3, 1, "?"), r":3: column 1.* '\?' is not a"),
    "empty cell": (replaced(7, 3, ""), r":7: column 3 \(acc_m/s\^2\) is empty"),
    "nan": (replaced(7, 3, "NaN"), r":7: column 3.*'NaN' is not a finite number"),
    "infinity": (replaced(7, 3, "-inf"), r":7: column 3.*'-inf' is not a finite number"),
    "short row": (replaced(7, 2, "").replace(",,", ","), r":7: 2 cells, column 3"),
    "cut off": ((HEADER + rows())[:-12], r":25: 2 cells, column 3 \(acc_m/s\^2\) is missing"),
    "gap": (without_row(9), r":9: 0\.001 s between 0\.003 s and 0\.004 s, usually 0\.0005 s.*samples are missing"),
    "repeated time": (replaced(9, 1, "0.0030"), r":9: time 0\.003 s is repeated"),
    "time runs back": (replaced(9, 1, "0.0020"), r":9: time 0\.002 s comes after 0\.003 s"),
    "no time": ("force_N,acc_g\n" + rows(columns=2), r":1: no column of time; the header names 'force_N', 'acc_g'"),
    "no response": ("time_s,force_N\n" + rows(columns=2), r":1: no column of a response"),
    "nothing known": ("foo,bar,baz\n" + rows(), r"no column of time; the header names 'foo', 'bar', 'baz'"),
    "unknown unit": ("t_s,f [V],a_g\n" + rows(), r":1: 'f \[V\]': the unit 'V' is not known; .* one of N, kN"),
    "unknown unit in its row": ("t,f,a\ns,N,V\n" + rows(), r"'a': the unit 'V' is not known"),
    "name against unit": (
        "t_s,force [m/s²],a_g\n" + rows(),
        r"has the unit m/s² of acceleration, but must be of force",
    ),
    "mixed quantities": (
        "t_s,f_N,acc_x_g,disp_y_mm\n" + rows(columns=4),
        r"are acceleration and displacement: must be one quantity; choose with --response-column",
    ),
    "two of one axis": ("t_s,f_N,acc1_g,acc2_g\n" + rows(columns=4), r"not one for each of the axes"),
    "two forces": ("t_s,f1_N,f2_N,a_g\n" + rows(columns=4), r"2 columns of force.*choose with --force-column"),
    "another axis": ("t_s,f_N,ay_g\n" + rows(), r"--axis x: the responses are along y", {"axis": "x"}),
    "milliseconds called seconds": (
        "Sampling rate: 2000 Hz\ntime_s,force_N,acc_g\n" + rows(scale=1000.0),
        r"has a sample every 0\.5 s, 0\.0005 s is stated.*unit of the time",
    ),
    "another period": (HEADER + rows(), r"every 0\.0005 s, 0\.001 s is stated", {"period_s": 1e-3}),
    "too short": (HEADER + "\n".join(rows().splitlines()[:5]), r"5 rows of numbers: too short; .* at least 16"),
    "points and commas": (
        "t_s;f_N;a_g\n" + rows(";", ",").replace("0,0050", "0.0050"),
        r":12: column 1.*'0\.0050' has a decimal point, other cells have decimal commas",
    ),
    "unknown column": (HEADER + rows(), r"--force-column 'hammer': no column has this", {"force_column": "hammer"}),
    "column beyond": (
        HEADER + rows(),
        r"--response-column 7: the file has columns 1 to 3",
        {"response_columns": ("7",)},
    ),
    "text below the header": (HEADER + "measured on Monday\n" + rows(), r":2: column 1: 'measured on Monday' is not a"),
}


def test_points_for_thousands(tmp_path: Path) -> None:
    values = [f"{k:,}".replace(",", ".") + f",{k % 7}" for k in range(990, 1000 + COUNT)][-COUNT:]
    values[3], values[5] = "-1.234.567,25", "+1.000,5e-2"
    lines = [f"{k};{value};{k},5" for k, value in enumerate(values)]
    record = only(read(tmp_path, "t_ms;f_N;a_g\n" + "\n".join(lines) + "\n"))
    expected = [k + k % 7 / 10 for k in range(1000, 1000 + COUNT)]
    expected[3], expected[5] = -1234567.25, 10.005
    np.testing.assert_allclose(record.force_n, expected, rtol=1e-15)
    for bad in ("1.26,5", "1.2655,1", "12.345.6,1", "1234.567,8"):
        with pytest.raises(RecordError, match=rf":5: column 2 \(f_N\) '{bad}' is not a finite number"):
            read(tmp_path, "t_ms;f_N;a_g\n" + "\n".join(lines).replace(values[3], bad) + "\n")


def test_times_of_the_day(tmp_path: Path) -> None:
    lines = [f"10:15:00,{500 * k:06d};{k},0;{k},5" for k in range(COUNT)]
    text = "Zeit;Kraft [N];Beschleunigung Y [m/s²]\n" + "\n".join(lines) + "\n"
    with pytest.raises(RecordError, match=r":2: column 1 \(Zeit\) '10:15:00,000000' is a time of day.*--sample-period"):
        read(tmp_path, text)
    record = only(read(tmp_path, text, period_s=5e-4))
    assert (record.period_s, record.start_s, record.axis) == (5e-4, 0.0, "y")
    np.testing.assert_array_equal(record.response, np.arange(COUNT) + 0.5)
    assert any("the stated period of 0.0005 s is used" in text for text in record.notes)


@pytest.mark.parametrize("name", BAD)
def test_bad_text_is_refused_with_line_and_cell(name: str, tmp_path: Path) -> None:
    content, message, *options = BAD[name]
    with pytest.raises(RecordError, match=message):
        read(tmp_path, content, **dict(*options))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"axis": "a"}, "must be x, y or z"),
        ({"period_s": -1.0}, "must be above 0"),
        ({"force_scale": 0.0}, "must be a number other than 0"),
        ({"response_scale": float("nan")}, "must be a number other than 0"),
        ({"time_unit": "N"}, "time_unit 'N' is not known: must be one of s, ms, µs, min"),
        ({"response_unit": "furlong"}, "response_unit 'furlong' is not known"),
    ],
)
def test_bad_options(options: dict[str, Any], message: str) -> None:
    with pytest.raises(RecordError, match=message):
        ReadOptions(**options)


numbers = st.floats(-1e6, 1e6).map(lambda value: float(f"{value:.9g}"))


@given(
    table=st.lists(st.tuples(numbers, numbers), min_size=16, max_size=40),
    dialect=st.sampled_from([(",", "."), (";", "."), (";", ","), ("\t", ","), (" ", ".")]),
    unit=st.sampled_from([("s", 1.0), ("ms", 1e-3), ("us", 1e-6)]),
)
def test_a_written_csv_reads_back_to_the_digits(
    tmp_path_factory: pytest.TempPathFactory,
    table: list[tuple[float, float]],
    dialect: tuple[str, str],
    unit: tuple[str, float],
) -> None:
    delimiter, point = dialect
    text = io.StringIO()
    writer = csv.writer(text, delimiter=delimiter)
    writer.writerow([f"time_{unit[0]}", "force_N", "acc_m/s^2"])
    for k, (force, response) in enumerate(table):
        writer.writerow([f"{value:.9g}".replace(".", point) for value in (0.25 * k, force, response)])
    path = tmp_path_factory.getbasetemp() / "written.csv"
    path.write_text(text.getvalue(), encoding="utf-8")
    record = only(read_records(path))
    assert record.period_s == pytest.approx(0.25 * unit[1], rel=1e-12)
    assert list(zip(record.force_n.tolist(), record.response.tolist(), strict=True)) == table


@given(
    cuts=st.lists(
        st.tuples(st.integers(0, 700), st.integers(0, 6), st.text('0,;.\n\t "#-eNs[]/µ\x00', max_size=4)), max_size=4
    ),
    name=st.sampled_from(["plain", "german excel", "labview", "quoted", "blanks and comment"]),
)
def test_damaged_text_gives_a_record_or_an_error(
    tmp_path_factory: pytest.TempPathFactory, cuts: list[tuple[int, int, str]], name: str
) -> None:
    content = DIALECTS[name]
    assert isinstance(content, str)
    for at, length, inserted in cuts:
        content = content[:at] + inserted + content[at + length :]
    path = tmp_path_factory.getbasetemp() / "damaged.csv"
    path.write_text(content, encoding="utf-8")
    try:
        records = read_records(path)
    except RecordError as error:
        assert str(path) in str(error)
    else:
        assert all(np.isfinite(record.response).all() and record.period_s > 0.0 for record in records)


# Universal files, written by pyuff.

PULSE: FloatArray = np.concatenate((np.zeros(40), 300.0 * np.sin(np.pi * np.arange(9) / 8), np.zeros(151)))
RINGING: FloatArray = np.exp(-np.arange(200) / 60.0) * np.sin(np.arange(200) * 0.37)


def dataset(values: FloatArray, kind: int, **more: Any) -> dict[str, Any]:
    found: dict[str, Any] = {
        "type": 58,
        "binary": 0,
        "func_type": 1,
        "rsp_node": 1,
        "rsp_dir": 1,
        "ref_node": 1,
        "ref_dir": 1,
        "id1": "NONE",
        "x": np.arange(len(values)) / 6000.0,
        "data": values.copy(),
        "abscissa_spacing": 1,
        "abscissa_spec_data_type": 17,
        "ordinate_spec_data_type": kind,
        "orddenom_spec_data_type": 0,
    }
    return found | more


def units(code: int, length: float, force: float) -> dict[str, Any]:
    found: dict[str, Any] = pyuff.prepare_164(
        units_code=code, units_description="units", temp_mode=1, length=length, force=force, temp=1.0, temp_offset=0.0
    )
    return found


def universal(tmp_path: Path, sets: list[dict[str, Any]], **options: Any) -> list[Record]:
    path = tmp_path / "tap.uff"
    path.unlink(missing_ok=True)
    pyuff.UFF(str(path)).write_sets(sets, mode="add")
    return read_records(path, ReadOptions(**options))


# pyuff leaves a file open where it writes binary sets.
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning", "ignore::ResourceWarning")
@pytest.mark.parametrize("binary", [0, 1])
@pytest.mark.parametrize("even", [0, 1])
def test_universal_files_read_like_csv(binary: int, even: int, tmp_path: Path) -> None:
    how = {"binary": binary, "abscissa_spacing": even}
    sets = [units(1, 1.0, 1.0), dataset(PULSE, 13, **how), dataset(RINGING, 12, rsp_dir=2, **how)]
    record = only(universal(tmp_path, sets))
    content = "t_s,f_N,ay_m/s2\n" + "".join(
        f"{k / 6000.0:.12g},{PULSE[k]:.12g},{RINGING[k]:.12g}\n" for k in range(len(PULSE))
    )
    same = only(read(tmp_path, content))
    assert same.force_n is not None
    assert record.axis == same.axis == "y"
    assert record.period_s == pytest.approx(same.period_s, rel=3e-6)
    np.testing.assert_allclose(record.force_n, same.force_n, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(record.response, same.response, rtol=1e-10, atol=1e-10)
    assert not record.warnings


def test_units_of_a_universal_file(tmp_path: Path) -> None:
    sets = [dataset(PULSE, 13), dataset(RINGING, 8)]
    record = only(universal(tmp_path, [units(5, 1000.0, 1000.0), *sets]))
    assert record.quantity == "displacement"
    np.testing.assert_allclose(record.force_n, PULSE / 1000.0, atol=1e-12)
    np.testing.assert_allclose(record.response, RINGING / 1000.0, atol=1e-12)
    labels = [dataset(PULSE, 0, ordinate_axis_units_lab="kN"), dataset(RINGING, 0, ordinate_axis_units_lab="g")]
    record = only(universal(tmp_path, labels))
    np.testing.assert_allclose(record.force_n, PULSE * 1000.0, atol=1e-7)
    np.testing.assert_allclose(record.response, RINGING * 9.80665, atol=1e-9)
    assert any("SI is assumed" in text for text in only(universal(tmp_path, sets)).warnings)
    contradiction = only(universal(tmp_path, [units(1, 1.0, 1.0), *labels]))
    assert any("the label is used" in text for text in contradiction.warnings)


def test_a_sensor_against_the_axis_is_turned(tmp_path: Path) -> None:
    record = only(universal(tmp_path, [dataset(PULSE, 13, rsp_dir=-1), dataset(RINGING, 12, rsp_dir=-1)]))
    np.testing.assert_allclose(record.force_n, -PULSE, atol=1e-7)
    np.testing.assert_allclose(record.response, -RINGING, atol=1e-10)


@pytest.mark.parametrize("order", ["FRFRFR", "RFRFRF", "FFFRRR", "RRRFFF"])
def test_several_taps_in_one_file(order: str, tmp_path: Path) -> None:
    count = {"F": 0, "R": 0}
    sets = []
    for letter in order:
        count[letter] += 1
        values, kind, node = (PULSE, 13, 1) if letter == "F" else (RINGING, 12, 2)
        sets.append(dataset(values * count[letter], kind, rsp_node=node))
    records = universal(tmp_path, sets)
    assert len(records) == 3
    for n, record in enumerate(records, start=1):
        assert np.max(record.force_n) == pytest.approx(300.0 * n)
        np.testing.assert_allclose(record.response, RINGING * n, atol=1e-9)


def test_forces_are_matched_by_number_and_place(tmp_path: Path) -> None:
    by_version = [
        *(dataset(PULSE * n, 13, ver_num=n) for n in (3, 1, 2)),
        *(dataset(RINGING * n, 12, ver_num=n, rsp_node=2) for n in (1, 2, 3)),
    ]
    for record in universal(tmp_path, by_version):
        assert np.max(record.force_n) / 300.0 == pytest.approx(np.max(record.response) / np.max(RINGING))
    by_place = [
        dataset(PULSE, 13, rsp_node=1, rsp_dir=1),
        dataset(PULSE * 2, 13, rsp_node=1, rsp_dir=2),
        dataset(RINGING * 2, 12, ref_dir=2, rsp_dir=2),
        dataset(RINGING, 12, ref_dir=1, rsp_dir=1),
    ]
    records = universal(tmp_path, by_place)
    assert [record.axis for record in records] == ["y", "x"]
    for record in records:
        assert np.max(record.force_n) / 300.0 == pytest.approx(np.max(record.response) / np.max(RINGING))
    assert only(universal(tmp_path, by_place, axis="x")).axis == "x"


def test_one_hit_and_a_triaxial_sensor(tmp_path: Path) -> None:
    sets = [dataset(PULSE, 13, rsp_dir=3), *(dataset(RINGING, 12, rsp_dir=k, ref_dir=3) for k in (1, 2, 3))]
    records = universal(tmp_path, sets)
    assert [record.axis for record in records] == ["x", "y", "z"]
    assert all(record.force_n is not None for record in records)
    assert [record.force_n for record in universal(tmp_path, sets, ignore_force=True)] == [None] * 3


def frequency_response() -> dict[str, Any]:
    return dataset(RINGING.astype(np.complex128), 12, func_type=4, abscissa_spec_data_type=18)  # type: ignore[arg-type]


BAD_UNIVERSAL: dict[str, tuple[Any, ...]] = {
    "FRF only": (lambda: [frequency_response()], "no time record: the file contains 1 frequency response functions"),
    "units only": (lambda: [units(1, 1.0, 1.0)], "no time record: the file contains datasets of type 164"),
    "unknown": (lambda: [dataset(RINGING, 0)], "unknown quantity"),
    "type against unit": (
        lambda: [dataset(RINGING, 12, ordinate_axis_units_lab="N")],
        "type 12 is acceleration, its unit N is of force",
    ),
    "volts": (lambda: [dataset(RINGING, 12, ordinate_axis_units_lab="V")], "unit 'V' of the acceleration is not known"),
    "rotation": (lambda: [dataset(RINGING, 12, rsp_dir=4)], "direction 4 is a rotation"),
    "other lengths": (lambda: [dataset(PULSE, 13), dataset(RINGING[:150], 12)], "must be sampled together"),
    "too few forces": (
        lambda: [dataset(PULSE, 13), dataset(RINGING, 12), dataset(RINGING, 12)],
        "2 responses at node 1 and 1 forces",
    ),
    "force only": (lambda: [dataset(PULSE, 13)], r"no response; the file contains force along x \(dataset 1\)"),
    "two quantities": (
        lambda: [dataset(RINGING, 12), dataset(RINGING, 8, rsp_node=2)],
        "acceleration and displacement: must be one",
    ),
    "too short": (lambda: [dataset(RINGING[:9], 12)], "9 samples: too short"),
    "other axis": (
        lambda: [dataset(RINGING, 12)],
        "no response along z; the file contains acceleration along x",
        {"axis": "z"},
    ),
    "other period": (lambda: [dataset(RINGING, 12)], "0.001 s is stated", {"period_s": 1e-3}),
}


@pytest.mark.parametrize("name", BAD_UNIVERSAL)
def test_bad_universal_files(name: str, tmp_path: Path) -> None:
    make, message, *options = BAD_UNIVERSAL[name]
    with pytest.raises(RecordError, match=message):
        universal(tmp_path, make(), **dict(*options))


def test_a_cut_universal_file(tmp_path: Path) -> None:
    path = tmp_path / "cut.uff"
    pyuff.UFF(str(path)).write_sets([dataset(RINGING, 12)], mode="add")
    lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
    path.write_text("".join(lines[:20] + lines[-1:]), encoding="utf-8")
    with pytest.raises(RecordError, match="values, but 200 by its header: the file is truncated"):
        read_records(path)
    path.write_text("".join(lines[:20]), encoding="utf-8")
    with pytest.raises(RecordError, match="no time record: the file contains no dataset"):
        read_records(path)
    path.write_text("time,acc\n0,1\n", encoding="utf-8")
    with pytest.raises(RecordError, match="not a UFF file: it begins with"):
        read_records(path)


# WAV files, written by SciPy and by the standard library.

TAP = np.column_stack([PULSE, 10.0 * RINGING])


@pytest.mark.parametrize("kind", [np.int16, np.int32, np.float32, np.float64])
def test_wav_files_read_to_their_resolution(kind: type, tmp_path: Path) -> None:
    path = tmp_path / "tap.wav"
    full = np.array([400.0, 20.0])
    integer = np.dtype(kind).kind == "i"
    top = -float(np.iinfo(kind).min) if integer else 1.0
    values = np.round(TAP / full * top) if integer else TAP
    wavfile.write(path, 6000, values.astype(kind))
    scales = {"force_scale": 400.0, "response_scale": 20.0} if integer else {}
    record = only(read_records(path, ReadOptions(**scales, axis="x")))
    step = 1.0 / top if integer else float(np.finfo(kind).eps)
    assert (record.period_s, record.axis) == (1 / 6000.0, "x")
    np.testing.assert_allclose(record.force_n, TAP[:, 0], atol=400.0 * step)
    np.testing.assert_allclose(record.response, TAP[:, 1], atol=20.0 * step)
    swapped = only(read_records(path, ReadOptions(response_first=True, **scales)))
    assert np.max(np.abs(swapped.force_n)) == pytest.approx(np.max(TAP[:, 1]) * (20.0 if integer else 1.0), rel=1e-3)


def test_wav_of_24_bits(tmp_path: Path) -> None:
    path = tmp_path / "tap.wav"
    values = np.round(TAP / [400.0, 20.0] * 2**23).astype(int)
    with wave.open(str(path), "wb") as file:
        file.setnchannels(2)
        file.setsampwidth(3)
        file.setframerate(6000)
        file.writeframes(b"".join(struct.pack("<i", int(value))[:3] for value in values.ravel()))
    record = only(read_records(path, ReadOptions(force_scale=400.0, response_scale=20.0)))
    np.testing.assert_allclose(record.force_n, TAP[:, 0], atol=400.0 * 2.0**-23)
    np.testing.assert_allclose(record.response, TAP[:, 1], atol=20.0 * 2.0**-23)


def test_a_mono_wav_is_a_decay(tmp_path: Path) -> None:
    path = tmp_path / "decay.wav"
    wavfile.write(path, 8000, (RINGING * 32000).astype(np.int16))
    record = only(read_records(path))
    assert record.force_n is None
    assert any("the response is a ratio" in text for text in record.warnings)


def test_bad_wav_files(tmp_path: Path) -> None:
    path = tmp_path / "tap.wav"
    shares = (TAP / [400.0, 20.0] * 32767).astype(np.int16)
    wavfile.write(path, 6000, shares)
    with pytest.raises(RecordError, match="a mass needs --force-scale and --response-scale"):
        read_records(path)
    assert only(read_records(path, ReadOptions(ignore_force=True))).force_n is None
    with pytest.raises(RecordError, match=r"6000 samples per second, but a stated period of 0.001 s"):
        read_records(path, ReadOptions(ignore_force=True, period_s=1e-3))
    path.write_bytes(path.read_bytes()[:30])
    with pytest.raises(RecordError, match="cannot be read"):
        read_records(path)
    broken = TAP.copy()
    broken[17, 1] = np.nan
    for samples, said in (
        (np.zeros((100, 3), dtype=np.int16), "3 channels"),
        (np.zeros(100, dtype=np.uint8), "8 bits"),
        (np.zeros(5, dtype=np.int16), "5 samples"),
        (broken, "sample 18 of channel 2 is nan"),
    ):
        wavfile.write(path, 6000, samples)
        with pytest.raises(RecordError, match=said):
            read_records(path)
    path.write_text(HEADER + rows(), encoding="utf-8")
    with pytest.raises(RecordError, match="not a WAV file: it begins with"):
        read_records(path)


def test_uneven_clock_is_resampled_within_its_band(tmp_path: Path) -> None:
    rng = np.random.default_rng(4)
    mode = TrueMode(83.0, 0.02, 60.0)
    fine = np.arange(int(2.2 * 65536)) / 65536.0
    force = np.where((fine > 0.05) & (fine < 0.056), 500.0 * np.sin(np.pi * (fine - 0.05) / 0.006) ** 2, 0.0)
    response = acceleration([mode], force, fine[1])
    times = (np.arange(4096) + 0.5 + rng.uniform(-0.3, 0.3, 4096)) / 2048.0
    columns = [np.interp(times, fine, each) for each in (force, response)]
    columns = [each + 0.003 * np.std(each) * rng.standard_normal(4096) for each in columns]
    path = tmp_path / "logger.csv"
    save(path, times, columns)
    (record,) = read_records(path)
    assert record.widened >= 3.0
    assert any("resampled to" in warning and "widened" in warning for warning in record.warnings)
    (found,) = identify(path).modes
    for name in ("frequency_hz", "damping_ratio", "stiffness_n_per_m"):
        assert getattr(found, name).low <= getattr(mode, name) <= getattr(found, name).high
    for back_s, said in ((0.0, "is repeated"), (1e-4, "comes after .*")):
        times[2000] = times[1999] - back_s
        save(path, times, columns)
        with pytest.raises(RecordError, match=rf"logger.csv:2002: time .* {said}: must ascend"):
            read_records(path)
    times[2000:] += 0.01
    save(path, times, columns)
    with pytest.raises(RecordError, match=r"must ascend|is too long to resample"):
        read_records(path)


def test_clock_of_coarse_digits_is_taken_as_even(tmp_path: Path) -> None:
    times = np.round(np.arange(2000) / 1024.0, 4)  # rounded to a tenth of the period
    path = tmp_path / "rounded.csv"
    save(path, times, [np.sin(300.0 * times), np.cos(300.0 * times)])
    (record,) = read_records(path)
    assert record.widened == 1.0
    assert record.period_s == pytest.approx(1.0 / 1024.0, rel=1e-4)


def save(path: Path, times: FloatArray, columns: list[FloatArray]) -> None:
    np.savetxt(path, np.column_stack((times, *columns)), delimiter=",", header="time_s,force_N,acc_m/s^2", comments="",
               fmt="%.7f")  # fmt: skip


def test_volts_by_the_sensitivity_of_the_sensors(tmp_path: Path) -> None:
    path = tmp_path / "volts.csv"
    volts = np.column_stack((np.arange(COUNT) * PERIOD_S, FORCE * 2.25, RESPONSE / 9.80665 * 0.1))
    header = "time_s,force [mV],ax [V]"
    np.savetxt(path, volts, delimiter=",", header=header, comments="")
    with pytest.raises(RecordError, match=r"the unit 'mV' is not known.*--force-sensitivity 2.25mV/N"):
        read_records(path)
    (record,) = read_records(path, ReadOptions(force_sensitivity="2.25mV/N", response_sensitivity="100 mV/g"))
    assert record.force_n == pytest.approx(FORCE)
    assert record.response == pytest.approx(RESPONSE)
    assert record.axis == "x"
    with pytest.raises(RecordError, match=r"force_sensitivity '2.25 N/mV': must be V, mV or µV over one of N, kN"):
        ReadOptions(force_sensitivity="2.25 N/mV")
    with pytest.raises(RecordError, match=r"response_sensitivity '100 mV/N': must be"):
        ReadOptions(response_sensitivity="100 mV/N")
    with pytest.raises(RecordError, match="specify only one"):
        ReadOptions(force_sensitivity="1mV/N", force_scale=2.0)
    np.savetxt(path, volts, delimiter=",", header="time_s,force_N,ax [V]", comments="")
    with pytest.raises(RecordError, match=r"'force_N' is in N, not in volts"):
        read_records(path, ReadOptions(force_sensitivity="2.25mV/N", response_sensitivity="100 mV/g"))
