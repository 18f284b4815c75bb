"""The samples of a Sinumerik capture: rows of numbers, one for each position control cycle."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from shapegcode.errors import RecordError
from shapegcode.io.edge_events import COUNTER_RANGE

__all__ = ["Rows", "read_rows"]

FloatArray = npt.NDArray[np.float64]
_FEWEST = 2
_LARGEST = 1e12
_NUMBERS = {int, float, type(None)}


@dataclass(frozen=True)
class Rows:
    """Samples.

    Attributes:
        counter: (n,) rising.
        columns: (n,) by address, without the counter.
        notes: what was left out.
    """

    counter: npt.NDArray[np.int64]
    columns: Mapping[str, FloatArray]
    notes: tuple[str, ...]


def read_rows(source: str, addresses: tuple[str, ...], files: Iterable[tuple[str, list[Any]]]) -> Rows:
    """Join the rows of all entries "HFData"."""
    pieces: list[FloatArray] = []
    places: list[str] = []  # of each piece, for messages
    for name, payload in files:
        for index, entry in enumerate(payload):
            if "HFData" not in entry:
                continue
            where = f"{name}: Payload[{index}].HFData"
            piece = _numbers(where, entry["HFData"], addresses)
            if len(piece):
                pieces.append(piece)
                places.append(where)
    if sum(map(len, pieces)) < _FEWEST:
        raise RecordError(f"{source}: the Payload holds {sum(map(len, pieces))} rows of HFData: at least 2 are needed")
    values = np.concatenate(pieces)
    starts = np.cumsum([0, *(len(piece) for piece in pieces)])
    counter, kept, notes = _counters(values, addresses.index("CYCLE"), places, starts)
    columns: dict[str, FloatArray] = {}
    for place, address in enumerate(addresses):
        if address == "CYCLE":
            continue
        columns[address] = column = np.ascontiguousarray(values[kept, place])
        missing = np.flatnonzero(np.isnan(column))
        if missing.size:
            rest = (
                "no value at all"
                if missing.size == len(column)
                else f"no value in {missing.size} of {len(column)} samples"
            )
            notes.append(f"{address}: {rest}, the first at counter {counter[missing[0]]}")
    return Rows(counter, columns, tuple(notes))


def _numbers(where: str, rows: Any, addresses: tuple[str, ...]) -> FloatArray:
    """(rows, signals) numbers of one entry; NaN for null."""
    if not isinstance(rows, list):
        raise RecordError(f"{where} = {str(rows)[:40]!r}: must be a list of rows")
    for index, row in enumerate(rows):
        if not isinstance(row, list) or len(row) != len(addresses):
            found = f"{len(row)} values" if isinstance(row, list) else repr(str(row)[:40])
            raise RecordError(
                f"{where}[{index}] has {found}: SignalListHFData lists {len(addresses)} signals, and each row has one "
                "value of each"
            )
        if not set(map(type, row)) <= _NUMBERS:
            place = next(at for at, value in enumerate(row) if type(value) not in _NUMBERS)
            raise RecordError(f"{where}[{index}]: {addresses[place]} = {row[place]!r}: must be a number")
    try:
        values: FloatArray = np.array(rows, dtype=np.float64).reshape(len(rows), len(addresses))
    except OverflowError as error:
        raise RecordError(f"{where}: a number is too large: {error}") from error
    wild = np.argwhere(np.abs(values) > _LARGEST)
    if len(wild):
        at, place = wild[0]
        raise RecordError(
            f"{where}[{at}]: {addresses[place]} = {values[at, place]:g}: must be finite and at most {_LARGEST:g}"
        )
    return values


def _counters(
    values: FloatArray, place: int, places: list[str], starts: npt.NDArray[np.int64]
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.bool_], list[str]]:
    """Counter of each row that is kept, which rows these are, and notes."""
    raw = values[:, place]

    def at(row: int) -> str:
        piece = int(np.searchsorted(starts, row, side="right")) - 1
        return f"{places[piece]}[{row - starts[piece]}]"

    bad = np.flatnonzero(~((raw >= 0) & (raw < COUNTER_RANGE) & (raw == np.floor(raw))))
    if bad.size:
        raise RecordError(f"{at(bad[0])}: CYCLE = {raw[bad[0]]:g}: must be a whole number, 0 to {COUNTER_RANGE - 1}")
    notes: list[str] = []
    steps = np.diff(raw)
    over = steps < -COUNTER_RANGE / 2
    if over.any():
        notes.append(f"the counter begins anew at 0 behind {int(raw[np.flatnonzero(over)[0]])}: counted on")
    counter = raw.astype(np.int64)
    counter[1:] += COUNTER_RANGE * np.cumsum(over)
    repeated = np.flatnonzero(np.diff(counter) == 0) + 1
    same = np.array([np.array_equal(values[row], values[row - 1], equal_nan=True) for row in repeated], dtype=bool)
    kept = np.ones(len(counter), dtype=bool)
    kept[repeated[same]] = False
    if same.any():
        notes.append(f"{same.sum()} rows stand there twice and were taken once, the first at {at(repeated[same][0])}")
    back = np.flatnonzero((np.diff(counter) <= 0) & kept[1:])
    if back.size:
        row = int(back[0]) + 1
        said = "other values under the same counter" if counter[row] == counter[row - 1] else "the counter goes back"
        raise RecordError(
            f"{at(row)}: CYCLE = {raw[row]:.0f} behind {raw[row - 1]:.0f}: {said}; it must rise from row to row"
        )
    return counter[kept], kept, notes
