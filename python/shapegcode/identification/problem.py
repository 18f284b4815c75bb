"""What is fitted: taps with force, or free decays, each as the core's fits want them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import firwin, kaiserord, oaconvolve

from shapegcode import _core
from shapegcode.errors import RecordError
from shapegcode.identification.checks import MIN_PULSE, Prepared
from shapegcode.identification.spectra import decay_spectrum
from shapegcode.io.units import FloatArray

Starts = list[tuple[float, float]]  # (omega_rad_s, damping ratio) of each mode
Fit = _core.ModalFit | _core.DecayFit
MIN_SWINGS = 2.0  # Swings of a mode in the record: fewer do not tell its frequency
HIGHEST_SHARE = 0.45  # Of the sampling rate: the force between samples is known up to there
_STEPS, _QUICK_STEPS = 60, 15  # of a fit; of one that only shows where a mode may be
_PEAKS = 2  # of the residual's spectrum that are tried


@dataclass(frozen=True, eq=False)
class FitProblem:
    """Records over time: taps with force, or free decays without."""

    responses: list[FloatArray]  # (n,) each, in the unit of the quantity
    forces: list[FloatArray] | None  # (n,) each, N; None: decays
    period_s: float  # time between two samples
    band_hz: tuple[float, float]  # modes are looked for in it
    widened: float  # what intervals are multiplied with; see `Record`
    quantity: str = "acceleration"  # what the sensor measured; of decays whatever it is: amplitudes are fitted
    force_noise_n: float = 0.0  # RMS of the force off the pulse
    hold: str = "band_limited"  # course of the force between samples: "band_limited", "linear" or "impulse"
    thinned: Thinned | None = None  # what was thinned out before the fit; None: every sample is fitted
    starts_in_pulse: bool = False  # the record begins within the pulse

    def fit(self, starts: Starts, *, left_by: Fit | None = None, coloured: bool = False, quick: bool = False) -> Fit:
        """The best model near some modes, its residual white or coloured; or in a few steps, of what another leaves."""
        omega, zeta = np.array(starts).T
        responses, steps = self.left(left_by), _QUICK_STEPS if quick else _STEPS
        if self.forces is None:
            return _core.fit_decay(
                responses, self.period_s, omega, zeta, coloured_residuals=coloured, most_iterations=steps
            )
        return _core.fit_modes(
            self.forces, responses, self.period_s, omega, zeta, quantity=self.quantity, hold=self.held,
            # What is read after a blow lacks the force over the mass: so much of the force is fitted along.
            with_mass_line=self.hold == "impulse" and self.held != "impulse" and self.quantity == "acceleration",
            force_noise_n=0.0 if quick else self.force_noise_n, coloured_residuals=coloured, most_iterations=steps,
        )  # fmt: skip

    def rank(self, candidates: Starts, kept: int) -> Sequence[int]:
        """Indices of the candidates that explain most in addition to those already chosen."""
        omega, zeta = np.array(candidates).T
        records = self.responses, self.period_s
        ranking = _core.rank_modes(*records, omega, zeta, kept + 1, self.forces, self.quantity, kept)
        return [int(index) for index in ranking.chosen]

    @property
    def samples(self) -> int:
        """Of all records together."""
        return sum(map(len, self.responses))

    @property
    def squares(self) -> float:
        """Sum over the responses, offsets taken out."""
        return sum(float(np.sum((response - response.mean()) ** 2)) for response in self.responses)

    @property
    def duration_s(self) -> float:
        """Of the longest record."""
        return max(map(len, self.responses)) * self.period_s

    @property
    def white_share(self) -> float:
        """Share of white noise that reaches the samples: so many of them are independent."""
        return (1.0 if self.thinned is None else self.thinned.white_share) / self.widened**2

    @property
    def held(self) -> str:
        """Course of the force that is fitted: what was thinned out is band-limited, whatever it was."""
        return self.hold if self.thinned is None else "band_limited"

    def left(self, last: Fit | None) -> list[FloatArray]:
        """What a model leaves of the responses."""
        if last is None:
            return self.responses
        return [response - np.real(model) for response, model in zip(self.responses, last.fitted, strict=True)]

    def peaks_left(self, last: Fit | None) -> list[float]:
        """Frequencies (rad/s) of the highest peaks within the band of what a model leaves, the highest first."""
        residuals = self.left(last)
        length = 2 * max(map(len, residuals))
        power = np.zeros(length // 2 + 1)
        for residual in residuals:
            power += np.abs(np.fft.rfft(residual - residual.mean(), length)) ** 2
        frequency = np.fft.rfftfreq(length, self.period_s)
        power[(frequency < self.band_hz[0]) | (frequency > self.band_hz[1])] = 0.0
        inner = np.flatnonzero((power[1:-1] >= power[:-2]) & (power[1:-1] > power[2:])) + 1
        highest = inner[np.argsort(power[inner])[::-1][:_PEAKS]]
        return [float(2.0 * np.pi * frequency[index]) for index in highest]

    def other_courses(self, near: Fit) -> list[FitProblem]:
        """The same taps with every other course that the force may take between its samples."""
        if self.thinned is None:
            return [replace(self, hold="linear"), replace(self, hold="impulse")]
        if self.hold == "impulse":
            return []
        straight, responses = self.thinned.straight, self.responses
        # An acceleration holds the force over the mass as it was at the samples, whatever its course between them.
        if self.quantity == "acceleration" and isinstance(near, _core.ModalFit) and self.forces is not None:
            free = float(np.sum(near.inverse_mass))
            parts = zip(responses, self.forces, straight, strict=True)
            responses = [response - free * (sampled - course) for response, sampled, course in parts]
        return [replace(self, forces=straight, responses=responses, hold="linear")]

    def record(self, index: int) -> FitProblem:
        """One record alone."""
        forces = None if self.forces is None else [self.forces[index]]
        return replace(self, forces=forces, responses=[self.responses[index]])


def problem_of(ready: Prepared, band_hz: tuple[float, float] | None, *, within: bool = False) -> FitProblem:
    """The records of a fit, and the band to look in; a strong mode outside is part of what is measured within it."""
    first = ready.records[0]
    responses = [record.response for record in ready.records]
    longest_s = max(len(response) for response in responses) * first.period_s
    if band_hz is not None and not 0.0 <= band_hz[0] < band_hz[1] <= 0.5 / first.period_s:
        raise RecordError(
            f"band of {band_hz[0]:g} to {band_hz[1]:g} Hz: must ascend and end below half the sampling rate, "
            f"{0.5 / first.period_s:g} Hz"
        )
    band = (MIN_SWINGS / longest_s, HIGHEST_SHARE / first.period_s)
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
        hold="impulse" if are_blows(ready) else taps.hold,
    )  # fmt: skip


FLAT = 0.35  # Of the new sampling rate: the filter is flat up to here
_STOP_DB = 80.0  # ... and has fallen to -80 dB at half of it, as the filters of recorders do
_BAND = 0.34  # The band ends at this share of the new rate at most
_FEW = 4096  # Fewer samples than this need no thinning
_MARGIN = 1.25  # What stands out of the response above the band that the hit excites is looked at with this margin
_MARGIN_OF_BLOWS = 2.0
_GRID = 8  # points of the filter's transform per tap


@dataclass(frozen=True, eq=False)
class Thinned:
    """Taps with fewer samples."""

    responses: list[FloatArray]  # (n,) each
    forces: list[FloatArray]  # (n,) each, of a recorder's force
    straight: list[FloatArray]  # (n,) each, of a force that runs straight from sample to sample
    period_s: float  # time between two samples
    # share of the band up to half the new rate that the filter lets pass, in power: what is left of white noise
    white_share: float
    noise_correlation: float  # between two samples on end of white noise behind the filter
    # noise per sample of the pulse, as a share of what it was: the pulse's momentum is known as before
    force_noise: float
    first_s: list[float]  # time of the first new sample after that of the old first, per record; negative: before it


def highest_of_interest_hz(ready: Prepared, asked_hz: float | None) -> float:
    """Highest frequency at which an impact must be sampled; peaks of the response above the band are fitted, too."""
    excited = max(each.excited_hz or 0.0 for each in ready.usable)
    margin = _MARGIN
    if are_blows(ready):  # they excite all that the rate holds
        excited, margin = 0.0, _MARGIN_OF_BLOWS
    peaks = [
        peak.frequency_hz
        for each in ready.usable
        for response in (each.record.response[each.hit.first if each.hit else 0 :],)
        for peak in decay_spectrum(replace(each.record, response=response, force_n=None)).peaks
    ]
    return max(excited if asked_hz is None else asked_hz, margin * max(peaks, default=0.0))


def thin(ready: Prepared, highest_hz: float) -> Thinned | None:
    """Leave out samples that the band does not need, behind one filter of linear phase for force and response."""
    period = ready.records[0].period_s
    factor = int(_BAND / (highest_hz * period)) if highest_hz > 0.0 else 1
    longest = max(len(record.response) for record in ready.records)
    factor = min(factor, longest // (_FEW // 2))
    if factor < 2 or longest <= _FEW or (are_blows(ready) and ready.records[0].quantity == "velocity"):
        return None
    plain, straight = _filters(factor)
    reach = len(plain) // 2
    responses, forces, courses, first_s, widths = [], [], [], [], []
    for record in ready.records:
        force = record.force_n
        assert force is not None
        acts = np.flatnonzero(force)
        # Samples at rest to put before the record, so that nothing of the pulse is spread beyond it.
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


def are_blows(ready: Prepared) -> bool:
    """Whether the pulses are single blows of one or two samples."""
    forces = (record.force_n for record in ready.records)
    return any(np.count_nonzero(force) < MIN_PULSE for force in forces if force is not None)


def _filters(factor: int) -> tuple[FloatArray, FloatArray]:
    """The filter, and what it is of a force that runs straight between its samples: (sin x / x)² of its spectrum."""
    count, beta = kaiserord(_STOP_DB, (0.5 - FLAT) * 2.0 / factor)
    count |= 1
    plain = firwin(count, (0.5 + FLAT) / factor, window=("kaiser", beta))
    size = _GRID * count
    spectrum = np.fft.rfft(plain, size) * np.sinc(np.fft.rfftfreq(size)) ** 2
    return np.asarray(plain, dtype=np.float64), np.asarray(np.fft.irfft(spectrum, size)[:count], dtype=np.float64)
