"""Figures of the papers, repeated: the model's beside the published ones, neither tuned to the other."""

from __future__ import annotations

from importlib import resources
from typing import Any

import numpy as np

from shapegcode import _core
from shapegcode.converter import convert
from shapegcode.emit import motion_limits
from shapegcode.machine import Machine
from shapegcode.program import Program
from shapegcode.verify import largest_um, playback_options

# Paper 000, Table 2 (orbit error of the command in %) and its text on time ("up to 37 %", "under 4 %").
_PAPER_ORBIT_PERCENT = {(100, 40): 0.0270, (200, 40): 0.1075, (100, 1): 0.1051, (200, 1): 0.3546}
_PAPER_TIME = {40: "up to +37 %", 1: "under +4 %"}
_LONGEST_IDEAL_S = 0.05
_FINE_PERIOD_S = 1e-5  # the ideal command is continuous; at this period its figures no longer change


def path_program(feed_mm_per_s: float, machine: Machine) -> Program:
    """Paper 000's line, quarter arc, line, framed as in its listing, at a feed."""
    text = (resources.files("shapegcode") / "data" / "paper_path.nc").read_text(encoding="ascii")
    text = text.replace("F12000.", f"F{feed_mm_per_s * 60:.0f}.")
    return Program.from_text(text, machine, source="paper_path.nc")


def ideal_command(path: _core.Path, machine: Machine, arc_feed_ratio: float) -> tuple[Any, _core.PlaybackFigures]:
    """The paper's own way: the minimal shaper of both modes in continuous time, nothing written as blocks.

    Returns:
        Set-points, (n, 3), every 10 us, and their figures.
    """
    modes = [mode for axis in machine.axes.as_tuple() for mode in axis.modes]
    first, second = (_core.Mode(mode.frequency_hz, mode.damping_ratio) for mode in modes)
    designs = _core.minimal_two_mode(first, second, _LONGEST_IDEAL_S)
    shaper = next(design for design in designs if not design.has_negative)
    delays = [round(t / _FINE_PERIOD_S) for t in shaper.times_s]
    profile = _core.plan_speed(path, motion_limits(machine, arc_feed_ratio=arc_feed_ratio))
    samples = _core.Fir(delays, list(shaper.amplitudes)).apply(_core.interpolate(path, profile, _FINE_PERIOD_S))
    options = playback_options(machine)
    options.period_s = _FINE_PERIOD_S
    return samples, _core.play_samples(np.asfortranarray(samples), path, options)


def path_demo() -> dict[str, Any]:
    """Paper 000's path at both feeds and both reductions: ideal command, emitted program, and the paper's figures."""
    machine = Machine.load("vx500")
    rows = []
    for (feed, reduction), paper_percent in _PAPER_ORBIT_PERCENT.items():
        ratio = 1.0 - reduction / 100.0
        program = path_program(feed, machine)
        path = program.regions[-1].path
        unshaped = _core.plan_speed(path, motion_limits(machine)).duration_s
        _, ideal = ideal_command(path, machine, ratio)
        conversion = convert(program, machine, arc_feed_ratio=ratio)
        region = conversion.report["regions"][-1]
        emitted_s = region["time_s"]["emitted"]
        rows.append(
            {
                "feed_mm_per_s": feed,
                "reduction_percent": reduction,
                "unshaped": {
                    "time_s": unshaped,
                    "residual_vibration_um": region["residual_vibration_um"]["original"],
                },
                "ideal": {
                    "orbit_error_percent": ideal.orbit_error_percent[0],
                    "residual_vibration_um": largest_um([ideal.residual_mm]),
                    "time_s": ideal.duration_s,
                    "time_increase_percent": (ideal.duration_s / unshaped - 1.0) * 100.0,
                },
                "emitted": {
                    "orbit_error_percent": conversion.report["orbit_error_percent"][-1],
                    "residual_vibration_um": region["residual_vibration_um"]["emitted"],
                    "time_s": emitted_s,
                    "time_increase_percent": (emitted_s / unshaped - 1.0) * 100.0,
                    "blocks": conversion.report["blocks"]["emitted"],
                    "within_tolerance": conversion.within_tolerance,
                },
                "paper": {"orbit_error_percent": paper_percent, "time": _PAPER_TIME[reduction]},
            }
        )
    return {
        "machine": machine.name,
        "conditions": rows,
        "remark": (
            "The paper's 1 % rows are .0319 (100 mm/s) and .0638 (200 mm/s) above the model. Likely cause: there the "
            "stretch of constant speed before the arc lasts 125.25 (25.25) ms, off a 0.1 ms simulation grid; losing "
            "50 us shifts the arc, and a path shifted so gives .1050 and .3544. Nothing here is tuned to the paper."
        ),
    }
