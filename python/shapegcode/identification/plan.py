"""How to do a tap test, or to record the decay after a rapid stop, on a machining centre: text for the operator."""

from __future__ import annotations

import math
import textwrap
from pathlib import Path
from typing import TYPE_CHECKING

from shapegcode.identification.checks import DOUBLE_HIT, LEAST_FORCE, LEAST_LEAD, LEAST_PULSE
from shapegcode.identification.plan_result import AxisRecording, RapidStop, TapPlan
from shapegcode.identification.quality import EXCITED_HALF_SINE, FOLDING, LEAST_PERIODS
from shapegcode.machine import Machine

if TYPE_CHECKING:
    from shapegcode.machine import Axis

#: Modes of a machining centre that its own motion excites, Hz; for a plan without a machine file.
_USUAL_HZ = (20.0, 200.0)
#: Damping ratio where none is known: welded and cast structures with guides have 0.01 to 0.05.
_USUAL_DAMPING = 0.02
#: Modes are looked for up to this multiple of the highest one known.
_LOOK_ABOVE = 2.0
#: ... and up to here in any case: a mode that the machine file does not state is found only where it is looked for.
_LOOK_LEAST_HZ = 500.0
#: Samples in the pulse of the hammer: a half sine of ten is known to a percent.
_PULSE_SAMPLES = 10
#: The record lasts until the slowest mode has fallen to this share.
_FALLEN_TO = 0.01
#: ... and at least so many of its periods.
_PERIODS = 20
_PRE_TRIGGER_SHARE = 0.1
_PRE_TRIGGER_SAMPLES = 100
_TAPS = 5
_RATES = (1.0, 2.0, 2.5, 5.0, 10.0)
#: Frequency up to which a tip excites at most, typically; its pulse is no shorter than that needs.
_TIPS = (
    (300.0, "soft rubber"),
    (1000.0, "hard rubber or soft plastic"),
    (3000.0, "hard plastic (nylon)"),
    (math.inf, "steel, small hammer"),
)
_AXES = ("X", "Y", "Z")
_STOPS = 5
_LONG_STOP_S = 2.0
_WIDTH = 80
_EXAMPLE_ROWS = ((0, "0.02", "-0.004"), (1, "0.01", "0.003"), (2, "35.6", "0.412"), (3, "118.3", "1.378"))


def _round_up(value: float) -> float:
    power = 10.0 ** math.floor(math.log10(value))
    return next(step * power for step in _RATES if step * power >= value * (1.0 - 1e-9))


def recording_for(axis: str, modes: tuple[tuple[float, float], ...]) -> AxisRecording:
    """How to record."""
    known = modes or tuple((frequency, _USUAL_DAMPING) for frequency in _USUAL_HZ)
    highest = max(_LOOK_LEAST_HZ, _LOOK_ABOVE * max(frequency for frequency, _ in known))
    pulse = EXCITED_HALF_SINE / highest
    limit, tip = next((limit, name) for limit, name in _TIPS if highest <= limit)
    shortest = EXCITED_HALF_SINE / (limit if math.isfinite(limit) else highest)
    rate = _round_up(_PULSE_SAMPLES / shortest)
    fallen = max(math.log(1.0 / _FALLEN_TO) / (2.0 * math.pi * f * (z or _USUAL_DAMPING)) for f, z in known)
    duration = _round_up(max(fallen, _PERIODS / min(f for f, _ in known)))
    lead = max(_PRE_TRIGGER_SHARE * duration, _PRE_TRIGGER_SAMPLES / rate)
    return AxisRecording(
        axis, tuple(sorted({frequency for frequency, _ in modes})), highest, rate, duration, lead, pulse, tip
    )


def _modes(axis: Axis) -> tuple[tuple[float, float], ...]:
    found = []
    for mode in axis.modes:
        over = mode.frequency_over
        frequencies = over.frequency_hz if over is not None else (mode.frequency_hz,)
        found += [(frequency, mode.damping_ratio) for frequency in frequencies]
    return tuple(found)


def rapid_stop_program(axis: str, distance_mm: float, dwell_s: float) -> str:
    """A FANUC program that stops an axis from rapid several times, there and back, in the air."""
    number = 7201 + _AXES.index(axis)
    there, back = (f"{sign * distance_mm:.3f}".rstrip("0") for sign in (1.0, -1.0))
    lines = ["%", f"O{number}(RAPID STOP {axis})", "(INCREMENTAL, AIR ONLY, ENDS WHERE IT BEGAN)", "G21 G91 G94"]
    for _ in range(_STOPS):
        lines += [f"G00 {axis}{there}", f"G04 P{round(1000.0 * dwell_s)}", f"G00 {axis}{back}"]
        lines += [f"G04 P{round(1000.0 * dwell_s)}"]
    return "\n".join([*lines, "G90", "M30", "%"]) + "\n"


def _stop_distance_mm(machine: Machine | None, index: int) -> float:
    """A rapid long enough to reach its rate and to travel at it for as long as it takes to reach it."""
    if machine is None:
        return 100.0
    rate = machine.axes.as_tuple()[index].rapid_mm_per_min / 60.0
    ramp = machine.controller.rapid_time_constant_s
    seconds = ramp if isinstance(ramp, float) else (ramp.x, ramp.y, ramp.z)[index]
    return max(10.0, 10.0 * math.ceil(2.0 * rate * seconds / 10.0))


def _bullets(*texts: str) -> list[str]:
    """Each text as a paragraph of its own, with a star."""
    lines = []
    for text in texts:
        lines += textwrap.wrap(text, _WIDTH, initial_indent="* ", subsequent_indent="  ", break_on_hyphens=False)
    return lines


def _machine_part() -> list[str]:
    return [
        "1. THE MACHINE",
        *_bullets(
            "Warm, drives on, axes held in position by the controller (handle or MDI mode), spindle stopped, doors as "
            "the safety rules say. Not with the emergency stop pressed: the drives are then off and the modes "
            "are others.",
            "Axis in the middle of its travel, the workpiece or one of its weight clamped on. Then again at both ends "
            "and without a workpiece: the spread goes into frequency_over or frequency_uncertainty_percent.",
            "Nothing else may shake it: pumps, fans and chip conveyor off where the machine allows.",
        ),
    ]


def _sensor_part(how: AxisRecording) -> list[str]:
    return [
        "2. SENSOR AND HAMMER, FOR EACH AXIS",
        *_bullets(
            "Sensor (accelerometer) screwed, waxed or on a magnet, on what the axis moves: X and Y on the table or the "
            "workpiece, Z on the spindle head; where the head or the column moves instead, there. Its arrow "
            "along the axis.",
            "Tap the same body right beside the sensor, or on the face opposite, along the axis. Mass and stiffness "
            "are those at this point: it should be where the tool cuts, or as near as can be. The tool tip is a test "
            "of its own, with a small hammer, a light sensor and some 20 times the sampling rate.",
            f"Hammer of 0.5 to 1.5 kg for a machine, 0.1 kg for a tool. Tip: {how.tip} (up to {how.highest_hz:g} Hz). "
            "The softest tip that reaches the highest frequency gives the most force to the low modes.",
            "Short and square, then let the hammer bounce back. A tip that touches twice spoils the tap.",
        ),
    ]


def _recording_part() -> list[str]:
    return [
        "3. RECORDING",
        *_bullets(
            "Both channels at once, at the same rate, with the same anti-aliasing filters. Rate, length and "
            f"pre-trigger: see the table. The pulse should have {_PULSE_SAMPLES} samples, never fewer than "
            f"{LEAST_PULSE}.",
            "Trigger on the force. The pre-trigger tells noise and offset: it must be quiet.",
            "Input ranges so that the largest value is at 30 to 70 % of the range. Look at every tap.",
            f"{_TAPS} good taps per axis, at least 3: they are averaged, and the coherence shows where they agree. One "
            "long recording with several taps is divided by itself; let the machine come to rest between them, a "
            "second or more.",
            "No window and no filter in the recorder. The force is set to 0 outside its pulse when it is read; an "
            "exponential window on the response would be taken for damping.",
        ),
    ]


def _stops(machine: Machine | None, dwell_s: float) -> tuple[RapidStop, ...]:
    """The decays of all axes."""
    ways = [_stop_distance_mm(machine, index) for index in range(len(_AXES))]
    return tuple(
        RapidStop(axis, way, dwell_s, rapid_stop_program(axis, way, dwell_s))
        for axis, way in zip(_AXES, ways, strict=True)
    )


def _stop_part(stops: tuple[RapidStop, ...]) -> list[str]:
    return [
        "4. WITHOUT A HAMMER: DECAY AFTER A RAPID STOP",
        *_bullets(
            "Gives frequencies and damping only; mass and stiffness need the force.",
            f"Sensor as above. This program stops X {2 * _STOPS} times. There must be room for the distance, in the "
            "air, nothing near the tool. Record all of it, or each stop from the end of the motion on:",
        ),
        "",
        *("    " + line for line in stops[0].program.splitlines()),
        "",
        *(
            f"    {stop.axis}: the same with {stop.axis} and {stop.distance_mm:g} mm, O{7201 + index}"
            for index, stop in enumerate(stops[1:], start=1)
        ),
        "",
        *_bullets("Where the decay begins is found by itself; --start says it."),
    ]


def _file_part(how: AxisRecording) -> list[str]:
    return [
        "5. THE FILE",
        *_bullets(
            "CSV (comma, semicolon, tab or blanks; decimal point or comma), UFF dataset 58, or WAV. A header names the "
            "columns, with their units; the time is evenly spaced:"
        ),
        "",
        "    time_s,force_N,acc_x_m/s^2",
        *(f"    {row / how.samples_per_s:.6g},{force},{response}" for row, force, response in _EXAMPLE_ROWS),
        "    ...",
        "",
        *_bullets("One file per tap, or several taps in one. For each axis:"),
        "    shapegcode identify x1.csv x2.csv x3.csv --axis x --update mine.toml",
    ]


def _refusal_part() -> list[str]:
    return [
        "6. WHAT IS REFUSED",
        *_bullets(
            "Overload: force or response cut off at its largest value.",
            f"Double hit: a second pulse above {100 * DOUBLE_HIT:g} % of the first.",
            f"No force, or less than {LEAST_FORCE:g} times its noise.",
            f"A record of fewer than {LEAST_PERIODS:g} periods whose response has not decayed.",
            f"Sampling too slow: the strongest vibration above {100 * FOLDING:g} % of half the rate.",
            "A record that begins inside the pulse; gaps and repeats in the time; cells that are no numbers; frequency "
            "responses without their time records.",
        ),
        *textwrap.wrap(
            f"There are warnings for a pulse of fewer than {LEAST_PULSE} samples, fewer than {LEAST_LEAD} samples "
            "before the hit, a tip too soft for the mode, and a machine that was not at rest.",
            _WIDTH,
        ),
    ]


def tap_plan(machine: Machine | str | Path | None = None) -> TapPlan:
    """How to do the test: where to tap, with what, how to record, how to write the file, and what is refused.

    Args:
        machine: gives the axes and the modes known; None: the usual range of machining centres.

    Returns:
        Rates and lengths by axis, programs for decays, and the instructions for the operator.

    Source: this project; limits are those of `identification.checks`.
    """
    machine = None if machine is None else Machine.of(machine)
    usual = f"{_USUAL_HZ[0]:g} to {_USUAL_HZ[1]:g} Hz"
    if machine is None:
        recordings: tuple[AxisRecording, ...] = (recording_for("X Y Z", ()),)
        about = (
            f"No machine file is given: lengths are for modes from {usual}, where the motion of its axes excites a "
            f"machining centre, rates for modes up to {_LOOK_LEAST_HZ:g} Hz. With -m MACHINE they follow from its "
            "modes."
        )
    else:
        named = zip(_AXES, machine.axes.as_tuple(), strict=True)
        recordings = tuple(recording_for(name, _modes(axis)) for name, axis in named)
        about = (
            f"Lengths follow from the modes of the machine file (an axis without modes: {usual}); every axis is looked "
            f"at up to {_LOOK_LEAST_HZ:g} Hz or more, as there may be modes that the file does not state."
        )
    stops = _stops(machine, max(_LONG_STOP_S, 2.0 * max(how.duration_s for how in recordings)))
    parts = [
        textwrap.wrap(about, _WIDTH),
        _machine_part(),
        _sensor_part(max(recordings, key=lambda how: how.highest_hz)),
        _recording_part(),
        _stop_part(stops),
        _file_part(recordings[0]),
        _refusal_part(),
    ]
    return TapPlan(
        None if machine is None else machine.name,
        recordings,
        stops,
        "\n\n".join("\n".join(part) for part in parts),
    )
