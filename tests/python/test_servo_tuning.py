"""Auto-servo-tuning files: modes with the motor held, from a chain of inertias solved as a matrix; what is refused."""

import struct
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import shapegcode as sg
from shapegcode.cli import main
from shapegcode.io.read import read_measurement, read_records

DIGITS = "0123456789abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ!#$`()*+-/:;=?@[]^_{|}~"
HZ = np.arange(0.0, 400.0, 0.5)
MOTOR = 0.012
LOADS = ((47.0, 0.021, 0.004), (131.0, 0.015, 0.0025))  # Hz and damping ratio with the motor held, kg m²


def base_85(values: npt.NDArray[Any]) -> str:
    """Doubles as SINUMERIK Operate writes them."""
    words = []
    for value in np.ascontiguousarray(values).view(np.float64):
        for number in struct.unpack(">II", struct.pack(">d", value)):
            digits = [DIGITS[number // 85**power % 85] for power in range(4, -1, -1)]
            words.append("." if number == 0 else "".join(digits))
    return "\n    ".join("".join(words[i : i + 20]) for i in range(0, len(words), 20))


def response(name: str, values: npt.NDArray[Any], hertz: npt.NDArray[Any] = HZ) -> str:
    """A response with its frequencies."""
    kind = "ComplexNumber" if np.iscomplexobj(values) else "double"
    arrays = "".join(
        f'<NumericArray elementtype="{each}" format="base85" name="{label}">'
        f'<unsigned_int name="m_length">{len(numbers)}</unsigned_int>'
        f'<raw name="m_pNumberArray"><![CDATA[\n{base_85(numbers)}\n]]></raw></NumericArray>'
        for label, each, numbers in (("m_ValueVector", kind, values), ("m_FrequencyVector", "double", hertz))
    )
    return f'<FrequencyResponseFunction name="{name}">{arrays}</FrequencyResponseFunction>'


def plant(noise: float = 2e-3) -> npt.NDArray[np.complex128]:
    """Speed over torque of a motor with loads on springs: the matrix of the chain, solved line by line."""
    rng = np.random.default_rng(3)
    found = np.zeros(len(HZ), dtype=np.complex128)
    for index, hertz in enumerate(HZ[1:], start=1):
        s = 2j * np.pi * hertz
        matrix = np.diag([MOTOR * s**2, *(inertia * s**2 for *_, inertia in LOADS)]).astype(np.complex128)
        for place, (clamped_hz, zeta, inertia) in enumerate(LOADS, start=1):
            omega = 2.0 * np.pi * clamped_hz
            spring = inertia * (omega**2 + 2.0 * zeta * omega * s)
            matrix[0, 0] += spring
            matrix[place, place] += spring
            matrix[0, place] -= spring
            matrix[place, 0] -= spring
        torque = np.zeros(len(LOADS) + 1)
        torque[0] = 1.0
        found[index] = s * np.linalg.solve(matrix, torque)[0]
    return found * (1.0 + noise * (rng.standard_normal(len(HZ)) + 1j * rng.standard_normal(len(HZ))))


def write(path: Path, axis: str = "MX1", *, parts: str | None = None, begin: str = "") -> Path:
    """An AST result."""
    parts = parts or response("m_pPlant", plant()) + response("m_pMeasCoherence", np.full(len(HZ), 0.9999))
    path.write_text(
        f'<?xml version="1.0" encoding="ISO-8859-1"?>\n{begin}<AutoServoTuning>\n'
        f'<string name="m_szAxisName">{axis}</string>'
        '<DynamicModelPositionController840DSL><DynamicModelList name="m_SpeedControllerList">\n'
        f"{parts}</DynamicModelList></DynamicModelPositionController840DSL></AutoServoTuning>\n"
    )
    return path


def test_the_modes_with_the_motor_held(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write(tmp_path / "ast.xml")
    found = sg.identify(path)
    assert found.ok, found.reason
    assert found.axis == "x"
    assert [mode.frequency_hz.value for mode in found.modes] == pytest.approx([each[0] for each in LOADS], rel=5e-3)
    assert [mode.damping_ratio.value for mode in found.modes] == pytest.approx([each[1] for each in LOADS], rel=0.1)
    assert all(mode.mass_kg is None for mode in found.modes)
    # The free chain resonates elsewhere: the peak of the speed.
    assert abs(HZ[1:][np.argmax(np.abs(plant(0.0)[1:] * HZ[1:]))] - LOADS[0][0]) > 2.0
    assert main(["identify", str(path)]) == 0
    assert "2 modes of the X axis" in capsys.readouterr().out


def test_digits_as_the_control_writes_them(tmp_path: Path) -> None:
    # The first double of a published measurement (Trace-Tools, demo/freq_trace.XML), decoded by hand.
    number = 0
    for digit in "kH);l":
        number = 85 * number + DIGITS.index(digit)
    assert struct.unpack(">d", number.to_bytes(4, "big") + b"\0" * 4)[0] == pytest.approx(1.0, abs=2.0)
    (read,) = read_measurement(write(tmp_path / "ast.xml"))
    assert isinstance(read, sg.FrequencyResponse)
    assert np.array_equal(read.frequency_hz, HZ[1:])
    assert read.response == pytest.approx(-1.0 / (2j * np.pi * HZ[1:] * plant()[1:]), rel=1e-12)


BOMB = '<!DOCTYPE a [<!ENTITY b "bbbbbbbbbb"><!ENTITY c "&b;&b;&b;&b;&b;&b;&b;&b;">]>'


@pytest.mark.parametrize(
    ("how", "why"),
    [
        ({"axis": "C1"}, "axis C1 is rotary"),
        ({"axis": "MSP1"}, "axis MSP1 is rotary"),
        ({"axis": "SPINDLE"}, "axis SPINDLE is rotary"),
        ({"begin": BOMB}, r"ast.xml:2: a declared document type"),
        ({"begin": "<a>" * 100}, "more than 64 nested elements"),
        ({"begin": "</a>"}, "incomplete XML"),
        ({"parts": "<a/>"}, "contains no m_pPlant"),
        ({"parts": '<FrequencyResponseFunction name="m_pPlant"/>'}, "has no m_FrequencyVector and m_ValueVector"),
        ({"parts": response("m_pPlant", plant()).replace("base85", "hex")}, "has the format 'hex'"),
        ({"parts": response("m_pPlant", plant()).replace("CDATA[\n", 'CDATA[\n"')}, "is no base-85 digit"),
        ({"parts": response("m_pPlant", plant()[:-1])}, "800 frequencies and 799 values"),
        ({"parts": response("m_pPlant", plant() * np.nan)}, "value 1 of m_pPlant is not finite"),
        ({"parts": response("m_pPlant", plant() * 1e-300)}, r"value 1 of the response is .*e\+298: must be 0 or from"),
        ({"parts": response("m_pPlant", plant() * 1e300)}, "value 1 of the response is .*e-302: must be 0 or from"),
        (
            {"parts": response("m_pPlant", plant()) + response("m_pMeasCoherence", np.ones(10), HZ[:10])},
            "other frequencies than m_pPlant",
        ),
    ],
)
def test_refused(how: dict[str, Any], why: str, tmp_path: Path) -> None:
    with pytest.raises(sg.RecordError, match=why):
        sg.identify(write(tmp_path / "ast.xml", **how))


def test_an_axis_that_the_file_names_is_no_other_one(tmp_path: Path) -> None:
    path = write(tmp_path / "ast.xml", "MX1")
    assert sg.identify(path, sg.ReadOptions(axis="x")).axis == "x"
    with pytest.raises(sg.RecordError, match="contains the X axis, but Y is requested"):
        sg.identify(path, sg.ReadOptions(axis="y"))


def test_an_axis_with_another_name_is_stated(tmp_path: Path) -> None:
    path = write(tmp_path / "ast.xml", "Q3")
    assert any("--axis" in warning for warning in sg.identify(path).warnings)
    stated = sg.identify(path, sg.ReadOptions(axis="y"))
    assert stated.axis == "y"
    assert not stated.warnings


@pytest.mark.parametrize("encoding", ["x-nonsense", "base64", "gb2312", "idna", "IBM037"])
def test_an_encoding_that_is_none_is_refused(encoding: str, tmp_path: Path) -> None:
    path = write(tmp_path / "ast.xml")
    path.write_text(path.read_text().replace("ISO-8859-1", encoding))
    with pytest.raises(sg.RecordError, match=r"ast\.xml:1: .*(required: XML in UTF-8|unknown encoding)") as refused:
        sg.identify(path)
    assert "\n" not in str(refused.value)


def test_utf_16_is_read(tmp_path: Path) -> None:
    path = write(tmp_path / "ast.xml")
    path.write_text(path.read_text().replace("ISO-8859-1", "UTF-16"), encoding="utf-16")
    assert [round(mode.frequency_hz.value) for mode in sg.identify(path).modes] == [47, 131]


def test_a_response_without_noise_warns_of_nothing(tmp_path: Path) -> None:
    """pytest takes a warning of NumPy for an error: a mass alone, as exact as doubles are."""
    rigid = 1.0 / (2j * np.pi * np.maximum(HZ, 0.1) * MOTOR)
    found = sg.identify(write(tmp_path / "ast.xml", parts=response("m_pPlant", rigid)))
    assert not found.modes


def test_no_record_over_time(tmp_path: Path) -> None:
    path = write(tmp_path / "ast.xml")
    with pytest.raises(sg.RecordError, match=r"ast\.xml: XML can .* required: a record over time"):
        read_records(path)
