"""Designs of test cuts, and results of their records: coefficients, forces, and how the control follows the feed."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar, Literal

from shapegcode.io.units import FloatArray
from shapegcode.machine import Machine
from shapegcode.results.json import hidden
from shapegcode.results.outcome import Plot
from shapegcode.results.result import Result
from shapegcode.results.table import Column, Table
from shapegcode.testcut.cut import CuttingLaw, Edge, TestCut
from shapegcode.testcut.forces import Coefficient, CoefficientFit, Expected, MeanForces
from shapegcode.testcut.record import Revolutions


@dataclass(frozen=True, repr=False, eq=False)
class CutDesign(Result):
    """A designed test cut, before it is run.

    Attributes:
        cut: content of the side file.
        files: paths of program and side file, once written.
        warnings: unexpected properties of the design.
        edge: edge to mill before each pass.
        stock_mm: length of the stock along X.
        machine: machine whose controller runs the program.
    """

    published: ClassVar[tuple[str, ...]] = ("cutting force",)
    cut: TestCut
    files: tuple[str, ...]
    warnings: tuple[str, ...]
    edge: Edge = field(metadata=hidden())
    stock_mm: float = field(metadata=hidden())
    machine: Machine = field(metadata=hidden())

    @property
    def answer(self) -> str:
        """Kind, passes and duration."""
        cut = self.cut
        seconds = sum(each.duration_s for each in cut.passes)
        return f"{cut.kind} for {cut.machine}: {len(cut.passes)} measuring passes, {seconds:.0f} s in total"

    @property
    def next_step(self) -> str:
        """Run the program, and fit the records."""
        files = " ".join(f"pass{number}.csv" for number in range(1, len(self.cut.passes) + 1))
        side = self.files[1] if self.files else "its side file"
        return f"run it, then shapegcode testcut fit {files} --cut {side}"

    def tables(self) -> list[Table]:
        """Table with one row for each pass."""
        columns = (
            Column("pass", value=lambda row: row[0]),
            Column("what", value=lambda row: row[1].name.lower(), text=True),
            Column("radial depth", "mm", lambda row: _range(row[1].edge_height_mm, 2, 5e-3)),
            Column("feed", "mm/min", lambda row: _range([feed for _, feed in row[1].feeds])),
            Column("blocks", value=lambda row: len(row[1].feeds)),
            Column("s", value=lambda row: row[1].duration_s, digits=1),
        )
        return [Table("", columns, list(enumerate(self.cut.passes, start=1)))]


def _range(values: Sequence[float], digits: int | None = None, same: float = 0.0) -> str:
    low, high = (f"{value:g}" if digits is None else f"{value:.{digits}f}" for value in (min(values), max(values)))
    return low if max(values) - min(values) <= same else f"{low} ... {high}"


EXPONENT_LIMIT, FACTOR_LIMIT = 0.05, 0.10  # widest accepted half intervals
RATIO_LIMIT = 0.10  # largest difference of measured and expected effect of the feed


@dataclass(frozen=True)
class ChipRange:
    """Range of the mean chip thickness over the mean forces of a fit."""

    min: float  # thinnest, mm
    max: float  # thickest, mm
    middle: float  # geometric mean, mm


@dataclass(frozen=True)
class TaperPass:
    """Results from the record of one pass."""

    file: str  # path
    feed_mm_per_min: float  # mean of the pass, from the record
    spindle_rev_per_min: float  # from the record, or as commanded
    offset_n: tuple[float, float]  # force along the feed and to its left shown in air before the cut
    drift_n: tuple[float, float]  # its change until after the cut


@dataclass(frozen=True)
class LeftOut:
    """A part of a pass with chatter."""

    number: int  # of the pass, from 1
    from_mm: float  # X at its start
    to_mm: float  # X at its end


@dataclass(frozen=True, repr=False, eq=False)
class TaperResult(Result):
    """Coefficients of the cutting force from the records of a taper.

    Attributes:
        program: program of the test cut.
        machine: name of the machine.
        cutting: the table ``[cutting]`` for the tool file.
        coefficients: each with its interval; the factors are for a chip 1 mm thick.
        at_chip: k1 and k2 at the chip thickness `chip_mm.middle`, known much more precisely than the factors.
        chip_mm: range of the mean chip thickness.
        mean_forces: number of mean forces, the ignored ones included.
        outliers: number of ignored ones, whose force deviates from the others.
        rms_n: RMS residual of the others, along the feed and to its left.
        rms_percent: RMS residual of both, relative to the resultant.
        neighbour_correlation: correlation of neighbouring residuals, 0 to 1; the intervals allow for it.
        passes: results from the sampled records; empty for files with means.
        left_out: parts with chatter.
        poor: messages for poorly known coefficients of the power laws.
        warnings: further remarks.
        cut: the test cut.
        fit: the fit, row by row.
        data: the mean forces.
        kind: kind of the test cut.
    """

    published: ClassVar[tuple[str, ...]] = ("cutting force",)
    program: str
    machine: str
    cutting: CuttingLaw
    coefficients: tuple[Coefficient, ...]
    at_chip: tuple[Coefficient, ...]
    chip_mm: ChipRange
    mean_forces: int
    outliers: int
    rms_n: tuple[float, float]
    rms_percent: float
    neighbour_correlation: float
    passes: tuple[TaperPass, ...]
    left_out: tuple[LeftOut, ...]
    poor: tuple[str, ...]
    warnings: tuple[str, ...]
    cut: TestCut = field(metadata=hidden())
    fit: CoefficientFit = field(metadata=hidden())
    data: MeanForces = field(metadata=hidden())
    kind: Literal["taper"] = "taper"

    @property
    def ok(self) -> bool:
        """Every exponent is known to ±0.05 and every factor to ±10 %, or better."""
        return not self.poor

    @property
    def answer(self) -> str:
        """k1 and k2 at the middle chip thickness, and the residual."""
        k1, k2 = (each.value for each in self.at_chip)
        chip = self.chip_mm
        sentence = (
            f"k1 {k1:.4g} N/mm² and k2 {k2:.3g} at a chip of {1e3 * chip.middle:.2f} um; {self.mean_forces} mean "
            f"forces, chips {1e3 * chip.min:.2f} to {1e3 * chip.max:.2f} um thick on average; residual "
            f"{self.rms_percent:.1f} % of the force"
        )
        return "; poor: ".join([sentence, *self.poor])

    @property
    def next_step(self) -> str:
        """Use the coefficients, or measure more."""
        if self.poor:
            return "more passes, with other feeds or a longer stock"
        return "put [cutting] into the tool file (-o FILE writes it)"

    def _next_after(self, file: str) -> str:
        return self.next_step if self.poor else f"put [cutting] of {file} into the tool file"

    def tables(self) -> list[Table]:
        """Table with one row for each coefficient."""
        chip = f" at a chip of {1e3 * self.chip_mm.middle:.2f} um"
        rows = [(each.name, each) for each in self.coefficients]
        rows += [(name + chip, each) for name, each in zip(("k1", "k2"), self.at_chip, strict=True)]
        columns = (
            Column("key", value=lambda row: row[0], text=True),
            Column("value", value=lambda row: f"{row[1].value:.4g}"),
            Column("95 % interval", value=lambda row: f"{row[1].low:.4g} ... {row[1].high:.4g}"),
            Column("unit", value=lambda row: row[1].unit, text=True),
        )
        return [Table("coefficients of the cutting force", columns, rows)]

    def plots(self) -> Mapping[str, Plot]:
        """`testcut-forces`: measured and fitted; `testcut-coefficients`: over the chip thickness."""
        return self._drawn_beside()

    def to_toml(self) -> str:
        """The table ``[cutting]`` for a tool file, with the intervals as comments."""
        tool = self.cut.tool
        lines = [
            "[cutting]",
            f"# measured: taper {self.program} on {self.machine}, D{tool.diameter_mm:g} with {tool.flutes} flutes, "
            f"{self.cut.spindle_rev_per_min:g} rev/min",
            f"# valid for chips {self.chip_mm.min:.4f} to {self.chip_mm.max:.4f} mm thick on average",
        ]
        for each in self.coefficients:
            interval = f"95 %: {each.low:.5g} to {each.high:.5g} {each.unit}".rstrip()
            lines.append(f"{each.name} = {each.value:.6g}  # {interval}")
        return "\n".join([*lines, f'chip_thickness = "{self.cutting.chip_thickness}"']) + "\n"


@dataclass(frozen=True, eq=False)
class CornerPass:
    """Largest resultant in the stock in one pass, measured and expected: mean over a revolution, and peak."""

    number: int  # of the pass, from 1
    measured_mean_n: float  # largest mean, as recorded
    measured_peak_n: float  # largest magnitude, as recorded
    expected_mean_n: float  # largest mean of the force law
    expected_peak_n: float  # largest magnitude of the force law
    record: Revolutions = field(metadata=hidden())  # recorded means by revolution
    forecast: Expected = field(metadata=hidden())  # expected by the force law


@dataclass(frozen=True)
class ForceRatio:
    """Largest mean resultant with the modified feed over that with the constant one."""

    measured: float  # as recorded
    expected: float  # of the force law


@dataclass(frozen=True, repr=False, eq=False)
class CornerResult(Result):
    """Measured against expected resultant of the passes of an unrolled corner.

    Attributes:
        program: program of the test cut.
        machine: name of the machine.
        peaks: largest resultants of the passes, in file order.
        ratio: effect of the modified feed; None: only one of the two passes was recorded.
        scale: measured over expected mean resultant, in the recorded pass with the lowest number: error of the
            coefficients.
        warnings: further remarks.
        kind: kind of the test cut.
    """

    published: ClassVar[tuple[str, ...]] = ("cutting force",)
    program: str
    machine: str
    peaks: tuple[CornerPass, ...]
    ratio: ForceRatio | None
    scale: float
    warnings: tuple[str, ...]
    kind: Literal["corner"] = "corner"

    @property
    def ok(self) -> bool:
        """True if the feed changes the largest resultant as much as expected, within 10 %, or if `ratio` is None."""
        return self.ratio is None or abs(self.ratio.measured / self.ratio.expected - 1.0) <= RATIO_LIMIT

    @property
    def answer(self) -> str:
        """Measured over expected resultant; ratio of largest mean resultants with modified and with constant feed."""
        sentence = f"the measured resultant is {self.scale:.2f} times the expected one in the first recorded pass"
        if self.ratio is None:
            return sentence
        ratios = f"measured {self.ratio.measured:.2f}, expected {self.ratio.expected:.2f}"
        return f"{sentence}; largest mean resultant after over before: {ratios}"

    @property
    def next_step(self) -> str:
        """Next test cut to run."""
        if abs(self.scale - 1.0) > RATIO_LIMIT:
            return "shapegcode testcut taper measures the coefficients"
        return "shapegcode testcut interval shows how often the feed may change"

    def tables(self) -> list[Table]:
        """Table with one row for each pass."""
        columns = (
            Column("pass", value="number"),
            Column("measured mean", value="measured_mean_n", digits=1),
            Column("expected mean", value="expected_mean_n", digits=1),
            Column("measured peak", value="measured_peak_n", digits=1),
            Column("expected peak", value="expected_peak_n", digits=1),
        )
        return [Table("largest resultant, N", columns, self.peaks)]

    def plots(self) -> Mapping[str, Plot]:
        """`testcut-corner`: resultants along each pass, measured and expected."""
        return self._drawn_beside()


@dataclass(frozen=True, eq=False)
class FollowedPass:
    """How the controller followed the feeds of one pass."""

    number: int  # of the pass, from 1
    interval_mm: float  # length of its blocks
    deviation: float  # largest |measured - expected| mean force in the second half of a block, relative to expected
    at_mm: float  # X of the end of that block
    noise: float  # relative standard deviation of such a mean at constant feed
    lag_s: float  # best-fitting time constant
    ok: bool  # followed: the deviation is within 5 % plus twice the noise
    time_s: FloatArray = field(metadata=hidden())  # (m,) of the record
    # (m,) mean over a revolution, scaled to the expected one on the straight part
    force_n: FloatArray = field(metadata=hidden())
    immediate_n: FloatArray = field(metadata=hidden())  # (m,) expected if the feed follows at once
    lagging_n: FloatArray = field(metadata=hidden())  # (m,) expected with the lag


@dataclass(frozen=True, repr=False, eq=False)
class IntervalResult(Result):
    """Shortest interval at which the controller follows the commanded feeds.

    Attributes:
        program: program of the test cut.
        machine: name of the machine.
        interval_mm: shortest measured interval that is followed, as are all longer ones; None: the longest is not.
        lag_interval_mm: travel at the largest feed until a lag of the median time constant reaches 90 % of a step.
        passes: measured passes, by interval.
        warnings: further remarks.
        kind: kind of the test cut.
    """

    published: ClassVar[tuple[str, ...]] = ("cutting force",)
    program: str
    machine: str
    interval_mm: float | None
    lag_interval_mm: float
    passes: tuple[FollowedPass, ...]
    warnings: tuple[str, ...]
    kind: Literal["interval"] = "interval"

    @property
    def ok(self) -> bool:
        """True if the control follows the longest interval."""
        return self.interval_mm is not None

    @property
    def answer(self) -> str:
        """The interval, or the travel that a step needs."""
        if self.interval_mm is None:
            needed = f"90 % of a step need about {self.lag_interval_mm:.2f} mm at the largest feed"
            some = any(each.ok for each in self.passes)
            follows = "does not follow the longest" if some else "follows none of the"
            return f"the control {follows} measured interval{'' if some else 's'}; {needed}"
        return f"the control follows feed changes every {self.interval_mm:g} mm or more"

    @property
    def next_step(self) -> str:
        """Set the interval, or test longer ones."""
        if self.interval_mm is None:
            return "shapegcode testcut interval --intervals with longer ones"
        return f"set feed_control.interval_mm = {self.interval_mm} in the machine file"

    def tables(self) -> list[Table]:
        """Table with one row for each pass."""
        columns = (
            Column("interval", "mm", value=lambda each: f"{each.interval_mm:g}"),
            Column("largest deviation", value=lambda each: f"{100 * each.deviation:.0f} %"),
            Column("at X", "mm", "at_mm", digits=2),
            Column("noise", value=lambda each: f"{100 * each.noise:.1f} %"),
            Column("lag", "ms", lambda each: f"{1e3 * each.lag_s:.0f}"),
            Column("follows", value=lambda each: "yes" if each.ok else "no"),
        )
        return [Table("how the control follows the feed", columns, self.passes)]

    def plots(self) -> Mapping[str, Plot]:
        """`testcut-interval`: resultant over time, measured, at the commanded feeds and with the lag."""
        return self._drawn_beside()
