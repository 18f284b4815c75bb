"""Position loops identified from a log: figures, tables, pictures."""

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

    name: str  # of the parameter
    value: float | None  # null if the record does not determine it
    low: float | None  # lower end of the interval (95 %; of drive and torque: the range of the fits to halves and all)
    high: float | None  # upper end
    unit: str  # unit of value and interval
    note: str = ""  # why it is unknown, or its basis


@dataclass(frozen=True)
class ServoModel:
    """A model of the loop, compared with the record."""

    name: str  # "servo lag", "dead time and servo lag", "drive"
    # RMS of the residual following error in samples to which it was not fitted, mm or degrees
    rest: float
    rest_fitted: float  # RMS residual of the fit to all samples
    # part of the mean square of the control's contour deviation that the model explains in samples to which it was
    # not fitted; null without deviation. Negative: the control's own model is better
    explained_percent: float | None


@dataclass(frozen=True, eq=False)
class ServoCurves:
    """Data to plot an axis, one array for each section without a gap."""

    time_s: tuple[FloatArray, ...]  # (n,)
    speed: tuple[FloatArray, ...]  # of the command, (n,)
    lag: tuple[FloatArray, ...]  # command minus actual position, (n,)
    deviation: tuple[FloatArray, ...] | None  # the control's contour deviation, (n,); None: not recorded
    # residual of the lag after the best model's fit to the other half, (n,)
    rest: tuple[FloatArray, ...]


@dataclass(frozen=True)
class ServoAxis:
    """One axis.

    Attributes:
        name: as in the file.
        unit: "mm" or "deg".
        travel: largest range of the commanded positions in a section, mm or degrees.
        top_speed: highest commanded speed, per second.
        lag_rms: root mean square of command minus actual position.
        deviation_rms: RMS of the control's contour deviation; null if not recorded.
        models: models compared with the record; none if they cannot be fitted, see `note`.
        parameters: of the model "dead time and servo lag", of the torque, of the drive.
        note: undetermined or unexplained behaviour.
        curves: data to plot.
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
        """The model with the least residual in samples to which it was not fitted."""
        return min(self.models, key=lambda each: each.rest, default=None)

    @property
    def small_unit(self) -> str:
        """A thousandth of the unit."""
        return "µm" if self.unit == "mm" else "mdeg"

    def model(self, name: str) -> ServoModel | None:
        """Find a model by name.

        Args:
            name: "servo lag", "dead time and servo lag" or "drive".

        Returns:
            The model; None: not fitted.
        """
        return next((each for each in self.models if each.name == name), None)

    def parameter(self, name: str) -> ServoEstimate | None:
        """Find a parameter by name.

        Args:
            name: such as "dead time", "position gain", "drive: speed loop".

        Returns:
            The parameter, whose value may be unknown; None: not fitted.
        """
        return next((each for each in self.parameters if each.name == name), None)


@dataclass(frozen=True, repr=False, eq=False)
class ServoFit(Result):
    """Position loops identified from a log of commands and actual positions.

    Attributes:
        source: file.
        duration_s: of the samples, without gaps.
        axes: one for each axis with command and actual position.
        machine: name of the machine that gets the values; empty: none.
        written: keys of the machine file that were set, with their values.
        warnings: values that could not be written, and parts of the log that were not used.
        fitted: the machine with the parameters found; None without a machine.
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
        """For each axis with a fitted model: its following error, and the residual of its best model."""
        fitted = [axis for axis in self.axes if axis.models]
        if not fitted:
            return f"{self.source}: no model can be fitted to any axis, for the reasons in the last table"
        said = (
            f"{axis.name} {1e3 * axis.lag_rms:.4g} to {1e3 * min(each.rest for each in axis.models):.3g} "
            f"{axis.small_unit}"
            for axis in fitted
        )
        return f"following error, rms, and the model's residual in data to which it was not fitted: {', '.join(said)}"

    def to_toml(self) -> str:
        """The machine file with the gain and feed-forward found, each with a remark.

        Returns:
            The text of the file.

        Raises:
            ArgumentError: nothing was found that has a key in a machine file.
        """
        if self.fitted is None or not self.written:
            raise ArgumentError(
                f"{self.source}: no gain or feed-forward of X, Y or Z was found, so there is no machine file to write; "
                "name the axes where the labels of the log do not (axes, for example X=1,Y=6,Z=2)"
            )
        return self.fitted.to_toml()

    @property
    def next_step(self) -> str:
        """Write the machine file, or plot the residual."""
        if self.written:
            return "-o FILE writes the machine file with " + ", ".join(self.written)
        return "--plots DIR plots the residual; -m and -o write gain and feed-forward into a machine file"

    def _next_after(self, file: str) -> str:
        return f"shapegcode machine show {file} explains it; measured here: {', '.join(self.written)}"

    def tables(self) -> list[Table]:
        """Residuals of the models, and their parameters."""
        explained = (
            Column("axis", value="name", left=True),
            Column("unit", value="small_unit", left=True),
            Column("top speed", "/s", "top_speed", digits=1),
            Column("lag", value=lambda axis: _milli(axis.lag_rms)),
            Column("servo lag", value=partial(_rest, "servo lag")),
            Column("and dead time", value=partial(_rest, "dead time and servo lag")),
            Column("drive", value=partial(_rest, "drive")),
            Column("control's model", value=lambda axis: _milli(axis.deviation_rms)),
            Column("of which explained", "%", lambda axis: axis.best and axis.best.explained_percent, digits=1),
        )
        fitted = [axis for axis in self.axes if axis.parameters]
        drives = [axis for axis in fitted if axis.model("drive")]
        notes = [axis for axis in self.axes if axis.note]
        name = Column("axis", value="name", left=True)
        said = (name, Column("", value="note", text=True))
        return [
            Table("Residual following error, rms, in data to which the model was not fitted", explained, self.axes),
            Table("Servo lag with dead time, 95 % intervals", (name, *_columns(_LAG)), fitted),
            *([Table("The drive: range of three fits", (name, *_columns(_DRIVE)), drives)] if drives else []),
            *([Table("Undetermined", said, notes)] if notes else []),
        ]

    def plots(self) -> Mapping[str, Plot]:
        """Picture of the axes."""
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
