"""Streams a motion: stores its largest values and envelopes, and writes it to files piece by piece."""

from __future__ import annotations

import contextlib
import shutil
import sys
import tempfile
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import BinaryIO

import numpy as np

from shapegcode import _core
from shapegcode.io.data_file import named_errors, replaced_file
from shapegcode.io.units import FloatArray
from shapegcode.model.stream import KINDS, Chunk
from shapegcode.results.outcome import Xyz
from shapegcode.simulation.result import Motion


class MotionEnvelope:
    """Minimum and maximum of several curves over equal intervals, as short as the limit of their number allows."""

    def __init__(self, most: int = 4000) -> None:
        """Create an envelope of at most *most* whole intervals, 2 or more; the last samples may form one more."""
        self._most = most
        self._low = self._high = self._rest = np.empty((0, 0))
        self.samples_per_bucket = 1

    def add(self, values: FloatArray) -> None:
        """Add samples, (k, curves)."""
        if not self._rest.shape[1]:
            self._low = self._high = self._rest = np.empty((0, values.shape[1]))
        rest = np.concatenate([self._rest, values])
        whole = len(rest) // self.samples_per_bucket
        body = rest[: whole * self.samples_per_bucket].reshape(whole, self.samples_per_bucket, rest.shape[1])
        self._rest = rest[whole * self.samples_per_bucket :].copy()
        self._low = np.concatenate([self._low, body.min(axis=1)])
        self._high = np.concatenate([self._high, body.max(axis=1)])
        while len(self._low) > self._most:
            self._merge()

    def _merge(self) -> None:
        """Merge pairs of intervals; if their number is odd, the last interval goes back to the waiting samples."""
        pairs = len(self._low) // 2
        if len(self._low) % 2:
            # Its two extremes represent it until its interval is full.
            extremes = np.repeat(self._low[-1:], self.samples_per_bucket, axis=0)
            extremes[-1] = self._high[-1]
            self._rest = np.concatenate([extremes, self._rest])
        self._low = self._low[: 2 * pairs].reshape(pairs, 2, self._low.shape[1]).min(axis=1)
        self._high = self._high[: 2 * pairs].reshape(pairs, 2, self._high.shape[1]).max(axis=1)
        self.samples_per_bucket *= 2

    def result(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Middle of each interval in samples since the first, (n,); minimum and maximum, (n, curves)."""
        if not self._rest.shape[1]:
            raise ValueError("no sample: an envelope needs at least one")
        low, high = self._low, self._high
        starts = np.arange(len(low), dtype=np.float64) * self.samples_per_bucket
        middles = starts + (self.samples_per_bucket - 1) / 2
        if len(self._rest):
            low = np.concatenate([low, self._rest.min(axis=0, keepdims=True)])
            high = np.concatenate([high, self._rest.max(axis=0, keepdims=True)])
            last = len(starts) * self.samples_per_bucket + (len(self._rest) - 1) / 2
            middles = np.append(middles, last)
        return middles, low, high


class MotionRecorder:
    """Largest values of a motion, axis by axis, and its curves as envelopes."""

    def __init__(self, period_s: float) -> None:
        """Record a motion sampled once per period."""
        self._period_s = period_s
        self._begin_s = self._end_s = 0.0
        self.samples = 0  # number of samples so far
        self._largest: dict[str, FloatArray] = {}
        self._velocity: FloatArray | None = None
        self._envelope = MotionEnvelope()

    def add(self, chunk: Chunk) -> None:
        """Add samples."""
        if not self.samples:
            self._begin_s = float(chunk.time_s[0])
        before = chunk.velocity_mm_per_s[:1] if self._velocity is None else self._velocity
        acceleration = np.diff(np.concatenate([before, chunk.velocity_mm_per_s]), axis=0) / self._period_s
        self._velocity = chunk.velocity_mm_per_s[-1:].copy()
        self.samples += len(chunk)
        self._end_s = float(chunk.time_s[-1])
        self._note("largest_speed_mm_per_min", chunk.velocity_mm_per_s * 60.0)
        self._note("largest_acceleration_mm_per_s2", acceleration)
        self._note("largest_error_um", chunk.error_mm * 1e3)
        curves = [chunk.command_mm, chunk.response_mm, chunk.velocity_mm_per_s, acceleration, chunk.error_mm]
        if chunk.motor_force_n is not None and chunk.friction_force_n is not None:
            self._note("largest_motor_force_n", chunk.motor_force_n)
            self._note("largest_friction_force_n", chunk.friction_force_n)
            curves += [chunk.motor_force_n, chunk.friction_force_n]
        self._envelope.add(np.concatenate(curves, axis=1))

    def _note(self, name: str, values: FloatArray) -> None:
        self._largest[name] = np.maximum(self._largest.get(name, 0.0), np.abs(values).max(axis=0))

    def result(
        self, program: str, lines: tuple[int, int] | None, every: int, csv: str | None, npz: str | None
    ) -> Motion:
        """The motion so far."""
        middles, low, high = self._envelope.result()
        return Motion(
            lines=lines,
            every=every,
            samples=self.samples,
            end_s=self._end_s,
            program=program,
            times_s=self._begin_s + middles * self._period_s,
            low=low.reshape(len(low), -1, 3),
            high=high.reshape(len(high), -1, 3),
            csv=csv,
            npz=npz,
            **{name: Xyz(*map(float, values)) for name, values in self._largest.items()},
        )


WriteMotion = Callable[[Chunk], None]  # appends the rows of a chunk to a file


def _csv(stream: BinaryIO) -> WriteMotion:
    has_head = False

    def write(chunk: Chunk) -> None:
        nonlocal has_head
        columns = chunk.columns()
        if not has_head:
            has_head = True
            stream.write((",".join(["kind", *columns]) + "\n").encode())
        table = np.column_stack([column.astype(np.float64) for column in columns.values()])
        stream.write(_core.csv_rows(chunk.kind, KINDS, table))

    return write


@contextlib.contextmanager
def csv_file(path: str | Path) -> Iterator[WriteMotion]:
    """Open a CSV file for `kind` and `Chunk.columns`, with a header; ``-`` is standard output."""
    if path == "-":
        yield _csv(sys.stdout.buffer)
        sys.stdout.buffer.flush()
        return
    with named_errors(path), replaced_file(path) as stream:
        yield _csv(stream)


@contextlib.contextmanager
def npz_file(path: str | Path) -> Iterator[WriteMotion]:
    """Open a NumPy archive for `Chunk.columns` and `kind`; until it is closed, it uses disk space of twice its size."""
    target = Path(path).resolve()
    # Temporary files are in the folder of the archive, which has space, unless the path is that of a device.
    folder = target.parent if target.is_file() or not target.exists() else None
    # One file per column, joined at the end, as an archive stores columns one after the other.
    parts: dict[str, tuple[BinaryIO, np.dtype[np.generic]]] = {}
    rows = 0

    with named_errors(path), contextlib.ExitStack() as files, replaced_file(path) as stream:

        def write(chunk: Chunk) -> None:
            nonlocal rows
            for name, column in {**chunk.columns(), "kind": chunk.kind}.items():
                if name not in parts:
                    # Deleted when the stack closes it.
                    parts[name] = files.enter_context(tempfile.TemporaryFile(dir=folder)), column.dtype
                parts[name][0].write(np.ascontiguousarray(column).data)
            rows += len(chunk)

        yield write
        with zipfile.ZipFile(stream, "w", zipfile.ZIP_STORED) as archive:
            for name, (file, dtype) in parts.items():
                file.seek(0)
                # A ZipInfo without a time: equal motions give equal bytes.
                with archive.open(zipfile.ZipInfo(f"{name}.npy"), "w", force_zip64=True) as member:
                    descr = np.lib.format.dtype_to_descr(dtype)
                    header = {"descr": descr, "fortran_order": False, "shape": (rows,)}
                    np.lib.format.write_array_header_1_0(member, header)
                    shutil.copyfileobj(file, member)
            with archive.open(zipfile.ZipInfo("kind_names.npy"), "w") as member:
                np.lib.format.write_array(member, np.array(KINDS))
