"""Reads universal files: records and frequency responses in dataset 58, text or binary, with dataset 164's units."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from shapegcode.errors import RecordError
from shapegcode.io.record import (
    FrequencyResponse,
    Quantity,
    ReadOptions,
    Record,
    UnevenTimeError,
    checked_response,
    even_period,
    frequency_factor,
    per_volt,
    scale_of,
    stated_unit,
    volts_of,
)
from shapegcode.io.units import FloatArray, find_unit, tap_label, units_of

_TIME_RESPONSE = 1
_FUNCTIONS = {
    2: "auto spectra", 3: "cross spectra", 4: "frequency response functions", 6: "coherence",
    9: "power spectral densities", 12: "spectra",
}  # fmt: skip
_TIME_TYPE = 17
_Measured = Literal["force"] | Quantity
_MEASURED: dict[int, _Measured] = {8: "displacement", 9: "force", 11: "velocity", 12: "acceleration", 13: "force"}
_AXES = {1: "x", 2: "y", 3: "z"}
_COMPLEX = (5, 6)


@dataclass(frozen=True, eq=False)
class _Channel:
    """A time record of the file: SI, positive along its axis."""

    number: int
    header: dict[str, Any]
    measures: _Measured
    axis: str | None
    period_s: float
    start_s: float
    values: FloatArray

    @property
    def place(self) -> tuple[int, int]:
        """Node and axis."""
        return _place(self.header, "rsp")


class UffFile:
    """Datasets of one file."""

    def __init__(self, path: Path, options: ReadOptions) -> None:
        import pyuff

        self.path, self.options = path, options
        self.warnings: list[str] = []  # assumptions made on reading
        self.unitless: list[str] = []
        try:
            self.uff = pyuff.UFF(str(path))
            self.types = [int(each) for each in self.uff.get_set_types()]
        except Exception as error:  # pyuff raises nothing narrower
            raise RecordError(f"{path}: the universal file cannot be read: {error}") from error

    def dataset(self, index: int) -> dict[str, Any]:
        """Read one dataset with pyuff."""
        try:
            found: dict[str, Any] = self.uff.read_sets(index)
        except Exception as error:  # pyuff raises nothing narrower
            raise RecordError(
                f"{self.path}: dataset {index + 1} (type {self.types[index]}) cannot be read: {error}"
            ) from error
        if self.types[index] == 58 and "data" not in found:
            raise RecordError(f"{self.path}: dataset {index + 1} has no values: it is damaged")
        return found

    def channels(self) -> list[_Channel]:
        """Read the time records."""
        units: dict[str, Any] = {}
        others: dict[str, int] = {}
        found: list[_Channel] = []
        for index, kind in enumerate(self.types):
            if kind == 164:
                units = self.dataset(index)
            if kind != 58:
                continue
            data = self.dataset(index)
            function = int(data["func_type"])
            timed = function == 0 and int(data["abscissa_spec_data_type"]) == _TIME_TYPE
            if function != _TIME_RESPONSE and not timed:
                name = _FUNCTIONS.get(function, f"functions of type {function}")
                others[name] = others.get(name, 0) + 1
                continue
            found.append(self._channel(index, data, units))
        if not found:
            held = ", ".join(f"{count} {name}" for name, count in others.items()) or (
                "datasets of type " + ", ".join(map(str, sorted(set(self.types)))) if self.types else "no dataset"
            )
            raise RecordError(
                f"{self.path}: no time record: the file contains {held}; required: time records (dataset 58, function "
                "type 1) of the response, and of the force for a mass: spectra do not show overload, double hits "
                "and noise"
            )
        if self.unitless:
            sets = "dataset" if len(self.unitless) == 1 else "datasets"
            self.warnings.append(f"no unit in {sets} {', '.join(self.unitless)}, and no dataset 164: SI is assumed")
        return found

    def _channel(self, index: int, data: dict[str, Any], units: dict[str, Any]) -> _Channel:
        where = f"{self.path}: dataset {index + 1}"
        if int(data["ord_data_type"]) in _COMPLEX:
            raise RecordError(f"{where}: complex values: a time record is real")
        values = whole_values(where, data)
        if len(values) < 16:
            raise RecordError(
                f"{where}: {len(values)} samples: too short; a record needs at least 16, better about 1000"
            )
        direction = int(data["rsp_dir"])
        if abs(direction) > 3:
            raise RecordError(f"{where}: direction {direction} is a rotation; required: x, y, z (1 to 3)")
        measures = self._measures(where, data)
        factor = self._factor(where, data, measures, units)
        period, start = self._period(where, data)
        return _Channel(
            number=index + 1,
            header=data,
            measures=measures,
            axis=_AXES.get(abs(direction)),
            period_s=period,
            start_s=start,
            values=np.asarray(values * (factor if direction >= 0 else -factor), dtype=np.float64),
        )

    def _measures(self, where: str, data: dict[str, Any]) -> _Measured:
        code = int(data["ordinate_spec_data_type"])
        unit = find_unit(str(data.get("ordinate_axis_units_lab", "")))
        by_unit = unit.measures if unit is not None and unit.measures != "time" else None
        if code in _MEASURED:
            if by_unit not in {None, _MEASURED[code]}:
                raise RecordError(
                    f"{where}: its data type {code} is {_MEASURED[code]}, its unit {unit.name if unit else ''} is of "
                    f"{by_unit}: must agree"
                )
            return _MEASURED[code]
        if by_unit is not None and by_unit != "torque":
            return by_unit
        for text in (data.get("ordinate_axis_lab", ""), data.get("id1", ""), data.get("id2", "")):
            measures = tap_label(str(text)).measures
            if measures in ("force", "acceleration", "velocity", "displacement"):
                return measures
            if measures == "response" and self.options.quantity:
                return self.options.quantity
        if self.options.quantity:
            return self.options.quantity
        raise RecordError(
            f"{where}: unknown quantity: ordinate data type {code}, unit "
            f"{data.get('ordinate_axis_units_lab', '')!r}, title {data.get('id1', '')!r}; required: data type 13 "
            "(force), 12 (acceleration), 11 (velocity) or 8 (displacement), or a unit"
        )

    def _factor(self, where: str, data: dict[str, Any], measures: _Measured, units: dict[str, Any]) -> float:
        options = self.options
        force = measures == "force"
        scale = options.force_scale if force else options.response_scale
        sensitivity = options.force_sensitivity if force else options.response_sensitivity
        if sensitivity is not None:
            volts = volts_of(str(data.get("ordinate_axis_units_lab", "")).replace("NONE", ""))
            if volts is None:
                raise RecordError(f"{where}: it is not in volts: omit the sensitivity, or state the scale")
            return volts * per_volt("sensitivity", sensitivity, (measures,))[1]
        if scale is not None:
            return scale
        stated = stated_unit(options.force_unit if force else options.response_unit, (measures,))
        if stated is not None:
            return stated.factor
        text = str(data.get("ordinate_axis_units_lab", "")).strip()
        label = find_unit(text)
        # Dataset 164: SI value = value / factor.
        system = 1.0 / float(units["force" if force else "length"]) if units else None
        if label is not None:
            if system is not None and not np.isclose(system, label.factor, rtol=1e-4):
                self.warnings.append(
                    f"dataset {where.rsplit(' ', 1)[1]}: its unit is {label.name}, dataset 164 has "
                    f"{system:g} SI units: the label is used"
                )
            return label.factor
        if system is not None:
            return system
        if text.upper() not in {"", "NONE"}:
            known = units_of(measures)
            raise RecordError(
                f"{where}: the unit {text!r} of the {measures} is not known and there is no dataset 164; required: one "
                f"of {known}, or a scale (--force-scale, --response-scale)"
            )
        self.unitless.append(where.rsplit(" ", 1)[1])
        return 1.0

    def _period(self, where: str, data: dict[str, Any]) -> tuple[float, float]:
        unit = find_unit(str(data.get("abscissa_axis_units_lab", "")))
        if unit is not None and unit.measures != "time":
            raise RecordError(f"{where}: its abscissa is in {unit.name}: must be time in a time record")
        times = np.asarray(data["x"], dtype=np.float64) * (unit.factor if unit is not None else 1.0)
        if not np.isfinite(times).all():
            raise RecordError(f"{where}: a time is not a finite number")
        try:
            period, notes = even_period(times, self.options.period_s)
        except UnevenTimeError as error:
            raise RecordError(f"{where}, sample {error.row + 1}: {error}") from error
        if not period > 0.0:
            raise RecordError(f"{where}: its time increment is {period:g} s: must be above 0")
        self.warnings += [f"dataset {where.rsplit(' ', 1)[1]}: {note}" for note in notes]
        return period, float(times[0])


def whole_values(where: str, data: dict[str, Any]) -> npt.NDArray[Any]:
    """Check the values of a dataset: as many as its header states, and finite."""
    values = np.asarray(data["data"])
    if len(values) != int(data["num_pts"]):
        raise RecordError(
            f"{where}: {len(values)} values, but {data['num_pts']} by its header: the file is truncated or damaged"
        )
    bad = np.flatnonzero(~np.isfinite(values))
    if bad.size:
        raise RecordError(f"{where}: value {bad[0] + 1} is {values[bad[0]]}: must be a finite number")
    return values


def _force_of(path: Path, response: _Channel, forces: list[_Channel], responses: list[_Channel]) -> _Channel:
    """Find the force of a response.

    Candidates are the forces at the reference point of the response; without any there, all forces. Of several those
    with the response's version, load case and function number are taken, as far as these numbers differ between the
    forces. If several are left, the order in the file decides.
    """

    def alike(channel: _Channel, channels: list[_Channel]) -> list[_Channel]:
        for key in ("ver_num", "load_case_id", "func_id"):
            if len({int(each.header[key]) for each in forces}) > 1:
                same = [each for each in channels if int(each.header[key]) == int(channel.header[key])]
                channels = same or channels
        return channels

    reference = _place(response.header, "ref")
    candidates = [force for force in forces if force.place == reference] if reference != (0, 0) else []
    candidates = alike(response, candidates or forces)
    rivals = alike(response, [each for each in responses if each.place == response.place])
    order = rivals.index(response)
    if order >= len(candidates):
        raise RecordError(
            f"{path}: {len(rivals)} responses at node {response.place[0]} and {len(candidates)} forces that may "
            "match: each measurement needs its force; number them (version number of dataset 58)"
        )
    force = candidates[order]
    if len(force.values) != len(response.values) or not np.isclose(force.period_s, response.period_s, rtol=1e-4):
        raise RecordError(
            f"{path}: the response in dataset {response.number} has {len(response.values)} samples every "
            f"{response.period_s:g} s, its force in dataset {force.number} {len(force.values)} every "
            f"{force.period_s:g} s: must be sampled together"
        )
    return force


def read_uff(path: Path, options: ReadOptions) -> list[Record]:
    """Read the time records of a universal file."""
    file = UffFile(path, options)
    channels = file.channels()
    forces = [each for each in channels if each.measures == "force"]
    responses = [each for each in channels if each.measures != "force"]
    if options.quantity is not None:
        responses = [each for each in responses if each.measures == options.quantity]
    axes = {each.axis for each in responses} - {None}
    if options.axis is not None and axes:
        responses = [each for each in responses if each.axis == options.axis]
    if not responses:
        held = ", ".join(f"{each.measures} along {each.axis or 'no axis'} (dataset {each.number})" for each in channels)
        wanted = " ".join(
            part for part in (options.quantity or "response", f"along {options.axis}" if options.axis else "") if part
        )
        raise RecordError(f"{path}: no {wanted}; the file contains {held}")
    quantities = sorted({each.measures for each in responses})
    if len(quantities) > 1:
        raise RecordError(
            f"{path}: the responses are {' and '.join(quantities)}: must be one quantity; choose with --quantity"
        )
    records = []
    for each in responses:
        force = None if options.ignore_force or not forces else _force_of(path, each, forces, responses)
        assert each.measures != "force"
        records.append(
            Record(
                source=f"{path} dataset {each.number}" if len(responses) > 1 else str(path),
                period_s=each.period_s,
                response=each.values,
                quantity=each.measures,
                force_n=None if force is None else force.values,
                axis=each.axis or options.axis,
                start_s=each.start_s,
                warnings=tuple(file.warnings),
            )
        )
    return records


_FRF, _COHERENCE = 4, 6
_RESPONSES: dict[int, Quantity] = {8: "displacement", 11: "velocity", 12: "acceleration"}
_FORCES = (9, 13)


def _functions(file: UffFile) -> list[tuple[int, dict[str, Any]]]:
    return [(index, file.dataset(index)) for index, kind in enumerate(file.types) if kind == 58]


def is_frf_uff(path: Path, options: ReadOptions) -> bool:
    """Whether a universal file contains frequency responses and no time record."""
    kinds = {int(data["func_type"]) for _, data in _functions(UffFile(path, options))}
    return _FRF in kinds and _TIME_RESPONSE not in kinds


def read_frf_uff(path: Path, options: ReadOptions) -> list[FrequencyResponse]:
    """Read frequency responses of a universal file: stated datasets, else along the axis (driving point if present)."""
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
    responses = []
    for index, data in found:
        where = f"{path}: dataset {index + 1}"
        if not np.iscomplexobj(data["data"]):
            raise RecordError(
                f"{where}: real values only: a magnitude without phase does not separate modes; export real "
                "and imaginary part"
            )
        values = whole_values(where, data)
        label = str(data.get("abscissa_axis_units_lab", ""))
        unit = find_unit(label)
        if unit is not None and unit.measures == "time":
            raise RecordError(f"{where}: its abscissa is in {unit.name}: must be frequency in a frequency response")
        frequency = np.asarray(data["x"], dtype=np.float64) * frequency_factor(label)
        quantity, factor, warnings = _scale(where, data, units, options)
        sign = -1.0 if int(data["rsp_dir"]) * int(data["ref_dir"]) < 0 else 1.0
        scaled = np.asarray(values * (sign * factor), dtype=np.complex128)
        lines = frequency, scaled, _coherence(data, coherences, len(values))
        source, axis = where if len(found) > 1 else str(path), _axis(data) or options.axis
        warnings = [*file.warnings, *warnings]
        responses.append(checked_response(source, *lines, quantity, axis, warnings, notes, where=where))
    return responses


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
    """Select the responses along the axis, at the driving point if present."""
    along = [each for each in found if options.axis is None or _axis(each[1]) in {options.axis, None}]
    listed = "; ".join(f"dataset {index + 1}: {_point(data)}" for index, data in found[:12])
    if not along:
        raise RecordError(f"{path}: --axis {options.axis}: no frequency response along it; the file contains {listed}")
    driving = [each for each in along if _place(each[1], "rsp") == _place(each[1], "ref")]
    chosen = driving or along
    if len({(_place(data, "rsp"), _place(data, "ref")) for _, data in chosen}) > 1:
        raise RecordError(
            f"{path}: {len(chosen)} frequency responses of different points: choose with --axis, or with "
            f"--response-column NUMBER of the dataset; the file contains {listed}"
        )
    if len(chosen) < len(found):
        which = ", ".join(str(index + 1) for index, _ in chosen)
        notes.append(
            f"{path}: of {len(found)} frequency responses the one in dataset {which} is used, {_point(chosen[0][1])}"
        )
    if not driving:
        data = chosen[0][1]
        if _place(data, "rsp")[0] and _place(data, "ref")[0]:
            notes.append(
                f"{path}: hammer and sensor are not at one point ({_point(data)}): masses are not those at the sensor"
            )
    return chosen


def _place(data: dict[str, Any], which: str) -> tuple[int, int]:
    return int(data[f"{which}_node"]), abs(int(data[f"{which}_dir"]))


def _axis(data: dict[str, Any]) -> str | None:
    return _AXES.get(abs(int(data["rsp_dir"])))


def _point(data: dict[str, Any]) -> str:
    return f"node {data['rsp_node']} along {_axis(data) or data['rsp_dir']}, force at node {data['ref_node']}"


def _scale(
    where: str, data: dict[str, Any], units: dict[str, Any] | None, options: ReadOptions
) -> tuple[Quantity, float, list[str]]:
    """Quantity, factor to SI and warnings, from options, labels, type of the ordinate and dataset 164."""
    kind, denominator = int(data["ordinate_spec_data_type"]), int(data["orddenom_spec_data_type"])
    if kind in _FORCES and denominator in _RESPONSES:
        raise RecordError(f"{where}: force over response (an apparent mass or stiffness): export response over force")
    if denominator not in {0, *_FORCES}:
        raise RecordError(f"{where}: its denominator is of data type {denominator}; required: a force (13)")
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
        return quantity, unit.factor / over, [] if force else [f"{where}: no unit of the force: N is assumed"]
    if units is not None:
        # Dataset 164: SI value = value / factor.
        return quantity, float(units["force"]) / float(units["length"]), []
    if named:
        raise RecordError(f"{where}: the units {' / '.join(named)!r} are not known; state --response-unit (over N)")
    return quantity, 1.0, [f"{where}: no unit and no dataset 164: SI is assumed"]


def _coherence(data: dict[str, Any], coherences: list[dict[str, Any]], lines: int) -> FloatArray | None:
    """Coherence between the same points, with the same number of lines; None: not in the file."""
    for other in coherences:
        same = all(_place(other, which) == _place(data, which) for which in ("rsp", "ref"))
        values = np.real(np.asarray(other["data"]))
        if same and len(values) == lines:
            return np.asarray(values, dtype=np.float64)
    return None
