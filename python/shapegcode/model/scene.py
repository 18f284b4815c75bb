"""Simulates programs for a page; each piece of motion is decimated as soon as it is simulated, to bound the memory."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from shapegcode import _core
from shapegcode.io.units import FloatArray
from shapegcode.machine import Machine
from shapegcode.model.machine_model import fanuc_model
from shapegcode.model.modes import axis_modes
from shapegcode.model.stream import Chunk, cuts_of_lines, stream
from shapegcode.program import Program
from shapegcode.program.compensation import paired_regions
from shapegcode.results.page import scene as page
from shapegcode.results.page.scene import Kept, Scene, SceneSpectrum, Variant

MAX_POINTS = 60_000  # largest number of samples per program on a page
_HALF_PIXEL, _MIN_EXTENT_MM = 0.5, 1e-3
_FLAT = {"deviation": 1e-3, "vibration": 1e-3, "speed": 1e-3, "acceleration": 1e-6}  # a curve with less range is flat


@dataclass
class _Followed:
    cuts: list[tuple[_core.Region, _core.Path]]  # cuts with their nominal paths, in line order
    _at: int = -1
    _follower: _core.PathFollower | None = field(default=None, repr=False)

    def deviations_mm(self, chunk: Chunk) -> FloatArray:
        """Deviation of table from path, (k, 3); from command if no path is known."""
        found = chunk.error_mm.copy()
        cut_of = cuts_of_lines([cut for cut, _ in self.cuts], chunk.line)
        borders = np.flatnonzero(np.diff(cut_of)) + 1
        for begin, end in zip([0, *borders], [*borders, len(chunk)], strict=True):
            rank = int(cut_of[begin])
            if rank < 0:
                continue
            if rank != self._at or self._follower is None:
                self._at, self._follower = rank, _core.PathFollower(self.cuts[rank][1])
            found[begin:end] = self._follower.step(chunk.command_mm[begin:end], chunk.response_mm[begin:end])
        return found


def scene_of(
    original: Program,
    machine: Machine,
    emitted: Program | None = None,
    *,
    labels: tuple[str, str] = ("original", "emitted"),
    plant: str = "modal",
    on_progress: Callable[[float], None] = lambda _done: None,
) -> Scene:
    """Simulate a program and its emitted program for a page."""
    programs = [original, *([emitted] if emitted is not None else [])]
    variants, spectra, notes = [], [], []
    for rank, (program, label) in enumerate(zip(programs, labels, strict=False)):
        key = ("original", "emitted")[rank]

        def done(share: float, rank: int = rank) -> None:
            on_progress((rank + share) / len(programs))

        variant, lines, kept = _variant(key, label, program, original, machine, plant, done)
        variants.append(variant)
        spectra += lines
        notes.append(
            f"{label}: {len(variant.sample)} of {variant.samples} samples, path within {kept.path_pixels:.1f} pixel of "
            f"{page.PIXELS_WIDE}, curves within {kept.pixels / page.PIXELS_HIGH * 100.0:.1f} % of their range"
        )
    of_mode = "mode of {}, {:g} Hz".format
    return Scene(
        period_s=machine.controller.interpolation_period_s,
        variants=tuple(variants),
        thinned=f"Decimated for display, extremes kept ({'; '.join(notes)}). Figures use all samples.",
        spectra=tuple(spectra),
        modes=tuple(
            page.ModeLine(axis, mode.frequency_hz, of_mode(axis.upper(), mode.frequency_hz))
            for axis, modes in zip("xyz", axis_modes(machine), strict=True)
            for mode in modes
        ),
        link_lines=tuple(
            (made.first_line, made.last_line, own.first_line, own.last_line)
            for made, own in (() if emitted is None else paired_regions(emitted, original))
        ),
    )


def _variant(
    key: str, label: str, program: Program, nominal: Program, machine: Machine, plant: str,
    on_progress: Callable[[float], None],
) -> tuple[Variant, list[SceneSpectrum], Kept]:  # fmt: skip
    period_s = machine.controller.interpolation_period_s
    whole_s = _core.time_program(program.core, fanuc_model(machine)).total_s or period_s
    cuts = [(mine, other.path) for mine, other in paired_regions(program, nominal)]
    followed = _Followed(sorted(cuts, key=lambda cut: cut[0].first_line))
    thinner, spectrum = page.Thinner(_scales(nominal), MAX_POINTS), page.AccelerationSpectrum(period_s)
    blocks = _Blocks()
    velocity: FloatArray | None = None
    for chunk in stream(program, machine, plant=plant):
        before = chunk.velocity_mm_per_s[:1] if velocity is None else velocity
        acceleration = np.diff(np.concatenate([before, chunk.velocity_mm_per_s]), axis=0) / period_s * 1e-3
        velocity = chunk.velocity_mm_per_s[-1:].copy()
        spectrum.add(acceleration)
        deviation_um = followed.deviations_mm(chunk) * 1e3
        curves = {
            "deviation": np.linalg.norm(deviation_um, axis=1),
            "vibration": np.linalg.norm(chunk.error_mm, axis=1) * 1e3,
            "speed": np.linalg.norm(chunk.velocity_mm_per_s, axis=1) * 60.0,
            "acceleration": np.linalg.norm(acceleration, axis=1),
        }
        if chunk.motor_force_n is not None:
            curves["force"] = np.linalg.norm(chunk.motor_force_n, axis=1)
        rank, starts = blocks.add(chunk)
        thinner.add(chunk.sample, np.column_stack([chunk.line, rank]), chunk.command_mm, deviation_um, curves, starts)
        on_progress(min(float(chunk.time_s[-1]) / whole_s, 1.0))
    kept = thinner.result()
    line, block = kept.labels.T
    channels = dict(kept.curves) | {"block_s": blocks.durations()[block] * period_s}
    text = program.expanded_text.decode("utf-8", "replace")
    variant = Variant(
        key, label, program.source, text, kept.sample, line, block, kept.command_mm, kept.deviation_um, channels,
        thinner.samples, tuple((cut.first_line, cut.last_line) for cut, _ in cuts),
    )  # fmt: skip
    # Up to twice the highest mode and at least 200 Hz, within half the sample rate.
    highest = max((mode.frequency_hz for modes in axis_modes(machine) for mode in modes), default=0.0)
    return variant, spectrum.lines(key, max_hz=min(max(2.0 * highest, 200.0), 0.5 / period_s)), kept


class _Blocks:
    """Numbers the interpolated blocks in order of execution, and collects their durations."""

    def __init__(self) -> None:
        self._last_line = -1
        self._counts: list[npt.NDArray[np.int64]] = []
        self._rank = -1

    def add(self, chunk: Chunk) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.intp]]:
        """Number of each sample's block, (k,), and the rows at which blocks begin."""
        line = chunk.line.astype(np.int64)
        begins = np.diff(line, prepend=self._last_line) != 0
        rank = self._rank + np.cumsum(begins)
        self._last_line, self._rank = int(line[-1]), int(rank[-1])
        self._counts.append(np.stack(np.unique(rank, return_counts=True)))
        return rank, np.flatnonzero(begins)

    def durations(self) -> npt.NDArray[np.int64]:
        """Duration of each block, in samples."""
        ranks, counts = np.concatenate(self._counts, axis=1)
        found = np.zeros(self._rank + 1, dtype=np.int64)
        np.add.at(found, ranks, counts)
        return found


def _scales(program: Program) -> dict[str, float]:
    """Half a pixel of the path in mm, and for each curve the range below which it is flat."""
    corners = [corner for region in program.regions for corner in (region.path.polyline(),) if len(corner)]
    extent = float(np.ptp(np.concatenate(corners), axis=0).max()) if corners else 0.0
    return {"path": max(extent, _MIN_EXTENT_MM) * _HALF_PIXEL / page.PIXELS_WIDE} | _FLAT
