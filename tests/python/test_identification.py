"""Modes from taps and decays whose truth is known (SciPy's simulation), and refusals where the data hold too little."""

from dataclasses import replace

import numpy as np
import pytest

from shapegcode.errors import RecordError
from shapegcode.identification import problem
from shapegcode.identification.identify import identify
from shapegcode.identification.result import Estimate, Identification, IdentifiedMode
from shapegcode.io.record import Record
from tap_truth import TrueMode, acceleration, random_modes, tap

NAMES = ("frequency_hz", "damping_ratio", "stiffness_n_per_m")


def estimates(mode: IdentifiedMode) -> list[Estimate]:
    found = [getattr(mode, name) for name in NAMES]
    assert all(isinstance(estimate, Estimate) for estimate in found)
    return found


def truth_of(mode: TrueMode) -> list[float]:
    return [getattr(mode, name) for name in NAMES]


def nearest(result: Identification, mode: TrueMode) -> tuple[IdentifiedMode, bool]:
    """The found mode next to a true one, and whether it was accepted."""
    pairs = [*((found, True) for found in result.modes), *((found, False) for found in result.refused)]
    return min(pairs, key=lambda pair: abs(pair[0].frequency_hz.value - mode.frequency_hz))


def decay(modes: list[tuple[float, float, float]], rng: np.random.Generator, noise: float = 0.0) -> Record:
    """Cosines of (frequency, damping ratio, amplitude) that decay after a stop."""
    rate = 2000.0
    time = np.arange(3000) / rate
    response = noise * rng.standard_normal(len(time))
    for frequency, damping, amplitude in modes:
        omega = 2.0 * np.pi * frequency
        response += (
            amplitude
            * np.exp(-damping * omega * time)
            * np.cos(omega * np.sqrt(1.0 - damping**2) * time + 0.3 * frequency)
        )
    return Record("decay", 1.0 / rate, response)


def test_forty_decibels_of_noise() -> None:
    rng = np.random.default_rng(4)
    errors: list[list[float]] = []
    covered: list[list[bool]] = []
    for draw in range(12):
        modes = random_modes(rng, 1 + draw % 4)
        result = identify([tap(modes, rng, snr_db=40.0)])
        assert result.order == len(modes)
        for mode in modes:
            found, accepted = nearest(result, mode)
            if not accepted:
                continue
            pairs = list(zip(estimates(found), truth_of(mode), strict=True))
            errors.append([abs(estimate.value / value - 1.0) for estimate, value in pairs])
            covered.append([estimate.low <= value <= estimate.high for estimate, value in pairs])
    assert len(errors) >= 25
    assert np.all(np.median(errors, axis=0) <= (0.001, 0.02, 0.02))
    # 25 intervals that hold in 95 % of all cases: fewer than 80 % in one case of a thousand.
    assert np.all(np.mean(covered, axis=0) >= 0.8)


FAST = (TrueMode(46.0, 0.03, 120.0), TrueMode(263.0, 0.02, 30.0), TrueMode(1071.0, 0.02, 60.0))


def test_a_fast_record_is_thinned_out_and_says_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    record = tap(FAST, np.random.default_rng(5), snr_db=50.0, rate_hz=51200.0, samples=12800, pulse_samples=80)
    thinned = identify([record])
    assert len(thinned.fitted_records[0].response) < len(record.response) / 4
    assert "51200 samples per second are decimated to" in thinned.notes[-1]
    monkeypatch.setattr(problem, "thin", lambda *_: None)
    whole = identify([record])
    assert len(whole.fitted_records[0].response) == len(record.response)
    for mode in FAST:
        fast, full = nearest(thinned, mode)[0], nearest(whole, mode)[0]
        for one, other, truth in zip(estimates(fast), estimates(full), truth_of(mode), strict=True):
            assert one.low <= other.high
            assert other.low <= one.high
            assert one.value == pytest.approx(truth, rel=0.02)


@pytest.mark.parametrize("band_hz", [None, (500.0, 3500.0)])
def test_a_steel_holder_at_51_kilohertz(band_hz: tuple[float, float] | None) -> None:
    # The frequencies of a steel holder; its damping and masses are made up here, the record is SciPy's.
    holder = (TrueMode(1071.0, 0.02, 1.2), TrueMode(1981.0, 0.015, 0.8), TrueMode(2608.0, 0.02, 0.5))
    record = tap(
        holder, np.random.default_rng(1), snr_db=40.0, rate_hz=51200.0, samples=51200, pulse_samples=16
    )  # fmt: skip
    found = identify([record], band_hz=band_hz)
    assert len(found.fitted_records[0].response) <= len(record.response) / 2
    assert len(found.modes) == len(holder)
    for mode, truth in zip(found.modes, holder, strict=True):
        assert abs(mode.frequency_hz.value - truth.frequency_hz) < 0.01 * truth.damping_ratio * truth.frequency_hz
        for estimate, true in zip(estimates(mode), truth_of(truth), strict=True):
            assert estimate.value == pytest.approx(true, rel=2e-3)


def test_a_thinned_blow_of_one_sample() -> None:
    time, begin = np.arange(25600) / 51200.0, 400
    force = np.zeros(len(time))
    force[begin] = 500.0
    response = np.zeros(len(time))
    modes = (TrueMode(700.0, 0.02, 8.0), TrueMode(1981.0, 0.015, 4.0))
    for mode in modes:  # closed form: second derivative of the response to a unit of momentum, the blow itself left out
        pole = mode.omega * complex(-mode.damping_ratio, np.sqrt(1.0 - mode.damping_ratio**2))
        rings = np.imag(pole**2 * np.exp(pole * time[: len(time) - begin])) / pole.imag
        response[begin:] += 500.0 * time[1] / mode.mass_kg * rings
    response += 1e-3 * np.std(response) * np.random.default_rng(3).standard_normal(len(time))
    found = identify([Record("blow", time[1], response, force_n=force)])
    assert found.fitted_records[0].period_s > 2.0 * time[1]
    for mode in modes:
        values = [estimate.value for estimate in estimates(nearest(found, mode)[0])]
        assert values == pytest.approx(truth_of(mode), rel=2e-3)


def test_a_thinned_force_may_have_run_straight_between_its_samples() -> None:
    # Simulated without a filter at the rate of the record. Taken for band-limited only, the mass of the upper mode
    # would be off by (pi f/rate)^2/3, .5 %.
    time = np.arange(25600) / 51200.0
    force = np.where((time > 0.01) & (time < 0.0112), 800.0 * np.sin(np.pi * (time - 0.01) / 0.0012), 0.0)
    modes = (TrueMode(700.0, 0.02, 8.0), TrueMode(1981.0, 0.015, 4.0))
    response = acceleration(modes, force, time[1])
    noise = 1e-4 * np.std(response) * np.random.default_rng(3).standard_normal(len(time))
    found = identify([Record("straight", time[1], response + noise, force_n=force)])
    assert found.fitted_records[0].period_s > 2.0 * time[1]
    for mode in modes:
        values = [estimate.value for estimate in estimates(nearest(found, mode)[0])]
        assert values == pytest.approx(truth_of(mode), rel=3e-4)


def test_a_strong_mode_above_the_band_asked_for_does_not_spoil_it() -> None:
    modes = (TrueMode(61.0, 0.03, 80.0), TrueMode(143.0, 0.02, 50.0), TrueMode(1071.0, 0.02, 6.0))
    record = tap(modes, np.random.default_rng(8), snr_db=50.0, rate_hz=25600.0, samples=25600, pulse_samples=15)
    found = identify([record], band_hz=(20.0, 400.0))
    assert [round(mode.frequency_hz.value) for mode in found.modes] == [61, 143]
    for mode in modes[:2]:
        values = [estimate.value for estimate in estimates(nearest(found, mode)[0])]
        assert values == pytest.approx(truth_of(mode), rel=0.02)


@pytest.mark.slow
def test_refuses_rather_than_lies_at_ten_decibels() -> None:
    rng = np.random.default_rng(6)
    wrong = refused = 0
    for draw in range(24):
        modes = random_modes(rng, 1 + draw % 4)
        result = identify([tap(modes, rng, snr_db=10.0)])
        for mode in modes:
            if result.order == 0:
                continue
            found, accepted = nearest(result, mode)
            if abs(found.frequency_hz.value / mode.frequency_hz - 1.0) > 0.05:
                continue  # missed: nothing is said of it
            pairs = zip(estimates(found), truth_of(mode), strict=True)
            if max(abs(estimate.value / value - 1.0) for estimate, value in pairs) > 0.10:
                wrong += 1
                refused += not accepted
    assert wrong >= 3
    assert refused >= 0.95 * wrong


def test_several_taps_are_more_certain_than_one() -> None:
    rng = np.random.default_rng(8)
    mode = TrueMode(120.0, 0.02, 12.0)
    taps = [tap([mode], rng, snr_db=20.0, peak_n=peak) for peak in (300.0, 500.0, 800.0)]
    one = identify(taps[:1]).modes[0]
    three = identify(taps).modes[0]
    assert three.damping_ratio.uncertainty_percent < one.damping_ratio.uncertainty_percent
    for estimate, value in zip(estimates(three), truth_of(mode), strict=True):
        assert estimate.value == pytest.approx(value, rel=0.02)


def test_taps_that_differ_by_more_than_noise_widen_the_interval() -> None:
    rng = np.random.default_rng(9)
    structures = [TrueMode(120.0, 0.02, mass) for mass in (11.0, 12.0, 13.0)]
    result = identify([tap([mode], rng, snr_db=40.0) for mode in structures], accepted_percent=50.0)
    mass = result.modes[0].mass_kg
    # Student's t of two degrees of freedom on a standard deviation of 8 % over the root of three.
    assert 15.0 < mass.uncertainty_percent < 30.0


@pytest.mark.parametrize("blow", ["linear", "one sample"])
def test_other_courses_of_the_force(blow: str) -> None:
    mode = TrueMode(250.0, 0.015, 3.0)
    period = 1.0 / 1500.0
    rng = np.random.default_rng(1)
    time = np.arange(3000) * period
    force = np.zeros(3000)
    if blow == "linear":
        force[40:48] = 400.0 * np.sin(np.pi * np.arange(8) / 8.0)
        response = acceleration([mode], force, period)
    else:
        # A blow of 1 N s just before sample 40: the exact impulse response from there on.
        force[40] = 1.0 / period
        after = time[:-40]
        s = -mode.damping_ratio * mode.omega + 1j * mode.omega * np.sqrt(1.0 - mode.damping_ratio**2)
        response = np.zeros(3000)
        response[40:] = np.imag(s**2 * np.exp(s * after)) / (s.imag * mode.mass_kg)
    response += 1e-3 * np.std(response) * rng.standard_normal(3000)
    found = identify([Record("tap", period, response, force_n=force)]).modes[0]
    for estimate, value in zip(estimates(found), truth_of(mode), strict=True):
        assert estimate.value == pytest.approx(value, rel=0.004)


def test_paper_003_from_its_record() -> None:
    """Paper 003, section 3: 5 kg, 20 N s/m, 4000 N/m, a blow of 1 N s at the first sample, 1024 samples of 5 ms."""
    omega, zeta = np.sqrt(800.0), 20.0 / (2.0 * np.sqrt(5.0 * 4000.0))
    s = -zeta * omega + 1j * omega * np.sqrt(1.0 - zeta**2)
    response = np.imag(s**2 * np.exp(s * 0.005 * np.arange(1024))) / (s.imag * 5.0)
    force = np.zeros(1024)
    force[0] = 200.0
    result = identify([Record("paper 003", 0.005, response, force_n=force)])
    (found,) = result.modes
    assert found.frequency_hz.value == pytest.approx(4.5016, abs=5e-5)
    assert found.damping_ratio.value == pytest.approx(0.0707, abs=5e-5)
    assert found.mass_kg.value == pytest.approx(5.0, rel=0.002)
    assert found.stiffness_n_per_m.value == pytest.approx(4000.0, rel=0.002)


@pytest.mark.parametrize("quantity", ["velocity", "displacement"])
def test_other_sensors(quantity: str) -> None:
    mode = TrueMode(80.0, 0.03, 20.0)
    record = tap([mode], np.random.default_rng(2))
    # A band-limited acceleration, integrated in the frequency domain where the record ends at rest.
    spectrum = np.fft.rfft(np.concatenate([record.response, np.zeros(len(record.response))]))
    omega = 2.0 * np.pi * np.fft.rfftfreq(2 * len(record.response), record.period_s)
    power = 1 if quantity == "velocity" else 2
    spectrum[1:] /= (1j * omega[1:]) ** power
    spectrum[0] = 0.0
    response = np.fft.irfft(spectrum)[: len(record.response)]
    assert len(response) == len(record.response)
    noise = 1e-3 * np.std(response) * np.random.default_rng(3).standard_normal(len(response))
    other = replace(record, response=response - response[:32].mean() + noise, quantity=quantity)  # type: ignore[arg-type]
    found = identify([other]).modes
    best = min(found, key=lambda candidate: abs(candidate.frequency_hz.value - 80.0))
    for estimate, value in zip(estimates(best), truth_of(mode), strict=True):
        assert estimate.value == pytest.approx(value, rel=0.03)


def test_decay_of_a_rapid_stop_has_both_modes() -> None:
    """Paper 000: 46 Hz and 131 Hz."""
    rng = np.random.default_rng(5)
    result = identify([decay([(46.0, 0.02, 1.0), (131.0, 0.02, 0.5)], rng, noise=0.01)])
    assert [mode.frequency_hz.value for mode in result.modes] == pytest.approx([46.0, 131.0], rel=1e-3)
    assert [mode.damping_ratio.value for mode in result.modes] == pytest.approx([0.02, 0.02], rel=0.05)
    assert all(mode.mass_kg is None for mode in result.modes)
    assert result.refused == ()


def test_noise_alone_has_no_modes() -> None:
    rng = np.random.default_rng(3)
    force = np.zeros(4096)
    force[64:74] = 500.0 * np.sin(np.pi * np.arange(10) / 10.0) ** 2
    with pytest.raises(RecordError, match="noise only"):
        identify([Record("noise", 1.0 / 2048.0, rng.standard_normal(4096), force_n=force)])


def test_a_mode_against_the_push_is_refused() -> None:
    rng = np.random.default_rng(7)
    near, opposed = TrueMode(60.0, 0.02, 10.0), TrueMode(150.0, 0.02, -40.0)
    result = identify([tap([near, opposed], rng, snr_db=40.0)])
    assert [mode.frequency_hz.value for mode in result.modes] == pytest.approx([60.0], rel=1e-3)
    assert [mode.frequency_hz.value for mode in result.refused] == pytest.approx([150.0], rel=1e-3)
    assert "not at the same point" in result.refused[0].refusal


def test_limit_of_certainty_is_the_callers() -> None:
    rng = np.random.default_rng(11)
    record = tap([TrueMode(90.0, 0.02, 10.0)], rng, snr_db=15.0)
    strict, generous = identify([record], accepted_percent=0.01), identify([record], accepted_percent=30.0)
    assert strict.modes == () and "limit 0.01 %" in strict.refused[0].refusal
    assert len(generous.modes) == 1


def test_number_of_modes_and_band() -> None:
    rng = np.random.default_rng(12)
    record = tap([TrueMode(60.0, 0.02, 10.0), TrueMode(150.0, 0.02, 10.0)], rng, snr_db=40.0)
    assert identify([record], modes=1).order == 1
    in_band = identify([record], band_hz=(100.0, 200.0), max_modes=1)
    assert in_band.modes == () or in_band.modes[0].frequency_hz.value > 100.0
    with pytest.raises(RecordError, match="2048 samples per second are too slow for 2000 Hz"):
        identify([record], band_hz=(100.0, 2000.0))
