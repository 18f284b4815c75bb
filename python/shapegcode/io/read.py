"""Reads records of tap tests and decays from any supported file; contains the readers of text columns and WAV."""

import io
import re
import warnings
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from shapegcode.errors import RecordError
from shapegcode.io.data_file import open_file, read_file
from shapegcode.io.frf_files import is_frf_text, is_mat, is_xml, read_frf_mat, read_frf_text, read_servo_tuning
from shapegcode.io.record import (
    RESPONSES,
    STATED_RATE_TOLERANCE,
    UNITS,
    FrequencyResponse,
    Quantity,
    ReadOptions,
    Record,
    UnevenTimeError,
    even_grid,
    even_period,
    per_volt,
    resample,
    stated_unit,
    volts_of,
)
from shapegcode.io.table import TextTable, is_clock_time
from shapegcode.io.uff import is_frf_uff, read_frf_uff, read_uff
from shapegcode.io.units import FloatArray, Label, Measured, Unit, tap_label, unit_of

_EXAMPLE = "time_s,force_N,acc_m/s^2"
_REMEDY = (
    "state the unit, or for a signal in volts the sensor's sensitivity (--force-sensitivity 2.25mV/N, "
    "--response-sensitivity 100mV/g) or the scale (--force-scale, --response-scale)"
)
_MIN_ROWS = 16  # fewer samples are no record of a vibration


@dataclass(frozen=True)
class _Column:
    index: int
    label: Label
    factor: float
    quantity: Quantity = "acceleration"


class _Chooser:
    def __init__(self, table: TextTable, options: ReadOptions) -> None:
        self.table, self.options = table, options
        self.labels = table.labels(tap_label)
        self.where = table.where
        self.warnings: list[str] = []
        self.notes: list[str] = []

    def _named(self, wanted: str, option: str) -> int:
        """Index of the column named by an option."""
        path, columns = self.table.path, self.table.layout.columns
        if wanted.strip().isdigit():
            number = int(wanted)
            if not 1 <= number <= columns:
                raise RecordError(f"{path}: {option} {number}: the file has columns 1 to {columns}")
            return number - 1
        plain = wanted.strip().lower()
        found = [index for index, label in enumerate(self.labels) if label.text.lower() == plain]
        found = found or [index for index, label in enumerate(self.labels) if label.text.lower().startswith(plain)]
        if len(found) != 1:
            what = "no column has" if not found else f"{len(found)} columns have"
            line = self.table.layout.header_line
            raise RecordError(f"{path}:{line}: {option} {wanted!r}: {what} this name; {self._listed()}")
        return found[0]

    def _listed(self) -> str:
        return "the header names " + ", ".join(repr(label.text) for label in self.labels if label.text)

    def _name(self, index: int) -> str:
        text = self.labels[index].text
        return repr(text) if text else f"column {index + 1}"

    def _factor(self, index: int, measures: Literal["time", "force"], option_unit: str | None) -> float:
        """Factor of a column to s or N."""
        unit = self._unit(index, (measures,), option_unit)
        if unit is None and measures == "force":
            self.warnings.append(f"{self._name(index)} has no unit: N is assumed")
        return 1.0 if unit is None else unit.factor

    def _unit(self, index: int, allowed: tuple[Measured, ...], option_unit: str | None) -> Unit | None:
        label = self.labels[index]
        if option_unit is not None:
            label = replace(label, unit=stated_unit(option_unit, allowed))
        return unit_of(self.where, replace(label, text=label.text or f"column {index + 1}"), allowed, _REMEDY)

    def _response(self, index: int) -> _Column:
        """Response column, with its quantity by option, name or unit."""
        options, label = self.options, self.labels[index]
        said = next((each for each in RESPONSES if each == label.measures), None)
        quantity = options.quantity or said
        if options.response_sensitivity is not None:
            of_volt, factor = per_volt("response_sensitivity", options.response_sensitivity, RESPONSES)
            measured = next(each for each in RESPONSES if each == of_volt.measures)
            return _Column(index, label, self._volts(index) * factor, measured)
        if options.response_scale is not None:
            return _Column(index, label, options.response_scale, quantity or "acceleration")
        bound = options.quantity or (None if options.response_unit else said)
        unit = self._unit(index, RESPONSES if bound is None else (bound,), options.response_unit)
        if unit is None:
            quantity = quantity or "acceleration"
            self.warnings.append(f"{self._name(index)} has no unit: {UNITS[quantity]} is assumed")
            return _Column(index, label, 1.0, quantity)
        return _Column(index, label, unit.factor, next(each for each in RESPONSES if each == unit.measures))

    def _volts(self, index: int) -> float:
        """Scale of a column to volts, for a sensor whose sensitivity is stated."""
        label = self.labels[index]
        factor = None if label.unit is not None else volts_of(label.unknown_unit)
        if factor is None:
            said = label.unit.name if label.unit is not None else label.unknown_unit
            raise RecordError(
                f"{self.where}: {self._name(index)} is in {said}, not in volts: omit its sensitivity, or state "
                "the scale (--force-scale, --response-scale)"
            )
        if not label.unknown_unit:
            self.warnings.append(f"{self._name(index)} has no unit: V is assumed, as its sensitivity is stated")
        return factor

    def time(self) -> _Column | None:
        """The column of the time; None: no column, but an option or the preamble states the period."""
        options = self.options
        if options.time_column is not None:
            index = self._named(options.time_column, "--time-column")
        else:
            found = [k for k, label in enumerate(self.labels) if label.measures == "time"]
            if not found:
                if options.period_s is not None or self.table.layout.period_s is not None:
                    return None
                raise RecordError(
                    f"{self.where}: no column of time; {self._listed()}; required: one called time (or t, Zeit), "
                    "--time-column, or the period (--sample-period)"
                )
            index = found[0]
            if len(found) > 1:
                self.warnings.append(f"{len(found)} columns of time: {self.labels[index].text!r} is used")
        return _Column(index, self.labels[index], self._factor(index, "time", options.time_unit))

    def force(self) -> _Column | None:
        """The column of the force; None (a free decay) if there is none, or with --ignore-force."""
        options = self.options
        if options.ignore_force:
            return None
        if options.force_column is not None:
            index = self._named(options.force_column, "--force-column")
        else:
            found = [k for k, label in enumerate(self.labels) if label.measures == "force"]
            if len(found) > 1 and options.axis:
                found = [k for k in found if self.labels[k].axis in {options.axis, None}]
            if not found:
                return None
            if len(found) > 1:
                names = ", ".join(repr(self.labels[k].text) for k in found)
                raise RecordError(f"{self.where}: {len(found)} columns of force, {names}: choose with --force-column")
            index = found[0]
        scale = options.force_scale
        if options.force_sensitivity is not None:
            scale = self._volts(index) * per_volt("force_sensitivity", options.force_sensitivity, ("force",))[1]
        factor = self._factor(index, "force", options.force_unit) if scale is None else scale
        return _Column(index, self.labels[index], factor)

    def responses(self, taken: set[int]) -> list[_Column]:
        options = self.options
        if options.response_columns:
            found = [self._named(name, "--response-column") for name in options.response_columns]
        else:
            kinds = {"response", *RESPONSES}
            found = [k for k, label in enumerate(self.labels) if label.measures in kinds and k not in taken]
            if options.axis is not None:
                named = [k for k in found if self.labels[k].axis is not None]
                chosen = [k for k in named if self.labels[k].axis == options.axis]
                if named and not chosen:
                    axes = ", ".join(sorted({self.labels[k].axis or "" for k in named}))
                    raise RecordError(
                        f"{self.where}: --axis {options.axis}: the responses are along {axes}; {self._listed()}"
                    )
                found = chosen or found
        if not found:
            raise RecordError(
                f"{self.where}: no column of a response; {self._listed()}; required: an acceleration, velocity "
                f"or displacement, as in {_EXAMPLE!r}, or --response-column"
            )
        columns = [self._response(k) for k in found]
        self._refuse_mixed(columns)
        return columns

    def _refuse_mixed(self, columns: list[_Column]) -> None:
        quantities = sorted({column.quantity for column in columns})
        names = ", ".join(repr(column.label.text or f"column {column.index + 1}") for column in columns)
        if len(quantities) > 1:
            raise RecordError(
                f"{self.where}: the responses {names} are {' and '.join(quantities)}: must be one quantity; choose "
                "with --response-column or --axis"
            )
        axes = [column.label.axis for column in columns]
        if len(set(axes)) < len(axes) and not self.options.response_columns:
            raise RecordError(
                f"{self.where}: {len(columns)} responses, {names}, and not one for each of the axes x, y, z: choose "
                "with --response-column or --axis"
            )


def read_csv(path: Path, options: ReadOptions) -> list[Record]:
    """Read a text file with columns."""
    named = (options.time_column, *options.response_columns)
    by_number = bool(options.response_columns) and all(name is None or name.strip().isdigit() for name in named)
    table = TextTable(path, by_number=by_number)
    layout, reader = table.layout, _Chooser(table, options)
    if layout.skipped:
        lines = "line" if layout.skipped == 1 else "lines"
        reader.notes.append(f"{path}: {layout.skipped} {lines} before the header in line {layout.header_line} ignored")
    time = reader.time()
    force = reader.force()
    taken = {column.index for column in (time, force) if column is not None}
    responses = reader.responses(taken)
    if time is not None and options.period_s is not None and is_clock_time(table.first_cell(time.index)):
        reader.notes.append(
            f"{path}: {time.label.text!r} contains times of day, which are not supported: the stated period of "
            f"{options.period_s:.6g} s is used"
        )
        time = None
    columns = [column for column in (time, force, *responses) if column is not None]
    values = table.numbers([column.index for column in columns], _MIN_ROWS)
    stated = options.period_s if options.period_s is not None else layout.period_s
    start_s, widened = 0.0, 1.0
    if time is None:
        assert stated is not None
        period = stated
        if options.period_s is None:
            reader.warnings.append(f"no column of time: the preamble's {1.0 / period:.9g} samples per second are used")
    else:
        times = values[:, 0] * time.factor
        try:
            try:
                period, notes = even_period(times, stated, even_clock=False)
            except UnevenTimeError as error:
                if not error.ascending or stated is not None:
                    raise
                grid = even_grid(times)
                period, notes = grid.period_s, [f"{path}: {note}" for note in grid.notes]
                columns_of = [resample(column, times, grid) for column in values.T[1:]]
                values = np.column_stack((grid.times_s / time.factor, *columns_of))
                widened = grid.widened
        except UnevenTimeError as error:
            raise RecordError(f"{path}:{table.line_of(error.row)}: {error}") from error
        reader.warnings += notes
        start_s = float(times[0])
        if time.label.unit is None and options.time_unit is None:
            reader.warnings.append(f"the time has no unit: s is assumed, {1.0 / period:.6g} samples per second")
    values_of = dict(zip((column.index for column in columns), values.T, strict=True))
    force_n = None if force is None else np.ascontiguousarray(values_of[force.index] * force.factor)
    several = len(responses) > 1
    return [
        Record(
            source=f"{path} {column.label.text}" if several else str(path),
            period_s=period,
            response=np.ascontiguousarray(values_of[column.index] * column.factor),
            quantity=column.quantity,
            force_n=force_n,
            axis=column.label.axis or (options.axis if not several else None),
            start_s=start_s,
            warnings=tuple(reader.warnings),
            notes=tuple(reader.notes),
            widened=widened,
        )
        for column in responses
    ]


_HEADER = re.compile(rb"^\s*#\s*time\s*,\s*accel_x\s*,\s*accel_y\s*,\s*accel_z\s*$", re.MULTILINE)
_OF_NAME = re.compile(r"raw_data_([xyz])(?:[_.]|$)|axis=([-0-9.]+),([-0-9.]+)", re.IGNORECASE)


def is_klipper(head: bytes) -> bool:
    """Whether a file begins as Klipper's raw data do: ``#time,accel_x,accel_y,accel_z``."""
    return _HEADER.search(head[:400]) is not None


def klipper_options(options: ReadOptions) -> ReadOptions:
    """Options with Klipper's units (s, mm/s²) unless others are given, as its files state none; without a force."""
    scaled = options.response_scale is not None or options.response_unit is not None
    return replace(
        options,
        time_unit=options.time_unit or "s",
        response_unit=options.response_unit if scaled else "mm/s^2",
        ignore_force=True,
    )


def read_sweep(path: Path, options: ReadOptions) -> Record:
    """Read the record along the shaken axis."""
    told = options.axis or _axis_of_name(path.name)
    records = read_csv(path, replace(klipper_options(options), axis=told))
    record = max(records, key=lambda each: float(each.response.std()))
    axis = (record.axis or "").upper()
    note = () if told else (f"{path}: the axis is not stated: {axis} moved most and is used (state it with --axis)",)
    return replace(record, source=str(path), notes=(*record.notes, *note))


def _axis_of_name(name: str) -> str | None:
    match = _OF_NAME.search(name)
    if match is None:
        return None
    if match[1]:
        return match[1].lower()
    x, y = (abs(float(part)) for part in match.group(2, 3))
    return "x" if y == 0.0 < x else "y" if x == 0.0 < y else None


_BYTES_TO_KNOW = 4096
_WAV = (b"RIFF", b"RIFX", b"RF64")
_NO_TEXT = (".uff", ".unv", ".uf", ".uf58", ".wav", ".wave")


def read_records(path: str | Path, options: ReadOptions | None = None) -> list[Record]:
    """Read a file: CSV or other text columns, UFF (dataset 58, text or binary) or WAV, recognized by its content."""
    path = Path(path)
    options = options or ReadOptions()
    head = _head(path)
    if head[:4] in _WAV:
        if options.force_sensitivity or options.response_sensitivity:
            raise RecordError(
                f"{path}: a WAV file does not state its full scale in volts: specify N and m/s² at full scale "
                "(--force-scale, --response-scale)"
            )
        return read_wav(path, options)
    if is_xml(head):
        raise RecordError(f"{path}: XML can only contain a frequency response; required: a record over time")
    if _is_uff(head):
        return read_uff(path, options)
    if path.suffix.lower() in _NO_TEXT:
        is_wav = path.suffix.lower().startswith(".wav")
        kind, begins = ("WAV", "'RIFF'") if is_wav else ("UFF", "'    -1' (start of a dataset)")
        raise RecordError(
            f"{path}: not a {kind} file: it begins with {head[:16]!r} instead of {begins}; rename it if it is text "
            "with columns"
        )
    return read_csv(path, klipper_options(options) if is_klipper(head) else options)


def read_measurement(path: str | Path, options: ReadOptions | None = None) -> list[Record] | list[FrequencyResponse]:
    """Read a file with records over time or a frequency response."""
    path = Path(path)
    options = options or ReadOptions()
    head = _head(path)
    if is_mat(path, head):
        return read_frf_mat(path, options)
    if is_xml(head):
        return read_servo_tuning(path, options)
    if _is_uff(head):
        return read_frf_uff(path, options) if is_frf_uff(path, options) else read_records(path, options)
    if head[:4] not in _WAV and path.suffix.lower() not in _NO_TEXT and is_frf_text(path, options):
        return read_frf_text(path, options)
    return read_records(path, options)


def _head(path: Path) -> bytes:
    """The first bytes of a non-empty file."""
    with open_file(path) as file:
        head = file.read(_BYTES_TO_KNOW)
    if not head.strip():
        raise RecordError(f"{path}: the file is empty; a record of time, force and acceleration is needed")
    return head


def _is_uff(head: bytes) -> bool:
    plain = head.lstrip(b"\r\n")
    return plain[:6] == b"    -1" and plain[6:7] in {b"\r", b"\n", b" "}


def _channels(path: Path) -> tuple[int, FloatArray, bool]:
    """Samples per second, values (n, channels), and whether these are ratios of full scale."""
    from scipy.io import wavfile

    try:
        with warnings.catch_warnings():
            # Ignore chunks with titles and the like from measuring programs.
            warnings.simplefilter("ignore", wavfile.WavFileWarning)
            # Read from memory: for a file SciPy allocates as many samples as its header states.
            rate, data = wavfile.read(io.BytesIO(read_file(path)))
    except OSError:
        raise
    except Exception as error:  # SciPy raises errors of any kind
        raise RecordError(
            f"{path}: the WAV file cannot be read ({error}); required: PCM of 16, 24 or 32 bits, or float of 32 or 64"
        ) from error
    if data.ndim == 1:
        data = data[:, np.newaxis]
    if data.dtype.kind == "f":
        with np.errstate(invalid="ignore"):  # a signalling NaN becomes a quiet one, and is reported as such
            return rate, data.astype(np.float64), False
    if data.dtype == np.uint8:
        raise RecordError(
            f"{path}: 8 bits per sample resolve 1/128 of full scale, too coarse for a decay; required: 16, 24 or 32 "
            "bits, or float"
        )
    # SciPy puts 24 bits into the upper three bytes of 32, so full scale is that of the type.
    return rate, data.astype(np.float64) / -float(np.iinfo(data.dtype).min), True


def read_wav(path: Path, options: ReadOptions) -> list[Record]:
    """Read a WAV file: float samples are SI values unless a scale is given, integers are ratios of full scale."""
    rate, data, shares = _channels(path)
    count, channels = data.shape
    if channels > 2:
        raise RecordError(
            f"{path}: {channels} channels; required: one (free decay) or two (force, response); "
            "write CSV or UFF for more"
        )
    if rate <= 0 or count < 16:
        raise RecordError(f"{path}: {count} samples at {rate} Hz: a record needs at least 16, better about 1000")
    period = 1.0 / rate
    if options.period_s is not None and abs(options.period_s / period - 1.0) > STATED_RATE_TOLERANCE:
        raise RecordError(
            f"{path}: {rate} samples per second, but a stated period of {options.period_s:g} s: must agree within "
            f"{100 * STATED_RATE_TOLERANCE:g} %"
        )
    bad = np.argwhere(~np.isfinite(data))
    if bad.size:
        row, channel = bad[0]
        raise RecordError(
            f"{path}: sample {row + 1} of channel {channel + 1} is {data[row, channel]}: must be a finite number"
        )
    notes: list[str] = []
    force, response = data[:, 0], data[:, -1]
    force_n: FloatArray | None = None
    if channels == 2:
        if options.response_first:
            force, response = response, force
        if not options.ignore_force:
            scales = {"--force-scale": options.force_scale, "--response-scale": options.response_scale}
            missing = [name for name, scale in scales.items() if scale is None]
            if shares and missing:
                raise RecordError(
                    f"{path}: integer samples are ratios of full scale; a mass needs {' and '.join(missing)} (N, m/s² "
                    "at full scale); frequencies and damping only: --ignore-force"
                )
            force_n = np.ascontiguousarray(force * (options.force_scale or 1.0))
            if not shares and options.force_scale is None:
                notes.append("no unit in a WAV file: force is assumed in N")
    if options.response_scale is None:
        notes.append(
            "integer samples without a scale: the response is a ratio, which gives frequencies and damping"
            if shares
            else f"no unit in a WAV file: response is assumed in SI ({options.quantity or 'acceleration'})"
        )
    return [
        Record(
            source=str(path),
            period_s=period,
            response=np.ascontiguousarray(response * (options.response_scale or 1.0)),
            quantity=options.quantity or "acceleration",
            force_n=force_n,
            axis=options.axis,
            warnings=tuple(notes),
        )
    ]
