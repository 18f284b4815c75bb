"""Result of an identification with uncertainties: figures, tables, the next step."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np

from shapegcode._core import Mode
from shapegcode.identification.checks import Prepared, RecordUse
from shapegcode.io.record import ComplexArray, FrequencyResponse, Record
from shapegcode.io.units import FloatArray
from shapegcode.results.json import hidden, sparse
from shapegcode.results.outcome import Plot, Xyz
from shapegcode.results.page.model import Light
from shapegcode.results.result import Result
from shapegcode.results.table import Column, Table


@dataclass(frozen=True)
class Estimate:
    """A value and its 95 % interval.

    Attributes:
        value: the estimate.
        low: lower end of the interval.
        high: upper end.
    """

    value: float
    low: float
    high: float

    def __post_init__(self) -> None:
        for name in ("value", "low", "high"):
            object.__setattr__(self, name, float(getattr(self, name)))

    def __float__(self) -> float:
        return self.value

    def __format__(self, spec: str) -> str:
        return format(self.value, spec) if spec else str(self)

    @property
    def uncertainty_percent(self) -> float:
        """Larger half of the interval, in percent of the value."""
        return 100.0 * max(self.high - self.value, self.value - self.low) / abs(self.value)

    def map(self, function: Callable[[float], float]) -> Self:
        """The estimate of a monotonic function of the value.

        Args:
            function: monotonic function of the value, rising or falling.

        Returns:
            Estimate of the function's value.
        """
        ends = sorted((function(self.low), function(self.high)))
        return type(self)(function(self.value), *ends)


@dataclass(frozen=True)
class IdentifiedMode:
    """One mode.

    Attributes:
        frequency_hz: undamped natural frequency.
        damping_ratio: 1 = critically damped.
        mass_kg: equivalent (modal) mass at the point of the tap; None without a measured force.
        damping_n_s_per_m: equivalent viscous damping; None without a measured force.
        stiffness_n_per_m: equivalent stiffness; None without a measured force.
        refusal: why this mode is refused: not supported by the data, or beyond the requested number; empty: it is not.
        left_out: refused without a fault of the test: beyond the excited band or the requested number, or with a
            peak below 2 % of the highest supported one; in a sweep or capture also narrower than the line spacing.
        moves: mode shape: motion along X, Y and Z relative to that along the axis of the test; null for an
            axis that was not measured. Only if other axes were measured too.
    """

    frequency_hz: Estimate
    damping_ratio: Estimate
    mass_kg: Estimate | None = None
    damping_n_s_per_m: Estimate | None = None
    stiffness_n_per_m: Estimate | None = None
    refusal: str = ""
    left_out: bool = False
    moves: Xyz[Estimate | None] | None = field(default=None, metadata=sparse())

    @property
    def mode(self) -> Mode:
        """Its frequency and damping ratio, for a shaper or a machine."""
        return Mode(self.frequency_hz.value, self.damping_ratio.value)


def mode_line(mode: IdentifiedMode) -> str:
    """A mode in one line: each value with half of its 95 % interval, or why the data do not support it."""
    if mode.refusal:
        return f"{mode.frequency_hz.value:.4g} Hz not supported: {mode.refusal}"
    named = (
        ("frequency", mode.frequency_hz, 1.0, "Hz"),
        ("damping", mode.damping_ratio, 100.0, "%"),
        ("m", mode.mass_kg, 1.0, "kg"),
        ("c", mode.damping_n_s_per_m, 1.0, "N s/m"),
        ("k", mode.stiffness_n_per_m, 1e-6, "N/µm"),
    )
    return ", ".join(f"{name} {estimate_cell(each, factor)} {unit}" for name, each, factor, unit in named if each)


def estimate_cell(estimate: Estimate | None, factor: float) -> str:
    """An estimate times a factor, ``46.02 ± 0.58``, to two digits of the interval; both ends if it is skewed."""
    if estimate is None:
        return ""
    value, low, high = (factor * each for each in (estimate.value, estimate.low, estimate.high))
    above, below = high - value, value - low
    if not (math.isfinite(above) and math.isfinite(below) and above > 0.0 and below > 0.0):
        return f"{value:.4g} ({low:.4g} ... {high:.4g})"
    skewed = max(above, below) > 1.2 * min(above, below)
    half = min(above, below) if skewed else max(above, below)
    decimals = min(max(0, 1 - math.floor(math.log10(half))), 6)
    if skewed:
        return f"{value:z.{decimals}f} ({low:z.{decimals}f} ... {high:z.{decimals}f})"
    return f"{value:z.{decimals}f} ± {half:.{decimals}f}"


@dataclass(frozen=True)
class ChartPole:
    """A pole of the stabilisation chart."""

    order: int  # number of modes of its model
    frequency_hz: float  # undamped natural frequency
    damping_ratio: float  # damping ratio of the pole
    stable_frequency: bool  # the model one order lower has it too, within 1 %
    stable_damping: bool  # and within 5 % of the damping ratio


@dataclass(frozen=True)
class MassCheck:
    """The equivalent mass by the method of Back, Ko and Kim, 2003 (paper 003 in docs/evidence/references.md)."""

    closed_form_kg: float  # one simulation; the RMS of the response is proportional to 1/m
    bisection_kg: float  # the paper's search
    halvings: int  # halving steps of the search


@dataclass(frozen=True, eq=False)
class Sweep:
    """Spectrum and fit of a sweep without force, or of a capture of command and encoder."""

    source: str  # of the record
    axis: str | None  # "x", "y" or "z"; None: not known
    samples: int  # number of recorded samples
    period_s: float  # time between two samples
    frequency_hz: FloatArray  # (n,) middles of the bins
    amplitude: FloatArray  # (n,) amplitude of the response relative to the command, any unit
    fitted: FloatArray  # (n,) amplitude of the model
    command: str = ""  # program or capture with the command; empty: its spectrum is assumed
    kind: str = "sweep without force"


@dataclass(frozen=True)
class MachineFile:
    """Machine file into which the modes were written."""

    path: str  # as named
    axis: str  # "x", "y" or "z"
    notes: tuple[str, ...]  # replaced, kept, removed and added modes, one sentence each


@dataclass(frozen=True, repr=False, eq=False, kw_only=True)
class Identification(Result):
    """Modes found in one or several records of the same point.

    Attributes:
        files: as named, or the sources of records.
        modes: those that the data support, by ascending frequency.
        refused: modes above the noise that are refused, each with the reason.
        order: number of modes of the chosen model; 0: no mode.
        evidence: information criterion (lower is better) by number of modes; empty if frequency responses were fitted
            (those given, or those of impacts with many modes).
        fit_percent: 100 * (1 - |measured - fitted| / |measured|), over all records together; null without a model.
        noise_rms: RMS measurement noise of the response in the fitted band, in the unit of the records; null
            if not known.
        mass_check: check of the equivalent mass from taps, if the model has one mode; else null.
        reason: why there is no mode; empty: there are modes.
        doubt: why the modes found should not be used; empty: usable.
        machine_file: where the modes were written; null: nowhere.
        warnings: of the records and of the result.
        notes: remarks, such as on ignored parts of the files.
        prepared: used and refused taps or decays; None: none usable, or the input is frequency responses or a sweep.
        chart: poles of the stabilisation chart.
        sweep: spectrum of a sweep or capture; None: the modes are from other records.
        responses: frequency responses without time record, in the fitted band.
        turned: whether the sign of the frequency responses was reversed.
        options: command-line options that the next step repeats.
        fitted_lines: model response at the lines of each frequency response, (n,) complex.
        fitted_records: the records as they were fitted, decimated if the band allows it.
        fitted: model response per record, (n,), at the fitted samples.
    """

    json_extra: ClassVar[dict[str, Any]] = {
        **Result.json_extra,
        "axis": str | None,
        "decay": bool,
        "records": tuple[RecordUse, ...],
    }

    files: tuple[str, ...]
    modes: tuple[IdentifiedMode, ...] = ()
    refused: tuple[IdentifiedMode, ...] = ()
    order: int = 0
    evidence: Mapping[int, float] = field(default_factory=dict)
    fit_percent: float | None = None
    noise_rms: float | None = None
    mass_check: MassCheck | None = None
    reason: str = ""
    doubt: str = ""
    machine_file: MachineFile | None = None
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    prepared: Prepared | None = field(default=None, metadata=hidden())
    chart: tuple[ChartPole, ...] = field(default=(), metadata=hidden())
    sweep: Sweep | None = field(default=None, metadata=hidden())
    responses: tuple[FrequencyResponse, ...] = field(default=(), metadata=hidden())
    turned: bool = field(default=False, metadata=hidden())
    options: tuple[str, ...] = field(default=(), metadata=hidden())
    fitted_lines: tuple[ComplexArray, ...] = field(default=(), metadata=hidden())
    fitted_records: tuple[Record, ...] = field(default=(), metadata=hidden())
    fitted: tuple[FloatArray, ...] = field(default=(), metadata=hidden())

    @property
    def methods(self) -> tuple[str, ...]:
        """Published methods of the fit."""
        if self.sweep is not None and not self.sweep.command:
            return ("modes from a sweep",)
        over_time = self.evidence and not self.responses and self.sweep is None
        return ("modes from records" if over_time else "modes from frequency responses",)

    @property
    def taps(self) -> tuple[Record, ...]:
        """Used taps or decays."""
        return () if self.prepared is None else self.prepared.records

    @property
    def axis(self) -> str | None:
        """Measured axis, "x", "y" or "z"; null: not stated by the files."""
        if self.sweep is not None:
            return self.sweep.axis
        if self.responses:
            return self.responses[0].axis
        return self.taps[0].axis if self.taps else None

    @property
    def decay(self) -> bool:
        """Whether the modes are from free decays."""
        return bool(self.taps) and self.taps[0].force_n is None

    @property
    def source(self) -> str:
        """Origin of the modes, for the machine file."""
        names = ", ".join(Path(file).name for file in self.files)
        if self.responses or self.sweep is not None:
            return f"{'frequency response' if self.sweep is None else self.sweep.kind} {names}"
        return f"free decay {names}" if self.decay else f"tap test {names}, {self._counted()}"

    def _counted(self) -> str:
        if self.sweep is not None:
            return f"a {self.sweep.kind}"
        count = len(self.taps) + len(self.responses)
        kind = "frequency response" if self.responses else "decay" if self.decay else "tap"
        return f"{count} {kind}{'' if count == 1 else 's'}"

    @property
    def records(self) -> tuple[RecordUse, ...]:
        """The records: taps or decays (used ones, then refused ones), or frequency responses, or the one sweep."""
        if self.sweep is not None:
            sweep = self.sweep
            return (RecordUse(sweep.source, True, "", sweep.samples, sweep.period_s, quantity="acceleration"),)
        used = []
        for lines in self.responses:
            about: dict[str, Any] = {"quantity": lines.quantity, "resolution_hz": lines.resolution_hz}
            used.append(RecordUse(lines.source, True, "", len(lines.response), **about))
        if self.prepared is None:
            return tuple(used)
        for each in self.prepared.usable:
            tap = each.record
            measured = len(tap.response), tap.period_s, tap.start_s, tap.quantity, each.excited_hz
            used.append(RecordUse(tap.source, True, "", *measured))
        return (*used, *self.prepared.refused)

    @property
    def _unsupported(self) -> list[IdentifiedMode]:
        return [mode for mode in self.refused if not mode.left_out]

    @property
    def ok(self) -> bool:
        """Whether there are modes to use, and every peak above the noise is supported or may be ignored."""
        return bool(self.modes) and not self._unsupported and not self.doubt

    @property
    def exit_code(self) -> int:
        """0: use all modes; 1: some are not supported, or use is doubtful; 2: no mode is supported."""
        return super().exit_code if self.modes else 2

    @property
    def light(self) -> tuple[Light, str]:
        """Red: do not use; amber: some modes are not supported, or there are warnings."""
        if self.doubt or not self.modes:
            return "red", self.doubt or self.reason
        if self._unsupported:
            return "amber", f"{len(self._unsupported)} more not supported by the data"
        return super().light

    @property
    def answer(self) -> str:
        """Whether to use the modes or why not, the frequencies, and the quality of the fit."""
        if not self.modes:
            peaks = "the peaks are not supported by the data, see the table for the reasons"
            return f"do not use: no mode in {', '.join(self.files)}: {peaks if self.refused else self.reason}"
        count = f"{len(self.modes)} mode{'' if len(self.modes) == 1 else 's'}"
        axis = "" if self.axis is None else f" of the {self.axis.upper()} axis"
        hertz = ", ".join(f"{mode.frequency_hz.value:.4g}" for mode in self.modes)
        use = f"do not use: {self.doubt}; " if self.doubt else "use: "
        said = f"{use}{count}{axis} in {self._counted()}: {hertz} Hz; the model explains {self.fit_percent:.1f} %"
        more = len(self._unsupported)
        return f"{said}; {more} more {'is' if more == 1 else 'are'} NOT supported by the data" if more else said

    @property
    def next_step(self) -> str:
        """Next command: repeat the test, write the machine file, or choose a shaper."""
        if self.sweep is not None and self.sweep.command and (self._unsupported or self.doubt or not self.modes):
            return "sweep again, for longer or with more acceleration (shapegcode sweep), or tap"
        if not self.modes:
            return "shapegcode identify --tap-plan describes the test"
        if self._unsupported or self.doubt:
            return "tap again, longer or more often, for the unsupported modes (shapegcode identify --tap-plan)"
        if self.machine_file is not None:
            return f"shapegcode shaper -m {self.machine_file.path}"
        if self.sweep is not None and self.sweep.command not in ("", self.sweep.source):
            how = f"--sweep {self.sweep.command} -m mine.toml"
        else:
            how = f"--axis {self.axis or 'x'}"
        return f"shapegcode identify {' '.join((*self.files, how, *self.options))} --update mine.toml"

    def __repr__(self) -> str:
        lines = [super().__repr__(), *(f"  {mode_line(mode)}" for mode in (*self.modes, *self.refused))]
        if self.warnings:
            lines.append(f"  {len(self.warnings)} warning{'' if len(self.warnings) == 1 else 's'}: see .warnings")
        return "\n".join(lines)

    def tables(self) -> list[Table]:
        """Tables of modes with intervals, mode shapes, refused modes, records; without empty ones."""
        check, caption = self.mass_check, ""
        if check is not None:
            caption = (
                f"check, equivalent mass as in paper 003: closed form {check.closed_form_kg:.4g} kg, bisection "
                f"{check.bisection_kg:.4g} kg after {check.halvings} halving{'' if check.halvings == 1 else 's'}"
            )
        moving = self.modes if any(mode.moves is not None for mode in self.modes) else ()
        tables = (
            Table("modes, each ± 95 %", _MODE_COLUMNS, self.modes, caption=caption),
            Table("mode shapes, relative to the motion along the mode's axis", _MOVE_COLUMNS, moving),
            Table("not supported by the data" if self._unsupported else "left out", _REFUSAL_COLUMNS, self.refused),
            Table("records", _RECORD_COLUMNS, self.records),
        )
        return [table for table in tables if table.rows]

    def plots(self) -> Mapping[str, Plot]:
        """`identify-traces`, `-stabilisation`, `-decay` if a mode was found, and `-response` (decays: `-spectrum`).

        For a frequency response without time record: `-response` and `-stabilisation`; for a sweep: `-sweep`. None
        without a model.
        """
        return self._drawn_beside() if self.fitted or self.fitted_lines or self.sweep is not None else {}


def as_sweep(
    found: Identification, notes: Iterable[str], source: str, samples: int, period_s: float, command: str,
    kind: str = Sweep.kind,
) -> Identification:  # fmt: skip
    """Result for a response to a known command, like that of a sweep: without tap records and their noise."""
    measured, fitted = found.responses[0], np.abs(found.fitted_lines[0])
    lines = measured.frequency_hz, np.abs(measured.response), fitted
    sweep = Sweep(source, measured.axis, samples, period_s, *lines, command, kind)
    notes = (*notes, *found.notes)
    return replace(found, notes=notes, responses=(), fitted_lines=(), noise_rms=None, sweep=sweep)


def by_support(found: Sequence[IdentifiedMode]) -> dict[str, Any]:
    """Fields for supported modes, refused modes, and the reason if no mode is supported."""
    modes, refused = (tuple(mode for mode in found if bool(mode.refusal) == bad) for bad in (False, True))
    reason = "" if modes else "no mode exceeds the noise"
    if refused and not modes:
        reason = "the peaks are not supported by the data: " + "; ".join(
            f"{mode.frequency_hz.value:.4g} Hz: {mode.refusal}" for mode in refused
        )
    return {"modes": modes, "refused": refused, "reason": reason}


_MODE_COLUMNS = (
    Column("frequency", "Hz", lambda mode: estimate_cell(mode.frequency_hz, 1.0)),
    Column("damping", "%", lambda mode: estimate_cell(mode.damping_ratio, 100.0)),
    Column("m", "kg", lambda mode: estimate_cell(mode.mass_kg, 1.0)),
    Column("c", "N s/m", lambda mode: estimate_cell(mode.damping_n_s_per_m, 1.0)),
    Column("k", "N/µm", lambda mode: estimate_cell(mode.stiffness_n_per_m, 1e-6)),
)


def _move_cell(letter: str, mode: IdentifiedMode) -> str:
    estimate: Estimate | None = getattr(mode.moves, letter)
    exact = estimate is not None and estimate.low == estimate.high
    return f"{estimate.value:g}" if estimate is not None and exact else estimate_cell(estimate, 1.0)


_FREQUENCY = Column("frequency", "Hz", lambda mode: f"{mode.frequency_hz.value:.4g}")
_MOVE_COLUMNS = (_FREQUENCY, *(Column(letter.upper(), "1", partial(_move_cell, letter)) for letter in "xyz"))
_REFUSAL_COLUMNS = (_FREQUENCY, Column("why", value="refusal", text=True))
_RECORD_COLUMNS = (
    Column("record", value="source", text=True),
    Column("samples"),
    Column("duration", "s", "duration_s", digits=3),
    Column("resolution", "Hz", "resolution_hz", digits=3),
    Column("excited up to", "Hz", "excited_hz", digits=0),
    Column("not used", value="reason", text=True),
)
