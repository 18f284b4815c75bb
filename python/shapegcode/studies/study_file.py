"""The file of a study (STUDY.toml): program, machine, varied values, settings to choose.

program = "part.nc"
machine = "mine.toml"
n = 10000

[vary]
axes.x.modes.1.frequency_hz = { mean = 46.0, sd = 2.0 }
axes.x.modes.1.damping_ratio = { median = 0.02, percent = 40.0 }
axes.y.modes.1.frequency_hz = { low = 120.0, high = 140.0 }
controller.block_time_s = [0.005, 0.008]

[choose]
shaping.family = ["zv", "zvd", "ei"]
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, get_origin

from pydantic import BeforeValidator, ConfigDict, Field, Strict, model_validator

from shapegcode.errors import ArgumentError, FileError, Problem
from shapegcode.machine import Machine
from shapegcode.settings.describe import keys_schema, toml_schema
from shapegcode.settings.keys import Bool, Float, InlineTable, Positive, Text, TomlTable, key, table_type
from shapegcode.settings.load import KeyProblem, field_of, parsed, read_text, validated
from shapegcode.studies.optimize import USUAL_CONVERSIONS, USUAL_DRAWS
from shapegcode.studies.replay import DEFAULT_MEASURES, MEASURES
from shapegcode.studies.varied import MAX_DRAWS, Distribution, listed, lognormal, normal, uniform

_KINDS: dict[tuple[str, ...], Callable[..., Distribution]] = {
    ("mean", "sd"): normal,
    ("mean", "percent"): normal,
    ("median", "percent"): lognormal,
    ("low", "high"): uniform,
    ("one_of",): lambda one_of, known=None: listed(one_of, known=known),
}
_GIVE = "give mean and sd (or percent), median and percent, low and high, or one_of"
_DOTTED = re.compile(r"^(\s*)([\w-]+(?:\.[\w-]+)+)(\s*=)", re.MULTILINE)


class StudyFileError(FileError):
    """A study file that cannot be used; the message lists every problem."""


def _as_table(value: object) -> object:
    """Convert a list of choices to its table."""
    if isinstance(value, list):
        return {"one_of": value}
    if not isinstance(value, dict):
        raise ValueError(f"must be a list or a table: {_GIVE}")
    if unknown := sorted(value.keys() - SampledValue.model_fields):
        raise ValueError(f"{', '.join(unknown)}: no such key here: {_GIVE}")
    return value


class SampledValue(InlineTable):
    """Distribution of a value."""

    model_config = ConfigDict(
        json_schema_extra={
            "oneOf": [{"required": list(kind), "propertyNames": {"enum": [*kind, "known"]}} for kind in _KINDS]
        }
    )

    mean: Float | None = key("mean of a normal distribution", default=None)
    sd: Positive | None = key("standard deviation, in the unit of the value", default=None)
    percent: Positive | None = key(
        "standard deviation in percent of the mean; with a median: increase at one standard deviation", default=None
    )
    median: Positive | None = key("median of a lognormal distribution", default=None)
    low: Float | None = key("lowest value of a uniform distribution", default=None)
    high: Float | None = key("highest value", default=None)
    one_of: Annotated[tuple[Any, ...], Field(min_length=1)] | None = key("choices, equally likely", default=None)
    known: Bool | None = key("the program is converted for each value", default=None)

    @model_validator(mode="after")
    def _one_kind(self) -> SampledValue:
        try:
            self.distribution()
        except ArgumentError as wrong:
            raise ValueError(str(wrong)) from None
        return self

    def distribution(self) -> Distribution:
        """The distribution of these parameters."""
        given = {name: getattr(self, name) for name in self.model_fields_set}
        for kind, make in _KINDS.items():
            if given.keys() - {"known"} == set(kind):
                return make(**given)
        raise ArgumentError(_GIVE)


def _flat(given: Mapping[str, object], above: tuple[str, ...] = ()) -> Iterator[tuple[str, object]]:
    """Flatten nested tables to dotted keys, except distributions and tables that are values of the machine file."""
    leaves = SampledValue.model_fields.keys()
    for name, entry in given.items():
        parts = (*above, *name.split("."))
        if isinstance(entry, dict) and entry and not entry.keys() & leaves and not _is_value(parts):
            yield from _flat(entry, parts)
        else:
            yield ".".join((*above, name)), entry


def _is_value(parts: Sequence[str]) -> bool:
    """True if these are the parts of a key of the machine file that is not a table."""
    field = field_of(Machine, [int(part) if part.isdigit() else part for part in parts])
    return field is not None and table_type(field) is None and get_origin(field.annotation) is not dict


Values = Annotated[dict[str, Annotated[SampledValue, BeforeValidator(_as_table)]], Field(min_length=1)]
Lists = Annotated[dict[str, Annotated[tuple[Any, ...], Field(min_length=1)]], Field(min_length=1)]
Measure = Annotated[Text, Field(json_schema_extra={"enum": list(MEASURES)})]


class StudyFile(TomlTable):
    """Contents of the study file."""

    program: Text = key("the program, relative to this file")
    machine: Text | None = key(
        "machine file, relative to this file, or a built-in machine; left out: that of -m", default=None
    )
    n: Annotated[int, Strict(), Field(ge=1, le=MAX_DRAWS)] | None = key(
        f"number of samples; left out: 1000, and {USUAL_DRAWS} per combination of optimize", default=None
    )
    sampling: Literal["sobol", "lhs", "grid"] = key("sampling method of study", default="sobol")
    measure: tuple[Measure, ...] = key("measures of study", default=DEFAULT_MEASURES)
    seed: Annotated[int, Strict(), Field(ge=0)] = key("seed of the random numbers", default=0)
    indices: Bool = key("Sobol indices of study; needs shapegcode[study]", default=False)
    at_least: Annotated[Positive, Field(le=1)] = key("required probability of staying within tolerance", default=0.95)
    shape_all: Bool = key("also shape cuts that gain little, as convert --shape-all", default=False)
    most: Annotated[int, Strict(), Field(ge=1, le=100_000)] = key(
        "maximum number of conversions of optimize", default=USUAL_CONVERSIONS
    )
    vary: Values = key("the distribution from which each key of the machine file is sampled")
    choose: Lists | None = key(
        "values from which optimize chooses, by key of the machine file; left out: block periods, families, planned "
        "tolerances, arc feeds",
        default=None,
    )

    @model_validator(mode="after")
    def _measured(self) -> StudyFile:
        for name in self.measure:
            if name not in MEASURES:
                raise KeyProblem("measure", name, f"must be one of {', '.join(MEASURES)}")
        return self

    def options(self) -> dict[str, Any]:
        """Arguments of `study` in addition to program and machine."""
        return self._arguments("sampling", "measure", "seed", "indices", "at_least", "shape_all")

    def choice_options(self) -> dict[str, Any]:
        """Arguments of `optimize` in addition to program and machine."""
        return self._arguments("seed", "shape_all", "most", "choose") | {"probability": self.at_least}

    def _arguments(self, *names: str) -> dict[str, Any]:
        sampled = {name: value.distribution() for name, value in self.vary.items()}
        found = {"vary": sampled} | {name: getattr(self, name) for name in names}
        return found if self.n is None else found | {"n": self.n}


def study_schema(title: str) -> dict[str, Any]:
    """JSON Schema of the file, for editors: it checks the keys of the machine file, not the limits of values."""
    found = toml_schema(StudyFile, title)
    choices: dict[str, Any] = {"type": "array", "minItems": 1}
    schemas: dict[str, dict[str, Any]] = {
        "vary": {"anyOf": [choices, {"$ref": "#/$defs/SampledValue"}]},
        "choose": choices,
    }
    for table, value in schemas.items():
        meaning = found["properties"][table]["description"]
        found["properties"][table] = keys_schema(Machine, value, table, found["$defs"]) | {"description": meaning}
    return found


def load_study(path: str | Path) -> StudyFile:
    """Read a study file; its file names are relative to its folder.

    Args:
        path: path of the file.

    Returns:
        The contents.

    Raises:
        StudyFileError: not TOML, or wrong keys or values; every problem is listed.
        OSError: the file cannot be read.
    """
    text = read_text(Path(path), StudyFileError)
    data = parsed(text, str(path), StudyFileError)
    for table in ("vary", "choose"):
        if isinstance(data.get(table), dict):
            flat: dict[str, object] = {}
            for name, entry in _flat(data[table]):
                if name in flat:
                    twice = Problem(f"{table}.{name}", "", "given twice, in quotes and without")
                    raise StudyFileError(str(path), (twice,))
                flat[name] = entry
            data[table] = flat
    # Put dotted keys in quotes, as in messages, so that their lines are found.
    quoted = _DOTTED.sub(r'\1"\2"\3', text)
    found = validated(StudyFile, data, str(path), quoted, StudyFileError)
    beside = Path(path).parent
    machine = found.machine
    if machine is not None and machine not in Machine.builtin_names():
        machine = str(beside / machine)
    return found.model_copy(update={"program": str(beside / found.program), "machine": machine})
