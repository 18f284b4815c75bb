"""A program that shakes one axis with rising and falling frequency, planned on the model of the control."""

import math
from dataclasses import astuple, dataclass
from itertools import pairwise
from pathlib import Path
from typing import Literal

import numpy as np

from shapegcode import _core
from shapegcode.errors import ArgumentError
from shapegcode.identification.spectra import moving_parts
from shapegcode.io.data_file import write_text
from shapegcode.io.units import FloatArray
from shapegcode.machine import Machine
from shapegcode.model.machine_model import MachineModel
from shapegcode.model.stream import stream
from shapegcode.program import Program
from shapegcode.results.result import Result
from shapegcode.results.table import Column, Table

_PAUSE_S = 1.0, 2.5  # after each rise, and after each fall, for the vibration to decay
_TRIED = 8, 24  # moves of a trial, and of a longer one
_OF_STEP = 0.4  # feed over the corner speed difference: a reversal changes the speed by twice the feed; margin 20 %
_MIN_AT_ONCE = 100.0  # mm/min; below it moves excite too little, and moves with ramps are used
_SPARE = 1.15  # Margin to the shortest block time, for rounding of moves to increments
_MIN_MM_S2 = 20.0  # a sensor of 12 bits and ± 2 g resolves 10 mm/s²
_MIN_CYCLES = 3.0  # least cycles of the lowest frequency in its rise
_MIN_BAND = 1.5  # upper end over lower end


@dataclass(frozen=True)
class SweptBand:
    """A band of frequencies in the program, swept once up and once down.

    Attributes:
        low_hz: lowest frequency of the back-and-forth moves.
        high_hz: highest one.
        travel_mm: longest move.
        feed_mm_per_min: highest feed.
        acceleration_mm_s2: amplitude of the commanded acceleration between these frequencies, as simulated.
        blocks: number of moves.
        duration_s: duration with pauses.
    """

    low_hz: float
    high_hz: float
    travel_mm: float
    feed_mm_per_min: float
    acceleration_mm_s2: float
    blocks: int
    duration_s: float


@dataclass(frozen=True, repr=False, eq=False)
class SweepProgram(Result):
    """A program that shakes an axis.

    Attributes:
        machine: name of the machine.
        axis: "x", "y" or "z".
        file: file of the program.
        bands: parts of the program, ascending.
        limit: what limits the frequency of moves, at the upper end of the band or above it.
        acceleration_percent: stated limit of the amplitude, relative to the axis' largest acceleration.
        duration_s: simulated duration of the program.
        size_bytes: size of the program.
        warnings: to be read before the program is run.
    """

    machine: str
    axis: Literal["x", "y", "z"]
    file: str
    bands: tuple[SweptBand, ...]
    limit: str
    acceleration_percent: float
    duration_s: float
    size_bytes: int
    warnings: tuple[str, ...] = ()

    @property
    def answer(self) -> str:
        """Axis, band, duration, travel, size, and the limit of the band."""
        travel = max(band.travel_mm for band in self.bands)
        return (
            f"{self.axis.upper()} axis of {self.machine}: {self.bands[0].low_hz:.4g} to {self.bands[-1].high_hz:.4g} "
            f"Hz in {self.duration_s:.0f} s within {travel:.3g} mm, {self.size_bytes / 1024.0:.0f} KiB; {self.limit}"
        )

    @property
    def next_step(self) -> str:
        """Run the program with a logger, then identify the record."""
        return (
            f"run {self.file} with a logger on what the {self.axis.upper()} axis moves, then shapegcode identify "
            f"--sweep {self.file} RECORD.csv -m MACHINE"
        )

    def tables(self) -> list[Table]:
        """One row for each band."""
        columns = (
            Column("from", "Hz", "low_hz", digits=1),
            Column("to", "Hz", "high_hz", digits=1),
            Column("move up to", "mm", "travel_mm", digits=3),
            Column("feed up to", "mm/min", "feed_mm_per_min", digits=0),
            Column("acceleration", "mm/s²", "acceleration_mm_s2", digits=0),
            Column("blocks"),
            Column("duration", "s", "duration_s", digits=1),
        )
        return [Table("planned, as simulated", columns, self.bands)]


def write_sweep(
    file: str | Path,
    machine: Machine | str | Path,
    axis: Literal["x", "y", "z"] = "x",
    *,
    band_hz: tuple[float, float] | None = None,
    travel_mm: float = 5.0,
    acceleration_share: float = 0.3,
    seconds: float = 60.0,
    number: int = 7201,
) -> SweepProgram:
    """Write a program that shakes one axis over a band of frequencies, for `identify` with `sweep`.

    It consists of back-and-forth moves (G91, G01), whose frequency rises, then falls, band by band, with pauses. The
    lengths and feeds of the moves are planned on the controller's model: the amplitude of the commanded acceleration
    stays within the stated ratio to the axis' limit, the moves within the travel, the feed within the maximum. The
    program ends where it begins, and may be stopped by feed hold at any time.

    Args:
        file: program file to write.
        machine: the machine whose controller runs it.
        axis: axis to shake.
        band_hz: lowest and highest frequency of the moves; None: from 8 Hz to the highest that the control reaches,
            200 Hz at most.
        travel_mm: longest move, from the start point in the positive direction.
        acceleration_share: largest amplitude relative to the axis' largest acceleration.
        seconds: approximate duration of all moves.
        number: program number (O word).

    Returns:
        The band reached, its limit, and the excitation of each part, simulated from the written program.

    Raises:
        ArgumentError: a value outside its range, or the control does not reach the band within these limits; the
            message gives what it reaches.
        OSError: the file cannot be written.
    """
    found, text = plan_sweep(file, machine, axis, band_hz, travel_mm, acceleration_share, seconds, number)
    write_text(file, text)
    return found


def plan_sweep(
    file: str | Path, machine: Machine | str | Path, axis: Literal["x", "y", "z"], band_hz: tuple[float, float] | None,
    travel_mm: float, acceleration_share: float, seconds: float, number: int,
) -> tuple[SweepProgram, str]:  # fmt: skip
    """Plan the program of `write_sweep`; returns its result and the text, which is not written."""
    machine = Machine.of(machine)
    for name, value in (("travel_mm", travel_mm), ("acceleration_share", acceleration_share), ("seconds", seconds)):
        if not (math.isfinite(value) and value > 0.0):
            raise ArgumentError(f"{name} = {value:g}: must be finite and above 0")
    if acceleration_share > 1.0:
        raise ArgumentError(f"acceleration_share = {acceleration_share:g}: must be at most 1, the axis' own limit")
    if axis not in ("x", "y", "z"):
        raise ArgumentError(f"axis = {axis!r}: must be x, y or z")
    if seconds > machine.controller.max_program_s:
        raise ArgumentError(
            f"seconds = {seconds:g}: must be at most {machine.controller.max_program_s:g} (controller.max_program_s)"
        )
    low, high = band_hz or (8.0, 200.0)
    if not 0.0 < low < high < math.inf:
        raise ArgumentError(f"band of {low:g} to {high:g} Hz: must be above 0, finite and ascend")
    planner = _Planner(machine, axis, travel_mm, acceleration_share)
    for _ in range(6):
        strokes, limit = planner.plan(low, high)
        if band_hz is not None and strokes[-1].hertz < 0.999 * high:
            raise ArgumentError(f"{high:g} Hz cannot be reached, {strokes[-1].hertz:.4g} Hz can: {limit}")
        bands = _bands(strokes, machine, seconds)
        text = _text(bands, machine, axis, number)
        command, period_s = commanded(Program.from_text(text, machine, source=str(file)), machine)
        swept = _swept(bands, command[:, "xyz".index(axis)], period_s)
        over = max(band.acceleration_mm_s2 for band in swept) / planner.allowed
        if over <= 1.0:
            break
        planner.wanted *= 0.99 / over  # Interpolated frequencies and rounding may exceed the plan
    else:
        raise ArgumentError(f"the acceleration stays {over:.2g} times the limit: state less (--acceleration)")
    warnings = []
    if len(text) > machine.controller.program_memory_bytes:
        warnings.append(
            f"{len(text)} bytes are more than the memory of {machine.controller.program_memory_bytes} bytes "
            "(controller.program_memory_bytes): run it from a card, or state less time (--seconds)"
        )
    sizes = 100.0 * acceleration_share, len(command) * period_s, len(text)
    return SweepProgram(machine.name, axis, str(file), swept, limit, *sizes, tuple(warnings)), text


def commanded(program: Program, machine: Machine) -> tuple[FloatArray, float]:
    """Set-points of a program after all filters of the control, (n, 3) mm, and their period in s."""
    command = [chunk.command_mm for chunk in stream(program, machine)]
    return np.concatenate(command), machine.controller.interpolation_period_s


@dataclass(frozen=True)
class _Move:
    hertz: float  # of one move back and forth
    length_mm: float
    feed_mm_per_min: float


class _Planner:
    def __init__(self, machine: Machine, axis: str, travel_mm: float, share: float) -> None:
        limits = getattr(machine.axes, axis)
        self._machine, self._model, self._travel_mm = machine, MachineModel(machine), travel_mm
        self._axis = "xyz".index(axis)
        self._feed, controller = limits.max_feed_mm_per_min, machine.controller
        if controller.motion == "look_ahead" and controller.corner_rule == "speed_difference":
            # A reversal at this feed needs no ramp: a move takes length/feed whatever the time constants.
            at_once = _OF_STEP * getattr(controller.corner_speed_difference_mm_per_min, axis)
            if at_once >= _MIN_AT_ONCE:
                self._feed = min(self._feed, at_once)
        self.allowed = self.wanted = share * limits.max_acceleration_mm_s2
        self._block_s = max(controller.block_time_s, 2.0 * controller.interpolation_period_s)
        self._min_mm = 4 * controller.least_increment_mm  # of the shortest move

    def plan(self, low: float, high: float) -> tuple[list[_Move], str]:
        """Moves from the lowest frequency to *high*, or as high as can be reached; and a text on what limits them."""
        most = 0.5 / (_SPARE * self._block_s)
        spare = f"with {100.0 * (_SPARE - 1.0):.0f} % margin"
        limit = f"a block lasts {1e3 * self._block_s:g} ms or more, {spare} moves reach {most:.4g} Hz"
        if high <= most:
            limit = f"moves could reach {most:.4g} Hz, with blocks of {1e3 * self._block_s:g} ms"
        top = min(high, most)
        if not top >= _MIN_BAND * low:
            raise ArgumentError(f"band of {low:g} to {high:g} Hz: must ascend by {_MIN_BAND:g} times or more; {limit}")
        count = 2 + math.ceil(3.0 * math.log2(top / low))  # three per octave, interpolated between
        found: list[_Move] = []
        for hertz in np.geomspace(low, top, count):
            move, amplitude = self._move(float(hertz))
            short = move.length_mm < self._min_mm
            if short or amplitude < _MIN_MM_S2:
                limit = f"at {hertz:.4g} Hz " + (
                    f"a move would be {1e3 * move.length_mm:.2g} µm, less than {1e3 * self._min_mm:g} µm"
                    if short
                    else f"the control commands only {amplitude:.2g} mm/s², less than {_MIN_MM_S2:g} mm/s²"
                )
                break
            found.append(move)
        if not found or found[-1].hertz < _MIN_BAND * low:
            raise ArgumentError(f"band of {low:g} to {high:g} Hz: {limit}")
        return found, limit

    def _move(self, hertz: float) -> tuple[_Move, float]:
        """The move with the wanted amplitude, or with nearly the largest possible one, and its amplitude in mm/s²."""
        top = min(self._feed, 60.0 * self._travel_mm / (0.5 / hertz))
        tried = [self._tried(hertz, float(feed)) for feed in np.geomspace(top / 100.0, top, 9)]
        largest = max(amplitude for _, amplitude in tried)
        goal = min(self.wanted, 0.98 * largest)  # a higher feed gains nothing more
        place = next(k for k, (_, amplitude) in enumerate(tried) if amplitude >= goal)
        if place and tried[place][1] > goal:
            (below, low), (above, high) = tried[place - 1], tried[place]
            share = (math.log(goal) - math.log(low)) / (math.log(high) - math.log(low))
            tried[place] = self._tried(hertz, below.feed_mm_per_min ** (1.0 - share) * above.feed_mm_per_min**share)
        move, size = tried[place]
        if size > self.wanted:  # Too much even at the lowest feed tried: reduce the feed further
            return self._tried(hertz, move.feed_mm_per_min * (self.wanted / size))
        return move, size

    def _tried(self, hertz: float, feed: float) -> tuple[_Move, float]:
        """The move that takes half a cycle, and the amplitude of acceleration of moving it back and forth, mm/s²."""
        half_s = 0.5 / hertz
        low, high = 0.0, min(feed / 60.0 * half_s, self._travel_mm)
        for _ in range(14):
            middle = 0.5 * (low + high)
            few, many = (len(self._motion(middle, feed, count)) for count in _TRIED)
            lasts_s = (many - few) * self._model.period_s / (_TRIED[1] - _TRIED[0])
            low, high = (middle, high) if lasts_s < half_s else (low, middle)
        x = self._motion(high, feed, _TRIED[1])
        size = amplitude(x, self._model.period_s, (0.8 * hertz, 1.2 * hertz), _TRIED[1] / 2 / hertz)
        return _Move(hertz, high, feed), size

    def _motion(self, length_mm: float, feed: float, count: int) -> FloatArray:
        """Set-points of moves back and forth, (n,) mm."""
        step = np.zeros(3)
        step[self._axis] = length_mm
        ends = [np.zeros(3), step]
        path = _core.Path([_core.Segment.line(ends[k % 2], ends[(k + 1) % 2], feed / 60.0) for k in range(count)])
        read = self._model.ordinary.stream(path, self._model.options(), 0.0).read(1 << 20)
        return np.asarray(read.command_mm[:, self._axis], dtype=np.float64)


def amplitude(command_mm: FloatArray, period_s: float, band_hz: tuple[float, float], lasts_s: float) -> float:
    """Amplitude, mm/s², of the sine that in `lasts_s` has the energy of the commanded acceleration in a band."""
    acceleration = np.diff(command_mm, 2) / period_s**2
    size = 2 * len(acceleration)
    hertz = np.fft.rfftfreq(size, period_s)
    inside = (hertz >= band_hz[0]) & (hertz <= band_hz[1])
    energy = 2.0 * period_s * float(np.sum(np.abs(np.fft.rfft(acceleration, size)[inside]) ** 2)) / size
    return math.sqrt(2.0 * energy / lasts_s)


def _bands(strokes: list[_Move], machine: Machine, seconds: float) -> list[list[_Move]]:
    """Moves back and forth of each rise and fall of the frequency, rounded to increments and feed decimals."""
    hertz, length, feed = np.array([astuple(each) for each in strokes]).T
    octaves = math.log2(hertz[-1] / hertz[0])
    edges = np.geomspace(hertz[0], hertz[-1], 1 + math.ceil(2.0 * octaves))  # two bands per octave
    lasts_s = 0.5 * seconds / (len(edges) - 1)
    if lasts_s * hertz[0] < _MIN_CYCLES:
        needed = 2.0 * (len(edges) - 1) * _MIN_CYCLES / hertz[0]
        raise ArgumentError(
            f"seconds = {seconds:g}: {lasts_s * hertz[0]:.2g} cycles of {hertz[0]:g} Hz in each rise and fall; "
            f"required: {_MIN_CYCLES:g} or more, {math.ceil(10.0 * needed) / 10.0:g} s"
        )
    step, digits = machine.controller.least_increment_mm, machine.controller.feed_decimals_mm
    found, carried = [], 0.0
    for low, high in pairwise(edges):
        rising, now_s = [], 0.0
        while now_s < lasts_s:
            at = low * (high / low) ** (now_s / lasts_s)
            size, speed = (math.exp(np.interp(math.log(at), np.log(hertz), np.log(each))) for each in (length, feed))
            rounded = max(round((size + carried) / step), 1) * step
            carried = size + carried - rounded
            rising.append(_Move(at, rounded, round(speed, digits)))
            now_s += 1.0 / at
        found += [rising, rising[::-1]]
    return found


def plain_name(name: str) -> str:
    """The name in capitals, without characters that some control does not allow in a comment; at most 30."""
    return "".join(sign for sign in name.upper() if sign.isalnum() or sign in " -.")[:30]


def _text(bands: list[list[_Move]], machine: Machine, axis: str, number: int) -> str:
    decimals = max(1, round(-math.log10(machine.controller.least_increment_mm)))
    reach = max(move.length_mm for band in bands for move in band)
    lines = [
        "%", f"O{number:04d}(SWEEP {axis.upper()})", f"(SWEEP BY SHAPEGCODE FOR {plain_name(machine.name)})",
        f"(SHAKES {axis.upper()}: 0 TO +{reach:.{decimals}f} MM FROM THE START POINT)",
        "(AIR ONLY: NO SPINDLE, NO OTHER AXIS MOVES, ENDS WHERE IT BEGAN)",
        "(START THE LOGGER FIRST, STOP IT LAST. OVERRIDE 100 PERCENT)",
        "(FEED HOLD STOPS IT AT ANY TIME: THE RECORD BEFORE REMAINS USABLE)",
        "G21 G17 G91 G94 G64", "G04 P2000",
    ]  # fmt: skip
    for count, band in enumerate(bands):
        code, feed = f"G01 {axis.upper()}", ""
        for move in band:
            new = f" F{move.feed_mm_per_min:.{machine.controller.feed_decimals_mm}f}"
            new = new if "." in new else f"{new}."
            size = f"{move.length_mm:.{decimals}f}".lstrip("0")
            lines += [f"{code}{size}{'' if new == feed else new}", f"{axis.upper()}-{size}"]
            code, feed = axis.upper(), new
        lines.append(f"G04 P{round(1e3 * _PAUSE_S[count % 2])}")
    return "\n".join([*lines, "G90", "M30", "%"]) + "\n"


def _swept(bands: list[list[_Move]], x_mm: FloatArray, period_s: float) -> tuple[SweptBand, ...]:
    moves = moving_parts(x_mm, period_s)
    if len(moves) != len(bands):
        raise ArgumentError(
            f"{len(moves)} parts move, {len(bands)} were planned: the control's filters bridge the pauses"
        )
    found = []
    for rising, (first, _), (_, end) in zip(bands[::2], moves[::2], moves[1::2], strict=True):
        low, high = rising[0].hertz, rising[-1].hertz
        lasts_s = (end - first) * period_s - _PAUSE_S[0]
        size = amplitude(x_mm[first:end], period_s, (0.95 * low, 1.05 * high), lasts_s)
        _, length_mm, feed = np.max([astuple(each) for each in rising], axis=0).tolist()
        found.append(SweptBand(low, high, length_mm, feed, size, 4 * len(rising), lasts_s + sum(_PAUSE_S)))
    return tuple(found)
