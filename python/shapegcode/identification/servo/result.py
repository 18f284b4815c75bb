"""What a log of commands and actual positions says about the position loops: figures, tables, pictures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

from shapegcode.errors import ArgumentError
from shapegcode.io.units import FloatArray
from shapegcode.machine import Machine
from shapegcode.results.json import hidden
from shapegcode.results.outcome import Plot
from shapegcode.results.result import Result
from shapegcode.results.table import Column, Table


@dataclass(frozen=True)
class ServoEstimate:
    """A parameter."""

    name: str  # of it
    value: float | None  # null where the record does not tell it
    low: float | None  # lower end of the interval (95 %; of the drive: the range of the fits to the halves and to all)
    high: float | None  # upper end
    unit: str  # of the three
    note: str = ""  # why it is not known, or what it rests on


@dataclass(frozen=True)
class ServoModel:
    """A model of the loop, compared with the record."""

    name: str  # "servo lag", "dead time and servo lag", "drive"
    # root mean square of what it leaves of the following error in samples that it was not fitted to, in mm or degrees
    rest: float
    rest_fitted: float  # the same where it was fitted to all samples
    # share of the mean square of the control's contour deviation that it explains in samples that it was not fitted to;
    # null where there is none. Negative: the control's own model is better
    explained_percent: float | None


@dataclass(frozen=True, eq=False)
class ServoCurves:
    """Data of the picture of an axis, one array for each section without a gap."""

    time_s: tuple[FloatArray, ...]  # (n,)
    speed: tuple[FloatArray, ...]  # of the command, (n,)
    lag: tuple[FloatArray, ...]  # command less actual position, (n,)
    deviation: tuple[FloatArray, ...] | None  # the control's contour deviation, (n,); None: not recorded
    # what the best model leaves of the lag, each sample judged by the fit to the other half, (n,)
    rest: tuple[FloatArray, ...]


@dataclass(frozen=True)
class ServoAxis:
    """One axis.

    Attributes:
        name: as the file has it.
        unit: "mm" or "deg".
        travel: of the command, mm or degrees.
        top_speed: of the command, per second.
        lag_rms: root mean square of command less actual position.
        deviation_rms: of the control's contour deviation; null where it was not recorded.
        models: held against it; none where the axis did not change its speed.
        parameters: of the dead time and servo lag, then of the drive and of the torque.
        note: what the record cannot tell, or what no model explains.
        curves: for the picture.
    """

    name: str
    unit: str
    travel: float
    top_speed: float
    lag_rms: float
    deviation_rms: float | None
    models: tuple[ServoModel, ...]
    parameters: tuple[ServoEstimate, ...]
    note: str
    curves: ServoCurves | None = field(default=None, metadata=hidden())

    @property
    def best(self) -> ServoModel | None:
        """The model that leaves least in samples that it was not fitted to."""
        return min(self.models, key=lambda each: each.rest, default=None)

    @property
    def small_unit(self) -> str:
        """A thousandth of the unit."""
        return "µm" if self.unit == "mm" else "mdeg"

    def model(self, name: str) -> ServoModel | None:
        """A model.

        Args:
            name: "servo lag", "dead time and servo lag" or "drive".

        Returns:
            The model; None: it was not fitted.
        """
        return next((each for each in self.models if each.name == name), None)

    def parameter(self, name: str) -> ServoEstimate | None:
        """A parameter.

        Args:
            name: such as "dead time", "position gain", "drive: speed loop".

        Returns:
            The parameter, whose value may be unknown; None: it was not fitted.
        """
        return next((each for each in self.parameters if each.name == name), None)


@dataclass(frozen=True, repr=False, eq=False)
class ServoFit(Result):
    """Position loops as a log of commands and actual positions shows them.

    Attributes:
        source: file.
        duration_s: of the samples, without gaps.
        axes: one for each axis with command and actual position.
        machine: name of the machine whose file gets the values; empty: none.
        written: keys of the machine file that were set, with their values.
        warnings: what no model explains, and what reading had to leave out.
        fitted: the machine with what is known; None without a machine.
    """

    source: str
    duration_s: float
    axes: tuple[ServoAxis, ...]
    machine: str
    written: Mapping[str, float]
    warnings: tuple[str, ...]
    fitted: Machine | None = field(default=None, metadata=hidden())

    @property
    def ok(self) -> bool:
        """Whether the loop of at least one axis is determined."""
        return any(axis.models for axis in self.axes)

    @property
    def answer(self) -> str:
        """Ratio of the following error that the model explains, for the axis with the largest one."""
        fitted = [axis for axis in self.axes if axis.models]
        if not fitted:
            return f"{self.source}: no axis changes its speed: nothing follows but the lag at constant speed"
        said = (
            f"{axis.name} {1e3 * axis.lag_rms:.4g} to {1e3 * min(each.rest for each in axis.models):.3g} "
            f"{axis.small_unit}"
            for axis in fitted
        )
        return f"following error, rms, and the model's residual in data to which it was not fitted: {', '.join(said)}"

    def to_toml(self) -> str:
        """The machine file with the gain and feed-forward that are known, each with a remark.

        Returns:
            The text of the file.

        Raises:
            ArgumentError: nothing is known that a machine file has a key for.
        """
        if self.fitted is None or not self.written:
            raise ArgumentError(
                f"{self.source}: no gain or feed-forward of X, Y or Z follows, so there is no machine file to write; "
                "name the axes where the labels of the log do not (axes, for example X=1,Y=6,Z=2)"
            )
        return self.fitted.to_toml()

    @property
    def next_step(self) -> str:
        """To write the machine file, or to look at the pictures."""
        if self.written:
            return "-o FILE writes the machine file with " + ", ".join(self.written)
        return "--plots DIR plots the residual; -m and -o write gain and feed-forward into a machine file"

    def next_step_after(self, file: str) -> str:
        """To look at the machine file that was written.

        Args:
            file: name of it.

        Returns:
            One sentence.
        """
        return f"shapegcode machine show {file} explains it; measured here: {', '.join(self.written)}"

    def tables(self) -> list[Table]:
        """What the models explain, and their parameters."""
        explained = (
            Column("axis", value="name", left=True),
            Column("unit", value="small_unit", left=True),
            Column("top speed", "/s", "top_speed", digits=1),
            Column("lag", value=lambda axis: _milli(axis.lag_rms)),
            Column("servo lag", value=partial(_rest, "servo lag")),
            Column("and dead time", value=partial(_rest, "dead time and servo lag")),
            Column("drive", value=partial(_rest, "drive")),
            Column("control's model", value=lambda axis: _milli(axis.deviation_rms)),
            Column("of that explained", "%", lambda axis: axis.best and axis.best.explained_percent, digits=1),
        )
        fitted = [axis for axis in self.axes if axis.parameters]
        drives = [axis for axis in fitted if axis.model("drive")]
        notes = [axis for axis in self.axes if axis.note]
        name = Column("axis", value="name", left=True)
        said = (name, Column("", value="note", text=True))
        return [
            Table("Left of the following error, rms, where the model was not fitted", explained, self.axes),
            Table("What follows: servo lag behind a dead time, 95 % intervals", (name, *_columns(_LAG)), fitted),
            *([Table("The drive: range of three fits", (name, *_columns(_DRIVE)), drives)] if drives else []),
            *([Table("What does not follow", said, notes)] if notes else []),
        ]

    def plots(self) -> Mapping[str, Plot]:
        """A picture of the axes."""
        return self._drawn_beside()


def _milli(value: float | None) -> str:
    return "" if value is None else f"{1e3 * value:.4g}"


def _rest(name: str, axis: ServoAxis) -> str:
    found = axis.model(name)
    return "" if found is None else _milli(found.rest)


_LAG = (
    ("lag", "ms", "lag at constant speed"),
    ("dead time", "ms", "dead time"),
    ("gain", "1/s", "position gain"),
    ("feed-forward", "", "feed-forward"),
    ("friction by torque", "/s²", "friction over mass by torque"),
)
_DRIVE = (
    ("dead time", "ms", "drive: dead time"),
    ("gain", "1/s", "drive: position gain"),
    ("feed-forward", "", "drive: feed-forward"),
    ("speed loop", "Hz", "drive: speed loop"),
    ("integral", "ms", "drive: integral time"),
    ("friction", "/s²", "drive: friction over mass"),
)


def _columns(parameters: Sequence[tuple[str, str, str]]) -> tuple[Column, ...]:
    return tuple(Column(heading, unit, partial(_cell, name), text=True) for heading, unit, name in parameters)


def _cell(name: str, axis: ServoAxis) -> str:
    """Value and interval; a question mark if the record does not determine the value."""
    found = axis.parameter(name)
    if found is None:
        return ""
    scale = 1e3 if found.unit == "s" else 1.0
    digits = 3 if name.startswith("drive") else 4
    value = "?" if found.value is None else f"{scale * found.value:.{digits}g}"
    if found.low is None or found.high is None:
        return value
    return f"{value} {scale * found.low:.{digits}g}–{scale * found.high:.{digits}g}"
