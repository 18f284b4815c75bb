"""Motion on a page: the spectrum against SciPy's, thinning by its own promise, deviations against closed forms."""

import base64
import gzip
from pathlib import Path

import numpy as np
import pytest
from scipy import signal

import shapegcode as sg
from shapegcode.model.scene import scene_of
from shapegcode.model.stream import stream
from shapegcode.program import Program
from shapegcode.results.page.scene import PIXELS_HIGH, AccelerationSpectrum, Scene, Thinner, Variant, packed

CORNER = "G90 G21 G17 G54\nG0 X0 Y0 Z5.\nG1 Z0. F3000.\nX30. Y40.\nX60. Y0.\nG0 Z5.\nM30\n"


def program(tmp_path: Path, machine: sg.Machine, text: str = CORNER) -> Program:
    file = tmp_path / "part.nc"
    file.write_text(text)
    return Program.read(file, machine)


def test_the_spectrum_is_welchs() -> None:
    """The same as `scipy.signal.welch`, however the motion is cut into pieces."""
    period_s = 0.002
    samples = np.random.default_rng(3).normal(size=(9137, 3)) * [1.0, 2.0, 0.0]
    spectrum = AccelerationSpectrum(period_s)
    for piece in np.array_split(samples, [1, 700, 5000, 5003]):
        spectrum.add(piece)
    lines = spectrum.lines("original", max_hz=100.0)
    assert [line.axis for line in lines] == ["x", "y"]
    for rank, line in enumerate(lines):
        frequency, density = signal.welch(
            samples[:, rank], 1.0 / period_s, "hann", nperseg=1000, detrend=False, scaling="density"
        )
        wanted = (frequency > 0.0) & (frequency <= 100.0)
        assert line.frequency_hz == pytest.approx(frequency[wanted])
        assert line.amplitude == pytest.approx(np.sqrt(density[wanted]))


def test_thinned_curves_stay_within_half_a_pixel() -> None:
    """Straight lines between what is kept pass every sample within what was promised, and the largest is kept."""
    count = 20_000
    time = np.arange(count)
    path = np.column_stack([np.cos(time / 900.0) * 50.0, np.sin(time / 900.0) * 50.0, np.zeros(count)])
    deviation = np.column_stack([np.sin(time / 37.0), np.zeros(count), np.zeros(count)])
    spike = np.zeros(count)
    spike[12_345] = 7.0
    thinner = Thinner({"path": 0.03, "deviation": 1e-3}, most=100_000)
    for rows in np.array_split(time, 7):
        thinner.add(rows, rows[:, None], path[rows], deviation[rows], {"spike": spike[rows]}, np.array([], dtype=int))
    kept = thinner.result()
    assert len(kept.sample) < count / 2
    assert 12_345 in kept.sample
    assert kept.curves["spike"].max() == 7.0
    for whole, part, tolerance in (
        (path, kept.command_mm, 0.03),
        (deviation, kept.deviation_um, 2.0 * 0.5 / PIXELS_HIGH),
        (spike[:, None], kept.curves["spike"][:, None], 7.0 * 0.5 / PIXELS_HIGH),
    ):
        for axis in range(whole.shape[1]):
            drawn = np.interp(time, kept.sample, part[:, axis])
            assert np.abs(drawn - whole[:, axis]).max() <= tolerance * (1.0 + 1e-9)


def test_too_many_samples_are_thinned_further_and_that_is_said() -> None:
    """At most so many are kept; the promise gets coarser and the path gives way last."""
    noise = np.random.default_rng(1).normal(size=(30_000, 4))
    thinner = Thinner({"path": 0.01, "deviation": 1e-3}, most=2_000)
    rows = np.arange(len(noise))
    thinner.add(rows, rows[:, None], noise[:, :3] * 1e-3, noise[:, :3], {"noise": noise[:, 3]}, np.array([], dtype=int))
    kept = thinner.result()
    assert len(kept.sample) <= 2_000
    assert kept.pixels > 0.5
    assert kept.path_pixels <= kept.pixels
    assert kept.curves["noise"].max() == noise[:, 3].max()


def test_the_deviation_is_the_distance_from_the_line(tmp_path: Path) -> None:
    """On straight cuts the distance of the table from its line follows from a cross product."""
    machine = sg.Machine.load("vx500")
    part = program(tmp_path, machine)
    scene = scene_of(part, machine)
    (variant,) = scene.variants
    (chunk,) = stream(part, machine)
    first = (chunk.line == 4) & (chunk.sample < chunk.sample[chunk.line == 4][-60])  # clear of the corner
    direction = np.array([0.6, 0.8, 0.0])
    away = np.linalg.norm(np.cross(chunk.response_mm[first], direction), axis=1) * 1e3
    # Beside the line of the path in its plane; Z is at rest there but for its own vibration.
    rows = np.isin(variant.sample, chunk.sample[first])
    expected = dict(zip(chunk.sample[first], away, strict=True))
    found = variant.channels["deviation"][rows]
    assert found.size > 10
    assert found == pytest.approx([expected[sample] for sample in variant.sample[rows]], abs=1e-6)
    speed = np.linalg.norm(np.diff(chunk.command_mm, axis=0), axis=1) / scene.period_s * 60.0
    assert variant.channels["speed"].max() == pytest.approx(speed.max())
    # A block lasts as long as its line is interpolated.
    for line in (4, 5):
        lasts = np.count_nonzero(chunk.line == line) * scene.period_s
        assert set(np.round(variant.channels["block_s"][variant.line == line], 9)) == {round(lasts, 9)}


def test_two_programs_are_measured_against_the_same_path(tmp_path: Path) -> None:
    machine = sg.Machine.load("vx500")
    part = program(tmp_path, machine)
    result = sg.convert(part, machine)
    out = tmp_path / "out.nc"
    out.write_bytes(result.text)
    scene = scene_of(part, machine, Program.read(out, machine))
    original, emitted = scene.variants
    assert original.channels["deviation"].max() == pytest.approx(
        result.contour_error_um.response.original.max, rel=1e-3
    )
    assert emitted.channels["vibration"].max() < original.channels["vibration"].max()
    assert scene.link_lines
    assert scene.link_lines[0][2] == 3
    assert {mode.axis for mode in scene.modes} == {"x", "y"}


def unpacked(column: dict[str, float], body: bytes) -> np.ndarray:
    """A column as a page's script unpacks it."""
    kind = {"u2d": "<u2", "i4d": "<i4"}[str(column["kind"])]
    steps = np.frombuffer(body, kind, count=int(column["count"]), offset=int(column["at"])).astype(np.int64)
    ranks = np.cumsum(steps)
    if column["kind"] == "i4d":
        return ranks
    return column["low"] + (ranks % 65536) / 65535.0 * (column["high"] - column["low"])


def test_packed_numbers_come_back() -> None:
    rng = np.random.default_rng(7)
    count = 301
    xyz = rng.normal(size=(count, 3)) * 100.0
    lines = np.sort(rng.integers(0, 5000, count))
    channels = {"speed": rng.random(count), "vibration": np.full(count, 3.0)}
    text = "(</script> ä)\nG1 X1.\n"
    variant = Variant("original", "o", "a.nc", text, lines, lines[::-1].copy(), lines, xyz, xyz * 2, channels, 9999)
    head, data = packed(Scene(0.001, (variant,), "thinned"))
    body = gzip.decompress(base64.b64decode(data))
    (said,) = head["variants"]
    assert said["samples"] == 9999
    columns = said["columns"]
    assert (unpacked(columns["sample"], body) == lines).all()
    assert (unpacked(columns["line"], body) == lines[::-1]).all()
    for rank, axis in enumerate("xyz"):
        half = np.ptp(xyz[:, rank]) / 65535.0 / 2.0
        assert np.abs(unpacked(columns[axis], body) - xyz[:, rank]).max() <= half * (1.0 + 1e-9)
    assert unpacked(columns["vibration"], body) == pytest.approx(3.0)
    at, size = said["text"]["at"], said["text"]["count"]
    assert body[at : at + size].decode() == text
