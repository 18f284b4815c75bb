"""Motion of a page: programs over time, decimated for display (Douglas and Peucker 1973), packed.

Each curve keeps its maximum; `Scene.thinned` states how accurate the rest is. Figures are never computed from these
decimated data.
"""

import base64
import gzip
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from shapegcode import _core
from shapegcode.io.units import FloatArray


@dataclass(frozen=True)
class Channel:
    """A value along the path."""

    label: str  # its name
    unit: str
    how: str  # explanation in one line


CHANNELS: Mapping[str, Channel] = {
    "deviation": Channel(
        "deviation from the path",
        "µm",
        "Distance of the table from the programmed path; the contour error also counts how far a corner is cut.",
    ),
    "vibration": Channel("vibration", "µm", "Distance of the table from the commanded position at that instant."),
    "speed": Channel("speed", "mm/min", "Speed of the command; corners and short blocks are slow."),
    "acceleration": Channel("acceleration", "m/s²", "Acceleration of the command, which excites the vibration modes."),
    "block_s": Channel("time per block", "s", "Duration of the block at the tool: slow blocks are bright."),
    "force": Channel("force", "N", "Cutting force, or force of the motors if the plant has drives."),
}
"""Possible values along the path of a scene, by name."""


@dataclass(frozen=True, eq=False)
class Variant:
    """A program over time."""

    key: str  # "original" or "emitted", or another name in lower case
    label: str  # shown name
    file: str  # name of the program
    text: str  # program text
    sample: npt.NDArray[np.int64]  # indices of the kept interpolation periods, (n,), ascending
    line: npt.NDArray[np.int64]  # program line of the block being interpolated, (n,), from 1
    block: npt.NDArray[np.int64]  # index of that block among the motion blocks, (n,), from 0
    command_mm: FloatArray  # set-points, (n, 3)
    deviation_um: FloatArray  # of the table from the path or, if unknown, from its command, (n, 3)
    channels: Mapping[str, FloatArray]  # values along the path by the names of `CHANNELS`, each (n,)
    samples: int  # number of simulated periods
    # first and last line of each cut, (k, 2), in which the largest deviation is searched for; empty: everywhere
    cut_lines: tuple[tuple[int, int], ...] = ()


@dataclass(frozen=True)
class ModeLine:
    """A mode of the machine in a spectrum."""

    axis: str  # "x", "y" or "z"
    frequency_hz: float
    label: str  # for example "mode of X, 46 Hz"


@dataclass(frozen=True, eq=False)
class SceneSpectrum:
    """Spectrum of the acceleration of the command along an axis."""

    axis: str  # "x", "y" or "z"
    variant: str  # key of its variant
    frequency_hz: FloatArray  # (m,)
    amplitude: FloatArray  # spectral density, (m,), m/s²/√Hz


@dataclass(frozen=True, eq=False)
class Scene:
    """The motion shown on a page."""

    period_s: float  # interpolation period
    variants: tuple[Variant, ...]  # programs, the original first
    thinned: str  # accuracy of the decimation, in a sentence
    spectra: tuple[SceneSpectrum, ...] = ()  # of axes that move
    modes: tuple[ModeLine, ...] = ()  # of the machine
    # lines of the emitted program and the corresponding lines of the original: rows of first and last emitted, first
    # and last original
    link_lines: tuple[tuple[int, int, int, int], ...] = field(default=())


def packed(scene: Scene) -> tuple[dict[str, Any], str]:
    """Pack a scene for the script of the page.

    Numbers are 16-bit integers between minimum and maximum of their column (`low`, `high`), stored as
    differences modulo 65536 (`u2d`); samples, lines and blocks are 32-bit differences (`i4d`).
    """
    body = bytearray()

    def add(data: bytes, **entry: Any) -> dict[str, Any]:
        body.extend(bytes(-len(body) % 4))
        place = {"at": len(body)} | entry
        body.extend(data)
        return place

    def whole(values: npt.NDArray[np.int64]) -> dict[str, Any]:
        steps = np.diff(values, prepend=0).astype("<i4")
        return add(steps.tobytes(), count=len(values), kind="i4d")

    def ranks(values: FloatArray) -> dict[str, Any]:
        low, high = (float(values.min()), float(values.max())) if len(values) else (0.0, 0.0)
        span = (high - low) or 1.0
        rank = np.round((values - low) / span * 65535.0).astype(np.int64)
        steps = (np.diff(rank, prepend=0) % 65536).astype("<u2")
        return add(steps.tobytes(), count=len(values), kind="u2d", low=low, high=low + span)

    variants = []
    for variant in scene.variants:
        text = variant.text.encode()
        columns = {name: whole(getattr(variant, name)) for name in ("sample", "line", "block")}
        for name, table in (("", variant.command_mm), ("d", variant.deviation_um)):
            columns |= {name + axis: ranks(table[:, number]) for number, axis in enumerate("xyz")}
        columns |= {name: ranks(values) for name, values in variant.channels.items()}
        entry = {"key": variant.key, "label": variant.label, "file": variant.file, "samples": variant.samples}
        entry["cuts"] = variant.cut_lines
        variants.append(entry | {"columns": columns, "text": add(text, count=len(text))})
    spectra = []
    for one in scene.spectra:
        columns = {"frequency_hz": ranks(one.frequency_hz), "amplitude": ranks(one.amplitude)}
        spectra.append({"axis": one.axis, "variant": one.variant} | columns)
    shown = {name for variant in scene.variants for name in variant.channels}
    head = {
        "format": 1,
        "period_s": scene.period_s,
        "thinned": scene.thinned,
        "variants": variants,
        "channels": {name: vars(channel) for name, channel in CHANNELS.items() if name in shown},
        "spectra": spectra,
        "modes": [vars(mode) for mode in scene.modes],
        "link_lines": scene.link_lines,
    }
    return head, base64.b64encode(gzip.compress(bytes(body), 9, mtime=0)).decode()


IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]

PIXELS_WIDE, PIXELS_HIGH = 1600, 200
"""Pixels assumed for the decimation: the width for the path, the height for a curve from minimum to maximum."""

_HALF_PIXEL = 0.5
_STEP = 0.5  # fraction of the tolerance for each of two passes
_COARSER = 1.5
_PATH_LAST = 20.0
_SHARE_OF_STARTS = 0.5


@dataclass(frozen=True, eq=False)
class Kept:
    """Samples that are kept for a page, and the errors caused by leaving out the others."""

    sample: IntArray  # indices of the samples, (n,)
    labels: IntArray  # labels of each, (n, labels)
    command_mm: FloatArray  # (n, 3)
    deviation_um: FloatArray  # (n, 3)
    curves: Mapping[str, FloatArray]  # by name, each (n,)
    path_pixels: float  # largest error of the path
    pixels: float  # largest error of a curve


class Thinner:
    """Decimates samples piece by piece to a maximum number."""

    def __init__(self, scales: Mapping[str, float], most: int) -> None:
        self._scales = scales
        self._most = most
        self._names: list[str] = []
        self._pieces: list[tuple[IntArray, IntArray, FloatArray, BoolArray]] = []
        self._low: FloatArray = np.array(np.inf)
        self._high: FloatArray = np.array(-np.inf)
        # The error of repeated decimation is the sum of the tolerances.
        self._spent = _STEP
        self._path_spent = _path_factor(_STEP)
        self.samples = 0

    def add(
        self, sample: IntArray, labels: IntArray, command_mm: FloatArray, deviation_um: FloatArray,
        curves: Mapping[str, FloatArray], starts: npt.NDArray[np.intp],
    ) -> None:  # fmt: skip
        """Decimate samples and add them."""
        self._names = list(curves)
        values = np.column_stack([command_mm, deviation_um, *curves.values()])
        self._low = np.minimum(self._low, values.min(axis=0))
        self._high = np.maximum(self._high, values.max(axis=0))
        started = np.zeros(len(sample), dtype=bool)
        started[starts] = True
        # The ranges only grow, so tolerances from the ranges so far are finer than those at the end.
        rows = self._chosen(sample, values, started, _STEP)
        self._pieces.append((sample[rows], labels[rows], values[rows], started[rows]))
        self.samples += len(sample)
        if sum(len(piece[0]) for piece in self._pieces) > 8 * self._most:
            thinned, factor = self._thinned(_STEP, most=4 * self._most)
            self._pieces = [thinned]
            self._spent += factor
            self._path_spent += _path_factor(factor)

    def _tolerances(self, factor: float) -> FloatArray:
        # The path is drawn large: its tolerance grows only after that of the curves has grown twentyfold.
        path = np.full(3, self._scales["path"] * _path_factor(factor))
        span = np.maximum(self._high - self._low, 1e-12)
        floors = np.array([self._scales.get(name, 0.0) for name in self._names])
        curves = np.maximum(span[6:], floors) * _HALF_PIXEL / PIXELS_HIGH
        # The three components of the deviation have one tolerance, from the largest of their ranges.
        deviation = np.full(3, max(float(span[3:6].max()), self._scales["deviation"])) * _HALF_PIXEL / PIXELS_HIGH
        tolerances: FloatArray = np.concatenate([path, deviation * factor, curves * factor])
        return tolerances

    def _chosen(
        self, sample: IntArray, values: FloatArray, started: BoolArray, factor: float, *, starts: bool = True
    ) -> npt.NDArray[np.intp]:
        rows = _core.thin_curves(sample.astype(np.float64), np.asfortranarray(values), self._tolerances(factor))
        keep = np.zeros(len(sample), dtype=bool)
        keep[rows] = True
        keep[values[:, 6:].argmax(axis=0)] = True
        if starts:
            keep |= started
        return np.flatnonzero(keep)

    def _thinned(self, factor: float, most: int) -> tuple[tuple[IntArray, IntArray, FloatArray, BoolArray], float]:
        sample, labels, values, started = (np.concatenate(parts) for parts in zip(*self._pieces, strict=True))
        starts = int(started.sum()) <= _SHARE_OF_STARTS * most
        rows = self._chosen(sample, values, started, factor, starts=starts)
        while len(rows) > most:
            factor *= _COARSER
            rows = self._chosen(sample, values, started, factor, starts=starts)
        return (sample[rows], labels[rows], values[rows], started[rows]), factor

    def result(self) -> Kept:
        """The kept samples."""
        if not self._pieces:
            raise ValueError("no sample: nothing to show")
        (sample, labels, values, _), factor = self._thinned(_STEP, most=self._most)
        curves = {name: values[:, 6 + rank] for rank, name in enumerate(self._names)}
        path_pixels = (self._path_spent + _path_factor(factor)) * _HALF_PIXEL
        pixels = (self._spent + factor) * _HALF_PIXEL
        return Kept(sample, labels, values[:, :3], values[:, 3:6], curves, path_pixels, pixels)


def _path_factor(factor: float) -> float:
    """Factor on the path's tolerance if the tolerance of the curves is multiplied by *factor*."""
    return max(factor / _PATH_LAST, min(factor, _STEP))


_SEGMENT_S = 2.0  # line spacing half a hertz
_STILL = 1e-9


class AccelerationSpectrum:
    """Welch's mean of spectra of half-overlapping Hann windows (P. D. Welch 1967)."""

    def __init__(self, period_s: float) -> None:
        self._period_s = period_s
        self._length = max(2 * round(0.5 * _SEGMENT_S / period_s), 8)
        self._window = np.hanning(self._length + 1)[:-1]
        self._power = np.zeros((self._length // 2 + 1, 3))
        self._windows = 0
        self._rest: FloatArray = np.zeros((0, 3))

    def add(self, acceleration: FloatArray) -> None:
        """Add samples, (k, 3), m/s²."""
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

    def lines(self, variant: str, *, max_hz: float) -> list[SceneSpectrum]:
        """The spectral density of each axis that moves."""
        if len(self._rest) and not self._windows:
            # A motion shorter than one window: zero-padded.
            self._count(np.concatenate([self._rest, np.zeros((self._length - len(self._rest), 3))]))
        frequency: FloatArray = np.fft.rfftfreq(self._length, self._period_s).astype(np.float64)
        wanted = (frequency > 0.0) & (frequency <= max_hz)
        scale = 2.0 * self._period_s / float((self._window**2).sum()) / max(self._windows, 1)
        density: FloatArray = np.sqrt(self._power * scale)
        moving = np.flatnonzero(density.max(axis=0) > _STILL)
        return [SceneSpectrum("xyz"[axis], variant, frequency[wanted], density[wanted, axis]) for axis in moving]
