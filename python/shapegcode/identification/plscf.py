"""Poles of frequency responses by poly-reference least squares in the frequency domain (pLSCF), band by band."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg

from shapegcode.identification.frf_model import Lines
from shapegcode.io.frequency_response import ComplexArray

_CIRCLE = 0.85  # share of the unit circle that a band is laid on
_LINES_PER_ORDER = 4
_MAX_ORDER = 24
_MIN_ORDER = 2
_MAX_DAMPING = 0.3


@dataclass(frozen=True)
class Pole:
    """A pole of a model of some order in some band."""

    omega: float  # rad/s
    zeta: float
    order: int


def band_poles(parts: Sequence[Lines], low: float, high: float) -> list[Pole]:
    """Poles between two angular frequencies, of models of growing order, ascending.

    Source: P. Guillaume et al., A poly-reference implementation of the least-squares complex frequency-domain
    estimator, IMAC 21, 2003.
    """
    chosen = [(lines, (lines.omega >= low) & (lines.omega <= high)) for lines in parts]
    fewest = min(int(np.count_nonzero(inside)) for _, inside in chosen)
    most = min(_MAX_ORDER, fewest // _LINES_PER_ORDER)
    if most < _MIN_ORDER:
        return []
    width = 2.0 * np.pi * _CIRCLE / (high - low)
    sides: list[tuple[ComplexArray, ComplexArray, ComplexArray]] = []
    for lines, inside in chosen:
        z = np.exp(-width * (lines.s[inside] - 1j * low))
        weight = lines.weight[inside]
        response = lines.response[inside]
        numerator = np.asarray(weight[:, None] * z[:, None] ** np.arange(most + 1), dtype=np.complex128)
        denominator = -response[:, None] * numerator
        sides.append((numerator.conj().T @ numerator, numerator.conj().T @ denominator,
                      denominator.conj().T @ denominator))  # fmt: skip
    found = []
    for order in range(_MIN_ORDER, most + 1):
        size = order + 1
        normal = np.zeros((size, size), dtype=np.complex128)
        for numerators, mixed, denominators in sides:
            solved = scipy.linalg.lstsq(numerators[:size, :size], mixed[:size, :size], check_finite=False)[0]
            normal += denominators[:size, :size] - mixed[:size, :size].conj().T @ solved
        try:
            # With the highest coefficient fixed, poles of noise come out unstable.
            free = np.linalg.solve(normal[:-1, :-1], -normal[:-1, -1])
        except np.linalg.LinAlgError:
            continue
        roots = np.roots(np.append(free, 1.0)[::-1])
        roots = roots[np.abs(roots) > 0.0]
        exponent = -np.log(np.abs(roots)) / width - 1j * (np.angle(roots) % (-2.0 * np.pi)) / width
        for pole in exponent + 1j * low:
            omega = float(np.abs(pole))
            zeta = float(-pole.real / omega)
            if low <= omega <= high and 0.0 < zeta < _MAX_DAMPING:
                found.append(Pole(omega, zeta, order))
    return found
