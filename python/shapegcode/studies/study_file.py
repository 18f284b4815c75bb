"""The file of a study (STUDY.toml): program, machine, what is varied.

program = "part.nc"
machine = "mine.toml"
n = 10000

[vary]
axes.x.modes.1.frequency_hz = { mean = 46.0, sd = 2.0 }
axes.x.modes.1.damping_ratio = { median = 0.02, percent = 40.0 }
axes.y.modes.1.frequency_hz = { low = 120.0, high = 140.0 }
controller.block_time_s = [0.005, 0.008]
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, Strict, model_validator

from shapegcode.errors import ArgumentError, FileError
from shapegcode.machine import Machine
from shapegcode.settings.keys import Bool, Float, InlineTable, Positive, Text, TomlTable, key
from shapegcode.settings.load import parsed, read_text, validated
from shapegcode.settings.problems import KeyProblem
from shapegcode.studies.distributions import Distribution, listed, lognormal, normal, uniform
from shapegcode.studies.replay import DEFAULT_MEASURES, MEASURES

__all__ = ["DrawnValue", "StudyFile", "StudyFileError", "load_study"]

_KINDS = "give mean and sd (or percent), median and percent, low and high, or one_of"
_MOST = 10_000_000
_DOTTED = re.compile(r"^(\s*)([\w-]+(?:\.[\w-]+)+)(\s*=)", re.MULTILINE)


class StudyFileError(FileError):
    """A file of a study that cannot be used; the message lists every problem."""


def _as_table(value: object) -> object:
    """A list of choices as what it stands for."""
    return {"one_of": value} if isinstance(value, list) else value


class DrawnValue(InlineTable):
    """What a value is drawn from."""

    mean: Float | None = key("mean of a normal distribution", default=None)
    sd: Positive | None = key("its standard deviation, in the unit of the value", default=None)
    percent: Positive | None = key(
        "standard deviation in percent: of the mean, or factor about the median", default=None
    )
    median: Positive | None = key("median of a lognormal distribution", default=None)
    low: Float | None = key("lowest value of a uniform distribution", default=None)
    high: Float | None = key("highest value", default=None)
    one_of: Annotated[tuple[Any, ...], Field(min_length=1)] | None = key("choices, each as likely", default=None)
    known: Bool | None = key("the program is converted for each value", default=None)

    @model_validator(mode="after")
    def _one_kind(self) -> DrawnValue:
        try:
            self.distribution()
        except ArgumentError as wrong:
            raise ValueError(str(wrong)) from None
        return self

    def distribution(self) -> Distribution:
        """The distribution that it says.

        Returns:
            One of four kinds.

        Raises:
            ArgumentError: the keys are not those of one kind.
        """
        given = self.model_fields_set - {"known"}
        if given == {"one_of"} and self.one_of is not None:
            return listed(self.one_of, known=self.known)
        if given in ({"mean", "sd"}, {"mean", "percent"}) and self.mean is not None:
            return normal(self.mean, self.sd, percent=self.percent, known=self.known)
        if given == {"median", "percent"} and self.median is not None and self.percent is not None:
            return lognormal(self.median, self.percent, known=self.known)
        if given == {"low", "high"} and self.low is not None and self.high is not None:
            return uniform(self.low, self.high, known=self.known)
        raise ArgumentError(_KINDS)


_LEAVES = frozenset(DrawnValue.model_fields)


def _flat(value: Mapping[str, object], prefix: str = "") -> dict[str, object]:
    """Tables below tables as dotted keys; a table with the keys of `DrawnValue` is a value."""
    found: dict[str, object] = {}
    for name, entry in value.items():
        if isinstance(entry, dict) and entry and not entry.keys() & _LEAVES:
            found |= _flat(entry, f"{prefix}{name}.")
        else:
            found[f"{prefix}{name}"] = entry
    return found


Values = Annotated[dict[str, Annotated[DrawnValue, BeforeValidator(_as_table)]], Field(min_length=1)]


class StudyFile(TomlTable):
    """What is played on which machines."""

    program: Text = key("the program, beside this file")
    machine: Text | None = key(
        "machine file beside this one, or a built-in machine; left out: that of -m", default=None
    )
    n: Annotated[int, Strict(), Field(ge=1, le=_MOST)] = key("how many draws", default=1000)
    sampling: Literal["sobol", "lhs", "grid"] = key("how they are spread", default="sobol")
    measure: tuple[Text, ...] = key("what is measured", default=DEFAULT_MEASURES)
    seed: Annotated[int, Strict(), Field(ge=0)] = key("of the random numbers", default=0)
    indices: Bool = key("Sobol indices too; needs shapegcode[study]", default=False)
    at_least: Annotated[Positive, Field(le=1)] = key("probability of staying within tolerance", default=0.95)
    shape_all: Bool = key("shape every region, see convert --shape-all", default=False)
    vary: Values = key("what each key of the machine file is drawn from")

    @model_validator(mode="after")
    def _measured(self) -> StudyFile:
        for name in self.measure:
            if name not in MEASURES:
                raise KeyProblem("measure", name, f"must be one of {', '.join(MEASURES)}")
        return self

    def options(self) -> dict[str, Any]:
        """What `study` takes beside program and machine."""
        names = ("n", "sampling", "measure", "seed", "indices", "at_least", "shape_all")
        drawn = {name: value.distribution() for name, value in self.vary.items()}
        return {"vary": drawn, **{name: getattr(self, name) for name in names}}


def load_study(path: str | Path) -> StudyFile:
    """Read the file of a study; the files that it names are looked for beside it.

    Args:
        path: of the file.

    Returns:
        What it says.

    Raises:
        StudyFileError: not TOML, or wrong keys or values; every problem is listed.
        OSError: the file cannot be read.
    """
    text = read_text(Path(path), StudyFileError)
    data = parsed(text, str(path), StudyFileError)
    if isinstance(data.get("vary"), dict):
        data["vary"] = _flat(data["vary"])
    # In quotes, as they are said in messages, so that these find their lines.
    quoted = _DOTTED.sub(r'\1"\2"\3', text)
    found = validated(StudyFile, data, str(path), quoted, StudyFileError)
    beside = Path(path).parent
    machine = found.machine
    if machine is not None and machine not in Machine.builtin_names():
        machine = str(beside / machine)
    return found.model_copy(update={"program": str(beside / found.program), "machine": machine})
