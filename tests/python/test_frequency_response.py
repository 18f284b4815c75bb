"""Frequency responses without time record: closed forms by SciPy, files by pyuff and SciPy, what is refused."""

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
import pyuff
from scipy.io import savemat
from scipy.signal import freqs

from shapegcode.errors import RecordError
from shapegcode.identification.identify import identify
from shapegcode.identification.result import Identification
from shapegcode.identification.update import update_machine
from shapegcode.io.record import FrequencyResponse, Quantity, ReadOptions, ratio_unit
from shapegcode.io.units import FloatArray
from shapegcode.machine import Machine
from tap_truth import TrueMode, random_modes
from test_tap_files import dataset

ComplexArray = npt.NDArray[np.complex128]
MODES = (TrueMode(46.0, 0.03, 120.0), TrueMode(121.0, 0.02, 60.0), TrueMode(263.0, 0.025, 30.0))
HZ = np.arange(800) * 0.5
NAMES = ("frequency_hz", "damping_ratio", "mass_kg", "stiffness_n_per_m")
POWERS: dict[Quantity, int] = {"displacement": 0, "velocity": 1, "acceleration": 2}


def closed_form(modes: Any, hz: FloatArray, quantity: Quantity) -> ComplexArray:
    """Response over force by SciPy's polynomials of s."""
    total = np.zeros(len(hz), dtype=np.complex128)
    for mode in modes:
        numerator = [1.0 / mode.mass_kg, *[0.0] * POWERS[quantity]]
        total += freqs(numerator, [1.0, 2.0 * mode.damping_ratio * mode.omega, mode.omega**2], 2.0 * np.pi * hz)[1]
    return total


def noisy(hz: FloatArray, quantity: Quantity = "acceleration", noise: float = 1e-4, seed: int = 1) -> ComplexArray:
    """White noise of the accelerometer on any quantity."""
    rng = np.random.default_rng(seed)
    white = noise * (rng.standard_normal(len(hz)) + 1j * rng.standard_normal(len(hz)))
    omega = np.maximum(2.0 * np.pi * hz, 1e-9)
    return closed_form(MODES, hz, quantity) + white * (1j * omega) ** (POWERS[quantity] - 2)


def check(found: Identification, axis: str | None = None, share: float = 3e-3) -> None:
    assert found.ok, found.reason
    assert found.axis == axis
    assert len(found.modes) == len(MODES)
    for mode, truth in zip(found.modes, MODES, strict=True):
        values = [getattr(mode, name).value for name in NAMES]
        assert values == pytest.approx([getattr(truth, name) for name in NAMES], rel=share)


def write_uff(path: Path, **how: Any) -> Path:
    header = {
        "func_type": 4, "data": noisy(HZ), "x": HZ, "abscissa_spec_data_type": 18, "orddenom_spec_data_type": 13,
        "ordinate_axis_units_lab": "m/s^2", "orddenom_axis_units_lab": "N", "abscissa_axis_units_lab": "Hz",
    }  # fmt: skip
    pyuff.UFF(str(path)).write_sets([dataset(HZ, 12, **(header | how))], mode="add")
    return path


@pytest.mark.parametrize("quantity", ["acceleration", "velocity", "displacement"])
@pytest.mark.parametrize("coherent", [False, True])
def test_intervals_hold_the_truth(quantity: Quantity, coherent: bool) -> None:
    rng = np.random.default_rng(2)
    covered, errors = [], []
    for draw in range(10):
        modes = random_modes(rng, 1 + draw % 3)
        hz = np.arange(1, 1200) * 0.5
        clean = closed_form(modes, hz, quantity)
        flat = np.abs(clean * (2.0 * np.pi * hz) ** (2 - POWERS[quantity]))
        level = flat if coherent else np.full(len(hz), np.median(flat))  # as high as the response, and the file says so
        noise = 0.02 * level * (rng.standard_normal(len(hz)) + 1j * rng.standard_normal(len(hz)))
        response = clean + noise * (2.0 * np.pi * hz) ** (POWERS[quantity] - 2)
        coherence = np.full(len(hz), 1.0 / (1.0 + 2.0 * 0.02**2)) if coherent else None
        found = identify([FrequencyResponse("closed form", hz, response, quantity, coherence)])
        for mode in found.modes:
            truth = min(modes, key=lambda each: abs(each.frequency_hz - mode.frequency_hz.value))
            for name in NAMES:
                estimate, true = getattr(mode, name), getattr(truth, name)
                covered.append(estimate.low <= true <= estimate.high)
                errors.append(abs(estimate.value / true - 1.0))
    assert len(covered) >= 4 * 12
    assert np.mean(covered) >= 0.85
    assert np.median(errors) < (6e-3 if coherent else 2e-3)


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # pyuff leaves its file open
@pytest.mark.parametrize("binary", [0, 1])
def test_universal_files(tmp_path: Path, binary: int) -> None:
    check(identify(write_uff(tmp_path / "frf.uff", binary=binary)), "x")
    turned = write_uff(tmp_path / "turned.uff", binary=binary, data=-noisy(HZ) / 9.80665, rsp_dir=-2, ref_dir=2,
                       ordinate_axis_units_lab="g")  # fmt: skip
    check(identify(turned), "y")


def test_universal_file_of_uneven_spacing(tmp_path: Path) -> None:
    uneven = np.concatenate((HZ[1:400], HZ[400::3]))
    path = write_uff(tmp_path / "frf.uff", x=uneven, data=noisy(uneven, "displacement"), abscissa_spacing=0,
                     ordinate_spec_data_type=8, ordinate_axis_units_lab="m")  # fmt: skip
    check(identify(path), "x", 5e-3)


@pytest.mark.slow
def test_the_driving_point_of_several_is_taken_and_coherence_is_read(tmp_path: Path) -> None:
    path = write_uff(tmp_path / "frf.uff", rsp_node=7, data=-noisy(HZ))
    write_uff(path)
    coherence = np.full(len(HZ), 0.99)
    write_uff(path, func_type=6, data=coherence, ordinate_spec_data_type=0, orddenom_spec_data_type=0)
    found = identify(path)
    check(found, "x")
    assert any("dataset 2 is used" in note for note in found.notes)
    assert found.responses[0].coherence is not None
    other = identify(path, ReadOptions(response_columns=("1",)))
    check(other, "x")
    assert any("the sign is reversed" in warning for warning in other.warnings)
    with pytest.raises(RecordError, match=r"--response-column 9: datasets with frequency responses are 1, 2"):
        identify(path, ReadOptions(response_columns=("9",)))


def test_coherence_weights_the_fit() -> None:
    rng = np.random.default_rng(3)
    hz = HZ[1:]
    spread = np.where((hz > 60.0) & (hz < 100.0), 0.02, 1e-4)  # a disturbance, which the coherence shows
    response = closed_form(MODES, hz, "acceleration") + spread * (
        rng.standard_normal(len(hz)) + 1j * rng.standard_normal(len(hz))
    )
    coherence = np.abs(response) ** 2 / (np.abs(response) ** 2 + 2.0 * spread**2)
    check(identify([FrequencyResponse("weighted", hz, response, coherence=coherence)]))


def test_text_of_any_shape(tmp_path: Path) -> None:
    hz = HZ[1:]
    receptance, accelerance = noisy(hz, "displacement"), noisy(hz)
    files = {
        "a.csv": (np.c_[hz, accelerance.real, accelerance.imag], ",", "f [Hz],Re [(m/s^2)/N],Im [(m/s^2)/N]"),
        "b.csv": (np.c_[hz, 1e6 * receptance.real, 1e6 * receptance.imag], ";", "Frequency;Real (µm/N);Imag (µm/N)"),
        "c.csv": (
            np.c_[hz, 20.0 * np.log10(np.abs(accelerance)), np.degrees(np.angle(accelerance))], ";",
            "Inertance\nFrequency (Hz);Magnitude (dB);Phase (deg)",
        ),
        "d.frf": (np.c_[hz, receptance.real, receptance.imag], " ", "CutPro\nFrequency [Hz] Real [m/N] Imag [m/N]"),
        "e.frf": (np.c_[hz, receptance.real, receptance.imag], "\t", ""),
    }  # fmt: skip
    for name, (table, delimiter, header) in files.items():
        np.savetxt(tmp_path / name, table, delimiter=delimiter, header=header, comments="", encoding="utf-8")
        if not header:
            (tmp_path / name).write_bytes((tmp_path / name).read_bytes().lstrip())
        found = identify(tmp_path / name, ReadOptions(axis="z"))
        check(found, "z")
        assert bool(found.warnings) == (name == "e.frf" or "dB" in header), name


def test_matlab_files(tmp_path: Path) -> None:
    hz = HZ[1:]
    receptance, accelerance = noisy(hz, "displacement"), noisy(hz)
    path = tmp_path / "a.mat"
    savemat(path, {"f": hz, "receptance": receptance})
    check(identify(path))
    savemat(path, {"w": 2.0 * np.pi * hz, "H": np.c_[receptance, accelerance]})
    with pytest.raises(RecordError, match="H has 2 columns: choose one with --response-column H:1 to H:2"):
        identify(path, ReadOptions(quantity="acceleration"))
    check(identify(path, ReadOptions(quantity="acceleration", response_columns=("H:2",))))
    savemat(path, {"freq": hz, "H_real": receptance.real, "H_imag": receptance.imag}, format="4")
    check(identify(path, ReadOptions(response_unit="m")))
    with pytest.raises(RecordError, match=r"unclear whether it is displacement, velocity or acceleration over force"):
        identify(path)
    path.write_bytes(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(512) + b"\x89HDF\r\n\x1a\n")
    with pytest.raises(RecordError, match=r"version 7.3 \(HDF5\).*save\('file.mat', 'f', 'H', '-v7'\)"):
        identify(path)


def test_a_band_beside_strong_modes() -> None:
    modes = (*MODES[:2], TrueMode(900.0, 0.01, 1.0))
    hz = np.arange(1, 2000) * 0.5
    found = identify([FrequencyResponse("band", hz, closed_form(modes, hz, "acceleration"))], band_hz=(30.0, 200.0))
    assert [round(mode.frequency_hz.value) for mode in found.modes] == [46, 121]
    for mode, truth in zip(found.modes, MODES, strict=False):
        assert mode.mass_kg.value == pytest.approx(truth.mass_kg, rel=0.01)


def test_lines_too_far_apart_for_the_damping() -> None:
    hz = np.arange(1, 60) * 10.0
    found = identify([FrequencyResponse("coarse", hz, noisy(hz))])
    assert any("less than the 10 Hz between two lines" in mode.refusal for mode in found.refused)


def test_what_is_wrong_is_said_with_its_line(tmp_path: Path) -> None:
    path = tmp_path / "frf.csv"
    table = np.c_[HZ[1:], noisy(HZ[1:]).real, noisy(HZ[1:]).imag]
    table[10, 0] = 1.0
    np.savetxt(path, table, delimiter=",", header="f [Hz],Re [m/N],Im [m/N]", comments="")
    with pytest.raises(RecordError, match=r"frf.csv:12: frequency 1 Hz comes after 5 Hz: must ascend"):
        identify(path)
    path.write_text("f [Hz],Re [m/N],Im [m/N]\n" + "".join(f"{k},{'x' if k == 30 else 1},1\n" for k in range(1, 40)))
    with pytest.raises(RecordError, match=r"frf.csv:31: column 2 \(Re \[m/N\]\) 'x' is not a finite number"):
        identify(path)
    with pytest.raises(RecordError, match=r"real values only"):
        identify(write_uff(tmp_path / "real.uff", data=np.abs(noisy(HZ))))
    with pytest.raises(RecordError, match=r"force over response"):
        identify(write_uff(tmp_path / "k.uff", ordinate_spec_data_type=13, orddenom_spec_data_type=8))
    good = FrequencyResponse("frf", HZ[1:], noisy(HZ[1:]))
    with pytest.raises(RecordError, match=r"band of 500 to 900 Hz: must ascend and overlap the lines, 0.5 to 399.5"):
        identify([good], band_hz=(500.0, 900.0))
    with pytest.raises(RecordError, match="10 lines of a frequency response; required: 16"):
        FrequencyResponse("few", HZ[1:11], noisy(HZ[1:11]))


def test_units_of_a_response_over_a_force() -> None:
    for text, measures, factor in (
        ("m/N", "displacement", 1.0), ("µm/N", "displacement", 1e-6), ("(m/s²)/N", "acceleration", 1.0),
        ("m/s^2/N", "acceleration", 1.0), ("g/N", "acceleration", 9.80665), ("1/kg", "acceleration", 1.0),
        ("m/(N s)", "velocity", 1.0), ("mm/s/kN", "velocity", 1e-6),
        ("inch/lbf", "displacement", 0.0254 / 4.4482216152605),
    ):  # fmt: skip
        found = ratio_unit(text)
        assert found is not None, text
        assert (found[0].measures, found[1]) == (measures, pytest.approx(factor)), text
    assert ratio_unit("V/N") is None


def test_into_the_machine_file(tmp_path: Path) -> None:
    path = write_uff(tmp_path / "frf.uff")
    mine = tmp_path / "mine.toml"
    mine.write_text(Machine.builtin_text("vx500"), encoding="utf-8")
    update = update_machine(mine, identify(path), keep_modes="yz")
    assert [round(mode.frequency_hz) for mode in update.machine.axes.x.modes] == [46, 121, 263]
    assert 'source = "frequency response frf.uff"' in update.text


def test_pictures(tmp_path: Path) -> None:
    found = identify([FrequencyResponse("frf", HZ[1:], noisy(HZ[1:]))])
    written = found.save_plots(tmp_path)
    assert {Path(each).stem for each in written} == {"identify-response", "identify-stabilisation"}
