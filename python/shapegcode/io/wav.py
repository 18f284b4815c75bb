"""Reads records from WAV files: one channel is a free decay, two are force and response."""

from __future__ import annotations

import io
import warnings
from pathlib import Path

import numpy as np
from scipy.io import wavfile

from shapegcode.errors import RecordError
from shapegcode.io.data_file import read_file
from shapegcode.io.record import FloatArray, ReadOptions, Record
from shapegcode.io.sampling import STATED_RATE_TOLERANCE


def _channels(path: Path) -> tuple[int, FloatArray, bool]:
    """(samples per second, (n, channels), whether the values are shares of full scale)."""
    try:
        with warnings.catch_warnings():
            # Chunks with titles and the like, which measuring programs add, are of no interest.
            warnings.simplefilter("ignore", wavfile.WavFileWarning)
            # From memory: of a file SciPy takes the memory for as many samples as its header states.
            rate, data = wavfile.read(io.BytesIO(read_file(path)))
    except OSError:
        raise
    except Exception as error:  # SciPy raises what its parts do
        raise RecordError(
            f"{path}: the WAV file cannot be read ({error}); needed is PCM of 16, 24 or 32 bits, or float of 32 or 64"
        ) from error
    if data.ndim == 1:
        data = data[:, np.newaxis]
    if data.dtype.kind == "f":
        with np.errstate(invalid="ignore"):  # a signalling NaN becomes a quiet one, and is told of as such
            return rate, data.astype(np.float64), False
    if data.dtype == np.uint8:
        raise RecordError(
            f"{path}: 8 bits per sample resolve 1/128 of full scale, too coarse for a decay; needed are 16, 24 or 32 "
            "bits, or float"
        )
    # SciPy puts 24 bits into the upper three bytes of 32, so that full scale is that of the type.
    return rate, data.astype(np.float64) / -float(np.iinfo(data.dtype).min), True


def read_wav(path: Path, options: ReadOptions) -> list[Record]:
    """Read a WAV file.

    Float samples are in N and m/s² (or times the scales); integers are shares of full scale, which mean N and m/s² by
    the scales only.
    """
    rate, data, shares = _channels(path)
    count, channels = data.shape
    if channels > 2:
        raise RecordError(
            f"{path}: {channels} channels; needed is one (free decay) or two (force, response); "
            "write CSV or UFF for more"
        )
    if rate <= 0 or count < 16:
        raise RecordError(f"{path}: {count} samples at {rate} Hz: a record has at least 16, a good one some 1000")
    period = 1.0 / rate
    if options.period_s is not None and abs(options.period_s / period - 1.0) > STATED_RATE_TOLERANCE:
        raise RecordError(
            f"{path}: {rate} samples per second, a period of {options.period_s:g} s is stated: must agree within "
            f"{100 * STATED_RATE_TOLERANCE:g} %"
        )
    bad = np.argwhere(~np.isfinite(data))
    if bad.size:
        row, channel = bad[0]
        raise RecordError(
            f"{path}: sample {row + 1} of channel {channel + 1} is {data[row, channel]}: must be a finite number"
        )
    notes: list[str] = []
    response = data[:, -1]
    force_n: FloatArray | None = None
    if channels == 2:
        force = data[:, 1] if options.response_first else data[:, 0]
        response = data[:, 0] if options.response_first else data[:, 1]
        if not options.ignore_force:
            missing = [
                name
                for name, scale in (
                    ("--force-scale", options.force_scale),
                    ("--response-scale", options.response_scale),
                )
                if scale is None
            ]
            if shares and missing:
                raise RecordError(
                    f"{path}: integer samples are shares of full scale; a mass needs {' and '.join(missing)} (N, m/s² "
                    "at full scale); frequencies and damping only: --ignore-force"
                )
            force_n = np.ascontiguousarray(force * (options.force_scale or 1.0))
            if not shares and options.force_scale is None:
                notes.append("no unit in a WAV file: force is taken in N")
    if options.response_scale is None:
        notes.append(
            "integer samples without a scale: the response is a share of full scale, good for frequencies and damping"
            if shares
            else f"no unit in a WAV file: response is taken in SI ({options.quantity or 'acceleration'})"
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
