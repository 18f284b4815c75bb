"""What a turned feed override does to blocks of one duration, and the block period that bears it best.

A control that starts blocks on its interpolation ticks lengthens each of them to whole ticks, during which the axes
stand. At 100 % a block takes whole ticks by itself. At another override all of equal blocks are lengthened alike: the
motion as a whole runs evenly slower, and what is left is a ripple at the blocks' rate. Where that rate, or a multiple
of it, meets a mode at some position of the dial, another block period is better.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from shapegcode import _core
from shapegcode.machine import Machine
from shapegcode.model.machine_model import MachineModel

__all__ = ["best_for_dial", "dial_vibration_um"]

_STROKES_S = (0.25, 0.4, 0.7)  # at the feed: how a ripple meets a mode's own motion depends on the length


def dial_vibration_um(block_period_s: float, shaper: _core.Shaper, model: MachineModel, feed_mm_per_s: float) -> float:
    """Largest residual vibration of straight strokes in equal blocks, over the positions of the dial."""
    moves = np.array([float(bool(axis.modes)) for axis in model.machine.axes.as_tuple()])
    speed = feed_mm_per_s * math.sqrt(moves.sum())
    fir = _core.Fir([round(t / block_period_s) for t in shaper.times_s], list(shaper.amplitudes))
    worst_mm = 0.0
    for stroke_s in _STROKES_S:
        path = _core.Path([_core.Segment.line(np.zeros(3), moves * feed_mm_per_s * stroke_s, speed)])
        samples = fir.apply(_core.interpolate(path, _core.plan_speed(path, model.limits()), block_period_s))
        ways = np.linalg.norm(np.diff(samples, axis=0), axis=1)
        blocks = _core.Path(
            [
                _core.Segment.line(start, end, way / block_period_s)
                for start, end, way in zip(samples[:-1], samples[1:], ways, strict=True)
                if way > 0.0
            ]
        )
        for ratio in model.machine.dial_positions:
            played = model.play_emitted(blocks, path, override=ratio, contour=False)
            worst_mm = max(worst_mm, float(played.residual_mm.max()))
    return worst_mm * 1e3


def best_for_dial(
    designs: Iterable[tuple[float, _core.Shaper]], machine: Machine, feed_mm_per_s: float
) -> tuple[float, _core.Shaper]:
    """The block period with the best of both: a short shaper, and little vibration with the dial turned.

    What stays below `tolerance.residual_floor_um` counts as that. Above it twice the vibration weighs as much as a
    shaper of twice the duration.
    """
    model = MachineModel(machine)
    floor_um = max(machine.tolerance.residual_floor_um, 1e-3)

    def cost(design: tuple[float, _core.Shaper]) -> float:
        period_s, shaper = design
        return shaper.duration_s * max(floor_um, dial_vibration_um(period_s, shaper, model, feed_mm_per_s))

    return min(designs, key=cost)
