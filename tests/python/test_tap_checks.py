"""Checks of taps and decays on records whose truth is known, their spectra, and the plan of a test."""

import json
from dataclasses import replace
from typing import Any

import jsonschema
import numpy as np
import pytest
from scipy import signal

import tap_truth
from shapegcode.errors import RecordError
from shapegcode.identification.checks import Prepared, excited_hz, find_hits, is_clipped, prepare, split_hits
from shapegcode.identification.plan import TapPlan, rapid_stop_program, recording_for, tap_plan
from shapegcode.identification.spectra import decay_spectrum, find_decay, frf, mode_envelopes
from shapegcode.io.record import Record
from shapegcode.io.units import FloatArray
from shapegcode.machine import Machine
from shapegcode.program import Program
from shapegcode.results.json import schema, to_text
from shapegcode.timing.cycle_time import cycle_time

RATE = 5000.0
MODES = ((46.0, 0.02, 50.0), (131.0, 0.02, 80.0))
Modes = tuple[tuple[float, float, float], ...]


def half_sine(count: int, at: int, width: int, peak_n: float) -> FloatArray:
    force = np.zeros(count)
    force[at : at + width + 1] = peak_n * np.sin(np.pi * np.arange(width + 1) / width)
    return force


def acceleration(force: FloatArray, modes: Modes = MODES, rate: float = RATE) -> FloatArray:
    return tap_truth.acceleration([tap_truth.TrueMode(*mode) for mode in modes], force, 1.0 / rate)


def tap(
    force: FloatArray,
    *,
    snr_db: float = 40.0,
    force_noise: float = 0.5,
    seed: int = 3,
    rate: float = RATE,
    modes: Modes = MODES,
) -> Record:
    rng = np.random.default_rng(seed)
    response = acceleration(force, modes, rate)
    sigma = float(np.sqrt(np.mean(response**2))) * 10.0 ** (-snr_db / 20.0)
    return Record(
        "tap",
        1.0 / rate,
        response + sigma * rng.normal(size=len(force)),
        force_n=force + force_noise * rng.normal(size=len(force)),
    )


GOOD = tap(half_sine(5000, 200, 12, 500.0))
assert GOOD.force_n is not None


def one(record: Record, **options: Any) -> Prepared:
    prepared = prepare([record], **options)
    assert len(prepared.records) == 1
    return prepared


def test_a_good_tap_passes_without_a_word() -> None:
    prepared = one(GOOD)
    assert prepared.warnings == ()
    assert prepared.refused == ()
    hit = prepared.usable[0].hit
    assert 199 <= hit.first <= 201
    assert 212 <= hit.end <= 214
    assert prepared.usable[0].force_noise_n == pytest.approx(0.5, rel=0.05)
    truth = acceleration(half_sine(5000, 200, 12, 500.0))
    sigma = float(np.sqrt(np.mean(truth**2))) / 100.0
    assert prepared.usable[0].response_noise == pytest.approx(sigma, rel=0.15)


def test_the_force_window_keeps_the_momentum_and_nothing_else() -> None:
    force = half_sine(5000, 200, 12, 500.0)
    record = tap(force, snr_db=300.0, force_noise=0.0)
    shifted = replace(record, force_n=record.force_n + 40.0, response=record.response + 3.0)
    prepared = one(shifted)
    windowed = prepared.records[0].force_n
    assert np.all(windowed[:200] == 0.0)
    assert np.all(windowed[213:] == 0.0)
    np.testing.assert_allclose(windowed, force, atol=1e-9)
    np.testing.assert_allclose(prepared.records[0].response, record.response, atol=1e-9)
    assert any("offset of the force, 40 N" in text for text in prepared.warnings)


@pytest.mark.parametrize("snr_db", [10.0, 20.0, 40.0, 60.0])
def test_noise_alone_refuses_nothing(snr_db: float) -> None:
    for seed in range(5):
        assert one(tap(half_sine(5000, 200, 12, 500.0), snr_db=snr_db, seed=seed)).refused == ()


def test_a_negative_pulse_and_a_sensor_the_other_way_are_turned() -> None:
    good = one(GOOD)
    negative = one(replace(GOOD, force_n=-GOOD.force_n))
    assert any("the sign of the force is reversed" in text for text in negative.warnings)
    against = one(replace(GOOD, response=-GOOD.response))
    assert any("opposite to the hammer's force" in text for text in against.warnings)
    for other in (negative, against):
        np.testing.assert_array_equal(other.records[0].response, good.records[0].response)
        assert other.records[0].force_n is not None
        assert good.records[0].force_n is not None
        np.testing.assert_array_equal(other.records[0].force_n, good.records[0].force_n)
    for times, quantity in ((1, "velocity"), (2, "displacement")):
        response = GOOD.response - np.mean(GOOD.response[:200])
        for _ in range(times):
            response = np.cumsum(response) / RATE
        turned = one(replace(GOOD, response=-response, quantity=quantity))  # type: ignore[arg-type]
        assert any("opposite to the hammer's force" in text for text in turned.warnings)


def test_a_double_hit_is_refused_and_ringing_is_not() -> None:
    force = half_sine(5000, 200, 12, 500.0)
    with pytest.raises(RecordError, match=r"double hit: a second pulse of 20 % comes 60 ms after the first"):
        prepare([tap(force + half_sine(5000, 500, 12, 100.0))])
    with pytest.raises(RecordError, match=r"double hit: a second pulse of 60 % comes 5 ms"):
        prepare([tap(force + half_sine(5000, 225, 12, 300.0))])
    small = one(tap(force + half_sine(5000, 500, 12, 30.0)))
    assert any("second pulse of 6 % comes 60 ms after the first: taken as ringing" in text for text in small.warnings)
    sections = signal.butter(6, 1000.0, fs=RATE, output="sos")
    rings = np.asarray(signal.sosfilt(sections, half_sine(5000, 200, 3, 500.0)))
    assert one(tap(rings)).refused == ()


def test_a_recording_is_divided_into_its_hits() -> None:
    starts = [500 + 7000 * k for k in range(5)]
    force = np.sum([half_sine(40_000, at, 12, 300.0 + 100.0 * k) for k, at in enumerate(starts)], axis=0)
    record = replace(tap(force), start_s=2.0)
    parts = split_hits(record)
    assert len(parts) == 5
    assert sum(len(part.response) for part in parts) == 40_000
    for start, peak, part in zip(starts, (300.0, 400.0, 500.0, 600.0, 700.0), parts, strict=True):
        assert np.max(part.force_n) == pytest.approx(peak, abs=5.0)
        at = (start + 6) / RATE + 2.0
        assert part.time_s[int(np.argmax(part.force_n))] == pytest.approx(at, abs=1.5 / RATE)
    doubled = force + half_sine(40_000, starts[2] + 400, 12, 200.0)
    prepared = prepare([tap(doubled)])
    assert len(prepared.records) == 4
    assert [refused.source for refused in prepared.refused] == ["tap hit 3"]
    assert "double hit: a second pulse of 40 % comes 80 ms" in prepared.refused[0].reason
    assert split_hits(GOOD) == [GOOD]
    assert len(find_hits(tap(half_sine(5000, 200, 12, 500.0) + half_sine(5000, 1200, 12, 500.0)))) == 1, (
        "the machine still shakes when the hammer comes again: a double hit"
    )


def test_overload_is_refused() -> None:
    clean = tap(half_sine(5000, 200, 12, 500.0), snr_db=60.0)
    assert clean.force_n is not None
    limit = 0.6 * float(np.max(np.abs(clean.response)))
    with pytest.raises(RecordError, match=r"overload: the response \(acceleration\) is cut off at"):
        prepare([replace(clean, response=np.clip(clean.response, -limit, limit))])
    with pytest.raises(RecordError, match=r"overload: the force is cut off at 400;"):
        prepare([replace(clean, force_n=np.clip(clean.force_n, None, 400.0))])
    decay = np.exp(-np.arange(4000) / 800.0) * np.sin(np.arange(4000) * 0.05)
    with pytest.raises(RecordError, match=r"overload: the response \(acceleration\) is cut off at 0.5 m/s²"):
        prepare([Record("decay", 1e-3, np.clip(decay, -0.5, 0.5))])


def test_clipping_is_told_from_coarse_steps() -> None:
    time = np.arange(20_000) / 20_000.0
    for frequency in (5.0, 46.0, 433.0, 3000.0):
        for bits in (8, 12, 16, 24):
            wave = np.exp(-3.0 * time) * np.sin(2.0 * np.pi * frequency * time + 0.3)
            levels = 2.0 ** (bits - 1) - 1.0
            assert not is_clipped(np.round(wave * levels) / levels), (frequency, bits)
            if frequency < 1000.0:
                assert is_clipped(np.round(np.clip(wave, -0.7, 0.7) * levels) / levels), (frequency, bits)
    assert not is_clipped(np.random.default_rng(0).normal(size=100_000))
    assert not is_clipped(np.zeros(10))


def test_missing_and_weak_force() -> None:
    with pytest.raises(RecordError, match=r"zero force: every sample is 0 N.*--ignore-force"):
        prepare([replace(GOOD, force_n=np.zeros(5000))])
    with pytest.raises(RecordError, match="no impact above the noise: the largest force"):
        prepare([tap(half_sine(5000, 200, 12, 500.0), force_noise=100.0)])
    with pytest.raises(RecordError, match="no impact above the noise"):
        prepare([replace(GOOD, force_n=np.random.default_rng(2).normal(size=5000))])
    with pytest.raises(RecordError, match="every sample of the response is 0: is the sensor connected"):
        prepare([replace(GOOD, response=np.zeros(5000))])


def test_narrow_and_soft_pulses_are_told() -> None:
    narrow = one(tap(half_sine(5000, 200, 2, 500.0)))
    assert any("the pulse has 1 samples above a tenth of its peak" in text for text in narrow.warnings)
    soft = one(tap(half_sine(5000, 200, 200, 500.0)))
    # The transform of the half sine says 32.6 Hz; the samples beside it, which count too, hold some noise.
    assert any("excites up to 32." in text and "strongest vibration at 46" in text for text in soft.warnings)
    asked = one(GOOD, band_hz=1000.0)
    assert any("less than the 1000 Hz asked for: take a harder tip" in text for text in asked.warnings)


def test_a_half_sine_excites_as_its_transform_says() -> None:
    # |cos(pi x) / (1 - 4 x²)| = 0.1 first at x = 1.3033 (x: frequency times duration).
    assert excited_hz(half_sine(5000, 200, 100, 500.0), 1.0 / RATE) == pytest.approx(1.3033 * RATE / 100, rel=2e-3)
    assert excited_hz(np.array([0.0, 1.0, 0.0]), 1.0 / RATE) == pytest.approx(RATE / 2)


def test_too_short_a_record_says_how_long_it_must_be() -> None:
    with pytest.raises(RecordError, match=r"2\.\d periods of 4\d.* Hz.*too short; required: 0\.1\d* s \(8 periods\)"):
        prepare([tap(half_sine(500, 200, 12, 500.0))])
    with pytest.raises(RecordError, match="15 samples of response: too short; required: 32"):
        prepare([tap(half_sine(215, 200, 12, 500.0))])
    damped = tap(half_sine(700, 100, 12, 500.0), modes=((46.0, 0.3, 50.0),))
    assert one(damped).refused == (), "few periods are enough where the response has decayed"


def test_sampling_too_slow_for_the_mode() -> None:
    with pytest.raises(RecordError, match="5000 samples per second are too slow for 2400 Hz; required: 6000 or more"):
        prepare([GOOD], band_hz=2400.0)
    folded = tap(half_sine(5000, 200, 3, 500.0), modes=((2300.0, 0.01, 1.0),))
    with pytest.raises(RecordError, match=r"is above 2000 Hz, 80 % of half the sampling rate"):
        prepare([folded])


def test_without_pre_trigger() -> None:
    late = one(tap(half_sine(5000, 0, 12, 500.0)))
    assert any(
        "samples before the impact: noise and offset are measured from 8 or more" in text for text in late.warnings
    )
    assert late.usable[0].response_noise is None
    with pytest.raises(RecordError, match="begins inside the pulse"):
        prepare([tap(half_sine(5000, 200, 12, 500.0)[205:])])
    rng = np.random.default_rng(4)
    restless = replace(GOOD, response=GOOD.response + 2.0 * np.sin(np.arange(5000) * 0.1 + rng.normal()))
    assert any("the machine was not at rest" in text for text in one(restless).warnings)


def test_records_must_belong_together() -> None:
    good = replace(GOOD, axis="x")
    for other, message in (
        (replace(good, axis="y"), "axis is x; .*axis is y"),
        (replace(good, quantity="velocity"), "quantity is acceleration; .*quantity is velocity"),
        (replace(good, force_n=None), "kind is tap with force; .*kind is decay"),
        (replace(good, period_s=1e-4), "must have the same sampling rate"),
    ):
        with pytest.raises(RecordError, match=message):
            prepare([good, other])
    with pytest.raises(RecordError, match="no record"):
        prepare([])
    mixed = prepare([replace(good, force_n=np.zeros(5000)), replace(good, warnings=("assumed",))])
    assert len(mixed.records) == len(mixed.refused) == 1
    assert mixed.warnings == ("assumed",)


# Decays.


def rapid_stop(noise: float, seed: int, *, ramp_s: float = 0.1, rate: float = 4000.0) -> tuple[Record, float]:
    """Accelerometer on an axis that makes a rapid and stops; and when its command ends."""
    count = int(2.0 * rate)
    command = np.zeros(count)
    edges = [round(each * rate) for each in (0.2, 0.2 + ramp_s, 0.5, 0.5 + ramp_s)]
    command[edges[0] : edges[1]] = 4.0
    command[edges[2] : edges[3]] = -4.0
    sensed = command - 0.7 * acceleration(command, ((46.0, 0.02, 1.0), (131.0, 0.02, 1.0)), rate)
    sensed += noise * np.random.default_rng(seed).normal(size=count)
    return Record("stop", 1.0 / rate, sensed), 0.5 + ramp_s


@pytest.mark.parametrize("noise", [1e-4, 0.05, 0.2])
@pytest.mark.parametrize("ramp_s", [0.03, 0.1, 0.15])
def test_the_decay_begins_when_the_axis_has_stopped(noise: float, ramp_s: float) -> None:
    record, end_s = rapid_stop(noise, 1, ramp_s=ramp_s)
    decay = find_decay(record)
    assert end_s - 0.002 <= decay.start_s <= end_s + 0.045, "at the end of the command or two periods later"
    assert decay.start_s + len(decay.response) * decay.period_s > 1.2
    peaks = decay_spectrum(decay).peaks
    assert len(peaks) >= 2
    assert sorted(peak.frequency_hz for peak in peaks[:2]) == pytest.approx([46.0, 131.0], abs=1.5)
    assert min(peaks[:2], key=lambda each: each.frequency_hz).label.startswith("4")


def test_the_start_of_a_decay_may_be_stated() -> None:
    record, _ = rapid_stop(0.01, 2)
    decay = find_decay(record, 0.8)
    assert decay.start_s == pytest.approx(0.8)
    assert one(record, start_s=0.8).records[0].start_s == pytest.approx(0.8)
    with pytest.raises(RecordError, match=r"start at 5 s: must be within the record, 0 to 1\.99975 s"):
        find_decay(record, 5.0)
    with pytest.raises(RecordError, match="every sample is 0: no vibration"):
        find_decay(Record("dead", 1e-3, np.zeros(500)))


def test_a_decay_from_its_first_sample_on_and_the_next_event() -> None:
    time = np.arange(4000) / 2000.0
    decay = np.exp(-2.0 * np.pi * 46.0 * 0.02 * time) * np.sin(2.0 * np.pi * 46.0 * time)
    whole = find_decay(Record("decay", 1.0 / 2000.0, decay))
    assert whole.start_s < 0.03
    assert len(whole.response) > 3900
    twice = np.concatenate((decay[:1600], decay))
    assert find_decay(Record("decay", 1.0 / 2000.0, twice)).start_s == pytest.approx(0.8, abs=0.03)
    cut = find_decay(Record("decay", 1.0 / 2000.0, twice), 0.0)
    assert len(cut.response) / 2000.0 == pytest.approx(0.8, abs=0.06)


@pytest.mark.parametrize("snr_db", [40.0, 10.0])
def test_a_decay_is_never_begun_before_it_begins(snr_db: float) -> None:
    rng = np.random.default_rng(11)
    late = []
    for _ in range(60):
        count = int(rng.integers(1, 5))
        frequencies, dampings = rng.uniform(20.0, 400.0, count), rng.uniform(0.005, 0.05, count)
        begin = rng.uniform(0.0, 0.5)
        time = np.arange(8000) / 4000.0 - begin
        wave = np.zeros(8000)
        for frequency, damping in zip(frequencies, dampings, strict=True):
            phase = 2.0 * np.pi * frequency * time + rng.uniform(0.0, 6.0)
            wave += rng.uniform(0.3, 1.0) * np.exp(-2.0 * np.pi * frequency * damping * np.abs(time)) * np.cos(phase)
        wave[time < 0.0] = 0.0
        sigma = float(np.sqrt(np.mean(wave**2))) * 10.0 ** (-snr_db / 20.0)
        found = find_decay(Record("decay", 1.0 / 4000.0, wave + sigma * rng.normal(size=8000)))
        late.append(found.start_s - begin)
    assert min(late) > -1.0 / 4000.0
    assert np.median(late) < 0.03
    assert max(late) < 0.3


# Spectra.


def receptance(frequency: FloatArray) -> np.ndarray[Any, np.dtype[np.complex128]]:
    s = 2j * np.pi * frequency
    found = np.zeros(len(frequency), dtype=np.complex128)
    for mode, damping, mass in MODES:
        omega = 2.0 * np.pi * mode
        found += s**2 / mass / (s**2 + 2.0 * damping * omega * s + omega**2)
    return found


def test_the_frf_is_that_of_the_plant() -> None:
    taps = [tap(half_sine(10_000, 200, 12, 400.0 + 20.0 * k), snr_db=30.0, seed=k) for k in range(8)]
    found = frf(prepare(taps).records)
    band = (found.frequency_hz > 20.0) & (found.frequency_hz < 300.0)
    truth = receptance(found.frequency_hz[band])
    error = np.abs(found.response[band] - truth) / np.abs(truth)
    assert np.median(error) < 0.02
    assert np.median(found.coherence[band]) > 0.99
    near = [int(np.argmin(np.abs(found.frequency_hz - each))) for each in (46.0, 131.0)]
    assert found.coherence[near] == pytest.approx(1.0, abs=1e-3)
    assert found.coherence[found.frequency_hz > 2000.0].mean() < 0.5, "the hammer does not reach there"
    assert frf(prepare(taps[:1]).records).coherence is None


def test_the_frf_agrees_with_scipys_welch_of_one_segment() -> None:
    record = one(tap(half_sine(4096, 200, 12, 500.0))).records[0]
    assert record.force_n is not None
    found = frf([record])
    options: dict[str, Any] = {"fs": RATE, "window": "boxcar", "nperseg": 4096, "detrend": False}
    frequency, cross = signal.csd(record.force_n, record.response, **options)
    _, power = signal.welch(record.force_n, **options)
    np.testing.assert_allclose(found.frequency_hz, frequency[1:])
    np.testing.assert_allclose(found.response[:-1], (cross / power)[1:-1], rtol=1e-9)


def test_an_frf_needs_force_and_one_rate() -> None:
    for records, message in (
        ([], "no record"),
        ([replace(GOOD, force_n=None)], "no force"),
        ([GOOD, replace(GOOD, period_s=1e-3)], "a sample every"),
    ):
        with pytest.raises(RecordError, match=message):
            frf(records)


def test_peaks_of_a_decay() -> None:
    time = np.arange(4096) / 2000.0
    wave = 2.0 * np.sin(2.0 * np.pi * 46.3 * time) + 0.1 * np.sin(2.0 * np.pi * 131.7 * time)
    found = decay_spectrum(Record("steady", 1.0 / 2000.0, wave))
    assert [peak.frequency_hz for peak in found.peaks] == pytest.approx([46.3, 131.7], abs=0.05)
    assert [peak.amplitude for peak in found.peaks] == pytest.approx([2.0, 0.1], rel=0.02)
    assert [peak.label for peak in found.peaks] == ["46.3 Hz", "131.7 Hz"]
    noise = np.random.default_rng(1).normal(size=4096)
    assert decay_spectrum(Record("noise", 1e-3, noise)).peaks == ()
    assert decay_spectrum(Record("nothing", 1e-3, np.zeros(100))).peaks == ()


def test_the_envelopes_fall_as_the_modes_do() -> None:
    time = np.arange(8000) / 4000.0
    modes = ((46.0, 0.01), (131.0, 0.015))
    wave = sum(np.exp(-2.0 * np.pi * f * z * time) * np.sin(2.0 * np.pi * f * time) for f, z in modes)
    record = Record("decay", 1.0 / 4000.0, np.asarray(wave))
    for (frequency, damping), found in zip(modes, mode_envelopes(record, [46.0, 131.0]), strict=True):
        middle = slice(200, 1600)
        slope = np.polyfit(time[middle], np.log(found[middle]), 1)[0]
        assert -slope / (2.0 * np.pi * frequency) == pytest.approx(damping, rel=0.05)
    with pytest.raises(RecordError, match="mode at 3000 Hz"):
        mode_envelopes(record, [3000.0])


# The plan.


def test_a_record_as_planned_passes() -> None:
    for modes in ((), ((46.0, 0.02),), ((131.0, 0.02), (20.0, 0.05)), ((1195.0, 0.013),)):
        how = recording_for("X", modes)
        lead = round(how.pre_trigger_s * how.samples_per_s)
        count = lead + round(how.duration_s * how.samples_per_s)
        force = half_sine(count, lead, round(how.pulse_s * how.samples_per_s), 300.0)
        plant = tuple((frequency, damping, 20.0) for frequency, damping in modes or ((20.0, 0.02), (200.0, 0.02)))
        prepared = one(tap(force, rate=how.samples_per_s, modes=plant), band_hz=0.9 * how.highest_hz)
        assert prepared.warnings == ()


def test_the_plan_speaks_of_the_machine() -> None:
    plan = tap_plan(Machine.load("vx500"))
    assert "tap test of VX500" in plan.answer
    assert [(row.axis, row.modes_hz) for row in plan.recordings] == [("X", (46.0,)), ("Y", (131.0,)), ("Z", ())]
    assert [stop.axis for stop in plan.stops] == ["X", "Y", "Z"]
    assert plan.stops[0].distance_mm == 120.0, "twice the way in which a rapid of 24 m/min is reached in 0.15 s"
    assert plan.stops[0].program == rapid_stop_program("X", 120.0, plan.stops[0].dwell_s)
    assert "G00 X120." in plan.instructions
    assert max(len(line) for line in plan.instructions.splitlines()) <= 80
    (table,) = plan.tables()
    assert max(len(line) for line in str(table).splitlines()) <= 80
    for text in ("double hit", "overload", "pre-trigger", "coherence", "time_s,force_N,acc_x_m/s^2"):
        assert text in plan.instructions.lower() or text in plan.instructions
    other = tap_plan()
    assert (other.machine, [row.axis for row in other.recordings]) == (None, ["X Y Z"])
    for each in (plan, other):
        jsonschema.validate(json.loads(to_text(each.to_dict())), schema(TapPlan))


@pytest.mark.parametrize("axis", ["X", "Y", "Z"])
def test_the_program_of_rapid_stops_runs_and_comes_back(axis: str) -> None:
    machine = Machine.load("vx500")
    text = rapid_stop_program(axis, 120.0, 4.0)
    time = cycle_time(Program.from_text(text, machine), machine)
    assert time.warnings == ()
    assert time.dwell_s == pytest.approx(40.0)
    assert time.rapid_s == pytest.approx(10 * 120.0 / 400.0), "ten rapids of 120 mm at 24 m/min"
    words = [line.split()[1] for line in text.splitlines() if line.startswith("G00")]
    assert sum(float(word.removeprefix(axis)) for word in words) == 0.0
