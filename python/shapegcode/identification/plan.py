"""How to do a tap test, or to record the decay after a rapid stop, on a machining centre: text for the operator."""

import math
import textwrap
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

from shapegcode.identification import checks
from shapegcode.machine import Machine
from shapegcode.results.result import Result
from shapegcode.results.table import Column, Table


@dataclass(frozen=True)
class AxisRecording:
    """How to record the modes of an axis."""

    axis: str  # "X", "Y", "Z", or all of them
    modes_hz: tuple[float, ...]  # known modes, ascending; empty: the usual range
    highest_hz: float  # upper end of the searched band
    samples_per_s: float  # sampling rate
    duration_s: float  # of one tap, from the trigger on
    pre_trigger_s: float  # before it
    pulse_s: float  # longest pulse of the force that still excites the highest frequency
    tip: str  # of the hammer


@dataclass(frozen=True)
class RapidStop:
    """How to excite a free decay of an axis without a hammer."""

    axis: str  # "X", "Y" or "Z"
    distance_mm: float  # length of each rapid
    dwell_s: float  # rest after each rapid, to record the decay
    program: str  # program text, FANUC dialect


@dataclass(frozen=True, repr=False, eq=False)
class TapPlan(Result):
    """How to do a tap test.

    Attributes:
        machine: name of the machine; null: no machine file was given.
        recordings: how to record each axis.
        stops: rapid-stop programs for each axis.
        instructions: text for the operator: machine, sensor and hammer, recording, file, reasons for refusal.
        warnings: none.
    """

    machine: str | None
    recordings: tuple[AxisRecording, ...]
    stops: tuple[RapidStop, ...]
    instructions: str
    warnings: tuple[str, ...] = ()

    @property
    def answer(self) -> str:
        """The purpose of the plan: a tap test of the machine."""
        return f"tap test of {self.machine or 'a machining centre'}: how to do it"

    @property
    def next_step(self) -> str:
        """Do the test, then identify each axis."""
        return "do the test, then for each axis: shapegcode identify x1.csv x2.csv x3.csv --axis x --update mine.toml"

    def tables(self) -> list[Table]:
        """How to record each axis."""
        columns = (
            Column("axis", text=True),
            Column("modes known", "Hz", lambda row: ", ".join(map("{:g}".format, row.modes_hz)) or "none", text=True),
            Column("search up to", "Hz", "highest_hz", digits=0),
            Column("samples/s", value="samples_per_s", digits=0),
            Column("record", "s", lambda row: f"{row.duration_s:g}"),
            Column("pre-trigger", "s", lambda row: f"{row.pre_trigger_s:.2g}"),
            Column("longest pulse", "ms", lambda row: f"{1e3 * row.pulse_s:.2g}"),
            Column("tip", text=True),
        )
        return [Table("recording", columns, self.recordings)]


_USUAL_HZ = (20.0, 200.0)  # Typical modes that a machining centre's own motion excites, without a machine file
_USUAL_DAMPING = 0.02  # Damping ratio if unknown: welded and cast structures with guides have 0.01 to 0.05
# Modes are searched up to this multiple of the highest known one, and at least up to this many Hz.
_LOOK_ABOVE, _LOOK_MIN_HZ = 2.0, 500.0
_PULSE_SAMPLES = 10  # Samples in the pulse of the hammer: a half sine of ten is known to a percent
_FALLEN_TO = 0.01  # The record lasts until the slowest mode has decayed to this ratio
_PERIODS = 20  # ... and at least this many of its periods
_TIPS = (  # Highest frequency that a tip typically excites, Hz
    (300.0, "soft rubber"),
    (1000.0, "hard rubber or soft plastic"),
    (3000.0, "hard plastic (nylon)"),
    (math.inf, "steel, small hammer"),
)
_AXES = ("X", "Y", "Z")
_TAPS, _STOPS, _LONG_STOP_S, _WIDTH = 5, 5, 2.0, 80


def _round_up(value: float) -> float:
    power = 10.0 ** math.floor(math.log10(value))
    return next(step * power for step in (1.0, 2.0, 2.5, 5.0, 10.0) if step * power >= value * (1.0 - 1e-9))


def recording_for(axis: str, modes: tuple[tuple[float, float], ...]) -> AxisRecording:
    """How to record an axis whose modes are known (Hz, damping ratio); with none known, for modes of 20 to 200 Hz."""
    known = modes or tuple((frequency, _USUAL_DAMPING) for frequency in _USUAL_HZ)
    highest = max(_LOOK_MIN_HZ, _LOOK_ABOVE * max(frequency for frequency, _ in known))
    pulse = checks.EXCITED_HALF_SINE / highest
    limit, tip = next((limit, name) for limit, name in _TIPS if highest <= limit)
    shortest = checks.EXCITED_HALF_SINE / (limit if math.isfinite(limit) else highest)
    rate = _round_up(_PULSE_SAMPLES / shortest)
    fallen = max(math.log(1.0 / _FALLEN_TO) / (2.0 * math.pi * f * (z or _USUAL_DAMPING)) for f, z in known)
    duration = _round_up(max(fallen, _PERIODS / min(f for f, _ in known)))
    lead = max(0.1 * duration, 100 / rate)  # pre-trigger
    known_hz = tuple(sorted({frequency for frequency, _ in modes}))
    return AxisRecording(axis, known_hz, highest, rate, duration, lead, pulse, tip)


def rapid_stop_program(axis: str, distance_mm: float, dwell_s: float) -> str:
    """A FANUC program that stops an axis from rapid several times, there and back, in the air."""
    number = 7201 + _AXES.index(axis)
    there, back = (f"{sign * distance_mm:.3f}".rstrip("0") for sign in (1.0, -1.0))
    lines = ["%", f"O{number}(RAPID STOP {axis})", "(INCREMENTAL, AIR ONLY, ENDS WHERE IT BEGAN)", "G21 G91 G94"]
    dwell = f"G04 P{round(1000.0 * dwell_s)}"
    lines += [f"G00 {axis}{there}", dwell, f"G00 {axis}{back}", dwell] * _STOPS
    return "\n".join([*lines, "G90", "M30", "%"]) + "\n"


def _instructions(about: str, recordings: tuple[AxisRecording, ...], stops: tuple[RapidStop, ...]) -> str:
    """The text for the operator, wrapped at 80 characters except for indented lines."""
    text = (resources.files("shapegcode") / "data" / "tap_plan.txt").read_text(encoding="utf-8").format(
        highest=max(recordings, key=lambda how: how.highest_hz), pulse_samples=_PULSE_SAMPLES, taps=_TAPS,
        checks=checks, stop_count=2 * _STOPS, program=textwrap.indent(stops[0].program.rstrip("\n"), "    "),
        others="\n".join(
            f"    {stop.axis}: the same with {stop.axis} and {stop.distance_mm:g} mm, O{7201 + index}"
            for index, stop in enumerate(stops[1:], start=1)
        ),
        times=[row / recordings[0].samples_per_s for row in range(4)], double_hit=100 * checks.DOUBLE_HIT,
        folding=100 * checks.FOLDING,
    )  # fmt: skip
    lines: list[str] = []
    for line in f"{about}\n\n{text}".splitlines():
        bullet = line.startswith("* ")
        wrapped = textwrap.wrap(line, _WIDTH, subsequent_indent="  " if bullet else "", break_on_hyphens=not bullet)
        lines += [line] if line.startswith("    ") else wrapped or [""]
    return "\n".join(lines)


def tap_plan(machine: Machine | str | Path | None = None) -> TapPlan:
    """How to do a tap test: where to tap, with what, how to record, the file, and reasons for refusal.

    Args:
        machine: source of the axes and known modes; None: the usual range of machining centres.

    Returns:
        Rates and lengths by axis, rapid-stop programs, and the instructions for the operator.

    Source: this project; limits are those of `identification.checks`.
    """
    machine = None if machine is None else Machine.of(machine)
    usual = f"{_USUAL_HZ[0]:g} to {_USUAL_HZ[1]:g} Hz"
    distances_mm = [100.0] * len(_AXES)
    if machine is None:
        recordings: tuple[AxisRecording, ...] = (recording_for("X Y Z", ()),)
        about = (
            f"No machine file is given: lengths are for modes from {usual}, the range that a machining centre's own "
            f"motion excites, rates for modes up to {_LOOK_MIN_HZ:g} Hz. With -m MACHINE they follow from its "
            "modes."
        )
    else:
        axes = machine.axes.as_tuple()
        modes = [
            [
                (frequency, mode.damping_ratio)
                for mode in axis.modes
                for frequency in (mode.frequency_over.frequency_hz if mode.frequency_over else (mode.frequency_hz,))
            ]
            for axis in axes
        ]
        recordings = tuple(recording_for(name, tuple(each)) for name, each in zip(_AXES, modes, strict=True))
        # Long enough to reach the rapid rate and to hold it as long as the acceleration lasts.
        ramps_s = machine.controller.rapid_time_constant_s.as_tuple()
        reached = (axis.rapid_mm_per_min / 60.0 * ramp_s for axis, ramp_s in zip(axes, ramps_s, strict=True))
        distances_mm = [max(10.0, 10.0 * math.ceil(2.0 * each / 10.0)) for each in reached]
        about = (
            f"Lengths follow from the modes of the machine file (an axis without modes: {usual}); every axis is "
            f"measured up to {_LOOK_MIN_HZ:g} Hz or more, as the file may lack modes."
        )
    dwell_s = max(_LONG_STOP_S, 2.0 * max(how.duration_s for how in recordings))
    stops = tuple(
        RapidStop(axis, distance_mm, dwell_s, rapid_stop_program(axis, distance_mm, dwell_s))
        for axis, distance_mm in zip(_AXES, distances_mm, strict=True)
    )
    text = _instructions(about, recordings, stops)
    return TapPlan(None if machine is None else machine.name, recordings, stops, text)
