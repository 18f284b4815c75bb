"""How much of a command's acceleration lies at which frequency, of a motion that passes by."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from shapegcode.results.page.scene import SceneSpectrum

FloatArray = npt.NDArray[np.float64]

_SEGMENT_S = 2.0  # so the lines lie half a hertz apart
_STILL = 1e-9


class AccelerationSpectrum:
    """Welch's mean of the spectra of windows that overlap by half (P. D. Welch 1967), window of Hann."""

    def __init__(self, period_s: float) -> None:
        """Of samples that are one period apart."""
        self._period_s = period_s
        self._length = max(2 * round(0.5 * _SEGMENT_S / period_s), 8)
        self._window = np.hanning(self._length + 1)[:-1]
        self._power = np.zeros((self._length // 2 + 1, 3))
        self._windows = 0
        self._rest: FloatArray = np.zeros((0, 3))

    def add(self, acceleration: FloatArray) -> None:
        """Further samples, (k, 3), m/s²."""
        waiting = np.concatenate([self._rest, acceleration])
        half = self._length // 2
        begin = 0
        while begin + self._length <= len(waiting):
            self._count(waiting[begin : begin + self._length])
            begin += half
        self._rest = waiting[begin:]

    def _count(self, part: FloatArray) -> None:
        self._power += np.abs(np.fft.rfft(part * self._window[:, None], axis=0)) ** 2
        self._windows += 1

    def lines(self, variant: str, *, most_hz: float) -> list[SceneSpectrum]:
        """The spectral density of each axis that moves."""
        if len(self._rest) and not self._windows:
            # A motion shorter than one window: with rest behind it.
            self._count(np.concatenate([self._rest, np.zeros((self._length - len(self._rest), 3))]))
        frequency: FloatArray = np.fft.rfftfreq(self._length, self._period_s).astype(np.float64)
        wanted = (frequency > 0.0) & (frequency <= most_hz)
        scale = 2.0 * self._period_s / float((self._window**2).sum()) / max(self._windows, 1)
        density: FloatArray = np.sqrt(self._power * scale)
        return [
            SceneSpectrum("xyz"[axis], variant, frequency[wanted], density[wanted, axis])
            for axis in range(3)
            if density[:, axis].max() > _STILL
        ]
