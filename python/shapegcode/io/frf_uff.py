"""Reads frequency responses from universal files: dataset 58 of function type 4, text or binary, any spacing."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from shapegcode.errors import RecordError
from shapegcode.io.frequency_response import FrequencyResponse, checked_lines, scale_of
from shapegcode.io.record import FloatArray, Quantity, ReadOptions
from shapegcode.io.uff import UffFile
from shapegcode.io.units import find_unit

_TIME_RESPONSE, _FRF, _COHERENCE = 1, 4, 6
_RESPONSES: dict[int, Quantity] = {8: "displacement", 11: "velocity", 12: "acceleration"}
_FORCES = (9, 13)
_AXES = {1: "x", 2: "y", 3: "z"}


def _functions(file: UffFile) -> list[tuple[int, dict[str, Any]]]:
    return [(index, file.dataset(index)) for index, kind in enumerate(file.types) if kind == 58]


def is_frf_uff(path: Path, options: ReadOptions) -> bool:
    """Whether a universal file holds frequency responses and no time record."""
    kinds = {int(data["func_type"]) for _, data in _functions(UffFile(path, options))}
    return _FRF in kinds and _TIME_RESPONSE not in kinds


def read_frf_uff(path: Path, options: ReadOptions) -> list[FrequencyResponse]:
    """Read the frequency responses of a universal file: that of the driving point, if it is among several."""
    file = UffFile(path, options)
    functions = _functions(file)
    units = next((file.dataset(k) for k, kind in enumerate(file.types) if kind == 164), None)
    found = [(index, data) for index, data in functions if int(data["func_type"]) == _FRF]
    notes: list[str] = []
    if options.response_columns:
        found = _numbered(path, found, options.response_columns)
    else:
        found = _of_one_point(path, found, options, notes)
    coherences = [data for _, data in functions if int(data["func_type"]) == _COHERENCE]
    return [_response(file, index, data, units, coherences, options, notes, len(found) > 1) for index, data in found]


def _numbered(
    path: Path, found: list[tuple[int, dict[str, Any]]], wanted: tuple[str, ...]
) -> list[tuple[int, dict[str, Any]]]:
    numbers = {str(index + 1): (index, data) for index, data in found}
    for number in wanted:
        if number not in numbers:
            raise RecordError(
                f"{path}: --response-column {number}: datasets with frequency responses are {', '.join(numbers)}"
            )
    return [numbers[number] for number in wanted]


def _of_one_point(
    path: Path, found: list[tuple[int, dict[str, Any]]], options: ReadOptions, notes: list[str]
) -> list[tuple[int, dict[str, Any]]]:
    """Those along the axis, at the driving point where there is one."""
    along = [each for each in found if options.axis is None or _axis(each[1]) in {options.axis, None}]
    listed = "; ".join(f"dataset {index + 1}: {_point(data)}" for index, data in found[:12])
    if not along:
        raise RecordError(f"{path}: --axis {options.axis}: no frequency response along it; the file holds {listed}")
    driving = [each for each in along if _place(each[1], "rsp") == _place(each[1], "ref")]
    chosen = driving or along
    if len({(_place(data, "rsp"), _place(data, "ref")) for _, data in chosen}) > 1:
        raise RecordError(
            f"{path}: {len(chosen)} frequency responses of different points: choose with --axis, or with "
            f"--response-column NUMBER of the dataset; the file holds {listed}"
        )
    if len(chosen) < len(found):
        which = ", ".join(str(index + 1) for index, _ in chosen)
        notes.append(
            f"{path}: of {len(found)} frequency responses that in dataset {which} is used, {_point(chosen[0][1])}"
        )
    if not driving:
        data = chosen[0][1]
        if _place(data, "rsp")[0] and _place(data, "ref")[0]:
            notes.append(
                f"{path}: hammer and sensor are not at one point ({_point(data)}): the masses are not those there"
            )
    return chosen


def _place(data: dict[str, Any], which: str) -> tuple[int, int]:
    return int(data[f"{which}_node"]), abs(int(data[f"{which}_dir"]))


def _axis(data: dict[str, Any]) -> str | None:
    return _AXES.get(abs(int(data["rsp_dir"])))


def _point(data: dict[str, Any]) -> str:
    return f"node {data['rsp_node']} along {_axis(data) or data['rsp_dir']}, force at node {data['ref_node']}"


def _response(
    file: UffFile,
    index: int,
    data: dict[str, Any],
    units: dict[str, Any] | None,
    coherences: list[dict[str, Any]],
    options: ReadOptions,
    notes: list[str],
    several: bool,
) -> FrequencyResponse:
    where = f"{file.path}: dataset {index + 1}"
    values = np.asarray(data["data"])
    if not np.iscomplexobj(values):
        raise RecordError(
            f"{where}: real values only: a magnitude without phase tells no mode from its neighbour; export real and "
            "imaginary part"
        )
    if len(values) != int(data["num_pts"]):
        raise RecordError(
            f"{where}: {len(values)} values, its header says {data['num_pts']}: the file is cut off or damaged"
        )
    bad = np.flatnonzero(~np.isfinite(values))
    if bad.size:
        raise RecordError(f"{where}: value {bad[0] + 1} is {values[bad[0]]}: must be a finite number")
    frequency = _frequency(where, data)
    quantity, factor, warnings = _scale(where, data, units, options)
    coherence = _coherence(data, coherences, len(values))
    sign = -1.0 if int(data["rsp_dir"]) * int(data["ref_dir"]) < 0 else 1.0
    lines, response, coherence, left_out = checked_lines(
        where, frequency, np.asarray(values * (sign * factor), dtype=np.complex128), coherence
    )
    return FrequencyResponse(
        where if several else str(file.path),
        lines,
        response,
        quantity,
        coherence,
        _axis(data) or options.axis,
        tuple([*file.warnings, *warnings]),
        tuple([*notes, *left_out]),
    )


def _frequency(where: str, data: dict[str, Any]) -> FloatArray:
    frequency = np.asarray(data["x"], dtype=np.float64)
    label = str(data.get("abscissa_axis_units_lab", "")).strip().lower()
    if "rad" in label:
        return frequency / (2.0 * np.pi)
    if "khz" in label:
        return frequency * 1000.0
    unit = find_unit(label)
    if unit is not None and unit.measures == "time":
        raise RecordError(f"{where}: its abscissa is in {unit.name}: a frequency response has its frequency there")
    return frequency


def _scale(
    where: str, data: dict[str, Any], units: dict[str, Any] | None, options: ReadOptions
) -> tuple[Quantity, float, list[str]]:
    """Quantity and factor to SI: by options, the labels, dataset 164, the kinds of the ordinate."""
    kind, denominator = int(data["ordinate_spec_data_type"]), int(data["orddenom_spec_data_type"])
    if kind in _FORCES and denominator in _RESPONSES:
        raise RecordError(f"{where}: force over response (an apparent mass or stiffness): export response over force")
    if denominator not in {0, *_FORCES}:
        raise RecordError(f"{where}: its denominator is of data type {denominator}: needed is a force (13)")
    top = str(data.get("ordinate_axis_units_lab", "")).strip()
    bottom = str(data.get("orddenom_axis_units_lab", "")).strip()
    named = [text for text in (top, bottom) if text.upper() not in {"", "NONE"}]
    if options.response_unit or options.response_scale or options.force_unit:
        return scale_of(where, "", options)
    for text in (f"{top}/{bottom}", top, str(data.get("id1", ""))):
        try:
            found = scale_of(where, text, options)
        except RecordError:
            continue
        if not found[2]:
            return found
    quantity = options.quantity or _RESPONSES.get(kind)
    if quantity is None:
        return scale_of(where, str(data.get("id1", "")), options)
    unit = find_unit(top)
    if unit is not None and unit.measures == quantity and (bottom == "" or find_unit(bottom) is not None):
        force = find_unit(bottom)
        over = 1.0 if force is None else force.factor
        return quantity, unit.factor / over, [] if force else [f"{where}: no unit of the force: N is taken"]
    if units is not None:
        # Dataset 164: SI value = value / factor.
        return quantity, float(units["force"]) / float(units["length"]), []
    if named:
        raise RecordError(f"{where}: the units {' / '.join(named)!r} are not known; state --response-unit (over N)")
    return quantity, 1.0, [f"{where}: no unit and no dataset 164: SI is taken"]


def _coherence(data: dict[str, Any], coherences: list[dict[str, Any]], lines: int) -> FloatArray | None:
    """The coherence of the same points, if the file has it."""
    for other in coherences:
        same = all(_place(other, which) == _place(data, which) for which in ("rsp", "ref"))
        values = np.real(np.asarray(other["data"]))
        if same and len(values) == lines:
            return np.asarray(values, dtype=np.float64)
    return None
