"""Chooses values, such as block period, family, tolerance and feed on arcs, for the shortest program that stays within
tolerance with a given probability.

All combinations are converted if there are not too many; else those that SciPy's differential evolution selects.
"""

from __future__ import annotations

import contextlib
import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from shapegcode.errors import ArgumentError, DesignError, MachineError
from shapegcode.io.units import FloatArray
from shapegcode.machine import Machine
from shapegcode.machine.programs import ANY_PRICE
from shapegcode.program import Program
from shapegcode.settings.keys import toml
from shapegcode.studies import varied as varying
from shapegcode.studies.replay import SHARE, Replay, SamplesJob, simulate_all
from shapegcode.studies.result import Candidate, ChosenValue, Optimum
from shapegcode.studies.study import check_ends, check_probability, within

USUAL_DRAWS = 256  # Default number of machines per combination
USUAL_CONVERSIONS = 300  # Default maximum of conversions

_FRESH = 4  # new samples that confirm a choice, per earlier sample: the best of many may be best by chance
_UNLIKELY_S = 1e6  # cost of a candidate with too low a probability, above any cycle time
_NO_TEXT_S = 1e9


def optimize(
    program: Program | str | Path,
    machine: Machine | str | Path,
    vary: varying.Vary,
    *,
    choose: Choices | None = None,
    probability: float = 0.95,
    n: int = USUAL_DRAWS,
    most: int = USUAL_CONVERSIONS,
    seed: int = 0,
    shape_all: bool = False,
    on_progress: Callable[[float], None] = lambda _share: None,
) -> Optimum:
    """Choose the settings with the shortest time among those that keep the tolerance with the required probability.

    By default these are block period, family, planned tolerance and arc feed.

    >>> found = sg.optimize("part.nc", machine, {"axes.x.modes.1.frequency_hz": sg.normal(46, 2)}, probability=0.99)
    >>> sg.convert("part.nc", machine.with_values(found.values))

    Args:
        program: the program to convert, or its file.
        machine: the machine; its tolerances decide, whatever tolerance a combination is planned for.
        vary: uncertain values of the simulated machine, as for `study`.
        choose: values to choose from, by key; None: see `shapegcode.studies.optimize.usual_choices`.
        probability: required probability of staying within tolerance.
        n: machines on which a combination is simulated; four times as many new ones confirm it.
        most: maximum number of combinations to convert.
        seed: equal seeds give equal results.
        shape_all: see `convert`.
        on_progress: called with the finished fraction of the conversions.

    Returns:
        The settings, and the converted combinations.

    Raises:
        ArgumentError: a probability outside 0 to 1, nothing to vary or to choose, or varying a value that is `known`
            to the converter.
        MachineError: an unknown key, or a sampled value that is invalid in a machine file.
        ProgramError: the program cannot be read.
        OSError: its file cannot be read.
    """
    machine = Machine.of(machine)
    check_probability("probability", probability)
    if isinstance(most, bool) or not isinstance(most, int) or most < 1:
        raise ArgumentError(f"most = {most!r}: must be a whole number of conversions, 1 or more")
    varied = varying.varied_values(machine, vary)
    choices = checked_choices(usual_choices(machine) if choose is None else choose, [each.key for each in varied])
    for each in varied:
        if each.known:
            raise ArgumentError(f"vary: {each.key}: the converter reads it: put it into choose")
    samples = [varying.sampled_columns(varied, n, "sobol", seed, indices=False)]
    if n > (largest := varying.MAX_DRAWS // _FRESH):
        raise ArgumentError(f"n = {n}: must be at most {largest}: {_FRESH} times as many confirm a choice")
    samples.append(varying.sampled_columns(varied, _FRESH * n, "sobol", seed + 1, indices=False))
    keys, rows = [each.key for each in varied], []
    for columns in samples:
        check_ends(machine, varied, columns)
        rows.append(tuple(dict(zip(keys, row, strict=True)) for row in zip(*columns, strict=True)))
    _check_values(machine, choices)
    if isinstance(program, Program):
        program.require_machine(machine)
    source = str(program) if isinstance(program, Path) else program
    combinations = math.prod(len(values) for values in choices.values())
    run = _Choosing(
        source, machine, choices, rows, probability, shape_all,
        lambda finished: on_progress(min(1.0, finished / min(most, combinations))),
    )  # fmt: skip
    for ranks in search(choices, most, seed, run.cost):
        run.converted(ranks)
    best = run.best()
    name = program.source if isinstance(program, Program) else str(program)
    ranked = sorted(run.candidates.values(), key=lambda each: math.inf if each.time_s is None else each.time_s)
    return Optimum(name, machine.name, probability, n, best, run.as_it_is(), tuple(ranked), combinations)


def _check_values(machine: Machine, choices: Choices) -> None:
    """Refuse a key with only invalid values; other invalid combinations are candidates without a program."""
    for key, values in choices.items():
        problems = []
        for value in values:
            try:
                varying.sampled_machine(machine, {key: value}, "choose")
            except MachineError as wrong:
                problems.append(wrong)
        if problems and len(problems) == len(values):
            raise problems[0]


class _Choosing:
    def __init__(
        self, program: Program | str, machine: Machine, choices: Choices,
        rows: Sequence[tuple[Mapping[str, object], ...]], probability: float, shape_all: bool,
        on_conversion: Callable[[int], None],
    ) -> None:  # fmt: skip
        # No limit on the price: the shortest time is searched for.
        self._program, self._machine, self._choices, self._rows = program, machine.with_values(ANY_PRICE), choices, rows
        self._probability, self._shape_all, self._on_conversion = probability, shape_all, on_conversion
        self._replays: dict[Ranks, Replay] = {}
        self.candidates: dict[Ranks, Candidate] = {}

    def converted(self, ranks: Ranks) -> Candidate:
        if ranks not in self.candidates:
            values = {key: among[rank] for (key, among), rank in zip(self._choices.items(), ranks, strict=True)}
            chosen = tuple(ChosenValue(key, toml(value)) for key, value in values.items())
            try:
                machine = varying.sampled_machine(self._machine, values, "choose")
                replay = Replay.of(self._program, machine, self._machine, shape_all=self._shape_all, is_whole=True)
                self._replays[ranks] = replay
                self.candidates[ranks] = Candidate(chosen, replay.time_s)
            except (ArgumentError, DesignError, MachineError) as no_text:
                self.candidates[ranks] = Candidate(chosen, None, why=str(no_text))
            self._on_conversion(len(self.candidates))
        return self.candidates[ranks]

    def _share(self, replay: Replay, which: int) -> float:
        rows = self._rows[which]
        numbers = tuple(range(1, len(rows) + 1))
        job = SamplesJob(self._machine.name, rows, numbers, (SHARE,), times=False)
        return float(within(np.array(simulate_all(replay, job, None))).mean())

    def simulated(self, ranks: Ranks) -> Candidate:
        """A candidate with its probability; if that is high enough, also the probability on new samples."""
        found = self.converted(ranks)
        if found.time_s is not None and found.within is None:
            share = self._share(self._replays[ranks], 0)
            checked = self._share(self._replays[ranks], 1) if share >= self._probability else None
            self.candidates[ranks] = found = replace(found, within=share, checked=checked)
        return found

    def cost(self, ranks: Ranks) -> float:
        """Cost for the evolution: cycle time, much larger if the probability is too low."""
        found = self.converted(ranks)
        if found.time_s is None:
            return _NO_TEXT_S
        share = self._share(self._replays[ranks], 0)
        return found.time_s if share >= self._probability else _UNLIKELY_S * (1.0 + self._probability - share)

    def best(self) -> Candidate | None:
        """The shortest candidate with enough probability; longer ones are not simulated."""
        order = sorted((each.time_s, ranks) for ranks, each in self.candidates.items() if each.time_s is not None)
        candidates = (self.simulated(ranks) for _, ranks in order)
        return next((each for each in candidates if (each.checked or 0.0) >= self._probability), None)

    def as_it_is(self) -> Candidate | None:
        try:
            replay = Replay.of(self._program, self._machine, shape_all=self._shape_all)
        except (ArgumentError, DesignError):
            return None
        return Candidate((), replay.time_s, self._share(replay, 0), self._share(replay, 1))


Choices = Mapping[str, Sequence[object]]  # values to choose from, by key of the machine file
Ranks = tuple[int, ...]


def usual_choices(machine: Machine) -> dict[str, tuple[object, ...]]:
    """Default choices: block period, family, planned tolerance, and arc feed."""
    controller = machine.controller
    least = max(1, math.ceil(controller.block_time_s / controller.interpolation_period_s - 1e-6))
    ticks = sorted({least, least + 1, least + 2, math.ceil(1.5 * least), 2 * least})
    return {
        "emission.block_period_s": tuple(round(each * controller.interpolation_period_s, 12) for each in ticks),
        "shaping.family": ("auto", "zv", "mzv", "zvd", "ei", "ei2"),
        "tolerance.contour_um": tuple(share * machine.tolerance.contour_um for share in (1.0, 0.75, 0.5)),
        "shaping.arc_feed_ratio": (1.0, 0.9, 0.8),
    }


def checked_choices(choices: Choices, varied: Sequence[str]) -> Choices:
    """Validate the choices."""
    if not choices:
        raise ArgumentError("choose: nothing to choose: give a list of values for one key or more")
    varying.check_keys("choose", choices)
    checked = {}
    for key, values in choices.items():
        try:
            checked[key] = varying.listed(values).values
        except ArgumentError:
            raise ArgumentError(f"choose: {key} = {values!r}: must be a list of one value or more") from None
        if key in varied:
            raise ArgumentError(f"choose: {key}: it is sampled (vary): a value is either sampled or chosen")
    return checked


class _EnoughError(Exception):
    """The maximum number of conversions is reached."""


def search(choices: Choices, most: int, seed: int, cost: Callable[[Ranks], float]) -> Iterator[Ranks]:
    """Yield combinations to convert: all of them, or those tried by differential evolution."""
    from scipy.optimize import Bounds, differential_evolution

    sizes = [len(values) for values in choices.values()]
    if math.prod(sizes) <= most:
        yield from itertools.product(*(range(size) for size in sizes))
        return
    known: dict[Ranks, float] = {}

    def asked(point: FloatArray) -> float:
        ranks = tuple(round(each) for each in point)
        if ranks not in known:
            if len(known) >= most:
                raise _EnoughError
            known[ranks] = cost(ranks)
        return known[ranks]

    bounds = Bounds(np.zeros(len(sizes)), np.array(sizes) - 1.0)
    with contextlib.suppress(_EnoughError):
        differential_evolution(
            asked, bounds, integrality=np.ones(len(sizes), dtype=bool), popsize=12, maxiter=most, tol=0.0,
            polish=False, rng=np.random.default_rng(seed), x0=np.zeros(len(sizes)),
        )  # fmt: skip
    yield from known
