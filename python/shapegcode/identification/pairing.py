"""Identified modes beside those of a machine file: which is which, and what share of the motion a new one takes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.optimize import linear_sum_assignment

from shapegcode.identification.mode import IdentifiedMode

SAME_MODE = 0.1
"""Two frequencies, relative to the old one, within which a mode is taken as the one that the file has."""

_NO_PAIR = 1e3
_SHARE_DIGITS = 4


def shares_of(modes: Sequence[IdentifiedMode]) -> tuple[list[float], str]:
    """Participations that sum to 1, and what they are: shares of the residues 1/m, or of the number of modes.

    Those of one point under a motion of its base do so, sum of phi_i Gamma_i = 1, for mode shapes that span the motion.
    """
    masses = [mode.mass_kg.value for mode in modes if mode.mass_kg is not None]
    if len(masses) < len(modes):
        return [_share(1.0 / len(modes))] * len(modes), "equal shares"
    total = sum(1.0 / mass for mass in masses)
    return [_share(1.0 / mass / total) for mass in masses], "share of the residues 1/m"


def _share(value: float) -> float:
    return float(f"{value:.{_SHARE_DIGITS}g}")


def matches(modes: Sequence[IdentifiedMode], old_hz: Sequence[float]) -> dict[int, int]:
    """Number of the old mode by that of the new: as many pairs within 10 % as there can be, the nearest ones."""
    if not old_hz or not modes:
        return {}
    new_hz = np.array([mode.frequency_hz.value for mode in modes])
    distance = np.abs(new_hz[:, None] / np.asarray(old_hz) - 1.0)
    pairs = zip(*linear_sum_assignment(np.where(distance <= SAME_MODE, distance, _NO_PAIR)), strict=True)
    return {int(new): int(old) for new, old in pairs if distance[new, old] <= SAME_MODE}
