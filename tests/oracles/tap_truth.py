"""Taps on structures whose modes are known: SciPy's simulation on a finer grid, an anti-aliasing filter, then noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.signal import cont2discrete, fftconvolve, firwin, lfilter

from shapegcode.io.record import Record

FloatArray = npt.NDArray[np.float64]
RATE_HZ = 2048.0
SAMPLES = 4096
FINER = 32  # steps of the simulation per sample
PRE_TRIGGER = 64  # samples before the tap
# As a recorder has it, on both channels: flat to .35, -80 dB from .5 of the sampling rate on.
ANTI_ALIASING = firwin(16 * 2 * FINER + 1, 0.425 / FINER * 2, window=("kaiser", 7.86))


@dataclass(frozen=True)
class TrueMode:
    """One mode of the structure, as the hammer sees it."""

    frequency_hz: float
    damping_ratio: float
    mass_kg: float

    @property
    def omega(self) -> float:
        return 2.0 * np.pi * self.frequency_hz

    @property
    def stiffness_n_per_m(self) -> float:
        return self.mass_kg * self.omega**2

    @property
    def damping_n_s_per_m(self) -> float:
        return 2.0 * self.damping_ratio * self.omega * self.mass_kg


def acceleration(modes: Sequence[TrueMode], force_n: FloatArray, period_s: float) -> FloatArray:
    """Response to a force that is linear between samples, mode by mode by SciPy."""
    response = np.zeros(len(force_n))
    for mode in modes:
        system = ([1.0 / mode.mass_kg, 0.0, 0.0], [1.0, 2.0 * mode.damping_ratio * mode.omega, mode.omega**2])
        numerator, denominator, _ = cont2discrete(system, period_s, method="foh")
        response += lfilter(numerator.ravel(), denominator, force_n)
    return response


def tap(
    modes: Sequence[TrueMode],
    rng: np.random.Generator,
    *,
    snr_db: float = np.inf,
    rate_hz: float = RATE_HZ,
    samples: int = SAMPLES,
    pulse_samples: int = 10,
    peak_n: float = 500.0,
    anti_aliasing: bool = True,
) -> Record:
    """One tap with a smooth pulse. Noise is white, on the response and on the force, `snr_db` below the RMS of each
    over the record."""
    fine = np.arange(samples * FINER) / (rate_hz * FINER)
    begin, length = PRE_TRIGGER / rate_hz, pulse_samples / rate_hz
    inside = (fine > begin) & (fine < begin + length)
    force = np.where(inside, peak_n * np.sin(np.pi * (fine - begin) / length) ** 2, 0.0)
    response = acceleration(modes, force, fine[1])
    if anti_aliasing:
        force, response = (fftconvolve(signal, ANTI_ALIASING, mode="same") for signal in (force, response))
    force, response = force[::FINER], response[::FINER]
    noise = 10.0 ** (-snr_db / 20.0)
    return Record(
        source="synthetic",
        period_s=1.0 / rate_hz,
        response=response + noise * np.sqrt(np.mean(response**2)) * rng.standard_normal(samples),
        force_n=force + noise * np.sqrt(np.mean(force**2)) * rng.standard_normal(samples),
    )


def random_modes(rng: np.random.Generator, n: int) -> list[TrueMode]:
    """Modes between 20 and 400 Hz, at least 10 % apart, damping .5 to 5 %, stiffness within a decade."""
    while True:
        frequency = np.sort(np.exp(rng.uniform(np.log(20.0), np.log(400.0), n)))
        if n == 1 or np.min(frequency[1:] / frequency[:-1]) >= 1.1:
            break
    found = []
    for f in frequency:
        stiffness = np.exp(rng.uniform(np.log(1e7), np.log(1e8)))
        found.append(TrueMode(f, np.exp(rng.uniform(np.log(0.005), np.log(0.05))), stiffness / (2 * np.pi * f) ** 2))
    return found
