"""Motion to look at on a page: programs in time, thinned for display, packed so that it is small.

Thinned means: between two kept samples every curve is a straight line in time, within a stated fraction of a pixel
(Douglas and Peucker 1973, with time as the first coordinate). Extremes are kept. Figures are never taken from here.
"""

from __future__ import annotations

import base64
import gzip
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Channel:
    """A value along the path."""

    label: str  # what it is
    unit: str
    how: str  # one line: how to read a picture of it


CHANNELS: Mapping[str, Channel] = {
    "deviation": Channel(
        "deviation from the path",
        "µm",
        "Distance of the table from the programmed path; the contour error also counts how far a corner is cut.",
    ),
    "vibration": Channel("vibration", "µm", "Distance of the table from where the control wants it at that instant."),
    "speed": Channel("speed", "mm/min", "Speed of the command; corners and short blocks are slow."),
    "acceleration": Channel("acceleration", "m/s²", "Acceleration of the command: what excites the vibration modes."),
    "block_s": Channel("time per block", "s", "How long the block under the tool takes: what is slow shows bright."),
    "force": Channel("force", "N", "Cutting force, or force of the motors where the plant has drives."),
}
"""Values along the path that a scene may hold, by name."""


@dataclass(frozen=True, eq=False)
class Variant:
    """A program in time."""

    key: str  # "original" or "emitted", or another name of small letters
    label: str  # for people
    file: str  # name of the program
    text: str  # of the program
    sample: npt.NDArray[np.int64]  # which interpolation periods are kept, (n,), rising
    line: npt.NDArray[np.int64]  # of the text, of the block that is interpolated, (n,), from 1
    block: npt.NDArray[np.int64]  # rank of that block among the motion blocks, (n,), from 0
    command_mm: FloatArray  # set-points, (n, 3)
    deviation_um: FloatArray  # of the table from the path, or where that is not known from its command, (n, 3)
    channels: Mapping[str, FloatArray]  # values along the path by the names of `CHANNELS`, each (n,)
    samples: int  # how many periods were simulated
    # first and last line of each cut, (k, 2): there the largest deviation is looked for; empty: everywhere
    cut_lines: tuple[tuple[int, int], ...] = ()


@dataclass(frozen=True)
class ModeLine:
    """A mode of the machine in a spectrum."""

    axis: str  # "x", "y" or "z"
    frequency_hz: float
    label: str  # for example "X 46 Hz (assumed)"


@dataclass(frozen=True, eq=False)
class SceneSpectrum:
    """SceneSpectrum of the acceleration of the command along an axis."""

    axis: str  # "x", "y" or "z"
    variant: str  # key of its variant
    frequency_hz: FloatArray  # (m,)
    amplitude: FloatArray  # (m,), m/s² per line


@dataclass(frozen=True, eq=False)
class Scene:
    """What a page shows of motion.

    Attributes:
        period_s: interpolation period.
        variants: programs, the original first.
        thinned: how far the thinning may be seen, in a sentence.
        spectra: of axes that move.
        modes: of the machine.
        link_lines: lines of the emitted text and the lines of the original that they stand for: rows of first and last
            emitted, first and last original.
    """

    period_s: float
    variants: tuple[Variant, ...]
    thinned: str
    spectra: tuple[SceneSpectrum, ...] = ()
    modes: tuple[ModeLine, ...] = ()
    link_lines: tuple[tuple[int, int, int, int], ...] = field(default=())


def packed(scene: Scene) -> tuple[dict[str, Any], str]:
    """A scene as the page's script reads it.

    Numbers are 16-bit ranks between the least and the largest value of their column (`low`, `high`), stored as
    differences modulo 65536 (`u2d`); samples, lines and blocks are 32-bit differences (`i4d`).
    """
    body = bytearray()

    def add(data: bytes, **said: Any) -> dict[str, Any]:
        body.extend(bytes(-len(body) % 4))
        place = {"at": len(body)} | said
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
        said = {"key": variant.key, "label": variant.label, "file": variant.file, "samples": variant.samples}
        said["cuts"] = variant.cut_lines
        variants.append(said | {"columns": columns, "text": add(text, count=len(text))})
    spectra = [
        {"axis": one.axis, "variant": one.variant}
        | {"frequency_hz": ranks(one.frequency_hz), "amplitude": ranks(one.amplitude)}
        for one in scene.spectra
    ]
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
