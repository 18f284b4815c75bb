"""Figures of the papers, repeated: the model's beside the published ones, neither tuned to the other."""

from __future__ import annotations

import time
from importlib import resources
from typing import Any

import numpy as np

from shapegcode import _core
from shapegcode.conversion.convert import convert
from shapegcode.machine import Machine
from shapegcode.model.controller import motion_limits
from shapegcode.model.machine_model import MachineModel
from shapegcode.program import Program
from shapegcode.results.figures import largest_um
from shapegcode.timing.cycle_time import cycle_time
from shapegcode.timing.result import AGREEMENT_PERCENT, PARTS

# Paper 000, Table 2 (orbit error of the command in %) and its text on time ("up to 37 %", "under 4 %").
_PAPER_ORBIT_PERCENT = {(100, 40): 0.0270, (200, 40): 0.1075, (100, 1): 0.1051, (200, 1): 0.3546}
_PAPER_TIME = {40: "up to +37 %", 1: "under +4 %"}
_LONGEST_IDEAL_S = 0.05
_FINE_PERIOD_S = 1e-5  # the ideal command is continuous; at this period its figures no longer change

# Paper 004, section 3: rapid time constant, bell time of the rapids, time constant of cutting moves in s; measured and
# predicted cycle time in s of its own program.
_PAPER_TIMES = (((0.150, 0.030, 0.050), 2169.1, 2172.4), ((0.100, 0.020, 0.100), 2157.3, 2172.0))


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
    options = MachineModel(machine).options()
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


def piece_text() -> str:
    """The test piece with the features of ISO 10791-7 that comes with shapegcode."""
    return (resources.files("shapegcode") / "data" / "iso10791_7.nc").read_text(encoding="ascii")


def paper_004_machine(rapid_time_constant_s: float, rapid_bell_time_s: float, time_constant_s: float) -> Machine:
    """Paper 004's testbed (``kimm004``) with other constants."""
    data = Machine.load("kimm004").model_dump(exclude_none=True)
    data["controller"] |= {
        "rapid_time_constant_s": rapid_time_constant_s,
        "rapid_bell_time_s": rapid_bell_time_s,
        "time_constant_s": time_constant_s,
    }
    return Machine.from_data(data, "kimm004")


def cycle_time_demo() -> dict[str, Any]:
    """Our test piece with both sets of constants of paper 004: closed form, full interpolation, computing time."""
    text = piece_text()
    rows: list[dict[str, Any]] = []
    for constants, measured_s, predicted_s in _PAPER_TIMES:
        machine = paper_004_machine(*constants)
        began = time.perf_counter()
        program = Program.from_text(text, machine, source="iso10791_7.nc")
        closed = cycle_time(program, machine, full=False)
        middle = time.perf_counter()
        full = cycle_time(program, machine)
        ended = time.perf_counter()
        rows.append(
            {
                "rapid_time_constant_s": constants[0],
                "rapid_bell_time_s": constants[1],
                "time_constant_s": constants[2],
                "closed_form_s": closed.cycle_time_s,
                "full_interpolation_s": full.full_interpolation_s,
                "difference_percent": full.difference_percent,
                "computing_s": {"closed_form": middle - began, "full_interpolation": ended - middle},
                "parts": {name: getattr(closed, name) for name in PARTS},
                "paper": {"measured_s": measured_s, "predicted_s": predicted_s, "computing": "under 1 s"},
            }
        )
    return {
        "machine": "kimm004",
        "program": "iso10791_7.nc",
        "agrees": all(abs(row["difference_percent"]) <= AGREEMENT_PERCENT for row in rows),
        "sets": rows,
        "remark": (
            "The paper's program is not published: its times are of another program for a test piece of the same "
            "standard, so ours cannot be compared with them, and nothing here is tuned to them. What can be compared "
            "is how the time answers to the constants, and the closed form with the full interpolation."
        ),
    }
