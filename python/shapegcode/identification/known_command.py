"""Modes from any accelerometer's record during a program with known command.

Apart from a smooth drive lag the sensor shows the commanded acceleration times 1 - sum of G s²/(s² + 2 zeta omega s
+ omega²), G: participation of a mode. The logger's start and clock and the control's waits are found from the record,
part by part.
"""

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy.ndimage import maximum_filter1d, uniform_filter1d
from scipy.optimize import minimize_scalar
from scipy.signal import resample_poly

from shapegcode.errors import RecordError
from shapegcode.identification.across import with_moves
from shapegcode.identification.frf_fit import find_frf_modes, within
from shapegcode.identification.model_search import Sought
from shapegcode.identification.result import Estimate, Identification, as_sweep
from shapegcode.identification.spectra import REST_S, Spectra, moving_parts, transforms
from shapegcode.identification.sweep_program import commanded
from shapegcode.io.read import read_records
from shapegcode.io.record import FEWEST_LINES, ComplexArray, FrequencyResponse, ReadOptions, Record
from shapegcode.io.units import FloatArray
from shapegcode.machine import Machine
from shapegcode.program import Program

_CLOCK = 0.025  # largest relative error of the logger's clock
_COARSE_STEP, _FINE_STEP = 0.001, 5e-4
_FURTHEST_RATE, _EXACT_RATE = 0.003, 3e-6  # largest change from the rate found below 40 Hz; tolerance
_LONGEST_WAIT_S, _WAIT_STEP_S = 0.21, 0.015  # largest difference of a part's duration from the simulated one; step
_WAIT_GRID_S = np.arange(-0.025, 0.025, 2.5e-4)  # around the wait found below 40 Hz
_REPORTED_WAIT_S, _NEAR_S = 0.005, 0.03
_CLOCK_KNOWN, _CLOCK_HZ = 3e-4, 150.0  # relative uncertainty of the clock (95 %); highest line used to refine it
_COARSE_HZ = 40.0  # start and clock are first searched below this frequency
_AFTER_S, _RINGS_S = 3.0, 2.0  # record used after the last part; record needed after a part, unless the next one begins
_OVER_HALF = 2.5  # samples per cycle of the highest line
_LONGEST_LAG_S = 0.02  # largest lag of a part relative to the others
_IRREGULAR_S = 0.008  # irregularity of the time between a rise and its fall
_LAST_LAG_S = 0.004  # below half a cycle of the fastest moves
_UNLIKELY = 0.3  # cost of the longest lag; a perfect correlation gains 1
_EXPLAINED = 0.5  # least fraction of a part's power explained by the others
_FEWEST_PARTS = 2
_LOWEST_HZ, _NARROWEST = 4.0, 8.0  # lowest line; least ratio of the highest line to it
_LOUD, _QUIET, _LEVELLED_HZ = 0.1, 0.01, 1.0  # energy of a used part over the loudest; whitening: floor, width
_SAME_START_S, _AWAY_S, _STANDS_OUT = 0.15, 0.5, 2.0
_CORRELATED = 0.25  # minimum of the squared correlation of a part, below 40 Hz
_OWN = 0.1  # least power of a part's own lines, relative to its largest line
_LAGS_S = np.arange(-0.1, 0.1, 2.5e-4)


@dataclass(frozen=True, eq=False)
class KnownCommand:
    """Commanded motion of one axis by a program."""

    source: str  # of the program
    axis: str  # "x", "y" or "z": the axis that moves
    period_s: float  # interpolation period
    kicks: FloatArray  # (n,) change of speed at each set-point, m/s
    parts: tuple[tuple[float, float], ...]  # begin and end of each part between rests, s

    @property
    def position(self) -> FloatArray:
        """Position of the next set-point relative to the first, (n,) m."""
        return np.asarray(np.cumsum(np.cumsum(self.kicks)) * self.period_s)


def known_command(program: str | Path | Program, machine: Machine | str | Path) -> KnownCommand:
    """Simulated command of the axis that a program shakes, on the machine's controller."""
    machine = Machine.of(machine)
    if not isinstance(program, Program):
        program = Program.read(program, machine)
    positions, period_s = commanded(program, machine)
    moved = np.ptp(positions, axis=0)
    axis = int(np.argmax(moved))
    if not moved[axis] > 0.0:
        raise RecordError(f"{program.source}: nothing moves; required: the program that ran during the record")
    others = [f"{'XYZ'[k]} by {moved[k]:.3g} mm" for k in range(3) if k != axis and moved[k] > 0.0]
    if others:
        raise RecordError(
            f"{program.source}: {'XYZ'[axis]} moves by {moved[axis]:.3g} mm, and {' and '.join(others)} too; required: "
            "a program that moves one axis, as shapegcode sweep writes it"
        )
    x = positions[:, axis]
    kicks = np.diff(np.diff(x, prepend=x[0], append=x[-1])) * 1e-3 / period_s
    parts = tuple((first * period_s, end * period_s) for first, end in moving_parts(x, period_s))
    return KnownCommand(program.source, "xyz"[axis], period_s, kicks, parts)


def find_modes_of_command(
    command: KnownCommand, sources: Sequence[str | Path | Record], options: ReadOptions, sought: Sought, *, across: bool
) -> Identification:
    """Find the modes in records of a known command; with `across` also mode shapes along the sensor's other axes."""
    if options.axis not in (None, command.axis):
        raise RecordError(
            f"axis {options.axis.upper()} is asked for, {command.source} moves {command.axis.upper()}: omit the axis, "
            "that of the sensor is found from the record"
        )
    options = replace(options, axis=None)
    aligned = [_aligned(command, source, options, sought.band_hz, across=across) for source in sources]
    ends = [[each.response.frequency_hz[end] for each in aligned] for end in (0, -1)]
    responses = [within(each.response, max(ends[0]), min(ends[1])) for each in aligned]
    names = tuple(each.source if isinstance(each, Record) else str(each) for each in sources)
    found = find_frf_modes(responses, names, replace(sought, phase_known=False))
    first, lines = aligned[0].record, responses[0].frequency_hz
    if across:
        others = [within(one, max(ends[0]), min(ends[1])) for each in aligned for one in each.others]
        found = with_moves(found, others)
    modes = []
    for mode in found.modes:  # the frequency interval includes the uncertainty of the logger's clock
        known, own = mode.frequency_hz, _CLOCK_KNOWN * mode.frequency_hz.value
        below, above = np.hypot((known.value - known.low, known.high - known.value), own)
        modes.append(replace(mode, frequency_hz=Estimate(known.value, known.value - below, known.value + above)))
    rate = min(1.0 / each.record.period_s for each in aligned)
    looked = f"searched from {lines[0]:.0f} to {lines[-1]:.0f} Hz; {rate:.0f} samples per second reach "
    notes = (*(note for each in aligned for note in each.notes), f"{looked}{rate / _OVER_HALF:.0f} Hz")
    found = replace(found, modes=tuple(modes))
    return as_sweep(found, notes, first.source, len(first.response), first.period_s, command.source)


@dataclass(frozen=True, eq=False)
class _Aligned:
    record: Record
    response: FrequencyResponse  # ratio −acceleration/commanded acceleration
    notes: tuple[str, ...]
    others: tuple[FrequencyResponse, ...] = ()  # responses of the sensor's other axes


def _aligned(
    command: KnownCommand, source: str | Path | Record, options: ReadOptions, band_hz: tuple[float, float] | None, *,
    across: bool,
) -> _Aligned:  # fmt: skip
    """Align the record of a file with the command, on the program's time."""
    records = [source] if isinstance(source, Record) else read_records(source, replace(options, ignore_force=True))
    clocks = [_Clock(command, record) for record in records]
    named = [clock for clock in clocks if clock.record.axis == command.axis] if across else []
    best = max(named or clocks, key=lambda clock: clock.correlation)
    others = [each for each in records if each is not best.record] if across else []
    return best.aligned(band_hz, len(records) > 1, others)


def _held_at_ends(values: FloatArray) -> bool:
    """Whether consecutive samples at the maximum, or at the minimum, are more than 0.2 % of all."""
    ends = [end for end in (np.max(values), np.min(values)) if abs(end - np.median(values)) > 0.0]
    beside = (np.diff(np.flatnonzero(values == end)) == 1 for end in ends)
    return any(np.count_nonzero(each) > 0.002 * len(values) for each in beside)


class _Clock:
    """Clock of a record: program time = m + (logger's time - logger's time at m) * (1 + rate), m: middle of a part."""

    def __init__(self, command: KnownCommand, record: Record) -> None:
        if record.quantity != "acceleration":
            raise RecordError(f"{record.source}: {record.quantity}: a sweep needs an acceleration")
        if not np.ptp(record.response) > 0.0:
            raise RecordError(f"{record.source}: every sample is {record.response[0]:.4g} m/s²: nothing was measured")
        if _held_at_ends(record.response):
            raise RecordError(
                f"{record.source}: overload: the acceleration is cut off at {np.max(np.abs(record.response)):.4g} "
                "m/s²; required: a larger range of the sensor, or less acceleration (shapegcode sweep --acceleration)"
            )
        if len(command.parts) < _FEWEST_PARTS:
            raise RecordError(
                f"{command.source}: has no rest of {REST_S:g} s or more; required: {_FEWEST_PARTS} parts "
                "separated by such rests, as from shapegcode sweep"
            )
        duration, needed = len(record.response) * record.period_s, command.parts[1][1]
        if duration < needed - command.parts[0][0]:
            raise RecordError(
                f"{record.source}: {duration:.3g} s: too short; required: two parts of {command.source} between its "
                f"rests: {needed:.3g} s or more from its start"
            )
        if 1.0 / record.period_s < _OVER_HALF * _NARROWEST * _LOWEST_HZ:
            raise RecordError(
                f"{record.source}: {1.0 / record.period_s:g} samples per second are too slow; required: "
                f"{_OVER_HALF:g} for each Hz of the highest mode, {_OVER_HALF * _NARROWEST * _LOWEST_HZ:g} or more"
            )
        self.command, self.record = command, record
        self.values = record.response - np.mean(record.response)
        self.windows = list(pairwise([*(begin for begin, _ in command.parts), command.parts[-1][1] + _AFTER_S]))
        self.middles = np.array([np.mean(each) for each in self.windows])
        self.rate, start_s, self.wait_s, self.shares = self._coarse()
        late = self.wait_s * np.arange(len(self.windows))
        self.places_s = (self.middles + start_s + late) / (1.0 + self.rate)  # of the middles, on the logger's clock
        self.correlation = float(np.mean(self.shares))

    def _coarse(self) -> tuple[float, float, float, FloatArray]:
        """Relative error of the clock's rate, start, wait per part, squared correlations; frequencies below 40 Hz."""
        command, period = self.command, self.record.period_s
        thinner = max(1, int(0.4 / period / _COARSE_HZ))
        values = resample_poly(self.values, 1, thinner)
        step = period * thinner
        smooth = _low_passed(command, min(_COARSE_HZ, 0.4 / step))
        times = np.arange(len(smooth)) * command.period_s
        inside = [(times >= begin) & (times < end) for begin, end in self.windows]
        energy = np.array([np.sum(np.abs(smooth[part]) ** 2) for part in inside])
        used = np.flatnonzero(energy > _LOUD * energy.max())
        size = 1 << int(np.ceil(np.log2(len(values) + len(smooth) * (times[1] - times[0]) / step + 1)))
        # Weight every frequency alike, since a long-ringing mode would dominate the record.
        spectrum = np.fft.fft(values, size)
        level = uniform_filter1d(np.abs(spectrum), max(1, round(_LEVELLED_HZ * size * step)), mode="wrap")
        hertz = np.abs(np.fft.fftfreq(size, step))
        inside = (hertz >= _LOWEST_HZ) & (hertz <= min(_COARSE_HZ, 0.4 / step))
        spectrum = np.where(inside, spectrum / np.maximum(level, _QUIET * np.max(level)), 0.0)
        values = np.fft.ifft(spectrum).real[: len(values)]
        power = np.concatenate(([0.0], np.cumsum(np.concatenate((values**2, np.zeros(size - len(values)))))))
        best = (-1.0, 0.0, 0.0, 0.0, np.zeros(len(self.windows)))
        waits = np.arange(-_LONGEST_WAIT_S, _LONGEST_WAIT_S + 1e-9, _WAIT_STEP_S)
        for rate in np.arange(-_CLOCK, _CLOCK + 1e-9, _COARSE_STEP):
            every = step * (1.0 + rate)
            squares = np.zeros((len(used), size), dtype=np.float32)
            for row, part in enumerate(used):
                begin, end = self.windows[part]
                at = begin + every * np.arange(int((end - begin) / every))
                wave = np.interp(at, times, smooth.real) + 1j * np.interp(at, times, smooth.imag)
                found = np.abs(np.fft.ifft(spectrum * np.conj(np.fft.fft(wave, size)))) ** 2
                # The correlation is circular: indices past the end are parts that began before the record.
                ends = np.arange(size) + len(at)
                own = power[np.minimum(ends, size)] - power[:size] + power[np.maximum(ends - size, 0)]
                own = np.maximum(own, _QUIET * float(np.max(own)))
                share = found / (own * 0.5 * float(np.sum(np.abs(wave) ** 2)))
                squares[row] = np.roll(share, -round(begin / every))
            wide = maximum_filter1d(squares, 2 * max(1, round(_NEAR_S / every)) + 1, axis=1, mode="wrap")
            for wait in waits:
                total = np.zeros(size, dtype=np.float32)
                for correlated, part in zip(wide, used, strict=True):
                    total += np.roll(correlated, -round(wait * part / every))
                place = int(np.argmax(total))
                if total[place] > best[0]:
                    first = place - size if place > len(values) else place
                    shares = np.zeros(len(self.windows))
                    reach = max(1, round(_SAME_START_S / every))
                    for correlated, part in zip(squares, used, strict=True):
                        near = np.arange(-reach, reach + 1) + place + round(wait * part / every)
                        shares[part] = correlated[near % size].max()
                    best = (float(total[place]), float(rate), first * every, float(wait), shares)
        return best[1:]

    def aligned(self, band_hz: tuple[float, float] | None, chosen: bool, others: Sequence[Record]) -> _Aligned:
        """Find start and clock of the record, and the ratio −response/command, also for other axes of the sensor."""
        rows = self._recorded(self._clear_parts(), _FEWEST_PARTS)
        clear = np.isin(np.arange(len(self.windows)), rows)
        for furthest in (_FURTHEST_RATE, _FINE_STEP):
            self._refine(rows, furthest)
            spectra = self._spectra()
            rows = self._recorded(_in_place(spectra, clear), _FEWEST_PARTS)
        while True:
            lags = _lags(spectra.of(rows), rows)
            explained = _explained(spectra.of(rows).late(lags))
            worst = int(np.argmin(explained))
            if explained[worst] >= _EXPLAINED or len(rows) <= _FEWEST_PARTS:
                break
            rows = np.delete(rows, worst)
        if np.min(explained) < _EXPLAINED:
            percent = 100 * max(np.min(explained), 0.0)
            raise RecordError(self._no_relation(f"the other parts of the program explain {percent:.0f} % of one"))
        # Keep complete pairs: otherwise ringing is cut off, or belongs to another part.
        alone = len(self.windows) - 1 if len(self.windows) % 2 else -1
        rows = self._recorded(rows[np.isin(rows ^ 1, rows) | (rows == alone)], 1)
        if len(rows) > 1:
            self._refine(rows, _FINE_STEP)  # without the parts that did not match the others
        spectra = self._spectra()
        lags = _lags(spectra.of(rows), rows)
        notes = self._notes(rows)
        if chosen:
            notes.append(f"{self.record.source}: this axis of the sensor matches the command best")
        used = spectra.of(rows).late(lags).in_twos(rows)
        response = self._response(used)
        inside, beside = np.isin(used.hertz, response.frequency_hz), []
        for other in others:
            clock = copy(self)
            clock.record, clock.values = other, other.response - np.mean(other.response)
            of_other = clock._spectra().of(rows).late(lags).in_twos(rows)
            # Delay, lag and sign removed from the first are removed from the others too.
            lines = response.response * (of_other.ratio() / used.ratio())[inside]
            beside.append(replace(response, source=other.source, response=lines, axis=other.axis))
        if band_hz is not None:
            hertz, (low, high) = response.frequency_hz, band_hz
            count = np.count_nonzero((hertz >= low) & (hertz <= high))
            if count < FEWEST_LINES:
                raise RecordError(
                    f"{self.record.source}: {count} lines between {low:g} and {high:g} Hz, {FEWEST_LINES} are needed: "
                    f"there are {len(hertz)} from {hertz[0]:.4g} to {hertz[-1]:.4g} Hz"
                )
            response, *beside = (within(each, low, high) for each in (response, *beside))
        return _Aligned(self.record, response, tuple(notes), tuple(beside))

    def _spectra(
        self, highest_hz: float = np.inf, rate: float | None = None, rows: npt.NDArray[np.intp] | None = None
    ) -> Spectra:
        stretch = 1.0 + (self.rate if rate is None else rate)
        period = self.record.period_s * stretch
        highest_hz = min(highest_hz, 1.0 / (_OVER_HALF * period))
        begins, ends = np.array(self.windows).T
        hertz = np.arange(_LOWEST_HZ, highest_hz, 0.5 / np.max(ends - begins))
        rows = np.arange(len(self.windows)) if rows is None else rows
        before = self.places_s * stretch - self.middles  # logger's minus program time of each part
        first = np.ceil((begins + before) / period).astype(int)
        last = np.append(first[1:], np.ceil((ends[-1] + before[-1]) / period).astype(int))  # ends where the next begins
        first, last = np.maximum(first, 0)[rows], np.minimum(last, len(self.values))[rows]
        parts = [self.values[each:end] for each, end in zip(first, last, strict=True)]
        parts = [each - np.mean(each) if len(each) else each for each in parts]
        response = transforms(parts, first * period - before[rows], period, hertz) * period
        every = self.command.period_s
        first, last = (np.rint(each[rows] / every).astype(int) for each in (begins, ends))
        kicks = [self.command.kicks[each:end] for each, end in zip(first, last, strict=True)]
        return Spectra(hertz, transforms(kicks, first * every, every, hertz), response)

    def _clear_parts(self) -> npt.NDArray[np.intp]:
        rows = np.flatnonzero(self.shares >= _CORRELATED)
        if len(rows) < _FEWEST_PARTS:
            few = f"{len(rows)} of {np.count_nonzero(self.shares)} parts correlate with the record, the best by"
            best, limit = 100.0 * np.sqrt(np.max(self.shares)), 100.0 * _CORRELATED**0.5
            raise RecordError(self._no_relation(f"{few} {best:.0f} % (limit {limit:.0f} %)"))
        return rows

    def _recorded(self, rows: npt.NDArray[np.intp], fewest: int) -> npt.NDArray[np.intp]:
        """Select the parts recorded in full: from their start to the end of ringing, or to the next part."""
        begins, ends = np.array(self.windows).T
        until = np.minimum(ends, np.array(self.command.parts)[:, 1] + _RINGS_S)
        first, last = (self.places_s + (each - self.middles) / (1.0 + self.rate) for each in (begins, until))
        held = (first >= 0.0) & (last <= len(self.values) * self.record.period_s)
        inside = np.intersect1d(rows, np.flatnonzero(held))
        if len(inside) < fewest:
            raise RecordError(
                f"{self.record.source}: no two parts of {self.command.source} (1 and 2, 3 and 4, ...) are both in the "
                f"record as commanded, from the start of the first to {_RINGS_S:g} s after the second; required: one "
                "such pair, a rise and fall of a sweep"
            )
        return inside

    def _no_relation(self, found: str) -> str:
        axis = self.command.axis.upper()
        return (
            f"{self.record.source}: no relation to the command of {self.command.source}: {found}. Is the sensor on "
            f"what the {axis} axis moves, along {axis}? Was it this program, at an override of 100 %, and is it the "
            f"machine file of this control? The clock of the logger may be off by {100 * _CLOCK:g} %"
        )

    def _refine(self, rows: npt.NDArray[np.intp], furthest: float) -> None:
        """Fit the clock error with which neighbouring parts agree best, at any wait between them; then fit the wait."""

        def shares(rate: float) -> Spectra:  # response times conjugate command, over the root of the power of all
            spectra = self._spectra(_CLOCK_HZ, rate, rows)
            share = np.conj(spectra.command) * spectra.response / np.sqrt(np.maximum(spectra.power, 1e-300))
            return replace(spectra, response=share)

        def missed(rate: float) -> float:  # minus the power common to neighbours
            spectra = shares(rate)
            both = np.conj(spectra.response[:-1]) * spectra.response[1:]
            agreed = (both @ np.exp(spectra.turn[:, None] * _WAIT_GRID_S)).real
            return -float(np.sum(np.max(agreed, axis=1)))

        rates = self.rate + np.arange(-furthest, furthest + 1e-9, _FINE_STEP)
        near = float(rates[int(np.argmin([missed(each) for each in rates]))])
        bounds = near - _FINE_STEP, near + _FINE_STEP
        self.rate = float(minimize_scalar(missed, bounds=bounds, method="bounded", options={"xatol": _EXACT_RATE}).x)
        spectra = shares(self.rate)
        turn = spectra.turn * (rows - float(np.mean(rows)))[:, None]
        agreed = [np.sum(np.abs(np.sum(spectra.response * np.exp(turn * each), axis=0)) ** 2) for each in _WAIT_GRID_S]
        late = np.arange(len(self.windows)) - float(np.mean(rows))
        self.places_s = self.places_s + _WAIT_GRID_S[int(np.argmax(agreed))] * late / (1.0 + self.rate)

    def _notes(self, rows: npt.NDArray[np.intp]) -> list[str]:
        first = int(rows[0])
        begins_s = self.places_s[first] - self.middles[first] / (1.0 + self.rate)
        waits = np.polyfit(rows, self.places_s[rows] * (1.0 + self.rate) - self.middles[rows], 1)[0]
        notes = [
            f"the program begins {abs(begins_s):.3f} s {'after' if begins_s >= 0.0 else 'before'} the record does; the "
            f"logger's clock is {-100.0 * self.rate:+.4f} % off the control's"
        ]
        if abs(waits) > _REPORTED_WAIT_S:
            notes.append(
                f"each part of the program with the rest after it takes {1e3 * abs(waits):.0f} ms "
                f"{'longer' if waits > 0.0 else 'less'} than simulated: the control's ramps or waits are not those of "
                "the machine file, which does not affect the modes; or the override was not 100 %, and frequencies are "
                "wrong by its ratio"
            )
        missing = sorted(set(range(len(self.windows))) - set(rows.tolist()))
        if missing:
            begin = self.windows[missing[0]][0]
            what = f"in {len(missing)} of {len(self.windows)} parts"
            cause = "little of it was recorded, or the control does not move as in its machine file"
            if missing == list(range(missing[0], len(self.windows))):
                what = f"from {begin:.1f} s on"
                cause = (
                    "feed hold, another override, a jump of the logger's clock, a short record, or too little motion"
                )
            notes.append(f"{what} the record does not match the program ({cause}): not used")
        return [f"{self.record.source}: {note}" for note in notes]

    def _response(self, spectra: Spectra) -> FrequencyResponse:
        """Ratio −response/command at the lines that the command excites and on which the parts agree."""
        used, coherence = spectra.coherent()
        if np.count_nonzero(used) < FEWEST_LINES:
            raise RecordError(self._no_relation("no line is coherent with the command"))
        power = spectra.power
        hertz, ratio, coherence = spectra.hertz[used], spectra.ratio()[used], coherence[used]
        # Residual delay and position-loop lag, from all lines: the values that align the phases best.
        turn, turns = 2j * np.pi * hertz, np.exp(2j * np.pi * hertz * _LAGS_S[:, None])
        gains_per_s = np.geomspace(10.0, 200.0, 14)
        loops = [np.ones(len(hertz), dtype=np.complex128), *(1.0 + turn / gain for gain in gains_per_s)]
        sums = [np.abs(turns @ (ratio * loop / np.abs(ratio * loop))) for loop in loops]
        ratio = ratio * loops[int(np.argmax([np.max(each) for each in sums]))]
        unit = ratio / np.abs(ratio)
        best = turns[int(np.argmax(np.abs(turns @ unit)))]
        # Sign of the sensor from the lowest lines, with 15 % of the power, where the axis moves as a rigid body.
        power = power[used]
        lowest = np.cumsum(power) <= 0.15 * np.sum(power)
        ratio = ratio * best * (np.sign(np.sum((unit * best * power)[lowest].real)) or 1.0)
        source, axis = self.record.source, self.command.axis
        return FrequencyResponse(source, hertz, -ratio, "acceleration", coherence, axis, scaled=False)


def _in_place(spectra: Spectra, clear: npt.NDArray[np.bool_]) -> npt.NDArray[np.intp]:
    """Parts to use: `clear` ones; and, of those at their programmed time, any that stand out or lie between others."""
    lags = np.linspace(-_AWAY_S, _AWAY_S, 401)
    crossed = spectra.response * np.conj(spectra.command)
    height = np.abs(crossed @ np.exp(spectra.turn[:, None] * lags))
    near = np.abs(lags[np.argmax(height, axis=1)]) < _SAME_START_S
    clear = clear | (near & (height.max(axis=1) > _STANDS_OUT * np.sqrt(np.mean(height**2, axis=1))))
    rows = np.arange(len(clear))
    ends = np.flatnonzero(clear)[[0, -1]]
    return np.flatnonzero(clear | (near & (rows > ends[0]) & (rows < ends[1])))


def _lags(spectra: Spectra, rows: npt.NDArray[np.intp]) -> FloatArray:
    """Delay of each part's response relative to its prediction from the other parts, s."""
    power = np.abs(spectra.command) ** 2
    own = power > _OWN * np.max(power, axis=1, keepdims=True)
    each = [np.array([part]) for part in range(len(rows))]
    pairs = [np.flatnonzero(rows // 2 == pair) for pair in np.unique(rows // 2)]

    def moved(lags: FloatArray, blocks: list[npt.NDArray[np.intp]], longest_s: float) -> FloatArray:
        lags = lags.copy()
        for block in blocks:
            lags[block] += _lag(spectra.late(lags), block, own, longest_s)
        return lags

    lags = moved(np.zeros(len(rows)), each, _LONGEST_LAG_S)
    # In its band a pair (rise and fall) outweighs harmonics of other parts, so that the two set each other's lag.
    # Parts first get the median lag from rise to fall, times their number. Then pairs are shifted as a whole: a single
    # part would not move.
    between = [lags[pair[1]] - lags[pair[0]] for pair in pairs if len(pair) > 1]
    lags = np.asarray((float(np.median(between)) if between else 0.0) * (rows - np.mean(rows)), dtype=np.float64)
    lags = moved(lags, each, _IRREGULAR_S)
    lags = moved(lags, pairs if len(pairs) > 1 else [], _LONGEST_LAG_S)
    lags = moved(lags, each, _LAST_LAG_S)
    return lags - float(np.mean(lags))


def _lag(spectra: Spectra, block: npt.NDArray[np.intp], own: npt.NDArray[np.bool_], longest_s: float) -> float:
    """Delay of some parts' response behind that predicted from the others, s; 0 for several unexplained parts."""
    others = spectra.of(np.setdiff1d(np.arange(len(own)), block)).ratio() * spectra.command[block]
    expected, response = (np.where(own[block], each, 0.0) for each in (others, spectra.response[block]))
    whole = float(np.sqrt(np.sum(np.abs(expected) ** 2) * np.sum(np.abs(response) ** 2)))
    crossed = np.sum(response * np.conj(expected), axis=0) / max(whole, 1e-300)

    def missed(lag: float) -> float:
        """Cost of a lag; the fastest parts correlate nearly as well one cycle away, so shorter lags are preferred."""
        unlikely = _UNLIKELY * (lag / _LONGEST_LAG_S) ** 2
        return unlikely - float(np.sum((crossed * np.exp(spectra.turn * lag)).real))

    steps = np.arange(-longest_s, longest_s + 1e-9, 5e-4)
    best = float(steps[int(np.argmin([missed(each) for each in steps]))])
    width = float(steps[1] - steps[0])
    found = minimize_scalar(missed, bounds=(best - width, best + width), method="bounded")
    return float(found.x) if len(block) == 1 or -found.fun > _EXPLAINED else 0.0


def _explained(spectra: Spectra) -> FloatArray:
    """Fraction of each part's power, at its own strongest lines, that the other parts explain."""
    found, rows = [], np.arange(len(spectra.command))
    for row in rows:
        others = spectra.of(rows[rows != row])
        own = np.abs(spectra.command[row]) ** 2
        inside = own > _OWN * np.max(own)
        left = (spectra.response[row] - others.ratio() * spectra.command[row])[inside]
        total = float(np.sum(np.abs(spectra.response[row][inside]) ** 2))
        found.append(1.0 - float(np.sum(np.abs(left) ** 2)) / max(total, 1e-300))
    return np.array(found)


def _low_passed(command: KnownCommand, highest_hz: float) -> ComplexArray:
    """Analytic signal of the commanded acceleration below a frequency."""
    size = 2 * len(command.kicks)
    spectrum = np.fft.fft(command.kicks, size) / command.period_s
    hertz = np.fft.fftfreq(size, command.period_s)
    spectrum[(hertz <= 0.0) | (hertz > highest_hz)] = 0.0
    return 2.0 * np.fft.ifft(spectrum)[: len(command.kicks)]
