"""Results of a study: quantiles, probability of staying within tolerance, influences; the best combination."""

from __future__ import annotations

import shlex
import tomllib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

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
    """A varied value."""

    key: str  # dotted name in the machine file
    value: str  # value in the file
    unit: str  # unit of its values
    drawn_from: str  # its distribution, as text
    known: bool  # the program was converted for each value


@dataclass(frozen=True)
class Quantity:
    """A measure over all samples."""

    name: str  # name of the measure, with its unit
    nominal: float  # value on the machine of the file
    mean: float  # mean of all samples
    p5: float  # 5 % quantile
    p25: float  # 25 % quantile
    p50: float  # the median
    p75: float  # 75 % quantile
    p95: float  # 95 % quantile
    p99: float  # 99 % quantile
    largest: float  # maximum of all samples

    @property
    def unit(self) -> str:
        """Unit, by the ending of the name."""
        return next((unit for ending, unit in _UNITS.items() if self.name.endswith(ending)), "")


@dataclass(frozen=True)
class ParameterInfluence:
    """Influence of a value on the verdict."""

    key: str  # key of the value
    low: float  # smallest ratio to the limit, median of the samples in one bin of the value
    high: float  # largest ratio, likewise
    low_at: str  # value at the smallest ratio
    high_at: str  # value at the largest ratio
    first: float | None = None  # first-order Sobol index of the ratio; None: not requested, or not computable
    total: float | None = None  # total Sobol index
    first_error: float | None = None  # half width of the 95 % interval of `first`, by resampling
    total_error: float | None = None  # the same for `total`


def _with_error(value: float | None, error: float | None) -> str:
    return "" if value is None or error is None else f"{value:.2f} ± {error:.2f}"


@dataclass(frozen=True)
class RefusedDraws:
    """Samples that could not be simulated, because there is no emitted program for them."""

    values: str  # values of the conversion, as text
    draws: int  # number of samples
    why: str  # the reason


@dataclass(frozen=True)
class BinQuantiles:
    """A measure over the samples in one bin of a value."""

    at: float  # median of the value; for a list the index
    name: str  # name of the bin
    low: float  # 5 % quantile of the measure
    median: float  # median
    high: float  # 95 % quantile


@dataclass(frozen=True)
class Bins:
    """Quantiles of a measure in bins of one varied value."""

    key: str  # key of the value
    measure: str  # name of the measure
    bins: tuple[BinQuantiles, ...]  # in the order of the values
    numbers: bool  # true for numbers; false for choices


@dataclass(frozen=True, repr=False, eq=False)
class MachineStudy(Result):
    """A program simulated on many sampled machines (Monte Carlo).

    Attributes:
        program: name of the program.
        machine: name of the varied machine.
        sampling: "sobol", "lhs" or "grid".
        seed: seed of the samples.
        n: number of simulated samples.
        conversions: number of programs converted for them.
        varied: the varied values.
        within: ratio of all samples that stay within every limit; those without an emitted program do not.
        within_interval: 95 % interval of the estimated probability; meaningless for a grid.
        at_least: the required probability.
        quantities: quantiles of each measure over the simulated samples.
        parameter_sensitivity: values by influence on the verdict, most influential first.
        curves: measures over each value, for pictures.
        refused: samples without an emitted program.
        warnings: samples without a program, and what was not measured.
        limits_um: smallest limit of each measure that has one.
        draws: values by key and measures by name, one row per simulated sample.
    """

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
        """True if enough samples stay within tolerance."""
        return self.within >= self.at_least

    @property
    def answer(self) -> str:
        """Probability of staying within tolerance, and the most influential value."""
        low, high = self.within_interval
        sure = "" if self.sampling == "grid" else f" (95 % interval {low * 100:.1f} to {high * 100:.1f} %)"
        what = "of the grid stays" if self.sampling == "grid" else "of the machines stay"
        most = f"; {self.parameter_sensitivity[0].key} has most influence" if self.parameter_sensitivity else ""
        return f"{self.within * 100:.1f} % {what} within tolerance{sure}, required {self.at_least * 100:g} %{most}"

    @property
    def next_step(self) -> str:
        """What to do next: convert, measure or choose the most influential value, or see why samples were refused."""
        if self.ok:
            sure = "it stays within tolerance in spite of the uncertainties"
            return f"convert {self.program} for {self.machine}: {sure}."
        if not self.parameter_sensitivity:
            return "see why samples were refused."
        key, low_at = self.parameter_sensitivity[0].key, self.parameter_sensitivity[0].low_at
        if next(each.known for each in self.varied if each.key == key):
            least = f"choose {key} where the ratio to the limit is smallest ({low_at})"
            return f"{least}, or by shapegcode optimize with the same file."
        return f"measure {key} more precisely, or let shapegcode optimize choose a more robust shaper."

    def quantity(self, name: str) -> Quantity:
        """Quantiles of a measure.

        Args:
            name: name of the measure.

        Returns:
            Its quantiles.

        Raises:
            KeyError: it was not measured.
        """
        return {each.name: each for each in self.quantities}[name]

    def key_figures(self) -> tuple[Figure, ...]:
        """Probability; for each measure its value on the machine as in the file, and its 95 % quantile."""
        figures = [Figure("stay within tolerance", "%", None, self.within * 100, 1, None, "", "within", 100.0)]
        for rank, each in enumerate(self.quantities):
            keys = f"quantities.{rank}.nominal", f"quantities.{rank}.p95"
            limit = self.limits_um.get(each.name)
            figures.append(Figure(f"{each.name}, 95 %", each.unit, each.nominal, each.p95, 2, limit, *keys))
        return tuple(figures)

    def tables(self) -> list[Table]:
        """Tables of quantiles, influences, and refused samples."""
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
            Column("ratio to limit", value=lambda row: f"{row.low:.2f} to {row.high:.2f}"),
            Column("least at", value="low_at", priority=2),
            Column("largest at", value="high_at"),
            Column("first order", value=lambda row: _with_error(row.first, row.first_error), priority=2),
            Column("total", value=lambda row: _with_error(row.total, row.total_error)),
        )
        tables = [
            Table(f"{self.n} samples, {self.conversions} conversion{'s' * (self.conversions != 1)}", measures,
                  self.quantities),
            Table("influence on the verdict: median ratio to the limit over each value", deciding,
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
        """Every sample: its values as coordinates, its measures as variables; needs `shapegcode[study]`.

        Args:
            what: "draws" for the samples, or "quantities" for the quantiles; empty: the samples.

        Returns:
            The Dataset, with units; its dimension is `draw`, or `percent`.

        Raises:
            ArgumentError: `what` is neither of these words, nor empty.
            NotKeptError: the study was read back from its JSON, which has no samples.
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
            raise NotKeptError("the samples of a study are not in its JSON: run it again, or keep --csv")
        keys = {each.key for each in self.varied}
        units = {each.key: each.unit for each in self.varied} | {each.name: each.unit for each in self.quantities}
        measured: dict[str, Any] = {}
        coordinates: dict[str, Any] = {"draw": np.arange(1, self.n + 1)}
        for name, values in self.draws.items():
            array = xr.DataArray(values, dims=["draw"], attrs={"units": units.get(name, "")})
            (coordinates if name in keys else measured)[name] = array
        return xr.Dataset(measured, coords=coordinates, attrs=about)

    def csv_lines(self) -> Iterator[str]:
        """Yield CSV lines: a header, then one line per sample.

        Yields:
            The lines, with line ends.
        """
        yield ",".join(self.draws) + "\n"
        for row in zip(*self.draws.values(), strict=True):
            yield ",".join(f"{value:.9g}" if isinstance(value, float) else str(value) for value in row) + "\n"


_SHOWN = 12


@dataclass(frozen=True)
class ChosenValue:
    """A key of the machine file with its chosen value."""

    key: str  # dotted name
    value: str  # as TOML


@dataclass(frozen=True)
class Candidate:
    """A converted combination.

    Attributes:
        values: the chosen values.
        time_s: cycle time; None: no emitted program.
        within: ratio of samples within tolerance; None: no emitted program, or a shorter combination is good enough.
        checked: the same for four times as many new samples; None: `within` is None or below the required ratio.
        why: reason without an emitted program.
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
        program: name of the program.
        machine: name of the varied machine.
        probability: required probability of staying within tolerance.
        draws: number of machines on which a candidate is simulated; it is confirmed on four times as many others.
        best: the best candidate; None: no candidate has the required probability.
        as_it_is: the settings of the machine file as a candidate; None: they give no emitted program.
        candidates: all candidates that were converted, shortest first; those without an emitted program last.
        combinations: number of possible combinations.
        warnings: always empty.
        machine_words: the machine as argument of -m.
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
        """True if there is a best candidate."""
        return self.best is not None

    @property
    def values(self) -> dict[str, Any]:
        """The settings, for `machine.with_values(found.values)`; empty without a best candidate."""
        chosen = () if self.best is None else self.best.values
        return {each.key: tomllib.loads(f"value = {each.value}")["value"] for each in chosen}

    @property
    def answer(self) -> str:
        """Best settings, their cycle time, and the probability of staying within tolerance."""
        if self.best is None or self.best.time_s is None:
            asked = f"{self.probability * 100:g} % of the machines"
            return f"none of {len(self.candidates)} choices stays within tolerance on {asked}"
        was_s = None if self.as_it_is is None else self.as_it_is.time_s
        before = "" if was_s is None else f" (with the file's settings {was_s:.3f} s)"
        checked = self.best.checked or 0.0
        return (
            f"{self.best.words}: {self.best.time_s:.3f} s{before}, within tolerance on {checked * 100:.1f} % of the "
            f"machines, required {self.probability * 100:g} %"
        )

    @property
    def next_step(self) -> str:
        """The command that converts with the best settings; if none is good enough, what to change."""
        if self.best is None:
            return "measure the most influential value (shapegcode study), widen the tolerance, or require less."
        words = [word for each in self.best.values for word in ("--set", f"{each.key}={each.value}")]
        program = shlex.quote(self.program)
        return f"shapegcode convert {program} -m {self.machine_words} {shlex.join(words)} -o shaped.nc"

    def key_figures(self) -> tuple[Figure, ...]:
        """Time and probability of the best candidate."""
        if self.best is None or self.best.time_s is None:
            return ()
        was = None if self.as_it_is is None else self.as_it_is.time_s
        return (
            Figure("cycle time", "s", was, self.best.time_s, 3, None, "as_it_is.time_s", "best.time_s"),
            Figure(
                "stay within tolerance", "%", None, (self.best.checked or 0.0) * 100, 1, None, "", "best.checked", 100.0
            ),
        )

    def plots(self) -> Mapping[str, Plot]:
        """Time and probability of the shortest combinations; empty without any emitted program."""
        return self._drawn_beside() if self.shown else {}

    @property
    def shown(self) -> tuple[Candidate, ...]:
        """The first candidates by cycle time, without those that have no emitted program."""
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
        caption = f"and {more} more, all slower or without an emitted program" if more > 0 else ""
        title = f"choices by time: {len(self.candidates)} of {self.combinations} converted"
        return [Table(title, columns, self.candidates[:_SHOWN], caption)]
