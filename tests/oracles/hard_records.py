"""Impact tests as a workshop records them, on structures whose modes are known: many modes, some close, poor sensors.

5 to 30 modes of .5 to 8 % damping, pairs within a bandwidth, modes above the band, free or clamped; 1 to 5 hits with a
tip of 800 to 5 000 Hz, some of them double; 12-bit converters, noise, drift of the sensor, mains hum; 51.2 kHz, 1 s.
Simulated by the inverse Laplace transform on a vertical line (no code of ours), the force in closed form.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shapegcode.io.record import Record
from tap_truth import TrueMode

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]
RATE_HZ = 51200.0
SAMPLES = 51200
PRE_TRIGGER_S = 0.02
_PADDED = 4  # times the record, so that what wraps around has died away on the line
_BITS = 12


@dataclass(frozen=True)
class HardRecord:
    """A simulated test and its truth."""

    modes: tuple[TrueMode, ...]  # all of the structure, ascending
    rigid_mass_kg: float | None  # of a free structure; None: clamped
    records: tuple[Record, ...]  # one a hit
    double: tuple[bool, ...]  # whether it is a double hit
    tip_hz: float  # up to where a hit excites (-20 dB)
    noise: float  # RMS of all that is random in the response, in its unit
    forces: tuple[FloatArray, ...]  # without noise


def accelerance(
    modes: tuple[TrueMode, ...], rigid_mass_kg: float | None, s: ComplexArray, tangents: FloatArray | None = None
) -> ComplexArray:
    """Acceleration over force of the structure at points of the Laplace plane; `tangents`: phases of complex modes."""
    turns = np.zeros(len(modes)) if tangents is None else tangents
    total = (
        np.zeros(len(s), dtype=np.complex128) if rigid_mass_kg is None else np.full(len(s), 1.0 / rigid_mass_kg + 0j)
    )
    for mode, tangent in zip(modes, turns, strict=True):
        total += (
            s**2
            / mode.mass_kg
            * (1.0 + tangent * s / mode.omega)
            / (s**2 + 2.0 * mode.damping_ratio * mode.omega * s + mode.omega**2)
        )
    return total


def structure(rng: np.random.Generator) -> tuple[tuple[TrueMode, ...], float | None]:
    """Random modes, and the mass of a free structure."""
    count = int(rng.integers(5, 31))
    low, high = (80.0, 6000.0) if rng.random() < 0.5 else (250.0, 6000.0)
    hertz: list[float] = []
    damping: list[float] = []
    while len(hertz) < count:
        zeta = float(np.exp(rng.uniform(np.log(0.005), np.log(0.08))))
        if hertz and rng.random() < 0.2:  # beside another one, within a bandwidth
            other = int(rng.integers(len(hertz)))
            place = hertz[other] * (1.0 + 2.0 * damping[other] * float(rng.uniform(0.3, 1.0)))
        else:
            place = float(np.exp(rng.uniform(np.log(low), np.log(high))))
        hertz.append(place)
        damping.append(zeta)
    above = int(rng.integers(2, 6))
    hertz += list(rng.uniform(6500.0, 14000.0, above))
    damping += list(np.exp(rng.uniform(np.log(0.005), np.log(0.05), above)))
    total = float(np.exp(rng.uniform(np.log(2.0), np.log(200.0))))
    masses = total * np.exp(rng.normal(0.0, 0.6, len(hertz)))
    modes = sorted(
        (TrueMode(*each) for each in zip(hertz, damping, map(float, masses), strict=True)), key=lambda m: m.omega
    )
    return tuple(modes), (None if rng.random() < 0.5 else total * float(rng.uniform(0.5, 3.0)))


def hard_record(seed: int, delay_s: float = 0.0, tangent: float = 0.0) -> HardRecord:
    """A random test, with a response that comes late, and modes that are complex by a random tangent of their phase."""
    rng = np.random.default_rng(seed)
    modes, rigid = structure(rng)
    tip_hz = float(np.exp(rng.uniform(np.log(800.0), np.log(5000.0))))
    length_s = 1.685 / tip_hz  # a pulse of the shape sin² has fallen to a tenth there
    hits = int(rng.integers(1, 6))
    doubled = int(rng.integers(hits)) if hits > 1 and rng.random() < 0.3 else -1
    count = _PADDED * SAMPLES
    sigma = 12.0 * RATE_HZ / count
    s = sigma + 2j * np.pi * np.fft.rfftfreq(count, 1.0 / RATE_HZ)
    grow = np.exp(sigma * np.arange(SAMPLES) / RATE_HZ)
    tangents = tangent * np.random.default_rng((seed, 1)).standard_normal(len(modes))
    response_of = accelerance(modes, rigid, s, tangents) * np.exp(-s * delay_s)

    def pulse(begin_s: float, peak_n: float) -> ComplexArray:
        turn = 2.0 * np.pi / length_s
        end = np.exp(-s * length_s)
        return np.exp(-s * begin_s) * 0.5 * peak_n * (1.0 - end) * (1.0 / s - s / (s**2 + turn**2))

    def samples(spectrum: ComplexArray) -> FloatArray:
        return np.fft.irfft(spectrum, count)[:SAMPLES] * RATE_HZ * grow

    clean, noisy = [], []
    for hit in range(hits):
        peak = 500.0 * float(np.exp(rng.normal(0.0, 0.25)))
        force = pulse(PRE_TRIGGER_S, peak)
        if hit == doubled:
            force = force + pulse(PRE_TRIGGER_S + float(rng.uniform(0.006, 0.03)), peak * float(rng.uniform(0.15, 0.6)))
        clean.append((samples(force), samples(force * response_of)))
    time_s = np.arange(SAMPLES) / RATE_HZ
    top = max(float(np.max(np.abs(response))) for _, response in clean)
    top_n = max(float(np.max(np.abs(force))) for force, _ in clean)
    noise = float(10.0 ** rng.uniform(-4.0, -3.0))
    drift, hum = top * rng.uniform(0.0, 0.01), top * rng.uniform(0.0, 0.003)
    for force, response in clean:
        phases = rng.uniform(0.0, 2.0 * np.pi, 2)
        recorded = response + top * noise * rng.standard_normal(SAMPLES)
        recorded += drift * float(rng.uniform(-1, 1)) * (1.0 - np.exp(-time_s / float(rng.uniform(0.3, 3.0))))
        recorded += hum * (np.sin(314.159 * time_s + phases[0]) + 0.4 * np.sin(942.478 * time_s + phases[1]))
        pushed = force + top_n * noise * rng.standard_normal(SAMPLES)
        noisy.append((_converted(pushed, 1.5 * top_n), _converted(recorded, 1.5 * top)))
    records = tuple(
        Record(f"hit {number}", 1.0 / RATE_HZ, response, "acceleration", force)
        for number, (force, response) in enumerate(noisy, start=1)
    )
    step = 1.5 * top / 2 ** (_BITS - 1)
    return HardRecord(
        modes, rigid, records, tuple(hit == doubled for hit in range(hits)), tip_hz,
        float(np.hypot(top * noise, step / np.sqrt(12.0))), tuple(force for force, _ in clean),
    )  # fmt: skip


def _converted(values: FloatArray, full_scale: float) -> FloatArray:
    step = full_scale / 2 ** (_BITS - 1)
    return np.asarray(step * np.round(values / step), dtype=np.float64)


def bounds(hard: HardRecord) -> FloatArray:
    """(modes, 2) Cramér-Rao bounds, relative, of frequency and damping ratio, from the hits that are not double.

    Of the whole structure: frequency, damping and mass of every mode, the rigid mass, an offset a hit.
    """
    count = 2 * SAMPLES
    s = 2j * np.pi * np.fft.rfftfreq(count, 1.0 / RATE_HZ)[1 : count // 4]
    columns = []
    for mode in hard.modes:
        below = s**2 + 2.0 * mode.damping_ratio * mode.omega * s + mode.omega**2
        column = s**2 / mode.mass_kg / below
        columns += [
            -column / below * (2.0 * mode.damping_ratio * mode.omega * s + 2.0 * mode.omega**2),
            -column / below * (2.0 * mode.damping_ratio * mode.omega * s),
            column,
        ]
    if hard.rigid_mass_kg is not None:
        columns.append(np.full(len(s), 1.0 + 0j))
    jacobian = np.array(columns).T
    used = [force for force, double in zip(hard.forces, hard.double, strict=True) if not double]
    power = sum(np.abs(np.fft.rfft(force, count)[1 : count // 4]) ** 2 for force in used)
    # White noise of every sample, on a transform of a record that is filled up to twice its length: half of the lines.
    weight = np.sqrt(power / (hard.noise**2 * count / 2.0) / 2.0)
    weighted = weight[:, None] * jacobian
    gram = np.real(weighted.conj().T @ weighted)
    scale = np.sqrt(np.diag(gram))
    inverse = np.linalg.pinv(gram / np.outer(scale, scale), hermitian=True, rcond=1e-13) / np.outer(scale, scale)
    spread = np.sqrt(np.maximum(np.diag(inverse), 0.0))
    return np.array([[spread[3 * i], spread[3 * i + 1]] for i in range(len(hard.modes))])


def to_find(hard: HardRecord, excited_hz: float) -> list[TrueMode]:
    """Modes that a test tells: excited, and with bounds below 1 % in frequency and 20 % in damping ratio."""
    told = zip(hard.modes, bounds(hard), strict=True)
    return [mode for mode, bound in told if mode.frequency_hz < excited_hz and bound[0] < 0.01 and bound[1] < 0.2]


def is_meant(mode: TrueMode, frequency_hz: float, damping_ratio: float) -> bool:
    """Whether an estimate is meant to be a true mode: within half of its damping ratio, and a factor of two of it."""
    apart = abs(frequency_hz / mode.frequency_hz - 1.0)
    return apart < max(0.02, 0.5 * mode.damping_ratio) and 0.5 < damping_ratio / mode.damping_ratio < 2.0
