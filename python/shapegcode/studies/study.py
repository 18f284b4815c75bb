"""A Monte Carlo study: one program on many sampled machines, and their verdicts."""

from __future__ import annotations

import contextlib
import warnings
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from shapegcode.batching.process import Cluster, cluster_executor
from shapegcode.errors import ArgumentError, DesignError, MachineError
from shapegcode.io.units import FloatArray
from shapegcode.machine import Machine
from shapegcode.program import Program
from shapegcode.program.computer import cores
from shapegcode.settings.keys import toml
from shapegcode.studies import replay as replays, result as results
from shapegcode.studies.varied import (
    Columns,
    Listed,
    Varied,
    Vary,
    index_problem,
    salib,
    sampled_columns,
    sampled_machine,
    varied_values,
)

Progress = Callable[[str, float], None]


def study(
    program: Program | str | Path,
    machine: Machine | str | Path,
    vary: Vary,
    *,
    n: int = 1000,
    sampling: str = "sobol",
    measure: Sequence[str] = replays.DEFAULT_MEASURES,
    seed: int = 0,
    indices: bool = False,
    at_least: float = 0.95,
    shape_all: bool = False,
    scheduler: Cluster | str | None = None,
    on_progress: Progress = lambda _stage, _share: None,
) -> results.MachineStudy:
    """Simulate a program on machines with sampled values, and compute the probability of staying within tolerance.

    The program is converted once, for the machine file. A mode, drive, filter or time in `vary` is changed only in the
    simulated machine; but for a key that only the converter reads, or whose distribution is `known`, the program is
    converted for each sampled value.

    >>> sg.study("part.nc", machine, {"axes.x.modes.1.frequency_hz": sg.normal(46, 2)}, n=10_000)

    Args:
        program: the program, or its file.
        machine: the machine, its file, or a built-in name.
        vary: distribution of each key: `normal`, `lognormal`, `uniform`, or a list of values. Modes count from 1.
        n: number of samples; a grid has this many at most.
        sampling: "sobol", "lhs" (latin hypercube) or "grid".
        measure: measures, see `shapegcode.studies.replay.MEASURES`.
        seed: equal seeds give equal samples.
        indices: Sobol indices by SALib; samples are then Saltelli's design, at most `n`.
        at_least: required probability of staying within tolerance.
        shape_all: see `convert`.
        scheduler: Dask's address, or a `Cluster`; "local": one on this computer; None: threads of this process.
        on_progress: called with the stage and the finished fraction of the samples.

    Returns:
        Quantiles, probability, influences; `to_xarray()` has every sample.

    Raises:
        ArgumentError: nothing to vary; invalid n, seed, sampling, measure or `at_least`; nothing could be simulated.
        MachineError: an unknown key, or a sampled value that is invalid in a machine file: key, value, limit.
        DesignError: no shaper exists for the machine file.
        ProgramError: the program cannot be read.
        OSError: its file cannot be read.
    """
    machine = Machine.of(machine)
    check_probability("at_least", at_least)
    wanted = replays.checked_measures(measure)
    varied = varied_values(machine, vary)
    columns = sampled_columns(varied, n, sampling, seed, indices=indices)
    check_ends(machine, varied, columns)
    if isinstance(program, Program):
        program.require_machine(machine)
    source = str(program) if isinstance(program, Path) else program
    cluster = Cluster(scheduler) if isinstance(scheduler, str) else scheduler
    with contextlib.ExitStack() as stack:
        pool = None if cluster is None else stack.enter_context(cluster_executor(cluster, cores()))[0]
        run = _StudyRun(source, machine, varied, columns, wanted, pool, shape_all, on_progress)
        texts = run.simulate()
    return _result(run, texts, sampling, seed, at_least, indices=indices)


def check_ends(machine: Machine, varied: Sequence[Varied], columns: Columns) -> None:
    """Before any conversion, check machines with lowest and highest value of each key, or with each listed value."""
    for each, column in zip(varied, columns, strict=True):
        if isinstance(each.distribution, Listed):
            ends = {toml(value): index for index, value in enumerate(column)}.values()
        else:
            numbers = np.asarray(column, dtype=float)
            ends = {"low": int(numbers.argmin()), "high": int(numbers.argmax())}.values()
        for index in ends:
            row = {one.key: values[index] for one, values in zip(varied, columns, strict=True)}
            sampled_machine(machine, row, f"{machine.name}, sample {index + 1}")


@dataclass(frozen=True)
class _Text:
    """An emitted program and the samples that it serves; or the reason why there is no such program."""

    draws: tuple[int, ...]
    values: Mapping[str, object]
    replay: replays.Replay | None
    why: str = ""


class _StudyRun:
    def __init__(
        self, program: Program | str, machine: Machine, varied: Sequence[Varied], columns: Columns,
        wanted: tuple[str, ...], pool: Executor | None, shape_all: bool, on_progress: Progress,
    ) -> None:  # fmt: skip
        self.program, self.machine, self.varied, self.columns = program, machine, varied, columns
        self.wanted, self.pool, self.shape_all, self.on_progress = wanted, pool, shape_all, on_progress
        self.count = len(columns[0])
        self.measured = np.full((self.count, len(wanted)), np.nan)
        self.nominal: dict[str, float] = {}

    def simulate(self) -> list[_Text]:
        groups: dict[str, list[int]] = {}
        rows = [self._row(index, known=True) for index in range(self.count)]
        for index, row in enumerate(rows):
            groups.setdefault(toml(row), []).append(index)
        texts, done = [], 0
        for draws in groups.values():
            self.on_progress("converting", done / self.count)
            text = self._text(tuple(draws), rows[draws[0]])
            if text.replay is not None:
                self._simulate(text, done)
            done += len(draws)
            texts.append(text)
        self._simulate_nominal(texts)
        return texts

    def _row(self, index: int, *, known: bool) -> dict[str, object]:
        pairs = zip(self.varied, self.columns, strict=True)
        return {each.key: column[index] for each, column in pairs if each.known == known}

    def _text(self, draws: tuple[int, ...], values: Mapping[str, object]) -> _Text:
        machine = sampled_machine(self.machine, values, f"{self.machine.name}, sample {draws[0] + 1}")
        try:
            return _Text(draws, values, replays.Replay.of(self.program, machine, shape_all=self.shape_all))
        except (ArgumentError, DesignError) as error:
            if not values:
                raise  # there is no other program
            return _Text(draws, values, None, str(error))

    def _simulate(self, text: _Text, before: int) -> None:
        assert text.replay is not None
        job = replays.SamplesJob(
            self.machine.name,
            tuple(self._row(index, known=False) for index in text.draws),
            tuple(index + 1 for index in text.draws),
            self.wanted,
            any(each.changes_times and not each.known for each in self.varied),
        )
        self.measured[list(text.draws)] = replays.simulate_all(
            text.replay, job, self.pool, lambda done: self.on_progress("simulating", (before + done) / self.count)
        )

    def _simulate_nominal(self, texts: Sequence[_Text]) -> None:
        """Convert the program for the unvaried machine file, and simulate it on the unvaried machine."""
        try:
            held = next((text.replay for text in texts if not text.values), None)
            replay = held or replays.Replay.of(self.program, self.machine, shape_all=self.shape_all)
        except (ArgumentError, DesignError, MachineError):
            self.nominal = dict.fromkeys(self.wanted, float("nan"))
            return
        self.nominal = replay.simulate(self.machine, self.wanted, times=False)


def _result(
    run: _StudyRun, texts: Sequence[_Text], sampling: str, seed: int, at_least: float, *, indices: bool
) -> results.MachineStudy:
    kept = np.flatnonzero(~np.isnan(run.measured[:, run.wanted.index(replays.SHARE)]))
    refused = [text for text in texts if text.replay is None]
    if len(kept) == 0:
        raise ArgumentError(f"no sample could be simulated: {refused[0].why}")
    columns = [[column[index] for index in kept] for column in run.columns]
    measured = {name: run.measured[kept, rank] for rank, name in enumerate(run.wanted)}
    shares = measured[replays.SHARE]
    # A sample without an emitted program counts as out of tolerance.
    good = int(within(shares).sum())
    whole = indices and not refused
    warnings = [f"{run.count - len(kept)} of {run.count} samples have no program: they count as out of tolerance"]
    warnings += ["no Sobol indices: they need every sample"] if indices else []
    alone = replays.CONTOURS.isdisjoint(run.wanted)
    alone_warnings = ["no contour is measured: within tolerance means residual vibration alone"] if alone else []
    limits = [each for text in texts if text.replay is not None for each in text.replay.limits]
    return results.MachineStudy(
        program=run.program.source if isinstance(run.program, Program) else run.program,
        machine=run.machine.name,
        sampling=sampling,
        seed=seed,
        n=len(kept),
        conversions=len(texts),
        varied=tuple(
            results.VariedKey(each.key, each.value, each.unit, each.distribution.words, each.known)
            for each in run.varied
        ),
        within=good / run.count,
        within_interval=interval_of(good, run.count),
        at_least=at_least,
        quantities=tuple(quantity(name, values, run.nominal[name]) for name, values in measured.items()),
        parameter_sensitivity=parameter_sensitivity(run.varied, columns, shares, indices=whole, seed=seed),
        curves=tuple(
            results.Bins(each.key, name, bins_of(each, column, values), not isinstance(each.distribution, Listed))
            for each, column in zip(run.varied, columns, strict=True)
            for name, values in measured.items()
        ),
        refused=tuple(results.RefusedDraws(toml(dict(text.values)), len(text.draws), text.why) for text in refused),
        warnings=(*alone_warnings, *(warnings if refused else ())),
        limits_um={
            "residual_um": min(float(each.residual_um.min()) for each in limits),
            "contour_um": min(each.contour_um for each in limits),
        },
        draws={each.key: np.array(column) for each, column in zip(run.varied, columns, strict=True)} | measured,
    )


def check_probability(name: str, value: object) -> None:
    """Refuse an invalid probability."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 < value <= 1.0:
        raise ArgumentError(f"{name} = {value!r}: must be a probability, above 0 and at most 1")


def quantity(name: str, values: FloatArray, nominal: float) -> results.Quantity:
    """Quantiles of one measure."""
    p5, p25, p50, p75, p95, p99 = np.percentile(values, results.PERCENT).tolist()
    return results.Quantity(name, nominal, float(values.mean()), p5, p25, p50, p75, p95, p99, float(values.max()))


def within(shares: FloatArray) -> npt.NDArray[np.bool_]:
    """Mask of the samples that keep every limit; *shares*: the largest ratio to a limit, of each sample."""
    return shares <= 1.0 + 1e-9


def interval_of(good: int, count: int) -> tuple[float, float]:
    """Clopper and Pearson's interval of a probability, at 95 %."""
    from scipy.stats import binomtest

    interval = binomtest(good, count).proportion_ci(0.95)
    return float(interval.low), float(interval.high)


def bins_of(each: Varied, column: Sequence[object], values: FloatArray) -> tuple[results.BinQuantiles, ...]:
    """Quantiles of a measure over a varied value: in up to ten bins of equally many samples, or per listed value."""
    if isinstance(each.distribution, Listed):
        groups = [
            (rank, str(choice), [index for index, value in enumerate(column) if value == choice])
            for rank, choice in enumerate(each.distribution.values)
        ]
        return tuple(_bin(float(rank), name, values[chosen]) for rank, name, chosen in groups if chosen)
    numbers = np.asarray(column, dtype=float)
    order = np.argsort(numbers, kind="stable")
    count = max(1, min(10, len(order) // 5))
    parts = ((float(np.median(numbers[part])), part) for part in np.array_split(order, count))
    return tuple(_bin(middle, f"{middle:.4g}", values[part]) for middle, part in parts)


def _bin(at: float, name: str, values: FloatArray) -> results.BinQuantiles:
    return results.BinQuantiles(at, name, *np.percentile(values, (5.0, 50.0, 95.0)).tolist())


def parameter_sensitivity(
    varied: Sequence[Varied], columns: Sequence[Sequence[object]], shares: FloatArray, *, indices: bool, seed: int
) -> tuple[results.ParameterInfluence, ...]:
    """Influence of each varied value on the largest ratio to a limit; largest influence first."""
    found = _indices(varied, shares, seed) if indices else {}
    rows = []
    for each, column in zip(varied, columns, strict=True):
        bins = bins_of(each, column, shares)
        low, high = min(bins, key=lambda one: one.median), max(bins, key=lambda one: one.median)
        index = found.get(each.key, ())
        rows.append(results.ParameterInfluence(each.key, low.median, high.median, low.name, high.name, *index))
    rank = (lambda row: row.total or 0.0) if found else (lambda row: row.high - row.low)
    return tuple(sorted(rows, key=rank, reverse=True))


def _indices(varied: Sequence[Varied], shares: FloatArray, seed: int) -> dict[str, tuple[float, ...]]:
    """First-order and total index of each value by SALib, and their errors; empty if the measure is constant."""
    sobol = salib("analyze")
    if float(np.ptp(shares)) == 0.0:
        return {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = sobol.analyze(index_problem(varied), shares, calc_second_order=False, seed=seed)
    rows = zip(*(map(float, found[name]) for name in ("S1", "ST", "S1_conf", "ST_conf")), strict=True)
    return {each.key: row for each, row in zip(varied, rows, strict=True)}
