"""The figures of docs/concepts/moving_modes.md: `python tests/oracles/moving_scenario.py` prints them.

A zig-zag that cuts along X while Z travels 400 mm, with a stop at every turn; the X mode falls from 52 to 41 Hz over Z.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from shapegcode import _core
from shapegcode.shaping import ModeBand, minimax_robust, shortest_non_negative
from shapegcode.shaping.track import MovingMode, ShaperTrack, design_track

Array = NDArray[np.float64]
Filter = Callable[[Array], Array]

BLOCK_S, TICK_S = 0.005, 0.001
MODE = _core.Mode(46.0, 0.02)
TABLE = _core.ModeTable(2, [0.0, 200.0, 400.0], [52.0, 46.0, 41.0])
FEED_MM_S = 100.0
RAMP_S = 0.05


def at_z(z_mm: float) -> _core.Mode:
    """The X mode where Z stands at `z_mm`."""
    return TABLE.mode_at(MODE, z_mm)


def strokes(count: int, x_mm: float = 30.0, depth_mm: float = 400.0) -> list[Array]:
    """The strokes of the zig-zag from rest to rest, (n, 3) at the block period."""
    corners = [np.array([x_mm * (k % 2), 0.0, depth_mm * k / count]) for k in range(count + 1)]
    result = []
    for start, end in itertools.pairwise(corners):
        length = float(np.linalg.norm(end - start))
        speed = FEED_MM_S * np.clip(np.arange(0.0, 100.0, BLOCK_S) / RAMP_S, 0.0, 1.0)
        way = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * BLOCK_S)])
        ramp = FEED_MM_S * RAMP_S / 2.0
        half = way[way <= length / 2.0]
        assert length / 2.0 > ramp
        way = np.concatenate([half, (length - half)[::-1]])
        result.append(start + way[:, None] / length * (end - start))
    return result


def played_residuals_um(
    runs: Sequence[Array], shape: Filter, modes: _core.Mode = MODE, table: _core.ModeTable = TABLE
) -> Array:
    """Residual vibration of X after each stop, µm: every move shaped, written as blocks, simulated."""
    command = [shape(run) for run in runs]
    options = _core.SimulationOptions()
    options.period_s = TICK_S
    options.modes = [[modes], [], []]
    options.mode_tables = [[table], [], []]
    options.measure_contour = False
    residuals = []
    for stop in range(1, len(runs) + 1):
        grid = np.vstack(command[:stop])
        time = np.arange(len(grid)) * BLOCK_S
        fine = np.arange(0.0, time[-1] + 0.5 * TICK_S, TICK_S)
        positions = np.column_stack([np.interp(fine, time, grid[:, axis]) for axis in range(3)])
        figures = _core.simulate_samples(positions, _core.Path([]), options)
        residuals.append(float(figures.residual_mm[0]) * 1e3)
    return np.array(residuals)


def fixed(shaper: _core.Shaper) -> Filter:
    """One shaper for the whole program."""
    fir = _core.Fir([round(t / BLOCK_S) for t in shaper.times_s], list(shaper.amplitudes))
    return lambda run: np.asarray(fir.apply(run))


def following(track: ShaperTrack) -> Filter:
    """The shapers of a track, each increment shared between its neighbours (scatter form)."""
    filters = track.following()
    return lambda run: np.asarray(filters.apply(run))


def switched(track: ShaperTrack) -> Filter:
    """The nearest shaper of a track for each increment (scatter form)."""
    filters, places = track.filters, track.following()

    def shape(run: Array) -> Array:
        middle = np.concatenate([run[:1, 2], 0.5 * (run[1:, 2] + run[:-1, 2])])
        return np.asarray(filters.apply(run, [round(places.place(z)) for z in middle]))

    return shape


def gathered(track: ShaperTrack) -> Filter:
    """The output taken from the nearest shaper at each instant (gather form): what not to do."""
    filters, places = track.filters, track.following()
    longest = filters.duration_samples

    def shape(run: Array) -> Array:
        held = np.vstack([run, np.repeat(run[-1:], longest, axis=0)])
        every = [np.asarray(fir.apply(held))[: len(held)] for fir in filters.set]
        return np.array([every[round(places.place(z))][row] for row, z in enumerate(held[:, 2])])

    return shape


def main_track(count: int | None = None, *, equal_means: bool = True) -> ShaperTrack:
    """Shapers along Z: as many as 2 % of residual need, or `count` evenly spread ones."""
    modes = [MovingMode(MODE, TABLE)]
    if count is None and equal_means:
        return design_track(modes, 2, (0.0, 400.0), BLOCK_S)
    rows = np.linspace(0.0, 400.0, count or 3)
    table = _core.ModeTable(2, rows, [at_z(z).frequency_hz for z in rows])
    design = None if equal_means else lambda found: shortest_non_negative(found, BLOCK_S)
    return design_track([MovingMode(MODE, table)], 2, (0.0, 400.0), BLOCK_S, residual_limit=1.0, design=design)


def robust_shaper(limit: float) -> _core.Shaper:
    """One shaper that leaves at most `limit` anywhere between 41 and 52 Hz."""
    return minimax_robust([ModeBand(_core.Mode(46.5, 0.02), 5.5 / 46.5)], BLOCK_S, vibration_limit=limit).shaper


def table(count: int) -> list[tuple[str, float, Array]]:
    """Name, duration in ms and residual at every stop of each way to shape `count` strokes."""
    runs = strokes(count)
    nominal = shortest_non_negative([MODE], BLOCK_S)
    robust, track = robust_shaper(0.02), main_track()
    cells, unequal = main_track(11), main_track(11, equal_means=False)
    ways: list[tuple[str, float, Filter]] = [
        ("unshaped", 0.0, lambda run: run),
        ("fixed, nominal 46 Hz", nominal.duration_s, fixed(nominal)),
        ("fixed, robust: 2 % from 41 to 52 Hz", robust.duration_s, fixed(robust)),
        (f"following, {len(track.nodes)} shapers, shared", track.duration_s, following(track)),
        ("following, 11 shapers, switched", cells.duration_s, switched(cells)),
        ("11 shapers, gather form, equal means", cells.duration_s, gathered(cells)),
        ("11 shapers, gather form, shortest designs", unequal.duration_s, gathered(unequal)),
    ]
    return [(name, duration * 1e3, played_residuals_um(runs, shape)) for name, duration, shape in ways]


if __name__ == "__main__":
    for strokes_made in (20, 4):
        print(f"\n{strokes_made} strokes of {400 / strokes_made:g} mm in Z; residual of X at the stops, um\n")
        print("| shaper | lasts, ms | largest | RMS |")
        print("|---|---|---|---|")
        for name, duration_ms, residuals in table(strokes_made):
            rms = float(np.sqrt(np.mean(residuals**2)))
            print(f"| {name} | {duration_ms:.0f} | {residuals.max():.2f} | {rms:.2f} |")
