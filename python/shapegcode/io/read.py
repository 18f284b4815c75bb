"""Reads records of tap tests and decays from any supported file; WAV files are read here."""

import io
import warnings
from pathlib import Path

import numpy as np

from shapegcode.errors import RecordError
from shapegcode.io.data_file import open_file, read_file
from shapegcode.io.frf_files import is_frf_text, is_mat, read_frf_mat, read_frf_text
from shapegcode.io.record import STATED_RATE_TOLERANCE, FrequencyResponse, ReadOptions, Record
from shapegcode.io.servo_tuning import is_xml, read_servo_tuning
from shapegcode.io.taps import is_klipper, klipper_options, read_csv
from shapegcode.io.uff import is_frf_uff, read_frf_uff, read_uff
from shapegcode.io.units import FloatArray

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
    """Read a WAV file.

    Float samples are in N and m/s² (or times the scales); integers are ratios of full scale, converted to N and m/s² by
    the scales.
    """
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
