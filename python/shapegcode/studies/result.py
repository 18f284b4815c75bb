"""What a study found: quantiles, probability of staying within tolerance, what decides; the best of some choices."""

from __future__ import annotations

import shlex
import tomllib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
import numpy.typing as npt

from shapegcode._core import ArgumentError
from shapegcode.results.json import hidden
from shapegcode.results.outcome import NotKeptError, Plot
from shapegcode.results.page.model import Figure
from shapegcode.results.result import Result
from shapegcode.results.table import Column, Table

if TYPE_CHECKING:
    import xarray as xr

PERCENT = (5, 25, 50, 75, 95, 99)
_UNITS = {"_um": "µm", "_s": "s"}


@dataclass(frozen=True)
class VariedKey:
    """What was varied."""

    key: str  # dotted name in the machine file
    value: str  # what the file says
    unit: str  # of its values
    drawn_from: str  # in words
    known: bool  # the text was converted for each value


@dataclass(frozen=True)
class Quantity:
    """A measure over all samples."""

    name: str  # of the measure, with its unit
    nominal: float  # on the machine as the file has it
    mean: float  # of all draws
    p5: float  # below it lie 5 %; and so the others
    p25: float  # likewise
    p50: float  # the median
    p75: float  # likewise
    p95: float  # likewise
    p99: float  # likewise
    largest: float  # of all draws

    @property
    def unit(self) -> str:
        """As the name ends."""
        return next((unit for ending, unit in _UNITS.items() if self.name.endswith(ending)), "")


@dataclass(frozen=True)
class ParameterInfluence:
    """What a value does to the verdict."""

    key: str  # of the value
    low: float  # least share of the limit, median of the draws in one bin of the value
    high: float  # largest
    low_at: str  # value at which it is least
    high_at: str  # value at which it is largest
    first: float | None = None  # Sobol index of first order of the share; None: not asked for
    total: float | None = None  # total Sobol index
    first_error: float | None = None  # half of the 95 % interval of the first, by resampling
    total_error: float | None = None  # likewise


def _with_error(value: float | None, error: float | None) -> str:
    return "" if value is None or error is None else f"{value:.2f} ± {error:.2f}"


@dataclass(frozen=True)
class RefusedDraws:
    """Samples that could not be simulated, because there is no emitted program for them."""

    values: str  # that the converter was given, in words
    draws: int  # how many
    why: str  # in words


@dataclass(frozen=True)
class BinQuantiles:
    """A measure over the samples in one bin of a value."""

    at: float  # median of the value; of a list the rank
    name: str  # of the bin
    low: float  # 5 % of the measure lie below it
    median: float  # half of it
    high: float  # 95 %


@dataclass(frozen=True)
class Bins:
    """A measure over one value, bin by bin."""

    key: str  # of the value
    measure: str  # of which
    bins: tuple[BinQuantiles, ...]  # in the order of the values
    numbers: bool  # the values are numbers; else choices


@dataclass(frozen=True, repr=False, eq=False)
class MachineStudy(Result):
    """A program simulated on many sampled machines (Monte Carlo).

    Attributes:
        program: its name.
        machine: that was varied.
        sampling: "sobol", "lhs" or "grid".
        seed: of the draws.
        n: draws that were simulated.
        conversions: texts that were made for them.
        varied: what was varied.
        within: share of the draws that stay within every limit.
        within_interval: of the probability that this estimates, 95 %; of a grid it means nothing.
        at_least: what the probability should be.
        quantities: measures over all draws.
        parameter_sensitivity: values by what they do to the verdict, the one that decides first.
        curves: measures over each value, for pictures.
        refused: draws without a text.
        warnings: caution, before you run.
        limits_um: smallest limit of each measure that has one.
        draws: values by key and measures by name, one row for each draw.
    """

    json_extra: ClassVar[dict[str, Any]] = dict(Result.json_extra)

    program: str
    machine: str
    sampling: str
    seed: int
    n: int
    conversions: int
    varied: tuple[VariedKey, ...]
    within: float
    within_interval: tuple[float, float]
    at_least: float
    quantities: tuple[Quantity, ...]
    parameter_sensitivity: tuple[ParameterInfluence, ...]
    curves: tuple[Bins, ...]
    refused: tuple[RefusedDraws, ...] = ()
    warnings: tuple[str, ...] = ()
    limits_um: Mapping[str, float] = field(default_factory=dict)
    draws: Mapping[str, npt.NDArray[Any]] = field(default_factory=dict, metadata=hidden())

    @property
    def ok(self) -> bool:
        """Whether enough samples stay within tolerance."""
        return self.within >= self.at_least

    @property
    def answer(self) -> str:
        """How likely it stays within tolerance, and what decides that."""
        low, high = self.within_interval
        sure = "" if self.sampling == "grid" else f" (95 % interval {low * 100:.1f} to {high * 100:.1f} %)"
        what = "of the grid stays" if self.sampling == "grid" else "of the machines stay"
        most = f"; {self.parameter_sensitivity[0].key} decides" if self.parameter_sensitivity else ""
        return f"{self.within * 100:.1f} % {what} within tolerance{sure}, asked for {self.at_least * 100:g} %{most}"

    @property
    def next_step(self) -> str:
        """To measure what decides, or to convert."""
        if self.ok:
            sure = "it stays within tolerance in spite of the uncertainties"
            return f"convert {self.program} for {self.machine}: {sure}."
        if not self.parameter_sensitivity:
            return "see why samples were refused."
        key, low_at = self.parameter_sensitivity[0].key, self.parameter_sensitivity[0].low_at
        if next(each.known for each in self.varied if each.key == key):
            least = f"choose {key} where the share of the limit is least ({low_at})"
            return f"{least}, or by shapegcode optimize with the same file."
        return f"measure {key} more closely, or let shapegcode optimize choose a more robust shaper."

    def quantity(self, name: str) -> Quantity:
        """A measure.

        Args:
            name: of it.

        Returns:
            Its quantiles.

        Raises:
            KeyError: it was not measured.
        """
        return {each.name: each for each in self.quantities}[name]

    def key_figures(self) -> tuple[Figure, ...]:
        """How likely, and the 95 % quantile of each measure beside the machine as it stands in its file."""
        figures = [Figure("stay within tolerance", "%", None, self.within * 100, 1, None, "", "within", 100.0)]
        for rank, each in enumerate(self.quantities):
            keys = f"quantities.{rank}.nominal", f"quantities.{rank}.p95"
            limit = self.limits_um.get(each.name)
            figures.append(Figure(f"{each.name}, 95 %", each.unit, each.nominal, each.p95, 2, limit, *keys))
        return tuple(figures)

    def tables(self) -> list[Table]:
        """Quantiles, what decides, what was refused."""
        measures = (
            Column("measure", value="name", left=True, priority=0),
            Column("file", value="nominal", digits=3),
            *(
                Column(name, value=value, digits=3, priority=priority)
                for name, value, priority in (
                    ("5 %", "p5", 1), ("25 %", "p25", 3), ("median", "p50", 1), ("75 %", "p75", 3), ("95 %", "p95", 0),
                    ("99 %", "p99", 2), ("largest", "largest", 2),
                )
            ),
            Column("limit", value=lambda row: self.limits_um.get(row.name), digits=3),
        )  # fmt: skip
        deciding = (
            Column("value", value="key", left=True, priority=0),
            Column("share of limit", value=lambda row: f"{row.low:.2f} to {row.high:.2f}"),
            Column("least at", value="low_at", priority=2),
            Column("largest at", value="high_at"),
            Column("first order", value=lambda row: _with_error(row.first, row.first_error), priority=2),
            Column("total", value=lambda row: _with_error(row.total, row.total_error)),
        )
        tables = [
            Table(f"{self.n} draws, {self.conversions} conversion{'s' * (self.conversions != 1)}", measures,
                  self.quantities),
            Table("what decides the verdict: median share of the limit over each value", deciding,
                  self.parameter_sensitivity),
        ]  # fmt: skip
        if self.refused:
            why = (Column("values", text=True), Column("draws"), Column("why", text=True))
            tables.append(Table("not simulated", why, self.refused))
        return tables

    def plots(self) -> Mapping[str, Plot]:
        """Tornado and quantile bands."""
        return self._drawn_beside()

    def to_xarray(self, what: str = "") -> xr.Dataset:
        """Every draw: its values as coordinates, its measures as variables; needs `shapegcode[study]`.

        Args:
            what: "draws", or "quantities" for the quantiles; empty: the draws.

        Returns:
            The Dataset, with units; its dimension is `draw`, or `percent`.

        Raises:
            ArgumentError: another word.
            NotKeptError: the study was read back from its JSON, which has no draws.
            ModuleNotFoundError: xarray is not installed.
        """
        import xarray as xr

        about = {
            "program": self.program, "machine": self.machine, "sampling": self.sampling, "seed": self.seed,
            "within": self.within,
        }  # fmt: skip
        if what == "quantities":
            rows = {
                each.name: xr.DataArray(
                    [getattr(each, f"p{percent}") for percent in PERCENT], dims=["percent"], attrs={"units": each.unit}
                )
                for each in self.quantities
            }
            return xr.Dataset(rows, coords={"percent": [float(percent) for percent in PERCENT]}, attrs=about)
        if what not in ("", "draws"):
            raise ArgumentError(f"{what}: must be draws or quantities")
        if not self.draws:
            raise NotKeptError("the draws of a study are not in its JSON: run it again, or keep --csv")
        keys = {each.key for each in self.varied}
        units = {each.key: each.unit for each in self.varied} | {each.name: each.unit for each in self.quantities}
        measured: dict[str, Any] = {}
        coordinates: dict[str, Any] = {"draw": np.arange(1, self.n + 1)}
        for name, values in self.draws.items():
            array = xr.DataArray(values, dims=["draw"], attrs={"units": units.get(name, "")})
            (coordinates if name in keys else measured)[name] = array
        return xr.Dataset(measured, coords=coordinates, attrs=about)

    def csv_lines(self) -> Iterator[str]:
        """One line for each draw.

        Yields:
            Header and lines.
        """
        yield ",".join(self.draws) + "\n"
        for row in zip(*self.draws.values(), strict=True):
            yield ",".join(f"{value:.9g}" if isinstance(value, float) else str(value) for value in row) + "\n"


_SHOWN = 12


@dataclass(frozen=True)
class ChosenValue:
    """A key of the machine file and what was chosen."""

    key: str  # dotted name
    value: str  # as TOML


@dataclass(frozen=True)
class Candidate:
    """A combination that was converted.

    Attributes:
        values: what was chosen.
        time_s: cycle time; None: there is no text.
        within: share of the draws that stay within tolerance; None: not simulated, as there is a shorter one.
        checked: the same of fresh draws, four times as many; None: not simulated.
        why: there is no text.
    """

    values: tuple[ChosenValue, ...]
    time_s: float | None
    within: float | None = None
    checked: float | None = None
    why: str = ""

    @property
    def words(self) -> str:
        """The values, for a cell."""
        return ", ".join(f"{each.key.rpartition('.')[2]} {each.value}" for each in self.values)


@dataclass(frozen=True, repr=False, eq=False)
class Optimum(Result):
    """The shortest program that stays within tolerance with the requested probability.

    Attributes:
        program: its name.
        machine: that was varied.
        probability: of staying within tolerance that was asked for.
        draws: machines on which a candidate is simulated; four times as many fresh ones confirm it.
        best: the candidate; None: none is likely enough.
        as_it_is: the machine file without a choice; None: it has no text.
        candidates: all that were converted, the shortest first.
        combinations: how many there are to choose from.
        warnings: caution, before you run.
        machine_words: the machine as a command names it behind -m.
    """

    program: str
    machine: str
    probability: float
    draws: int
    best: Candidate | None
    as_it_is: Candidate | None
    candidates: tuple[Candidate, ...]
    combinations: int
    warnings: tuple[str, ...] = ()
    machine_words: str = "MACHINE"

    @property
    def ok(self) -> bool:
        """Whether there is one."""
        return self.best is not None

    @property
    def values(self) -> dict[str, Any]:
        """What to set: `machine.with_values(found.values)`; nothing where none is likely enough."""
        chosen = () if self.best is None else self.best.values
        return {each.key: tomllib.loads(f"value = {each.value}")["value"] for each in chosen}

    @property
    def answer(self) -> str:
        """What to set, how long it takes, how likely it is good."""
        if self.best is None or self.best.time_s is None:
            asked = f"{self.probability * 100:g} % of the machines"
            return f"none of {len(self.candidates)} choices stays within tolerance on {asked}"
        was_s = None if self.as_it_is is None else self.as_it_is.time_s
        before = "" if was_s is None else f" (as the file has it {was_s:.3f} s)"
        checked = self.best.checked or 0.0
        return (
            f"{self.best.words}: {self.best.time_s:.3f} s{before}, within tolerance on {checked * 100:.1f} % of the "
            f"machines, asked for {self.probability * 100:g} %"
        )

    @property
    def next_step(self) -> str:
        """To convert with it."""
        if self.best is None:
            return "measure what decides (shapegcode study), widen the tolerance, or ask for less."
        words = [word for each in self.best.values for word in ("--set", f"{each.key}={each.value}")]
        program = shlex.quote(self.program)
        return f"shapegcode convert {program} -m {self.machine_words} {shlex.join(words)} -o shaped.nc"

    def key_figures(self) -> tuple[Figure, ...]:
        """Time and probability of the best one."""
        if self.best is None or self.best.time_s is None:
            return ()
        was = None if self.as_it_is is None else self.as_it_is.time_s
        return (
            Figure("cycle time", "s", was, self.best.time_s, 3, None, "as_it_is.time_s", "best.time_s"),
            Figure("stay within tolerance", "%", None, (self.best.checked or 0.0) * 100, 1, None, "", "best.checked",
                   100.0),
        )  # fmt: skip

    def plots(self) -> Mapping[str, Plot]:
        """Time and probability of the shortest choices; nothing where none has a text."""
        return self._drawn_beside() if self.shown else {}

    @property
    def shown(self) -> tuple[Candidate, ...]:
        """The shortest candidates that have a text."""
        return tuple(each for each in self.candidates[:_SHOWN] if each.time_s is not None)

    def tables(self) -> list[Table]:
        """The shortest candidates."""

        def chosen(rank: int) -> Callable[[Candidate], str]:
            return lambda row: row.values[rank].value

        keys = [each.key for each in self.candidates[0].values]
        columns = (
            *(Column(key.rpartition(".")[2], value=chosen(rank), text=True) for rank, key in enumerate(keys)),
            Column("time", "s", "time_s", digits=3),
            Column("within", "%", lambda row: None if row.within is None else row.within * 100.0, digits=1),
            Column("confirmed", "%", lambda row: None if row.checked is None else row.checked * 100.0, digits=1),
            Column("why not", value="why", text=True, priority=2),
        )
        more = len(self.candidates) - _SHOWN
        caption = f"and {more} more, all slower or without a text" if more > 0 else ""
        title = f"choices by time: {len(self.candidates)} of {self.combinations} converted"
        return [Table(title, columns, self.candidates[:_SHOWN], caption)]
