"""What the machine makes of set-points: base-excited modes per axis, residual vibration, contour error.

One mode is `u'' + 2ζω u' + ω² u = 2ζω x' + ω² x` with x the command and u the response. Set-points are joined
by straight lines in time; the modes are discretised exactly for such an input (first-order hold).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.signal import lfilter
from scipy.spatial import KDTree

from .player import starts
from .records import Move

Vector = npt.NDArray[np.float64]
#: Finest time step on which responses are looked at: 76 points per oscillation at 131 Hz.
FINE_STEP_S = 1e-4


@dataclass(frozen=True)
class Mode:
    """A base-excited mode. `share` scales its motion relative to the command where an axis has several.

    `excited_by`: shares of every axis' acceleration that excite it; None: its own axis alone.
    """

    frequency_hz: float
    damping_ratio: float
    share: float = 1.0
    excited_by: tuple[float, ...] | None = None


#: One entry per axis: None (rigid), a mode, (frequency, damping ratio), or a list of these.
AxisModes = None | Mode | tuple[float, float] | Sequence[Mode | tuple[float, float]]


class ContourError(NamedTuple):
    """Largest and root-mean-square distance to the programmed path in µm."""

    max_um: float
    rms_um: float


def _modes_of(entry: AxisModes) -> list[Mode]:
    if entry is None:
        return []
    if isinstance(entry, Mode):
        return [entry]
    if len(entry) == 2 and all(isinstance(v, (int, float)) for v in entry):
        return [Mode(float(entry[0]), float(entry[1]))]  # type: ignore[arg-type]
    return [m for e in entry for m in _modes_of(e)]  # type: ignore[arg-type]


def relative_motion(command: Vector, mode: Mode, step_s: float) -> Vector:
    """Response − command of one mode for a command (n,) that is linear between steps and starts from rest."""
    w, z = 2.0 * math.pi * mode.frequency_hz, mode.damping_ratio
    # e = u − x obeys e'' + 2ζω e' + ω² e = −x''. For an x that is linear between steps the exact (first-order
    # hold) transfer function is −(z − 1)²/h · r sin φ/ω_d / (z² − 2 r cos φ z + r²), r = exp(−ζωh),
    # φ = ω_d h.
    if not (w > 0.0 and 0.0 <= z < 1.0):
        raise ValueError(f"a mode needs a frequency > 0 and 0 ≤ damping ratio < 1, not {mode}")
    wd = w * math.sqrt(1.0 - z * z)
    r, phi = math.exp(-z * w * step_s), wd * step_s
    numerator = -r * math.sin(phi) / (wd * step_s) * np.array([1.0, -2.0, 1.0])
    denominator = np.array([1.0, -2.0 * r * math.cos(phi), r * r])
    return mode.share * np.asarray(lfilter(numerator, denominator, command - command[0]))


def response(
    setpoints: Vector, modes: Sequence[AxisModes], period_s: float, *, rest_s: float = 0.0
) -> tuple[Vector, Vector, Vector]:
    """Times (m,), command (m, axes) and response (m, axes), at steps of at most 0.1 ms.

    The command is held for `rest_s` after the last set-point.
    """
    points = np.asarray(setpoints, dtype=float)
    if points.ndim != 2 or len(points) < 2 or not np.isfinite(points).all():
        raise ValueError(f"set-points must be finite, shape (n ≥ 2, axes); got shape {points.shape}")
    if len(modes) != points.shape[1]:
        raise ValueError(f"{len(modes)} axes of modes for {points.shape[1]} axes of set-points")
    over = max(1, math.ceil(period_s / FINE_STEP_S - 1e-9))
    step = period_s / over
    held = np.concatenate([points, np.repeat(points[-1:], math.ceil(rest_s / period_s), axis=0)])
    fine = np.arange((len(held) - 1) * over + 1) / over
    command = np.stack([np.interp(fine, np.arange(len(held)), held[:, k]) for k in range(held.shape[1])], axis=1)
    moved = command.copy()
    for k, entry in enumerate(modes):
        for mode in _modes_of(entry):
            exciting = command[:, k] if mode.excited_by is None else command @ np.array(mode.excited_by)
            moved[:, k] += relative_motion(exciting, mode, step)
    return fine * period_s, command, moved


def residual_ratio(times: Vector, amplitudes: Vector, frequency: npt.ArrayLike, damping_ratio: float) -> Vector:
    """Vibration of modes after the last of some impulses over that of one impulse then."""
    omega = 2.0 * math.pi * np.atleast_1d(frequency)[:, None]
    turn = (-damping_ratio + 1j * math.sqrt(1.0 - damping_ratio**2)) * omega * (np.max(times) - times)
    return np.asarray(np.abs((amplitudes * np.exp(turn)).sum(axis=1)))


def rest_index(setpoints: Vector, *, still_mm: float = 0.0) -> int:
    """Index of the first set-point after which no axis changes by more than `still_mm` per period."""
    changes = np.flatnonzero((np.abs(np.diff(setpoints, axis=0)) > still_mm).any(axis=1))
    return int(changes[-1]) + 1 if len(changes) else 0


def residual_um(
    setpoints: Vector,
    modes: Sequence[AxisModes],
    period_s: float,
    *,
    rest_s: float = 0.3,
    delay_s: float = 0.0,
    still_mm: float = 1e-12,
) -> Vector:
    """Residual vibration per axis in µm: largest |response − command| from the instant the set-points rest.

    The instant is the last change of any axis (plus `delay_s`); the set-points are then held for `rest_s`.
    """
    stop = rest_index(np.asarray(setpoints), still_mm=still_mm)
    points = np.asarray(setpoints, dtype=float)[: stop + 1]
    if len(points) < 2:
        return np.zeros(np.asarray(setpoints).shape[1])
    times, command, moved = response(points, modes, period_s, rest_s=rest_s + delay_s)
    after = times >= stop * period_s + delay_s - 1e-9
    return np.asarray(1000.0 * np.abs(moved - command)[after].max(axis=0))


def path_polyline(moves: Sequence[Move], *, sagitta_mm: float = 2e-5, spacing_mm: float = 0.5) -> Vector:
    """The path as points (n, 3), arcs within `sagitta_mm`, neighbours no further apart than `spacing_mm`."""
    parts: list[Vector] = []
    for move, at in zip(moves, starts(moves), strict=True):
        pieces = max(1, math.ceil(move.length / spacing_mm))
        if move.kind == "arc":
            assert move.radius is not None and move.end_radius is not None and move.sweep is not None
            radius = max(move.radius, move.end_radius)
            step = 2.0 * math.acos(max(1.0 - sagitta_mm / radius, 0.0))
            pieces = max(pieces, math.ceil(abs(move.sweep) / step))
        fractions = np.linspace(0.0, 1.0, pieces + 1)
        parts.append(at + move.offsets(fractions)[0 if not parts else 1 :])
    if not parts:
        raise ValueError("no programmed moves to measure against")
    return np.concatenate(parts)


def contour_error_um(points: Vector, programmed_moves: Sequence[Move]) -> ContourError:
    """True distance of points (n, 3) in mm from the programmed path, good to 0.1 µm.

    It is the distance to the *nearest* part of the whole path, in time order or not: hand over one region at
    a time where a path crosses itself.
    """
    points = np.asarray(points, dtype=float)
    if not np.isfinite(points).all():
        raise ValueError("points to measure must be finite")
    distance = distances_from_polyline(points, path_polyline(programmed_moves))
    return ContourError(float(1000.0 * distance.max()), float(1000.0 * np.sqrt(np.mean(distance**2))))


def distances_from_polyline(points: Vector, path: Vector) -> Vector:
    """Exact distance of every point to an open polyline."""
    if len(path) == 1:
        path = np.repeat(path, 2, axis=0)
    longest = float(np.linalg.norm(np.diff(path, axis=0), axis=1).max())
    tree = KDTree(path)
    nearest, _ = tree.query(points)
    # The piece holding the nearest point of the path has an end within this reach, so nothing is missed.
    reach = np.sqrt(nearest**2 + (0.5 * longest) ** 2) * (1.0 + 1e-12) + 1e-12
    best = np.asarray(nearest, dtype=float).copy()
    for first in range(0, len(points), 4096):
        some = slice(first, first + 4096)
        lists = tree.query_ball_point(points[some], reach[some])
        owner = np.repeat(np.arange(len(lists)) + first, [len(v) for v in lists])
        vertex = np.concatenate([np.asarray(v, dtype=int) for v in lists])
        for begin in (np.maximum(vertex - 1, 0), np.minimum(vertex, len(path) - 2)):
            along = path[begin + 1] - path[begin]
            offset = points[owner] - path[begin]
            square = np.einsum("ij,ij->i", along, along)
            fraction = np.einsum("ij,ij->i", offset, along) / np.where(square > 0.0, square, 1.0)
            gap = np.linalg.norm(offset - np.clip(fraction, 0.0, 1.0)[:, None] * along, axis=1)
            np.minimum.at(best, owner, gap)
    return best
