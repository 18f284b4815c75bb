"""Modes from the record of any accelerometer beside a program whose command is known.

The axis moves as commanded but for a smooth lag of its drive, and the sensor on what it carries shows the command's
acceleration times 1 - sum of G s²/(s² + 2 zeta omega s + omega²). The logger runs on its own clock: where the program
begins in the record and how much faster its clock runs is found from the record, part by part of the program.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from copy import copy
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy.ndimage import uniform_filter1d
from scipy.optimize import minimize_scalar
from scipy.signal import resample_poly

from shapegcode.errors import RecordError
from shapegcode.identification.across import with_moves
from shapegcode.identification.frf_fit import find_frf_modes
from shapegcode.identification.model_search import Sought
from shapegcode.identification.parts import Spectra, transform
from shapegcode.identification.result import Identification, Sweep
from shapegcode.identification.sweep_program import REST_S, commanded, moving_parts
from shapegcode.io.frequency_response import FEWEST_LINES, ComplexArray, FrequencyResponse
from shapegcode.io.read import read_records
from shapegcode.io.record import FloatArray, ReadOptions, Record
from shapegcode.machine import Machine
from shapegcode.program import Program

_CLOCK = 0.025  # the logger's clock may be off by this share
_COARSE_STEP, _FINE_STEP = 0.001, 5e-5
_COARSE_HZ = 40.0  # start and clock are first looked for in what lies below
_AFTER_S = 3.0  # of the record behind the last part
_RINGS_S = 2.0  # of the record that a part needs behind it, or up to the next part
_OVER_HALF = 2.5  # samples per cycle of the highest line
_LONGEST_LAG_S = 0.02  # of a part against the others
_EXPLAINED = 0.5  # share of a part's power that the others must explain
_FEWEST_PARTS = 2
_LOWEST_HZ = 4.0
_NARROWEST = 8.0  # highest line over the lowest
_HELD = 0.002  # share of samples at an end of the range that stand beside another one
_LOUD = 0.1  # of the loudest part: below 40 Hz
_QUIET = 0.01
_LEVELLED_HZ = 1.0
_SAME_START_S = 0.15
_ROUNDS = 2
_AWAY_S, _STANDS_OUT = 0.5, 2.0
_GAINS_PER_S = np.geomspace(10.0, 200.0, 14)
_LOWEST_SHARE = 0.15  # of the power of the command
_CORRELATED = 0.25  # squared correlation of a part, below 40 Hz
_SLOWER = np.arange(-0.02, 0.0201, 0.002)  # moves of a part than commanded
_OTHER_SPEED = 1.2e-3  # within 3e-4 by the right command, 1e-3 by a time constant 10 % off, 1.3e-3 at 99 % override
_AGREE, _FEWEST_PAIRS = 0.8, 3
_FINER = 8  # lines between two, for their interpolation
_OWN = 0.1  # of the largest line of a part, in power
_LAGS_S = np.arange(-0.1, 0.1, 2.5e-4)


@dataclass(frozen=True, eq=False)
class KnownCommand:
    """What a program commands one axis.

    Attributes:
        source: of the program.
        axis: "x", "y" or "z": the one that moves.
        times_s: (n,) instants of the set-points.
        kicks: (n,) change of speed at each of them, m/s.
        parts: begin and end of each part between rests, s.
    """

    source: str
    axis: str
    times_s: FloatArray
    kicks: FloatArray
    parts: tuple[tuple[float, float], ...]

    @property
    def period_s(self) -> float:
        """Interpolation period."""
        return float(self.times_s[1] - self.times_s[0])

    @property
    def position(self) -> FloatArray:
        """(n,) m."""
        return np.asarray(np.cumsum(np.cumsum(self.kicks)) * self.period_s)


def known_command(program: str | Path | Program, machine: Machine | str | Path) -> KnownCommand:
    """The command of the axis that a program shakes, as the machine's controller makes it."""
    machine = Machine.of(machine)
    if not isinstance(program, Program):
        program = Program.read(program, machine)
    positions, period_s = commanded(program, machine)
    moved = np.ptp(positions, axis=0)
    axis = int(np.argmax(moved))
    if not moved[axis] > 0.0:
        raise RecordError(f"{program.source}: nothing moves: needed is the program that ran beside the logger")
    others = [f"{'XYZ'[k]} by {moved[k]:.3g} mm" for k in range(3) if k != axis and moved[k] > 0.0]
    if others:
        raise RecordError(
            f"{program.source}: {'XYZ'[axis]} moves by {moved[axis]:.3g} mm, and {' and '.join(others)} too: needed is "
            "a program that moves one axis, as shapegcode sweep writes it"
        )
    x = positions[:, axis]
    kicks = np.diff(np.diff(x, prepend=x[0], append=x[-1])) * 1e-3 / period_s
    parts = [(first * period_s, end * period_s) for first, end in moving_parts(x, period_s)]
    return KnownCommand(
        program.source, "xyz"[axis], np.asarray(np.arange(len(x)) * period_s, dtype=np.float64), kicks, tuple(parts)
    )


def find_modes_of_command(
    command: KnownCommand,
    sources: Sequence[str | Path | Record],
    options: ReadOptions,
    sought: Sought,
    *,
    across: bool = False,
) -> Identification:
    """Find the modes in records beside a known command, with `across` what they move of the sensor's other axes too.

    See `identify.identify`.
    """
    aligned = [_aligned(command, source, options, sought.band_hz, across=across) for source in sources]
    ends = [[each.response.frequency_hz[end] for each in aligned] for end in (0, -1)]
    responses = [_between(each.response, max(ends[0]), min(ends[1])) for each in aligned]
    names = tuple(_name(each) for each in sources)
    found = find_frf_modes(responses, names, replace(sought, phase_known=False))
    first, lines = aligned[0], responses[0].frequency_hz
    if across:
        found = with_moves(
            found, [_between(one, max(ends[0]), min(ends[1])) for each in aligned for one in each.others]
        )
    return replace(
        found,
        notes=(*(note for each in aligned for note in each.notes), *found.notes),
        responses=(),
        fitted_lines=(),
        noise_rms=None,
        sweep=Sweep(
            first.record.source, command.axis, len(first.record.response), first.record.period_s, lines,
            np.abs(responses[0].response), np.abs(found.fitted_lines[0]), command=command.source,
        ),
    )  # fmt: skip


def _name(source: str | Path | Record) -> str:
    return source.source if isinstance(source, Record) else str(source)


def _between(each: FrequencyResponse, low_hz: float, high_hz: float) -> FrequencyResponse:
    """The lines that all records have."""
    inside = (each.frequency_hz >= low_hz) & (each.frequency_hz <= high_hz)
    assert each.coherence is not None
    lines, coherence = each.response[inside], each.coherence[inside]
    return replace(each, frequency_hz=each.frequency_hz[inside], response=lines, coherence=coherence)


@dataclass(frozen=True, eq=False)
class _Aligned:
    record: Record
    response: FrequencyResponse  # minus the acceleration over that of the command
    notes: tuple[str, ...]
    others: tuple[FrequencyResponse, ...] = ()  # the same of the sensor's other axes


def _aligned(
    command: KnownCommand,
    source: str | Path | Record,
    options: ReadOptions,
    band_hz: tuple[float, float] | None,
    *,
    across: bool,
) -> _Aligned:
    """The record of a file that goes with the command, on the program's time."""
    records = [source] if isinstance(source, Record) else read_records(source, replace(options, ignore_force=True))
    clocks = [_Clock(command, record) for record in records]
    named = [clock for clock in clocks if clock.record.axis == command.axis] if across else []
    best = max(named or clocks, key=lambda clock: clock.correlation)
    others = [each for each in records if each is not best.record] if across else []
    return best.aligned(band_hz, len(records) > 1, others)


def _held_at_ends(values: FloatArray) -> bool:
    """Whether the largest or the smallest value stands for samples in a row, again and again."""
    for end in (np.max(values), np.min(values)):
        at = np.flatnonzero(values == end)
        if np.count_nonzero(np.diff(at) == 1) > _HELD * len(values) and abs(end - np.median(values)) > 0.0:
            return True
    return False


class _Clock:
    """A record and where the program is in it: program time = logger's time * (1 + rate) - start."""

    def __init__(self, command: KnownCommand, record: Record) -> None:
        if record.quantity != "acceleration":
            raise RecordError(f"{record.source}: {record.quantity}: a sweep needs an acceleration")
        if not np.ptp(record.response) > 0.0:
            raise RecordError(f"{record.source}: every sample is {record.response[0]:.4g} m/s²: nothing was measured")
        if _held_at_ends(record.response):
            raise RecordError(
                f"{record.source}: overload: the acceleration is cut off at {np.max(np.abs(record.response)):.4g} "
                "m/s²; needed is a larger range of the sensor, or less acceleration (shapegcode sweep --acceleration)"
            )
        if len(command.parts) < _FEWEST_PARTS:
            raise RecordError(
                f"{command.source}: moves without a rest of {REST_S:g} s or more: needed are {_FEWEST_PARTS} parts "
                "with such a rest between them, as shapegcode sweep writes them"
            )
        duration, needed = len(record.response) * record.period_s, command.parts[1][1]
        if duration < needed - command.parts[0][0]:
            raise RecordError(
                f"{record.source}: {duration:.3g} s: too short, needed are two parts of {command.source} between its "
                f"rests: {needed:.3g} s or more from its start"
            )
        if 1.0 / record.period_s < _OVER_HALF * _NARROWEST * _LOWEST_HZ:
            raise RecordError(
                f"{record.source}: {1.0 / record.period_s:g} samples per second are too slow: needed are "
                f"{_OVER_HALF:g} for each Hz of the highest mode, {_OVER_HALF * _NARROWEST * _LOWEST_HZ:g} or more"
            )
        self.command, self.record = command, record
        self.values = record.response - np.mean(record.response)
        ends = [begin for begin, _ in command.parts[1:]]
        self.windows = list(
            zip([begin for begin, _ in command.parts], [*ends, command.parts[-1][1] + _AFTER_S], strict=True)
        )
        self.rate, self.start_s, self.shares = self._coarse()
        self.correlation = float(np.mean(self.shares))

    def _coarse(self) -> tuple[float, float, FloatArray]:
        """Rate, start, and squared correlation of each part, by what lies below 40 Hz and 40 % of the sampling rate."""
        command, period = self.command, self.record.period_s
        thinner = max(1, int(0.4 / period / _COARSE_HZ))
        values = resample_poly(self.values, 1, thinner)
        step = period * thinner
        smooth, times = _low_passed(command, min(_COARSE_HZ, 0.4 / step))
        energy = np.array(
            [np.sum(np.abs(smooth[(times >= begin) & (times < end)]) ** 2) for begin, end in self.windows]
        )
        used = np.flatnonzero(energy > _LOUD * energy.max())
        size = 1 << int(np.ceil(np.log2(len(values) + len(smooth) * (times[1] - times[0]) / step + 1)))
        # A mode that rings for long would be most of the record: every frequency counts alike.
        spectrum = np.fft.fft(values, size)
        level = uniform_filter1d(np.abs(spectrum), max(1, round(_LEVELLED_HZ * size * step)), mode="wrap")
        hertz = np.abs(np.fft.fftfreq(size, step))
        inside = (hertz >= _LOWEST_HZ) & (hertz <= min(_COARSE_HZ, 0.4 / step))
        spectrum = np.where(inside, spectrum / np.maximum(level, _QUIET * np.max(level)), 0.0)
        values = np.fft.ifft(spectrum).real[: len(values)]
        power = np.concatenate(([0.0], np.cumsum(np.concatenate((values**2, np.zeros(size - len(values)))))))
        best = (-1.0, 0.0, 0.0, np.zeros(len(self.windows)))
        for rate in np.arange(-_CLOCK, _CLOCK + 1e-9, _COARSE_STEP):
            every = step * (1.0 + rate)
            squares = np.zeros((len(used), size))
            for row, part in enumerate(used):
                begin, end = self.windows[part]
                at = begin + every * np.arange(int((end - begin) / every))
                wave = np.interp(at, times, smooth.real) + 1j * np.interp(at, times, smooth.imag)
                found = np.abs(np.fft.ifft(spectrum * np.conj(np.fft.fft(wave, size)))) ** 2
                # Behind the end it begins again: a part that began before the record.
                ends = np.arange(size) + len(at)
                own = power[np.minimum(ends, size)] - power[:size] + power[np.maximum(ends - size, 0)]
                own = np.maximum(own, _QUIET * float(np.max(own)))
                share = found / (own * 0.5 * float(np.sum(np.abs(wave) ** 2)))
                squares[row] = np.roll(share, -round(begin / every))
            total = squares.mean(axis=0)
            place = int(np.argmax(total))
            if total[place] > best[0]:
                first = place - size if place > len(values) else place
                shares = np.zeros(len(self.windows))
                reach = max(1, round(_SAME_START_S / every))
                near = np.arange(place - reach, place + reach + 1) % size
                shares[used] = squares[:, near].max(axis=1)
                best = (float(total[place]), float(rate), first * every, shares)
        return best[1:]

    def aligned(self, band_hz: tuple[float, float] | None, chosen: bool, others: Sequence[Record]) -> _Aligned:
        """Minus the response over the command, with start and clock found; and of others on the same clock."""
        rows = self._recorded(self._clear_parts(), _FEWEST_PARTS)
        clear = np.isin(np.arange(len(self.windows)), rows)
        spectra = self._spectra(band_hz)
        for _ in range(_ROUNDS):
            self._refine(spectra.of(rows), rows)
            spectra = self._spectra(band_hz)
            rows = self._recorded(_in_place(spectra, clear), _FEWEST_PARTS)
        while True:
            lags = _lags(spectra.of(rows))
            explained = _explained(spectra.of(rows).late(lags))
            worst = int(np.argmin(explained))
            if explained[worst] >= _EXPLAINED or len(rows) <= _FEWEST_PARTS:
                break
            rows = np.delete(rows, worst)
        if np.min(explained) < _EXPLAINED:
            raise RecordError(
                self._no_relation(f"parts of the program explain {max(100 * np.min(explained), 0.0):.0f} % of another")
            )
        rows = self._whole(rows)
        self._refine(spectra.of(rows), rows)  # Without those that did not go with the others
        spectra = self._spectra(band_hz)
        lags = _lags(spectra.of(rows))
        self._refuse_other_speed(spectra)
        notes = self._notes(rows)
        if chosen:
            notes.append(f"{self.record.source}: of the axes of the sensor this one goes with the command best")
        used = spectra.of(rows).late(lags).in_twos(rows)
        response = self._response(used)
        beside = []
        for other in others:
            clock = copy(self)
            clock.record, clock.values = other, other.response - np.mean(other.response)
            of_other = clock._spectra(band_hz).of(rows).late(lags).in_twos(rows)
            # Delay, lag and sign that were taken out of the one are taken out of the other.
            inside = np.isin(used.hertz, response.frequency_hz)
            lines = response.response * (of_other.ratio() / used.ratio())[inside]
            beside.append(replace(response, source=other.source, response=lines, axis=other.axis))
        return _Aligned(self.record, response, tuple(notes), tuple(beside))

    def _spectra(self, band_hz: tuple[float, float] | None) -> Spectra:
        """Lines of command and response of each part."""
        period = self.record.period_s * (1.0 + self.rate)
        low, high = band_hz or (_LOWEST_HZ, np.inf)
        high = min(high, 1.0 / (_OVER_HALF * period))
        longest = max(end - begin for begin, end in self.windows)
        step = 0.5 / longest
        hertz = np.arange(max(low, _LOWEST_HZ), high, step)
        if len(hertz) < FEWEST_LINES:
            raise RecordError(
                f"{self.record.source}: band of {low:g} to {high:.4g} Hz: {len(hertz)} lines between {_LOWEST_HZ:g} Hz "
                f"and a {_OVER_HALF:g}th of the samples per second: needed are {FEWEST_LINES} or more, "
                f"{FEWEST_LINES * step:.3g} Hz"
            )
        rows: list[tuple[ComplexArray, ComplexArray]] = []
        for begin, end in self.windows:
            first, last = (int(np.ceil((each + self.start_s) / period)) for each in (begin, end))
            first, last = max(first, 0), min(last, len(self.values))
            part = self.values[first:last]
            part = part - np.mean(part) if len(part) else part
            response = transform(part, first * period - self.start_s, period, hertz) * period
            every = self.command.period_s
            first, last = round(begin / every), round(end / every)
            rows.append((transform(self.command.kicks[first:last], first * every, every, hertz), response))
        return Spectra(hertz, np.array([each for each, _ in rows]), np.array([each for _, each in rows]))

    def _clear_parts(self) -> npt.NDArray[np.intp]:
        """Parts of the program that the record shows beyond doubt."""
        rows = np.flatnonzero(self.shares >= _CORRELATED)
        if len(rows) < _FEWEST_PARTS:
            best = 100.0 * float(np.sqrt(np.max(self.shares)))
            raise RecordError(
                self._no_relation(
                    f"{len(rows)} of {np.count_nonzero(self.shares)} parts of the program correlate with it, the best "
                    f"by {best:.0f} % (limit {100.0 * _CORRELATED**0.5:.0f} %)"
                )
            )
        return rows

    def _refuse_other_speed(self, spectra: Spectra) -> None:
        """Refuse a program whose moves took another time than commanded, although its rests are where they should be.

        A rise and its fall pass the same frequencies the other way round: if they are slower than commanded, what
        they say of a frequency is late in one and early in the other, and agrees only with a command as slow.
        """
        found = []
        for row in range(0, len(self.windows) - 1, 2):
            if not (self._is_recorded(row) and self._is_recorded(row + 1)):
                continue
            powers = np.abs(spectra.command[row : row + 2]) ** 2
            both = np.flatnonzero(np.all(powers > _OWN * powers.max(axis=1)[:, None], axis=0))
            if len(both) < FEWEST_LINES:
                continue
            lines = slice(both[0], both[-1] + 1)
            hertz, responses = spectra.hertz[lines], spectra.response[row : row + 2, lines]
            size = 1 << int(np.ceil(np.log2(4 * len(hertz))))
            agree = np.zeros(len(_SLOWER))
            stretched = zip(*(self._stretched(each, hertz) for each in (row, row + 1)), strict=True)
            for place, (one, other) in enumerate(stretched):
                powers = np.abs([one, other]) ** 2
                inside = np.all(powers > _OWN * powers.max(axis=1)[:, None], axis=0)
                crossed = responses[0] * np.conj(one * responses[1]) * other * inside
                total = float(np.sum(np.abs(crossed)))
                if total > 0.0:
                    agree[place] = size * float(np.max(np.abs(np.fft.ifft(crossed, size)))) / total
            best = int(np.argmax(agree))
            if 0 < best < len(_SLOWER) - 1 and agree[best] > _AGREE:
                below, most, above = agree[best - 1 : best + 2]
                between = (below - above) / (2.0 * (below - 2.0 * most + above))
                found.append(float(_SLOWER[best] + between * (_SLOWER[1] - _SLOWER[0])))
        if len(found) < _FEWEST_PAIRS:
            return
        slower = float(np.median(found))
        if abs(slower) > _OTHER_SPEED:
            raise RecordError(
                self._no_relation(
                    f"its moves and its rests tell of clocks that differ by {100.0 * abs(slower):.2f} % (limit "
                    f"{100.0 * _OTHER_SPEED:g} %)"
                )
            )

    def _stretched(self, row: int, hertz: FloatArray) -> Iterator[ComplexArray]:
        """Lines of the command of a part that takes so much longer about its middle, for each of `_SLOWER`."""
        period, (begin, end) = self.command.period_s, self.windows[row]
        first, last, middle = round(begin / period), round(end / period), 0.5 * sum(self.command.parts[row])
        # As those of the part itself at frequencies so much higher, which turn slowly when seen from its middle.
        reach = 1.0 + _SLOWER[-1]
        fine = np.arange(hertz[0] / reach, hertz[-1] * reach, (hertz[1] - hertz[0]) / _FINER)
        lines = transform(self.command.kicks[first:last], first * period - middle, period, fine)
        turned = np.exp(-2j * np.pi * hertz * middle)
        for slower in _SLOWER:
            at = hertz * (1.0 + slower)
            yield turned * (np.interp(at, fine, lines.real) + 1j * np.interp(at, fine, lines.imag))

    def _whole(self, rows: npt.NDArray[np.intp]) -> npt.NDArray[np.intp]:
        """Those of the parts of which the other one of their two is there as well.

        Of a part alone the ringing is cut off, or that of the part before is in it: both look like modes.
        """
        alone = len(self.windows) - 1 if len(self.windows) % 2 else -1
        return self._recorded(rows[np.isin(rows ^ 1, rows) | (rows == alone)], 1)

    def _recorded(self, rows: npt.NDArray[np.intp], fewest: int) -> npt.NDArray[np.intp]:
        """Those of the parts that the record holds until they rang down."""
        inside = np.array([row for row in rows.tolist() if self._is_recorded(row)], dtype=np.intp)
        if len(inside) < fewest:
            raise RecordError(
                f"{self.record.source}: no two parts of {self.command.source} (1 and 2, 3 and 4, ...) are both in the "
                f"record as commanded, from the begin of the first to {_RINGS_S:g} s behind the second: needed is one "
                "such pair, a rise and fall of a sweep"
            )
        return inside

    def _is_recorded(self, row: int) -> bool:
        """Whether the record holds a part from its begin until it rang down, or the next one begins."""
        last_s = len(self.values) * self.record.period_s * (1.0 + self.rate) - self.start_s
        begin, end = self.windows[row]
        return begin >= -self.start_s and min(end, self.command.parts[row][1] + _RINGS_S) <= last_s

    def _no_relation(self, found: str) -> str:
        axis = self.command.axis.upper()
        return (
            f"{self.record.source}: no relation to the command of {self.command.source}: {found}. Is the sensor on "
            f"what the {axis} axis moves, along {axis}? Was it this program, at an override of 100 %, and is it the "
            f"machine file of this control? The clock of the logger may be off by {100 * _CLOCK:g} %"
        )

    def _refine(self, spectra: Spectra, rows: npt.NDArray[np.intp]) -> None:
        """The rate for which the parts agree best on one response."""
        power = np.maximum(spectra.power, 1e-300)
        middles = np.array([np.mean(self.windows[row]) for row in rows])
        middle = float(middles.mean())
        crossed = np.conj(spectra.command) * spectra.response

        def missed(change: float) -> float:
            turned = np.exp(-spectra.turn * change * (middles - middle)[:, None])
            return -float(np.sum(np.abs(np.sum(crossed * turned, axis=0)) ** 2 / power))

        changes = np.arange(-1.5 * _COARSE_STEP, 1.5 * _COARSE_STEP, _FINE_STEP)
        best = float(changes[int(np.argmin([missed(each) for each in changes]))])
        found = minimize_scalar(missed, bounds=(best - _FINE_STEP, best + _FINE_STEP), method="bounded")
        factor = 1.0 + float(found.x)
        # Program time = (logger's time * (1 + rate) - start), stretched about the middle of the parts.
        self.rate = (1.0 + self.rate) * factor - 1.0
        self.start_s = self.start_s * factor + middle * (factor - 1.0)

    def _notes(self, rows: npt.NDArray[np.intp]) -> list[str]:
        """What is said of the clock, and of parts that are not used."""
        start_s = self.start_s / (1.0 + self.rate)
        notes = [
            f"{self.record.source}: the program begins {abs(start_s):.3f} s {'after' if start_s >= 0.0 else 'before'} "
            f"the record; the logger's clock is {-100.0 * self.rate:+.4f} % off the control's"
        ]
        missing = sorted(set(range(len(self.windows))) - set(rows.tolist()))
        if missing:
            begin = self.windows[missing[0]][0]
            after = missing == list(range(missing[0], len(self.windows)))
            cause = (
                "feed hold, another override, a jump of the logger's clock, a short record, or too little motion"
                if after
                else "little of it was recorded, or the control does not move as its machine file says"
            )
            what = f"from {begin:.1f} s on" if after else f"in {len(missing)} of {len(self.windows)} parts"
            notes.append(f"{self.record.source}: {what} the record does not go with the program ({cause}): not used")
        return notes

    def _response(self, spectra: Spectra) -> FrequencyResponse:
        """Minus the response over the command where the command excites and parts agree."""
        used, coherence = spectra.coherent()
        if np.count_nonzero(used) < FEWEST_LINES:
            raise RecordError(self._no_relation("no line is coherent with the command"))
        power = spectra.power
        hertz, ratio, coherence = spectra.hertz[used], spectra.ratio()[used], coherence[used]
        # What is left of a delay and the lag of a position loop, by all lines: those that bring phases best together.
        turn, turns = 2j * np.pi * hertz, np.exp(2j * np.pi * hertz * _LAGS_S[:, None])
        loops = [np.ones(len(hertz), dtype=np.complex128), *(1.0 + turn / gain for gain in _GAINS_PER_S)]
        sums = [np.abs(turns @ (ratio * loop / np.abs(ratio * loop))) for loop in loops]
        ratio = ratio * loops[int(np.argmax([np.max(each) for each in sums]))]
        unit = ratio / np.abs(ratio)
        best = turns[int(np.argmax(np.abs(turns @ unit)))]
        # The sign of the sensor, by the lowest lines: there the axis moves as one.
        power = power[used]
        lowest = np.cumsum(power) <= _LOWEST_SHARE * np.sum(power)
        ratio = ratio * best * (np.sign(np.sum((unit * best * power)[lowest].real)) or 1.0)
        return FrequencyResponse(
            self.record.source, hertz, -ratio, "acceleration", coherence, self.command.axis, scaled=False
        )


def _in_place(spectra: Spectra, clear: npt.NDArray[np.bool_]) -> npt.NDArray[np.intp]:
    """Parts that are clear, or correlate with their command best where they should be and stand out or are between."""
    lags = np.linspace(-_AWAY_S, _AWAY_S, 401)
    crossed = spectra.response * np.conj(spectra.command)
    height = np.abs(crossed @ np.exp(spectra.turn[:, None] * lags))
    near = np.abs(lags[np.argmax(height, axis=1)]) < _SAME_START_S
    clear = clear | (near & (height.max(axis=1) > _STANDS_OUT * np.sqrt(np.mean(height**2, axis=1))))
    rows = np.arange(len(clear))
    ends = np.flatnonzero(clear)[[0, -1]]
    return np.flatnonzero(clear | (near & (rows > ends[0]) & (rows < ends[1])))


def _lags(spectra: Spectra) -> FloatArray:
    """By how much the response of each part is later than the others say, s."""
    lags = np.zeros(len(spectra.command))
    for _ in range(_ROUNDS):
        late = spectra.late(lags)
        for row in range(len(lags)):
            others = late.of(np.flatnonzero(np.arange(len(lags)) != row)).ratio()
            crossed = late.response[row] * np.conj(others * late.command[row])
            crossed = crossed * (np.abs(late.command[row]) ** 2 > _OWN * np.max(np.abs(late.command[row]) ** 2))

            def missed(lag: float, crossed: ComplexArray = crossed) -> float:
                return -float(np.sum((crossed * np.exp(spectra.turn * lag)).real))

            steps = np.linspace(-_LONGEST_LAG_S, _LONGEST_LAG_S, 81)
            best = float(steps[int(np.argmin([missed(each) for each in steps]))])
            width = float(steps[1] - steps[0])
            lags[row] += float(minimize_scalar(missed, bounds=(best - width, best + width), method="bounded").x)
    return lags - float(np.mean(lags))


def _explained(spectra: Spectra) -> FloatArray:
    """Share of the power of each part, where the command has most of its own, that the other parts explain."""
    found = []
    for row in range(len(spectra.command)):
        others = spectra.of(np.flatnonzero(np.arange(len(spectra.command)) != row))
        own = np.abs(spectra.command[row]) ** 2
        inside = own > _OWN * np.max(own)
        left = (spectra.response[row] - others.ratio() * spectra.command[row])[inside]
        total = float(np.sum(np.abs(spectra.response[row][inside]) ** 2))
        found.append(1.0 - float(np.sum(np.abs(left) ** 2)) / max(total, 1e-300))
    return np.array(found)


def _low_passed(command: KnownCommand, highest_hz: float) -> tuple[ComplexArray, FloatArray]:
    """Analytic signal of the commanded acceleration below a frequency, and its instants."""
    size = 2 * len(command.kicks)
    spectrum = np.fft.fft(command.kicks, size) / command.period_s
    hertz = np.fft.fftfreq(size, command.period_s)
    spectrum[(hertz <= 0.0) | (hertz > highest_hz)] = 0.0
    return 2.0 * np.fft.ifft(spectrum)[: len(command.kicks)], command.times_s
