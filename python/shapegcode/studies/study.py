"""A study: one text, many sampled machines, what that does to the verdict."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from shapegcode.batching.process import Cluster, cluster_executor
from shapegcode.errors import ArgumentError, DesignError, MachineError
from shapegcode.machine import Machine
from shapegcode.program import Program
from shapegcode.settings.keys import toml
from shapegcode.studies.distributions import Listed
from shapegcode.studies.replay import CONTOURS, DEFAULT_MEASURES, SHARE, DrawsJob, Replay, checked_measures, play_all
from shapegcode.studies.result import Bins, MachineStudy, RefusedDraws, VariedKey
from shapegcode.studies.summary import bins_of, check_probability, decides, interval_of, quantity, within
from shapegcode.studies.varied import Columns, Varied, Vary, drawn, drawn_machine, varied_values
from shapegcode.verdict.ahead import cores

Progress = Callable[[str, float], None]


def study(
    program: Program | str | Path,
    machine: Machine | str | Path,
    vary: Vary,
    *,
    n: int = 1000,
    sampling: str = "sobol",
    measure: Sequence[str] = DEFAULT_MEASURES,
    seed: int = 0,
    indices: bool = False,
    at_least: float = 0.95,
    shape_all: bool = False,
    scheduler: Cluster | str | None = None,
    on_progress: Progress = lambda _stage, _share: None,
) -> MachineStudy:
    """Play a program on machines whose values are drawn, and say how likely it stays within tolerance.

    The text is converted once, for the machine file. A mode, a drive, a filter, a time of `vary` is that of the machine
    that plays it. A value that only the converter reads, or one that is `known`, gives a text for each of its values.

    >>> sg.study("part.nc", machine, {"axes.x.modes.1.frequency_hz": sg.normal(46, 2)}, n=10_000)

    Args:
        program: what is played, or its file.
        machine: as its file has it.
        vary: what each key is drawn from: `normal`, `lognormal`, `uniform`, or a list of values. Modes count from 1.
        n: how many draws.
        sampling: "sobol", "lhs" (latin hypercube) or "grid".
        measure: what is measured, see `shapegcode.studies.replay.MEASURES`.
        seed: the same one gives the same draws.
        indices: Sobol indices by SALib; draws are then Saltelli's design, at most `n`.
        at_least: probability of staying within tolerance that is asked for.
        shape_all: see `convert`.
        scheduler: Dask's address, or a `Cluster`; "local": one of this machine; None: threads of this process.
        on_progress: called with what is being done, and the share of it that is done.

    Returns:
        Quantiles, probability, what decides; `to_xarray()` has every draw.

    Raises:
        ArgumentError: nothing to vary, n below 1, another sampling or measure, or nothing that could be played.
        MachineError: a key that there is none, or a draw that a machine file could not have: key, value, limit.
        ProgramError: the program cannot be read.
        OSError: its file cannot be read.
    """
    machine = Machine.of(machine)
    check_probability("at_least", at_least)
    wanted = checked_measures(measure)
    varied = varied_values(machine, vary)
    columns = drawn(varied, n, sampling, seed, indices=indices)
    check_ends(machine, varied, columns)
    if isinstance(program, Program):
        program.require_machine(machine)
    source = str(program) if isinstance(program, Path) else program
    cluster = Cluster(scheduler) if isinstance(scheduler, str) else scheduler
    with contextlib.ExitStack() as stack:
        pool = None if cluster is None else stack.enter_context(cluster_executor(cluster, cores()))[0]
        run = _StudyRun(source, machine, varied, columns, wanted, pool, shape_all, on_progress)
        texts = run.play()
    return _result(run, texts, sampling, seed, at_least, indices=indices)


def check_ends(machine: Machine, varied: Sequence[Varied], columns: Columns) -> None:
    """Make the machines with the lowest and the highest value of each key, before anything is converted."""
    for each, column in zip(varied, columns, strict=True):
        if isinstance(each.distribution, Listed):
            ends = {toml(value): index for index, value in enumerate(column)}.values()
        else:
            numbers = np.asarray(column, dtype=float)
            ends = {"low": int(numbers.argmin()), "high": int(numbers.argmax())}.values()
        for index in ends:
            row = {one.key: values[index] for one, values in zip(varied, columns, strict=True)}
            drawn_machine(machine, row, f"{machine.name}, draw {index + 1}")


@dataclass(frozen=True)
class _Text:
    """A text and its draws; without one the reason."""

    draws: tuple[int, ...]
    values: Mapping[str, object]
    replay: Replay | None
    why: str = ""


class _StudyRun:
    """A study under way."""

    def __init__(
        self, program: Program | str, machine: Machine, varied: Sequence[Varied], columns: Columns,
        wanted: tuple[str, ...], pool: Executor | None, shape_all: bool, on_progress: Progress,
    ) -> None:  # fmt: skip
        self.program, self.machine, self.varied, self.columns = program, machine, varied, columns
        self.wanted, self.pool, self.shape_all, self.on_progress = wanted, pool, shape_all, on_progress
        self.count = len(columns[0])
        self.measured = np.full((self.count, len(wanted)), np.nan)
        self.nominal: dict[str, float] = {}

    @property
    def name(self) -> str:
        """Of the program."""
        return self.program.source if isinstance(self.program, Program) else self.program

    def play(self) -> list[_Text]:
        """Convert each text and play its draws."""
        groups: dict[str, list[int]] = {}
        rows = [self._row(index, known=True) for index in range(self.count)]
        for index, row in enumerate(rows):
            groups.setdefault(toml(row), []).append(index)
        texts, done = [], 0
        for draws in groups.values():
            self.on_progress("converting", done / self.count)
            text = self._text(tuple(draws), rows[draws[0]])
            if text.replay is not None:
                self._play(text, done)
            done += len(draws)
            texts.append(text)
        self._play_nominal(texts)
        return texts

    def _row(self, index: int, *, known: bool) -> dict[str, object]:
        return {
            each.key: column[index]
            for each, column in zip(self.varied, self.columns, strict=True)
            if each.known == known
        }

    def _text(self, draws: tuple[int, ...], values: Mapping[str, object]) -> _Text:
        machine = drawn_machine(self.machine, values, f"{self.machine.name}, draw {draws[0] + 1}")
        try:
            return _Text(draws, values, Replay.of(self.program, machine, shape_all=self.shape_all))
        except (ArgumentError, DesignError) as error:
            if not values:
                raise  # there is no other text
            return _Text(draws, values, None, str(error))

    def _play(self, text: _Text, before: int) -> None:
        assert text.replay is not None
        job = DrawsJob(
            self.machine.name,
            tuple(self._row(index, known=False) for index in text.draws),
            tuple(index + 1 for index in text.draws),
            self.wanted,
            any(each.changes_times and not each.known for each in self.varied),
        )
        done = before

        def tell(more: int) -> None:
            nonlocal done
            done += more
            self.on_progress("playing", done / self.count)

        self.measured[list(text.draws)] = play_all(text.replay, job, self.pool, tell)

    def _play_nominal(self, texts: Sequence[_Text]) -> None:
        """The text for the machine file on that machine."""
        try:
            held = next((text.replay for text in texts if not text.values), None)
            replay = held or Replay.of(self.program, self.machine, shape_all=self.shape_all)
        except (ArgumentError, DesignError, MachineError):
            self.nominal = dict.fromkeys(self.wanted, float("nan"))
            return
        self.nominal = replay.play(self.machine, self.wanted, times=False)


def _result(
    run: _StudyRun, texts: Sequence[_Text], sampling: str, seed: int, at_least: float, *, indices: bool
) -> MachineStudy:
    kept = np.flatnonzero(~np.isnan(run.measured[:, run.wanted.index(SHARE)]))
    refused = [text for text in texts if text.replay is None]
    if len(kept) == 0:
        raise ArgumentError(f"no sample could be simulated: {refused[0].why}")
    columns = [[column[index] for index in kept] for column in run.columns]
    measured = {name: run.measured[kept, rank] for rank, name in enumerate(run.wanted)}
    shares = measured[SHARE]
    # A draw without a text is none that stays within tolerance.
    good = int(within(shares).sum())
    whole = indices and not refused
    warnings = [f"{run.count - len(kept)} of {run.count} draws have no text: they count as out of tolerance"]
    warnings += ["no Sobol indices: they need every draw"] if indices else []
    alone = CONTOURS.isdisjoint(run.wanted)
    said = ["no contour is measured: within tolerance means its residual vibration alone"] if alone else []
    replays = [text.replay for text in texts if text.replay is not None]
    return MachineStudy(
        program=run.name,
        machine=run.machine.name,
        sampling=sampling,
        seed=seed,
        n=len(kept),
        conversions=len(texts),
        varied=tuple(
            VariedKey(each.key, each.value, each.unit, each.distribution.words, each.known) for each in run.varied
        ),
        within=good / run.count,
        within_interval=interval_of(good, run.count),
        at_least=at_least,
        quantities=tuple(quantity(name, values, run.nominal[name]) for name, values in measured.items()),
        decides=decides(run.varied, columns, measured, indices=whole, seed=seed),
        curves=tuple(
            Bins(each.key, name, bins_of(each, column, values), not isinstance(each.distribution, Listed))
            for each, column in zip(run.varied, columns, strict=True)
            for name, values in measured.items()
        ),
        refused=tuple(RefusedDraws(toml(dict(text.values)), len(text.draws), text.why) for text in refused),
        warnings=(*said, *(warnings if refused else ())),
        limits_um={
            "residual_um": min(replay.residual_limit_um for replay in replays),
            "contour_um": min(replay.contour_limit_um for replay in replays),
        },
        draws={each.key: np.array(column) for each, column in zip(run.varied, columns, strict=True)} | measured,
    )
