"""Data of a fit over time: taps with force, or free decays, as the core's fit functions take them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from scipy.signal import firwin, kaiserord, oaconvolve

from shapegcode import _core
from shapegcode.errors import RecordError
from shapegcode.identification.checks import MIN_PULSE, Prepared
from shapegcode.identification.spectra import decay_spectrum
from shapegcode.io.units import FloatArray

Starts = list[tuple[float, float]]  # (omega_rad_s, damping ratio) of each mode
Fit = _core.ModalFit | _core.DecayFit
MIN_CYCLES = 2.0  # Least cycles of a mode in the record to find its frequency
HIGHEST_SHARE = 0.45  # Ratio to the sampling rate up to which the force between samples is known
_STEPS, _QUICK_STEPS = 60, 15  # iterations of a fit; of one that only locates a mode


@dataclass(frozen=True, eq=False)
class Thinned:
    """Decimated tap records."""

    responses: list[FloatArray]  # (n,) each
    forces: list[FloatArray]  # (n,) each, force band-limited between samples, as from a recorder
    straight: list[FloatArray]  # (n,) each, force linear between samples
    period_s: float  # time between two samples
    # power of white noise after the filter, relative to its power below half the new rate
    white_share: float
    noise_correlation: float  # correlation of consecutive samples of filtered white noise
    # noise of a sample of the pulse relative to the original, so that its impulse is as uncertain as before
    force_noise: float
    first_s: list[float]  # time of the first new sample relative to the first old one, per record


@dataclass(frozen=True, eq=False)
class FitProblem:
    """Records to fit over time: impacts with their force, or free decays, for which no force is recorded."""

    responses: list[FloatArray]  # (n,) each, in the unit of the quantity
    forces: list[FloatArray] | None  # (n,) each, N; None: decays
    period_s: float  # time between two samples
    band_hz: tuple[float, float]  # searched band
    widened: float  # factor on intervals; see `Record`
    quantity: str = "acceleration"  # what the sensor measured; any for decays, whose amplitudes are fitted
    force_noise_n: float = 0.0  # RMS noise of a sample of the pulse; measured outside it, less if decimated
    hold: str = "band_limited"  # force between samples: "band_limited", "linear" or "impulse"
    thinned: Thinned | None = None  # decimated records; None: every sample is fitted
    starts_in_pulse: bool = False  # any record begins within its pulse

    def fit(self, starts: Starts, *, left_by: Fit | None = None, coloured: bool = False, quick: bool = False) -> Fit:
        """Fit a model, from *starts*, to the responses or to the residual of the fit *left_by*; *quick*: few steps."""
        omega, zeta = np.array(starts).T
        responses, steps = self.left(left_by), _QUICK_STEPS if quick else _STEPS
        if self.forces is None:
            return _core.fit_decay(
                responses, self.period_s, omega, zeta, coloured_residuals=coloured, most_iterations=steps
            )
        return _core.fit_modes(
            self.forces, responses, self.period_s, omega, zeta, quantity=self.quantity, hold=self.held,
            # Samples after an impulse do not contain force/mass, so a multiple of the force is fitted too.
            with_mass_line=self.hold == "impulse" and self.held != "impulse" and self.quantity == "acceleration",
            force_noise_n=0.0 if quick else self.force_noise_n, coloured_residuals=coloured, most_iterations=steps,
        )  # fmt: skip

    def rank(self, candidates: Starts, kept: int) -> Sequence[int]:
        """Indices of the first `kept` candidates, and of the further one, if any, that improves their fit most."""
        omega, zeta = np.array(candidates).T
        records = self.responses, self.period_s
        ranking = _core.rank_modes(*records, omega, zeta, kept + 1, self.forces, self.quantity, kept)
        return [int(index) for index in ranking.chosen]

    @property
    def samples(self) -> int:
        """Number of samples of all records."""
        return sum(map(len, self.responses))

    @property
    def squares(self) -> float:
        """Sum of squares of the responses without offsets."""
        return sum(float(np.sum((response - response.mean()) ** 2)) for response in self.responses)

    @property
    def duration_s(self) -> float:
        """Duration of the longest record, s."""
        return max(map(len, self.responses)) * self.period_s

    @property
    def white_share(self) -> float:
        """Independent fraction of the samples: below 1 if decimated (filtered noise) or resampled from uneven times."""
        return (1.0 if self.thinned is None else self.thinned.white_share) / self.widened**2

    @property
    def held(self) -> str:
        """Intersample behaviour of the fitted force: decimated records are always band-limited."""
        return self.hold if self.thinned is None else "band_limited"

    def left(self, last: Fit | None) -> list[FloatArray]:
        """Residuals of the responses after a model."""
        if last is None:
            return self.responses
        return [response - np.real(model) for response, model in zip(self.responses, last.fitted, strict=True)]

    def peaks_left(self, last: Fit | None) -> list[float]:
        """Frequencies (rad/s) of the two highest peaks of the residual's spectrum in the band, by falling height."""
        residuals = self.left(last)
        length = 2 * max(map(len, residuals))
        power = np.zeros(length // 2 + 1)
        for residual in residuals:
            power += np.abs(np.fft.rfft(residual - residual.mean(), length)) ** 2
        frequency = np.fft.rfftfreq(length, self.period_s)
        power[(frequency < self.band_hz[0]) | (frequency > self.band_hz[1])] = 0.0
        inner = np.flatnonzero((power[1:-1] >= power[:-2]) & (power[1:-1] > power[2:])) + 1
        highest = inner[np.argsort(power[inner])[::-1][:2]]
        return [float(2.0 * np.pi * frequency[index]) for index in highest]

    def other_courses(self, near: Fit) -> list[Self]:
        """The same problem, once for each of the other possible behaviours of the force between samples."""
        if self.thinned is None:
            return [replace(self, hold="linear"), replace(self, hold="impulse")]
        if self.hold == "impulse":
            return []
        straight, responses = self.thinned.straight, self.responses
        # An acceleration contains force/mass at the samples, whatever the force does between them.
        if self.quantity == "acceleration" and isinstance(near, _core.ModalFit) and self.forces is not None:
            free = float(np.sum(near.inverse_mass))
            parts = zip(responses, self.forces, straight, strict=True)
            responses = [response - free * (sampled - course) for response, sampled, course in parts]
        return [replace(self, forces=straight, responses=responses, hold="linear")]

    def record(self, index: int) -> Self:
        """One record alone."""
        forces = None if self.forces is None else [self.forces[index]]
        return replace(self, forces=forces, responses=[self.responses[index]])


def problem_of(ready: Prepared, band_hz: tuple[float, float] | None, *, within: bool = False) -> FitProblem:
    """Records of a fit and band to search: `band_hz` if `within`, else widened, as modes outside of it matter."""
    first = ready.records[0]
    responses = [record.response for record in ready.records]
    longest_s = max(len(response) for response in responses) * first.period_s
    if band_hz is not None and not 0.0 <= band_hz[0] < band_hz[1] <= 0.5 / first.period_s:
        raise RecordError(
            f"band of {band_hz[0]:g} to {band_hz[1]:g} Hz: must ascend and end below half the sampling rate, "
            f"{0.5 / first.period_s:g} Hz"
        )
    band = (MIN_CYCLES / longest_s, HIGHEST_SHARE / first.period_s)
    if band_hz is not None:
        band = band_hz if within else (min(band[0], band_hz[0]), max(band[1], band_hz[1]))
    widest = max(record.widened for record in ready.records)
    if first.force_n is None:
        return FitProblem(responses, None, first.period_s, band, widest)
    forces = [record.force_n for record in ready.records if record.force_n is not None]
    noise = [each.force_noise_n for each in ready.usable if each.force_noise_n is not None]
    noise_n = float(np.sqrt(np.mean(np.square(noise)))) if noise else 0.0
    taps = FitProblem(
        responses, forces, first.period_s, band, widest, first.quantity, noise_n,
        starts_in_pulse=any(force[0] != 0.0 for force in forces),
    )  # fmt: skip
    thinned = thin(ready, highest_of_interest_hz(ready, None if band_hz is None else band_hz[1]))
    if thinned is None:
        return taps
    return replace(
        taps, forces=thinned.forces, responses=thinned.responses, period_s=thinned.period_s, thinned=thinned,
        band_hz=(band[0], min(band[1], FLAT / thinned.period_s)), force_noise_n=noise_n * thinned.force_noise,
        hold="impulse" if are_pulses(ready) else taps.hold,
    )  # fmt: skip


FLAT = 0.35  # Ratio to the new sampling rate up to which the filter is flat
_STOP_DB = 80.0  # ... and has fallen to -80 dB at half of it, as the filters of recorders do
_BAND = 0.34  # Highest end of the band, relative to the new rate
_FEW = 4096  # Fewer samples than this need no decimation


def highest_of_interest_hz(ready: Prepared, asked_hz: float | None) -> float:
    """Highest frequency to keep in taps, Hz: end of the band or, if higher, the highest peak with a margin."""
    excited, margin = max(each.excited_hz or 0.0 for each in ready.usable), 1.25
    if are_pulses(ready):  # short pulses excite all frequencies up to half the rate
        excited, margin = 0.0, 2.0
    peaks = [
        peak.frequency_hz
        for each in ready.usable
        for response in (each.record.response[each.hit.first if each.hit else 0 :],)
        for peak in decay_spectrum(replace(each.record, response=response, force_n=None)).peaks
    ]
    return max(excited if asked_hz is None else asked_hz, margin * max(peaks, default=0.0))


def thin(ready: Prepared, highest_hz: float) -> Thinned | None:
    """Decimate to the rate needed, with one linear-phase filter for force and response; None: no decimation."""
    period = ready.records[0].period_s
    factor = int(_BAND / (highest_hz * period)) if highest_hz > 0.0 else 1
    longest = max(len(record.response) for record in ready.records)
    factor = min(factor, longest // (_FEW // 2))
    if factor < 2 or longest <= _FEW or (are_pulses(ready) and ready.records[0].quantity == "velocity"):
        return None
    plain, straight = _filters(factor)
    reach = len(plain) // 2
    responses, forces, courses, first_s, widths = [], [], [], [], []
    for record in ready.records:
        force = record.force_n
        assert force is not None
        acts = np.flatnonzero(force)
        # Samples at rest before the record, so that the filtered pulse stays within it.
        before = max(0, 2 * reach + factor - int(acts[0]))
        lead = np.zeros(before)
        places = slice(reach, before + len(force) - reach, factor)
        response = oaconvolve(np.concatenate((lead, record.response)), plain, "same")[places]
        both = [oaconvolve(np.concatenate((lead, force)), taps, "same")[places] for taps in (plain, straight)]
        inside = np.arange(before + len(force))[places]
        near = (inside >= before + acts[0] - reach) & (inside <= before + acts[-1] + reach)
        forces.append(np.where(near, both[0], 0.0))
        courses.append(np.where(near, both[1], 0.0))
        responses.append(np.ascontiguousarray(response))
        first_s.append((reach - before) * period)
        widths.append((acts[-1] - acts[0] + 1) / np.count_nonzero(near))
    whole = float(np.sum(plain**2))
    correlation = float(np.sum(plain[factor:] * plain[:-factor])) / whole
    force_noise = float(np.sqrt(np.mean(widths))) / factor
    return Thinned(responses, forces, courses, period * factor, whole * factor, correlation, force_noise, first_s)


def are_pulses(ready: Prepared) -> bool:
    """Whether any pulse has only one or two samples."""
    forces = (record.force_n for record in ready.records)
    return any(np.count_nonzero(force) < MIN_PULSE for force in forces if force is not None)


def _filters(factor: int) -> tuple[FloatArray, FloatArray]:
    """The decimation filter; and one for a force linear between samples, whose spectrum has a factor (sin x / x)²."""
    count, beta = kaiserord(_STOP_DB, (0.5 - FLAT) * 2.0 / factor)
    count |= 1
    plain = firwin(count, (0.5 + FLAT) / factor, window=("kaiser", beta))
    size = 8 * count  # of the transform: eight points per coefficient
    spectrum = np.fft.rfft(plain, size) * np.sinc(np.fft.rfftfreq(size)) ** 2
    return np.asarray(plain, dtype=np.float64), np.asarray(np.fft.irfft(spectrum, size)[:count], dtype=np.float64)
