"""A flexible axis shaken by a known command, and a logger of its own clock: NumPy alone, nothing of the package."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]
_FINE_HZ = 16_000.0
_AROUND_S = 8.0  # of silence for what rings on


@dataclass(frozen=True)
class ShakenMode:
    """A mode of the tool against the axis that carries it: share of the motion, frequency, damping ratio."""

    share: float
    frequency_hz: float
    damping_ratio: float

    def passed(self, s: ComplexArray) -> ComplexArray:
        """What it adds to the motion of the tool, over that of the axis."""
        omega = 2.0 * np.pi * self.frequency_hz
        return np.asarray(-self.share * s**2 / (s**2 + 2.0 * self.damping_ratio * omega * s + omega**2))


@dataclass(frozen=True)
class Logger:
    """An accelerometer with its own clock."""

    rate_hz: float = 800.0  # by its own clock
    clock: float = 1.01  # seconds it counts in one second
    begins_s: float = -3.3  # before the program does
    bits: int = 12
    range_m_s2: float = 4.0 * 9.81  # at full scale, either way
    noise_m_s2: float = 0.02
    gravity_m_s2: float = 0.4  # of the sensor's tilt


def drive(s: ComplexArray, bandwidth_hz: float = 60.0, gain_per_s: float | None = None) -> ComplexArray:
    """Motion of an axis over its command: loops of the drive, and the lag of the position loop, if there is one."""
    omega = 2.0 * np.pi * bandwidth_hz
    inner = omega**2 / (s**2 + 1.4 * omega * s + omega**2) / (1.0 + s / (4.0 * omega))
    return np.asarray(inner if gain_per_s is None else inner * gain_per_s / (s + gain_per_s))


def ran(text: str, period_s: float, ramp_s: float, wait_s: float = 0.0) -> FloatArray:
    """Positions in mm of a control that runs off a sweep: feed built up in a time of its own, late behind each G04.

    Reversals need no ramp. The time along the feed, which goes on evenly but for the two ramps of each part, is turned
    into positions.
    """
    parts: list[list[tuple[float, float]]] = [[]]
    pauses, feed = [], 0.0
    for line in text.splitlines():
        if line.startswith("G04"):
            pauses.append(float(line[5:]) * 1e-3)
            parts.append([])
        elif match := re.fullmatch(r"(?:G01 )?[XYZ](-?[0-9.]+)(?: F([0-9.]+))?", line):
            feed = float(match[2] or feed)
            parts[-1].append((float(match[1]), feed / 60.0))
    found = [np.zeros(1)]
    for part, pause in zip(parts, [*pauses, 0.0], strict=True):
        lengths, feeds = np.array(part).reshape(-1, 2).T
        ends = np.concatenate(([0.0], np.cumsum(np.abs(lengths) / feeds)))
        at = np.arange(0.0, ends[-1] + ramp_s + period_s, period_s)
        full = np.clip(at - 0.5 * ramp_s, 0.0, None)
        if ramp_s:
            full = np.where(at < ramp_s, at**2 / (2.0 * ramp_s), full)
            left = np.clip(ends[-1] + ramp_s - at, 0.0, None)
            full = np.where(left < ramp_s, ends[-1] - left**2 / (2.0 * ramp_s), full)
        if len(lengths):
            found.append(found[-1][-1] + np.interp(full, ends, np.concatenate(([0.0], np.cumsum(lengths)))))
        found.append(np.full(round((pause + wait_s) / period_s), found[-1][-1]))
    return np.concatenate(found)


def shaken(
    command_mm: FloatArray,
    period_s: float,
    modes: list[ShakenMode],
    *,
    bandwidth_hz: float = 60.0,
    gain_per_s: float | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Time and acceleration of the tool, m/s², of a command whose position is straight between its samples."""
    steps = np.diff(command_mm, prepend=command_mm[0], append=command_mm[-1]) * 1e-3 / period_s
    kicks = np.diff(steps)  # m/s at each sample
    count = int(2 ** np.ceil(np.log2((len(kicks) * period_s + _AROUND_S) * _FINE_HZ)))
    time = np.arange(count) / _FINE_HZ
    train = np.zeros(count)
    places = np.rint(np.arange(len(kicks)) * period_s * _FINE_HZ).astype(int)
    np.add.at(train, places, kicks * _FINE_HZ)
    s = 2j * np.pi * np.fft.rfftfreq(count, 1.0 / _FINE_HZ)
    passed = np.ones(len(s), dtype=np.complex128)
    for mode in modes:
        passed += mode.passed(s)
    spectrum = np.fft.rfft(train) * drive(s, bandwidth_hz, gain_per_s) * passed
    return time, np.fft.irfft(spectrum, count)


def logged(time_s: FloatArray, response: FloatArray, logger: Logger, seed: int) -> tuple[FloatArray, FloatArray]:
    """Time by the logger's clock, and its samples, m/s²."""
    generator = np.random.default_rng(seed)
    last = time_s[-1] - 1.0
    count = int((last - logger.begins_s) * logger.clock * logger.rate_hz)
    clock_s = np.arange(count) / logger.rate_hz
    values = np.interp(logger.begins_s + clock_s / logger.clock, time_s, response, left=0.0, right=0.0)
    values += logger.gravity_m_s2 + logger.noise_m_s2 * generator.standard_normal(count)
    step = logger.range_m_s2 / 2 ** (logger.bits - 1)
    limit = logger.range_m_s2
    return clock_s, np.clip(np.round(values / step) * step, -limit, limit - step)


def random_modes(generator: np.random.Generator) -> list[ShakenMode]:
    """One to four modes between 14 and 75 Hz, none within 15 % of another."""
    count = int(generator.integers(1, 5))
    while True:
        hertz = np.sort(np.exp(generator.uniform(np.log(14.0), np.log(75.0), count)))
        if np.all(hertz[1:] > 1.15 * hertz[:-1]):
            break
    shares = generator.uniform(0.15, 0.8, count)
    shares *= min(1.0, 1.0 / shares.sum())
    zeta = np.exp(generator.uniform(np.log(0.01), np.log(0.06), count))
    return [ShakenMode(*each) for each in zip(shares.tolist(), hertz.tolist(), zeta.tolist(), strict=True)]
