"""Results as tables for pandas and arrays for xarray (`pip install shapegcode[study]`)."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from shapegcode._core import ArgumentError
from shapegcode.results.json import plain
from shapegcode.results.outcome import Outcome

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

_UNITS = {
    "_mm_per_min": "mm/min", "_mm_per_s2": "mm/s²", "_mm_per_s": "mm/s", "_percent": "%", "_um": "µm", "_mm": "mm",
    "_ms": "ms", "_s": "s", "_hz": "Hz", "_n": "N", "_kg": "kg", "_rad": "rad", "_deg": "°",
}  # fmt: skip
_AXES = ("x", "y", "z")


def data_frame(result: Outcome, what: str = "") -> pd.DataFrame:
    """A list of a result as a table: a row for each entry, a column for each value, dots in names of nested ones."""
    import pandas as pd

    lists = {field.name: getattr(result, field.name) for field in _fields(result)}
    lists = {name: rows for name, rows in lists.items() if _is_list_of_rows(rows)}
    name = _chosen(what, lists, "a list of rows")
    table = pd.json_normalize([plain(row) for row in lists[name]])
    table.attrs = {"of": name, "units": {str(column): unit for column in table if (unit := _unit(str(column)))}}
    return table


def data_set(result: Outcome, what: str = "") -> xr.Dataset:
    """Arrays of a result, or of a part of it, with names of dimensions and units.

    The arrays of a part share the dimension that is as long as its times or frequencies; one of length three is the
    axis.
    """
    import xarray as xr

    parts: dict[str, dict[str, np.ndarray[Any, Any]]] = {}
    own = _arrays(result)
    if own:
        parts[type(result).__name__] = own
    for field in _fields(result):
        value = getattr(result, field.name)
        if dataclasses.is_dataclass(value) and not isinstance(value, type) and (found := _arrays(value)):
            parts[field.name] = found
    name = _chosen(what, parts, "arrays")
    arrays = parts[name]
    index = next((key for key in arrays if key.startswith(("times_", "time_", "frequency_", "frequencies_"))), None)
    length = len(arrays[index]) if index is not None else -1
    variables = {}
    for key, array in arrays.items():
        dimensions = [
            (index or key) if size == length and rank == 0 else ("axis" if size == len(_AXES) else f"{key}_{rank}")
            for rank, size in enumerate(array.shape)
        ]
        variables[key] = xr.DataArray(array, dims=dimensions, attrs={"units": unit} if (unit := _unit(key)) else {})
    whole = xr.Dataset(variables, attrs={"of": name})
    return whole.assign_coords(axis=list(_AXES)) if "axis" in whole.dims else whole


def _fields(value: object) -> Sequence[dataclasses.Field[Any]]:
    return dataclasses.fields(value) if dataclasses.is_dataclass(value) else ()


def _is_list_of_rows(value: object) -> bool:
    if not isinstance(value, Sequence) or isinstance(value, str | bytes) or not value:
        return False
    return all(dataclasses.is_dataclass(row) or isinstance(row, Mapping) for row in value)


def _arrays(value: object) -> dict[str, np.ndarray[Any, Any]]:
    """Arrays among the fields, also those that no JSON holds."""
    found = {field.name: getattr(value, field.name) for field in _fields(value)}
    return {name: array for name, array in found.items() if isinstance(array, np.ndarray) and array.ndim > 0}


def _chosen(what: str, there: Mapping[str, object], kind: str) -> str:
    if what in there:
        return what
    if there and not what:
        return next(iter(there))
    has = f"it has {', '.join(there)}" if there else f"it has no {kind}"
    raise ArgumentError(f"{what or 'this result'}: not {kind} of this result; {has}" if what else f"this result: {has}")


def _unit(name: str) -> str:
    """Of a plain number, as its name ends; of a nested one by the name that says it."""
    for part in reversed(name.split(".")):
        for ending, unit in _UNITS.items():
            if part.endswith(ending):
                return unit
    return ""
