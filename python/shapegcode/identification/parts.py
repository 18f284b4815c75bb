"""Spectra of a command and of what answers it, part by part between rests."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt
from scipy.ndimage import median_filter, uniform_filter1d
from scipy.signal import czt

from shapegcode.io.frequency_response import ComplexArray
from shapegcode.io.units import FloatArray

REST_S = 0.5  # of a command, between two parts
_EXCITED = 0.2  # of the median of the command's spectrum, in amplitude: lines below are not used
_BESIDE = 0.3  # of the lines around, in power: weaker lines show noise
_SMOOTH_LINES = 31
_COHERENT = 0.9


@dataclass(frozen=True, eq=False)
class Spectra:
    """Of each part, at the same lines and on the program's time."""

    hertz: FloatArray  # (n,)
    command: ComplexArray  # (parts, n)
    response: ComplexArray  # (parts, n)

    @property
    def turn(self) -> ComplexArray:
        """(n,) i omega."""
        return np.asarray(2j * np.pi * self.hertz)

    @cached_property
    def power(self) -> FloatArray:
        """(n,) of the command."""
        return np.asarray(np.sum(np.abs(self.command) ** 2, axis=0), dtype=np.float64)

    def late(self, lags_s: FloatArray) -> Spectra:
        """The same with the response of each part so much earlier."""
        return replace(self, response=self.response * np.exp(self.turn * lags_s[:, None]))

    def of(self, rows: npt.NDArray[np.intp]) -> Spectra:
        """Some parts."""
        return replace(self, command=self.command[rows], response=self.response[rows])

    def ratio(self) -> ComplexArray:
        """(n,) response over command, by least squares over the parts."""
        return np.asarray(np.sum(np.conj(self.command) * self.response, axis=0) / np.maximum(self.power, 1e-300))

    def in_twos(self, rows: npt.NDArray[np.intp]) -> Spectra:
        """Sums of the parts 0 and 1, 2 and 3, ...: what one leaves in the next is within one window."""
        first = [np.flatnonzero(rows // 2 == pair) for pair in np.unique(rows // 2)]
        return replace(
            self,
            command=np.array([self.command[each].sum(axis=0) for each in first]),
            response=np.array([self.response[each].sum(axis=0) for each in first]),
        )

    def coherent(self) -> tuple[npt.NDArray[np.bool_], FloatArray]:
        """Lines that the command excites, from the first to the last that the parts agree on, and coherence of all."""
        ratio, power = self.ratio(), self.power
        left = np.sum(np.abs(self.response - ratio * self.command) ** 2, axis=0) / max(len(self.command) - 1, 1)
        noise = uniform_filter1d(left, _SMOOTH_LINES) / np.maximum(power, 1e-300)
        size = np.abs(ratio) ** 2
        coherence = np.asarray(size / (size + noise + 1e-300), dtype=np.float64)
        used = (power > _EXCITED**2 * np.median(power)) & (power > _BESIDE * median_filter(power, _SMOOTH_LINES))
        good = np.flatnonzero(used & (uniform_filter1d(coherence, _SMOOTH_LINES) > _COHERENT))
        inside = np.zeros(len(used), dtype=np.bool_)
        if len(good):
            inside[good[0] : good[-1] + 1] = True
        return used & inside, coherence


def transforms(parts: list[FloatArray], begins_s: FloatArray, period_s: float, hertz: FloatArray) -> ComplexArray:
    """Of each part the sum of its values times exp(-i omega t), at evenly spaced frequencies."""
    values = np.zeros((len(parts), max(1, *(len(each) for each in parts))))
    for row, part in zip(values, parts, strict=True):
        row[: len(part)] = part
    turn = -2j * np.pi * period_s
    lines = czt(values, len(hertz), np.exp(turn * (hertz[1] - hertz[0])), np.exp(-turn * hertz[0]), axis=-1)
    return np.asarray(lines * np.exp(-2j * np.pi * hertz * begins_s[:, None]), dtype=np.complex128)


def moving_parts(x_mm: FloatArray, period_s: float) -> list[tuple[int, int]]:
    """First sample and end of each part of a motion between rests of half a second or more."""
    rows = np.flatnonzero(np.diff(x_mm))
    if not len(rows):
        return []
    cuts = np.flatnonzero(np.diff(rows) * period_s > REST_S)
    return [
        (int(rows[first]), int(rows[last]) + 2)
        for first, last in zip([0, *(cuts + 1)], [*cuts, len(rows) - 1], strict=True)
    ]
