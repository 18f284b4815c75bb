"""One tap or decay, or a frequency response without its time record, in SI units; options for reading their files; the
sampling period from the instants in a file, and resampling of unevenly sampled data.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
import numpy.typing as npt
from scipy.linalg import solveh_banded

from shapegcode.errors import RecordError
from shapegcode.hints import Hinted
from shapegcode.io.units import FloatArray, Measured, Unit, find_unit, units_of, words_of

Quantity = Literal["acceleration", "velocity", "displacement"]

UNITS: dict[Quantity, str] = {"acceleration": "m/s²", "velocity": "m/s", "displacement": "m"}
RESPONSES: tuple[Quantity, ...] = get_args(Quantity)


@dataclass(frozen=True, eq=False)
class Record:
    """Samples of one tap (with force) or of one free decay (without).

    Attributes:
        source: file, with column, dataset or impact if it has several, for messages.
        period_s: time between two samples.
        response: (n,) in the unit of `quantity`.
        quantity: what the sensor measured.
        force_n: (n,) force of the hammer at the same instants; None: a free decay.
        axis: "x", "y" or "z"; None: the file does not state it.
        start_s: time of the first sample in the file.
        warnings: assumptions made on reading.
        notes: parts ignored on reading.
        widened: factor on confidence intervals (uneven samples carry less information).
    """

    source: str
    period_s: float
    response: FloatArray
    quantity: Quantity = "acceleration"
    force_n: FloatArray | None = None
    axis: str | None = None
    start_s: float = 0.0
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    widened: float = 1.0

    def __post_init__(self) -> None:
        if not (np.isfinite(self.period_s) and self.period_s > 0.0):
            raise RecordError(f"{self.source}: period of {self.period_s:g} s: must be finite and above 0")
        _check_samples(self.source, "response", self.response)
        if self.force_n is None:
            return
        _check_samples(self.source, "force", self.force_n)
        if len(self.force_n) != len(self.response):
            raise RecordError(
                f"{self.source}: {len(self.force_n)} samples of force and {len(self.response)} of response: "
                "both must be sampled together"
            )

    @property
    def time_s(self) -> FloatArray:
        """Instants of the samples, (n,)."""
        return np.asarray(self.start_s + self.period_s * np.arange(len(self.response)), dtype=np.float64)


def _check_samples(source: str, what: str, values: FloatArray) -> None:
    array = np.asarray(values)
    if array.ndim != 1 or array.dtype.kind not in "fiu" or not array.size:
        raise RecordError(
            f"{source}: the {what} is of shape {array.shape} and type {array.dtype}; required: one row of real numbers"
        )
    bad = np.flatnonzero(~np.isfinite(array))
    if bad.size:
        raise RecordError(f"{source}: sample {bad[0]} of the {what} is {array[bad[0]]}: must be finite")


@dataclass(frozen=True)
class ReadOptions:
    """User's statements about a file, which override the file.

    Attributes:
        axis: use only the response along this axis ("x", "y" or "z"); a file without axes is assumed to have this one.
        time_column: header or number (from 1) of the column with the time.
        force_column: header or number of the column with the hammer's force.
        response_columns: headers or numbers of the response columns; empty: all named by the header.
        time_unit: unit of the time column, overrides the header.
        force_unit: unit of the force.
        response_unit: unit of the response.
        period_s: time between two samples, if the file has no time, or to check it.
        quantity: measured quantity, if the file does not state it; in a universal file it also selects the responses.
        force_scale: N per unit in the file; integer WAV: N at full scale.
        response_scale: m/s², m/s or m (see *quantity*) per unit in the file; integer WAV: at full scale.
        response_first: in a WAV file, the response is the first channel and the force the second.
        force_sensitivity: sensitivity of the hammer, such as "2.25 mV/N", for a force in volts.
        response_sensitivity: sensitivity of the sensor, such as "100 mV/g", for a response in volts.
        ignore_force: read only the response, as a free decay.
        exponential_window_s: time constant of an exponential window that the analyser applied to the response.
    """

    axis: str | None = None
    time_column: str | None = None
    force_column: str | None = None
    response_columns: tuple[str, ...] = ()
    time_unit: str | None = None
    force_unit: str | None = None
    response_unit: str | None = None
    period_s: float | None = None
    quantity: Quantity | None = None
    force_scale: float | None = None
    response_scale: float | None = None
    response_first: bool = False
    force_sensitivity: str | None = None
    response_sensitivity: str | None = None
    ignore_force: bool = False
    exponential_window_s: float | None = None

    def __post_init__(self) -> None:
        if self.axis not in {None, "x", "y", "z"}:
            raise RecordError(f"axis {self.axis!r}: must be x, y or z")
        for name in ("period_s", "force_scale", "response_scale"):
            value = getattr(self, name)
            if value is not None and not 0.0 < abs(value) < float("inf"):
                raise RecordError(f"{name} = {value:g}: must be a number other than 0")
        for name in ("period_s", "exponential_window_s"):
            value = getattr(self, name)
            if value is not None and not 0.0 < value < float("inf"):
                raise RecordError(f"{name} = {value:g}: must be above 0")
        kinds: dict[str, tuple[Measured, ...]] = {"time": ("time",), "force": ("force",), "response": RESPONSES}
        for kind, allowed in kinds.items():
            text = getattr(self, f"{kind}_unit")
            if text is not None and stated_unit(text, allowed) is None:
                raise RecordError(f"{kind}_unit {text!r} is not known: must be one of {units_of(*allowed)}")
        for kind in ("force", "response"):
            text = getattr(self, f"{kind}_sensitivity")
            if text is not None:
                per_volt(f"{kind}_sensitivity", text, kinds[kind])
                if getattr(self, f"{kind}_scale") is not None:
                    raise RecordError(f"{kind}_sensitivity {text!r} and {kind}_scale: specify only one")


_VOLTS = {"v": 1.0, "mv": 1e-3, "µv": 1e-6, "uv": 1e-6}


def volts_of(unit_text: str) -> float | None:
    """Factor from V, mV or µV to volts; without a unit 1; None: another unit."""
    plain = unit_text.strip().lower().replace("μ", "µ")
    return 1.0 if plain in {"", "volt", "volts"} else _VOLTS.get(plain)


def per_volt(option: str, text: str, allowed: tuple[Measured, ...]) -> tuple[Unit, float]:
    """Unit of the quantity that a sensor measures, and the SI value of one volt, from its sensitivity."""
    match = re.fullmatch(r"\s*([0-9.]+(?:[eE][+-]?\d+)?)\s*([mµuμ]?V)\s*/\s*\(?(.+?)\)?\s*", text)
    unit = find_unit(match[3]) if match else None
    volts = volts_of(match[2]) if match else None
    if match is None or unit is None or volts is None or unit.measures not in allowed or not float(match[1]) > 0.0:
        example = "2.25 mV/N" if allowed == ("force",) else "100 mV/g"
        raise RecordError(
            f"{option} {text!r}: must be V, mV or µV over one of {units_of(*allowed)}, such as {example!r}"
        )
    return unit, unit.factor / (float(match[1]) * volts)


def stated_unit(text: str | None, allowed: tuple[Measured, ...]) -> Unit | None:
    """Unit stated by an option; None: not stated, unknown, or of a quantity that is not allowed."""
    unit = find_unit(text) if text else None
    return unit if unit is not None and unit.measures in allowed else None


ComplexArray = npt.NDArray[np.complex128]

FEWEST_LINES = 16  # fewer lines do not determine a mode with its damping
_NAMES: dict[str, Quantity] = {
    "receptance": "displacement", "compliance": "displacement", "flexibility": "displacement",
    "admittance": "displacement", "mobility": "velocity", "accelerance": "acceleration", "inertance": "acceleration",
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class FrequencyResponse(Hinted):
    """A measured frequency response: response over force, one value per frequency.

    Attributes:
        source: file and dataset or column, for messages.
        frequency_hz: (n,), ascending, above 0; evenly spaced or not.
        response: (n,) complex, in m/s², m/s or m per N by `quantity`.
        quantity: response quantity, which was divided by the force.
        coherence: (n,) 0 to 1; None: not in the file.
        axis: "x", "y" or "z"; None: the file does not state it.
        warnings: assumptions made on reading.
        notes: parts ignored on reading.
        scaled: False: the force is known only up to a factor (a motor's torque), so that no mass follows.
    """

    source: str
    frequency_hz: FloatArray
    response: ComplexArray
    quantity: Quantity = "acceleration"
    coherence: FloatArray | None = None
    axis: str | None = None
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    scaled: bool = True

    def __post_init__(self) -> None:
        if not isinstance(self.source, str) or self.quantity not in get_args(Quantity):
            kinds = ", ".join(get_args(Quantity))
            raise RecordError(f"a frequency response: a name first, and a quantity that is one of {kinds}")
        count = len(self.frequency_hz)
        named = {"frequencies": self.frequency_hz, "lines": self.response, "coherence": self.coherence}
        for what, values in named.items():
            if values is None:
                continue
            bad = np.flatnonzero(~np.isfinite(values))
            if bad.size:
                raise RecordError(f"{self.source}: line {bad[0] + 1} of the {what} is {values[bad[0]]}: must be finite")
            if np.ndim(values) != 1 or len(values) != count:
                raise RecordError(f"{self.source}: {len(values)} {what} for {count} frequencies: must be equally many")
        if count < FEWEST_LINES:
            raise RecordError(f"{self.source}: {count} lines of a frequency response; required: {FEWEST_LINES} or more")
        if self.frequency_hz[0] <= 0.0 or np.any(np.diff(self.frequency_hz) <= 0.0):
            raise RecordError(f"{self.source}: the frequencies must be above 0 and ascend")
        if not np.any(self.response):
            raise RecordError(f"{self.source}: every line is 0: is it the right channel?")

    @property
    def resolution_hz(self) -> float:
        """Median of the line spacings, Hz."""
        return float(np.median(np.diff(self.frequency_hz)))


_SIZES = 1e-50, 1e50  # limits of magnitudes; their fourth powers do not overflow


def checked_response(
    source: str, frequency_hz: FloatArray, response: ComplexArray, coherence: FloatArray | None, quantity: Quantity,
    axis: str | None, warnings: Sequence[str], notes: Sequence[str] = (), *, where: str = "", factor: float = 1.0,
    scaled: bool = True,
) -> FrequencyResponse:  # fmt: skip
    """Check lines and make a `FrequencyResponse` of them, times a factor, without the line at 0 Hz."""
    where = where or source
    steps = np.diff(frequency_hz)
    if np.any(steps <= 0.0):
        row = int(np.flatnonzero(steps <= 0.0)[0]) + 1
        raise RecordError(
            f"{where}: frequency {frequency_hz[row]:.9g} Hz of value {row + 1} comes after {frequency_hz[row - 1]:.9g} "
            "Hz: must ascend"
        )
    if len(frequency_hz) and frequency_hz[0] < 0.0:
        raise RecordError(f"{where}: frequency {frequency_hz[0]:.9g} Hz: must be 0 or more")
    if coherence is not None and (np.any(coherence < 0.0) or np.any(coherence > 1.0 + 1e-6)):
        row = int(np.flatnonzero((coherence < 0.0) | (coherence > 1.0 + 1e-6))[0])
        raise RecordError(f"{where}: coherence {coherence[row]:.6g} of value {row + 1}: must be from 0 to 1")
    size = np.abs(response)
    strange = np.flatnonzero((size > _SIZES[1]) | ((size < _SIZES[0]) & (size > 0.0)))
    if strange.size:
        row = int(strange[0])
        raise RecordError(
            f"{where}: value {row + 1} of the response is {size[row]:.3g}: must be 0 or from {_SIZES[0]:g} to "
            f"{_SIZES[1]:g}; is it a response?"
        )
    if len(frequency_hz) and frequency_hz[0] == 0.0:
        frequency_hz, response, coherence = frequency_hz[1:], response[1:], None if coherence is None else coherence[1:]
        notes = (*notes, f"{where}: the line at 0 Hz is ignored")
    told = tuple(warnings), tuple(notes)
    return FrequencyResponse(source, frequency_hz, response * factor, quantity, coherence, axis, *told, scaled=scaled)


def frequency_factor(text: str) -> float:
    """Factor to Hz, from a label."""
    return 1.0 / (2.0 * np.pi) if "rad" in text.lower() else 1000.0 if "khz" in text.lower() else 1.0


def ratio_unit(text: str) -> tuple[Unit, float] | None:
    """Unit of the response and factor to SI, from ``m/N``, ``(m/s²)/N``, ``µm/N``, ``1/kg`` ...; None: unknown."""
    plain = text.strip().strip("[]")
    if re.fullmatch(r"(1/kg|kg\^?-1)", plain):
        unit = find_unit("m/s²")
        return None if unit is None else (unit, 1.0)
    match = re.fullmatch(r"(.+?)\s*/\s*\(?\s*(k?N|kgf|lbf)\s*\)?\s*[·*.]?\s*(s(?:\^?2|²)?)?\s*\)?", plain)
    if match is None:
        return None
    numerator = match[1].strip()
    if match[3]:  # m/(N s), m/(N·s²)
        numerator = f"{numerator.strip('( ')}/{match[3].replace('2', '²').replace('^', '')}"
    unit = find_unit(numerator.replace("(", "").replace(")", ""))
    force = find_unit(match[2])
    if unit is None or force is None or unit.measures not in RESPONSES:
        return None
    return unit, unit.factor / force.factor


def scale_of(where: str, label: str, options: ReadOptions) -> tuple[Quantity, float, list[str]]:
    """Quantity, factor to SI and warnings for a response over force, by options, unit or name."""
    force = stated_unit(options.force_unit, ("force",))
    over = options.force_scale or (1.0 if force is None else force.factor)
    named = options.quantity or next((_NAMES[word] for word in words_of(label) if word in _NAMES), None)
    stated = stated_unit(options.response_unit, RESPONSES)
    if options.response_scale is not None:
        if named is None:
            raise RecordError(f"{where}: --response-scale needs --quantity acceleration, velocity or displacement")
        return named, options.response_scale / over, []
    if stated is not None:
        measures = next(each for each in RESPONSES if each == stated.measures)
        if named not in {None, measures}:
            raise RecordError(f"{where}: --response-unit {stated.name} is of {measures}, the response is {named}")
        return measures, stated.factor / over, []
    # In brackets, after the name, or the whole text.
    inside = re.findall(r"\[([^\]]*)\]", label) + re.findall(r"\(((?:[^()]|\([^()]*\))*)\)", label)
    behind = [label[at.end() :] for at in re.finditer(r"[\s_]+", label)]
    found = next((unit for part in (*inside, *behind, label) if (unit := ratio_unit(part)) is not None), None)
    if found is not None:
        measures = next(each for each in RESPONSES if each == found[0].measures)
        if options.quantity not in {None, measures}:
            raise RecordError(f"{where}: {label!r} is of {measures}, --quantity is {options.quantity}: must agree")
        return measures, found[1], []
    if named is not None:
        si = {"acceleration": "(m/s²)/N", "velocity": "(m/s)/N", "displacement": "m/N"}[named]
        return named, 1.0 / over, [f"{where}: the response has no unit: {si} is assumed"]
    raise RecordError(
        f"{where}: unclear whether it is displacement, velocity or acceleration over force; required: a unit such "
        "as m/N, µm/N, (m/s)/N, (m/s²)/N or g/N in the header, or --response-unit (of the response, over N), or "
        "--quantity"
    )


#: Allowed deviation of an instant from even sampling, relative to the period. Rounding to the file's digits
#: moves it by up to half a digit; a missing or a doubled sample moves it, or a neighbour, by half a period or more.
_OFF_GRID = 0.49
#: Allowed relative difference of a step from the period; a missing sample doubles the step.
_OFF_STEP = 0.9
_REPORTED_DEVIATION = 0.1  # deviation from the grid that is reported, relative to the period
#: Allowed relative difference of stated and measured rate: clocks are far better, wrong units far worse.
STATED_RATE_TOLERANCE = 0.01
#: Rounding moves an instant by half a digit at most; if digits are finer than this fraction of the deviation, the
#: clock of the logger itself is uneven.
_ROUNDED = 0.5
_UNEVEN = 0.05  # uneven clock: half of the steps differ from the usual one by more than this ratio
_GRID_ONLY = "samples must be evenly spaced"


class UnevenTimeError(ValueError):
    """The instants are not evenly spaced."""

    def __init__(self, row: int, text: str, *, ascending: bool = False) -> None:
        super().__init__(text)
        self.row, self.ascending = row, ascending


def even_period(
    times_s: FloatArray, stated_s: float | None = None, *, even_clock: bool = True
) -> tuple[float, list[str]]:
    """Period of evenly spaced instants, the stated one or else the mean, and warnings."""
    count = len(times_s)
    steps = np.diff(times_s)
    backwards = np.flatnonzero(steps < 0.0)
    if backwards.size:
        row = int(backwards[0]) + 1
        raise UnevenTimeError(row, f"time {times_s[row]:.9g} s comes after {times_s[row - 1]:.9g} s: must ascend")
    mean = float(times_s[-1] - times_s[0]) / (count - 1)
    if stated_s is not None and not abs(mean / stated_s - 1.0) <= STATED_RATE_TOLERANCE:
        what = f"the time column has a sample every {mean:.6g} s, {stated_s:.6g} s is stated"
        must = f"must agree within {100 * STATED_RATE_TOLERANCE:g} %; is the unit of the time right?"
        raise UnevenTimeError(0, f"{what}: {must}")
    period = mean if stated_s is None else stated_s
    rising = steps[steps > 0.0]
    digit = float(np.min(rising)) if rising.size else 0.0
    coarse = stated_s is not None and digit > 1.5 * stated_s
    repeated = np.flatnonzero(steps == 0.0)
    if repeated.size and not coarse:
        row = int(repeated[0]) + 1
        remedy = "if the file has too few digits, omit the time and state the period (--sample-period)"
        raise UnevenTimeError(row, f"time {times_s[row]:.9g} s is repeated: must ascend; {remedy}")
    usual = float(np.median(steps))
    if not coarse:
        row = int(np.argmax(np.abs(steps - usual)))
        if abs(steps[row] - usual) > _OFF_STEP * usual:
            raise UnevenTimeError(
                row + 1,
                f"{steps[row]:.6g} s between {times_s[row]:.9g} s and {times_s[row + 1]:.9g} s, usually {usual:.6g} s: "
                f"{_GRID_ONLY}; samples are missing",
                # Lost samples of an even clock are not an uneven clock: the data in the gap are unknown.
                ascending=bool(np.median(np.abs(steps - usual)) > _UNEVEN * usual),
            )
    grid = times_s[0] + period * np.arange(count)
    off = times_s - grid
    # The first instant is rounded like the others.
    off -= np.median(off)
    row = int(np.argmax(np.abs(off)))
    share = float(abs(off[row])) / period
    limit = max(_OFF_GRID, digit / period if coarse else 0.0)
    place = f"time {times_s[row]:.9g} s is {share:.2g} periods of {period:.6g} s from even spacing"
    if share > limit:
        text = f"{place} (limit {limit:.2g}): {_GRID_ONLY} and none may be missing"
        raise UnevenTimeError(row, text, ascending=True)
    if not even_clock and share > _REPORTED_DEVIATION and not coarse and _digit_of(times_s) < _ROUNDED * share * period:
        text = f"{place}, more than the digits of the file explain: {_GRID_ONLY}"
        raise UnevenTimeError(row, text, ascending=True)
    if share > _REPORTED_DEVIATION and not coarse:
        return period, [
            f"times are up to {100 * share:.0f} % of a period from even spacing: rounding is assumed, with a "
            f"period of {period:.6g} s"
        ]
    return period, []


def _digit_of(times_s: FloatArray) -> float:
    """Value of the last digit of instants, s; 0: finer than a picosecond."""
    for power in range(13):
        scaled = times_s * 10.0**power
        if np.max(np.abs(scaled - np.round(scaled))) < 1e-3:
            return float(10.0**-power)
    return 0.0


_DENSITY = 0.8  # grid points per sample: the surplus samples average noise and bridge gaps
_LONGEST_STEP = 3.0  # longest step relative to the mean: a longer one limits the band to less than a third
_REACH = 16  # sinc of this many samples on either side in a Kaiser window with 80 dB, flat up to .4 of the grid's rate
_BETA = 7.86
_RIDGE = 1e-6
#: Minimum factor on confidence intervals: in addition to the noise, content of the pulse above the band of the grid is
#: an error that a fit to the resampled data does not detect.
_MIN_WIDENED = 3.0


@dataclass(frozen=True, eq=False)
class EvenGrid:
    """An even grid for uneven instants."""

    period_s: float  # time between two of its samples
    times_s: FloatArray  # (m,) instants
    widened: float  # factor on confidence intervals
    notes: list[str]  # description of the resampling


def even_grid(times_s: FloatArray) -> EvenGrid:
    """Finest even grid that the uneven samples can determine.

    Source: H. Landau, Acta Mathematica 117, 1967: samples denser than a band's Nyquist rate determine a signal in it;
    with no gap longer than the grid's period the solution is stable (K. Groechenig, 1992).
    """
    steps = np.diff(times_s)
    mean = float(times_s[-1] - times_s[0]) / len(steps)
    row = int(np.argmax(steps))
    if steps[row] > _LONGEST_STEP * mean:
        raise UnevenTimeError(
            row + 1,
            f"{steps[row]:.6g} s between {times_s[row]:.9g} s and {times_s[row + 1]:.9g} s, on average {mean:.6g} s: a "
            f"step of more than {_LONGEST_STEP:g} times the mean is too long to resample; samples are missing",
        )
    period = max(mean / _DENSITY, float(steps[row]))
    count = int((times_s[-1] - times_s[0]) / period + 1e-9) + 1
    widened = max(_MIN_WIDENED, float(np.sqrt(steps[row] / mean)))
    note = (
        f"times are not evenly spaced: steps of {np.min(steps):.4g} to {steps[row]:.4g} s, on average {mean:.4g} s; "
        f"resampled to {1.0 / period:.5g} samples per second, valid up to {0.4 / period:.4g} Hz; intervals are "
        f"widened by a factor of {widened:.2g}"
    )
    return EvenGrid(period, times_s[0] + period * np.arange(count), widened, [note])


def resample(values: FloatArray, times_s: FloatArray, grid: EvenGrid) -> FloatArray:
    """Values, at the points of a grid, of the band-limited signal that fits the samples best (least squares, sinc)."""
    offset = float(np.mean(values))
    at = (times_s - grid.times_s[0]) / grid.period_s
    first = np.floor(at).astype(int) - _REACH + 1
    columns = first[:, None] + np.arange(2 * _REACH)
    away = at[:, None] - columns
    inside = np.sqrt(np.maximum(1.0 - (away / _REACH) ** 2, 0.0))
    weights = np.sinc(away) * np.i0(_BETA * inside) / np.i0(_BETA)
    # The signal includes grid points beyond the ends.
    count = len(grid.times_s) + 2 * _REACH
    columns = columns + _REACH
    band = np.zeros((2 * _REACH, count))
    right = np.zeros(count)
    for j in range(2 * _REACH):
        np.add.at(right, columns[:, j], weights[:, j] * (values - offset))
        for k in range(j, 2 * _REACH):
            np.add.at(band[k - j], columns[:, j], weights[:, j] * weights[:, k])
    band[0] += _RIDGE
    solved = solveh_banded(band, right, lower=True)
    return np.asarray(offset + solved[_REACH : _REACH + len(grid.times_s)], dtype=np.float64)
